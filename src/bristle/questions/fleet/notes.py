"""What must be said of the findings of a fleet, as diagnostics."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from bristle.diagnostics import Kind
from bristle.findings import Finding, Severity
from bristle.model.parameters import Direction, ParameterName
from bristle.questions.fleet.changes import beyond_errors
from bristle.questions.fleet.quality import codes_of, critical, most_common
from bristle.questions.fleet.quantities import LEAST_FREEDOM, Adjusted
from bristle.questions.fleet.roster import Roster

_FEW = 10.0
"""Degrees of freedom below which the scatter between sessions is said to rest on few."""
_NAMED = 5
"""Steps that a sentence names."""


def headline(joints: pd.DataFrame, rate: float) -> Finding:
    """How many joints changed, and which the most clearly; `joints` are ranked."""
    tested, changed = joints["adjusted_p"].notna(), joints[joints["changed"]]
    if not tested.any():
        return Kind.FLEET_UNTESTED()
    if changed.empty:
        return Kind.FLEET_UNCHANGED(tested=int(tested.sum()), rate=100 * rate)
    first = _step(changed.iloc[0])
    more = Kind.AND_JOINTS(count=len(changed) - 1) if len(changed) > 1 else ""
    return Kind.FLEET_CHANGED(changed=len(changed), tested=int(tested.sum()), rate=100 * rate, first=first, more=more)


def notes(
    frame: pd.DataFrame, every: Sequence[Adjusted], joints: pd.DataFrame, left_out: Sequence[Finding], baseline: int
) -> tuple[Finding, ...]:
    """All that is to be said, cautions first.

    Args:
        frame: the dataset.
        every: the quantities.
        joints: ranked.
        left_out: what was said of values and types already.
        baseline: sessions before the first that may be changed.
    """
    said = [
        *_shifts(every), *_warned(joints), *left_out, *_few(every), *_untested(joints, baseline), *_sessions(frame),
        *_critical(frame),
    ]  # fmt: skip  # a list of values
    return tuple(sorted(said, key=lambda x: list(Severity).index(x.severity)))


def anew(people: Roster) -> Iterator[Finding]:
    """The joints that a tag begins anew."""
    every = people.table
    again = every[every["now"] & every.duplicated(["unit", "joint"], keep=False) & every["first"].notna()]
    if len(again):
        last = again.sort_values("first", kind="stable").iloc[-1]
        yield Kind.BASELINES_BEGUN(
            count=len(again), joint=f"{last['unit']} {last['joint']}", since=f"{last['first']:%Y-%m-%d}"
        )


def _shifts(every: Sequence[Adjusted]) -> Iterator[Finding]:
    """The shifts common to a type, of all its parameters in one sentence."""
    shifted = [x for x in every if x.knots.size]
    for type_ in dict.fromkeys(x.of.key.type for x in shifted):
        own = [x for x in shifted if x.of.key.type == type_]
        yield Kind.COMMON_SHIFT(
            names=tuple(str(ParameterName(x.of.key.parameter, Direction(x.of.key.direction))) for x in own),
            joints=max(int(x.of.now.sum()) for x in own),
            type=type_,
            percent=max((float(y) for x in own for y in x.of.percent(x.shift)), key=abs),
            cause=Kind.SHIFT_LOGGED() if any("temperature" in x.of.names for x in own) else Kind.SHIFT_UNLOGGED(),
        )


def _warned(joints: pd.DataFrame) -> Iterator[Finding]:
    said = joints.loc[joints["changed"] & (joints["new_warnings"] != ""), "new_warnings"]
    if len(said):
        yield Kind.WARNED_SINCE(count=len(said), codes=most_common(code for x in said for code in x.split()))


def _few(every: Sequence[Adjusted]) -> Iterator[Finding]:
    """The types whose scatter rests on few differences, once each."""
    told: dict[str, int] = {}
    for x in every:
        if LEAST_FREEDOM <= x.fit.freedom < _FEW:
            pairs = int((x.of.joint[1:] == x.of.joint[:-1]).sum())
            told[x.of.key.type] = max(pairs, told.get(x.of.key.type, 0))
    yield from (Kind.SCATTER_OF_FEW(type=type_, count=count) for type_, count in told.items())


def compared(every: Sequence[Adjusted], frame: pd.DataFrame, people: Roster) -> Iterator[Finding]:
    """Of types whose scatter rests on few, what differs by the errors of the estimates alone."""
    few = [x for x in every if x.tested and x.fit.freedom < _FEW]
    rows = beyond_errors(few, frame)
    for type_, own in rows.groupby("type", sort=False):
        head = own.head(_NAMED)
        who = people.table[["unit", "joint"]].iloc[head["number"].to_numpy(int)].to_dict("records")
        told = tuple(_step({**row, **one}) for row, one in zip(head.to_dict("records"), who, strict=True))
        yield Kind.BEYOND_ERRORS(type=str(type_), steps=told, more=_more(len(own) - len(told)))


def _step(row: "Mapping[Hashable, Any] | pd.Series[Any]") -> Finding:
    """One change, with its joint."""
    return Kind.JOINT_CHANGED(
        joint=f"{row['unit']} {row['joint']}",
        name=str(ParameterName(row["parameter"], Direction(row["direction"]))),
        percent=row["percent"],
        since=f"{row['since']:%Y-%m-%d}",
    )


def _more(count: int) -> Finding | str:
    return Kind.MORE_STEPS(count=count) if count else ""


def _untested(joints: pd.DataFrame, baseline: int) -> Iterator[Finding]:
    not_tested = joints[joints["untested"] != ""]
    if not_tested.empty:
        return
    short = int(not_tested["untested"].str.startswith(_SHORT).sum())
    why = []
    if short:
        why.append(Kind.UNTESTED_BY_SESSIONS(count=short, baseline=baseline))
    if len(not_tested) > short:
        why.append(Kind.UNTESTED_BY_SCATTER(count=len(not_tested) - short))
    yield Kind.JOINTS_UNTESTED(count=len(not_tested), why=tuple(why))


_SHORT = "fewer"


def _sessions(frame: pd.DataFrame) -> Iterator[Finding]:
    keys = ["unit", "joint", "session"]
    total = len(frame[keys].drop_duplicates())
    for column in ("failure", "left_out"):
        rows = frame[frame[column].notna()]
        if len(rows):
            count, first = len(rows[keys].drop_duplicates()), str(rows[column].iloc[0])
            yield (
                Kind.SESSIONS_FAILED(failed=count, total=total, first=first)
                if column == "failure"
                else Kind.SESSIONS_LEFT_OUT(count=count, first=first)
            )


def _critical(frame: pd.DataFrame) -> Iterator[Finding]:
    """Values that are not used, and the warnings that they have most often."""
    rows = frame[(frame["severity"] == "critical") & frame["value"].notna()]
    if len(rows):
        yield Kind.VALUES_CRITICAL(count=len(rows), codes=most_common(critical(codes_of(rows)["code"])))
