"""Runs an FMU in fmpy, beside the same joint in Python and beside the continuous equations by SciPy's Radau."""

import importlib
import math
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.control.plant import plant_rates
from bristle.errors import one_line
from bristle.model import motor
from bristle.model.functions import cogging_function
from bristle.model.parameters import Motor
from bristle.model.vectorize import bound
from bristle.page.output_folder import zipped
from bristle.questions.export.c_step import printed_joint
from bristle.questions.export.export import Artefact, Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import rms_percent
from export_checks.common import NotInstalled

STEP, SECONDS = 1e-3, 10.0
"""Communication step and length of what is simulated, s."""
OUTPUTS = ("position", "velocity", "z", "friction")
_RTOL, _ATOL = 1e-7, 1e-10
"""Of Radau; the second of 1 rad/s and 1 rad. Its own error is then below 1e-5 % (benchmarks/export_fmu.py)."""


class Played(NamedTuple):
    """A joint at the end of each communication step, (n,) each: rad, rad/s, rad, N*m."""

    position: Array
    velocity: Array
    deflection: Array
    friction: Array


def drive_torque(joint: ExportedJoint, time: Array) -> Array:
    """A sum of sines, N*m, (n,): half of breakaway at first, one and a half times that after 3.5 s; presliding, then sliding with reversals."""
    return _drive_torque(_breakaway(joint), time)


def _breakaway(joint: ExportedJoint) -> float:
    """Of both directions on average, N*m."""
    return float(np.mean([p.alpha_0 + p.alpha_1 for p in joint.pair]))


def _drive_torque(breakaway: float, time: Array) -> Array:
    level = breakaway * (1 + np.tanh(2 * (time - 3.5)) / 2)
    w = 2 * np.pi * time
    return np.asarray(level * (0.85 * np.sin(0.7 * w) + 0.15 * np.sin(3.1 * w)), dtype=np.float64)


def communication_points() -> Array:
    """Where each communication step begins, s, (n,)."""
    return np.asarray(STEP * np.arange(round(SECONDS / STEP)), dtype=np.float64)


def internal_steps(step: float, longest: float) -> int:
    """Into how many a communication step is cut, both s."""
    return max(1, math.ceil(step / longest * (1 - 1e-12)))


def python_joint(joint: ExportedJoint, torque: Array, step: float, longest: float) -> Played:
    """The joint by the function that is printed as C, each torque held over a step that is cut into equal ones no longer than `longest`, s."""
    n = internal_steps(step, longest)
    x, T, function = ca.SX.sym("x", 4), ca.SX.sym("T"), printed_joint(joint.law).function
    pair = ca.vertcat(*joint.pair.positive, *joint.pair.negative)
    rest: list[Any] = [joint.inertia, T, step / n]
    rest[1] -= cogging_function(joint.cogging)(x[0])
    one = ca.Function("one", [x, T], [function(pair, x[:3], ca.vertcat(*rest))])
    rows = one.mapaccum(torque.size * n)(np.zeros(4), np.repeat(torque, n)[None, :]).full()[:, n - 1 :: n]
    return Played(*rows)


_Rates = Callable[[float, Array], Array]
"""(time, (v, z, q)) -> as `solve_ivp` takes it."""


def continuous_joint(
    joint: ExportedJoint, torque: Callable[[float], float], load: Callable[[Any], Any] = lambda _: 0.0
) -> tuple[_Rates, _Rates]:
    """d(v, z, q)/dt of the continuous equations under a torque of time, (3,), and its derivatives by (v, z, q), (3, 3).

    `load` is a torque that the velocity makes, N*m, as an expression of CasADi.
    """
    x, T = ca.SX.sym("x", 3), ca.SX.sym("T")
    motor_of = Motor(1.0, 1.0, 0.0, joint.inertia)
    beside = load(x[0]) - cogging_function(joint.cogging)(x[2])
    rates = ca.vertcat(plant_rates(x[0], x[1], T, beside, joint.pair, motor_of, motor.current_for), x[0])
    f, df = (ca.Function("f", [x, T], [ca.densify(y)]) for y in (rates, ca.jacobian(rates, x)))

    def evaluated(function: Any) -> _Rates:
        """It as a function of time; called some ten thousand times, without a copy of its inputs."""
        state, now, rows = np.empty(3), np.empty(1), np.empty(function.size_out(0)[::-1])
        evaluate = bound(function, [state, now], [rows])

        def at(t: float, x: Array) -> Array:
            """Its value."""
            state[:], now[0] = x, torque(t)
            evaluate()
            return rows.T.squeeze().copy()

        return at

    return evaluated(f), evaluated(df)


