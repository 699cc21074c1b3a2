"""A joint with its friction, controller and reference: the paper's four, or a user's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from bristle.control.adaptation import Adaptation, Law, steady_gradient
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Case
from bristle.control.pid import Gains
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import AdaptOptions
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.known_joint import DEFLECTION, inertia_of, rises_of, whole, without_load
from bristle.identification.moving_runs import load_columns, terms_of
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import SIGNED, Direction, Lugre, Motor, Pair, ParameterName, unit
from bristle.model.parameters import Kind as JointKind
from bristle.model.rollout import load_level
from bristle.model.vectorize import evaluate
from bristle.simulation import edro
from bristle.simulation.drawn_joints import draws_of
from bristle.simulation.references import Sine

_FREQUENCY = 0.5  # of the default reference, Hz
_BESIDE = ("offset", "gravity", "spring", "quadratic")  # terms of the torque beside friction, inertia and links


class Carried(NamedTuple):
    """The load along a motion, where friction rises with it."""

    rises: Mapping[str, float]  # Coefficients of `law.load_levels`, by name
    others: Mapping[str, float]  # Coefficients of `law.load_terms`, by name


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLoop:
    """A joint to be compensated; rad stands for m and N*m for N where it slides."""

    name: str
    kind: JointKind
    plant: Pair[float]  # The truth of simulated data, else as identified
    model: Pair[float]  # Friction as identified
    J: float  # Inertia of the plant, kg*m**2
    draws: tuple[tuple[Pair[float], float], ...] = ()
    """Joints drawn from covariance and errors of constants: friction and inertia."""
    draws_by_constants: tuple[tuple[Pair[float], float], ...] = ()  # Joints drawn from errors of constants alone
    gains: Gains[float]
    amplitude: float  # Of the sinusoidal reference, rad
    frequency: float  # Of the reference for adaptation, Hz
    slow: float  # Of the other references, Hz
    period: float  # Control period, s
    adaptation: Adaptation
    start: Mapping[str, float]  # Shares of the model's parameters where the adaptation begins
    simulated: bool
    assumptions: tuple[Finding, ...] = ()
    diagnostic_law: Adaptation | None = None  # The total law, for replays, or None
    compensator: Compensator = field(default_factory=Compensator)
    """By default the paper's: LuGre driven by the reference velocity."""
    carried: Carried | None = None
    centre: float = 0.0  # Position about which references swing, rad

    def case(self, plant: Pair[float] | None = None, model: Pair[float] | None = None, J: float | None = None) -> Case:
        """Numbers of a run, by default the joint's own."""
        motor = Motor(1.0, 1.0, 0.0, self.J if J is None else J)
        return Case(plant=plant or self.plant, motor=motor, model=model or self.model, gains=self.gains)

    def wrong_start(self, model: Pair[float]) -> Pair[float]:
        """A wrong model for the adaptation to begin with."""
        wrong = ({name: share * getattr(p, name) for name, share in self.start.items()} for p in model)
        return Pair(*(p._replace(**own) for p, own in zip(model, wrong, strict=True)))

    def comparable_rates(self, law: Law) -> tuple[float, ...]:
        """The adaptation's rates for another law: times or over the parameter that only one law has in its gradient."""
        plan, begun = self.adaptation, self.wrong_start(self.model).positive
        power = (plan.law == "partial-theta") - (law == "partial-theta")
        sizes = (getattr(begun, name) or 1.0 for name in plan.parameters)
        return tuple(float(g * size**power) for g, size in zip(plan.gamma, sizes, strict=True))

    @property
    def observer_gain(self) -> float:
        """Gain k of the observer, 1/s: at most K_p a second of integral action, through the stiffest bristle."""
        return self.gains.K_p / max(p.sigma_0 for p in self.model)

    def sine(self, frequency: float, duration: float, amplitude: float | None = None) -> Reference:
        """A sine of this frequency, Hz, by default of the joint's amplitude."""
        sine = Sine(self.amplitude if amplitude is None else amplitude, frequency)
        return self.under_load(sine.sampled(duration, self.period))

    def under_load(self, motion: Reference) -> Reference:
        """A reference, (n,), from the centre, with the level to which friction rises under the load along it.

        The motor's torque follows the reference with steady friction (9), that of the links is gravity. Raises
        InputError where friction would rise by more than its load.
        """
        if self.carried is None:
            return motion
        there = motion._replace(position=motion.position + self.centre)
        columns = load_columns(_BESIDE, lambda name: getattr(there, name), motion.position.size)
        torques = {name: value * columns[name] for name, value in self.carried.others.items()}
        still = np.zeros(motion.position.size)
        gravity = np.asarray(sum(torques.get(name, still) for name in terms_of("gravity").names))
        own = self.J * motion.acceleration + sum(torques.values())
        v, level = motion.velocity, np.zeros_like(motion.position)
        curve = functions.steady_torque_function(self.model.law)
        own += np.where(v < 0, *(evaluate(curve, v, *p.stribeck)[0] for p in reversed(self.model)))
        for _ in range(200):  # friction is part of its own load: iterated
            before, level = level, load_level(self.carried.rises, own + level * np.sign(v), -gravity)
            if not np.isfinite(level).all():
                break
            if np.abs(level - before).max() <= 1e-9 * level.max():
                return motion._replace(level=level)
        raise InputError(
            f"{self.name}: friction rises by more than the load does ({', '.join(self.carried.rises)}), so no torque moves the joint; "
            "expected coefficients well below 1: fit without the load"
        )


