"""What `import bristle` offers: experiment files in, results out. The command line only calls these."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from bristle import edro
from bristle.compensation.asked import asked_parts, of_experiment
from bristle.compensation.replay import replays
from bristle.compensation.study import Study, study
from bristle.compensation.subject import of_paper
from bristle.data.experiment import Experiment, load_experiment
from bristle.identification.estimate import Joint
from bristle.identification.pipeline import Measured, identify_joint, measure
from bristle.report import summary
from bristle.report.tracking import FITS, fits

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[str, int, int], None]
"""Called with what is being done, how many steps are done, and how many there are."""
Source = Experiment | Path | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What was identified, joint by joint."""

    joints: tuple[Joint, ...]
    timings: dict[str, float] = field(default_factory=dict, compare=False)
    """Seconds spent, by name; no part of the result."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Every doubt about every joint, each with the joint's name and direction."""
        of_joints = [f"{joint.name}: {doubt}" for joint in self.joints for doubt in joint.doubts]
        of_fits = [f"{joint.name} {what}: {doubt}" for joint in self.joints for what, doubt in _of_fits(joint)]
        return (*of_joints, *of_fits)

    def to_json(self) -> str:
        """`results.json` of schema bristle-results/1."""
        return summary.to_json(self.joints)

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint, direction and parameter: value, unit, standard error, interval, doubts."""
        return summary.to_frame(self.joints)

    def fit_report(self) -> str:
        """The fits as plain text."""
        return summary.fit_report(self.joints)

    def write_report(
        self, folder: Path | str, progress: Progress | None = None, compensated: Study | None = None
    ) -> Path:
        """Write the HTML report, results.json, timings.json, figures and tables into a folder; returns the path of index.html.

        With what `adapt` returned, its sections follow.
        Only what bristle made there before is replaced. Raises ValueError where the folder cannot be used, with nothing half-written.
        """
        from bristle.report.page import write_report

        title = self.joints[0].name if len(self.joints) == 1 else f"{len(self.joints)} joints"
        return write_report(
            self.joints, Path(folder), title=title, seed=0, timings=self.timings, progress=progress, study=compensated
        )


def _of_fits(joint: Joint) -> Iterator[tuple[str, str]]:
    """Each doubt about a stage of a joint, with the stage's name."""
    stages: dict[str, tuple[str, ...]] = {d: fit.doubts for d, fit in joint.static.items()}
    if joint.presliding is not None:
        stages["presliding"] = joint.presliding.doubts
        stages |= {f"presliding {d}": fit.doubts for d, fit in joint.presliding.fits.items()}
    stages |= {FITS[kind]: fit.doubts for kind, fit in fits(joint).items()}
    yield from ((name, doubt) for name, doubts in stages.items() for doubt in doubts)


def identify(*experiments: Source, progress: Progress | None = None, second_route: bool = False) -> Results:
    """Identify the joints of one or more experiment files; with none, the embedded Ed-Ro (simulated).

    With `second_route` moving runs are fitted by CasADi and IPOPT as well, which takes long; the static fits always are.

    Raises ValueError in one sentence where a file cannot be used, or where two experiments name the same joint.
    """
    loaded = _load(experiments)
    timings: dict[str, float] = {}
    joints = []
    for done, experiment in enumerate(loaded):
        if progress:
            progress(f"identifying {experiment.joint.name}", done, len(loaded))
        spent: dict[str, float] = {}
        joints.append(identify_joint(measure(experiment), spent, second_route=second_route))
        timings |= {f"{experiment.joint.name}: {what}": seconds for what, seconds in spent.items()}
    return Results(joints=tuple(joints), timings=timings)


def adapt(
    experiment: Source | None = None, *, identified: Results | None = None, progress: Progress | None = None
) -> Study:
    """The identified joint in closed loop: the paper's experiments 3.3 to 5, what goes beyond them, and replays of the measured tracking runs.

    With no experiment the four joints of the embedded Ed-Ro (simulated), `identified` already or else first. Raises ValueError in one sentence
    where a file cannot be used, nothing is known of the inertia or of part of the model, or the loop cannot be run as asked.
    """
    if experiment is None:
        subjects = of_paper((identified or identify(progress=progress)).joints)
        return study(subjects, progress=progress, paper=True)
    loaded = _load([experiment])[0]
    asked_parts(loaded)  # what cannot be is said before minutes are spent
    if progress:
        progress(f"identifying {loaded.joint.name}", 0, 1)
    measured = measure(loaded)
    joint = identify_joint(measured)
    subject = of_experiment(loaded, joint)
    return study([subject], replays(subject, joint, measured), progress)


def write_adaptation(compensated: Study, folder: Path | str) -> Path:
    """Write what `adapt` returned as a page with figures and tables into a folder; returns the path of index.html.

    Only what bristle made there before is replaced. Raises ValueError where the folder cannot be used, with nothing half-written.
    """
    from bristle.report.page import write_adaptation as write

    joints = compensated.subjects
    return write(compensated, Path(folder), joints[0].name if len(joints) == 1 else f"{len(joints)} joints")


def inspect(experiment: Source) -> Measured:
    """Read an experiment's runs and cut them into segments, without fitting anything.

    Raises ValueError in one sentence where a file cannot be used.
    """
    return measure(experiment)


def _load(experiments: Sequence[Source]) -> list[Experiment]:
    sources = experiments or edro.experiments()
    loaded = [e if isinstance(e, Experiment) else load_experiment(e) for e in sources]
    names = [experiment.joint.name for experiment in loaded]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(
                f"joint.name: {names.count(name)} experiments name their joint {name!r}; give each joint its own name"
            )
    return loaded
