"""The file of a robot: one log of all joints, and an experiment of each; a joint's keys replace those of all."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, StrictBool, StrictInt, StrictStr

from bristle.data.experiment.load import Experiment, experiment_from
from bristle.data.experiment.signals import Context
from bristle.data.experiment.yaml_file import StrictModel, validate
from bristle.data.robot.urdf import Payload, Urdf, read_urdf
from bristle.data.text_table import naming
from bristle.errors import InputError, short, short_list

FREE = "free"  # what a torque constant is called that the links' torque is to tell
_OWN = ("motor", "fit", "segments", "plan", "adapt", "signals")  # keys that a joint replaces part by part
_WHOLE = ("inertia", "encoder_resolution", "kind", "truth", "assumptions")  # keys that it replaces as a whole
_RANGE = re.compile(r"\s*([0-9]{1,5})\s*-\s*([0-9]{1,5})\s*")


Pull = Annotated[float, Field(ge=-1e3, le=1e3)]  # of gravity in one direction, m/s**2


class RobotDescription(StrictModel):
    """The arm, whose URDF tells the torque of its links."""

    urdf: Annotated[StrictStr, Field(min_length=1, max_length=4096)]  # path, relative to the file
    gravity: tuple[Pull, Pull, Pull] = (0.0, 0.0, -9.81)  # m/s**2, in the frame of the base
    payload: Payload | None = None


class JointEntry(StrictModel):
    """One joint, without its keys of an experiment file."""

    name: Annotated[StrictStr, Field(min_length=1, max_length=200)]
    # its column of each signal, from 0; None: its place among the joints
    index: Annotated[StrictInt, Field(ge=0, lt=10_000)] | None = None
    torque_constant: StrictStr | None = None  # as under motor, or free
    identify: StrictBool = True  # whether its friction is asked for; its motion counts in any case


@dataclass(frozen=True, slots=True, kw_only=True)
class JointOfRobot:
    """A joint of a robot: its experiment, and the robot's own keys."""

    experiment: Experiment  # where the torque constant is free, with one of 1 N*m/A: its torques are numbers of amperes
    everywhere: Experiment  # with all runs of the robot, those of other joints too: it moves in them as well
    free: bool  # whether the torque constant is to be found
    identify: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Robot:
    """A robot's file, validated."""

    path: Path
    joints: tuple[JointOfRobot, ...]
    urdf: Urdf | None
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    payload: Payload | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, in the file's order."""
        return tuple(joint.experiment.joint.name for joint in self.joints)


def is_robot(data: Mapping[str, Any]) -> bool:
    """Whether a file's keys are those of a robot."""
    return "joints" in data or "robot" in data


