"""Everything that is tried of one or more joints: the paper's experiments, what goes beyond them, and replays of measured runs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bristle.arrays import Array
from bristle.control.adaptation import Law
from bristle.control.closed_loop import Trajectory
from bristle.progress import Progress, teller
from bristle.questions.compensation import ablation as ablating
from bristle.questions.compensation import paper_experiments, parameter_studies
from bristle.questions.compensation.ablation import AblationRow
from bristle.questions.compensation.paper_experiments import Adapted, Errors
from bristle.questions.compensation.parameter_studies import AdaptationMap, Band, Controlled, Drift, Sampled
from bristle.questions.compensation.replay import Replay
from bristle.simulation.joint_loop import JointLoop, one_way
from bristle.workers import Share, called

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """What was tried. Errors, drifts and sampling are of every joint, all else of the first."""

    loops: tuple[JointLoop, ...]
    adapting: JointLoop
    """The first joint as the adaptation has it: the paper's Table 2 has the positive friction in both directions."""
    paper: bool
    """Whether these are the paper's joints and experiments."""
    errors: tuple[Errors, ...]
    followed: dict[str, Trajectory]
    adapted: Adapted
    adaptation_map: AdaptationMap
    gradients: tuple[Array, dict[Law, Array]]
    drifts: tuple[Drift, ...]
    controllers: tuple[Controlled, ...]
    sampling: tuple[Sampled, ...]
    ablation: tuple[AblationRow, ...]
    band: Band | None
    replays: tuple[Replay, ...] = ()

    def text(self) -> str:
        """What compensation does to each error, where adaptation ends, and whether it would help on the measured runs; a line each."""
        from bristle.questions.compensation.page import lines

        return "\n".join(lines(self))

    def to_frame(self) -> "pd.DataFrame":
        """Fig. 8: a row for each joint, frequency and inertia feed-forward; errors in rad (m), torques in N*m (N)."""
        from bristle.questions.compensation.tables import compensation_errors

        return compensation_errors(self)

    def write(self, folder: Path | str) -> Path:
        """Write a page with figures and tables into a folder; returns the path of index.html.

        Only what bristle made there before is replaced. Raises InputError where the folder cannot be used, with nothing half-written.
        """
        from bristle.questions.compensation.page import write_adaptation

        return write_adaptation(self, Path(folder))


def study(
    loops: Sequence[JointLoop], replays: Sequence[Replay] = (), progress: Progress | None = None, *, paper: bool = False
) -> Study:
    """Run all of it; for the `paper`'s joints its Table 2 as it has that.

    Raises InputError where a loop cannot be run: a control period longer than it bears.
    """
    return begin_study(loops, replays, progress, map, paper=paper)()


def begin_study(
    loops: Sequence[JointLoop], replays: Sequence[Replay], progress: Progress | None, share: Share, *, paper: bool
) -> Callable[[], Study]:
    """`study`, begun by whoever shares the work; what is returned waits for the end, and raises what `study` does."""
    first = loops[0]
    adapting = one_way(first) if paper else first
    of_first: dict[str, partial[Any]] = {  # the longest first
        "ablation": partial(ablating.ablate, first),
        "adaptation_map": partial(parameter_studies.map_adaptation, adapting),
        "band": partial(parameter_studies.band, first),
        "adapted": partial(paper_experiments.adapted, adapting),
        "controllers": partial(parameter_studies.compare_controllers, first),
        "followed": partial(paper_experiments.followed, first),
        "gradients": partial(parameter_studies.gradients, adapting.plant.positive, adapting.adaptation.parameters[0]),
    }
    of_each: dict[str, Callable[[Sequence[JointLoop]], tuple[Any, ...]]] = {
        "errors": paper_experiments.errors,
        "drifts": parameter_studies.drifts,
        "sampling": parameter_studies.compare_sampling,
    }
    parts = list(of_first.items())
    parts += [(name, partial(run, [loop])) for name, run in of_each.items() for loop in loops]
    results = iter(share(called, [run for _, run in parts]))

    def ended() -> Study:
        """All of it, once it has come."""
        found: dict[str, Any] = dict.fromkeys(of_each, ())
        tell = teller(progress, len(parts))
        for name, _ in parts:
            tell(f"compensating: {name.replace('_', ' ')}")
            result = next(results)
            found[name] = found[name] + result if name in of_each else result
        return Study(loops=tuple(loops), adapting=adapting, paper=paper, replays=tuple(replays), **found)

    return ended
