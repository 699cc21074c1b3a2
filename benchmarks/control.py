"""How fast the adaptive compensation runs, beside what a user would write instead, in one run.

    python benchmarks/control.py             all three parts, some four minutes; the row in C needs a C compiler

(a) One `step` of the adaptive LuGre compensator in Python, as a loop in real time calls it: each call is timed, the clock's own time in it, along
the positions of a closed loop. The NumPy class is what a user would write first; the class in plain Python takes bristle's own two steps.

(b) One adaptive closed loop, 20 s at 1 kHz, by `simulate` and with SciPy's solvers between the samples, the same controller and compensator
in plain Python at each. The error is the largest distance of the positions from Radau at tight tolerances. Each solver has the loosest tolerance of
a scan whose error is not above bristle's, over the first 2 s and then over all. The atol is rtol of 1 rad, 1 rad/s and alpha_0 / sigma_0. With
sigma_0 = 1e4 all else is Table 1's. The C is CasADi's own code for bristle's control period, looped over the samples at -O3. All of this is one
thread.

(c) 1000 cases in one call of `simulate`, which takes two threads; beside single calls, of one thread.

Building and compiling are not counted, but printed. What is fast is the least wall time of several calls, in turns. SciPy's runs take seconds and
run once; theirs is processor time, which what else the machine does lengthens least. (c) is wall time, with the cores that were had beside it.
"""

import ctypes
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import fmean
from time import perf_counter, perf_counter_ns, process_time
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

import datasets_path  # noqa: F401
import simulated_edro
from bristle.arrays import Array
from bristle.control import compensator as compensating
from bristle.control.adaptation import Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Measurement, Reference
from bristle.control.control_period import (
    Case,
    Disturbance,
    Given,
    LoopOptions,
    at_rest,
    control_period,
    flat,
    numbers_of,
)
from bristle.model.parameters import Pair
from bristle.simulation import edro
from timing import least, once

H, SECONDS, SCANNED = 1e-3, 20.0, 2.0
ADAPTIVE = Compensator(adaptation=Adaptation())
JOINT = "gripper rotation"
CALLS, SLOW_CALLS = 100_000, 2_000
"""Of a step: compiled or written by hand, and uncompiled."""
TOLERANCES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SOLVERS = ("Radau", "BDF", "LSODA")
BATCH, BATCH_SECONDS, ALONE = 1000, 5.0, 20
"""Cases in one call, their length, s, and how many of them are run alone."""

Step = Callable[[float, float, float], float]
"""(reference, its velocity, measured position) -> torque."""


def sine(amplitude: float, frequency: float, seconds: float) -> Reference:
    """Amplitude sin(2 pi f t), rad."""
    t, w = H * np.arange(round(seconds / H)), 2 * np.pi * frequency
    return Reference(amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w * w * np.sin(w * t))


def cut(course: Reference, where: Any) -> Reference:
    """A part of the reference."""
    return Reference(course.position[where], course.velocity[where], course.acceleration[where])


def joint(name: str = JOINT, sigma_0: float | None = None) -> Case:
    """A joint of Table 1, its J and the paper's PID, whose compensator starts at 0.3 alpha_0 and 0.5 alpha_2, as in Table 2."""
    plant = Pair(*(p if sigma_0 is None else p._replace(sigma_0=sigma_0) for p in edro.TABLE_1[name]))
    model = Pair(*(p._replace(alpha_0=0.3 * p.alpha_0, alpha_2=0.5 * p.alpha_2) for p in plant))
    return Case(plant=plant, motor=simulated_edro.motor(name), model=model, gains=edro.PID_GAINS)


class InNumpy:
    """The adaptive compensator as a user would write it with NumPy: the exponential of a frozen rate, the gains an array."""

    def __init__(self, model: Pair[float]) -> None:
        self.model = model
        self.gamma = np.array([20.0, 20.0])
        self.theta = np.ones(2)
        self.z = 0.0

    def step(self, y_ref: float, v: float, y: float) -> float:
        """The torque at a sample, N*m."""
        a0, a1, a2, v_s, s0, s1 = self.model.positive if v >= 0 else self.model.negative
        g = self.theta[0] * a0 + a1 * np.exp(-((v / v_s) ** 2))
        z_ss = g * np.sign(v) / s0
        self.z = z_ss + (self.z - z_ss) * np.exp(-H * s0 * np.abs(v) / g)
        dz = v - s0 * np.abs(v) / g * self.z
        T = s0 * self.z + s1 * dz + self.theta[1] * a2 * v
        G = np.array([s0 * s1 * np.abs(v) * self.z / g**2, v])
        self.theta = np.clip(self.theta - H * self.gamma * G * (y - y_ref), 0.05, 5.0)
        return float(T)


