"""Moving data in few equations: the same static problem, a hundred times smaller, for what solves it over and over."""

from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from bristle.arrays import Array
from bristle.identification.static.grid import GRID, log_grid
from bristle.identification.static.problem import Regression

_NODES = 1000
_SLOWEST = 1e-7
"""Of the fastest speed: where nodes begin."""


def reduced(problem: Regression, v_s_range: tuple[float, float]) -> Regression:
    """The problem in fewer equations and velocities: the same sums of squares for every theta with v_s in the range, to about 1e-8 of the torque's.

    Nothing is left out that the columns or the torque hold, so the costs are the same, not only the minimum. Points that are not smoothed are
    returned as they are.
    """
    if problem.smooth is None:
        return problem
    basis = _basis(problem, v_s_range)
    weight = np.ones(problem.torque.size) if problem.root_weight is None else problem.root_weight
    two = len(problem.directions) == 2
    velocities, shares = [], []
    for sign in (1.0, -1.0) if two else (1.0,):
        moving = problem.velocity * sign > 0 if two else problem.velocity != 0
        nodes, own = _gathered(problem.velocity[moving], (problem.smooth[:, moving].T @ (basis * weight[:, None])).T)
        velocities.append(sign * nodes)
        shares.append(sign * own)
    return replace(
        problem,
        velocity=np.concatenate(velocities),
        torque=basis.T @ problem.torque,
        linear=basis.T @ problem.linear,
        smooth=sparse.csr_array(np.concatenate(shares, axis=1)),
        root_weight=None,
        known=None,
        memory={},
    )


def _basis(problem: Regression, v_s_range: tuple[float, float]) -> Array:
    """Orthonormal directions, (n, r), that span the torque and the model's columns for every v_s in the range, to 1e-8."""
    values = log_grid(v_s_range, GRID)
    shapes = [problem.shapes(values, k) for k in range(len(problem.peaks))]
    columns = np.column_stack([problem.linear, *shapes, problem.torque])
    sizes = np.linalg.norm(columns, axis=0)
    left, lengths, _ = np.linalg.svd(columns / np.where(sizes > 0, sizes, 1.0), full_matrices=False)
    kept: Array = left[:, lengths > 1e-8 * lengths[0]]
    return kept


def _gathered(velocity: Array, shares: Array) -> tuple[Array, Array]:
    """Few velocities that stand for many: the same weighted sums of any odd curve as smooth as a friction law.

    A cubic spline in log(abs(v)) through the curve's values at the nodes meets it within about 1e-9 of its size, so each sample's share can be
    handed to the nodes. Slower than 1e-7 of the fastest sample, a curve counts as constant.

    Args:
        velocity: of the samples, none zero, (N,).
        shares: of each sample in r sums, (r, N).

    Returns:
        The nodes, positive, (m,), and their shares, (r, m).
    """
    speed = np.abs(velocity)
    high = float(np.log(speed.max()))
    low = max(float(np.log(speed.min())), high + np.log(_SLOWEST))
    at = np.linspace(low, max(high, low + 1.0), _NODES)
    knots = np.concatenate([[at[0]] * 4, at[2:-2], [at[-1]] * 4])
    on_samples = BSpline.design_matrix(np.clip(np.log(speed), at[0], at[-1]), knots, 3)
    on_nodes: Array = BSpline.design_matrix(at, knots, 3).toarray()
    of_splines = np.asarray(on_samples.T @ (shares * np.sign(velocity)).T, dtype=np.float64)
    nodes: Array = np.exp(at)
    return nodes, np.asarray(np.linalg.solve(on_nodes.T, of_splines).T, dtype=np.float64)
