"""Comparison of friction models: Coulomb, viscous, Stribeck and LuGre, symmetric and per direction."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import condition
from bristle.estimation.information import bic, power_of
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.comparison import (
    APART,
    ONE,
    SYMMETRIC,
    Comparison,
    Data,
    Fitted,
    LeftOut,
    Row,
    rows_of,
)
from bristle.identification.dynamic.descent import carried, fit, with_deflections
from bristle.identification.dynamic.fit import relative_error
from bristle.identification.dynamic.problem import DynamicProblem, Values, dynamic_problem
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import DIRECTIONS, inertia, moved_in, regressors
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.points import point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records
from bristle.identification.static.set_up import sides_of
from bristle.model.parameters import SIGNED

COULOMB, VISCOUS, STRIBECK, LUGRE = "Coulomb", "Coulomb + viscous", "Stribeck curve", "LuGre"
"""Nested models; the Stribeck curve (9) adds alpha_1 and v_s, LuGre sigma_0 and sigma_1."""
_SAME = 2.0  # difference in BIC that is hardly worth a mention
_STEPS = 100
"""Most iterations of a LuGre fit: one friction for directions that differ converges slowly."""
_WORTH = 0.05  # of BIC: the gain at which a fit per direction ends
_DEPENDENT = 1e8  # condition number of dependent columns
Model = tuple[str, str]
"""Model and directions."""
Pose = Callable[[tuple[str, ...], Sequence[str]], tuple[Regression, Sequence[Regression]]]
"""(directions, regressors) -> the equations to fit, and those to predict."""


class Candidate(NamedTuple):
    """A fitted model."""

    residuals: Array
    parameters: int
    left_out: LeftOut = None
    settled: bool = True  # Whether its fit converged
    values: Values | None = None  # Where a LuGre fit ended


def compare_on_points(measured: Measured, static: Mapping[str, StaticFit]) -> Comparison | None:
    """The models on points, without LuGre, or None; errors are leave-one-out without held-out points."""
    points, held = (measured.points(hold_out=x) for x in (False, True))

    def pose(directions: tuple[str, ...], asked: Sequence[str]) -> tuple[Regression, Sequence[Regression]]:
        law = measured.experiment.fit.friction
        tests = [points_problem(held, directions, asked, law)] if held else []
        return points_problem(points, directions, asked, law), tests

    found, left, power = _static_models(measured.experiment, _variants(sides_of(points)), pose, moving=False)
    return rank_models("points", found, 1.0, power, static, None, left)


def compare_on_motion(
    measured: Measured, static: Mapping[str, StaticFit], alone: TrackingFit, apart: Values | None = None
) -> Comparison | None:
    """The models on moving runs, LuGre from `alone` or `apart`; `static` fits the same runs."""
    experiment, (records, held) = measured.experiment, (measured.moving(hold_out=x) for x in (False, True))
    (fixed, _), law, variants = inertia(experiment), experiment.fit.friction, _variants(moved_in(records))

    def pose(directions: tuple[str, ...], asked: Sequence[str]) -> tuple[Regression, Sequence[Regression]]:
        options = (directions, asked, experiment.fit.every, fixed, law)
        training = from_records(records, *options)[0]
        return training, [from_records([r], *options, training.weights)[0] for r in held]

    found, left, power = _static_models(experiment, variants, pose, moving=True)
    # LuGre as fitted, and in the other directions
    done = APART if any(name.direction in SIGNED for name in alone.parameters) else SYMMETRIC
    for called, directions in variants.items():
        if called == done or done not in variants:
            found[LUGRE, called] = _as_fitted(alone)
            continue
        with suppress(InputError):  # a start without influence: left out
            near = apart if called == APART else None
            found[LUGRE, called] = one = refitted(measured, alone, directions, near, held=held)
            if not one.settled:
                message = f"{LUGRE}, {called}: the fit had not settled; its numbers can still improve."
                numbers = {"model": LUGRE, "directions": called}
                left = (*left, Finding("lugre-unsettled", CAUTION, message, numbers))
    widened = inflation(min((c.residuals for c in found.values()), key=power_of, default=np.zeros(0)))
    return rank_models("moving runs", found, widened, power, static, alone, left)


def asked_regressors(experiment: Experiment, directions: tuple[str, ...], *, moving: bool) -> tuple[str, ...]:
    """Regressors of the models; an offset only where one friction serves both directions."""
    asked = regressors(experiment) if moving else point_regressors(experiment)
    if moving and experiment.fit.regressors is None and "offset" not in asked:
        asked = (*asked, "offset")
    return tuple(r for r in asked if r != "offset" or directions == ("both",))


def _variants(present: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Directions of the regression, by name."""
    return {SYMMETRIC: ("both",), APART: present} if len(present) == 2 else {ONE: present}


