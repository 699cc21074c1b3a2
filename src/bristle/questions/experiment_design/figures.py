"""Matplotlib figures of a plan."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from bristle.model import functions
from bristle.model.parameters import Direction
from bristle.model.vectorize import evaluate
from bristle.page.style import DIRECTION, decimal_log, panels, styled, thinned
from bristle.page.wording import axis, direction, symbol, two_digits
from bristle.questions.experiment_design.plan import Plan

CEILING = 200.0  # percent: the largest error that is drawn


def _panels(plan: Plan, height: float, count: int = 1, **how: Any) -> tuple[Figure, list[Axes]]:
    return panels(height, plan.joint.name, plan.joint.simulated, count, **how)


def percentage(error: float) -> str:
    """A relative standard error in percent, in two digits, at most `CEILING`."""
    return two_digits(error) if error < CEILING else f">{CEILING:g}"


@styled
def velocities_figure(plan: Plan) -> Figure:
    """The curve at the estimate, measured points, plausible v_s, and the velocities to run, with their counts."""
    figure, axes = _panels(plan, 0.6 + 2.6 * len(plan.velocities), len(plan.velocities))
    for ax, velocities in zip(axes, plan.velocities, strict=True):
        p, problem, look = velocities.problem.p, velocities.problem, DIRECTION[velocities.direction]
        sign = -1 if velocities.direction is Direction.NEGATIVE else 1
        v = np.geomspace(problem.low, problem.high, 200)
        torque = sign * evaluate(functions.steady_torque_function(p.law), v, *p.stribeck)[0]
        ax.axvspan(problem.nodes.min(), problem.nodes.max(), color="#dddddd", label="what vₛ may be")
        ax.plot(v, torque, color=look.colour, linestyle=look.line, label="at the estimate")
        fit = plan.joint.static.get(velocities.direction)
        if fit is not None and 0 < fit.velocity.size <= 60:
            far = np.abs(fit.velocity), sign * np.abs(fit.torque)
            ax.plot(*far, "x", color="#555555", markersize=5, label="measured")
        speeds, counts = (np.array(x) for x in zip(*velocities.chosen.runs, strict=True))
        there = sign * evaluate(functions.steady_torque_function(p.law), speeds, *p.stribeck)[0]
        ax.plot(speeds, there, look.marker, color=look.colour, markersize=8, label="to run, how often")
        decimal_log(ax)
        for k, (speed, n) in enumerate(
            zip(speeds.tolist(), counts.tolist(), strict=True)
        ):  # in two rows above the curve
            place = speed, 0.97 - 0.09 * (k % 2)
            ax.text(*place, f"×{n}", transform=ax.get_xaxis_transform(), ha="center", va="top", fontsize=9)
        bottom, top = ax.get_ylim()
        ax.set_ylim(bottom, top + 0.3 * (top - bottom))
        ax.set_ylabel(axis("torque", plan.joint.kind))
        ax.annotate(direction(velocities.direction), (0.01, 1.02), xycoords="axes fraction", fontsize=9)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.subplots_adjust(bottom=0.9 / figure.get_figheight())
    figure.legend(
        handles, labels, loc="lower center", ncols=len(labels), fontsize=9, frameon=False, columnspacing=1.2, handlelength=1.5
    )  # fmt: skip  # a list of values
    axes[-1].set_xlabel(axis("velocity", plan.joint.kind))
    return figure


@styled
def intervals_figure(plan: Plan) -> Figure:
    """Relative standard error of each free parameter, a row each, now and after each part of the plan."""
    names = [plan.start.names[k] for k in plan.free]
    relative = {stage: plan.percent(errors)[plan.free] for stage, errors in plan.standard_errors.items()}
    first, *_, last = (np.minimum(errors, CEILING) for errors in relative.values())
    looks = (("#D55E00", "s"), ("#E69F00", "v"), ("#009E73", "^"), ("#0072B2", "o"))
    figure, (ax,) = _panels(plan, 1.4 + 0.3 * len(names))
    y = np.arange(len(names))[::-1]
    ax.hlines(y, last, first, color="#bbbbbb", linewidth=1.5)
    for (label, errors), (colour, marker) in zip(relative.items(), looks, strict=True):
        ax.plot(np.minimum(errors, CEILING), y, marker, color=colour, markersize=6, label=label, clip_on=False)
    ax.set_xscale("log")
    low, high = ax.xaxis.get_view_interval()  # labels at 1, 2 and 5 of a narrow axis, at powers of ten of a wide one
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0,) if high > 200 * low else (1.0, 2.0, 5.0), numticks=12))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_yticks(y, [symbol(name) for name in names])
    ax.set_ylim(-0.7, len(names) + 0.8)
    ax.set_xlabel("Standard error (% of the value)")
    if max(np.max(relative["now"]), np.max(relative["with motion"])) > CEILING:
        ax.axvline(CEILING, color="#555555", linewidth=0.8, linestyle=":")
        ax.set_xlabel(f"Standard error (% of the value; at {CEILING:g} or more: not identifiable)")
    ax.legend(loc="upper center", ncols=4, fontsize=8.5, handletextpad=0.2, columnspacing=1.0)
    return figure


@styled
def motion_figure(plan: Plan) -> Figure:
    """The tracking motion: position and velocity vs time, with their limits."""
    run, limits = plan.references[-1], plan.limits
    time = np.arange(run.position.size) / limits.rate
    figure, (above, below) = _panels(plan, 5.0, 2, sharex=True)
    k = thinned(time.size, 1500)
    above.plot(time[k], run.position[k], color="#0072B2", linewidth=1.2)
    below.plot(time[k], run.velocity[k], color="#0072B2", linewidth=1.0)
    for edge in (-limits.velocity, limits.velocity):
        below.axhline(edge, color="#D55E00", linestyle="--", linewidth=1.0)
    above.set_ylabel(axis("position", plan.joint.kind))
    below.set_ylabel(axis("velocity", plan.joint.kind))
    below.set_xlabel(axis("time", plan.joint.kind))
    return figure
