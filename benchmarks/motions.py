"""How well one motion identifies a joint that nobody has seen: `python benchmarks/motions.py [--motions 200]`.

SIMULATED motions of LuGre joints drawn at random, without faults, each fitted by `bristle.fit_dynamic` with default
arguments from time, position and torque. The friction is the same in both directions. Motion k has a seed of its own,
and is the same for every number of motions.

Draws are log-uniform unless said:
  - alpha_0 0.01 to 10 N*m; alpha_1 0 to 0.5 alpha_0 (uniform); v_s 0.01 to 0.2 rad/s; greatest speed 5 to 50 v_s;
  - alpha_2: viscous torque at the greatest speed 0.1 to 1 alpha_0; sigma_0: deflection alpha_0 / sigma_0 1e-4 to 1e-2
    rad, at most 5 % of the travel; sigma_1: damping ratio 0.1 to 1 of the bristle with the inertia, at most 0.9 of
    the passive limit alpha_0 alpha_2 / alpha_1; inertia torque at the greatest acceleration 0.1 to 3 alpha_0;
  - sampling 20 Hz (`sines`: 50 Hz) to 10 kHz (2 kHz), at least 20 samples per period of the fastest sine; 15 to 40 s
    (uniform), shorter where a log would have more than 1e5 samples, but never under three periods of the slowest sine:
    there the rate is lowered;
  - encoder 12 to 18 bits per turn (uniform), at least 200 counts of travel (else all is drawn again); white torque
    noise of 0.2 to 10 % of alpha_0 per sample.

Every second motion is `sines`: four of 0.1 to 0.6 Hz; the others are in turn `multisine`: 8 to 12 sines up to 2 Hz;
`ramps`: the velocity goes in straight lines, 0.6 to 3.3 s each, between peaks of alternating sign and several sizes,
with rounded corners; `chirp`: a velocity of constant amplitude from 0.1 Hz to 1 to 5 Hz, the frequency growing
exponentially.

The torque is rolled out along the exact velocity at 20 kHz or more, then sampled. Halving that step changes no sample
by more than 6e-6 alpha_0 (12 motions).
"""

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import make_interp_spline

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.findings import Severity
from bristle.identification.verdict import Trust, value_warnings, verdict
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

KINDS = ("sines", "multisine", "sines", "ramps", "sines", "chirp")
PARAMETERS = ("alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1", "inertia")
FINE = 2e4
"""Hz, the least rate of the rollout."""
MOST_SAMPLES, LEAST_COUNTS = 100_000, 200
SPEEDS, SLOWEST = 60, 0.02
"""Of the curve error, in each direction: their number, and the lowest as a share of the greatest speed."""
BEYOND = 5.0
"""%, a curve error that a user must be warned of."""
Row = dict[str, Any]


class Motion(NamedTuple):
    """A simulated log and its truth."""

    kind: str
    rate: float
    """Hz."""
    bits: int
    """Of the encoder, per turn."""
    noise: float
    """Of the torque, as a share of alpha_0."""
    truth: Lugre[float]
    inertia: float
    greatest_speed: float
    position: Array
    """rad, in whole counts, (n,)."""
    torque: Array
    """N*m, (n,)."""


def main() -> None:
    """Fit all motions; print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--csv", type=Path, help="a row per motion; written anew after each")
    asked = parser.parse_args()
    rows: list[Row] = []
    with ProcessPoolExecutor(asked.processes, mp_context=get_context("spawn")) as pool:
        for row in pool.map(partial(fitted, asked.seed), range(asked.motions)):
            rows.append(row)
            print(f"{row['index']} {row['verdict']}, {row['seconds']:.1f} s", file=sys.stderr, flush=True)
            if asked.csv is not None:
                pd.DataFrame(rows).to_csv(asked.csv, index=False)
    frame = pd.DataFrame(rows)
    frame = frame.reindex(columns=[*dict.fromkeys((*frame, "error", "critical", "code"))])
    print(f"{asked.motions} SIMULATED motions, seed {asked.seed}")
    print_curves(frame)
    print_parameters(rows)
    print_beyond(frame)


def log_uniform(rng: np.random.Generator, low: float, high: float, size: int | None = None) -> Any:
    """One number, or `size` of them, whose logarithm is uniform."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size))


def frequencies_of(kind: str, rng: np.random.Generator) -> Array:
    """Hz: of each sine; of the ends of a chirp; of each ramp, which lasts half a period."""
    if kind == "sines":
        return rng.uniform(0.1, 0.6, 4)
    if kind == "multisine":
        return np.asarray(log_uniform(rng, log_uniform(rng, 0.1, 0.5), 2, int(rng.integers(8, 13))))
    return np.asarray(log_uniform(rng, 0.15, 0.8, 80) if kind == "ramps" else [0.1, rng.uniform(1, 5)])


