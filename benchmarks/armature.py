"""What published friction of a public leg leaves beside bristle's: `python benchmarks/armature.py`.

The hip of docs/armature.md, whose log holds commands alone (go2 under BRISTLE_DATA). The torque is that of the drive's
gains, some time late. Friction is held at each pair of Coulomb and viscous friction; inertia and gravity are fitted beside
it to one motion, through a low pass of 12 Hz and above 0.2 rad/s, and predict the other: so only friction is judged.
"""

import os
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

from bristle.arrays import Array

KP, KD = 20.0, 1.0
STEP, CUTOFF, SLOWEST = 0.005, 12.0, 0.2
FRICTION = {"bristle": (0.1552, 0.2567), "published, one tool": (0.293, 0.212), "published, another": (0.288, 0.153)}
"""Coulomb, N*m, and viscous, N*m*s/rad."""


def equations(log: Path, late: float) -> tuple[Array, Array]:
    """Columns of Coulomb and viscous friction, inertia and gravity, (n, 5), and the torque, N*m, (n,), of a drive that acts so late, s."""
    data = pd.read_csv(log)
    time = np.arange(data.time.iloc[0], data.time.iloc[-1], STEP)
    low = butter(4, CUTOFF, fs=1 / STEP, output="sos")
    q, dq, q_d, dq_d = (
        {shift: np.interp(time - shift, data.time, data[f"{name}_FL_hip"]) for shift in (0.0, late)}
        for name in ("q", "dq", "q_des", "dq_des")
    )
    torque = sosfiltfilt(low, KP * (q_d[late] - q[late]) + KD * (dq_d[late] - dq[late]))
    position = sosfiltfilt(low, q[0.0])
    velocity = np.gradient(position, STEP)
    columns = [np.sign(velocity), velocity, np.gradient(velocity, STEP), np.sin(position), np.cos(position)]
    slides = np.abs(velocity) > SLOWEST
    return np.stack(columns, axis=1)[slides], torque[slides]


def main() -> None:
    """Print what each pair leaves of the held-out torque, with the delay that bristle finds and without one."""
    folder = Path(os.environ["BRISTLE_DATA"]) / "go2"
    for late in (0.0149, 0.0):
        print(f"delay {1e3 * late:.1f} ms: left of the held-out torque")
        (X, y), (held, torque) = (equations(folder / f"motion_{k}.csv", late) for k in (0, 1))
        for name, pair in FRICTION.items():
            rest = np.linalg.lstsq(X[:, 2:], y - X[:, :2] @ pair, rcond=None)[0]
            left = torque - held[:, :2] @ pair - held[:, 2:] @ rest
            print(f"  {name}: {100 * np.linalg.norm(left) / np.linalg.norm(torque):.1f} %")


if __name__ == "__main__":
    main()
