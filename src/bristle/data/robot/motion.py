"""Torque that a robot's links ask of each joint, by Pinocchio, and the motion of all joints in a run."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.bandwidth import of_motion
from bristle.data.cleaning import make_record
from bristle.data.columns import Key, reading
from bristle.data.differentiation import estimate_motion
from bristle.data.experiment.load import Experiment, Run, files_of, read_run, table_of_run
from bristle.data.experiment.schema import GRAVITY
from bristle.data.experiment.signals import DRIVE
from bristle.data.experiment.tables import RunFiles, Source, keys_of
from bristle.data.record import Record
from bristle.data.robot.robot_file import Robot
from bristle.data.robot.urdf import Payload, Urdf
from bristle.data.text_table import RawTable, Reader, read_table
from bristle.errors import InputError, short_list
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

MAX_JOINTS = 100  # most joints that move: what Pinocchio keeps for a robot grows with their cube


@dataclass(frozen=True, slots=True)
class RigidBody:
    """A robot without friction, with its joints in a given order; other joints rest at zero."""

    model: Any  # pinocchio's
    places: tuple[int, ...]  # where each joint stands among the model's

    def torques(self, q: Array, v: Array, a: Array, *, gravity: Sequence[float] | None = None) -> Array:
        """Torque of each joint along a motion, N*m or N, (n, joints): M(q) a + C(q, v) v + g(q).

        Position q, rad or m, velocity v and acceleration a are (n, joints), gravity, m/s**2, in the frame of the base,
        (3,); None: as the robot was made with.
        """
        import pinocchio

        model = self.model if gravity is None else _under(self.model, gravity)
        data = model.createData()
        order = np.argsort(self.places)
        rows = zip(*(np.ascontiguousarray(x[:, order]) for x in (q, v, a)), strict=True)
        # Pinocchio takes one sample a call, of some microseconds
        found = np.array([pinocchio.rnea(model, data, *row) for row in rows]).reshape(len(q), len(order))
        return np.asarray(found[:, list(self.places)])

    def inertias(self, q: Array) -> Array:
        """Inertia of the links at each joint while others rest, kg*m**2 or kg, (n, joints): the diagonal of M(q)."""
        zero, unit = np.zeros_like(q), np.eye(q.shape[1])
        still = self.torques(q, zero, zero)
        moved = [self.torques(q, zero, zero + e)[:, k] for k, e in enumerate(unit)]
        return np.stack(moved, axis=1) - still


def largest_gravity(urdf: Urdf, name: str | None) -> float:
    """Torque of a joint's gravity a quarter turn from where it hangs, N*m, other joints at zero; None: the only joint.

    Raises InputError as `rigid_body`, where no joint of several is named, or it slides, or its axis is vertical.
    """
    known = [joint.name for joint in urdf.joints]
    if name is None and len(known) != 1:
        has = f"{urdf.file}: has {len(known)} joints: {short_list(known)}"
        raise InputError(f"{has}; name the one of the log, as in --name {known[0]}")
    body = rigid_body(urdf, [name or known[0]], (0.0, 0.0, -GRAVITY), None)
    still = np.zeros((2, 1))
    size = float(np.hypot(*body.torques(np.array([[0.0], [np.pi / 2]]), still, still)[:, 0]))
    if urdf.joint(name or known[0]).kind != "revolute" or not size > 1e-9:
        why = "which slides, or turns about a vertical axis"
        raise InputError(f"{urdf.file}: gravity makes no torque of {name or known[0]}, {why}")
    return size


def rigid_body(urdf: Urdf, names: Sequence[str], gravity: Sequence[float], payload: Payload | None) -> RigidBody:
    """The robot of a URDF with its joints in the order of `names`.

    Raises InputError where Pinocchio is missing or refuses the URDF, there is no such joint, or there are too many.
    """
    try:
        import pinocchio
    except ImportError as error:
        remedy = "install it with pip install 'bristle[robot]', or leave robot out"
        raise InputError(f"robot.urdf needs Pinocchio, which is not installed; {remedy}") from error
    if len(names) > MAX_JOINTS:
        raise InputError(f"got {len(names)} joints of {urdf.file}; expected at most {MAX_JOINTS}")
    own = [urdf.places[urdf.joint(name).name] for name in names]
    with reading("URDF that Pinocchio reads"):
        whole = pinocchio.buildModelFromXML(urdf.holding(payload) if payload else urdf.text)
        held = [k for k, name in enumerate(whole.names) if k and name not in own]
        model = pinocchio.buildReducedModel(whole, held, pinocchio.neutral(whole)) if held else whole
    places = tuple(int(model.joints[model.getJointId(name)].idx_v) for name in own)
    return RigidBody(_under(model, gravity), places)


def _under(model: Any, gravity: Sequence[float]) -> Any:
    import pinocchio

    own = pinocchio.Model(model)
    own.gravity.linear = np.asarray(gravity, dtype=float)
    return own


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotMotion:
    """The motion of each joint in one run."""

    file: str  # as results call it
    moving: Mapping[str, Record]  # of each joint that moves: position, velocity, acceleration
    resting: Mapping[str, float]  # where each of the others rests, rad or m

    def at(self, time: Array, names: tuple[str, ...]) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of joints at some times, s, (n, joints) each; linear between samples."""
        q, v, a = (np.zeros((time.size, len(names))) for _ in range(3))
        for k, name in enumerate(names):
            if name in self.resting:
                q[:, k] = self.resting[name]
                continue
            r = self.moving[name]
            for out, values in ((q, r.position), (v, r.velocity), (a, r.acceleration)):
                out[:, k] = np.interp(time, r.time, np.asarray(values))
        return q, v, a


