"""What `bristle.fit` costs beside what `bristle identify` spends on the same points between reading and printing: `python benchmarks/arrays.py`.

The points of gripper rotation of the embedded experiment (simulated), both directions, intervals three ways included. The two
are timed in turn, after one of each; medians. Then many points of the same joint at random speeds, by array and from a file:
processor seconds and peak memory of processes of their own, the start of Python included.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

import bristle
from bristle.arrays import Array
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.identification.curve import curve
from bristle.identification.identify import identify_joint
from bristle.identification.measured import measured_of
from bristle.simulation import edro

REPETITIONS = 15
MANY = (5_000, 50_000)
NOISE = 5e-4
KINDS = ("even noise", "noise that grows with speed", "even noise, 1 % strays", "Student t, 3 degrees of freedom")
EXPERIMENT = (
    "joint: {name: joint}\nsignals: {velocity: {column: v, unit: rad/s}, torque: {column: T, unit: N*m}}\n"
    "runs: [{files: p.csv, experiment: points}]\n"
)
FIT = "import sys, numpy, bristle; print(bristle.fit(*numpy.loadtxt(sys.argv[1], delimiter=',', skiprows=1).T))"


def write(folder: Path, v: Array, T: Array) -> None:
    """Points, and the experiment file that names them."""
    np.savetxt(folder / "p.csv", np.column_stack([v, T]), "%.17g", ",", header="v,T", comments="")
    (folder / "e.yaml").write_text(EXPERIMENT)


def points(count: int, kind: str) -> tuple[Array, Array]:
    """Points of gripper rotation at random speeds in both directions, rad/s and N*m."""
    p, rng = edro.TABLE_1["gripper rotation"].positive, np.random.default_rng(0)
    v = rng.uniform(0.01, 1.0, count) * rng.choice([-1.0, 1.0], count)
    even = rng.standard_t(3, count) if "Student" in kind else rng.standard_normal(count)
    noise = NOISE * even * (0.2 + np.abs(v) if "grows" in kind else 1.0)
    if "strays" in kind:
        noise[rng.choice(count, count // 100, replace=False)] += 10 * NOISE
    return v, curve(v, p.stribeck) + noise


def spent(*command: str) -> str:
    """Processor seconds and peak memory of a process, as printed."""
    with subprocess.Popen(  # noqa: S603  # our own words
        [sys.executable, *command], stdout=subprocess.DEVNULL, env={**os.environ, "OMP_NUM_THREADS": "1"}
    ) as run:
        _, status, used = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    failed = " (failed)" if run.returncode else ""
    return f"{used.ru_utime + used.ru_stime:6.1f} s {used.ru_maxrss / 1e3:5.0f} MB{failed}"


def many() -> None:
    """Print what many points cost."""
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"(a process counts no less than the {own:.0f} MB of the one that starts it)")
    for kind in KINDS:
        print(f"{kind:<34}{'bristle.fit':>17}{'identify':>17}{'report':>17}")
        for count in MANY:
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                write(folder, *points(count, kind))
                files = str(folder / "p.csv"), str(folder / "e.yaml")
                report = "report", files[1], "-o", str(folder / "report"), "--workers", "1"
                costs = (
                    spent("-c", FIT, files[0]),
                    spent("-m", "bristle", "identify", files[1]),
                    spent("-m", "bristle", *report),
                )
            print(f"  {count:>7} points{'':<18}{costs[0]:>17}{costs[1]:>17}{costs[2]:>17}", flush=True)


def main() -> None:
    """Print both times and their ratio."""
    kept = bristle.inspect(edro.experiments()[0]).points(hold_out=False)
    v, T = (np.array([getattr(s, name) for s in kept]) for name in ("velocity", "torque"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder, v, T)
        experiment = load_experiment(folder / "e.yaml")
        runs = read_runs(experiment)
    times = dict[str, list[float]](identify=[], fit=[])
    for _ in range(REPETITIONS + 1):
        for what, run in (
            ("identify", lambda: identify_joint(measured_of(experiment, runs))),
            ("fit", lambda: bristle.fit(v, T)),
        ):
            started = perf_counter()
            run()
            times[what].append(perf_counter() - started)
    identify, fit = (median(times[what][1:]) for what in ("identify", "fit"))
    print(f"{v.size} points, two directions, {REPETITIONS} times each")
    print(f"identify, from the run that was read to the result: {1e3 * identify:.0f} ms")
    print(f"fit, from arrays to the result: {1e3 * fit:.0f} ms, {fit / identify:.2f} times")
    many()


if __name__ == "__main__":
    main()