def of_paper(joints: Sequence[Joint]) -> tuple[JointLoop, ...]:
    """The four joints of Table 1 under the paper's PID, with what was identified of the embedded data."""
    loops = []
    for joint in joints:
        pair = edro.TABLE_1[joint.name]
        J, known = edro.inertia(pair), whole(joint)
        loops.append(
            JointLoop(
                name=joint.name, kind="revolute", plant=pair, model=known.pair(1.0, J), J=J,
                draws=draws_of(joint, known, 1.0, J),
                gains=edro.PID_GAINS, amplitude=1.0, frequency=0.5, slow=0.2, period=1e-3, adaptation=Adaptation(),
                start=edro.TABLE_2_START, simulated=True, assumptions=PAPER_ASSUMPTIONS,
            )
        )  # fmt: skip  # a list of values
    return tuple(loops)


PAPER_ASSUMPTIONS: tuple[Finding, ...] = (
    Finding("paper-reference", CAUTION, "Reference: 1 rad sin(2 pi f t), 0.2 Hz for Figs 5 to 8 and 0.5 Hz for the "
        "adaptation; the paper gives neither amplitude nor frequency."),
    Finding("paper-control", CAUTION, "Control in torque: the PID's output is taken in N*m and its error in rad; the paper "
        "gives no unit of its control signal and no motor."),
    Finding("paper-inertia", CAUTION, "Inertia: (15) inverted, J = (sigma_1 / 0.2)**2 / sigma_0, the mean of the two "
        "directions; the paper gives none."),
    Finding("paper-rates", CAUTION, "Learning rates: 20 for both gains, with e in rad; the paper's [0, 1] fits an error in "
        "degrees (20 per rad is 0.35 per degree)."),
    Finding("paper-sampling", CAUTION, "Sampling: controller, compensator and adaptation at 1 kHz; the paper ran continuous "
        "blocks. The position is measured as it is, unless an encoder is named."),
    Finding("paper-table-2", CAUTION, "Table 2: the paper says wrist, its numbers are the gripper's; plant and model have "
        "its (+) parameters in both directions."),
)  # fmt: skip  # a table
"""Constants of the closed loop that the paper does not give."""


def one_way(loop: JointLoop) -> JointLoop:
    """A joint of Table 1 with its positive friction both ways, as in the paper's Table 2."""
    pair = Pair(loop.plant.positive, loop.plant.positive)
    return replace(loop, plant=pair, model=pair, J=edro.inertia(pair), draws=())


