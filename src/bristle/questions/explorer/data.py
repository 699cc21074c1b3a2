"""Data of the explorer's page as JSON: values with intervals and truth, measurements, and the cost of each fit.

An open bound is "inf" or "-inf", as in results.json; a missing value is null.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from bristle.arrays import Array, to_bound
from bristle.errors import InputError
from bristle.findings import Severity
from bristle.identification.fits import Estimate, PreslidingFit, StaticFit, TrackingFit
from bristle.identification.known_joint import (
    KnownJoint,
    Source,
    chosen,
    guessed_inertia,
    inertia_of,
    known_joint,
    moving_fits,
    stage_estimates,
    without_load,
)
from bristle.identification.results import Joint
from bristle.model import functions, parameters
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import SIGNED, Direction, ParameterName, effort, unit
from bristle.model.vectorize import evaluate
from bristle.page.style import thinned
from bristle.page.wording import in_print, pretty, printable
from bristle.questions.explorer.engine import loop_options
from bristle.simulation.joint_loop import PAPER_ASSUMPTIONS, JointLoop, fastest_measured, one_way

MOST_SAMPLES = 4000  # of a measured run
MOST_DRAWN = 300  # samples of a loading or a loop
_PIECES = {"alpha_0": 4.0, "v_s": 10.0, "sigma_0": 10.0}  # logarithmic sliders, and their range as a factor
_TIMES = 4.0  # range of the other sliders, over the identified value
_SHOWN = ("position", "velocity", "torque", "K_p", "K_i", "K_d")  # quantities with units on the page
_FREQUENCY = 0.5  # Hz, of a sine at the fastest measured speed, for an unknown travel or inertia


def explored(joints: Sequence[Joint], loops: Mapping[str, JointLoop | str]) -> dict[str, Any]:
    """The data of some joints, and their loops or why there is none. Raises InputError where no friction is known."""
    known = [(joint, known_joint(joint)) for joint in joints]
    left_out = [joint.name for joint, one in known if not one.directions]
    if len(left_out) == len(joints):
        raise InputError(
            f"{', '.join(left_out) or 'no joint'}: nothing is known of the friction over velocity; "
            "explore needs ramp, points or tracking runs that were fitted"
        )
    return {
        "schema": "bristle-explorer/1",
        "joints": [_joint(joint, one, loops[joint.name]) for joint, one in known if one.directions],
        "left_out": [printable(name) for name in left_out],
    }


def _joint(joint: Joint, known: KnownJoint, loop: JointLoop | str) -> dict[str, Any]:
    fastest, slow = fastest_measured(joint), joint.presliding
    travel = joint.travel or fastest / (2 * np.pi * _FREQUENCY)
    level = max(known.values(d)["alpha_0"] for d in known.directions)
    guessed = guessed_inertia(level, 2 * np.pi * _FREQUENCY * fastest)
    J = loop.J if isinstance(loop, JointLoop) else inertia_of(None, joint) or guessed
    sets = list(_sets(joint, known, travel, J))
    truth = {  # by direction, where the data are simulated
        str(d): {name: float(x) if np.isfinite(x) else None for name, x in p._asdict().items()}
        for d in SIGNED
        if (p := joint.truth.get(d) or joint.truth.get(Direction.BOTH)) is not None
    }
    speeds = np.abs(np.concatenate([fit.velocity for fit in joint.static.values()] or [np.zeros(0)]))
    slowest = float(min(speeds[speeds > 0], default=fastest / 1000))  # that was fitted
    fitted = {s.place for fit in joint.static.values() for s in fit.segments}
    truth_law = next((p.law for p in joint.truth.values()), None)
    shown = [{name: row["value"] for name, row in p.items()} for one in sets for p in one["values"].values()]
    shown += truth.values() if truth_law == joint.law else ()
    return {
        "name": printable(joint.name),
        "law": joint.law.name,
        "law_title": "" if joint.law == GAUSSIAN else f"Law: {joint.law.title}.",
        "simulated": joint.simulated,
        "units": {name: pretty(unit(name, joint.kind)) for name in (*parameters.fields_of(joint.law), *_SHOWN)},
        "effort": effort(joint.kind),
        "directions": [str(d) for d in known.directions],
        "sets": sets,
        "truth": truth or None,
        "truth_law": truth_law and truth_law.name,
        "ranges": ranges(joint.law, shown, fastest),
        "speeds": [slowest, fastest],
        "static": [_static(d, fit) for d, fit in joint.static.items() if d in set(Direction) - {Direction.SHARED}],
        "other_points": [_point(s) for s in joint.segments if s.accepted and s.place not in fitted],  # held out
        "presliding": {d: _presliding(fit) for d, fit in (slow.fits if slow else {}).items()},
        "loops": [
            _drawn(x.position - (x.position.min() + x.position.max()) / 2, x.torque)
            for x in (slow.loops if slow else ())[:3]
        ],
        "moving": _moving(joint.moving),
        "correlations": list(_correlations(joint)),
        "warnings": [
            f"{w.severity}: {printable(str(w))}"
            for w in (*(w for w in joint.fit_warnings() if w.severity is Severity.CRITICAL), *without_load(joint))
        ],
        "loop": _plans(loop),
    }


def _plans(loop: JointLoop | str) -> list[dict[str, Any]] | str:
    """The cases of the joint's loop, of the paper's joints first that of Table 2, or why there is none."""
    if isinstance(loop, str):
        return loop
    if loop.plant.law != loop.model.law:
        laws = f"{loop.plant.law.name} friction, the fitted model {loop.model.law.name}"
        return f"{printable(loop.name)}: the simulated joint has {laws}; a loop is shown where both have one law"
    cases = [("friction of either direction", loop, False)]
    if loop.assumptions == PAPER_ASSUMPTIONS:
        cases.insert(0, ("friction (+) in both directions, as in Table 2", one_way(loop), True))
    return [
        {
            "label": label, "options": loop_options(one), "one_way": both,
            "assumptions": [printable(in_print(x)) for x in one.assumptions],
        }
        for label, one, both in cases
    ]  # fmt: skip  # a list of values


_Values = dict[str, dict[str, dict[str, Any]]]  # what is known of each parameter, by direction


def _sets(joint: Joint, known: KnownJoint, travel: float, J: float) -> Iterator[dict[str, Any]]:
    """The values to use, then those of the stages and of moving runs, if they differ and are possible."""
    source = {row.parameter: str(row.source) for row in chosen(joint)}
    use: _Values = {}
    for d in known.directions:
        missing, use[str(d)] = known.missing(d), {}
        for name, value in known.filled(d, travel, J)._asdict().items():
            estimate = None if name in missing else known.estimate(name, d)
            of = "assumed" if name in missing else parameters.in_direction(source, name, d) or "given"
            use[str(d)][name] = _value(value, estimate, of)
    yield {"key": "use", "label": "values to use", "values": use}

    # Values of constant velocity and slow loading; none where a direction has no such fit.
    stages: _Values = {}
    own = {row.parameter: row for row in stage_estimates(joint)}
    for side, rows in use.items():
        fit = joint.static.get(side)
        if fit is not None and (law := fit.values()) is not None:
            stages[side] = dict(rows)
            for name in parameters.fields_of(joint.law):
                row = own.get(ParameterName(name, Direction(side)))
                estimate = None if row is None else row.estimate
                value = getattr(law, name, None if estimate is None else estimate.value)
                if value is not None:
                    stages[side][name] = _value(value, estimate, str(Source.STATIC if row is None else row.source))

    # Values of moving runs; none where a direction has no complete set.
    moving: _Values = {}
    for side in use:
        if (run := joint.moving) is not None and (p := run.values(side)) is not None:
            parts = ((n, x, parameters.in_direction(run.parameters, n, side)) for n, x in p._asdict().items())
            moving[side] = {n: _value(x, estimate, str(Source.TRACKING)) for n, x, estimate in parts}

    for key, label, values in (
        ("stages", "fits of constant velocity and slow loading alone", stages),
        ("moving", "fit of moving runs", moving),
    ):
        pairs = [
            (n, values[d][n]["value"], use[d][n]["value"]) for d in values for n in parameters.fields_of(joint.law)
        ]
        other = any(value != used for _, value, used in pairs) and all(
            parameters.is_possible(n, value) for n, value, _ in pairs
        )
        if other and len(values) == len(use):
            yield {"key": key, "label": label, "values": values}


def _value(value: float, estimate: Estimate | None, source: str) -> dict[str, Any]:
    interval = estimate.interval if estimate is not None and estimate.value is not None else None
    return {
        "value": float(value),
        "standard_error": None if estimate is None else estimate.standard_error,
        "interval": None if interval is None else [to_bound(end) for end in interval],
        "source": source,
    }


def _static(direction: str, fit: StaticFit) -> dict[str, Any]:
    """One fit of constant velocities: its points and cost.

    `torque` is without other regressors, `norm` the divisor of the relative error. A cost that two directions share is
    that of this direction, with the other as fitted.
    """
    p, v = fit.values(), fit.velocity
    extra = np.zeros(0)
    if p is not None and fit.residuals.size:
        extra = fit.torque - fit.residuals - evaluate(functions.steady_torque_function(p.law), v, *p)[0]
    off = bool(extra.size) and float(np.abs(extra).max()) > 1e-9 * float(np.abs(fit.torque).max())
    torque = fit.torque - extra if off else fit.torque
    errors = [s.standard_error for s in fit.segments]
    cost, left = float(fit.residuals @ fit.residuals), float(np.linalg.norm(fit.residuals))
    profile, drawn = fit.profile, None
    other = 0.0 if profile is None or abs(profile.best_cost - cost) <= 1e-6 * cost else profile.best_cost - cost
    if profile is not None:
        k = thinned(profile.near_v_s.size, MOST_DRAWN)
        drawn = {"v_s": profile.near_v_s[k].tolist(), "cost": (profile.near_cost - other)[k].tolist()}
    return {
        "direction": direction, "velocity": v.tolist(), "torque": torque.tolist(),
        "standard_error": errors if len(errors) == v.size else None,
        "stick_slip": [bool(s.stick_slip) for s in fit.segments],
        "place": [printable(f"{s.file} {s.where}") for s in fit.segments],
        "norm": 100 * left / fit.relative_error if fit.relative_error else float(np.linalg.norm(fit.torque)),
        "rms": fit.rms, "relative_error": fit.relative_error, "cost": cost,
        "least": None if profile is None else profile.best_cost - other,
        "threshold": None if profile is None else profile.threshold - other, "profile": drawn,
        "strays": [_point(s) for s in fit.strays],
    }  # fmt: skip  # a list of values


def _point(s: Any) -> dict[str, Any]:
    return {"velocity": s.velocity, "torque": s.torque, "place": printable(f"{s.file} {s.where}")}


def _presliding(fit: PreslidingFit) -> dict[str, Any]:
    """Slow loading of one direction, each loading from its rest position by sigma_0."""
    loadings, sigma_0 = [], fit.sigma_0.value
    for x in fit.loadings:
        # The rest position: mean over count edges of the displacement less that of the model.
        rest, below = 0.0, fit.level > x.edge_torque
        if sigma_0 and sigma_0 > 0 and below.any():
            T = x.edge_torque[below]
            taken = evaluate(functions.loading_displacement_function(), T, fit.level, sigma_0)[0]
            rest = float(np.average(x.edge_displacement[below] - taken, weights=(1 - T / fit.level) ** 2))
        edges = thinned(x.edge_torque.size, 40)
        own = {
            "edge_displacement": (x.edge_displacement[edges] - rest).tolist(),
            "edge_torque": x.edge_torque[edges].tolist(),
        }
        loadings.append(_drawn(x.displacement - rest, x.torque) | own)
    return {"level": float(fit.level), "loadings": loadings}


def _drawn(displacement: Array, torque: Array) -> dict[str, Any]:
    k = thinned(torque.size, MOST_DRAWN)
    return {"displacement": displacement[k].tolist(), "torque": torque[k].tolist(), "samples": int(torque.size)}


def _moving(fit: TrackingFit | None) -> dict[str, Any] | None:
    """The equations of the fit of moving runs, with its set; None where there is none."""
    if fit is None or fit.velocity.size < 2:
        return None
    sets = {d: p for d in SIGNED if (p := fit.values(d) or fit.values(Direction.BOTH)) is not None}
    if not sets:
        return None
    one = next(iter(sets.values()))
    n, steps = min(fit.velocity.size, MOST_SAMPLES), np.diff(fit.time)
    usual = float(np.median(steps))
    # First equation of each run and after each gap: time steps back, or by more than two steps.
    starts = [0, *(1 + np.flatnonzero((steps <= 0) | (steps > 2 * usual))).tolist()]
    return {
        "pair": {"law": fit.law.name, **{str(d): sets.get(d, one)._asdict() for d in SIGNED}},
        "step": usual, "time": fit.time[:n].tolist(), "velocity": fit.velocity[:n].tolist(),
        "residuals": fit.residuals[:n].tolist(), "starts": [k for k in starts if k < n],
        "norm": float(np.linalg.norm(fit.measured[:n])), "equations": int(fit.velocity.size),
        "relative_error": float(fit.relative_error) if n == fit.velocity.size else None,
    }  # fmt: skip  # a list of values


def _correlations(joint: Joint) -> Iterator[dict[str, Any]]:
    fits: list[tuple[str, Sequence[str], Array]] = [
        (f"constant velocity {d}", fit.names, fit.covariance) for d, fit in joint.static.items() if fit.names
    ]
    words = {Source.TRACKING: "moving runs alone", Source.JOINT: "moving runs with the other stages"}
    fits += [(words[source], [str(n) for n in fit.names], fit.covariance) for source, fit in moving_fits(joint).items()]
    for label, names, covariance in fits:
        spread = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
        if len(names) > 1 and np.isfinite(covariance).all() and (spread > 0).all():
            matrix = covariance / np.outer(spread, spread)
            yield {"label": label, "names": list(names), "matrix": np.clip(matrix, -1.0, 1.0).tolist()}


def ranges(law: Law, sets: Sequence[Mapping[str, float | None]], fastest: float) -> dict[str, dict[str, Any]]:
    """Ends of each parameter's slider, its least value, and whether it is logarithmic.

    `sets`: the values to be shown, of both directions; `fastest`: measured speed, rad/s, which has no slider.
    """
    names = [name for name in parameters.fields_of(law) if name != FASTEST]
    rows = {name: [x for p in sets if (x := p[name]) is not None] for name in names}
    searched = {own.name: own.searched for own in law.peak.own}
    # Torque of a parameter of one at the fastest speed, for those that may be zero.
    columns = evaluate(functions.linear_shapes_function(law), fastest)
    named = zip(("alpha_0", "alpha_2", *law.coefficients), columns, strict=True)
    torques = {"alpha_1": 1.0} | {name: float(x) for name, x in named}
    found: dict[str, dict[str, Any]] = {}
    for name, values in rows.items():
        positive, least = [x for x in values if x > 0], parameters.least_of(name)
        if name in searched:
            ends = [*searched[name], *positive]
            own = {"low": min(ends), "high": max(ends), "log": True}
        elif name in _PIECES and positive:
            by = _PIECES[name]
            own = {"low": min(positive) / by, "high": max(positive) * by, "log": True}
        else:
            size = max(map(abs, values)) or max(rows["alpha_0"]) / torques.get(name, fastest)
            own = {"low": max(least, -_TIMES * size), "high": _TIMES * size, "log": False}
        found[name] = own | {"least": to_bound(least)}
    return found
