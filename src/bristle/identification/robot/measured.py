"""Measured runs of a robot, joint by joint, with known link torques."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bristle.data.bandwidth import decimation
from bristle.data.experiment.load import Experiment, Run, from_current, in_own_unit
from bristle.data.experiment.schema import PlusMinus
from bristle.data.record import Record
from bristle.data.robot.motion import (
    LinkTorques,
    RigidBody,
    RobotMotion,
    read_motions,
    reader_of,
    rigid_body,
    runs_of,
    without_links,
)
from bristle.data.robot.robot_file import JointOfRobot, Robot
from bristle.data.robot.urdf import Urdf
from bristle.estimation import levels
from bristle.findings import CAUTION, CRITICAL, Finding, unit_of
from bristle.identification.fits import Estimate
from bristle.identification.measured import Measured, measured_of, refuse_repeated
from bristle.identification.moving_runs import LEVELS, regressors
from bristle.identification.robot.links import (
    UNSEEN,
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
from bristle.workers import Share

_SAMPLES = 500  # for the mean inertia of the links


def measure_robot(
    robot: Robot,
    progress: Progress | None = None,
    share: Share = map,
    only: str | None = None,
    constant: Estimate | None = None,
) -> tuple[Measured, ...]:
    """What each joint to identify measured; with a URDF also link torques, torque constants and plausibility checks.

    `share` maps the joints, `only` is the one wanted, `constant` its known torque constant. Raises InputError.
    """
    parts = [part._replace(constant=constant) for part in _parts(robot, progress) if only in (None, part.name)]
    measured: list[Measured] = []
    for part, done in zip(parts, share(_measured, parts), strict=True):
        if progress:
            progress(f"links of {part.name}", len(measured), len(parts))
        measured.append(done)
    return tuple(measured)


def against_urdf(robot: Robot) -> dict[str, tuple[Finding, ...]]:
    """Findings of the logs against the URDF, by joint. Raises InputError as `measure_robot` does."""
    found = {}
    for part in _parts(robot, None):
        found[part.name] = (*part.findings, *(() if part.joint.free else scale_warnings(_scale(part))))
    return found


def _parts(robot: Robot, progress: Progress | None) -> list["_Part"]:
    """The joints to identify, with findings of all together."""
    body = None if robot.urdf is None else rigid_body(robot.urdf, robot.names, robot.gravity, robot.payload)
    reader = reader_of(robot)
    motions = read_motions(robot, reader)
    asked = [joint for joint in robot.joints if joint.identify]
    read, links = {}, None if body is None else LinkTorques(body, robot.names)
    for k, joint in enumerate(asked):
        if progress:
            progress(f"reading {joint.experiment.joint.name}", k, len(asked))
        read[joint.experiment.joint.name] = runs_of(joint.experiment, motions, links, reader)
    together = _of_all(robot, motions, read, body)
    parts = []
    for joint in asked:
        name = joint.experiment.joint.name
        inertia, moving = None, [m for m in motions.values() if name in m.moving]
        if body is not None and moving:  # of the links, on average over the longest run
            motion = max(moving, key=lambda m: m.moving[name].time.size)
            time = motion.moving[name].time
            q = motion.at(time[:: max(1, time.size // _SAMPLES)], robot.names)[0]
            inertia = float(body.inertias(q)[:, robot.names.index(name)].mean())
        findings = (*together.get(name, ()), *_limits(robot.urdf, name, read[name], in_amperes=joint.free))
        parts.append(_Part(joint, read[name], robot.urdf is not None, inertia, findings))
    return parts


class _Part(NamedTuple):
    """A joint and findings of all together."""

    joint: JointOfRobot
    runs: tuple[Run, ...]
    linked: bool  # Whether link torques are known
    link_inertia: float | None
    findings: tuple[Finding, ...]
    constant: Estimate | None = None  # The torque constant, if already found

    @property
    def name(self) -> str:
        return self.joint.experiment.joint.name


def _scale(part: _Part) -> LinkScale:
    """Scale of the links by the static fit."""
    return link_scale(part.joint.experiment, _training(part.runs)) if part.linked else UNSEEN


def _measured(part: _Part) -> Measured:
    """One joint, in N*m, or in A without a torque constant."""
    experiment, runs, seen = part.joint.experiment, part.runs, _scale(part)
    findings, constant = list(part.findings), None
    if part.linked and part.joint.free:
        beside = in_own_unit(experiment, tuple(dict.fromkeys((*regressors(experiment), "links"))))
        # no refinement where the log contradicts the declared order or gravity
        wrong = any(f.code in {"joint-order", "gravity-direction"} for f in findings)
        refined = seen if wrong else scale_beside_bristles(beside, _training(runs), seen)
        constant = part.constant or torque_constant(refined if seen.told else seen, experiment.joint.kind)
        experiment, runs = _with_constant(experiment, runs, refined, constant.value, constant.standard_error)
        findings += [] if constant.value else constant.warnings
    else:
        findings += scale_warnings(seen)
    runs = tuple(map(without_links, runs))
    refuse_repeated(experiment, runs)
    whole = measured_of(experiment, runs)
    return replace(whole, findings=tuple(findings), torque_constant=constant, link_inertia=part.link_inertia)


def _training(runs: Sequence[Run]) -> tuple[Record, ...]:
    return tuple(run.record for run in runs if run.kind == "tracking" and not run.hold_out)


def _with_constant(
    experiment: Experiment, runs: tuple[Run, ...], found: LinkScale, K: float | None, error: float | None
) -> tuple[Experiment, tuple[Run, ...]]:
    """The joint in N*m by a torque constant; without one in A, links as regressor if clear."""
    if K is None:
        clear = found.scale > levels.CLEAR * found.error
        beside = tuple(name for name in regressors(experiment) if name not in LEVELS)
        asked = tuple(dict.fromkeys((*beside, "links"))) if clear else experiment.fit.regressors
        by = experiment.motor.k_t if experiment.motor else 1.0  # 1 N*m/A, but for a gear
        links = {} if clear else {"link_torque": None}
        bare = tuple(run.having(torque=np.asarray(run.record.torque) / by, torque_shifts={}, **links) for run in runs)
        return in_own_unit(experiment, asked), bare
    constants, known = experiment.motor_constants, PlusMinus(value=K, standard_error=error)
    scaled_by = constants and constants.model_copy(update={"torque_constant": known})
    own = experiment.model_copy(update={"motor_constants": scaled_by})
    (constant,) = (c for c in own.torque_constants if c.name == "torque_constant")
    scaled = []
    for run in runs:
        current = np.asarray(run.record.torque)
        shifts = {**{c: K * x for c, x in run.record.torque_shifts.items()}, str(constant): current * (error or 0.0)}
        notes = tuple(
            from_current(K * d.numbers["k_t"], d.numbers["unit"]) if d.code == "torque-from-current" else d
            for d in run.record.notes
        )
        scaled.append(run.having(torque=K * current, torque_shifts=shifts, notes=notes))
    return own, tuple(scaled)


def _limits(urdf: Urdf | None, name: str, runs: Sequence[Run], *, in_amperes: bool) -> list[Finding]:
    """Positions, speeds and torques beyond the URDF's limits: critical beyond what any drive has."""
    if urdf is None:
        return []
    joint, found = urdf.joint(name), list[Finding]()
    effort = np.inf if in_amperes else joint.effort
    for signal, low, high, share, slack in (
        ("position", joint.lower, joint.upper, 0.0, levels.BEYOND_LIMIT),
        ("velocity", -joint.velocity, joint.velocity, levels.SAMPLES_BEYOND, levels.BEYOND_LIMIT * joint.velocity),
        ("torque", -effort, effort, levels.SAMPLES_BEYOND, (levels.PEAK_EFFORT - 1) * effort),
    ):
        logged = np.concatenate([np.zeros(0), *(x for run in runs if (x := getattr(run.record, signal)) is not None)])
        if not logged.size:
            continue
        least, most = np.quantile(logged, [share, 1 - share]).tolist()
        if least >= low - slack and most <= high + slack:
            continue
        of, far = unit_of(signal), signal == "torque" and max(-least, most) > levels.NO_DRIVE * effort
        message = (
            f"The {signal} runs from {least:.3g} to {most:.3g}{of}; the URDF allows {low:.3g} to {high:.3g}{of}: check "
            f"{'the unit, the torque constant and the gear' if signal == 'torque' else 'the order of the joints, units and the URDF'}."
        )
        named = {"signal": signal, "low": least, "high": most, "least": low, "most": high}
        beyond = Finding("beyond-urdf", CAUTION, message, named)
        found.append(Finding("effort-far-beyond", CRITICAL, message, named) if far else beyond)
    return found


