"""How fast all six LuGre parameters are fitted to moving data, beside what a user would pick instead, in one run, at equal accuracy.

    python benchmarks/tracking.py            seconds, ratios, costs and differences; uses numba and a C compiler where there are any;
                                             with one BLAS thread, then the fast ones with as many as BLAS takes
    python benchmarks/tracking.py memory     peak resident memory of bristle's fit of 1e6 and 1e7 samples, each in a process of its own

The data are the gripper's torque along a sum of sines at 1 kHz, with noise. Every fit begins 30 % off in every parameter and finds seven
numbers, scaled as bristle scales them: the parameters, and the deflection z0 at the first sample. All but solve_ivp take the same
exact-exponential step, with a node at each zero of the velocity, and so have the same minimum. The cost is bristle's at what a fit found; a
fit has succeeded where it is within 1e-6 of the lowest. Building and compiling are not counted. bristle does as it does for a user: of 1e5 samples
it begins with every eighth.
"""

import ctypes
import importlib
import math
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import casadi as ca
import lmfit
import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from bristle.arrays import Array
from bristle.data.record import Record
from bristle.estimation.covariance import covariance
from bristle.estimation.nonlinear import LeastSquares, minimise
from bristle.identification.dynamic import descent
from bristle.identification.dynamic import problem as trajectory
from bristle.model import functions, law
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout
from bristle.model.time_refinement import Nodes, with_extra_nodes
from bristle.simulation.edro import TABLE_1
from timing import Call, least, once

TRUTH = TABLE_1["gripper rotation"].positive
OFF = Lugre(1.3, 0.7, 1.3, 1.3, 0.7, 1.3)
H, NOISE, EQUAL = 1e-3, 2e-4, 1e-6
LINES = ((0.1, 1.0), (0.05, 3.7), (0.02, 9.0))
"""Amplitude, rad/s, and frequency, Hz."""
MANY, SOME, FEW = 100_000, 10_000, 2_000
"""Samples: of the fast fits, of IPOPT, of solve_ivp."""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
FADED = 1e-150
"""Added to what z0 has left, so that no method is slowed by denormal numbers."""

Fit = Callable[[], Array]
Evaluate = Callable[[Array], tuple[Array, Array]]


class Case(NamedTuple):
    """The data, n samples, and the start of every fit."""

    problem: trajectory.DynamicProblem
    start: dict[trajectory.Unknown, float]
    posed: LeastSquares[trajectory.Unknown]

    @property
    def velocity(self) -> Array:
        """rad/s, (n,)."""
        return self.problem.motions[0].velocity

    @property
    def torque(self) -> Array:
        """N*m, (n,)."""
        return self.problem.motions[0].torque

    @property
    def x0(self) -> Array:
        """The scaled start, (7,)."""
        return self.posed.unknowns.scaled(self.start)

    def physical(self, x: Array) -> Array:
        """The six parameters and z0 at scaled unknowns, (7,)."""
        return self.posed.unknowns.natural(x)

    def slopes(self, x: Array) -> Array:
        """The derivative of each of `physical` by its scaled unknown, (7,)."""
        return self.posed.unknowns.slopes(x)

    def steps(self) -> tuple[Array, Array, Array, Any]:
        """v0, v1 and h of one step to each node, the first of no duration, (N,); and which nodes are the samples."""
        nodes = with_extra_nodes(Nodes(self.velocity, H, slice(0, self.velocity.size)), math.inf)
        v0, h = np.append(nodes.v[0], nodes.v[:-1]), np.append(0.0, np.broadcast_to(nodes.h, nodes.v.size - 1))
        return v0, nodes.v, h, nodes.samples

    def gauss_newton(self, evaluate: Evaluate) -> Array:
        """What bristle's own descent finds with another's residuals and Jacobian."""
        return minimise(evaluate, self.x0, self.posed.unknowns.lower, self.posed.unknowns.upper).x


