"""A joint as it is compensated: its friction, what is known of that, its controller, and which motion it follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bristle import edro
from bristle.control.adaptation import Adaptation, Learnt, gradient
from bristle.control.closed import Case, Course
from bristle.control.compensator import Compensator
from bristle.control.pid import Gains
from bristle.data.experiment import AdaptOptions, Experiment
from bristle.identification.estimate import Joint, TrackingFit
from bristle.model import functions
from bristle.model.arrays import Array, evaluate
from bristle.model.parameters import Kind, Lugre, Motor, Pair, unit

DRAWS = 60
"""Joints drawn from the covariance of the identified parameters."""
SEED = 0
_BANDWIDTH = 30.0
"""Of a controller that nobody gave, rad/s: K_p = J w**2, K_d = 2 J w, K_i = 0.2 J w**3 ..."""
_SLOWEST = 0.02
"""... but w no more than this over the control period."""
_DEFLECTION = 1e-3
"""Where nothing shows the bristle's stiffness: its deflection in slow sliding is this share of the reference's amplitude ..."""
_DAMPING_RATIO = 0.1
"""... and sigma_1 is that of (15)."""
_BEYOND = 30.0
"""A reference may be so many times as fast as what was measured."""
_COARSE = 0.02
"""The control period is at most this share of the reference's."""
_FREQUENCY = 0.5
"""Of a reference that nobody gave, Hz."""
_HALF = 0.5
"""Share of a parameter's error that is mended in a second, where no rates are given."""
_LOGARITHMIC = ("alpha_0", "v_s", "sigma_0", "inertia")
"""Drawn by their logarithms: they are positive."""


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

    def sine(self, frequency: float, duration: float, amplitude: float | None = None) -> Course:
        """Amplitude sin(2 pi frequency t)."""
        return sine(self.amplitude if amplitude is None else amplitude, frequency, duration, self.period)


def sine(amplitude: float, frequency: float, duration: float, period: float) -> Course:
    """Amplitude sin(2 pi frequency t), its velocity and its acceleration, from 0 to the duration, s."""
    t: Array = period * np.arange(round(duration / period) + 1, dtype=np.float64)
    w = 2 * np.pi * frequency
    return Course(amplitude * np.sin(w * t), amplitude * w * np.cos(w * t), -amplitude * w * w * np.sin(w * t))


