"""How often 95 % intervals cover the truth in simulated data, and how often bristle gives none."""

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation import covariance
from bristle.identification.static.batch import Batch
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.fit_warnings import is_closed
from bristle.identification.static.grid import solve
from bristle.identification.static.uncertainty import resample
from bristle.questions.method_validation import solvers as methods
from bristle.questions.method_validation.results import Coverage
from bristle.questions.method_validation.solvers import ValidationCase

INTERVAL_SETS, BOOTSTRAP_SETS, DRAWS = 200, 100, 399
"""Data sets at most of which the intervals are counted, and the bootstrap's, from so many draws each."""


def covers_truth(case: ValidationCase, theta: Array, cost: Array) -> NDArray[np.bool_]:
    """Which intervals by the exact Jacobian's covariance cover the truth, (p, sets); theta (p, sets), cost (sets,)."""
    n, p = case.velocity.size, len(case.names)
    jacobian = methods.jacobians(case, theta)
    length = np.linalg.norm(jacobian, axis=1)
    alive = (length > 0).all(axis=1)
    scaled = jacobian[alive] / length[alive, None, :]
    values, vectors = np.linalg.eigh(scaled.transpose(0, 2, 1) @ scaled)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.einsum("sij,sj->si", vectors**2, np.where(values > 1e-13, 1 / values, np.inf))
    error = np.full((p, cost.size), np.nan)
    error[:, alive] = np.sqrt(inverse).T / length[alive].T * np.sqrt(cost[alive] / (n - p))
    error[~np.isfinite(error)] = np.nan
    inside: NDArray[np.bool_] = np.abs(theta - case.theta[:, None]) <= covariance.student(n - p) * error
    return inside


def interval_coverage(case: ValidationCase, torques: Array, *, identifiable: bool) -> tuple[Coverage, ...]:
    """Coverage of bristle's own intervals; the bootstrap only where v_s can be known."""
    few = np.ascontiguousarray(torques[:, :INTERVAL_SETS])
    fits = Batch(case.problem(few[:, 0]), few, case.v_s_range)
    ends = {"covariance": fits.covariance_intervals(), "profile": fits.profile_intervals()}
    if identifiable:
        problems = [case.problem(torque) for torque in few.T[:BOOTSTRAP_SETS]]
        resampled = [resample(p, solve(p, case.v_s_range), case.v_s_range, DRAWS) for p in problems]
        ends["bootstrap-t"] = (
            np.stack([x.low for x in resampled], axis=1),
            np.stack([x.high for x in resampled], axis=1),
        )
    return tuple(
        Coverage(
            kind=kind,
            repetitions=low.shape[1],
            share=((low <= case.theta[:, None]) & (case.theta[:, None] <= high)).mean(axis=1),
        )
        for kind, (low, high) in ends.items()
    )


def declined_share(case: ValidationCase, torques: Array) -> float:
    """Share of data sets of which bristle says that v_s is not identifiable, or has no finite interval."""
    options = FitOptions()
    v_s = [estimate_static(case.problem(t), options, "revolute", case.v_s_range).get("v_s") for t in torques.T]
    return float(np.mean([x is None or x.interval is None or not is_closed(x.interval) for x in v_s]))
