"""What `bristle.fit` costs beside what `bristle identify` spends on the same points between reading and printing: `python benchmarks/arrays.py`.

The points of gripper rotation of the embedded experiment (simulated), both directions, intervals three ways included. The two
are timed in turn, after one of each; medians. Then, in a process each, what many simulated points cost: CPU seconds with the
import of bristle, and the peak of resident memory.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

import bristle
from bristle.data.experiment.load import load_experiment, read_runs
from bristle.identification.identify import identify_joint
from bristle.identification.measured import measured_of
from bristle.simulation import edro

REPETITIONS = 15
MANY = (5_000, 50_000, 200_000)
"""Points."""
FIT = """
import resource, sys
import numpy as np
import bristle
n = int(sys.argv[1])
v = np.geomspace(0.01, 0.8, n // 2)
T = 0.3 + 0.12 * np.exp(-((v / 0.06) ** 2)) + 0.4 * v + 0.002 * np.random.default_rng(0).standard_normal((2, v.size))
bristle.fit(np.append(v, -v), np.append(T[0], -T[1]))
used = resource.getrusage(resource.RUSAGE_SELF)
print(f"fit of {n} points: {used.ru_utime + used.ru_stime:.1f} s, {used.ru_maxrss / 1024:.0f} MiB")
"""


def main() -> None:
    """Print both times and their ratio."""
    kept = bristle.inspect(edro.experiments()[0]).points(hold_out=False)
    v, T = (np.array([getattr(s, name) for s in kept]) for name in ("velocity", "torque"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        np.savetxt(folder / "p.csv", np.column_stack([v, T]), "%.17g", ",", header="v,T", comments="")
        (folder / "e.yaml").write_text(
            "joint: {name: joint}\nsignals: {velocity: {column: v, unit: rad/s}, torque: {column: T, unit: N*m}}\n"
            "runs: [{files: p.csv, experiment: points}]\n"
        )
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
    for n in MANY:
        subprocess.run([sys.executable, "-c", FIT, str(n)], check=True)  # noqa: S603  # our own command


if __name__ == "__main__":
    main()
