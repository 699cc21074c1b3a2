"""What sensitivity is explored of: a user's joint or the paper's gripper, with its motion; what is not known of it is assumed, and said."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from bristle.data.experiment.load import Experiment
from bristle.data.units import to_si
from bristle.errors import InputError
from bristle.identification.identify import Measured
from bristle.identification.known_joint import Start, start_of
from bristle.identification.known_model import DEFLECTION, inertia_of
from bristle.identification.limits import Limits, limits_of
from bristle.identification.results import Estimate, Joint
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Kind, Lugre, Pair, unit
from bristle.questions.sensitivity.local import Motion, motion
from bristle.simulation import edro
from bristle.simulation.joint_loop import (
    JointLoop,
    fastest_measured,
    of_experiment,
    of_paper,
    one_way,
    requested_motion,
)

RANGE = (1e-6, 1e4)
"""Of a motion's amplitude over the measured travel, and of its peak speed over the fastest measured one."""
_BRISTLE = ("sigma_0", "sigma_1")
"""What is guessed where nothing was seen of it."""


class Model(NamedTuple):
    """What is known of a joint's friction."""

    p: Lugre[float] | Pair[float]
    estimates: Mapping[str, Estimate]
    """By name as in `information.names_of`, bare where both directions share it."""
    assumed: tuple[str, ...]
    """Names of what is not known, and was filled in."""
    said: tuple[str, ...]


def motion_of(
    kind: Kind, amplitude: str | float | None, frequency: str | float | None, default: tuple[float, float]
) -> Motion:
    """The motion asked for, as quantities with units or SI numbers; what is None is the default's (amplitude, frequency).

    Raises InputError where it is no quantity of its kind, or not positive.
    """
    asked = (("amplitude", amplitude, unit("position", kind)), ("frequency", frequency, "Hz"))
    found = [
        standard if given is None else _quantity(name, given, si)
        for (name, given, si), standard in zip(asked, default, strict=True)
    ]
    return motion(*found)


def within(moved: Motion, kind: Kind, limits: Limits) -> Motion:
    """The motion, if its amplitude and its peak speed are within `RANGE` of what was measured (or declared under `plan`).

    Raises InputError where they are not: there the model is of nothing.
    """
    q, v = unit("position", kind), unit("velocity", kind)
    how = f", which is {moved.amplitude:g} {q} at {moved.frequency:g} Hz"
    for name, got, known, si, what, whose in (
        ("amplitude", moved.amplitude, limits.travel, q, "travel", ""),
        ("peak speed", moved.top_speed, limits.velocity, v, "fastest speed", how),
    ):
        low, high = (share * known for share in RANGE)
        if not low <= got <= high:
            raise InputError(
                f"{name}: got {got:.3g} {si}{whose}; expected {low:.2g} to {high:.2g} {si}, "
                f"{RANGE[0]:g} to {RANGE[1]:g} times the joint's {what}: choose another amplitude or frequency"
            )
    return moved


def _quantity(name: str, given: str | float, si: str) -> float:
    if not isinstance(given, str):
        return float(given)
    try:
        return to_si(given, si)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error


def of_joint(
    measured: Measured, joint: Joint, amplitude: str | float | None = None, frequency: str | float | None = None
) -> tuple[Model, Motion, JointLoop | str]:
    """A user's joint, as identified from `measured`: what is known of it, the motion, and its loop, or the sentence why there is none.

    Raises InputError where nothing is known of its friction over velocity, or the motion cannot be.
    """
    experiment, sets = measured.experiment, _sets(joint)
    limits = _limits(measured)
    default = requested_motion(experiment.adapt, fastest_measured(joint, 1.0))
    moved = within(motion_of(joint.kind, amplitude, frequency, default), joint.kind, limits)
    model = _model(measured, joint, sets, limits)
    try:
        return model, moved, of_experiment(experiment, joint)
    except InputError as error:
        return model, moved, str(error)


def _limits(measured: Measured) -> Limits:
    """How far and how fast it went, as a plan takes it. Raises InputError where it did not move."""
    limits, _ = limits_of(measured)
    if not limits.travel > 0:
        raise InputError(
            f"{measured.experiment.path.name}: the position is {limits.position[0]:g} throughout; expected runs that move, or plan.position"
        )
    return limits


def of_gripper(
    measured: Measured, joint: Joint, amplitude: str | float | None = None, frequency: str | float | None = None
) -> tuple[Model, Motion, JointLoop | str]:
    """The paper's gripper rotation (+) in both directions, with the intervals that its simulated logs give; `joint` as identified from them.

    Raises InputError where the motion cannot be.
    """
    subject = one_way(of_paper([joint])[0])
    default = (subject.amplitude, subject.frequency)
    moved = within(motion_of("revolute", amplitude, frequency, default), "revolute", _limits(measured))
    p = edro.TABLE_1[joint.name].positive
    own = {name: _moved(e, getattr(p, name)) for name, e in _estimates(joint, "+").items() if e is not None}
    said = (
        "Friction: gripper rotation (+) of Table 1, in both directions; the paper's own numbers.",
        "Intervals: those of the embedded gripper, whose logs are SIMULATED from the same numbers, put about these numbers; the paper gives none.",
        "Noise: of the same simulated logs.",
        "Reference: 1 rad at 0.5 Hz if no other is given, as in the adaptation's experiment; the paper names no motion.",
    )
    return Model(p, own, (), said), moved, subject