def of_experiment(experiment: Experiment, joint: Joint) -> JointLoop:
    """A user's joint with its `adapt` options, or defaults.

    Raises InputError where no inertia or no complete model is known, or an option is not possible.
    """
    asked, known, J = experiment.adapt, whole(joint), inertia_of(experiment, joint)
    if J is None:
        raise InputError(
            f"{joint.name}: no inertia is known, without which no loop can be simulated; give it as inertia, or a tracking run that shows it"
        )
    carried, fastest = _carried(joint), fastest_measured(joint)
    assumed = [] if carried else list(without_load(joint))
    amplitude, frequency = requested_motion(asked, fastest)
    speed = 2 * np.pi * frequency * amplitude
    beyond = speed / fastest
    if beyond > levels.FASTER:
        raise InputError(
            f"{experiment.path}: adapt: a reference of {amplitude:g} at {frequency:g} Hz is {beyond:.3g} times as fast as anything measured; "
            f"expected at most {levels.FASTER:g} times: lower adapt.amplitude or adapt.frequency"
        )
    if beyond > 1:
        message = f"The reference is {beyond:.2g} times as fast as anything measured: the model is extrapolated."
        assumed.append(Finding("extrapolated", CAUTION, message, {"ratio": beyond}))
    gains = _gains(asked, J, joint.kind, assumed)
    if asked.amplitude is None or asked.frequency is None:
        q = unit("position", joint.kind)
        message = f"Reference: {amplitude:.3g} {q} at {frequency:.3g} Hz; set adapt.amplitude and adapt.frequency to override."
        assumed.append(Finding("reference-taken", NOTE, message, {"amplitude": amplitude, "frequency": frequency}))
    travel = joint.travel or amplitude
    model = known.pair(travel, J)
    by_deflection = f"from a deflection of {DEFLECTION:g} of the {'travel' if joint.travel else 'amplitude'}"
    ways = {"sigma_0": by_deflection, "sigma_1": f"from (15) with a damping ratio of {DAMPING_RATIO:g}"}
    assumed += [
        bristle_filled(ParameterName(name, d), getattr(p, name), joint.kind, how)
        for d, p in zip(SIGNED, model, strict=True) for name, how in ways.items() if name in known.missing(d)
    ]  # fmt: skip  # two loops
    compensator, adaptation = asked_parts(experiment)
    if asked.gamma is None:
        adaptation = _paced(adaptation, model.positive, gains.K_p, speed, assumed)
    total = replace(adaptation, law="total")
    diagnostic_law = None if adaptation.law == "total" else _paced(total, model.positive, gains.K_p, speed, [])
    # the wrong model starts as given, else at the paper's shares or one half
    shares = {name: asked.start.get(name, 0.5) for name in adaptation.parameters}
    start = asked.start if "start" in asked.model_fields_set else shares
    truth = truth_of(joint)
    if truth is None:
        message = "The plant is the identified model itself, and its drive has no limit: backlash, flexibility and noise are left out."
        assumed.append(Finding("plant-is-model", CAUTION, message))
    assumed += [joint.torque_scale] if joint.torque_scale else []
    loop = JointLoop(
        name=joint.name, kind=joint.kind, plant=truth or model, model=model, J=J,
        draws=draws_of(joint, known, travel, J), draws_by_constants=draws_of(joint, known, travel, J, statistical=False),
        gains=gains, amplitude=amplitude, frequency=frequency, slow=0.4 * frequency, period=asked.period, adaptation=adaptation,
        start=dict(start), simulated=joint.simulated, assumptions=tuple(assumed), diagnostic_law=diagnostic_law,
        carried=carried, centre=asked.centre if carried else 0.0,
    )  # fmt: skip  # a list of values
    if carried:
        rise = float(np.max(loop.sine(frequency, 1 / frequency).level))
        torque, position = unit("torque", joint.kind), unit("position", joint.kind)
        message = (
            f"Friction rises with load ({' and '.join(carried.rises)}): model and plant have it, by up to {rise:.3g} {torque} along the reference "
            f"about position {asked.centre:.3g} {position} (set adapt.centre to override); gravity itself is taken as compensated."
        )
        numbers = {"names": tuple(carried.rises), "rise": rise, "centre": asked.centre}
        told = Finding("load-of-reference", CAUTION, message, numbers)
        loop = replace(loop, assumptions=(told, *loop.assumptions))
    return replace(loop, compensator=replace(compensator, observer_gain=loop.observer_gain))


def truth_of(joint: Joint) -> Pair[float] | None:
    """The true sets of simulated data, if complete."""
    sets = [joint.truth.get(d) or joint.truth.get(Direction.BOTH) for d in SIGNED]
    known = [p for p in sets if p is not None and np.isfinite(p).all()]
    return Pair(*known) if len(known) == len(sets) else None


def bristle_filled(name: ParameterName, value: float, kind: JointKind, how: str) -> Finding:
    """A caution on an assumed parameter of the bristle."""
    of = f"{name.name} ({name.direction})" if name.direction in SIGNED else name.name
    message = f"{of}: not identifiable from these data; assumed {value:.3g} {unit(name.name, kind)}, {how}."
    return Finding("bristle-filled", CAUTION, message, {"name": name.name, "value": value, "direction": name.direction})


def _carried(joint: Joint) -> Carried | None:
    """The load along a motion, or None."""
    rises = rises_of(joint)
    known = {name.name: x for name, x in joint.moving.known.items()} if joint.moving is not None else {}
    others = {name: known[name] for beside in _BESIDE for name in terms_of(beside).names if name in known}
    told = "gravity_sin" in others or set(rises) == {"motor_load"}
    return Carried(rises, others) if rises and told and joint.link_inertia is None else None


