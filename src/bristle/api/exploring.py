"""The page on which the friction model of identified joints can be played with."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from bristle.api.identifying import identify
from bristle.api.joints import Known, read_if_results
from bristle.api.results import Results
from bristle.errors import InputError
from bristle.identification.results import Joint
from bristle.progress import Progress
from bristle.questions.array_fit.fit import Fit
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop, of_experiment, of_paper
from bristle.workers import Share

if TYPE_CHECKING:
    from bristle.questions.explorer.page import Explorer


def explore(
    experiment: Known | None = None, *, joint: str | None = None, progress: Progress | None = None
) -> "Explorer":
    """The friction model in the hand: one page that computes offline, with sliders for the parameters of each joint.

    >>> import bristle
    >>> page = bristle.explore("wrist.yaml")
    >>> page.joints
    ('points',)
    >>> page.write("explore.html").name
    'explore.html'

    Args:
        experiment: a file of a joint or of a robot, or what `identify` or a fit of arrays gave; None: the embedded Ed-Ro
            (simulated).
        joint: the only one on the page; None: all.
        progress: told of every step.

    Of results no log is read. Raises InputError in one sentence where a file cannot be used, or nothing is known of the
    friction over velocity.
    """
    from bristle.questions.explorer.page import explorer  # which draws, and a fit does not

    known = identify(joint=joint, progress=progress) if experiment is None else read_if_results(experiment)
    results = known if isinstance(known, Results) else identify(known, joint=joint, progress=progress)
    return explorer(*_known(results, None if isinstance(experiment, Fit) else joint))


def explorers(results: Results, share: Share) -> Iterator["Explorer | None"]:
    """The one page of all joints, made by whoever shares the work; None where nothing is known of the friction over velocity."""
    return iter(share(_explorer, [_known(results)]))


def _explorer(known: "_Known") -> "Explorer | None":
    from bristle.questions.explorer.page import explorer

    with suppress(InputError):
        return explorer(*known)
    return None


_Known = tuple[Sequence[Joint], dict[str, JointLoop | str]]
"""Joints, and the loop of each or why there is none."""


def _known(results: Results, joint: str | None = None) -> _Known:
    joints = results.whole_joints(joint)
    return joints, {found.name: known_loop(results, found) for found in joints}


def known_loop(results: Results, joint: Joint) -> JointLoop | str:
    """The loop of an identified joint, the paper's own of the embedded ones, or the sentence why there is none."""
    try:
        experiment, folder = results.logs.experiment_of(joint)
        if folder != edro.datasets_folder() or joint.name not in edro.TABLE_1:
            return of_experiment(experiment, joint)
    except InputError as error:
        return str(error)
    return of_paper([joint])[0]
