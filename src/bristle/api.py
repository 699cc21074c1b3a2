"""What `import bristle` offers: experiment files in, results out. The command line only calls these."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bristle.arrays import Array
from bristle.data.experiment.arrays import seconds
from bristle.data.experiment.draft import Told
from bristle.data.experiment.load import Experiment, load_experiment
from bristle.diagnostics import Diagnostic, Severity
from bristle.errors import InputError, short, short_list
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured, measure
from bristle.identification.proposal import completed, draft_of_logs
from bristle.identification.results import Joint
from bristle.model.parameters import Kind, Lugre, Pair, unit
from bristle.progress import Progress, step
from bristle.questions.array_fit.fit import (
    Fit,
    along,
    fit_motion,
    fit_points,
    fit_slow_loading,
    segments_frame,
    simulated_torque,
    steady,
)
from bristle.questions.compensation.replay import replays
from bristle.questions.compensation.study import Study, study
from bristle.questions.experiment_design.plan import VELOCITIES, Plan, check_plan
from bristle.questions.experiment_design.plan import plan as plan_next
from bristle.questions.method_validation.cases import joint_cases, sweep
from bristle.questions.method_validation.results import Validation
from bristle.questions.method_validation.run import REPETITIONS, STARTS, check_request
from bristle.questions.method_validation.run import validate as validate_cases
from bristle.questions.sensitivity.joint import motion_of, of_gripper, of_joint
from bristle.questions.sensitivity.study import SAMPLES, SensitivityStudy, check_samples, study_sensitivity
from bristle.questions.session_comparison.compare import compare as compare_sessions
from bristle.questions.session_comparison.results import Comparison
from bristle.simulation import edro
from bristle.simulation.joint_loop import asked_parts, of_experiment, of_paper

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What was identified, joint by joint."""

    joints: tuple[Joint, ...]
    timings: dict[str, float] = field(default_factory=dict, compare=False)
    """Seconds spent, by name; no part of the result."""
    measured: tuple[Measured, ...] = field(default=(), compare=False, repr=False)
    """What each joint was identified from, for questions that follow; no part of the result."""

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """Every diagnostic about a joint, one of its stages or a fit, with the joint's name first in its subject."""
        return tuple(
            replace(x, subject=(joint.name, *x.subject)) for joint in self.joints for x in joint.fit_warnings()
        )

    @property
    def serious(self) -> tuple[Diagnostic, ...]:
        """Those of `warnings` that are critical, or call for caution; notes are not."""
        return tuple(warning for warning in self.warnings if warning.severity is not Severity.NOTE)

    def text(self) -> str:
        """The fit report, as the command line prints it."""
        from bristle.questions.joint_report.text import fit_report

        return fit_report(self.joints)

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint, direction and parameter: value, unit, standard error, interval, warnings."""
        from bristle.questions.joint_report.results_file import to_frame

        return to_frame(self.joints)

    def to_json(self) -> str:
        """`results.json` of schema bristle-results/2."""
        from bristle.questions.joint_report.results_file import to_json

        return to_json(self.joints)

    def uncertainty(self) -> "pd.DataFrame":
        """One row per joint, fit and parameter: the 95 % interval by covariance, profile and bootstrap, and their warnings."""
        from bristle.questions.joint_report.interval_tables import uncertainty

        return uncertainty(self.joints)

    def write(self, folder: Path | str, progress: Progress | None = None, compensated: Study | None = None) -> Path:
        """Write the HTML report, results.json, timings.json, figures and tables into a folder; returns the path of index.html.

        With what `adapt` returned, its sections follow.
        Only what bristle made there before is replaced. Raises InputError where the folder cannot be used, with nothing half-written.
        """
        from bristle.questions.compensation.page import section
        from bristle.questions.joint_report.page import write_report

        title = self.joints[0].name if len(self.joints) == 1 else f"{len(self.joints)} joints"
        return write_report(
            self.joints,
            Path(folder),
            title=title,
            seed=0,
            timings=self.timings,
            progress=progress,
            appended=section(compensated) if compensated else None,
        )


Source = Experiment | Path | str
"""An experiment: loaded, or its file."""
Known = Source | Results | Fit
"""A joint: to be identified, or identified already."""


def identify(
    *experiments: Source, progress: Progress | None = None, crosscheck: bool = False, uncertainty: bool = False
) -> Results:
    """Identify the joints of one or more experiment files; with none, the embedded Ed-Ro (simulated).

    With `crosscheck` moving runs are fitted by CasADi and IPOPT as well, which takes long; the static fits always are.
    With `uncertainty` each parameter of moving runs gets its intervals by profile and bootstrap too; those of static and presliding fits always do.

    Raises InputError in one sentence where a file cannot be used, or where two experiments name the same joint.
    """
    loaded = _load(experiments)
    timings: dict[str, float] = {}
    joints, every = [], []
    for done, experiment in enumerate(loaded):
        if progress:
            progress(f"identifying {experiment.joint.name}", done, len(loaded))
        spent: dict[str, float] = {}
        measured = measure(experiment)
        every.append(measured)
        joints.append(
            identify_joint(measured, spent, crosscheck=crosscheck, uncertainty=uncertainty, progress=progress)
        )
        timings |= {f"{experiment.joint.name}: {what}": seconds for what, seconds in spent.items()}
    return Results(joints=tuple(joints), timings=timings, measured=tuple(every))


def fit(
    data: "ArrayLike | pd.DataFrame",
    /,
    torque: "ArrayLike | str | None" = None,
    *,
    velocity: str | None = None,
    position: "ArrayLike | str | None" = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    **options: Any,
) -> Fit:
    """Coulomb, Stribeck and viscous friction (9) from points of velocity and torque: what `identify` gives for a file of them.

    >>> import bristle
    >>> v = [-1.0, -0.6, -0.3, -0.15, -0.08, -0.04, -0.02, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0]
    >>> T = [-0.059, -0.0431, -0.0312, -0.0254, -0.0241, -0.0250, -0.0252, 0.0251, 0.0250, 0.0241, 0.0254, 0.0312, 0.0431, 0.059]
    >>> found = bristle.fit(v, T, directions="symmetric")
    >>> round(found.params["alpha_0"], 4)
    0.0193
    >>> found.predict([0.5]).round(3)
    array([0.039])

    Args:
        data: velocities, rad/s (m/s where prismatic), (n,); or a data frame, of which `velocity`, `torque` and `position` name columns.
        torque: of the drive, positive along positive velocity, N*m (N), (n,).
        velocity: the column of a data frame.
        position: rad (m), (n,), where gravity is among the regressors.
        units: of `velocity`, `torque` or `position` where they are not in SI, such as `{"velocity": "deg/s"}`.
        kind: of the joint, `revolute` or `prismatic`.
        options: as under `fit` in an experiment file: `directions`, `regressors`, `loss`, `stray`, `model`, `v_s_range`.

    Raises InputError in one sentence where an array is no n finite numbers (missing values are named by row), an option is
    unknown, or the points cannot be fitted.
    """
    signals: dict[str, Any] = {"velocity": data, "torque": torque, "position": position}
    if hasattr(data, "columns"):
        signals = {"velocity": _of_frame(data, velocity, "velocity"), "torque": _of_frame(data, torque, "torque")}
        signals |= {} if position is None else {"position": _of_frame(data, position, "position")}
    elif velocity is not None:
        raise InputError("velocity: names a column of a data frame; got arrays, of which the first is the velocity")
    if signals["torque"] is None:
        raise InputError("torque: missing; give n torques beside n velocities, or name the column of a data frame")
    return fit_points(signals, units or {}, kind, options)


def find_segments(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    velocity: "ArrayLike | None" = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
) -> "pd.DataFrame":
    """The stretches of a run at constant velocity, each a point for `fit`: those that are kept and those that are not, with the reasons.

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 12, 0.002)
    >>> v = np.repeat([0.1, 0.3, 0.9], 2000)
    >>> T = 0.02 + 0.04 * v + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = bristle.find_segments(t, np.cumsum(v) * 0.002, T)
    >>> found[found.accepted].velocity.round(2).tolist()
    [0.1, 0.3, 0.9]

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        velocity: rad/s (m/s), (n,), where it is logged; else from the position.
        units: of what is not in SI, by `time`, `position`, `velocity`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.

    Returns a row for each stretch: velocity, torque, its standard error, accepted, reasons, warnings, and its samples from
    `start` to before `stop`. Raises InputError in one sentence where an array is no n finite numbers.
    """
    return segments_frame(_signals(t, position, torque, velocity), units or {}, kind)


def fit_presliding(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    breakaway: Fit | None = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    **options: Any,
) -> Fit:
    """The bristle's stiffness from a torque that loads the resting joint slowly: section 3.2, (13) to (15).

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 20, 0.002)
    >>> T = 0.02 * np.interp(t % 20, [0, 5, 15, 20], [0, 1, -1, 0])
    >>> dT = np.diff(T, prepend=0.0)
    >>> q = np.cumsum(dT / (6.0 * (1 - np.sign(dT) * T / 0.025)))
    >>> found = bristle.fit_presliding(t, q, T)
    >>> round(found.params["sigma_0+"], 1)
    6.0

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        breakaway: what `fit` gave for the same joint: its alpha_0 + alpha_1 is the torque at which the joint slides; None: from
            these data, where they slide, or a lower bound.
        units: of what is not in SI, by `time`, `position`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.
        options: as under `fit` in an experiment file: `presliding_cutoff`, `breakaway_displacement`.

    Raises InputError in one sentence where an array is no n finite numbers, or the torque never grows slowly from zero.
    """
    return fit_slow_loading(_signals(t, position, torque, None), units or {}, kind, options, breakaway)


def fit_dynamic(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    velocity: "ArrayLike | None" = None,
    priors: Sequence[Fit] = (),
    inertia: float | str | None = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    uncertainty: bool = False,
    **options: Any,
) -> Fit:
    """All of LuGre (3)-(5) from a motion, with inertia and what else makes torque, as far as the motion shows them.

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 8, 0.002)
    >>> v = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    >>> q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) * 0.002
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> T = bristle.simulate(v, 0.002, law) + 0.001 * np.gradient(v, t)
    >>> T += 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = bristle.fit_dynamic(t, q, T, directions="symmetric")
    >>> round(found.params["alpha_0"], 3), round(found.params["inertia"], 4)
    (0.02, 0.001)

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        velocity: rad/s (m/s), (n,), where it is logged; else from the position.
        priors: what `fit` and `fit_presliding` gave for the same joint; all is then fitted together.
        inertia: kg*m**2 (kg), or a quantity such as `0.05 +/- 0.01 kg*m^2`, which is a prior; None: fitted.
        units: of what is not in SI, by `time`, `position`, `velocity`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.
        uncertainty: whether each parameter gets its intervals by profile and bootstrap too, which takes longer.
        options: as under `fit` in an experiment file: `directions`, `regressors`, `position_cutoff`, `predict`, `fixed`, `shared`.

    Raises InputError in one sentence where an array is no n finite numbers, an option is unknown, or the motion cannot be
    fitted.
    """
    known = f"{inertia!r} {unit('inertia', kind)}" if isinstance(inertia, int | float) else inertia
    signals = _signals(t, position, torque, velocity)
    return fit_motion(signals, units or {}, kind, options, priors, known, uncertainty=uncertainty)


def friction(velocity: "ArrayLike", of: Fit | Lugre[float]) -> Array:
    """Friction (9) of steady sliding, N*m, in the shape of `velocity`, rad/s, of a fit or of given parameters; 0 at rest.

    >>> import bristle
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.friction([0.0, 0.5, -0.5], law).round(3)
    array([ 0.  ,  0.04, -0.04])

    Raises InputError where a fit knows nothing of friction over velocity.
    """
    return of.friction(velocity) if isinstance(of, Fit) else steady(velocity, of)


def simulate(velocity: "ArrayLike", dt: float, of: Fit | Lugre[float] | Pair[float]) -> Array:
    """Friction torque (3)-(5), N*m, (n,), along a velocity, rad/s, (n,), with samples `dt` s apart, the bristle bent as in steady sliding at first.

    >>> import bristle, numpy as np
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.simulate(np.full(3, 0.5), 1e-3, law).round(3)
    array([0.04, 0.04, 0.04])

    Args:
        velocity: linear between its samples.
        dt: > 0.
        of: a fit of a motion, or parameters, for both directions or for each.

    Raises InputError where the velocity is no n finite numbers, or a fit does not show the bristle in both directions.
    """
    return simulated_torque(velocity, dt, of) if isinstance(of, Fit) else along(velocity, dt, of)


def _signals(t: Any, position: Any, torque: Any, velocity: Any) -> dict[str, Any]:
    """By name. Raises InputError where there is no time."""
    time = seconds(position) if t is None else t
    if time is None:
        raise InputError("t: missing; give n times, or a series whose index is the time as position")
    return {"time": time, "position": position, "velocity": velocity, "torque": torque}


def _of_frame(frame: Any, column: Any, name: str) -> Any:
    """A column of a data frame. Raises InputError where it has none of that name."""
    if not isinstance(column, str) or column not in frame.columns:
        raise InputError(
            f"{name}: got {short(column)}; expected one of the data frame's columns: {short_list(map(str, frame.columns))}"
        )
    return frame[column].to_numpy()


def adapt(
    experiment: Known | None = None, *, identified: Results | None = None, progress: Progress | None = None
) -> Study:
    """The identified joint in closed loop: the paper's experiments 3.3 to 5, what goes beyond them, and replays of the measured tracking runs.

    With no experiment the four joints of the embedded Ed-Ro (simulated), `identified` already or else first. Raises InputError in one sentence
    where a file cannot be used, nothing is known of the inertia or of part of the model, or the loop cannot be run as asked.
    """
    if experiment is None:
        subjects = of_paper((identified or identify(progress=progress)).joints)
        return study(subjects, progress=progress, paper=True)
    loaded = _experiment(experiment)
    asked_parts(loaded)  # what cannot be is said before minutes are spent
    measured, joint = _identified(experiment, loaded, progress)
    subject = of_experiment(loaded, joint)
    step(progress, "replaying the tracking runs")
    return study([subject], replays(subject, joint, measured), progress)


def compare(first: Results | Path | str, second: Results | Path | str) -> Comparison:
    """Which parameters changed beyond their joint uncertainty between two sessions, from the results of each, or its `results.json`.

    Raises InputError in one sentence where a file is no results file, both are one file, or they have no joint in common, of one kind and in the same
    units.
    """
    from bristle.questions.session_comparison.results_file import read_session, session_of

    sessions = [session_of(x.joints) if isinstance(x, Results) else read_session(Path(x)) for x in (first, second)]
    if not isinstance(first, Results) and not isinstance(second, Results) and Path(first).samefile(second):
        raise InputError(f"{second}: is the same file as {first}; expected the results.json of another session")
    return compare_sessions(*sessions)


def write_comparison(compared: Comparison, folder: Path | str) -> Path:
    """`Comparison.write`: what `compare` returned as a page with figures and tables."""
    return compared.write(folder)


def sensitivity(
    experiment: Known | None = None,
    *,
    amplitude: float | str | None = None,
    frequency: float | str | None = None,
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> SensitivityStudy:
    """Which parameters of a joint matter: along a motion, over amplitude and frequency, over their intervals; and what a motion would tell.

    Args:
        experiment: of the joint, or what `identify` or a fit of arrays gave; None: the paper's gripper rotation (+), with the
            intervals that its simulated logs give.
        amplitude: of the motion, rad (m where the joint slides) or a quantity such as `5 deg`; None: `adapt.amplitude`, or from the measured speeds.
        frequency: Hz, or a quantity; None: `adapt.frequency`, or 0.5 Hz.
        samples: of the Sobol indices, a power of two, at least 32; 0: none.
        progress: told of every step.

    Raises InputError in one sentence where a file cannot be used, nothing is known of its friction over velocity, or the motion or the samples
    cannot be.
    """
    check_samples(samples)
    known = edro.experiments()[0] if experiment is None else experiment
    loaded = _experiment(known)
    motion_of(loaded.joint.kind, amplitude, frequency, (1.0, 1.0))  # what cannot be is said before seconds are spent
    measured, joint = _identified(known, loaded, progress)
    request = (of_gripper if experiment is None else of_joint)(measured, joint, amplitude, frequency)
    return study_sensitivity(joint, request, samples, progress)


def validate(
    experiment: Known | None = None,
    *,
    identified: Results | None = None,
    repetitions: int = REPETITIONS,
    starts: int = STARTS,
    noise: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """The grid search validated against full nonlinear fits, on points SIMULATED from the fitted model at the joint's own velocities.

    With no experiment a declared sweep: every set of Table 1, at two noise levels and three designs. The seed is fixed.

    Args:
        experiment: of one joint, or what `identify` or a fit of arrays gave.
        identified: it, identified already; the first joint counts.
        repetitions: data sets for each method that is fast; the solvers of full fits see the first 50.
        starts: random starts of each such solver on one data set.
        noise: standard deviation of a point's torque over alpha_0; None: the fit's own, or both levels of the sweep.
        progress: called as it goes.

    Raises InputError in one sentence where a file cannot be used, or a number makes no validation.
    """
    check_request(repetitions, starts, noise)
    joint = identified.joints[0] if identified else None
    if experiment is not None and joint is None:
        _, joint = _identified(experiment, _experiment(experiment), progress)
    case_set = joint_cases(joint, noise) if joint else sweep(noise)
    return validate_cases(case_set, repetitions=repetitions, starts=starts, progress=progress)


def plan(
    experiment: Known, *, velocities: int = VELOCITIES, aim: str = "all", progress: Progress | None = None
) -> Plan:
    """What to measure next on a joint: constant velocities, slow loading and a tracking motion, and the intervals to expect.

    Args:
        experiment: with limits under `plan`, or else as far as its runs went; or what `identify` or a fit of arrays gave.
        velocities: runs at constant velocity in each direction.
        aim: the parameter whose interval is to shrink, or `all`.
        progress: called with what is being done, how many steps are done, and how many there are.

    Raises InputError in one sentence where a file cannot be used, or its limits leave nothing to plan.
    """
    loaded = _experiment(experiment)
    check_plan(velocities, aim)
    return plan_next(*_identified(experiment, loaded, progress), velocities, aim, progress)


def inspect(experiment: Source) -> Measured:
    """Read an experiment's runs and cut them into segments, and look for points off the law; no result is fitted.

    Raises InputError in one sentence where a file cannot be used.
    """
    return measure(experiment)


def draft(
    *logs: Path | str, told: Told | None = None, folder: Path | None = None, progress: Progress | None = None
) -> tuple[str, tuple[str, ...]]:
    """The text of an experiment file that runs as it is, for logs of one joint, and a sentence on each thing guessed.

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

    Runs without `experiment` get one, by what their signals do; regressors and directions are tried as `static.set_up`
    has it; what the file says of `fit` already is left to its author, and the line to write there is a comment. Raises
    InputError where a file cannot be used.
    """
    return completed(Path(experiment))


def _experiment(known: Known) -> Experiment:
    """Of a joint. Raises InputError where results are of several joints, or were not made here."""
    if isinstance(known, Results):
        if len(known.joints) != 1 or not known.measured:
            what = f"{len(known.joints)} joints" if known.measured else "a file, without the data"
            raise InputError(
                f"got results of {what}; expected what `identify` returned for one joint, or an experiment file"
            )
        return known.measured[0].experiment
    return known.measured.experiment if isinstance(known, Fit) else _load([known])[0]


def _identified(known: Known, experiment: Experiment, progress: Progress | None) -> tuple[Measured, Joint]:
    """What the joint was measured by, and the joint: identified here unless it is already."""
    if isinstance(known, Results):
        return known.measured[0], known.joints[0]
    if isinstance(known, Fit):
        return known.measured, known.joint
    if progress:
        progress(f"identifying {experiment.joint.name}", 0, 1)
    measured = measure(experiment)
    return measured, identify_joint(measured, progress=progress)


def _load(experiments: Sequence[Source]) -> list[Experiment]:
    sources = experiments or edro.experiments()
    loaded = [e if isinstance(e, Experiment) else load_experiment(e) for e in sources]
    names = [experiment.joint.name for experiment in loaded]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"joint.name: {names.count(name)} experiments name their joint {name!r}; give each joint its own name"
            )
    return loaded
