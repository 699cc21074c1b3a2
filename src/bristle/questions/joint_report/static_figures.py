"""Results as matplotlib figures. Every axis carries quantity and unit; directions differ in colour, marker and line."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.record import Record
from bristle.identification.curve import FrictionPoints, curve, drag_of, friction_points, stated_curve
from bristle.identification.fits import StaticFit
from bristle.identification.known_joint import as_identified
from bristle.identification.results import Joint
from bristle.model.laws.parts import FASTEST
from bristle.model.parameters import SIGNED, Direction, Kind, Lugre, Stribeck, bends_down, static_of, unit
from bristle.page.style import DIRECTION, LINES, decimal_log, new_figure, panels, styled, thinned
from bristle.page.wording import axis, direction, number, pretty, shortened

FIG_1 = Lugre(0.0194, 0.0055, 0.0394, 0.072, 20.0, 0.02)
"""The parameters of the paper's Fig. 1."""
FIG_1_V_S = (0.036, 0.072, 0.144)
"""Assumed: the paper shows three distinct v_s and names none. The middle one is the gripper's in Table 1."""
_BEYOND = 1.15  # times the fastest measured speed, up to which a curve that is held beyond it is drawn
_SEEN = 0.01  # of the range of torques: a narrower band lies within its line

_SHADES: dict[str, dict[str, Any]] = {
    "kept": {"facecolor": "#009E73", "alpha": 0.3, "linewidth": 0},
    "kept, stick-slip": {"facecolor": "#009E73", "alpha": 0.3, "hatch": "..", "linewidth": 0},
    "rejected": {"facecolor": "none", "edgecolor": "#D55E00", "alpha": 0.5, "hatch": "//", "linewidth": 0},
}
"""How the segments of a run are marked."""


@styled
def stribeck_figure() -> Figure:
    """Fig. 1 of the paper: the steady curve for three values of v_s."""
    figure = new_figure(3.6)
    ax = figure.subplots()
    for sign in (-1.0, 1.0):
        v = sign * np.geomspace(1e-4, 0.5, 200)
        for v_s, line, shade in zip(FIG_1_V_S, LINES, ("#0072B2", "#D55E00", "#000000"), strict=True):
            label = f"{'' if sign > 0 else '_'}vₛ = {v_s} rad/s (assumed)"
            ax.plot(v, curve(v, FIG_1.stribeck._replace(v_s=v_s)), line, color=shade, label=label)
    ax.legend(loc="lower right")
    ax.set(xlabel=axis("velocity", "revolute"), ylabel=axis("torque", "revolute", "friction"))
    return figure


@styled
def curve_figure(joint: Joint) -> Figure:
    """Fig. 4 for a joint: measured friction, the values to use and their stated 95 % band; below, both directions as magnitudes over log speed."""
    figure, (whole, slow) = panels(6.2, joint.name, joint.simulated, 2)
    shown = friction_points(joint)
    # Rejected segments as crosses, accepted ones that were not fitted (held out) as diamonds.
    fitted = {s.place for x in shown for s in x.segments}
    groups = (
        ("rejected", "x", [s for s in joint.segments if not s.accepted]),
        ("held out", "D", [s for s in joint.segments if s.accepted and s.place not in fitted]),
    )
    for name, marker, chosen in groups:
        if chosen:
            v, torque = np.array([(s.velocity, s.torque) for s in chosen]).T
            whole.plot(v, torque, marker, color="#666666", markerfacecolor="none", markersize=5, label=name)
    _frame(whole, joint, shown)
    strays = [(x.velocity, x.torque) for fit in joint.static.values() for x in fit.strays]
    for ax, magnitude in ((whole, False), (slow, True)):
        for x in shown:
            _curves(ax, joint, x, magnitude=magnitude)
            _fitted_points(ax, x, magnitude=magnitude)
        if strays:  # a ring about each point that the warnings name, fitted or left out
            v, torque = np.array(strays).T
            at, force = (np.abs(v), torque * np.sign(v)) if magnitude else (v, torque)
            ax.plot(at, force, "o", color="black", markerfacecolor="none", markersize=11, label="stray, named")
    decimal_log(slow)
    slow.set_ylim(bottom=max(0.0, slow.get_ylim()[0]))  # a torque against the motion is no friction
    whole.set(xlabel=axis("velocity", joint.kind), ylabel=axis("torque", joint.kind, "friction"))
    slow.set(xlabel=axis("velocity", joint.kind, "magnitude of"), ylabel=axis("torque", joint.kind, "magnitude of"))
    if whole.get_legend_handles_labels()[0]:
        whole.legend(loc="best")
    return figure


