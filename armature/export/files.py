"""Write motions and designs in the format that was asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path

import numpy as np
import yaml

from armature.export.designs import design_columns
from armature.export.motion_columns import motion_arrays, motion_columns
from armature.export.ros import joint_names, joint_trajectory
from armature.export.tables import write_csv, write_parquet
from shared.contracts.results import DesignsAnswer, Trajectory


class Format(StrEnum):
    """Formats of files."""

    CSV = "csv"
    PARQUET = "parquet"
    NPZ = "npz"
    ROS_JSON = "ros-json"
    ROS_YAML = "ros-yaml"

    @property
    def suffix(self) -> str:
        """What the file's name ends with."""
        return {Format.ROS_JSON: ".json", Format.ROS_YAML: ".yaml"}.get(self, f".{self.value}")


TABULAR = (Format.CSV, Format.PARQUET)
"""Formats that designs can be written in."""


def write_motion(motion: Trajectory, path: Path, kind: Format, names: Sequence[str] | None = None) -> None:
    """Write one motion.

    Parameters
    ----------
    names
        Of the joints, for ROS and NPZ.
    """
    match kind:
        case Format.CSV:
            write_csv(motion_columns(motion), path)
        case Format.PARQUET:
            write_parquet(motion_columns(motion), path)
        case Format.NPZ:
            named = joint_names(len(motion.joint_position_rad[0])) if names is None else list(names)
            np.savez(path, allow_pickle=False, joint_names=np.array(named), **motion_arrays(motion))
        case Format.ROS_JSON:
            path.write_text(json.dumps(joint_trajectory(motion, names), indent=1) + "\n", encoding="utf-8")
        case Format.ROS_YAML:
            text = yaml.safe_dump(joint_trajectory(motion, names), sort_keys=False, default_flow_style=None, width=1000)
            path.write_text(text, encoding="utf-8")


def write_designs(designs: DesignsAnswer, path: Path, kind: Format) -> None:
    """Write every design as one table, CSV or Parquet."""
    write = write_csv if kind is Format.CSV else write_parquet
    write(design_columns(designs), path)