def case(n: int) -> Case:
    """The data of n samples."""
    t: Array = H * np.arange(n, dtype=np.float64)
    v = sum((size * np.sin(2 * np.pi * f * t) for size, f in LINES), np.zeros(n))
    torque = rollout(v, H, TRUTH, 0.0).torque + NOISE * np.random.default_rng(0).standard_normal(n)
    record = Record(file="benchmark", time=t, velocity=v, torque=torque)
    problem = trajectory.dynamic_problem([record], ("both",), (), 1, None)
    friction = (off * p for off, p in zip(OFF, TRUTH, strict=True))
    start = dict(zip(problem.friction_names, friction, strict=True)) | {trajectory.InitialState("z0", 0): 0.0}
    return Case(problem, start, descent.least_squares(problem, start))


def bristle(data: Case) -> Array:
    """The fit that all others are compared with."""
    return descent.fit(data.problem, data.start)[1].x


def package(name: str) -> ModuleType | None:
    """A package if it is there, looked for outside this folder, whose coverage.py numba would take for the package of that name."""
    path = sys.path.copy()
    sys.path[:] = [p for p in path if Path(p).resolve() != Path(__file__).resolve().parent]
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
    finally:
        sys.path[:] = path


def advance(z: float, v0: float, v1: float, h: float, g0: float, gm: float, g1: float, sigma_0: float) -> float:
    """The step of `law.bristle_step`, as a user of numba would write it; g at the beginning, the middle and the end is known."""
    speed0, speed1 = abs(v0), abs(v1)
    x = h * (sigma_0 / 6) * (speed0 / g0 + 2 * (speed0 + speed1) / gm + speed1 / g1) + 1e-100
    forgotten = -math.expm1(-x)
    a, phi = 1 - forgotten, forgotten / x
    return a * z + math.copysign(1 / sigma_0, v0 + v1) * ((1 - phi) * g1 + (phi - a) * g0)


def simulator(numba: ModuleType) -> Callable[..., Array]:
    """The torque along a velocity, compiled by numba: a loop over the samples that keeps g from one step to the next."""
    step = numba.njit(advance)

    def simulate(
        v: Array, h: float, a0: float, a1: float, a2: float, v_s: float, s0: float, s1: float, z: float
    ) -> Array:
        T = np.empty(v.size)
        v0, g0 = v[0], a0 + a1 * math.exp(-((v[0] / v_s) ** 2))
        T[0] = s0 * z + s1 * (v0 - s0 * abs(v0) / g0 * z) + a2 * v0
        for k in range(1, v.size):
            v1 = v[k]
            g1 = a0 + a1 * math.exp(-((v1 / v_s) ** 2))
            if v0 * v1 < 0:
                part = h * v0 / (v0 - v1)
                z = step(z, v0, 0.0, part, g0, a0 + a1 * math.exp(-((v0 / 2 / v_s) ** 2)), a0 + a1, s0)
                z = step(z, 0.0, v1, h - part, a0 + a1, a0 + a1 * math.exp(-((v1 / 2 / v_s) ** 2)), g1, s0)
            else:
                z = step(z, v0, v1, h, g0, a0 + a1 * math.exp(-(((v0 + v1) / 2 / v_s) ** 2)), g1, s0)
            T[k] = s0 * z + s1 * (v1 - s0 * abs(v1) / g1 * z) + a2 * v1
            v0, g0 = v1, g1
        return T

    compiled: Callable[..., Array] = numba.njit(simulate)
    return compiled


def numba_fits(data: Case) -> dict[str, Fit]:
    """SciPy's least_squares with finite differences over the compiled simulator; none where numba is not installed."""
    numba = package("numba")
    if numba is None:
        print("numba is not installed: without its rows")
        return {}
    simulate = simulator(numba)

    def residuals(x: Array) -> Array:
        return data.torque - simulate(data.velocity, H, *data.physical(x))

    def fit(method: Any) -> Array:
        x: Array = least_squares(residuals, data.x0, method=method).x
        return x

    return {f"numba, least_squares {method}": partial(fit, method) for method in ("trf", "lm")}


