"""Every estimate of a joint as rows of one tidy table, with the stage that it comes from; and those to use."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from bristle.identification.known_joint import Known, chosen, moving_estimates, moving_fits, stage_estimates
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, Lugre

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "warnings", "source")


def to_frame(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction, parameter and source: value, unit, standard_error, lower, upper, warnings (joined by `; `).

    What does not exist is nan; a bound that is open is infinite. Where anything but the static fits was found, a last column `source` says
    which stage a row comes from: `static`, `presliding`, and `joint` (all runs at once) or, without a joint fit, `tracking` (the moving runs alone).
    """
    frame = estimates(joints)
    return frame if (frame["source"] != "static").any() else frame.drop(columns="source")


def estimates(joints: Sequence[Joint]) -> "pd.DataFrame":
    """The rows of `to_frame`, `source` included whatever was found."""
    return _framed((joint, row) for joint in joints for row in (*stage_estimates(joint), *_best_of_moving(joint)))


def identified(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction and parameter, as `known_joint.chosen` has them."""
    return _framed((joint, row) for joint in joints for row in chosen(joint))


def _best_of_moving(joint: Joint) -> Iterable[Known]:
    """The joint fit where there is one, else that of the moving runs alone."""
    return (row for source in list(moving_fits(joint))[-1:] for row in moving_estimates(joint, source))


def _framed(rows: Iterable[tuple[Joint, Known]]) -> "pd.DataFrame":
    import pandas as pd

    return pd.DataFrame([_row(joint.name, row) for joint, row in rows], columns=list(COLUMNS))


def _row(joint: str, row: Known) -> tuple[object, ...]:
    e, (name, direction) = row.estimate, row.parameter
    lower, upper = (math.nan, math.nan) if e.interval is None else e.interval
    value, error = (math.nan if x is None else x for x in (e.value, e.standard_error))
    warnings = "; ".join(map(str, e.warnings))
    return joint, str(direction), name, value, e.unit, error, lower, upper, warnings, str(row.source)


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
    truth = given.get(direction, given.get(Direction.BOTH))
    return float(getattr(truth, parameter)) if truth is not None and parameter in Lugre._fields else math.nan
