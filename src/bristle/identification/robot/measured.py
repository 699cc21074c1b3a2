"""What the logs of a robot measured, joint by joint: each with the links' torque known, and its torque constant if that was free."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bristle.data.experiment.load import Experiment, Run
from bristle.data.experiment.schema import PlusMinus
from bristle.data.experiment.signals import Signal, Signals
from bristle.data.record import Record
from bristle.data.robot.motion import RobotMotion, read_motions, runs_of, without_links
from bristle.data.robot.rigid_body import RigidBody, rigid_body
from bristle.data.robot.robot_file import JointOfRobot, Robot
from bristle.data.robot.urdf import Urdf
from bristle.diagnostics import Diagnostic, Kind
from bristle.identification.measured import Measured, measured_of, refuse_repeated
from bristle.identification.moving_runs import regressors
from bristle.identification.robot.links import (
    Course,
    LinkScale,
    coupling,
    link_scale,
    order_warnings,
    scale_beside_bristles,
    scale_warnings,
    thinned,
    torque_constant,
)
from bristle.progress import Progress

_BEYOND = 0.01
"""rad or m: a position beyond a limit by more is none of that joint."""
_LEAST = 0.05
"""Of a joint's torque: what the links may amount to, below which nothing is said."""
_SAMPLES = 500
"""Samples over which the inertia of the links is averaged."""


def measure_robot(robot: Robot, progress: Progress | None = None) -> tuple[Measured, ...]:
    """What each joint of a robot measured that is to be identified.

    With a URDF the torque of the links is known: it stands in each record, its scale gives a torque constant that is free,
    and the order of joints and gravity's direction are checked against the log. Without one the other joints' motion is in
    each torque, and it is said how much. Raises InputError where a file cannot be used as declared.
    """
    body = None if robot.urdf is None else rigid_body(robot.urdf, robot.names, robot.gravity, robot.payload)
    motions = read_motions(robot)
    asked = [joint for joint in robot.joints if joint.identify]
    read = {}
    for k, joint in enumerate(asked):
        if progress:
            progress(f"reading {joint.experiment.joint.name}", k, len(asked))
        read[joint.experiment.joint.name] = runs_of(joint.experiment, motions, robot.names, body)
    together = _of_all(robot, motions, read, body)
    return tuple(_measured(robot, joint, read, motions, body, together) for joint in asked)


def _measured(
    robot: Robot,
    joint: JointOfRobot,
    read: Mapping[str, tuple[Run, ...]],
    motions: Mapping[str, RobotMotion],
    body: RigidBody | None,
    together: Mapping[str, tuple[Diagnostic, ...]],
) -> Measured:
    """One joint: in N*m, or where its torque constant is not seen in A."""
    experiment, name = joint.experiment, joint.experiment.joint.name
    runs = read[name]
    findings = list(together.get(name, ()))
    constant = None
    if body is not None:
        training = _training(runs)
        found = link_scale(experiment, training) if training else None
        if joint.free:
            if found is not None:
                asked = tuple(dict.fromkeys((*regressors(experiment), "links")))
                found = scale_beside_bristles(_in_amperes(experiment, asked), training, found)
            seen = found or LinkScale(scale=0.0, error=np.inf, explained=0.0, left=0.0)
            constant = torque_constant(seen, experiment.joint.kind)
            experiment, runs = _with_constant(experiment, runs, seen, constant.value, constant.standard_error)
            findings += [] if constant.value else constant.warnings
        elif found is not None:
            findings += scale_warnings(found)
        findings += _limits(robot.urdf, name, runs)
    runs = tuple(map(without_links, runs))
    refuse_repeated(experiment, runs)
    whole = measured_of(experiment, runs)
    inertia = None if body is None else _link_inertia(body, robot.names, name, motions)
    return replace(whole, findings=tuple(findings), torque_constant=constant, link_inertia=inertia)


def _training(runs: Sequence[Run]) -> tuple[Record, ...]:
    return tuple(run.record for run in runs if run.kind == "tracking" and not run.hold_out)


def _with_constant(
    experiment: Experiment, runs: tuple[Run, ...], found: LinkScale, K: float | None, error: float | None
) -> tuple[Experiment, tuple[Run, ...]]:
    """The joint with the torque constant that was found, or in A where none was: then the links are a regressor, or too small for one."""
    if K is None:
        clear = found.scale > 2 * found.error
        asked = tuple(dict.fromkeys((*regressors(experiment), "links"))) if clear else experiment.fit.regressors
        own = _in_amperes(experiment, asked)
        return own, runs if clear else tuple(_with(run, link_torque=None) for run in runs)
    constants = experiment.motor_constants
    known = PlusMinus(value=K, standard_error=None if error is None else float(f"{error:.3g}"))
    own = experiment.model_copy(
        update={"motor_constants": constants and constants.model_copy(update={"torque_constant": known})}
    )
    (constant,) = (c for c in own.torque_constants if c.name == "torque_constant")
    scaled = []
    for run in runs:
        current = np.asarray(run.record.torque)
        shifts = {**{c: K * x for c, x in run.record.torque_shifts.items()}, str(constant): current * (error or 0.0)}
        notes = tuple(d.but(k_t=K) if d.kind is Kind.TORQUE_FROM_CURRENT else d for d in run.record.notes)
        scaled.append(_with(run, torque=K * current, torque_shifts=shifts, notes=notes))
    return own, tuple(scaled)