class InPython:
    """The same in plain Python, with bristle's own two steps, so that it gives what bristle gives."""

    def __init__(self, model: Pair[float]) -> None:
        self.model = model
        self.gains = (1.0, 1.0)
        self.z = self.v = 0.0

    def advance(self, z: float, v0: float, v1: float, h: float) -> float:
        """The exact-exponential step of z while v goes from v0 to v1."""
        a0, a1, _, v_s, s0, _ = self.model[v0 + v1 < 0]
        s0, a0 = self.model[z < 0].sigma_0, self.gains[0] * a0
        g0, g1 = a0 + a1 * math.exp(-((v0 / v_s) ** 2)), a0 + a1 * math.exp(-((v1 / v_s) ** 2))
        gm = a0 + a1 * math.exp(-(((v0 + v1) / (2 * v_s)) ** 2))
        x = h * s0 / 6 * (abs(v0) / g0 + 2 * (abs(v0) + abs(v1)) / gm + abs(v1) / g1) + 1e-100
        forgotten = -math.expm1(-x)
        a, phi = 1 - forgotten, forgotten / x
        z = a * z + math.copysign(1 / s0, v0 + v1) * ((1 - phi) * g1 + (phi - a) * g0)
        return z * (1 + forgotten * (s0 / self.model[z < 0].sigma_0 - 1))

    def step(self, y_ref: float, v: float, y: float) -> float:
        """The torque at a sample, N*m."""
        v0, share = self.v, 0.5
        middle = (v0 + v) / 2
        if v0 * v < 0:
            share, middle = abs(v0) / (abs(v0) + abs(v)), 0.0
        z = self.advance(self.advance(self.z, v0, middle, share * H), middle, v, (1 - share) * H)
        a0, a1, a2, v_s, _, s1 = self.model[v < 0]
        s0, (theta_1, theta_2) = self.model[z < 0].sigma_0, self.gains
        g = theta_1 * a0 + a1 * math.exp(-((v / v_s) ** 2))
        T = s0 * z + s1 * (v - s0 * abs(v) / g * z) + theta_2 * a2 * v
        pull = 20.0 * H * (y - y_ref)
        theta_1 = min(max(theta_1 - pull * s0 * s1 * abs(v) * z / g**2, 0.05), 5.0)
        self.gains = theta_1, min(max(theta_2 - pull * v, 0.05), 5.0)
        self.z, self.v = z, v
        return T


def stepper(step: Callable[..., Any], model: Pair[float]) -> Step:
    """A step of bristle's as a loop in real time takes it, with its state kept and its arguments made at each sample."""
    state = compensating.initial_state(ADAPTIVE, model)

    def call(y_ref: float, v: float, y: float) -> float:
        nonlocal state
        state, T = step(state, Reference(y_ref, v, 0.0), Measurement(y, v), H)
        return float(T)

    return call


def timed(begin: Callable[[], Step], run: list[tuple[float, float, float]], calls: int) -> tuple[Array, Array]:
    """The time of each call, us, over turns of a run from its beginning; and the torques of the last turn."""
    times: list[int] = []
    torques: list[float] = []
    while len(times) < calls:
        step, torques = begin(), []
        for sample in run[: calls - len(times)]:
            start = perf_counter_ns()
            T = step(*sample)
            times.append(perf_counter_ns() - start)
            torques.append(T)
    return np.array(times) / 1e3, np.array(torques)


def one_step() -> None:
    """Print part (a)."""
    case, course = joint(), sine(1.0, 0.5, SECONDS)
    positions = simulate(LoopOptions(compensator=ADAPTIVE), [case], course, H).position[0]
    run = list(zip(course.position.tolist(), course.velocity.tolist(), positions.tolist(), strict=True))
    build = once(lambda: compensating.compiled(ADAPTIVE))
    begins: dict[str, tuple[Callable[[], Step], int]] = {
        "bristle, compiled": (lambda: stepper(compensating.compiled(ADAPTIVE), case.model), CALLS),
        "bristle, not compiled": (lambda: stepper(partial(compensating.step, ADAPTIVE), case.model), SLOW_CALLS),
        "plain Python, math": (lambda: InPython(case.model).step, CALLS),
        "NumPy, as a user would": (lambda: InNumpy(case.model).step, CALLS),
    }
    print(f"(a) a step of the adaptive compensator, {CALLS} calls ({SLOW_CALLS} where not compiled);")
    print(f"    {JOINT}, 1 rad at 0.5 Hz; built in {build:.3f} s; one thread\n")
    print(f"{'microseconds':24} {'median':>9} {'99 %':>9} {'largest':>9} {'x bristle':>10} {'torque off':>11}")
    ours, expected = 0.0, np.zeros(0)
    for name, (begin, calls) in begins.items():
        times, torques = timed(begin, run, calls)
        median, most, largest = np.median(times), np.quantile(times, 0.99), times.max()
        if not ours:
            ours, expected = float(median), torques
        n = min(torques.size, expected.size)
        off = np.abs(torques[:n] - expected[:n]).max() / np.abs(expected).max()
        print(f"{name:24} {median:9.2f} {most:9.2f} {largest:9.0f} {median / ours:10.2f} {off:11.1e}", flush=True)
    verdict("under 100 us at the median", ours < 100, f"{ours:.1f} us")


