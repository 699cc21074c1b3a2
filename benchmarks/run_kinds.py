"""How often `bristle new` names the right experiment of a log, on SIMULATED logs.

    python benchmarks/run_kinds.py [LOGS]

LOGS logs (10) of each kind at each of 100, 250 and 1000 Hz, with a logged velocity and without: joints over three
decades of torque, encoders of 2000 to 1 000 000 counts, noise of up to 3 % of alpha_0, half of the tracking runs with
gravity as large as friction. Motions reach 0.3 to 3 rad/s, held velocities go down to a fiftieth of that.
"""

import sys
from collections import Counter
from collections.abc import Callable
from functools import partial

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.data.run_kinds import kinds_of, stretches
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

RATES = (100.0, 250.0, 1000.0)
Rng = np.random.Generator


def joint(rng: Rng) -> tuple[Lugre[float], float]:
    """Friction, and an inertia that friction stops within 0.1 to 1 s from 1 rad/s."""
    alpha_0 = 10 ** rng.uniform(-2, 1)
    g0 = alpha_0 * (1 + rng.uniform(0, 0.6))
    bend = 10 ** rng.uniform(-3, -2)
    p = Lugre(alpha_0, g0 - alpha_0, alpha_0 * rng.uniform(0.1, 1), rng.uniform(0.02, 0.1), g0 / bend, 0.02 * g0 / bend)
    return p, alpha_0 * rng.uniform(0.1, 1)


def logged(
    rng: Rng, rate: float, q: Array, v: Array, T: Array, p: Lugre[float], count: float, *, velocity: bool
) -> Record:
    """What a log holds of a motion, with counts and noise, and a velocity from it where none is logged."""
    T = T + rng.uniform(0, 0.03) * p.alpha_0 * rng.standard_normal(T.size)
    measured = v + 0.005 * np.abs(v).max() * rng.standard_normal(v.size)
    record = Record(
        file="log.csv",
        time=np.arange(q.size) / rate,
        position=count * np.round(q / count),
        torque=T,
        velocity=measured if velocity else None,
    )
    return record if velocity else estimate_motion(record, min(10.0, 0.4 * rate))


def moved(rng: Rng, rate: float, v: Array, *, velocity: bool, gravity: bool = False) -> Record:
    """The log of a joint that is moved with a velocity, rad/s, (n,)."""
    p, J = joint(rng)
    q = np.cumsum(v) / rate
    T = rollout(v, 1 / rate, p).torque + J * np.gradient(v) * rate
    T = T + gravity * p.alpha_0 * rng.uniform(0.3, 1) * np.sin(q + rng.uniform(0, 6))
    return logged(rng, rate, q, v, T, p, 2 * np.pi / 10 ** rng.uniform(3.3, 5.3), velocity=velocity)


def holds(rng: Rng, rate: float, *, velocity: bool, speeds: int) -> Record:
    """Velocities held for 1 to 3 s each, in both directions, with rests of 0.3 s between and 0.1 s to speed up."""
    top = rng.uniform(0.5, 3)
    parts = []
    for speed in np.geomspace(top / rng.uniform(8, 50), top, speeds) if speeds > 1 else [rng.uniform(0.1, 3)]:
        for sign in (1, -1) if speeds > 1 else (1,):
            ramp = np.linspace(0, 1, max(int(0.1 * rate), 2))
            parts += [sign * speed * np.concatenate([ramp, np.ones(int(rng.uniform(1, 3) * rate)), ramp[::-1]])]
            parts += [np.zeros(int(0.3 * rate))]
    return moved(rng, rate, np.concatenate(parts), velocity=velocity)


def tracking(rng: Rng, rate: float, *, velocity: bool, what: str) -> Record:
    """Twenty seconds of two sines, of a chirp, or of moves to random places with no velocity held for long."""
    t = np.arange(int(20 * rate)) / rate
    top, slow = rng.uniform(0.3, 3), rng.uniform(0.1, 0.5)
    if what == "chirp":
        v = top * np.sin(2 * np.pi * (slow * t + 0.02 * t**2))
    elif what == "sines":
        v = top * (np.sin(2 * np.pi * slow * t) + rng.uniform(0.3, 1) * np.sin(2 * np.pi * 2.7 * slow * t + 1))
    else:
        move = np.sin(np.linspace(0, np.pi, int(rng.uniform(0.5, 1.5) * rate))) ** 2
        rest = np.zeros(int(rng.uniform(0.1, 0.5) * rate))
        signs = np.resize([1.0, -1.0], 200)
        v = np.concatenate([part for s in signs for part in (s * rng.uniform(0.3, 1) * top * move, rest)])[: t.size]
    return moved(rng, rate, v, velocity=velocity, gravity=bool(rng.integers(2)))