def _with(run: Run, **changed: object) -> Run:
    return replace(run, record=replace(run.record, **changed))  # type: ignore[arg-type]  # fields by name


def _in_amperes(experiment: Experiment, asked: tuple[str, ...] | None) -> Experiment:
    """The joint whose torque is a current, A, all that follows with it."""

    def renamed(signals: Signals) -> Signals:
        """The current as the torque."""
        current = signals.current
        own = None if current is None else Signal(**{**dict(current), "unit": "A"})
        return signals.model_copy(update={"current": None, "torque": own})

    runs = tuple(
        run if run.signals is None else run.model_copy(update={"signals": renamed(run.signals)})
        for run in experiment.runs
    )
    kind = "prismatic in A" if experiment.joint.kind == "prismatic" else "revolute in A"
    return experiment.model_copy(
        update={
            "joint": experiment.joint.model_copy(update={"kind": kind}),
            "motor_constants": None,
            "inertia": None,
            "signals": renamed(experiment.signals),
            "runs": runs,
            "fit": experiment.fit.model_copy(update={"regressors": asked}),
            "plan": experiment.plan.model_copy(update={"torque": None}),
        }
    )


def _limits(urdf: Urdf | None, name: str, runs: Sequence[Run]) -> list[Diagnostic]:
    """Positions and speeds that the URDF says the joint cannot have."""
    if urdf is None:
        return []
    joint = urdf.joint(name)
    q = np.concatenate([np.asarray(r.record.position) for r in runs if r.record.position is not None] or [np.zeros(0)])
    v = np.concatenate([np.asarray(r.record.velocity) for r in runs if r.record.velocity is not None] or [np.zeros(0)])
    found = []
    if q.size and (q.min() < joint.lower - _BEYOND or q.max() > joint.upper + _BEYOND):
        found.append(
            Kind.BEYOND_URDF(signal="position", low=q.min(), high=q.max(), least=joint.lower, most=joint.upper)
        )
    if v.size and np.quantile(np.abs(v), 0.999) > joint.velocity * (1 + _BEYOND):
        found.append(
            Kind.BEYOND_URDF(signal="velocity", low=v.min(), high=v.max(), least=-joint.velocity, most=joint.velocity)
        )
    return found


def _link_inertia(
    body: RigidBody, names: tuple[str, ...], name: str, motions: Mapping[str, RobotMotion]
) -> float | None:
    """What the joint has to accelerate of the links, on average over its moving runs, kg*m**2 or kg."""
    times = [(m, m.moving[name].time) for m in motions.values() if name in m.moving]
    if not times:
        return None
    motion, time = max(times, key=lambda pair: pair[1].size)
    q = motion.at(time[:: max(1, time.size // _SAMPLES)], names)[0]
    return float(body.inertias(q)[:, names.index(name)].mean())


def _of_all(
    robot: Robot, motions: Mapping[str, RobotMotion], read: Mapping[str, tuple[Run, ...]], body: RigidBody | None
) -> dict[str, tuple[Diagnostic, ...]]:
    """By joint, what its torque says when all joints are looked at together, in the longest run where more than one moves."""
    shared: dict[str, dict[str, Record]] = {}
    for name, runs in read.items():
        for record in _training(runs):
            shared.setdefault(record.file, {})[name] = record
    together = {file: own for file, own in shared.items() if len(own) > 1 or len(motions[file].moving) > 1}
    if not together:
        return {}
    file = max(together, key=lambda f: (len(together[f]), next(iter(together[f].values())).time.size))
    own = together[file]
    names = tuple(name for name in robot.names if name in own)
    kinds = tuple(j.experiment.joint.kind for j in robot.joints if j.experiment.joint.name in own)
    first = own[names[0]]
    everyone = motions[file].at(first.time, robot.names)
    torque = np.column_stack([np.interp(first.time, own[n].time, np.asarray(own[n].torque)) for n in names])
    decimation = robot.joints[0].experiment.fit.decimation
    if body is None:
        q, v, a = everyone
        padded = np.column_stack(
            [torque[:, names.index(n)] if n in names else np.ones(len(torque)) for n in robot.names]
        )
        course, moved = thinned(Course(time=first.time, q=q, v=v, a=a, torque=padded, kinds=kinds), decimation, file)
        shares = {name: coupling(course, moved, robot.names.index(name)) for name in names}
        return {name: (Kind.LINKS_NOT_REMOVED(share=100 * x),) for name, x in shares.items() if x > _LEAST}
    if names != robot.names:  # an order of joints that do not all move and have a torque cannot be told
        return {}
    q, v, a = everyone
    course, moved = thinned(Course(time=first.time, q=q, v=v, a=a, torque=torque, kinds=kinds), decimation, file)
    found = order_warnings(course, moved, names, body.torques, robot.gravity)
    return dict.fromkeys(names, found)
