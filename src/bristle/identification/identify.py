"""Identification of a joint from its measured runs."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.special import expit

from bristle.arrays import Array
from bristle.data.experiment.constants import ONE, torque_scale
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import AS_WRITTEN, GONE
from bristle.data.experiment.signals import COMMANDS, DRIVE
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation, spectral_line
from bristle.estimation.covariance import student
from bristle.estimation.information import power_of
from bristle.estimation.levels import BIC_GAIN, EARLY, LATEST_DELAY, LOWER, MOST_WAVES, MOSTLY, NO_COULOMB, OFTEN, SURE
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.comparison import APART, SYMMETRIC, Comparison
from bristle.identification.curve import LEAST, accuracy_of, band, curve
from bristle.identification.dynamic.priors import DynamicStages, fit_with_priors
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import Crosscheck, Estimate, Presliding, StaticFit, TrackingFit
from bristle.identification.known_joint import chosen
from bristle.identification.law_comparison import (
    WITH_DRAG,
    brakes,
    fitted_law,
    law_warnings,
    laws_of_motion,
    laws_of_points,
    term_that_pays,
)
from bristle.identification.measured import (
    Measured,
    nothing_to_fit,
    with_decimation,
    with_options,
    with_slopes,
    with_wider_low_pass,
    without_delay,
    without_lag,
    without_twist,
)
from bristle.identification.model_selection import Refitted, bic_of_directions, compare_models, refitted
from bristle.identification.moving_runs import (
    DIRECTIONS,
    directions,
    loads_slowly,
    moved_in,
    refuse_noise,
    refuse_opposing_runs,
    regressors,
    turn_of,
)
from bristle.identification.periods import with_periods
from bristle.identification.point_checks import point_warnings
from bristle.identification.presliding.fit import identify_presliding, with_damping
from bristle.identification.presliding.stiffness import KnownValue
from bristle.identification.results import Input, Joint
from bristle.identification.settling import without_settling
from bristle.identification.static.fit import fit_moving, fit_points, reconcile_static
from bristle.identification.static.set_up import directions_of_points, trial_of_motion, trial_of_points
from bristle.identification.static.strays import refit
from bristle.model.laws.registry import AUTO, PAPER
from bristle.model.parameters import INERTIA, Direction, ParameterName, effort_unit, has_own_unit, slides, unit
from bristle.progress import Progress, step

_WIDER = (1.6, 2.5, 4.0, 6.3)  # factors on the low pass
_SHIFTS = 6  # most corrections of a delay, each of first order
_OFF_LINE = 1.5  # equations per period of a vibration: their filter takes it off
_SLOWER = 1.25  # times as many samples an equation, at the least, against one
_OVERTONE = 0.1  # of the frequency of a sine: nearer to a multiple of it is the shape of its friction
_LONGEST = 4.0  # times the delay that fits best: the longest time constant
_ROUNDS = 4  # most corrections of holds for settling
_CHOICES = 2  # choices of a law by moving runs: the load, then peak and terms
_OF_MOVING_RUNS = Finding("of-moving-runs", NOTE, "the moving runs")


def identify_joint(measured: Measured, *, uncertainty: bool = False, progress: Progress | None = None) -> Joint:
    """Everything identified of a joint, with intervals and warnings. Raises InputError where no run can be fitted.

    `uncertainty` adds intervals of the moving fit by profile and bootstrap.
    """
    return _Decisions(measured, progress).joint_of(uncertainty=uncertainty)


class _Decisions:
    """The decisions about a joint in order: each is tried, the joint is fitted again, and the better fit is kept."""

    joint: Joint

    def __init__(self, measured: Measured, progress: Progress | None) -> None:
        self.measured, self.progress, self.asked_law = measured, progress, measured.experiment.fit.law
        self.told: dict[str, str] = {}  # what was chosen, by setting
        self.doubts: tuple[Finding, ...] = ()
        self.laws: Comparison | None = None
        self.bic: dict[str, float] = {}  # by `SYMMETRIC` and `APART`
        self.late = 0.0  # s, by which the torque was logged too late

    def joint_of(self, *, uncertainty: bool) -> Joint:
        """The identified joint, after all decisions."""
        auto = self.measured.experiment.fit.directions == "auto"
        if auto:
            self._directions()
        self._regressors()
        self.measured = with_periods(self.measured)
        self._law()
        self.joint = self._identified(self.measured)
        notes = (note for run in self.measured.runs for note in run.record.notes)
        if (noisy := next((note for note in notes if note.code == "velocity-noisy"), None)) is not None:
            self.told["chosen velocity"] = noisy.message
        self._velocity()
        self._terms()
        self._vibration()
        self._low_pass()
        filtered = self.measured
        self._flexible()
        self._on_time()
        if self.measured is not filtered:
            self._low_pass()
            self._on_time(again=True)
        if (scale := next((w for w in self.measured.findings if w.code == "scale-by-gravity"), None)) is not None:
            self.told["chosen scale"] = scale.message
        of_motion = auto and not self.bic
        if of_motion:
            self._sides()
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
        if joint.tracking is not None and uncertainty:  # for the final set-up alone
            joint = self._identified(measured, joint.tracking, uncertainty=True)
        step(self.progress, "comparing friction models")
        models, other = compare_models(measured, joint), 0.0
        if {APART, SYMMETRIC} <= self.bic.keys():
            apart = measured.experiment.fit.directions == "separate"
            self.told["chosen directions"] = _chosen(self.bic, apart=apart)
            other = float(expit(-np.nan_to_num(abs(self.bic[APART] - self.bic[SYMMETRIC]), nan=np.inf) / 2))
        warnings = (*law_warnings(self.laws, measured.experiment.fit), *self.doubts, *joint.warnings)
        settings = {**joint.settings, **self.told}
        joint = replace(joint, models=models, laws=self.laws, settings=settings, warnings=warnings)
        return replace(joint, accuracy=accuracy_of(joint, measured, other)).with_subjects()

    def _take(self, measured: Measured, most: float = np.inf, *, afresh: bool = False) -> bool:
        """Fit again, `afresh` with all starts; keep it if moving residuals are at most `most` times as large. Whether it was kept."""
        if most < np.inf and not afresh and self._left_on(measured) > most:
            return False
        again, before = self._identified(measured, None if afresh else self.joint.tracking), self.joint.moving
        if most < np.inf and (before is None or again.moving is None or again.moving.rms > most * before.rms):
            return False
        self.measured, self.joint = measured, again
        return True

    def _left_on(self, measured: Measured) -> float:
        """RMS of the residuals of other records over those in force, moving runs descended from their last minimum; inf without any."""
        if (alone := self.joint.tracking) is None:
            return float("inf")
        left = refitted(measured, alone, directions(measured.experiment, measured.moving(hold_out=False))).residuals
        return float(np.sqrt(np.mean(left**2))) / alone.rms

    def _left_by_file(self, measured: Measured) -> dict[str, float]:
        """RMS of the residuals of each file of other records, or of those in force, nearly as far as they descend."""
        if (alone := self.joint.tracking) is None:
            return {}
        sides = directions(measured.experiment, measured.moving(hold_out=False))
        found = refitted(measured, alone, sides, BIC_GAIN / 20, rough=True)
        files, run = np.unique(found.file, return_inverse=True)
        rms = np.sqrt(np.bincount(run, found.residuals**2) / np.bincount(run))
        return dict(zip(files.tolist(), rms.tolist(), strict=True))

    def _directions(self) -> None:
        """Choose directions of points by BIC; moving runs in both directions begin with one friction."""
        measured, bic = self.measured, dict[str, float]()
        points, training = measured.points(hold_out=False), measured.moving(hold_out=False)
        if points:
            bic = directions_of_points(measured.experiment, points)
            one = bool(bic) and bic[SYMMETRIC] <= bic[APART]
        else:
            one = bool(training) and len(moved_in(training)) == len(DIRECTIONS)
        self.bic, self.measured = bic, _with_directions(measured, "symmetric" if one else "separate")

    def _regressors(self) -> None:
        """Choose the regressors with the least error on held-out parts, unless the file names them."""
        experiment, fit, better = self.measured.experiment, self.measured.experiment.fit, None
        moving, points = self.measured.moving(hold_out=False), self.measured.points(hold_out=False)
        if fit.set_up == AS_WRITTEN or "regressors" in fit.model_fields_set:
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
        """Choose the law on the points, and compare the laws on them."""
        measured, fit = self.measured, self.measured.experiment.fit
        laws = laws_of_points(measured, fit.friction) if measured.points(hold_out=False) else None
        self.laws = laws
        if laws is not None and term_that_pays(fit, laws) == WITH_DRAG:
            dragged = with_options(measured, law=WITH_DRAG)
            if all(brakes(x.problem.named(refit(x.problem.rows(x.kept)).theta)) for x in dragged.searches):
                self.measured = dragged
                return
        if fit.law == AUTO:
            law = PAPER if laws is None else laws.chosen.name
            self.measured = with_options(measured, law=law)

    def _terms(self) -> None:
        """Add gravity, a spring, then cogging, where it explains half of the moving runs' residuals: the first regression may miss it."""
        for term in ("gravity", "spring", "cogging"):
            fit, moving = self.measured.experiment.fit, self.joint.moving
            trend = "spring" if slides(self.measured.experiment.joint.kind) else "gravity"
            lacks = {"residual-ripple": "cogging", "residual-trend": trend}
            said = [w for w in (moving.warnings if moving else ()) if w.numbers.get("over", "position") == "position"]
            of_term = (w.numbers for w in said if w.numbers.get("term", lacks.get(w.code)) == term)
            share = max((x["share"] for x in of_term), default=0.0)
            if fit.set_up == AS_WRITTEN or share < MOSTLY or term in (fit.regressors or ()):
                continue
            more = with_periods(with_options(self.measured, regressors=(*(fit.regressors or ()), term)))
            if self._take(more, LOWER):
                asked, orders = ", ".join(more.experiment.fit.regressors or ()), more.experiment.fit.orders
                asked += f" of order {', '.join(map(str, orders))}" if isinstance(orders, tuple) and orders else ""
                why = f"{term} explains {100 * share:.0f} % of what the others leave"
                self.told["chosen regressors"] = f"{asked}; {why} (fit.set_up: as-written overrules)"

    def _sides(self) -> None:
        """Take one friction per direction for moving runs where its BIC is clearly better."""
        measured, joint = self.measured, self.joint
        if joint.tracking is None:
            self.bic = {}
            return
        v, both = _common_speeds(joint.tracking.velocity), moved_in(measured.moving(hold_out=False))
        if len(both) == len(DIRECTIONS) and not v.size:
            self.bic = {SYMMETRIC: 0.0, APART: np.nan}
            return
        compared = partial(bic_of_directions, measured, joint.tracking)
        bic, ended = compared()
        self.bic = bic
        if not bic or bic[APART] >= bic[SYMMETRIC] - BIC_GAIN:
            return
        sided = _with_directions(measured, "separate")
        each = self._identified(sided, ended)
        self.bic = bic = compared(each.tracking)[0]
        if (fit := each.moving) is not None:
            # nan where the directions differ by a constant, or within their bands where both move: the BIC then improves at reversals alone
            # infinite where one of them has no friction
            within = [(fit.values(d), d) for d in DIRECTIONS]
            curves = [(curve(v, p.stribeck), band(v, fit, d)) for p, d in within if p is not None]
            bands = [half for _, half in curves if half is not None]
            alike = len(bands) == len(DIRECTIONS) and bool(
                np.linalg.norm(curves[0][0] - curves[1][0]) < np.linalg.norm(np.hypot(*bands))
            )
            if alike or any(w.code == "offset-or-friction" for w in fit.warnings):
                bic[APART] = np.nan
            least = NO_COULOMB * float(np.sqrt(np.mean(fit.measured**2)))
            levels = (e.value for name, e in fit.parameters.items() if name.name == "alpha_0")
            bic[APART] = bic[APART] if all(x is not None and x > least for x in levels) else np.inf
        if bic[APART] < bic[SYMMETRIC] - BIC_GAIN:
            self.measured, self.joint = sided, each

    def _clearly_lower(self) -> float:
        """Ratio of residuals below which other signals of the same motion explain the torque clearly better, by BIC."""
        alone = self.joint.tracking
        independent = 1.0 if alone is None else alone.residuals.size / inflation(alone.residuals)
        return max(LOWER, float(np.exp(-BIC_GAIN / (2 * independent))))

    def _velocity(self) -> None:
        """Take the slope of the position for a logged velocity where it leaves clearly less of the torque: that is noisy, or late."""
        moving = self.measured.moving(hold_out=False)
        both = any(r.position is not None and not r.velocity_estimated for r in moving)
        drives = self.measured.experiment.signals.drive() == "command"  # makes the torque of the logged velocity itself
        if not both or drives or self.measured.experiment.fit.set_up == AS_WRITTEN:
            return
        left, most, files = self._left_by_file, self._clearly_lower(), [r.file for r in moving]
        logged, slopes = left(self.measured), left(with_slopes(self.measured, files))
        lower = [file for file in files if slopes.get(file, np.inf) <= most * logged.get(file, 0.0)]
        if lower and self._take(with_slopes(self.measured, lower), 1.0):
            where = f" in {len(lower)} of {len(files)} runs" if len(lower) < len(files) else ""
            more = max(logged[file] / slopes[file] for file in lower)
            self.told["chosen velocity"] = (
                f"the slope of the position{where}; the logged one leaves {more:.2g} times as much of the torque "
                "(fit.set_up: as-written overrules)"
            )

    def _low_pass(self) -> None:
        """Take a wider low pass where it leaves clearly less of the torque: the narrower one filtered out part of the motion."""
        if self.measured.experiment.fit.position_cutoff is not None or self.joint.tracking is None:
            return
        found, most = None, self._clearly_lower()
        for factor in _WIDER:
            wide = with_wider_low_pass(self.measured, factor)
            if self._left_on(wide) <= most:
                found, most = wide, 1.0  # then as wide as leaves no more than the narrow one
            elif found is not None:
                break
        if found is not None:
            self._take(found)

    def _law_of_motion(self, alone: TrackingFit) -> None:
        """Choose the law on the moving runs."""
        every = self.asked_law == AUTO
        self.laws, ends = laws_of_motion(self.measured, alone, every=every)
        term = None if self.laws is None else term_that_pays(self.measured.experiment.fit, self.laws)
        if self.laws is not None and term is not None:
            more = with_options(self.measured, law=term)
            again = self._identified(more, ends[term])
            if again.tracking is not None and brakes(again.tracking.known):
                self.measured, self.joint = more, again
        for _ in range(_CHOICES if every else 0):
            if self.laws is None or self.joint.tracking is None:
                break
            law = self.laws.chosen.name
            if law == fitted_law(self.measured.experiment.fit):
                break
            self.measured = with_options(self.measured, law=law)
            self.joint = self._identified(self.measured, ends[law])
            # then peak and terms beside the load
            if self.measured.experiment.fit.load and self.joint.tracking is not None:
                laws, ends = laws_of_motion(self.measured, self.joint.tracking, every=True)
                self.laws = laws or self.laws

    def _vibration(self) -> None:
        """Filter a vibration out of the torque, where one is most of what the fit leaves: a force that is not logged shakes the joint."""
        from scipy.signal import periodogram

        fit, alone = self.measured.experiment.fit, self.joint.tracking
        if alone is None or "decimation" in fit.model_fields_set or fit.set_up == AS_WRITTEN:
            return
        longest = max(pairwise([*alone.starts_of_runs, alone.residuals.size]), key=lambda x: x[1] - x[0])
        part = slice(*longest)
        step = float(np.median(np.diff(alone.time[part])))
        (line, share), (tone, single) = (spectral_line(x[part], step) for x in (alone.residuals, alone.velocity))
        overtone = single > MOSTLY and tone > 0 and abs(line / tone - round(line / tone)) < _OVERTONE
        if share > MOSTLY and line * step > MOST_WAVES and not overtone:
            # the motion has it, and not its alias
            record = self.measured.moving(hold_out=False)[0]
            f, shaken = periodogram(np.asarray(record.velocity), 1 / record.step, window="hann")
            at = max((line, 1 / step - line), key=lambda x: float(np.interp(x, f, shaken)))
            every = int(np.ceil(max(_SLOWER, 1 / (_OFF_LINE * at * step)) * fit.every))
            if (slower := with_decimation(self.measured, every)) is None:
                return
            self._take(slower)
            self.told["chosen vibration"] = (
                f"near {at:.2g} Hz, by a force that is not logged, was {100 * share:.0f} % of what the fit left, and is filtered out "
                "(fit.decimation overrules)"
            )

    def _flexible(self) -> None:
        """Take the position where it rubs, behind a drive that twists, where residuals fall by a tenth."""
        as_logged, alone, moving = self.measured, self.joint.tracking, self.joint.moving
        found = (w.numbers for w in (moving.warnings if moving else ()) if w.code == "flexible-drive")
        asked = next((float(x["compliance"]) for x in found), 0.0)
        if not asked or alone is None or as_logged.experiment.fit.set_up == AS_WRITTEN:
            return
        given = as_logged.experiment.inertia
        inertia = alone.known.get(INERTIA, 0.0 if given is None else given.value)

        def twisted(compliance: float, before: float) -> Measured:
            """The same for this compliance, over the one asked for, and this share of the inertia before what twists."""
            return without_twist(as_logged, compliance * asked, inertia, before)

        best = self._least(twisted, [1.0, 0.3], [np.inf, 1.0])
        if best is not None and self._take(twisted(*best.x.tolist()), LOWER, afresh=True):
            J = np.asarray(best.jac)
            spread = np.linalg.pinv(J.T @ J)[0, 0] * np.mean(best.fun**2) * inflation(best.fun)
            kind = as_logged.experiment.joint.kind
            self.told["chosen position"] = (
                f"where it rubs, behind the logged one by {best.x[0] * asked:.3g} +/- {np.sqrt(spread) * asked:.1g} "
                f"{unit('position', kind)} per {effort_unit(kind)}: a belt, shaft or coupling twists (fit.set_up: as-written overrules)"
            )

    def _least(self, changed: Callable[..., Measured], start: Sequence[float], most: Sequence[float]) -> Any:
        """Numbers, up to some, by which changed records leave least, all parameters at their best; None without a start."""
        from scipy.optimize import least_squares

        alone, experiment = self.joint.tracking, self.measured.experiment
        if alone is None:
            return None
        sides = directions(experiment, self.measured.moving(hold_out=False))
        ends = list[Refitted]()  # ever better ones, from which the next begins

        def left(x: Array) -> Array:
            """What all other parameters leave at their best, (n,)."""
            near = ends[-1].values if ends else None
            end = refitted(changed(*x.tolist()), alone, sides, near=near, rough=True)
            if not ends or power_of(end.residuals) < power_of(ends[-1].residuals):
                ends.append(end)
            return end.residuals

        try:
            bounds, steps = ([0.0] * len(start), most), [0.01] * len(start)
            return least_squares(left, start, bounds=bounds, diff_step=steps, ftol=1e-3, xtol=1e-2, max_nfev=12)
        except InputError:  # no start under numbers that were tried
            return None

    def _on_time(self, *, again: bool = False) -> None:
        """Take off a delay of the torque where residuals fall by a tenth; of commands wherever they do not grow."""
        signals, as_logged, late, moving = self.measured.experiment.signals, self.measured, 0.0, self.joint.moving
        source = next((name for name in (*DRIVE, *COMMANDS) if getattr(signals, name) is not None), None)
        declared = source is not None and "delay" in getattr(signals, source).model_fields_set
        told = declared or (again and source in COMMANDS)
        if told or moving is None or as_logged.experiment.fit.set_up == AS_WRITTEN:
            return
        for _ in range(_SHIFTS):
            more, error = moving.late
            if source not in COMMANDS:
                found = (w for w in moving.warnings if w.code in ("torque-delayed", "delay-or-presliding"))
                more = next((float(w.numbers["delay"]) for w in found), 0.0)
            elif abs(more) < error:
                break
            if not more or abs(late + more) >= LATEST_DELAY:
                break
            # once, for to interpolate smooths
            if not self._take(without_delay(as_logged, late + more), 1.0 if late or source in COMMANDS else LOWER):
                break
            late, moving = late + more, self.joint.moving or moving
        if late < 0 and source not in COMMANDS and self._lagging(as_logged, -late):
            return
        error = moving.late[1]
        if late or (source in COMMANDS and np.isfinite(error)):  # its error is one of the torque
            self._take(without_delay(as_logged, late, error, final=True))
        moving = self.joint.moving
        if source in COMMANDS and moving is not None:
            self._of_commands(late + moving.late[0], moving.late[1])
        elif late:
            self.late += late
            how = "late" if self.late > 0 else "early"
            self.told["chosen delay"] = (
                f"logged {abs(self.late):.3g} s {how}, which is taken off (signals.torque.delay overrules)"
            )

    def _lagging(self, as_logged: Measured, late: float) -> bool:
        """Take a velocity that is logged alone, `late` s behind, as it was before a time constant where that leaves a tenth less."""
        if any(r.position is not None for r in as_logged.moving(hold_out=False)):
            return False
        best = self._least(lambda times: without_lag(as_logged, times * late), [1.0], [_LONGEST])
        if best is None or not self._take(without_lag(as_logged, best.x[0] * late), LOWER, afresh=True):
            return False
        self.told["chosen velocity"] = (
            f"logged behind the joint's with a time constant of {best.x[0] * late:.3g} s, which is taken off "
            "(fit.set_up: as-written overrules)"
        )
        return True

    def _of_commands(self, late: float, error: float) -> None:
        """Report the delay of a drive that acts `late` s before its command, with its standard error, s."""
        measured = self.measured
        message = (
            f"The drive would act {late:.2g} s before it was told: its gains, their units, or the time stamps of its commands are wrong, "
            "and so is friction."
        )
        early = Finding("acts-early", CRITICAL, message, {"early": late}, {"torque": np.inf})
        half = max((r.fine or r).step for r in measured.moving(hold_out=False)) / 2  # the resolution of rows
        self.doubts = (early,) if late > max(EARLY * error, half) else self._feedback(late)
        told, reach = "as the drive makes it of its commands", student(np.inf) * error
        if reach < LATEST_DELAY:
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
        """A caution where a drive may use fresh measurements: old ones act as viscous friction, K_p times delay."""
        experiment, velocity = self.measured.experiment, [r.velocity for r in self.measured.moving(hold_out=False)]
        command, gain = experiment.signals.command, (experiment.motor_constants or ONE).at_joint().kp
        if command is None or command.fresh is not None or gain is None or late >= 0:
            return ()
        lower, of = -late * gain.value, unit("alpha_2", experiment.joint.kind)
        viscous = [x.estimate for x in chosen(self.joint) if x.parameter.name == "alpha_2"]
        if any(e.value is not None and e.value - lower < -SURE * (e.standard_error or 0.0) for e in viscous):
            return ()  # friction would drive
        speed = float(np.sqrt(np.mean(np.concatenate([np.asarray(v) for v in velocity]) ** 2)))
        message = (
            "ASSUMED: the drive compares its commands with measurements as old as they are. If it compares them with new "
            f"ones, alpha_2 is {lower:.2g} {of} lower, and these data do not tell which holds: write `fresh: true` (or "
            "`false`) under signals.command, or --fresh (--not-fresh)."
        )
        return (Finding("feedback-unknown", CAUTION, message, {"lower": lower}, {"torque": lower * speed}),)

    def _identified(
        self,
        measured: Measured,
        near: TrackingFit | Values | None = None,
        *,
        uncertainty: bool = False,
    ) -> Joint:
        """The joint under one law; the moving fit begins at `near`."""
        experiment, training = measured.experiment, _training(measured)
        points, stages = measured.points(hold_out=False), DynamicStages()
        static: dict[str, StaticFit] = {}
        checks: dict[str, Crosscheck] = {}
        step(self.progress, "fitting friction vs velocity")
        if points:
            static, checks = fit_points(measured, points)
        elif not training and (not measured.slow or {run.kind for run in measured.runs} & {"ramp", "points"}):
            raise InputError(nothing_to_fit(measured))
        elif training:
            static = fit_moving(experiment, training, measured.moving(hold_out=True))
        if training:
            step(self.progress, "fitting the moving runs")
            held, load = measured.moving(hold_out=True), partial(_presliding, experiment, measured.slow)
            stages = fit_with_priors(
                experiment, training, held, static, load if measured.slow else None, near, static_is_apart=bool(points),
                uncertainty=uncertainty, progress=self.progress,
            )  # fmt: skip  # a list of values
            static = static if points else reconcile_static(static, stages.tracking)
            fit = stages.joint_fit or stages.tracking
            J = fit.parameters.get(INERTIA) if fit else None
            if stages.presliding is not None and experiment.inertia is None and J is not None and J.value:
                known = KnownValue(J.value, J.standard_error or 0.0, _OF_MOVING_RUNS, J.shifts)  # sigma_1 by (15)
                stages = stages._replace(presliding=with_damping(stages.presliding, known, experiment.joint.kind))
        elif measured.slow:
            step(self.progress, "fitting slow loading")
            stages = DynamicStages(presliding=_presliding(experiment, measured.slow, static))
        inputs = (
            Input(file=r.file, sha256=r.sha256, rows=r.rows, dropped=r.dropped, notes=r.notes, labels=r.labels)
            for r in (run.record for run in measured.runs)
        )
        return Joint(
            name=experiment.joint.name, kind=experiment.joint.kind, inputs=tuple(inputs),
            segments=tuple(s for candidates in measured.segments for s in candidates), static=static,
            crosscheck=checks, **stages._asdict(), warnings=tuple(_joint_warnings(measured, static)),
            torque_scale=torque_scale(experiment.torque_constants, simulated=experiment.simulated),
            travel=measured.travel, torque_constant=measured.torque_constant,
            link_inertia=None if has_own_unit(experiment.joint.kind) else measured.link_inertia,
            truth=experiment.truth, simulated=experiment.simulated, assumptions=experiment.assumptions,
            settings=_settings(experiment, self.asked_law, training),
        )  # fmt: skip  # a list of values


