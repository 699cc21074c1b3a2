"""Before anything is identified: what logs hold, and the experiment file that describes them."""

from pathlib import Path

from bristle.api.joints import Known, asked_joint
from bristle.data.experiment.draft import Told
from bristle.identification.measured import Measured
from bristle.identification.proposal import completed, draft_of_logs
from bristle.progress import Progress


def inspect(experiment: Known, joint: str | None = None) -> Measured:
    """Read the runs of a joint and cut them into segments, and look for points off the law; no result is fitted.

    >>> import bristle
    >>> [segment.velocity for segment in bristle.inspect("wrist.yaml").segments[0]]
    [-1.0, -0.3, -0.08, -0.02, 0.02, 0.08, 0.3, 1.0]

    Raises InputError in one sentence where a file cannot be used, or is of several joints and `joint` names none of them.
    """
    return asked_joint(experiment, joint).measured()


def draft(
    *logs: Path | str, told: Told | None = None, folder: Path | None = None, progress: Progress | None = None
) -> tuple[str, tuple[str, ...]]:
    """The text of an experiment file that runs as it is, for logs of one joint, and a sentence on each thing guessed.

    >>> import bristle
    >>> text, guessed = bristle.draft("points.csv")
    >>> print(text.splitlines()[0])
    joint: {name: "points", kind: revolute}   # revolute or prismatic
    >>> guessed[0]
    'joint.kind: revolute, by the units'

    Args:
        logs: data files with the same columns; `bristle.Told` says what their names do not.
        told: columns, units, scales and constants that are not to be guessed.
        folder: where the text will be saved, for data files are named relative to it; None: beside the first.
        progress: called with what is being done, how many steps are done, and how many there are.

    Raises InputError in one sentence where something needed cannot be guessed, or a file cannot be used as drafted.
    """
    return draft_of_logs([Path(log) for log in logs], told or Told(), folder, progress)


def complete(experiment: Path | str) -> tuple[str, str]:
    """The text of an experiment file with the set-up that its runs ask for, and a sentence that says what was added, and why.

    >>> import bristle
    >>> text, said = bristle.complete("wrist.yaml")
    >>> said.partition(":")[0]
    'nothing added'

    Runs without `experiment` get one, by what their signals do; regressors and directions are tried as `static.set_up`
    has it; what the file says of `fit` already is left to its author, and the line to write there is a comment. Raises
    InputError where a file cannot be used.
    """
    return completed(Path(experiment))
