"""Identification of a joint from its measured runs."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import expit

from bristle.arrays import Array
from bristle.data.experiment.schema import AS_WRITTEN
from bristle.estimation import levels
from bristle.identification.comparison import APART, SYMMETRIC, Comparison
from bristle.identification.curve import LEAST, accuracy_of, band, curve
from bristle.identification.fits import TrackingFit
from bristle.identification.law_comparison import (
    WITH_DRAG,
    brakes,
    fitted_law,
    law_warnings,
    laws_of_motion,
    laws_of_points,
    term_that_pays,
)
from bristle.identification.measured import Measured, with_options
from bristle.identification.model_selection import bic_of_directions, compare_models
from bristle.identification.moving_runs import DIRECTIONS, moved_in
from bristle.identification.periods import with_periods
from bristle.identification.results import Joint
from bristle.identification.settling import without_settling
from bristle.identification.signal_decisions import SignalDecisions
from bristle.identification.static.set_up import directions_of_points, trial_of_motion, trial_of_points
from bristle.identification.static.strays import refit
from bristle.model.laws.registry import AUTO, PAPER
from bristle.model.parameters import slides
from bristle.progress import Progress, step

_ROUNDS = 4  # most corrections of holds for settling
_CHOICES = 2  # choices of a law by moving runs: the load, then peak and terms


def identify_joint(measured: Measured, *, uncertainty: bool = False, progress: Progress | None = None) -> Joint:
    """Everything identified of a joint, with intervals and warnings. Raises InputError where no run can be fitted.

    `uncertainty` adds intervals of the moving fit by profile and bootstrap.
    """
    return _Decisions(measured, progress).joint_of(uncertainty=uncertainty)


class _Decisions(SignalDecisions):
    """The decisions about a joint in order: each is tried, the joint is fitted again, and the better fit is kept."""

    def __init__(self, measured: Measured, progress: Progress | None) -> None:
        super().__init__(measured, progress)
        self.laws: Comparison | None = None
        self.bic: dict[str, float] = {}  # by `SYMMETRIC` and `APART`

    def joint_of(self, *, uncertainty: bool) -> Joint:
        """The identified joint, after all decisions."""
        auto = self.measured.experiment.fit.directions == "auto"
        if auto:
            self._directions()
        self._regressors()
        self.measured = with_periods(self.measured)
        self._law()
        self.joint = self.fitted(self.measured)
        self.choose_velocity()
        self._terms("gravity", "spring", "cogging")
        self.take_off()
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
        self._terms("ripple")  # what the load does not explain, which is of the position, too
        held = self.measured
        for _ in range(_ROUNDS):
            if (settled := without_settling(held, self.joint, self.measured)) is None:
                break
            self.take(settled)
        measured, joint = self.measured, self.joint
        if joint.tracking is not None and uncertainty:  # for the final set-up alone
            joint = self.fitted(measured, joint.tracking, uncertainty=True)
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

    def _terms(self, *terms: str) -> None:
        """Add each of some terms of the position where it explains half of the residuals: the first regression may miss it."""
        for term in terms:
            fit, moving = self.measured.experiment.fit, self.joint.moving
            trend = "spring" if slides(self.measured.experiment.joint.kind) else "gravity"
            lacks = {"residual-ripple": "cogging", "friction-by-position": "ripple", "residual-trend": trend}
            said = [w for w in (moving.warnings if moving else ()) if w.numbers.get("over", "position") == "position"]
            of_term = (w.numbers for w in said if w.numbers.get("term", lacks.get(w.code)) == term)
            share = max((x["share"] for x in of_term), default=0.0)
            if fit.set_up == AS_WRITTEN or share < levels.MOSTLY or term in (fit.regressors or ()):
                continue
            more = with_periods(with_options(self.measured, regressors=(*(fit.regressors or ()), term)))
            if self.take(more, levels.LOWER):
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
        if not bic or bic[APART] >= bic[SYMMETRIC] - levels.BIC_GAIN:
            return
        sided = _with_directions(measured, "separate")
        each = self.fitted(sided, ended)
        self.bic = bic = compared(each.tracking)[0]
        if (fit := each.moving) is not None:
            # nan where the directions differ by a constant, of which reversals hardly tell, or within their bands where both move
            # infinite where one of them has no friction
            within = [(fit.values(d), d) for d in DIRECTIONS]
            curves = [(curve(v, p.stribeck), band(v, fit, d)) for p, d in within if p is not None]
            bands = [half for _, half in curves if half is not None]
            alike = len(bands) == len(DIRECTIONS) and bool(
                np.linalg.norm(curves[0][0] - curves[1][0]) < np.linalg.norm(np.hypot(*bands))
            )
            told = joint.moving is not None and fit.rms <= levels.LOWER * joint.moving.rms
            if alike or (not told and any(w.code == "offset-or-friction" for w in fit.warnings)):
                bic[APART] = np.nan
            least = levels.NO_COULOMB * float(np.sqrt(np.mean(fit.measured**2)))
            coulomb = (e.value for name, e in fit.parameters.items() if name.name == "alpha_0")
            bic[APART] = bic[APART] if all(x is not None and x > least for x in coulomb) else np.inf
        if bic[APART] < bic[SYMMETRIC] - levels.BIC_GAIN:
            self.measured, self.joint = sided, each

    def _law_of_motion(self, alone: TrackingFit) -> None:
        """Choose the law on the moving runs."""
        every = self.asked_law == AUTO
        self.laws, ends = laws_of_motion(self.measured, alone, every=every)
        term = None if self.laws is None else term_that_pays(self.measured.experiment.fit, self.laws)
        if self.laws is not None and term is not None:
            more = with_options(self.measured, law=term)
            again = self.fitted(more, ends[term])
            if again.tracking is not None and brakes(again.tracking.known):
                self.measured, self.joint = more, again
        for _ in range(_CHOICES if every else 0):
            if self.laws is None or self.joint.tracking is None:
                break
            law = self.laws.chosen.name
            if law == fitted_law(self.measured.experiment.fit):
                break
            self.measured = with_options(self.measured, law=law)
            self.joint = self.fitted(self.measured, ends[law])
            # then peak and terms beside the load
            if self.measured.experiment.fit.load and self.joint.tracking is not None:
                laws, ends = laws_of_motion(self.measured, self.joint.tracking, every=True)
                self.laws = laws or self.laws


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
        often.append(own[count > levels.OFTEN * count.sum()])
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
    how = "worse" if higher >= 0 else f"better, by less than {levels.BIC_GAIN:g}"
    return f"{took}; {left} fits {how} (BIC {'higher' if higher >= 0 else 'lower'} by {abs(higher):.3g}; fit.directions overrules)"
