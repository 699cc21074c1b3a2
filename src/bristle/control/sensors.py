"""What a sensor does to a signal: the encoder's counts and white noise.

The virtual bench and the closed loop share these, so that simulated logs are spoilt in one way only.
"""

from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError

Expression = Any
"""A float or a CasADi symbol: CasADi carries no types."""


class Sensors(NamedTuple):
    """How well the bench measures."""

    resolution: float
    """Angle of one encoder count, rad (m where prismatic), > 0."""
    voltage_noise: float
    """Standard deviation of each logged voltage, V, >= 0: white."""
    torque_noise: float
    """Standard deviation of the torque that disturbs the plant, N*m, >= 0: held over a control period, white from one to the next."""


def quantise(x: Expression, resolution: Expression) -> Expression:
    """The encoder's reading of x: the nearest count, in the unit of x. Each count's interval is half open, [k - 1/2, k + 1/2)."""
    return ca.floor(x / resolution + 0.5) * resolution


def white_noise(rng: np.random.Generator, standard_deviation: float, shape: tuple[int, ...]) -> Array:
    """Normal, independent, zero-mean noise, in the unit of `standard_deviation`.

    Raises InputError if the standard deviation is negative.
    """
    if not standard_deviation >= 0:
        raise InputError(f"the standard deviation of noise is {standard_deviation}; expected zero or more")
    return standard_deviation * rng.standard_normal(shape)