def _static_models(
    experiment: Experiment, variants: Mapping[str, tuple[str, ...]], pose: Pose, *, moving: bool
) -> tuple[dict[Model, Candidate], tuple[Finding, ...], float]:
    """Fitted static models, a note on those with too few equations, and the power of the measured torque, (N*m)**2."""
    found, few, power = dict[Model, Candidate](), list[str](), 0.0
    for called, directions in variants.items():
        whole, held = pose(directions, asked_regressors(experiment, directions, moving=moving))
        power = power or power_of(whole.measured)
        for model in (COULOMB, VISCOUS, STRIBECK):
            problem = _reduced(whole, model)
            if problem.torque.size <= len(problem.names) or condition(problem.linear) > _DEPENDENT:
                few.append(f"{model}, {called}")
                continue
            solution = solve(problem, default_range(problem.velocity))
            errors = [_reduced(test, model).relative_error(solution.theta) for test in held]
            if not moving and not held:
                errors = [_left_out_error(problem, solution.residuals, solution.jacobian)]
            found[model, called] = Candidate(solution.residuals, len(problem.names), _mean(errors))
    message = f"Too few points, or too much alike, for {'; '.join(few)}."
    return found, (Finding("too-few-for-models", NOTE, message, {"models": tuple(few)}),) if few else (), power


def _reduced(problem: Regression, model: str) -> Regression:
    """The problem without terms that a model lacks."""
    if model == STRIBECK:
        return problem
    lost = {name for name in problem.linear_names if model != VISCOUS and name.name == "alpha_2"}
    return replace(problem.without(lost), peaks=())


def _mean(errors: Sequence[float]) -> LeftOut:
    known = [x for x in errors if np.isfinite(x)]
    return float(np.mean(known)) if known else None


def _left_out_error(problem: Regression, residuals: Array, jacobian: Array) -> float:
    """Leave-one-out error, 100 * norm(r / (1 - h)) / norm(T), percent; nan at full leverage."""
    scale = np.linalg.norm(jacobian, axis=0)
    basis, values, _ = np.linalg.svd(jacobian / np.where(scale > 0, scale, 1.0), full_matrices=False)
    seen = basis[:, values > 1e-9 * values[0]]
    rest = 1 - np.einsum("nk,nk->n", seen, seen)
    norm = float(np.linalg.norm(problem.torque))
    return 100 * float(np.linalg.norm(residuals / rest)) / norm if norm and rest.min() > 1e-9 else float("nan")


def refitted(
    measured: Measured,
    alone: TrackingFit,
    directions: tuple[str, ...],
    near: Values | None = None,
    worth: float = 0.0,
    held: Sequence[Record] = (),
) -> Candidate:
    """LuGre in other directions, from `alone` or `near`, to steps worth less than `worth`; `held` are predicted."""
    experiment, records = measured.experiment, measured.moving(hold_out=False)
    asked, (fixed, _) = asked_regressors(experiment, directions, moving=True), inertia(experiment)
    given = {name.name for name in alone.known} - {name.name for name in alone.names if name in alone.known}

    def posed(chosen: Sequence[Record]) -> DynamicProblem:
        """The problem of some records, with what the experiment fixes."""
        whole = dynamic_problem(chosen, directions, asked, experiment.fit.every, fixed, law=experiment.fit.friction)
        values = carried(whole, alone.known)  # given values are held in other directions too
        return replace(whole, fixed={name: x for name, x in values.items() if name.name in given})

    problem = posed(records)
    start = {name: value for name, value in carried(problem, alone.known).items() if name not in problem.fixed}
    begin = with_deflections(problem, start)  # the law, or what is held, may have changed since `near`
    begin |= {name: value for name, value in (near or {}).items() if name in begin}
    enough = worth * alone.rms**2 * inflation(alone.residuals) if worth else 0.0
    values, minimum = fit(problem, begin, _STEPS, enough)
    errors = _mean([relative_error(posed([r]), values) for r in held])
    return Candidate(minimum.residuals, len(problem.names), errors, minimum.converged, values)


