"""Friction models fitted to the same equations, and which to use: Coulomb, viscous, Stribeck and LuGre, symmetric and per direction."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import condition
from bristle.estimation.information import criteria, power_of
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.descent import carried, fit, with_deflections
from bristle.identification.dynamic.fit import relative_error
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, dynamic_problem
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.moving_runs import DIRECTIONS, declared, inertia, moved_in, regressors
from bristle.identification.results import ModelComparison, ModelRow
from bristle.identification.static import problem as regression
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression
from bristle.model.parameters import SIGNED

COULOMB, VISCOUS, STRIBECK, LUGRE = "Coulomb", "Coulomb + viscous", "Stribeck curve", "LuGre"
"""Each with the terms of the one before: Coulomb and viscous friction; the steady curve (9), with alpha_1 and v_s;
sigma_0 and sigma_1."""
SYMMETRIC, APART, ONE = "symmetric", "per direction", "one direction"
_SAME = 2.0  # a difference in BIC below this is worth a bare mention
_STEPS = 100
"""Of the LuGre fit that no stage has done yet, at the most: one set of friction for directions that differ has a long way along a flat valley."""
_WORTH = 0.05  # of BIC: less decides nothing about directions
_DEPENDENT = 1e8  # condition number beyond which columns are told apart by rounding alone
HELD_OUT = Finding("held-out-runs", NOTE, "Hold-out: held-out runs.")
Pose = Callable[[tuple[str, ...], Sequence[str]], tuple[Regression, Sequence[Regression]]]
"""(directions, regressors) -> the equations to fit, and those to predict."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCandidate:
    """A model fitted."""

    model: str
    directions: str
    parameters: int
    residuals: Array
    """(n,)."""
    hold_out: float | None
    """Percent."""
    settled: bool = True
    """Whether its fit came to its end."""
    values: Values = field(default_factory=dict)
    """Of a LuGre model: where it ended."""


def compare_on_points(
    experiment: Experiment, velocity: Array, pose: Pose, static: Mapping[str, StaticFit]
) -> ModelComparison | None:
    """The models on points at constant velocity, rad/s, (n,), where LuGre is its Stribeck curve (9); None where none can be fitted.

    Without held-out points each point is predicted from all others, to first order: its residual over 1 - its leverage.
    """
    present = tuple(d for d, sign in DIRECTIONS.items() if (velocity * sign > 0).any())
    candidates, left, power = _static_candidates(experiment, _variants(present), pose, press=True)
    each = Finding("each-left-out", NOTE, "Hold-out: each point predicted from all others.")
    held_by = HELD_OUT if pose(("both",), ())[1] else each
    message = "At constant velocity LuGre is its Stribeck curve, so it is not listed apart."
    left_out = (*left, Finding("lugre-is-its-curve", NOTE, message))
    return rank_models("points", candidates, held_by, 1.0, power, static, None, left_out)


