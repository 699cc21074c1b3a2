"""Rollout of LuGre along a velocity, with exact Jacobian: exact-exponential steps over nodes, scanned in chunks.

For a `Pair` a node also stands where z changes sign. Several motions may be rolled out one behind the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array
from bristle.model import functions
from bristle.model.parameters import Lugre, Pair, fields_of, lugre_of
from bristle.model.time_refinement import Index, Nodes, inserted, with_extra_nodes
from bristle.model.vectorize import evaluate, scan, vectorised

AT_ONCE = 15_000  # samples worked on at a time
_FADED = 1e-150  # added to each sensitivity's source, against slow denormal numbers
_ONE = np.zeros(1, dtype=np.intp)  # where one motion begins
_PASSES = 50  # at most this many scans of a chunk to settle where z changes sign
_STILL = 1e-12
"""Sign changes of z have settled when z changes there by at most this share of alpha_0 / sigma_0 per scan."""

_Parameters = Lugre[float] | Pair[float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rollout:
    """Result along a velocity, (n,), read-only."""

    z: Array
    """Mean bristle deflection, rad."""
    torque: Array
    """T_f, N*m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RolloutJacobian(Rollout):
    """A rollout with its exact total derivatives."""

    by_parameters: Array
    """dT_f/dp, (n, 6) in the order of the law's tuple, or (n, 12) for a pair, positive set first."""
    by_z0: Array
    """dT_f/dz0 at given parameters, N*m/rad, (n,)."""


def load_level(rises: Mapping[str, float], motor: Array, links: Array) -> Array:
    """Rise of the level by coefficients (`law.load_levels`), by name, under motor and link torques, N*m, (n,)."""
    function = functions.load_levels_function()
    columns = dict(zip(function.name_out(), evaluate(function, motor, links), strict=True))
    return np.asarray(sum((rises[name] * columns[name] for name in rises), np.zeros_like(motor)))


def rollout(
    velocity: Array,
    step: float | Array,
    parameters: _Parameters,
    z0: float | Array | None = None,
    coarsening: float = 1.0,
    level: Array | None = None,
    begins: Index = _ONE,
) -> Rollout:
    """Bristle deflection and friction torque (3)-(5) along a velocity that is linear between its samples.

    Args:
        velocity: rad/s at the samples, (n,); n may be 0 or 1.
        step: time between samples, s, > 0: scalar or (n - 1,).
        parameters: one set, or a pair of sets: sigma_0 by the sign of z, all others by the sign of v.
        z0: deflection at the first sample, rad, of several motions (m,); by default the steady one for the first velocity,
            0 where that is 0.
        coarsening: how many times farther apart than usual nodes may stand between samples; 10 is quick, and good for a
            start.
        level: what a load adds to alpha_0 at the samples (`law.load_levels`), N*m, (n,), linear between them, never so far
            below zero that the level is not positive; None: nothing.
        begins: the first sample of each motion, (m,), ascending from 0; several need their `z0`. What `step` says of the time
            between two of them counts for nothing.

    Raises:
        ValueError: where velocity is not a finite (n,) array, or step is not positive or of another length.
    """
    velocity, step = _checked(velocity, step)
    z_all, torque = np.empty((2, velocity.size))
    advance = vectorised(functions.step_function(parameters.law))
    friction = vectorised(functions.torque_function(parameters.law))
    risen = None if level is None else level[None]
    starts = np.atleast_1d(_start(velocity, parameters, risen)[0] if z0 is None else z0)
    z = float(starts[0])
    for at, drawn, own in _chunks(velocity, step, parameters, coarsening, risen, begins):
        nodes, signs = _settled(drawn, z, starts[own], parameters)
        a, b = advance(*nodes.steps, *_risen(_acting(parameters, signs, nodes.heading), nodes))
        a[nodes.begins - 1], b[nodes.begins - 1] = 0.0, starts[own]
        inside = scan(a, b, z)
        z_all[at] = inside[nodes.samples]
        acting = _with_level(_acting(parameters, z_all[at], velocity[at]), None if level is None else level[at])
        friction(z_all[at], velocity[at], *acting, out=[torque[at]])
        z = float(inside[-1])
    return Rollout(z=_frozen(z_all), torque=_frozen(torque))


