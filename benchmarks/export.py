"""What the exports hold of a joint, beside bristle in Python, in one run.

    python benchmarks/export.py              C, MuJoCo and FMU, some two minutes
    python benchmarks/export.py c            the C alone; needs gcc, and arm-none-eabi-gcc for its size

(a) The printed C of each compensator, over 10 s at 1 kHz with presliding, standstill, reversals and noise: how far its torque is off that of the
compensator in Python, over the peak torque, the largest of the four embedded joints. Its size on a Cortex-M4F in single precision at -O2, br_init and
br_step with parameters that are known at run time, without libm: bytes of code, and of stack. The time of one step here, double precision at -O2,
in a loop, beside the compensator in Python as a loop in real time calls it: the least of several runs, in turns.

(b) and (c) are those of export_mujoco.py and export_fmu.py.
"""

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import export_fmu
import export_mujoco
from bristle.api.exporting import exported_joints
from bristle.control.adaptation import LAWS, STEPS, Adaptation
from bristle.control.compensator import Compensator
from bristle.questions.export.c_header import header, python_torque
from bristle.questions.export.exported import ExportedJoint
from export_checks.c import FLAGS, compiled, motion
from timing import least

RESULTS = Path(__file__).parents[1] / "reports" / "edro" / "results.json"
"""`bristle report` writes it."""
COMPENSATORS = (
    *(Compensator(name=name) for name in ("coulomb", "stribeck", "lugre", "lugre-feedback", "lugre-observer")),
    *(Compensator(adaptation=Adaptation(law=law, step=step)) for law in LAWS for step in STEPS),
)
CORTEX = ("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-ffreestanding", "-DBRISTLE_SINGLE")
FUNCTIONS = """#include "joint.h"
int start(const br_params *p, br_state *s);
int start(const br_params *p, br_state *s) { return br_init(p, s); }
int tick(const br_params *p, br_state *s, const br_input *in, br_real *torque);
int tick(const br_params *p, br_state *s, const br_input *in, br_real *torque) { return br_step(p, s, in, torque); }
"""
RUNS = 5


def off(joints: Sequence[ExportedJoint], compensator: Compensator, real: type) -> float:
    """The largest distance of the C's torque from Python's, over the peak torque, of these joints."""
    found = []
    for joint in joints:
        inputs = motion(joint)
        torque = python_torque(joint, compensator, inputs)
        with compiled(header(joint, compensator), joint, compensator, real) as code:
            found.append(float(np.abs(code(inputs) - torque).max() / np.abs(torque).max()))
    return max(found)


def size(joint: ExportedJoint, compensator: Compensator) -> str:
    """Bytes of code and of stack on a Cortex-M4F."""
    if shutil.which("arm-none-eabi-gcc") is None:
        return "no compiler"
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "joint.h").write_text(header(joint, compensator), encoding="ascii")
        (place / "f.c").write_text(FUNCTIONS, encoding="ascii")
        command = ("arm-none-eabi-gcc", *CORTEX, *FLAGS, "-fstack-usage", "-c", "f.c")
        subprocess.run(command, cwd=place, check=True)  # noqa: S603  # our own words
        measure = ("arm-none-eabi-size", "f.o")
        listed = subprocess.run(measure, cwd=place, check=True, capture_output=True, text=True)  # noqa: S603  # the same
        stack = max(int(line.split("\t")[1]) for line in (place / "f.su").read_text().splitlines())
        return f"{listed.stdout.splitlines()[1].split()[0]} B, {stack} B"


def times(joint: ExportedJoint, compensator: Compensator) -> tuple[float, float]:
    """Nanoseconds of a step, of the C in double precision and of Python."""
    inputs = motion(joint)
    with compiled(header(joint, compensator), joint, compensator, np.float64) as code:
        rows = code.packed(inputs)
        calls = {"C": lambda: code.run(rows), "Python": lambda: python_torque(joint, compensator, inputs)}
        found = least(calls, RUNS)
    return 1e9 * found["C"] / len(rows), 1e9 * found["Python"] / len(rows)


def table(joints: Sequence[ExportedJoint]) -> Iterator[str]:
    """(a)."""
    yield f"{'compensator':34}{'double':>9}{'single':>9}   {'Cortex-M4F':14}{'C':>9}{'Python':>11}{'ratio':>8}"
    for compensator in COMPENSATORS:
        a = compensator.adaptation
        name = f"{compensator.name} {a.law}, {a.step}" if a else compensator.name
        double, single = (off(joints, compensator, real) for real in (np.float64, np.float32))
        c, python = times(joints[0], compensator)
        sized = size(joints[0], compensator)
        yield f"{name:34}{double:9.0e}{single:9.0e}   {sized:14}{c:6.0f} ns{python:8.0f} ns{python / c:8.0f}"


def main() -> None:
    """Print the parts."""
    joints = exported_joints(RESULTS)
    print("(a) C99")
    for line in table(joints):
        print(line)
    if sys.argv[1:] != ["c"]:
        print("\n(b) MuJoCo")
        export_mujoco.main()
        print("\n(c) FMU")
        export_fmu.main()


if __name__ == "__main__":
    main()