@styled
def small_figure(joint: Joint) -> Figure:
    """The same in little: points, curve, and how far the axes go, where no friction is drawn: against the motion."""
    figure = Figure(figsize=(2.1, 1.05))
    ax, shown = figure.add_axes((0.02, 0.04, 0.96, 0.92)), friction_points(joint)
    _frame(ax, joint, shown)
    for limits, set_limits in ((ax.get_xlim(), ax.set_xlim), (ax.get_ylim(), ax.set_ylim)):
        set_limits(-max(map(abs, limits)), max(map(abs, limits)))
    for x in shown:
        look, k = DIRECTION[x.direction], thinned(x.velocity.size, 60)
        v, torque, label = x.velocity[k], x.torque[k], f"_fitted {direction(x.direction)}"
        ax.plot(v, torque, look.marker, color=look.colour, markersize=2.2, label=label)
        _curves(ax, joint, x, magnitude=False)
    ax.axhline(0, color="#666666", linewidth=0.5, label="_zero")
    ax.axvline(0, color="#666666", linewidth=0.5, label="_zero")
    if any(x.velocity.size for x in shown):
        fastest = max(float(np.abs(x.velocity).max(initial=0.0)) for x in shown)
        most = max(float(np.abs(x.torque).max(initial=0.0)) for x in shown)
        ax.plot([fastest, 0], [0, most], "+", color="#666666", markersize=5, label="_scale")
        speed, effort = (pretty(unit(name, joint.kind)) for name in ("velocity", "torque"))
        beside: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "top", "fontsize": 9}
        ax.annotate(f"{number(fastest, 2)} {speed}", (fastest, 0), (3, -3), **beside)
        ax.annotate(f"{number(most, 2)} {effort}", (0, most), (-6, 2), **beside)
    ax.set_axis_off()
    return figure


def _directions(joint: Joint) -> Iterator[tuple[str, StaticFit]]:
    return ((d, fit) for d, fit in joint.static.items() if d in DIRECTION)


def _law(joint: Joint, direction: Direction) -> Stribeck[float] | None:
    """The curve of the values to use in a direction, even where no joint can have it; None where none is known."""
    known, one = as_identified(joint), static_of(joint.law)
    values = known.values(direction)
    return one(*(values[name] for name in one._fields)) if values.keys() >= {*one._fields} else None


def _curves(ax: Axes, joint: Joint, points: FrictionPoints, *, magnitude: bool) -> None:
    """The values to use with the band that is stated of them, by sign of the velocity; beyond the fastest speed held where it bends down."""
    drag, stated = drag_of(as_identified(joint)), joint.accuracy
    for d in SIGNED:
        sign, p = float(f"{d}1"), _law(joint, d)
        speeds = np.abs(points.velocity[points.velocity * sign > 0])
        if p is None or not speeds.size:
            continue
        look, of = DIRECTION[points.direction], direction(d)
        slowest, fastest = max(float(speeds.min()) / 2, 1e-3 * float(speeds.max())), float(speeds.max())

        def drawn(v: Array, p: Stribeck[float] = p) -> tuple[Array, Array]:
            """The law over velocities, or its magnitude over speeds."""
            friction = curve(v, p) + drag * v * np.abs(v)
            return (np.abs(v), np.abs(friction)) if magnitude else (v, friction)

        v = np.geomspace(slowest if magnitude else slowest / 50, 1.02 * fastest, 200)
        low, high = (v[0], v[-1]) if stated is None else (0.99 * stated.slowest, 1.02 * stated.fastest)
        ax.plot(*drawn(sign * v), ":", color=look.colour, linewidth=1.0, label=f"_(9) {of} not stated")
        ax.plot(*drawn(sign * v[(v >= low) & (v <= high)]), look.line, color=look.colour, label=f"_(9) {of}")
        if bends_down(p):  # hatched, since nobody measured it
            ends, held = drawn(sign * getattr(p, FASTEST) * np.array([1.0, _BEYOND]))
            ax.plot(ends, held, ":", color=look.colour, linewidth=1.2, label=f"_held {of}")
            hatched: dict[str, Any] = {"facecolor": "none", "edgecolor": "#666666", "hatch": "//", "linewidth": 0}
            ax.axvspan(*sorted(ends.tolist()), **hatched, alpha=0.5, label=_once(ax, "not measured: held", of))
        v = sign * np.geomspace(low, min(high, 1.02 * fastest), 200)
        half = stated_curve(joint, v)[1]
        if np.isfinite(half).all():
            label = "95 % band" if half.max() > _SEEN * np.ptp(points.torque) else "95 % band (within the line)"
            x, y = drawn(v)
            named = _once(ax, label, of)
            ax.fill_between(x, y - half, y + half, color=look.colour, alpha=0.22, linewidth=0, label=named)


def _once(ax: Axes, label: str, of: str) -> str:
    """A label, which the legend has only the first time."""
    return f"_{label} {of}" if label in ax.get_legend_handles_labels()[1] else label