def _moved(e: Estimate, value: float) -> Estimate:
    """The estimate with another value, and all else in proportion."""
    if not e.value:
        return e
    by = value / e.value
    error, interval = e.standard_error, e.interval
    return replace(
        e,
        value=value,
        standard_error=None if error is None else by * error,
        interval=None if interval is None else (by * interval[0], by * interval[1]),
    )


def _inertia_known(experiment: Experiment, joint: Joint) -> bool:
    try:
        return inertia_of(experiment, joint) > 0
    except InputError:
        return False


def _sets(joint: Joint) -> dict[str, Lugre[float]]:
    """What was fitted, by direction. Raises InputError where nothing is known of the friction over velocity."""
    sets = {d: p for d in ("both", "+", "-") if (p := _values(joint, d)) is not None}
    if not sets:
        raise InputError(
            f"{joint.name}: nothing is known of its friction over velocity; sensitivity needs ramp, points or tracking runs that were fitted"
        )
    return sets


def _model(measured: Measured, joint: Joint, sets: Mapping[str, Lugre[float]], limits: Limits) -> Model:
    """The friction of a joint, one set or a pair, with the bristle of a plan's start where none was seen."""
    ways = ["both"] if "both" in sets else list(sets)
    said = [] if len(ways) > 1 or ways == ["both"] else [f"Only direction {ways[0]} is known; it is taken for both."]
    filled, estimates, assumed = [], dict[str, Estimate](), list[str]()
    found = {d: _estimates(joint, d) for d in ways}
    unseen = any(name in _missing(own) for own in found.values() for name in _BRISTLE)
    start = start_of(measured, joint, limits) if unseen else None
    inertia = _inertia_known(measured.experiment, joint)
    for d in ways:
        own, tag = found[d], d if len(ways) > 1 else ""
        guesses = _guesses(start, d, joint.kind, inertia=inertia) if start else {}
        p, missing, sentences = _filled(sets[d], own, guesses, joint.kind)
        filled.append(p)
        assumed += [name + tag for name in missing]
        said += [f"{name}{tag}: {sentence}" for name, sentence in sentences.items()]
        shared = joint.moving is not None and tag
        for name, e in own.items():
            bare = shared and joint.moving and name in joint.moving.parameters
            if e is not None:
                estimates[name if bare else name + tag] = e
    return Model(filled[0] if len(filled) == 1 else Pair(*filled), estimates, tuple(assumed), tuple(said))


def _values(joint: Joint, d: str) -> Lugre[float] | None:
    if joint.moving is not None:
        return joint.moving.values(d)
    return joint.static[d].values() if d in joint.static else None


def _estimates(joint: Joint, d: str) -> dict[str, Estimate | None]:
    """What was found of each LuGre parameter of a direction; None where nothing looked for it."""
    fit, tag = joint.moving, "" if d == "both" else d
    if fit is not None:
        found = {name: fit.parameters.get(name + tag, fit.parameters.get(name)) for name in Lugre._fields}
        return {name: e for name, e in found.items() if e is not None or name not in fit.known}  # given: not unknown
    own: dict[str, Estimate | None] = dict.fromkeys(Lugre._fields)
    own |= {name: e for name, e in joint.static[d].parameters.items() if name in own}
    slow = joint.presliding.fits.get(d) if joint.presliding else None
    return own | ({"sigma_0": slow.sigma_0, "sigma_1": slow.sigma_1} if slow else {})


def _missing(own: Mapping[str, Estimate | None]) -> list[str]:
    return [name for name, e in own.items() if e is None or e.value is None]


def _guesses(start: Start, d: str, kind: Kind, *, inertia: bool) -> dict[str, tuple[float, str]]:
    """What a plan takes the bristle of a direction for, and how that is found: one joint, one guess."""
    p, key = start.p(d), start.key("sigma_0", "+" if d == "both" else d)
    stiff = f"{DEFLECTION:g} of the travel in deflection" if key in start.guessed else "as slow loading has it"
    damped = f"(15) with a damping ratio of {DAMPING_RATIO:g}"
    J = f"a guessed inertia of {start.inertia:.2g} {unit('inertia', kind)}"
    return {
        "sigma_0": (p.sigma_0, stiff),
        "sigma_1": (p.sigma_1, damped if inertia else f"{damped} and {J}"),
    }


def _filled(
    p: Lugre[float], own: Mapping[str, Estimate | None], guesses: Mapping[str, tuple[float, str]], kind: Kind
) -> tuple[Lugre[float], list[str], dict[str, str]]:
    """The set with what was found, a bristle where none was seen, the names of what is assumed, and a sentence on each."""
    missing = _missing(own)
    guessed = {name: guesses[name] for name in missing if name in guesses}
    seen = {name: e.value for name, e in own.items() if e is not None and e.value is not None}
    p = p._replace(**seen, **{name: value for name, (value, _) in guessed.items()})
    sentences = {}
    for name in missing:
        how = guessed[name][1] if name in guessed else "as it was held in the fit"
        sentences[name] = f"these data do not show it; assumed {getattr(p, name):.3g} {unit(name, kind)}, {how}."
    return p, missing, sentences
