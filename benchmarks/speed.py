"""What `identify` and `report` cost beside an older commit, and how that grows: `python benchmarks/speed.py DATA [COMMIT] [--grow]`.

DATA is a folder of measured logs, which are not in the repository. Whole commands, each in a process of its own, take
turns in one sitting; a job's time is the processor time of the process and its children (of a robot and the report, that
work in several processes: wall time), the least of its turns. Both trees read the same experiment file, which the older
one drafts beforehand, untimed. With `--grow` SIMULATED logs instead, by this tree alone: a motion of 1e3 to 1e6 samples
at 500 Hz, and 10 to 1000 files of 5 s at 67 Hz.
"""

import compileall
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter
from typing import NamedTuple

import numpy as np
import pandas as pd

from bristle.arrays import Array
from bristle.model.parameters import Lugre
from bristle.model.rollout import rollout

ROOT = Path(__file__).parent.parent
OLD, TURNS = "5f90f65", 1
JOINT = Lugre(alpha_0=1.3, alpha_1=0.3, alpha_2=0.5, v_s=0.1, sigma_0=800.0, sigma_1=5.0)
INERTIA, FINE = 0.2, 2000
SERVO = "--column position=0 --unit position=rad --column velocity=1 --unit velocity=rad/s --column torque=4 --unit torque=N*m --rate 1kHz"
ARM = "--column time=0 --column position=1-6 --column velocity=7-12 --column current=13-18 --torque-constant 1N*m/A"
CONSTANTS = (10, 10.70, 8.46, 9.00, 9.48, 10.12)
"""Of the six-axis arm, N*m/A, as published."""


class Job(NamedTuple):
    """Logs below DATA, what `bristle new` is told of them, and what is asked of the new time over the old."""

    logs: str
    told: str
    asked: str
    held_out: str = ""


JOBS = {
    "emps": Job("emps/DATA_EMPS.mat emps/DATA_EMPS_PULSES.mat",
        "--column time=t --unit time=s --column position=qm --unit position=m --column torque=vir --unit torque=V "
        "--scale torque=35.15N/V", "0.25", "DATA_EMPS_PULSES.mat"),
    "servo": Job("servo_lugre/J_*.txt servo_lugre/Fs_[123].txt servo_lugre/sigma0_[123].txt", SERVO, "0.167"),
    "gravity_sim": Job("../cases/logs/gravity_sim/*.csv", "", "0.5"),
    "ur10e robot (wall)": Job("ur10e/ur10e.urdf ur10e/trajectory_12_harmonics.csv ur10e/trajectory_8_harmonics.csv", ARM, "0.5"),
    "forty files": Job("", "", "20 s"),
}  # fmt: skip  # a row each


def simulated(samples: int, rate: float, seed: int) -> pd.DataFrame:
    """Time, position and torque of one motion of four sines; 14 bits, 1 % of torque noise."""
    rng = np.random.default_rng(seed)
    times = max(1, round(FINE / rate))
    t = np.arange(samples * times) / (rate * times)
    frequencies, phases = 2 * np.pi * rng.uniform(0.1, 0.6, 4), rng.uniform(0, 2 * np.pi, 4)
    waves = np.outer(t, frequencies) + phases
    q, v = np.sin(waves) @ (0.6 / frequencies), np.cos(waves) @ np.full(4, 0.6)
    acceleration = -np.sin(waves) @ (0.6 * frequencies)
    torque: Array = rollout(v, 1 / (rate * times), JOINT).torque + INERTIA * acceleration
    count = 2 * np.pi / 2**14
    log = pd.DataFrame({"t_s": t, "position_rad": np.round(q / count) * count, "torque_Nm": torque})[::times]
    return log.assign(torque_Nm=log.torque_Nm + rng.normal(0, 0.01 * JOINT.alpha_0, len(log)))