def verdict(asked: str, holds: object, found: str) -> None:
    """Print whether a limit that this benchmark sets holds."""
    print(f"asked: {asked}: {'holds' if holds else 'DOES NOT HOLD'}, {found}", flush=True)


def between(case: Case) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """The plant's rates of (y, v, z) under a torque that is held, and their Jacobian, as a user would write them: floats, no arrays."""
    (positive, negative), J = case.plant, case.motor.J

    def rates(_: float, x: Array, T: float) -> tuple[float, float, float]:
        _, v, z = x.tolist()
        a0, a1, a2, v_s, _, s1 = positive if v >= 0 else negative
        s0 = positive.sigma_0 if z >= 0 else negative.sigma_0
        dz = v - s0 * abs(v) / (a0 + a1 * math.exp(-((v / v_s) ** 2))) * z
        return v, (T - s0 * z - s1 * dz - a2 * v) / J, dz

    def jacobian(_: float, x: Array, __: float) -> list[list[float]]:
        _, v, z = x.tolist()
        a0, a1, a2, v_s, _, s1 = positive if v >= 0 else negative
        s0 = positive.sigma_0 if z >= 0 else negative.sigma_0
        peak = a1 * math.exp(-((v / v_s) ** 2))
        g, decay = a0 + peak, s0 * abs(v) / (a0 + peak)
        by_v = 1 - z * s0 * (math.copysign(1.0, v) + 2 * abs(v) * v / v_s**2 * peak / g) / g
        return [[0.0, 1.0, 0.0], [0.0, -(s1 * by_v + a2) / J, -(s0 - s1 * decay) / J], [0.0, by_v, -decay]]

    return rates, jacobian


def sampled(case: Case, course: Reference, method: Any, rtol: float, *, jac: bool = False) -> Array:
    """The positions of the sampled loop, PID and compensator in plain Python at each sample and SciPy's solver from one to the next, (n,)."""
    rates, jacobian = between(case)
    options: dict[str, Any] = {"method": method, "rtol": rtol}
    options["atol"] = rtol * np.array([1.0, 1.0, case.plant.positive.alpha_0 / case.plant.positive.sigma_0])
    options |= {"jac": jacobian} if jac else {}
    compensator, (K_p, K_i, K_d, _) = InPython(case.model), case.gains
    x, integral, last, positions = np.zeros(3), 0.0, 0.0, []
    for y_ref, v_ref in zip(course.position.tolist(), course.velocity.tolist(), strict=True):
        y = float(x[0])
        positions.append(y)
        e = y_ref - y
        integral += H * K_i * e
        T = K_p * e + integral + K_d * (e - last) / H + compensator.step(y_ref, v_ref, y)
        last = e
        x = solve_ivp(rates, (0.0, H), x, args=(T,), **options).y[:, -1]
    return np.array(positions)


def off(positions: Array, tight: Array) -> float:
    """The largest distance from the reference, as far as the positions go, rad."""
    return float(np.abs(positions - tight[: positions.size]).max())


C_LOOP = """
#define CASADI_SYMBOL_EXPORT static
#include "generated.c"
void roll(const double *u, const double *q, long n, double *memory, double *log) {
  casadi_real w[WORK], next[WIDTH];
  const double *in[3] = {memory, 0, q};
  double *out[2] = {next, 0};
  for (long k = 0; k < n; ++k) {
    in[1] = u + INPUTS * k; out[1] = log + ROWS * k;
    control_period(in, out, 0, w, 0);
    for (int i = 0; i < WIDTH; ++i) memory[i] = next[i];
  }
}
"""


