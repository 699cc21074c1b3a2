"""A second opinion on friction, independent of the fits: a robust regression, the simplest of a ladder of set-ups."""

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.estimation import levels

BANDWIDTH, ABOVE = 0.999, 12.0  # share of the position's power within its bandwidth, and the low pass over it
SLOWEST, BLOCKS, SAMPLES = 0.03, 10, 4000  # of the greatest speed; blocks in time, of few runs; equations
SHARES = (0.03, 0.06, 0.12, 0.25)  # of the greatest speed: v_s of the peaks tried
HUBER, PASSES = 1.5, 5
SHAPES = ("", "peak", "quadratic")


class SecondOpinion(NamedTuple):
    """A friction curve and its set-up."""

    set_up: tuple[str, ...]
    values: dict[str, float]
    without: Array  # Values without each block, (k, p)
    held_out: float  # Error on held-out blocks, percent of the torque
    slowest: float  # The smallest speed, rad/s
    top: float  # The largest speed, rad/s
    v_s: float

    def friction(self, v: Array) -> tuple[Array, Array]:
        """Friction at velocities, rad/s, and its jackknife standard error, (n,) each."""
        columns = friction_columns(v, self.set_up, self.v_s)
        used = [list(self.values).index(name) for name in columns]
        X, k = np.stack(list(columns.values()), axis=1), len(self.without)
        parts = X @ self.without[:, used].T
        error = np.sqrt((k - 1) / k * np.sum((parts - parts.mean(axis=1, keepdims=True)) ** 2, axis=1))
        return X @ np.array(list(self.values.values()))[used], error


def friction_columns(v: Array, set_up: Sequence[str], v_s: float) -> dict[str, Array]:
    """Columns of a friction by name, (n,) each."""
    sides = {"+": v > 0, "-": v < 0} if "separate" in set_up else {"": np.ones(v.size, dtype=bool)}
    shapes = {"coulomb": np.sign(v), "viscous": v}
    shapes |= {"peak": np.sign(v) * np.exp(-((v / v_s) ** 2))} if "peak" in set_up else {}
    shapes |= {"quadratic": v * np.abs(v)} if "quadratic" in set_up else {}
    return {f"{name}{side}": shape * inside for name, shape in shapes.items() for side, inside in sides.items()}


class _Data(NamedTuple):
    """Equations of all runs, (n,)."""

    v: Array
    a: Array | None
    q: Array | None
    torque: Array
    block: NDArray[np.intp]


