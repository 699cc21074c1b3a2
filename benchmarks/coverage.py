"""How often the 95 % intervals cover the truth: `python benchmarks/coverage.py [--seeds 100] [--repetitions 1000] [--moving 200]`.

(a) the embedded experiment, simulated again with other seeds, through all of bristle's steps from a log file on: eight joint-direction sets.
(c) gripper rotation, all its runs simulated again with other seeds: all six parameters, by each stage and by the joint fit.
(b) points of gripper rotation (+) with Gaussian noise, at designs from good to poor, by covariance, profile and bootstrap-t; each design with the
    standard error of v_s that it gives.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

import datasets_path  # noqa: F401
import simulated_edro
from bristle.arrays import Array
from bristle.data.experiment.schema import FitOptions
from bristle.identification.fits import Estimate
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured, measure
from bristle.identification.moving_runs import DIRECTIONS
from bristle.identification.results import Joint
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.grid import default_range
from bristle.identification.static.problem import from_points
from bristle.identification.static.solution import solve_static
from bristle.identification.static.uncertainty import three_ways
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.simulation import bench, edro

NAMES = ("alpha_0", "alpha_1", "alpha_2", "v_s")
WAYS = ("covariance", "profile", "bootstrap")
BLOCK = 50
"""Seeds simulated at a time: as many as fit in memory at ease."""
P = edro.TABLE_1["gripper rotation"].positive


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--repetitions", type=int, default=1000)
    parser.add_argument("--moving", type=int, default=200)
    chosen = parser.parse_args()
    if chosen.seeds:
        embedded(chosen.seeds)
    if chosen.repetitions:
        designs(chosen.repetitions)
    if chosen.moving:
        moving(chosen.moving)


def embedded(seeds: int) -> None:
    """Coverage of the embedded experiment over seeds."""
    print(f"embedded experiment, simulated with seeds 0 to {seeds - 1}: intervals that cover the truth")
    print(f"{'':<44}{'fits':>9}" + "".join(f"{name:>9}" for name in NAMES) + f"{'no peak':>9}")
    total, every, fits = dict.fromkeys(NAMES, 0), 0, 0
    for stem, (name, _) in simulated_edro.SETTINGS.items():
        estimates = _estimates(stem, seeds)
        for sign, p in zip("+-", edro.TABLE_1[name], strict=True):
            found = [one[sign] for one in estimates]
            kept = [one for one in found if "v_s" in one]
            hits = {n: sum(_covers(one[n], getattr(p, n)) for one in kept) for n in NAMES}
            for n in NAMES:
                total[n] += hits[n]
            every, fits = every + len(found), fits + len(kept)
            _row(f"{name} ({sign})", f"{len(kept)}", hits, len(kept), len(found))
    _row("all", f"{fits}", total, fits, every)
    inside = sum(total.values())
    print(f"all parameters: {100 * inside / (4 * fits):.1f} % of {4 * fits} intervals")


def _estimates(stem: str, seeds: int) -> list[dict[str, dict[str, Estimate]]]:
    """Per seed and direction, the static parameters of a joint of the embedded experiment, from a log as a user would give it."""
    document = yaml.safe_load((edro.datasets_folder() / f"{stem}.yaml").read_text())
    text = yaml.safe_dump({**document, "runs": [{"files": "log.npz", "experiment": "ramp"}]})
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "experiment.yaml"
        file.write_text(text)
        for first in range(0, seeds, BLOCK):
            logs = simulated_edro.logs(stem, range(first, min(first + BLOCK, seeds)))
            for position, voltage in zip(logs.position, logs.voltage, strict=True):
                np.savez(Path(folder) / "log.npz", time=logs.time, position=position, voltage=voltage)
                measured = measure(file)
                found.append({sign: _fitted(measured, sign) for sign in DIRECTIONS})
    return found


def _fitted(measured: Measured, sign: str) -> dict[str, Estimate]:
    own = [s for s in measured.points(hold_out=False) if s.velocity * DIRECTIONS[sign] > 0]
    velocity, torque = np.array([s.velocity for s in own]), np.array([s.torque for s in own])
    return dict(estimate_static(from_points(velocity, torque, (sign,)), measured.experiment.fit, "revolute"))


def _covers(estimate: Estimate, truth: float) -> bool:
    return estimate.interval is not None and estimate.interval[0] <= truth <= estimate.interval[1]


def _row(label: str, first: str, hits: dict[str, int], found: int, repetitions: int) -> None:
    shares = "".join(f"{100 * hits[n] / max(found, 1):8.1f}%" for n in NAMES)
    print(f"{label:<44}{first:>9}{shares}{100 * (repetitions - found) / repetitions:8.1f}%", flush=True)


def designs(repetitions: int) -> None:
    """Coverage at planned velocities, by each kind of interval; where a Stribeck term is supported, whatever bounds it."""
    print(f"{repetitions} repetitions of gripper rotation (+), simulated points with Gaussian noise, seed 0")
    print(f"{'design':<44}{'se(v_s)':>9}" + "".join(f"{name:>9}" for name in NAMES) + f"{'no peak':>9}")
    for label, velocities, noise in DESIGNS:
        rng = np.random.default_rng(0)
        v_s_range = default_range(velocities)
        hits, errors = {way: dict.fromkeys(NAMES, 0) for way in WAYS}, []
        for _ in range(repetitions):
            torque = bench.steady_points(P, velocities, noise, rng, 1)[0]
            found = solve_static(from_points(velocities, torque, ("+",)), FitOptions(), "revolute", v_s_range)
            v_s = found.parameters.get(ParameterName("v_s", Direction.POSITIVE))
            if v_s is None:
                continue
            errors.append(v_s.standard_error or np.inf)
            for name, three in three_ways(found, v_s_range).items():
                for way in WAYS:
                    low, high = getattr(three, way) or (-np.inf, np.inf)
                    hits[way][name.name] += low <= getattr(P, name.name) <= high
        spread = 100 * float(np.median(errors)) / P.v_s
        for way in WAYS:
            _row(
                f"{label if way == WAYS[0] else '':<34}{way:>10}", f"{spread:.1f}%", hits[way], len(errors), repetitions
            )


def moving(seeds: int) -> None:
    """Coverage of all six parameters of gripper rotation, and how far the estimates lie from the truth on average."""
    print(
        f"gripper rotation, all runs simulated with seeds 0 to {seeds - 1}: intervals that cover the truth, and mean error in standard errors"
    )
    print(f"{'':<24}{'fits':>7}" + "".join(f"{name:>16}" for name in Lugre._fields))
    found: dict[str, dict[str, list[tuple[bool, float]]]] = {}
    for joint in _joints(seeds):
        for sign, p in zip("+-", edro.TABLE_1["gripper rotation"], strict=True):
            for stage, name, estimate in _by_stage(joint, sign):
                if estimate.value is not None and estimate.standard_error:
                    truth = getattr(p, name)
                    off = (estimate.value - truth) / estimate.standard_error
                    found.setdefault(f"{stage} ({sign})", {}).setdefault(name, []).append(
                        (_covers(estimate, truth), off)
                    )
    for label, by_name in found.items():
        cells = [_cell(by_name.get(name, [])) for name in Lugre._fields]
        print(f"{label:<24}{max(map(len, by_name.values())):>7}" + "".join(f"{cell:>16}" for cell in cells))


def _cell(seen: list[tuple[bool, float]]) -> str:
    if not seen:
        return "-"
    hits, off = zip(*seen, strict=True)
    return f"{100 * np.mean(hits):.1f}% {np.mean(off):+.2f}"


def _by_stage(joint: Joint, sign: str) -> Iterator[tuple[str, str, Estimate]]:
    """Every estimate of a LuGre parameter in one direction: stage, parameter, estimate."""
    yield from (("static", name, e) for name, e in joint.static[sign].parameters.items())
    if joint.presliding is not None:
        yield "edges", "sigma_0", joint.presliding.fits[sign].sigma_0
    for stage, fit in (("moving runs", joint.tracking), ("joint fit", joint.joint_fit)):
        if fit is not None:
            yield from ((stage, name, fit.parameters[ParameterName(name, Direction(sign))]) for name in Lugre._fields)


def _joints(seeds: int) -> Iterator[Joint]:
    """Gripper rotation, measured again with each seed."""
    text = (edro.datasets_folder() / "gripper.yaml").read_text()
    names = ("", "_presliding", "_tracking", "_held_out")
    for name in names:
        text = text.replace(f"gripper{name}.csv", f"log{name}.npz")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "experiment.yaml"
        file.write_text(text)
        for first in range(0, seeds, BLOCK):
            block = range(first, min(first + BLOCK, seeds))
            ramps, loads = simulated_edro.logs("gripper", block), simulated_edro.load_logs("gripper", block)
            motions = [simulated_edro.tracking_logs("gripper", block, held_out=held) for held in (False, True)]
            for k in range(len(block)):
                for name, logs in zip(names, (ramps, loads, *motions), strict=True):
                    np.savez(
                        Path(folder) / f"log{name}.npz",
                        time=logs.time,
                        position=logs.position[k],
                        voltage=logs.voltage[k],
                    )
                yield identify_joint(measure(file))


DESIGNS: tuple[tuple[str, Array, float], ...] = (
    ("16 log speeds, noise 0.5 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.005 * P.alpha_0),
    ("16 log speeds, noise 2 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.02 * P.alpha_0),
    ("16 log speeds, noise 5 %", np.geomspace(0.15 * P.v_s, 0.8, 16), 0.05 * P.alpha_0),
    ("10 even from 0.5 v_s, noise 1 %", np.linspace(0.5 * P.v_s, 0.8, 10), 0.01 * P.alpha_0),
    ("12 even from 1.0 v_s, noise 1 %", np.linspace(1.0 * P.v_s, 0.8, 12), 0.01 * P.alpha_0),
)
"""Log speeds go from 0.15 v_s to 0.8 rad/s, even ones to 0.8 rad/s."""


if __name__ == "__main__":
    main()
