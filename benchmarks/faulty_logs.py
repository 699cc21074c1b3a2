"""Simulated logs of a LuGre joint, clean ones and ones with a physical fault, for `faults.py`.

Every log draws a joint of its own from its seed, by factors of about 1.3. Signals are logged at 500 Hz.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate

RATE = 500.0
TYPICAL = Lugre(0.5, 0.2, 0.4, 0.08, 1000.0, 0.5)
J = 0.02
TONES = ((0.17, 0.8), (0.41, 0.5), (1.1, 0.3))
"""Of a motion: Hz and rad/s."""


@dataclass
class Log:
    """Signals of one log, SI, (n,), and what its experiment file says."""

    t: Array
    q: Array
    v: Array
    torque: Array
    kind: str
    truth: Lugre[float]
    holds: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    """Of constant-velocity runs: which hold each sample is of, (n,)."""
    velocity_logged: bool = False
    rate: float | None = None
    """Declared instead of a time column, Hz."""
    more: str = ""
    """Lines that a user adds to the draft."""
    beside: "Log | None" = None
    """Another run of the same joint."""
    drag: float = 0.0
    """Torque that a fault added as v * abs(v) ..."""
    raised: float = 0.0
    """... and the share of friction that it added in direction +."""


def joint(rng: np.random.Generator) -> Lugre[float]:
    """A joint."""
    return Lugre(*(float(x * np.exp(0.3 * rng.standard_normal())) for x in TYPICAL))


def motion(seed: int, seconds: float = 8.0, peak: bool = True) -> Log:
    """Three tones, simulated at 4 kHz; an encoder of 20 bits, 0.5 % of noise in the torque; perhaps without a Stribeck peak."""
    rng = np.random.default_rng(seed)
    p = joint(rng)
    p = p if peak else p._replace(alpha_1=0.0)
    h, n = 1 / 4000, round(4000 * seconds)
    t = h * np.arange(n, dtype=np.float64)
    v = np.sum([a * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi)) for f, a in TONES], axis=0)
    torque = rollout(v, h, p).torque + J * np.gradient(v, h)
    q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * h)])
    part = slice(None, None, round(1 / h / RATE))
    noise = 5e-3 * rms(torque) * rng.standard_normal(t[part].size)
    return Log(t[part], counted(q[part], 20), v[part], torque[part] + noise, "tracking", p)


def without_peak(seed: int) -> Log:
    """A motion of a joint whose friction has no Stribeck effect."""
    return motion(seed, peak=False)


def steady(v: Array, p: Lugre[float]) -> Array:
    """Friction at constant velocities, (n,)."""
    return evaluate(steady_torque_function(), v, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)[0]


def ramps(seed: int, speeds: Array | None = None, seconds: float = 2.0) -> Log:
    """Holds at 14 speeds in each direction, or at others, in v_s, in random order; 2 % of noise in each sample, 2e-3 N*m in each hold."""
    rng = np.random.default_rng(seed)
    p = joint(rng)
    speeds = np.geomspace(0.2 * p.v_s, 1.5, 14) if speeds is None else speeds * p.v_s
    each = rng.permutation(np.concatenate([speeds, -speeds]))
    holds = np.repeat(np.arange(each.size), round(seconds * RATE))
    v = each[holds]
    torque = steady(v, p) * (1 + 0.02 * rng.standard_normal(v.size)) + 2e-3 * rng.standard_normal(each.size)[holds]
    return again(Log(np.arange(v.size, dtype=np.float64) / RATE, v, v, torque, "ramp", p, holds=holds), v, torque)


def points(seed: int) -> Log:
    """A table of 20 speeds in each direction, with noise of 1 % of alpha_0."""
    rng = np.random.default_rng(seed)
    p = joint(rng)
    speeds = np.geomspace(0.1 * p.v_s, 1.5, 20)
    v = np.concatenate([-speeds[::-1], speeds])
    torque = steady(v, p) + 0.01 * p.alpha_0 * rng.standard_normal(v.size)
    return Log(np.arange(v.size, dtype=np.float64), v, v, torque, "points", p)


def slow(seed: int) -> Log:
    """Two slow cycles of torque to 0.85 g0 in each direction, without sliding, then one until it slides; beside ramps, which give g0.

    LuGre without inertia and viscous friction: dx = dT / (sigma_0 (1 - sgn(dx) T / g0)), from (4).
    """
    rng = np.random.default_rng([seed, 1])
    beside = ramps(seed)
    p = beside.truth
    g0 = p.alpha_0 + p.alpha_1
    t = np.arange(round(32 * RATE), dtype=np.float64) / RATE
    load = 0.85 * g0 * np.interp(t % 16, [0, 4, 8, 12, 16], [0, 1, 0, -1, 0])
    dT = np.diff(load, prepend=0.0)
    q = np.cumsum(dT / (p.sigma_0 * (1 - np.sign(dT) * load / g0)))
    torque = load + 1e-3 * g0 * rng.standard_normal(t.size)
    q = counted(q + rng.uniform(0, 1) * 2 * np.pi / 2**20, 20)
    return Log(t, q, np.gradient(q, t), torque, "presliding", p, beside=beside)


def curve(log: Log, v: Array) -> Array:
    """True friction at some velocities, N*m, (n,), what a fault added to it included."""
    return steady(v, log.truth) * np.where(v > 0, 1 + log.raised, 1.0) + log.drag * v * np.abs(v)


def speeds(log: Log) -> Array:
    """Over which the curve of a log without its fault is judged, rad/s: those of holds and points; of a motion 60 in each direction."""
    log = log.beside or log
    if log.kind == "tracking":
        v = np.linspace(0.02, 1, 60) * np.abs(log.v).max()
        return np.append(v, -v)
    return np.unique(log.v)


def drag(x: Log, s: float) -> Log:
    """Quadratic drag."""
    return replace(x, torque=x.torque + s * x.v * np.abs(x.v), drag=s)


def again(log: Log, v: Array, torque: Array) -> Log:
    """The log with another velocity and torque, (n,), and the position that goes with them."""
    return replace(log, v=v, torque=torque, q=counted(np.cumsum(v) / RATE, 18))


def counted(q: Array, bits: float) -> Array:
    """As an encoder of so many bits to a turn reads it, (n,)."""
    count = 2 * np.pi / 2**bits
    counts: Array = np.floor(q / count) * count
    return counts


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(x**2)))


Change = Callable[[Log, float], Log]
Signal = Callable[[Log, float], Array]


def torque(change: Signal) -> Change:
    """A fault of the torque alone."""
    return lambda x, s: replace(x, torque=change(x, s))


def position(change: Signal) -> Change:
    """A fault of the position alone."""
    return lambda x, s: replace(x, q=change(x, s))


def speed(change: Signal) -> Change:
    """A fault of a velocity that is logged."""
    return lambda x, s: replace(x, v=change(x, s), velocity_logged=True)


def rows(x: Log, keep: NDArray[np.intp]) -> Log:
    """Some samples, by index."""
    return replace(x, **{name: getattr(x, name)[keep] for name in ("t", "q", "v", "torque")})


def lost(x: Log, count: float) -> Log:
    """Samples lost in three places, under a declared rate."""
    gone = np.concatenate([np.arange(k, k + int(count)) for k in (700, 1900, 3100)])
    return replace(rows(x, np.delete(np.arange(x.t.size), gone)), rate=RATE)


def jumped(x: Log, size: float) -> Array:
    """An encoder that slips three times."""
    return x.q + size * np.searchsorted([1300, 2900, 4700], np.arange(x.q.size))


def low_passed(x: Array, cutoff: float) -> Array:
    """Through one pole, Hz."""
    a = np.exp(-2 * np.pi * cutoff / RATE)
    filtered: Array = lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]
    return filtered


def jittered(x: Log, share: float) -> Log:
    """Sampled at irregular instants that the time stamps do not tell."""
    rng = np.random.default_rng(7)
    at = x.t + share / RATE * rng.uniform(-0.5, 0.5, x.t.size)
    return replace(x, q=counted(np.interp(at, x.t, x.q), 20), torque=np.interp(at, x.t, x.torque))


def stick_slip(x: Log, share: float) -> Log:
    """Slow holds that stop and go four times a second."""
    square = np.where(np.abs(x.v) < 1.5 * x.truth.v_s, np.sign(np.sin(2 * np.pi * 4 * x.t)), 0.0)
    return again(x, x.v * (1 + share * square), x.torque * (1 - 0.3 * share * square))


def ordered(seed: int) -> Log:
    """Holds, slow ones first."""
    log = ramps(seed)
    keys = [np.abs(log.v[log.holds == k][0]) for k in range(int(log.holds.max()) + 1)]
    index = np.concatenate([np.flatnonzero(log.holds == k) for k in np.argsort(keys)])
    return replace(again(log, log.v[index], log.torque[index]), holds=log.holds[index])


def accelerating(x: Log, share: float) -> Log:
    """Holds within which the speed grows by a share, the torque with it."""
    inside = np.arange(x.v.size) % round(2 * RATE) / (2 * RATE)
    v = x.v * (1 + share * (inside - 0.5))
    return again(x, v, x.torque + steady(v, x.truth) - steady(x.v, x.truth))


def frozen(x: Log, count: float) -> Array:
    """A position that stays for so many samples once a second."""
    k = np.arange(x.q.size)
    return x.q[np.maximum.accumulate(np.where(k % 500 < count, 0, k))]


def wrapped(x: Array, limit: float) -> Array:
    """As an integer that overflows reads it."""
    return (x + limit) % (2 * limit) - limit


def by_direction(x: Log, share: float) -> Log:
    """More friction in one direction than in the other."""
    return replace(x, torque=x.torque * np.where(x.v > 0, 1 + share, 1.0), raised=share)


def by_load(x: Log, share: float) -> Log:
    """Gravity, and friction that grows with it."""
    gravity = np.sin(x.q)
    whole = x.torque + gravity + share * np.abs(gravity) * np.sign(x.v)
    return replace(x, torque=whole)


def noisier(x: Log, times: float) -> Log:
    """Holds with more noise, of so many times 2e-3 N*m."""
    rng = np.random.default_rng(3)
    return replace(x, torque=x.torque + 2e-3 * times * rng.standard_normal(int(x.holds.max()) + 1)[x.holds])


def dead(x: Array, width: float) -> Array:
    """Through a dead zone of so much on either side of zero."""
    return np.sign(x) * np.maximum(np.abs(x) - width, 0)


def off_at(x: Log, which: tuple[int, int], share: float) -> Array:
    """The torque of two holds or points off by a share."""
    k = x.holds if x.holds.size else np.arange(x.v.size)
    return x.torque * np.where(np.isin(k, which), 1 + share, 1.0)


def resting(x: Log, more: float) -> Array:
    """Points below 0.12 v_s, or more, that do not slide."""
    return x.torque * np.where(np.abs(x.v) < (0.12 + more) * x.truth.v_s, 0.5, 1.0)


def largest(x: Log) -> float:
    """The largest torque."""
    return float(np.abs(x.torque).max())


def few_speeds(seed: int) -> Log:
    """Holds at four speeds in each direction."""
    return ramps(seed, np.geomspace(0.3, 5, 4))


def short_holds(seed: int) -> Log:
    """Holds of a second."""
    return ramps(seed, seconds=1.0)


class Fault(NamedTuple):
    """A fault, and what names it."""

    make: Callable[[int], Log]
    change: Change
    strengths: tuple[float, float]
    named_by: tuple[str, ...] = ()
    """Codes whose sentence names the fault, or the pattern that it leaves, and words of a refusal that does."""


DRIFT = ("drift-in-order", "friction-drifts", "residual-trend")
TERM = ("lacks-a-term", "lacks-unknown-term", "residual-trend")
DELAY = ("torque-delayed",)
LATE = ("reversals-left", "inertia-below-zero")
WARMS = ("torque-drifts-in-runs", "friction-drifts", "residual-trend")
RIPPLE = ("residual-ripple", "lacks-a-term")
SPEED = ("velocity-factor", "velocity-unrelated")
COARSE = ("whole-positions", "count-bias")
PEAK = ("no-stribeck", "takes-up-peak", "interval-open")
STRAYS = ("strays",)
SIDES = ("offset-or-friction", "directions-differ", "lacks-a-term")
LOADED = ("open-cycles", "above-g0", "softens")
OPPOSES = ("torque opposes the velocity",)
STICKS = ("stick-slip", "stick-slip-points")

FAULTS: dict[str, Fault] = {
    "torque late by 2, 8 ms": Fault(motion, torque(lambda x, s: np.interp(x.t - s, x.t, x.torque)), (2e-3, 8e-3), DELAY),
    "torque through a slow filter": Fault(motion, torque(lambda x, s: low_passed(x.torque, s)), (20.0, 3.0), (*DELAY, *LATE)),
    "torque of the wrong sign": Fault(motion, torque(lambda x, s: -s * x.torque), (1.0, 2.0), OPPOSES),
    "torque clipped": Fault(motion, torque(lambda x, s: np.clip(x.torque, -s * rms(x.torque), s * rms(x.torque))), (1.4, 1.0), ("clipped",)),
    "torque overflows its integer": Fault(motion, torque(lambda x, s: wrapped(x.torque, s * largest(x))), (0.9, 0.6)),
    "torque of few bits": Fault(motion, torque(lambda x, s: np.round(x.torque / s) * s), (0.1, 0.4), ("torque-coarse",)),
    "dead zone of the torque sensor": Fault(motion, torque(lambda x, s: dead(x.torque, s)), (0.05, 0.2), ("dead-zone", "torque-missing")),
    "torque offset": Fault(motion, torque(lambda x, s: x.torque + s), (0.05, 0.2), SIDES),
    "spikes in the torque": Fault(motion, torque(lambda x, s: x.torque + s * (np.arange(x.t.size) % 997 == 5)), (2.0, 10.0), ("bursts",)),
    "noise for torque": Fault(motion, torque(lambda x, s: s * np.random.default_rng(1).standard_normal(x.t.size)), (0.1, 1.0), ("nothing to do",)),
    "hum of 50 Hz": Fault(motion, torque(lambda x, s: x.torque + s * np.sin(2 * np.pi * 50 * x.t)), (0.1, 0.4)),
    "temperature drift": Fault(motion, torque(lambda x, s: x.torque * (1 + s * (0.5 - x.t / x.t[-1]))), (0.1, 0.4), WARMS),
    "quadratic drag": Fault(motion, drag, (0.1, 0.4), TERM),
    "gravity": Fault(motion, torque(lambda x, s: x.torque + s * np.sin(x.q)), (0.1, 1.0), (*TERM, "residual-ripple")),
    "cogging": Fault(motion, torque(lambda x, s: x.torque + s * np.sin(20 * x.q)), (0.03, 0.1), RIPPLE),
    "friction by direction": Fault(motion, by_direction, (0.1, 0.4), SIDES),
    "friction by load": Fault(motion, by_load, (0.1, 0.3), (*TERM, "friction-by-load")),
    "backlash": Fault(motion, position(lambda x, s: x.q + s / 2 * np.tanh(x.v / 0.01)), (0.005, 0.02), ("backlash", "reversals-left")),
    "position of 8, 10 bits": Fault(motion, position(lambda x, s: counted(x.q, s)), (10, 8), COARSE),
    "counts as rad": Fault(motion, position(lambda x, s: np.round(x.q * 2**s / (2 * np.pi))), (14, 18), (*COARSE, "encoder counts")),
    "degrees as rad, velocity logged": Fault(motion, lambda x, s: replace(x, q=s * x.q, velocity_logged=True), (180 / np.pi, 1000.0), SPEED),
    "position freezes": Fault(motion, position(frozen), (10, 40), ("position-jumps",)),
    "encoder slips": Fault(motion, position(jumped), (0.01, 0.1), ("position-jumps",)),
    "samples lost": Fault(motion, lost, (5, 40), ("position-jumps",)),
    "time stamps jitter": Fault(motion, jittered, (0.5, 2.0), ("stamps-jitter",)),
    "logged too seldom": Fault(motion, lambda x, s: rows(x, np.arange(0, x.t.size, int(s))), (10, 25), ("unseen-fast",)),
    "velocity by a factor": Fault(motion, speed(lambda x, s: s * x.v), (1.2, 0.5), SPEED),
    "velocity of the wrong sign": Fault(motion, speed(lambda x, s: -s * x.v), (1.0, 2.0), (*SPEED, "as far as its logged velocity")),
    "velocity through a slow filter": Fault(motion, speed(lambda x, s: low_passed(x.v, s)), (20.0, 3.0), (*DELAY, *SPEED, *LATE)),
    "inertia given wrong": Fault(motion, lambda x, s: replace(x, more=f"inertia: {s * J} kg*m**2\n"), (0.7, 1.3), ("inertia-doubted",)),
    "ramps: temperature drift in order": Fault(ordered, torque(lambda x, s: x.torque * (1 + s * (x.t / x.t[-1] - 0.5))), (0.1, 0.3), DRIFT),
    "ramps: temperature drift": Fault(ramps, torque(lambda x, s: x.torque * (1 + s * (x.t / x.t[-1] - 0.5))), (0.1, 0.3), DRIFT),
    "ramps: too few speeds": Fault(few_speeds, lambda x, s: x if s > 3 else rows(x, np.flatnonzero(x.holds < 6)), (4, 3), (*PEAK, "too-uncertain")),
    "ramps: none below v_s": Fault(lambda k: ramps(k, np.geomspace(1.5, 15, 12)), noisier, (0, 1), PEAK),
    "ramps: none above v_s": Fault(lambda k: ramps(k, np.geomspace(0.1, 0.9, 12)), noisier, (0, 1), PEAK),
    "ramps: torque offset": Fault(ramps, torque(lambda x, s: x.torque + s), (0.05, 0.15), SIDES),
    "ramps: two stray holds": Fault(ramps, torque(lambda x, s: off_at(x, (3, 11), s)), (0.2, 0.5), STRAYS),
    "ramps: torque clipped": Fault(ramps, torque(lambda x, s: np.clip(x.torque, -s * largest(x), s * largest(x))), (0.8, 0.6), ("clipped",)),
    "ramps: quadratic drag": Fault(ramps, drag, (0.05, 0.2), TERM),
    "ramps: cogging": Fault(short_holds, torque(lambda x, s: x.torque + s * np.sin(8 * x.q)), (0.03, 0.1), (*RIPPLE, "torques-doubted")),
    "ramps: stick-slip": Fault(ramps, stick_slip, (0.7, 1.2), STICKS),
    "ramps: holds that accelerate": Fault(ramps, accelerating, (0.2, 0.6), (*TERM, "No segment at constant velocity")),
    "ramps: degrees as rad, velocity logged": Fault(ramps, lambda x, s: replace(x, q=s * x.q, velocity_logged=True), (180 / np.pi, 1000.0), SPEED),
    "points: strays": Fault(points, torque(lambda x, s: off_at(x, (2, 30), s)), (0.2, 0.5), STRAYS),
    "points: sign of one direction": Fault(points, torque(lambda x, s: np.abs(x.torque) * s), (1.0, 2.0), (*OPPOSES, "is a magnitude")),
    "points: torque clipped": Fault(points, torque(lambda x, s: np.clip(x.torque, -s * largest(x), s * largest(x))), (0.8, 0.6), ("clipped",)),
    "points: torque offset": Fault(points, torque(lambda x, s: x.torque + s), (0.05, 0.15), SIDES),
    "points: quadratic drag": Fault(points, drag, (0.05, 0.2), TERM),
    "points: some that do not slide": Fault(points, torque(resting), (0.0, 0.1), STRAYS),
    "slow loading: load cell offset": Fault(slow, torque(lambda x, s: x.torque + s), (0.05, 0.2), LOADED),
    "slow loading: position drifts": Fault(slow, position(lambda x, s: x.q + s * x.t), (3e-5, 1e-4), ("open-cycles",)),
    "slow loading: torque clipped": Fault(slow, torque(lambda x, s: np.clip(x.torque, -s * largest(x), s * largest(x))), (0.8, 0.5), ("clipped",)),
    "slow loading: torque late": Fault(slow, torque(lambda x, s: np.interp(x.t - s, x.t, x.torque)), (0.1, 0.5), ("open-cycles",)),
    "slow loading: position of 12, 14 bits": Fault(slow, position(lambda x, s: counted(x.q, s)), (14, 12), ("few-counts", "within-noise")),
    "slow loading: backlash": Fault(slow, position(lambda x, s: x.q + s / 2 * np.tanh(x.torque / 0.02)), (0.0003, 0.002), ("open-cycles",)),
    "slow loading: wrong sign": Fault(slow, torque(lambda x, s: -s * x.torque), (1.0, 2.0), OPPOSES),
}  # fmt: skip  # a table
UNSEEN: dict[str, Fault] = {
    "torque constant": Fault(motion, torque(lambda x, s: s * x.torque), (0.9, 1.1)),
    "sampling rate declared": Fault(motion, lambda x, s: replace(x, rate=s * RATE), (0.9, 1.1)),
    "gear ratio": Fault(motion, lambda x, s: replace(x, q=s * x.q, torque=x.torque / s), (0.9, 1.1)),
    "points: rpm, mrad/s as rad/s": Fault(points, lambda x, s: replace(x, v=s * x.v), (30 / np.pi, 1000.0)),
    "slow loading: compliance in series": Fault(slow, position(lambda x, s: x.q + x.torque / s), (2000.0, 200.0)),
}  # fmt: skip  # a table
"""Faults that these data look the same without: a consistent unit, gear or rate, a spring that the bristle hides."""
CLEAN = {"motion": motion, "no Stribeck effect": without_peak, "ramps": ramps, "points": points, "slow loading": slow}
