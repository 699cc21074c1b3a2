"""Timings and errors of `bristle.model.rollout` beside what a user would pick instead, in one run.

    python benchmarks/rollout.py             ratios for 1e5 and 1e6 samples, and errors against a tight reference
    python benchmarks/rollout.py accuracy    largest relative torque error at 1 kHz over sigma_0, slow and fast trace

The reference is SciPy's Radau at
rtol 1e-10 on the same piecewise-linear velocity, restarted at each sample and at each zero crossing. The C is CasADi's own code for the same
step, looped over the samples without any extra node, compiled with -O3.
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.model import functions, law
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout, rollout_jacobian
from bristle.model.vectorize import evaluate
from timing import Call, least

GRIPPER = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)
H = 1e-3


def slow(n: int) -> Array:
    """0.1 rad/s at 1 Hz, sampled at 1 kHz."""
    v: Array = 0.1 * np.sin(2 * np.pi * H * np.arange(n))
    return v


def fast(n: int) -> Array:
    """0.5 rad/s at 1.3 Hz plus 0.2 at 3.7 Hz, sampled at 1 kHz."""
    t = H * np.arange(n)
    v: Array = 0.5 * np.sin(2 * np.pi * 1.3 * t) + 0.2 * np.sin(2 * np.pi * 3.7 * t)
    return v


def solve(v: Callable[[float], float], span: tuple[float, float], z0: Array, sigma_0: Array, **options: Any) -> Any:
    """SciPy's solution of the gripper's dz/dt (4) along v(t), for several stiffnesses at once."""
    p = GRIPPER

    def decay(u: float) -> Any:
        return sigma_0 * abs(u) / (p.alpha_0 + p.alpha_1 * np.exp(-((u / p.v_s) ** 2)))

    if options["method"] == "Radau":
        options["jac"] = lambda t, _: np.diag(-decay(v(t)))
    return solve_ivp(lambda t, z: v(t) - decay(v(t)) * z, span, z0, **options)


def reference(velocity: Array, sigma_0: Array) -> Array:
    """Deflection from rest, (n, len(sigma_0))."""
    z = np.zeros((velocity.size, sigma_0.size))
    tight = {"method": "Radau", "rtol": 1e-10, "atol": 1e-10 * GRIPPER.alpha_0 / sigma_0}
    for k, (v0, v1) in enumerate(pairwise(velocity)):
        stops = [0.0, H * v0 / (v0 - v1), H] if v0 * v1 < 0 else [0.0, H]
        y = z[k]
        for span in pairwise(stops):
            y = solve(partial(line, v0, (v1 - v0) / H), span, y, sigma_0, **tight).y[:, -1]
        z[k + 1] = y
    return z


def line(v0: float, slope: float, t: float) -> float:
    """A velocity that is linear in time."""
    return v0 + slope * t


def torque(z: Array, velocity: Array, p: Lugre[float] = GRIPPER) -> Array:
    """T_f at given deflections."""
    return evaluate(functions.torque_function(), z, velocity, *p)[0]


def relative(got: Array, expected: Array) -> float:
    """Largest error relative to the largest value."""
    return float(np.abs(got - expected).max() / np.abs(expected).max())


def mapaccum(velocity: Array) -> dict[str, Call]:
    """CasADi's `mapaccum` of the same step: the value, `ca.jacobian` of it, and a step augmented with the sensitivities."""
    n = velocity.size - 1
    s = {name: ca.SX.sym(name) for name in ("z", "v0", "v1")}
    p = Lugre(*(ca.SX.sym(name) for name in Lugre._fields))
    z_by = ca.SX.sym("z_by", 1, 6)
    vector = ca.vertcat(*p)
    a, b = law.bristle_step(s["v0"], s["v1"], H, p)
    z1 = a * s["z"] + b
    friction = law.torque(s["z"], s["v1"], p)
    out = ca.substitute(friction, s["z"], z1)
    step = ca.Function("step", [*s.values(), vector], ca.cse([z1, out]))
    z1_by = ca.jacobian(z1, vector) + a * z_by
    out_by = ca.substitute(
        ca.jacobian(friction, vector) + ca.jacobian(friction, s["z"]) * z_by,
        ca.horzcat(s["z"], z_by),
        ca.horzcat(z1, z1_by),
    )
    state = ca.horzcat(s["z"], z_by)
    augmented = ca.Function(
        "augmented", [state, s["v0"], s["v1"], vector], ca.cse([ca.horzcat(z1, z1_by), out, ca.densify(out_by)])
    )
    v0, v1, values = ca.DM(velocity[:-1]).T, ca.DM(velocity[1:]).T, ca.repmat(ca.DM(list(GRIPPER)), 1, n)
    rolled = step.mapaccum(n)
    calls: dict[str, Call] = {
        "mapaccum": partial(rolled, 0, v0, v1, values),
        "augmented step, mapaccum": partial(augmented.mapaccum(n), ca.DM.zeros(1, 7), v0, v1, values),
    }
    if n <= 10_000:  # built within seconds
        q = ca.MX.sym("q", 6)
        curve = rolled(0, v0, v1, ca.repmat(q, 1, n))[1].T
        by_q = {"ca.jacobian": ca.jacobian(curve, q), "ca.jtimes, 6 seeds": ca.jtimes(curve, q, ca.DM.eye(6))}
        calls |= {
            f"{name} of mapaccum": partial(ca.Function("by_q", [q], [J]), list(GRIPPER)) for name, J in by_q.items()
        }
    return calls


