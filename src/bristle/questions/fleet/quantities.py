"""A parameter in a direction of all joints of a type, adjusted for temperature, load and a shift common to the type.

A value is the joint's level, plus the effects of temperature, load and time on every joint of the type, plus the scatter
of a session, plus its own error: in logarithms where every value is positive, else in units of the type's median.
"""

import re
from dataclasses import dataclass
from math import inf, nan
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.estimation.moderation import normal_errors
from bristle.estimation.robust import RobustFit, differences_of, fit_differences
from bristle.estimation.step_test import Levels

KNOTS = 12  # most knots of the common shift over time
PER_KNOT = 20  # differences between sessions per knot
_FAR = 300.0  # largest logarithm of a value
COVARIATES = ("temperature", "load")
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
    """By number of the joint: unit, joint, type, sessions, first, latest, file, now (without a later baseline)."""


def named_rows(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows with unit, joint and session."""
    known = frame[["unit", "joint", "session"]].notna().all(axis=1)
    return frame if known.all() else frame[known].reset_index(drop=True)


def roster(frame: pd.DataFrame) -> Roster:
    """The joints of the named rows of a dataset; their type is that of their last row."""
    unit = frame["unit"].astype("category").cat.codes.to_numpy(np.intp)
    name = frame["joint"].astype("category").cat.codes.to_numpy(np.intp)
    pairs = unit * (int(name.max(initial=0)) + 1) + name
    day = (frame["session"].to_numpy("datetime64[us]") - _EPOCH) / _DAY
    marked = pd.DataFrame({"pair": pairs, "day": day, "marked": _marked(frame["tags"])})
    begun = np.zeros(pairs.size, dtype=np.intp)
    if marked["marked"].any():  # the first of successive marked sessions begins the baseline
        sessions = marked.groupby(["pair", "day"])["marked"].any()
        before = sessions.groupby("pair").shift(fill_value=False)
        count = (sessions & ~before).groupby("pair").cumsum()
        begun = np.asarray(count.reindex(pd.MultiIndex.from_arrays([pairs, day])), dtype=np.intp)
    most = int(begun.max(initial=0)) + 1
    every, joint = np.unique(pairs * most + begun, return_inverse=True)
    rows = pd.DataFrame({"joint": joint, "session": frame["session"].to_numpy()})
    last = rows.sort_values("session", kind="stable").drop_duplicates("joint", keep="last").sort_values("joint").index
    table = frame.iloc[last][["unit", "joint", "type", "file"]].astype(str).reset_index(drop=True)
    visits = rows.groupby("joint")["session"]
    table = table.assign(sessions=visits.nunique(), first=visits.min(), latest=visits.max())
    table["now"] = ~np.isin(every + 1, every) | (every % most == most - 1)
    # Usable: with a value and an error, without a critical warning.
    value, error = (frame[name].to_numpy(float) for name in ("value", "standard_error"))
    sound = (frame["severity"] != "critical") & frame["failure"].isna()
    usable = np.isfinite(value) & np.isfinite(error) & (error > 0) & sound.to_numpy(bool)
    return Roster(joint=joint.astype(np.intp), unit=unit.astype(np.intp), day=day, usable=usable, table=table)


def _marked(tags: "pd.Series[str]") -> NDArray[np.bool_]:
    """Rows whose tags begin a new baseline, (rows,)."""
    text = tags.astype("category")
    begins = np.array([_BEGINS.search(str(tag)) is not None for tag in text.cat.categories], dtype=bool)
    return np.append(begins, False)[text.cat.codes]


class QuantityKey(NamedTuple):
    """Names of a quantity."""

    type: str
    parameter: str
    direction: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A parameter in a direction, of a type of joints; rows are sorted by joint and session."""

    key: QuantityKey
    rows: NDArray[np.intp]  # indices in the frame, (n,)
    joint: NDArray[np.intp]  # joint of each row, numbered from 0 within the quantity, (n,)
    joints: NDArray[np.intp]  # numbers of the joints in the fleet, (m,)
    now: NDArray[np.bool_]  # whether no later baseline of the joint began, so that it is tested, (m,)
    y: Array  # value on the scale, (n,)
    known: Array  # its variance, (n,)
    scale: float  # unit of the scale, in the parameter's unit; 0: logarithms
    covariates: Array  # minus their medians, nan where not known, (n, c)
    names: tuple[str, ...]  # of the covariates, (c,)
    time: Array  # days since the first session, (n,)
    unit: NDArray[np.intp]  # the unit of each row, (n,)
    value_unit: str

    def shown(self, level: Array) -> Array:
        """Levels on the scale as values in the parameter's unit."""
        return level * self.scale if self.scale else np.exp(np.clip(level, -_FAR, _FAR))

    def percent(self, difference: Array) -> Array:
        """Differences on the scale in percent: of the value before, or of the type's median."""
        return 100 * (difference if self.scale else np.expm1(np.minimum(difference, _FAR)))


def quantity_of(key: QuantityKey, rows: pd.DataFrame, where: NDArray[np.intp], people: Roster) -> Quantity | None:
    """The quantity of some rows, at the indices `where` of the frame; None where its median is not clear of zero."""
    joint, day = people.joint[where], people.day[where]
    order = np.lexsort((day, joint))
    columns = ("value", "standard_error", "lower", "upper")
    value, error, lower, upper = (rows[name].to_numpy(float)[order] for name in columns)
    typical, uncertain = float(np.median(np.abs(value))), float(np.median(error))
    if typical <= levels.CLEAR * uncertain:
        return None
    scale = 0.0 if (value > 0).all() else typical
    one = value if not scale else np.full(value.size, scale)
    y, e = value / scale if scale else np.log(value), normal_errors(error / one, (upper - lower) / 2 / one)
    joints, own = np.unique(joint[order], return_inverse=True)
    covariates = [(name, rows[name].to_numpy(float)[order]) for name in COVARIATES]
    told = [(name, x - np.nanmedian(x)) for name, x in covariates if np.isfinite(x).any() and np.nanstd(x) > 0]
    return Quantity(
        key=key, rows=where[order], joint=own.astype(np.intp), joints=joints.astype(np.intp),
        now=people.table["now"].to_numpy(bool)[joints], y=y, known=e**2, scale=scale,
        covariates=np.stack([x for _, x in told], axis=1) if told else np.zeros((y.size, 0)),
        names=tuple(name for name, _ in told), time=day[order], unit=people.unit[where][order],
        value_unit=str(rows["value_unit"].iloc[0]),
    )  # fmt: skip  # a list of values


@dataclass(frozen=True, slots=True, kw_only=True)
class Adjusted:
    """A quantity without the effects common to its type."""

    of: Quantity
    fit: RobustFit
    regressors: Array  # of the common effects, (n, p)
    known: Array  # variances, with those of unknown covariates, (n,)
    knots: Array  # days, of the piecewise linear common shift, (k,); empty without a shift
    shift_p: float  # p-value of the common shift; nan where it was not tested

    @property
    def y(self) -> Array:
        """The adjusted values, on the scale of the quantity, (n,)."""
        return self.of.y - self.regressors @ self.fit.coefficients

    @property
    def variance(self) -> Array:
        """Variance of each, (n,)."""
        return self.known + self.fit.variance

    @property
    def tested(self) -> bool:
        """Whether the scatter between sessions is known."""
        return self.fit.freedom >= levels.TESTED_FREEDOM and bool((self.variance > 0).all())

    def effect(self, name: str) -> tuple[float, float, float]:
        """The effect of a covariate in percent per K or per unit of load, with its 95 % interval; nan if not known."""
        if name not in self.of.names:
            return nan, nan, nan
        k = self.of.names.index(name)
        error = float(np.sqrt(self.fit.covariance[k, k])) if self.tested else inf
        reach = student(self.fit.freedom_of_coefficients) * error if self.tested else inf
        b = float(self.fit.coefficients[k])
        return 100 * b, 100 * (b - reach), 100 * (b + reach)

    @property
    def shift(self) -> Array:
        """The common shift at the knots, on the scale, (k,): 0 at the first."""
        if not self.knots.size:
            return np.zeros(0)
        return np.concatenate([[0.0], self.fit.coefficients[len(self.of.names) :]])


def adjusted(quantity: Quantity, tests: int) -> Adjusted:
    """The quantity without the effects of temperature and load, and without a significant shift common to its joints.

    A session without temperature is in none of these fits; it gets the median and a larger variance.
    `tests`: quantities of the fleet that are tested for a shift.
    """
    gaps = ~np.isfinite(quantity.covariates)
    covariates = np.where(gaps, 0.0, quantity.covariates)
    told, first = np.asarray(~gaps.any(axis=1), dtype=bool), differences_of(quantity.joint)
    first = first[told[first] & told[first + 1]]
    fit, X = fit_differences(quantity.y, quantity.known, covariates, first, quantity.unit), covariates
    knots, p, most = np.zeros(0), nan, min(KNOTS, first.size // PER_KNOT)
    if (np.bincount(quantity.joint) > 1).sum() >= levels.LEAST_JOINTS and most > 1:
        days = np.unique(np.round(quantity.time))
        knots = days if days.size <= most else np.unique(np.quantile(quantity.time, np.linspace(0, 1, most)))
    if knots.size > 1:
        # Hat functions of the knots but the first, (n, k - 1).
        hats = np.stack([np.interp(quantity.time, knots, row) for row in np.eye(knots.size)[1:]], axis=1)
        both = np.concatenate([covariates, hats], axis=1)
        shifted = fit_differences(quantity.y, quantity.known, both, first, quantity.unit)
        # Wald's test that the coefficients of the shift are zero.
        first_hat = covariates.shape[1]
        b, cov = shifted.coefficients[first_hat:], shifted.covariance[first_hat:, first_hat:]
        free = shifted.freedom_of_coefficients - b.size + 1
        if free >= 1 and np.isfinite(cov).all() and (rank := int(np.linalg.matrix_rank(cov, hermitian=True))):
            statistic = float(b @ np.linalg.pinv(cov, hermitian=True) @ b) / rank * free
            p = float(fdtrc(rank, free, statistic / max(shifted.freedom_of_coefficients, 1.0)))
        if p < levels.RARE / max(tests, 1):
            fit, X = shifted, both
    if X is covariates:
        knots = np.zeros(0)
    spread = np.nanvar(quantity.covariates, axis=0) * fit.coefficients[: gaps.shape[1]] ** 2
    return Adjusted(of=quantity, fit=fit, regressors=X, known=quantity.known + gaps @ spread, knots=knots, shift_p=p)


def padded(one: Adjusted, most: NDArray[np.intp] | None = None) -> Levels:
    """The joints' series, a row each; `most`: number of sessions of each joint, (m,); None: all."""
    joint = one.of.joint
    place = np.arange(joint.size) - np.searchsorted(joint, joint)
    counts = np.bincount(joint)
    shape = (counts.size, int(counts.max()))
    y, variance, X = np.zeros(shape), np.full(shape, inf), np.zeros((*shape, one.regressors.shape[1]))
    y[joint, place], X[joint, place] = one.y, one.regressors
    variance[joint, place] = one.variance if most is None else np.where(place < most[joint], one.variance, inf)
    return Levels(y, variance, X, one.fit.covariance)
