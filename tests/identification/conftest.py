"""Static problems to fit: the paper's Table 1 and the points one would measure."""

from pathlib import Path

import numpy as np
import pytest

from bristle.arrays import Array
from bristle.model.functions import steady_torque_function
from bristle.model.parameters import Lugre
from bristle.model.vectorize import evaluate

GRIPPER = Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184)


def curve(velocity: Array, p: Lugre[float]) -> Array:
    """Equation (9)."""
    return evaluate(steady_torque_function(), velocity, p.alpha_0, p.alpha_1, p.alpha_2, p.v_s)[0]


def points_file(folder: Path, velocity: Array, torque: Array, more: str = "") -> Path:
    """An experiment of given points, rad/s and N*m, (n,), with the file that holds them; `more` is what else the experiment says."""
    rows = "".join(f"{v!r},{T!r}\n" for v, T in zip(velocity.tolist(), torque.tolist(), strict=True))
    (folder / "points.csv").write_text(f"v,T\n{rows}", encoding="utf-8")
    path = folder / "joint.yaml"
    path.write_text(
        "joint: {name: wrist}\nsignals: {velocity: {column: v, unit: rad/s}, torque: {column: T, unit: N*m}}\n"
        f"runs: [{{files: points.csv, experiment: points}}]\n{more}",
        encoding="utf-8",
    )
    return path


@pytest.fixture
def gripper() -> Lugre[float]:
    """Gripper rotation (+) of Table 1."""
    return GRIPPER


@pytest.fixture
def speeds() -> Array:
    """A design that sees the Stribeck region: 16 speeds from 0.15 v_s to 11 v_s."""
    return np.geomspace(0.15 * GRIPPER.v_s, 0.8, 16)