def loading(rng: Rng, rate: float, *, velocity: bool, breaks: bool) -> Record:
    """Torque that grows slowly and falls, in cycles below breakaway, or once and beyond it."""
    p, J = joint(rng)
    g0, bend = p.alpha_0 + p.alpha_1, (p.alpha_0 + p.alpha_1) / p.sigma_0
    if breaks:
        n, held = int(rng.uniform(3, 10) * rate), rng.uniform(0.4, 0.8)
        T = g0 / held * np.arange(n) / n
        q, v = -bend * np.log1p(-np.minimum(T / g0, 0.99)), np.zeros(n)
        for k in range(int(np.argmax(0.99 * g0 < T)), n):  # an integrator for a few samples
            level = p.alpha_0 + p.alpha_1 * np.exp(-((v[k - 1] / p.v_s) ** 2)) + p.alpha_2 * v[k - 1]
            v[k] = max(v[k - 1] + (T[k] - level) / (J * rate), 0.0)
            q[k] = q[k - 1] + v[k] / rate
    else:
        n, peak = int(rng.uniform(2, 8) * rate), rng.uniform(0.5, 0.9) * g0
        quarter = np.linspace(0, peak, n // 4)
        cycle = np.concatenate([quarter, quarter[::-1], -quarter, -quarter[::-1]])
        T = np.tile(cycle, int(rng.integers(2, 5)))
        s = np.sign(np.gradient(T))
        q = np.cumsum(np.gradient(T) / (p.sigma_0 * (1 - s * T / g0)))
        v = np.gradient(q) * rate
    count = min(2 * np.pi / 10 ** rng.uniform(4, 6), np.ptp(q) / 6)
    return logged(rng, rate, q, v, T, p, count, velocity=velocity)


def mixture(rng: Rng, rate: float, *, velocity: bool, mostly: str) -> Record:
    """Two thirds of one experiment and a third of the other, one after the other, of one joint: holds and two sines."""
    top = rng.uniform(0.5, 3)
    ramp = np.linspace(0, 1, max(int(0.1 * rate), 2))
    seconds = 20.0 if mostly == "holds" else 5.0
    parts = [
        sign * speed * np.concatenate([ramp, np.ones(int(seconds / 10 * rate)), ramp[::-1]])
        for speed in np.geomspace(top / 20, top, 5)
        for sign in (1, -1)
    ]
    t = np.arange(int((25 - seconds) / 2.5 * rate)) / rate
    v = np.concatenate([*parts, top * np.sin(2 * np.pi * 0.4 * t) + 0.5 * top * np.sin(2 * np.pi * 1.1 * t)])
    return moved(rng, rate, v, velocity=velocity)


LOGS: dict[str, tuple[str, Callable[..., Record]]] = {
    "12 speeds held": ("ramp", partial(holds, speeds=12)),
    "5 speeds held": ("ramp", partial(holds, speeds=5)),
    "one speed held": ("ramp", partial(holds, speeds=1)),
    "two sines": ("tracking", partial(tracking, what="sines")),
    "chirp": ("tracking", partial(tracking, what="chirp")),
    "moves and rests": ("tracking", partial(tracking, what="moves")),
    "loading below breakaway": ("presliding", partial(loading, breaks=False)),
    "loading up to breakaway": ("presliding", partial(loading, breaks=True)),
    "mostly holds, some sines": ("ramp", partial(mixture, mostly="holds")),
    "mostly sines, some holds": ("tracking", partial(mixture, mostly="sines")),
}


def guessed(record: Record) -> str:
    """The kind that a log alone is taken for."""
    return kinds_of([(record.file, stretches(record, "revolute"))])[0]


def main() -> None:
    """Print a row per kind of log."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    print(f"SIMULATED logs, {count} at each rate: share taken for the right experiment, in percent")
    print(
        f"{'log':>26} {'right one':>11}"
        + "".join(f"{f'{r:g} Hz':>9}{'no vel.':>8}" for r in RATES)
        + "  taken for, else"
    )
    for row, (name, (right, simulate)) in enumerate(LOGS.items()):
        cells, wrong = "", Counter[str]()
        for rate in RATES:
            for velocity in (True, False):
                rng = np.random.default_rng([row, int(rate), velocity])
                found = Counter(guessed(simulate(rng, rate, velocity=velocity)) for _ in range(count))
                cells += f"{100 * found[right] / count:{9 if velocity else 8}.1f}"
                wrong += found
        del wrong[right]
        print(f"{name:>26} {right:>11}{cells}  {', '.join(f'{k} {n}' for k, n in wrong.items())}", flush=True)


if __name__ == "__main__":
    main()
