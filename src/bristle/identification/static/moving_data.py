"""A static fit from moving runs, where there are no points: linear least squares with the grid, and what it leaves out."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.record import Record
from bristle.diagnostics import Diagnostic, Kind
from bristle.errors import InputError
from bristle.identification.moving_runs import directions, inertia, regressors
from bristle.identification.results import Crosscheck, StaticFit
from bristle.identification.static import problem as regression
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import Regression
from bristle.model.parameters import INERTIA, Stribeck


def fit_moving(
    experiment: Experiment, records: Sequence[Record], held: Sequence[Record], timings: dict[str, float] | None
) -> tuple[dict[str, StaticFit], dict[str, Crosscheck], tuple[Diagnostic, ...]]:
    """Static parameters and the declared regressors from moving runs, by linear least squares with the grid: fits, cross-checks, doubts.

    Raises InputError where a run lacks a signal, is too short, or its torque opposes its velocity.
    """
    fixed, prior = inertia(experiment)
    moving, asked = directions(experiment, records), regressors(experiment)

    def problem(chosen: Sequence[Record]) -> tuple[Regression, tuple[Array, Array], int]:
        """The regression of some records, time and position of each equation, samples dropped at ends."""
        return regression.from_records(chosen, moving, asked, experiment.fit.decimation, fixed)

    every, (time, position), _ = problem(records)
    training, fast = _above(every, experiment.fit.moving_above)
    where = PointInfo(time=time[fast], position=position[fast[: position.size]])
    if prior is not None and "inertia" in asked:
        free = training.linear @ np.linalg.lstsq(training.linear, training.torque, rcond=None)[0]
        sigma = float(np.std(training.torque - free))
        training = regression.with_prior(training, INERTIA, prior.value, float(prior.standard_error or 0.0), sigma)
    tests = [(r.file, _above(problem([r])[0], experiment.fit.moving_above)[0]) for r in held]
    fits, checks = fit_static(training, experiment.fit, experiment.joint.kind, where, tests, timings)
    return fits, checks, _left_out(experiment, every, fast, fits)


def _above(problem: Regression, speed: float | None) -> tuple[Regression, NDArray[np.bool_]]:
    """The equations faster than a speed, and which those are, (n,)."""
    if speed is None:
        return problem, np.ones(problem.torque.size, dtype=bool)
    fast = np.abs(problem.velocity if problem.smooth is None else problem.smooth @ problem.velocity) > speed
    if fast.sum() <= problem.linear.shape[1]:
        raise InputError(
            f"fit.moving_above: {int(fast.sum())} of {fast.size} equations are faster than {speed:.3g}, too few for a fit; lower it"
        )
    return problem.rows(fast), fast


def _left_out(
    experiment: Experiment, every: Regression, fast: NDArray[np.bool_], fits: Mapping[str, StaticFit]
) -> tuple[Diagnostic, ...]:
    """How the fit does on the slow equations that were left out of it."""
    if fast.all():
        return ()
    slow = every.rows(~fast)
    values = {(name, d): e.value or 0.0 for d, fit in fits.items() for name, e in fit.parameters.items()}
    extra = {name: value for (name, d), value in values.items() if name not in Stribeck._fields}
    theta = np.array([values.get(n, extra.get(n.name, 0.0)) or (1.0 if n.name == "v_s" else 0.0) for n in every.names])
    return (
        Kind.SLOW_LEFT_OUT(
            slow=int((~fast).sum()),
            equations=fast.size,
            above=experiment.fit.moving_above,
            error=slow.relative_error(theta),
        ),
    )
