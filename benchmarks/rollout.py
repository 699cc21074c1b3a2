"""Timings and errors of `bristle.model.rollout` beside what a user would pick instead, in one run.

    python benchmarks/rollout.py             ratios for 1e5 and 1e6 samples, and errors against a tight reference
    python benchmarks/rollout.py accuracy    largest relative torque error at 1 kHz over sigma_0, slow and fast trace

Each time is the least of several, taken in turns, so that what else the machine does falls on all alike. The reference is SciPy's Radau at
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
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from bristle.model import functions, law
from bristle.model.arrays import Array, evaluate
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout, rollout_jacobian

GRIPPER = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)
H = 1e-3
Call = Callable[[], object]


def slow(n: int) -> Array:
    """0.1 rad/s at 1 Hz, sampled at 1 kHz."""
    return 0.1 * np.sin(2 * np.pi * H * np.arange(n))


def fast(n: int) -> Array:
    """0.5 rad/s at 1.3 Hz plus 0.2 at 3.7 Hz, sampled at 1 kHz."""
    t = H * np.arange(n)
    return 0.5 * np.sin(2 * np.pi * 1.3 * t) + 0.2 * np.sin(2 * np.pi * 3.7 * t)


def rates(
    v: Callable[[float], float], p: Lugre[float], sigma_0: Array
) -> tuple[Callable[[float, Array], Array], Callable[[float, Array], Array]]:
    """dz/dt and its Jacobian, for several stiffnesses at once."""

    def decay(u: float) -> Array:
        return sigma_0 * abs(u) / (p.alpha_0 + p.alpha_1 * np.exp(-((u / p.v_s) ** 2)))

    return (lambda t, z: v(t) - decay(v(t)) * z), (lambda t, _: np.diag(-decay(v(t))))


def reference(velocity: Array, p: Lugre[float], sigma_0: Array) -> Array:
    """Deflection from rest, (n, len(sigma_0))."""
    z = np.zeros((velocity.size, sigma_0.size))
    for k, (v0, v1) in enumerate(zip(velocity[:-1], velocity[1:], strict=True)):
        rate, jacobian = rates(lambda t, v0=v0, v1=v1: v0 + (v1 - v0) / H * t, p, sigma_0)
        stops = [0.0, H * v0 / (v0 - v1), H] if v0 * v1 < 0 else [0.0, H]
        y = z[k]
        for span in zip(stops[:-1], stops[1:], strict=True):
            y = solve_ivp(rate, span, y, method="Radau", rtol=1e-10, atol=1e-10 * p.alpha_0 / sigma_0, jac=jacobian).y[
                :, -1
            ]
        z[k + 1] = y
    return z


def torque(z: Array, velocity: Array, p: Lugre[float] = GRIPPER) -> Array:
    """T_f at given deflections."""
    return evaluate(functions.torque(), z, velocity, *p)[0]


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
    rolled, rolled_augmented = step.mapaccum(n), augmented.mapaccum(n)
    q = ca.MX.sym("q", 6)
    curve = rolled(0, v0, v1, ca.repmat(q, 1, n))[1].T
    calls: dict[str, Call] = {
        "value": lambda: rolled(0, v0, v1, values),
        "augmented": lambda: rolled_augmented(ca.DM.zeros(1, 7), v0, v1, values),
    }
    if velocity.size <= 100_000:
        jacobian = ca.Function("jacobian", [q], [ca.jacobian(curve, q)])
        calls["jacobian"] = lambda: jacobian(ca.DM(list(GRIPPER)))
    return calls


C_LOOP = """
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
    generator.add(functions.step())
    generator.add(functions.torque())
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


def least(calls: dict[str, Call], repeats: int) -> dict[str, float]:
    """The least time of each call, s; the calls take turns."""
    times = dict.fromkeys(calls, np.inf)
    for _ in range(repeats):
        for name, call in calls.items():
            start = time.perf_counter()
            call()
            times[name] = min(times[name], time.perf_counter() - start)
    return times


