"""The longest control period that a loop bears, from the derivative of what it remembers after a period by what it remembered before.

The joint slides so fast that its bristle has no part; nothing is compensated, counted or limited. Where that derivative has an eigenvalue beyond the
unit circle, a swing that is large enough grows without end. A loop that is unstable in stick alone is not refused, for its swings end where the joint
breaks away; nor is one that no shorter period would mend.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import exp, inf, nan
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.control.compensator import Compensator
from bristle.control.period import controlled, moved, numbers_of, plant_size
from bristle.control.wiring import Case, Wiring
from bristle.errors import InputError
from bristle.model import law, motor
from bristle.model.parameters import Lugre, Motor, Pair

_FAST = 1e3
"""Multiples of v_s at which the joint slides."""
_LEAST = 1e-4
"""Growth in the period asked for, as a logarithm, that counts."""
_HALVINGS, _BISECTIONS = 10, 10
"""To find a shorter period that the loop bears, and then the longest."""


def refuse_long_period(wiring: Wiring, cases: Sequence[Case], period: float) -> None:
    """Raises InputError where a case diverges at this control period, s, and would not at a shorter one. Sliding mode is bounded: never refused."""
    if wiring.controller == "sliding":
        return
    rows = np.array([_linear(case, p) for case in cases for p in case.plant])
    found = growth(wiring, rows, np.full(len(rows), period))
    if not (found > _LEAST).any():
        return
    bearable = _bearable(wiring, rows, period)
    blamed = np.where(bearable > 0, found, 0.0)
    worst = int(blamed.argmax())
    if blamed[worst] > _LEAST:
        which = f"case {worst // 2}: " if len(cases) > 1 else ""
        raise InputError(
            f"{which}got a control period of {period:g} s, in which the loop's fastest mode grows by a factor of "
            f"{exp(blamed[worst]):.4g}; the loop bears about {bearable[worst]:.2g} s: shorten the period, or lower the gains or the delay"
        )


def growth(wiring: Wiring, rows: Array, period: Array) -> Array:
    """By how much the fastest mode of each row of numbers grows in its period, s, as a logarithm; (rows,)."""
    bare = replace(wiring, compensator=Compensator(name="none"), encoder=False, speedometer=False, informed=False)
    derivatives = _derivative(bare).map(len(rows))(np.vstack([rows.T, period])).full()
    size = derivatives.shape[0]
    modes = np.linalg.eigvals(derivatives.reshape(size, len(rows), size).transpose(1, 0, 2))
    return np.asarray(np.log(np.abs(modes).max(axis=1)))


def _bearable(wiring: Wiring, rows: Array, period: float) -> Array:
    """The longest periods up to this one, s, that these bear, to a thousandth; zero where none is found; (rows,)."""
    low = np.full(len(rows), period)
    for _ in range(_HALVINGS):
        low = np.where(_borne(wiring, rows, low, period), low, low / 2)
    low, high = np.where(_borne(wiring, rows, low, period), low, 0.0), np.minimum(2 * low, period)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        good = _borne(wiring, rows, middle, period)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return low


def _borne(wiring: Wiring, rows: Array, shorter: Array, period: float) -> NDArray[np.bool_]:
    """Whether nothing grows in these shorter periods, or no faster in time than what does not count."""
    return growth(wiring, rows, shorter) <= _LEAST * shorter / period


def _linear(case: Case, p: Lugre[float]) -> list[float]:
    """The numbers of a period but its length, with one set for both directions and no limit."""
    return numbers_of(replace(case, plant=Pair(p, p), torque_limit=inf), nan)[:-1]


@lru_cache(maxsize=32)
def _derivative(wiring: Wiring) -> ca.Function:
    """(numbers) -> the derivative of what is remembered after a period by what was before, in fast sliding along positive velocity."""
    now = controlled(wiring)
    n, size = plant_size(wiring), now.memory.shape[0]
    sent, numbers = ca.SX.sym("sent"), ca.vertsplit(now.numbers)
    new = ca.vertcat(*moved(wiring, now, sent))
    by = ca.jacobian(new, now.memory) + ca.mtimes(ca.jacobian(new, sent), ca.jacobian(now.sent, now.memory))
    whole = ca.vertcat(by, ca.jacobian(ca.vertcat(*now.kept), now.memory))
    own = [*range(n + 3), *range(n + 6, size)]  # the compensator has no part
    p: Lugre[Any] = Lugre(*numbers[:6])
    m: Motor[Any] = Motor(*numbers[24:28])
    v = _FAST * p.v_s
    T = law.steady_torque(v, p)
    plant = [0.0, v, law.steady_deflection(v, p), motor.current_for(T, v, m)][:n]
    held = T if wiring.drive == "torque" else motor.voltage(T, v, m)
    at = ca.Function("at", [now.memory, sent, now.given, now.numbers], [ca.densify(whole[own, own])])
    still = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]  # the controller is linear: its own derivative is the same everywhere
    there = at(ca.vertcat(*plant, *[0.0] * (size - n)), held, still, now.numbers)
    return ca.Function("derivative", [now.numbers], [there], {"cse": True})