def compiled(options: LoopOptions, folder: Path) -> Callable[[Case, Reference], Array] | None:
    """The positions of the loop by the C that CasADi writes for bristle's control period; None where there is no compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    step = control_period(options)
    generator = ca.CodeGenerator("generated.c", {"with_header": False})
    generator.add(step)
    generator.generate(f"{folder}/")
    rows = step.numel_out(1)
    sizes = {"WORK": step.sz_w(), "WIDTH": step.numel_in(0), "INPUTS": step.numel_in(1), "ROWS": rows}
    code = C_LOOP
    for name, size in sizes.items():
        code = code.replace(name, str(size))
    (folder / "roll.c").write_text(code)
    library = folder / "roll.so"
    subprocess.run([compiler, "-O3", "-shared", "-fPIC", "-o", library, folder / "roll.c", "-lm"], check=True)  # noqa: S603 - our own C
    roll = ctypes.CDLL(str(library)).roll
    pointer = np.ctypeslib.ndpointer(np.float64, flags="C")
    roll.argtypes = [pointer, pointer, ctypes.c_long, pointer, pointer]

    def call(case: Case, course: Reference) -> Array:
        n = course.position.size
        u = np.ascontiguousarray(np.stack(np.broadcast_arrays(*flat(Given(course, Disturbance())))).T)
        memory, log = np.array(flat(at_rest(options, float(course.position[0])))), np.empty((n, rows))
        roll(u, np.array(flat(numbers_of(case, H))), n, memory, log)
        positions: Array = log[:, 0]
        return positions

    return call


class Row(NamedTuple):
    """A line of part (b)."""

    seconds: float
    error: float
    """rad."""


def shown(name: str, row: Row, radau: float) -> None:
    """Print it."""
    faster, real = radau / row.seconds, SECONDS / row.seconds
    print(f"{name:32} {row.seconds:9.4f} {real:12.1f} {faster:9.1f} {row.error:10.1e}", flush=True)


def tolerances(case: Case, course: Reference, tight: Array, ours: float) -> dict[str, float]:
    """Print the scan, and give the loosest tolerance of each solver whose error is not above bristle's, or else the tightest."""
    n = round(SCANNED / H)
    short = cut(course, slice(n))
    print(f"{f'rad off in {SCANNED:g} s, by rtol':24}" + "".join(f"{rtol:9.0e}" for rtol in TOLERANCES))
    print(f"{'bristle':24}{ours:9.1e}")
    chosen = {}
    for solver in SOLVERS:
        errors = [off(sampled(case, short, solver, rtol), tight) for rtol in TOLERANCES]
        good = [rtol for rtol, error in zip(TOLERANCES, errors, strict=True) if error <= ours]
        chosen[solver] = max(good, default=min(TOLERANCES))
        print(f"{solver:24}" + "".join(f"{error:9.1e}" for error in errors), flush=True)
    return chosen


def through_scipy(case: Case, course: Reference, tight: Array, ours: float, chosen: dict[str, float]) -> dict[str, Row]:
    """All 20 s of each solver, once; where that errs more than bristle after all, at the next tolerance."""
    rows = {}
    for solver, jac in (("Radau", False), ("Radau", True), ("BDF", False), ("LSODA", False)):
        for rtol in (rtol for rtol in TOLERANCES if rtol <= chosen[solver]):
            start = process_time()
            positions = sampled(case, course, solver, rtol, jac=jac)
            row = Row(process_time() - start, off(positions, tight))
            if row.error <= ours:
                break
        rows[f"{solver}{', its Jacobian given' if jac else ''}, {rtol:.0e}"] = row
    return rows


def positions_of(options: LoopOptions, case: Case, course: Reference) -> Array:
    """By bristle, (n,)."""
    found: Array = simulate(options, [case], course, H).position[0]
    return found


def by_bristle(case: Case, course: Reference, tight: Array, options: LoopOptions) -> dict[str, Row]:
    """What bristle takes by itself and in C, in turns."""
    calls: dict[str, Callable[[], Array]] = {"bristle": partial(positions_of, options, case, course)}
    with tempfile.TemporaryDirectory() as folder:
        start = perf_counter()
        in_c = compiled(options, Path(folder))
        built = perf_counter() - start
        if in_c is not None:
            calls["its C"] = partial(in_c, case, course)
        times = least(calls, 15)
    print("    C: no compiler\n" if in_c is None else f"    C: compiled in {built:.2f} s\n")
    return {name: Row(times[name], off(call(), tight)) for name, call in calls.items()}


