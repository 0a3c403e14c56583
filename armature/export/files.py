"""Write motions and designs in the format that was asked for; a file is written whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path

import numpy as np
import yaml

from armature.export.designs import design_columns
from armature.export.motion_columns import joint_columns, joint_names, motion_arrays, motion_columns
from armature.export.ros import joint_trajectory
from armature.export.tables import write_csv, write_parquet
from armature.whole_files import whole_file
from shared.contracts.comparisons import DesignsAnswer
from shared.contracts.motions import Trajectory


class Format(StrEnum):
    """Formats of files."""

    CSV = "csv"
    PARQUET = "parquet"
    NPZ = "npz"
    JOINT_CSV = "joint-csv"
    ROS_JSON = "ros-json"
    ROS_YAML = "ros-yaml"

    @property
    def suffix(self) -> str:
        """What the file's name ends with."""
        others = {Format.JOINT_CSV: ".joints.csv", Format.ROS_JSON: ".json", Format.ROS_YAML: ".yaml"}
        return others.get(self, f".{self.value}")


TABULAR = (Format.CSV, Format.PARQUET)
"""Formats that designs can be written in."""


def write_motion(motion: Trajectory, path: Path, kind: Format, names: Sequence[str] | None = None) -> None:
    """Write one motion.

    Parameters
    ----------
    names
        Of the joints, for ROS, NPZ and `joint-csv`.

    Raises
    ------
    ValueError
        There are more or fewer names than joints.
    """
    named = joint_names(motion, names)
    with whole_file(path) as part:
        match kind:
            case Format.CSV:
                write_csv(motion_columns(motion), part)
            case Format.PARQUET:
                write_parquet(motion_columns(motion), part)
            case Format.NPZ:
                np.savez(part, allow_pickle=False, joint_names=np.array(named), **motion_arrays(motion))
            case Format.JOINT_CSV:
                write_csv(joint_columns(motion, named), part)
            case Format.ROS_JSON:
                part.write_text(json.dumps(joint_trajectory(motion, named), indent=1) + "\n", encoding="utf-8")
            case Format.ROS_YAML:
                message = joint_trajectory(motion, named)
                text = yaml.safe_dump(message, sort_keys=False, default_flow_style=None, width=1000)
                part.write_text(text, encoding="utf-8")


def write_designs(designs: DesignsAnswer, path: Path, kind: Format) -> None:
    """Write every design as one table, CSV or Parquet."""
    write = write_csv if kind is Format.CSV else write_parquet
    with whole_file(path) as part:
        write(design_columns(designs), part)
