"""Everything that is tried of one or more joints: the paper's experiments, what goes beyond them, and replays of measured runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bristle.arrays import Array
from bristle.control.adaptation import Law
from bristle.control.closed_loop import Trajectory
from bristle.progress import Progress
from bristle.questions.compensation import ablation as trying
from bristle.questions.compensation import paper_experiments, parameter_studies
from bristle.questions.compensation.ablation import Tried
from bristle.questions.compensation.paper_experiments import Adapted, Errors
from bristle.questions.compensation.parameter_studies import Band, Controlled, Drift, Map, Sampled
from bristle.questions.compensation.replay import Replay
from bristle.simulation.joint_loop import Subject, one_way


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What was tried. Errors, drifts and sampling are of every joint, all else of the first."""

    subjects: tuple[Subject, ...]
    adapting: Subject
    """The first joint as the adaptation has it: the paper's Table 2 has the positive friction in both directions."""
    paper: bool
    """Whether these are the paper's joints and experiments."""
    errors: tuple[Errors, ...]
    followed: dict[str, Trajectory]
    adapted: Adapted
    landings: Map
    gradients: tuple[Array, dict[Law, Array]]
    drifts: tuple[Drift, ...]
    controllers: tuple[Controlled, ...]
    sampling: tuple[Sampled, ...]
    ablation: tuple[Tried, ...]
    band: Band | None
    replays: tuple[Replay, ...] = ()


def study(
    subjects: Sequence[Subject],
    replays: Sequence[Replay] = (),
    progress: Progress | None = None,
    *,
    paper: bool = False,
) -> Study:
    """Run all of it; for the `paper`'s joints its Table 2 as it has that.

    Raises InputError where a loop cannot be run: a control period longer than it bears.
    """
    first = subjects[0]
    adapting = one_way(first) if paper else first
    steps: dict[str, Callable[[], Any]] = {
        "errors": lambda: paper_experiments.errors(subjects),
        "followed": lambda: paper_experiments.followed(first),
        "adapted": lambda: paper_experiments.adapted(adapting),
        "landings": lambda: parameter_studies.landings(adapting),
        "gradients": lambda: parameter_studies.gradients(adapting.plant.positive, adapting.adaptation.parameters[0]),
        "drifts": lambda: parameter_studies.drifts(subjects),
        "controllers": lambda: parameter_studies.controllers(first),
        "sampling": lambda: parameter_studies.sampling(subjects),
        "ablation": lambda: trying.ablation(first),
        "band": lambda: parameter_studies.band(first),
    }
    found = {}
    for done, (name, run) in enumerate(steps.items()):
        if progress:
            progress(f"compensating: {name}", done, len(steps))
        found[name] = run()
    return Study(subjects=tuple(subjects), adapting=adapting, paper=paper, replays=tuple(replays), **found)
