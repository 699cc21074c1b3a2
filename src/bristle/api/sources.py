"""Experiment and robot files, loaded, kept to be loaded again, and their logs."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bristle.data.experiment.load import Experiment, experiment_from
from bristle.data.experiment.yaml_file import MAX_BYTES, parse, read_text
from bristle.data.robot.robot_file import Robot, is_robot, pick, robot_of
from bristle.errors import InputError, check_name, check_regular, short, unreadable
from bristle.identification.document import is_results
from bristle.identification.fits import Estimate
from bristle.identification.known_gravity import measure_scaled
from bristle.identification.measured import Measured
from bristle.identification.results import Joint, WrittenExperiment
from bristle.identification.robot.measured import measure_robot
from bristle.progress import Progress
from bristle.simulation import edro

Source = Experiment | Robot | Path | str  # an experiment, or a robot: loaded, or its file


def placed(written: WrittenExperiment, folder: Path) -> WrittenExperiment:
    """An experiment file of a results file, its folder made absolute. Raises InputError where name or text is invalid."""
    name = check_name(written.file, "experiments: file")
    if name in ("", ".", "..") or Path(name).name != name or "\\" in name:
        raise InputError(f"experiments: file: got {short(name)}; expected the name of a file")
    if len(written.text) > MAX_BYTES:
        raise InputError(f"experiments: text of {len(written.text)} characters; expected at most {MAX_BYTES}")
    if written.folder is None:
        return written
    own = folder.resolve() / check_name(written.folder, "experiments: folder")
    return replace(written, folder=os.path.normpath(own))


def _path(text: WrittenExperiment) -> Path:
    return Path(text.folder or edro.datasets_folder()) / text.file


def _sha256(path: Path) -> str:
    try:
        check_regular(path)
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(unreadable(path, error)) from error


def path_of(source: object, expected: str = "an experiment, or the path of its file") -> Path:
    """The path of a file. Raises InputError where it is none."""
    if not isinstance(source, str | os.PathLike):
        raise InputError(f"got {short(source)}, {type(source).__name__}; expected {expected}")
    return Path(source)


def load_text(text: str, path: Path) -> Experiment | Robot:
    """The experiment or robot of a text with the path that it would have. Raises InputError."""
    return _described(parse(text, str(path)), path)


def _described(data: dict[str, Any], path: Path) -> Experiment | Robot:
    return robot_of(data, path) if is_robot(data) else experiment_from(data, path, str(path))


def opened(source: Source) -> tuple[Experiment | Robot, WrittenExperiment | None]:
    """The experiment or robot of a source, and its file as written; no file if it no longer agrees with the object.

    Raises InputError where the source cannot be read.
    """
    if isinstance(source, Experiment | Robot):
        try:
            again, found = opened(source.path)
        except (InputError, OSError):  # of arrays, or gone
            return source, None
        return source, found if again == source else None
    path = path_of(source)
    if is_results_file(path):
        expected = "an experiment file, or ask plan, adapt, validate or sensitivity of it"
        raise InputError(f"{path}: is a results file, identified already; expected {expected}")
    text = read_text(path)
    data = parse(text, str(path))
    loaded = _described(data, path)
    beside = {}
    if isinstance(loaded, Robot) and isinstance(data.get("robot"), dict):
        urdf = str(data["robot"]["urdf"])
        beside[urdf] = _sha256(path.parent / urdf)
    own = path.parent.resolve()
    folder = None if own == edro.datasets_folder() else str(own)
    return loaded, WrittenExperiment(file=path.name, folder=folder, text=text, beside=beside, joints=names_of(loaded))


def is_results_file(path: Path) -> bool:
    """Whether a path is a results file; False where it cannot be read."""
    try:
        return is_results(path)
    except (OSError, InputError):
        return False


def open_all(sources: Sequence[Source]) -> list[tuple[Experiment | Robot, WrittenExperiment | None]]:
    """Some files as `opened`, or the embedded Ed-Ro. Raises InputError also where two joints have one name."""
    found = [opened(source) for source in sources or edro.experiments()]
    names = [name for one, _ in found for name in names_of(one)]
    for name in names:
        if names.count(name) > 1:
            many = f"{names.count(name)} experiments name their joint {name!r}"
            raise InputError(f"joint.name: {many}; give each joint its own name")
    return found


def names_of(loaded: Experiment | Robot) -> tuple[str, ...]:
    """Names of the joints that are to be identified."""
    if isinstance(loaded, Experiment):
        return (loaded.joint.name,)
    return tuple(joint.experiment.joint.name for joint in loaded.joints if joint.identify)


def measure_joints(
    loaded: Experiment | Robot,
    progress: Progress | None = None,
    only: str | None = None,
    constant: Estimate | None = None,
) -> tuple[Measured, ...]:
    """The data of each joint of a file; arguments as of `measure_robot`. Raises InputError where logs cannot be used."""
    if isinstance(loaded, Experiment):
        return (measure_scaled(loaded),)
    return measure_robot(loaded, progress, only=only, constant=constant)


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLogs:
    """The logs behind some joints."""

    texts: tuple[WrittenExperiment, ...] = ()  # the files that name them, their folders absolute
    read: dict[str, Measured] = field(default_factory=dict)  # by joint, what was read

    def of(self, joint: Joint) -> Measured:
        """The data of a joint, as when it was identified. Raises InputError where a log is missing or changed."""
        if joint.name not in self.read:
            text = self._text(joint, " logs; expected what `identify` returned or wrote, or an experiment file")
            again = measure_joints(_loaded(text, joint), only=joint.name, constant=joint.torque_constant)
            self.read.update({one.experiment.joint.name: one for one in again})
        measured = self.read[joint.name]
        known = [(x.file, x.sha256) for x in joint.inputs]
        found = [(run.record.file, run.record.sha256) for run in measured.runs]
        if known != found:
            odd = next((file for file, sha in found if (file, sha) not in known), None)
            what = f"{odd} was changed, or added," if odd else "a log went missing"
            expected = "expected the same logs, or identify it anew"
            raise InputError(f"{joint.name}: {what} since the joint was identified; {expected}")
        return measured

    def experiment_of(self, joint: Joint) -> Experiment:
        """The experiment of a joint, its logs unread. Raises InputError."""
        if joint.name in self.read:
            return self.read[joint.name].experiment
        loaded = _loaded(self._text(joint, " experiment file"), joint)
        return loaded if isinstance(loaded, Experiment) else pick(loaded, joint.name).experiment

    def written(self, folder: Path) -> Iterator[WrittenExperiment]:
        """The files as a results file in some folder holds them: relative, so that both may be moved together."""
        for text in self.texts:
            place = text.folder
            if place is not None:
                with suppress(ValueError):  # another drive
                    place = os.path.relpath(place, folder.resolve())
                place = Path(place).as_posix()
            yield replace(text, folder=place)

    def _text(self, joint: Joint, lacking: str) -> WrittenExperiment:
        """The file that names a joint. Raises InputError where there is none."""
        text = next((text for text in self.texts if joint.name in text.joints), None)
        if text is None:
            raise InputError(f"{joint.name}: got results without their{lacking}")
        return text


def _loaded(text: WrittenExperiment, joint: Joint) -> Experiment | Robot:
    """The experiment or robot of a text. Raises InputError where a file beside it changed, or it lacks the joint."""
    path = _path(text)
    for name, known in text.beside.items():
        if _sha256(path.parent / name) != known:
            names = ", ".join(text.joints)
            raise InputError(f"{name}: was changed since {names} was identified with it; identify anew")
    loaded = load_text(text.text, path)
    if joint.name not in names_of(loaded):
        raise InputError(f"{text.file}: its text in the results names no joint {short(joint.name)}")
    return loaded