def _of_all(
    robot: Robot, motions: Mapping[str, RobotMotion], read: Mapping[str, tuple[Run, ...]], body: RigidBody | None
) -> dict[str, tuple[Finding, ...]]:
    """Findings from all joints together in the longest run with several moving, by joint."""
    shared: dict[str, dict[str, Record]] = {}
    for name, runs in read.items():
        for record in _training(runs):
            shared.setdefault(record.file, {})[name] = record
    by_file = {motion.file: motion for motion in motions.values()}
    together = {file: own for file, own in shared.items() if len(own) > 1 or len(by_file[file].moving) > 1}
    if not together:
        return {}
    file = max(together, key=lambda f: (len(together[f]), next(iter(together[f].values())).time.size))
    own = together[file]
    first = next(iter(own.values()))
    q, v, a = by_file[file].at(first.time, robot.names)
    torque = np.ones_like(q)  # for joints at rest or not identified
    for name, r in own.items():
        torque[:, robot.names.index(name)] = np.interp(first.time, r.time, np.asarray(r.torque))
    kinds = tuple(joint.experiment.joint.kind for joint in robot.joints)
    whole = Course(time=first.time, q=q, v=v, a=a, torque=torque, kinds=kinds)
    every = robot.joints[0].experiment.fit.decimation or decimation([*own.values()])
    course, moved = thinned(whole, every, file)
    if body is None:
        found: dict[str, tuple[Finding, ...]] = {}
        for name in own:
            share = 100 * coupling(course, moved, robot.names.index(name))
            message = (
                "Other joints move too and no URDF is named, so the torque of the links is not removed: it may be "
                f"{share:.0f} % of this joint's torque. Name the URDF under robot, as urdf."
            )
            if share > 100 * levels.LINK_TORQUE:
                found[name] = (Finding("links-not-removed", CRITICAL, message, {"share": share}),)
        return found
    if len(own) < len(robot.names):  # an order needs all joints moving, with torques
        return {}
    return dict.fromkeys(robot.names, order_warnings(course, moved, robot.names, body, robot.gravity))
