"""Friction models fitted to the same equations: Coulomb, viscous, Stribeck and LuGre, symmetric and per direction."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.covariance import condition
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.fit import relative_error
from bristle.identification.dynamic.problem import DynamicProblem, Unknown, Values, dynamic_problem
from bristle.identification.dynamic.starts import carried
from bristle.identification.dynamic.unknowns import fit, with_deflections
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.model_criteria import (
    APART,
    COULOMB,
    LUGRE,
    ONE,
    STRIBECK,
    SYMMETRIC,
    VISCOUS,
    ModelCandidate,
    power_of,
    rank_models,
    scores,
)
from bristle.identification.moving_runs import DIRECTIONS, declared, inertia, moved_in, regressors
from bristle.identification.results import ModelComparison
from bristle.identification.static import problem as regression
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression
from bristle.model.parameters import SIGNED, ParameterName

_STEPS = 100
"""Of the LuGre fit that no stage has done yet, at the most: one set of friction for directions that differ has a long way along a flat valley."""
_WORTH = 0.05
"""Of BIC: less decides nothing about directions."""
_DEPENDENT = 1e8
"""Condition number beyond which columns are told apart by rounding alone."""
HELD_OUT = Finding("held-out-runs", NOTE, "Hold-out: held-out runs.")
Pose = Callable[[tuple[str, ...], Sequence[str]], tuple[Regression, Sequence[Regression]]]
"""(directions, regressors) -> the equations to fit, and those to predict."""


def compare_on_points(
    experiment: Experiment, velocity: Array, pose: Pose, static: Mapping[str, StaticFit]
) -> ModelComparison | None:
    """The models on points at constant velocity, where LuGre is its Stribeck curve (9); None where no model can be fitted.

    Without held-out points each point is predicted from all others, to first order: its residual over 1 - its leverage.

    Args:
        experiment: with its options.
        velocity: of the points, rad/s, (n,).
        pose: poses the problem.
        static: what the fit found.
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
    experiment's fit is that fit, `alone`; in the others it is fitted here, from where that fit ended.

    Args:
        experiment: with its options.
        records: training runs.
        held: hold-out runs.
        static: static fits of the moving runs themselves; empty where other runs gave them, or `alone` is the one to use.
        alone: all parameters of the moving runs.
        apart: where LuGre with a friction for each direction ended, if that is known.

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
    candidates += _lugre(experiment, records, held, alone, variants, apart)
    for directions in (c.directions for c in candidates if not c.settled):
        message = f"{LUGRE}, {directions}: the fit had not settled; its numbers can still improve."
        left = (*left, Finding("lugre-unsettled", CAUTION, message, {"model": LUGRE, "directions": directions}))
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
            candidates.append(
                ModelCandidate(
                    model=model,
                    directions=called,
                    parameters=len(problem.names),
                    residuals=solution.residuals,
                    hold_out=_mean(errors),
                )
            )
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


def _lugre(
    experiment: Experiment,
    records: Sequence[Record],
    held: Sequence[Record],
    alone: TrackingFit,
    variants: Mapping[str, tuple[str, ...]],
    apart: Values | None,
) -> list[ModelCandidate]:
    """LuGre as it was fitted, and in the directions in which it was not."""
    done = APART if any(name.direction in SIGNED for name in alone.parameters) else SYMMETRIC
    if done not in variants:
        done = ONE
    errors = [h.relative_error for h in alone.hold_out]
    count = len(alone.names) + len(alone.starts_of_runs)
    candidates = {
        done: ModelCandidate(
            model=LUGRE, directions=done, parameters=count, residuals=alone.residuals, hold_out=_mean(errors)
        )
    }
    for called, directions in variants.items():
        if called != done:
            with suppress(InputError):  # a start that shows nothing is no reason to fail: then this one is left out
                near = apart if called == APART else None
                candidates[called] = refitted(experiment, records, held, alone, called, directions, near)
    return [candidates[called] for called in variants if called in candidates]


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
    known = {name: value for name, value in values.items() if isinstance(name, ParameterName)}
    return ModelCandidate(
        model=LUGRE,
        directions=called,
        parameters=len(problem.names),
        residuals=minimum.residuals,
        hold_out=_mean([relative_error(posed([r]), known) for r in held]),
        settled=minimum.converged,
        values=values,
    )


def bic_of_directions(
    experiment: Experiment, records: Sequence[Record], alone: TrackingFit, each: TrackingFit | None = None
) -> tuple[dict[str, float], Values]:
    """BIC of LuGre with one friction for both directions, as it was fitted, and with one for each; and where this one ended.

    With one for `each` as it was fitted, or else near the first. Neither where the runs go one way, or not the torque is predicted.
    """
    if alone.quantity != "torque" or len(moved_in(records)) < len(DIRECTIONS):
        return {}, {}
    of_each, ended = (
        {SYMMETRIC: (alone.residuals, len(alone.names) + len(alone.starts_of_runs))},
        dict[Unknown, float](),
    )
    if each is not None:
        of_each[APART] = each.residuals, len(each.names) + len(each.starts_of_runs)
    else:
        try:
            apart = refitted(experiment, records, (), alone, APART, tuple(DIRECTIONS), worth=_WORTH)
        except InputError:  # a start that shows nothing is no reason to fail
            return {}, {}
        of_each[APART], ended = (apart.residuals, apart.parameters), {**apart.values}
    effective = alone.residuals.size / inflation(min((rows for rows, _ in of_each.values()), key=power_of))
    power = power_of(alone.measured)
    return {called: scores(rows, k, effective, power)[1] for called, (rows, k) in of_each.items()}, ended
