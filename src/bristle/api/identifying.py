"""Identification of the joints of experiment files, and the joint of a question."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import NamedTuple

from bristle.api.results import Results, choose, read_results
from bristle.api.sources import JointLogs, Source, is_results_file, measure_joints, names_of, open_all, opened
from bristle.data.experiment.load import Experiment
from bristle.data.robot.robot_file import Robot, pick
from bristle.errors import InputError, short
from bristle.estimation import levels
from bristle.findings import Severity
from bristle.identification.identify import identify_joint
from bristle.identification.known_gravity import measure_scaled
from bristle.identification.measured import Measured
from bristle.identification.results import Joint, WrittenExperiment
from bristle.identification.robot.measured import measure_robot
from bristle.progress import Progress, step
from bristle.questions.array_fit.fit import Fit
from bristle.workers import Share, sharing

Known = Source | Results | Fit
"""A joint to be identified, or identified already: results, their file, or a fit of arrays."""


def read_if_results(known: Known) -> Source | Results:
    """The results of a results file or a fit; other sources unchanged. Raises InputError where a file is damaged."""
    if isinstance(known, Fit):
        return Results(joints=(known.joint,), logs=JointLogs(read={known.joint.name: known.measured}))
    return read_results(known) if isinstance(known, Path | str) and is_results_file(Path(known)) else known


class AskedJoint(NamedTuple):
    """The joint of a question; it is measured and identified when that is asked for."""

    experiment: Experiment  # as its file has it: of a robot with a torque constant that is still free
    source: Experiment | Robot | tuple[Measured, Joint]  # what its file describes; or what is known of it already

    def measured(self, progress: Progress | None = None) -> Measured:
        """The data that it was, or is to be identified from."""
        if isinstance(self.source, tuple):
            return self.source[0]
        (measured,) = measure_joints(self.source, progress, only=self.experiment.joint.name)
        return measured

    def identified(self, progress: Progress | None) -> tuple[Measured, Joint]:
        """Its data, and the joint, identified here unless it is already."""
        if isinstance(self.source, tuple):
            return self.source
        measured = self.measured(progress)
        step(progress, f"identifying {self.experiment.joint.name}")
        return measured, identify_joint(measured, progress=progress)


def asked_joint(known: Known, name: str | None = None) -> AskedJoint:
    """The joint of a name, or the only one. Raises InputError where a file cannot be read, or there are several joints."""
    source = read_if_results(known)
    if isinstance(source, Results):
        joint = source.joint(None if isinstance(known, Fit) else name)
        measured = source.logs.of(joint)
        return AskedJoint(measured.experiment, (measured, joint))
    loaded, _ = opened(source)
    chosen = choose(names_of(loaded), name)
    own = pick(loaded, chosen).experiment if isinstance(loaded, Robot) else loaded
    return AskedJoint(own, loaded)


def identify(
    *experiments: Source,
    joint: str | None = None,
    progress: Progress | None = None,
    uncertainty: bool = False,
    need: float | str | None = None,
    workers: int = 1,
) -> Results:
    """Identify the joints of one or more files, of a joint or a robot each; with none, the embedded Ed-Ro (simulated).

    >>> import bristle
    >>> results = bristle.identify("wrist.yaml")
    >>> results
    Results(joints=(Joint('points': static both),))
    >>> results.to_frame()[["parameter", "value"]].round(3).head(2)
      parameter  value
    0   alpha_0  0.019
    1   alpha_1  0.005

    Args:
        experiments: files, or what was loaded from them.
        joint: the only one of a robot that is identified; None: all.
        progress: told of every step.
        uncertainty: whether each parameter of moving runs gets its intervals by profile and bootstrap too; those of
            static and presliding fits always do.
        need: how well friction must be known (95 %) for the values to be used, percent, as 5 or "5%"; None: 10.
        workers: processes among which the joints are shared out; in a script more than one need
            `if __name__ == "__main__":` around the call.

    Raises InputError in one sentence where a file cannot be used, or where two experiments name the same joint.
    """
    files = open_all(experiments)
    processes, begin = min(workers, len(_chosen(files, joint))), partial(levels.put, levels.changed())
    with sharing(processes, "bristle.identification.identify", begin=begin) as share:
        return _identified(files, joint, share, progress, uncertainty=uncertainty, need=need)


def identified(
    *experiments: Source,
    joint: str | None = None,
    uncertainty: bool = False,
    need: float | str | None = None,
    share: Share = map,
    progress: Progress | None = None,
    each: Callable[[Joint], None] = lambda _: None,
) -> Results:
    """`identify` with the joints shared out; of one results file what it holds, and nothing is identified.

    `need` None leaves that of a results file. `each` is called with each identified joint while others are in work.
    Raises InputError as `identify` and `read_results` do.
    """
    if len(experiments) == 1:
        known = read_if_results(experiments[0])
        if isinstance(known, Results):
            joints = known.joints if joint is None else (known.joint(joint),)
            return replace(
                known, joints=tuple(replace(x, need=x.need if need is None else percent(need)) for x in joints)
            )
        experiments = (known,)
    files = open_all(experiments)
    return _identified(files, joint, share, progress, each, uncertainty=uncertainty, need=need)


_Files = Sequence[tuple[Experiment | Robot, WrittenExperiment | None]]


def _chosen(files: _Files, joint: str | None) -> list[str]:
    names = [name for loaded, _ in files for name in names_of(loaded)]
    return names if joint is None else [choose(names, joint)]


def _identified(
    files: _Files,
    joint: str | None,
    share: Share,
    progress: Progress | None,
    each: Callable[[Joint], None] = lambda _: None,
    *,
    uncertainty: bool,
    need: float | str | None,
) -> Results:
    chosen = _chosen(files, joint)
    # data that cannot be used are refused before minutes are spent on the others
    every = list[Measured]()
    alone = iter(share(measure_scaled, [loaded for loaded, _ in files if isinstance(loaded, Experiment)]))
    for loaded, _ in files:
        every += [next(alone)] if isinstance(loaded, Experiment) else measure_robot(loaded, progress, share)
    every = [one for one in every if one.experiment.joint.name in chosen]
    work = partial(_work, uncertainty=uncertainty, need=levels.NEED if need is None else percent(need))
    waiting = iter(share(partial(work, progress=progress) if share is map else work, every))
    found = list[Joint]()
    for done, measured in enumerate(every):
        if progress:
            progress(f"identifying {measured.experiment.joint.name}", done, len(every))
        found.append(next(waiting))
        each(found[-1])
    texts = tuple(text for _, text in files if text is not None)
    logs = JointLogs(texts=texts, read={one.experiment.joint.name: one for one in every})
    return Results(joints=tuple(found), logs=logs)


def _work(measured: Measured, uncertainty: bool, need: float, progress: Progress | None = None) -> Joint:
    """`identify_joint`; where data are no good the error names what was found in them first."""
    try:
        joint = identify_joint(measured, uncertainty=uncertainty, progress=progress)
    except InputError as error:
        if measured.link_inertia is None and not measured.findings:
            raise
        cause = next((w for w in measured.findings if w.severity is Severity.CRITICAL), error)
        raise InputError(f"{measured.experiment.joint.name}: {cause}") from error
    return replace(joint, need=need)


def percent(need: float | str) -> float:
    """A percentage, with or without its sign. Raises InputError where it is not above 0."""
    try:
        value = float(str(need).strip().removesuffix("%"))
    except ValueError:
        value = 0.0
    if not 0 < value < inf:
        raise InputError(f"need: got {short(need)}; expected a percentage of friction that is more than 0, such as 10%")
    return value