def rollout_jacobian(
    velocity: Array, step: float | Array, parameters: _Parameters, z0: float | None = None
) -> RolloutJacobian:
    """The rollout with the exact derivative of its torque with respect to the parameters and to z0.

    The sensitivities dz/dp obey the recurrence of z with another right-hand side, which CasADi writes. Arguments and
    errors are those of `rollout`; where z0 is not given, the derivative of the steady start is part of `by_parameters`.
    """
    velocity = np.asarray(velocity, dtype=np.float64)
    sets = 1 if isinstance(parameters, Lugre) else 2
    rows = np.empty((len(fields_of(parameters.law)) * sets + 1, velocity.size))
    rolled = rollout_into(list(rows), velocity, step, parameters, z0)
    return RolloutJacobian(
        z=rolled.z, torque=rolled.torque, by_parameters=_frozen(rows[:-1].T), by_z0=_frozen(rows[-1])
    )


def rollout_into(
    rows: Sequence[Array],
    velocity: Array,
    step: float | Array,
    parameters: _Parameters,
    z0: float | Array | None = None,
    coarsening: float = 1.0,
    level: Array | None = None,
    begins: Index = _ONE,
) -> Rollout:
    """The rollout, and its derivatives written to `rows`: (n,) for each parameter, 6 or 12 of the paper's law, then for z0.

    A fit gives the rows of its own Jacobian: fresh memory for another costs as much as a fifth of the work. `level`, (1
    + k, n), is that of `rollout`, and its derivatives by k parameters of its own, whose rows stand between those of the
    law and z0's, which is each motion's own. All else as in `rollout_jacobian` and `rollout`.
    """
    velocity, step = _checked(velocity, step)
    law, fields = parameters.law, fields_of(parameters.law)
    names, count = functions.step_parameters(law), len(fields)
    advance = vectorised(functions.step_sensitivity_function(law))
    friction = vectorised(functions.torque_sensitivity_function(law))
    sets, rises = 1 if isinstance(parameters, Lugre) else 2, 0 if level is None else len(level) - 1
    enters = np.array([count * k + fields.index(name) for k in range(sets) for name in names])  # columns of these
    z_all, torque = np.empty((2, velocity.size))
    *every, by_z0 = rows
    by_parameters, by_level = every[: len(every) - rises], every[len(every) - rises :]
    start, carry = _start(velocity, parameters, level) if z0 is None else (z0, np.zeros(enters.size + rises))
    starts = np.atleast_1d(start)
    z, faded = float(starts[0]), 1.0
    for at, drawn, own in _chunks(velocity, step, parameters, coarsening, level, begins):
        nodes, signs = _settled(drawn, z, starts[own], parameters)
        slopes = np.empty((2 + 2 * len(names), nodes.v.size - 1))
        advance(*nodes.steps, *_risen(_acting(parameters, signs, nodes.heading), nodes), out=list(slopes))
        slopes[:, nodes.begins - 1] = 0.0  # what a motion begins with depends on no parameter
        slopes[1, nodes.begins - 1] = starts[own]
        inside = scan(slopes[0], slopes[1], z)
        source, offset = slopes[2 : 2 + len(names)], slopes[2 + len(names) :]
        source *= inside[:-1]  # dz+/dp at fixed z is da/dp z + db/dp
        source += offset
        source += _FADED
        shares = _by_set(source, parameters, signs, nodes.heading, names)
        if rises:  # the level adds to alpha_0
            shares = np.vstack([shares, nodes.rise[1:] * source[names.index("alpha_0")]])
        z_by = scan(slopes[0], shares, carry)
        z_all[at] = inside[nodes.samples]
        T_z = np.empty(at.stop - at.start)
        acting, derivatives = _acting(parameters, z_all[at], velocity[at]), [row[at] for row in by_parameters]
        acting = _with_level(acting, None if level is None else level[0, at])
        friction(z_all[at], velocity[at], *acting, out=[torque[at], T_z, *derivatives[:count]])
        for row, slope, z_rise in zip(by_level, () if level is None else level[1:], z_by[enters.size :], strict=True):
            row[at] = derivatives[0] * slope[at] + T_z * z_rise[nodes.samples]
        if isinstance(parameters, Pair):
            shared_out = _by_set(np.array(derivatives[:count]), parameters, z_all[at], velocity[at], fields)
            for row, part in zip(derivatives, shared_out, strict=True):
                row[:] = part
        for column, row in zip(enters, z_by[: enters.size], strict=True):
            derivatives[column] += T_z * row[nodes.samples]
        by_z0[at] = 0.0
        if faded > _FADED or nodes.begins.size:
            begun = np.zeros(slopes.shape[1])
            begun[nodes.begins - 1] = 1.0
            left = scan(slopes[0], begun, faded)
            by_z0[at], faded = T_z * left[nodes.samples], float(left[-1])
        z, carry = float(inside[-1]), np.where(np.abs(z_by[:, -1]) > _FADED, z_by[:, -1], 0.0)
    return Rollout(z=_frozen(z_all), torque=_frozen(torque))


