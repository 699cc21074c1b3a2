"""What to measure next: what would remove the warnings, in speeds and files that a user can set."""

from collections.abc import Iterator

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint, StaticFit
from bristle.model.parameters import unit
from bristle.page.wording import direction as named
from bristle.page.wording import number, pretty, symbol

WIDE = 0.15
"""A standard error above this share of its value is called wide."""
_MOTIONS = {
    ("alpha_1", "v_s"): "add constant velocities below and around vₛ (experiment: ramp), or move long and slowly there",
    ("alpha_2",): "move faster, where the viscous part is larger",
    (
        "sigma_0",
        "sigma_1",
    ): "add slow loading below breakaway (experiment: presliding), or turn often and slowly, by a few times the way in which friction builds up",
    ("inertia",): "accelerate harder, or give the inertia",
}
"""Parameters that moving runs may leave open, and what would show them."""
_CLEAR = 1.1
"""How far above a speed that sticks and slips a proposed one lies."""


def next_measurements(joint: Joint) -> tuple[str, ...]:
    """Sentences that say which runs would help most, each with its range; empty where there is nothing to warn of."""
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
    advice += _of_moving(joint)
    held = [*(fit.hold_out for fit in joint.static.values()), *(fit.hold_out for fit in moving_fits(joint).values())]
    if joint.static and not any(held):
        advice.append("Hold back one run (hold_out: true): the error on data that were not fitted is the one to trust.")
    return tuple(advice)


def _of_moving(joint: Joint) -> Iterator[str]:
    """What moving runs leave open, and which motion would show it."""
    fit = joint.moving
    if fit is None:
        return
    wide = {
        name.name
        for name, e in fit.parameters.items()
        if e.value is None or (e.standard_error or 0.0) > WIDE * abs(e.value)
    }
    for names, how in _MOTIONS.items():
        open_ones = [symbol(name) for name in names if name in wide]
        if open_ones:
            yield f"The moving runs leave {' and '.join(open_ones)} open: {how}."
    if fit.quantity == "torque" and any(warning.kind is Kind.COUNT_BIAS for warning in fit.warnings):
        yield "Encoder counts bias the moving runs: try fit.predict: position on the same logs, or a finer encoder."


def _of_fit(joint: Joint, fit: StaticFit) -> Iterator[str]:
    speeds = np.abs(fit.velocity[fit.velocity != 0])
    v_unit = pretty(unit("velocity", joint.kind))
    if fit.outcome.kind is Kind.STATIC_TOO_FEW or speeds.size == 0:
        yield "measure at least eight constant speeds, evenly spread in log(v) over two decades or what the joint allows."
        return
    fast, floor = float(speeds.max()), _slowest(joint, fit)
    slower = f"{_between(speeds.min() / 10, speeds.min(), floor)} {v_unit}"
    if fit.outcome.kind is Kind.STATIC_NO_STRIBECK:
        where = "it does so below what was measured" if speeds.min() > floor else "these data do not show it"
        yield f"if friction rises at low speed, {where}: try five constant speeds from {slower}."
        return
    yield from _of_stribeck(fit, speeds, v_unit, slower, floor)
    viscous = fit.parameters.get("alpha_2")
    if viscous and viscous.value and viscous.standard_error and viscous.standard_error > WIDE * viscous.value:
        yield f"α₂ is wide: measure faster, {number(fast, 2)} to {number(2 * fast, 2)} {v_unit}, where the viscous part is larger."


def _slowest(joint: Joint, fit: StaticFit) -> float:
    """The slowest speed worth asking for, rad/s or m/s: a hundredth of the fastest seen, and clear of where the joint sticks and slips."""
    signs = {1.0, -1.0} if fit.direction == "both" else {1.0 if fit.direction == "+" else -1.0}
    sticking = [abs(s.velocity) for s in joint.segments if s.stick_slip and np.sign(s.velocity) in signs]
    return max(float(np.abs(fit.velocity).max()) / 100, _CLEAR * max(sticking, default=0.0))


def _between(low: float, high: float, floor: float) -> str:
    """A range of speeds in two digits from `low`, or from `floor` where that is higher, to `high`, or to what leaves room for five speeds."""
    low = max(low, floor)
    high = high if high >= 1.5 * low else 3 * low
    return f"{_rounded_up(low)} to {number(high, 2)}"


def _rounded_up(x: float) -> str:
    """In two digits, never less than it is."""
    digit = 10.0 ** (np.floor(np.log10(x)) - 1)
    return number(float(np.ceil(x / digit * (1 - 1e-12)) * digit), 2)


def _of_stribeck(fit: StaticFit, speeds: Array, v_unit: str, slower: str, floor: float) -> Iterator[str]:
    v_s = fit.parameters.get("v_s")
    if v_s is None or v_s.value is None:
        return
    low, high = v_s.interval or (0.0, np.inf)
    if np.count_nonzero(speeds < v_s.value) < 3:
        wanted = _between(v_s.value / 5, v_s.value, floor)
        yield f"fewer than three points lie below vₛ: measure five constant speeds from {wanted} {v_unit}."
    elif low <= 0:
        yield f"nothing limits vₛ below: measure five constant speeds from {slower}."
    if np.isinf(high):
        wanted = _between(v_s.value, 2 * float(speeds.max()), floor)
        yield f"nothing limits vₛ above: measure more speeds from {wanted} {v_unit}."
    elif v_s.standard_error and v_s.standard_error > WIDE * v_s.value:
        wanted = _between(v_s.value / 2, 2 * v_s.value, floor)
        yield f"vₛ is wide: measure more speeds, or longer runs, from {wanted} {v_unit}, where the curve bends."
