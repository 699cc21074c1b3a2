"""What the page and the terminal show of a plan: results -> the values that a template names, and lines of text."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.model.parameters import unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.wording import direction, number, pretty, symbol
from bristle.questions.experiment_design import figures, tables
from bristle.questions.experiment_design.plan import Plan
from bristle.questions.experiment_design.references import DEFLECTIONS, SETTLE

_UNSEEN = 50.0
"""Percent: a parameter whose expected standard error is wider is not seen."""


def write_plan(plan: Plan, folder: Path) -> Path:
    """Write the page of a plan: index.html, figures/ and tables/; returns the path of index.html. Raises as `write_part` does."""
    return write_part(
        folder, "bristle.questions.experiment_design", "plan.html", section(plan), draw(plan), tables.all_tables(plan)
    )


def draw(plan: Plan) -> Mapping[str, tuple[Callable[[], Figure | None], str]]:
    """What draws each figure, and how it is called for a reader who does not see it."""
    name = plan.name
    return {
        "plan-velocities": (lambda: figures.velocities_figure(plan), f"velocities to run on {name}"),
        "plan-comparison": (lambda: figures.comparison_figure(plan), f"planned and spaced velocities of {name}"),
        "plan-robustness": (lambda: figures.robustness_figure(plan), f"error of the Stribeck velocity of {name}"),
        "plan-intervals": (lambda: figures.intervals_figure(plan), f"errors of {name} before and after"),
        "plan-loading": (
            lambda: figures.loading_figure(plan),
            f"error of the stiffness of {name} over the peak torque",
        ),
        "plan-motion": (lambda: figures.motion_figure(plan), f"tracking motion of {name}"),
        "plan-motions": (lambda: figures.motions_figure(plan), f"errors of {name} after three motions"),
        "plan-whole": (lambda: figures.whole_figure(plan), f"all references of {name}"),
    }


def section(plan: Plan) -> dict[str, Any]:
    """Everything that the template names, but for the figures."""
    q, v, T = (pretty(unit(name, plan.kind)) for name in ("position", "velocity", "torque"))
    stiff = pretty(unit("sigma_0", plan.kind))
    designs = tables.designs(plan)
    columns = {f"{name} (%)": name for name in ("alpha_0", "alpha_1", "alpha_2", "v_s")}
    headed = {name: f"{symbol(name)} (%)" for name in columns.values()}
    motions = tables.motions(plan).drop(columns="rms").set_index("motion").T.reset_index(names="parameter")
    return {
        "title": plan.name,
        "seed": 0,
        "simulated": plan.simulated,
        "aim": "all parameters" if plan.aim == "all" else symbol(plan.aim),
        "static_aim": plan.directions[0].chosen.aim,
        "limits": _limits(plan),
        "intervals": _shown(tables.intervals(plan).rename(columns={"in percent": "with motion (%)"})),
        "velocities": shown(tables.velocities(plan).rename(columns={"velocity": f"velocity ({v})"})),
        "designs": _shown(designs.rename(columns={**headed, "velocities": f"velocities ({v})"})),
        "comparison": _shown(tables.comparison(plan).rename(columns=headed)),
        "loading": _shown(
            tables.loading(plan).rename(
                columns={
                    "peak": f"peak ({T})",
                    "share_of_breakaway": "over breakaway",
                    "rise": "rise (s)",
                    "viscous_share": "viscous share",
                    "by_noise": f"error by noise ({stiff})",
                    "standard_error": f"with the viscous share ({stiff})",
                }
            )
        ),
        "lines": shown(
            tables.lines(plan).rename(
                columns={"amplitude": f"amplitude ({q})", "frequency": "frequency (Hz)", "phase": "phase (rad)"}
            )
        ),
        "motions": _shown(motions),
        "rms": [(m, number(x, 3)) for m, x in tables.motions(plan)[["motion", "rms"]].itertuples(index=False)],
        "runs": max(r.run for r in plan.references),
        "duration": number(plan.duration, 3),
        "hold": number(plan.limits.hold, 3),
        "settle": SETTLE,
        "deflections": DEFLECTIONS,
        "rate": number(plan.limits.rate),
        "lacking": lacking(plan),
        "assumptions": [pretty(sentence) for sentence in plan.assumptions],
    }


def lacking(plan: Plan) -> list[str]:
    """What even this plan would not show, and what would."""
    relative = 100 * plan.stages["with motion"] / np.abs(plan.start.estimate)
    names = [plan.start.names[k] for k in plan.free if not relative[k] <= _UNSEEN]
    said = (
        [f"Even after this plan {', '.join(map(symbol, names))} would not be seen within these limits."]
        if names
        else []
    )
    v = pretty(unit("velocity", plan.kind))
    for own in plan.directions:
        if own.task.low > 0.5 * own.task.p.v_s:
            where = f" {direction(own.tag)}" if own.tag else ""
            said.append(
                f"The slowest constant speed, {own.task.low:.3g} {v}, is {own.task.low / own.task.p.v_s:.2g} times vₛ{where}: slower runs would "
                "show the Stribeck region far better; a stiffer controller may hold them, then lower plan.minimum_velocity."
            )
        if not np.isfinite(own.chosen.alone).all():
            said.append(
                f"The planned velocities{f' {direction(own.tag)}' if own.tag else ''} are too few different ones for a fit of their own: they add to "
                "what was measured; identify them together with the runs so far."
            )
    return said


def text(plan: Plan) -> str:
    """The plan as plain text."""
    v, T, q = (unit(name, plan.kind) for name in ("velocity", "torque", "position"))
    aim = "all parameters" if plan.aim == "all" else plan.aim
    out = [
        f"{plan.name}: what to measure next, for {aim}{' (identified from SIMULATED data)' if plan.simulated else ''}"
    ]
    for own in plan.directions:
        speeds = ", ".join(
            f"{x:.4g}" + (f" x{n}" if n > 1 else "")
            for x, n in zip(*np.unique(own.chosen.speeds, return_counts=True), strict=True)
        )
        where = f"direction {own.tag}" if own.tag else "each direction"
        out.append(f"  constant velocities, {where}, {v}: {speeds}; {plan.limits.hold:.3g} s averaged at each")
    for x in plan.loads:
        seen = (
            "not seen: too few encoder counts"
            if not np.isfinite(x.error)
            else f"+/- {x.error:.2g} {unit('sigma_0', plan.kind)}: {x.scatter:.2g} by noise, and the viscous share that its "
            f"estimate neglects, {100 * x.lag:.2g} %, beside it"
        )
        out.append(
            f"  slow loading, direction {x.tag}: to {x.peak:.3g} {T} ({x.share:.2g} of breakaway) in {x.rise:.3g} s, twice; sigma_0 {seen}"
        )
    out.append(f"  tracking, {plan.motions[0].duration:.3g} s: {_sines(plan)} (amplitude {q}, frequency Hz)")
    out.append("  half of each 95 % interval, in percent of the value:")
    stages = list(plan.stages)
    out.append(f"    {'':<12}{'estimate':>12}" + "".join(f"{stage:>18}" for stage in stages))
    for k in plan.free:
        name = plan.start.names[k]
        value = float(plan.start.estimate[k])
        cells = "".join(f"{_cell(100 * tables.NORMAL * plan.stages[s][k] / abs(value)):>18}" for s in stages)
        out.append(
            f"    {name:<12}{value:>12.4g}{cells}{'  (the estimate is a guess)' if name in plan.start.guessed else ''}"
        )
    out += [f"  {sentence}" for sentence in lacking(plan)]
    out += [f"  assumed: {sentence}" for sentence in plan.assumptions]
    return "\n".join(out)


def _sines(plan: Plan) -> str:
    rows = tables.lines(plan).itertuples(index=False)
    return ", ".join(f"{row.amplitude:.2g} at {row.frequency:.2g}" for row in rows)


def _cell(percent: float) -> str:
    return f"{percent:.3g}" if percent < 100 * tables.NORMAL else "not seen"


def _limits(plan: Plan) -> list[tuple[str, str]]:
    x, kind = plan.limits, plan.kind
    q, v, a, T = (pretty(unit(name, kind)) for name in ("position", "velocity", "acceleration", "torque"))
    return [
        ("position", f"{x.position[0]:.4g} to {x.position[1]:.4g} {q}"),
        ("constant velocities", f"{x.slowest:.3g} to {x.velocity:.3g} {v}"),
        ("acceleration", f"{x.acceleration:.3g} {a}"),
        (
            "torque" if kind == "revolute" else "force",
            f"{x.torque:.3g} {T}" if np.isfinite(x.torque) else "not limited",
        ),
        ("time", "not limited" if x.time is None else f"{x.time:g} s"),
    ]


def _shown(frame: pd.DataFrame) -> Table:
    """A table with numbers to four digits, and None, not nan, where there is none."""
    return shown(frame.astype(object).map(_rounded).where(frame.notna(), None))


def _rounded(x: object) -> object:
    return float(f"{x:.4g}") if isinstance(x, float) else x