def _with_directions(measured: Measured, directions: str) -> Measured:
    """The same with these directions; one friction for both has an offset as regressor."""
    fit = measured.experiment.fit
    asked = (("inertia",) if measured.moving(hold_out=False) else ()) if fit.regressors is None else fit.regressors
    about = ("offset",) if directions == "symmetric" else ()
    return with_options(measured, directions=directions, regressors=(*(x for x in asked if x != "offset"), *about))


def _common_speeds(velocity: Array) -> Array:
    """Of velocities, (n,), the speeds at which both directions move often, each a quarter around it."""
    speed, often = np.abs(velocity), []
    moves, near = speed > LEAST * speed.max(), np.round(10 * np.log10(np.maximum(speed, 1e-300)))
    for sign in DIRECTIONS.values():
        own, count = np.unique(near[moves & (sign * velocity > 0)], return_counts=True)
        often.append(own[count > OFTEN * count.sum()])
    return np.asarray(speed[moves & np.isin(near, np.intersect1d(*often))])


def _chosen(bic: Mapping[str, float], *, apart: bool) -> str:
    """The sentence on the chosen directions."""
    more = bic[APART] - bic[SYMMETRIC]
    took, left = ("each its own friction", "one for both") if apart else ("the same friction both ways", "one for each")
    if np.isnan(more):
        return "the same friction both ways; one for each differs by a constant, or by nothing where both move (fit.directions overrules)"
    if not np.isfinite(more):
        return f"{took}, for {left} would leave a direction without friction, or drive it (fit.directions overrules)"
    higher = -more if apart else more
    how = "worse" if higher >= 0 else f"better, by less than {BIC_GAIN:g}"
    return f"{took}; {left} fits {how} (BIC {'higher' if higher >= 0 else 'lower'} by {abs(higher):.3g}; fit.directions overrules)"


