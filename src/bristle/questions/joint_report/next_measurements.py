"""What to measure next: what would remove the warnings, in speeds and files that a user can set."""

from collections.abc import Iterator

import numpy as np

from bristle.arrays import Array
from bristle.diagnostics import Kind
from bristle.findings import Finding, with_subjects
from bristle.identification.fits import StaticFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import unit, units_of

WIDE = 0.15
"""A standard error above this share of its value is called wide."""
_MOTIONS = {
    ("alpha_1", "v_s"): Kind.PEAK_OPEN,
    ("alpha_2",): Kind.VISCOUS_OPEN,
    ("sigma_0", "sigma_1"): Kind.BRISTLE_OPEN,
    ("inertia",): Kind.INERTIA_OPEN,
}
"""Parameters that moving runs may leave open, and what would show them."""
_CLEAR = 1.1
"""How far above a speed that sticks and slips a proposed one lies."""


def next_measurements(joint: Joint) -> tuple[Finding, ...]:
    """Which runs would help most, each with its range; empty where there is nothing to warn of. That of a static fit has it as its subject."""
    advice: list[Finding] = []
    for d, fit in joint.static.items():
        if d != "shared":
            advice += with_subjects(tuple(_of_fit(joint, fit)), {}, units_of(joint.kind), ("static", d))
    sticking = sorted({s.file for s in joint.segments if s.stick_slip})
    if sticking:
        advice.append(Kind.REPEAT_STICKING(files=tuple(sticking)))
    if {"+", "-"} & set(joint.static) and not {"+", "-"} <= set(joint.static):
        advice.append(Kind.MEASURE_DIRECTION(direction="-" if "+" in joint.static else "+"))
    advice += _of_moving(joint)
    held = [*(fit.hold_out for fit in joint.static.values()), *(fit.hold_out for fit in moving_fits(joint).values())]
    if joint.static and not any(held):
        advice.append(Kind.HOLD_BACK())
    return tuple(advice)


def _of_moving(joint: Joint) -> Iterator[Finding]:
    """What moving runs leave open, and which motion would show it."""
    fit = joint.moving
    if fit is None:
        return
    wide = {
        name.name
        for name, e in fit.parameters.items()
        if e.value is None or (e.standard_error or 0.0) > WIDE * abs(e.value)
    }
    for names, kind in _MOTIONS.items():
        open_ones = tuple(name for name in names if name in wide)
        if open_ones:
            yield kind(names=open_ones)
    if fit.quantity == "torque" and any(warning.code == "count-bias" for warning in fit.warnings):
        yield Kind.AVOID_COUNTS()


def _of_fit(joint: Joint, fit: StaticFit) -> Iterator[Finding]:
    speeds = np.abs(fit.velocity[fit.velocity != 0])
    v_unit = unit("velocity", joint.kind)
    if fit.outcome.code == "static-too-few" or speeds.size == 0:
        yield Kind.MEASURE_SPEEDS()
        return
    slowest, fast, floor = float(speeds.min()), float(speeds.max()), _slowest(joint, fit)
    low, high = _between(slowest / 10, slowest, floor)
    if fit.outcome.code == "static-no-stribeck":
        rises = Kind.RISES_BELOW if slowest > floor else Kind.RISE_NOT_SHOWN
        yield rises(low=low, high=high, unit=v_unit)
        return
    yield from _of_stribeck(fit, speeds, v_unit, (low, high), floor)
    viscous = fit.parameters.get("alpha_2")
    if viscous and viscous.value and viscous.standard_error and viscous.standard_error > WIDE * viscous.value:
        yield Kind.ALPHA_2_WIDE(low=fast, high=2 * fast, unit=v_unit)


def _slowest(joint: Joint, fit: StaticFit) -> float:
    """The slowest speed worth asking for, rad/s or m/s: a hundredth of the fastest seen, and clear of where the joint sticks and slips."""
    signs = {1.0, -1.0} if fit.direction == "both" else {1.0 if fit.direction == "+" else -1.0}
    sticking = [abs(s.velocity) for s in joint.segments if s.stick_slip and np.sign(s.velocity) in signs]
    return max(float(np.abs(fit.velocity).max()) / 100, _CLEAR * max(sticking, default=0.0))


def _between(low: float, high: float, floor: float) -> tuple[float, float]:
    """A range of speeds from `low`, or `floor` where that is higher, in two digits, to `high`, or to what leaves room for five speeds."""
    low = max(low, floor)
    return _rounded_up(low), high if high >= 1.5 * low else 3 * low


def _rounded_up(x: float) -> float:
    """To two digits, never less than it is."""
    digit = 10.0 ** (np.floor(np.log10(x)) - 1)
    return float(np.ceil(x / digit * (1 - 1e-12)) * digit)


def _of_stribeck(
    fit: StaticFit, speeds: Array, v_unit: str, slower: tuple[float, float], floor: float
) -> Iterator[Finding]:
    v_s = fit.parameters.get("v_s")
    if v_s is None or v_s.value is None:
        return
    low, high = v_s.interval or (0.0, np.inf)
    if np.count_nonzero(speeds < v_s.value) < 3:
        first, last = _between(v_s.value / 5, v_s.value, floor)
        yield Kind.FEW_POINTS_BELOW(low=first, high=last, unit=v_unit)
    elif low <= 0:
        yield Kind.UNLIMITED_BELOW(low=slower[0], high=slower[1], unit=v_unit)
    if np.isinf(high):
        first, last = _between(v_s.value, 2 * float(speeds.max()), floor)
        yield Kind.UNLIMITED_ABOVE(low=first, high=last, unit=v_unit)
    elif v_s.standard_error and v_s.standard_error > WIDE * v_s.value:
        first, last = _between(v_s.value / 2, 2 * v_s.value, floor)
        yield Kind.V_S_WIDE(low=first, high=last, unit=v_unit)