def augmented() -> ca.Function:
    """(state, v0, v1, h, p) -> (state, T, T by p and z0); the state is z with its derivatives by what enters it and by z0."""
    z, v0, v1, h = (ca.SX.sym(name) for name in ("z", "v0", "v1", "h"))
    p = Lugre(*(ca.SX.sym(name) for name in Lugre._fields))
    names = functions.step_parameters()
    by = ca.SX.sym("by", 1, len(names) + 1)
    where = ca.DM(len(names) + 1, 7)
    for row, column in enumerate([*map(Lugre._fields.index, names), 6]):
        where[row, column] = 1
    a, b = law.bristle_step(v0, v1, h, p)
    z1 = a * z + b
    by1 = ca.horzcat(ca.jacobian(z1, ca.vertcat(*(getattr(p, name) for name in names))), FADED) + a * by
    T = law.torque(z, v1, p)
    T_by = ca.horzcat(ca.jacobian(T, ca.vertcat(*p)), 0) + ca.jacobian(T, z) * (by @ where)
    state, state1 = ca.horzcat(z, by), ca.horzcat(z1, by1)
    outputs = [state1, *(ca.densify(ca.substitute(out, state, state1)) for out in (T, T_by.T))]
    return ca.Function("augmented", [state, v0, v1, h, ca.vertcat(*p)], ca.cse(outputs))


def mapaccum_evaluate(data: Case) -> Evaluate:
    """Residuals and Jacobian by CasADi's mapaccum of the augmented step."""
    step = augmented()
    *steps, samples = data.steps()
    along, rolled, empty = [ca.DM(x).T for x in steps], step.mapaccum(steps[0].size), [0.0] * (step.numel_in(0) - 2)

    def evaluate(x: Array) -> tuple[Array, Array]:
        q = data.physical(x)
        state = ca.DM([[q[6], *empty, 1.0]])
        _, T, T_by = rolled(state, *along, ca.repmat(ca.DM(q[:6]), 1, steps[0].size))
        return data.torque - T.full()[0, samples], -T_by.full().T[samples] * data.slopes(x)

    return evaluate


C_LOOP = """
#define CASADI_SYMBOL_EXPORT static
#include "generated.c"
void roll(const double *v0, const double *v1, const double *h, const long *row, long n, const double *p, double *state, double *T, double *by) {
  casadi_real w[WORK]; double next[WIDTH];
  const double *in[5] = {state, 0, 0, 0, p};
  double *out[3] = {next, 0, 0};
  for (long k = 0; k < n; ++k) {
    in[1] = v0 + k; in[2] = v1 + k; in[3] = h + k;
    out[1] = T + row[k]; out[2] = by + 7 * row[k];
    augmented(in, out, 0, w, 0);
    for (int i = 0; i < WIDTH; ++i) state[i] = next[i];
  }
}
"""


