"""Fits of many simulated sets of torques at the same constant velocities, under any law."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import numpy as np

from bristle.arrays import Array
from bristle.identification.static.batch import COARSE, Batch
from bristle.identification.static.grid import default_range
from bristle.identification.static.problem import from_points
from bristle.model.parameters import Lugre
from bristle.questions.experiment_design.velocities import SEED, DesignProblem, evaluate_design
from bristle.simulation.bench import steady_points

_SHAPES = 40  # shapes of a peak that are tried where there is more to it than v_s
_REACH, _FAR = 4.0, 9.0  # ... so many expected standard errors about the estimate, of a logarithm at most so far


def fitted(p: Lugre[float], speeds: Array, torques: Array, relative: Mapping[str, float]) -> dict[str, Array]:
    """Each static parameter of fits of the sets of torques, (sets,); of a peak's shape the best of some that are tried.

    Args:
        p: what they are simulated from.
        speeds: rad/s, (n,).
        torques: N*m, (n, sets).
        relative: the expected standard error of each parameter over its size.
    """
    law, default = p.law, default_range(speeds)
    regression = from_points(speeds, torques[:, 0], ("both",), law=law)
    tried = round(_SHAPES ** (1 / max(len(law.peak.own), 1)))
    ranges = []
    for own in law.peak.own:
        ends = getattr(p, own.name) * np.exp(np.array([-1, 1]) * min(_REACH * relative[own.name], _FAR))
        low, high = np.clip(ends, *own.searched).tolist()
        ranges.append(np.geomspace(low, high, tried).tolist())
    shapes = list(product(*ranges))
    batches = [Batch(replace(regression, shape=x, memory={}), torques, default, COARSE) for x in shapes]
    best = np.argmin([batch.cost for batch in batches], axis=0)
    theta = np.take_along_axis(np.array([batch.theta for batch in batches]), best[None, None], axis=0)[0]
    shape = zip((own.name for own in law.peak.own), np.array(shapes)[best].T, strict=True)
    return dict(zip((name.name for name in regression.names), theta, strict=True)) | dict(shape)


def spaced_speeds(problem: DesignProblem, count: int, kind: str) -> Array:
    """As many speeds over the problem's range, spaced evenly (`even`) or evenly in log(v) (`log`), rad/s, (count,)."""
    return np.asarray((np.linspace if kind == "even" else np.geomspace)(problem.low, problem.high, count))


def simulated_errors(problem: DesignProblem, speeds: Array, repetitions: int = 2000, seed: int = SEED) -> Array:
    """How fits of these runs alone scatter, SIMULATED from the estimate with Gaussian noise, (4,), as the problem's names."""
    # half the width of the middle 68.3 % of the estimates, which is the standard deviation where they are normal and is
    # not ruled by a few that fail
    torques = steady_points(problem.p, speeds, problem.noise, np.random.default_rng(seed), repetitions)
    relative = evaluate_design(problem, speeds).errors / np.abs(problem.estimate)
    found = fitted(problem.p, speeds, torques.T, dict(zip(problem.names, relative.tolist(), strict=True)))
    low, high = np.percentile([found[name] for name in problem.names], [15.87, 84.13], axis=1)
    return np.asarray((high - low) / 2)
