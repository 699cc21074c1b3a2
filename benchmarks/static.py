"""How fast the static fit is, beside what a user would pick instead: `python benchmarks/static.py`.

(a) one set of 200 points, parameters and covariance, against scipy.optimize.curve_fit and lmfit, both from a start within 30 % of the answer;
(b) 1000 sets at shared velocities against a loop of curve_fit. Everything is timed in this one run; the ratios are what counts.
"""

import lmfit
import numpy as np
from scipy.optimize import curve_fit

from bristle.edro import TABLE_1
from bristle.identification.batch import solve_batch
from bristle.identification.regression import from_points
from bristle.identification.static import default_range, plain_grid, solve
from bristle.identification.uncertainty import covariance
from bristle.model.arrays import Array
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

    batch = least({"batch": lambda: solve_batch(v, torques, default_range(v))}, 50)["batch"]
    one_by_one = least({"loop": loop}, 3)["loop"]
    together, _ = solve_batch(v, torques, default_range(v))
    apart = loop().T
    print("(b) 1000 sets of 200 points at shared velocities")
    print(f"  bristle, batch               {1e3 * batch:9.2f} ms")
    print(f"  a loop of curve_fit          {1e3 * one_by_one:9.2f} ms   {one_by_one / batch:7.0f} times bristle")
    worst = np.abs(together[[0, 2, 1, 3]] - apart).max(axis=1) / apart.std(axis=1)
    print(f"  largest difference, in standard deviations over the sets: {worst.max():.1e}")


if __name__ == "__main__":
    main()
