"""The moving fit alone and with priors from other stages, and their consistency."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from math import hypot
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from bristle.data.encoder import resolution
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.profile_likelihood import Profiled
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.dynamic.descent import (
    LOGARITHMIC,
    carried,
    logarithms,
    with_deflections,
    without_deflections,
)
from bristle.identification.dynamic.encoder_bias import without_count_bias
from bristle.identification.dynamic.fit import DynamicSolution, fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, Prior, Unknown, Values, dynamic_problem
from bristle.identification.dynamic.uncertainty import parts_of_runs, profile_until_stable, shifts_of, with_three_ways
from bristle.identification.fits import Estimate, Presliding, StaticFit, TrackingFit
from bristle.identification.moving_runs import directions, inertia, regressors
from bristle.identification.repeats import clustered, widened, with_priors_beside
from bristle.identification.results import Consistency
from bristle.identification.systematic import with_systematic
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import INERTIA, Direction, ParameterName, of_friction, without_peak
from bristle.model.vectorize import evaluate
from bristle.progress import Progress

_BENDS = 0.01  # of the travel: deflection of the bristle at the start by default

Load = Callable[[Mapping[str, StaticFit] | TrackingFit], Presliding]


class DynamicStages(NamedTuple):
    """Results of moving runs; None or empty where missing."""

    tracking: TrackingFit | None = None
    joint_fit: TrackingFit | None = None  # Moving runs alone, and with priors of the other stages
    consistency: tuple[Consistency, ...] = ()
    presliding: Presliding | None = None


def fit_with_priors(
    experiment: Experiment,
    records: Sequence[Record],
    held: Sequence[Record],
    static: Mapping[str, StaticFit],
    load: Load | None,
    near: TrackingFit | Values | None = None,
    *,
    static_is_apart: bool,
    uncertainty: bool = False,
    progress: Progress | None = None,
) -> DynamicStages:
    """All parameters from moving runs, alone and with priors of other stages. Raises InputError for missing signals.

    `static_is_apart`: the static fits are of other data; `load` makes the presliding stage; `near` is a fit of the same
    runs, or its values, to begin at. `uncertainty` adds intervals by profile and bootstrap.
    """
    moving = directions(experiment, records)
    kind, count, pose = experiment.joint.kind, _count(experiment, records), partial(_problem, experiment, moving)

    def fitted(
        posed: DynamicProblem,
        *others: Values,
        search: bool = False,
        dropped: Mapping[ParameterName, Finding] | None = None,
    ) -> tuple[DynamicSolution, Mapping[Unknown, Profiled]]:
        """The fit of a problem from some starts, and its profiles if asked for."""
        refit = partial(fit_tracking, posed, start, kind, tests, progress=progress, dropped=dropped)
        solved = refit(others=others, search=search)
        if not uncertainty:
            return solved, {}
        return profile_until_stable(solved, lambda end: refit(others=[end], search=False), progress)

    def finished(solved: DynamicSolution, profiles: Mapping[Unknown, Profiled]) -> TrackingFit:
        """The fit without encoder bias, and with intervals three ways if asked for."""
        fit = without_count_bias(solved, records, pose, count) if count else solved.fit
        return with_three_ways(solved, fit, profiles) if uncertainty else fit

    # a static fit of the same runs is biased by presliding: then g0 comes from the moving fit
    slow = load(static) if load and static_is_apart else None
    problem, start = posed_and_start(experiment, moving, records, static, slow)
    tests = [(r.file, pose([r], problem.fixed)) for r in held]
    known = [with_deflections(problem, _from(problem, near, start))] if isinstance(near, TrackingFit) else []
    if near is not None and not known:  # values of the same problem need no other start
        start = _from(problem, near, start)
    solved, profiles = fitted(problem, *known, search=near is None)
    fit, freedom = solved.fit, dict(zip(solved.solution.names, solved.solution.freedoms.tolist(), strict=True))
    scatter = clustered(*parts_of_runs(solved), fit.parameters, freedom, logarithms(fit.names))
    by_runs = finished(solved, profiles)
    alone = with_systematic(widened(by_runs, scatter, LOGARITHMIC), shifts_of(solved))
    if load and not static_is_apart:
        slow = load(alone)
    priors = _priors(problem, experiment, static if static_is_apart else {}, slow)
    if not priors:
        return DynamicStages(alone, presliding=slow)
    ended = {**solved.problem.fixed, **solved.values}
    start = start if static_is_apart else {}  # points may lead to another minimum
    posed = replace(problem, priors=tuple(priors), sigma=alone.rms)
    # what the moving runs do not show stays left out, unless another stage shows it
    peaked = {name.direction for name in posed.with_prior if name.name in ("alpha_1", "v_s")}
    out = {name: why for name, why in solved.dropped.items() if name.direction not in peaked}
    posed = replace(posed, fixed={**posed.fixed, **{name: ended[name] for name in out}})
    solved, profiles = fitted(posed, ended, dropped=out)
    joint = finished(solved, profiles)
    joint = widened(joint, with_priors_beside(scatter, by_runs, joint), LOGARITHMIC)
    joint = with_systematic(joint, shifts_of(solved))
    agree, warnings = _consistency(priors, alone, joint), [*joint.warnings]
    of_joint, of_alone = joint.relative_error, alone.relative_error
    if of_joint > levels.FACTOR * of_alone:
        message = (
            "The joint fit explains the moving runs much worse than a fit of these alone (relative error "
            f"{of_joint:.3g} % instead of {of_alone:.3g} %): the stages contradict each other."
        )
        warnings.append(Finding("stages-do-not-fit", CRITICAL, message, {"joint": of_joint, "alone": of_alone}))
    return DynamicStages(alone, replace(joint, warnings=tuple(warnings)), agree, slow)


def posed_and_start(
    experiment: Experiment,
    moving: tuple[str, ...],
    records: Sequence[Record],
    static: Mapping[str, StaticFit],
    slow: Presliding | None,
) -> tuple[DynamicProblem, Mapping[ParameterName, float]]:
    """The problem of the training runs, and its start."""
    whole = _problem(experiment, moving, records, {})
    # shape parameters, hardly seen in motion: of the static fit, else the middle of their range
    shape = dict[ParameterName, float]()
    for d, own in product(whole.directions, whole.law.peak.own):
        fit = _static_of(static, d)
        shape[ParameterName(own.name, d)] = _value(fit.parameters.get(own.name) if fit else None, own.middle)
    fixed, known = {**whole.fixed, **shape}, (*whole.friction_names, *whole.extra_names)
    if experiment.fit.model == "coulomb-viscous":  # v_s has no effect
        nothing = without_peak(whole.law)
        fixed |= {n: nothing[n.name] for n in whole.friction_names if n.name in nothing}
    for name, value in experiment.fit.fixed.items():  # a bare name stands for both directions
        meant = [n for n in known if name in (str(n), n.name)]
        if not meant:
            raise InputError(
                f"{experiment.path.name}: fit.fixed: {name} is not a parameter of the moving runs; expected one of {', '.join(map(str, known))}"
            )
        fixed |= dict.fromkeys(meant, value)
    start = {name: value for name, value in _start(whole, static, slow).items() if name not in fixed}
    return replace(whole, fixed=fixed), start


def _from(
    problem: DynamicProblem, near: TrackingFit | Values, start: Mapping[ParameterName, float]
) -> dict[ParameterName, float]:
    """The end of a fit of the same runs, completed by a start."""
    known = near.known if isinstance(near, TrackingFit) else without_deflections(near)
    told = carried(problem, known)
    return {**start, **{n: x for n, x in told.items() if n in start and (x or n.name not in LOGARITHMIC)}}


def _problem(
    experiment: Experiment,
    moving: tuple[str, ...],
    records: Sequence[Record],
    fixed: Mapping[ParameterName, float],
) -> DynamicProblem:
    """The problem of some records."""
    (known, _), options, asked = inertia(experiment), experiment.fit, regressors(experiment)
    posed = dynamic_problem(records, moving, asked, options.every, known, fixed, options.friction)
    cutoff = max(r.cutoff for r in records)
    logged = all(r.position is not None and not r.integrated for r in records)
    count = _count(experiment, records)
    return replace(posed, count=count, cutoff=cutoff, position_logged=logged, stribeck=options.model)


def _count(experiment: Experiment, records: Sequence[Record]) -> float:
    """The encoder count where velocities come from positions, rad; 0 otherwise."""
    return resolution(experiment, records) if all(r.velocity_estimated for r in records) else 0.0


def _static_of(static: Mapping[str, StaticFit], direction: Direction) -> StaticFit | None:
    return static.get(direction) or static.get(Direction.BOTH)


def _start(
    problem: DynamicProblem, static: Mapping[str, StaticFit], slow: Presliding | None
) -> dict[ParameterName, float]:
    """First values of every parameter, from the stages if known."""
    torque = float(np.median([np.abs(m.torque).mean() for m in problem.motions]))
    speed, travel = problem.fastest, problem.travel
    shared = {n: e for fit in static.values() for n, e in fit.parameters.items()}
    extra = {name: _value(shared.get(name.name), 0.0) for name in problem.extra_names}
    out: dict[ParameterName, float] = {}
    for d in problem.directions:
        fit = _static_of(static, d)
        known = fit.parameters if fit is not None else {}
        alpha_0 = max(_value(known.get("alpha_0"), 0.5 * torque), 1e-3 * torque)
        sigma_0 = _value(_stiffness(slow, d), alpha_0 / (_BENDS * travel))
        inertia_guess = max(extra.get(INERTIA, 0.0), 1e-3 * torque / speed)
        (sigma_1, *_) = evaluate(functions.presliding_damping_function(), sigma_0, inertia_guess, DAMPING_RATIO)
        first = {name: _value(known.get(name), 0.0) for name in problem.law.coefficients} | {
            "alpha_0": alpha_0,
            "alpha_1": _value(known.get("alpha_1"), 0.3 * alpha_0),
            "alpha_2": max(_value(known.get("alpha_2"), 0.1 * torque / speed), 1e-3 * torque / speed),
            "v_s": _value(known.get("v_s"), 0.1 * speed),
            "sigma_0": sigma_0,
            "sigma_1": float(sigma_1),
        }
        out |= {ParameterName(name, d): value for name, value in first.items()}
    if extra.get(INERTIA, 1.0) <= 0:  # negative inertia of a linear fit without presliding
        extra[INERTIA] = 1e-3 * torque / speed
    return out | extra


def _stiffness(slow: Presliding | None, direction: Direction) -> Estimate | None:
    """sigma_0 from presliding of one direction, or of both, with a normal error."""
    fits = [fit for d, fit in slow.fits.items() if direction in (Direction.BOTH, d)] if slow else []
    known = [
        (fit.sigma_0.value, fit.sigma_0.standard_error**2 * _scatter(fit.degrees_of_freedom), fit.sigma_0.shifts)
        for fit in fits
        if fit.sigma_0.value and fit.sigma_0.standard_error
    ]
    if not known:
        return None
    weight = np.array([1 / variance for _, variance, _ in known])
    value = float(weight @ [x for x, _, _ in known] / weight.sum())
    constants = dict.fromkeys(c for _, _, by in known for c in by)
    shifts = {c: float(weight @ [by.get(c, 0.0) for _, _, by in known] / weight.sum()) for c in constants}
    return replace(fits[0].sigma_0, value=value, standard_error=float(weight.sum() ** -0.5), shifts=shifts)


def _value(e: Estimate | None, otherwise: float) -> float:
    return otherwise if e is None or not e.value else e.value


def _priors(
    problem: DynamicProblem, experiment: Experiment, static: Mapping[str, StaticFit], slow: Presliding | None
) -> list[Prior]:
    """Static, presliding and experiment file as normal distributions."""
    priors = []
    for d in problem.directions:
        fit = _static_of(static, d)
        if fit is not None:
            rows = [k for k, name in enumerate(fit.names) if of_friction(name)]
            covariance = fit.covariance[np.ix_(rows, rows)] * _scatter(fit.degrees_of_freedom)
            if rows and np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0:
                estimates = [fit.parameters[fit.names[k]] for k in rows]
                means = np.array([e.value for e in estimates], dtype=float)
                root = np.linalg.inv(np.linalg.cholesky(covariance))
                shifts = {c: np.array([e.shifts.get(c, 0.0) for e in estimates]) for c in estimates[0].shifts}
                priors.append(Prior("static", tuple(ParameterName(fit.names[k], d) for k in rows), means, root, shifts))
        bristle = _stiffness(slow, d)
        if bristle is not None:
            value, root = np.array([bristle.value or 0.0]), np.array([[1 / (bristle.standard_error or 1.0)]])
            shifts = {c: np.array([by]) for c, by in bristle.shifts.items()}
            priors.append(Prior("presliding", (ParameterName("sigma_0", d),), value, root, shifts))
    _, known = inertia(experiment)
    if known is not None and INERTIA in problem.extra_names:
        value, root = np.array([known.value]), np.array([[1 / (known.standard_error or np.inf)]])
        priors.append(Prior("experiment file", (INERTIA,), value, root))
    free = set(problem.names)
    return [prior for prior in priors if free.issuperset(prior.names)]


def _scatter(freedom: float) -> float:
    """Variance of Student's t over its squared standard error, n / (n - 2)."""
    return 1 + 2 / (freedom - 2) if freedom > 2 else 4.0  # n / (n - 2)