def compare_on_motion(
    experiment: Experiment,
    records: Sequence[Record],
    held: Sequence[Record],
    static: Mapping[str, StaticFit],
    alone: TrackingFit,
    apart: Values | None = None,
) -> ModelComparison | None:
    """The models on moving runs: every equation of all of them, with the same decimation and regressors; None where the position is predicted.

    Symmetric models have the experiment's offset; two Coulomb terms take its part in those per direction. LuGre in the directions of the
    experiment's fit is that fit, `alone`; in the others it is fitted here, from where that fit ended, or `apart`. `static` are fits of the
    moving runs themselves; empty where other runs gave them, or `alone` is the one to use.

    Raises InputError as the fits of moving runs do.
    """
    if alone.quantity != "torque":
        return None
    (fixed, _), law = inertia(experiment), experiment.fit.friction
    variants = _variants(moved_in(records))

    def pose(directions: tuple[str, ...], asked: Sequence[str]) -> tuple[Regression, Sequence[Regression]]:
        """The regression of the training runs, and of each held-out one."""
        options = (directions, asked, experiment.fit.every, fixed, law)
        training = regression.from_records(records, *options)[0]
        return training, [regression.from_records([r], *options, training.weights)[0] for r in held]

    candidates, left, power = _static_candidates(experiment, variants, pose, press=False)
    # LuGre as it was fitted, and in the directions in which it was not
    done = APART if any(name.direction in SIGNED for name in alone.parameters) else SYMMETRIC
    for called, directions in variants.items():
        if called == done or done not in variants:
            rows, count = _equations_and_unknowns(alone)
            errors = _mean([h.relative_error for h in alone.hold_out])
            own = ModelCandidate(model=LUGRE, directions=called, parameters=count, residuals=rows, hold_out=errors)
            candidates.append(own)
            continue
        with suppress(InputError):  # a start that shows nothing is no reason to fail: then this one is left out
            near = apart if called == APART else None
            candidates.append(refitted(experiment, records, held, alone, called, directions, near))
    for called in (c.directions for c in candidates if not c.settled):
        message = f"{LUGRE}, {called}: the fit had not settled; its numbers can still improve."
        left = (*left, Finding("lugre-unsettled", CAUTION, message, {"model": LUGRE, "directions": called}))
    variance_inflation = inflation(min((c.residuals for c in candidates), key=power_of, default=np.zeros(0)))
    held_by = HELD_OUT if held else None
    return rank_models("moving runs", candidates, held_by, variance_inflation, power, static, alone, left)


def asked_regressors(experiment: Experiment, directions: tuple[str, ...], *, moving: bool) -> tuple[str, ...]:
    """What the models have beside friction: as the experiment asks; an offset only where one set of friction serves both directions."""
    if moving:
        symmetric = experiment.fit.regressors is None and len(directions) == 1
        asked = regressors(experiment)
        asked = (*asked, "offset") if symmetric and "offset" not in asked else asked
    else:
        asked = declared(experiment) or ()
    return tuple(r for r in asked if r != "offset" or directions == ("both",))


