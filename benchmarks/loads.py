"""Friction that rises with load: what is recovered, and what it predicts: `python benchmarks/loads.py [folder of bam_xl330]`.

(a) SIMULATED: a joint swings a weight about four angles, a log each, with friction that rises by 10 % of the torque of
    gravity: the coefficient of the law `paper+link-load`, fitted to all moving runs, with an exact supply and with one that
    errs by 2 % (standard deviation) in each log; seeds 0 to 9;
(b) measured, where the folder is given (bam_xl330: a small servo that swings a weight, at two gains of its controller):
    fitted to the logs of one gain and held against those of the other. Every signal goes through 6 Hz, forward and
    backward; samples count that are faster than 0.2 rad/s, and of one sign and driven for 50 ms around, the same for every
    law. Error of the torque, 100 * norm(error) / norm(measured), and its ratio to that of a law without load.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import butter, filtfilt

import bristle
from bristle.arrays import Array
from bristle.data.record import Record
from bristle.identification.load_levels import levels_of, settled_weights
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_records
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.registry import LOADS
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.model.rollout import rollout

SETS = 10
P = Lugre(0.25, 0.08, 0.4, 0.05, 400.0, 1.0)
J, G, RISES, NOISE, STEP = 0.08, 6.0, 0.1, 0.02, 0.002
ANGLES = (0.15, 0.5, 0.9, 1.3)
SUPPLY = 0.02
K_T, R = 0.3867, 4.017
FAST = 0.2
Logs = list[tuple[Record, NDArray[np.bool_]]]
LINK_LOAD = ParameterName("link_load", Direction.SHARED)


def swung(angle: float, rng: np.random.Generator) -> pd.DataFrame:
    """A log of 20 s about an angle, its torque from LuGre whose level rises with gravity's."""
    t, w = np.arange(0, 20, STEP), 2 * np.pi * np.array([[0.25], [0.7]])
    size, phase = np.array([[0.35], [0.12]]), rng.uniform(0, 2 * np.pi, (2, 1))
    q = angle + (size * np.sin(w * t + phase)).sum(axis=0)
    v, a = (size * w * np.cos(w * t + phase)).sum(axis=0), -(size * w**2 * np.sin(w * t + phase)).sum(axis=0)
    gravity = G * np.sin(q)
    T = rollout(v, STEP, P, level=RISES * np.abs(gravity)).torque + J * a + gravity
    return pd.DataFrame({"t": t, "q": q, "v": v, "T": T + NOISE * rng.standard_normal(t.size)})


def simulated(folder: Path, seed: int, supply: float) -> tuple[float, tuple[float, float]]:
    """The coefficient and its interval."""
    rng = np.random.default_rng(seed)
    for k, angle in enumerate(ANGLES):
        log = swung(angle, rng)
        log["T"] *= 1 + supply * rng.standard_normal()
        log.to_csv(folder / f"{k}.csv", index=False)
    columns = ", ".join(
        f"{name}: {{column: {column}, unit: {unit}}}"
        for name, column, unit in (
            ("time", "t", "s"), ("position", "q", "rad"), ("velocity", "v", "rad/s"), ("torque", "T", "N*m"),
        )
    )  # fmt: skip  # a list of values
    (folder / "geared.yaml").write_text(
        f"joint: {{name: geared, kind: revolute}}\nsimulated: true\nsignals: {{{columns}}}\n"
        "fit: {directions: symmetric, regressors: [inertia, gravity], law: paper+link-load}\n"
        f"runs: [{{files: [{', '.join(f'{k}.csv' for k in range(len(ANGLES)))}], experiment: tracking}}]\n"
    )
    tracking = bristle.identify(folder / "geared.yaml").joint().tracking
    e = tracking.parameters[LINK_LOAD] if tracking is not None else None
    if e is None or e.value is None or e.interval is None:
        return np.nan, (np.nan, np.nan)
    return e.value, e.interval


