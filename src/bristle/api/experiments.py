"""The questions that a user asks of logs, of experiments, and of results."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from bristle.api.exporting import explorers
from bristle.api.fleets import Fleet
from bristle.api.identifying import Known, asked_joint, identified, identify, read_if_results
from bristle.api.results import Results
from bristle.api.sources import Source, path_of
from bristle.data.experiment.draft import Told
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.page.output_folder import check_folder
from bristle.progress import Progress, step
from bristle.questions.array_fit.fit import Fit
from bristle.questions.compensation.replay import replays
from bristle.questions.compensation.study import Study, begin_study, study
from bristle.questions.drafting.proposal import draft_of_logs
from bristle.questions.experiment_design.plan import VELOCITIES, Plan, check_plan
from bristle.questions.experiment_design.plan import plan as plan_next
from bristle.questions.method_validation.cases import joint_cases, sweep
from bristle.questions.method_validation.results import Validation
from bristle.questions.method_validation.run import REPETITIONS, STARTS, check_request
from bristle.questions.method_validation.run import validate as validate_cases
from bristle.questions.sensitivity.joint import motion_of, of_gripper, of_joint
from bristle.questions.sensitivity.study import SAMPLES, SensitivityStudy, check_samples, study_sensitivity
from bristle.questions.session_comparison.compare import compare as compare_sessions
from bristle.questions.session_comparison.results import Comparison, read_session, session_of
from bristle.simulation import edro
from bristle.simulation.joint_loop import asked_parts, of_experiment, of_paper
from bristle.workers import REPORT, sharing

if TYPE_CHECKING:
    from bristle.page.page import Drawing
    from bristle.page.report import Report


Answer = Comparison | Plan | SensitivityStudy | Study | Validation
"""Results of questions; the `report.py` beside each makes sections of it, and is imported only then, for it draws."""


def report(
    *experiments: Source,
    folder: Path | str,
    uncertainty: bool = False,
    need: float | str | None = None,
    workers: int = 1,
    mailed: bool = False,
    found: Callable[[Results], object] | None = None,
    progress: Progress | None = None,
) -> Results:
    """Identify joints and write the report of them into a folder: its pages, results.json, figures and tables.

    >>> import bristle, pathlib
    >>> results = bristle.report("wrist.yaml", folder="report")
    >>> sorted(path.name for path in pathlib.Path("report").iterdir() if path.suffix)
    ['checks.html', 'data.html', 'explore.html', 'index.html', 'joints.html', 'method.html', 'results.json', 'uncertainty.html']

    Args:
        experiments: files of a joint or a robot each, or one results file, whose report is written anew; none: the embedded
            Ed-Ro (simulated), with its compensation (`adapt`) on the page too.
        folder: made where it does not exist; only what bristle made there before is replaced.
        uncertainty: whether each parameter of moving runs gets its intervals by profile and bootstrap too.
        need: as of `identify`; None: of a results file what it holds.
        workers: as of `identify`.
        mailed: whether the pages and what belongs to them are written as one reproducible file, report.zip, as well.
        found: called with the results before anything is written.
        progress: told of every step.

    Raises InputError in one sentence where a file cannot be used, or the folder cannot be written.
    """
    check_folder(Path(folder), ("results.json",))
    with sharing(workers, *REPORT, begin=partial(levels.put, levels.changed())) as share:
        from bristle.questions.joint_report.figures import drawings  # while the processes load it too

        begun: dict[str, dict[str, Drawing]] = {}

        def draw(joint: Joint) -> None:
            """Draw the figures of a joint while others are identified."""
            begun[joint.name] = drawings(joint, share)

        results = identified(
            *experiments, uncertainty=uncertainty, need=need, share=share, progress=progress, each=draw
        )
        explored = explorers(results, share)
        compensated = None if experiments else begin_study(of_paper(results.joints), (), progress, share, paper=True)
        if found is not None:
            found(results)
        study = None if compensated is None else compensated()
        results.write(folder, progress, study, next(explored), mailed=mailed, share=share, begun=begun)
    return results


def adapt(experiment: Known | None = None, *, joint: str | None = None, progress: Progress | None = None) -> Study:
    """The identified joint in closed loop: the paper's experiments 3.3 to 5 and others, and replays of tracking runs.

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 8, 0.002)
    >>> v = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    >>> q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) * 0.002
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> T = bristle.simulate(v, 0.002, law) + 0.001 * np.gradient(v, t)
    >>> T += 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> study = bristle.adapt(bristle.fit_dynamic(t, q, T, directions="symmetric"))
    >>> print(bristle.report_of(study).text()[:54])
    joint, 0.2 Hz: RMS error 23.7 mrad without, 0.129 mrad

    With no experiment the four joints of the embedded Ed-Ro (simulated); of several joints the one named `joint`. Raises
    InputError in one sentence where a file cannot be used, nothing is known of the inertia or of part of the model, or the
    loop cannot be run as asked.
    """
    if experiment is None:
        return study(of_paper(identify(progress=progress).joints), progress=progress, paper=True)
    asked = asked_joint(experiment, joint)
    asked_parts(asked.experiment)  # what cannot be is said before minutes are spent
    measured, found = asked.identified(progress)
    subject = of_experiment(measured.experiment, found)
    step(progress, "replaying the tracking runs")
    return study([subject], replays(subject, found, measured), progress)


def compare(first: Results | Path | str, second: Results | Path | str) -> Comparison:
    """Which parameters changed beyond their joint uncertainty between two sessions, given as results or `results.json`.

    >>> import bristle
    >>> first = bristle.identify("wrist.yaml")
    >>> [change.parameter.name for change in bristle.compare(first, first).changes if change.changed]
    []

    Raises InputError in one sentence where a file is no results file, both are one file, or they have no joint of one
    kind and unit in common.
    """
    results = "results as identify gave them, or the path of their file"
    given = [x if isinstance(x, Results) else path_of(x, results) for x in (first, second)]
    sessions = [session_of(x.joints) if isinstance(x, Results) else read_session(x) for x in given]
    if isinstance(given[0], Path) and isinstance(given[1], Path) and given[0].samefile(given[1]):
        raise InputError(f"{second}: is the same file as {first}; expected the results.json of another session")
    return compare_sessions(*sessions)


def sensitivity(
    experiment: Known | None = None,
    *,
    joint: str | None = None,
    amplitude: float | str | None = None,
    frequency: float | str | None = None,
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> SensitivityStudy:
    """Which parameters of a joint matter along a motion, over amplitude and frequency, and over their intervals.

    >>> import bristle
    >>> study = bristle.sensitivity("wrist.yaml", samples=0)
    >>> print(bristle.report_of(study).text()[:20])
    alpha_0 matters most

    Args:
        experiment: of the joint, or what `identify` or a fit of arrays gave; None: the paper's gripper rotation (+), with the
            intervals that its simulated logs give.
        joint: which, where there are several.
        amplitude: of the motion, rad or m, or a quantity; None: `adapt.amplitude`, or from the measured speeds.
        frequency: Hz, or a quantity; None: `adapt.frequency`, or 0.5 Hz.
        samples: of the Sobol indices, a power of two, at least 32; 0: none.
        progress: told of every step.

    Raises InputError in one sentence where a file cannot be used, its friction vs velocity is unknown, or the motion or
    the number of samples is invalid.
    """
    check_samples(samples)
    known = edro.experiments()[0] if experiment is None else experiment
    asked = asked_joint(known, joint)
    motion_of(asked.experiment.joint.kind, amplitude, frequency, (1.0, 1.0))  # said before seconds are spent
    measured, found = asked.identified(progress)
    request = (of_gripper if experiment is None else of_joint)(measured, found, amplitude, frequency)
    return study_sensitivity(found, request, samples, progress)


def validate(
    experiment: Known | None = None,
    *,
    joint: str | None = None,
    repetitions: int = REPETITIONS,
    starts: int = STARTS,
    noise: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """The grid search validated against full nonlinear fits, on points SIMULATED from the fitted model.

    >>> import bristle
    >>> checked = bristle.validate("wrist.yaml", repetitions=20, starts=2)
    >>> len(checked.cases)
    1

    With no experiment a declared sweep: every set of Table 1, at two noise levels and three designs. The seed is fixed.

    Args:
        experiment: of one joint, or what `identify` or a fit of arrays gave.
        joint: which, where there are several.
        repetitions: data sets for each method that is fast; the solvers of full fits see the first 50.
        starts: random starts of each such solver on one data set.
        noise: standard deviation of a point's torque over alpha_0; None: the fit's own, or both levels of the sweep.
        progress: called as it goes.

    Raises InputError in one sentence where a file cannot be used, or a number makes no validation.
    """
    check_request(repetitions, starts, noise)
    source = None if experiment is None else read_if_results(experiment)
    if source is None:
        case_set = sweep(noise)
    elif isinstance(source, Results):  # which needs no logs
        case_set = joint_cases(source.joint(None if isinstance(experiment, Fit) else joint), noise)
    else:
        case_set = joint_cases(asked_joint(source, joint).identified(progress)[1], noise)
    return validate_cases(case_set, repetitions=repetitions, starts=starts, progress=progress)


def plan(
    experiment: Known,
    *,
    joint: str | None = None,
    velocities: int = VELOCITIES,
    aim: str = "all",
    progress: Progress | None = None,
) -> Plan:
    """What to measure next: constant velocities, slow loading and a tracking motion, and the intervals to expect.

    >>> import bristle
    >>> plan = bristle.plan("wrist.yaml", velocities=4)
    >>> print(bristle.report_of(plan).text()[:49])
    points: measure 4 speeds from 0.02 to 1 rad/s in

    Args:
        experiment: with limits under `plan`, or else as far as its runs went; or what `identify` or a fit of arrays gave.
        joint: which, where there are several.
        velocities: runs at constant velocity in each direction.
        aim: the parameter whose interval is to shrink, or `all`.
        progress: called with what is being done, how many steps are done, and how many there are.

    Raises InputError in one sentence where a file cannot be used, or its limits leave nothing to plan.
    """
    asked = asked_joint(experiment, joint)
    check_plan(velocities, aim)
    return plan_next(*asked.identified(progress), velocities, aim, progress)


def inspect(experiment: Known, joint: str | None = None) -> Measured:
    """Read the runs of a joint and cut them into segments, and look for points off the law; no result is fitted.

    >>> import bristle
    >>> [segment.velocity for segment in bristle.inspect("wrist.yaml").segments[0]]
    [-1.0, -0.3, -0.08, -0.02, 0.02, 0.08, 0.3, 1.0]

    Raises InputError in one sentence where a file cannot be used, or is of several joints and `joint` names none of them.
    """
    return asked_joint(experiment, joint).measured()


def draft(
    *logs: Path | str, told: Told | None = None, folder: Path | str | None = None, progress: Progress | None = None
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
    place = None if folder is None else Path(folder)
    return draft_of_logs([Path(log) for log in logs], told or Told(), place, progress)


def report_of(result: Answer | Fleet) -> "Report":
    """A result as a report: `text()` is what the command prints, `write(folder)` the page with its figures and tables.

    >>> import bristle
    >>> first = bristle.identify("wrist.yaml")
    >>> report = bristle.report_of(bristle.compare(first, first))
    >>> report.write("page").name, sorted(report.frames)
    ('index.html', ['changes', 'sets'])

    Args:
        result: of `adapt`, `compare`, `fleet`, `plan`, `sensitivity` or `validate`.

    Raises InputError where it is anything else.
    """
    if isinstance(result, Fleet):
        return result.report()
    if not isinstance(result, Answer):
        expected = "a result of adapt, compare, fleet, plan, sensitivity or validate"
        raise InputError(f"got a {type(result).__name__}; expected {expected}")
    made: Report = import_module(f"{type(result).__module__.rpartition('.')[0]}.report").report(result)
    return made