def of_motion(records: Sequence[Record], *, slides: bool) -> SecondOpinion | None:
    """The opinion on moving runs with position and torque, of a joint that slides or turns; None of too little data."""
    parts = [part for number, record in enumerate(records) for part in _equations(record, number)]
    if not parts:
        return None
    v, a, q, torque, run = (np.concatenate(x) for x in zip(*parts, strict=True))
    every = max(v.size // SAMPLES, 1)
    v, a, q, torque, run = (x[::every] for x in (v, a, q, torque, run))
    runs = np.unique(run).size  # of many, neighbours are held out together
    order = run if runs >= 6 else np.arange(v.size)
    block = order if 6 <= runs <= BLOCKS else order * BLOCKS // (order.max(initial=0) + 1)
    keep = np.abs(v) > SLOWEST * np.abs(v).max(initial=0.0)
    made = {record.made_of for record in records}  # inertia or gravity that made the torque
    known_a, known_q = (None if name in made else x[keep] for name, x in (("inertia", a), ("gravity", q)))
    of_position = "spring" if slides else "gravity"
    return _opinion(_Data(v[keep], known_a, known_q, torque[keep], block[keep]), of_position)


def of_points(v: Array, torque: Array) -> SecondOpinion | None:
    """The opinion on points, (n,); a block is every fifth by speed."""
    order = np.argsort(v)
    return _opinion(_Data(v[order], None, None, torque[order], np.arange(v.size) % 5))


def _equations(record: Record, number: int) -> list[tuple[Array, ...]]:
    """Velocity, acceleration, position, torque and run number of each stretch between gaps, low-passed."""
    from scipy.signal import butter, sosfiltfilt

    found, step = list[tuple[Array, ...]](), record.step
    if record.position is None or record.integrated or record.torque is None:
        return found
    for start, stop in pairwise([*record.starts, record.time.size]):
        q, torque = record.position[start:stop], record.torque[start:stop]
        if stop - start < 60:
            continue
        power = np.abs(np.fft.rfft((q - q.mean()) * np.hanning(q.size))) ** 2
        reached = np.searchsorted(np.cumsum(power), BANDWIDTH * power.sum())
        cutoff = min(ABOVE * max(float(reached), 1.0) / (q.size * step), 0.4 / step)
        low = butter(4, cutoff, fs=1 / step, output="sos")
        q, torque = (sosfiltfilt(low, x) for x in (q, torque))
        v = np.gradient(q, step)
        every, ends = max(int(0.4 / (cutoff * step)), 1), int(0.5 / (cutoff * step))
        inside = np.zeros(q.size, bool)
        inside[ends : max(q.size - ends, ends) : every] = True
        inside &= ~np.isin(record.torque[start:stop], (record.torque.min(), record.torque.max()))  # perhaps clipped
        found.append(tuple(x[inside] for x in (v, np.gradient(v, step), q, torque, np.full(q.size, number))))
    return found


def _opinion(data: _Data, of_position: str = "") -> SecondOpinion | None:
    blocks = np.unique(data.block)
    if data.v.size < 8 or blocks.size < 3:
        return None
    top, both = float(np.abs(data.v).max()), data.v.min() < 0 < data.v.max()
    ladder = [
        tuple(x for x in choice if x)
        for choice in product(("", "separate"), ("", "offset"), dict.fromkeys(("", of_position)), SHAPES)
        if not ("separate" in choice and "offset" in choice)
        and (both or not {"separate", "offset"} & {*choice})
        and (data.q is not None or not {"gravity", "spring"} & {*choice})
    ]

    def left_by_peak(share: float) -> float:
        names, X = _columns(data, ("separate", "peak") if both else ("peak",), share * top)
        return float(np.median(np.abs(data.torque - X @ _solve(names, X, data.torque))))

    best, outs, tried = min(SHARES, key=left_by_peak), [data.block == k for k in blocks], []
    for set_up in ladder:
        names, X = _columns(data, set_up, best * top)
        if (
            X.shape[1] * 2 > data.v.size
            or np.linalg.cond(X / np.maximum(np.linalg.norm(X, axis=0), 1e-300)) > levels.ALIKE
        ):
            continue
        left = [data.torque[out] - X[out] @ _solve(names, X[~out], data.torque[~out]) for out in outs]
        stray = 5 * 1.4826 * float(np.median(np.abs(np.concatenate(left)))) or np.inf
        tried.append((set_up, np.array([float(np.mean(np.minimum(np.abs(x), stray) ** 2)) for x in left])))
    if not tried:
        return None
    _, least = min(tried, key=lambda x: float(x[1].mean()))
    # the simplest within one standard error of the best over blocks
    within = [
        (set_up, errors)
        for set_up, errors in tried
        if (errors - least).mean() <= np.std(errors - least, ddof=1) / np.sqrt(least.size)
    ]
    set_up, errors = min(within, key=lambda x: (len(_columns(data, x[0], 1.0)[0]), float(x[1].mean())))
    names, X = _columns(data, set_up, best * top)
    theta = _solve(names, X, data.torque)
    without = np.array([_solve(names, X[~out], data.torque[~out]) for out in outs])
    size = float(np.mean(data.torque**2))
    held_out = 100 * float(np.sqrt(errors.mean() / size)) if size else float("inf")
    slowest = max(SLOWEST * top, float(np.abs(data.v).min()))
    values = dict(zip(names, theta.tolist(), strict=True))
    return SecondOpinion(set_up, values, without, held_out, slowest, top, best * top)


def _columns(data: _Data, set_up: Sequence[str], v_s: float) -> tuple[list[str], Array]:
    columns = friction_columns(data.v, set_up, v_s)
    columns |= {} if data.a is None else {"inertia": data.a}
    columns |= {"offset": np.ones(data.v.size)} if "offset" in set_up else {}
    if data.q is not None and "gravity" in set_up:
        columns |= {"gravity_sin": np.sin(data.q), "gravity_cos": np.cos(data.q)}
    columns |= {"spring": data.q} if data.q is not None and "spring" in set_up else {}
    return list(columns), np.stack(list(columns.values()), axis=1)


def _solve(names: Sequence[str], X: Array, y: Array) -> Array:
    """Robust least squares with non-negative friction, (p,)."""
    free = [name.startswith(("offset", "gravity", "spring", "quadratic")) for name in names]
    size = np.maximum(np.linalg.norm(X, axis=0), 1e-300)
    weight, theta = np.ones(y.size), np.zeros(len(names))
    for _ in range(PASSES):
        A, b = X / size * weight[:, None], y * weight
        gram = A.T @ A + 1e-12 * np.eye(size.size)
        root = np.linalg.cholesky(gram)
        low, goal = np.where(free, -np.inf, 0.0), np.linalg.solve(root, A.T @ b)
        theta = np.linalg.solve(root.T, goal)
        if (theta < low).any():
            theta = lsq_linear(root.T, goal, (low, np.inf), method="bvls").x
        left = np.abs(y - X / size @ theta)
        limit = HUBER * 1.4826 * float(np.median(left))
        weight = np.sqrt(np.minimum(1.0, limit / np.maximum(left, 1e-300))) if limit else np.ones(y.size)
    return np.asarray(theta / size)
