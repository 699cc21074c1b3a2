"""How often strays are named, rightly and wrongly, and what intervals cover beside them, on SIMULATED points.

    python benchmarks/strays.py [SETS]

The gripper (+) of Table 1 at 22 speeds, even in log(v), with white noise of 1 % of alpha_0, SETS sets (400) for each of
three seeds: clean ones; ones in which two points are off by ten standard deviations, at random places and signs; the
same at neighbouring speeds with one sign; and three, more than can be strays, which is misfit. Then what the 95 %
intervals cover.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.strays import all_but, find_strays
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Stribeck
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

SEEDS = (1, 2, 3)
SPEEDS = np.geomspace(0.005, 1.0, 22)
TRUTH = TABLE_1["gripper rotation"].positive.stribeck
NOISE = 0.01 * TRUTH.alpha_0
OFF = 10.0
NAMED = ("clean: none", "two: both", "neighbours", "three: misfit")
COVERED = ("clean", "without strays")


def problem(torque: Array) -> Regression:
    """The points as a static problem."""
    return from_points(SPEEDS, torque, ("+",))


def covered(points: Regression) -> list[bool]:
    """Whether the 95 % interval of each static parameter holds the truth; what is not identifiable counts for nothing."""
    estimates = estimate_static(points, FitOptions(), "revolute")
    known = ((getattr(TRUTH, name), e.interval) for name, e in estimates.items() if name in Stribeck._fields)
    return [low <= true <= high for true, ends in known if ends is not None for low, high in [ends]]


def off(places: NDArray[np.int_], signs: Array) -> Array:
    """What strays add, N*m, (22,)."""
    added = np.zeros(SPEEDS.size)
    added[places] = OFF * NOISE * signs
    return added


def one_set(rng: np.random.Generator) -> tuple[list[bool], list[list[bool]]]:
    """What `NAMED` and `COVERED` head, of one set."""
    (exact,) = evaluate(steady_torque_function(), SPEEDS, *TRUTH)
    noise = NOISE * rng.standard_normal(SPEEDS.size)
    places, signs = rng.permutation(SPEEDS.size)[:3], rng.choice([-1.0, 1.0], 3)
    two, first = off(places[:2], signs[:2]), int(rng.integers(SPEEDS.size - 1))
    clean, with_two = problem(exact + noise), problem(exact + noise + two)
    rows = set(find_strays(with_two).rows)
    beside = find_strays(problem(exact + noise + off(np.array([first, first + 1]), signs[:1])))
    named = [
        not find_strays(clean).rows,
        set(places[:2].tolist()) <= rows,
        {first, first + 1} <= set(beside.rows),
        find_strays(problem(exact + noise + off(places, signs))).misfit,
    ]
    return named, [covered(clean), covered(with_two.rows(all_but(SPEEDS.size, sorted(rows))))]


def main() -> None:
    """Print a row per seed in each of two tables."""
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 400
    print(f"{sets} SIMULATED sets a seed, 22 points, noise 1 % of alpha_0, strays of {OFF:g} standard deviations")
    found = {}
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        found[seed] = [one_set(rng) for _ in range(sets)]
    titles = ("named", "95 % intervals that cover the truth")
    for k, (title, heads) in enumerate(zip(titles, (NAMED, COVERED), strict=True)):
        print(f"\n{title}, %\n{'seed':>5}" + "".join(f"{head:>16}" for head in heads))
        for seed, each in found.items():
            shares = [100 * float(np.mean(np.hstack([one[k][j] for one in each]))) for j in range(len(heads))]
            print(f"{seed:>5}" + "".join(f"{share:>16.1f}" for share in shares))


if __name__ == "__main__":
    main()