def _checked(velocity: Array, step: float | Array) -> tuple[Array, Array]:
    velocity, step = np.asarray(velocity, dtype=np.float64), np.asarray(step, dtype=np.float64)
    if velocity.ndim != 1 or not np.isfinite([velocity.min(initial=0.0), velocity.max(initial=0.0)]).all():
        raise ValueError(
            f"velocity has shape {velocity.shape}, or holds a value that is not finite; expected a finite array (n,)"
        )
    count = max(velocity.size - 1, 0)
    if step.shape not in ((), (count,)) or not (np.isfinite(step) & (step > 0)).all():
        raise ValueError(
            f"step has shape {step.shape}, or is not positive and finite; expected one positive number or {count} of them"
        )
    return velocity, step


def _frozen(array: Array) -> Array:
    array.setflags(write=False)
    return array


def _acting(parameters: _Parameters, z: Array, v: Array) -> Sequence[float | Array]:
    """The set that acts at (z, v): numbers, or arrays of a pair."""
    if isinstance(parameters, Lugre):
        return parameters
    return evaluate(functions.active_function(parameters.law), z, v, *parameters.positive, *parameters.negative)


def _risen(acting: Sequence[float | Array], nodes: Nodes) -> Sequence[float | Array]:
    """The set that acts over each step, with the level of a load."""
    return _with_level(acting, None if nodes.level is None else nodes.rise[0])


def _with_level(acting: Sequence[float | Array], level: Array | None) -> Sequence[float | Array]:
    """A set with something added to alpha_0, which comes first."""
    return acting if level is None else (acting[0] + level, *acting[1:])


def _by_set(rows: Array, parameters: _Parameters, z: Array, v: Array, names: Sequence[str]) -> Array:
    """Derivatives by the acting set, (m, n), assigned to the sets of a pair, (2 m, n)."""
    if isinstance(parameters, Lugre):
        return rows
    fields, one = fields_of(parameters.law), lugre_of(parameters.law)
    of_one = Pair(one(*[1.0] * len(fields)), one(*[0.0] * len(fields)))
    shares = dict(zip(fields, _acting(of_one, z, v), strict=True))
    positive = np.array([shares[name] for name in names])
    return np.vstack([rows * positive, rows * (1 - positive)])


def _start(velocity: Array, parameters: _Parameters, level: Array | None = None) -> tuple[float, Array]:
    """The steady deflection at the first velocity, and its derivatives by parameters of z, then of the level."""
    v = velocity[:1] if velocity.size else np.zeros(1)
    first = np.zeros((1, 1)) if level is None or not velocity.size else level[:, :1]
    acting = _with_level(_acting(parameters, v, v), first[0])
    z, *by = evaluate(functions.steady_deflection_function(parameters.law), v, *acting)
    names, fields = functions.step_parameters(parameters.law), fields_of(parameters.law)
    rows = np.array([by[fields.index(name)] for name in names])
    return float(z[0]), np.append(_by_set(rows, parameters, v, v, names)[:, 0], first[1:, 0] * by[0][0])


def _chunks(
    velocity: Array, step: Array, parameters: _Parameters, coarsening: float, level: Array | None, begins: Index
) -> Iterator[tuple[slice, Nodes, slice]]:
    """Chunks of samples with their nodes, and the motions that begin within."""
    v_s = parameters.v_s if isinstance(parameters, Lugre) else min(p.v_s for p in parameters)
    for start in range(0, velocity.size, AT_ONCE):
        stop = min(start + AT_ONCE, velocity.size)
        h = step[start:stop] if step.ndim else float(step)
        own = slice(*np.searchsorted(begins, [start, stop], side="right").tolist())
        risen = None if level is None else level[:, start : stop + 1]
        nodes = Nodes(velocity[start : stop + 1], h, slice(0, stop - start), risen, begins[own] - start)
        yield slice(start, stop), with_extra_nodes(nodes, v_s, coarsening), own


