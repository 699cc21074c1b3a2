"""The gear between motor and joint: on which side each signal was logged, and what brings it to the joint."""

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, ValidationInfo

from bristle.data import units
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, short

Side = Literal["motor", "joint"]
SIDED = ("position", "velocity", "torque")
"""Signals that are logged on either side; current and voltage are the motor's."""
_MOST = 1e6  # turns of one side for a turn of the other; in SI for a prismatic joint the square of it


def _read_ratio(value: object, info: ValidationInfo) -> float:
    """Read `100` or `-100`, turns of the motor for one of the joint; for a prismatic joint `1256 rad/m`, or its inverse, `5 mm/rev`."""
    most, ratio = _MOST, 0.0
    if getattr(info.context, "kind", "revolute") == "prismatic":
        most = _MOST**2
        try:
            ratio = units.to_si(value, "rad/m")
        except InputError:
            travel = units.to_si(value, "m/rad") if isinstance(value, str) and "/" in value else 0.0
            ratio = 1 / travel if travel else 0.0
    elif isinstance(value, int | float) and not isinstance(value, bool):
        ratio = float(value)
    if not 1 / most <= abs(ratio) <= most:
        raise InputError(
            f"got {short(value)}; expected turns of the motor for one turn of the joint, such as 100, or -100 where they turn opposite ways "
            "(prismatic: with a unit, such as 1256 rad/m or 5 mm/rev)"
        )
    return ratio


class Gear(StrictModel):
    """How many times the motor turns for one turn of the joint, and on which side signals were logged."""

    ratio: Annotated[float, BeforeValidator(_read_ratio)]
    """Angle of the motor over that of the joint, 1, or rad/m; negative where they turn opposite ways."""
    position: Side | None = None
    velocity: Side | None = None
    torque: Side | None = None
    current: Literal["motor"] = "motor"  # current, and voltage, are always the motor's

    def at_motor(self, signal: str) -> bool:
        """Whether a signal was logged on the motor's side."""
        return getattr(self, signal, None) == "motor" or signal == "voltage"

    def to_joint(self, signal: str) -> float:
        """What a signal in SI, as logged, is multiplied by to be the joint's: angles 1/ratio, torques ratio.

        Of current and voltage it is the sign of the ratio: with it k_t at the joint, abs(ratio) times the motor's, is positive in (6) to (8).
        """
        if not self.at_motor(signal):
            return 1.0
        by = {"position": 1 / self.ratio, "velocity": 1 / self.ratio, "torque": self.ratio}
        return by.get(signal, math.copysign(1.0, self.ratio))
