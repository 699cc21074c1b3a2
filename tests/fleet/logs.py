"""A small fleet of short ramp logs, simulated, in a folder, with its catalog."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

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
    rng = np.random.default_rng(seed)
    (torque,) = steady_points(TRUTH, SPEEDS, 4e-4, rng, 1)
    time = np.arange(SPEEDS.size) * 0.01
    rows = np.column_stack([time, np.cumsum(SPEEDS) * 0.01, factor * torque])
    return "t,q,T\n" + "".join(f"{t:.2f},{q:.6f},{T:.7g}\n" for t, q, T in rows.tolist())


def write_session(folder: Path, unit: str, joint: str, session: str, seed: int, factor: float = 1.0) -> Path:
    """The experiment file and the log of a joint in a session; returns the file."""
    place = folder / unit / session
    place.mkdir(parents=True, exist_ok=True)
    (place / f"{joint}.csv").write_text(log_text(seed, factor), encoding="utf-8")
    path = place / f"{joint}.yaml"
    path.write_text(YAML.format(joint=joint, log=f"{joint}.csv"), encoding="utf-8")
    return path


def write_catalog(path: Path, rows: Sequence[Mapping[str, object]]) -> Path:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [",".join(str(row.get(name, "")) for name in columns) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")
    return path


def write_fleet_logs(
    folder: Path, units: int = 2, joints: Sequence[str] = ("wrist", "elbow"), sessions: int = 2
) -> Path:
    """Logs of so many units, joints and sessions, below `folder`/logs, and a catalog of them; returns the catalog."""
    rows = []
    for u in range(units):
        for s in range(sessions):
            for j, joint in enumerate(joints):
                unit, session = f"r{u}", f"2026-0{s + 1}-01"
                path = write_session(folder / "logs", unit, joint, session, seed=100 * u + 10 * s + j)
                file = path.relative_to(folder).as_posix()
                rows.append({"file": file, "unit": unit, "session": session, "temperature": 20 + s})
    return write_catalog(folder / "catalog.csv", rows)
