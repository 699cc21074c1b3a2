"""IPOPT by way of CasADi, silent, and without an exception where it ends early: who calls judges where it ended."""

from typing import Any

import casadi as ca


def solver(name: str, x: ca.MX | ca.SX, cost: ca.MX | ca.SX, *given: Any, **options: object) -> ca.Function:
    """The solver of min cost(x, given), x a column; called with x0, lbx, ubx and, for what is given, p. `options` are IPOPT's own."""
    problem: dict[str, Any] = {"x": x, "f": cost} | ({"p": ca.vertcat(*given)} if given else {})
    settings: dict[str, Any] = {
        "print_time": False,
        "error_on_fail": False,
        "ipopt": {"print_level": 0, "sb": "yes", **options},
    }
    return ca.nlpsol(name, "ipopt", problem, settings)