def radau_held(joint: ExportedJoint, torque: Array, step: float) -> Array:
    """Velocity at the end of each step, rad/s, (n,), each torque held over its step."""
    from scipy.integrate import solve_ivp

    now = {"torque": 0.0}
    rates, slopes = continuous_joint(joint, lambda _: now["torque"])
    x, found = np.zeros(3), np.empty(torque.size)
    for k, now["torque"] in enumerate(torque.tolist()):
        solved = solve_ivp(rates, (0, step), x, "Radau", jac=slopes, rtol=_RTOL, atol=_ATOL, first_step=step)
        x = np.asarray(solved.y[:, -1])
        found[k] = x[0]
    return found


def radau_continuous(
    joint: ExportedJoint,
    torque: Callable[[float], float],
    times: Array,
    load: Callable[[Any], Any] = lambda _: 0.0,
    tolerances: tuple[float, float] = (_RTOL, _ATOL),
) -> Array:
    """Velocity at given times, rad/s, (n,), from rest at time 0, under a torque that is a continuous function of time, and a load.

    `tolerances` are Radau's, the second of 1 rad/s and 1 rad.
    """
    from scipy.integrate import solve_ivp

    (rates, slopes), (rtol, atol) = continuous_joint(joint, torque, load), tolerances
    solved = solve_ivp(
        rates, (0, times[-1]), np.zeros(3), "Radau", times, jac=slopes, rtol=rtol, atol=atol, max_step=10 * STEP
    )
    return np.asarray(solved.y[0])


def of_largest(found: Played, true: Played) -> float:
    """The largest difference in position and velocity, each over its largest value."""
    pairs = ((found.position, true.position), (found.velocity, true.velocity))
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)


@cache
def installed_fmpy() -> Any:
    """The module, with those of its parts that are used. Raises NotInstalled where there is none."""
    try:
        fmpy = importlib.import_module("fmpy")
        for part in ("fmi2", "validation"):
            importlib.import_module(f"fmpy.{part}")
    except ImportError as missing:
        raise NotInstalled("fmpy is not installed; install bristle[fmu]") from missing
    return fmpy


