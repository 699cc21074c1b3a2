"""Decisions about what was logged: velocity, low pass, a vibration, a twist and delays."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.experiment.constants import ONE
from bristle.data.experiment.schema import AS_WRITTEN, PERIODIC
from bristle.data.experiment.signals import COMMANDS, DRIVE
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation, spectral_line
from bristle.estimation.covariance import student
from bristle.estimation.information import power_of
from bristle.findings import CAUTION, CRITICAL, Finding
from bristle.identification.changed_signals import (
    with_decimation,
    with_slopes,
    with_wider_low_pass,
    without_delay,
    without_lag,
    without_twist,
)
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import TrackingFit
from bristle.identification.joint_fit import fitted_joint
from bristle.identification.known_joint import chosen
from bristle.identification.measured import Measured
from bristle.identification.model_selection import Refitted, refitted
from bristle.identification.moving_runs import directions
from bristle.identification.results import Joint
from bristle.model.parameters import INERTIA, effort_unit, unit
from bristle.progress import Progress

_WIDER = (1.6, 2.5, 4.0, 6.3)  # factors on the low pass
_SHIFTS = 6  # most corrections of a delay, each of first order
_OFF_LINE = 1.5  # equations per period of a vibration: their filter takes it off
_SLOWER = 1.25  # times as many samples an equation, at the least, against one
_OVERTONE = 0.1  # of the frequency of a sine: nearer to a multiple of it is the shape of its friction
_BEHIND = 0.1  # of the inertia: a search begins with as much behind what twists, at the least
_ALL_BEHIND = 3.0  # of the inertia: a search ends there; beyond 1 friction is before what twists, too
_LONGEST = 4.0  # times the delay that fits best: the longest time constant


class SignalDecisions:
    """What the joint's own signals show of what they should be: each change is tried, the joint is fitted again, the better fit is kept."""

    joint: Joint

    def __init__(self, measured: Measured, progress: Progress | None) -> None:
        self.measured, self.progress, self.asked_law = measured, progress, measured.experiment.fit.law
        self.told: dict[str, str] = {}  # what was chosen, by setting
        self.doubts: tuple[Finding, ...] = ()
        self.late = 0.0  # s, by which the torque was logged too late

    def fitted(
        self, measured: Measured, near: TrackingFit | Values | None = None, *, uncertainty: bool = False
    ) -> Joint:
        """The joint of these runs under the options in force."""
        return fitted_joint(measured, self.asked_law, near, uncertainty=uncertainty, progress=self.progress)

    def take_off(self) -> None:
        """Take off a vibration, a low pass too narrow, a twist, and a delay, in this order."""
        self._vibration()
        self._low_pass()
        filtered = self.measured
        self._flexible()
        self._on_time()
        if self.measured is not filtered:
            self._low_pass()
            self._on_time(again=True)

    def take(self, measured: Measured, most: float = np.inf, *, afresh: bool = False) -> bool:
        """Fit again, `afresh` with all starts; keep it if moving residuals are at most `most` times as large. Whether it was kept."""
        if most < np.inf and not afresh and self._beside()(measured) > most:
            return False
        again, before = self.fitted(measured, None if afresh else self.joint.tracking), self.joint.moving
        if most < np.inf and (before is None or again.moving is None or again.moving.rms > most * before.rms):
            return False
        self.measured, self.joint = measured, again
        return True

    def _left(self, measured: Measured) -> Refitted | None:
        """What these records leave over means of samples, nearly as far as they descend from the last minimum; None without one."""
        if (alone := self.joint.tracking) is None:
            return None
        sides = directions(measured.experiment, measured.moving(hold_out=False))
        return refitted(measured, alone, sides, levels.BIC_GAIN / 20, rough=True)

    def _beside(self) -> Callable[[Measured], float]:
        """RMS of what other records leave over that of those in force, as a function of the others; inf without a fit of moving runs."""
        now = self._left(self.measured)

        def ratio(others: Measured) -> float:
            """Of these records."""
            left = self._left(others)
            if now is None or left is None:
                return float("inf")
            return float(np.sqrt(np.mean(left.residuals**2) / np.mean(now.residuals**2)))

        return ratio

    def _left_by_file(self, measured: Measured) -> dict[str, float]:
        """RMS of what each file of other records leaves, or of those in force."""
        if (found := self._left(measured)) is None:
            return {}
        files, run = np.unique(found.file, return_inverse=True)
        rms = np.sqrt(np.bincount(run, found.residuals**2) / np.bincount(run))
        return dict(zip(files.tolist(), rms.tolist(), strict=True))

    def _clearly_lower(self) -> float:
        """Ratio of residuals below which other signals of the same motion explain the torque clearly better, by BIC."""
        alone = self.joint.tracking
        independent = 1.0 if alone is None else alone.residuals.size / inflation(alone.residuals)
        return max(levels.LOWER, float(np.exp(-levels.BIC_GAIN / (2 * independent))))

    def choose_velocity(self) -> None:
        """Take the slope of the position for a logged velocity where it leaves clearly less of the torque: that is noisy, or late."""
        notes = (note for run in self.measured.runs for note in run.record.notes)
        if (noisy := next((note for note in notes if note.code == "velocity-noisy"), None)) is not None:
            self.told["chosen velocity"] = noisy.message
        placed = {"gravity", "spring", *PERIODIC} & {*(self.measured.experiment.fit.regressors or ())}
        if placed and any(r.integrated for r in self.measured.moving(hold_out=False)):
            self.told["chosen position"] = (
                "the integral of the velocity, from zero, for none is logged (signals.position overrules)"
            )
        moving = self.measured.moving(hold_out=False)
        both = any(r.position is not None and not r.velocity_estimated and not r.integrated for r in moving)
        drives = self.measured.experiment.signals.drive() == "command"  # makes the torque of the logged velocity itself
        if not both or drives or self.measured.experiment.fit.set_up == AS_WRITTEN:
            return
        left, most, files = self._left_by_file, self._clearly_lower(), [r.file for r in moving]
        logged, slopes = left(self.measured), left(with_slopes(self.measured, files))
        lower = [file for file in files if slopes.get(file, np.inf) <= most * logged.get(file, 0.0)]
        if lower and self.take(with_slopes(self.measured, lower), 1.0):
            where = f" in {len(lower)} of {len(files)} runs" if len(lower) < len(files) else ""
            more = max(logged[file] / slopes[file] for file in lower)
            self.told["chosen velocity"] = (
                f"the slope of the position{where}; the logged one leaves {more:.2g} times as much of the torque "
                "(fit.set_up: as-written overrules)"
            )
        lags = [w.numbers for r in moving for w in r.warnings if w.code == "velocity-lags" and w.numbers["filtered"]]
        # a torque through the same filter fits the late velocity, but gravity is of the position
        if lags and not lower:
            late = float(np.median([x["lag"] for x in lags]))
            if self.take(with_slopes(without_delay(self.measured, late), files), most):
                self.late = late
                self.told["chosen velocity"] = (
                    f"the slope of the position, with the torque {late:.2g} s earlier: both were logged through a filter "
                    "(fit.set_up: as-written overrules)"
                )

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
        overtone = single > levels.MOSTLY and tone > 0 and abs(line / tone - round(line / tone)) < _OVERTONE
        if share > levels.MOSTLY and line * step > levels.MOST_WAVES and not overtone:
            # the motion has it, and not its alias
            record = self.measured.moving(hold_out=False)[0]
            f, shaken = periodogram(np.asarray(record.velocity), 1 / record.step, window="hann")
            at = max((line, 1 / step - line), key=lambda x: float(np.interp(x, f, shaken)))
            every = int(np.ceil(max(_SLOWER, 1 / (_OFF_LINE * at * step)) * fit.every))
            if (slower := with_decimation(self.measured, every)) is None:
                return
            self.take(slower)
            self.told["chosen vibration"] = (
                f"near {at:.2g} Hz, by a force that is not logged, was {100 * share:.0f} % of what the fit left, and is filtered out "
                "(fit.decimation overrules)"
            )

    def _low_pass(self) -> None:
        """Take a wider low pass where it leaves clearly less of the torque: the narrower one filtered out part of the motion."""
        if self.measured.experiment.fit.position_cutoff is not None or self.joint.tracking is None:
            return
        found, most, left_on = None, self._clearly_lower(), self._beside()
        for factor in _WIDER:
            wide = with_wider_low_pass(self.measured, factor)
            if left_on(wide) <= most:
                found, most = wide, 1.0  # then as wide as leaves no more than the narrow one
            elif found is not None:
                break
        if found is not None:
            self.take(found)

    def _flexible(self) -> None:
        """Take the position where it rubs, behind a drive that twists, where residuals fall by a tenth."""
        as_logged, alone, moving = self.measured, self.joint.tracking, self.joint.moving
        found = (w.numbers for w in (moving.warnings if moving else ()) if w.code == "flexible-drive")
        asked, ahead = next(((float(x["compliance"]), float(x["before"])) for x in found), (0.0, 0.0))
        if asked <= 0 or alone is None or as_logged.experiment.fit.set_up == AS_WRITTEN:
            return
        given = as_logged.experiment.inertia
        inertia = alone.known.get(INERTIA, 0.0 if given is None else given.value)

        def twisted(compliance: float, behind: float) -> Measured:
            """The same for this compliance, over the one asked for, and this share of the inertia behind what twists."""
            return without_twist(as_logged, compliance * asked, inertia, 1 - behind)

        most = 1.0 if ahead >= 0 else _ALL_BEHIND
        best = self._least(twisted, [1.0, max(1 - ahead, _BEHIND)], [np.inf, most])
        if best is not None and self.take(twisted(*best.x.tolist()), levels.LOWER, afresh=True):
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
            if not more or abs(late + more) >= levels.LATEST_DELAY:
                break
            # once, for to interpolate smooths
            if not self.take(
                without_delay(as_logged, late + more), 1.0 if late or source in COMMANDS else levels.LOWER
            ):
                break
            late, moving = late + more, self.joint.moving or moving
        if late < 0 and source not in COMMANDS and self._lagging(as_logged, -late):
            return
        error = moving.late[1]
        if late or (source in COMMANDS and np.isfinite(error)):  # its error is one of the torque
            self.take(without_delay(as_logged, late, error, final=True))
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
        if any(r.position is not None and not r.integrated for r in as_logged.moving(hold_out=False)):
            return False
        best = self._least(lambda times: without_lag(as_logged, times * late), [1.0], [_LONGEST])
        if best is None or not self.take(without_lag(as_logged, best.x[0] * late), levels.LOWER, afresh=True):
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
        self.doubts = (early,) if late > max(levels.EARLY * error, half) else self._feedback(late)
        told, reach = "as the drive makes it of its commands", student(np.inf) * error
        if reach < levels.LATEST_DELAY:
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
        if any(e.value is not None and e.value - lower < -levels.SURE * (e.standard_error or 0.0) for e in viscous):
            return ()  # friction would drive
        speed = float(np.sqrt(np.mean(np.concatenate([np.asarray(v) for v in velocity]) ** 2)))
        message = (
            "ASSUMED: the drive compares its commands with measurements as old as they are. If it compares them with new "
            f"ones, alpha_2 is {lower:.2g} {of} lower, and these data do not tell which holds: write `fresh: true` (or "
            "`false`) under signals.command, or --fresh (--not-fresh)."
        )
        return (Finding("feedback-unknown", CAUTION, message, {"lower": lower}, {"torque": lower * speed}),)
