"""Columns as CSV, Parquet and data frames. Numbers keep all their digits."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armature.errors import MissingExtraError

if TYPE_CHECKING:
    import pandas as pd

Columns = Mapping[str, Sequence[Any] | np.ndarray]
"""Name to values, all of one length; the unit is in the name."""


def write_csv(columns: Columns, path: Path) -> None:
    """One line of names, one a row; floats in the shortest form that reads back to the same number."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*map(_plain, columns.values()), strict=True))


def write_parquet(columns: Columns, path: Path) -> None:
    """Parquet, for which the extra `tables` is needed."""
    data_frame(columns).to_parquet(path, index=False)


def data_frame(columns: Columns) -> pd.DataFrame:
    """A pandas data frame.

    Raises
    ------
    MissingExtraError
        pandas is not installed.
    """
    try:
        import pandas as pd
    except ImportError as error:
        raise MissingExtraError("data frames and Parquet", "tables") from error
    return pd.DataFrame(dict(columns))


def _plain(values: Sequence[Any] | np.ndarray) -> list[Any]:
    """Python's numbers: numpy's print their type."""
    return list(values.tolist() if isinstance(values, np.ndarray) else values)
