"""The page and the text of a plan: results -> figures by name with their captions, what the template names, and lines."""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.arrays import Array
from bristle.model.parameters import Direction, effort, static_estimated_of, unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.plain import columns, pair
from bristle.page.wording import counted, direction, in_print, number, pretty, symbol, two_digits
from bristle.questions.experiment_design import figures, tables
from bristle.questions.experiment_design.excitation import MotionDesign
from bristle.questions.experiment_design.figures import CEILING, percentage
from bristle.questions.experiment_design.plan import NORMAL, Plan
from bristle.questions.experiment_design.references import DEFLECTIONS, SETTLE
from bristle.questions.experiment_design.velocities import errors_by_v_s

_PLAYED = {"velocities", "lines"}
"""Tables of what is played, which are not rounded further."""


def write_plan(plan: Plan, folder: Path) -> Path:
    """Write the page of a plan: index.html, figures/ and tables/; returns the path of index.html. Raises as `write_part` does."""
    name, kind, x, static = plan.joint.name, plan.joint.kind, plan.limits, plan.velocities[0]
    drawn: dict[str, tuple[Callable[[Plan], Figure], str]] = {
        "velocities": (figures.velocities_figure, f"velocities to run on {name}"),
        "robustness": (figures.robustness_figure, f"error of the Stribeck velocity of {name}"),
        "intervals": (figures.intervals_figure, f"errors of {name} before and after"),
        "loading": (figures.loading_figure, f"error of the stiffness of {name} vs the peak torque"),
        "motion": (figures.motion_figure, f"tracking motion of {name}"),
        "motions": (figures.motions_figure, f"errors of {name} after three motions"),
        "whole": (figures.whole_figure, f"all references of {name}"),
    }
    draw = {f"plan-{file}": (partial(figure, plan), label) for file, (figure, label) in drawn.items()}
    every = (tables.velocities, tables.designs, tables.intervals, tables.loading, tables.lines, tables.motions)
    frames = {table.__name__: table(plan) for table in every}
    motions = frames["motions"].set_index("motion")
    on_page = {**frames, "motions": motions.drop(columns="rms").T.reset_index(names="parameter")}
    q, v, a, T = (pretty(unit(quantity, kind)) for quantity in ("position", "velocity", "acceleration", "torque"))

    # The page's heading of each column of a table that has another one there: with its unit, or in symbols.
    units = {
        "velocity": ("velocity", "velocity"), "velocities": ("velocities", "velocity"), "peak": ("peak", "torque"),
        "by_noise": ("error by noise", "sigma_0"), "standard_error": ("with the viscous share", "sigma_0"),
        "amplitude": ("amplitude", "position"),
    }  # fmt: skip  # a table
    headings = {
        **{own: f"{symbol(own)} (%)" for own in static_estimated_of(plan.joint.law)},
        **{column: f"{heading} ({pretty(unit(quantity, kind))})" for column, (heading, quantity) in units.items()},
        "in percent": "with motion (%)", "share_of_breakaway": "ratio to breakaway", "rise": "rise (s)",
        "viscous_share": "viscous share", "frequency": "frequency (Hz)", "phase": "phase (rad)",
    }  # fmt: skip  # a table
    context = {
        "title": name,
        "seed": 0,
        "simulated": plan.joint.simulated,
        "aim": "all parameters" if plan.aim == "all" else symbol(plan.aim),
        "static_aim": static.chosen.aim,
        "static_parameters": {4: "four"}.get(len(static.problem.names), len(static.problem.names)),
        "limits": [
            ("position", f"{x.position[0]:.4g} to {x.position[1]:.4g} {q}"),
            ("constant velocities", f"{x.slowest:.3g} to {x.velocity:.3g} {v}"),
            ("acceleration", f"{x.acceleration:.3g} {a}"),
            (effort(kind), f"{x.torque:.3g} {T}" if np.isfinite(x.torque) else "not limited"),
            ("time", "not limited" if x.time is None else f"{x.time:g} s"),
        ],
        **{key: (shown if key in _PLAYED else _rounded)(f.rename(columns=headings)) for key, f in on_page.items()},
        "rms": [(motion, number(rms, 3)) for motion, rms in motions["rms"].items()],
        "runs": max(r.run for r in plan.references),
        "duration": number(plan.duration, 3),
        "hold": number(x.hold, 3),
        "settle": SETTLE,
        "deflections": DEFLECTIONS,
        "rate": number(x.rate),
        "worth": plan.worth and in_print(plan.worth),
        "warnings": plan.warnings,
        "assumptions": plan.assumptions,
        "captions": captions(plan),
    }
    return write_part(folder, "bristle.questions.experiment_design", "plan.html", context, draw, frames)


