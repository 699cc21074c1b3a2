"""A small fleet of short ramp logs, simulated, in a folder, with its catalog."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from bristle.model.parameters import Lugre
from bristle.simulation.bench import steady_points

TRUTH = Lugre(0.02, 0.006, 0.04, 0.07, 6.0, 0.02)
SPEEDS = np.repeat([s * v for v in (0.02, 0.04, 0.08, 0.15, 0.3, 0.6) for s in (1, -1)], 100)
"""rad/s, 1 s each at 100 Hz."""
YAML = """joint: {{name: {joint}, kind: revolute}}
signals:
  time: {{column: t, unit: s}}
  position: {{column: q, unit: rad}}
  torque: {{column: T, unit: N*m}}
runs:
  - {{files: {log}, experiment: ramp}}
"""


def log_text(seed: int, factor: float = 1.0) -> str:
    """A ramp log as CSV; torques are those of `TRUTH` times a factor, with noise."""
    (torque,) = steady_points(TRUTH, SPEEDS, 4e-4, np.random.default_rng(seed), 1)
    columns = {"t": np.arange(SPEEDS.size) * 0.01, "q": np.cumsum(SPEEDS) * 0.01, "T": factor * torque}
    return str(pd.DataFrame(columns).to_csv(index=False, float_format="%.7g"))


def write_session(folder: Path, unit: str, joint: str, session: str, seed: int, factor: float = 1.0) -> Path:
    """The experiment file and the log of a joint in a session; returns the file."""
    path = folder / unit / session / f"{joint}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".csv").write_text(log_text(seed, factor), encoding="utf-8")
    path.write_text(YAML.format(joint=joint, log=f"{joint}.csv"), encoding="utf-8")
    return path


def write_catalog(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    pd.DataFrame(rows).to_csv(path, index=False)
    return path


def write_fleet_logs(
    folder: Path, units: int = 2, joints: Sequence[str] = ("wrist", "elbow"), sessions: int = 2
) -> Path:
    """Logs of so many units, joints and sessions, below `folder`/logs, and a catalog of them; returns the catalog."""
    rows = []
    for u, s, (j, joint) in product(range(units), range(sessions), enumerate(joints)):
        unit, session = f"r{u}", f"2026-0{s + 1}-01"
        path = write_session(folder / "logs", unit, joint, session, seed=100 * u + 10 * s + j)
        file = path.relative_to(folder).as_posix()
        rows.append({"file": file, "unit": unit, "session": session, "temperature": 20 + s})
    return write_catalog(folder / "catalog.csv", rows)
