"""Which joints a question is about: a file of one or of a robot, what was loaded, or what is identified already."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from bristle.api.results import Results, choose
from bristle.data.experiment.load import Experiment, experiment_from
from bristle.data.experiment.yaml_file import parse, read_text
from bristle.data.robot.robot_file import Robot, is_robot, pick, robot_of
from bristle.errors import InputError
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured, measure
from bristle.identification.results import Joint
from bristle.identification.robot.measured import Share, measure_robot
from bristle.progress import Progress
from bristle.questions.array_fit.fit import Fit
from bristle.simulation import edro

Source = Experiment | Robot | Path | str
"""An experiment, or a robot: loaded, or its file."""
Known = Source | Results | Fit
"""A joint: to be identified, or identified already."""


def load(source: Source) -> Experiment | Robot:
    """What a file describes. Raises InputError where it cannot be read."""
    if isinstance(source, Experiment | Robot):
        return source
    path = Path(source)
    data = parse(read_text(path), str(path))
    return robot_of(data, path) if is_robot(data) else experiment_from(data, path, str(path))


def load_all(sources: Sequence[Source]) -> list[Experiment | Robot]:
    """What some files describe, or the embedded Ed-Ro. Raises InputError where one cannot be read, or two joints have one name."""
    loaded = [load(source) for source in sources or edro.experiments()]
    names = [name for one in loaded for name in names_of(one)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"joint.name: {names.count(name)} experiments name their joint {name!r}; give each joint its own name"
            )
    return loaded


def names_of(loaded: Experiment | Robot) -> tuple[str, ...]:
    """Of the joints that are to be identified."""
    if isinstance(loaded, Experiment):
        return (loaded.joint.name,)
    return tuple(joint.experiment.joint.name for joint in loaded.joints if joint.identify)


def measure_joints(
    loaded: Experiment | Robot, progress: Progress | None = None, share: Share = map
) -> tuple[Measured, ...]:
    """What each joint of a file measured. Raises InputError where its logs cannot be used."""
    return (measure(loaded),) if isinstance(loaded, Experiment) else measure_robot(loaded, progress, share)


class AskedJoint(NamedTuple):
    """One joint that a question is about; it is measured and identified when that is asked for."""

    experiment: Experiment
    """As its file has it: of a robot with a torque constant that is still free."""
    loaded: Experiment | Robot | None
    known: tuple[Measured, Joint] | None

    def measured(self, progress: Progress | None = None) -> Measured:
        """What it was, or is to be identified from."""
        if self.known is not None or self.loaded is None:
            return self.identified(progress)[0]
        every = measure_joints(self.loaded, progress)
        return next(m for m in every if m.experiment.joint.name == self.experiment.joint.name)

    def identified(self, progress: Progress | None) -> tuple[Measured, Joint]:
        """What it was measured by, and the joint: identified here unless it is already."""
        if self.known is not None:
            return self.known
        measured = self.measured(progress)
        if progress:
            progress(f"identifying {self.experiment.joint.name}", 0, 1)
        return measured, identify_joint(measured, progress=progress)


def asked_joint(known: Known, name: str | None = None) -> AskedJoint:
    """The joint that a question is about, of several the one of a name.

    Raises InputError where a file cannot be read, or there are several joints and no name, or none of that name.
    """
    if isinstance(known, Fit):
        return AskedJoint(known.measured.experiment, None, (known.measured, known.joint))
    if isinstance(known, Results):
        joint = known.joint(name)
        measured = known.measured_joint(joint.name)
        return AskedJoint(measured.experiment, None, (measured, joint))
    loaded = load(known)
    chosen = choose(names_of(loaded), name)
    own = pick(loaded, chosen).experiment if isinstance(loaded, Robot) else loaded
    return AskedJoint(own, loaded, None)
