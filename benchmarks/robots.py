"""What bristle finds of a whole arm: `python benchmarks/robots.py [--seeds 20] [--workers 2]`; needs Pinocchio; ten minutes or twice that.

The embedded arm, simulated again with other noise and other phases of its motion, from its logs on as `bristle report` takes them. Printed per joint:
errors over standard errors and over the truth, how often the 95 % intervals hold the truth, and what is said of the Stribeck term.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import datasets_path  # noqa: F401
import simulated_arm as arm
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.robot.robot_file import robot_of
from bristle.identification.fits import Estimate
from bristle.identification.identify import identify_joint
from bristle.identification.known_joint import chosen
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.identification.robot.measured import measure_robot

SLIDING = ("alpha_0", "alpha_2")
STRIBECK = ("alpha_1", "v_s")
LUGRE = (*SLIDING, *STRIBECK, "sigma_0", "sigma_1")


class Found(NamedTuple):
    """One number that was found, or not."""

    seed: int
    joint: str
    source: str
    """Which fit: `static`, or `report` for the one that the report's table has."""
    name: str
    value: float | None
    error: float
    """Standard error, the systematic one included."""
    interval: tuple[float, float]
    truth: float

    @property
    def off(self) -> float:
        """In standard errors."""
        return 0.0 if self.value is None else (self.value - self.truth) / self.error

    @property
    def inside(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return self.interval[0] <= self.truth <= self.interval[1]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--workers", type=int, default=min(2, os.cpu_count() or 1))
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    chosen_options = parser.parse_args()
    seeds = range(chosen_options.first, chosen_options.first + chosen_options.seeds)
    began = time.perf_counter()
    with ProcessPoolExecutor(chosen_options.workers, mp_context=get_context("spawn")) as pool:
        every, serious = [], []
        for found, warned in pool.map(_of_seed, seeds):
            every += found
            serious += warned
            print(f"{found[0].seed}", end=" ", file=sys.stderr, flush=True)
    print(f"arm of {len(arm.JOINTS)} joints, seeds {seeds[0]} to {seeds[-1]}, {time.perf_counter() - began:.0f} s")
    sliding(every)
    stribeck(every)
    constants(every)
    print("\ncritical warnings and cautions, of all joints and seeds: ", end="")
    print(", ".join(f"{kind} {serious.count(kind)}" for kind in sorted(set(serious))) or "none")


def _of_seed(seed: int) -> tuple[list[Found], list[str]]:
    """What bristle finds from one simulation, and the kinds of its warnings that are no notes."""
    with tempfile.TemporaryDirectory() as folder:
        path = _written(Path(folder), seed)
        robot = robot_of(parse(read_text(path), str(path)), path)
        found, kinds = [], []
        for measured in measure_robot(robot):
            joint = identify_joint(measured)
            found += list(_numbers(seed, measured, joint))
            kinds += [w.code for w in joint.fit_warnings() if w.severity.name != "NOTE"]
        return found, kinds


def _written(folder: Path, seed: int) -> Path:
    """The arm's file with the logs of a seed."""
    text = (arm.FOLDER / "robot.yaml").read_text(encoding="utf-8")
    for name, held_out in (("motion", False), ("held_out", True)):
        log = arm.simulate_arm(seed, held_out=held_out)
        columns: dict[str, Any] = {f"q_{joint.name}": log.position[:, k] for k, joint in enumerate(arm.JOINTS)}
        columns |= {f"i_{joint.name}": log.current[:, k] for k, joint in enumerate(arm.JOINTS)}
        np.savez(folder / f"{name}.npz", **{"time": log.time, **columns})
        text = text.replace(f"{name}.csv", f"{name}.npz")
    (folder / "arm.urdf").write_bytes((arm.FOLDER / "arm.urdf").read_bytes())
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return folder / "robot.yaml"


def _numbers(seed: int, measured: Measured, joint: Joint) -> Iterator[Found]:
    """Each parameter as the report has it, by the static fit, and the torque constant."""
    own = next(j for j in arm.JOINTS if j.name == joint.name)
    truths = {(sign, name): getattr(p, name) for sign, p in zip("+-", own.friction, strict=True) for name in LUGRE}
    for row in chosen(joint):
        name, direction = row.parameter
        if (str(direction), name) in truths:
            yield _found(seed, joint.name, "report", name, row.estimate, truths[str(direction), name])
    for sign, fit in joint.static.items():
        yield from (
            _found(seed, joint.name, "static", name, e, truths[sign, name])
            for name, e in fit.parameters.items()
            if (sign, name) in truths
        )
    if measured.torque_constant is not None:
        yield _found(seed, joint.name, "links", "torque_constant", measured.torque_constant, own.torque_constant)


def _found(seed: int, joint: str, source: str, name: str, e: Estimate, truth: float) -> Found:
    error = float(np.hypot(e.standard_error or np.nan, e.systematic or 0.0))
    return Found(seed, joint, source, name, e.value, error, e.interval or (-np.inf, np.inf), truth)


def sliding(every: Iterable[Found]) -> None:
    """Coulomb and viscous friction, both directions together, joint by joint."""
    print("\nCoulomb and viscous friction: errors over all seeds and both directions")
    print(f"{'':<34}{'given':>7}{'inside':>8}{'RMS z':>7}{'max |z|':>9}{'RMS off':>9}{'max off':>9}{'largest SE':>12}")
    for source in ("report", "static"):
        rows = [x for x in every if x.source == source and x.name in SLIDING]
        for joint in arm.JOINTS:
            for name in SLIDING:
                _line(f"{source}: {joint.name} {name}", [x for x in rows if (x.joint, x.name) == (joint.name, name)])
        _line(f"{source}: all", rows)


def _line(label: str, rows: list[Found]) -> None:
    given = [x for x in rows if x.value is not None]
    known = [x for x in given if np.isfinite(x.error)]
    if not known:
        print(f"{label:<34}{len(given):>3}/{len(rows)}")
        return
    z, off = np.array([x.off for x in known]), np.array([(x.value or 0.0) / x.truth - 1 for x in given])
    print(
        f"{label:<34}{f'{len(given)}/{len(rows)}':>7}{100 * np.mean([x.inside for x in given]):>7.1f}%{np.sqrt(np.mean(z**2)):>7.2f}"
        f"{np.abs(z).max():>9.1f}{100 * np.sqrt(np.mean(off**2)):>8.2f}%{100 * np.abs(off).max():>8.1f}%"
        f"{100 * max(x.error / x.truth for x in known):>11.1f}%"
    )


def stribeck(every: Iterable[Found]) -> None:
    """The Stribeck and the bristle's parameters as the report has them: given and right, given and wrong, or not identifiable."""
    print(
        "\nStribeck and bristle, as the report has them: within 3 standard errors, farther off, not identifiable; inside"
    )
    for name in (*STRIBECK, "sigma_0", "sigma_1"):
        for joint in arm.JOINTS:
            rows = [x for x in every if (x.source, x.name, x.joint) == ("report", name, joint.name)]
            given = [x for x in rows if x.value is not None]
            right = sum(abs(x.off) <= 3 for x in given)
            inside = f"{100 * np.mean([x.inside for x in given]):.0f}%" if given else "-"
            counts = f"{right:>4}{len(given) - right:>4}{len(rows) - len(given):>4}"
            print(f"{name + ' ' + joint.name:<34}{counts}{inside:>7}", flush=True)


def constants(every: Iterable[Found]) -> None:
    """Torque constants that were free."""
    print("\ntorque constants that were free")
    for joint in (j for j in arm.JOINTS if j.free):
        _line(joint.name, [x for x in every if (x.source, x.joint) == ("links", joint.name)])


if __name__ == "__main__":
    main()
