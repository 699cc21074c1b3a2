"""References, and joints of Table 1 in closed loop or beside a compensator alone."""

import numpy as np

import simulated_edro
from bristle.arrays import Array
from bristle.control.compensator import Compensator, CompensatorState, Measurement, Reference, compiled, initial_state
from bristle.control.control_period import Case
from bristle.model.parameters import Motor, Pair
from bristle.simulation import edro

H = 1e-3
PAIR = edro.TABLE_1["gripper rotation"]
P = PAIR.positive


def sine(seconds: float, frequency: float, period: float = H, amplitude: float = 1.0) -> Reference:
    """Amplitude sin(2 pi f t), rad."""
    t, w = period * np.arange(round(seconds / period) + 1), 2 * np.pi * frequency
    return Reference(amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w * w * np.sin(w * t))


def case(name: str, **changes: object) -> Case:
    """A joint of Table 1 with its true model and the paper's PID."""
    values = {
        "plant": edro.TABLE_1[name], "motor": simulated_edro.motor(name), "model": edro.TABLE_1[name], "gains": edro.PID_GAINS,
    }  # fmt: skip  # a list of values
    return Case(**(values | changes))  # type: ignore[arg-type]


def wrong_start() -> Case:
    """Table 2's scenario (docs/paper.md): the compensator starts at 0.3 alpha_0 and 0.5 alpha_2; J by (15)."""
    wrong = P._replace(alpha_0=0.3 * P.alpha_0, alpha_2=0.5 * P.alpha_2)
    J = (P.sigma_1 / 0.2) ** 2 / P.sigma_0
    return Case(plant=Pair(P, P), motor=Motor(1.0, 1.0, 0.0, J), model=Pair(wrong, wrong), gains=edro.PID_GAINS)


def follow(
    compensator: Compensator, v: Array, pair: Pair[float] = PAIR, e: float = 0.0
) -> tuple[CompensatorState, Array]:
    """State at the end and torque at every sample, the reference moving at v (n,) from rest, the joint off by e."""
    run, state, out = compiled(compensator), initial_state(compensator, pair, e), []
    y = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * H)])
    for position, speed in zip(y.tolist(), v.tolist(), strict=True):
        state, T = run(state, Reference(position, speed, 0.0), Measurement(position + e, speed), H)
        out.append(T)
    return state, np.array(out)
