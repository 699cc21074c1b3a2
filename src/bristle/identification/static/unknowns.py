"""All parameters of a static problem at once as unknowns of a nonlinear fit: v_s by its logarithm, the others over a typical size."""

import numpy as np

from bristle.arrays import Array
from bristle.estimation.problem import LeastSquares, Unknowns
from bristle.identification.static.problem import Regression
from bristle.model.parameters import ParameterName, Stribeck


def least_squares(problem: Regression, v_s_range: tuple[float, float]) -> LeastSquares[ParameterName]:
    """The problem without the grid: residuals and their exact Jacobian by the scaled parameters, v_s within its range (rad/s)."""
    unknowns = unknowns_of(problem, v_s_range)

    def evaluate(x: Array) -> tuple[Array, Array]:
        """Residuals, (n,), and Jacobian, (n, p), at scaled parameters, (p,)."""
        theta = unknowns.natural(x)
        return problem.residuals(theta), -problem.jacobian(theta) * unknowns.slopes(x)

    return LeastSquares(unknowns=unknowns, evaluate=evaluate, priors=problem.priors)


def unknowns_of(problem: Regression, v_s_range: tuple[float, float]) -> Unknowns[ParameterName]:
    """The parameters in the order of the problem's `names`; a typical size is the torque over the column's largest entry."""
    torque, peaks = float(np.abs(problem.torque).max()) or 1.0, len(problem.peaks)
    columns = np.abs(problem.linear).max(axis=0)
    columns[columns == 0] = 1.0
    low, high = np.log(v_s_range)
    friction = [name.name in Stribeck._fields for name in problem.names]
    return Unknowns(
        names=problem.names,
        logarithmic=np.array([name.name == "v_s" for name in problem.names]),
        scale=np.concatenate([torque / columns, np.full(peaks, torque), np.ones(peaks)]),
        lower=np.concatenate([problem.lower, np.zeros(peaks), np.full(peaks, low)]),
        upper=np.concatenate([np.full(columns.size + peaks, np.inf), np.full(peaks, high)]),
        least=np.where(friction, 0.0, -np.inf),
    )
