"""Robots for the tests: a pendulum, the embedded arm, and a short log of it, written to a folder."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import simulated_arm as arm
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.robot.robot_file import Robot, robot_of
from simulated_arm import ArmLog

NO_PINOCCHIO = "needs Pinocchio: pip install 'bristle[robot]'"
ARM = arm.FOLDER / "arm.urdf"
NAMES = tuple(joint.name for joint in arm.JOINTS)
SIGNALS = {
    "time": {"column": "time", "unit": "s"},
    "position": {"column": "q_{joint}", "unit": "rad"},
    "current": {"column": "i_{joint}", "unit": "A"},
}
M, L, J = 1.7, 0.4, 0.03  # of the pendulum: kg, m, kg*m**2 about its own centre


def inertial(mass: float, center: str = "0 0 0", moment: float = 0.0) -> str:
    """A link's mass, kg, at a place, m, with one moment about all axes, kg*m**2."""
    moments = " ".join(f'{x}="{moment}"' for x in ("ixx", "iyy", "izz"))
    inertia = f'<inertia {moments} ixy="0" ixz="0" iyz="0"/>'
    return f'<inertial><origin xyz="{center}"/><mass value="{mass}"/>{inertia}</inertial>'


def pendulum(limit: str = "", mass: float = M, kind: str = "revolute") -> str:
    """A URDF of one joint that turns about y, its mass hanging down at zero."""
    return (
        f'<robot name="pendulum"><link name="base"/><link name="rod">{inertial(mass, f"0 0 {-L}", J)}</link>'
        f'<joint name="swing" type="{kind}"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>{limit}</joint></robot>'
    )


def document(**changed: Any) -> dict[str, Any]:
    own = [{"name": joint.name, "torque_constant": f"{joint.torque_constant} N*m/A"} for joint in arm.JOINTS]
    whole = {
        "robot": {"urdf": "arm.urdf"}, "joints": own, "signals": SIGNALS,
        "runs": [{"files": "log.npz", "experiment": "tracking"}],
        "fit": {"position_cutoff": "20 Hz", "decimation": 6}, "simulated": True,
    }  # fmt: skip  # a list of values
    return {key: x for key, x in {**whole, **changed}.items() if x is not None}


def write(folder: Path, keys: Mapping[str, Any], log: ArmLog | None = None) -> Path:
    """A robot's file, the arm's URDF and a log in a folder; returns the file."""
    (folder / "arm.urdf").write_bytes(ARM.read_bytes())
    if log is not None:
        columns: dict[str, Any] = {f"q_{name}": log.position[:, k] for k, name in enumerate(NAMES)}
        columns |= {f"i_{name}": log.current[:, k] for k, name in enumerate(NAMES)}
        np.savez(folder / "log.npz", **{"time": log.time, **columns})
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(dict(keys), sort_keys=False), encoding="utf-8")
    return path


def load_robot(path: Path) -> Robot:
    return robot_of(parse(read_text(path), str(path)), path)