def _training(measured: Measured) -> tuple[Record, ...]:
    """The moving runs to fit. Raises InputError if they are missing, contradictory, or their torque is noise."""
    experiment, training = measured.experiment, measured.moving(hold_out=False)
    for record in measured.slow:
        q, torque = record.position, record.torque
        if q is not None and torque is not None and not loads_slowly(record):
            nothing = np.zeros((q.size, 0))
            refuse_noise(experiment, q - q.mean(), torque, f"of {record.file}, taken as presliding", nothing)
    if training:
        refuse_opposing_runs(experiment, training)
    elif load := experiment.fit.load[:1]:
        raise InputError(
            f"{experiment.path.name}: fit.law: {load[0]} needs a tracking run to fit; add one under runs, or leave the load out"
        )
    return training


def _presliding(
    experiment: Experiment, slow: Sequence[Record], fit: Mapping[str, StaticFit] | TrackingFit
) -> Presliding:
    """The presliding stage, with g0 from the static fits or from a fit of moving runs."""
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
    """g0 = alpha_0 + alpha_1 of a direction with its error; without a Stribeck term alpha_0 is a lower bound of it."""
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
    source = _OF_MOVING_RUNS if moving else Finding("of-static-fit", NOTE, "the static fit")
    if len(terms) == 1:
        source = replace(source, message=f"alpha_0 of {source.message}, which shows no peak")
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
        why = f"none of its {tried} candidate segments was kept" if tried else "it was not measured"
        message = f"Direction {other} is not identified: {why}."
        yield Finding("direction-unknown", CAUTION, message, {"direction": other, "tried": tried})
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
    yield from point_warnings(measured, kept, static)


