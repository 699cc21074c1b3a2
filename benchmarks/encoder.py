"""What an encoder's counts do to the estimates, over its bits: `python benchmarks/encoder.py`.

(a) presliding of gripper rotation (+): relative error of sigma_0 by (14) and from count edges, the joint resting on a count edge or anywhere in
a count. (b) moving runs of gripper rotation: error of each parameter in its standard errors, as fitted and after the bias of counts is taken off.
Simulated, with fixed seeds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

import datasets_path  # noqa: F401
import simulated_edro
from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.data.slow_loading import find_loadings
from bristle.findings import NOTE, Finding
from bristle.identification.dynamic.encoder_bias import without_count_bias
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, dynamic_problem
from bristle.identification.fits import PreslidingFit, TrackingFit
from bristle.identification.presliding.fit import fit_presliding
from bristle.identification.presliding.stiffness import KnownValue
from bristle.model import functions
from bristle.model.motor import drive_torque
from bristle.model.parameters import INERTIA, SIGNED, Direction, Lugre, ParameterName
from bristle.model.vectorize import evaluate
from bristle.simulation import edro

PAIR = edro.TABLE_1["gripper rotation"]
P = PAIR.positive
G0 = P.alpha_0 + P.alpha_1
METHODS = ("printed", "sigma_0")
REPETITIONS = 200
SEEDS = 10


def main() -> None:
    """Print both tables."""
    presliding()
    moving()


def presliding() -> None:
    """Both estimates of sigma_0, on a count edge and over rest positions."""
    print(
        f"(a) sigma_0 of gripper rotation (+), error in %: on a count edge without noise; mean +- spread over {REPETITIONS} rest positions, with"
    )
    print("    torque noise of 0.5 % of g0")
    print(f"{'bits':>4}" + "".join(f"{m:>24}" for m in METHODS))
    for bits in (12, 14, 16, 18):
        quantum, rng = 2 * np.pi / 2**bits, np.random.default_rng(bits)
        exact = ramp(quantum, 0.0, 0.0, rng)
        fits = [ramp(quantum, rng.uniform(), 0.005 * G0, rng) for _ in range(REPETITIONS)]
        cells = [f"{error([exact], m)[0]:+.1f}; {spread(error(fits, m))}" for m in METHODS]
        print(f"{bits:>4}" + "".join(f"{cell:>24}" for cell in cells))


def ramp(quantum: float, phase: float, noise: float, rng: np.random.Generator) -> PreslidingFit:
    """The fit of one slow ramp to 0.85 g0."""
    time = np.arange(0, 25, 0.01)
    torque = 0.85 * G0 * time / 25
    y = evaluate(functions.loading_displacement_function(), torque, G0, P.sigma_0)[0]
    measured = torque + noise * rng.standard_normal(time.size)
    record = Record(file="ramp", time=time, position=quantum * np.floor(y / quantum + phase), torque=measured)
    found = find_loadings(record, 2.0 if noise else 1e3, quantum, None)
    level = KnownValue(G0, 0.005 * G0, Finding("of-static-fit", NOTE, "the static fit"))
    return fit_presliding(found, level, None, "revolute")


def error(fits: Sequence[PreslidingFit], method: str) -> Array:
    """Relative errors of one method, percent."""
    return np.array([100 * ((getattr(fit, method).value or np.nan) / P.sigma_0 - 1) for fit in fits])


def spread(errors: Array) -> str:
    """Mean and standard deviation."""
    return f"{np.nanmean(errors):+.1f} +- {np.nanstd(errors):.1f}"


def moving() -> None:
    """Errors of the moving fit in standard errors, as fitted and corrected, over bits."""
    print(
        f"(b) moving runs of gripper rotation, mean over {SEEDS} seeds of (estimate - truth) / standard error: as fitted / bias of counts taken off"
    )
    names = [ParameterName(name, Direction.POSITIVE) for name in Lugre._fields] + [INERTIA]
    print(f"{'bits':>4}" + "".join(f"{name!s:>16}" for name in names))
    for bits in (14, 15, 16, 18, 20):
        pairs = [both(2 * np.pi / 2**bits, seed) for seed in range(SEEDS)]
        off = np.array([[[distance(fit, name) for name in names] for fit in pair] for pair in pairs])
        seen = np.isfinite(off)
        means = np.where(
            seen.any(axis=0), np.where(seen, off, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1), np.nan
        )
        print(f"{bits:>4}" + "".join(f"{f'{a:+.1f} / {b:+.1f}':>16}" for a, b in means.T))


def both(quantum: float, seed: int) -> tuple[TrackingFit, TrackingFit]:
    """One seed's fit as it is, and with the bias taken off."""
    run = measured(quantum, seed)

    def pose(records: Sequence[Record], fixed: Mapping[ParameterName, float]) -> DynamicProblem:
        return dynamic_problem(records, ("+", "-"), ("inertia",), simulated_edro.DECIMATION, None, fixed)

    found = fit_tracking(pose([run], {}), truth(), "revolute", search=False)
    return found.fit, without_count_bias(found, [run], pose, quantum)


def measured(quantum: float, seed: int) -> Record:
    """A moving run of the virtual bench, with velocity and torque as `identify` estimates them."""
    log = simulated_edro.tracking_logs("gripper", [seed], resolution=quantum)
    motor = simulated_edro.motor("gripper rotation")
    record = estimate_motion(
        Record(file="run", time=log.time, position=log.position[0], voltage=log.voltage[0]), simulated_edro.CUTOFF
    )
    torque = np.asarray(drive_torque(record.voltage, record.velocity, motor))
    return replace(record, torque=torque)


def truth() -> dict[ParameterName, float]:
    """The true parameters by name."""
    own = {ParameterName(name, d): x for d, p in zip(SIGNED, PAIR, strict=True) for name, x in p._asdict().items()}
    return own | {INERTIA: simulated_edro.motor("gripper rotation").J}


def distance(fit: TrackingFit, name: ParameterName) -> float:
    """(estimate - truth) / standard error; nan where the motion does not show the parameter."""
    e = fit.parameters[name]
    return np.nan if e.value is None or not e.standard_error else (e.value - truth()[name]) / e.standard_error


if __name__ == "__main__":
    main()
