"""The joints of a fleet, numbered: whose each row of a dataset is."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.arrays import Array

_EPOCH = np.datetime64("1970-01-01", "us")
_DAY = np.timedelta64(1, "D")


@dataclass(frozen=True, slots=True, kw_only=True)
class Roster:
    """Every joint of a dataset once."""

    joint: NDArray[np.intp]
    """Number of the joint of each row, (rows,)."""
    unit: NDArray[np.intp]
    """Number of the unit of each row, (rows,)."""
    day: Array
    """Of each row's session, days, (rows,)."""
    usable: NDArray[np.bool_]
    """Which rows have a value that findings may rest on, (rows,)."""
    table: pd.DataFrame
    """A row per joint, in the order of their numbers: unit, joint, type, sessions, latest, file."""


def named_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of which it is known whose and of when they are; a failure may lack any of these."""
    known = frame[["unit", "joint", "session"]].notna().all(axis=1)
    return frame if known.all() else frame[known].reset_index(drop=True)


def roster(frame: pd.DataFrame) -> Roster:
    """The joints of a dataset all of whose rows are named. A joint has the type of its last row that is not left out."""
    unit = frame["unit"].astype("category").cat.codes.to_numpy(np.intp)
    name = frame["joint"].astype("category").cat.codes.to_numpy(np.intp)
    pairs = unit * (int(name.max(initial=0)) + 1) + name
    _, first, joint = np.unique(pairs, return_index=True, return_inverse=True)
    day = (frame["session"].to_numpy("datetime64[us]") - _EPOCH) / _DAY
    kept = frame["left_out"].isna().to_numpy()
    table = pd.DataFrame({key: frame[key].astype(str).to_numpy()[first] for key in ("unit", "joint")})
    last = pd.DataFrame({"joint": joint, "day": np.where(kept, day, -np.inf)}).sort_values(
        ["joint", "day"], kind="stable"
    )
    rows = last.drop_duplicates("joint", keep="last").index.to_numpy()
    table["type"] = frame["type"].astype(str).to_numpy()[rows]
    sessions = pd.DataFrame({"joint": joint, "day": day})[kept].drop_duplicates().groupby("joint").size()
    table["sessions"] = sessions.reindex(range(len(table)), fill_value=0).to_numpy(int)
    table["latest"] = frame["session"].to_numpy("datetime64[us]")[rows]
    table["file"] = frame["file"].astype(str).to_numpy()[rows]
    return Roster(joint=joint.astype(np.intp), unit=unit.astype(np.intp), day=day, usable=_usable(frame), table=table)


def _usable(frame: pd.DataFrame) -> NDArray[np.bool_]:
    """With a value and an error, and nothing critical said of it, in a session that is not left out."""
    value, error = (frame[name].to_numpy(float) for name in ("value", "standard_error"))
    known = np.isfinite(value) & np.isfinite(error) & (error > 0) & (frame["severity"] != "critical").to_numpy()
    usable: NDArray[np.bool_] = known & (frame["failure"].isna() & frame["left_out"].isna()).to_numpy(bool)
    return usable
