"""How all joints of a robot move in a run, and what its links then ask of each: read beside the runs of each joint."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bristle.arrays import Array
from bristle.data.bandwidth import of_motion
from bristle.data.cleaning import make_record
from bristle.data.columns import Key
from bristle.data.differentiation import estimate_motion
from bristle.data.experiment.load import Experiment, Run, files_of, read_run, table_of_run
from bristle.data.experiment.signals import DRIVE
from bristle.data.experiment.tables import RunFiles, Source, keys_of
from bristle.data.record import Record
from bristle.data.robot.rigid_body import RigidBody
from bristle.data.robot.robot_file import Robot
from bristle.data.text_table import RawTable, Reader, read_table
from bristle.errors import InputError
from bristle.findings import NOTE, Finding

_STILL = 1e-3  # rad or m: a joint that goes no further rests, too


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotMotion:
    """One run: how each joint moves in it."""

    file: str  # as results call it
    moving: Mapping[str, Record]  # of each joint that moves: position, velocity, acceleration
    resting: Mapping[str, float]  # where each of the others rests, rad or m

    def at(self, time: Array, names: tuple[str, ...]) -> tuple[Array, Array, Array]:
        """Position, velocity and acceleration of some joints at some times, s, (n, joints) each; linear between samples."""
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
    """What reads each log of a robot once, with all columns that will be asked of it: its joints share them."""
    signals = [joint.everywhere.signals_of(run) for joint in robot.joints for run in joint.everywhere.runs]
    clocks = [key for x in signals if x.time is not None for key in x.time.columns()]
    asked = dict.fromkeys(
        [*clocks, *(key for x in signals for name, key in keys_of(x).items() if name not in x.apart())]
    )
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
    """How all joints move in each run that is a course over time, by what tells that from others.

    Raises InputError where a joint has no position, or a file cannot be read as declared.
    """
    records: dict[str, dict[str, Record | float]] = {}
    called: dict[str, str] = {}
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
        # a joint rests where it goes no further than 0.02 of its largest travel in any run
        rests = {name for name, x in travels[key].items() if x <= max(_STILL, 0.02 * farthest[name])}
        at = {name: x if isinstance(x, float) else float(np.median(np.asarray(x.position))) for name, x in own.items()}
        motions[key] = RobotMotion(
            file=called[key],
            moving={name: x for name, x in own.items() if isinstance(x, Record) and name not in rests},
            resting={name: x for name, x in at.items() if name in rests},
        )
    return motions


def _key(run: RunFiles, sources: list[Source]) -> str:
    """What tells the files of a run, and the part of them, from others."""
    return repr((sources, run.rows, run.time))


def _motion(experiment: Experiment, run: RunFiles, sources: list[Source], read: Reader) -> tuple[str, Record | float]:
    """What a run is called, and how one joint moves in it; where it rests, if it does not."""
    signals = experiment.signals_of(run).model_copy(update=dict.fromkeys(DRIVE))
    if signals.position is None:
        raise InputError(
            f"{experiment.path}: {experiment.joint.name} has no position, which a robot's joints need; name it under signals"
        )
    table, shown = table_of_run(experiment, run, sources, signals, read)
    keys = keys_of(signals)
    logged = table.columns[keys["position"]] * signals.position.factor("position", experiment.context)
    seen = logged[np.isfinite(logged)]
    if seen.size and np.ptp(seen) <= _STILL:
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
    """What the links ask of all joints in a run, computed once for the joints whose records have one time."""

    def __init__(self, body: RigidBody, names: tuple[str, ...]) -> None:
        """`names`: of the joints, in the order of the body's."""
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
    """The runs in which a joint moves, each with what the links ask of it where the robot is known.

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
        raise InputError(
            f"{experiment.path}: {name} rests in every run; log it while it moves, or give it identify: false under joints"
        )
    return tuple(runs)


def without_links(run: Run) -> Run:
    """A run at constant velocity, or of slow loading, without the links' torque; a moving one as it is: its fit takes it off."""
    r = run.record
    if run.kind == "tracking" or r.link_torque is None or r.torque is None:
        return run
    largest = float(np.abs(r.link_torque).max())
    message = f"The torque of the links, at most {largest:.3g} N*m, was taken off before segments were looked for."
    note = Finding("links-taken-off", NOTE, message, {"largest": largest})
    return replace(run, record=replace(r, torque=r.torque - r.link_torque, link_torque=None, notes=(*r.notes, note)))
