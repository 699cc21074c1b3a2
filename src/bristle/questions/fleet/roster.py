"""The joints of a fleet, numbered: whose each row of a dataset is.

A joint has a number for each of its baselines: a session with the tag `baseline` begins a new one.
"""

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.arrays import Array

_EPOCH = np.datetime64("1970-01-01", "us")
_DAY = np.timedelta64(1, "D")
_BEGINS = re.compile(r"(?:^|[\s,;])baseline(?=$|[\s,;])", re.IGNORECASE)
"""Among the tags of a session, a word of its own: that its joint begins anew with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Roster:
    """Every joint of a dataset, once for each of its baselines."""

    joint: NDArray[np.intp]  # number of the joint of each row, (rows,)
    unit: NDArray[np.intp]  # number of the unit of each row, (rows,)
    day: Array  # of each row's session, days, (rows,)
    usable: NDArray[np.bool_]  # which rows have a value that findings may rest on, (rows,)
    table: pd.DataFrame
    """A row per joint, in the order of their numbers: unit, joint, type, sessions, first, latest, file, now (whether no later baseline began)."""


def named_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of which it is known whose and of when they are; a failure may lack any of these."""
    known = frame[["unit", "joint", "session"]].notna().all(axis=1)
    return frame if known.all() else frame[known].reset_index(drop=True)


def roster(frame: pd.DataFrame, whole: pd.DataFrame) -> Roster:
    """The joints of the named rows of a whole dataset. A joint has the type of its last row that is not left out.

    A failed session of which no joint is known begins all joints of its unit anew, or those of its type, where it is marked.
    """
    unit = frame["unit"].astype("category").cat.codes.to_numpy(np.intp)
    name = frame["joint"].astype("category").cat.codes.to_numpy(np.intp)
    pairs = unit * (int(name.max(initial=0)) + 1) + name
    day = (frame["session"].to_numpy("datetime64[us]") - _EPOCH) / _DAY
    kept = frame["left_out"].isna().to_numpy()
    marks = [pd.DataFrame({"pair": pairs, "day": day, "marked": _marked(frame["tags"]) & kept})]
    # Marks of sessions of which no joint is known, for each joint of their unit, and of their type where it is given.
    unknown = whole[whole["joint"].isna() & whole["unit"].notna() & whole["session"].notna()]
    unknown = unknown[_marked(unknown["tags"])]
    if len(unknown):
        known = pd.DataFrame({"unit": frame["unit"].astype(str), "type": frame["type"].astype(str), "pair": pairs})
        days = (unknown["session"].to_numpy("datetime64[us]") - _EPOCH) / _DAY
        names = unknown[["type"]].assign(unit=unknown["unit"].astype(str), day=days)
        both = names.merge(known.drop_duplicates(), on="unit", suffixes=("_asked", ""))
        asked = both["type_asked"]
        own = asked.isna() | (asked.astype(str) == both["type"])
        marks.append(both.loc[own, ["pair", "day"]].assign(marked=True))
    marked = pd.concat(marks)
    begun = np.zeros(pairs.size, dtype=np.intp)
    if marked["marked"].any():  # one of successive marked sessions is the baseline's first
        sessions = marked.groupby(["pair", "day"])["marked"].any()
        before = sessions.groupby("pair").shift(fill_value=False)
        count = (sessions & ~before).groupby("pair").cumsum()
        begun = np.asarray(count.reindex(pd.MultiIndex.from_arrays([pairs, day])), dtype=np.intp)
    most = int(begun.max(initial=0)) + 1
    every, first, joint = np.unique(pairs * most + begun, return_index=True, return_inverse=True)
    table = pd.DataFrame({key: frame[key].astype(str).to_numpy()[first] for key in ("unit", "joint")})
    last = pd.DataFrame({"joint": joint, "day": np.where(kept, day, -np.inf)})
    rows = last.sort_values(["joint", "day"], kind="stable").drop_duplicates("joint", keep="last").index.to_numpy()
    table["type"] = frame["type"].astype(str).to_numpy()[rows]
    seen = pd.DataFrame({"joint": joint, "session": frame["session"]})[kept]
    visits = seen.drop_duplicates().groupby("joint")["session"]
    table["sessions"] = visits.size().reindex(range(len(table)), fill_value=0).to_numpy(int)
    table["first"] = visits.min().reindex(range(len(table))).to_numpy("datetime64[us]")
    table["latest"] = frame["session"].to_numpy("datetime64[us]")[rows]
    table["file"] = frame["file"].astype(str).to_numpy()[rows]
    table["now"] = ~np.isin(every + 1, every) | (every % most == most - 1)
    # With a value and an error, and nothing critical said of it, in a session that is not left out.
    value, error = (frame[name].to_numpy(float) for name in ("value", "standard_error"))
    usable = np.isfinite(value) & np.isfinite(error) & (error > 0) & (frame["severity"] != "critical").to_numpy()
    usable = usable & (frame["failure"].isna() & frame["left_out"].isna()).to_numpy(bool)
    return Roster(joint=joint.astype(np.intp), unit=unit.astype(np.intp), day=day, usable=usable, table=table)


def _marked(tags: "pd.Series[str]") -> NDArray[np.bool_]:
    """Which tags begin a joint anew, (rows,)."""
    text = tags.astype("category")
    begins = np.array([_BEGINS.search(str(tag)) is not None for tag in text.cat.categories], dtype=bool)
    return np.append(begins, False)[text.cat.codes]
