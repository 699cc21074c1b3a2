"""The longest stable control period of a loop, by the eigenvalues of its period map in fast sliding.

A loop that is unstable in stick alone, or at any shorter period, is not refused.
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
from bristle.control.control_period import (
    UNDISTURBED,
    Case,
    LoopMemory,
    LoopOptions,
    after,
    at_rest,
    controlled,
    flat,
    numbers_of,
    with_law_of,
)
from bristle.control.plant import State
from bristle.errors import InputError
from bristle.model import law, motor
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import Pair

_FAST = 1e3  # multiples of v_s at which the joint slides
_LEAST = 1e-4  # log growth per period that counts
_HALVINGS, _BISECTIONS = 10, 10  # in the search for a stable period


def refuse_long_period(options: LoopOptions, cases: Sequence[Case], period: float) -> None:
    """Raise InputError where a case diverges at this control period, s, but not at a shorter one."""
    if options.controller == "sliding":
        return
    linear = [replace(case, plant=Pair(p, p), torque_limit=inf) for case in cases for p in case.plant]
    grown = growth(options, linear, np.full(len(linear), period))
    if not (grown > _LEAST).any():
        return

    def borne(shorter: Array) -> NDArray[np.bool_]:
        """Whether nothing grows in shorter periods, or no faster in time."""
        return growth(options, linear, shorter) <= _LEAST * shorter / period

    # the longest stable periods up to this one, to a thousandth, or zero
    bearable = np.full(len(linear), period)
    for _ in range(_HALVINGS):
        bearable = np.where(borne(bearable), bearable, bearable / 2)
    bearable, high = np.where(borne(bearable), bearable, 0.0), np.minimum(2 * bearable, period)
    for _ in range(_BISECTIONS):
        middle = (bearable + high) / 2
        good = borne(middle)
        bearable, high = np.where(good, middle, bearable), np.where(good, high, middle)
    blamed = np.where(bearable > 0, grown, 0.0)
    worst = int(blamed.argmax())
    if blamed[worst] > _LEAST:
        which = f"case {worst // 2}: " if len(cases) > 1 else ""
        raise InputError(
            f"{which}got a control period of {period:g} s, in which the loop's fastest mode grows by a factor of "
            f"{exp(blamed[worst]):.4g}; the loop bears about {bearable[worst]:.2g} s: shorten the period, or lower the gains or the delay"
        )


def growth(options: LoopOptions, cases: Sequence[Case], period: Array) -> Array:
    """Log growth of each case's fastest mode per period, s, in positive sliding, (cases,); inf if no number."""
    rows = np.array([flat(numbers_of(case, nan)) for case in cases])
    options = with_law_of(options, cases)
    bare = replace(options, compensator=Compensator(name="none"), encoder=False, speedometer=False, informed=False)
    derivatives = _derivative(bare).map(len(rows))(rows.T, period[None]).full()
    size = derivatives.shape[0]
    matrices = derivatives.reshape(size, len(rows), size).transpose(1, 0, 2)
    known = np.isfinite(matrices).all(axis=(1, 2))
    grown = np.full(len(rows), inf)
    grown[known] = np.log(np.abs(np.linalg.eigvals(matrices[known])).max(axis=1))
    return grown


@lru_cache(maxsize=32)
def _derivative(options: LoopOptions) -> ca.Function:
    """(numbers, period) -> derivative of the state after a period by that before, in fast positive sliding."""
    now = controlled(options)
    memory, given, numbers = now.inputs
    sent, h = ca.SX.sym("sent"), ca.SX.sym("h")

    def linear(state: LoopMemory) -> Any:
        """Its numbers without those of the compensator."""
        return ca.vertcat(*flat(state._replace(compensator=())))

    before, new = linear(now.memory), linear(after(options, now, sent))
    by = ca.jacobian(new, before) + ca.mtimes(ca.jacobian(new, sent), ca.jacobian(now.sent, before))
    p, m = now.numbers.plant.positive, now.numbers.motor
    v = _FAST * p.v_s
    if p.law.terms:  # known up to there alone
        v = ca.fmin(v, getattr(p, FASTEST))
    T = law.steady_torque(v, p)
    current = (motor.current_for(T, v, m),) if options.inductance else ()
    sliding = at_rest(options, 0.0)._replace(plant=State(0.0, v, law.steady_deflection(v, p)), current=current)
    held = T if options.drive == "torque" else motor.voltage(T, v, m)
    at = ca.Function("at", [memory, sent, given, numbers], [ca.densify(by)])
    # the controller is linear: its own derivative is the same everywhere
    there = at(ca.vertcat(*flat(sliding)), held, flat(UNDISTURBED), numbers)
    return ca.Function("derivative", [numbers, h], [ca.substitute(there, now.numbers.period, h)], {"cse": True})
