"""The second route: the same least-squares problem through CasADi and IPOPT, and how its answer compares.

IPOPT is silent, and raises no exception where it ends early: who calls judges where it ended.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Generic, NamedTuple

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.estimation.nonlinear import Name, Unknowns


class SecondRoute(NamedTuple, Generic[Name]):
    """Where the second route ended, beside the first."""

    cost_grid: float
    """The cost of the first."""
    cost_full: float
    """The lowest cost of any end of the second."""
    starts: int
    reached: int
    """How many starts ended at the lowest cost."""
    parameters: Mapping[Name, float]
    difference_in_se: Mapping[Name, float]
    """Second less first, in standard errors of the first, where there is one."""
    agrees: bool
    """Whether both found the same cost."""

    @property
    def worst(self) -> float:
        """The largest difference in standard errors."""
        return max(map(abs, self.difference_in_se.values()), default=0.0)


def solver(name: str, x: ca.MX | ca.SX, cost: ca.MX | ca.SX, *given: Any, **options: object) -> ca.Function:
    """The solver of min cost(x, given), called with x0, lbx, ubx and, for what is given, p; `options` are IPOPT's."""
    problem: dict[str, Any] = {"x": x, "f": cost} | ({"p": ca.vertcat(*given)} if given else {})
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", **options}
    return ca.nlpsol(name, "ipopt", problem, {"print_time": False, "error_on_fail": False, "ipopt": quiet})


def natural(unknowns: Unknowns[Any], x: ca.MX | ca.SX) -> list[Any]:
    """The unknowns in their units as expressions of the scaled ones, a column."""
    parts: Any = zip(ca.vertsplit(x), unknowns.logarithmic.tolist(), unknowns.scale.tolist(), strict=True)
    return [ca.exp(one) if logarithmic else one * size for one, logarithmic, size in parts]


def ends(whole: ca.Function, unknowns: Unknowns[Any], starts: Sequence[Array], **given: Any) -> list[Array]:
    """The scaled unknowns where a `solver` ends from each start between the bounds, (p,) each."""
    solved = (whole(x0=x0, lbx=unknowns.lower, ubx=unknowns.upper, **given)["x"] for x0 in starts)
    return [np.asarray(x).ravel() for x in solved]


def compared(
    values: Mapping[Name, float],
    cost: float,
    errors: Mapping[Name, float | None],
    minima: Sequence[Mapping[Name, float]],
    costs: Sequence[float],
    same: float,
) -> SecondRoute[Name]:
    """The ends of the second route beside the answer of the first, by name, its cost there and its standard errors.

    `costs` at the `minima` are by the first's own reckoning; those that differ by less than `same` are the same.
    """
    lowest = min(costs)
    parameters = minima[costs.index(lowest)]
    known = {name: error for name, error in errors.items() if name in parameters and error and np.isfinite(error)}
    return SecondRoute(
        cost_grid=cost, cost_full=lowest, starts=len(costs), reached=sum(one <= lowest + same for one in costs),
        parameters=parameters,
        difference_in_se={name: (parameters[name] - values[name]) / error for name, error in known.items()},
        agrees=abs(lowest - cost) <= same,
    )  # fmt: skip  # a list of values
