"""A static fit from an experiment's runs: points at constant velocity, of a direction or both, or moving runs."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.findings import NOTE, Finding
from bristle.identification.fits import Crosscheck, StaticFit, TrackingFit
from bristle.identification.load_levels import levels_of, settled_weights
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import (
    DIRECTIONS,
    directions,
    inertia,
    refuse_noise,
    refuse_opposing,
    regressors,
)
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.points import groups, point_regressors, points_problem
from bristle.identification.static.problem import Regression, from_records, with_prior
from bristle.model.parameters import INERTIA, ParameterName


def refuse_opposing_points(experiment: Experiment, points: Sequence[Segment], asked: Sequence[str]) -> None:
    """Raise InputError where the torque of points is noise, or opposes their velocity: of each direction, or of both about an offset.

    Where gravity is asked for, which may outweigh friction, nothing is refused.
    """
    v, T = (np.array([getattr(s, name) for s in points]) for name in ("velocity", "torque"))
    for d, sign in DIRECTIONS.items() if not asked else ():
        own = v * sign > 0
        refuse_opposing(experiment, v[own], T[own], f"at the {np.count_nonzero(own)} points of direction {d}")
    if asked and "gravity" not in asked and v.size and v.min() < 0 < v.max():
        refuse_noise(experiment, v, T, f"at the {v.size} points")
        middle = (T[v > 0].mean() + T[v < 0].mean()) / 2
        refuse_opposing(experiment, v, T - middle, f"at the {v.size} points, an offset apart")


def fit_points(measured: Measured, points: Sequence[Segment]) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Static parameters and the declared regressors from points at constant velocity: fits and cross-checks.

    Raises InputError where a regressor needs what points do not have, or torque opposes velocity.
    """
    experiment, asked = measured.experiment, point_regressors(measured.experiment)
    if "inertia" in (experiment.fit.regressors or ()) and not measured.moving(hold_out=False):  # which can tell it
        raise InputError(
            f"{experiment.path.name}: fit.regressors: inertia needs acceleration, which constant-velocity points do not have; "
            "leave it out, or give the runs as experiment: tracking"
        )
    held, law = measured.points(hold_out=True), experiment.fit.friction
    static: dict[str, StaticFit] = {}
    checks: dict[str, Crosscheck] = {}
    refuse_opposing_points(experiment, points, asked)
    searches = {search.sides: search for search in measured.searches}
    for sides, group in groups(experiment, points):
        signs = [DIRECTIONS[d] for d in sides if d in DIRECTIONS] or list(DIRECTIONS.values())
        both = by_file(s for s in held if np.sign(s.velocity) in signs), by_file(group)
        tests, apart = ([(file, points_problem(s, sides, asked, law)) for file, s in of.items()] for of in both)
        runs = [(file, one) for file, one in apart if one.torque.size > len(one.names)]
        # a run of one point has no course over time
        known = [[s.time for s in group] if len(apart) < len(group) else [None], [s.position for s in group]]
        time, position = (np.zeros(0) if None in x else np.array(x, dtype=float) for x in known)
        where = PointInfo(segments=group, time=time, position=position, search=searches.get(sides))
        problem = points_problem(group, sides, asked, law)
        fits, checked = fit_static(problem, experiment.fit, experiment.joint.kind, where, tests, runs)
        static |= fits
        checks |= checked
    return static, checks


def by_file(points: Iterable[Segment]) -> dict[str, list[Segment]]:
    """The points of each run, in their order."""
    found = defaultdict[str, list[Segment]](list)
    for s in points:
        found[s.file].append(s)
    return found


def fit_moving(
    experiment: Experiment, records: Sequence[Record], held: Sequence[Record]
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck]]:
    """Static parameters and the declared regressors from moving runs, by linear least squares with the grid.

    Fits and cross-checks. Raises InputError where a run lacks a signal, is too short, or its torque opposes its
    velocity.
    """
    fixed, prior = inertia(experiment)
    moving, asked = directions(experiment, records), regressors(experiment)

    def problem(
        chosen: Sequence[Record], weights: Mapping[str, float] | None
    ) -> tuple[Regression, tuple[Array, Array], int]:
        """The regression of some records, time and position of each equation, samples dropped at ends."""
        return from_records(chosen, moving, asked, experiment.fit.every, fixed, experiment.fit.friction, weights)

    def fitted(weights: Mapping[str, float]) -> Mapping[ParameterName, float]:
        """By the grid, with gravity and links that weigh so much where the level rises with their load."""
        one = problem(records, weights)[0]
        return one.named(solve(one, default_range(one.velocity)).theta)

    weights = settled_weights(fitted, problem(records, None)[0].weights) if levels_of(asked) else {}
    training, (time, position), _ = problem(records, weights)
    where = PointInfo(time=time, position=position)
    if prior is not None and "inertia" in asked:
        free = training.linear @ np.linalg.lstsq(training.linear, training.torque, rcond=None)[0]
        sigma = float(np.std(training.torque - free))
        training = with_prior(training, INERTIA, prior.value, float(prior.standard_error or 0.0), sigma)
    tests = [(r.file, problem([r], weights)[0]) for r in held]
    apart = [(r.file, problem([r], weights)[0]) for r in records if len(records) > 1]
    runs = [(file, one) for file, one in apart if one.torque.size > len(one.names)]
    return fit_static(training, experiment.fit, experiment.joint.kind, where, tests, runs)


def beside_moving(static: Mapping[str, StaticFit], moving: TrackingFit | None) -> dict[str, StaticFit]:
    """The static fits of moving runs; where the fit of all parameters of the same runs knows their friction, their outcome says so.

    A static law is LuGre's with a bristle that does not bend: the poorer model of the same runs, whose errors do not know what
    presliding does to it. One fit gives a joint's values; what is said of the other is then no reason to doubt them. One that
    estimated nothing says why, as before.
    """
    if moving is None or all(e.value is None for name, e in moving.parameters.items() if name.name == "alpha_0"):
        return dict(static)
    found = dict(static)
    for d, fit in static.items():
        if fit.relative_error is not None:
            message = (
                f"Without presliding, of which its errors know nothing: the relative error is {fit.relative_error:.2g} %, and "
                f"{moving.relative_error:.2g} % with it. Use the fit of all parameters of the moving runs, not these numbers."
            )
            numbers = {"error": fit.relative_error, "other": moving.relative_error}
            found[d] = replace(fit, outcome=Finding("static-superseded", NOTE, message, numbers), warnings=())
    return found


def is_superseded(fit: StaticFit) -> bool:
    """Whether the fit of all parameters of the same runs is the one to use."""
    return fit.outcome.code == "static-superseded"