def _variants(present: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Directions of the regression by what they are called."""
    return {SYMMETRIC: ("both",), APART: present} if len(present) == 2 else {ONE: present}


def _static_candidates(
    experiment: Experiment, variants: Mapping[str, tuple[str, ...]], pose: Pose, *, press: bool
) -> tuple[list[ModelCandidate], tuple[Finding, ...], float]:
    """The static models that there are equations enough for; which there are not; and the power of what is to be explained, (N*m)**2."""
    candidates, few, power = list[ModelCandidate](), list[str](), 0.0
    for called, directions in variants.items():
        whole, held = pose(directions, asked_regressors(experiment, directions, moving=not press))
        power = power or power_of(whole.measured)
        for model in (COULOMB, VISCOUS, STRIBECK):
            problem = _reduced(whole, model)
            if problem.torque.size <= len(problem.names) or condition(problem.linear) > _DEPENDENT:
                few.append(f"{model}, {called}")
                continue
            solution = solve(problem, default_range(problem.velocity))
            errors = [_reduced(test, model).relative_error(solution.theta) for test in held]
            if press and not held:
                errors = [_left_out_error(problem, solution.residuals, solution.jacobian)]
            one = ModelCandidate(
                model=model, directions=called, parameters=len(problem.names),
                residuals=solution.residuals, hold_out=_mean(errors),
            )  # fmt: skip  # a list of values
            candidates.append(one)
    message = f"Too few points, or too much alike, for {'; '.join(few)}."
    return candidates, (Finding("too-few-for-models", NOTE, message, {"models": tuple(few)}),) if few else (), power


def _reduced(problem: Regression, model: str) -> Regression:
    """The problem without what a model does not have."""
    if model == STRIBECK:
        return problem
    lost = {name for name in problem.linear_names if model != VISCOUS and name.name == "alpha_2"}
    return replace(problem.without(lost), peaks=())


def _mean(errors: Sequence[float]) -> float | None:
    known = [x for x in errors if np.isfinite(x)]
    return float(np.mean(known)) if known else None


def _left_out_error(problem: Regression, residuals: Array, jacobian: Array) -> float:
    """100 * norm(r / (1 - h)) / norm(T), percent, h the leverages; nan where a point determines a parameter alone."""
    scale = np.linalg.norm(jacobian, axis=0)
    basis, values, _ = np.linalg.svd(jacobian / np.where(scale > 0, scale, 1.0), full_matrices=False)
    seen = basis[:, values > 1e-9 * values[0]]
    rest = 1 - np.einsum("nk,nk->n", seen, seen)
    norm = float(np.linalg.norm(problem.torque))
    return 100 * float(np.linalg.norm(residuals / rest)) / norm if norm and rest.min() > 1e-9 else float("nan")


def refitted(
    experiment: Experiment,
    records: Sequence[Record],
    held: Sequence[Record],
    alone: TrackingFit,
    called: str,
    directions: tuple[str, ...],
    near: Values | None = None,
    worth: float = 0.0,
) -> ModelCandidate:
    """LuGre in other directions than those of the fit, from where that fit ended, or from values that are `near`.

    It ends where the next step would lower BIC by less than `worth`.
    """
    asked, (fixed, _) = asked_regressors(experiment, directions, moving=True), inertia(experiment)
    given = {name.name for name in alone.known} - {name.name for name in alone.names if name in alone.known}

    def posed(chosen: Sequence[Record]) -> DynamicProblem:
        """The problem of some records, with what the experiment fixes."""
        whole = dynamic_problem(chosen, directions, asked, experiment.fit.every, fixed, law=experiment.fit.friction)
        values = carried(whole, alone.known)  # what was given to the fit is held in other directions too
        return replace(whole, fixed={name: x for name, x in values.items() if name.name in given})

    problem = posed(records)
    start = {name: value for name, value in carried(problem, alone.known).items() if name not in problem.fixed}
    begin = with_deflections(problem, start)  # the law, or what is held, may have changed since `near`
    begin |= {name: value for name, value in (near or {}).items() if name in begin}
    enough = worth * alone.rms**2 * inflation(alone.residuals) if worth else 0.0
    values, minimum = fit(problem, begin, _STEPS, enough)
    errors = _mean([relative_error(posed([r]), values) for r in held])
    return ModelCandidate(
        model=LUGRE, directions=called, parameters=len(problem.names), residuals=minimum.residuals, hold_out=errors,
        settled=minimum.converged, values=values,
    )  # fmt: skip  # a list of values


def _equations_and_unknowns(fit: TrackingFit) -> tuple[Array, int]:
    """What a fit leaves of each equation, (n,), and how many unknowns it has, the starts of its runs among them."""
    return fit.residuals, len(fit.names) + len(fit.starts_of_runs)


def bic_of_directions(
    experiment: Experiment, records: Sequence[Record], alone: TrackingFit, each: TrackingFit | None = None
) -> tuple[dict[str, float], Values]:
    """BIC of LuGre with one friction for both directions, as it was fitted, and with one for each; and where this one ended.

    With one for `each` as it was fitted, or else near the first. Neither where the runs go one way, or not the torque is predicted.
    """
    if alone.quantity != "torque" or len(moved_in(records)) < len(DIRECTIONS):
        return {}, {}
    of_each, ended = {SYMMETRIC: _equations_and_unknowns(alone)}, dict[Unknown, float]()
    if each is not None:
        of_each[APART] = _equations_and_unknowns(each)
    else:
        try:
            apart = refitted(experiment, records, (), alone, APART, tuple(DIRECTIONS), worth=_WORTH)
        except InputError:  # a start that shows nothing is no reason to fail
            return {}, {}
        of_each[APART], ended = (apart.residuals, apart.parameters), {**apart.values}
    effective = alone.residuals.size / inflation(min((rows for rows, _ in of_each.values()), key=power_of))
    power = power_of(alone.measured)
    return {called: criteria(rows, k, effective, power)[1] for called, (rows, k) in of_each.items()}, ended


def rank_models(
    data: Literal["points", "moving runs"],
    candidates: Sequence[ModelCandidate],
    held_by: Finding | None,
    variance_inflation: float,
    power: float,
    static: Mapping[str, StaticFit],
    alone: TrackingFit | None,
    left_out: tuple[Finding, ...],
) -> ModelComparison | None:
    """The candidates, on the same equations, as rows, with the one to use; None where there is none.

    `held_by` says what their `hold_out` is about, `variance_inflation` is how many equations count as an independent one, `power` the
    sum of squares of what they explain, (N*m)**2; `static` and `alone` are fits of these data, and `left_out` is not compared.
    """
    if not candidates:
        return None
    n = candidates[0].residuals.size
    marks = [criteria(c.residuals, c.parameters, n / variance_inflation, power) for c in candidates]
    lowest_aicc = min((aicc for aicc, _ in marks if aicc is not None), default=0.0)
    lowest_bic = min(bic for _, bic in marks)
    # whether a fit of these data keeps a Stribeck term in any direction, and shows the bristle
    shown = {name.name for name, e in (alone.parameters if alone else {}).items() if e.value is not None}
    peaks = [f.parameters["alpha_1"].value for f in static.values() if "alpha_1" in f.parameters]
    kept, seen = "alpha_1" in shown or any(x is not None for x in peaks), "sigma_0" in shown
    allowed = [k for k, c in enumerate(candidates) if (seen if c.model == LUGRE else (c.model == STRIBECK) == kept)]
    best = min(allowed, key=lambda k: marks[k][1], default=None)
    rows = tuple(
        ModelRow(
            model=c.model, directions=c.directions, parameters=c.parameters,
            rms=float(np.sqrt(power_of(c.residuals) / n)),
            relative_error=100 * float(np.sqrt(power_of(c.residuals) / power)) if power else None,
            aicc=None if aicc is None else aicc - lowest_aicc, bic=bic - lowest_bic, hold_out=c.hold_out,
            candidate=k in allowed, recommended=k == best,
        )
        for k, (c, (aicc, bic)) in enumerate(zip(candidates, marks, strict=True))
    )  # fmt: skip  # a list of values
    return ModelComparison(
        data=data, n=n, effective=n / variance_inflation, hold_out_by=held_by, rows=rows,
        sentence=_sentence(rows, static, kept=kept), left_out=left_out,
    )  # fmt: skip  # a list of values


def _sentence(rows: Sequence[ModelRow], static: Mapping[str, StaticFit], *, kept: bool) -> Finding:
    """Which to use and why."""
    allowed = sorted((r for r in rows if r.candidate), key=lambda r: r.bic)
    if not allowed:
        message = "None of the models with the terms that the fit supports can be fitted to so few points."
        return Finding("no-model", CAUTION, message)
    best, *rest = allowed
    lowest = "it has the lowest BIC"
    if len(rows) > len(allowed):
        lowest = f"of the models with the terms that the fit supports {lowest}"
    if rest:
        gap = rest[0].bic - best.bic
        lowest = f"{lowest} ({'hardly worse: ' * (gap < _SAME)}{_called(rest[0])} has {gap:.1f} more)"
    other = min((r for r in allowed if r.aicc is not None), key=lambda r: r.aicc or 0.0, default=best)
    why: list[Finding | str] = [lowest, *([] if other is best else [f"AICc prefers {_called(other)}"])]
    # what the fit does not support, and whether that it keeps the Stribeck term rests on points that stick and slip
    outcomes, shown = {f.outcome.code for f in static.values()}, [r.bic for r in rows if r.model == STRIBECK]
    if not kept and shown and "static-as-asked" not in outcomes:
        gain = best.bic - min(shown)
        lower = f", though it would lower the BIC by {gain:.1f} (the fit's warnings say why)" if gain > 0 else ""
        why.append(f"the Stribeck term is not identifiable from these data, as the fit found{lower}")
    if kept and "static-stick-slip" in outcomes:
        message = "but its Stribeck term rests on points that stick and slip"
        why.append(Finding("peak-of-stick-slip", CAUTION, message))
    if any(r.model == LUGRE and not r.candidate for r in rows):
        why.append("the motion does not show LuGre's bristle")
    model = _called(best)
    return Finding("use-model", NOTE, f"Use {model}: {'; '.join(map(str, why))}.", {"model": model, "why": tuple(why)})


def _called(row: ModelRow) -> str:
    return row.model if row.directions == ONE else f"{row.model}, {row.directions}"
