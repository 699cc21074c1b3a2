"""Everything that is tried of one or more joints: the paper's experiments, what goes beyond them, and replays of measured runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bristle.compensation import ablation as trying
from bristle.compensation import beyond
from bristle.compensation import experiments as paper
from bristle.compensation.ablation import Tried
from bristle.compensation.beyond import Band, Controlled, Drift, Map, Sampled
from bristle.compensation.experiments import Adapted, Errors
from bristle.compensation.replay import Replay
from bristle.compensation.subject import Subject
from bristle.control.closed import Trajectory
from bristle.model.arrays import Array

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many steps are done, and how many there are."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What was tried. Errors, drifts and sampling are of every joint, all else of the first."""

    subjects: tuple[Subject, ...]
    adapting: Subject
    """The first joint as the adaptation has it: the paper's Table 2 has the positive friction in both directions."""
    errors: tuple[Errors, ...]
    followed: dict[str, Trajectory]
    adapted: Adapted
    landings: Map
    gradients: tuple[Array, dict[str, Array]]
    drifts: tuple[Drift, ...]
    controllers: tuple[Controlled, ...]
    sampling: tuple[Sampled, ...]
    ablation: tuple[Tried, ...]
    band: Band | None
    replays: tuple[Replay, ...] = ()


def study(
    subjects: Sequence[Subject], adapting: Subject, replays: Sequence[Replay] = (), progress: Progress | None = None
) -> Study:
    """Run all of it.

    Raises ValueError where a loop cannot be run: a control period longer than it bears.
    """
    first, total, done = subjects[0], 7, 0

    def say(what: str) -> None:
        nonlocal done
        if progress:
            progress(what, done, total)
        done += 1

    say("compensating: errors")
    errors, followed = paper.errors(subjects), paper.followed(first)
    say("compensating: adaptation")
    adapted = paper.adapted(adapting)
    say("compensating: rates, amplitudes, frequencies")
    landings = beyond.landings(adapting)
    say("compensating: drift")
    drifts = beyond.drifts(subjects)
    say("compensating: ablation")
    tried = trying.ablation(first)
    say("compensating: controllers, sampling")
    controllers, sampling = beyond.controllers(first), beyond.sampling(subjects)
    say("compensating: uncertainty")
    band = beyond.band(first)
    return Study(
        subjects=tuple(subjects), adapting=adapting, errors=errors, followed=followed, adapted=adapted, landings=landings,
        gradients=beyond.gradients(adapting.plant.positive, adapting.adaptation.parameters[0]), drifts=drifts, ablation=tried, band=band,
        controllers=controllers, sampling=sampling,
        replays=tuple(replays),
    )  # fmt: skip  # a list of values