def asked_parts(experiment: Experiment) -> tuple[Compensator, Adaptation]:
    """Compensator and adaptation by `adapt`, missing rates zero. Raises InputError, with the file's name."""
    asked = experiment.adapt
    longest = 0.02 / (asked.frequency or _FREQUENCY)
    if asked.period > longest:
        raise InputError(
            f"{experiment.path}: adapt.period: got {asked.period:g} s; expected at most {longest:g} s, a fiftieth of the reference's period"
        )
    names = ("law", "step", "parameters", "gamma", "limits", "dead_zone", "leakage", "forgetting")
    given: dict[str, Any] = {name: value for name in names if (value := getattr(asked, name)) is not None}
    if "gamma" not in given:
        given["gamma"] = (0.0,) * len(given.get("parameters", Adaptation().parameters))
    try:
        adaptation = Adaptation(**given)
        name: Any = asked.compensator
        return replace(Compensator(name=name, adaptation=adaptation), adaptation=None), adaptation
    except InputError as error:
        raise InputError(f"{experiment.path}: adapt: {str(error).removeprefix('adaptation: ')}") from error


def _paced(plain: Adaptation, p: Lugre[float], K_p: float, fastest: float, assumed: list[Finding]) -> Adaptation:
    """The adaptation with rates that halve a parameter's error in a second, along a sine with this top speed, rad/s.

    A relative error s of a parameter p makes a position error of about s p D / K_p, D the total derivative of the
    torque, so its gain moves by gamma G s p D / K_p a second, in steady sliding. A parameter without torque there gets
    the rate zero.
    """
    v = fastest * np.sin(np.pi * (np.arange(64) + 0.5) / 128)  # a quarter of the sine
    z, *by = evaluate(functions.steady_deflection_function(p.law), v, *p)
    T, T_z, *by_p = evaluate(functions.torque_sensitivity_function(p.law), z, v, *p)
    names, rates = plain.parameters, []
    for name, G in zip(names, np.abs(steady_gradient(plain, v, p)), strict=True):
        at = p._fields.index(name)
        worth = float(np.mean(G * (getattr(p, name) * np.abs(by_p[at] + T_z * by[at]))))
        seen = worth > 1e-3 * float(np.mean(G) * np.mean(np.abs(T)))
        rates.append(0.5 * K_p / worth if seen else 0.0)
    told = ", ".join(f"{rate:.3g}" for rate in rates)
    still = "" if all(rates) else "; zero where a parameter has no effect in steady sliding"
    message = (
        f"Learning rates: {told} for {', '.join(names)}, which halve the error in about 1 s{still} "
        "(set adapt.gamma to override)."
    )
    assumed.append(Finding("rates-taken", NOTE, message, {"rates": tuple(rates)}))
    return replace(plain, gamma=tuple(rates))


def _gains(asked: AdaptOptions, J: float, kind: JointKind, assumed: list[Finding]) -> Gains[float]:
    if asked.gains is not None:
        return Gains(asked.gains.K_p, asked.gains.K_i, asked.gains.K_d, asked.gains.filter_time)
    w = min(30.0, 0.02 / asked.period)  # rad/s
    gains = Gains(J * w**2, 0.2 * J * w**3, 2 * J * w, 0.0)
    message = (
        f"PID: default, K_p {gains.K_p:.3g} {unit('sigma_0', kind)}, K_i and K_d to match, for {w:g} rad/s at this inertia "
        "(set adapt.gains to override)."
    )
    assumed.append(Finding("default-pid", CAUTION, message, {"K_p": gains.K_p, "bandwidth": w}))
    return gains


def fastest_measured(joint: Joint) -> float:
    """The fastest measured speed, rad/s. Raises InputError without any."""
    moving = joint.moving
    known = [fit.velocity for fit in joint.static.values()] + ([moving.velocity] if moving is not None else [])
    fastest = max((float(np.abs(v).max()) for v in known if v.size), default=0.0)
    if not fastest:
        raise InputError(f"{joint.name}: its results hold no measured velocity; identify it from its logs again")
    return fastest


def requested_motion(asked: AdaptOptions, fastest: float) -> tuple[float, float]:
    """Amplitude, rad, and frequency, Hz: as asked for, else 0.5 Hz and half the fastest speed, rad/s."""
    frequency = asked.frequency or _FREQUENCY
    return asked.amplitude or float(f"{0.5 * fastest / (2 * np.pi * frequency):.2g}"), frequency
