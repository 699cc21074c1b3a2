"""Results as tables: each function makes one DataFrame, which the page shows and `tables/*.csv` holds."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import wraps
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bristle.identification.comparison import Comparison
from bristle.identification.fits import Estimate, PreslidingFit, RunScatter, StaticFit, TrackingFit, Uncertainty
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName, unit
from bristle.page.plain import in_unit
from bristle.page.wording import MISSING, pretty, span
from bristle.questions.joint_report.results_file import declared, estimates, identified
from bristle.questions.joint_report.sentences import methods, pair

WAYS = ("covariance", "profile", "bootstrap")
"""In which an interval is found."""
_Rows = Iterator[tuple[Any, ...]]
_Maker = Callable[[Sequence[Joint]], pd.DataFrame]


def _table(columns: str) -> Callable[[Callable[[Joint], _Rows]], _Maker]:
    """Makes of what gives the rows of one joint the table of several, the joint's name first.

    A column of numbers is marked by a #, one of true and false by a ?: it is of these, whatever is missing in it.
    """
    names, kinds = columns.replace("#", "").replace("?", "").split(), {"#": float, "?": bool}
    dtypes = {name[:-1]: kinds[name[-1]] for name in columns.split() if name[-1] in kinds}

    def of(rows: Callable[[Joint], _Rows]) -> _Maker:
        @wraps(rows)
        def made(joints: Sequence[Joint]) -> pd.DataFrame:
            """The table."""
            found = [(joint.name, *row) for joint in joints for row in rows(joint)]
            return pd.DataFrame(found, columns=["joint", *names]).astype(dtypes)

        return made

    return of


def parameters(joints: Sequence[Joint]) -> pd.DataFrame:
    """Every stage's parameters with their intervals; for simulated data also true, error_percent and inside (the interval holds the truth)."""
    return with_truth(estimates(joints), joints)


@_table("file rows dropped sha256 labels notes")
def inputs(joint: Joint) -> _Rows:
    """One row per file: rows, dropped, sha256, labels, notes."""
    for x in joint.inputs:
        yield x.file, x.rows, x.dropped, x.sha256, _labels(x.labels), " ".join(map(str, x.notes))


@_table("file where start stop velocity torque standard_error# accepted? stick_slip? reasons warnings labels")
def segments(joint: Joint) -> _Rows:
    """One row per candidate segment: where, velocity, torque, standard error, accepted, stick_slip, reasons, warnings.

    `where` is its place in the file; `start` and `stop` are its first sample and one past the last, from 0.
    """
    own = attrgetter("file", "where", "start", "stop", "velocity", "torque", "standard_error", "accepted", "stick_slip")
    for s in joint.segments:
        yield *own(s), *(" ".join(map(str, x)) for x in (s.reasons, s.warnings)), _labels(s.labels)


def _labels(labels: Any) -> str:
    return ", ".join(f"{name} {value}" for name, value in labels.items())


@_table("direction parameter grid# full# difference_in_se#")
def crosscheck(joint: Joint) -> _Rows:
    """One row per parameter: the full nonlinear fit's value, the grid's, and their difference in standard errors."""
    for d, check in joint.crosscheck.items():
        for name, full in check.parameters.items():
            # What is shared belongs to a fit of its own only where two directions share it.
            fit = joint.static.get(name.direction) or joint.static.get(d)
            e = None if fit is None else fit.parameters.get(name.name)
            yield d, name.within(d), None if e is None else e.value, full, check.difference_in_se.get(name)