C_LOOP = """
#define CASADI_SYMBOL_EXPORT static
#include "generated.c"
void roll(const double *v, long n, double h, const double *p, double z, double *T) {
  casadi_real w[256]; double a, b;
  const double *step_in[9] = {0, 0, &h, p, p + 1, p + 2, p + 3, p + 4, p + 5};
  const double *torque_in[8] = {&z, 0, p, p + 1, p + 2, p + 3, p + 4, p + 5};
  double *step_out[2] = {&a, &b}, *torque_out[1];
  for (long k = 0; k < n; ++k) {
    torque_in[1] = v + k; torque_out[0] = T + k;
    torque(torque_in, torque_out, 0, w, 0);
    if (k == n - 1) break;
    step_in[0] = v + k; step_in[1] = v + k + 1;
    step(step_in, step_out, 0, w, 0);
    z = a * z + b;
  }
}
"""


def compiled(folder: Path) -> Callable[[Array], Array] | None:
    """The same scheme in scalar C at -O3, or None where there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    generator = ca.CodeGenerator("generated.c", {"with_header": False})
    generator.add(functions.step_function())
    generator.add(functions.torque_function())
    generator.generate(f"{folder}/")
    (folder / "roll.c").write_text(C_LOOP)
    library = folder / "roll.so"
    subprocess.run([compiler, "-O3", "-shared", "-fPIC", "-o", library, folder / "roll.c", "-lm"], check=True)  # noqa: S603 - our own C
    roll = ctypes.CDLL(str(library)).roll
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    roll.argtypes = [pointer, ctypes.c_long, ctypes.c_double, pointer, ctypes.c_double, pointer]

    def call(velocity: Array) -> Array:
        T = np.empty(velocity.size)
        roll(velocity, velocity.size, H, np.array(GRIPPER), 0.0, T)
        return T

    return call


def timings() -> None:
    """Print times per sample, ratios, and errors."""
    with tempfile.TemporaryDirectory() as folder:
        in_c = compiled(Path(folder))
        for n, repeats in ((10_001, 15), (100_000, 15), (1_000_000, 7)):
            v = slow(n)
            calls: dict[str, Call] = {
                "bristle": partial(rollout, v, H, GRIPPER, 0.0),
                "bristle, Jacobian": partial(rollout_jacobian, v, H, GRIPPER, 0.0),
                **({} if in_c is None else {"C -O3": partial(in_c, v)}),
                **mapaccum(v),
            }
            times = least(calls, repeats)
            print(f"\n{n} samples{'':22} ns/sample   times bristle's", flush=True)
            for name, seconds in times.items():
                ours = times["bristle" if name in ("bristle", "mapaccum", "C -O3") else "bristle, Jacobian"]
                print(f"  {name:30} {seconds / n * 1e9:9.1f}   {seconds / ours:9.2f}", flush=True)
        errors(in_c, times["bristle"] / n)


def errors(in_c: Callable[[Array], Array] | None, ours: float) -> None:
    """Print errors on one record, and the time of SciPy's solvers, which take it at once; `ours` is bristle's time per sample, s."""
    n = 2001
    v, t, stiffness = slow(n), H * np.arange(n), np.array([GRIPPER.sigma_0, 1e5])
    for sigma_0, z in zip(stiffness, reference(v, stiffness).T, strict=True):
        p = GRIPPER._replace(sigma_0=float(sigma_0))
        expected = torque(z, v, p)
        print(f"\n{n} samples, sigma_0 = {sigma_0:<8.6g}{'':5} error   ns/sample   times bristle's")
        print(f"  {'bristle':30} {relative(rollout(v, H, p, 0.0).torque, expected):9.1e}")
        if p == GRIPPER:
            print(f"  {'mapaccum':30} {relative(np.array(mapaccum(v)['mapaccum']()[1]).ravel(), expected[1:]):9.1e}")
        if p == GRIPPER and in_c is not None:
            print(f"  {'C -O3':30} {relative(in_c(v), expected):9.1e}")
        solvers: dict[str, dict[str, Any]] = {
            "Radau, rtol 1e-6": {"method": "Radau", "rtol": 1e-6, "atol": 1e-6 * p.alpha_0 / p.sigma_0},
            "LSODA, defaults": {"method": "LSODA"},
        }
        for name, options in solvers.items():
            start = time.perf_counter()
            got = solve(
                lambda s: float(np.interp(s, t, v)), (0.0, t[-1]), np.zeros(1), np.array([sigma_0]), t_eval=t, **options
            )
            each = (time.perf_counter() - start) / n
            error = relative(torque(got.y[0], v, p), expected)
            print(f"  {name:30} {error:9.1e} {each * 1e9:11.0f}   {each / ours:9.0f}   success={got.success}")


def accuracy() -> None:
    """Print the largest torque error at 1 kHz over one second, relative to the largest torque, over sigma_0."""
    sigma_0 = np.array([1.0, GRIPPER.sigma_0, 1e2, 1e3, 1e4, 1e5, 1e6])
    print("sigma_0, N*m/rad  " + "".join(f"{s:>10.4g}" for s in sigma_0))
    for trace in (slow, fast):
        v = trace(1001)
        z = reference(v, sigma_0)
        sets = [GRIPPER._replace(sigma_0=float(s)) for s in sigma_0]
        errors = [relative(rollout(v, H, p, 0.0).torque, torque(z[:, k], v, p)) for k, p in enumerate(sets)]
        print(f"{trace.__name__:18}" + "".join(f"{error:10.1e}" for error in errors))


if __name__ == "__main__":
    accuracy() if sys.argv[1:] == ["accuracy"] else timings()
