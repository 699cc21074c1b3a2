"""The page and the text of a plan: results -> figures by name, what the template names, and lines."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.model.laws.parts import Law
from bristle.model.parameters import Direction, Kind, effort, static_estimated_of, unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.plain import columns, pair
from bristle.page.wording import in_print, number, pretty, symbol, two_digits
from bristle.questions.experiment_design import figures, tables
from bristle.questions.experiment_design.captions_section import captions
from bristle.questions.experiment_design.plan import NORMAL, Plan
from bristle.questions.experiment_design.references import DEFLECTIONS, SETTLE

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
    headings = _headings(kind, plan.joint.law)
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


def _headings(kind: Kind, law: Law) -> dict[str, str]:
    """The page's heading of each column of a table that has another one there: with its unit, or in symbols."""
    units = {
        "velocity": ("velocity", "velocity"),
        "velocities": ("velocities", "velocity"),
        "peak": ("peak", "torque"),
        "by_noise": ("error by noise", "sigma_0"),
        "standard_error": ("with the viscous share", "sigma_0"),
        "amplitude": ("amplitude", "position"),
    }
    return {
        **{name: f"{symbol(name)} (%)" for name in static_estimated_of(law)},
        **{column: f"{heading} ({pretty(unit(quantity, kind))})" for column, (heading, quantity) in units.items()},
        "in percent": "with motion (%)",
        "share_of_breakaway": "ratio to breakaway",
        "rise": "rise (s)",
        "viscous_share": "viscous share",
        "frequency": "frequency (Hz)",
        "phase": "phase (rad)",
    }


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