def recovered() -> None:
    """(a)."""
    for supply in (0.0, SUPPLY):
        with TemporaryDirectory() as folder:
            found = [simulated(Path(folder), seed, supply) for seed in range(SETS)]
        values = np.array([value for value, _ in found])
        inside = np.mean([low <= RISES <= high for _, (low, high) in found])
        width = np.median([high - low for _, (low, high) in found])
        print(
            f"  supply errs by {supply:.0%}: {values.min():.4f} to {values.max():.4f}, mean {values.mean():.4f}; "
            f"{inside:.0%} of the intervals hold {RISES:g}, median width {width:.4f}"
        )


def xl330(file: Path) -> tuple[Record, NDArray[np.bool_]]:
    """A log at 250 Hz through a 6 Hz low pass, forward and backward; and where it is fast, of one sign and driven for 50 ms around."""
    log, rate = pd.read_csv(file), 250.0
    t = np.arange(log["time"].iloc[0], log["time"].iloc[-1], 1 / rate)
    columns = (log["position"], log["input_volts"] * log["pwm"] / 885, log["torque_enable"])
    q, volts, driven = (np.interp(t, log["time"], x) for x in columns)
    v = np.gradient(q, t)
    low = butter(2, 6.0, fs=rate)
    signals = {"position": q, "velocity": v, "acceleration": np.gradient(v, t), "torque": K_T * (volts - K_T * v) / R}
    smooth: dict[str, Any] = {name: filtfilt(*low, x) for name, x in signals.items()}
    about, sign = 2 * round(0.05 * rate) + 1, np.sign(smooth["velocity"])
    kept = (np.abs(smooth["velocity"]) > FAST) & (minimum_filter1d(sign, about) == maximum_filter1d(sign, about))
    kept &= minimum_filter1d(driven, about) == 1
    kept[: about // 2] = kept[-(about // 2) :] = False
    return Record(file=file.name, time=t, **smooth), kept


def posed(logs: Logs, load: tuple[str, ...], weights: Mapping[str, float]) -> Regression:
    """The equations of some logs."""
    records, kept = zip(*logs, strict=True)
    whole, _, _ = from_records(records, ("both",), ("inertia", "gravity", *load), 1, None, GAUSSIAN, weights)
    return whole.rows(np.concatenate(kept))


def solution(problem: Regression) -> Array:
    """By the grid."""
    return solve(problem, default_range(problem.velocity)).theta


def held_out(fitted: Logs, held: Logs, load: tuple[str, ...]) -> tuple[float, int, dict[str, float]]:
    """Error of the torque of some logs by a fit of others, percent, equations, and the coefficients of the load."""

    def named(weights: Mapping[str, float]) -> Mapping[ParameterName, float]:
        """The parameters under a load."""
        problem = posed(fitted, load, weights)
        return problem.named(solution(problem))

    weights = settled_weights(named) if load else {}
    problem, test = posed(fitted, load, weights), posed(held, load, weights)
    theta = solution(problem)
    rises = {n.name: x for n, x in zip(problem.names, theta.tolist(), strict=True) if n.name in levels_of(load)}
    return test.relative_error(theta), test.torque.size, rises


def measured(folder: Path) -> None:
    """(b)."""
    logs = {gain: [xl330(file) for file in sorted(folder.glob(f"{gain}_*.csv"))] for gain in ("kp400", "kp100")}
    for fitted, held in (("kp400", "kp100"), ("kp100", "kp400")):
        before, n, _ = held_out(logs[fitted], logs[held], ())
        print(f"  {fitted} fitted, {held} held out, {n} equations: Coulomb + viscous + Stribeck {before:.1f} %")
        for name in LOADS:
            error, _, rises = held_out(logs[fitted], logs[held], (name,))
            told = ", ".join(f"{k} {x:.3f}" for k, x in rises.items())
            print(f"    +{name}: {error:.1f} %, {error / before:.2f} times; {told}")


def main() -> None:
    """Everything."""
    print(f"(a) link_load of {SETS} SIMULATED sets of four logs, truth {RISES:g}")
    recovered()
    if len(sys.argv) > 1:
        print("(b) bam_xl330")
        measured(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
