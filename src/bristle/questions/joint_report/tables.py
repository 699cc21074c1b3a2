"""Results as tables: each function makes one DataFrame, which the page shows and `tables/*.csv` holds."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bristle.identification.fits import Estimate, StaticFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName, unit
from bristle.page.wording import WORK
from bristle.questions.joint_report.interval_tables import repeats, uncertainty
from bristle.questions.joint_report.results_file import declared, estimates, identified
from bristle.questions.joint_report.sentences import methods


def parameters(joints: Sequence[Joint]) -> pd.DataFrame:
    """Every stage's parameters with their intervals; for simulated data also true, error_percent and inside (the interval holds the truth)."""
    return with_truth(estimates(joints), joints)


def inputs(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per file: rows, dropped, sha256, labels, notes."""
    return pd.DataFrame(
        [
            (joint.name, x.file, x.rows, x.dropped, x.sha256, _labels(x.labels), " ".join(map(str, x.notes)))
            for joint in joints
            for x in joint.inputs
        ],
        columns=["joint", "file", "rows", "dropped", "sha256", "labels", "notes"],
    )


def segments(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per candidate segment: where, velocity, torque, standard error, accepted, stick_slip, reasons, warnings.

    `where` is its place in the file; `start` and `stop` are its first sample and one past the last, from 0.
    """
    return pd.DataFrame(
        [
            (
                joint.name, s.file, s.where, s.start, s.stop, s.velocity, s.torque, s.standard_error, s.accepted, s.stick_slip,
                " ".join(map(str, s.reasons)), " ".join(map(str, s.warnings)), _labels(s.labels),
            )
            for joint in joints
            for s in joint.segments
        ],
        columns=[
            "joint", "file", "where", "start", "stop", "velocity", "torque", "standard_error", "accepted", "stick_slip",
            "reasons", "warnings", "labels",
        ],
    ).astype({"standard_error": float, "accepted": bool, "stick_slip": bool})  # fmt: skip  # one name per line would hide the table's shape


def _labels(labels: Any) -> str:
    return ", ".join(f"{name} {value}" for name, value in labels.items())


def comparison(joints: Sequence[Joint]) -> pd.DataFrame:
    """The paper's plain grid, the refined minimum and the fit without stick-slip points, side by side."""
    rows = [
        (
            joint.name, d, name, e.unit, fit.plain_grid.get(name), e.value, e.standard_error,
            *_without(fit, name),
        )
        for joint in joints
        for d, fit in joint.static.items()
        for name, e in fit.parameters.items()
    ]  # fmt: skip  # as in `segments`
    numbers = ["plain_grid", "refined", "standard_error", "without_stick_slip", "without_standard_error"]
    frame = pd.DataFrame(rows, columns=["joint", "direction", "parameter", "unit", *numbers])
    return frame.astype(dict.fromkeys(numbers, float))


def _without(fit: StaticFit, name: str) -> tuple[float | None, float | None]:
    other = fit.without_stick_slip.get(name)
    return (None, None) if other is None else (other.value, other.standard_error)


def crosscheck(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per parameter: the full nonlinear fit's value, the grid's, and their difference in standard errors."""
    rows = [
        (joint.name, d, name.within(d), _refined(joint, d, name), full, check.difference_in_se.get(name))
        for joint in joints
        for d, check in joint.crosscheck.items()
        for name, full in check.parameters.items()
    ]
    numbers = ["grid", "full", "difference_in_se"]
    return pd.DataFrame(rows, columns=["joint", "direction", "parameter", *numbers]).astype(
        dict.fromkeys(numbers, float)
    )


def _refined(joint: Joint, direction: str, name: ParameterName) -> float | None:
    """The grid's value; what is shared belongs to a fit of its own only where two directions share it."""
    fit = joint.static.get(name.direction) or joint.static.get(direction)
    estimate = None if fit is None else fit.parameters.get(name.name)
    return None if estimate is None else estimate.value


def hold_out(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    return pd.DataFrame(
        [
            (joint.name, d, h.file, h.relative_error, fit.relative_error)
            for joint in joints
            for d, fit in joint.static.items()
            for h in fit.hold_out
        ],
        columns=["joint", "direction", "file", "relative_error", "relative_error_of_fit"],
    )


def presliding(joints: Sequence[Joint]) -> pd.DataFrame:
    """sigma_0 by each method, side by side, with the truth where the data are simulated; `recommended` marks the one to use."""
    rows = [
        (
            joint.name,
            d,
            method,
            e.value,
            e.unit,
            e.standard_error,
            e.systematic,
            *(e.interval or (None, None)),
            method == fit.recommended,
        )
        for joint in joints
        if joint.presliding
        for d, fit in joint.presliding.fits.items()
        for method, e in methods(fit).items()
    ]
    numbers = ["value", "standard_error", "systematic", "lower", "upper"]
    columns = ["joint", "direction", "method", "value", "unit", *numbers[1:], "recommended"]
    frame = pd.DataFrame(rows, columns=columns).astype({**dict.fromkeys(numbers, float), "recommended": bool})
    return with_truth(declared(frame).assign(parameter="sigma_0"), joints).drop(columns="parameter")


def hysteresis(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per closed cycle: where, half the ranges of torque and displacement, work lost, secant, slope, inverse slope, counts."""
    columns = [
        "file",
        "start",
        "stop",
        "torque_amplitude",
        "displacement_amplitude",
        "loss",
        "secant",
        "slope",
        "inverse_slope",
        "counts",
    ]
    rows = [
        (joint.name, *(getattr(x, name) for name in columns))
        for joint in joints
        if joint.presliding
        for x in joint.presliding.loops
    ]
    slopes = ["secant", "slope", "inverse_slope"]
    return pd.DataFrame(rows, columns=["joint", *columns]).astype(dict.fromkeys(slopes, float))


def stiffness(joints: Sequence[Joint]) -> pd.DataFrame:
    """Stiffness against amplitude: initial and secants of each direction, beside what LuGre's own exponential gives from the initial one on."""
    columns = ["kind", "torque", "displacement", "value", "standard_error", "lugre", "sigma_0"]
    rows = [
        (joint.name, d, *(getattr(x, name) for name in columns))
        for joint in joints
        if joint.presliding
        for d, fit in joint.presliding.fits.items()
        for x in fit.amplitudes
    ]
    return pd.DataFrame(rows, columns=["joint", "direction", *columns]).astype(dict.fromkeys(columns[1:], float))


def breakaway(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per loading that broke away: where it began, its torque, and how far that is from the median of its direction, percent."""
    columns = ["joint", "direction", "file", "start", "breakaway", "from_median_percent"]
    rows = [
        (joint.name, x.direction, x.file, x.start, x.breakaway, _from_median(x.breakaway, medians.get(x.direction)))
        for joint in joints
        if joint.presliding and (medians := joint.presliding.breakaway) is not None
        for x in joint.presliding.breakaways
    ]
    return pd.DataFrame(rows, columns=columns)


def _from_median(torque: float | None, median: Estimate | None) -> float:
    return 100 * (torque / median.value - 1) if torque is not None and median and median.value else np.nan


def points(joints: Sequence[Joint]) -> pd.DataFrame:
    """What was fitted: velocity, torque, residual, time and position of every point, in SI units."""
    frames = [
        pd.DataFrame(list(_points(joint, d, fit))) for joint in joints for d, fit in joint.static.items() if fit.n
    ]
    columns = ["joint", "direction", "velocity", "torque", "residual", "time", "position"]
    return pd.concat(frames, ignore_index=True).reindex(columns=columns) if frames else pd.DataFrame(columns=columns)


def _points(joint: Joint, direction: str, fit: StaticFit) -> Iterator[dict[str, Any]]:
    columns = {"velocity": fit.velocity, "torque": fit.torque, "residual": fit.residuals}
    columns |= {"time": fit.time, "position": fit.position}
    whole = {name: x.tolist() for name, x in columns.items() if x.size == fit.velocity.size}
    for k in range(fit.velocity.size):
        yield {"joint": joint.name, "direction": direction, **{name: x[k] for name, x in whole.items()}}


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
    return pd.DataFrame(rows, columns=["joint", "direction", "grid", "v_s", "cost"])


def models(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per joint, data and model: parameters, rms, relative error, AICc and BIC above the lowest, hold-out error, which to use."""
    columns = [
        "model",
        "directions",
        "parameters",
        "rms",
        "relative_error",
        "aicc",
        "bic",
        "hold_out",
        "candidate",
        "recommended",
    ]
    rows = [
        (joint.name, x.data, *(getattr(row, name) for name in columns))
        for joint in joints
        for x in joint.models
        for row in x.rows
    ]
    frame = pd.DataFrame(rows, columns=["joint", "data", *columns])
    numbers = ["rms", "relative_error", "aicc", "bic", "hold_out"]
    return frame.astype({**dict.fromkeys(numbers, float), "candidate": bool, "recommended": bool})


def laws(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per joint and law: parameters, rms, AICc and BIC above the lowest, errors at speeds and runs left out, weight, which one."""
    numbers = ["rms", "aicc", "bic", "left_out", "run_left_out", "weight"]
    columns = ["law", "parameters", *numbers, "in_force", "chosen"]
    rows = [
        (joint.name, joint.laws.data, *(getattr(row, name) for name in columns))
        for joint in joints
        if joint.laws is not None
        for row in joint.laws.rows
    ]
    frame = pd.DataFrame(rows, columns=["joint", "data", *columns])
    return frame.astype({**dict.fromkeys(numbers, float), "in_force": bool, "chosen": bool})


def table_1(joints: Sequence[Joint]) -> pd.DataFrame:
    """All parameters per direction, as in the paper's Table 1, each by the stage to use, with the truth where the data are simulated."""
    frame = with_truth(identified(joints), joints)
    frame.insert(len(frame.columns) - 2, "source", frame.pop("source"))
    return frame


def tracking(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter, with the truth where the data are simulated, and what encoder counts had added."""
    numbers = ["value", "standard_error", "systematic", "lower", "upper", "count_bias"]
    columns = ["joint", "fit", "direction", "parameter", "value", "unit", *numbers[1:]]
    rows = [
        (
            joint.name, kind, name.direction, name.name, e.value, e.unit, e.standard_error, e.systematic,
            *(e.interval or (None, None)), fit.count_bias.get(name),
        )
        for joint in joints
        for kind, fit in moving_fits(joint).items()
        for name, e in fit.parameters.items()
    ]  # fmt: skip  # one row, one line
    frame = pd.DataFrame(rows, columns=columns).astype(dict.fromkeys(numbers, float))
    return with_truth(declared(frame), joints)


def tracking_hold_out(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    rows = [
        (joint.name, kind, held.file, held.relative_error, fit.relative_error)
        for joint in joints
        for kind, fit in moving_fits(joint).items()
        for held in fit.hold_out
    ]
    return pd.DataFrame(rows, columns=["joint", "fit", "file", "relative_error", "relative_error_of_fit"])


def consistency(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per parameter that a stage of its own knows: that stage, the moving runs alone, the joint fit, and what follows."""
    numbers = ["stage_value", "stage_error", "tracking_value", "tracking_error", "joint_value", "joint_error"]
    rows = [
        (
            joint.name, x.parameter.direction, x.parameter.name, x.stage, *(getattr(x, name) for name in numbers),
            unit_of(joint, x.parameter), x.difference_in_se, x.verdict,
        )
        for joint in joints
        for x in joint.consistency
    ]  # fmt: skip  # as above
    columns = ["joint", "direction", "parameter", "stage", *numbers, "unit", "difference_in_se", "verdict"]
    return pd.DataFrame(rows, columns=columns).astype(dict.fromkeys([*numbers, "difference_in_se"], float))


def unit_of(joint: Joint, name: ParameterName) -> str:
    """The unit of a parameter of moving runs; empty where they know none of that name."""
    return next((fit.parameters[name].unit for fit in moving_fits(joint).values() if name in fit.parameters), "")


def with_truth(frame: pd.DataFrame, joints: Sequence[Joint]) -> pd.DataFrame:
    """The frame with true, error_percent and inside (the interval holds the truth) inserted as columns behind `upper`.

    `frame` has joint, direction, parameter, value, lower and upper. What is not known is nan; `inside` is None there.
    """
    frame, place = frame.copy(), list(frame.columns).index("upper") + 1
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
    return float(getattr(truth, parameter)) if truth is not None and parameter in truth._fields else math.nan


def units(joints: Sequence[Joint]) -> pd.DataFrame:
    """The unit of every column that has one, per joint."""
    names = {"velocity": "velocity", "torque": "torque", "residual": "torque", "time": "time", "position": "position"}
    names |= {
        "breakaway": "torque",
        **dict.fromkeys(("secant", "slope", "inverse_slope", "lugre", "sigma_0"), "sigma_0"),
    }
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
