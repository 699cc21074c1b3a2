"""The FMU of each joint of the embedded report, in one run: errors against Python and Radau, a build from source, and time.

    python benchmarks/export_fmu.py       some two minutes; needs fmpy, a C compiler, CMake and linux64

Each joint is driven for 10 s by a sum of sines, from presliding through reversals to sliding, with a communication step of 1 ms.

(a) Against the function in Python that is printed as C, with the same internal steps: the largest difference in position
and velocity over the largest value.

(b) Against SciPy's Radau of the continuous equations: RMS error of the velocity, the torque held over each communication step
as the FMU holds it; then of a continuous torque, of which the FMU gets the value in the middle, or at the beginning, of each step.

(c) The same FMU without its binary, built by `fmpy compile`: the largest difference from the binary that bristle made.

(d) How the error of (b), held, falls with the longest internal step, for one joint.

(e) Time of an internal step, ns, within one long communication step; and of a communication step of 1 ms by fmpy, us, with
setting the torque and reading the outputs: mostly Python's calls. The least of several runs.
"""

from pathlib import Path
from time import perf_counter_ns

import numpy as np

import bristle
from bristle.questions.export.export import Export
from bristle.questions.export.loss import rms_percent
from export_checks.fmu import (
    SECONDS,
    STEP,
    LoadedFmu,
    built_by_fmpy,
    communication_points,
    drive_torque,
    fmu_problems,
    internal_steps,
    loaded_fmu,
    of_largest,
    python_joint,
    radau_continuous,
    radau_held,
    source_only,
)

RESULTS = Path(__file__).parents[1] / "reports" / "edro" / "results.json"
"""`bristle report` writes it."""
STEPS = (1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
RUNS = 5


def figures(handed: Export) -> None:
    """(a), (b), (c) and (e) of one joint."""
    (joint,), time = handed.joints, communication_points()
    begin, middle = (drive_torque(joint, time + shift) for shift in (0.0, STEP / 2))
    with loaded_fmu(handed.content) as fmu:
        longest = fmu.start("longest_step")
        found, ahead = fmu.play(begin), fmu.play(middle)
        inner, outer = timed(fmu, float(begin[0]) + 0.1)
    continuous = radau_continuous(joint, lambda t: float(drive_torque(joint, np.asarray(t))), time + STEP)
    with loaded_fmu(built_by_fmpy(source_only(handed.content))) as fmu:
        built = fmu.play(begin)
    n, off = internal_steps(STEP, longest), rms_percent(found.velocity, radau_held(joint, begin, STEP))
    by_middle, by_beginning = (rms_percent(x.velocity, continuous) for x in (ahead, found))
    print(f"{joint.name}: {len(handed.content)} bytes, {n} internal steps of {1e6 * STEP / n:g} us")
    print(f"  fmpy validation: {fmu_problems(handed.content) or 'no problem'}")
    print(f"  (a) off Python: {of_largest(found, python_joint(joint, begin, STEP, longest)):.1e} of the largest")
    print(
        f"  (b) off Radau: held {off:.1e} %, continuous {by_middle:.1e} % by the middle, {by_beginning:.1e} % by the beginning of each step"
    )
    print(f"  (c) built from source by fmpy: {of_largest(built, found):.1e} of the largest off the binary")
    print(f"  (e) {inner:.0f} ns an internal step, {outer:.0f} us a communication step by fmpy")


def timed(fmu: LoadedFmu, torque: float) -> tuple[float, float]:
    """Time of an internal step, ns, and of a communication step, us."""
    inner, outer = [], []
    count = internal_steps(1.0, fmu.start("longest_step"))
    for _ in range(RUNS):
        slave = fmu.begin(fmu.instance())
        slave.setReal([fmu.references["torque"]], [torque])
        start = perf_counter_ns()
        slave.doStep(0.0, 1.0)
        inner.append((perf_counter_ns() - start) / count)
        slave.freeInstance()
        start = perf_counter_ns()
        fmu.play(np.full(1000, torque))
        outer.append((perf_counter_ns() - start) / 1000 / 1000)
    return min(inner), min(outer)


def convergence(handed: Export) -> None:
    """(d)."""
    (joint,), time = handed.joints, communication_points()
    torque = drive_torque(joint, time)
    true = radau_held(joint, torque, STEP)
    print(f"(d) {joint.name}, the torque held over 1 ms; longest internal step, RMS error of velocity against Radau")
    for longest in STEPS:
        print(
            f"  {1e6 * longest:6g} us  {rms_percent(python_joint(joint, torque, STEP, longest).velocity, true):.1e} %"
        )


def main() -> None:
    """Everything, in order."""
    print(f"{SECONDS:g} s, communication step {1000 * STEP:g} ms")
    exported = [bristle.export(RESULTS, "fmu", joint=x.name) for x in bristle.read_results(RESULTS).joints]
    for handed in exported:
        figures(handed)
    convergence(exported[1])


if __name__ == "__main__":
    main()
