"""Design of slow loading below breakaway, to determine sigma_0.

At count edge k the torque T_k is read with noise: y(T_k; g0, sigma_0) = k q - y0, with y of `law.loading_displacement`
and an unknown rest position y0.
"""

from collections.abc import Sequence

import numpy as np

from bristle.arrays import Array, result
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.parameters import Direction, Lugre
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design.start import Start, inverse
from bristle.simulation.fisher import covariance
from bristle.simulation.limits import Limits

PEAKS = np.linspace(0.1, 0.8, 36)  # over g0 = alpha_0 + alpha_1; near 1 noise of the torque moves the joint far
RISES = np.array([5.0, 8.0, 14.0, 25.0, 40.0])  # times to the peak, s
CYCLES = 2  # rises in a run
_TENTH = 0.1  # averaging time of the torque noise of slow loading, s


@result
class LoadingDesign:
    """Slow loading of one direction."""

    direction: Direction
    peak: float  # torque where it turns, N*m
    share: float  # of g0
    rise: float  # time from zero to the peak, s
    counts: float  # encoder counts that the joint should move; inf: a count is not known
    viscous_share: float  # neglected torque of sigma_1 and alpha_2 at the end of the rise, over its torque
    noise_error: float  # expected standard error of sigma_0 by noise, N*m/rad, of `CYCLES` rises; inf: not identifiable
    error: float  # root of the sum of squares of that and `viscous_share` times sigma_0, N*m/rad


def plan_loading(
    measured: Measured, joint: Joint, start: Start, direction: Direction, limits: Limits, share: float
) -> LoadingDesign:
    """Slow loading in a direction, + or -, by the estimates and the noise of the loadings so far."""
    p, hold_noise = start.p(direction), start.noise[start.direction_of(direction)]
    of_g0 = seen_covariance(start.known, start.indices(direction, ("alpha_0", "alpha_1")))
    g0_error = float(np.sqrt(of_g0.sum())) if of_g0.size else hold_noise
    # Noise of a tenth of a second's mean torque at the count edges of measured loadings, if there are enough.
    slow = joint.presliding.fits.get(direction) if joint.presliding else None
    g0, residuals = p.alpha_0 + p.alpha_1, []
    for loading in slow.loadings if slow else ():
        keep = loading.edge_torque < PEAKS[-1] * g0
        if keep.sum() > 2:
            y, y_T = evaluate(functions.loading_displacement_function(), loading.edge_torque[keep], g0, p.sigma_0)[:2]
            left = y - loading.edge_displacement[keep]
            residuals.append((left - left.mean()) / y_T)
    noise = 0.0
    if residuals:
        cutoff = max(r.cutoff for r in measured.slow)
        noise = float(np.std(np.concatenate(residuals)) / np.sqrt(2 * cutoff * _TENTH))
    noise = noise or hold_noise * float(np.sqrt(limits.hold / share / _TENTH))
    return design_loading(direction, p, g0_error, noise, start.resolution, share)


def design_loading(
    direction: Direction, p: Lugre[float], g0_error: float, noise: float, count: float, share: float = 1.0
) -> LoadingDesign:
    """The peak and rise with the least error of sigma_0.

    `g0_error`: standard error of alpha_0 + alpha_1, N*m; `noise`: of a tenth of a second's mean torque, N*m; `count`: of
    the encoder, rad, or 0; `share`: of the times in `RISES`.
    """
    g0, rises = p.alpha_0 + p.alpha_1, share * RISES
    scatter, viscous, y = loading_errors(p, g0_error, noise, count, rises)
    errors = np.hypot(scatter, viscous * p.sigma_0)
    best = errors.min(axis=1)  # the shortest rise that is at most a tenth worse than the longest
    row = int(np.argmax(best <= 1.1 * best[-1])) if np.isfinite(best[-1]) else RISES.size - 1
    column = int(errors[row].argmin()) if np.isfinite(best[-1]) else PEAKS.size - 1
    return LoadingDesign(
        direction=direction, peak=float(PEAKS[column] * g0), share=float(PEAKS[column]), rise=float(rises[row]),
        counts=float(y[column] / count) if count else np.inf, viscous_share=float(viscous[row, column]),
        noise_error=float(scatter[row, column]), error=float(errors[row, column]),
    )  # fmt: skip  # a list of values


def loading_errors(p: Lugre[float], g0_error: float, noise: float, count: float, rises: Array) -> tuple[Array, ...]:
    """Standard error of sigma_0 by noise, and viscous share, by rise and peak, (m, k); displacement at peaks, (k,)."""
    g0, noise = p.alpha_0 + p.alpha_1, noise / CYCLES**0.5
    scatter = np.array([[_stiffness_error(p, r * g0, g0_error, noise, count, rise) for r in PEAKS] for rise in rises])
    y, y_T = evaluate(functions.loading_displacement_function(), PEAKS * g0, g0, p.sigma_0)[:2]
    return scatter, (p.sigma_1 + p.alpha_2) * y_T / rises[:, None], y


def seen_covariance(information: Array, at: Sequence[int]) -> Array:
    """Marginal covariance of the identifiable parameters at the indices `at`, ascending."""
    seen = np.flatnonzero(np.diag(information) > 0)
    among = np.flatnonzero(np.isin(seen, at))
    return inverse(information[np.ix_(seen, seen)])[np.ix_(among, among)]


def _stiffness_error(p: Lugre[float], peak: float, g0_error: float, noise: float, count: float, rise: float) -> float:
    """Standard error of sigma_0 from one rise to a peak with unknown rest position; inf below two edges."""
    g0 = p.alpha_0 + p.alpha_1
    reach = float(evaluate(functions.loading_displacement_function(), peak, g0, p.sigma_0)[0])
    edges = reach / count if count else np.inf
    if edges < 2:
        return np.inf
    looked = int(min(edges, 400))  # edges computed
    T = g0 * -np.expm1(-p.sigma_0 / g0 * reach * (np.arange(looked) + 0.5) / looked)  # where the edges are, no model
    _, y_T, y_g0, y_sigma_0 = evaluate(functions.loading_displacement_function(), T, g0, p.sigma_0)
    averages = rise / _TENTH
    alone = max(1.0, edges / averages) * looked / edges if np.isfinite(edges) else looked / averages
    rows = np.column_stack([y_sigma_0, np.ones(looked), y_g0]) / (y_T * noise * np.sqrt(alone))[:, None]
    matrix = rows.T @ rows + np.diag([0.0, 0.0, max(g0_error, 1e-9 * g0) ** -2])
    return float(covariance(matrix)[0][0])
