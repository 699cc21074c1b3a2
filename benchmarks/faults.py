"""What bristle says of logs with a physical fault: is it right, does it warn, or is it confident and wrong?

Each fault is put into simulated logs of a joint (LuGre, another set for each seed), at two strengths. Every estimate with
a value is held against the truth: wrong is what lies more than three of its stated errors off (the standard error, or a
quarter of its 95 % interval where that is more). A warning counts if it is critical or a caution and is about the joint
as a whole, the fit that the estimate is of, or the estimate. A refusal counts as a warning.

    python benchmarks/faults.py [--seeds 5] [--controls 40] [--only NAME]
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import bristle
from bristle.arrays import Array
from bristle.diagnostics import Diagnostic, Severity
from bristle.errors import InputError
from bristle.identification.fits import Estimate
from bristle.identification.results import Joint
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre, ParameterName
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate

RATE = 500.0
TRUTH = Lugre(0.5, 0.2, 0.25, 0.08, 250.0, 0.6)
J = 0.02
SERIOUS = {Severity.CRITICAL, Severity.CAUTION}


@dataclass
class Log:
    """Signals of one log, SI, (n,), and what its experiment file says."""

    t: Array
    q: Array
    v: Array
    torque: Array
    kind: str
    truth: Lugre[float]
    holds: Array = field(default_factory=lambda: np.zeros(0))
    """Of constant-velocity runs: which hold each sample is of, (n,)."""
    velocity_logged: bool = False
    unit: str = "rad"
    fit: str = ""
    rate: float | None = None
    """Declared instead of a time column, Hz."""
    more: str = ""
    """Further lines."""


def motion(seed: int) -> Log:
    """Thirty seconds of six tones, sampled at 500 Hz from a simulation at 4 kHz; an encoder of 18 bits; 0.5 % of noise in the torque."""
    rng = np.random.default_rng(seed)
    p = Lugre(*(x * np.exp(0.3 * rng.standard_normal()) for x in TRUTH))
    h, n = 1 / 4000, 120_000
    t = h * np.arange(n)
    v = np.zeros(n)
    for f, a in ((0.11, 0.7), (0.23, 0.5), (0.53, 0.35), (1.3, 0.2), (2.9, 0.1), (6.1, 0.04)):
        v += a * np.sin(2 * np.pi * f * t + rng.uniform(0, 2 * np.pi))
    torque = rollout(v, h, p).torque + J * np.gradient(v, h)
    q = np.cumsum(v) * h
    part = slice(None, None, round(1 / h / RATE))
    torque = torque[part] + 5e-3 * rng.standard_normal(n)[part] * np.sqrt(np.mean(torque**2))
    return Log(t[part], counted(q[part], 18), v[part], torque, "tracking", p)


def ramps(seed: int, speeds: Array | None = None, seconds: float = 2.0) -> Log:
    """Holds at 14 speeds in each direction, in random order, with 2 % of noise in each sample of the torque."""
    rng = np.random.default_rng(seed)
    p = Lugre(*(x * np.exp(0.3 * rng.standard_normal()) for x in TRUTH))
    speeds = np.geomspace(0.2 * p.v_s, 1.5, 14) if speeds is None else speeds * p.v_s
    each = rng.permutation(np.concatenate([speeds, -speeds]))
    holds = np.repeat(np.arange(each.size), round(seconds * RATE))
    v = each[holds]
    torque = evaluate(steady_torque_function(), v, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)[0]
    torque = torque * (1 + 0.02 * rng.standard_normal(v.size)) + 2e-3 * rng.standard_normal(each.size)[holds]
    t = np.arange(v.size) / RATE
    return Log(t, counted(np.cumsum(v) / RATE, 18), v, torque, "ramp", p, holds=holds)


def counted(q: Array, bits: int) -> Array:
    """As an encoder of so many bits to a turn reads it, (n,)."""
    count = 2 * np.pi / 2**bits
    counts: Array = np.floor(q / count) * count
    return counts


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def late(log: Log, seconds: float) -> Log:
    """Torque logged later."""
    return replace(log, torque=np.interp(log.t - seconds, log.t, log.torque))


def lost(log: Log, count: int) -> Log:
    """Samples lost in three places, under a declared rate."""
    gone = np.concatenate([np.arange(k, k + count) for k in (3000, 7000, 11000)])
    kept = {name: np.delete(getattr(log, name), gone) for name in ("t", "q", "v", "torque")}
    return replace(log, **kept, rate=RATE)  # type: ignore[arg-type]  # arrays by name


def low_passed(x: Array, cutoff: float) -> Array:
    """Through one pole."""
    from scipy.signal import lfilter

    a = np.exp(-2 * np.pi * cutoff / RATE)
    filtered: Array = lfilter([1 - a], [1, -a], x)
    return filtered


def stick_slip(log: Log, share: float) -> Log:
    """Slow holds that stop and go four times a second."""
    slow = np.abs(log.v) < 1.5 * log.truth.v_s
    v = np.where(slow, log.v * (1 + share * np.sign(np.sin(2 * np.pi * 4 * log.t))), log.v)
    torque = np.where(slow, log.torque * (1 - 0.3 * share * np.sign(np.sin(2 * np.pi * 4 * log.t))), log.torque)
    return replace(log, q=counted(np.cumsum(v) / RATE, 18), v=v, torque=torque)


Fault = tuple[Callable[[int], Log], Callable[[Log, float], Log], tuple[float, float]]
SHOWN_BY_NO_DATA = {"torque constant", "sampling rate", "gear"}
FAULTS: dict[str, Fault] = {
    "torque late": (motion, late, (2e-3, 8e-3)),
    "wrong sign": (motion, lambda x, s: replace(x, torque=-x.torque), (1, 1)),
    "degrees as rad": (motion, lambda x, s: replace(x, q=np.rad2deg(x.q), velocity_logged=True), (1, 1)),
    "velocity by a factor": (motion, lambda x, s: replace(x, v=s * x.v, velocity_logged=True), (0.5, 1.2)),
    "velocity of the wrong sign": (motion, lambda x, s: replace(x, v=-x.v, velocity_logged=True), (1, 1)),
    "counts as rad": (motion, lambda x, s: replace(x, q=np.round(x.q * 2**s / (2 * np.pi))), (14, 18)),
    "coarse position": (motion, lambda x, s: replace(x, q=counted(x.q, int(s))), (8, 10)),
    "lost samples": (motion, lambda x, s: lost(x, int(s)), (5, 40)),
    "clipped torque": (motion, lambda x, s: replace(x, torque=np.clip(x.torque, -s * rms(x.torque), s * rms(x.torque))), (1.0, 1.4)),
    "quadratic drag": (motion, lambda x, s: replace(x, torque=x.torque + s * x.v * np.abs(x.v)), (0.1, 0.4)),
    "gravity": (motion, lambda x, s: replace(x, torque=x.torque + s * np.sin(x.q)), (0.1, 1.0)),
    "torque offset": (motion, lambda x, s: replace(x, torque=x.torque + s), (0.05, 0.2)),
    "hum": (motion, lambda x, s: replace(x, torque=x.torque + s * np.sin(2 * np.pi * 50 * x.t)), (0.1, 0.4)),
    "cogging": (motion, lambda x, s: replace(x, torque=x.torque + s * np.sin(20 * x.q)), (0.03, 0.1)),
    "warming up": (motion, lambda x, s: replace(x, torque=x.torque * (1 + s * np.exp(-x.t / 10))), (0.1, 0.4)),
    "backlash": (motion, lambda x, s: replace(x, q=x.q + s / 2 * np.tanh(x.v / 0.01)), (0.005, 0.02)),
    "filtered torque": (motion, lambda x, s: replace(x, torque=low_passed(x.torque, s)), (3.0, 20.0)),
    "friction by direction": (motion, lambda x, s: replace(x, torque=x.torque * np.where(x.v > 0, 1 + s, 1.0), fit="directions: symmetric"), (0.1, 0.4)),
    "friction by load": (motion, lambda x, s: replace(x, torque=x.torque + np.sin(x.q) + s * np.abs(np.sin(x.q)) * np.sign(x.v), fit="regressors: [inertia, gravity]"), (0.1, 0.3)),
    "frozen position": (motion, lambda x, s: replace(x, q=x.q[np.maximum.accumulate(np.where(np.arange(x.q.size) % 500 < s, 0, np.arange(x.q.size)))]), (10, 40)),
    "spikes": (motion, lambda x, s: replace(x, torque=x.torque + s * (np.arange(x.t.size) % 997 == 5)), (2.0, 10.0)),
    "noise for torque": (motion, lambda x, s: replace(x, torque=s * np.random.default_rng(1).standard_normal(x.t.size)), (0.1, 1.0)),
    "log too seldom": (motion, lambda x, s: replace(x, t=x.t[:: int(s)], q=x.q[:: int(s)], v=x.v[:: int(s)], torque=x.torque[:: int(s)]), (10, 25)),
    "wrong inertia given": (motion, lambda x, s: replace(x, more=f"inertia: {s * J} kg*m**2\n"), (0.7, 1.3)),
    "drift in the order of speed": (lambda seed: ordered(ramps(seed)), lambda x, s: replace(x, torque=x.torque * (1 + s * x.t / x.t[-1])), (0.1, 0.3)),
    "few speeds": (lambda seed: ramps(seed, np.geomspace(0.3, 5, 4)), lambda x, s: x, (1, 1)),
    "all above v_s": (lambda seed: ramps(seed, np.geomspace(1.5, 15, 12)), lambda x, s: x, (1, 1)),
    "all below v_s": (lambda seed: ramps(seed, np.geomspace(0.1, 0.9, 12)), lambda x, s: x, (1, 1)),
    "offset of ramps": (ramps, lambda x, s: replace(x, torque=x.torque + s), (0.05, 0.15)),
    "stray holds": (ramps, lambda x, s: replace(x, torque=x.torque * np.where(np.isin(x.holds, [3, 11]), 1 + s, 1.0)), (0.2, 0.5)),
    "clipped holds": (ramps, lambda x, s: replace(x, torque=np.clip(x.torque, -s * np.abs(x.torque).max(), s * np.abs(x.torque).max())), (0.6, 0.8)),
    "quadratic ramps": (ramps, lambda x, s: replace(x, torque=x.torque + s * x.v * np.abs(x.v)), (0.05, 0.2)),
    "cogging, short holds": (lambda seed: ramps(seed, seconds=1.0), lambda x, s: replace(x, torque=x.torque + s * np.sin(8 * x.q)), (0.03, 0.1)),
    "stick-slip": (ramps, stick_slip, (0.7, 1.2)),
    "ramps in degrees": (ramps, lambda x, s: replace(x, q=np.rad2deg(x.q), velocity_logged=True), (1, 1)),
    "torque constant": (motion, lambda x, s: replace(x, torque=s * x.torque), (0.9, 1.1)),
    "sampling rate": (motion, lambda x, s: replace(x, rate=s * RATE), (0.9, 1.1)),
    "gear": (motion, lambda x, s: replace(x, q=s * x.q, torque=x.torque / s), (0.9, 1.1)),
}  # fmt: skip  # a table


def ordered(log: Log) -> Log:
    """The same holds, slow ones first."""
    keys = [np.abs(log.v[log.holds == k][0]) for k in range(int(log.holds.max()) + 1)]
    index = np.concatenate([np.flatnonzero(log.holds == k) for k in np.argsort(keys)])
    v = log.v[index]
    return replace(log, v=v, torque=log.torque[index], holds=log.holds[index], q=counted(np.cumsum(v) / RATE, 18))


def identified(log: Log, folder: Path) -> Joint | str:
    """What bristle makes of a log by default, or the sentence by which it refuses it."""
    columns = {"t": log.t, "q": log.q, **({"v": log.v} if log.velocity_logged else {}), "tau": log.torque}
    np.savetxt(folder / "log.csv", np.stack(list(columns.values()), axis=1), "%.9g", ",", header=",".join(columns), comments="")
    time = "{column: t, unit: s}" if log.rate is None else f"{{rate: {log.rate} Hz}}"
    velocity = "  velocity: {column: v, unit: rad/s}\n" if log.velocity_logged else ""
    (folder / "e.yaml").write_text(
        f"joint: {{name: a}}\nsignals:\n  time: {time}\n  position: {{column: q, unit: rad}}\n{velocity}"
        f"  torque: {{column: tau, unit: N*m}}\nruns:\n  - {{files: log.csv, experiment: {log.kind}}}\nfit: {{{log.fit}}}\n{log.more}"
    )
    try:
        return bristle.identify(folder / "e.yaml").joints[0]
    except InputError as refusal:
        return str(refusal)


def estimates(joint: Joint) -> Iterator[tuple[str, ParameterName, Estimate, tuple[Diagnostic, ...]]]:
    """Every estimate with a value: the fit it is of, its name, and the warnings about that fit."""
    if joint.moving is not None:
        for name, e in joint.moving.parameters.items():
            if e.value is not None:
                yield "moving", name, e, joint.moving.warnings
        return
    for d, fit in joint.static.items():
        for bare, e in fit.parameters.items():
            if e.value is not None:
                yield "static", ParameterName.parse(f"{bare}{d}" if d in {"+", "-"} else bare), e, fit.warnings


def judged(joint: Joint, truth: Lugre[float]) -> tuple[list[str], list[str]]:
    """Which estimates are wrong and warned of, and which are wrong with nothing said."""
    true = {**truth._asdict(), "inertia": J}
    whole = [w for w in joint.warnings if w.severity in SERIOUS]
    warned, silent = [], []
    for _, name, e, of_fit in estimates(joint):
        if name.name not in true or e.value is None:
            continue
        error = e.standard_error or 0.0
        if e.interval is not None and np.isfinite(e.interval).all():
            error = max(error, (e.interval[1] - e.interval[0]) / 4)
        if abs(e.value - true[name.name]) > 3 * error + 1e-3 * true[name.name]:
            said = [*whole, *(w for w in (*of_fit, *e.warnings) if w.severity in SERIOUS)]
            (warned if said else silent).append(f"{name} {e.value:.3g} +/- {error:.2g} (true {true[name.name]:.3g})")
    return warned, silent


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--controls", type=int, default=40)
    parser.add_argument("--only", default="")
    asked = parser.parse_args()
    print(f"seeds 0 to {asked.seeds - 1}, two strengths; of each case: right, warned or refused, confident and wrong")
    total: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for fault, (make, change, strengths) in FAULTS.items():
            if asked.only in fault:
                total += shown(fault, [change(make(seed), s) for s in dict.fromkeys(strengths) for seed in range(asked.seeds)], folder)
        controls: list[Any] = [make(1000 + k) for k in range(asked.controls // 2) for make in (motion, ramps)]
        if not asked.only:
            clean(controls, folder)
    print(f"all faults but those that no data show: {dict(total)}")


def shown(fault: str, logs: list[Log], folder: Path) -> Counter[str]:
    """Print one fault's row; its counts, unless no data could show it."""
    count: Counter[str] = Counter()
    examples: list[str] = []
    for log in logs:
        joint = identified(log, folder)
        if isinstance(joint, str):
            count["warned"] += 1
            continue
        warned, silent = judged(joint, log.truth)
        count["silent" if silent else "warned" if warned else "right"] += 1
        examples += silent[:2]
    no_data = fault in SHOWN_BY_NO_DATA
    print(f"{fault:<30} {count['right']:>3} {count['warned']:>3} {count['silent']:>3}  {'(no data show it) ' if no_data else ''}{'; '.join(examples[:3])}", flush=True)
    return Counter() if no_data else count


def clean(logs: list[Log], folder: Path) -> None:
    """Print how often clean logs are warned of, or misjudged."""
    critical, cautions, silent = 0, Counter[str](), 0
    for log in logs:
        joint = identified(log, folder)
        assert isinstance(joint, Joint), joint
        every = [w for w in joint.all_warnings() if w.severity in SERIOUS]
        critical += any(w.severity is Severity.CRITICAL for w in every)
        cautions.update(w.kind.name for w in set(every))
        silent += bool(judged(joint, log.truth)[1])
    print(f"{len(logs)} clean logs: {critical} with a critical warning, {silent} with a silent miss; cautions {dict(cautions)}")


if __name__ == "__main__":
    main()
