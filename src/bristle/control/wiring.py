"""What a closed loop is given: what is connected to what, the numbers of a case, and the course of a run."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from bristle.arrays import Array
from bristle.control.compensator import Compensator
from bristle.control.pid import Gains, Sliding
from bristle.errors import InputError
from bristle.model.parameters import Motor, Pair

_SOFT: Sliding[float] = Sliding(K=2.0, slope=15.0, layer=10.0, filter_time=0.0)
_KNOWN = {"drive": ("torque", "voltage"), "controller": ("pid", "sliding"), "derivative": ("error", "measurement")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wiring:
    """What is connected to what; the numbers stand in `Case`. Raises InputError where that cannot work."""

    compensator: Compensator = field(default_factory=Compensator)
    drive: Literal["torque", "voltage"] = "torque"
    """What the drive takes: the torque itself, or the voltage that the motor model makes of it."""
    back_emf: bool = True
    """Whether that voltage has the back-EMF at the reference velocity; else the joint is braked by it."""
    delay: int = 0
    """Control periods from the command to the drive."""
    encoder: bool = False
    """Whether positions are counted; else they are measured as they are."""
    speedometer: bool = False
    """Whether the compensator is given the true velocity; else it differentiates the position where it needs one."""
    substeps: int = 1
    """Steps of the plant in a control period."""
    controller: Literal["pid", "sliding"] = "pid"
    """(21), or sliding mode, to compare with."""
    derivative: Literal["error", "measurement"] = "error"
    """What (21) differentiates: with the measurement, a step of the reference kicks no more."""
    inductance: bool = False
    """Whether the current lags the voltage by L / R (1); else it follows at once (6)."""
    informed: bool = False
    """Whether the compensator's model drifts with the plant: the best that adaptation can do."""

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if self.delay < 0 or self.substeps < 1:
            raise InputError(
                f"wiring: got delay {self.delay} and substeps {self.substeps}; expected zero or more, and one or more"
            )
        for what, known in _KNOWN.items():
            if getattr(self, what) not in known:
                raise InputError(f"wiring: {what}: got {getattr(self, what)!r}; expected {' or '.join(known)}")
        if self.controller == "sliding" and self.derivative == "measurement":
            raise InputError(
                "wiring: derivative: got measurement for sliding mode, whose surface needs that of the error"
            )
        if self.inductance and self.drive == "torque":
            raise InputError(
                "wiring: inductance: got a drive of torque, whose current does not lag; choose drive voltage"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """The numbers of one run. Raises InputError where sliding mode has no boundary layer."""

    plant: Pair[float]
    """Friction as it is."""
    motor: Motor[float]
    model: Pair[float]
    """Friction as the compensator takes it."""
    gains: Gains[float]
    torque_limit: float = float("inf")
    """Largest torque asked for, controller and compensator together, N*m."""
    resolution: float = 1.0
    """One count, rad, where there is an encoder."""
    sliding: Sliding[float] = _SOFT
    """Of the controller where it is sliding mode; in its layer the default is a PD controller with the paper's K_p and K_d."""

    def __post_init__(self) -> None:
        """Refuse what cannot work."""
        if not self.sliding.layer > 0:
            raise InputError(f"case: sliding: layer: got {self.sliding.layer:g}; expected a positive number")


class Course(NamedTuple):
    """What a run is given at every control period; arrays (n,), or (cases, n) where cases differ."""

    position: Array
    """Reference, rad."""
    velocity: Array
    """rad/s."""
    acceleration: Array
    """rad/s**2."""
    load: Array | float = 0.0
    """Disturbing torque, positive along positive velocity, N*m."""
    drift_0: Array | float = 1.0
    """The plant's alpha_0 over that of the case: friction that changes during the run."""
    drift_2: Array | float = 1.0
    """The same of alpha_2."""
    noise: Array | float = 0.0
    """Added to the measured position, rad."""
