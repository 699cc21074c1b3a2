"""Least squares by CasADi and IPOPT, which is silent where it ends early."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.estimation.nonlinear import Unknowns


def solver(name: str, x: ca.MX | ca.SX, cost: ca.MX | ca.SX, *given: Any, **options: object) -> ca.Function:
    """The solver of min cost(x, given), called with x0, lbx, ubx and p; `options` are IPOPT's."""
    problem: dict[str, Any] = {"x": x, "f": cost} | ({"p": ca.vertcat(*given)} if given else {})
    quiet: dict[str, Any] = {"print_level": 0, "sb": "yes", **options}
    return ca.nlpsol(name, "ipopt", problem, {"print_time": False, "error_on_fail": False, "ipopt": quiet})


def natural(unknowns: Unknowns[Any], x: ca.MX | ca.SX) -> list[Any]:
    """The unknowns in their units as expressions of the scaled ones, a column."""
    parts: Any = zip(ca.vertsplit(x), unknowns.logarithmic.tolist(), unknowns.scale.tolist(), strict=True)
    return [ca.exp(one) if logarithmic else one * size for one, logarithmic, size in parts]


def ends(whole: ca.Function, unknowns: Unknowns[Any], starts: Sequence[Array], **given: Any) -> list[Array]:
    """Scaled unknowns at the end from each start, (p,) each."""
    solved = (whole(x0=x0, lbx=unknowns.lower, ubx=unknowns.upper, **given)["x"] for x0 in starts)
    return [np.asarray(x).ravel() for x in solved]
