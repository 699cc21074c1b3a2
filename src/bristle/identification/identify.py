"""From what an experiment measured to everything found out about its joint: static, presliding and moving fits, models."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.special import expit

from bristle.data.experiment.constants import ONE, torque_scale
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import AS_WRITTEN, GONE
from bristle.data.experiment.signals import COMMANDS, DRIVE
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.covariance import student
from bristle.estimation.score_test import MATTERS
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.comparison import APART, GAIN, SYMMETRIC, Comparison
from bristle.identification.curve import accuracy_of, band, curve
from bristle.identification.dynamic.priors import DynamicStages, fit_with_priors
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import Crosscheck, Estimate, Presliding, StaticFit, TrackingFit
from bristle.identification.known_joint import chosen
from bristle.identification.law_comparison import (
    WITH_DRAG,
    law_warnings,
    laws_of_motion,
    laws_of_points,
    term_that_pays,
    with_averages,
)
from bristle.identification.measured import Measured, in_time, nothing_to_fit, through_wider, with_options
from bristle.identification.model_selection import bic_of_directions, compare_on_motion, compare_on_points, refitted
from bristle.identification.moving_runs import (
    DIRECTIONS,
    directions,
    loads_slowly,
    moved_in,
    refuse_noise,
    refuse_opposing_runs,
)
from bristle.identification.periods import with_periods
from bristle.identification.point_checks import point_warnings
from bristle.identification.presliding.fit import identify_presliding, with_damping
from bristle.identification.presliding.stiffness import KnownValue
from bristle.identification.results import Input, Joint
from bristle.identification.settings import settings_of
from bristle.identification.settling import without_settling
from bristle.identification.static.fit import beside_moving, fit_moving, fit_points, is_superseded
from bristle.identification.static.set_up import directions_of_points, trial_of_motion, trial_of_points
from bristle.identification.static.strays import refit
from bristle.model.laws.registry import AUTO, PAPER, law_named
from bristle.model.parameters import INERTIA, Direction, ParameterName, effort_unit, has_own_unit, of_load, unit
from bristle.progress import Progress, step

_WIDER, _LESS = (1.6, 2.5, 4.0), 0.9
"""Times the low pass that the spectra choose, and what a fit leaves through the first of these where it took motion."""
_LATEST = 0.05  # s: no log is later, and what asks for more is another term, as friction that rises with load
_SHIFTS = 3  # times that a delay of the torque is looked for: each is told to first order
_SURE, _FAR = 5.0, 3.0
"""Standard errors: by which a drive is told to act before its commands, and by which viscous friction is not below zero."""
_ROUNDS = 4  # times that holds are told what they had not settled, at the most
_NOTHING = 1e-3  # of the torque: a Coulomb friction that is less is none
_CHOICES = 2  # of a law by moving runs: of the load, and of the peak and terms beside it
_OF_MOVING_RUNS = Finding("of-moving-runs", NOTE, "the moving runs")


def identify_joint(
    measured: Measured, *, crosscheck: bool = False, uncertainty: bool = False, progress: Progress | None = None
) -> Joint:
    """Everything that an experiment tells of its joint, with intervals and warnings, cross-checked.

    Points at constant velocity give the static parameters where there are any, else the moving runs do, with their
    regressors; slow runs give the presliding ones; moving runs give all, alone and with the other stages as priors.
    With `crosscheck` the fit of the moving runs is solved by CasADi and IPOPT as well, which takes long; with
    `uncertainty` its parameters get their intervals by profile and bootstrap too, as static and presliding ones always
    do. `progress` is told of every step.

    Raises InputError where no run can be fitted, saying which threshold ate what.
    """
    return _Decisions(measured, progress).joint_of(crosscheck=crosscheck, uncertainty=uncertainty)


class _Decisions:
    """What is decided about a joint, one thing after the other: each is tried, identified anew, and kept if it is better."""

    joint: Joint

    def __init__(self, measured: Measured, progress: Progress | None) -> None:
        self.measured, self.progress, self.asked_law = measured, progress, measured.experiment.fit.law
        self.told: dict[str, str] = {}
        """What was chosen, and what overrules it, by its name among the settings."""
        self.doubts: tuple[Finding, ...] = ()
        self.laws: Comparison | None = None
        """The laws side by side."""
        self.under: Comparison | None = None
        """The same, where they chose the law of the fits."""
        self.bic: dict[str, float] = {}
        """Of one friction for both directions, and of one for each ..."""
        self.ended: Values | None = None
        """... which ended there, of moving runs."""

    def joint_of(self, *, crosscheck: bool, uncertainty: bool) -> Joint:
        """All decisions in their order."""
        auto = self.measured.experiment.fit.directions == "auto"
        if auto:
            self._directions()
        self._regressors()
        self.measured = with_periods(self.measured)
        self._law()
        self.under, self.joint = self.laws, self._identified(self.measured, self.laws)
        self._gravity()
        self._on_time()
        if (scale := next((w for w in self.measured.findings if w.code == "scale-by-gravity"), None)) is not None:
            self.told["chosen scale"] = scale.message
        of_motion = auto and not self.bic
        if of_motion:
            self._sides()
        self._low_pass()
        if self.laws is None and self.joint.tracking is not None:
            step(self.progress, "comparing friction laws")
            before = self.measured.experiment.fit.law
            self._law_of_motion(self.joint.tracking)
            fit = self.measured.experiment.fit
            if of_motion and fit.law != before and fit.directions == "symmetric":
                self._sides()
        held = self.measured
        for _ in range(_ROUNDS):
            if (settled := without_settling(held, self.joint, self.measured)) is None:
                break
            self._take(settled)
        measured, joint = self.measured, self.joint
        if joint.tracking is not None and (crosscheck or uncertainty):  # of what was decided, once
            joint = self._identified(
                measured, self.under, joint.tracking, crosscheck=crosscheck, uncertainty=uncertainty
            )
        step(self.progress, "comparing friction models")
        models, other = self._models(joint), 0.0
        if {APART, SYMMETRIC} <= self.bic.keys():
            apart = measured.experiment.fit.directions == "separate"
            self.told["chosen directions"] = _chosen(self.bic, apart=apart) + _offset_as_friction(joint)
            other = float(expit(-np.nan_to_num(abs(self.bic[APART] - self.bic[SYMMETRIC]), nan=np.inf) / 2))
        warnings = (*law_warnings(self.laws), *self.doubts, *joint.warnings)
        settings = {**joint.settings, **self.told}
        joint = replace(joint, models=models, laws=self.laws, settings=settings, warnings=warnings)
        return replace(joint, accuracy=accuracy_of(joint, measured, other)).with_subjects()

    def _again(self, measured: Measured, near: TrackingFit | Values | None = None) -> Joint:
        """Identified anew, moving runs from where they ended, or from `near`."""
        return self._identified(measured, self.under, self.joint.tracking if near is None else near)

    def _take(self, measured: Measured, most: float = np.inf) -> bool:
        """Identified anew, and kept if the moving runs then leave so many times as much at most; whether it was."""
        again, before = self._again(measured), self.joint.moving
        if most < np.inf and (before is None or again.moving is None or again.moving.rms > most * before.rms):
            return False
        self.measured, self.joint = measured, again
        return True

    def _directions(self) -> None:
        """Of points by BIC; of moving runs that go both ways one friction, to begin with."""
        measured, bic = self.measured, dict[str, float]()
        points, training = measured.points(hold_out=False), measured.moving(hold_out=False)
        if points:
            bic = directions_of_points(measured.experiment, points)
            one = bool(bic) and bic[SYMMETRIC] <= bic[APART]
        else:
            ways = len(moved_in(training)) if training else 0
            one = ways == len(DIRECTIONS) and measured.experiment.fit.predict == "torque"
        self.bic, self.measured = bic, _with_directions(measured, "symmetric" if one else "separate")

    def _regressors(self) -> None:
        """The regressors that explain most of what is left of parts held out; the file overrules."""
        experiment, fit, better = self.measured.experiment, self.measured.experiment.fit, None
        moving, points = self.measured.moving(hold_out=False), self.measured.points(hold_out=False)
        if fit.set_up == AS_WRITTEN or "regressors" in fit.model_fields_set or fit.predict != "torque":
            return
        if points:
            better = trial_of_points(experiment, points).better()
        elif moving:
            better = trial_of_motion(experiment, moving).better()
        most = better is not None and better.error**2 < better.asked_error**2 / 2
        if better is None or not most or better.set_up.directions != better.asked.directions:
            return
        error = f"error of parts held out {better.asked_error:.2g} -> {better.error:.2g} %"
        self.told["chosen regressors"] = f"{', '.join(better.set_up.regressors)}; {error} (fit.regressors overrules)"
        also = ("inertia",) if points and moving else ()
        self.measured = with_options(self.measured, regressors=(*also, *better.set_up.regressors))

    def _law(self) -> None:
        """The law asked for, or the one that the points choose; and the laws side by side on them."""
        measured, fit = self.measured, self.measured.experiment.fit
        laws = laws_of_points(measured, fit.friction) if measured.points(hold_out=False) else None
        self.laws = laws
        if laws is not None and term_that_pays(fit, laws) == WITH_DRAG:
            dragged = with_options(measured, law=WITH_DRAG)
            if all(_brakes(x.problem.named(refit(x.problem.rows(x.kept)).theta)) for x in dragged.searches):
                self.measured, self.laws = dragged, laws.under(WITH_DRAG)
                return
        if fit.law == AUTO:
            law = PAPER if laws is None else laws.chosen.name
            self.measured, self.laws = with_options(measured, law=law), laws and laws.under(law)

    def _gravity(self) -> None:
        """Moving runs with gravity, where it explains most of what a fit without it leaves.

        A regression without a bristle, which chose the regressors, may leave so much at reversals that it does not see gravity.
        """
        fit, moving = self.measured.experiment.fit, self.joint.moving
        lacks = (w.numbers for w in (moving.warnings if moving else ()) if w.code == "lacks-a-term")
        share = next((x["share"] for x in lacks if x["term"] == "gravity"), 0.0)
        if fit.set_up == AS_WRITTEN or share < 1 / 2:
            return
        more = with_options(self.measured, regressors=(*(fit.regressors or ()), "gravity"))
        if self._take(more, 1.0):
            asked, why = ", ".join(more.experiment.fit.regressors or ()), f"gravity explains {100 * share:.0f} %"
            told = f"{asked}; {why} of what the others leave (fit.set_up: as-written overrules)"
            self.told["chosen regressors"] = told

    def _sides(self) -> None:
        """Moving runs with a friction for each direction, where that has a clearly better BIC."""
        measured, joint = self.measured, self.joint
        if joint.tracking is None:
            self.bic, self.ended = {}, None
            return
        compared = partial(bic_of_directions, measured, joint.tracking)
        bic, self.ended = compared()
        self.bic = bic
        if not bic or bic[APART] >= bic[SYMMETRIC] - GAIN:
            return
        sided = _with_directions(measured, "separate")
        each = self._again(sided, self.ended)
        self.bic = bic = compared(each.tracking)[0]
        if (fit := each.moving) is not None:
            # nan where the two differ by a constant alone, or by less than their bands: a better BIC is then of two bristles, about reversals
            # that no model describes; infinite where one of them is no friction, which leaves an offset
            v, within = np.abs(fit.velocity)[fit.velocity != 0], [(fit.values(d), d) for d in DIRECTIONS]
            both = [(curve(v, p.stribeck), band(v, fit, d)) for p, d in within if p is not None]
            bands = [half for _, half in both if half is not None]
            alike = len(bands) == len(DIRECTIONS) and bool(
                np.linalg.norm(both[0][0] - both[1][0]) < np.linalg.norm(np.hypot(*bands))
            )
            if alike or any(w.code == "offset-or-friction" for w in fit.warnings):
                bic[APART] = np.nan
            least = _NOTHING * float(np.sqrt(np.mean(fit.measured**2)))
            levels = (e.value for name, e in fit.parameters.items() if name.name == "alpha_0")
            bic[APART] = bic[APART] if all(x is not None and x > least for x in levels) else np.inf
        if bic[APART] < bic[SYMMETRIC] - GAIN:
            self.measured, self.joint = sided, each

    def _low_pass(self) -> None:
        """Moving runs through the widest low pass that leaves no more than the spectra's own, where one leaves a tenth less.

        The narrow one then took what the motion does: noise that a wider one lets in makes a fit leave more.
        """
        measured, alone, found = self.measured, self.joint.tracking, None
        experiment = measured.experiment
        if experiment.fit.position_cutoff is not None or alone is None or alone.quantity != "torque":
            return
        sides = directions(experiment, measured.moving(hold_out=False))
        for factor in _WIDER:
            wide = through_wider(measured, factor)
            left = refitted(wide, alone, sides).residuals
            if np.linalg.norm(left) > (1.0 if found else _LESS) * np.sqrt(left.size) * alone.rms:
                break
            found = wide
        if found is not None:
            self._take(found)

    def _law_of_motion(self, alone: TrackingFit) -> None:
        """Moving runs under the law that they choose."""
        every = self.asked_law == AUTO
        self.laws, ends = laws_of_motion(self.measured, alone, every=every)
        term = None if self.laws is None else term_that_pays(self.measured.experiment.fit, self.laws)
        if self.laws is not None and term is not None:
            more, found = with_options(self.measured, law=term), self.laws.under(term)
            again = self._identified(more, found, ends[term])
            if again.tracking is not None and _brakes(again.tracking.known):
                self.measured, self.joint, self.laws, self.under = more, again, found, found
        for _ in range(_CHOICES if every else 0):
            if self.laws is None or self.laws.chosen.in_force or self.joint.tracking is None:
                break
            law = self.laws.chosen.name
            self.measured, self.laws = with_options(self.measured, law=law), self.laws.under(law)
            self.under, self.joint = self.laws, self._identified(self.measured, self.laws, ends[law])
            # which peak and terms beside the load
            if self.measured.experiment.fit.load and self.joint.tracking is not None:
                laws, ends = laws_of_motion(self.measured, self.joint.tracking, every=True)
                self.laws = laws or self.laws

    def _on_time(self) -> None:
        """Moving runs without the delay of their torque, and what is said of it, and doubted.

        A delay is told to first order, and taken where it is one of a log and the fit then leaves a tenth less. A drive that was told
        what to follow has one: it is taken where the fit then leaves no more, with its interval.
        """
        signals, as_logged, late, moving = self.measured.experiment.signals, self.measured, 0.0, self.joint.moving
        told_by = next((name for name in (*DRIVE, *COMMANDS) if getattr(signals, name) is not None), None)
        declared = told_by is not None and "delay" in getattr(signals, told_by).model_fields_set
        if declared or moving is None or as_logged.experiment.fit.set_up == AS_WRITTEN:
            return
        for _ in range(_SHIFTS):
            more, error = moving.late
            if told_by not in COMMANDS:
                found = (w for w in moving.warnings if w.code == "torque-delayed")
                more = next((float(w.numbers["delay"]) for w in found), 0.0)
            elif abs(more) < error:
                break
            if not more or abs(late + more) >= _LATEST:
                break
            # once, for to interpolate smooths
            if not self._take(in_time(as_logged, late + more), 1.0 if told_by in COMMANDS else _LESS):
                break
            late, moving = late + more, self.joint.moving or moving
        error = moving.late[1]
        if late or (told_by in COMMANDS and np.isfinite(error)):  # an error of the delay is one of the torque
            self._take(in_time(as_logged, late, error, final=True))
        moving = self.joint.moving
        if told_by in COMMANDS and moving is not None:
            self._of_commands(late + moving.late[0], moving.late[1])
        elif late:
            how = "late" if late > 0 else "early"
            self.told["chosen delay"] = (
                f"logged {abs(late):.3g} s {how}, which is taken off (signals.torque.delay overrules)"
            )

    def _of_commands(self, late: float, error: float) -> None:
        """What is said of a drive that acts so long before it was told, s, and doubted."""
        measured = self.measured
        message = (
            f"The drive would act {late:.2g} s before it was told: its gains, their units, or the time stamps of its commands are wrong, "
            "and so is friction."
        )
        early = Finding("acts-early", CRITICAL, message, {"early": late}, {"torque": np.inf})
        half = max(r.step for r in measured.moving(hold_out=False)) / 2  # of a sample: rows are told apart no finer
        self.doubts = (early,) if late > max(_SURE * error, half) else self._feedback(late)
        told, reach = "as the drive makes it of its commands", student(np.inf) * error
        if reach < _LATEST:
            digits = max(1 - int(np.floor(np.log10(error))), 0)
            value, off, low, high = (f"{x:.{digits}f}" for x in (-late, error, -late - reach, -late + reach))
            told += f", {value} +/- {off} s late [{low}, {high}]"
        else:
            told += "; its delay is not identifiable, and taken as 0"
        told += " (signals.command.delay, negative, overrules)"
        said = (w for run in measured.runs for w in run.record.warnings if w.code == "commands-at-once")
        if (at_once := next(said, None)) is not None:  # nothing says whether commands are held between samples
            lower, of = at_once.numbers["lower"], unit("alpha_2", measured.experiment.joint.kind)
            told += f"; ASSUMED not held between samples: held (--held), alpha_2 is {lower:.2g} {of} lower"
        self.told["chosen delay"] = told

    def _feedback(self, late: float) -> tuple[Finding, ...]:
        """Of a drive that may compare its commands with measurements of the moment: as old as these they are a friction of K_p times the delay."""
        experiment, velocity = self.measured.experiment, [r.velocity for r in self.measured.moving(hold_out=False)]
        command, gain = experiment.signals.command, (experiment.motor_constants or ONE).at_joint().kp
        if command is None or command.fresh is not None or gain is None or late >= 0:
            return ()
        lower, of = -late * gain.value, unit("alpha_2", experiment.joint.kind)
        viscous = [x.estimate for x in chosen(self.joint) if x.parameter.name == "alpha_2"]
        if any(e.value is not None and e.value - lower < -_FAR * (e.standard_error or 0.0) for e in viscous):
            return ()  # friction would drive
        speed = float(np.sqrt(np.mean(np.concatenate([np.asarray(v) for v in velocity]) ** 2)))
        message = (
            "ASSUMED: the drive compares its commands with measurements as old as they are. If it compares them with new "
            f"ones, alpha_2 is {lower:.2g} {of} lower, and these data do not tell which holds: write `fresh: true` (or "
            "`false`) under signals.command, or --fresh (--not-fresh)."
        )
        return (Finding("feedback-unknown", CAUTION, message, {"lower": lower}, {"torque": lower * speed}),)

    def _models(self, joint: Joint) -> tuple[Comparison, ...]:
        """Friction models side by side, on the points and on the moving runs."""
        static, alone, found = joint.static, joint.tracking, list[Comparison | None]()
        if points := self.measured.points(hold_out=False):
            found.append(compare_on_points(self.measured, static))
        if alone is not None:
            own = {} if points else {d: fit for d, fit in static.items() if not is_superseded(fit)}
            found.append(compare_on_motion(self.measured, own, alone, self.ended))
        return tuple(x for x in found if x is not None)

    def _identified(
        self,
        measured: Measured,
        laws: Comparison | None,
        near: TrackingFit | Values | None = None,
        *,
        crosscheck: bool = False,
        uncertainty: bool = False,
    ) -> Joint:
        """Under one law, which `laws` may have chosen, without models side by side; moving runs begin at `near`."""
        experiment, training = measured.experiment, _training(measured)
        points, stages = measured.points(hold_out=False), DynamicStages()
        static: dict[str, StaticFit] = {}
        checks: dict[str, Crosscheck] = {}
        step(self.progress, "fitting friction vs velocity")
        if points:
            static, checks = fit_points(measured, points)
        elif not training and (not measured.slow or {run.kind for run in measured.runs} & {"ramp", "points"}):
            raise InputError(nothing_to_fit(measured))
        elif training and experiment.fit.predict == "torque":
            static, checks = fit_moving(experiment, training, measured.moving(hold_out=True))
        if training:
            step(self.progress, "fitting the moving runs")
            stages = fit_with_priors(
                experiment,
                training,
                measured.moving(hold_out=True),
                static,
                partial(_presliding, experiment, measured.slow) if measured.slow else None,
                near,
                static_is_apart=bool(points),
                crosscheck=crosscheck,
                uncertainty=uncertainty,
                progress=self.progress,
            )
            static = static if points else beside_moving(static, stages.tracking)
            fit = stages.joint_fit or stages.tracking
            J = fit.parameters.get(INERTIA) if fit else None
            if stages.presliding is not None and experiment.inertia is None and J is not None and J.value:
                known = KnownValue(J.value, J.standard_error or 0.0, _OF_MOVING_RUNS, J.shifts)  # sigma_1 by (15)
                stages = stages._replace(presliding=with_damping(stages.presliding, known, experiment.joint.kind))
        elif measured.slow:
            step(self.progress, "fitting slow loading")
            stages = DynamicStages(presliding=_presliding(experiment, measured.slow, static))
        if self.asked_law == AUTO:
            static, tracking = with_averages(static, stages.tracking, laws)
            stages = stages._replace(tracking=tracking)
        return Joint(
            name=experiment.joint.name,
            kind=experiment.joint.kind,
            inputs=tuple(
                Input(file=r.file, sha256=r.sha256, rows=r.rows, dropped=r.dropped, notes=r.notes, labels=r.labels)
                for r in (run.record for run in measured.runs)
            ),
            segments=tuple(s for candidates in measured.segments for s in candidates),
            static=static,
            crosscheck=checks,
            **stages._asdict(),
            warnings=tuple(_joint_warnings(measured, static)),
            torque_scale=torque_scale(experiment.torque_constants, simulated=experiment.simulated),
            travel=measured.travel,
            torque_constant=measured.torque_constant,
            link_inertia=None if has_own_unit(experiment.joint.kind) else measured.link_inertia,
            truth=experiment.truth,
            simulated=experiment.simulated,
            assumptions=experiment.assumptions,
            settings=settings_of(experiment, self.asked_law, training),
        )


def _with_directions(measured: Measured, directions: str) -> Measured:
    """In these directions; an offset is a regressor where one friction serves both."""
    fit = measured.experiment.fit
    asked = (("inertia",) if measured.moving(hold_out=False) else ()) if fit.regressors is None else fit.regressors
    about = ("offset",) if directions == "symmetric" else ()
    return with_options(measured, directions=directions, regressors=(*(x for x in asked if x != "offset"), *about))


def _chosen(bic: Mapping[str, float], *, apart: bool) -> str:
    """What was chosen, why, and what overrules it."""
    more = bic[APART] - bic[SYMMETRIC]
    took, left = ("each its own friction", "one") if apart else ("the same friction both ways", "two")
    if np.isnan(more):
        return "the same friction both ways, for two differ by a constant, as an offset, or by nothing (fit.directions overrules)"
    if not np.isfinite(more):
        return f"{took}, for {left} would leave a direction without friction, or drive it (fit.directions overrules)"
    left, higher = ("one fits", -more) if apart else ("two fit", more)
    how = "worse" if higher >= 0 else f"better, by less than {GAIN:g}"
    return f"{took}; {left} {how} (BIC {'higher' if higher >= 0 else 'lower'} by {abs(higher):.3g}; fit.directions overrules)"


def _offset_as_friction(joint: Joint) -> str:
    """What an offset would be as friction of the two directions, where one friction serves both: no data tell the two apart."""
    known = {(x.parameter.name, x.parameter.direction): x.estimate for x in chosen(joint)}
    level, offset = known.get(("alpha_0", Direction.BOTH)), known.get(("offset", Direction.SHARED))
    if level is None or offset is None or not (level.value and offset.value and offset.interval):
        return ""
    low, high = offset.interval
    if low <= 0 <= high or not MATTERS < abs(offset.value) / level.value < 1:
        return ""
    plus, minus = (level.value + sign * offset.value for sign in (1, -1))
    friction = f"alpha_0 {plus:.3g} (+) and {minus:.3g} {unit('torque', joint.kind)} (-)"
    return f"; its offset may as well be friction: {friction}; no data tell the two apart, and their sum is the same"


def _brakes(values: Mapping[ParameterName, float]) -> bool:
    """Whether v abs(v) is drag in every direction, and a load makes friction rise: what pushes is none."""
    drag = law_named(WITH_DRAG).coefficients
    return all(x > 0 for name, x in values.items() if name.name in drag or of_load(name.name))


def _training(measured: Measured) -> tuple[Record, ...]:
    """The moving runs that are fitted. Raises InputError where there should be some, they contradict one another, or a torque is noise."""
    experiment, training = measured.experiment, measured.moving(hold_out=False)
    for record in measured.slow:
        q, torque = record.position, record.torque
        if q is not None and torque is not None and not loads_slowly(record):
            nothing = np.zeros((q.size, 0))
            refuse_noise(experiment, q - q.mean(), torque, f"of {record.file}, taken as presliding", nothing)
    if training:
        refuse_opposing_runs(experiment, training)
    elif experiment.fit.load or experiment.fit.predict == "position":
        load = "".join(experiment.fit.load[:1])
        asked, what = (f"fit.law: {load}", "the load") if load else ("fit.predict: position", "predict")
        raise InputError(
            f"{experiment.path.name}: {asked} needs a tracking run to fit; add one under runs, or leave {what} out"
        )
    return training


def _presliding(
    experiment: Experiment, slow: Sequence[Record], fit: Mapping[str, StaticFit] | TrackingFit
) -> Presliding:
    """sigma_0 and sigma_1 from the slow runs, with g0 from the static fits, or from a fit of moving runs."""
    as_asked = experiment.fit.model == "coulomb-viscous"
    levels = {d: level for d in DIRECTIONS if (level := _breakaway_torque(fit, d, without_peak=as_asked)) is not None}
    J, of_file = experiment.inertia, Finding("of-experiment-file", NOTE, "the experiment file")
    known = None if J is None else KnownValue(J.value, J.standard_error or 0.0, of_file)
    return identify_presliding(
        slow, levels, known, experiment.fit, experiment.encoder_resolution, experiment.joint.kind
    )


def _breakaway_torque(
    fits: Mapping[str, StaticFit] | TrackingFit, direction: str, *, without_peak: bool
) -> KnownValue | None:
    """g0 = alpha_0 + alpha_1 of a direction, with the error that their covariance gives.

    Where no Stribeck term was seen alpha_0 is a lower bound of it, or g0 itself where the experiment says that there is no peak.
    """
    moving = isinstance(fits, TrackingFit)
    fit = fits if isinstance(fits, TrackingFit) else fits.get(direction) or fits.get("both")
    if fit is None:
        return None
    estimates: Mapping[Any, Estimate] = fit.parameters
    level, peak = (
        [name, ParameterName(name, Direction(direction)), ParameterName(name, Direction.BOTH)]
        for name in ("alpha_0", "alpha_1")
    )
    terms = [key for key in (*level, *peak) if key in estimates and estimates[key].value]
    if not terms or terms[0] not in level:
        return None
    value = sum(estimates[key].value or 0.0 for key in terms)
    share = np.array([float(name in terms) for name in fit.names])
    error = float(np.sqrt(share @ fit.covariance @ share)) if share.size else 0.0
    if len(terms) == 2:
        source = _OF_MOVING_RUNS if moving else Finding("of-static-fit", NOTE, "the static fit")
    elif moving:
        message = "alpha_0 of the moving runs, which show no peak"
        source = Finding("of-moving-runs-without-peak", NOTE, message)
    else:
        source = Finding("of-static-fit-without-peak", NOTE, "alpha_0 of the static fit, which shows no peak")
    if len(terms) == 1 and not without_peak:
        value, error = max(value - student(np.inf) * error, 0.0), np.inf
    constants = dict.fromkeys(c for key in terms for c in estimates[key].shifts)
    shifts = {c: sum(estimates[key].shifts.get(c, 0.0) for key in terms) for c in constants}
    return KnownValue(value, error, source, shifts)


def _joint_warnings(measured: Measured, static: dict[str, StaticFit]) -> Iterator[Finding]:
    experiment, kept = measured.experiment, measured.points(hold_out=False)
    yield from measured.warnings
    for key in experiment.fit.gone:
        message = f"fit.{key} is a key of earlier versions, and is not read as it was: {GONE[key]}."
        yield Finding("key-gone", CAUTION, message, {"key": key})
    told, of = {w.code for w in measured.warnings}, effort_unit(experiment.joint.kind)
    if experiment.coasting is not None and experiment.coasting.known is None:
        message = f"Nothing of the joint is known, so friction is per inertia, in {of}: write `coasting: {{inertia: 0.02 kg*m^2}}`, or its gravity."
        yield Finding("per-inertia", CAUTION, message, {"unit": of})
    elif has_own_unit(experiment.joint.kind) and "constant-unseen" not in told and measured.link_inertia is None:
        constant = "torque_constant: 0.35 N*m/A"
        lacks, lines = {
            "A": ("torque constant is", constant),
            "V": ("motor constants are", f"{constant}, resistance: 2.1 ohm"),
        }.get(of, ("gain of the drive is", f"kp: 20 {'N*m/rad' if of == 'rad' else 'N/m'}"))
        share = "" if of in ("A", "V") else ", as a share of kp, and alpha_2 holds what the drive damps"
        message = (
            f"No {lacks} given, so friction is in {of}{share}: write `motor: {{{lines}}}`, as seen at the joint, or "
            "the torque of a known gravity."
        )
        yield Finding("no-torque-constant", CAUTION, message, {"unit": of})
    if experiment.fit.directions == "separate" and len(set(static) & set(DIRECTIONS)) == 1:
        other = next(d for d in DIRECTIONS if d not in static)
        tried = sum(s.velocity * DIRECTIONS[other] > 0 for candidates in measured.segments for s in candidates)
        why = Finding("not-measured", CAUTION, "it was not measured")
        if tried:
            message = f"none of its {tried} candidate segments was kept"
            why = Finding("none-kept", CAUTION, message, {"tried": tried})
        message = f"Direction {other} is not identified: {why}."
        yield Finding("direction-unknown", CAUTION, message, {"direction": other, "why": why})
    # of kept segments, counted: each warning is listed with its segment
    told = {file for d in measured.warnings if d.code == "velocity-factor" for file in d.numbers["files"]}
    differ = sum(any(d.code == "position-differs" for d in s.warnings) for s in kept)
    if differ and not told:
        message = f"Position and velocity disagree in {differ} of {len(kept)} kept segments; the slope of the position is used."
        yield Finding("positions-disagree", CAUTION, message, {"differ": differ, "kept": len(kept)})
    others = sum(any(d.code not in {"position-differs", "stick-slip"} for d in s.warnings) for s in kept)
    if others:
        message = f"The torque of {others} of {len(kept)} kept segments is questionable; the list of segments says why."
        yield Finding("torques-doubted", CAUTION, message, {"doubted": others, "kept": len(kept)})
    unused = tuple(run.record.file for run in measured.runs if run.kind == "presliding" and run.hold_out)
    if unused:
        message = f"Held-out presliding runs are not used: {', '.join(unused)}."
        yield Finding("held-out-unused", NOTE, message, {"files": unused})
    if experiment.truth and not experiment.simulated:
        message = "True parameters are given (truth), but the data are not declared simulated."
        yield Finding("truth-undeclared", CAUTION, message)
    yield from point_warnings(measured, kept, static)