def of_paper(joints: Sequence[Joint]) -> tuple[Subject, ...]:
    """The four joints of Table 1 under the paper's PID, each with what was identified of it from the embedded data."""
    found = []
    for joint in joints:
        pair = edro.TABLE_1[joint.name]
        found.append(
            Subject(
                name=joint.name, kind="revolute", plant=pair, model=identified(joint), J=edro.inertia(pair), draws=_draws(joint),
                gains=edro.PID_GAINS, amplitude=1.0, frequency=0.5, slow=0.2, period=1e-3, adaptation=Adaptation(),
                start={"alpha_0": 0.3, "alpha_2": 0.5}, simulated=True, assumptions=PAPER_ASSUMPTIONS,
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


def of_experiment(experiment: Experiment, joint: Joint) -> Subject:
    """A user's joint with its own `adapt` options, or with what bristle takes where there are none.

    Raises ValueError where no inertia is known, the runs do not give a whole model, or the adaptation cannot be as it is asked.
    """
    asked, found = experiment.adapt, identified(joint)
    J = _inertia(experiment, joint)
    assumed: list[str] = []
    frequency = asked.frequency or _FREQUENCY
    fastest = _fastest(joint, found)
    amplitude = asked.amplitude or float(f"{0.5 * fastest / (2 * np.pi * frequency):.2g}")
    beyond = 2 * np.pi * frequency * amplitude / fastest
    if beyond > _BEYOND:
        raise ValueError(
            f"{experiment.path}: adapt: a reference of {amplitude:g} at {frequency:g} Hz is {beyond:.3g} times as fast as anything measured; "
            f"expected at most {_BEYOND:g} times: lower adapt.amplitude or adapt.frequency"
        )
    if beyond > 1:
        assumed.append(f"The reference is {beyond:.2g} times as fast as anything measured: the model is extrapolated.")
    gains = _gains(asked, J, joint.kind, assumed)
    if asked.amplitude is None or asked.frequency is None:
        q = unit("position", joint.kind)
        assumed.append(
            f"Reference: {amplitude:.3g} {q} at {frequency:.3g} Hz; give adapt.amplitude and adapt.frequency."
        )
    unseen = _unseen(joint)
    model = _filled(found, unseen, amplitude, J)
    for d, names in unseen.items():
        for name in names:
            how = (
                f"{_DEFLECTION:g} of the amplitude in deflection"
                if name == "sigma_0"
                else f"(15) with a damping ratio of {_DAMPING_RATIO:g}"
            )
            assumed.append(
                f"{name} ({d}): these data do not show it; {getattr(model[d == '-'], name):.3g} {unit(name, joint.kind)}, {how}."
            )
    compensator, adaptation = asked_parts(experiment)
    if asked.gamma is None:
        adaptation = _paced(adaptation, model.positive, gains.K_p, amplitude * frequency, assumed)
    truth = _truth(joint)
    if truth is None:
        assumed.append(
            "The plant is the identified model itself: backlash, flexibility and noise are not in the simulations."
        )
    assumed.append(
        f"The drive gives the {'torque' if joint.kind == 'revolute' else 'force'} that it is asked for, every {asked.period:g} s, without limit."
    )
    return Subject(
        name=joint.name, kind=joint.kind, plant=truth or model, model=model, J=J,
        draws=tuple((_filled(pair, unseen, amplitude, inertia), inertia) for pair, inertia in _draws(joint)),
        gains=gains, amplitude=amplitude, frequency=frequency, slow=0.4 * frequency, period=asked.period, adaptation=adaptation,
        start=asked.start, simulated=joint.simulated, assumptions=tuple(assumed), compensator=compensator,
    )  # fmt: skip  # a list of values


def asked_parts(experiment: Experiment) -> tuple[Compensator, Adaptation]:
    """Compensator and adaptation as `adapt` asks for them; rates that are not given are zero.

    Raises ValueError, with the file's name, where they cannot be so.
    """
    asked = experiment.adapt
    longest = _COARSE / (asked.frequency or _FREQUENCY)
    if asked.period > longest:
        raise ValueError(
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
    except ValueError as error:
        raise ValueError(f"{experiment.path}: adapt: {str(error).removeprefix('adaptation: ')}") from error


def _paced(plain: Adaptation, p: Lugre[float], K_p: float, pace: float, assumed: list[str]) -> Adaptation:
    """The adaptation with rates that mend half of a parameter's error in a second.

    A parameter that is wrong by a share s makes an error of position of about s p G / K_p, G its derivative, so that its gain moves by
    gamma G s p G' / K_p a second: gamma is chosen at the mean speed of the reference, 4 times amplitude times frequency (`pace`).
    """
    names = plain.parameters
    rates = tuple(_rate(plain, k, p, K_p, 4 * pace) for k in range(len(names)))
    listed = ", ".join(f"{rate:.3g}" for rate in rates)
    assumed.append(
        f"Learning rates: {listed} for {', '.join(names)}, which mend about half of an error in a second; give adapt.gamma."
    )
    return replace(plain, gamma=rates)


def _rate(a: Adaptation, k: int, p: Lugre[float], K_p: float, v: float) -> float:
    """The rate of one parameter at speed v; 0 where the law has no gradient there."""
    z, *by = (float(x[0]) for x in evaluate(functions.steady_deflection(), np.array([v]), *p))
    slopes = tuple(by[Lugre._fields.index(name)] * getattr(p, name) for name in a.parameters)
    G = float(gradient(a, z, v, p, Learnt((1.0,) * len(slopes), slopes, ()))[k])
    T, T_z, *by_p = (float(x[0]) for x in evaluate(functions.torque_sensitivity(), np.array([z]), np.array([v]), *p))
    name = a.parameters[k]
    own = Lugre._fields.index(name)
    whole = getattr(p, name) * abs(by_p[own] + T_z * by[own])
    worth = abs(G) * max(whole, 1e-6 * abs(T))
    return _HALF * K_p / worth if worth > 0 else 0.0


def _gains(asked: AdaptOptions, J: float, kind: Kind, assumed: list[str]) -> Gains[float]:
    if asked.gains is not None:
        return Gains(asked.gains.K_p, asked.gains.K_i, asked.gains.K_d, asked.gains.filter_time)
    w = min(_BANDWIDTH, _SLOWEST / asked.period)
    gains = Gains(J * w**2, 0.2 * J * w**3, 2 * J * w, 0.0)
    q = unit("sigma_0", kind)
    assumed.append(
        f"PID: nobody gave one; K_p {gains.K_p:.3g} {q}, K_i and K_d to match, for {w:g} rad/s at this inertia; give adapt.gains."
    )
    return gains


def _fastest(joint: Joint, model: Pair[float]) -> float:
    """The fastest measured speed, rad/s."""
    moving = joint.joint_fit or joint.tracking
    known = [fit.velocity for fit in joint.static.values()] + ([moving.velocity] if moving is not None else [])
    speeds = [float(np.abs(v).max()) for v in known if v.size]
    return max(speeds, default=10 * max(p.v_s for p in model))


def identified(joint: Joint) -> Pair[float]:
    """The model that was identified: of all runs at once, or of constant velocities and slow loading.

    Raises ValueError where part of it is missing.
    """
    return Pair(*(_identified(joint, direction) for direction in "+-"))


def _identified(joint: Joint, direction: str) -> Lugre[float]:
    fit = joint.joint_fit or joint.tracking
    moving = fit and (fit.values(direction) or fit.values("both"))
    if moving:
        return moving
    static = joint.static.get(direction) or joint.static.get("both")
    p = static.values() if static else None
    slow = joint.presliding.fits.get(direction) if joint.presliding else None
    known = slow and slow.sigma_0.value
    if p is None or not slow or not known:
        what = "friction over velocity" if p is None else "bristle stiffness (sigma_0)"
        raise ValueError(
            f"{joint.name}: nothing is known of the {what} in direction {direction}; "
            "a compensator needs a tracking run, or ramp and presliding runs in both directions"
        )
    return p._replace(sigma_0=known, sigma_1=slow.sigma_1.value or 0.0)


def _unseen(joint: Joint) -> dict[str, list[str]]:
    """Of each direction what the moving runs do not show of the bristle, and was not given either."""
    fit = joint.joint_fit or joint.tracking
    if fit is None:
        return {}
    found = {}
    for d in "+-":
        known = {name: fit.parameters.get(name + d, fit.parameters.get(name)) for name in ("sigma_0", "sigma_1")}
        found[d] = [name for name, e in known.items() if e is not None and e.value is None]
    return found


def _filled(pair: Pair[float], unseen: Mapping[str, Sequence[str]], amplitude: float, J: float) -> Pair[float]:
    """The pair with a bristle where none was seen."""
    sets = []
    for p, d in zip(pair, "+-", strict=True):
        missing = unseen.get(d, ())
        sigma_0 = p.alpha_0 / (_DEFLECTION * amplitude) if "sigma_0" in missing else p.sigma_0
        damping = float(evaluate(functions.presliding_damping(), sigma_0, J, _DAMPING_RATIO)[0])
        sets.append(p._replace(sigma_0=sigma_0, sigma_1=damping if "sigma_1" in missing else p.sigma_1))
    return Pair(*sets)


def _truth(joint: Joint) -> Pair[float] | None:
    sets = [joint.truth.get(d) or joint.truth.get("both") for d in "+-"]
    known = [p for p in sets if p is not None and np.isfinite(p).all()]
    return Pair(*known) if len(known) == len(sets) else None


def _inertia(experiment: Experiment, joint: Joint) -> float:
    for fit in (joint.joint_fit, joint.tracking):
        if fit is not None:
            found = fit.parameters.get("inertia")
            value = found.value if found is not None and found.value else fit.fixed.get("inertia")
            if value and value > 0:
                return float(value)
    if experiment.inertia is not None:
        return experiment.inertia.value
    motor = experiment.motor
    if motor is not None and np.isfinite(motor.J):
        return motor.J
    raise ValueError(
        f"{joint.name}: no inertia is known, without which no loop can be simulated; give it as inertia, or a tracking run that shows it"
    )


def _draws(joint: Joint) -> tuple[tuple[Pair[float], float], ...]:
    """Joints from the covariance of the fit of moving runs; none where there is no such fit."""
    fit = joint.joint_fit or joint.tracking
    if fit is None or not fit.names:
        return ()
    values = {name: e.value for name, e in fit.parameters.items() if e.value is not None}
    names = [name for name in fit.names if name in values]
    own = [fit.names.index(name) for name in names]
    centre = np.array([values[name] for name in names])
    positive = np.array([name.rstrip("+-") in _LOGARITHMIC for name in names]) & (centre > 0)
    chain = np.where(positive, 1 / np.where(positive, centre, 1.0), 1.0)
    covariance = fit.covariance[np.ix_(own, own)] * np.outer(chain, chain)
    if not np.isfinite(covariance).all():
        return ()
    rng = np.random.default_rng(SEED)
    moved = rng.multivariate_normal(np.zeros(len(names)), covariance, DRAWS, method="eigh")
    with np.errstate(over="ignore"):
        drawn = np.where(positive, centre * np.exp(np.minimum(moved, 5.0)), np.maximum(centre + moved, 0.0))
    found = []
    for row in drawn.tolist():
        one = _with(fit, dict(zip(names, row, strict=True)))
        pair = Pair(*(_set(one, d) for d in "+-"))
        J = one.get("inertia")
        if J:
            found.append((pair, float(J)))
    return tuple(found)


def _with(fit: TrackingFit, drawn: Mapping[str, float]) -> dict[str, float]:
    return {**fit.fixed, **{name: e.value for name, e in fit.parameters.items() if e.value is not None}, **drawn}


def _set(values: Mapping[str, float], direction: str) -> Lugre[float]:
    return Lugre(*(values.get(name + direction, values.get(name, 0.0)) for name in Lugre._fields))


def one_way(subject: Subject) -> Subject:
    """A joint of Table 1 with its positive friction in both directions, model and plant alike: as the paper's Table 2 has it."""
    pair = Pair(subject.plant.positive, subject.plant.positive)
    return replace(subject, plant=pair, model=pair, J=edro.inertia(pair), draws=())
