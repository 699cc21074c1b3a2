"""Survey of a catalog's files: inputs, by size, time of modification and SHA-256, and joints."""

import hashlib
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

from bristle import __version__
from bristle.data.experiment.load import Experiment, experiment_from, files_of
from bristle.data.experiment.tables import matches
from bristle.data.experiment.yaml_file import MAX_BYTES, parse, read_text
from bristle.data.robot.robot_file import Robot, is_robot, robot_of
from bristle.errors import InputError, check_regular, one_line, short, unreadable
from bristle.questions.fleet import files

SCHEMA = "bristle-fleet/1"  # of the dataset; part of the keys
OWN = "."  # name of the experiment file among its inputs
_KEY = 32  # hexadecimal digits of a key
_BAG = (".mcap", ".db3", ".yaml")  # files of a folder that is a bag


class FleetInput(NamedTuple):
    """An input of the results."""

    name: str  # relative to the folder of the experiment file
    path: str
    stamp: files.Stamp
    sha256: str


class Surveyed(NamedTuple):
    """The inputs and joints of a file of a catalog."""

    path: str
    inputs: tuple[FleetInput, ...] = ()  # the file itself first
    patterns: tuple[str, ...] = ()  # of its logs
    beside: tuple[str, ...] = ()  # other files that it names, as a URDF
    joints: tuple[str, ...] = ()  # to be identified
    robot: bool = False
    apart: bool = False  # whether signals have files of their own, so that a run's digest is not that of its file
    failure: str = ""  # why it cannot be used

    def key(self, joint: str) -> str:
        """Key of the results of a joint: a hash of content, joint and version."""
        known = [__version__, SCHEMA, joint, sorted((one.name, one.sha256) for one in self.inputs)]
        return hashlib.sha256(json.dumps(known).encode()).hexdigest()[:_KEY]

    def written(self) -> str:
        """Its text in the ledger."""
        return json.dumps([__version__, *self], separators=(",", ":"))


def surveyed_of(text: str) -> Surveyed | None:
    """A file from its text in the ledger; None where another version of bristle wrote it."""
    version, *rest = json.loads(text)
    if version != __version__ or len(rest) != len(Surveyed._fields):
        return None
    path, inputs, patterns, beside, joints, robot, apart, failure = rest
    known = tuple(FleetInput(name, at, files.Stamp(*found), sha) for name, at, found, sha in inputs)
    return Surveyed(path, known, tuple(patterns), tuple(beside), tuple(joints), robot, apart, failure)


def survey(path: str, known: Surveyed | None = None, *, verify: bool = False) -> Surveyed:
    """Survey a file of a catalog and its inputs; `known`: the last run's survey; `verify`: read all again."""
    try:
        if known is not None and not verify and not known.failure and files.stamp(path) == known.inputs[0].stamp:
            others = known.inputs[1:]  # nothing is read where all inputs have the same stamps
            found = _found(known.path, known.patterns, known.beside)
            if found == [(x.name, x.path) for x in others] and all(files.stamp(x.path) == x.stamp for x in others):
                return known
        return _looked_at(path, {} if known is None or verify else {one.path: one for one in known.inputs})
    except InputError as error:
        return Surveyed(path, failure=without_folder(str(error), path))
    except FileNotFoundError:
        return Surveyed(
            path, failure=f"{files.name_of(path)}: no such file; check the path, which is relative to the catalog"
        )
    except OSError as error:
        return Surveyed(path, failure=without_folder(unreadable(files.name_of(path), error), path))


def without_folder(sentence: str, path: str, *folders: str) -> str:
    """A sentence without the folders of files."""
    for folder in (*folders, files.folder_of(path)):
        sentence = sentence.replace(f"{folder.rstrip('/')}/", "") if folder.strip("/.") else sentence
    return one_line(sentence)


def _looked_at(path: str, known: Mapping[str, FleetInput]) -> Surveyed:
    own = _input(OWN, path, {})
    with _described(path) as (loaded, urdf):
        if isinstance(loaded, Experiment):
            experiments: tuple[Experiment, ...] = (loaded,)
            joints: tuple[str, ...] = (loaded.joint.name,)
        else:
            experiments = tuple(joint.everywhere for joint in loaded.joints)
            joints = tuple(one.experiment.joint.name for one in loaded.joints if one.identify)
    # Patterns of runs, and files of signals.
    runs = [(one, run) for one in experiments for run in one.runs]
    of_signals = (getattr(signal, "file", None) for one, run in runs for _, signal in one.signals_of(run))
    own_files = [file for file in of_signals if file]
    patterns = tuple(dict.fromkeys((*(pattern for _, run in runs for pattern in run.patterns), *own_files)))
    beside = () if urdf is None else (urdf,)
    found = Surveyed(path, (own,), patterns, beside, joints, robot=isinstance(loaded, Robot), apart=bool(own_files))
    try:
        if isinstance(loaded, Experiment) and not files.is_remote(path):
            list(files_of(loaded))  # raises where files are named twice
        return found._replace(inputs=(own, *(_input(name, at, known) for name, at in _found(path, patterns, beside))))
    except InputError as error:  # of a log; the joints are known
        return found._replace(failure=without_folder(str(error), path))


