"""Simulated logs for `calibration.py`: 18 joints, four experiments, half of them with one physical fault that data can show.

Log k has a seed of its own. Its joint is one of the four of the paper's Table 1, whose directions differ, or one of ten
drawn at random with one friction for both. Its experiment is in turn a motion, holds at constant velocity (`ramps`), a
table of velocity-torque points, or slow loading beside ramps. 20 Hz to 5 kHz, an encoder of 12 to 20 bits, white torque
noise of 0.2 to 10 % of alpha_0 per sample. Sizes of faults are relative to the joint's alpha_0 and to its motion.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1
from motions import frequencies_of, log_uniform, velocity_of

FINE = 2e4
"""Hz, the least rate of the rollout."""
EXPERIMENTS = ("motion", "ramps", "points", "slow")
MOTIONS = ("sines", "multisine", "ramps", "chirp")
OTHERS = 10
Rng = np.random.Generator


class Joint(NamedTuple):
    """A joint that is moved at up to a speed, rad/s."""

    name: str
    pair: Pair[float]
    top: float

    @property
    def level(self) -> float:
        """Mean alpha_0 of both directions."""
        return (self.pair.positive.alpha_0 + self.pair.negative.alpha_0) / 2


@dataclass
class Log:
    """Signals of one log, SI, (n,), of a joint, and what was changed in it."""

    joint: Joint
    experiment: str
    t: Array
    q: Array
    v: Array
    torque: Array
    inertia: float = 0.0
    rate: float = 0.0
    """Hz; the next two as drawn."""
    bits: int = 0
    noise: float = 0.0
    fastest: float = 0.0
    """Hz: of what the motion is made of."""
    holds: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    """Which hold each sample is of, (n,)."""
    speeds: Array = field(default_factory=lambda: np.zeros(0))
    """Over which the curve is judged, of both directions."""
    drag: float = 0.0
    """Torque that was added as v * abs(v)."""
    more: float = 0.0
    """Share of the friction that was added in direction +."""
    beside: "Log | None" = None
    """Ramps of the same joint."""

    @property
    def curve(self) -> Array:
        """True friction at `speeds`, drag included."""
        v = self.speeds
        return steady(v, self.joint) * np.where(v > 0, 1 + self.more, 1.0) + self.drag * v * np.abs(v)


def steady(v: Array, joint: Joint) -> Array:
    """Friction at constant velocities, (n,)."""
    plus, minus = (evaluate(steady_torque_function(), v, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)[0] for p in joint.pair)
    return np.where(v > 0, plus, minus)


def joints() -> list[Joint]:
    """Those of Table 1, and ten drawn with seeds of their own."""
    known = [Joint(name, pair, 0.8) for name, pair in TABLE_1.items()]
    return known + [_other(k) for k in range(OTHERS)]


def _other(k: int) -> Joint:
    rng = np.random.default_rng([43, k])
    alpha_0 = log_uniform(rng, 0.01, 10)
    alpha_1, v_s = rng.uniform(0, 0.5) * alpha_0, log_uniform(rng, 0.01, 0.2)
    top, sigma_0 = log_uniform(rng, 5, 50) * v_s, alpha_0 / log_uniform(rng, 1e-4, 1e-2)
    alpha_2 = log_uniform(rng, 0.1, 1) * alpha_0 / top
    sigma_1 = min(0.9 * alpha_0 * alpha_2 / alpha_1, 0.02 * sigma_0 * v_s)
    p = Lugre(*map(float, (alpha_0, alpha_1, alpha_2, v_s, sigma_0, sigma_1)))
    return Joint(f"other {k}", Pair(p, p), float(top))


def drawn(seed: int, k: int) -> "Log":
    """Log k without a fault."""
    every = joints()
    rng = np.random.default_rng([seed, k])
    joint, experiment = every[k % len(every)], EXPERIMENTS[(k // len(every)) % len(EXPERIMENTS)]
    return {"motion": motion, "ramps": ramps, "points": points, "slow": slow}[experiment](joint, rng)


def _moved(joint: Joint, v: Array, a: Array, h: float, inertia: float, every: int) -> tuple[Array, Array]:
    """Position and torque of a motion on a fine grid, one sample in so many."""
    q = np.append(0, np.cumsum(h / 2 * (v[1:] + v[:-1]) + h**2 / 12 * (a[:-1] - a[1:])))
    return q[::every], (rollout(v, h, joint.pair).torque + inertia * a)[::every]


def _logged(log: Log, rng: Rng) -> Log:
    """With counts and noise."""
    count = 2 * np.pi / 2**log.bits
    q = count * np.round(log.q / count + rng.uniform(0, 2**log.bits))
    return replace(log, q=q, torque=log.torque + log.noise * log.joint.level * rng.standard_normal(log.torque.size))


def motion(joint: Joint, rng: Rng) -> Log:
    """Sines, multisines, ramps with reversals, or a chirp, 10 to 30 s."""
    while True:
        kind = MOTIONS[int(rng.integers(len(MOTIONS)))]
        f = np.asarray(frequencies_of(kind, rng), dtype=np.float64)
        rate = float(log_uniform(rng, max(20.0, 20 * f.max()), 5e3))
        seconds = min(max(rng.uniform(10, 30), 3 / f.min()), 60_000 / rate)
        bits, noise = int(rng.integers(12, 21)), float(log_uniform(rng, 0.002, 0.1))
        samples, parts = int(seconds * rate), int(np.ceil(FINE / rate))
        h = 1 / (rate * parts)
        v, a = velocity_of(kind, f, h * np.arange((samples - 1) * parts + 1, dtype=np.float64), rng)
        v, a = np.stack([v, a]) * (joint.top / np.abs(v).max())
        inertia = float(log_uniform(rng, 0.1, 3) * joint.level / np.abs(a).max())
        q, torque = _moved(joint, v, a, h, inertia, parts)
        travel, bend = np.ptp(q), max(p.alpha_0 / p.sigma_0 for p in joint.pair)
        if travel >= 200 * 2 * np.pi / 2**bits and bend <= 0.05 * travel:
            break
    t, v = np.arange(samples, dtype=np.float64) / rate, np.asarray(v[::parts])
    speeds = np.linspace(0.02, 1, 60) * joint.top
    log = Log(joint, "motion", t, q, v, torque, inertia, rate, bits, noise, float(f.max()))
    return _logged(replace(log, speeds=np.append(speeds, -speeds)), rng)


def ramps(joint: Joint, rng: Rng) -> Log:
    """Holds of 1 to 3 s at 7 to 14 speeds in each direction, in random order, 0.1 to 0.4 s from one to the next."""
    while True:
        rate, bits = float(log_uniform(rng, 20, 1e3)), int(rng.integers(12, 21))
        seconds, between = rng.uniform(1, 3), rng.uniform(0.1, 0.4)
        v_s = min(p.v_s for p in joint.pair)
        speeds = np.geomspace(rng.uniform(0.2, 0.5) * v_s, joint.top, int(rng.integers(7, 15)))
        if speeds[0] * seconds >= 30 * 2 * np.pi / 2**bits:
            break
    each = rng.permutation(np.append(speeds, -speeds))
    noise = float(log_uniform(rng, 0.002, 0.1))
    parts = int(np.ceil(5e3 / rate))
    h = float(1 / (rate * parts))
    knots = np.cumsum(np.ravel([[between, seconds]] * each.size))
    t = h * np.arange(int(knots[-1] * rate) * parts, dtype=np.float64)
    v = np.interp(t, np.append(0, knots), np.append(0, np.repeat(each, 2)))
    inertia = float(0.3 * joint.level / (2 * joint.top / between))
    q, torque = _moved(joint, v, np.gradient(v, h), h, inertia, parts)
    t, v = t[::parts], v[::parts]
    log = Log(joint, "ramps", t, q, v, torque, inertia, rate, bits, noise)
    log.holds = np.searchsorted(knots, t) // 2
    log.speeds = np.append(speeds, -speeds)
    return _logged(log, rng)


def points(joint: Joint, rng: Rng) -> Log:
    """A table of 8 to 20 speeds in each direction."""
    v_s, noise = min(p.v_s for p in joint.pair), float(log_uniform(rng, 0.002, 0.1))
    speeds: Array = np.geomspace(rng.uniform(0.1, 0.5) * v_s, joint.top, int(rng.integers(8, 21)))
    v = np.asarray(np.append(-speeds[::-1], speeds), dtype=np.float64)
    torque = steady(v, joint) + noise * joint.level * rng.standard_normal(v.size)
    return Log(joint, "points", np.arange(v.size, dtype=np.float64), v, v, torque, noise=noise, speeds=v)


def slow(joint: Joint, rng: Rng) -> Log:
    """Two slow cycles of torque to 0.85 of the weaker g0, of 8 to 24 s each, beside ramps.

    LuGre without inertia and viscous friction: dx = dT / (sigma_0 (1 - sgn(dx) T / g0)), from (4).
    """
    beside = ramps(joint, rng)
    bend = min((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in joint.pair)
    while True:
        rate, bits = float(log_uniform(rng, 50, 1e3)), int(rng.integers(12, 21))
        if bend >= 8 * 2 * np.pi / 2**bits or bits == 20:
            break
    seconds, noise = rng.uniform(8, 24), float(log_uniform(rng, 0.002, 0.03))
    t = np.arange(int(2 * seconds * rate)) / rate
    g0 = [p.alpha_0 + p.alpha_1 for p in joint.pair]
    load = 0.85 * min(g0) * np.interp((t / seconds) % 1, [0, 0.25, 0.5, 0.75, 1], [0, 1, 0, -1, 0])
    before = np.append(0.0, load[:-1])
    s = np.sign(load - before)
    stiff = np.where(load + before >= 0, joint.pair.positive.sigma_0, joint.pair.negative.sigma_0)
    level = np.where(s > 0, g0[0], g0[1])
    q = np.cumsum(s * level / stiff * (np.log1p(-s * before / level) - np.log1p(-s * load / level)))  # exact
    log = Log(joint, "slow", t, q, np.gradient(q, t), load, rate=rate, bits=bits, noise=noise, beside=beside)
    return replace(_logged(log, rng), speeds=beside.speeds)


Change = Callable[[Log, float, Rng], Log]


def _torque(change: Callable[[Log, float], Array]) -> Change:
    """A fault of the torque alone; its size is times alpha_0."""
    return lambda x, s, _: replace(x, torque=change(x, s * x.joint.level))


def _position(change: Callable[[Log, float, Rng], Array]) -> Change:
    return lambda x, s, rng: replace(x, q=change(x, s, rng))


def _drag(x: Log, s: float, _: Rng) -> Log:
    """Quadratic drag that is so many times alpha_0 at the greatest speed."""
    drag = s * x.joint.level / x.joint.top**2
    return replace(x, torque=x.torque + drag * x.v * np.abs(x.v), drag=drag)


def _directed(x: Log, s: float, _: Rng) -> Log:
    """More friction in direction +, and less in direction -: an offset makes no such difference at all speeds."""
    own = steady(x.v, x.joint)
    return replace(x, torque=x.torque + np.where(x.v > 0, s * own, 0.0), more=s)


def _drift(x: Log, s: float, _: Rng) -> Log:
    """Friction that falls by a share over the log, about its mean."""
    return replace(x, torque=x.torque * (1 + s * (0.5 - x.t / x.t[-1])))


def _by_load(x: Log, s: float, _: Rng) -> Log:
    """Gravity as large as alpha_0, of which a share adds to friction."""
    gravity = x.joint.level * np.sin(x.q)
    return replace(x, torque=x.torque + gravity + s * np.abs(gravity) * np.sign(x.v))


def _late(x: Log, s: float, _: Rng) -> Log:
    """By a share of the period of the fastest sine."""
    return replace(x, torque=np.interp(x.t - s / x.fastest, x.t, x.torque))


def _filtered(x: Log, s: float, _: Rng) -> Log:
    """Through one pole at so many times the fastest sine."""
    a = np.exp(-2 * np.pi * min(s * x.fastest, 0.4 * x.rate) / x.rate)
    return replace(x, torque=lfilter([1 - a], [1, -a], x.torque, zi=[a * x.torque[0]])[0])


def _clipped(x: Log, s: float, _: Rng) -> Log:
    """At a share of the largest torque."""
    largest = s * float(np.quantile(np.abs(x.torque), 0.995))
    return replace(x, torque=np.clip(x.torque, -largest, largest))


def _spikes(x: Log, s: float, rng: Rng) -> Log:
    """In one sample of 300."""
    hit = rng.uniform(size=x.t.size) < 1 / 300
    return replace(x, torque=x.torque + s * x.joint.level * hit * np.sign(rng.standard_normal(x.t.size)))


def _slips(x: Log, s: float, rng: Rng) -> Array:
    """Three times by a share of the travel."""
    at = np.sort(rng.integers(0, x.q.size, 3))
    return x.q + s * np.ptp(x.q) * np.searchsorted(at, np.arange(x.q.size))


def _strays(x: Log, s: float, rng: Rng) -> Log:
    """Two holds or points off by a share."""
    k = x.holds if x.holds.size else np.arange(x.v.size)
    return replace(
        x, torque=x.torque * np.where(np.isin(k, rng.choice(int(k.max()) + 1, 2, replace=False)), 1 + s, 1.0)
    )


def _resting(x: Log, s: float, _: Rng) -> Log:
    """The two slowest points of each direction do not slide."""
    slowest = np.sort(np.abs(x.v))[3]
    return replace(x, torque=x.torque * np.where(np.abs(x.v) <= slowest, s, 1.0))


class Fault(NamedTuple):
    """A fault, how strong it is drawn, and the codes that name it."""

    experiment: str
    change: Change
    least: float
    most: float
    codes: tuple[str, ...]


TERM = ("lacks-a-term", "lacks-unknown-term", "residual-trend", "unexplained")
SIDES = ("offset-or-friction", "directions-differ", "lacks-a-term")
DRIFT = ("friction-drifts", "drift-in-order", "torque-drifts-in-runs", "residual-trend")
OPEN = ("open-cycles",)
CLIPPED = ("clipped", "clipped-left-out")
PLAY = ("backlash", "reversals-left")
STRAYS = ("strays",)
FAULTS: dict[str, Fault] = {
    "torque late": Fault("motion", _late, 0.005, 0.03, ("torque-delayed",)),
    "torque through a slow filter": Fault("motion", _filtered, 3, 15, ("torque-delayed", "reversals-left")),
    "torque clipped": Fault("motion", _clipped, 0.5, 0.8, CLIPPED),
    "torque of few bits": Fault("motion", _torque(lambda x, s: np.round(x.torque / s) * s), 0.1, 0.4, ("torque-coarse",)),
    "dead zone": Fault("motion", _torque(lambda x, s: np.sign(x.torque) * np.maximum(np.abs(x.torque) - s, 0)), 0.1, 0.4, ("dead-zone",)),
    "spikes": Fault("motion", _spikes, 3, 20, ("bursts",)),
    "temperature drift": Fault("motion", _drift, 0.1, 0.4, DRIFT),
    "drag": Fault("motion", _drag, 0.2, 1, TERM),
    "gravity": Fault("motion", _torque(lambda x, s: x.torque + s * np.sin(x.q)), 0.3, 2, (*TERM, "residual-ripple")),
    "cogging": Fault("motion", _torque(lambda x, s: x.torque + s * np.sin(8 * x.q)), 0.06, 0.2, ("residual-ripple", "lacks-a-term")),
    "offset": Fault("motion", _torque(lambda x, s: x.torque + s), 0.1, 0.5, SIDES),
    "friction by direction": Fault("motion", _directed, 0.1, 0.4, SIDES),
    "friction by load": Fault("motion", _by_load, 0.1, 0.3, (*TERM, "friction-by-load", "other-law")),
    "backlash": Fault("motion", _position(lambda x, s, _: x.q + s * np.ptp(x.q) * np.tanh(50 * x.v / x.joint.top)), 0.002, 0.01, PLAY),
    "encoder slips": Fault("motion", _position(_slips), 0.005, 0.05, ("position-jumps", "bursts")),
    "ramps: temperature drift": Fault("ramps", _drift, 0.1, 0.4, DRIFT),
    "ramps: offset": Fault("ramps", _torque(lambda x, s: x.torque + s), 0.1, 0.5, SIDES),
    "ramps: strays": Fault("ramps", _strays, 0.2, 0.5, STRAYS),
    "ramps: torque clipped": Fault("ramps", _clipped, 0.6, 0.85, CLIPPED),
    "ramps: drag": Fault("ramps", _drag, 0.2, 1, TERM),
    "ramps: gravity": Fault("ramps", _torque(lambda x, s: x.torque + s * np.sin(x.q)), 0.3, 2, (*TERM, "residual-ripple", "torques-doubted")),
    "points: strays": Fault("points", _strays, 0.2, 0.5, STRAYS),
    "points: torque clipped": Fault("points", _clipped, 0.6, 0.85, CLIPPED),
    "points: offset": Fault("points", _torque(lambda x, s: x.torque + s), 0.1, 0.5, SIDES),
    "points: drag": Fault("points", _drag, 0.2, 1, TERM),
    "points: some that do not slide": Fault("points", _resting, 0.3, 0.7, STRAYS),
    "slow: load cell offset": Fault("slow", _torque(lambda x, s: x.torque + s), 0.05, 0.3, ("open-cycles", "above-g0", "softens")),
    "slow: position drifts": Fault("slow", _position(lambda x, s, _: x.q + s * np.ptp(x.q) * x.t / x.t[-1]), 0.1, 0.5, OPEN),
    "slow: torque clipped": Fault("slow", _clipped, 0.5, 0.8, ("clipped",)),
    "slow: backlash": Fault("slow", _position(lambda x, s, _: x.q + s * np.ptp(x.q) * np.tanh(20 * x.torque / x.joint.level)), 0.1, 0.5, OPEN),
}  # fmt: skip  # a table


def faulty(seed: int, k: int) -> tuple[Log, str]:
    """Log k, with a fault in half of them, and its name; empty where it has none."""
    log = drawn(seed, k)
    rng = np.random.default_rng([seed, k, 1])
    if rng.uniform() < 0.5:
        return log, ""
    same = log.joint.pair.positive == log.joint.pair.negative  # else an offset is a friction that differs more
    names = [x for x, fault in FAULTS.items() if fault.experiment == log.experiment and (same or "offset" not in x)]
    name = names[int(rng.integers(len(names)))]
    fault = FAULTS[name]
    return fault.change(log, float(log_uniform(rng, fault.least, fault.most)), rng), name
