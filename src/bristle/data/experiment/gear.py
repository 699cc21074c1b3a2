"""The gear between motor and joint, and the factors from one side to the other."""

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, ValidationInfo

from bristle.data import units
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, short

Side = Literal["motor", "joint"]
SIDED = ("position", "velocity", "torque")  # logged on either side; current and voltage are the motor's
_MOST = 1e6  # turns of one side for a turn of the other; in SI for a prismatic joint the square of it


def _read_ratio(value: object, info: ValidationInfo) -> float:
    """Turns of the motor for one of the joint, `100` or `-100`; prismatic `1256 rad/m`, or its inverse, `5 mm/rev`."""
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
            f"got {short(value)}; expected turns of the motor for one turn of the joint, such as 100, or -100 where they "
            "turn opposite ways (prismatic: with a unit, such as 1256 rad/m or 5 mm/rev)"
        )
    return ratio


class Gear(StrictModel):
    """Ratio of the gear, and the side on which each signal was logged."""

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
        """Factor from a signal in SI, as logged, to the joint's: angles 1/ratio, torques ratio.

        Of current and voltage it is the sign of the ratio: with it k_t at the joint, abs(ratio) times the motor's, is
        positive in (6) to (8).
        """
        if not self.at_motor(signal):
            return 1.0
        by = {"position": 1 / self.ratio, "velocity": 1 / self.ratio, "torque": self.ratio}
        return by.get(signal, math.copysign(1.0, self.ratio))
