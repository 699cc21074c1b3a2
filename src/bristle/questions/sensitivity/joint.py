"""The joint and motion of a sensitivity study: a user's joint, or the paper's gripper, with assumed parameters."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from bristle.data.units import positive_si
from bristle.errors import InputError
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate
from bristle.identification.known_joint import DEFLECTION, guessed_inertia, inertia_of, known_joint, without_load
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Direction, Kind, Lugre, Pair, ParameterName, of_friction, unit
from bristle.questions.sensitivity.local import SineMotion, motion
from bristle.simulation import edro, joint_loop
from bristle.simulation.limits import Limits, limits_of

RANGE = (1e-6, 1e4)  # of amplitude over measured travel, and of peak speed over the fastest measured one


class KnownFriction(NamedTuple):
    """The friction model of a joint."""

    p: Lugre[float] | Pair[float]
    estimates: Mapping[ParameterName, Estimate]
    assumed: tuple[ParameterName, ...]  # parameters that are not known
    assumptions: tuple[Finding, ...]  # their values, and what else is assumed


Request = tuple[KnownFriction, SineMotion, joint_loop.JointLoop | str]  # the loop, or why there is none
Asked = str | float | None  # a quantity or an SI number; None: the default


def motion_of(kind: Kind, amplitude: Asked, frequency: Asked, default: tuple[float, float]) -> SineMotion:
    """The motion asked for. Raises InputError where a quantity is of another kind or not positive."""
    asked = (("amplitude", amplitude, unit("position", kind)), ("frequency", frequency, "Hz"))
    pairs = zip(asked, default, strict=True)
    return motion(*(own if given is None else positive_si(name, given, si) for (name, given, si), own in pairs))


def within(moved: SineMotion, kind: Kind, limits: Limits) -> SineMotion:
    """The motion. Raises InputError where amplitude or peak speed is out of `RANGE` of the joint's limits."""
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


def of_joint(measured: Measured, joint: Joint, amplitude: Asked = None, frequency: Asked = None) -> Request:
    """A user's joint. Raises InputError where no friction is known, or the motion is not possible."""
    experiment, known = measured.experiment, known_joint(joint)
    directions = known.directions
    if not directions:
        raise InputError(
            f"{joint.name}: nothing is known of its friction vs velocity; sensitivity needs ramp, points or tracking runs that were fitted"
        )
    limits = _limits(measured)
    default = joint_loop.requested_motion(experiment.adapt, joint_loop.fastest_measured(joint))
    moved = within(motion_of(joint.kind, amplitude, frequency, default), joint.kind, limits)

    # One set or a pair, with an assumed bristle where none was identified.
    assumptions = [*without_load(joint), *([joint.torque_scale] if joint.torque_scale else [])]
    if len(directions) == 1 and directions != (Direction.BOTH,):
        message = f"Only direction {directions[0]} is known; it is used for both."
        assumptions.append(Finding("one-direction-known", CAUTION, message, {"direction": directions[0]}))
    identified = inertia_of(experiment, joint)
    J = identified or guessed_inertia(max(known.values(d)["alpha_0"] for d in directions), limits.acceleration)
    sets, estimates, assumed = [], dict[ParameterName, Estimate](), list[ParameterName]()
    inertia = "" if identified else f" and a guessed inertia of {J:.2g} {unit('inertia', joint.kind)}"
    guesses = {
        "sigma_0": f"from a deflection of {DEFLECTION:g} of the travel",
        "sigma_1": f"from (15) with a damping ratio of {DAMPING_RATIO:g}{inertia}",
    }
    for d in directions:
        sets.append(known.filled(d, limits.travel, J))
        own = d if len(directions) > 1 else Direction.BOTH
        for name in known.missing(d):
            how = guesses.get(name, "as it was held in the fit")
            guessed, value, si = ParameterName(name, own), getattr(sets[-1], name), unit(name, joint.kind)
            message = f"{guessed}: not identifiable from these data; assumed {value:.3g} {si}, {how}."
            assumptions.append(Finding("bristle-assumed", CAUTION, message, {"name": guessed, "value": value}))
            assumed.append(guessed)
        for parameter, e in known.estimates.items():
            if of_friction(parameter.name) and parameter.direction in (d, Direction.BOTH):
                estimates[parameter if len(directions) > 1 else parameter._replace(direction=own)] = e
    p = sets[0] if len(sets) == 1 else Pair(*sets)
    model = KnownFriction(p, estimates, tuple(assumed), tuple(assumptions))
    try:
        return model, moved, replace(joint_loop.of_experiment(experiment, joint), carried=None)
    except InputError as error:
        return model, moved, str(error)


def _limits(measured: Measured) -> Limits:
    """Travel and speeds as a plan takes them. Raises InputError where the joint did not move."""
    limits, _ = limits_of(measured)
    if not limits.travel > 0:
        raise InputError(
            f"{measured.experiment.path.name}: the position is {limits.position[0]:g} throughout; expected runs that move, or plan.position"
        )
    return limits


def of_gripper(measured: Measured, joint: Joint, amplitude: Asked = None, frequency: Asked = None) -> Request:
    """The paper's gripper rotation (+) in both directions, with intervals of simulated logs. Raises as `of_joint`."""
    subject = joint_loop.one_way(joint_loop.of_paper([joint])[0])
    default = (subject.amplitude, subject.frequency)
    moved = within(motion_of("revolute", amplitude, frequency, default), "revolute", _limits(measured))
    p = edro.TABLE_1[joint.name].positive
    known = known_joint(joint)
    estimates = dict[ParameterName, Estimate]()
    for name in Lugre._fields:  # the paper's value, with errors in proportion
        e, value = known.estimate(name, Direction.POSITIVE), getattr(p, name)
        if e is not None and e.value:
            by, error = value / e.value, e.standard_error
            ends = e.interval and (by * e.interval[0], by * e.interval[1])
            e = Estimate(value=value, unit=e.unit, standard_error=error and by * error, interval=ends)
        if e is not None:
            estimates[ParameterName(name, Direction.BOTH)] = e
    friction = "Friction: gripper rotation (+) of Table 1, in both directions; the paper's own numbers."
    intervals = (
        "Intervals: those of the embedded gripper, whose logs are SIMULATED from the same numbers, put about these "
        "numbers; the paper gives none."
    )
    told = "1 rad at 0.5 Hz unless another is given, as assumed for the adaptive experiment; the paper names no motion."
    assumptions = (
        Finding("gripper-friction", NOTE, friction),
        Finding("gripper-intervals", CAUTION, intervals),
        Finding("gripper-noise", CAUTION, "Noise: of the same simulated logs."),
        Finding("gripper-reference", CAUTION, f"Reference: {told}"),
    )
    return KnownFriction(p, estimates, (), assumptions), moved, subject