def _fitted_points(ax: Axes, points: FrictionPoints, *, magnitude: bool) -> None:
    """The points that were fitted, with the standard error of the segment that each came from; stick-slip points hollow."""
    k, look, label = thinned(points.velocity.size), DIRECTION[points.direction], direction(points.direction)
    error, sticks = np.full(k.size, np.nan), np.zeros(k.size, dtype=bool)
    if points.segments:
        error = np.array([points.segments[i].standard_error for i in k], dtype=float)  # nan for None
        sticks = np.array([points.segments[i].stick_slip for i in k], dtype=bool)
    x, y = points.velocity[k], points.torque[k]
    if magnitude:
        x, y = np.abs(x), y * np.sign(x)
    bars = np.isfinite(error)
    named = f"_95 % error bars {label}"
    ax.errorbar(x[bars], y[bars], 1.96 * error[bars], fmt="none", ecolor=look.colour, capsize=2, label=named)
    size = 2.0 if k.size > 100 else 5.5
    for chosen, fill, suffix in ((~sticks, look.colour, ""), (sticks, "white", ", stick-slip")):
        if chosen.any():
            named = f"{'_' if magnitude else ''}fitted {label}{suffix}"
            ax.plot(x[chosen], y[chosen], look.marker, color=look.colour, mfc=fill, markersize=size, label=named)


def _frame(ax: Axes, joint: Joint, shown: Sequence[FrictionPoints]) -> None:
    """Limits from what was fitted, so that a wild rejected segment does not flatten the curve."""
    v, torque = (np.concatenate([np.zeros(1), *ys]) for ys in ([x.velocity for x in shown], [x.torque for x in shown]))
    for d in SIGNED:
        if (p := _law(joint, d)) is not None and bends_down(p) and (v * float(f"{d}1") > 0).any():
            v = np.append(v, float(f"{d}1") * _BEYOND * np.abs(v).max())  # drawn held, beyond the fastest speed
    for limits, x in ((ax.set_xlim, v), (ax.set_ylim, torque)):
        low, high = float(x.min()), float(x.max())
        margin = 0.08 * (high - low)
        if margin > 0:
            limits(low - margin, high + margin)


@styled
def residuals_figure(joint: Joint) -> Figure | None:
    """Residuals over velocity, and over position and time where they are known; None where nothing was fitted."""
    fits = [(d, fit) for d, fit in _directions(joint) if fit.residuals.size]
    quantities = ("velocity", "position", "time")
    shown = [q for q in quantities if any(getattr(fit, q).size == fit.residuals.size for _, fit in fits)]
    if not fits:
        return None
    figure, axes = panels(0.5 + 2.1 * len(shown), joint.name, joint.simulated, len(shown), sharey=True)
    for ax, quantity in zip(axes, shown, strict=True):
        ax.axhline(0.0, color="#666666", linewidth=0.8, label="_zero")
        for d, fit in fits:
            x, k = getattr(fit, quantity), thinned(fit.residuals.size)
            if x.size == fit.residuals.size:
                size = 2 if k.size > 100 else 5
                look = DIRECTION[d]
                ax.plot(x[k], fit.residuals[k], look.marker, color=look.colour, markersize=size, label=direction(d))
        ax.set(xlabel=axis(quantity, joint.kind), ylabel=axis("torque", joint.kind, "residual"))
    axes[0].margins(y=0.35)  # room for the legend
    axes[0].legend(loc="upper right", ncols=2)
    return figure


@styled
def inspect_figure(records: Sequence[Record], segments: Sequence[Segment], kind: Kind) -> Figure:
    """Velocity and torque of each run over time; accepted segments shaded, rejected ones hatched, stick-slip marked."""
    figure = new_figure(max(2.6 * len(records), 3.0), width=9.0)
    axes = figure.subplots(max(len(records), 1), 2, squeeze=False)
    for row, record in zip(axes, records, strict=False):
        own = [s for s in segments if s.file == record.file]
        for ax, quantity in zip(row, ("velocity", "torque"), strict=True):
            values = getattr(record, quantity)
            if values is None:
                ax.text(0.5, 0.5, f"no {quantity}", transform=ax.transAxes, ha="center")
            else:
                k = thinned(record.time.size, 3000)
                ax.plot(record.time[k], values[k], "-", color="black", linewidth=0.8, label="_measured")
                low, high = np.percentile(values, [1, 99])
                if np.ptp(values) > 3 * (high - low) > 0:  # a transient would flatten all else
                    ax.set_ylim(low - 0.5 * (high - low), high + 0.5 * (high - low))
            for s in own:
                ends = float(record.time[s.start]), float(record.time[min(s.stop, record.time.size) - 1])
                ax.axvspan(*ends, **_SHADES[_shade_of(s)])
            ax.set(xlabel=axis("time", kind), ylabel=axis(quantity, kind))
        row[0].set_title(shortened(record.file, 48, end=True), loc="left")
        kept = f"{sum(s.accepted for s in own)} of {len(own)} segments kept"
        row[1].set_title(kept if own else "not a ramp run, so not cut into segments", loc="left")
    seen = {_shade_of(s) for s in segments}
    handles = [Patch(**look, label=name) for name, look in _SHADES.items() if name in seen]
    if handles:
        axes[0, 1].legend(handles=handles, loc="lower right", ncols=len(handles), fontsize="small")
    return figure


def _shade_of(s: Segment) -> str:
    return "rejected" if not s.accepted else "kept, stick-slip" if s.stick_slip else "kept"
