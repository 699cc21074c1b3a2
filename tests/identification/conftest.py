"""What several files need: the paper's Table 1, points and motions of it, fits of them, experiment files, and what an estimate must have."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array, Interval
from bristle.data.record import Record
from bristle.findings import NOTE, Finding
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, dynamic_problem
from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.presliding.stiffness import KnownValue
from bristle.identification.results import Joint
from bristle.model.functions import loading_displacement_function, steady_torque_function
from bristle.model.parameters import INERTIA, SIGNED, Direction, Lugre, Pair, ParameterName
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate

from ..conftest import present

GRIPPER = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)  # Gripper rotation (+) of Table 1
OTHER = Lugre(0.0148, 0.0040, 0.0307, 0.0720, 4.5356, 0.0146)  # Gripper rotation (-)
G0 = GRIPPER.alpha_0 + GRIPPER.alpha_1  # its breakaway torque, N*m, at vanishing speed
SOURCE = Finding("of-static-fit", NOTE, "the static fit")
J = 1.27e-3  # its inertia, kg*m**2
TONES = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0), (0.01, 12.0))
"""Amplitudes of velocity, rad/s, at frequencies, Hz, that show all parameters of `GRIPPER`."""
SIGNALS = {
    "t": "time: {column: t, unit: s}", "q": "position: {column: q, unit: rad}",
    "v": "velocity: {column: v, unit: rad/s}", "T": "torque: {column: T, unit: N*m}", "driven": "enabled: driven",
}  # fmt: skip  # a list of values
"""What an experiment file says of a column."""


@pytest.fixture
def gripper() -> Lugre[float]:
    """Gripper rotation (+) of Table 1."""
    return GRIPPER


@pytest.fixture
def speeds() -> Array:
    """A design that sees the Stribeck region: 16 speeds from 0.15 v_s to 11 v_s."""
    return np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)


def curve(velocity: Array, p: Lugre[float]) -> Array:
    """Equation (9)."""
    return evaluate(steady_torque_function(), velocity, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)[0]


def bent(torque: Array, level: float = G0) -> Array:
    """How far the gripper's bristle bends under a slow torque, (n,), where it holds that level."""
    return evaluate(loading_displacement_function(), torque, level, GRIPPER.sigma_0)[0]


def known(level: float, error: float) -> KnownValue:
    """A g0 that the static fit knows so well, N*m."""
    return KnownValue(level, error, SOURCE)


def white(size: int, deviation: float, seed: int = 0) -> Array:
    """Noise, (n,)."""
    return deviation * np.random.default_rng(seed).standard_normal(size)


def tones(t: Array, lines: Iterable[tuple[float, float]] = TONES) -> Array:
    """A sum of sines of these amplitudes and frequencies, the k-th by k radians ahead, (n,)."""
    total: Array = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines)], axis=0)
    return total


def way(v: Array, step: float) -> Array:
    """The position that a velocity leads to from zero, (n,)."""
    return np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * step)])


def moved(
    v: Array,
    step: float,
    p: Lugre[float] | Pair[float] = GRIPPER,
    noise: float = 0.0,
    *,
    seed: int = 0,
    z0: float | None = None,
    inertia: float = J,
    file: str = "run.csv",
) -> Record:
    """A run at this velocity, (n,): torque of LuGre and of an inertia, with white noise."""
    t: Array = step * np.arange(v.size, dtype=np.float64)
    a = np.gradient(v, t)
    torque = rollout(v, step, p, z0).torque + inertia * a + white(v.size, noise, seed)
    return Record(file=file, time=t, velocity=v, acceleration=a, torque=torque)


def with_torque(run: Record, change: Callable[[Array], Array]) -> Record:
    return replace(run, torque=change(present(run.torque)))


def sides(p: Lugre[float] | Pair[float]) -> tuple[str, ...]:
    return ("both",) if isinstance(p, Lugre) else ("+", "-")


def by_name(p: Lugre[float] | Pair[float], inertia: float | None = J) -> dict[ParameterName, float]:
    sets = {Direction.BOTH: p} if isinstance(p, Lugre) else dict(zip(SIGNED, p, strict=True))
    every = {ParameterName(name, d): value for d, own in sets.items() for name, value in own._asdict().items()}
    return every if inertia is None else every | {INERTIA: inertia}


def posed(run: Record, directions: tuple[str, ...] = ("both",), decimation: int = 1) -> DynamicProblem:
    return dynamic_problem([run], directions, ("inertia",), decimation, None)


def fitted(problem: DynamicProblem, start: Mapping[ParameterName, float] | None = None) -> TrackingFit:
    """The fit from one start, the gripper itself if none is given."""
    return fit_tracking(problem, by_name(GRIPPER) if start is None else start, "revolute", search=False).fit


def value_of(e: Estimate) -> float:
    assert e.value is not None, e.warnings
    return e.value


def error_of(e: Estimate) -> float:
    assert e.standard_error is not None, e.warnings
    return e.standard_error


def holds(interval: Interval | None, truth: float) -> bool:
    return interval is not None and interval[0] <= truth <= interval[1]


def codes(findings: Iterable[Finding]) -> list[str]:
    return [x.code for x in findings]


def experiment_file(
    folder: Path, columns: Mapping[str, Array], kind: str = "tracking", fit: str = "", more: str = "", file: str = "log"
) -> Path:
    """A log of columns, each (n,) under a name of `SIGNALS`, and its experiment; `fit` and `more` are what else that says."""
    log = folder / f"{file}.csv"
    np.savetxt(log, np.column_stack([*columns.values()]), "%.17g", ",", header=",".join(columns), comments="")
    path = folder / "joint.yaml"
    path.write_text(
        f"joint: {{name: wrist}}\nsignals: {{{', '.join(SIGNALS[name] for name in columns)}}}\n"
        f"runs: [{{files: {log.name}, experiment: {kind}}}]\nfit: {{{fit}}}\n{more}",
        encoding="utf-8",
    )
    return path


def written(path: Path, **columns: Array) -> Path:
    """A log of columns, (n,) each, by name."""
    np.savetxt(path, np.column_stack([*columns.values()]), "%.9g", ",", header=",".join(columns), comments="")
    return path


def drafted(*logs: Path, told: bristle.Told | None = None) -> Joint:
    """The joint of some logs, as they are drafted with what is told of them."""
    path = logs[0].with_suffix(".yaml")
    path.write_text(bristle.draft(*logs, told=told)[0], encoding="utf-8")
    return bristle.identify(path).joint()


def points_file(folder: Path, velocity: Array, torque: Array, fit: str = "", more: str = "") -> Path:
    """An experiment of given points, rad/s and N*m, (n,), with the file that holds them."""
    return experiment_file(folder, {"v": velocity, "T": torque}, "points", fit, more, "points")


def accepted(path: Path, text: str, changes: Iterable[tuple[str, str, str]]) -> list[tuple[str, str]]:
    """The changes to an experiment file, from and to, that are not refused in these words, with what was said."""
    found = list[tuple[str, str]]()
    for old, new, says in changes:
        path.write_text(text.replace(old, new), encoding="utf-8")
        try:
            bristle.identify(path)
            found.append((new, "nothing"))
        except bristle.InputError as refused:
            found += [(new, str(refused))] if old not in text or not re.search(says, str(refused)) else []
    return found
