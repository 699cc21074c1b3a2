"""How near `bristle.fit_dynamic`, as it comes, is to the truth on simulated motions: `python benchmarks/motions.py [--motions 200]`.

Each motion is of a LuGre joint drawn at random, alike in both directions; position (encoder counts) and torque (white noise) are logged. Printed
are the error of the curve (root mean square over 60 speeds in each direction, in percent of friction's), the verdict, how often the 95 % interval
of each parameter holds the truth, and CPU seconds; last, the motions whose curve is off by more than 5 %. Motion k is the same whatever their number.
The torque is integrated at 8 times the rate of the log, and 5 kHz, at the least.
"""

import argparse
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pandas as pd

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.identification.verdict import verdict
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

KINDS = ("sines", "sines", "sines", "multisine", "reversals", "chirp")
"""Half of the motions are four sines."""
NAMES = ("alpha_0", "alpha_1", "alpha_2", "v_s", "sigma_0", "sigma_1", "inertia")
FINER, FINEST = 8, 5000.0
"""Samples of the simulation to one of the log at the least, and its rate, Hz, at the least."""
MOST = 100_000
"""Samples of a log."""
PERIODS, COUNTS = 20, 200
"""Samples of a period of the fastest sine, and encoder counts of travel, at the least."""
SPEEDS = 60
LOW = 0.02
"""The slowest speed of the curve, of the fastest."""
FAR, NEAR = 5.0, 2.0
"""Percent of friction."""


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def drawn(k: int, seed: int) -> dict[str, Any]:
    """Motion k: what it is like, the truth, and its log."""
    rng = np.random.default_rng([seed, k])
    kind = KINDS[k % len(KINDS)]
    alpha_0, v_s = log_uniform(rng, 0.01, 10.0), log_uniform(rng, 0.01, 0.2)
    top = v_s * log_uniform(rng, 5.0, 50.0)

    # Lines of the velocity: frequency, share, phase. Reversals are a triangle of position with corners of 2 % of a period.
    fastest = {
        "sines": 0.6,
        "multisine": log_uniform(rng, 0.6, 2.0),
        "reversals": log_uniform(rng, 0.1, 0.6),
        "chirp": log_uniform(rng, 1.0, 5.0),
    }[kind]
    lines = 4 if kind == "sines" else int(rng.integers(8, 13))
    f = rng.uniform(0.1, fastest, lines)
    size, phase = rng.uniform(0.3, 1.0, lines), rng.uniform(0, 2 * np.pi, lines)
    levels = rng.uniform(0.1, 1.0, 40)

    # Rate and length.
    seconds = rng.uniform(15.0, 40.0)
    slowest_rate = PERIODS * (fastest if kind != "reversals" else 10 * fastest)
    rate = max(log_uniform(rng, 50.0, 2000.0) if kind == "sines" else log_uniform(rng, 20.0, 10_000.0), slowest_rate)
    n = min(int(seconds * rate), MOST)
    finer = max(FINER, int(np.ceil(FINEST / rate)))
    t = np.arange(n * finer) / (rate * finer)
    end = n / rate

    if kind in ("sines", "multisine"):
        wave = (size * np.sin(2 * np.pi * f * t[:, None] + phase)).sum(axis=1)
    elif kind == "chirp":
        wave = np.sin(2 * np.pi * (0.1 * t + (fastest - 0.1) * t**2 / (2 * end)) + phase[0])
    else:
        half = (2 * fastest * t).astype(int)
        within = 2 * fastest * t - half
        corner = np.clip(np.minimum(within, 1 - within) / 0.04, 0, 1)
        wave = np.where(half % 2, -1.0, 1.0) * levels[half % levels.size] * np.sin(np.pi / 2 * corner)
    v = top * wave / np.abs(wave).max()

    # The joint: viscous torque, acceleration and presliding are drawn relative to Coulomb friction and motion.
    acceleration = np.gradient(v, t)
    alpha_1 = alpha_0 * rng.uniform(0.0, 0.5)
    alpha_2 = alpha_0 * log_uniform(rng, 0.1, 1.0) / top
    sigma_0 = alpha_0 / log_uniform(rng, 1e-4, 1e-2)
    inertia = alpha_0 * log_uniform(rng, 0.1, 3.0) / float(np.abs(acceleration).max())
    # A joint dissipates in every motion (`is_passive`), and its bristle damps 0.1 to 0.7 of critically at the most.
    sigma_1 = min(2 * rng.uniform(0.1, 0.7) * float(np.sqrt(sigma_0 * inertia)), 0.8 * alpha_2 * alpha_0 / alpha_1)
    truth = Lugre(alpha_0, alpha_1, alpha_2, v_s, sigma_0, sigma_1)
    torque = rollout(v, 1 / (rate * finer), truth).torque + inertia * acceleration

    # What is logged.
    bits = int(rng.integers(12, 19))
    q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) / (rate * finer)
    count = min(2 * np.pi / 2**bits, float(np.ptp(q)) / COUNTS)
    noise = log_uniform(rng, 0.002, 0.1)
    logged = slice(None, None, finer)
    return {
        "k": k, "kind": kind, "rate": rate, "bits": float(np.log2(2 * np.pi / count)), "noise": noise, "samples": n, "top": top,
        "truth": {**truth._asdict(), "inertia": inertia}, "t": t[logged], "q": np.round(q[logged] / count) * count,
        "torque": torque[logged] + noise * alpha_0 * rng.standard_normal(n),
    }  # fmt: skip  # a table


