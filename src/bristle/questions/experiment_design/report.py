"""The report of a plan."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.estimation import levels
from bristle.model.parameters import Direction, unit
from bristle.page.page import Drawing
from bristle.page.plain import columns, pair
from bristle.page.report import Report, Section, Table
from bristle.page.wording import counted, direction, number, pretty, symbol, two_digits
from bristle.questions.experiment_design import figures
from bristle.questions.experiment_design.figures import percentage
from bristle.questions.experiment_design.plan import Plan, finite
from bristle.questions.experiment_design.references import DEFLECTIONS, SETTLE

_HEADINGS = {
    "in percent": "with motion (%)", "share_of_breakaway": "ratio to breakaway", "rise": "rise (s)", "viscous_share": "viscous share",
    "frequency": "frequency (Hz)", "phase": "phase (rad)",
}  # fmt: skip  # a table
_UNITS = {
    "velocity": ("velocity", "velocity"), "peak": ("peak", "torque"),
    "by_noise": ("error by noise", "sigma_0"), "standard_error": ("with the viscous share", "sigma_0"),
    "amplitude": ("amplitude", "position"),
}  # fmt: skip  # headings of columns with the unit of a quantity


def report(plan: Plan) -> Report:
    """What to measure, the expected intervals, limits, and each part of the plan; the terminal has the parts first."""
    name, aim = plan.joint.name, plan.aim
    simulated = " (identified from SIMULATED data)" if plan.joint.simulated else ""
    planned_for = f"  Planned for {'all parameters' if aim == 'all' else aim}{simulated}."
    sections = [Section("", findings=(plan.worth,), lines=(str(plan.worth), planned_for))]
    if plan.warnings:
        lines = tuple(f"  {warning.coded}" for warning in plan.warnings)
        sections.append(Section("What it would not show", findings=plan.warnings, lines=lines, turn=2, coded=True))
    assumed = (f"  assumed: {said.flagged}" for said in plan.assumptions)
    sections += [
        _worth(plan),
        Section("Assumed", findings=plan.assumptions, lines=tuple(assumed), turn=3, form="part"),
        _of_velocities(plan),
        _of_loading(plan),
        _of_motion(plan),
    ]
    return Report(
        f"{name}: what to measure next",
        tuple(sections),
        about=f"Planned for {'all parameters' if aim == 'all' else symbol(aim)}, from the runs so far.",
        simulated="The joint was not measured but simulated." if plan.joint.simulated else "",
        seed=0,
    )


def _drawing(plan: Plan, draw: Callable[[Plan], Figure], label: str, caption: str, how: str) -> Drawing:
    name = draw.__name__.removesuffix("_figure")
    return Drawing(partial(draw, plan), f"plan-{name}", label, f"{caption}.", how)


def _worth(plan: Plan) -> Section:
    """Intervals before and after the plan."""
    now, then = (plan.percent(plan.standard_errors[stage]).tolist() for stage in ("now", "with motion"))
    k = max(plan.aimed, key=then.__getitem__)
    found = (
        f"Largest standard error expected after the plan: {percentage(then[k])} % of {symbol(plan.start.names[k])}, "
        f"from {percentage(now[k])} % now"
    )
    figure = _drawing(
        plan, figures.intervals_figure, f"errors of {plan.joint.name} before and after", found,
        "Relative standard error of each parameter: now (squares), and as expected after velocities, loading and motion (circles).",
    )  # fmt: skip  # a list of values
    errors = plan.standard_errors
    rows = [("", "estimate", *(stage.removeprefix("with ") for stage in errors))]
    for k in plan.free:
        name, value = plan.start.names[k], float(plan.start.estimate[k])
        relative = [error[k] / abs(value) for error in errors.values()]
        known = float(errors["now"][k]) if relative[0] < 1 else None
        estimate = f"{pair(value, known)} {unit(name.name, plan.joint.kind)}"
        half = (f"{two_digits(100 * levels.NORMAL * error)} %" if error < 1 else "open" for error in relative)
        rows.append((str(name), f"{estimate}{' (a guess)' * (name in plan.start.guessed)}", *half))
    note = (
        "Parameters given as exact are not listed. Now: as fitted. After: predicted, not measured, and lower bounds: 1.96 times the "
        "standard errors by the Cramér-Rao bound at the estimates. Statistical errors only: those of constants, as of the torque's "
        "scale, come on top, and no run lowers them. A dash: not identifiable. A guess is assumed, because no run identifies the "
        "parameter."
    )
    lines = (
        "  half of each 95 % interval, in percent of the value: now as fitted; then predicted with each part of the plan added, "
        "at the least (Cramer-Rao bound); open: not identifiable.",
        "  Statistical errors only: those of constants, as of the torque's scale, come on top, and no run lowers them.",
        *columns(rows, indent=2),
    )
    runs = max(r.run for r in plan.references)
    return Section(
        "What it is worth",
        text=f"{runs} runs in {number(plan.duration, 3)} s: constant velocities, slow loading, one tracking motion. The table shows half of "
        "each 95 % interval in the parameter's unit: now, and as expected after each part of the plan.",
        figure=figure, table=_table(plan, "intervals", "Half of each 95 % interval", plan.to_frame(), note), lines=lines, turn=1, id="expected",
    )  # fmt: skip  # a list of values


def _of_velocities(plan: Plan) -> Section:
    static, hold = plan.velocities[0], number(plan.limits.hold, 3)
    what = "c-optimal runs for one parameter alone"
    if static.chosen.aim == "all":
        count = {4: "four"}.get(len(static.problem.names), len(static.problem.names))
        what = f"D-optimal runs: smallest volume of the joint confidence region of all {count} parameters"
    text = (
        f"The {what}, in addition to the runs so far, found by exchange on a fine grid of speeds; near ones become one. Each is averaged over "
        f"{hold} s after a run-in of {SETTLE} s or {DEFLECTIONS:.0f} bristle deflections, whichever is longer."
    )
    lines, speeds, si = [], [], unit("velocity", plan.joint.kind)
    for x in plan.velocities:
        where = "each direction" if x.direction is Direction.BOTH else f"direction {x.direction}"
        listed = (
            ", ".join(f"{speed:.4g}" + (f" x{count}" if count > 1 else "") for speed, count in x.chosen.runs) + f" {si}"
        )
        lines.append(f"  constant velocities, {where}: {listed}; each averaged over {plan.limits.hold:.3g} s")
        run = [speed for speed, _ in x.chosen.runs]
        ends = dict.fromkeys(number(speed, 3) for speed in (run[0], run[-1]))
        many, at = counted(len(x.velocities), "run"), counted(len(run), "speed")
        speeds.append(f"{direction(x.direction)}: {many} at {at}, {' to '.join(ends)} {pretty(si)}")
    chosen = _drawing(
        plan, figures.velocities_figure, f"velocities to run on {plan.joint.name}",
        f"Constant velocities, {'; '.join(speeds)}",
        "Friction curve at the estimate with the speeds to run and, above, how often; grey: the plausible values of vₛ, over which the design "
        "is averaged; crosses: measured so far.",
    )  # fmt: skip  # a list of values
    rows = [(x.direction, speed, count) for x in plan.velocities for speed, count in x.chosen.runs]
    frame = pd.DataFrame(rows, columns=["direction", "velocity", "runs"])
    runs = _table(plan, "velocities", "Constant velocities to run", frame, digits=None)
    return Section("Constant velocities", text=text, figure=chosen, table=runs, lines=tuple(lines), id="velocities")


def _of_loading(plan: Plan) -> Section:
    torque, stiffness = (unit(x, plan.joint.kind) for x in ("torque", "sigma_0"))
    lines = []
    for load in plan.loadings:
        seen = (
            f"predicted to +/- {load.error:.2g} {stiffness} at the least (by noise {load.noise_error:.2g} {stiffness}; the estimate "
            f"neglects a viscous torque of {100 * load.viscous_share:.2g} %)"
            if np.isfinite(load.error)
            else "not identifiable: too few encoder counts"
        )
        lines.append(
            f"  slow loading, direction {load.direction}: to {load.peak:.3g} {torque} ({load.share:.2g} of breakaway) in {load.rise:.3g} s, twice; "
            f"sigma_0 {seen}"
        )
    text = (
        "Torque rises to the peak and falls, two times, open loop, the joint at rest. Higher peaks cross more counts, but near breakaway the "
        "displacement depends on the breakaway torque, which has an error of its own. Slower loading averages more noise. Viscous share: torque "
        "of σ₁ and α₂ at the peak, which the estimate of σ₀ neglects. It counts as an error beside the noise (root of the sum of squares), in the "
        "choice of the rise and in the expected error. σ₁ is not identifiable here ((15) is only a prior); the tracking motion identifies it."
    )
    rows = [
        {
            "direction": x.direction, "peak": x.peak, "share_of_breakaway": x.share, "rise": x.rise, "counts": finite(x.counts),
            "viscous_share": x.viscous_share, "by_noise": finite(x.noise_error), "standard_error": finite(x.error),
        }
        for x in plan.loadings
    ]  # fmt: skip  # a table
    title, table = "Slow loading below breakaway", _table(plan, "loading", "Slow loading", pd.DataFrame(rows))
    return Section(title, text=text, table=table, lines=tuple(lines), id="loading")


def _of_motion(plan: Plan) -> Section:
    """The tracking motion, its sines slowest first."""
    position, sines = unit("position", plan.joint.kind), plan.motion.lines
    frame = pd.DataFrame(sines._asdict()).sort_values("frequency", ignore_index=True)
    said = ", ".join(f"{x.amplitude:.2g} {position} at {x.frequency:.2g} Hz" for x in frame.itertuples())
    lines = (f"  tracking, {plan.motion.duration:.3g} s: {said}",)
    limits, run = plan.limits, plan.references[-1]
    q, v = (pretty(unit(quantity, plan.joint.kind)) for quantity in ("position", "velocity"))
    ends = (np.abs(run.velocity).max(), run.position.min(), run.position.max())
    fastest, least, most = (number(float(end), 3) for end in ends)
    motion = _drawing(
        plan, figures.motion_figure, f"tracking motion of {plan.joint.name}",
        f"Peak velocity {fastest} {v}, {number(limits.velocity, 3)} {v} allowed; positions {least} to {most} {q}, "
        f"{' to '.join(number(x, 3) for x in limits.position)} {q} allowed",
        "Position and velocity of the motion; dashed: the velocity limit.",
    )  # fmt: skip  # a list of values
    text = "A sum of sines within the limits, faded in and out, that minimises the relative standard errors."
    note = (
        "As played, scaled to the limits: amplitude · sin(2π frequency · time + phase), with time from the start of the motion, about "
        "the middle of the position range."
    )
    table = _table(plan, "lines", "Sines of the tracking motion", frame, note, digits=None)
    return Section("The tracking motion", text=text, figure=motion, table=table, lines=lines, id="motion")


def _table(plan: Plan, file: str, title: str, frame: pd.DataFrame, note: str = "", digits: int | None = 4) -> Table:
    """A table of the page: with its headings, numbers to `digits`, and None for missing ones."""
    shown = frame
    if digits is not None:
        rounded = frame.astype(object).map(lambda x: float(f"{x:.{digits}g}") if isinstance(x, float) else x)
        shown = rounded.where(frame.notna(), None)
    in_units = {own: f"{words} ({pretty(unit(of, plan.joint.kind))})" for own, (words, of) in _UNITS.items()}
    return Table(file, title, frame, shown.rename(columns=_HEADINGS | in_units), note)
