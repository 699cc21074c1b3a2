"""References, and joints of Table 1 in closed loop."""

import numpy as np

from bristle.control.compensator import Reference
from bristle.control.control_period import Case
from bristle.model.parameters import Motor, Pair
from bristle.simulation import edro

H = 1e-3
P = edro.TABLE_1["gripper rotation"].positive


def sine(seconds: float, frequency: float, period: float = H, amplitude: float = 1.0) -> Reference:
    """Amplitude sin(2 pi f t), rad."""
    t, w = period * np.arange(round(seconds / period) + 1), 2 * np.pi * frequency
    return Reference(amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w * w * np.sin(w * t))


def case(name: str, **changes: object) -> Case:
    """A joint of Table 1 with its true model and the paper's PID."""
    values = {
        "plant": edro.TABLE_1[name],
        "motor": edro.motor(name),
        "model": edro.TABLE_1[name],
        "gains": edro.PID_GAINS,
    }
    return Case(**(values | changes))  # type: ignore[arg-type]


def wrong_start() -> Case:
    """Table 2's scenario (docs/paper.md): the compensator starts at 0.3 alpha_0 and 0.5 alpha_2; J by (15)."""
    wrong = P._replace(alpha_0=0.3 * P.alpha_0, alpha_2=0.5 * P.alpha_2)
    J = (P.sigma_1 / 0.2) ** 2 / P.sigma_0
    return Case(plant=Pair(P, P), motor=Motor(1.0, 1.0, 0.0, J), model=Pair(wrong, wrong), gains=edro.PID_GAINS)