def velocity_of(kind: str, f: Array, t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Velocity and acceleration at times from 0 on, exact but for a common scale."""
    if kind == "ramps":  # the corners are rounded by a moving average over a fifth of the shortest ramp
        knots = np.append(0, np.cumsum(0.5 / f))
        peaks = log_uniform(rng, 0.1, 1, knots.size) * np.resize([1.0, -1.0], knots.size)
        straight, width = make_interp_spline(knots, peaks, 1), 0.1 / f.max()
        area = straight.antiderivative()
        return (area(t + width) - area(t)) / width, (straight(t + width) - straight(t)) / width
    if kind == "chirp":
        growth, w0 = np.log(f[1] / f[0]) / t[-1], 2 * np.pi * f[0]
        w = w0 * np.exp(growth * t)
        angle = rng.uniform(0, 2 * np.pi) + (w - w0) / growth
        return np.sin(angle), w * np.cos(angle)
    v, a = np.zeros((2, t.size))
    for w in 2 * np.pi * f:
        size, angle = rng.uniform(0.3, 1), rng.uniform(0, 2 * np.pi) + w * t
        v += size * np.sin(angle)
        a += size * w * np.cos(angle)
    return v, a


def simulated(seed: int, k: int, finer: int = 1) -> Motion:
    """Motion k; `finer` divides the step of the rollout."""
    rng, kind = np.random.default_rng([seed, k]), KINDS[k % len(KINDS)]
    while True:
        # the joint
        alpha_0 = log_uniform(rng, 0.01, 10)
        alpha_1, v_s = rng.uniform(0, 0.5) * alpha_0, log_uniform(rng, 0.01, 0.2)
        greatest_speed, deflection = log_uniform(rng, 5, 50) * v_s, log_uniform(rng, 1e-4, 1e-2)
        alpha_2 = log_uniform(rng, 0.1, 1) * alpha_0 / greatest_speed
        inertial, damping_ratio = log_uniform(rng, 0.1, 3), log_uniform(rng, 0.1, 1)

        # the log
        f = frequencies_of(kind, rng)
        low, high = (50, 2e3) if kind == "sines" else (20, 1e4)
        rate = log_uniform(rng, max(low, 20 * f.max()), min(high, MOST_SAMPLES * f.min() / 3))
        seconds = min(max(rng.uniform(15, 40), 3 / f.min()), MOST_SAMPLES / rate)
        bits, noise = int(rng.integers(12, 19)), log_uniform(rng, 0.002, 0.1)

        # the exact motion on a fine grid; the position is the velocity's integral, exact for cubics
        samples, parts = int(seconds * rate), finer * int(np.ceil(FINE / rate))
        h = 1 / (rate * parts)
        v, a = velocity_of(kind, f, h * np.arange((samples - 1) * parts + 1), rng)
        v, a = np.stack([v, a]) * (greatest_speed / np.abs(v).max())
        moved = np.append(0, np.cumsum(h / 2 * (v[1:] + v[:-1]) + h**2 / 12 * (a[:-1] - a[1:])))
        count, travel = 2 * np.pi / 2**bits, np.ptp(moved)
        if travel >= LEAST_COUNTS * count and deflection <= 0.05 * travel:
            break
    inertia, sigma_0 = inertial * alpha_0 / np.abs(a).max(), alpha_0 / deflection
    passive = 0.9 * alpha_0 * alpha_2 / alpha_1
    sigma_1 = min(2 * damping_ratio * np.sqrt(sigma_0 * inertia), passive)
    truth = Lugre(*map(float, (alpha_0, alpha_1, alpha_2, v_s, sigma_0, sigma_1)))
    torque = (rollout(v, h, truth).torque + inertia * a)[::parts]
    torque += noise * alpha_0 * rng.standard_normal(torque.size)
    position = count * np.round(moved[::parts] / count + rng.uniform(0, 2**bits))
    return Motion(kind, float(rate), bits, float(noise), truth, float(inertia), float(greatest_speed), position, torque)


def fitted(seed: int, k: int) -> Row:
    """What is drawn, and what is found, of motion k."""
    motion = simulated(seed, k)
    true = {**motion.truth._asdict(), "inertia": motion.inertia}
    row: Row = {"index": k, "kind": motion.kind, "rate": motion.rate, "bits": motion.bits, "noise": motion.noise}
    row |= {"samples": motion.torque.size} | {f"true {name}": true[name] for name in PARAMETERS}
    began = time.process_time()
    try:
        fit = bristle.fit_dynamic(np.arange(motion.torque.size) / motion.rate, motion.position, motion.torque)
    except Exception as end:  # noqa: BLE001  # a defect is a row of the table too
        reason = str(end) if isinstance(end, InputError) else f"a defect: {type(end).__name__}: {end}"
        return row | {"seconds": time.process_time() - began, "verdict": "refused", "reason": reason}
    row["seconds"] = time.process_time() - began
    found = verdict(fit.joint)
    row |= {"verdict": str(found.trust), "code": "" if found.reason is None else found.reason.code}
    row |= {"reason": str(found.reason or ""), "warnings": " ".join(w.code for w in value_warnings(fit.joint))}
    row["critical"] = sum(w.severity is Severity.CRITICAL for w in value_warnings(fit.joint))

    # the curve of steady sliding, in % of its RMS; nan where a direction has none
    speeds = np.linspace(SLOWEST, 1, SPEEDS) * motion.greatest_speed
    speeds = np.append(speeds, -speeds)
    steady = bristle.friction(speeds, motion.truth)
    try:
        off = fit.friction(speeds) - steady
    except InputError:
        off = np.full(speeds.size, np.nan)
    row["error"] = float(100 * np.sqrt(np.mean(off**2) / np.mean(steady**2)))

    # each estimate, of both directions at once or of each
    for name, e in fit.to_frame().iterrows():
        bare = str(name).rstrip("+-")
        if bare in PARAMETERS:
            value, error, lower, upper = map(float, (e.value, e.standard_error, e.lower, e.upper))
            row |= {f"{name} value": value, f"{name} error": error, f"{name} lower": lower, f"{name} upper": upper}
            row |= {f"{name} z": (value - true[bare]) / error, f"{name} inside": lower <= true[bare] <= upper}
    return row


def print_curves(rows: pd.DataFrame) -> None:
    """Errors of the steady curve by kind of motion; shares are of all motions."""
    table: dict[str, Row] = {}
    for kind in (*dict.fromkeys(KINDS), "all"):
        own = rows if kind == "all" else rows[rows.kind == kind]
        refused, beyond = own.verdict == "refused", own.error > BEYOND
        table[kind] = {"number": len(own), "refused": refused.sum(), "no curve": (own.error.isna() & ~refused).sum()}
        table[kind] |= {"median error": f"{own.error.median():.2f} %"}
        table[kind] |= {f"within {limit:g} %": f"{(own.error <= limit).mean():.1%}" for limit in (2, BEYOND)}
        table[kind] |= {f"beyond {BEYOND:g} %": beyond.sum(), "not critical": (beyond & (own.critical == 0)).sum()}
        table[kind] |= {str(trust): (own.verdict == trust).sum() for trust in Trust}
        table[kind] |= {"seconds, median": f"{own.seconds.median():.1f}", "total": f"{own.seconds.sum():.0f}"}
    print(pd.DataFrame.from_dict(table, orient="index").to_string())


def print_parameters(rows: list[Row]) -> None:
    """How many parameters have a 95 % interval, how often it holds the truth, and how wide it is; + and - each count."""
    table: dict[str, Row] = {}
    for bare in PARAMETERS:
        own = [(row, f"{bare}{d}") for row in rows for d in ("", "+", "-") if f"{bare}{d} value" in row]
        value, lower, upper, inside, z = (
            np.array([float(row[f"{name} {what}"]) for row, name in own])
            for what in ("value", "lower", "upper", "inside", "z")
        )
        half = (upper - lower) / 2 / np.array([row[f"true {bare}"] for row, _ in own])
        has = np.isfinite(half)
        table[bare] = {"asked": len(own), "values": np.isfinite(value).sum(), "intervals": has.sum()}
        table[bare] |= {"hold the truth": f"{inside[has].mean():.1%}", "|z|, median": f"{np.nanmedian(np.abs(z)):.2f}"}
        table[bare] |= {"half-width, median": f"{np.median(half[has]):.1%}"}
    print(
        f"\nintervals that are finite, and half their width relative to the truth\n{pd.DataFrame.from_dict(table, orient='index').to_string()}"
    )


def print_beyond(rows: pd.DataFrame) -> None:
    """The motions whose curve is off by more than `BEYOND`, and those refused."""
    far = rows[rows.error > BEYOND]
    print(
        f"\n{len(far)} motions beyond {BEYOND:g} %: rate, Hz; bits; noise, % of alpha_0; error, %; verdict and reason"
    )
    for _, x in far.iterrows():
        drawn = f"{x['index']:>5}  {x.kind:<10}{x.rate:>6.0f}{x.bits:>4}{100 * x.noise:>7.2f}{x.error:>8.1f}"
        print(f"{drawn}  {x.verdict}: {x.code or 'no warning'}")
    for _, x in rows[rows.verdict == "refused"].iterrows():
        print(f"{x['index']:>5}  {x.kind:<10}refused: {x.reason}")


if __name__ == "__main__":
    main()
