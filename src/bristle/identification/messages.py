"""Sentences of the findings of identification, by name, until identification itself is written anew; all others stand where they arise."""

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from string import Formatter
from typing import Any

import numpy as np

from bristle.findings import CAUTION, CRITICAL, NOTE, Finding, Severity, in_direction, unit_of


class _Formatter(Formatter):
    """Python's formatting, a few conversions for words, and after a number's format the quantity whose unit it has: `{v_s:.3g velocity}`."""

    def convert_field(self, value: Any, conversion: str | None) -> Any:
        """A value in the words that `_CONVERSIONS` has for it, or the unit of what it names; others as Python converts them."""
        if conversion == "u":
            return unit_of(str(value))
        words = _CONVERSIONS.get(conversion or "")
        return words(value) if words else super().convert_field(value, conversion)

    def format_field(self, value: Any, format_spec: str) -> Any:
        """As Python formats it, with a space before the percent sign or a unit."""
        number, _, quantity = format_spec.partition(" ")
        text = super().format_field(_raw(value), number)
        return f"{text[:-1]} %" if number.endswith("%") else text + (unit_of(quantity) if quantity else "")


def _raw(value: Any) -> Any:
    """A part that is a sentence keeps its units open."""
    return value.message if isinstance(value, Finding) else value


_CONVERSIONS: dict[str, Callable[[Any], str]] = {
    "d": in_direction,
    "e": lambda count: "" if count == 1 else "s",
    "j": lambda words: " and ".join(str(_raw(x)) for x in words),
    "l": lambda words: ", ".join(str(_raw(x)) for x in words),
    "m": lambda words: "; ".join(str(_raw(x)) for x in words),
    "p": lambda numbers: ", ".join(f"{name} ({number:.1f})" for name, number in numbers),
}
"""Of a direction, the ending of what is counted, of lists of names and of long things, of named numbers in brackets."""
_CRITICAL, _CAUTION, _NOTE = CRITICAL, CAUTION, NOTE


