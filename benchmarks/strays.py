"""How often strays are named, rightly and wrongly, and what intervals cover without them, on SIMULATED points.

    python benchmarks/strays.py [SETS]

The gripper (+) of Table 1 at 22 speeds, even in log(v), with white noise of 1 % of alpha_0, SETS sets (400) for each of
three seeds: clean ones, and ones in which two points are off by ten standard deviations, at random places and signs.
"""

import sys

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.strays import find_strays
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Stribeck
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

SEEDS = (1, 2, 3)
SPEEDS = np.geomspace(0.005, 1.0, 22)
TRUTH = TABLE_1["gripper rotation"].positive.stribeck
NOISE = 0.01 * TRUTH.alpha_0
OFF = 10.0


def covered(problem: Regression) -> list[bool]:
    """Whether the 95 % interval of each static parameter holds the truth; what is not identifiable counts for nothing."""
    estimates = estimate_static(problem, FitOptions(), "revolute")
    known = ((getattr(TRUTH, name), e.interval) for name, e in estimates.items() if name in Stribeck._fields)
    return [low <= true <= high for true, ends in known if ends is not None for low, high in [ends]]


def dropped(torque: Array) -> tuple[set[int], Regression]:
    """The strays of a set, and the problem without them."""
    problem = from_points(SPEEDS, torque, ("+",))
    rows = set(find_strays(problem).rows)
    return rows, problem.rows(np.array([k not in rows for k in range(SPEEDS.size)]))


def main() -> None:
    """Print a row per seed."""
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    exact = evaluate(steady_torque_function(), SPEEDS, *TRUTH)[0]
    print(f"{sets} SIMULATED sets a seed, 22 points, noise 1 % of alpha_0, two strays of {OFF:g} standard deviations")
    print(
        f"{'seed':>5} {'clean, none named':>18} {'both strays named':>18} {'coverage, clean':>16} {'coverage, drop':>15}"
    )
    for seed in SEEDS:
        rng, clean, both = np.random.default_rng(seed), 0, 0
        covers: dict[str, list[bool]] = {"clean": [], "drop": []}
        for _ in range(sets):
            torque = exact + NOISE * rng.standard_normal(SPEEDS.size)
            clean += not find_strays(from_points(SPEEDS, torque, ("+",))).rows
            covers["clean"] += covered(from_points(SPEEDS, torque, ("+",)))
            places = rng.choice(SPEEDS.size, 2, replace=False)
            torque[places] += OFF * NOISE * rng.choice([-1.0, 1.0], 2)
            rows, rest = dropped(torque)
            both += set(places.tolist()) <= rows
            covers["drop"] += covered(rest)
        shares = [100 * x for x in (clean / sets, both / sets, *(float(np.mean(c)) for c in covers.values()))]
        print(f"{seed:>5} {shares[0]:>16.1f} % {shares[1]:>16.1f} % {shares[2]:>14.1f} % {shares[3]:>13.1f} %")


if __name__ == "__main__":
    main()