def text(plan: Plan) -> str:
    """The plan as plain text."""
    kind = plan.joint.kind
    velocity, torque, position, stiffness = (unit(x, kind) for x in ("velocity", "torque", "position", "sigma_0"))
    aim = "all parameters" if plan.aim == "all" else plan.aim
    simulated = " (identified from SIMULATED data)" if plan.joint.simulated else ""
    lines = [f"{plan.joint.name}: what to measure next, for {aim}{simulated}"]
    lines += [f"  {plan.worth}"] if plan.worth else []
    for x in plan.velocities:
        where = "each direction" if x.direction is Direction.BOTH else f"direction {x.direction}"
        speeds = tables.listed(x.chosen, "{:.4g}")
        lines.append(
            f"  constant velocities, {where}: {speeds} {velocity}; each averaged over {plan.limits.hold:.3g} s"
        )
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
    sines = ", ".join(
        f"{x.amplitude:.2g} {position} at {x.frequency:.2g} Hz" for x in tables.lines(plan).itertuples(index=False)
    )
    lines += [
        f"  tracking, {plan.motions[0].duration:.3g} s: {sines}",
        "  half of each 95 % interval, in percent of the value: now as fitted; then predicted with each part of the plan added, "
        "at the least (Cramer-Rao bound); open: not identifiable.",
        "  Statistical errors only: those of constants, as of the torque's scale, come on top, and no run lowers them.",
    ]
    errors = plan.standard_errors
    rows = [("", "estimate", *(stage.removeprefix("with ") for stage in errors))]
    for k in plan.free:
        name, value = plan.start.names[k], float(plan.start.estimate[k])
        relative = [error[k] / abs(value) for error in errors.values()]
        estimate = f"{pair(value, float(errors['now'][k]) if relative[0] < 1 else None)} {unit(name.name, kind)}"
        half = (f"{two_digits(100 * NORMAL * error)} %" if error < 1 else "open" for error in relative)
        rows.append((str(name), f"{estimate}{' (a guess)' * (name in plan.start.guessed)}", *half))
    lines += columns(rows, indent=2)
    lines += [f"  {warning.coded}" for warning in plan.warnings]
    return "\n".join([*lines, *(f"  assumed: {assumption.flagged}" for assumption in plan.assumptions)])


def _rounded(frame: pd.DataFrame) -> Table:
    """A table with numbers to four digits, and None, not nan, where there is none."""
    rounded = frame.astype(object).map(lambda x: float(f"{x:.4g}") if isinstance(x, float) else x)
    return shown(rounded.where(frame.notna(), None))


