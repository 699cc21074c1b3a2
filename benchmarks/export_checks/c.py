"""Compiles the printed C with the compiler of this machine, and runs it beside the compensator in Python."""

import ctypes
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.control.compensator import Compensator
from bristle.errors import InputError
from bristle.questions.export.c_header import numbers_of, python_torque, top_speed
from bristle.questions.export.c_numbers import identifier
from bristle.questions.export.c_step import printed_step
from bristle.questions.export.export import Artefact, Request, c_compiler
from bristle.questions.export.exported import ExportedJoint
from export_checks.common import NotInstalled, told_by

FLAGS = (
    "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wfloat-equal", "-Werror", "-std=c99", "-O2",
)  # fmt: skip  # a list of values
_STEPS, _PERIOD = 10_000, 1e-3
_SEED = 0
_DOUBLE, _SINGLE = 1e-12, 5e-6
"""How far a torque may be off, over the largest."""
_DRIVER = """
#define BRISTLE_SELF_TEST
#include "joint.h"
int run(int n, const br_real *inputs, br_real *torque);
int run(int n, const br_real *inputs, br_real *torque)
{
    const br_params p = NAME;
    br_state s;
    int k, worst = br_init(&p, &s);
    for (k = 0; k < n; k++) {
        br_input in;
ASSIGN
        const int status = br_step(&p, &s, &in, &torque[k]);
        worst = status > worst ? status : worst;
    }
    return worst;
}
int self_test(void);
int self_test(void) { return NAME_self_test(); }
"""


def check_header(artefact: Artefact, joints: Sequence[ExportedJoint], request: Request) -> tuple[str, ...]:
    """The printed C beside Python, over 10 s at 1 kHz, in double and in single precision. Raises NotInstalled without a C compiler."""
    (joint,) = joints
    lines = []
    inputs = motion(joint)
    adaptive_observer = request.compensator.name == "lugre-observer" and request.compensator.adaptation is not None
    torque = python_torque(joint, request.compensator, inputs)
    for name, real in (("double", np.float64), ("single", np.float32))[: 1 if adaptive_observer else 2]:
        with compiled(artefact.content.decode("ascii"), joint, request.compensator, real) as code:
            found = code(inputs)
            failed = code.self_test()
        off = float(np.abs(found - torque).max() / np.abs(torque).max())
        most = _DOUBLE if real is np.float64 else _SINGLE
        self_test = "passed" if failed == 0 else f"FAILED at step {failed}"
        line = f"{name} precision: {off:.1e} of the peak torque off Python, {_STEPS} steps; self-test {self_test}"
        lines.append(told_by(failed == 0 and off <= most, line, f"{line}; expected at most {most:g}"))
    return tuple(lines)


def motion(joint: ExportedJoint) -> dict[str, Array]:
    """What the compensator is given for 10 s at 1 kHz, (n,) each, as numbers of single precision.

    Sliding up to `top_speed`, presliding, standstill, then reversals with noise.
    """
    rng = np.random.default_rng(_SEED)
    t = _PERIOD * np.arange(1, _STEPS + 1)
    top, w = top_speed(joint), 2 * np.pi * 0.7
    bent = min((p.alpha_0 + p.alpha_1) / p.sigma_0 for p in numbers_of(joint))
    parts = [t < 4, t < 6, t < 7]
    amplitude = np.select(parts, [top / w, 0.5 * bent, 0.0], 0.1 * top / w)
    noise = np.where(t < 7, 0.0, 0.02 * top * rng.standard_normal(t.size))
    moved = {
        "reference_position": amplitude * np.sin(w * t),
        "reference_velocity": amplitude * w * np.cos(w * t) + noise,
        "reference_acceleration": -amplitude * w**2 * np.sin(w * t),
        "position": amplitude * np.sin(w * t - 0.05) + noise * _PERIOD,
        "velocity": amplitude * w * np.cos(w * t - 0.05) + 0.5 * noise,
        "dt": np.full(t.size, _PERIOD),
        "motor_torque": 2 * joint.curves[0].alpha_0 * np.sin(3 * t) + noise,
        "link_torque": joint.curves[0].alpha_0 * np.cos(2 * t),
    }
    return {name: x.astype(np.float32).astype(np.float64) for name, x in moved.items()}


class RefusedCodeError(Exception):
    """A compiler does not take the printed code: a defect of bristle."""


class CompiledHeader:
    """A header that was compiled, in a library that is loaded."""

    def __init__(self, library: ctypes.CDLL, names: Sequence[str], real: type) -> None:
        self._library, self._names, self._real = library, names, real

    def __call__(self, inputs: dict[str, Array]) -> Array:
        """The torque of every step, N*m, (n,). Raises InputError where a step was refused."""
        torque, status = self.run(self.packed(inputs))
        if status:
            raise InputError(f"the printed C refused a step with status {status}; expected 0")
        return np.asarray(torque, dtype=np.float64)

    def packed(self, inputs: dict[str, Array]) -> Any:
        """What the C reads, row by row, (n, inputs)."""
        return np.array([inputs[name] for name in self._names]).T.astype(self._real, order="C")

    def run(self, rows: Any) -> tuple[Any, int]:
        """The torque of every row, (n,), and the worst status."""
        torque: Any = np.empty(len(rows), dtype=self._real)
        status = self._library.run(len(rows), *(ctypes.c_void_p(x.ctypes.data) for x in (rows, torque)))
        return torque, int(status)

    def self_test(self) -> int:
        """0, or the first step of the test vector that is off."""
        return int(self._library.self_test())


@contextmanager
def compiled(text: str, joint: ExportedJoint, compensator: Compensator, real: type) -> Iterator[CompiledHeader]:
    """A header as a library, in double or single precision.

    Raises NotInstalled where there is no C compiler, and RefusedCodeError where it refuses the code.
    """
    compiler = c_compiler()
    if compiler is None:
        raise NotInstalled("there is no C compiler here; install gcc or clang")
    names = printed_step(compensator, joint.law, tuple(joint.rises)).inputs
    assign = "\n".join(f"        in.{name} = inputs[{len(names)} * k + {j}];" for j, name in enumerate(names))
    source = _DRIVER.replace("NAME", identifier(joint)).replace("ASSIGN", assign)
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        place = Path(folder)
        (place / "joint.h").write_text(text, encoding="ascii")
        (place / "driver.c").write_text(source, encoding="ascii")
        single = ["-DBRISTLE_SINGLE"] if real is np.float32 else []
        command = [compiler, *FLAGS, *single, "-shared", "-fPIC", "-o", "joint.so", "driver.c", "-lm"]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)  # noqa: S603  # our own words
        if done.returncode:
            raise RefusedCodeError(f"{Path(compiler).name} refuses the code: {done.stderr.strip()[-300:]}")
        yield CompiledHeader(ctypes.CDLL(str(place / "joint.so")), names, real)