class Kind(Enum):
    """Sentences by name, with their severity; called with numbers each makes a finding."""

    def __init__(self, severity: Severity, template: str) -> None:
        self.severity, self.template = severity, template

    def __call__(self, **numbers: Any) -> Finding:
        """A finding of this kind; NumPy's numbers become Python's."""
        plain = {name: x.item() if isinstance(x, np.generic) else x for name, x in numbers.items()}
        return Finding(self.code, self.severity, _Formatter().vformat(self.template, (), plain), plain)

    @property
    def code(self) -> str:
        """Its name as a user types it, and as documents have it for an anchor: `lacks-a-term`."""
        return self.name.lower().replace("_", "-")

    # what a fit leaves
    TERM_EXPLAINS = (
        _NOTE,
        (
            "Under fit, write {lines}: beside all that is fitted it explains {share:.0%} of the squares that the fit leaves "
            "(an F test, to first order)."
        ),
    )
    LACKS_A_TERM = _CAUTION, "The fit lacks a term. {advice}"

    # robots: what the links tell, and whether log and URDF go together
    LINKS_NOT_REMOVED = (
        _CRITICAL,
        (
            "Other joints move too and no URDF is named, so the torque of the links is not removed: it may be {share:.0f} % of "
            "this joint's torque. Name the URDF under robot, as urdf."
        ),
    )
    JOINT_ORDER = (
        _CRITICAL,
        (
            "The log goes better with the URDF where {swaps!l} (sum of log relative errors lower by {gain:.2g}). Check the "
            "order of the columns against the names of the joints."
        ),
    )
    GRAVITY_DIRECTION = (
        _CRITICAL,
        (
            "The log goes better with gravity along {better!l} m/s**2 in the frame of the base (sum of log relative errors lower by "
            "{gain:.2g}). Check robot.gravity, and the signs of positions and torques."
        ),
    )
    LINKS_OPPOSE = (
        _CRITICAL,
        (
            "The current goes against the torque of the links ({scale:.3g} +/- {error:.2g} A/(N*m)): check robot.gravity, the "
            "order of the joints, and the sign of the current."
        ),
    )
    LINKS_SCALE = (
        _CAUTION,
        (
            "The torque of the links would fit {scale:.3g} +/- {error:.2g} times as large as the URDF has it: check its masses, "
            "robot.payload and the torque constant."
        ),
    )
    CONSTANT_UNSEEN = (
        _CAUTION,
        (
            "Torque constant not identifiable: the links explain {explained:.2g} A of the current, and {left:.2g} A stay unexplained. "
            "Friction is in A; give torque_constant, or log a motion that loads this joint more."
        ),
    )
    CONSTANT_BY_MASSES = (
        _CAUTION,
        (
            "The torque constant comes out of the URDF's masses, and at {joint}, whose constant is known, the links' torque would fit "
            "{scale:.3g} times as large: this constant, and friction with it, may be off as much."
        ),
    )
    BEYOND_URDF = (
        _CAUTION,
        (
            "The {signal} runs from {low:.3g} to {high:.3g}{signal!u}; the URDF allows {least:.3g} to {most:.3g}{signal!u}: "
            "check the order of the "
            "joints, units and the URDF."
        ),
    )
    EFFORT_BEYOND = (
        _CAUTION,
        (
            "The torque reaches {most:.3g} {unit}, and the URDF allows {limit:.3g} {unit}: check the torque constant, the gear "
            "and the URDF."
        ),
    )
    EFFORT_FAR_BEYOND = (
        _CRITICAL,
        (
            "The torque reaches {most:.3g} {unit}, and the URDF allows {limit:.3g} {unit}: check the unit of the torque or "
            "current, the torque constant and the gear."
        ),
    )

    # signals: what contradicts another signal, or itself

    DRIFT_IN_ORDER = (
        _CAUTION,
        (
            "Speed {way} with the order of the runs{direction!d} while the torque drifts within them ({slope:+.2g} per second, "
            "{across:.3g} from first to last, {share:.0%} of the torque): drift and speed cannot be told apart. Warm up, and take "
            "the speeds in random order."
        ),
    )
    HOLDS_SWING = (
        _CAUTION,
        (
            "In {count} of {points} holds the velocity swings by up to {swing:.0%} of its mean (rms) where friction bends with speed: the mean "
            "torque is then not the friction at the mean speed, and is off by up to {ratio:.2g} times the residuals of the fit ({file} {where}). "
            "Tune the speed loop, or hold these speeds again."
        ),
    )
    POINTS_REPEATED = (
        _CAUTION,
        (
            "{count} of {points} points of {file} repeat the speed and the torque of another exactly, first {where}: if they were written "
            "twice, errors are too small, by up to {factor:.2g} times. Leave the copies out with `exclude` under fit."
        ),
    )
    DRIFT_OF_ROWS = (
        _CAUTION,
        (
            "Beside what speed explains, the torque of the points{direction!d} goes with their rows in {file}: {across:+.3g} from "
            "first to last, {share:.0%} of it. If they stand there as they were measured, it drifts: warm up, or measure each "
            "speed going up and coming down."
        ),
    )
    DRIFT_OVER_RUNS = (
        _CAUTION,
        (
            "The torque drifts within the holds, by {slope:+.2g} per second and {across:.3g} from first to last ({share:.0%} of the "
            "torque): it depends on time or temperature, and the points scatter by it. Warm up, and repeat the first speeds at the end."
        ),
    )
    OFFSET_OR_FRICTION = (
        _CAUTION,
        (
            "The torque of the two directions differs by a constant. Either it has an offset of {offset:.3g} {unit}, and alpha_0 "
            "is {common:.4g torque} in both ({lines} under fit); or friction differs, with "
            "alpha_0 {plus:.4g torque} (+) and {minus:.4g torque} (-). The data cannot tell."
        ),
    )

    # residuals of any fit
    CORRELATED = (
        _NOTE,
        ("Residuals are correlated (lag one {lag_one:.2f}); standard errors are multiplied by {widened:.1f} for it."),
    )

    # intervals of any fit
    RESIDUAL_BLOCKS = _NOTE, "{blocks} blocks of independent residuals"
    SAMPLE_BLOCKS = _NOTE, "{blocks} blocks of samples"
    EDGE_BLOCKS = _NOTE, "{blocks} blocks of count edges"
    NO_BOOTSTRAP = _NOTE, "No bootstrap: {few} are too few to resample; at least {least} are needed."
    AT_BOUND = _CAUTION, "At its physical bound of zero: the interval is one-sided."
    NO_BOOTSTRAP_AT_BOUND = (
        _CAUTION,
        (
            "At its physical bound of zero: the intervals are one-sided; there is no bootstrap, which does not "
            "respect bounds."
        ),
    )
    REFITTED = _NOTE, "A profile found a lower cost than the fit; the fit was repeated from there."
    STILL_LOWER = _CRITICAL, "Profiles still find lower costs after {fits} new fits: do not use this fit."
    NOT_FITTED = _NOTE, "It was not fitted: there is nothing to profile or to resample."

    # static fits
    TAKES_UP_PEAK = (
        _CAUTION,
        (
            "It takes up part of a Stribeck term that these speeds show but do not bound: it describes the measured "
            "speeds, and no others."
        ),
    )

    # two routes to one fit
    IPOPT_AGREES = (
        _NOTE,
        (
            "Gauss-Newton on the rollout and IPOPT on the full simulation agree: the largest difference is "
            "{worst:.2g} standard errors. {reached} of {starts} IPOPT starts reached the lowest cost."
        ),
    )
    IPOPT_LOWER = (
        _CRITICAL,
        (
            "IPOPT found a lower cost ({lowest:.6g} against {cost:.6g}): do not use this fit. {reached} of "
            "{starts} IPOPT starts reached the lowest cost."
        ),
    )
    IPOPT_HIGHER = (
        _NOTE,
        (
            "IPOPT did not reach as low a cost ({lowest:.6g} against {cost:.6g}), so it does not confirm the fit."
            " {reached} of {starts} IPOPT starts reached its lowest cost."
        ),
    )

    # all parameters from a motion
    CONVERGED = _NOTE, "The fit converged."
    CONVERGED_AT_BOUND = _CAUTION, "The fit converged, with {names!l} at a bound."
    NOT_CONVERGED = _CRITICAL, "The fit did not converge; it gives no estimates."
    UNSEEN_WIDE = _CAUTION, "Not identifiable from this motion: its standard error is {share:.0%} of its value."
    UNSEEN_FAR = _CAUTION, "Not identifiable from this motion: its standard error is more than ten times its value."
    UNSEEN_COMPANION = (
        _CAUTION,
        ("Not identifiable from this motion: it means nothing without another parameter, which is not identifiable."),
    )
    UNSEEN_PEAK = (
        _CAUTION,
        (
            "Not identifiable from this motion: noise alone would look as much like a Stribeck peak in {percent:.0f} % of "
            "cases."
        ),
    )
    UNSEEN_NO_PEAK = _CAUTION, "Not identifiable from this motion: no sign of a Stribeck peak."
    UNSEEN_UNCONVERGED = _CAUTION, "Not estimated: the fit did not converge, or leaves more than was measured."
    UNSEEN_TOO_FEW = (
        _CAUTION,
        (
            "Not estimated: the motion leaves {equations} equations for {unknowns} unknowns, and at least {least} are needed; log "
            "longer or faster."
        ),
    )
    UNSEEN_BELOW_COUNT = (
        _CAUTION,
        (
            "Not identifiable from this motion: the bristle would bend by {reach:.2g position}, and may bend by as little as {least:.2g position}, "
            "which is less than an encoder count of {count:.2g position}; a finer encoder would show it."
        ),
    )
    UNSEEN_IN_COUNTS = (
        _CAUTION,
        (
            "Not identifiable from this motion: a motion between the encoder's counts would explain the torque "
            "{ratio:.2g} times worse than the counts themselves, so that what was fitted is theirs; a finer encoder would "
            "show it."
        ),
    )
    UNSEEN_BIASED = (
        _CAUTION,
        (
            "Not identifiable from this motion: encoder counts bias it by {share:.0%} of its value, {errors:.1f} standard "
            "errors, too much to be subtracted; a finer encoder would show it."
        ),
    )
    UNSEEN_NO_REVERSAL = (
        _CAUTION,
        (
            "Not identifiable from this motion: no reversal is followed by the travel of {reach:.2g position} by which the bristle "
            "would bend; move back and forth."
        ),
    )
    UNSEEN_FAST = (
        _CAUTION,
        (
            "Not identifiable from this motion: reversals pass the bristle's deflection in {samples:.2g} samples, and "
            "{least} are needed; log faster, or reverse more slowly."
        ),
    )
    UNSEEN_HALVES = (
        _CAUTION,
        (
            "Not identifiable from this motion: the halves of the record differ by {apart:.1f} standard errors; slow "
            "loading from rest (experiment: presliding) would show it."
        ),
    )
    UNSEEN_BEND = (
        _CAUTION,
        (
            "Not identifiable from this motion: v_s lies near the fastest speed, so the term would bend the whole"
            " curve instead of dropping at low speed."
        ),
    )
    UNSEEN = _CAUTION, "Not identifiable from this motion: {names!l}."
    ONLY_SUM_SEEN = (
        _CAUTION,
        "If v_s lies beyond these speeds, this is alpha_0 + alpha_1: only their sum is identifiable.",
    )
    ONLY_SUM_SEEN_OF_FIT = (
        _CAUTION,
        ("If v_s lies beyond these speeds, the value of alpha_0 is alpha_0 + alpha_1: only their sum is identifiable."),
    )
    DID_NOT_MOVE = (
        _CAUTION,
        "The fit did not move from its initial values: it may be at a bound, or where the cost is flat.",
    )
    OUT_OF_STEPS = _CRITICAL, "The fit reached its limit of iterations before it converged."
    FEW_STARTS = _CAUTION, "Only {reached} of {starts} starts reached the lowest cost; the others ended in a worse fit."
    NOTHING_SEEN = _CAUTION, "{name} is not identifiable: the torque does not depend on it in this motion."
    HARDLY_SEEN = _CAUTION, "{name} is hardly identifiable from these data."
    ONLY_AGAINST = (
        _CAUTION,
        ("{up!j} are identifiable only relative to one another: raising them together hardly changes the torque."),
    )
    ONLY_AS_SUM = (
        _CAUTION,
        ("{all!j} are identifiable only as a sum: raising {up!j} and lowering {down!j} hardly changes the torque."),
    )
    NOT_PASSIVE = (
        _CAUTION,
        (
            "The model can feed energy back{direction!d}: alpha_2 = {alpha_2:.3g alpha_2} is below sigma_1 alpha_1 / alpha_0 = {least:.3g alpha_2}. "
            "The fit stands; test a compensator that uses it with care."
        ),
    )
    ODD_DAMPING = _CAUTION, "The damping ratio in presliding{direction!d} would be {ratio:.2g}; 0.1 to 1 is usual."
    LACKS_UNKNOWN_TERM = (
        _CAUTION,
        (
            "What the fit leaves is a pattern and hardly any noise (correlation of neighbours {lag_one:.2f}): the model lacks a "
            "term, and numbers may be further off than their errors say. Look at the residuals; friction that depends on load, "
            "position or temperature leaves such patterns."
        ),
    )
    BURSTS = (
        _CAUTION,
        (
            "{few:.0%} of the equations hold {share:.0%} of what the fit leaves, most at {where!m}: that is no noise, and bends "
            "numbers further than their errors say. Look at the log there: an impact, lost samples, a reading not refreshed."
        ),
    )
    REVERSALS_LEFT = (
        _CAUTION,
        (
            "About reversals the fit leaves {ratio:.2g} times what it leaves elsewhere (rms): it does not describe how the joint "
            "turns, and numbers of the bristle, the peak and the inertia may be further off than their errors say. Backlash, a "
            "flexible coupling, a slipping encoder, and a torque that is late or filtered look like that; LuGre has none of them."
        ),
    )
    TORQUE_DELAYED = (
        _CAUTION,
        (
            "The torque fits better when taken {seconds:.2g} s ({samples:.2g} samples) {when}, which would "
            "explain {share:.0%} of the residuals far from reversals: check the time stamps, or add {delay:.2g} s to the delay of "
            "its signal and fit again (a voltage held until the next sample is half a sample early: its delay is "
            "negative)."
        ),
    )
    TORQUE_DRIFTS_IN_RUNS = (
        _CAUTION,
        (
            "The torque {how} by {by:.0%} in the course of a run, all else alike, which would explain {share:.0%} of what the fit "
            "leaves: a joint that warms up, or a sensor that does. Numbers are of the middle of the run; warm the joint up first, or "
            "fit its parts apart."
        ),
    )
    FRICTION_BY_LOAD = (
        _CAUTION,
        (
            "Friction changes with the load, by {by:.2g} +/- {error:.1g} of the gravity torque, which would explain {share:.0%} of "
            "what the fit leaves, as in a gear: the model has none of it. Under fit, write `law: {law}+link-load`, or gear-load in "
            "its place; else numbers are of the load on average."
        ),
    )
    LOAD_COLLINEAR = (
        _CAUTION,
        (
            "{name} and {other} are hardly told apart (variance inflation {inflation:.0f}): as one rises, the other falls. Add runs at "
            "other angles, or with another weight; the friction under a load of this motion is known better than either."
        ),
    )
    DELAY_OR_PRESLIDING = (
        _CAUTION,
        (
            "At reversals the torque looks as if taken {seconds:.2g} s ({samples:.2g} samples) {when}: a delay, or presliding "
            "that these data do not resolve, and they do not tell which. Check the time stamps; longer strokes would tell."
        ),
    )
    INERTIA_BELOW_ZERO = (
        _CRITICAL,
        (
            "The inertia comes out at {value:.3g} +/- {error:.2g} {unit}, and none is below zero: the torque is filtered or late, or "
            "another signal is not what it is taken for. Do not use the numbers of this fit."
        ),
    )
    INERTIA_DOUBTED = (
        _CAUTION,
        (
            "The given inertia may be wrong: with {more:+.3g} +/- {error:.2g} {unit} added the moving runs fit "
            "better; omit inertia to have it fitted."
        ),
    )
    COUNT_BIAS = (
        _CAUTION,
        (
            "Encoder counts bias {names!l} by more than a standard error. The bias was subtracted, but a finer "
            "encoder is better, or fit.predict: position, which simulates the motor and differentiates nothing."
        ),
    )
    COUNT_BIAS_UNKNOWN = (
        _CAUTION,
        (
            "Encoder counts decide this fit: what they add to its numbers cannot be told, and is not subtracted. Take a finer "
            "encoder, or fit.predict: position, which simulates the motor and differentiates nothing."
        ),
    )
    STAGES_DIFFER = _CAUTION, "The moving runs and the other stages differ by more than chance in {names!l}."
    STAGES_DO_NOT_FIT = (
        _CRITICAL,
        (
            "The joint fit explains the moving runs much worse than a fit of these alone (relative error "
            "{joint:.3g} % instead of {alone:.3g} %): the stages contradict each other."
        ),
    )
    STAGE_UNSEEN = _NOTE, "Not identifiable from the tracking runs."
    STAGE_AGREES = _NOTE, "They agree."
    STAGE_DIFFERS = (
        _CAUTION,
        "They differ by more than chance, and neither is much more precise: see the warnings of both.",
    )
    DISTRUST_MOVING = (
        _CAUTION,
        "They differ by more than chance; check the moving data first, which are less precise.",
    )
    DISTRUST_STAGE = (
        _CAUTION,
        "They differ by more than chance; check the {stage} stage first, which is less precise.",
    )

    # slow loading
    G0_AT_LEAST = (
        _CAUTION,
        "No run breaks away{direction!d}: g0 is at least {held:.3g torque}{bend}, and the interval of sigma_0 allows for every such g0; "
        "add ramp runs, or load up to breakaway once.",
    )
    G0_BY_BEND = _NOTE, ", from {low:.4g torque} to {high:.4g torque} by the bend of LuGre's loading curve"
    SOFTENS = (
        _CAUTION,
        (
            "Softening{direction!d}: from {low:.3g} to {high:.3g} {unit} the secant stiffness falls to {ratio:.2g} +/- {error:.1g} of "
            "its initial value, LuGre's own exponential to {lugre:.2g}; the interval of sigma_0 spans what the "
            "amplitudes give, and a Maxwell-slip model would describe the rest."
        ),
    )
    FEW_COUNTS = (
        _CAUTION,
        ("Few encoder counts: {edges} edges in {loadings} loadings; use a finer encoder, or load closer to breakaway."),
    )
    YIELDS = (
        _CRITICAL,
        (
            "The joint moves much further than its first counts predict: it slides, or this is not slow loading "
            "below breakaway."
        ),
    )
    ABOVE_G0 = (
        _CAUTION,
        (
            "The torque reaches {reached:.3g torque} without sliding, above g0 = {g0:.3g torque} ({source}): g0 may be too low."
            " Samples above {reach:g} g0 are not used."
        ),
    )
    SINGLE_RUN = _CAUTION, "One run only: its error is unknown."
    OUTLIER = (
        _CAUTION,
        "{file} is an outlier: it breaks away at {torque:.4g torque}; the median of {runs} runs{direction!d} is {median:.4g torque}.",
    )
    COARSE_LOOPS = _NOTE, "The hysteresis loops span only {counts} encoder counts: their slopes and losses are coarse."
    COARSE_LOOPS_BETWEEN = (
        _NOTE,
        "The hysteresis loops span only {least} to {most} encoder counts: their slopes and losses are coarse.",
    )
    OPEN_CYCLES = (
        _CAUTION,
        (
            "{open} of {cycles} hysteresis cycles not closed, by up to {most:+.0%} of their range, and left out: "
            "friction differs between the directions at these peaks, or the first cycle started from rest."
        ),
    )
    CYCLES_MOVE = (
        _CAUTION,
        (
            "Each of {cycles} closed hysteresis cycles ends away from where it began, by {share:+.1%} of its range on average, "
            "where LuGre comes back: the position drifts, the torque has an offset, or friction differs between the directions. By a drift "
            "sigma_0 is off by up to about half of that, one way in (+), the other in (-)."
        ),
    )
    TURNS_LATE = (
        _CAUTION,
        (
            "The torque of slow loading turns {seconds:.2g} s ({samples:.2g} samples) {when} than the displacement, where a bristle "
            "turns both at once: taken in time it changes sigma_0 by {change:+.0%}. Check the time stamps, or write `delay: {delay:.3g} s` "
            "under signals.torque (or the signal it comes from)."
        ),
    )
    NO_SIGMA_1 = _NOTE, "No estimate: (15) needs J and sigma_0, but {why}."
    NO_STIFFNESS = _NOTE, "there is no sigma_0"
    NO_INERTIA = _NOTE, "no positive inertia is known: give inertia in the experiment file, or add moving runs"
    PRIOR = (
        _CAUTION,
        (
            "An assumption, not an estimate: (15) with an assumed damping ratio of {ratio:g} (J: {source}); without an "
            "error, since that ratio is known no better than a factor."
        ),
    )
    NO_COUNTS = _NOTE, "No encoder counts are visible; (14) and the count edges need them."
    COUNTS_BIAS = (
        _CAUTION,
        "No interval: encoder counts bias this estimate by about {share:.1%}, more than its standard error.",
    )
    COUNTS_HIDE = (
        _NOTE,
        "No estimate from all samples: at some rest positions inside a count they would show no motion.",
    )
    NOT_POSITIVE = _CRITICAL, "Not positive: the displacement does not increase with the torque."
    NOTHING_BELOW_G0 = _NOTE, "No displacement was measured below g0."
    WHOLE_COUNT = (
        _NOTE,
        (
            "Assumes that the joint moves a whole count to the first edge; it may be any part of one. The "
            "interval allows for an unknown rest position."
        ),
    )
    REST_EXCLUDES = (
        _NOTE,
        (
            "No interval: it assumes that the joint moves a whole count to the first edge, and over the rest positions "
            "of these loadings sigma_0 lies in [{low:.3g}, {high:.3g}] {unit}, which excludes it."
        ),
    )
    WITHIN_NOISE = (
        _CAUTION,
        (
            "The displacement stays within the encoder's noise ({edges} in the longest loading): sigma_0 is at least {least:.3g} {unit}; "
            "a finer encoder is needed for more."
        ),
    )
    ONE_EDGE = _NOTE, "1 count edge"
    EDGES = _NOTE, "{edges} count edges"

    # the joint as a whole
    OFFSET_LEFT_OUT = (
        _NOTE,
        (
            "An offset of the torque cannot be told from a difference of alpha_0, and is not fitted. If alpha_0 were {common:.4g torque} in both "
            "directions, the offset would be {offset:.3g} {unit}: see whether the torque is zero where nothing loads the joint."
        ),
    )

    # a joint in its loop
    SHAPE_HELD = (
        _CAUTION,
        (
            "{names!l}: {value:.3g} is assumed, the middle of what is searched, since motion hardly shows it; add points at constant "
            "velocity, or give it under fit.fixed."
        ),
    )

    # friction laws side by side
    CURVE_HELD = (
        _CAUTION,
        (
            "Viscous friction bends down with speed (alpha_3 < 0). Faster than {fastest:.3g velocity}, the fastest speed "
            "measured, it is taken to stay as large as there."
        ),
    )

    # where the torque at which slow loading slides, and the inertia, come from
    OF_BREAKAWAY = _NOTE, "breakaway in direction {direction}{creep}"
    OF_ONE_BREAKAWAY = _CAUTION, "breakaway in direction {direction}{creep}; its error of {share:.0%} is a guess"
    CREEP_ADDED = _NOTE, ", with up to {share:.0%} added for the creep before it"
    OF_LARGEST_HELD = _CAUTION, "the largest torque held: no run breaks away"


