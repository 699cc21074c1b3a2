"""What to measure next: what would remove the doubts, in speeds and files that a user can set."""

from collections.abc import Iterator

import numpy as np

from bristle.identification.estimate import Joint, Outcome, StaticFit
from bristle.model.arrays import Array
from bristle.model.parameters import unit
from bristle.report.wording import direction as named
from bristle.report.wording import number, pretty

WIDE = 0.15
"""A standard error above this share of its value is called wide."""


def next_measurements(joint: Joint) -> tuple[str, ...]:
    """Sentences that say which runs would help most, each with its range; empty where nothing is in doubt."""
    advice = [f"{named(d)}: {text}" for d, fit in joint.static.items() if d != "shared" for text in _of_fit(joint, fit)]
    sticking = sorted({s.file for s in joint.segments if s.stick_slip})
    if sticking:
        advice.append(
            f"Repeat {', '.join(sticking)} with a stiffer velocity loop, or slightly faster: these runs stick and slip, so their mean "
            "torque is not the friction of steady sliding."
        )
    if {"+", "-"} & set(joint.static) and not {"+", "-"} <= set(joint.static):
        missing = "-" if "+" in joint.static else "+"
        advice.append(f"Measure direction {named(missing)} at the same speeds: nothing is known of it.")
    if not any(fit.hold_out for fit in joint.static.values()):
        advice.append("Hold back one run (hold_out: true): the error on data that were not fitted is the one to trust.")
    return tuple(advice)


def _of_fit(joint: Joint, fit: StaticFit) -> Iterator[str]:
    speeds = np.abs(fit.velocity[fit.velocity != 0])
    v_unit = pretty(unit("velocity", joint.kind))
    if fit.outcome is Outcome.TOO_FEW or speeds.size == 0:
        yield "measure at least eight constant speeds, evenly spread in log(v) over two decades or what the joint allows."
        return
    slow, fast = float(speeds.min()), float(speeds.max())
    slower = f"{number(slow / 10, 2)} to {number(slow, 2)} {v_unit}"
    if fit.outcome is Outcome.NO_STRIBECK:
        yield f"if friction rises at low speed, it does so below what was measured: try five constant speeds from {slower}."
        return
    yield from _of_stribeck(fit, speeds, v_unit, slower)
    viscous = fit.parameters.get("alpha_2")
    if viscous and viscous.value and viscous.standard_error and viscous.standard_error > WIDE * viscous.value:
        yield f"α₂ is wide: measure faster, {number(fast, 2)} to {number(2 * fast, 2)} {v_unit}, where the viscous part is larger."


def _of_stribeck(fit: StaticFit, speeds: Array, v_unit: str, slower: str) -> Iterator[str]:
    v_s = fit.parameters.get("v_s")
    if v_s is None or v_s.value is None:
        return
    low, high = v_s.interval or (0.0, np.inf)
    if np.count_nonzero(speeds < v_s.value) < 3:
        yield (
            f"fewer than three points lie below vₛ: measure five constant speeds from {number(v_s.value / 5, 2)} "
            f"to {number(v_s.value, 2)} {v_unit}."
        )
    elif low <= 0:
        yield f"nothing limits vₛ below: measure five constant speeds from {slower}."
    if np.isinf(high):
        top = float(speeds.max())
        yield f"nothing limits vₛ above: measure more speeds from {number(v_s.value, 2)} to {number(2 * top, 2)} {v_unit}."
    elif v_s.standard_error and v_s.standard_error > WIDE * v_s.value:
        yield (
            f"vₛ is wide: measure more speeds, or longer runs, from {number(v_s.value / 2, 2)} to {number(2 * v_s.value, 2)} {v_unit}, "
            "where the curve bends."
        )
