"""The joints of a fleet, numbered, one number per baseline: a session with the tag `baseline` begins a new one."""

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.arrays import Array

_EPOCH = np.datetime64("1970-01-01", "us")
_DAY = np.timedelta64(1, "D")
_BEGINS = re.compile(r"(?:^|[\s,;])baseline(?=$|[\s,;])", re.IGNORECASE)  # among the tags of a session


@dataclass(frozen=True, slots=True, kw_only=True)
class Roster:
    """Every joint of a dataset, once per baseline."""

    joint: NDArray[np.intp]  # number of the joint of each row, (rows,)
    unit: NDArray[np.intp]  # number of the unit of each row, (rows,)
    day: Array  # of each row's session, days, (rows,)
    usable: NDArray[np.bool_]  # rows whose values the findings use, (rows,)
    table: pd.DataFrame
    """By number of the joint: unit, joint, type, sessions, first, latest, file, now (whether no later baseline began)."""


def named_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows with unit, joint and session."""
    known = frame[["unit", "joint", "session"]].notna().all(axis=1)
    return frame if known.all() else frame[known].reset_index(drop=True)


def roster(frame: pd.DataFrame, whole: pd.DataFrame) -> Roster:
    """The joints of the named rows of a whole dataset; the type of a joint is that of its last row that is not left out.

    A marked session without a known joint begins new baselines of all joints of its unit, or of its type.
    """
    unit = frame["unit"].astype("category").cat.codes.to_numpy(np.intp)
    name = frame["joint"].astype("category").cat.codes.to_numpy(np.intp)
    pairs = unit * (int(name.max(initial=0)) + 1) + name
    day = (frame["session"].to_numpy("datetime64[us]") - _EPOCH) / _DAY
    kept = frame["left_out"].isna().to_numpy()
    marks = [pd.DataFrame({"pair": pairs, "day": day, "marked": _marked(frame["tags"]) & kept})]
    # Marks of sessions without a known joint, for each joint of their unit, and of their type where it is given.
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
    if marked["marked"].any():  # the first of successive marked sessions begins the baseline
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
    # Usable: with a value and an error, without a critical warning, in a session that is not left out.
    value, error = (frame[name].to_numpy(float) for name in ("value", "standard_error"))
    usable = np.isfinite(value) & np.isfinite(error) & (error > 0) & (frame["severity"] != "critical").to_numpy()
    usable = usable & (frame["failure"].isna() & frame["left_out"].isna()).to_numpy(bool)
    return Roster(joint=joint.astype(np.intp), unit=unit.astype(np.intp), day=day, usable=usable, table=table)


def _marked(tags: "pd.Series[str]") -> NDArray[np.bool_]:
    """Rows whose tags begin a new baseline, (rows,)."""
    text = tags.astype("category")
    begins = np.array([_BEGINS.search(str(tag)) is not None for tag in text.cat.categories], dtype=bool)
    return np.append(begins, False)[text.cat.codes]
