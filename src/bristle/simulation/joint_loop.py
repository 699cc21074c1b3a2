"""A joint as it is compensated: its friction, what is known of that, its controller, and which motion it follows; the paper's four."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.control.compensator import Compensator
from bristle.control.pid import Gains
from bristle.control.wiring import Case, Course
from bristle.identification.known_joint import draws_of, whole
from bristle.identification.results import Joint
from bristle.model.parameters import Kind, Motor, Pair
from bristle.simulation import edro


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """A joint to be compensated. Units are those of a revolute joint; rad stands for m and N*m for N where it slides."""

    name: str
    kind: Kind
    plant: Pair[float]
    """Friction as it is: the truth of simulated data, else as identified."""
    model: Pair[float]
    """Friction as identified."""
    J: float
    """Inertia of the plant, kg*m**2."""
    draws: tuple[tuple[Pair[float], float], ...] = ()
    """Joints that the identified covariance allows: friction and inertia."""
    gains: Gains[float]
    amplitude: float
    """Of the sinusoidal reference, rad."""
    frequency: float
    """Of the reference of the adaptation, Hz."""
    slow: float
    """Of the reference of the other experiments, Hz."""
    period: float
    """Control period, s."""
    adaptation: Adaptation
    start: Mapping[str, float]
    """Where the adaptation begins, as shares of the model's parameters."""
    simulated: bool
    assumptions: tuple[str, ...] = ()
    tracing: Adaptation | None = None
    """The total law, by which replays tell parameters apart; None: none."""
    compensator: Compensator = field(default_factory=Compensator)
    """The paper's, if no other was asked for: LuGre driven by the reference velocity."""

    def case(self, plant: Pair[float] | None = None, model: Pair[float] | None = None, J: float | None = None) -> Case:
        """Numbers of a run; what is not given is the subject's own."""
        inertia = self.J if J is None else J
        return Case(
            plant=plant or self.plant, motor=Motor(1.0, 1.0, 0.0, inertia), model=model or self.model, gains=self.gains
        )

    def begun(self, model: Pair[float]) -> Pair[float]:
        """A model with the wrong parameters with which the adaptation begins."""
        return Pair(
            *(p._replace(**{name: share * getattr(p, name) for name, share in self.start.items()}) for p in model)
        )

    @property
    def observer_gain(self) -> float:
        """Gain k of the observer, 1/s: at most K_p a second of integral action, through the stiffest bristle."""
        return self.gains.K_p / max(p.sigma_0 for p in self.model)

    def sine(self, frequency: float, duration: float, amplitude: float | None = None) -> Course:
        """A reference: amplitude sin(2 pi frequency t), the plan's amplitude if no other is given."""
        return sine(self.amplitude if amplitude is None else amplitude, frequency, duration, self.period)


def sine(amplitude: float, frequency: float, duration: float, period: float) -> Course:
    """The course amplitude sin(2 pi frequency t), with its velocity and its acceleration, from 0 to the duration, s."""
    t: Array = period * np.arange(round(duration / period) + 1, dtype=np.float64)
    w = 2 * np.pi * frequency
    return Course(amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w * w * np.sin(w * t))


def stacked(courses: Sequence[Course]) -> Course:
    """Courses of one length, one for each case: position, velocity and acceleration, (cases, n)."""
    return Course(*(np.stack([getattr(c, part) for c in courses]) for part in ("position", "velocity", "acceleration")))


def of_paper(joints: Sequence[Joint]) -> tuple[Subject, ...]:
    """The four joints of Table 1 under the paper's PID, each with what was identified of it from the embedded data."""
    found = []
    for joint in joints:
        pair = edro.TABLE_1[joint.name]
        J = edro.inertia(pair)
        found.append(
            Subject(
                name=joint.name, kind="revolute", plant=pair, model=whole(joint).pair(1.0, J), J=J,
                draws=draws_of(joint, 1.0, J),
                gains=edro.PID_GAINS, amplitude=1.0, frequency=0.5, slow=0.2, period=1e-3, adaptation=Adaptation(),
                start=edro.TABLE_2_START, simulated=True, assumptions=PAPER_ASSUMPTIONS,
            )
        )  # fmt: skip  # a list of values
    return tuple(found)


PAPER_ASSUMPTIONS: tuple[str, ...] = (
    "Reference: 1 rad sin(2 π f t), 0.2 Hz for Figs 5 to 8 and 0.5 Hz for the adaptation; the paper gives neither amplitude nor frequency.",
    "Control in torque: the PID's output is taken in N·m and its error in rad; the paper gives no unit of its control signal and no motor.",
    "Inertia: (15) inverted, J = (σ₁ / 0.2)² / σ₀, the mean of the two directions; the paper gives none.",
    "Learning rates: 20 for both gains, with e in rad; the paper's [0, 1] fits an error in degrees (20 per rad is 0.35 per degree).",
    "Sampling: controller, compensator and adaptation at 1 kHz; the paper ran continuous blocks. The position is measured as it is, unless an "
    "encoder is named.",
    "Table 2: the paper says wrist, its numbers are the gripper's; plant and model have its (+) parameters in both directions.",
    "No inertia feed-forward, unless it is named.",
)
"""Every constant of the closed loop that the paper does not give."""


def one_way(subject: Subject) -> Subject:
    """A joint of Table 1 with its positive friction in both directions, model and plant alike: as the paper's Table 2 has it."""
    pair = Pair(subject.plant.positive, subject.plant.positive)
    return replace(subject, plant=pair, model=pair, J=edro.inertia(pair), draws=())
