"""Noisy points of the steady curve."""

import numpy as np

from bristle.arrays import Array
from bristle.control.plant import white_noise
from bristle.model import functions
from bristle.model.parameters import Lugre, Stribeck
from bristle.model.vectorize import evaluate


def steady_points(
    p: Lugre[float] | Stribeck[float], velocities: Array, noise: float, rng: np.random.Generator, repetitions: int
) -> Array:
    """Steady torques (9) at velocities (rad/s) plus white noise (N*m), (repetitions, velocities), N*m."""
    curve = p.stribeck if isinstance(p, Lugre) else p
    (torque,) = evaluate(functions.steady_torque_function(p.law), velocities, *curve)
    return torque + white_noise(rng, noise, (repetitions, velocities.size))