def run(tree: Path, folder: Path, *arguments: str) -> tuple[float, float]:
    """Processor and wall time of a command of a tree, s."""
    began, before = perf_counter(), getrusage(RUSAGE_CHILDREN)
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
    command = [sys.executable, "-m", "bristle", *arguments]
    subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=True)  # noqa: S603  # our own
    after = getrusage(RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, perf_counter() - began


def drafted(job: Job, old: Path, data: Path, folder: Path) -> None:
    """`joint.yaml` of a job, beside copies of its logs, as the older tree drafts it."""
    folder.mkdir()
    if not job.logs:
        for k in range(40):
            simulated(335, 67, k).to_csv(folder / f"log_{k:02}.csv", index=False)
    for pattern in job.logs.split():
        for path in sorted((data / pattern).parent.glob(Path(pattern).name)):
            (folder / path.name).symlink_to(path)
    names = [path.name for pattern in job.logs.split() or ["*.csv"] for path in sorted(folder.glob(Path(pattern).name))]
    run(old, folder, "new", *names, "-o", "joint.yaml", *job.told.split())
    text = (folder / "joint.yaml").read_text()
    for line in text.splitlines():
        if job.held_out and job.held_out in line and "files" in line:
            text = text.replace(line, line.replace("experiment: ", "hold_out: true, experiment: "))
    for constant in CONSTANTS:
        text = text.replace("torque_constant: 1N*m/A", f"torque_constant: {constant} N*m/A", 1)
    (folder / "joint.yaml").write_text(text)


def compared(job: str, asked: str, old: Path, folder: Path, *arguments: str) -> None:
    """Print a row: the least time of each tree and their ratio, beside what is asked."""
    turns = [
        [run(tree, folder, *(x.format(k, tree.name) for x in arguments))["wall" in job] for tree in (old, ROOT)]
        for k in range(TURNS)
    ]
    before, now = np.min(turns, axis=0)
    print(f"| {job} | {before:.1f} | {now:.1f} | {now / before:.2f} | {asked} |", flush=True)


def beside(data: Path, commit: str) -> None:
    """Print a row a job: both times and their ratio, beside what is asked."""
    with tempfile.TemporaryDirectory() as name:
        folder, old = Path(name), Path(name) / "old"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "-q", "--detach", old, commit], check=True)  # noqa: S603, S607  # git
        try:
            for tree in (old, ROOT):  # as an installer does
                compileall.compile_dir(tree / "src", quiet=1)
            print(f"| job | {commit}, s | now, s | ratio | asked |\n|---|---|---|---|---|")
            for job, of in JOBS.items():
                place = folder / job.replace(" ", "_")
                drafted(of, old, data, place)
                compared(job, of.asked, old, place, "identify", "joint.yaml")
            compared("report (wall)", "0.75", old, folder, "report", "-o", "pages-{}-{}")
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", old], check=True)  # noqa: S603, S607  # git


def grown() -> None:
    """Print the processor time of `identify LOG...` by samples and by files."""
    for what, sizes in (("samples", (1000, 10_000, 100_000, 1_000_000)), ("files", (10, 40, 100, 400, 1000))):
        print(f"\n| {what} | s | s per 1000 |\n|---|---|---|")
        for size in sizes:
            with tempfile.TemporaryDirectory() as name:
                logs = [(size, 500.0)] if what == "samples" else [(335, 67.0)] * size
                for k, (samples, rate) in enumerate(logs):
                    simulated(samples, rate, k).to_csv(Path(name) / f"log_{k:04}.csv", index=False)
                took = run(ROOT, Path(name), "identify", *sorted(path.name for path in Path(name).iterdir()))[0]
            print(f"| {size} | {took:.1f} | {1000 * took / size:.2f} |", flush=True)


if __name__ == "__main__":
    given = [argument for argument in sys.argv[1:] if argument != "--grow"]
    if "--grow" in sys.argv:
        grown()
    else:
        beside(Path(given[0]).resolve(), given[1] if len(given) > 1 else OLD)
