"""Results as tables: each function makes one DataFrame, which the page shows and `tables/*.csv` holds."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bristle.identification.fits import Estimate, PreslidingFit, RunScatter, StaticFit, TrackingFit, Uncertainty
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName, unit
from bristle.page.wording import WORK
from bristle.questions.joint_report.results_file import declared, estimates, identified
from bristle.questions.joint_report.sentences import methods

WAYS = ("covariance", "profile", "bootstrap")
"""In which an interval is found."""


def parameters(joints: Sequence[Joint]) -> pd.DataFrame:
    """Every stage's parameters with their intervals; for simulated data also true, error_percent and inside (the interval holds the truth)."""
    return with_truth(estimates(joints), joints)


def inputs(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per file: rows, dropped, sha256, labels, notes."""
    rows = (
        (joint.name, x.file, x.rows, x.dropped, x.sha256, _labels(x.labels), " ".join(map(str, x.notes)))
        for joint in joints
        for x in joint.inputs
    )
    return _framed(rows, ("joint", "file", "rows", "dropped", "sha256", "labels", "notes"))


def segments(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per candidate segment: where, velocity, torque, standard error, accepted, stick_slip, reasons, warnings.

    `where` is its place in the file; `start` and `stop` are its first sample and one past the last, from 0.
    """
    own = ("file", "where", "start", "stop", "velocity", "torque", "standard_error", "accepted", "stick_slip")
    rows = (
        (joint.name, *_fields(s, own), *(" ".join(map(str, x)) for x in (s.reasons, s.warnings)), _labels(s.labels))
        for joint in joints
        for s in joint.segments
    )
    columns = ("joint", *own, "reasons", "warnings", "labels")
    return _framed(rows, columns, ("standard_error",), ("accepted", "stick_slip"))


def _labels(labels: Any) -> str:
    return ", ".join(f"{name} {value}" for name, value in labels.items())


def _fields(x: object, names: Iterable[str]) -> tuple[Any, ...]:
    return tuple(getattr(x, name) for name in names)


def _framed(
    rows: Iterable[tuple[Any, ...]], columns: Sequence[str], numbers: Sequence[str] = (), flags: Sequence[str] = ()
) -> pd.DataFrame:
    """Rows as a frame, of which some columns are numbers, or true and false, whatever is missing in them."""
    frame = pd.DataFrame(list(rows), columns=list(columns))
    return frame.astype({**dict.fromkeys(numbers, float), **dict.fromkeys(flags, bool)})


def comparison(joints: Sequence[Joint]) -> pd.DataFrame:
    """The paper's plain grid, the refined minimum and the fit without stick-slip points, side by side."""
    rows = []
    for joint in joints:
        for d, fit in joint.static.items():
            for name, e in fit.parameters.items():
                other = fit.without_stick_slip.get(name)
                without = (None, None) if other is None else (other.value, other.standard_error)
                known = fit.plain_grid.get(name), e.value, e.standard_error
                rows.append((joint.name, d, name, e.unit, *known, *without))
    numbers = ("plain_grid", "refined", "standard_error", "without_stick_slip", "without_standard_error")
    return _framed(rows, ("joint", "direction", "parameter", "unit", *numbers), numbers)


def crosscheck(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per parameter: the full nonlinear fit's value, the grid's, and their difference in standard errors."""
    rows = []
    checks = [(joint, d, check) for joint in joints for d, check in joint.crosscheck.items()]
    for joint, d, check in checks:
        for name, full in check.parameters.items():
            # What is shared belongs to a fit of its own only where two directions share it.
            fit = joint.static.get(name.direction) or joint.static.get(d)
            e = None if fit is None else fit.parameters.get(name.name)
            grid = None if e is None else e.value
            rows.append((joint.name, d, name.within(d), grid, full, check.difference_in_se.get(name)))
    numbers = ("grid", "full", "difference_in_se")
    return _framed(rows, ("joint", "direction", "parameter", *numbers), numbers)


def hold_out(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    return _held([(joint.name, d, fit) for joint in joints for d, fit in joint.static.items()], "direction")


def _held(fits: Iterable[tuple[str, str, StaticFit | TrackingFit]], of: str) -> pd.DataFrame:
    rows = ((joint, d, h.file, h.relative_error, fit.relative_error) for joint, d, fit in fits for h in fit.hold_out)
    return _framed(rows, ("joint", of, "file", "relative_error", "relative_error_of_fit"))


def presliding(joints: Sequence[Joint]) -> pd.DataFrame:
    """sigma_0 by each method, side by side, with the truth where the data are simulated; `recommended` marks the one to use."""
    rows = []
    for joint, d, fit in _slow_fits(joints):
        for method, e in methods(fit).items():
            known = e.value, e.unit, e.standard_error, e.systematic, *(e.interval or (None, None))
            rows.append((joint.name, d, method, *known, method == fit.recommended))
    errors = ("standard_error", "systematic", "lower", "upper")
    columns = ("joint", "direction", "method", "value", "unit", *errors, "recommended")
    frame = _framed(rows, columns, ("value", *errors), ("recommended",))
    return with_truth(declared(frame).assign(parameter="sigma_0"), joints).drop(columns="parameter")


def _slow_fits(joints: Sequence[Joint]) -> Iterator[tuple[Joint, str, PreslidingFit]]:
    for joint in joints:
        yield from ((joint, d, fit) for d, fit in (joint.presliding.fits if joint.presliding else {}).items())


def hysteresis(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per closed cycle: where, half the ranges of torque and displacement, work lost, secant, slope, inverse slope, counts."""
    slopes = ("secant", "slope", "inverse_slope")
    own = ("file", "start", "stop", "torque_amplitude", "displacement_amplitude", "loss", *slopes, "counts")
    rows = ((joint.name, *_fields(x, own)) for joint in joints if joint.presliding for x in joint.presliding.loops)
    return _framed(rows, ("joint", *own), slopes)


def stiffness(joints: Sequence[Joint]) -> pd.DataFrame:
    """Stiffness against amplitude: initial and secants of each direction, beside what LuGre's own exponential gives from the initial one on."""
    numbers = ("torque", "displacement", "value", "standard_error", "lugre", "sigma_0")
    fits = _slow_fits(joints)
    rows = ((joint.name, d, x.kind, *_fields(x, numbers)) for joint, d, fit in fits for x in fit.amplitudes)
    return _framed(rows, ("joint", "direction", "kind", *numbers), numbers)


def breakaway(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per loading that broke away: where it began, its torque, and how far that is from the median of its direction, percent."""
    rows = []
    for joint, slow in ((x, x.presliding) for x in joints if x.presliding):
        medians = {d: e.value for d, e in slow.breakaway.items()}
        for x in slow.breakaways:
            median = medians.get(x.direction)
            off = 100 * (x.breakaway / median - 1) if x.breakaway is not None and median else np.nan
            rows.append((joint.name, x.direction, x.file, x.start, x.breakaway, off))
    return _framed(rows, ("joint", "direction", "file", "start", "breakaway", "from_median_percent"))


def points(joints: Sequence[Joint]) -> pd.DataFrame:
    """What was fitted: velocity, torque, residual, time and position of every point, in SI units."""
    frames = []
    fits = [(x.name, d, fit) for x in joints for d, fit in x.static.items() if fit.velocity.size]
    for joint, d, fit in fits:
        signals = {"velocity": fit.velocity, "torque": fit.torque, "residual": fit.residuals}
        signals |= {"time": fit.time, "position": fit.position}
        whole = {name: x for name, x in signals.items() if x.size == fit.velocity.size}
        frames.append(pd.DataFrame({"joint": joint, "direction": d, **whole}))
    columns = ["joint", "direction", "velocity", "torque", "residual", "time", "position"]
    return pd.concat(frames, ignore_index=True).reindex(columns=columns) if frames else pd.DataFrame(columns=columns)


def profiles(joints: Sequence[Joint]) -> pd.DataFrame:
    """The cost over v_s: grid (plain or refined), v_s, cost."""
    rows = [
        (joint.name, d, grid, v_s, cost)
        for joint in joints
        for d, fit in joint.static.items()
        if (p := fit.profile) is not None
        for grid, x, y in (
            ("refined", p.v_s, p.cost),
            ("near the minimum", p.near_v_s, p.near_cost),
            ("plain", p.plain_v_s, p.plain_cost),
        )
        for v_s, cost in zip(x.tolist(), y.tolist(), strict=True)
    ]
    return _framed(rows, ("joint", "direction", "grid", "v_s", "cost"))


def models(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per joint, data and model: parameters, rms, relative error, AICc and BIC above the lowest, hold-out error, which to use."""
    numbers, flags = ("rms", "relative_error", "aicc", "bic", "hold_out"), ("candidate", "recommended")
    own = ("model", "directions", "parameters", *numbers, *flags)
    rows = ((joint.name, x.data, *_fields(row, own)) for joint in joints for x in joint.models for row in x.rows)
    return _framed(rows, ("joint", "data", *own), numbers, flags)


def laws(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per joint and law: parameters, rms, AICc and BIC above the lowest, errors at speeds and runs left out, weight, which one."""
    numbers, flags = ("rms", "aicc", "bic", "left_out", "run_left_out", "weight"), ("in_force", "chosen")
    own = ("law", "parameters", *numbers, *flags)
    rows = ((joint.name, x.data, *_fields(row, own)) for joint in joints if (x := joint.laws) for row in x.rows)
    return _framed(rows, ("joint", "data", *own), numbers, flags)


def table_1(joints: Sequence[Joint]) -> pd.DataFrame:
    """All parameters per direction, as in the paper's Table 1, each by the stage to use, with the truth where the data are simulated."""
    frame = with_truth(identified(joints), joints)
    frame.insert(len(frame.columns) - 2, "source", frame.pop("source"))
    return frame


def tracking(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter, with the truth where the data are simulated, and what encoder counts had added."""
    rows = []
    for joint in joints:
        for kind, fit in moving_fits(joint).items():
            for name, e in fit.parameters.items():
                known = e.value, e.unit, e.standard_error, e.systematic, *(e.interval or (None, None))
                rows.append((joint.name, kind, name.direction, name.name, *known, fit.count_bias.get(name)))
    errors = ("standard_error", "systematic", "lower", "upper", "count_bias")
    frame = _framed(rows, ("joint", "fit", "direction", "parameter", "value", "unit", *errors), ("value", *errors))
    return with_truth(declared(frame), joints)


def tracking_hold_out(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    return _held([(joint.name, kind, fit) for joint in joints for kind, fit in moving_fits(joint).items()], "fit")


def consistency(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per parameter that a stage of its own knows: that stage, the moving runs, the joint fit, and what follows."""
    numbers = ("stage_value", "stage_error", "tracking_value", "tracking_error", "joint_value", "joint_error")
    rows = []
    for joint in joints:
        for x in joint.consistency:
            found = (*_fields(x, numbers), unit_of(joint, x.parameter), x.difference_in_se, x.verdict)
            rows.append((joint.name, x.parameter.direction, x.parameter.name, x.stage, *found))
    columns = ("joint", "direction", "parameter", "stage", *numbers, "unit", "difference_in_se", "verdict")
    return _framed(rows, columns, (*numbers, "difference_in_se"))


def unit_of(joint: Joint, name: ParameterName) -> str:
    """The unit of a parameter of moving runs; empty where they know none of that name."""
    return next((fit.parameters[name].unit for fit in moving_fits(joint).values() if name in fit.parameters), "")


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


def interval_rows(joint: Joint) -> Iterator[IntervalRow]:
    """Every parameter whose interval is known three ways, fit by fit."""
    for d, static in joint.static.items():
        for name, three in static.uncertainty.items():
            yield IntervalRow("static", d, name, static.parameters[name], three)
    for _, d, slow in _slow_fits([joint]):
        for name, three in slow.uncertainty.items():
            yield IntervalRow("presliding", d, name, slow.sigma_0, three)
    for kind, moving in moving_fits(joint).items():
        for n, three in moving.uncertainty.items():
            yield IntervalRow(kind, n.direction, n.name, moving.parameters[n], three)


def uncertainty(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter: the value, and lower and upper end by each way; nan where a way has none."""
    ends = [f"{way}_{end}" for way in WAYS for end in ("lower", "upper")]
    found = [
        (
            joint.name, x.fit, x.direction, x.parameter, x.estimate.value, x.estimate.unit,
            *(end for way in WAYS for end in getattr(x.three, way) or (None, None)), " ".join(map(str, x.three.warnings)),
        )
        for joint in joints
        for x in interval_rows(joint)
    ]  # fmt: skip  # one row, one line
    columns = ["joint", "fit", "direction", "parameter", "value", "unit", *ends, "warnings"]
    return _framed(found, columns, ["value", *ends])


def repeats(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit, parameter and run that was fitted apart: its estimate, and the scatter of all of them.

    `before` and `after` are sqrt(chi2_red) before and after widening, `widened` what the standard error is multiplied by.
    """
    found = [
        (joint.name, kind, d, name, file, value, x.before, x.after, x.widened)
        for joint in joints
        for kind, d, name, x in scatter(joint)
        for file, value in x.by_run.items()
    ]
    numbers = ["value", "before", "after", "widened"]
    return _framed(found, ["joint", "fit", "direction", "parameter", "file", *numbers], numbers)


def scatter(joint: Joint) -> Iterator[tuple[str, str, str, RunScatter]]:
    """Fit, direction and parameter, and how far it scatters over the runs."""
    for d, static in joint.static.items():
        yield from (("static", d, name, x) for name, x in static.repeats.items())
    for _, d, slow in _slow_fits([joint]):
        yield from (("presliding", d, name, x) for name, x in slow.repeats.items())
    for kind, moving in moving_fits(joint).items():
        yield from ((kind, n.direction, n.name, x) for n, x in moving.repeats.items())


def units(joints: Sequence[Joint]) -> pd.DataFrame:
    """The unit of every column that has one, per joint."""
    names = {"velocity": "velocity", "torque": "torque", "residual": "torque", "time": "time", "position": "position"}
    names |= {"breakaway": "torque"} | dict.fromkeys(
        ("secant", "slope", "inverse_slope", "lugre", "sigma_0"), "sigma_0"
    )
    names |= {"torque_amplitude": "torque", "displacement": "position", "displacement_amplitude": "position"}
    rows = [(joint.name, column, unit(quantity, joint.kind)) for joint in joints for column, quantity in names.items()]
    rows += [(joint.name, "loss", WORK) for joint in joints]
    return pd.DataFrame(rows, columns=["joint", "column", "unit"])


def all_tables(joints: Sequence[Joint]) -> dict[str, pd.DataFrame]:
    """Every table by the name of its file."""
    fits = (parameters, inputs, segments, comparison, crosscheck, hold_out, points, profiles)
    moving = (tracking, tracking_hold_out, consistency, table_1, uncertainty, repeats)
    makers = (*fits, models, laws, presliding, breakaway, stiffness, hysteresis, *moving, units)
    return {maker.__name__: maker(joints) for maker in makers}
