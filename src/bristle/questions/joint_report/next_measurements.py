"""Advice on what to measure next, to remove warnings."""

from collections.abc import Iterator

import numpy as np

from bristle.findings import NOTE, Finding, unit_of, with_subjects
from bristle.identification.fits import StaticFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import units_of

WIDE = 0.15  # least relative standard error that is called wide


def next_measurements(joint: Joint) -> tuple[Finding, ...]:
    """Runs that would help most, with their range; advice on a static fit has it as its subject."""
    advice: list[Finding] = []
    for d, fit in joint.static.items():
        if d != "shared":
            advice += with_subjects(tuple(_of_fit(joint, fit)), {}, units_of(joint.kind), ("static", d))
    sticking = tuple(sorted({s.file for s in joint.segments if s.stick_slip}))
    if sticking:
        repeat = (
            f"Repeat {', '.join(sticking)} with a stiffer velocity loop, or slightly faster: these runs stick and slip, "
            "so their mean torque is not the friction of steady sliding."
        )
        advice.append(Finding("repeat-sticking", NOTE, repeat, {"files": sticking}))
    if {"+", "-"} & set(joint.static) and not {"+", "-"} <= set(joint.static):
        other = "-" if "+" in joint.static else "+"
        measure = f"Measure direction {other} at the same speeds: nothing is known of it."
        advice.append(Finding("measure-direction", NOTE, measure, {"direction": other}))
    advice += _of_moving(joint)
    held = [*(fit.hold_out for fit in joint.static.values()), *(fit.hold_out for fit in moving_fits(joint).values())]
    if joint.static and not any(held):
        hold_back = "Hold back one run (hold_out: true): the error on data that were not fitted is the one to trust."
        advice.append(Finding("hold-back", NOTE, hold_back))
    return tuple(advice)


def _of_moving(joint: Joint) -> Iterator[Finding]:
    """Parameters that moving runs leave open, and motions that would determine them."""
    fit = joint.moving
    if fit is None:
        return
    wide = {
        name.name
        for name, e in fit.parameters.items()
        if e.value is None or (e.standard_error or 0.0) > WIDE * abs(e.value)
    }
    if peak := tuple(name for name in ("alpha_1", "v_s") if name in wide):
        motion = "add constant velocities below and around v_s (experiment: ramp), or move long and slowly there"
        message = f"The moving runs leave {' and '.join(peak)} open: {motion}."
        yield Finding("peak-open", NOTE, message, {"names": peak})
    if "alpha_2" in wide:
        faster = "The moving runs leave alpha_2 open: move faster, where the viscous part is larger."
        yield Finding("viscous-open", NOTE, faster)
    if bristle := tuple(name for name in ("sigma_0", "sigma_1") if name in wide):
        message = (
            f"The moving runs leave {' and '.join(bristle)} open: add slow loading below breakaway (experiment: presliding), "
            "or turn often and slowly, by a few times the way in which friction builds up."
        )
        yield Finding("bristle-open", NOTE, message, {"names": bristle})
    if "inertia" in wide:
        harder = "The moving runs leave inertia open: accelerate harder, or give the inertia."
        yield Finding("inertia-open", NOTE, harder)
    if any(warning.code == "count-bias" for warning in fit.warnings):
        finer = "Encoder counts bias the moving runs: use a finer encoder."
        yield Finding("avoid-counts", NOTE, finer)


def _of_fit(joint: Joint, fit: StaticFit) -> Iterator[Finding]:
    speeds = np.abs(fit.velocity[fit.velocity != 0])
    if fit.outcome.code == "static-too-few" or speeds.size == 0:
        spread = "evenly spread in log(v) over two decades or what the joint allows"
        yield Finding("measure-speeds", NOTE, f"Measure at least eight constant speeds, {spread}.")
        return
    # The slowest speed to ask for: a hundredth of the fastest one, and above speeds of stick-slip.
    signs = {1.0, -1.0} if fit.direction == "both" else {1.0 if fit.direction == "+" else -1.0}
    sticking = [abs(s.velocity) for s in joint.segments if s.stick_slip and np.sign(s.velocity) in signs]
    slowest, fast = float(speeds.min()), float(speeds.max())
    floor = max(fast / 100, 1.1 * max(sticking, default=0.0))
    low, high = _between(slowest / 10, slowest, floor)
    if fit.outcome.code == "static-no-stribeck":
        below = slowest > floor
        where = "it does so below what was measured" if below else "these data do not show it"
        message = f"If friction rises at low speed, {where}: try five constant speeds from {_speeds(low, high)}."
        yield Finding("rises-below" if below else "rise-not-shown", NOTE, message, {"low": low, "high": high})
        return
    v_s = fit.parameters.get("v_s")
    if v_s is not None and v_s.value is not None:
        least, most = v_s.interval or (0.0, np.inf)
        if np.count_nonzero(speeds < v_s.value) < 3:
            first, last = _between(v_s.value / 5, v_s.value, floor)
            few = f"Fewer than three points lie below v_s: measure five constant speeds from {_speeds(first, last)}."
            yield Finding("few-points-below", NOTE, few, {"low": first, "high": last})
        elif least <= 0:
            slower = f"Nothing limits v_s below: measure five constant speeds from {_speeds(low, high)}."
            yield Finding("unlimited-below", NOTE, slower, {"low": low, "high": high})
        if np.isinf(most):
            first, last = _between(v_s.value, 2 * fast, floor)
            above = f"Nothing limits v_s above: measure more speeds from {_speeds(first, last)}."
            yield Finding("unlimited-above", NOTE, above, {"low": first, "high": last})
        elif v_s.standard_error and v_s.standard_error > WIDE * v_s.value:
            first, last = _between(v_s.value / 2, 2 * v_s.value, floor)
            near = f"measure more speeds, or longer runs, from {_speeds(first, last)}, where the curve bends"
            yield Finding("v-s-wide", NOTE, f"v_s is wide: {near}.", {"low": first, "high": last})
    viscous = fit.parameters.get("alpha_2")
    if viscous and viscous.value and viscous.standard_error and viscous.standard_error > WIDE * viscous.value:
        faster = f"alpha_2 is wide: measure faster, {_speeds(fast, 2 * fast)}, where the viscous part is larger."
        yield Finding("alpha-2-wide", NOTE, faster, {"low": fast, "high": 2 * fast})


def _between(low: float, high: float, floor: float) -> tuple[float, float]:
    """A range of speeds from `low`, at least `floor`, to `high`, with room for five speeds."""
    low = max(low, floor)
    digit = 10.0 ** (np.floor(np.log10(low)) - 1)
    rounded_up = float(np.ceil(low / digit * (1 - 1e-12)) * digit)  # to two digits, never less than it is
    return rounded_up, high if high >= 1.5 * low else 3 * low


def _speeds(low: float, high: float) -> str:
    return f"{low:.2g} to {high:.2g}{unit_of('velocity')}"