def _input(name: str, path: str, known: Mapping[str, FleetInput]) -> FleetInput:
    """A file with its digest, from the last survey if its stamp is the same."""
    found, before = files.stamp(path), known.get(path)
    same = before is not None and before.stamp == found
    return FleetInput(name, path, found, before.sha256 if same and before else files.digest_of(path))


@contextmanager
def _described(path: str) -> Iterator[tuple[Experiment | Robot, str | None]]:
    """The experiment or robot of a file, and the URDF that it names."""
    if not files.is_remote(path):
        yield _loaded(files.local_path(path))
        return
    with tempfile.TemporaryDirectory(prefix="bristle-") as folder:
        place = Path(folder) / files.name_of(path)
        try:
            place.write_bytes(files.read_bytes(path, MAX_BYTES))
            urdf = _urdf_of(parse(read_text(place), files.name_of(path)))
            if urdf is not None:
                beside = files.read_bytes(files.joined_path(files.folder_of(path), urdf))
                place = laid_out(Path(folder), place.name, {OWN: place.read_bytes(), urdf: beside})
            yield _loaded(place)
        except InputError as error:
            raise InputError(without_folder(str(error), path, folder)) from error


def _loaded(path: Path) -> tuple[Experiment | Robot, str | None]:
    data = parse(read_text(path), str(path))
    if str(data.get("schema")).startswith("bristle-results/"):
        raise InputError(
            f"{path}: is a results file, identified already; expected the experiment file that it was identified from"
        )
    return (robot_of(data, path), _urdf_of(data)) if is_robot(data) else (experiment_from(data, path, str(path)), None)


def _urdf_of(data: Mapping[str, Any]) -> str | None:
    about = data.get("robot")
    urdf = about.get("urdf") if isinstance(about, dict) and is_robot(data) else None
    return urdf if isinstance(urdf, str) and urdf else None


def _found(path: str, patterns: Sequence[str], beside: Sequence[str]) -> list[tuple[str, str]]:
    """Names and paths of the files by these patterns, and of those beside; sorted."""
    found = dict[str, str]()
    for pattern in patterns:
        for name, at in _matches(path, pattern):
            if files.is_folder(at):
                parts = (part for part in files.names_in(at) if part.endswith(_BAG))
                found |= {f"{name}/{part}": files.joined_path(at, part) for part in parts}
                continue
            if not files.is_remote(at):
                check_regular(files.local_path(at))
            found[name] = at
    found |= {name: files.joined_path(files.folder_of(path), name) for name in beside}
    return sorted(found.items())


def _matches(path: str, pattern: str) -> list[tuple[str, str]]:
    """Names and paths of files and folders by a pattern; a remote one must be relative."""
    if not files.is_remote(path):
        return [(name, str(at)) for at, name in matches(pattern, files.local_path(path))]
    folder, shown = files.folder_of(path), f"{files.name_of(path)}: runs: files {short(pattern)}"
    if "${" in pattern or PurePosixPath(pattern).is_absolute():
        raise InputError(
            f"{shown} is not relative to the folder of the experiment file; expected a relative path, as it is read from {path.partition('://')[0]}"
        )
    whole = files.joined_path(folder, pattern)
    found = [whole] if files.exists(whole) else files.glob_of(whole)
    if not found:
        raise InputError(
            f"{shown} matches no file; expected a path or glob relative to the folder of the experiment file"
        )
    return [(pattern if one == whole else one.removeprefix(f"{folder}/"), one) for one in found]


def laid_out(folder: Path, name: str, contents: Mapping[str, bytes]) -> Path:
    """Write an experiment file and its inputs into a folder. Raises InputError where a name leads out of it."""
    up = max((PurePosixPath(one).parts.count("..") for one in contents), default=0)
    base = folder.joinpath(*(["in"] * up))
    for one, data in contents.items():
        place = Path(*(base / (name if one == OWN else one)).parts)
        if PurePosixPath(one).is_absolute() or folder.resolve() not in place.resolve().parents:
            raise InputError(
                f"{name}: names {short(one)}; expected a path relative to its folder, because it is sent to another machine"
            )
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(data)
    return base / name
