"""Joints of a fleet that changed, and units that differ from their type.

A step test of every parameter and direction with a false discovery rate over the joints; random effects of a type, with
each unit's value shrunken to the type's mean.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtr

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.estimation.multiple_tests import false_discovery, false_discovery_within, simes
from bristle.estimation.robust import Population, population, without_each
from bristle.estimation.step_test import Levels, Steps, step_scan
from bristle.questions.fleet.quantities import Adjusted, Roster, padded

MOST_LEFT_OUT = 50  # most joints of a type of which each is compared with the others alone
_UNIT_COLUMNS = {
    "unit": "str", "joint": "str", "type": "str", "parameter": "str", "direction": "str", "value_unit": "str", "sessions": "int64",
    "value": "float64", "standard_error": "float64", "percent": "float64", "z": "float64", "adjusted_p": "float64", "outside": "bool",
    "shrunken": "float64", "shrunken_error": "float64", "borrowed_percent": "float64",
}  # fmt: skip  # columns of the units, and their types


class StepTests(NamedTuple):
    """The step tests of one quantity, a joint each."""

    one: Adjusted
    which: NDArray[np.intp]  # indices of the quantity's joints, (t,)
    steps: Steps


def step_tests(one: Adjusted, baseline: int) -> StepTests:
    """The tests of joints with more than `baseline` sessions since their last baseline began."""
    which = np.flatnonzero((np.bincount(one.of.joint) > baseline) & one.of.now)
    rows = padded(one)
    part = Levels(rows.y[which], rows.variance[which], rows.regressors[which], rows.covariance)
    empty = np.zeros(0)
    if not which.size:
        return StepTests(one, which, Steps(which, empty, empty, empty, empty, empty))
    return StepTests(one, which, step_scan(part, baseline, one.fit.freedom))


class Decided(NamedTuple):
    """All t tests of a fleet of m joints, decided at a false discovery rate."""

    joint: NDArray[np.intp]  # number of the joint of each test, (t,)
    p: Array  # (t,)
    z: Array  # (t,)
    named: NDArray[np.bool_]  # whether the parameter of each test changed, (t,)
    adjusted: Array  # p-value of each joint, nan where it was not tested, (m,)
    changed: NDArray[np.bool_]  # (m,)


def decide(tests: Sequence[StepTests], joints: int, rate: float) -> Decided:
    """The joints that changed, and their parameters; `joints`: number of joints of the fleet."""
    number = _joined([x.one.of.joints[x.which] for x in tests]).astype(np.intp)
    p, z = _joined([x.steps.p for x in tests]), _joined([x.steps.z for x in tests])
    adjusted, changed, named = np.full(joints, np.nan), np.zeros(joints, dtype=bool), np.zeros(p.size, dtype=bool)
    if p.size:
        own, group = np.unique(number, return_inverse=True)
        adjusted[own] = false_discovery(simes(p, group))
        changed[own] = adjusted[own] <= rate
        share = changed.sum() / own.size
        named = changed[number] & (false_discovery_within(p, group) <= rate * share)
    return Decided(number, p, z, named, adjusted, changed)


def _joined(parts: Sequence[Array | NDArray[np.intp]]) -> Array:
    return np.concatenate([np.zeros(0), *parts])


def change_rows(tests: Sequence[StepTests], decided: Decided, frame: pd.DataFrame) -> pd.DataFrame:
    """A row per test, with the number of its joint."""
    parts = []
    for one, which, steps in tests:
        q, counts = one.of, np.bincount(one.of.joint)
        row = q.rows[np.searchsorted(q.joint, which) + steps.after]
        reach = student(one.fit.freedom) * steps.error
        parts.append(pd.DataFrame({
            **q.key._asdict(), "sessions": counts[which], "value_unit": q.value_unit,
            "before": q.shown(steps.before), "after": q.shown(steps.before + steps.size), "percent": q.percent(steps.size),
            "percent_lower": q.percent(steps.size - reach), "percent_upper": q.percent(steps.size + reach),
            "since": frame["session"].to_numpy()[row], "sessions_after": counts[which] - steps.after,
        }))  # fmt: skip  # a table
    rows = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(_COLUMNS)).astype(_COLUMNS)
    return rows.assign(number=decided.joint, z=decided.z, p=decided.p, changed=decided.named)


_COLUMNS = {
    "type": "str", "parameter": "str", "direction": "str", "sessions": "int64", "value_unit": "str", "before": "float64", "after": "float64",
    "percent": "float64", "percent_lower": "float64", "percent_upper": "float64", "since": "datetime64[us]", "sessions_after": "int64",
}  # fmt: skip  # columns of the tests, and their types


def ranked(people: Roster, changes: pd.DataFrame, decided: Decided) -> pd.DataFrame:
    """A row per joint with its clearest test, by p-value; the index is the number of its last baseline."""
    first = changes.assign(size=-changes["z"].abs()).sort_values(["number", "p", "size"], kind="stable")
    first = first.drop_duplicates("number").set_index("number")
    own = [
        "parameter", "direction", "percent", "percent_lower", "percent_upper", "since", "sessions_after", "p", "size",
    ]  # fmt: skip  # a list of names
    table = people.table.join(first[own])
    table = table.assign(adjusted_p=decided.adjusted, changed=decided.changed)[people.table["now"]]
    table = table.sort_values(["adjusted_p", "p", "size", "unit", "joint"], kind="stable", na_position="last")
    return table.assign(rank=np.arange(1, len(table) + 1)).drop(columns=["p", "size"])


def own_levels(one: Adjusted, most: NDArray[np.intp]) -> tuple[Array, Array]:
    """Mean of each joint over its first `most` sessions, on the scale, and its variance: (m,) each."""
    rows = padded(one, most)
    weight = np.where(np.isfinite(rows.variance), 1 / rows.variance, 0.0)
    total = weight.sum(axis=1)
    return (weight * rows.y).sum(axis=1) / total, 1 / total


def population_of(one: Adjusted, most: NDArray[np.intp]) -> Population[float] | None:
    """Mean and spread of a type; None with too few joints."""
    now = one.of.now
    if now.sum() < levels.SEVERAL:
        return None
    level, variance = own_levels(one, most)
    return population(level[now], variance[now])


def unit_rows(
    quantities: Sequence[Adjusted], settled: Sequence[NDArray[np.intp]], people: Roster, rate: float
) -> pd.DataFrame:
    """A row per joint and quantity of types with a known spread; `settled`: sessions before a joint's change."""
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
        return pd.DataFrame(columns=list(_UNIT_COLUMNS)).astype(_UNIT_COLUMNS)
    number, p = np.concatenate(numbers), np.concatenate(ps)
    tested, group = np.unique(number, return_inverse=True)
    adjusted = false_discovery(simes(p, group))[group]
    rows = pd.concat(parts, ignore_index=True)
    share = (np.bincount(group, minlength=tested.size) > 0) & (np.bincount(group, adjusted <= rate) > 0)
    outside = (adjusted <= rate) & (p <= rate * share.mean())
    return rows.assign(adjusted_p=adjusted, outside=outside)[list(_UNIT_COLUMNS)]