def c_evaluate(data: Case, folder: Path) -> Evaluate | None:
    """The same by the C that CasADi writes for that step, looped and compiled at -O3; None where there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        print("there is no C compiler: without its row")
        return None
    step = augmented()
    width, n = step.numel_in(0), data.torque.size
    generator = ca.CodeGenerator("generated.c", {"with_header": False})
    generator.add(step)
    generator.generate(f"{folder}/")
    (folder / "roll.c").write_text(C_LOOP.replace("WORK", str(step.sz_w())).replace("WIDTH", str(width)))
    library = folder / "roll.so"
    subprocess.run([compiler, "-O3", "-shared", "-fPIC", "-o", library, folder / "roll.c", "-lm"], check=True)  # noqa: S603 - our own C
    roll = ctypes.CDLL(str(library)).roll
    double, long = (np.ctypeslib.ndpointer(kind, flags="C") for kind in (np.float64, ctypes.c_long))
    roll.argtypes = [double, double, double, long, ctypes.c_long, double, double, double, double]
    v0, v1, h, samples = data.steps()
    row = np.full(v1.size, n, dtype=ctypes.c_long)  # what no sample is goes to one row more
    row[samples] = np.arange(n)

    def evaluate(x: Array) -> tuple[Array, Array]:
        q, state, T, T_by = data.physical(x), np.zeros(width), np.empty(n + 1), np.empty((n + 1, 7))
        state[0], state[-1] = q[6], 1.0
        roll(v0, v1, h, row, v1.size, q, state, T, T_by)
        T_by *= -data.slopes(x)
        return data.torque - T[:n], T_by[:n]

    return evaluate


def ipopt_fits(data: Case) -> dict[str, Fit]:
    """IPOPT on the whole trajectory by single shooting through mapaccum of the step; the cost is 1 at the start."""
    *steps, samples = data.steps()
    n = steps[0].size
    z, v0, v1, h = (ca.SX.sym(name) for name in ("z", "v0", "v1", "h"))
    p = Lugre(*(ca.SX.sym(name) for name in Lugre._fields))
    a, b = law.bristle_step(v0, v1, h, p)
    z1 = a * z + b
    step = ca.Function("step", [z, v0, v1, h, ca.vertcat(*p)], ca.cse([z1, law.torque(z1, v1, p)]))
    x = ca.MX.sym("x", 7)
    logarithmic = [name.name in ("alpha_0", "v_s", "sigma_0") for name in data.problem.names]
    q = ca.vertcat(
        *(ca.exp(x[k]) if is_log else x[k] * data.posed.unknowns.scale[k] for k, is_log in enumerate(logarithmic))
    )
    T = step.mapaccum(n)(q[6], *(ca.DM(row).T for row in steps), ca.repmat(q[:6], 1, n))[1]
    cost = ca.sumsqr(ca.DM(data.torque) - T[np.arange(n)[samples].tolist()].T)
    nlp: Any = {"x": x, "f": cost / ca.Function("cost", [x], [cost])(data.x0)}
    lower, upper = data.posed.unknowns.lower, data.posed.unknowns.upper

    def solve(solver: ca.Function) -> Array:
        found: Array = solver(x0=data.x0, lbx=lower, ubx=upper)["x"].full().ravel()
        return found

    quiet: dict[str, Any] = {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}
    hessians: dict[str, dict[str, Any]] = {
        "limited-memory": {"ipopt.hessian_approximation": "limited-memory"},
        "exact Hessian": {},
    }
    return {
        f"IPOPT, {name}": partial(solve, ca.nlpsol("solver", "ipopt", nlp, quiet | options))
        for name, options in hessians.items()
    }


def radau(data: Case, q: Array, rtol: float = 1e-6) -> Array:
    """The torque by SciPy's Radau along the velocity between its samples; no step is longer than one, or it errs by jumps as q changes."""
    a0, a1, a2, v_s, s0, s1, z0 = q.tolist()
    v, change = data.velocity.tolist(), np.append(np.diff(data.velocity), 0.0).tolist()

    def decay(u: float) -> float:
        return float(s0 * abs(u) / (a0 + a1 * math.exp(-((u / v_s) ** 2))))

    def at(t: float) -> float:
        k = min(int(t / H), len(v) - 1)
        return float(v[k] + change[k] * (t / H - k))

    def rate(t: float, z: Array) -> Array:
        u = at(t)
        return u - decay(u) * z

    t = H * np.arange(len(v))
    tight = {"rtol": rtol, "atol": rtol * a0 / s0, "max_step": H, "jac": lambda t, _: [[-decay(at(t))]]}
    z = solve_ivp(rate, (0.0, t[-1]), [z0], "Radau", t_eval=t, **tight).y[0]
    u = data.velocity
    T: Array = s0 * z + s1 * (u - s0 * np.abs(u) / (a0 + a1 * np.exp(-((u / v_s) ** 2))) * z) + a2 * u
    return T


def lmfit_fit(data: Case) -> Array:
    """The fit by lmfit over SciPy's Radau; differences of 1e-4 of each unknown: in smaller ones the solver's own error drowns the derivatives."""
    start = lmfit.Parameters()
    start.add_many(*((f"x{k}", value) for k, value in enumerate(data.x0)))

    def residuals(p: Any) -> Array:
        return data.torque - radau(data, data.physical(np.array([p[name].value for name in p])))

    found = lmfit.minimize(residuals, start, epsfcn=1e-8, max_nfev=150)
    return np.array([found.params[name].value for name in found.params])