def adaptive(velocity: Array, method: str, **options: float) -> tuple[Array, bool, float]:
    """Torque by a variable-step solver that takes the whole record at once, whether it says success, and seconds."""
    t = H * np.arange(velocity.size)
    rate, _ = rates(lambda s: float(np.interp(s, t, velocity)), GRIPPER, np.array([GRIPPER.sigma_0]))
    start = time.perf_counter()
    solution = solve_ivp(rate, (0, t[-1]), [0.0], method=method, t_eval=t, **options)
    return torque(solution.y[0], velocity), bool(solution.success), time.perf_counter() - start


def timings() -> None:
    """Print times per sample and ratios."""
    with tempfile.TemporaryDirectory() as folder:
        in_c = compiled(Path(folder))
        for n, repeats in ((100_000, 7), (1_000_000, 5)):
            v = slow(n)
            casadi = mapaccum(v)
            calls: dict[str, Call] = {
                "bristle": lambda v=v: rollout(v, H, GRIPPER, 0.0),
                "bristle Jacobian": lambda v=v: rollout_jacobian(v, H, GRIPPER, 0.0),
                "mapaccum": casadi["value"],
                "mapaccum, augmented step": casadi["augmented"],
            }
            if in_c is not None:
                calls["C -O3"] = lambda v=v: in_c(v)
            if "jacobian" in casadi:
                calls["ca.jacobian of mapaccum"] = casadi["jacobian"]
            times = least(calls, repeats)
            print(f"\n{n} samples{'':22} ns/sample   times bristle's")
            for name, seconds in times.items():
                ours = times["bristle Jacobian" if "acobian" in name or "augmented" in name else "bristle"]
                print(f"  {name:30} {seconds / n * 1e9:9.1f}   {seconds / ours:9.2f}")
        solvers(in_c, times["bristle"] / n)


def solvers(in_c: Callable[[Array], Array] | None, ours: float) -> None:
    """Print errors on one record, and the time of SciPy's solvers; `ours` is bristle's time per sample, s."""
    n = 2001
    v = slow(n)
    expected = torque(reference(v, GRIPPER, np.array([GRIPPER.sigma_0]))[:, 0], v)
    print(f"\n{n} samples{'':24} error   ns/sample   times bristle's")
    print(f"  {'bristle':30} {relative(rollout(v, H, GRIPPER, 0.0).torque, expected):9.1e}")
    print(f"  {'mapaccum':30} {relative(np.r_[0.0, np.array(mapaccum(v)['value']()[1]).ravel()], expected):9.1e}")
    if in_c is not None:
        print(f"  {'C -O3':30} {relative(in_c(v), expected):9.1e}")
    scale = GRIPPER.alpha_0 / GRIPPER.sigma_0
    for name, method, options in (
        ("Radau, rtol 1e-6", "Radau", {"rtol": 1e-6, "atol": 1e-6 * scale}),
        ("LSODA, defaults", "LSODA", {}),
    ):
        got, success, seconds = adaptive(v, method, **options)
        each = seconds / n
        print(f"  {name:30} {relative(got, expected):9.1e} {each * 1e9:11.0f}   {each / ours:9.0f}   success={success}")


def accuracy() -> None:
    """Print the largest torque error at 1 kHz over one second, relative to the largest torque, over sigma_0."""
    sigma_0 = np.array([1.0, GRIPPER.sigma_0, 1e2, 1e3, 1e4, 1e5, 1e6])
    print("sigma_0, N*m/rad  " + "".join(f"{s:>10.4g}" for s in sigma_0))
    for trace in (slow, fast):
        v = trace(1001)
        z = reference(v, GRIPPER, sigma_0)
        sets = [GRIPPER._replace(sigma_0=float(s)) for s in sigma_0]
        errors = [relative(rollout(v, H, p, 0.0).torque, torque(z[:, k], v, p)) for k, p in enumerate(sets)]
        print(f"{trace.__name__:18}" + "".join(f"{error:10.1e}" for error in errors))


if __name__ == "__main__":
    accuracy() if sys.argv[1:] == ["accuracy"] else timings()
