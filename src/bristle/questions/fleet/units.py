"""Which units differ from their type: random effects, and each unit's own value drawn to the type's mean as far as it is uncertain."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtr

from bristle.arrays import Array
from bristle.estimation.multiple_tests import false_discovery, simes
from bristle.estimation.robust import Population, population, without_each
from bristle.questions.fleet.quantities import Adjusted, padded
from bristle.questions.fleet.roster import Roster

LEAST_UNITS = 5
"""Joints of a type from which on its mean and spread are told."""
MOST_LEFT_OUT = 50
"""Joints of a type up to which each is judged by the others alone: of more one hardly moves the spread."""
_COLUMNS = {
    "unit": "str", "joint": "str", "type": "str", "parameter": "str", "direction": "str", "value_unit": "str", "sessions": "int64",
    "value": "float64", "standard_error": "float64", "percent": "float64", "z": "float64", "adjusted_p": "float64", "outside": "bool",
    "shrunken": "float64", "shrunken_error": "float64", "borrowed_percent": "float64",
}  # fmt: skip  # a table
"""Columns of the units, and their types."""


def own_levels(one: Adjusted, most: NDArray[np.intp]) -> tuple[Array, Array]:
    """Mean of each joint over its first sessions, so many of each, on the scale, and its variance: (m,) each."""
    levels = padded(one, most)
    weight = np.where(np.isfinite(levels.variance), 1 / levels.variance, 0.0)
    total = weight.sum(axis=1)
    return (weight * levels.y).sum(axis=1) / total, 1 / total


def population_of(one: Adjusted, most: NDArray[np.intp]) -> Population[float] | None:
    """Mean and spread of a type; None where it has too few joints."""
    now = one.of.now
    if now.sum() < LEAST_UNITS:
        return None
    level, variance = own_levels(one, most)
    return population(level[now], variance[now])


def unit_rows(
    quantities: Sequence[Adjusted], settled: Sequence[NDArray[np.intp]], people: Roster, rate: float
) -> pd.DataFrame:
    """A row per joint and quantity of the types whose spread is known; `settled`: sessions of each joint before it changed.

    A joint is outside where its own value is beyond what the scatter of the others of its type makes likely, at the false
    discovery rate over all joints, as for changes.
    """
    parts, numbers, ps = [], [], []
    for one, most in zip(quantities, settled, strict=True):
        known = population_of(one, most)
        if known is None:
            continue
        q, now = one.of, one.of.now
        level, variance = (x[now] for x in own_levels(one, most))
        others = without_each(level, variance) if level.size <= MOST_LEFT_OUT else known
        z = (level - others.mean) / np.sqrt(others.variance + variance + others.mean_error**2)
        own = known.variance / (known.variance + variance)
        drawn = known.mean + own * (level - known.mean)
        error = np.sqrt(own * variance + (1 - own) ** 2 * known.mean_error**2)
        shown, near = q.shown(level), q.shown(drawn)
        slope, near_slope = (np.full(level.size, q.scale),) * 2 if q.scale else (shown, near)
        who = people.table.iloc[q.joints[now]]
        parts.append(pd.DataFrame({
            "unit": who["unit"].to_numpy(), "joint": who["joint"].to_numpy(), **q.key._asdict(),
            "value_unit": q.value_unit, "sessions": most[now], "value": shown, "standard_error": np.sqrt(variance) * slope,
            "percent": q.percent(level - known.mean), "z": z, "shrunken": near, "shrunken_error": error * near_slope,
            "borrowed_percent": 100 * (1 - own),
        }))  # fmt: skip  # a table
        numbers.append(q.joints[now])
        ps.append(2 * np.asarray(stdtr(others.freedom, -np.abs(z)), dtype=float))
    if not parts:
        return pd.DataFrame(columns=list(_COLUMNS)).astype(_COLUMNS)
    number, p = np.concatenate(numbers), np.concatenate(ps)
    tested, group = np.unique(number, return_inverse=True)
    adjusted = false_discovery(simes(p, group))[group]
    rows = pd.concat(parts, ignore_index=True)
    share = (np.bincount(group, minlength=tested.size) > 0) & (np.bincount(group, adjusted <= rate) > 0)
    outside = (adjusted <= rate) & (p <= rate * share.mean())
    return rows.assign(adjusted_p=adjusted, outside=outside)[list(_COLUMNS)]
