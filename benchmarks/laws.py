"""What the friction laws recover, and how often the data choose the right one, on SIMULATED points: `python benchmarks/laws.py`.

(a) each law fitted to 400 sets simulated from it: how many 95 % intervals hold the truth, by parameter;
(b) `auto` on 400 sets of the gripper (+), 22 speeds from 0.15 v_s to 0.8 rad/s, noise 0.5 and 5 % of alpha_0, v abs(v)
    absent, weak or strong: which law is chosen, and how many intervals of alpha_0 hold the truth;
(c) time of one fit, parameters and covariance, against scipy.optimize.curve_fit, and of the free exponent against the law
    without, in this one run.

Seed 0 throughout.
"""

from collections import Counter
from functools import partial

import numpy as np
from scipy.optimize import curve_fit

from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.covariance import covariance
from bristle.identification.law_comparison import compare_laws
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import Regression, from_points
from bristle.identification.static.profiles import with_best_shape
from bristle.model.functions import steady_torque_function
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.laws.registry import competing, law_named
from bristle.model.parameters import Stribeck, static_of
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1
from timing import least

SETS = 400
P = TABLE_1["gripper rotation"].positive
SPEEDS = np.geomspace(0.15 * P.v_s, 0.8, 22)
OWN = {"alpha_3": 0.02, "delta": 1.4, FASTEST: float(SPEEDS.max())}


def of_law(law: Law, **own: float) -> Stribeck[float]:
    """The gripper's parameters under a law."""
    values = {**P._asdict(), **OWN, **own}
    return static_of(law)(**{name: values[name] for name in static_of(law)._fields})


def simulated(p: Stribeck[float], v: Array, noise: float, rng: np.random.Generator) -> Array:
    """Steady torques with white noise, of a share of alpha_0."""
    torque: Array = evaluate(steady_torque_function(p.law), v, *p)[0]
    return torque + noise * p.alpha_0 * rng.standard_normal(v.size)


def coverage(law: Law, noise: float, speeds: Array) -> str:
    """How many intervals of a law's own fit hold the truth, percent, by parameter."""
    rng, p, options = np.random.default_rng(0), of_law(law), FitOptions(law=law.name, set_up="as-written")
    inside, known = Counter[str](), Counter[str]()
    for _ in range(SETS):
        problem = from_points(speeds, simulated(p, speeds, noise, rng), ("both",), law=law)
        for name, e in estimate_static(problem, options, "revolute").items():
            if name != FASTEST and e.interval is not None:
                known[name] += 1
                inside[name] += e.interval[0] <= getattr(p, name) <= e.interval[1]
    return ", ".join(f"{name} {100 * inside[name] / known[name]:.1f}" for name in known)


def chosen(p: Stribeck[float], noise: float, rng: np.random.Generator) -> tuple[str, bool]:
    """The law that `auto` takes of one set, and whether alpha_0's interval holds the truth."""
    torque = simulated(p, SPEEDS, noise, rng)

    def pose(law: Law) -> list[Regression]:
        """One solve."""
        return [from_points(SPEEDS, torque, ("both",), law=law)]

    found = compare_laws(pose, law_named("paper"))
    if found is None:
        raise SystemExit("22 points are enough to compare laws")
    law = law_named(found.chosen.name)
    own = estimate_static(pose(law)[0], FitOptions(law=law.name), "revolute")["alpha_0"].interval
    low, high = own or (-np.inf, np.inf)
    return law.name, low <= p.alpha_0 <= high


def choices() -> None:
    """(b)."""
    quadratic = law_named("gaussian+quadratic")
    for alpha_3 in (0.0, 0.02, 1.5):
        for noise in (0.005, 0.05):
            rng, p = np.random.default_rng(0), of_law(quadratic, alpha_3=alpha_3)
            laws, inside = zip(*(chosen(p, noise, rng) for _ in range(SETS)), strict=True)
            count = Counter(laws)
            bent = sum(n for name, n in count.items() if name.endswith("+quadratic"))
            told = ", ".join(f"{name} {100 * n / SETS:.1f}" for name, n in count.most_common())
            print(
                f"  alpha_3 {alpha_3:g}, noise {noise:.1%}: {told}; with v abs(v) {100 * bent / SETS:.1f} %; alpha_0 inside {np.mean(inside):.1%}"
            )


def model(v: Array, a0: float, a1: float, a2: float, v_s: float) -> Array:
    """Equation (9), written as a user would."""
    return (a0 + a1 * np.exp(-((v / v_s) ** 2))) * np.sign(v) + a2 * v


def times() -> None:
    """(c)."""
    rng, v = np.random.default_rng(0), np.geomspace(0.01, 1.0, 200)
    torque = model(v, *P[:4]) + 5e-4 * rng.standard_normal(200)

    def fitted(law: Law) -> Array:
        """Parameters and covariance of a law."""
        problem = with_best_shape(from_points(v, torque, ("both",), law=law), default_range(v))
        solution = solve(problem, default_range(v))
        return covariance(solution.jacobian, solution.cost)[0]

    start = (0.7 * P.alpha_0, 1.3 * P.alpha_1, 0.7 * P.alpha_2, 1.3 * P.v_s)
    names = ("gaussian", "lorentzian", "gaussian+quadratic", "free-exponent")
    spent = least(
        {name: partial(fitted, law_named(name)) for name in names}
        | {"curve_fit": partial(curve_fit, model, v, torque, p0=start)},
        repeats=20,
        number=10,
    )
    for name, seconds in spent.items():
        print(f"  {name}: {1e6 * seconds:.0f} us, {seconds / spent['gaussian']:.2f} times the Gaussian law's")


def main() -> None:
    """Everything, in a few minutes."""
    wide = np.geomspace(0.15 * P.v_s, 11 * P.v_s, 40)
    print(
        f"(a) {SETS} sets, 40 speeds from 0.15 to 11 v_s, noise 0.5 % of alpha_0: intervals that hold the truth, percent"
    )
    for law in (*competing(), law_named("free-exponent")):
        print(f"  {law.name}: {coverage(law, 0.005, wide)}")
    print(f"(b) {SETS} sets: laws chosen, percent")
    choices()
    print("(c) one fit of 200 points, parameters and covariance")
    times()


if __name__ == "__main__":
    main()