def _settings(experiment: Experiment, asked_law: str, training: Sequence[Record]) -> dict[str, str]:
    """Options in force; `asked_law` is `fit.law` as in the file."""
    fit = experiment.fit
    law, loads = fit.friction, fit.load
    rising = "".join(f", rising with the {name.replace('-', ' ')}" for name in loads)
    found = ", which the data chose (fit.law overrules)" if asked_law == AUTO or asked_law != fit.law else ""
    settings = {
        "law": f"{'+'.join((law.name, *loads))}{found}: {law.title}{rising}",
        "directions": fit.directions,
        "set-up": fit.set_up,
        "model": fit.model,
    }
    if isinstance(fit.orders, tuple):
        _, turn = turn_of(experiment.joint.kind)
        settings["orders"] = f"{', '.join(map(str, fit.orders)) or 'none'}, periods per {turn}"
    if training:
        settings["regressors"] = ", ".join(regressors(experiment)) or "none"
        chosen = ["fit.position_cutoff"] if fit.position_cutoff is None else []
        chosen += ["fit.decimation"] if "decimation" not in fit.model_fields_set else []
        if chosen:
            cutoffs = dict.fromkeys(f"{f(r.cutoff for r in training):.3g}" for f in (min, max))
            slowest = max(training, key=lambda r: r.step)
            every = fit.every * (1 if slowest.fine is None else round(slowest.step / slowest.fine.step))
            samples = f"one sample in {every}" if every > 1 else "all samples"
            by = f"by the spectra, {' and '.join(chosen)} overrule{'s'[len(chosen) - 1 :]}"
            settings["filters"] = f"low pass of {' to '.join(cutoffs)} Hz, {samples} ({by})"
        if (known := experiment.inertia) is not None:
            error = known.standard_error
            settings["inertia"] = f"{known.value:g} {f'+/- {error:g} (prior)' if error else '(fixed)'}"
    return settings
