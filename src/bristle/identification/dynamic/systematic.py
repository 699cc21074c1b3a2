"""What errors of constants do to a fit of moving data, to first order.

A constant that is off by its standard error changes the measured torque by dT, and so the residuals by dr; the minimum
then moves by -(J'J)**-1 J' dr, J being the Jacobian of the residuals. Rows of priors move as the stages behind them do:
what has the same cause is not averaged out. An inertia that is given holds its ground.
"""

from collections.abc import Mapping

import numpy as np

from bristle.estimation.covariance import seen
from bristle.estimation.linear import first_order
from bristle.estimation.nonlinear import projected
from bristle.identification.dynamic.fit import DynamicSolution
from bristle.identification.dynamic.output_error import with_more_torque
from bristle.identification.dynamic.problem import residuals
from bristle.model.parameters import ParameterName

_STEP = 1e-2  # of a standard error: by so much either way a constant is moved where the motor is simulated


def shifts_of(solved: DynamicSolution) -> dict[str, Mapping[ParameterName, float]]:
    """Change of each free parameter that lies at no bound, per standard error of each constant, by constant."""
    problem, posed, minimum = solved.problem, solved.solution.posed, solved.solution.minimum
    held = [*(m.shifts for m in problem.motions), *(prior.shifts for prior in problem.priors)]
    constants = dict.fromkeys(constant for by in held for constant in by)
    x, unknowns, shared = minimum.x, posed.unknowns, posed.shared
    if not constants or not shared.size:  # nothing is uncertain, or every parameter is given
        return {constant: {} for constant in constants}
    inside = (x > unknowns.lower) & (x < unknowns.upper)
    chosen = shared[seen(minimum.jacobian[:, shared]) & inside[shared]]
    J, slopes = projected(minimum.jacobian, chosen, posed.blocks), unknowns.slopes(x)[chosen]
    weight, shifts = problem.weight, dict[str, Mapping[ParameterName, float]]()
    for constant in constants:
        if problem.quantity == "torque":
            rows = [m.smoothed(m.shifts.get(constant, np.zeros(m.time.size))) for m in problem.motions]
            change = np.concatenate(rows)
        else:
            more, less = (
                residuals(with_more_torque(problem, constant, by), solved.values)[0] for by in (_STEP, -_STEP)
            )
            change = (more - less) / (2 * _STEP)
        of_priors = [
            -problem.sigma * (prior.root @ prior.shifts.get(constant, np.zeros(prior.value.size)))
            for prior in problem.priors
        ]
        moved = -first_order(J, np.concatenate([change * weight, *of_priors])) * slopes
        names = (unknowns.names[k] for k in chosen.tolist())
        shifts[constant] = {n: by for n, by in zip(names, moved.tolist(), strict=True) if isinstance(n, ParameterName)}
    return shifts
