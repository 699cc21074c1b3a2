"""What joints are identified from: files of a joint or of a robot, loaded, and what is kept of them to load them again."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bristle.data.experiment.load import Experiment, experiment_from
from bristle.data.experiment.yaml_file import MAX_BYTES, parse, read_text
from bristle.data.robot.robot_file import Robot, is_robot, robot_of
from bristle.errors import InputError, check_name, check_regular, short, unreadable
from bristle.identification.document import is_results
from bristle.identification.fits import Estimate
from bristle.identification.measured import Measured, measure
from bristle.identification.results import WrittenExperiment
from bristle.identification.robot.measured import measure_robot
from bristle.progress import Progress
from bristle.simulation import edro

Source = Experiment | Robot | Path | str
"""An experiment, or a robot: loaded, or its file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceText:
    """The text of a file that was loaded, by which it is loaded again as it was."""

    path: Path
    """Where it stood, absolute."""
    text: str
    beside: dict[str, str] = field(default_factory=dict)
    """SHA-256 of other files that it names, its logs apart."""
    joints: tuple[str, ...]
    """Those that are identified from it."""

    def loaded(self) -> Experiment | Robot:
        """What the text describes. Raises InputError where that cannot be, or a file beside it is not as it was."""
        for name, known in self.beside.items():
            if _sha256(self.path.parent / name) != known:
                raise InputError(
                    f"{name}: was changed since {', '.join(self.joints)} was identified with it; identify anew"
                )
        return load_text(self.text, self.path)

    def written(self, folder: Path) -> WrittenExperiment:
        """As a results file in some folder has it: its place from there, so that both may be moved together."""
        inside = self.path.parent == edro.datasets_folder()
        place = None if inside else _relative(self.path.parent, folder.resolve())
        return WrittenExperiment(
            file=self.path.name, folder=place, text=self.text, beside=self.beside, joints=self.joints
        )


def source_text(written: WrittenExperiment, folder: Path) -> SourceText:
    """What a results file in some folder has of an experiment file; nothing is opened.

    Raises InputError where its name is no file's, or its text is a book.
    """
    name = check_name(written.file, "experiments: file")
    if name in ("", ".", "..") or Path(name).name != name or "\\" in name:
        raise InputError(f"experiments: file: got {short(name)}; expected the name of a file")
    if len(written.text) > MAX_BYTES:
        raise InputError(f"experiments: text of {len(written.text)} characters; expected at most {MAX_BYTES}")
    place = edro.datasets_folder()
    if written.folder is not None:
        place = Path(os.path.normpath(folder.resolve() / check_name(written.folder, "experiments: folder")))
    return SourceText(path=place / name, text=written.text, beside=dict(written.beside), joints=written.joints)


def _relative(path: Path, start: Path) -> str:
    try:
        return Path(os.path.relpath(path, start)).as_posix()
    except ValueError:  # another drive
        return path.as_posix()


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


def load(source: Source) -> Experiment | Robot:
    """What a file describes. Raises InputError where it cannot be read."""
    return opened(source)[0]


def load_text(text: str, path: Path) -> Experiment | Robot:
    """What a text describes, as if it stood at a path. Raises InputError where it describes nothing."""
    return _described(parse(text, str(path)), path)


def _described(data: dict[str, Any], path: Path) -> Experiment | Robot:
    return robot_of(data, path) if is_robot(data) else experiment_from(data, path, str(path))


def opened(source: Source) -> tuple[Experiment | Robot, SourceText | None]:
    """What a file describes, and its text.

    What was loaded before has one where its file still describes the same. Raises InputError where a file cannot be read.
    """
    if isinstance(source, Experiment | Robot):
        try:
            again, found = opened(source.path)
        except (InputError, OSError):  # of arrays, or gone
            return source, None
        return source, found if again == source else None
    path = path_of(source)
    if is_results_file(path):
        raise InputError(
            f"{path}: is a results file, identified already; expected an experiment file, or ask plan, adapt, validate or sensitivity of it"
        )
    text = read_text(path)
    data = parse(text, str(path))
    loaded = _described(data, path)
    beside = {}
    if isinstance(loaded, Robot) and isinstance(data.get("robot"), dict):
        urdf = str(data["robot"]["urdf"])
        beside[urdf] = _sha256(path.parent / urdf)
    stood = path.parent.resolve() / path.name
    return loaded, SourceText(path=stood, text=text, beside=beside, joints=names_of(loaded))


def is_results_file(path: Path) -> bool:
    """Whether a path is a results file; what cannot be read is none, and is refused by who reads it."""
    try:
        return is_results(path)
    except (OSError, InputError):
        return False


def open_all(sources: Sequence[Source]) -> list[tuple[Experiment | Robot, SourceText | None]]:
    """What some files describe, or the embedded Ed-Ro. Raises InputError where one cannot be read, or two joints have one name."""
    found = [opened(source) for source in sources or edro.experiments()]
    names = [name for one, _ in found for name in names_of(one)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"joint.name: {names.count(name)} experiments name their joint {name!r}; give each joint its own name"
            )
    return found


def names_of(loaded: Experiment | Robot) -> tuple[str, ...]:
    """Of the joints that are to be identified."""
    if isinstance(loaded, Experiment):
        return (loaded.joint.name,)
    return tuple(joint.experiment.joint.name for joint in loaded.joints if joint.identify)


def measure_joints(
    loaded: Experiment | Robot,
    progress: Progress | None = None,
    only: str | None = None,
    constant: Estimate | None = None,
) -> tuple[Measured, ...]:
    """What each joint of a file measured; arguments as of `measure_robot`. Raises InputError where its logs cannot be used."""
    if isinstance(loaded, Experiment):
        return (measure(loaded),)
    return measure_robot(loaded, progress, only=only, constant=constant)