def _consistency(priors: Sequence[Prior], alone: TrackingFit, joint: TrackingFit) -> tuple[Consistency, ...]:
    """Each parameter of each stage, compared with the moving runs."""
    rows = []
    # limit of a normal difference (Bonferroni)
    count = sum(alone.parameters[name].value is not None for prior in priors for name in prior.names)
    limit = float(ndtri(1 - levels.SIGNIFICANCE / (2 * max(count, 1))))
    for prior in priors:
        errors = np.sqrt(np.diag(np.linalg.inv(prior.root.T @ prior.root)))
        for k, (name, value, error) in enumerate(zip(prior.names, prior.value.tolist(), errors.tolist(), strict=True)):
            moving, both = alone.parameters[name], joint.parameters[name]
            if moving.value is None or moving.standard_error is None:
                verdict, difference = Finding("stage-unseen", NOTE, "Not identifiable from the tracking runs."), None
            else:
                apart = [by - prior.shifts[c][k] if c in prior.shifts else by for c, by in moving.shifts.items()]
                difference = (moving.value - value) / hypot(error, moving.standard_error, *apart)
                verdict = Finding("stage-agrees", NOTE, "They agree.")
                if abs(difference) > limit:
                    less = prior.stage if error > moving.standard_error else "moving"
                    message = f"They differ by more than chance; check the {less} data first, which are less precise."
                    verdict = Finding("stage-differs", CAUTION, message)
            rows.append(
                Consistency(
                    parameter=name, stage=prior.stage, stage_value=value, stage_error=error,
                    tracking_value=moving.value, tracking_error=moving.standard_error, joint_value=both.value,
                    joint_error=both.standard_error, difference_in_se=difference, verdict=verdict,
                )
            )  # fmt: skip  # a list of values
    return tuple(rows)
