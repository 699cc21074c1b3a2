"""A plan of what to measure next: constant velocities, slow loading and a tracking motion, with expected intervals."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from bristle.arrays import Array, result
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding, in_direction
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import own_parameter
from bristle.model.parameters import INERTIA, SIGNED, ParameterName, Stribeck, estimated_of, static_estimated_of, unit
from bristle.page.wording import counted
from bristle.progress import Progress, step
from bristle.questions.experiment_design import excitation
from bristle.questions.experiment_design.excitation import MotionDesign
from bristle.questions.experiment_design.loading import LoadingDesign, plan_loading
from bristle.questions.experiment_design.references import PlannedRun, duration, in_turn, schedule
from bristle.questions.experiment_design.start import Start, embedded, start_of
from bristle.questions.experiment_design.velocities import VelocityPlan, largest_deflection, plan_velocities
from bristle.simulation.fisher import covariance, static_information
from bristle.simulation.limits import Limits, limits_of

if TYPE_CHECKING:
    import pandas as pd

VELOCITIES = 12  # runs at constant velocity in each direction
DURATION = 15.0  # longest tracking motion, s
_MOST = 1000


@result
class Plan:
    """What to measure next on one joint."""

    joint: Joint
    aim: str
    """A parameter, or `all`."""
    limits: Limits
    start: Start
    velocities: tuple[VelocityPlan, ...]
    """One for each direction, or one for both."""
    loadings: tuple[LoadingDesign, ...]
    motion: MotionDesign
    """The tracking motion, with the errors after the whole plan."""
    standard_errors: Mapping[str, Array]
    """Of every parameter, (p,): `now`, and expected `with velocities`, `with loading`, `with motion`; inf: unknown."""
    references: tuple[PlannedRun, ...]
    assumptions: tuple[Finding, ...]
    """Assumptions of the expected intervals: limits, the start, and the design."""

    @property
    def free(self) -> list[int]:
        """Indices, among the start's names, of the parameters that are not given as exact."""
        return [k for k, name in enumerate(self.start.names) if name not in self.start.given]

    @property
    def aimed(self) -> list[int]:
        """Indices of the free parameters of the aim."""
        return [k for k in self.free if self.aim in ("all", self.start.names[k].name)]

    def percent(self, errors: Array) -> Array:
        """Standard errors of all parameters, (p,), in percent of the estimates."""
        return 100 * errors / np.abs(self.start.estimate)

    @property
    def duration(self) -> float:
        """Duration of all references, s."""
        return sum(r.position.size for r in self.references) / self.limits.rate

    @property
    def worth(self) -> Finding:
        """What to measure, and the predicted intervals of alpha_0 and v_s, or of the aim, in the worse direction."""
        then, limit = (
            levels.NORMAL * self.percent(self.standard_errors["with motion"]),
            100 * levels.NORMAL * levels.WIDE,
        )
        speeds = np.unique(np.concatenate([x.chosen.speeds for x in self.velocities]))
        runs, loads = (len({r.run for r in self.references if r.kind == kind}) for kind in ("ramp", "presliding"))
        time = f"{self.duration / 60:.0f} min" if self.duration >= 100 else f"{self.duration:.0f} s"
        aims = ("alpha_0", "v_s") if self.aim == "all" else (self.aim,)
        worst = {aim: max(float(then[k]) for k in self.free if self.start.names[k].name == aim) for aim in aims}
        known_to = (f"{aim} {f'to +/- {x:.2g} %' if x <= limit else 'not identifiable'}" for aim, x in worst.items())
        message = (
            f"{self.joint.name}: measure {counted(speeds.size, 'speed')} from {speeds[0]:.3g} to {speeds[-1]:.3g} "
            f"{unit('velocity', self.joint.kind)} in {counted(runs, 'run')}, {counted(loads, 'slow loading')} and a tracking motion, "
            f"{time}: predicted {', '.join(known_to)} (95 %)."
        )
        numbers = {"duration": self.duration, "speeds": speeds.size, "known": tuple(worst.items())}
        return Finding("plan-narrows", NOTE, message, numbers)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Limits of the plan, and how to lift them."""
        relative = self.standard_errors["with motion"] / np.abs(self.start.estimate)
        warnings = []
        if unseen := tuple(self.start.names[k] for k in self.free if not relative[k] <= levels.WIDE):
            named = ", ".join(map(str, unseen))
            message = f"Even after this plan {named} would not be identifiable within these limits."
            warnings.append(Finding("still-unseen", CAUTION, message, {"names": unseen}))
        for plan in self.velocities:
            slowest, ratio = plan.problem.low, plan.problem.low / plan.problem.p.v_s
            if ratio > levels.SLOWEST:
                message = (
                    f"The slowest constant speed, {slowest:.3g} {unit('velocity', self.joint.kind)}, is {ratio:.2g} times "
                    f"v_s{in_direction(plan.direction)}: slower runs would show the Stribeck term far better. If a stiffer "
                    "controller can hold them, lower plan.minimum_velocity."
                )
                numbers = {"slowest": slowest, "ratio": ratio, "direction": plan.direction}
                warnings.append(Finding("slowest-too-fast", CAUTION, message, numbers))
        return tuple(warnings)

    def to_frame(self) -> "pd.DataFrame":
        """One row per free parameter: half the width of its 95 % interval now, and as expected after each part."""
        import pandas as pd

        rows = []
        for k in self.free:
            name, value = self.start.names[k], float(self.start.estimate[k])
            half = {stage: finite(levels.NORMAL * errors[k]) for stage, errors in self.standard_errors.items()}
            last = half["with motion"]
            guess = name in self.start.guessed or (name.name == "inertia" and half["now"] is None)
            row = {"parameter": str(name), "estimate": value, "guess": guess, "unit": unit(name.name, self.joint.kind)}
            rows.append({**row, **half, "in percent": None if last is None else 100 * last / abs(value)})
        return pd.DataFrame(rows).astype(dict.fromkeys((*self.standard_errors, "in percent"), object))

    def reference_frame(self) -> "pd.DataFrame":
        """Every sample to play: time, experiment, run, and references of position, velocity and torque."""
        import pandas as pd

        runs, sizes = self.references, [r.position.size for r in self.references]
        frame = pd.DataFrame({"time (s)": np.arange(sum(sizes)) / self.limits.rate})
        frame["experiment"] = np.repeat([r.kind for r in runs], sizes)
        frame["run"] = np.repeat([r.run for r in runs], sizes)
        for name in ("position", "velocity", "torque"):
            parts = [getattr(r, name) for r in runs]
            frame[f"{name} reference ({unit(name, self.joint.kind)})"] = np.concatenate(parts)
        return frame

    def reference_csv(self) -> str:
        """The references for a controller as CSV, empty where not commanded."""
        from bristle.page.plain import to_csv

        return to_csv(self.reference_frame(), "%.10g")


def finite(x: float) -> float | None:
    """The number, or None if it is not finite."""
    return float(x) if np.isfinite(x) else None


def plan(
    measured: Measured, joint: Joint, velocities: int = VELOCITIES, aim: str = "all", progress: Progress | None = None
) -> Plan:
    """What to measure next on an identified joint.

    `velocities`: runs at constant velocity in each direction; `aim`: the parameter whose interval is to shrink, of the
    joint's law or `inertia`, or `all`. Limits are those under `plan` in the experiment file.

    Raises InputError where the aim is no parameter, no friction vs velocity is known, or the limits leave no plan.
    """
    check_plan(velocities, aim, joint.law)
    step(progress, "velocities")
    limits, of_limits = limits_of(measured)
    start = start_of(measured, joint, limits)
    if any(aim == name.name for name in start.given):
        raise InputError(
            f"the {aim} is given as exact: there is nothing to plan for it; give its standard error, or leave it out of the experiment file"
        )
    share = 1.0
    while share > 0.02:  # all times are shortened by one share until the plan fits into the time
        short = replace(limits, hold=limits.hold * share)
        runs = tuple(plan_velocities(start, d, short, velocities, aim, share) for d in start.directions)
        loadings = tuple(plan_loading(measured, joint, start, d, short, share) for d in SIGNED)
        parts = in_turn([v for x in runs for v in x.velocities], largest_deflection(start), short)
        needed = duration(parts, loadings, short, share * DURATION)
        if limits.time is None or needed <= limits.time:
            limits = short
            break
        share *= min(0.9, limits.time / needed)
    else:
        raise InputError(
            f"{measured.experiment.path.name}: plan.time: {limits.time:g} s are too few for {velocities} velocities in each direction, loading "
            "and a motion; give more time or fewer velocities"
        )

    # Information about all parameters, (p, p), now and after each part of the plan.
    information, whole = {"now": start.known}, start.known
    for x in runs:
        names = [ParameterName(name, x.direction) for name in x.problem.names]
        whole = whole + embedded(start.names, names, static_information(x.chosen.speeds, x.problem.p, x.problem.noise))
    information["with velocities"] = whole
    for load in loadings:
        if np.isfinite(load.error):
            name = ParameterName("sigma_0", start.direction_of(load.direction))
            whole = whole + embedded(start.names, [name], np.array([[load.error**-2]]))
    information["with loading"] = whole
    problem = excitation.motion_problem(start, limits, whole, aim, share * DURATION)
    motion = excitation.best_motion(problem, progress)

    # Assumptions of the design.
    others = len(problem.sets) - 1
    local = (
        "The design is local: errors are those at the estimates, to first order; velocities are averaged over"
        f" the plausible values of v_s{f', the motion over {others} other plausible joints' if others else ''}."
    )
    assumed = [Finding("plan-local", NOTE, local, {"others": others})]
    if not start.resolution:
        encoder = "Encoder: the count is unknown; loading is planned as if the encoder were fine."
        assumed.append(Finding("encoder-count", NOTE, encoder))
    return Plan(
        joint=joint, aim=aim, limits=limits, start=start, velocities=runs, loadings=loadings, motion=motion,
        standard_errors={stage: covariance(x)[0] for stage, x in information.items()} | {"with motion": motion.errors},
        references=schedule(parts, loadings, limits, motion),
        assumptions=(*of_limits, *start.assumptions, *assumed),
    )  # fmt: skip  # a list of values


def check_plan(velocities: int, aim: str, law: Law | None = None) -> None:
    """Raise InputError where the number of velocities is out of range, or the aim is no parameter of a law."""
    static, aims = static_estimated_of(law or GAUSSIAN), (*estimated_of(law or GAUSSIAN), INERTIA.name)
    if not len(static) <= velocities <= _MOST:
        few = "four" if len(static) == len(Stribeck._fields) else len(static)
        raise InputError(
            f"got {velocities} velocities; expected {len(static)} to {_MOST}: {few} parameters take at least as many runs"
        )
    if aim not in (*aims, "all") and (law is not None or own_parameter(aim) is None):
        raise InputError(f"got {aim!r} as what to plan for; expected one of {', '.join(aims)}, or all")