def reader_of(robot: Robot) -> Reader:
    """A reader that reads each log of a robot once, with all columns that will be asked of it."""
    signals = [joint.everywhere.signals_of(run) for joint in robot.joints for run in joint.everywhere.runs]
    clocks = [key for x in signals if x.time is not None for key in x.time.columns()]
    own = (key for x in signals for name, key in keys_of(x).items() if name not in x.apart())
    asked = dict.fromkeys([*clocks, *own])
    tables: dict[Path, RawTable] = {}

    def read(path: Path, keys: Sequence[Key], shown: str | None = None) -> RawTable:
        if path not in tables and asked.keys() >= set(keys):
            with suppress(InputError):  # a file may lack what others have
                tables[path] = read_table(path, list(asked), shown)
        table = tables.get(path)
        if table is None or not table.columns.keys() >= set(keys):
            return read_table(path, keys, shown)
        return replace(table, columns={key: table.columns[key] for key in keys})

    return read


def read_motions(robot: Robot, read: Reader) -> dict[str, RobotMotion]:
    """The motion of all joints in each run over time, by the run's key.

    Raises InputError where a joint has no position, or a file cannot be read as declared.
    """
    records, called = dict[str, dict[str, Record | float]](), dict[str, str]()
    for joint in robot.joints:
        experiment = joint.everywhere
        for run, sources in files_of(experiment):
            if run.experiment != "points":
                key = _key(run, sources)
                called[key], moved = _motion(experiment, run, sources, read)
                records.setdefault(key, {})[experiment.joint.name] = moved
    travels = {
        key: {name: 0.0 if isinstance(x, float) else float(np.ptp(np.asarray(x.position))) for name, x in own.items()}
        for key, own in records.items()
    }
    farthest = {name: max((t.get(name, 0.0) for t in travels.values()), default=0.0) for name in robot.names}
    motions = dict[str, RobotMotion]()
    for key, own in records.items():
        rests = {
            name for name, x in travels[key].items() if x <= max(levels.JOINT_RESTS, levels.STILL * farthest[name])
        }
        at = {name: x if isinstance(x, float) else float(np.median(np.asarray(x.position))) for name, x in own.items()}
        motions[key] = RobotMotion(
            file=called[key],
            moving={name: x for name, x in own.items() if isinstance(x, Record) and name not in rests},
            resting={name: x for name, x in at.items() if name in rests},
        )
    return motions