def keep(found: dict[str, Array], name: str, fit: Fit) -> None:
    """Run a fit and keep what it found."""
    found[name] = fit()


def table(data: Case, fits: dict[str, Fit], slow: dict[str, Fit], repeats: int) -> None:
    """Time the fits, bristle's among them and the slow ones once, and print a line for each."""
    best = descent.fit(data.problem, data.start)[1]
    error = np.sqrt(covariance(best.jacobian, best.cost)[0].diagonal())
    found: dict[str, Array] = {}
    every: dict[str, Fit] = {"bristle": partial(bristle, data), **fits, **slow}
    calls: dict[str, Call] = {name: partial(keep, found, name, fit) for name, fit in every.items()}
    times = least({name: call for name, call in calls.items() if name not in slow}, repeats)
    times |= {name: once(calls[name]) for name in slow}
    evaluate = data.posed.evaluate
    costs = {name: float(np.sum(evaluate(x)[0] ** 2)) for name, x in found.items()}
    print(
        f"\n{data.torque.size} samples{'':16}    seconds   times bristle's   cost above bristle's   largest difference, s.e."
    )
    for name, x in found.items():
        above, apart = costs[name] / costs["bristle"] - 1, np.abs((x - found["bristle"]) / error).max()
        missed = "" if costs[name] <= (1 + EQUAL) * min(costs.values()) else "   no success: not the lowest cost"
        ratio = times[name] / times["bristle"]
        print(f"  {name:28} {times[name]:9.4f} {ratio:17.2f} {above:22.1e} {apart:26.1e}{missed}", flush=True)


def fast() -> None:
    """Print what fits within seconds."""
    for n, repeats in ((MANY, 7), (SOME, 40)):
        data = case(n)
        with tempfile.TemporaryDirectory() as folder:
            in_c = c_evaluate(data, Path(folder))
            evaluates = {"mapaccum of augmented step": mapaccum_evaluate(data)}
            evaluates |= {} if in_c is None else {"C of augmented step, -O3": in_c}
            descents: dict[str, Fit] = {name: partial(data.gauss_newton, e) for name, e in evaluates.items()}
            table(data, numba_fits(data) | descents, {}, repeats)


def slow() -> None:
    """Print what fits fewer samples in seconds; beside bristle's fit of as many."""
    some, few = case(SOME), case(FEW)
    table(some, {}, ipopt_fits(some), 15)
    table(few, {}, {"lmfit, solve_ivp Radau 1e-6": partial(lmfit_fit, few)}, 15)


def peak() -> float:
    """Largest resident memory of this process so far, bytes."""
    import resource

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(most if sys.platform == "darwin" else 1024 * most)


def memory_of(n: int) -> None:
    """Print the peaks of one size."""
    bristle(case(1000))
    before = peak()
    data = case(n)
    peaks = {"data": peak()}
    trajectory.residuals(data.problem, data.start)
    peaks["residuals and Jacobian"] = peak()
    bristle(data)
    peaks["fit"] = peak()
    print(f"{n} samples; {before / 1e9:.2f} GB before")
    for name, most in peaks.items():
        print(f"  {name:24} {most / 1e9:6.2f} GB at most, {(most - before) / n:5.0f} bytes per sample", flush=True)


def child(*arguments: str, **environment: str) -> None:
    """Run this script in a process of its own."""
    subprocess.run([sys.executable, __file__, *arguments], env={**os.environ, **environment}, check=True)  # noqa: S603 - itself


def main(arguments: list[str]) -> None:
    """Do what the arguments say; all but `memory` is for the processes that this one starts."""
    match arguments:
        case ["memory"]:
            for n in (1_000_000, 10_000_000):
                child("memory", str(n))
        case ["memory", n]:
            memory_of(int(n))
        case ["fast"]:
            fast()
        case ["slow"]:
            slow()
        case _:
            print("one BLAS thread", flush=True)
            child("fast", **ONE_THREAD)
            child("slow", **ONE_THREAD)
            print("\nas many BLAS threads as it takes", flush=True)
            child("fast")


if __name__ == "__main__":
    main(sys.argv[1:])
