"""Every estimate of a joint as rows of one tidy table, with the stage that it comes from; and which of them to use."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bristle.identification.results import Estimate, Joint
from bristle.model.parameters import Lugre
from bristle.page.wording import split
from bristle.questions.joint_report.dynamic import fits

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "doubts", "source")
_DIRECTIONS = ("+", "-", "both", "shared")


class Found(NamedTuple):
    """One parameter of one direction from one stage."""

    source: str
    """`static`, `presliding`, `tracking` (moving runs alone) or `joint` (moving runs with what the other stages say)."""
    direction: str
    parameter: str
    estimate: Estimate


def to_frame(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction, parameter and source: value, unit, standard_error, lower, upper, doubts (joined by `; `).

    What does not exist is nan; a bound that is open is infinite. Where anything but the static fits was found, a last column `source` says
    which stage a row comes from: `static`, `presliding`, and `joint` (all runs at once) or, without a joint fit, `tracking` (the moving runs alone).
    """
    frame = estimates(joints)
    return frame if (frame["source"] != "static").any() else frame.drop(columns="source")


def estimates(joints: Sequence[Joint]) -> "pd.DataFrame":
    """The rows of `to_frame`, `source` included whatever was found."""
    return _framed((joint, found) for joint in joints for found in (*_of_stages(joint), *_of_moving(joint)))


def identified(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction and parameter: from the joint fit where that knows it, else the moving runs, else its own stage."""
    return _framed((joint, found) for joint in joints for found in chosen(joint))


def chosen(joint: Joint) -> list[Found]:
    """The estimate to use of each parameter, direction by direction, in the order of `Lugre`; what is shared comes last.

    One that has no value stands for itself only where no stage has one.
    """
    found: dict[tuple[str, str], Found] = {}
    for source in reversed(fits(joint)):
        for row in _of_fit(joint, source):
            _keep(found, row)
    for row in _of_stages(joint):
        if not _is_known(found, row):
            _keep(found, row)
    return sorted(found.values(), key=_place)


def _keep(found: dict[tuple[str, str], Found], row: Found) -> None:
    key = row.direction, row.parameter
    if key not in found or (found[key].estimate.value is None and row.estimate.value is not None):
        found[key] = row


def _is_known(found: dict[tuple[str, str], Found], row: Found) -> bool:
    """Whether a fit of moving runs has a value of the parameter: of its direction, of both together, or of each."""
    known = {d for (d, name), x in found.items() if name == row.parameter and x.source in {"tracking", "joint"}}
    known = {d for d in known if found[d, row.parameter].estimate.value is not None}
    return bool(known & {row.direction, "both", "shared"}) or known >= {"+", "-"}


def _place(row: Found) -> tuple[int, int]:
    order = Lugre._fields
    return (
        _DIRECTIONS.index(row.direction) if row.direction in _DIRECTIONS else len(_DIRECTIONS),
        order.index(row.parameter) if row.parameter in order else len(order),
    )


def _of_stages(joint: Joint) -> Iterator[Found]:
    """The static parameters of each direction, then its sigma_0 by the recommended method and its sigma_1."""
    slow = joint.presliding.fits if joint.presliding else {}
    for d in dict.fromkeys((*joint.static, *slow)):
        if d in joint.static:
            yield from (Found("static", d, name, e) for name, e in joint.static[d].parameters.items())
        if d in slow:
            yield Found("presliding", d, "sigma_0", slow[d].sigma_0)
            yield Found("presliding", d, "sigma_1", slow[d].sigma_1)


def _of_moving(joint: Joint) -> Iterator[Found]:
    """The joint fit where there is one, else that of the moving runs alone."""
    for source in list(fits(joint))[-1:]:
        yield from _of_fit(joint, source)


def _of_fit(joint: Joint, source: str) -> Iterator[Found]:
    yield from (Found(source, *split(name), e) for name, e in fits(joint)[source].parameters.items())


def _framed(rows: Iterable[tuple[Joint, Found]]) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame([_row(joint.name, *found) for joint, found in rows], columns=list(COLUMNS))


def _row(joint: str, source: str, direction: str, parameter: str, e: Estimate) -> tuple[object, ...]:
    lower, upper = (math.nan, math.nan) if e.interval is None else e.interval
    value, error = (math.nan if x is None else x for x in (e.value, e.standard_error))
    return joint, direction, parameter, value, e.unit, error, lower, upper, "; ".join(map(str, e.doubts)), source


def with_truth(frame: "pd.DataFrame", joints: Sequence[Joint], place: int) -> "pd.DataFrame":
    """The frame with true, error_percent and inside (the interval holds the truth) inserted as its columns from `place` on.

    `frame` has joint, direction, parameter, value, lower and upper. What is not known is nan; `inside` is None there.
    """
    import numpy as np

    frame = frame.copy()
    true = [true_value(joints, row.joint, row.direction, row.parameter) for row in frame.itertuples()]
    frame.insert(place, "true", np.array(true, dtype=float))
    frame.insert(place + 1, "error_percent", 100 * (frame["value"] - frame["true"]) / frame["true"])
    known = frame[["true", "lower", "upper"]].notna().all(axis=1)
    inside = (frame["lower"] <= frame["true"]) & (frame["true"] <= frame["upper"])
    frame.insert(place + 2, "inside", inside.astype(object).where(known, None))
    return frame


def true_value(joints: Sequence[Joint], joint: Any, direction: Any, parameter: Any) -> float:
    """The true value; nan where it is not known. A truth of both directions is that of each."""
    given = next((j.truth for j in joints if j.name == joint), {})
    truth = given.get(direction, given.get("both"))
    return float(getattr(truth, parameter)) if truth is not None and parameter in Lugre._fields else math.nan
