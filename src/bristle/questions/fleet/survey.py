"""Survey of a catalog's files: inputs, by size, time of modification and SHA-256, and joints."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from bristle import __version__
from bristle.data.experiment.load import Experiment, experiment_from, files_of
from bristle.data.experiment.tables import matches
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.robot.robot_file import is_robot, robot_of
from bristle.errors import InputError, check_regular, one_line, unreadable
from bristle.estimation import levels

SCHEMA = "bristle-fleet/2"  # of the dataset; part of the keys
OWN = "."  # name of the experiment file among its inputs
_KEY = 32  # hexadecimal digits of a key
_BAG = (".mcap", ".db3", ".yaml")  # files of a folder that is a bag


class FleetInput(NamedTuple):
    """An input of the results."""

    name: str  # relative to the folder of the experiment file
    path: str
    stamp: tuple[int, int]  # bytes, and time of modification, ns: known to be the same without being read
    sha256: str


class Surveyed(NamedTuple):
    """The inputs and joints of a file of a catalog."""

    path: str
    inputs: tuple[FleetInput, ...] = ()  # the file itself first
    patterns: tuple[str, ...] = ()  # of its logs
    beside: tuple[str, ...] = ()  # other files that it names, as a URDF
    joints: tuple[str, ...] = ()  # to be identified
    robot: bool = False
    failure: str = ""  # why it cannot be used

    def key(self, joint: str) -> str:
        """Key of the results of a joint: a hash of content, joint, version and changed levels."""
        known = [
            __version__,
            SCHEMA,
            joint,
            sorted((one.name, one.sha256) for one in self.inputs),
            *levels.changed().items(),
        ]
        return hashlib.sha256(json.dumps(known).encode()).hexdigest()[:_KEY]

    def holds(self) -> bool:
        """Whether the inputs are those of now, by their stamps."""
        try:
            found = [(OWN, self.path), *_found(self.path, self.patterns, self.beside)]
            return found == [x[:2] for x in self.inputs] and all(stamp(x.path) == x.stamp for x in self.inputs)
        except (OSError, InputError):
            return False


def stamp(path: str) -> tuple[int, int]:
    """The stamp of a file. Raises OSError where there is none, and InputError where it is no file."""
    check_regular(Path(path))
    found = Path(path).stat()
    return found.st_size, found.st_mtime_ns


def survey(path: str, known: Sequence[FleetInput] = ()) -> Surveyed:
    """Survey a file of a catalog and its inputs; those `known` with the same stamps are not hashed again."""
    name, inputs = Path(path).name, {one.path: one for one in known}
    try:
        return _looked_at(path, inputs)
    except FileNotFoundError:
        why = f"{name}: no such file; check the path, which is relative to the catalog"
    except (InputError, OSError) as error:
        why = str(error) if isinstance(error, InputError) else unreadable(name, error)
    return Surveyed(path, failure=without_folder(why, path))


def without_folder(sentence: str, path: str) -> str:
    """A sentence without the folder of a file."""
    folder = str(Path(path).parent)
    return one_line(sentence.replace(f"{folder}/", "") if folder.strip("/.") else sentence)


def _looked_at(path: str, known: Mapping[str, FleetInput]) -> Surveyed:
    own, file = _input(OWN, path, {}), Path(path)
    data = parse(read_text(file), path)
    if str(data.get("schema")).startswith("bristle-results/"):
        raise InputError(
            f"{path}: is a results file, identified already; expected the experiment file that it was identified from"
        )
    beside, robot = tuple[str, ...](), is_robot(data)
    if robot:
        loaded = robot_of(data, file)
        experiments: tuple[Experiment, ...] = tuple(joint.everywhere for joint in loaded.joints)
        joints = tuple(one.experiment.joint.name for one in loaded.joints if one.identify)
        beside = (data["robot"]["urdf"],) if data.get("robot") else ()
    else:
        experiments = (experiment_from(data, file, path),)
        joints = (experiments[0].joint.name,)
    # Patterns of runs, and files of signals.
    runs = [(one, run) for one in experiments for run in one.runs]
    of_signals = (getattr(signal, "file", None) for one, run in runs for _, signal in one.signals_of(run))
    named = (*(pattern for _, run in runs for pattern in run.patterns), *filter(None, of_signals))
    found = Surveyed(path, (own,), tuple(dict.fromkeys(named)), beside, joints, robot)
    try:
        if not robot:
            list(files_of(experiments[0]))  # raises where files are named twice
        logs = (_input(name, at, known) for name, at in _found(path, found.patterns, beside))
        return found._replace(inputs=(own, *logs))
    except InputError as error:  # of a log; the joints are known
        return found._replace(failure=without_folder(str(error), path))


def _input(name: str, path: str, known: Mapping[str, FleetInput]) -> FleetInput:
    """A file with its digest, from the last survey if its stamp is the same."""
    found, before = stamp(path), known.get(path)
    if before is not None and before.stamp == found:
        return before
    with Path(path).open("rb") as file:
        return FleetInput(name, path, found, hashlib.file_digest(file, "sha256").hexdigest())


def _found(path: str, patterns: Sequence[str], beside: Sequence[str]) -> list[tuple[str, str]]:
    """Names and paths of the files by these patterns, and of those beside; sorted."""
    found = {name: str(Path(path).parent / name) for name in beside}
    for at, name in (match for pattern in patterns for match in matches(pattern, Path(path))):
        parts = [part for part in at.iterdir() if part.name.endswith(_BAG)] if at.is_dir() else None
        found |= {name: str(at)} if parts is None else {f"{name}/{part.name}": str(part) for part in parts}
    return sorted(found.items())