def closed_loop(sigma_0: float | None) -> None:
    """Print part (b) for one stiffness; None: Table 1's."""
    case, course, plain = joint(sigma_0=sigma_0), sine(1.0, 0.5, SECONDS), LoopOptions(compensator=ADAPTIVE)
    stiffness = " and ".join(f"{p.sigma_0:g}" for p in case.plant) if sigma_0 is None else f"{sigma_0:g}"
    print(f"\n(b) {JOINT}, sigma_0 = {stiffness}: {SECONDS:g} s at 1 kHz, one thread")
    tight = sampled(case, course, "Radau", 1e-10, jac=True)
    ours = positions_of(plain, case, course)
    chosen = tolerances(case, course, tight, off(ours[: round(SCANNED / H)], tight))
    slow = through_scipy(case, course, tight, off(ours, tight), chosen)
    fast = by_bristle(case, course, tight, plain)
    radau = min(row.seconds for name, row in slow.items() if name.startswith("Radau"))
    print(f"{f'all {SECONDS:g} s':32} {'seconds':>9} {'x real time':>12} {'x Radau':>9} {'rad off':>10}")
    for name, row in (fast | slow).items():
        shown(name, row, radau)
    judge(fast, radau)


def judge(fast: dict[str, Row], radau: float) -> None:
    """Print whether the ratios that this benchmark sets hold."""
    real = SECONDS / next(iter(fast.values())).seconds
    verdict("100 times faster than real time", real >= 100, f"{real:.0f}")
    for asked, begins in ((10, "bristle"), (100, "its C")):
        ratios = [radau / row.seconds for name, row in fast.items() if name.startswith(begins)]
        if ratios:
            found = " and ".join(f"{ratio:.0f}" for ratio in ratios)
            verdict(f"{begins} {asked} times faster than the faster Radau", min(ratios) >= asked, found)


def scenarios(rng: np.random.Generator) -> tuple[list[Case], Reference]:
    """The joints of Table 1 in turn, each with a sine of its own: 0.1 to 1 rad, 0.1 to 1 Hz."""
    names = list(edro.TABLE_1)
    cases = [joint(names[k % len(names)]) for k in range(BATCH)]
    sines = [sine(amplitude, frequency, BATCH_SECONDS) for amplitude, frequency in rng.uniform(0.1, 1.0, (BATCH, 2))]
    y, v, a = (np.stack(parts) for parts in zip(*(s[:3] for s in sines), strict=True))
    return cases, Reference(y, v, a)


def batch() -> None:
    """Print part (c)."""
    cases, course = scenarios(np.random.default_rng(0))
    n = course.position.shape[-1]

    def run(which: slice, samples: int = n) -> Array:
        part = cut(course, (which, slice(samples)))
        return simulate(LoopOptions(compensator=ADAPTIVE), cases[which], part, H).position

    first, second = (once(partial(run, slice(BATCH), 1000)) for _ in range(2))  # 1000 samples are what is built
    print(f"\n(c) {BATCH} cases of {BATCH_SECONDS:g} s at 1 kHz, joints of Table 1, in one call, two threads;")
    print(f"    built: a first call of 1 s took {first:.2f} s, a second {second:.2f} s\n")
    wall, cpu = perf_counter(), process_time()
    together = run(slice(BATCH))
    wall, cpu = perf_counter() - wall, process_time() - cpu
    some = range(0, BATCH, BATCH // ALONE + 1)  # all four joints
    times, apart = [], 0.0
    for k in some:
        start = perf_counter()
        positions = run(slice(k, k + 1))[0]
        times.append(perf_counter() - start)
        apart = max(apart, off(positions, together[k]))
    alone = fmean(times)
    print(f"one call, {cpu / wall:.2f} cores had        {wall:8.2f} s {1e3 * wall / BATCH:8.2f} ms a case")
    print(f"{BATCH} calls, from {len(some)} of them    {alone * BATCH:8.2f} s {1e3 * alone:8.2f} ms a case")
    real = BATCH * BATCH_SECONDS / wall
    print(f"one call is {alone * BATCH / wall:.2f} times as fast, {real:.0f} times real time; {apart:.1e} rad apart")


def main() -> None:
    """Print all parts."""
    run = partial(positions_of, LoopOptions(compensator=ADAPTIVE), joint(), sine(1.0, 0.5, SECONDS))
    first, second = once(run), once(run)
    print(f"built: a first run of the closed loop took {first:.3f} s, a second {second:.3f} s\n")
    one_step()
    for sigma_0 in (None, 1e4):
        closed_loop(sigma_0)
    batch()


if __name__ == "__main__":
    main()