def curve(speed: Array, p: dict[str, float]) -> Array:
    """Steady friction (9) in one direction, N*m."""
    return np.asarray(p["alpha_0"] + p["alpha_1"] * np.exp(-((speed / p["v_s"]) ** 2)) + p["alpha_2"] * speed)


def fitted(k: int, seed: int) -> dict[str, Any]:
    """A row: what motion k is like and what was found of it."""
    motion = drawn(k, seed)
    row = {name: motion[name] for name in ("k", "kind", "rate", "bits", "noise", "samples")}
    begun = process_time()
    try:
        found = bristle.fit_dynamic(motion["t"], motion["q"], motion["torque"])
    except InputError as error:
        return {**row, "seconds": process_time() - begun, "verdict": "refused", "reason": str(error)}
    row["seconds"] = process_time() - begun

    # The curve that a user gets from the fit, in both directions.
    speed = np.linspace(LOW, 1.0, SPEEDS) * motion["top"]
    true = curve(speed, motion["truth"])
    try:
        both = np.concatenate([found.friction(speed), -np.asarray(found.friction(-speed))])
        row["error"] = 100 * float(np.linalg.norm(both - np.tile(true, 2)) / np.linalg.norm(np.tile(true, 2)))
    except InputError:
        row["error"] = np.nan  # nothing is known of the curve
    said = verdict(found.joint)
    critical = [w for w in found.warnings if str(w.severity) == "critical"]
    row |= {"verdict": str(said.trust), "critical": len(critical), "reason": str(said.reason or "")}

    # Each parameter, where it has an interval: in each direction.
    for estimate in found.to_frame().itertuples():
        name = str(estimate.Index).rstrip("+-")
        if (
            name not in NAMES
            or not np.isfinite(estimate.value)
            or not np.isfinite([estimate.lower, estimate.upper]).all()
        ):
            continue
        true_value, error = motion["truth"][name], estimate.standard_error
        row.setdefault(name, []).append(
            (
                estimate.lower <= true_value <= estimate.upper,
                (estimate.value - true_value) / error if error else np.nan,
                (estimate.upper - estimate.lower) / 2 / true_value,
            )
        )
    return row


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    with Pool(options.processes) as pool:
        rows = []
        work = range(options.first, options.first + options.motions)
        for row in pool.imap(partial(fitted, seed=options.seed), work):
            rows.append(row)
            print(len(rows), end="\r", file=sys.stderr)
    frame = pd.DataFrame(rows)
    if options.csv:
        frame.to_csv(options.csv, index=False)
    report(frame, options.seed)


def report(frame: pd.DataFrame, seed: int) -> None:
    """The tables of some rows."""
    print(
        f"{len(frame)} simulated motions, seed {seed}: error of the friction curve in percent (RMS over speeds), as fit_dynamic comes"
    )
    heads = (
        "kind",
        "motions",
        "refused",
        "median",
        f"<= {NEAR:g} %",
        f"<= {FAR:g} %",
        "beyond, not critical",
        "use",
        "CPU s",
        "total s",
    )
    print(("{:>10}" * 6 + "{:>22}{:>6}{:>8}{:>9}").format(*heads))
    for kind in (*dict.fromkeys(frame["kind"]), "all"):
        own = frame if kind == "all" else frame[frame["kind"] == kind]
        error, far = own["error"].fillna(np.inf), (own["error"].fillna(np.inf) > FAR)
        print(
            f"{kind:>10}{len(own):>10}{int((own['verdict'] == 'refused').sum()):>10}{error.median():>10.2f}{100 * (error <= NEAR).mean():>9.1f}%"
            f"{100 * (error <= FAR).mean():>9.1f}%{int((far & ~(own['critical'] > 0) & (own['verdict'] != 'refused')).sum()):>22}"
            f"{int((own['verdict'] == 'use').sum()):>6}{own['seconds'].median():>8.2f}{own['seconds'].sum():>9.0f}"
        )
    print("\nparameter   intervals   hold the truth   median |z|   median half-width")
    for name in NAMES:
        every = [x for cell in frame.get(name, pd.Series(dtype=object)).dropna() for x in cell]
        if every:
            inside, z, width = np.array(every, dtype=float).T
            print(
                f"{name:<10}{len(every):>11}{100 * inside.mean():>15.1f}%{np.nanmedian(np.abs(z)):>13.2f}{100 * np.median(width):>18.1f}%"
            )
    print(f"\nbeyond {FAR:g} %:")
    for row in frame[~(frame["error"] <= FAR)].itertuples():
        log = f"{row.rate:.0f} Hz, {row.bits:.1f} bits, noise {100 * row.noise:.1f} %"
        print(f"{row.k:>5} {row.kind}, {log}: {row.error:.1f} %, {row.verdict}: {str(row.reason)[:110]}")


if __name__ == "__main__":
    main()