def _as_fitted(fit: TrackingFit) -> Candidate:
    """LuGre as fitted, with the deflections of its runs as unknowns."""
    return Candidate(
        fit.residuals, len(fit.names) + len(fit.starts_of_runs), _mean([h.relative_error for h in fit.hold_out])
    )


def bic_of_directions(
    measured: Measured, alone: TrackingFit, each: TrackingFit | None = None
) -> tuple[dict[str, float], Values | None]:
    """BIC of LuGre by `SYMMETRIC` and `APART` (`each`, or fitted here, with its end); empty for one direction."""
    if len(moved_in(measured.moving(hold_out=False))) < len(DIRECTIONS):
        return {}, None
    try:
        apart = each and _as_fitted(each)
        apart = apart or refitted(measured, alone, tuple(DIRECTIONS), worth=_WORTH)
    except InputError:  # a start without influence
        return {}, None
    both = {SYMMETRIC: _as_fitted(alone), APART: apart}
    effective = alone.residuals.size / inflation(min((x.residuals for x in both.values()), key=power_of))
    power = power_of(alone.measured)
    return {called: bic(x.residuals, x.parameters, effective, power) for called, x in both.items()}, apart.values


def rank_models(
    data: Data,
    candidates: Mapping[Model, Candidate],
    variance_inflation: float,
    power: float,
    static: Mapping[str, StaticFit],
    alone: TrackingFit | None,
    left_out: tuple[Finding, ...],
) -> Comparison | None:
    """The comparison of candidates, or None; `power` is the sum of squares of the measured torque, (N*m)**2."""
    if not candidates:
        return None
    n = next(iter(candidates.values())).residuals.size
    # whether a fit of these data keeps a Stribeck term in any direction, and shows the bristle
    shown = {name.name for name, e in (alone.parameters if alone else {}).items() if e.value is not None}
    peaks = [f.parameters["alpha_1"].value for f in static.values() if "alpha_1" in f.parameters]
    kept, seen = "alpha_1" in shown or any(x is not None for x in peaks), "sigma_0" in shown
    fitted = [
        Fitted(
            name=model if directions == ONE else f"{model}, {directions}", left_out=c.left_out,
            solves=[(c.residuals, c.parameters, n / variance_inflation, power)],
            candidate=seen if model == LUGRE else (model == STRIBECK) == kept,
        )
        for (model, directions), c in candidates.items()
    ]  # fmt: skip  # a list of values
    rows = rows_of(fitted)
    best = min((row for row in rows if row.candidate), key=lambda row: row.bic, default=None)
    rows = tuple(replace(row, chosen=row is best) for row in rows)
    sentence = _sentence(dict(zip(candidates, rows, strict=True)), static, kept=kept)
    return Comparison(data=data, n=n, effective=n / variance_inflation, rows=rows, sentence=sentence, left_out=left_out)


def _sentence(rows: Mapping[Model, Row], static: Mapping[str, StaticFit], *, kept: bool) -> Finding:
    """Which model to use and why."""
    allowed = sorted((r for r in rows.values() if r.candidate), key=lambda r: r.bic)
    if not allowed:
        message = "None of the models with the terms that the fit supports can be fitted to so few points."
        return Finding("no-model", CAUTION, message)
    best, *rest = allowed
    lowest = "it has the lowest BIC"
    if len(rows) > len(allowed):
        lowest = f"of the models with the terms that the fit supports {lowest}"
    if rest:
        gap = rest[0].bic - best.bic
        lowest = f"{lowest} ({'hardly worse: ' * (gap < _SAME)}{rest[0].name} has {gap:.1f} more)"
    why = [lowest]
    # terms without support, and a Stribeck term from points that stick and slip
    outcomes = {f.outcome.code for f in static.values()}
    shown = [r.bic for (model, _), r in rows.items() if model == STRIBECK]
    if not kept and shown and "static-as-asked" not in outcomes:
        gain = best.bic - min(shown)
        lower = f", though it would lower the BIC by {gain:.1f} (the fit's warnings say why)" if gain > 0 else ""
        why.append(f"the Stribeck term is not identifiable from these data, as the fit found{lower}")
    if kept and "static-stick-slip" in outcomes:
        why.append("but its Stribeck term rests on points that stick and slip")
    if any(model == LUGRE and not r.candidate for (model, _), r in rows.items()):
        why.append("the motion does not show LuGre's bristle")
    message = f"Use {best.name}: {'; '.join(why)}."
    return Finding("use-model", NOTE, message, {"model": best.name, "why": tuple(why)})
