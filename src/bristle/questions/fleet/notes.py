"""Headline and notes of a fleet's findings."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from bristle.findings import CAUTION, NOTE, Finding, Severity
from bristle.model.parameters import Direction, ParameterName
from bristle.page.wording import counted
from bristle.questions.fleet.changes import beyond_errors
from bristle.questions.fleet.quality import codes_of, most_common, severity
from bristle.questions.fleet.quantities import LEAST_FREEDOM, Adjusted, Roster

_FEW = 10.0  # degrees of freedom below which a note says that the scatter rests on few sessions
_NAMED = 5  # steps that a sentence names


def headline(joints: pd.DataFrame, rate: float) -> Finding:
    """The number of joints that changed, and the clearest of them; `joints` are ranked."""
    tested, changed = joints["adjusted_p"].notna(), joints[joints["changed"]]
    if not tested.any():
        return Finding("fleet-untested", NOTE, "No joint was tested for a change; the notes say why.")
    numbers = {"changed": len(changed), "tested": int(tested.sum()), "rate": 100 * rate}
    at_rate = f"at a false discovery rate of {100 * rate:.3g} %"
    if changed.empty:
        message = f"None of {numbers['tested']} joints changed beyond the scatter between sessions, {at_rate}."
        return Finding("fleet-unchanged", NOTE, message, numbers)
    more = f"; {counted(len(changed) - 1, 'other')} changed as well" if len(changed) > 1 else ""
    message = f"{len(changed)} of {numbers['tested']} joints changed, {at_rate}; the clearest: {_step(changed.iloc[0])}{more}."
    return Finding("fleet-changed", NOTE, message, numbers)


def notes(
    frame: pd.DataFrame, every: Sequence[Adjusted], joints: pd.DataFrame, left_out: Sequence[Finding], baseline: int
) -> tuple[Finding, ...]:
    """Notes on a dataset, its quantities and its ranked joints, cautions first; `left_out`: those on values left out."""
    said = []
    # Shifts common to a type, one sentence for all its parameters.
    shifted = [x for x in every if x.knots.size]
    for type_ in dict.fromkeys(x.of.key.type for x in shifted):
        own = [x for x in shifted if x.of.key.type == type_]
        names = tuple(str(ParameterName(x.of.key.parameter, Direction(x.of.key.direction))) for x in own)
        count = max(int(x.of.now.sum()) for x in own)
        percent = max((float(y) for x in own for y in x.of.percent(x.shift)), key=abs)
        logged = any("temperature" in x.of.names for x in own)
        cause = (
            "Temperature is already corrected for; look for a new lot of grease, new firmware or another torque constant."
            if logged
            else "Temperature is not in the catalog; log it, because it can cause this."
        )
        message = (
            f"{', '.join(names)} of all {count} joints of type {type_} shifted together, by up to {percent:+.2g} %: the cause is "
            f"common to the type. The shift is taken off, and no joint is accused of it. {cause}"
        )
        numbers = {"type": type_, "names": names, "joints": count, "percent": percent, "temperature_logged": logged}
        said.append(Finding("common-shift", CAUTION, message, numbers))

    warned = joints.loc[joints["changed"] & (joints["new_warnings"] != ""), "new_warnings"]
    if len(warned):
        codes = most_common(code for x in warned for code in x.split())
        message = (
            f"{len(warned)} of the joints that changed have warnings since that they did not have before: {', '.join(codes)}. "
            "Look at their logs first; a failing sensor is not wear."
        )
        said.append(Finding("warned-since", CAUTION, message, {"count": len(warned), "codes": codes}))
    said += left_out

    # Types whose scatter rests on few differences.
    few = [x for x in every if LEAST_FREEDOM <= x.fit.freedom < _FEW]
    for type_ in dict.fromkeys(x.of.key.type for x in few):
        count = max(int((x.of.joint[1:] == x.of.joint[:-1]).sum()) for x in few if x.of.key.type == type_)
        message = (
            f"The scatter between sessions of type {type_} rests on {count} pairs of successive sessions, so only large changes "
            "are told from it; more joints of the type, or more sessions, narrow it."
        )
        said.append(Finding("scatter-of-few", CAUTION, message, {"type": type_, "count": count}))

    # Joints that are not tested, and sessions and values that are left out.
    not_tested = joints[joints["untested"] != ""]
    if count := len(not_tested):
        short = int(not_tested["untested"].str.startswith("fewer").sum())
        why = [f"{short} without values in more than {baseline} sessions"] * (short > 0)
        if count > short:
            why.append(f"{count - short} whose type has too few repeated sessions to estimate the scatter between them")
        message = f"Not tested for a change: {counted(count, 'joint')}; {'; '.join(why)}."
        said.append(Finding("joints-untested", NOTE, message, {"count": count, "short": short}))
    keys = ["unit", "joint", "session"]
    total = len(frame[keys].drop_duplicates())
    failed, unused = (frame[frame[column].notna()] for column in ("failure", "left_out"))
    if len(failed):
        count, first = len(failed[keys].drop_duplicates()), failed["failure"].iloc[0]
        message = f"{count} of {counted(total, 'joint session')} without a result; the first: {first}"
        said.append(Finding("sessions-failed", NOTE, message, {"failed": count, "total": total}))
    if len(unused):
        count, first = len(unused[keys].drop_duplicates()), unused["left_out"].iloc[0]
        message = f"{counted(count, 'joint session')} left out of the findings; the first: {first}"
        said.append(Finding("sessions-left-out", NOTE, message, {"count": count}))
    rows = frame[(frame["severity"] == "critical") & frame["value"].notna()]
    if len(rows):
        codes = most_common(str(code) for code in codes_of(rows)["code"] if severity(code) == "critical")
        message = f"{counted(len(rows), 'value')} with a critical warning left out of the findings; the commonest: {', '.join(codes)}."
        said.append(Finding("values-critical", NOTE, message, {"count": len(rows), "codes": codes}))
    return tuple(sorted(said, key=lambda x: list(Severity).index(x.severity)))


def anew(people: Roster) -> Iterator[Finding]:
    """The joints with a new baseline, by a tag."""
    every = people.table
    again = every[every["now"] & every.duplicated(["unit", "joint"], keep=False) & every["first"].notna()]
    if len(again):
        last = again.sort_values("first", kind="stable").iloc[-1]
        message = (
            f"{counted(len(again), 'joint')} began anew at a session tagged baseline; "
            f"the last: {last['unit']} {last['joint']} on {last['first']:%Y-%m-%d}."
        )
        yield Finding("baselines-begun", NOTE, message, {"count": len(again)})


def compared(every: Sequence[Adjusted], frame: pd.DataFrame, people: Roster) -> Iterator[Finding]:
    """Steps by the errors of the estimates alone, of types whose scatter rests on few sessions."""
    few = [x for x in every if x.tested and x.fit.freedom < _FEW]
    rows = beyond_errors(few, frame)
    for type_, own in rows.groupby("type", sort=False):
        head = own.head(_NAMED)
        named = head.join(people.table[["unit", "joint"]], on="number")
        steps = "; ".join(map(_step, named.to_dict("records")))
        more = f", {len(own) - len(head)} more" if len(own) > len(head) else ""
        yield Finding(
            "beyond-errors",
            NOTE,
            f"Type {type_}: by the errors of the estimates alone, as compare judges two sessions, there are steps: {steps}{more}. "
            "Whether they are more than what sessions scatter by is not told from so few.",
            {"type": str(type_), "steps": len(own)},
        )


def _step(row: "Mapping[Hashable, Any] | pd.Series[Any]") -> str:
    name = ParameterName(row["parameter"], Direction(row["direction"]))
    return f"{row['unit']} {row['joint']}, {name} by {row['percent']:+.3g} % since {row['since']:%Y-%m-%d}"
