"""Which joints a question is about: a file of one or of a robot, what was loaded, or what is identified already."""

from pathlib import Path
from typing import NamedTuple

from bristle.api.results import Results, choose, read_results
from bristle.api.sources import JointLogs, Source, is_results_file, measure_joints, names_of, opened
from bristle.data.experiment.load import Experiment
from bristle.data.robot.robot_file import Robot, pick
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.progress import Progress
from bristle.questions.array_fit.fit import Fit

Known = Source | Results | Fit
"""A joint: to be identified, or identified already: results, their file, or a fit of arrays."""


def read_if_results(known: Known) -> Source | Results:
    """The results of a results file or a fit; what is neither as it is. Raises InputError where such a file is damaged."""
    if isinstance(known, Fit):
        return Results(joints=(known.joint,), logs=JointLogs(read={known.joint.name: known.measured}))
    return read_results(known) if isinstance(known, Path | str) and is_results_file(Path(known)) else known


class AskedJoint(NamedTuple):
    """One joint that a question is about; it is measured and identified when that is asked for."""

    experiment: Experiment
    """As its file has it: of a robot with a torque constant that is still free."""
    source: Experiment | Robot | tuple[Measured, Joint]
    """What its file describes; or what is known of it already."""

    def measured(self, progress: Progress | None = None) -> Measured:
        """What it was, or is to be identified from."""
        if isinstance(self.source, tuple):
            return self.source[0]
        (measured,) = measure_joints(self.source, progress, only=self.experiment.joint.name)
        return measured

    def identified(self, progress: Progress | None) -> tuple[Measured, Joint]:
        """What it was measured by, and the joint: identified here unless it is already."""
        if isinstance(self.source, tuple):
            return self.source
        measured = self.measured(progress)
        if progress:
            progress(f"identifying {self.experiment.joint.name}", 0, 1)
        return measured, identify_joint(measured, progress=progress)


def asked_joint(known: Known, name: str | None = None) -> AskedJoint:
    """The joint of a name, or the only one. Raises InputError where a file cannot be read, or it is not said which joint is meant."""
    source = read_if_results(known)
    if isinstance(source, Results):
        joint = source.whole_joint(None if isinstance(known, Fit) else name)
        measured = source.measured_joint(joint.name)
        return AskedJoint(measured.experiment, (measured, joint))
    loaded, _ = opened(source)
    chosen = choose(names_of(loaded), name)
    own = pick(loaded, chosen).experiment if isinstance(loaded, Robot) else loaded
    return AskedJoint(own, loaded)
