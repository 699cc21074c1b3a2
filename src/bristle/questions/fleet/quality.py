"""The quality of a fleet's data over time, by the kinds of warnings: so that a failing sensor is not called wear."""

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.diagnostics import Kind
from bristle.questions.fleet.roster import Roster

FAILED = "failed"
"""The code of a session that was not identified."""
_SEVERITY = {kind.code: str(kind.severity) for kind in Kind} | {FAILED: "critical"}
BY_CHANCE = 0.05
"""How likely a warning is in these sessions of a joint and not in those, at the rate of the other joints, for it to be named new."""
_PERIODS = ((31, "D"), (366, "W-MON"), (np.inf, "MS"))
"""Days that the sessions cover, up to which a period is a day, a week, a month."""


def codes_of(frame: pd.DataFrame) -> pd.DataFrame:
    """Which warnings each joint session has, once each: unit, joint, session, code."""
    said = frame["warnings"].astype("category")
    words = [str(x).split() for x in said.cat.categories]
    code = said.cat.codes.to_numpy()
    length = np.array([*map(len, words), 0])  # the last one is of no text
    count, begin = length[code], (length.cumsum() - length)[code]
    rows = np.repeat(np.arange(len(frame)), count)
    place = np.repeat(begin - (count.cumsum() - count), count) + np.arange(rows.size)
    text: NDArray[np.object_] = np.array([word for listed in words for word in listed], dtype=object)[place]
    warned = frame.iloc[rows][["unit", "joint", "session"]].assign(code=text)
    failed = frame[frame["failure"].notna()][["unit", "joint", "session"]].assign(code=FAILED)
    return pd.concat([warned, failed]).drop_duplicates()


def quality(frame: pd.DataFrame) -> pd.DataFrame:
    """How many joint sessions have each code in each period, 0 included: period, code, severity, joint_sessions, of, percent."""
    columns = ["period", "code", "severity", "joint_sessions", "of", "percent"]
    every = frame[["unit", "joint", "session"]].drop_duplicates()
    every, found = every[every["session"].notna()], codes_of(frame)
    if every.empty:
        return pd.DataFrame(columns=columns)
    days = (every["session"].max() - every["session"].min()).days
    rule = next(name for most, name in _PERIODS if days <= most)
    of = every.groupby(_period(every["session"], rule)).size()
    found = found[found["session"].notna()].assign(period=lambda x: _period(x["session"], rule))
    every_one = pd.MultiIndex.from_product([of.index, sorted(found["code"].unique())], names=["period", "code"])
    count = found.groupby(["period", "code"]).size().reindex(every_one, fill_value=0)
    counts = count.rename("joint_sessions").reset_index()
    counts["severity"] = counts["code"].map(lambda code: _SEVERITY.get(code, "caution"))
    counts["of"] = counts["period"].map(of)
    counts["percent"] = 100 * counts["joint_sessions"] / counts["of"]
    return counts.sort_values(["period", "code"], ignore_index=True)[columns]


def _period(session: "pd.Series[Any]", rule: str) -> "pd.Series[Any]":
    """The start of the period that each session is in."""
    start: pd.Series[Any] = session.dt.to_period({"D": "D", "W-MON": "W-SUN", "MS": "M"}[rule]).dt.start_time
    return start


def failures(frame: pd.DataFrame) -> pd.DataFrame:
    """Sessions without a result, and those that findings leave out, each with its sentence: unit, joint, session, file, failure."""
    said = frame["failure"].astype(object).where(frame["failure"].notna(), frame["left_out"].astype(object))
    rows = frame.assign(failure=said)[said.notna()]
    return rows[["unit", "joint", "session", "file", "failure"]].drop_duplicates(ignore_index=True)


def new_warnings(frame: pd.DataFrame, people: Roster, since: Mapping[int, pd.Timestamp]) -> dict[int, str]:
    """Codes of each joint, by its number, that most sessions since a time have and none before had, joined by a space.

    Not those that other joints have so often that this is chance (`BY_CHANCE`).
    """
    if not since:
        return {}
    keys = ["unit", "joint"]
    changed = people.table.loc[list(since), keys]
    numbers = dict(zip(zip(changed["unit"], changed["joint"], strict=True), changed.index, strict=True))
    found, every = codes_of(frame), frame[[*keys, "session"]].drop_duplicates()
    total, of_code = len(every), dict(found["code"].value_counts())
    found, every = (x[pd.MultiIndex.from_frame(x[keys].astype(str)).isin(list(numbers))] for x in (found, every))
    sessions = dict(iter(every.groupby(keys, observed=True)["session"]))
    begun: dict[int, list[str]] = {number: [] for number in since}
    for (unit, joint, code), group in found.groupby([*keys, "code"], observed=True)["session"]:
        number, own = numbers[str(unit), str(joint)], sessions[unit, joint]
        after, before = int((own >= since[number]).sum()), int((own < since[number]).sum())
        rate = (of_code[code] - len(group)) / max(total - len(own), 1)
        chance = rate ** len(group) * (1 - rate) ** before
        if (group >= since[number]).all() and len(group) > after / 2 and chance < BY_CHANCE:
            begun[number].append(str(code))
    return {number: " ".join(sorted(codes)) for number, codes in begun.items()}


def critical(codes: "pd.Series[Any]") -> Iterator[str]:
    """Those of some codes that are critical."""
    return (str(code) for code in codes if _SEVERITY.get(code) == "critical")


def most_common(codes: Iterator[str], count: int = 3) -> tuple[str, ...]:
    """The most frequent of some codes."""
    return tuple(code for code, _ in Counter(codes).most_common(count))
