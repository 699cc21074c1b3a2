"""Makes a simulated fleet of logs, the same bytes each time: `python datasets/fleet/make.py FOLDER [--robots 200] [--sessions 8] ...`.

FOLDER/catalog.csv is what `bristle fleet` takes; FOLDER/truth.csv says which joints wear, and since when; the logs lie in a folder
for each robot and session. Nothing of it is kept here: 200 robots of six joints and eight sessions make 9600 logs, about 400 MB.
"""

import argparse
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from simulated_fleet import NAMES, TYPES, FleetDesign, FleetTruth, fleet_truth, ramp_log

EXPERIMENT = """\
# SIMULATED by make.py: Table 1's friction, with scatter between robots and sessions
joint: {{name: {joint}, kind: revolute}}
signals:
  time: {{column: time, unit: s}}
  position: {{column: position, unit: rad}}
  torque: {{column: torque, unit: N*m}}
encoder_resolution: 1e-5 rad
runs:
  - {{files: {joint}.csv, experiment: ramp}}
simulated: true
"""


def options() -> argparse.Namespace:
    """What was asked for on the command line."""
    parser = argparse.ArgumentParser(description="Make a simulated fleet of logs.")
    parser.add_argument("folder", type=Path)
    plain = FleetDesign()
    for name in ("robots", "joints", "sessions"):
        parser.add_argument(f"--{name}", type=int, default=getattr(plain, name))
    for name in ("worn", "change", "swing"):
        parser.add_argument(f"--{name}", type=float, default=getattr(plain, name))
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def write_fleet(folder: Path, design: FleetDesign, seed: int) -> None:
    """Write logs, experiment files, catalog and truth of a fleet into a new folder."""
    truth = fleet_truth(design, np.random.default_rng(seed))
    folder.mkdir(parents=True)
    joints = list(TYPES)[: design.joints]
    rows = []
    for k, s in product(range(design.robots), range(design.sessions)):
        unit, when = f"robot-{k + 1:03d}", str(truth.session[k, s].astype("datetime64[s]"))
        place = Path(unit) / when[:10]
        (folder / place).mkdir(parents=True)
        for j, joint in enumerate(joints):
            log = ramp_log(truth.value[k, j, s], np.random.default_rng([seed, k, j, s]))
            log.to_csv(folder / place / f"{joint}.csv", index=False, float_format="%.7g", lineterminator="\n")
            (folder / place / f"{joint}.yaml").write_bytes(EXPERIMENT.format(joint=joint).encode())
            rows.append((unit, joint, joint, when, (place / f"{joint}.yaml").as_posix(), truth.temperature[k, s]))
    catalog = pd.DataFrame(rows, columns=["unit", "joint", "type", "session", "file", "temperature"])
    if not design.swing:
        catalog = catalog.drop(columns="temperature")
    catalog.to_csv(folder / "catalog.csv", index=False, float_format="%.1f", lineterminator="\n")
    told(design, truth).to_csv(folder / "truth.csv", index=False, float_format="%.6g", lineterminator="\n")


def told(design: FleetDesign, truth: FleetTruth) -> pd.DataFrame:
    """A row per joint: whether it wears, its first worn session, and its parameters in the first session."""
    rows = []
    for k, (j, joint) in product(range(design.robots), enumerate(list(TYPES)[: design.joints])):
        since = str(truth.session[k, truth.since[k, j]].astype("datetime64[s]")) if truth.worn[k, j] else ""
        rows.append((f"robot-{k + 1:03d}", joint, truth.worn[k, j], since, *truth.value[k, j, 0].ravel()))
    columns = [f"{name}{sign}" for sign in "+-" for name in NAMES]
    return pd.DataFrame(rows, columns=["unit", "joint", "worn", "since", *columns])


if __name__ == "__main__":
    asked = options()
    design = FleetDesign(**{name: value for name, value in vars(asked).items() if name in FleetDesign._fields})
    write_fleet(asked.folder, design, asked.seed)