def _settled(nodes: Nodes, z0: float, starts: Array, parameters: _Parameters) -> tuple[Nodes, Array]:
    """For a pair: nodes also where z changes sign, and the sign of z in every step.

    While the motion has one direction z changes its sign once at the most, under the set of the sign that it had: a
    scan of each such stretch from its start says where. The starts are found by repeating this until nothing moves.
    Each pass settles at least one more of them, and those after a stretch that sliding has made forgotten settle all at
    once.
    """
    if isinstance(parameters, Lugre) or nodes.v.size < 2:
        return nodes, np.zeros(0)
    advance = vectorised(functions.step_function(parameters.law))
    v0, v1, h = nodes.steps
    ahead = np.sign(nodes.heading)
    sets = np.array([_acting(parameters, np.array(sign), nodes.heading) for sign in (1.0, -1.0)])  # of each sign of z
    above, below = (advance(v0, v1, h, *_risen([*acting], nodes)) for acting in sets)
    for a, b in (above, below):
        a[nodes.begins - 1], b[nodes.begins - 1] = 0.0, starts
    first = np.flatnonzero(np.diff(ahead, prepend=np.nan))
    if nodes.begins.size:
        first = np.union1d(first, nodes.begins[nodes.begins < ahead.size])
    lengths = np.diff(first, append=ahead.size)
    still = _STILL * min(p.alpha_0 / p.sigma_0 for p in parameters)

    def steps(side: Array) -> tuple[Array, Array]:
        """Coefficients of every step for these signs of z."""
        a, b = (np.where(side < 0, minus, plus) for plus, minus in zip(above, below, strict=True))
        return a, b

    z = scan(*steps(ahead), z0)
    for _ in range(_PASSES):
        start = z[first]
        side = np.repeat(np.where(start == 0, ahead[first], np.sign(start)), lengths)
        a, b = steps(side)
        apart, from_start = a.copy(), b.copy()
        apart[first[1:] - 1], from_start[first[1:] - 1] = 0.0, start[1:]
        z = scan(apart, from_start, z0)
        passed = side * z[:-1] < 0
        crosses = ~passed & (side * (a * z[:-1] + b) < 0)
        crosses[nodes.begins - 1] = False
        at = np.flatnonzero(crosses)
        share = _share_before(v0[at], v1[at], np.abs(z[at] / b[at]), 1 - a[at])
        side = np.where(passed, ahead, side)
        a, b = steps(side)
        if at.size:  # a step in which z changes sign is two, one after the other
            (turn, level), whole = nodes.inside(at, share), h if isinstance(h, float) else h[at]
            begin, end = np.concatenate([v0[at], turn]), np.concatenate([turn, v1[at]])
            risen = None
            if nodes.level is not None and level is not None:
                risen = np.concatenate([nodes.level[0, at] + level[0], level[0] + nodes.level[0, at + 1]]) / 2
            below_zero = np.concatenate([side[at], ahead[at]]) < 0
            acting = _with_level([*sets[below_zero.astype(np.intp), :, np.concatenate([at, at])].T], risen)
            a_of, b_of = advance(begin, end, np.concatenate([whole * share, whole * (1 - share)]), *acting)
            before, after = slice(at.size), slice(at.size, None)
            a[at], b[at] = a_of[after] * a_of[before], a_of[after] * b_of[before] + b_of[after]
        z = scan(a, b, z0)
        if np.abs(z[first] - start).max() <= still:
            break
    return inserted(nodes, at, share)[0], np.insert(side, at + 1, ahead[at])


def _share_before(v0: Array, v1: Array, reached: Array, forgotten: Array) -> Array:
    """The share of a step's duration after which z is zero, where it changes sign in it, (k,).

    While g is constant, z reaches zero after the share log(1 + abs(z0 / z_ss)) / (h lambda) of the way travelled, and v
    is linear in time.

    Args:
        v0: velocity where the step begins, rad/s, (k,).
        v1: where it ends.
        reached: abs(z0) over what the step adds to a z of zero, (k,).
        forgotten: 1 - exp(-h lambda), (k,).
    """
    # a bristle that hardly moves in the step crosses at its end
    forgotten = np.minimum(np.maximum(forgotten, 1e-9), 1 - 1e-15)
    way = np.log1p(reached * forgotten) / -np.log1p(-forgotten)
    way = np.minimum(np.maximum(way, np.finfo(float).tiny), 1.0)
    first, last = np.abs(v0), np.abs(v1)
    slow, fast = first / (first + last), last / (first + last)
    fraction: Array = way / (slow + np.sqrt(slow**2 + (fast - slow) * way))
    return fraction
