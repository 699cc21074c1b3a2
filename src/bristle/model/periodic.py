"""Periodic friction along a steady sine, for many joints at once: rows of one long linear recurrence."""

from math import ceil, pi

import numpy as np

from bristle.arrays import Array
from bristle.model import functions
from bristle.model.parameters import Pair, pair_of
from bristle.model.time_refinement import Nodes, with_extra_nodes
from bristle.model.vectorize import evaluate, scan

SAMPLES = 200  # per period, before nodes at low speed
_BLOCK = 400_000  # nodes of all joints at a time, which bounds memory
_PASSES = 12  # most passes over the sign of z of a pair
_STILL = 1e-12  # of the largest z: tolerance of the passes
_ELASTIC = 1e-14  # least share that a bristle forgets in a period


def rms_torque(joints: Pair[Array], amplitude: float, frequency: float, samples: int = SAMPLES) -> Array:
    """Rms friction torque T_f (3) along amplitude sin(2 pi frequency t) with periodic z, N*m, (m,), to about 1e-4.

    Args:
        joints: both sets of m joints, each parameter (m,).
        amplitude: rad, > 0.
        frequency: Hz, > 0.
        samples: equal steps of the period, >= 8.
    """
    # one period of the velocity from its largest value on, with nodes as close as the smallest v_s asks for
    v = 2 * pi * frequency * amplitude * np.cos(2 * pi * np.arange(samples + 1) / samples)
    one = Nodes(v, 1 / (frequency * samples), slice(0, samples + 1))
    nodes, count = with_extra_nodes(one, min(float(p.v_s.min()) for p in joints)), joints.positive.v_s.size
    h, means = np.broadcast_to(nodes.h, nodes.v.size - 1), list[Array]()
    for joint in np.array_split(np.arange(count), ceil(count * nodes.v.size / _BLOCK)):
        pair = pair_of([x[joint, None] for p in joints for x in p], joints.law)
        z = _deflection(pair, nodes)
        (T,) = evaluate(functions.torque_function(pair.law), z, nodes.v, *_acting(pair, z, nodes.v))
        means.append((T[:, :-1] ** 2 + T[:, 1:] ** 2) @ h / (2 * h.sum()))
    return np.sqrt(np.concatenate(means))


def _deflection(pair: Pair[Array], nodes: Nodes) -> Array:
    """The periodic z at the nodes, (m, N), with sigma_0 by the sign of the given z."""
    heading = np.sign(nodes.heading)
    a, b = evaluate(functions.step_function(pair.law), *nodes.steps, *_acting(pair, heading, nodes.heading))
    z = _closed(a, b)
    for _ in range(_PASSES):
        signs, before = np.where(z[:, :-1] == 0, heading, np.sign(z[:, :-1])), z
        a, b = evaluate(functions.step_function(pair.law), *nodes.steps, *_acting(pair, signs, nodes.heading))
        z = _closed(a, b)
        if (np.abs(z - before).max(axis=1) <= _STILL * np.abs(z).max(axis=1)).all():
            break
    return z


def _closed(a: Array, b: Array) -> Array:
    """The periodic z, (m, n + 1), of z[k + 1] = a[k] z[k] + b[k]; a and b (m, n)."""
    kept = np.prod(a, axis=1)
    end = _scanned(a, b, np.zeros(len(a)))[:, -1]
    return _scanned(a, b, end / np.maximum(1 - kept, _ELASTIC))


def _scanned(a: Array, b: Array, z0: Array) -> Array:
    """One scan for all rows, started again at each z0."""
    forget, new = (np.concatenate([first[:, None], x], axis=1) for first, x in ((np.zeros(len(a)), a), (z0, b)))
    return scan(forget.reshape(-1), new.reshape(-1), 0.0)[1:].reshape(forget.shape)


def _acting(pair: Pair[Array], z: Array, v: Array) -> tuple[Array, ...]:
    return evaluate(functions.active_function(pair.law), z, v, *pair.positive, *pair.negative)
