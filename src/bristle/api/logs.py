"""What joints were identified from: at hand, or in logs that are read again once a question needs them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from bristle.api.sources import SourceText, measure_joints, names_of
from bristle.data.experiment.load import Experiment
from bristle.data.robot.robot_file import pick
from bristle.errors import InputError, short
from bristle.identification.measured import Measured
from bristle.identification.results import Joint, WrittenExperiment


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLogs:
    """The logs behind some joints."""

    texts: tuple[SourceText, ...] = ()
    """The files that name them."""
    read: dict[str, Measured] = field(default_factory=dict)
    """By joint, what was read."""

    @classmethod
    def at_hand(cls, measured: Sequence[Measured], texts: Sequence[SourceText | None] = ()) -> "JointLogs":
        """Those that were read just now."""
        read = {one.experiment.joint.name: one for one in measured}
        return cls(texts=tuple(text for text in texts if text is not None), read=read)

    def of(self, joint: Joint) -> Measured:
        """What a joint was identified from: read, unless it is at hand, and the same as then.

        Raises InputError where that is not known, or a log is missing or was changed.
        """
        if joint.name not in self.read:
            text = next((text for text in self.texts if joint.name in text.joints), None)
            if text is None:
                raise InputError(
                    f"{joint.name}: got results without their logs; expected what `identify` returned or wrote, or an experiment file"
                )
            self.read.update(self._read_again(text, joint))
        measured = self.read[joint.name]
        _refuse_changed(joint, measured)
        return measured

    def experiment_of(self, joint: Joint) -> tuple[Experiment, Path | None]:
        """The experiment of a joint, of which no log is read, and the folder of its file; None where that is not known.

        Raises InputError where the experiment is not known, or cannot be loaded any more.
        """
        text = next((text for text in self.texts if joint.name in text.joints), None)
        if joint.name in self.read:
            return self.read[joint.name].experiment, None if text is None else text.path.parent
        if text is None:
            raise InputError(f"{joint.name}: got results without their experiment file")
        loaded = text.loaded()
        if joint.name not in names_of(loaded):
            raise InputError(f"{text.path.name}: its text in the results names no joint {short(joint.name)}")
        return loaded if isinstance(loaded, Experiment) else pick(loaded, joint.name).experiment, text.path.parent

    def _read_again(self, text: SourceText, joint: Joint) -> Mapping[str, Measured]:
        loaded = text.loaded()
        if joint.name not in names_of(loaded):
            raise InputError(f"{text.path.name}: its text in the results names no joint {short(joint.name)}")
        again = measure_joints(loaded, only=joint.name, constant=joint.torque_constant)
        return {one.experiment.joint.name: one for one in again}

    def written(self, folder: Path) -> tuple[WrittenExperiment, ...]:
        """As a results file in some folder has them."""
        return tuple(text.written(folder) for text in self.texts)


def _refuse_changed(joint: Joint, measured: Measured) -> None:
    """InputError where a log is not the one that the joint was identified from."""
    known = [(x.file, x.sha256) for x in joint.inputs]
    found = [(run.record.file, run.record.sha256) for run in measured.runs]
    if known != found:
        odd = next((file for file, sha in found if (file, sha) not in known), None)
        what = f"{odd} was changed, or added," if odd else "a log went missing"
        raise InputError(
            f"{joint.name}: {what} since the joint was identified; expected the same logs, or identify it anew"
        )