class LoadedFmu:
    """An FMU that is unpacked in a folder, and whose binary is loaded for each instance."""

    def __init__(self, folder: Path) -> None:
        self._fmpy, self._folder = installed_fmpy(), folder
        self.description = self._fmpy.read_model_description(str(folder), validate=False)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}

    def instance(self, name: str = "joint", callbacks: Any = None) -> Any:
        """A new slave of fmpy, instantiated."""
        slave = self._fmpy.fmi2.FMU2Slave(
            instanceName=name, guid=self.description.guid, unzipDirectory=str(self._folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
        )  # fmt: skip  # a list of options
        slave.instantiate(callbacks=callbacks)
        return slave

    def start(self, name: str) -> float:
        """The start value of a parameter."""
        return next(float(v.start) for v in self.description.modelVariables if v.name == name)

    def begin(self, slave: Any, **start: float) -> Any:
        """The slave, ready to step, with some start values; dots in names are written as two underlines."""
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        for name, value in start.items():
            slave.setReal([self.references[name.replace("__", ".")]], [value])
        slave.exitInitializationMode()
        return slave

    def play(self, torque: Array, step: float = STEP, slave: Any = None, **start: float) -> Played:
        """Each torque held over a communication step, by a new slave or a given one, which is freed."""
        slave = self.begin(slave or self.instance(), **start)
        into, out = [self.references["torque"]], [self.references[name] for name in OUTPUTS]
        rows = np.empty((torque.size, len(out)))
        for k, T in enumerate(torque.tolist()):
            slave.setReal(into, [T])
            slave.doStep(k * step, step)
            rows[k] = slave.getReal(out)
        slave.terminate()
        slave.freeInstance()
        return Played(*rows.T)


@contextmanager
def loaded_fmu(content: bytes) -> Iterator[LoadedFmu]:
    """An FMU as fmpy loads it. Raises NotInstalled where fmpy is missing."""
    installed_fmpy()
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        with zipfile.ZipFile(BytesIO(content)) as archive:
            archive.extractall(folder)
        yield LoadedFmu(Path(folder))


def fmu_problems(content: bytes) -> list[str]:
    """What fmpy's validation says of it; nothing where it is sound."""
    fmpy = installed_fmpy()
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        path = Path(folder) / "joint.fmu"
        path.write_bytes(content)
        return [str(x) for x in fmpy.validation.validate_fmu(str(path))]


def source_only(content: bytes) -> bytes:
    """The same FMU without its binaries."""
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return zipped({name: archive.read(name) for name in archive.namelist() if not name.startswith("binaries/")})


def built_by_fmpy(content: bytes) -> bytes:
    """The FMU with a binary for this machine that `fmpy compile` made. Raises NotInstalled where that finds no CMake or compiler."""
    installed_fmpy()
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        path = Path(folder) / "joint.fmu"
        path.write_bytes(content)
        command = [sys.executable, "-m", "fmpy", "compile", path.name]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603  # our own words
        if done.returncode:
            raise NotInstalled(
                f"fmpy builds no binary: {one_line(done.stderr, 200)}; install cmake, make and a C compiler"
            )
        return path.read_bytes()


def check_fmu(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:  # noqa: ARG001  # as targets are
    """Validation, 10 s beside Python and beside Radau, and the same of the sources built by fmpy. Raises NotInstalled without fmpy."""
    (joint,) = joints
    problems = fmu_problems(artefact.content)
    lines = [f"fmpy validation: {'; '.join(problems) if problems else 'no problem'}"]
    built: bytes | None = None
    try:
        built = built_by_fmpy(source_only(artefact.content))
    except NotInstalled as missing:
        lines.append(f"sources: not built: {missing}")
    runs = artefact.content if _has_binary(artefact.content) else built
    if runs is not None:
        lines += compared(joint, runs, None if runs is built else built)
    return tuple(lines)


def _has_binary(content: bytes) -> bool:
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return any(name.startswith(f"binaries/{installed_fmpy().platform}/") for name in archive.namelist())


def compared(joint: ExportedJoint, runs: bytes, built: bytes | None = None) -> Iterator[str]:
    """An FMU that runs here, beside Python and Radau over 10 s, and beside it the one that was built of its sources."""
    time = communication_points()
    middle = drive_torque(joint, time + STEP / 2)
    with loaded_fmu(runs) as fmu:
        found, longest = fmu.play(middle), fmu.start("longest_step")
    off = of_largest(found, python_joint(joint, middle, STEP, longest))
    yield (
        f"{SECONDS:g} s at {1000 * STEP:g} ms, presliding, reversals and sliding: {off:.1e} of the largest position and velocity off Python, "
        f"{internal_steps(STEP, longest)} internal steps"
    )
    breakaway = _breakaway(joint)  # found once: the solver asks for the torque some ten thousand times
    true = radau_continuous(joint, lambda t: float(_drive_torque(breakaway, np.asarray(t))), time + STEP)
    yield (
        f"velocity RMS error against SciPy's Radau: {rms_percent(found.velocity, true):.1e} %, the FMU with the torque of the middle of each step"
    )
    if built is not None:
        with loaded_fmu(built) as fmu:
            off = of_largest(fmu.play(middle), found)
        yield f"sources, built by fmpy: {off:.1e} of the largest position and velocity off the binary"
