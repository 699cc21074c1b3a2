"""How often the 95 % intervals cover the truth: `python benchmarks/coverage.py [--seeds 100] [--repetitions 1000]`.

(a) the embedded experiment, simulated again with other seeds, through reading's next steps (segments, fit); eight joint-direction sets.
(b) points of gripper rotation (+) with Gaussian noise, at designs from good to poor; each design with the standard error of v_s that it gives.
"""

import argparse

import numpy as np

from bristle import bench, edro
from bristle.data.options import FitOptions
from bristle.identification.fit import estimate_static
from bristle.identification.regression import from_points
from bristle.model.arrays import Array

NAMES = ("alpha_0", "alpha_1", "alpha_2", "v_s")
P = edro.TABLE_1["gripper rotation"].positive


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--repetitions", type=int, default=1000)
    chosen = parser.parse_args()
    if chosen.repetitions:
        designs(chosen.repetitions)


def designs(repetitions: int) -> None:
    """Coverage at planned velocities."""
    print(f"{repetitions} repetitions of gripper rotation (+), simulated points with Gaussian noise, seed 0")
    print(f"{'design':<44}{'se(v_s)':>9}" + "".join(f"{name:>9}" for name in NAMES) + f"{'no peak':>9}")
    for label, velocities, noise in DESIGNS:
        rng = np.random.default_rng(0)
        hits, errors, lost = dict.fromkeys(NAMES, 0), [], 0
        for _ in range(repetitions):
            torque = bench.steady_points(P, velocities, noise, rng, 1)[0]
            parameters = estimate_static(from_points(velocities, torque, ("+",)), FitOptions(), "revolute")
            if parameters["v_s"].value is None:
                lost += 1
                continue
            errors.append(parameters["v_s"].standard_error)
            for name in NAMES:
                interval = parameters[name].interval
                hits[name] += interval is not None and interval[0] <= getattr(P, name) <= interval[1]
        found = max(repetitions - lost, 1)
        spread = 100 * float(np.median(np.array(errors, dtype=float))) / P.v_s
        print(
            f"{label:<44}{spread:8.1f}%"
            + "".join(f"{100 * hits[n] / found:8.1f}%" for n in NAMES)
            + f"{100 * lost / repetitions:8.1f}%"
        )


DESIGNS: tuple[tuple[str, Array, float], ...] = (
    ("16 speeds, 0.15 v_s to 11 v_s, noise 0.5 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.005 * P.alpha_0),
    ("16 speeds, 0.15 v_s to 11 v_s, noise 2 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.02 * P.alpha_0),
    ("16 speeds, 0.15 v_s to 11 v_s, noise 5 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.05 * P.alpha_0),
    ("10 speeds, even from 0.5 v_s, noise 1 %", np.linspace(0.5 * P.v_s, 0.8, 10), 0.01 * P.alpha_0),
    ("12 speeds, even from 1.0 v_s, noise 1 %", np.linspace(1.0 * P.v_s, 0.8, 12), 0.01 * P.alpha_0),
)


if __name__ == "__main__":
    main()