@_table("fit file relative_error# relative_error_of_fit#")
def hold_out(joint: Joint) -> _Rows:
    """One row per fit and hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    fits: list[tuple[str, StaticFit | TrackingFit]] = [*joint.static.items(), *moving_fits(joint).items()]
    for name, fit in fits:
        yield from ((name, x.file, x.relative_error, fit.relative_error) for x in fit.hold_out)


def presliding(joints: Sequence[Joint]) -> pd.DataFrame:
    """sigma_0 by each method, side by side, with the truth where the data are simulated."""
    frame = declared(_presliding(joints)).assign(parameter="sigma_0")
    return with_truth(frame, joints).drop(columns="parameter")


@_table("direction method value# unit standard_error# systematic# lower# upper#")
def _presliding(joint: Joint) -> _Rows:
    for d, fit in _slow_fits(joint).items():
        for method, e in methods(fit).items():
            yield d, method, *_known(e)


def _known(e: Estimate) -> tuple[Any, ...]:
    """Value, unit, standard error, systematic error, and the ends of the interval."""
    return e.value, e.unit, e.standard_error, e.systematic, *(e.interval or (None, None))


def _slow_fits(joint: Joint) -> Mapping[str, PreslidingFit]:
    return joint.presliding.fits if joint.presliding else {}


@_table("file start stop torque_amplitude displacement_amplitude loss secant# slope# inverse_slope# counts")
def hysteresis(joint: Joint) -> _Rows:
    """One row per closed cycle: where, half the ranges of torque and displacement, work lost, secant, slope, inverse slope, counts."""
    ranges = ("torque_amplitude", "displacement_amplitude", "loss")
    own = attrgetter("file", "start", "stop", *ranges, "secant", "slope", "inverse_slope", "counts")
    yield from map(own, joint.presliding.loops if joint.presliding else ())


@_table("direction file start breakaway from_median_percent")
def breakaway(joint: Joint) -> _Rows:
    """One row per loading that broke away: where it began, its torque, and how far that is from the median of its direction, percent."""
    slow = joint.presliding
    for x in slow.breakaways if slow else ():
        median = slow.breakaway[x.direction].value if slow and x.direction in slow.breakaway else None
        off = 100 * (x.breakaway / median - 1) if x.breakaway is not None and median else np.nan
        yield x.direction, x.file, x.start, x.breakaway, off


@_table("direction velocity torque residual time position")
def points(joint: Joint) -> _Rows:
    """What was fitted: velocity, torque, residual, time and position of every point, in SI units."""
    for d, fit in joint.static.items():
        signals = (fit.velocity, fit.torque, fit.residuals, fit.time, fit.position)
        none = np.full(fit.velocity.size, np.nan)
        known = [x if x.size == fit.velocity.size else none for x in signals]
        yield from ((d, *row) for row in np.column_stack(known).tolist())


_SIDE_BY_SIDE = "data name parameters rms# relative_error# bic# left_out# candidate? chosen?"


def _compared(comparisons: Sequence[Comparison]) -> _Rows:
    own = attrgetter(*_SIDE_BY_SIDE.replace("#", "").replace("?", "").split()[1:])
    yield from ((x.data, *own(row)) for x in comparisons for row in x.rows)


@_table(_SIDE_BY_SIDE)
def models(joint: Joint) -> _Rows:
    """One row per joint, data and model: parameters, rms, relative error, BIC above the lowest, which to use."""
    yield from _compared(joint.models)


@_table(_SIDE_BY_SIDE)
def laws(joint: Joint) -> _Rows:
    """The same of friction laws, with the error at speeds left out."""
    yield from _compared([joint.laws] if joint.laws else [])


def table_1(joints: Sequence[Joint]) -> pd.DataFrame:
    """All parameters per direction, as in the paper's Table 1, each by the stage to use, with the truth where the data are simulated."""
    frame = with_truth(identified(joints), joints)
    frame.insert(len(frame.columns) - 2, "source", frame.pop("source"))
    return frame


