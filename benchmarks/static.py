"""How fast the static fit is, beside what a user would pick instead: `python benchmarks/static.py`.

(a) one set of 200 points, parameters and covariance, against scipy.optimize.curve_fit and lmfit, both from a start within 30 % of the answer;
(b) 1000 sets at shared velocities against a loop of curve_fit;
(c) a profile interval for every parameter of each set, one by one, against a loop of lmfit's fit and conf_interval, and its distance from that;
(d) a bootstrap-t of 10 000 resamples of one set against a loop of curve_fit. Everything is timed in this one run; the ratios are what counts.
"""

import lmfit
import numpy as np
from scipy.optimize import curve_fit

from bristle.arrays import Array
from bristle.estimation.covariance import covariance
from bristle.identification.static.batch import COARSE, Batch
from bristle.identification.static.grid import default_range, plain_grid, solve
from bristle.identification.static.problem import from_points
from bristle.identification.static.profiles import profiled
from bristle.identification.static.uncertainty import resample
from bristle.simulation.edro import TABLE_1
from timing import least

P = TABLE_1["gripper rotation"].positive
NOISE = 5e-4
START = (0.7 * P.alpha_0, 1.3 * P.alpha_1, 0.7 * P.alpha_2, 1.3 * P.v_s)


def model(v: Array, a0: float, a1: float, a2: float, v_s: float) -> Array:
    """Equation (9), written as a user would."""
    return (a0 + a1 * np.exp(-((v / v_s) ** 2))) * np.sign(v) + a2 * v


def bristle_fit(v: Array, torque: Array) -> tuple[Array, Array]:
    """Parameters and covariance by the refined grid; no start needed."""
    problem = from_points(v, torque, ("both",))
    solution = solve(problem, default_range(v))
    return solution.theta, covariance(solution.jacobian, solution.cost)[0]


def main() -> None:
    """Time and print."""
    rng = np.random.default_rng(0)
    v = np.geomspace(0.01, 1.0, 200)
    torques = model(v, *P[:4])[:, None] + NOISE * rng.standard_normal((200, 1000))
    torque = np.ascontiguousarray(torques[:, 0])
    lmfit_model = lmfit.Model(model)
    guess = lmfit_model.make_params(**dict(zip(("a0", "a1", "a2", "v_s"), START, strict=True)))

    one = least(
        {
            "bristle, refined grid": lambda: bristle_fit(v, torque),
            "bristle, plain grid of 500": lambda: plain_grid(from_points(v, torque, ("both",)), default_range(v)),
            "curve_fit": lambda: curve_fit(model, v, torque, p0=START),
            "lmfit": lambda: lmfit_model.fit(torque, guess, v=v),
        },
        repeats=20,
        number=25,
    )
    base = one["bristle, refined grid"]
    print("(a) one set of 200 points, parameters and covariance")
    for name, spent in one.items():
        print(f"  {name:<28} {1e6 * spent:9.0f} us   {spent / base:7.2f} times bristle")
    theta = bristle_fit(v, torque)[0]
    found = curve_fit(model, v, torque, p0=START)[0]
    print(f"  largest difference to curve_fit, relative: {np.abs(theta[[0, 2, 1, 3]] / found - 1).max():.1e}")

    def loop() -> Array:
        return np.array([curve_fit(model, v, t, p0=START)[0] for t in torques.T])

    problem = from_points(v, torque, ("both",))
    batch = least({"batch": lambda: Batch(problem, torques, default_range(v), COARSE)}, 50)["batch"]
    one_by_one = least({"loop": loop}, 3)["loop"]
    together = Batch(problem, torques, default_range(v), COARSE).theta
    apart = loop().T
    print("(b) 1000 sets of 200 points at shared velocities")
    print(f"  bristle, batch               {1e3 * batch:9.2f} ms")
    print(f"  a loop of curve_fit          {1e3 * one_by_one:9.2f} ms   {one_by_one / batch:7.0f} times bristle")
    worst = np.abs(together[[0, 2, 1, 3]] - apart).max(axis=1) / apart.std(axis=1)
    print(f"  largest difference, in standard deviations over the sets: {worst.max():.1e}")
    profiles(v, torques, lmfit_model, guess)
    bootstraps(v, torque)


def profiles(v: Array, torques: Array, model: lmfit.Model, guess: lmfit.Parameters) -> None:
    """Profile intervals of every set, beside lmfit's of a few."""
    problem, v_s_range = from_points(v, torques[:, 0], ("both",)), default_range(v)
    order = ("a0", "a2", "a1", "v_s")

    def ours() -> Array:
        sets = [problem.with_torque(torque) for torque in torques.T]
        return np.array([list(profiled(x, solve(x, v_s_range)).intervals.values()) for x in sets]).transpose(1, 0, 2)

    def theirs(k: int) -> Array:
        fitted = model.fit(torques[:, k], guess, v=v)
        found = lmfit.conf_interval(fitted, fitted, sigmas=[0.95], p_names=list(order))
        return np.array([[found[name][0][1], found[name][-1][1]] for name in order])

    some = range(5)
    spent, loop = least({"ours": ours}, 3)["ours"], least({"loop": lambda: [theirs(k) for k in some]}, 3)["loop"]
    one_by_one = loop / len(some) * torques.shape[1]
    ends, reference = ours()[:, list(some)], np.stack([theirs(k) for k in some], axis=1)
    apart = np.abs((ends - reference) / np.ptp(reference, axis=-1)[..., None]).max()
    print("(c) 1000 sets of 200 points, a profile interval for each parameter")
    print(f"  bristle                      {1e3 * spent:9.2f} ms")
    print(
        f"  lmfit's fit, conf_interval   {1e3 * one_by_one:9.0f} ms   {one_by_one / spent:7.0f} times bristle (timed on {len(some)} sets)"
    )
    print(f"  largest distance between their ends, in widths: {apart:.1e}")


def bootstraps(v: Array, torque: Array, resamples: int = 10_000) -> None:
    """Bootstrap of one set, beside a loop of curve_fit over some resamples."""
    problem, v_s_range = from_points(v, torque, ("both",)), default_range(v)
    solution = solve(problem, v_s_range)
    rng = np.random.default_rng(0)
    drawn = (torque - solution.residuals)[:, None] + solution.residuals[rng.integers(0, v.size, (v.size, 200))]
    spent = least({"ours": lambda: resample(problem, solution, v_s_range, resamples)}, 3)["ours"]
    loop = least({"loop": lambda: [curve_fit(model, v, t, p0=START)[0] for t in drawn.T]}, 3)["loop"]
    loop *= resamples / drawn.shape[1]
    print(f"(d) a bootstrap-t of one set of 200 points, {resamples} resamples")
    print(f"  bristle                      {1e3 * spent:9.0f} ms")
    print(
        f"  a loop of curve_fit          {1e3 * loop:9.0f} ms   {loop / spent:7.0f} times bristle (timed on {drawn.shape[1]} resamples)"
    )


if __name__ == "__main__":
    main()
