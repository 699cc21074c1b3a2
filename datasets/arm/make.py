"""Makes the arm's example again, byte for byte: `python datasets/arm/make.py [FOLDER]` (default: where this script is)."""

import sys
from pathlib import Path

import numpy as np
import yaml

import simulated_arm as arm
from bristle.model.parameters import Lugre, unit
from simulated_arm import ArmJoint, ArmLog

HEADER = (
    "# SIMULATED by make.py: Table 1's friction, scaled, on an arm that is made up; README.md marks what is assumed.\n"
)


def truth(p: Lugre[float]) -> dict[str, str]:
    """The true parameters, each with its unit."""
    return {name: f"{value:g} {unit(name)}" for name, value in p._asdict().items()}


def entry(joint: ArmJoint) -> dict[str, object]:
    """What the robot's file says of one joint."""
    constant = "free" if joint.free else f"{joint.torque_constant} N*m/A"
    sets = {sign: truth(p) for sign, p in zip("+-", joint.friction, strict=True)}
    return {"name": joint.name, "torque_constant": constant, "truth": sets}


def robot() -> str:
    """The robot's file, as YAML."""
    document = {
        "robot": {"urdf": "arm.urdf"},
        "signals": {
            "time": {"column": "time", "unit": "s"},
            "position": {"column": "q_{joint}", "unit": "rad"},
            "current": {"column": "i_{joint}", "unit": "A"},
        },
        "runs": [
            {"files": "motion.csv", "experiment": "tracking"},
            {"files": "held_out.csv", "experiment": "tracking", "hold_out": True},
        ],
        "fit": {"position_cutoff": f"{arm.CUTOFF:g} Hz", "decimation": arm.DECIMATION},
        "encoder_resolution": f"{arm.RESOLUTION:.10e} rad",
        "joints": [entry(joint) for joint in arm.JOINTS],
        "simulated": True,
        "assumptions": list(arm.ASSUMPTIONS),
    }
    return HEADER + yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=120)


def table(log: ArmLog) -> str:
    """A log as CSV: time (s), positions (rad), currents (A); a count, 1.2e-5 rad, is more than the last digit."""
    names = ["time", *(f"{what}_{joint.name}" for what in "qi" for joint in arm.JOINTS)]
    form = ",".join(["{:.3f}", *["{:.6f}"] * len(arm.JOINTS), *["{:.4f}"] * len(arm.JOINTS)])
    rows = np.column_stack([log.time, log.position, log.current]).tolist()
    return ",".join(names) + "\n" + "".join(form.format(*row) + "\n" for row in rows)


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    temporary = path.with_suffix(path.suffix + ".tmp")
    temporary.write_bytes(text.encode())
    temporary.replace(path)


def main(folder: Path) -> None:
    """Write the robot's file and its two logs; arm.urdf is written by hand."""
    write(folder / "robot.yaml", robot())
    write(folder / "motion.csv", table(arm.simulate_arm(0)))
    write(folder / "held_out.csv", table(arm.simulate_arm(0, held_out=True)))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