def tracking(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter, with the truth where the data are simulated, and what encoder counts had added."""
    return with_truth(declared(_tracking(joints)), joints)


@_table("fit direction parameter value# unit standard_error# systematic# lower# upper# count_bias#")
def _tracking(joint: Joint) -> _Rows:
    for kind, d, name, e, fit, n in _fitted(joint):
        if kind in moving_fits(joint):
            yield kind, d, name, *_known(e), fit.count_bias.get(n)


@_table(
    "direction parameter stage stage_value# stage_error# tracking_value# tracking_error# joint_value# joint_error# unit "
    "difference_in_se# verdict"
)
def consistency(joint: Joint) -> _Rows:
    """One row per parameter that a stage of its own knows: that stage, the moving runs, the joint fit, and what follows."""
    errors = "stage_value", "stage_error", "tracking_value", "tracking_error", "joint_value", "joint_error"
    own = attrgetter("parameter.direction", "parameter.name", "stage", *errors)
    for x in joint.consistency:
        yield *own(x), unit(x.parameter.name, joint.kind), x.difference_in_se, x.verdict


def with_truth(frame: pd.DataFrame, joints: Sequence[Joint]) -> pd.DataFrame:
    """The frame with true, error_percent and inside (the interval holds the truth) inserted as columns behind `upper`.

    `frame` has joint, direction, parameter, value, lower and upper. What is not known is nan; `inside` is None there.
    """
    frame, place = frame.copy(), list(frame.columns).index("upper") + 1
    truths, true = {joint.name: joint.truth for joint in joints}, []
    for name, d, parameter in frame[["joint", "direction", "parameter"]].itertuples(index=False, name=None):
        of_joint = truths.get(name, {})
        truth = of_joint.get(d, of_joint.get(Direction.BOTH))  # a truth of both directions is that of each
        known = truth is not None and parameter in truth._fields
        true.append(float(getattr(truth, parameter)) if known else math.nan)
    frame.insert(place, "true", np.array(true, dtype=float))
    frame.insert(place + 1, "error_percent", 100 * (frame["value"] - frame["true"]) / frame["true"])
    told = frame[["true", "lower", "upper"]].notna().all(axis=1)
    inside = (frame["lower"] <= frame["true"]) & (frame["true"] <= frame["upper"])
    frame.insert(place + 2, "inside", inside.astype(object).where(told, None))
    return frame


def rounded(frame: pd.DataFrame) -> pd.DataFrame:
    """Estimates as the page shows them: value ± standard error with its unit and the 95 % interval, to two digits of the error."""
    numbers = frame[["value", "standard_error", "lower", "upper"]].itertuples(index=False, name=None)
    systematic = frame.get("systematic", pd.Series(np.nan, frame.index))
    shown = []
    for (value, error, low, high), unit_, constants in zip(numbers, frame["unit"], systematic, strict=True):
        own = Estimate(
            value=value, unit=unit_, standard_error=error, systematic=None if np.isnan(constants) else constants
        )
        known = in_unit(pair(own), pretty(unit_)) if not np.isnan(value) else MISSING
        shown.append((known, span(None if np.isnan([low, high]).any() else (low, high))))
    gone = ["standard_error", "systematic", "lower", "unit", "warnings", "source"]
    frame = frame.assign(value=[x for x, _ in shown], upper=[x for _, x in shown])
    source = frame.get("source")
    part = frame.drop(columns=gone, errors="ignore").rename(columns={"upper": "95 % interval"})
    return part if source is None else part.assign(source=source)


class IntervalRow(NamedTuple):
    """One parameter of one fit."""

    fit: str
    """`static`, `presliding`, `tracking` or `joint`."""
    direction: str
    parameter: str
    estimate: Estimate
    three: Uncertainty

    @property
    def name(self) -> str:
        """The parameter with its direction, as alpha_0+."""
        return str(ParameterName(self.parameter, Direction(self.direction)))


def _fitted(joint: Joint) -> Iterator[tuple[str, str, str, Estimate, Any, Any]]:
    """Fit, direction, parameter and estimate of every fit; then the fit itself, and what it calls the parameter."""
    for d, static in joint.static.items():
        yield from (("static", d, name, e, static, name) for name, e in static.parameters.items())
    for d, slow in _slow_fits(joint).items():
        yield "presliding", d, "sigma_0", slow.sigma_0, slow, "sigma_0"
    for kind, moving in moving_fits(joint).items():
        yield from ((kind, n.direction, n.name, e, moving, n) for n, e in moving.parameters.items())


def interval_rows(joint: Joint) -> Iterator[IntervalRow]:
    """Every parameter whose interval is known three ways, fit by fit."""
    for kind, d, parameter, e, fit, name in _fitted(joint):
        if name in fit.uncertainty:
            yield IntervalRow(kind, d, parameter, e, fit.uncertainty[name])


@_table(
    "fit direction parameter value# unit covariance_lower# covariance_upper# profile_lower# profile_upper# bootstrap_lower# "
    "bootstrap_upper# warnings"
)
def uncertainty(joint: Joint) -> _Rows:
    """One row per fit and parameter: the value, and lower and upper end by each way; nan where a way has none."""
    for x in interval_rows(joint):
        ends = (end for way in WAYS for end in getattr(x.three, way) or (None, None))
        warnings = " ".join(map(str, x.three.warnings))
        yield x.fit, x.direction, x.parameter, x.estimate.value, x.estimate.unit, *ends, warnings


@_table("fit direction parameter file value# before# widened#")
def repeats(joint: Joint) -> _Rows:
    """One row per fit, parameter and run that was fitted apart: its estimate, and the scatter of all of them.

    `before` is sqrt(chi2_red) before widening, `widened` what the standard error is multiplied by.
    """
    for *of, x in scatter(joint):
        yield from ((*of, file, value, x.before, x.widened) for file, value in x.by_run.items())


def scatter(joint: Joint) -> Iterator[tuple[str, str, str, RunScatter]]:
    """Fit, direction and parameter, and how far it scatters over the runs."""
    return ((kind, d, name, fit.repeats[n]) for kind, d, name, _, fit, n in _fitted(joint) if n in fit.repeats)


def all_tables(joints: Sequence[Joint]) -> dict[str, pd.DataFrame]:
    """Every table by the name of its file."""
    fits = (parameters, inputs, segments, crosscheck, hold_out, points)
    moving = (tracking, consistency, table_1, uncertainty, repeats)
    makers = (*fits, models, laws, presliding, breakaway, hysteresis, *moving)
    return {maker.__name__: maker(joints) for maker in makers}