def _key(run: RunFiles, sources: list[Source]) -> str:
    """Key of a run: its files, and the part of them."""
    return repr((sources, run.rows, run.time))


def _motion(experiment: Experiment, run: RunFiles, sources: list[Source], read: Reader) -> tuple[str, Record | float]:
    """The name of a run, and the motion of one joint in it, or where it rests."""
    signals = experiment.signals_of(run).model_copy(update=dict.fromkeys(DRIVE))
    if signals.position is None:
        why = f"{experiment.joint.name} has no position, which a robot's joints need"
        raise InputError(f"{experiment.path}: {why}; name it under signals")
    table, shown = table_of_run(experiment, run, sources, signals, read)
    keys = keys_of(signals)
    logged = table.columns[keys["position"]] * signals.position.factor("position", experiment.context)
    seen = logged[np.isfinite(logged)]
    if seen.size and np.ptp(seen) <= levels.JOINT_RESTS:
        return shown, float(np.median(seen))
    velocity = None if signals.velocity is None else table.columns[keys["velocity"]]
    if velocity is not None and np.ptp(velocity[np.isfinite(velocity)]) == 0:
        signals = signals.model_copy(update={"velocity": None})
    try:
        record = make_record(shown, table, signals, experiment.cleaning, experiment.context)
    except InputError as error:
        raise InputError(f"{shown}: {experiment.joint.name}: {str(error).removeprefix(f'{shown}: ')}") from error
    return shown, estimate_motion(record, experiment.fit.position_cutoff or of_motion)


class LinkTorques:
    """Link torques of all joints in a run, computed once for the joints whose records have the same times."""

    def __init__(self, body: RigidBody, names: tuple[str, ...]) -> None:
        self._body, self._names = body, names
        self._known: dict[str, tuple[Array, Array]] = {}

    def of(self, name: str, motion: RobotMotion, time: Array) -> Array:
        """Torque of a joint at some times of a run, N*m or N, (n,)."""
        before, torques = self._known.get(motion.file, (np.zeros(0), np.zeros((0, len(self._names)))))
        if not np.array_equal(before, time):
            torques = self._body.torques(*motion.at(time, self._names))
            self._known[motion.file] = time, torques
        return torques[:, self._names.index(name)]


def runs_of(
    experiment: Experiment, motions: Mapping[str, RobotMotion], links: LinkTorques | None, read: Reader
) -> tuple[Run, ...]:
    """The runs in which a joint moves, with the torque of the links where the robot is known.

    Raises InputError as `read_runs`, and where the joint moves in no run.
    """
    name = experiment.joint.name
    runs = []
    for run, sources in files_of(experiment):
        motion = motions.get(_key(run, sources))
        if motion is not None and name in motion.resting and run.experiment != "presliding":
            continue
        record = read_run(experiment, run, sources, read)
        if links is not None and motion is not None:
            record = replace(record, link_torque=links.of(name, motion, record.time))
        runs.append(Run(kind=run.experiment, record=record, hold_out=run.hold_out))
    if not runs:
        remedy = "log it while it moves, or give it identify: false under joints"
        raise InputError(f"{experiment.path}: {name} rests in every run; {remedy}")
    return tuple(runs)


def without_links(run: Run) -> Run:
    """A run at constant velocity, or of slow loading, less the links' torque; the fit of a moving run takes it off."""
    r = run.record
    if run.kind == "tracking" or r.link_torque is None or r.torque is None:
        return run
    largest = float(np.abs(r.link_torque).max())
    message = f"The torque of the links, at most {largest:.3g} N*m, was taken off before segments were looked for."
    note = Finding("links-taken-off", NOTE, message, {"largest": largest})
    return replace(run, record=replace(r, torque=r.torque - r.link_torque, link_torque=None, notes=(*r.notes, note)))