def captions(plan: Plan) -> dict[str, str]:
    """What each figure shows, in a sentence with a number: the beginning of its caption, by figure."""
    kind, limits, played = plan.joint.kind, plan.limits, plan.references[-1]
    q, v, T = (pretty(unit(name, kind)) for name in ("position", "velocity", "torque"))

    # The parameter that stays widest, or those that the plan is for; which of them stay open where any does.
    now, then = (_relative(plan, plan.standard_errors[stage]) for stage in ("now", "with motion"))
    largest, unseen = plan.aim == "all", [k for k in plan.aimed if not then[k] < CEILING]
    widest = [max(plan.aimed, key=then.__getitem__)] if largest else plan.aimed
    errors = (f"{percentage(then[k])} % of {_names(plan, [k])}, from {percentage(now[k])} % now" for k in widest)
    intervals = f"{'Largest standard' if largest else 'Standard'} error expected after the plan: {'; '.join(errors)}"
    if unseen:
        intervals = f"Standard error over {CEILING:g} %, not identifiable, even after the plan: {_names(plan, unseen)}"

    velocities, robustness, loading = [], [], []
    for x in plan.velocities:
        speeds = [speed for speed, _ in x.chosen.runs]
        ends = dict.fromkeys(number(speed, 3) for speed in (speeds[0], speeds[-1]))
        runs, at = counted(len(x.velocities), "run"), counted(len(speeds), "speed")
        velocities.append(f"{direction(x.direction)}: {runs} at {at}, {' to '.join(ends)} {v}")
        low, high = x.problem.nodes.min(), x.problem.nodes.max()
        of_v_s = errors_by_v_s(x.problem, x.chosen.speeds, np.geomspace(low, high, 60))
        between = dict.fromkeys(number(float(end), 3) for end in (low, high))
        ends = dict.fromkeys(percentage(end) for end in (float(of_v_s.min()), float(of_v_s.max())))
        robustness.append(
            f"{direction(x.direction)}: {' to '.join(ends)} % for a true vₛ of {' to '.join(between)} {v}"
        )
    for load in plan.loadings:
        peak = f"{number(load.peak, 3)} {T}"
        percent = percentage(100 * load.error / plan.start.p(load.direction).sigma_0)
        seen = f"{percent} % with rises of {number(load.rise, 3)} s to {peak}"
        if not np.isfinite(load.error):
            seen = f"not identifiable, as the joint moves only {number(load.counts, 2)} encoder counts at {peak}"
        loading.append(f"{direction(load.direction)}: {seen}")

    ends_of = (np.abs(played.velocity).max(), played.position.min(), played.position.max())
    fastest, least, most = (number(float(end), 3) for end in ends_of)
    planned, *others = plan.motions
    kinds = Counter(kind for kind, _ in dict.fromkeys((r.kind, r.run) for r in plan.references))
    found = {
        "intervals": intervals,
        "velocities": f"Constant velocities, {'; '.join(velocities)}",
        "robustness": f"Expected error of vₛ, {'; '.join(robustness)}",
        "loading": f"Expected error of σ₀, {'; '.join(loading)}",
        "motion": f"Peak velocity {fastest} {v}, {number(limits.velocity, 3)} {v} allowed; positions {least} to {most} {q}, "
        f"{' to '.join(number(x, 3) for x in limits.position)} {q} allowed",
        "motions": f"Standard errors, planned motion {'; '.join(_beside(plan, planned, x) for x in others)}",
        "whole": f"The plan takes {number(plan.duration, 3)} s: {kinds['ramp']} runs at constant velocity, {kinds['presliding']} of slow loading, "
        f"{counted(kinds['tracking'], 'tracking motion')}",
    }
    return {f"plan-{name}": f"{text}." for name, text in found.items()}


def _beside(plan: Plan, planned: MotionDesign, other: MotionDesign) -> str:
    """From the largest gain to the worst loss in what the plan is for; what of it one of the two motions alone shows."""
    mine, theirs = (_relative(plan, x.errors) for x in (planned, other))
    ratio = {k: mine[k] / theirs[k] for k in plan.aimed if mine[k] < CEILING and theirs[k] < CEILING}
    by = [f"{two_digits(ratio[k])} times for {_names(plan, [k])}" for k in sorted(ratio, key=ratio.__getitem__)]
    ends = " to ".join(dict.fromkeys((by[0], by[-1]))) if by else f"none below {CEILING:g} % after both"
    gained = _names(plan, [k for k in plan.aimed if mine[k] < CEILING and k not in ratio])
    lost = _names(plan, [k for k in plan.aimed if theirs[k] < CEILING and k not in ratio])
    alone = f", only the planned one shows {gained}" * bool(gained) + f", only the other one shows {lost}" * bool(lost)
    return f"vs {other.name}: {ends}{alone}"


def _relative(plan: Plan, errors: Array) -> list[float]:
    """Of each parameter, percent."""
    return list(map(float, 100 * errors / np.abs(plan.start.estimate)))


def _names(plan: Plan, at: Sequence[int]) -> str:
    return ", ".join(symbol(plan.start.names[k]) for k in at)