def robot_of(data: dict[str, Any], path: Path) -> Robot:
    """The robot of a YAML file's keys; its logs are not read yet.

    Raises InputError in one sentence that names the file and the key, what was got and what to do.
    """
    shared = {key: x for key, x in data.items() if key not in ("robot", "joints") and x is not None}
    if "joint" in shared:
        raise InputError(f"{path}: got joint beside joints; a robot's file names its joints under joints alone")
    entries = data.get("joints")
    if not isinstance(entries, list) or not entries or not all(isinstance(x, dict) for x in entries):
        expected = "a list, as [{name: elbow_joint, index: 2}, ...]"
        raise InputError(f"{path}: joints: got {short(entries)}; expected {expected}")
    given = data.get("robot")
    if given is not None and not isinstance(given, dict):
        raise InputError(f"{path}: robot: got {short(given)}; expected keys with values, as {{urdf: arm.urdf}}")
    about = None if given is None else validate(RobotDescription, given, f"{path}: robot", Context())
    urdf = None if about is None else read_urdf(path.parent / about.urdf)
    known = [entry.get("name") for entry in entries]
    for k, run in enumerate(runs if isinstance(runs := shared.get("runs"), list) else ()):
        if isinstance(run, dict) and run.get("joint") is not None and run["joint"] not in known:
            raise InputError(f"{path}: runs.{k}: joint: got {short(run['joint'])}; expected one of {short_list(known)}")
    joints = tuple(_joint(shared, dict(entry), k, path, urdf) for k, entry in enumerate(entries))
    twice = next((name for name in known if known.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}: joints: {short(twice)} is named twice; give each joint its own name")
    if not any(joint.identify for joint in joints):
        raise InputError(f"{path}: joints: each has identify: false; leave that out of at least one")
    of_robot: dict[str, Any] = {} if about is None else {"gravity": about.gravity, "payload": about.payload}
    return Robot(path=path, joints=joints, urdf=urdf, **of_robot)


def _joint(shared: Mapping[str, Any], entry: dict[str, Any], k: int, path: Path, urdf: Urdf | None) -> JointOfRobot:
    where = f"{path}: joints.{k}"
    own = {key: entry.pop(key) for key in (*_OWN, *_WHOLE) if entry.get(key) is not None}
    about = validate(JointEntry, entry, where, None)
    index = k if about.index is None else about.index
    if urdf is not None:
        with naming(f"{where}: name"):
            known = urdf.joint(about.name)
        if own.setdefault("kind", known.kind) != known.kind:
            raise InputError(f"{where}: kind: got {short(own['kind'])}; {urdf.file} has {about.name} {known.kind}")
    data = dict(shared)
    for key, x in own.items():
        parted = key in _OWN and isinstance(x, dict) and isinstance(data.get(key), dict)
        data[key] = {**data[key], **x} if parted else x
    free = about.torque_constant == FREE
    if free and urdf is None:
        raise InputError(f"{where}: torque_constant: free needs robot.urdf, whose links are the known torque; name it")
    if about.torque_constant is not None:
        unit = "N/A" if own.get("kind") == "prismatic" else "N*m/A"
        constant = f"1 {unit}" if free else about.torque_constant
        data["motor"] = {**(data.get("motor") or {}), "torque_constant": constant}
    data["joint"] = {"name": about.name, "kind": data.pop("kind", "revolute")}
    data["signals"] = _signals(data.get("signals"), about.name, index, f"{where}: signals")
    every: Any = data.get("runs")
    if isinstance(every, list):  # all with the columns of this joint
        every = list(every)
        for j, run in enumerate(every):
            if isinstance(run, dict):
                every[j] = {key: x for key, x in run.items() if key != "joint"}
                if "signals" in run:
                    every[j]["signals"] = _signals(run["signals"], about.name, index, f"{where}: runs.{j}.signals")
    if urdf is not None:  # what is planned stays within the joint's limits, unless the file has its own
        q, T = ("rad", "N*m") if known.kind == "revolute" else ("m", "N")
        reach = [f"{known.lower!r} {q}", f"{known.upper!r} {q}"] if known.upper < inf else None
        speed = f"{known.velocity!r} {q}/s" if known.velocity < inf else None
        torque = f"{known.effort!r} {T}" if known.effort < inf else None
        limits = {"position": reach, "velocity": speed, "torque": torque}
        plan = data.get("plan")
        own_plan = plan if isinstance(plan, dict) else {}
        data["plan"] = {**{key: x for key, x in limits.items() if x}, **own_plan}
    everywhere = experiment_from({**data, "runs": every}, path, where)
    both = zip(everywhere.runs, data["runs"], strict=True)
    own_runs = tuple(run for run, given in both if given.get("joint") in (None, about.name))
    if not own_runs and about.identify:
        remedy = f"add one of {short(about.name)}, or give it identify: false"
        raise InputError(f"{where}: each of the runs is of another joint; {remedy}")
    experiment = everywhere.model_copy(update={"runs": own_runs or everywhere.runs})
    if free and experiment.signals.current is None:
        raise InputError(f"{where}: torque_constant: free needs a current under signals; name it, or give the constant")
    return JointOfRobot(experiment=experiment, everywhere=everywhere, free=free, identify=about.identify)


def _signals(signals: Any, name: str, index: int, where: str) -> Any:
    """The signals with the columns of one joint."""
    if not isinstance(signals, dict):
        return signals
    own = dict(signals)
    for key, signal in signals.items():
        if not isinstance(signal, dict):
            continue
        column, columns = signal.get("column"), signal.get("columns")
        rest = {part: x for part, x in signal.items() if part not in ("column", "columns")}
        if "columns" in signal:
            if "column" in signal:
                raise InputError(f"{where}.{key}: got column beside columns; expected one of them")
            match = _RANGE.fullmatch(columns) if isinstance(columns, str) else None
            listed = list(range(int(match[1]), int(match[2]) + 1)) or None if match else columns
            if not isinstance(listed, list):
                got = f"{where}.{key}.columns: got {short(columns)}"
                raise InputError(f"{got}; expected a range such as 1-6, or a list of columns")
            if index >= len(listed):
                got = f"{where}.{key}.columns: got {len(listed)}"
                raise InputError(f"{got}; expected one for each joint, at least {index + 1}")
            own[key] = {"column": listed[index], **rest}
        elif isinstance(column, str) and ("{joint}" in column or "{index}" in column):
            own[key] = {"column": column.replace("{joint}", name).replace("{index}", str(index)), **rest}
        elif key != "time":
            own[key] = {"index": index, **signal}
    return own


def pick(robot: Robot, name: str) -> JointOfRobot:
    """The joint of a name. Raises InputError where the robot has none."""
    for joint in robot.joints:
        if joint.experiment.joint.name == name:
            return joint
    why = f"{robot.path} has none of that name"
    raise InputError(f"joint {short(name)}: {why}; expected one of {short_list(robot.names)}")
