"""What sensitivity is explored of: a user's joint or the paper's gripper, with its motion; what is not known of it is assumed, and said."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle import edro
from bristle.analysis.sensitivity import Motion, motion
from bristle.compensation.asked import of_experiment
from bristle.compensation.model import DAMPING_RATIO, DEFLECTION, inertia_of
from bristle.compensation.subject import Subject, of_paper, one_way
from bristle.data.experiment import Experiment
from bristle.data.units import to_si
from bristle.identification.estimate import Estimate, Joint
from bristle.model import functions
from bristle.model.arrays import evaluate
from bristle.model.parameters import Kind, Lugre, Pair, unit

_FREQUENCY = 0.5
"""Hz, of a motion that nobody gave; its top speed is half the fastest measured one."""


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

    Raises ValueError where it is no quantity of its kind, or not positive.
    """
    asked = (("amplitude", amplitude, unit("position", kind)), ("frequency", frequency, "Hz"))
    found = [
        standard if given is None else _quantity(name, given, si)
        for (name, given, si), standard in zip(asked, default, strict=True)
    ]
    return motion(*found)


def _quantity(name: str, given: str | float, si: str) -> float:
    if not isinstance(given, str):
        return float(given)
    try:
        return to_si(given, si)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from error


def of_joint(
    experiment: Experiment, joint: Joint, amplitude: str | float | None = None, frequency: str | float | None = None
) -> tuple[Model, Motion, Subject | str]:
    """A user's joint: what is known of it, the motion, and its loop, or the sentence why there is none.

    Raises ValueError where nothing is known of its friction over velocity, or the motion cannot be.
    """
    tone = experiment.adapt.frequency or _FREQUENCY
    speeds = [fit.velocity for fit in joint.static.values()] + ([joint.moving.velocity] if joint.moving else [])
    fastest = max((float(np.abs(v).max()) for v in speeds if v.size), default=1.0)
    wide = experiment.adapt.amplitude or float(f"{0.5 * fastest / (2 * np.pi * tone):.2g}")
    moved = motion_of(joint.kind, amplitude, frequency, (wide, tone))
    model = model_of(joint, moved.amplitude, _inertia(experiment, joint))
    try:
        return model, moved, of_experiment(experiment, joint)
    except ValueError as error:
        return model, moved, str(error)


def of_gripper(
    joint: Joint, amplitude: str | float | None = None, frequency: str | float | None = None
) -> tuple[Model, Motion, Subject | str]:
    """The paper's gripper rotation (+) in both directions, with the intervals that its simulated logs give; `joint` as identified from them.

    Raises ValueError where the motion cannot be.
    """
    subject = one_way(of_paper([joint])[0])
    moved = motion_of("revolute", amplitude, frequency, (subject.amplitude, subject.frequency))
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


def _inertia(experiment: Experiment, joint: Joint) -> float | None:
    try:
        return inertia_of(experiment, joint)
    except ValueError:
        return None


def model_of(joint: Joint, amplitude: float, J: float | None) -> Model:
    """The friction of a joint, one set or a pair, with a bristle where none was seen.

    Raises ValueError where nothing is known of its friction over velocity.
    """
    sets = {d: p for d in ("both", "+", "-") if (p := _values(joint, d)) is not None}
    if not sets:
        raise ValueError(
            f"{joint.name}: nothing is known of its friction over velocity; sensitivity needs ramp, points or tracking runs that were fitted"
        )
    ways = ["both"] if "both" in sets else list(sets)
    said = [] if len(ways) > 1 or ways == ["both"] else [f"Only direction {ways[0]} is known; it is taken for both."]
    filled, estimates, assumed = [], dict[str, Estimate](), list[str]()
    for d in ways:
        own, tag = _estimates(joint, d), d if len(ways) > 1 else ""
        p, missing, sentences = _filled(sets[d], own, amplitude, J, joint.kind)
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


def _filled(
    p: Lugre[float], own: Mapping[str, Estimate | None], amplitude: float, J: float | None, kind: Kind
) -> tuple[Lugre[float], list[str], dict[str, str]]:
    """The set with what was found, a bristle where none was seen, the names of what is assumed, and a sentence on each."""
    p = p._replace(**{name: e.value for name, e in own.items() if e is not None and e.value is not None})
    missing = [name for name, e in own.items() if e is None or e.value is None]
    said = {}
    if "sigma_0" in missing:
        p = p._replace(sigma_0=p.alpha_0 / (DEFLECTION * amplitude))
        said["sigma_0"] = f"{DEFLECTION:g} of the amplitude in deflection"
    if "sigma_1" in missing:
        damping = float(evaluate(functions.presliding_damping(), p.sigma_0, J, DAMPING_RATIO)[0]) if J else 0.0
        p = p._replace(sigma_1=damping)
        said["sigma_1"] = f"(15) with a damping ratio of {DAMPING_RATIO:g}" if J else "for no inertia is known"
    said |= {name: "as it was held in the fit" for name in missing if name not in said}
    sentences = {
        name: f"these data do not show it; assumed {getattr(p, name):.3g} {unit(name, kind)}, {how}."
        for name, how in said.items()
    }
    return p, missing, sentences