UNRESOLVED = frozenset({
    "unseen-unconverged", "unseen-below-count", "unseen-no-reversal", "unseen-fast", "unseen-halves",
    "unseen-companion", "unseen-in-counts", "unseen-biased", "unseen-too-few",
})  # fmt: skip  # a list of values
"""Kinds that leave no interval either: what was fitted is not what the parameter means."""
NOT_IDENTIFIABLE = UNRESOLVED | {
    "unseen-wide", "unseen-far", "unseen-bend", "unseen-peak", "unseen-no-peak",
}  # fmt: skip  # a list of values
"""Kinds by which a motion refuses a parameter."""


def but(finding: Finding, **numbers: Any) -> Finding:
    """A finding of a kind with other numbers."""
    made = Kind[finding.code.upper().replace("-", "_")](**{**finding.numbers, **numbers})
    return replace(made, subject=finding.subject)


_BY_WEIGHT = (
    "unexplained misfit inertia-below-zero velocity-factor velocity-unrelated whole-positions count-unit "
    "count-contradicts effort-far-beyond links-not-removed joint-order gravity-direction links-oppose not-converged "
    "out-of-steps still-lower full-fit-lower ipopt-lower undercut ipopt-undercuts static-at-edge at-edge flat-profile "
    "v-s-unknowable static-too-few too-few-points indistinct strays-matter stages-do-not-fit yields not-positive "
    "in-amperes one-speed-only stick-slip holds-swing position-differs torque-drifts positions-disagree torques-doubted stick-slip-points "
    "nothing-without other-law friction-drifts lacks-a-term lacks-unknown-term bursts reversals-left directions-differ residual-trend "
    "residual-ripple offset-or-friction drift-in-order takes-up-peak torque-delayed turns-late delay-or-presliding "
    "drift-of-rows drift-over-runs torque-drifts-in-runs friction-by-load clipped lost-samples position-jumps "
    "position-held stamps-jitter sampled-irregularly velocity-lags dead-zone torque-coarse loaded-at-start "
    "rows-not-finite rows-backward rows-repeated points-repeated rows-of-short-segments gaps count-bias counts-bias "
    "few-counts within-noise sigma-0-at-least count-rounded count-bias-unknown whole-degrees runs-scatter runs-move outlier "
    "stages-differ stage-differs static-without-presliding distrust-moving distrust-stage inertia-doubted "
    "intervals-differ cost-stays-low profile-skewed few-to-resample uneven-residuals "
    "profile-lost over-laws at-bound intervals-at-bound no-bootstrap-at-bound profile-open static-at-bound bound "
    "one-sided-profile alpha-1-open v-s-open-below v-s-open-above shape-open converged-at-bound g0-at-least strays "
    "strays-left-out constant-unseen static-no-stribeck no-stribeck like-noise no-peak bend one-speed "
    "v-s-down-to-zero v-s-up-to-any none-below-v-s too-few-for-peak peak-left-out profile-unseen unseen unseen-wide "
    "unseen-far unseen-companion unseen-peak unseen-no-peak unseen-unconverged unseen-too-few unseen-below-count "
    "unseen-in-counts unseen-biased unseen-no-reversal unseen-fast interval-with-zero-impossible "
    "unseen-halves unseen-bend nothing-seen direction-unknown none-kept not-measured sigma-0-unknown no-model "
    "nothing-seen-of nothing-compared not-told still-unseen static-stick-slip peak-of-stick-slip few-below-v-s "
    "single-run of-one-breakaway few-starts did-not-move few-velocities slowest-too-fast load-collinear "
    "ill-conditioned only-sum-seen only-sum-seen-of-fit hardly-seen only-against only-as-sum second-minimum "
    "lower-outside-range polishing-moves lugre-unsettled not-passive odd-damping above-g0 softens open-cycles "
    "cycles-move of-largest-held prior curve-held direction-taken inertia-guessed guessed noise-of-holds-guessed "
    "noise-of-motion-guessed noise-of-other-points default-pid peak-taken-as-none load-left-out load-of-reference "
    "shape-held bristle-filled plant-is-model drive-without-limit paper-reference paper-control paper-inertia "
    "paper-rates paper-sampling paper-table-2 one-direction-known bristle-assumed gripper-intervals gripper-noise "
    "gripper-reference box-held box-cut noise-assumed held-as-known extrapolated limit-slowest-guessed "
    "limit-hold-guessed limit-positions-guessed limit-acceleration-guessed limit-rate limit-frequency "
    "frequency-lowered links-scale constant-by-masses beyond-urdf effort-beyond header-lines decimal-comma "
    "counts-of-a-turn cutoff-lowered truth-undeclared unit-differs in-one-session files-all-shared files-shared "
    "one-simulated fit-distrusted models-differ laws-differ common-shift warned-since mixed-value-units "
    "scatter-of-few error-increased gain-at-limit model-unfit adaptation-worse adaptation-harms plants-refused "
    "loop-diverges motion-worse export-loses export-leaves-out export-without-inertia export-without-bristle "
    "export-joint-left-out"
)
WEIGHTIEST_FIRST = _BY_WEIGHT.split()
"""Codes of what is critical, then of what calls for caution, in the order in which warnings are named."""
