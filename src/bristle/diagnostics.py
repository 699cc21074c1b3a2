"""What a user must know beside a number, as values; every sentence about it stands in one table, `Kind`.

It stands on the ground, and not in `estimation`: readers of data, fits and pages all make or show diagnostics, and least squares knows no friction.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum, StrEnum
from string import Formatter
from typing import Annotated, Any

import numpy as np

from bristle.json_form import JsonForm, to_bound

Value = Any
"""A number, a word, a tuple of words or of named numbers, or a diagnostic that is a part of the sentence."""


class Severity(StrEnum):
    """What a diagnostic does to the number that it is about."""

    CRITICAL = "critical"
    """Do not use this number."""
    CAUTION = "caution"
    """Its interval is wider than it looks, or something is assumed."""
    NOTE = "note"
    """Worth knowing; the number is as good as it says."""


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One thing to know about an estimate, a fit, a segment or a run, by kind and numbers; `str` makes the sentence."""

    kind: "Kind"
    numbers: Mapping[str, Value]
    """What the sentence names, by name; a part of a sentence is a diagnostic of its own."""

    @property
    def severity(self) -> Severity:
        """Of its kind."""
        return self.kind.severity

    def but(self, **numbers: Value) -> "Diagnostic":
        """The same with other numbers."""
        return replace(self, numbers={**self.numbers, **numbers})

    def __str__(self) -> str:
        return _FORMATTER.vformat(self.kind.template, (), self.numbers)

    def __hash__(self) -> int:
        return hash((self.kind, str(self)))

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """In JSON, kind and numbers, which are read back; severity and sentence, which follow from them."""
        return JsonForm(WrittenDiagnostic, _written, _read).__get_pydantic_core_schema__(source, handler)


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenDiagnostic:
    """A diagnostic in results.json."""

    kind: str
    severity: Severity
    text: str
    """The sentence."""
    numbers: dict[str, Any]
    """What the sentence names; a part of it that is a diagnostic has a kind, a text and numbers of its own."""


def _written(x: Diagnostic) -> WrittenDiagnostic:
    numbers = {name: _to_json(value) for name, value in x.numbers.items()}
    return WrittenDiagnostic(kind=x.kind.name, severity=x.severity, text=str(x), numbers=numbers)


def _to_json(value: Value) -> Any:
    """A diagnostic, a list, a number or a word; whatever else is told by its text."""
    match value:
        case Diagnostic():
            return _written(value)
        case tuple() | list() if not hasattr(value, "_fields"):
            return [_to_json(x) for x in value]
        case np.generic():
            return _to_json(value.item())
        case float():
            return to_bound(value)
        case bool() | int():
            return value
        case _:
            return str(value)


def _read(x: WrittenDiagnostic) -> Diagnostic:
    """The diagnostic; one of a kind that this version does not know keeps its sentence."""
    if x.kind not in Kind.__members__:
        return Kind.UNKNOWN(text=x.text)
    return Diagnostic(Kind[x.kind], {name: _from_json(value) for name, value in x.numbers.items()})


def _read_older(x: WrittenDiagnostic | str) -> Diagnostic:
    return Kind.UNKNOWN(text=x) if isinstance(x, str) else _read(x)


OnceText = Annotated[Diagnostic, JsonForm(WrittenDiagnostic, _written, _read_older, older=str)]
"""A diagnostic that older files have as a bare sentence, which is kept."""


def _from_json(value: Any) -> Value:
    match value:
        case {"kind": str(kind), "text": str(text), "numbers": dict(numbers)}:
            return _read(WrittenDiagnostic(kind=kind, severity=Severity.NOTE, text=text, numbers=numbers))
        case list():
            return tuple(map(_from_json, value))
        case None | "inf" | "-inf":
            return float(value or "nan")
        case _:
            return value


def in_direction(direction: str) -> str:
    """What names a direction inside a sentence; nothing where both directions are one."""
    return f" in direction {direction}" if direction in {"+", "-"} else ""


class _Formatter(Formatter):
    """Python's formatting, and a few conversions for words."""

    def convert_field(self, value: Any, conversion: str | None) -> Any:
        """A value in the words that `_CONVERSIONS` has for it; others as Python converts them."""
        words = _CONVERSIONS.get(conversion or "")
        return words(value) if words else super().convert_field(value, conversion)


_CONVERSIONS: dict[str, Callable[[Any], str]] = {
    "b": lambda direction: f" ({direction})" if direction in {"+", "-"} else "",
    "c": lambda numbers: ", ".join(f"{name} {number:.3g} %" for name, number in numbers),
    "d": in_direction,
    "e": lambda count: "" if count == 1 else "s",
    "g": lambda numbers: ", ".join(f"{number:.3g}" for number in numbers),
    "i": lambda ends: ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ends),
    "j": lambda words: " and ".join(map(str, words)),
    "l": lambda words: ", ".join(map(str, words)),
    "m": lambda words: "; ".join(map(str, words)),
    "p": lambda numbers: ", ".join(f"{name} ({number:.1f})" for name, number in numbers),
    "w": lambda alone: "would let it in" if alone else "would answer this reason, not the other",
    "x": lambda numbers: ", ".join(f"{name} {number:.2g}" for name, number in numbers),
}
"""Of a direction in brackets, of named percentages, of a direction, the ending of what is counted, of numbers, of named intervals, of lists of names
and of long things, of named numbers, of whether a reason stands alone, and of named ratios."""
_FORMATTER = _Formatter()
_CRITICAL, _CAUTION, _NOTE = Severity.CRITICAL, Severity.CAUTION, Severity.NOTE


class Kind(Enum):
    """Every kind of diagnostic with its severity and its sentence; called with numbers it makes one."""

    def __init__(self, severity: Severity, template: str) -> None:
        self.severity, self.template = severity, template

    def __call__(self, **numbers: Any) -> Diagnostic:
        """A diagnostic of this kind; NumPy's numbers become Python's."""
        plain = {name: x.item() if isinstance(x, np.generic) else x for name, x in numbers.items()}
        return Diagnostic(self, plain)

    @property
    def title(self) -> str:
        """What its sentence begins with, up to the colon."""
        return self.template.partition(":")[0]

    # read from a results file
    UNKNOWN = _CAUTION, "{text}"

    # segments: why one is rejected
    TOO_SHORT = (
        _NOTE,
        "Too short: it lasts {duration:.3g} s, and {asked}; a longer hold, or segments.minimum_duration: {option} s, {alone!w}.",
    )
    DURATION_ASKED = _NOTE, "segments.minimum_duration asks for {asked:.3g} s"
    DEPENDENT_TORQUE = _NOTE, "fewer than two of its torque samples are independent"
    SAMPLES_ASKED = _NOTE, "{asked:.3g} s hold the {count:g} independent samples asked for"
    USUAL_ASKED = (
        _NOTE,
        "a quarter of this run's typical plateau, {duration:.3g} s or {travel:.3g} of travel, is asked for",
    )
    AT_REST = (
        _NOTE,
        "At rest or below breakaway: its mean speed is {speed:.3g}, and {wanted} is {least:.3g}; more torque{option} {alone!w}.",
    )
    NOISE_FLOOR = _NOTE, "the noise floor"
    MINIMUM_VELOCITY = _NOTE, "segments.minimum_velocity"
    OR_MINIMUM_VELOCITY = _NOTE, ", or a segments.minimum_velocity of {value},"
    ACCELERATING = (
        _NOTE,
        (
            "Accelerating: its velocity drifts by {drift:.3g}, mean {velocity:.3g}, and {allowed:.3g} is allowed; a "
            "steadier motion{option} {alone!w}."
        ),
    )
    OR_VELOCITY_TOLERANCE = _NOTE, ", or a segments.velocity_tolerance of {value},"
    HUNTING = (
        _NOTE,
        "Hunting: it moves backward {backward:.0%} of the time, and 10 % is allowed; a controller that does not oscillate {alone!w}.",
    )
    UNSTEADY = (
        _NOTE,
        (
            "Stick-slip without a steady mean: the means of its eighths scatter by {scatter:.3g} about {velocity:.3g}, and {allowed:.3g} is allowed; "
            "a longer hold or a stiffer controller{option} {alone!w}."
        ),
    )
    UNSETTLED = (
        _NOTE,
        (
            "Below breakaway, or not settled: its torque changes by {drift:.3g}, more than its mean {torque:.4g}; a "
            "longer hold at this speed {alone!w}."
        ),
    )
    SATURATED = (
        _NOTE,
        (
            "Saturated: {share:.0%} of its samples are at {limit}, and 5 % is allowed; a lower speed, or a higher torque_limit, {alone!w}."
        ),
    )
    LIMIT_GIVEN = _NOTE, "segments.torque_limit, {limit:.4g}"
    LIMIT_SEEN = _NOTE, "the largest torque or voltage of the run"
    SETTLING = (
        _NOTE,
        "Settling: it is an edge of the plateau in rows {start}-{stop}, which is kept apart; a hold of its own would let it in.",
    )

    POINT_AT_REST = (
        _NOTE,
        "At rest: the friction torque of a joint at rest is not a function of its velocity; leave such rows out.",
    )

    # segments: what warns about one that is kept
    STICK_SLIP = (
        _CAUTION,
        (
            "Stick-slip: the velocity deviates by {swing:.0%} of its mean and rests {resting:.0%} of the time; "
            "its mean torque is not the friction at its mean velocity."
        ),
    )
    POSITION_DIFFERS = (
        _CAUTION,
        (
            "The slope of the position, {slope:.4g}, and the mean of the velocity, {logged:.4g}, differ: "
            "samples may be missing, or a unit or the sampling rate be off."
        ),
    )
    TORQUE_DRIFTS = (
        _CAUTION,
        (
            "The torque changes by {drift:.3g} over the segment, mean {torque:.4g}, more than its noise: "
            "it depends on position, temperature or time, or had not settled."
        ),
    )
    TORQUE_UNSURE = _NOTE, "The torque holds fewer than two independent samples; its standard error is not known."

    # residuals of any fit
    DIRECTIONS_DIFFER = (
        _CAUTION,
        (
            "Friction differs between the directions (p = {p:.1g}, corrected for {looks} looks): that holds {share:.0%} of the "
            "residuals' variance; fit them apart (directions: separate)."
        ),
    )
    RESIDUAL_TREND = (
        _CAUTION,
        (
            "Residuals have a trend over {over} (p = {p:.1g}, corrected for {looks} looks) that holds {share:.0%} of their variance."
        ),
    )
    RESIDUAL_RIPPLE = (
        _CAUTION,
        (
            "Residuals have a ripple over position, of period {period:.3g}, (p = {p:.1g}, corrected for {looks} looks) "
            "that holds {share:.0%} of their variance."
        ),
    )
    CORRELATED = (
        _NOTE,
        "Residuals are correlated (lag one {lag_one:.2f}): standard errors are widened by {widened:.1f} for it.",
    )

    # intervals of any fit
    INTERVALS_DIFFER = _CAUTION, "The intervals part {sides!j} the estimate ({ends!i}): {reason}."
    COST_STAYS_LOW = (
        _CAUTION,
        "the cost stays low to the end of the range, so nothing limits the parameter on that side",
    )
    PROFILE_SKEWED = _CAUTION, "the profile is skewed, which a covariance cannot show; believe the profile"
    FEW_TO_RESAMPLE = _CAUTION, "{few} are few to resample; believe the profile"
    UNEVEN_RESIDUALS = (
        _CAUTION,
        (
            "the residuals are not as evenly and independently scattered as the covariance and the profile take them to be; believe the widest"
        ),
    )
    POINTS_FOR_PARAMETERS = _NOTE, "{points} points for {parameters} parameters"
    RESIDUAL_BLOCKS = _NOTE, "{blocks} blocks of independent residuals"
    SAMPLE_BLOCKS = _NOTE, "{blocks} blocks of samples"
    EDGE_BLOCKS = _NOTE, "{blocks} blocks of count edges"
    NO_BOOTSTRAP = _NOTE, "No bootstrap: {few} are too few to draw from; {least} are needed."
    NO_BLOCKS = (
        _NOTE,
        "No bootstrap: the residuals are correlated over so long that fewer than {least} blocks are left to draw.",
    )
    AT_BOUND = _CAUTION, "At its physical bound of zero: the interval is one-sided."
    INTERVALS_AT_BOUND = _CAUTION, "At its physical bound of zero: the intervals are one-sided."
    NO_BOOTSTRAP_AT_BOUND = (
        _CAUTION,
        (
            "At its physical bound of zero: the intervals are one-sided, and there is no bootstrap, which knows no bounds."
        ),
    )
    REFITTED_FROM_GRID = _NOTE, "A profile found a lower cost than the grid had: the fit was done again from there."
    REFITTED = _NOTE, "A profile found a lower cost than the fit had: the fit was done again from there."
    STILL_LOWER = _CRITICAL, "Profiles still find lower costs after {fits} new fits: distrust this one."
    NOT_FITTED = _NOTE, "It was not fitted: there is nothing to profile or to draw."
    PROFILE_OPEN = (
        _CAUTION,
        (
            "No finite interval by the profile: with the others fitted anew, every value that a motion can show, on that side, fits about as well."
        ),
    )
    PROFILE_UNSEEN = _CAUTION, "Nothing is seen of it: {open}"
    PROFILE_ROUGH = _NOTE, "The profile is hard to follow here, fits along it ran out of steps: its ends are rough."
    PROFILE_LOST = (
        _CAUTION,
        "The profile is hard to follow here: the search for an end was given up, so a side that is open may have one.",
    )

    # static fits
    STATIC_CONVERGED = _NOTE, "The best fit lies inside the range searched, away from every bound."
    STATIC_AT_BOUND = _CAUTION, "A parameter lies at its physical bound; its interval is one-sided."
    STATIC_AT_EDGE = (
        _CRITICAL,
        "The best v_s lies at the edge of the range searched; these velocities do not enclose it.",
    )
    STATIC_NO_STRIBECK = (
        _CAUTION,
        "Stribeck not identifiable from these data: Coulomb and viscous friction alone are fitted.",
    )
    STATIC_STICK_SLIP = (
        _CAUTION,
        "The Stribeck term rests on points that stick and slip; without them it is not identifiable.",
    )
    STATIC_TOO_FEW = _CRITICAL, "Too few points for the parameters asked for; none is estimated."
    BOUND = _CAUTION, "{name} lies at its physical bound of zero; the free fit would make it negative."
    FEW_BELOW_V_S = (
        _CAUTION,
        "Only {below} of {points} points lie below v_s{direction!d}; measure slower to see the Stribeck region.",
    )
    ILL_CONDITIONED = (
        _CAUTION,
        (
            "Ill conditioned: the scaled Jacobian's condition number is {condition:.2g}; some parameters move only together."
        ),
    )
    FLAT_PROFILE = _CRITICAL, "v_s cannot be told from these speeds{direction!d}: the profile is flat."
    ONE_SIDED_PROFILE = _CAUTION, "The profile of v_s is one-sided{direction!d}: nothing limits v_s {side}."
    AT_EDGE = _CRITICAL, "The best v_s lies at the edge of the range searched{direction!d}, {low:.3g} to {high:.3g}."
    SECOND_MINIMUM = _CAUTION, "A second minimum{direction!d} at v_s = {v_s:.3g} is within the 95 % threshold."
    HUBER_DIFFERS = (
        _CAUTION,
        "Least squares and the Huber refit differ by more than two combined standard errors in {moved!p}.{points}",
    )
    RESPONSIBLE = _CAUTION, " Points responsible: {points!m}."
    TOO_FEW_FOR_PEAK = _CAUTION, "{points} points are too few for a Stribeck term; at least {least} are needed."
    NO_STRIBECK = (
        _CAUTION,
        "Stribeck not identifiable{direction!d}: {why}; Coulomb and viscous friction alone are fitted.{asked}",
    )
    LIKE_NOISE = _CAUTION, "noise alone would look as much like a peak in {percent:.0f} % of cases"
    BEND = (
        _CAUTION,
        (
            "its v_s of {v_s:.3g} would lie near the fastest speed, {fastest:.3g}, so the term is a bend over the "
            "whole range and not a drop at low speed "
            "(speeds beyond {seen:g} v_s would tell)"
        ),
    )
    ONE_SPEED = (
        _CAUTION,
        (
            "its v_s of {v_s:.3g} would lie below a third of the slowest speed, {slowest:.3g}, so the term would rest on that one speed "
            "(slower ones would tell)"
        ),
    )
    RANGE_ASKED = _NOTE, " fit.v_s_range lets v_s be between {low:.3g} and {high:.3g} only."
    ALPHA_1_OPEN = _CAUTION, "No finite interval: v_s has none, and alpha_1 rises with it."
    V_S_OPEN_BELOW = _CAUTION, "No finite interval: the data allow v_s down to zero."
    V_S_OPEN_ABOVE = _CAUTION, "No finite interval: the data allow v_s without an upper limit."
    TOO_FEW_POINTS = (
        _CRITICAL,
        "{points} points for {parameters} linear parameters: at least {least} are needed; measure more speeds.",
    )
    INDISTINCT = (
        _CRITICAL,
        (
            "The points cannot tell the linear parameters apart (one speed only, or a regressor that never changes); measure at more speeds."
        ),
    )
    STICK_SLIP_POINTS = _CAUTION, "{sticking} of {points} points stick and slip; the fit without them is shown beside."
    NOTHING_WITHOUT = _CAUTION, "Without the points that stick and slip nothing can be fitted. {inner}"
    WITHOUT_STICK_SLIP = _NOTE, "Without the points that stick and slip: {inner}"
    SLOW_LEFT_OUT = (
        _NOTE,
        (
            "{slow} of {equations} equations are slower than fit.moving_above, {above:.3g}, and were left out of the "
            "static fit; there its relative error "
            "is {error:.0f} %: slow, and through reversals, the torque depends on the bristles' history, which (9) does not hold."
        ),
    )

    # two routes to one fit
    FULL_FIT_LOWER = (
        _CRITICAL,
        (
            "The full nonlinear fit found a lower cost than the grid ({full:.6g} against {grid:.6g}); trust neither before you know why. "
            "{reached} of {starts} random starts of the full fit ended in its best minimum."
        ),
    )
    GRID_LOWER = (
        _NOTE,
        "The grid found a lower cost than any start of the full nonlinear fit ({grid:.6g} against {full:.6g}).",
    )
    ROUTES_AGREE = (
        _NOTE,
        (
            "Grid and full nonlinear fit agree: the largest difference is {worst:.2g} standard errors. "
            "{reached} of {starts} random starts of the full fit ended in its best minimum."
        ),
    )
    IPOPT_AGREES = (
        _NOTE,
        (
            "Gauss-Newton on the rollout and IPOPT on the whole chain agree: the largest difference is {worst:.2g} standard errors. "
            "{reached} of {starts} starts of the second reached the lowest cost."
        ),
    )
    IPOPT_LOWER = (
        _CRITICAL,
        (
            "IPOPT found a lower cost ({lowest:.6g} against {cost:.6g}); distrust the fit. "
            "{reached} of {starts} starts of the second reached the lowest cost."
        ),
    )
    IPOPT_HIGHER = (
        _NOTE,
        (
            "IPOPT found no such low cost ({lowest:.6g} against {cost:.6g}); distrust the fit. "
            "{reached} of {starts} starts of the second reached the lowest cost."
        ),
    )

    # all parameters from a motion
    CONVERGED = _NOTE, "The fit converged inside every bound."
    CONVERGED_AT_BOUND = _CAUTION, "The fit converged, with {names!l} at a bound."
    NOT_CONVERGED = _CRITICAL, "The fit did not converge; its numbers are not to be trusted."
    UNSEEN_WIDE = _CAUTION, "Not identifiable from this motion: its standard error is {share:.0%} of its value."
    UNSEEN_FAR = _CAUTION, "Not identifiable from this motion: its standard error is over ten times its value."
    UNSEEN_COMPANION = _CAUTION, "Not identifiable from this motion: what it goes with is not."
    UNSEEN_BEND = (
        _CAUTION,
        (
            "Not identifiable from this motion: with v_s near the fastest speed the term would be a bend over the whole range "
            "and not a drop at low speed."
        ),
    )
    UNSEEN = _CAUTION, "Not identifiable from this motion: {names!l}."
    ONLY_SUM_SEEN = _CAUTION, "If v_s lies beyond these speeds this is alpha_0 + alpha_1: only their sum is seen."
    ONLY_SUM_SEEN_OF_FIT = (
        _CAUTION,
        "Of alpha_0 and alpha_1: if v_s lies beyond these speeds this is alpha_0 + alpha_1: only their sum is seen.",
    )
    DID_NOT_MOVE = _CAUTION, "The fit did not move from its start; it may lie on a bound or in a flat place."
    OUT_OF_STEPS = _CRITICAL, "The fit ran out of steps before it settled."
    FEW_STARTS = _CAUTION, "Only {reached} of {starts} starts reached the lowest cost."
    NOTHING_SEEN = _CAUTION, "Nothing is seen of {name}: the torque does not depend on it in this motion."
    HARDLY_SEEN = _CAUTION, "The data hardly see {name}."
    ONLY_AGAINST = _CAUTION, "The data see {up!j} only against one another: raising them together changes nothing."
    ONLY_AS_SUM = _CAUTION, "The data see {all!j} only as a sum: raising {up!j} and lowering {down!j} changes nothing."
    NOT_PASSIVE = (
        _CAUTION,
        "Not passive{direction!d}: alpha_2 = {alpha_2:.3g} is below sigma_1 alpha_1 / alpha_0 = {least:.3g}.",
    )
    ODD_DAMPING = _CAUTION, "The damping ratio in presliding{direction!d} would be {ratio:.2g}; 0.1 to 1 is usual."
    TORQUE_DELAYED = (
        _CAUTION,
        (
            "The torque fits better when taken {seconds:.2g} s ({samples:.2g} samples) {when} than now, which would "
            "explain {share:.0%} of what is left: "
            "check the time stamps, or add {delay:.2g} s to the delay of its signal and look again "
            "(a voltage held until the next sample is half a sample early, its delay negative)."
        ),
    )
    INERTIA_DOUBTED = (
        _CAUTION,
        (
            "The inertia that was given is doubted: with {more:+.3g} +/- {error:.2g} {unit} on top of it the moving runs fit better; "
            "leave inertia out to have it fitted."
        ),
    )
    COUNT_BIAS = (
        _CAUTION,
        (
            "Encoder counts biased {names!l} by more than a standard error; the bias was taken off, but a finer encoder is better, "
            "or fit.predict: position, which simulates the motor and differentiates nothing."
        ),
    )
    STAGES_DIFFER = _CAUTION, "The moving runs and the other stages differ by more than chance in {names!l}."
    STAGES_DO_NOT_FIT = (
        _CRITICAL,
        (
            "The joint fit explains the moving runs much worse than they can be explained, {joint:.3g} % against {alone:.3g} %: "
            "the stages do not fit together."
        ),
    )
    STAGE_UNSEEN = _NOTE, "The moving data do not show it."
    STAGE_AGREES = _NOTE, "They agree."
    STAGE_DIFFERS = _CAUTION, "They differ by more than chance, and neither is much surer: see the warnings of both."
    DISTRUST_MOVING = (
        _CAUTION,
        "They differ by more than chance; distrust the moving data first, which knows it less well.",
    )
    DISTRUST_STAGE = (
        _CAUTION,
        "They differ by more than chance; distrust the {stage} stage first, which knows it less well.",
    )

    # slow loading
    NO_SIGMA_0 = (
        _CAUTION,
        "No sigma_0{direction!d}: it needs the torque at which the joint slides; add ramp runs, or load up to breakaway once.",
    )
    FEW_COUNTS = (
        _CAUTION,
        "Few encoder counts: {edges} edges in {loadings} loadings; a finer encoder, or torque nearer to breakaway, would help.",
    )
    YIELDS = (
        _CRITICAL,
        "The joint moves much further than its first counts let expect: it slides, or this is no slow loading below breakaway.",
    )
    ABOVE_G0 = (
        _CAUTION,
        (
            "The torque reaches {reached:.3g} without sliding, above g0 = {g0:.3g} ({source}): g0 may be too low. "
            "Samples above {reach:g} g0 are left out."
        ),
    )
    SINGLE_RUN = _CAUTION, "One run only: no error can be given."
    OUTLIER = (
        _CAUTION,
        "{file} is an outlier: it breaks away at {torque:.4g}; the median of {runs} runs{direction!d} is {median:.4g}.",
    )
    COARSE_LOOPS = _NOTE, "The hysteresis loops span only {counts} encoder counts: their slopes and losses are coarse."
    COARSE_LOOPS_BETWEEN = (
        _NOTE,
        "The hysteresis loops span only {least} to {most} encoder counts: their slopes and losses are coarse.",
    )
    OPEN_CYCLES = (
        _CAUTION,
        (
            "{open} of {cycles} hysteresis cycles do not close, by up to {most:+.0%} of their range, and are no loop: "
            "the two directions' friction differs at these peaks, or the first cycle began from rest."
        ),
    )
    NO_SIGMA_1 = _NOTE, "Absent: (15) needs J and sigma_0, and {why}."
    NO_STIFFNESS = _NOTE, "there is no sigma_0"
    NO_INERTIA = _NOTE, "no positive inertia is known: give inertia in the experiment file, or moving runs"
    PRIOR = (
        _CAUTION,
        (
            "A prior, not an estimate: (15) assumes a damping ratio of {ratio:g} (J: {source}); its error holds none of that assumption's."
        ),
    )
    NO_COUNTS = _NOTE, "No encoder counts are seen: (14) and the count edges need them."
    COUNTS_BIAS = _CAUTION, "Counts bias this estimate by about {share:.1%}, more than its standard error."
    NOT_POSITIVE = _CRITICAL, "Not positive: the displacement does not grow with the torque."
    NOTHING_BELOW_G0 = _NOTE, "No displacement was measured below g0."
    WHOLE_COUNT = (
        _NOTE,
        (
            "Takes a whole count for the way to the first edge, of which any part may be true; the interval is that of an unknown rest position."
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
    DIRECTION_UNKNOWN = _CAUTION, "Nothing is known of direction {direction}: {why}."
    NONE_KEPT = _CAUTION, "none of its {tried} candidate segments was kept"
    NOT_MEASURED = _CAUTION, "it was not measured"
    POSITIONS_DISAGREE = (
        _CAUTION,
        (
            "Position and velocity disagree in {differ} of {kept} kept segments; the slope of the position counts.{looks}"
        ),
    )
    LOOKS_LIKE = _CAUTION, " It looks like {what}."
    TORQUES_DOUBTED = (
        _CAUTION,
        "{doubted} of {kept} kept segments have a torque in question; each says why in the list of segments.",
    )
    OFFSET_LEFT_OUT = (
        _NOTE,
        "With separate directions an offset cannot be told from the two Coulomb terms; it is left out.",
    )
    HELD_OUT_UNUSED = _NOTE, "Held-out presliding runs are not used: {files!l}."
    TRUTH_UNDECLARED = _CAUTION, "A truth is given, but the data are not declared simulated."

    # validation of the grid search
    POINTS_SIMULATED = (
        _NOTE,
        (
            "SIMULATED: torques are those of the model at the velocities named, with white Gaussian noise; "
            "no run is simulated, and no velocity is in error."
        ),
    )
    DIRECTIONS_ALONE = (
        _NOTE,
        "Each direction stands alone: what directions share (inertia, gravity, offset) is taken as known.",
    )
    NO_STRIBECK_TERM = _NOTE, "nothing to try: {outcome}"
    POINTS_WITHOUT_NOISE = (
        _NOTE,
        "nothing to try: the points lie on the model without noise; choose a noise level with --noise",
    )
    NO_GRID_FIT = _NOTE, "nothing to try: no friction over velocity was fitted by the grid."
    NOTHING_TRIED = _NOTE, "Nothing was tried."
    NEVER_UNDERCUT = (
        _NOTE,
        (
            "{fits} fits by IPOPT from random starts within the grid's bounds ({starts} of them on the first data set of each case): "
            "none undercuts the refined grid's cost by more than {same:g}, relative (at most {deficit:.1g})."
        ),
    )
    UNDERCUT = (
        _CRITICAL,
        (
            "{fits} fits by IPOPT from random starts within the grid's bounds ({starts} of them on the first data set of each case): "
            "the refined grid was undercut by up to {deficit:.2g}, relative; do not trust it before you know why."
        ),
    )
    DESIGN_VALIDATED = (
        _NOTE,
        (
            "{design}: random starts that end in another minimum: {other!c}; "
            "with v_s free, {outside:.3g} % find a lower cost outside the grid's range; "
            "no method can know v_s in {unknowable} of {cases} cases; in {coarse} of the others a plain grid of {values} is too coarse."
        ),
    )
    V_S_KNOWABLE = (
        _NOTE,
        (
            "v_s can be known here ({below} of {speeds} speeds below v_s): it scatters by {spread:.3g} % of the truth; "
            "no finite interval is returned in {declined:.3g} % of the repetitions."
        ),
    )
    V_S_UNKNOWABLE = (
        _CRITICAL,
        (
            "No method can know v_s here ({below} of {speeds} speeds below v_s): "
            "no finite interval is returned in {declined:.3g} % of the repetitions, "
            "and the best fit's v_s is off by {bias:.3g} % of the truth in the median and scatters by {spread:.3g} %. "
            "A solver that returns a number all the same returns noise."
        ),
    )
    IPOPT_NEVER_LOWER = (
        _NOTE,
        "From {starts} random starts within the grid's bounds IPOPT never finds a cost below the refined grid's.",
    )
    IPOPT_UNDERCUTS = (
        _CRITICAL,
        "IPOPT finds a cost below the refined grid's, by {deficit:.2g} relative; do not trust the grid before you know why.",
    )
    POLISHING_STAYS = (
        _NOTE,
        "IPOPT initialised at the grid's answer stays there, within {shift:.1g} standard errors: the full fit adds nothing.",
    )
    POLISHING_MOVES = (
        _CAUTION,
        "IPOPT initialised at the grid's answer moves by up to {shift:.2g} standard errors, along a valley of one cost.",
    )
    STARTS_PART = (
        _NOTE,
        (
            "Random starts that end in another minimum, or short of one: {other!c}; without a Stribeck term: {flat!c}. "
            "The grid has no start."
        ),
    )
    STARTS_AGREE = (
        _NOTE,
        "Every random start of {solvers!l} ends in the grid's minimum: here the grid has no advantage but time.",
    )
    PLAIN_GRID_ERROR = (
        _NOTE,
        (
            "The paper's plain grid of {values} has an error of v_s of {share:.3g} % of its standard error; "
            "{enough} (a step over √12 predicts {predicted}). The refined grid has none."
        ),
    )
    FINE_GRID = _NOTE, "the first of the resolutions tried to keep below {most:.3g} % is {values}"
    NO_FINE_GRID = _NOTE, "none of the resolutions tried keeps below {most:.3g} %"
    LOWER_OUTSIDE_RANGE = (
        _CAUTION,
        (
            "With v_s free, {count} of {starts} starts find a lower cost outside the grid's range, at v_s from {low:.3g} to {high:.3g}: "
            "there the range decides, not the data."
        ),
    )
    FIT_TIMES = _NOTE, "Time of one fit, over the refined grid's: {times!x}."
    PLAIN_GRID_ENOUGH = _NOTE, "Faster than the refined grid, and fine enough here: a plain grid of {values}."

    # a plan of measurements
    PLAN_LOCAL = (
        _NOTE,
        (
            "The design is local: errors are those of the estimates, to first order; velocities are averaged over what v_s may be, "
            "the motion over {others} other joints that may be."
        ),
    )
    REFERENCES_FOLLOWED = (
        _NOTE,
        "Each reference is followed exactly; friction is LuGre, the same everywhere and at any time.",
    )
    RUN_IN = (
        _NOTE,
        (
            "A run-in of at least {settle:g} s, or {deflections:g} bristle deflections of travel, precedes each hold: "
            "the bristle forgets over one."
        ),
    )
    ENCODER_COUNT = _NOTE, "Encoder: {count:.3g} {unit} a count."
    ENCODER_FINE = _NOTE, "Encoder: no count is known; loading is planned as if it were fine."
    STILL_UNSEEN = _CAUTION, "Even after this plan {names!l} would not be seen within these limits."
    SLOWEST_TOO_FAST = (
        _CAUTION,
        (
            "The slowest constant speed, {slowest:.3g} {unit}, is {ratio:.2g} times v_s{direction!d}: slower runs would show the Stribeck region "
            "far better; a stiffer controller may hold them, then lower plan.minimum_velocity."
        ),
    )
    FEW_VELOCITIES = (
        _CAUTION,
        (
            "The planned velocities{direction!d} are too few different ones for a fit of their own: they add to what was measured; "
            "identify them together with the runs so far."
        ),
    )

    # limits of a plan that nobody declared
    LIMIT_SPEED = _NOTE, "Fastest speed: {value:g} {unit}, the fastest measured; give plan.velocity."
    LIMIT_SLOWEST = (
        _NOTE,
        (
            "Slowest constant speed: {value:g} {unit}, the slowest measured that did not stick and slip; "
            "give plan.minimum_velocity."
        ),
    )
    LIMIT_SLOWEST_GUESSED = (
        _CAUTION,
        (
            "Slowest constant speed: {value:g} {unit}, {share:g} of the fastest: no run at constant velocity shows where the drive "
            "begins to stick and slip; give plan.minimum_velocity."
        ),
    )
    LIMIT_HOLD = _NOTE, "Averaged over: {value:g} {unit}, the usual hold so far; give plan.hold."
    LIMIT_HOLD_GUESSED = _CAUTION, "Averaged over: {value:g} {unit}, a guess; give plan.hold."
    LIMIT_POSITIONS = (
        _NOTE,
        (
            "Positions: {low:.3g} to {high:.3g} {unit}, as far as the measured runs went, counted as they do; "
            "give plan.position."
        ),
    )
    LIMIT_POSITIONS_GUESSED = (
        _CAUTION,
        (
            "Positions: 0 to {high:.3g} {unit}, what the fastest hold asks for: no run has positions; "
            "give plan.position."
        ),
    )
    LIMIT_ACCELERATION = (
        _NOTE,
        "Largest acceleration: {value:g} {unit}, the largest measured; give plan.acceleration.",
    )
    LIMIT_ACCELERATION_GUESSED = (
        _CAUTION,
        "Largest acceleration: {value:g} {unit}, {seconds:g} s from rest to the fastest speed; give plan.acceleration.",
    )
    LIMIT_TORQUE = _NOTE, "Largest torque: {value:g} {unit}, the largest measured; give plan.torque."
    LIMIT_RATE = _CAUTION, "Rate of the references: {rate:g} Hz, a default; give plan.rate."
    LIMIT_FREQUENCY = (
        _CAUTION,
        (
            "Highest frequency of the motion: {frequency:.3g} Hz{capped}, which the controller must be able to follow; "
            "give plan.frequency."
        ),
    )
    AT_WHICH = _NOTE, ", at which {why}"
    FREQUENCY_LOWERED = (
        _CAUTION,
        "Highest frequency of the motion: {frequency:.3g} Hz, not the declared {declared:g} Hz: at {frequency:.3g} Hz {why}.",
    )
    CAPPED_BY_RATE = _NOTE, "plan.rate, {rate:g} Hz, gives {samples:g} samples to a period"
    CAPPED_BY_DECIMATION = (
        _NOTE,
        "fit.decimation, {decimation}, leaves one equation in {step:.3g} s, {least:g} to a period",
    )
    CAPPED_BY_SAMPLING = (
        _NOTE,
        "the sampling of the moving runs leaves one equation in {step:.3g} s, {least:g} to a period",
    )

    # what a plan starts from
    DIRECTION_TAKEN = _CAUTION, "Nothing is known of direction {direction}: it is taken to be as direction {other}."
    INERTIA_GUESSED = (
        _CAUTION,
        "Inertia: a guess, {J:.2g} {unit}: {share:g} of alpha_0 at the largest acceleration; give inertia.",
    )
    INERTIA_EXACT = _NOTE, "Inertia: {J:.4g} {unit}, given as exact; intervals are those of the others."
    GUESSED = _CAUTION, "{name}{direction!b}: a guess, {value:.3g} {unit}, {why}."
    PEAK_TO_LOOK_FOR = (
        _NOTE,
        "{share:g} of alpha_0: no Stribeck peak was found, and this is the one to look for",
    )
    AMID_THE_SPEEDS = _NOTE, "amid the speeds, and anywhere among them in the design"
    BENT_BRISTLE = _NOTE, "a bristle that bends by {share:g} of the travel"
    BY_DAMPING_RATIO = _NOTE, "(15), a damping ratio of {ratio:g}"
    VISCOUS_SHARE = _NOTE, "{share:g} of alpha_0 at the fastest speed"
    NOISE_OF_EQUATIONS = (
        _NOTE,
        (
            "Noise: an equation of a moving run, one in {step:.3g} s, scatters by {rms:.2g} {unit} as so far, "
            "and counts for 1/{inflation:.2g}: residuals are correlated."
        ),
    )
    NOISE_AVERAGED = (
        _NOTE,
        "Noise: a hold's mean torque scatters by {scatter:.2g} {unit}, as those equations averaged over it.",
    )
    NOISE_OF_HOLDS_GUESSED = (
        _CAUTION,
        "Noise: a hold's mean torque scatters by {scatter:.2g} {unit}, {share:g} of alpha_0: a guess.",
    )
    NOISE_OF_MOTION_GUESSED = (
        _CAUTION,
        "Noise of a moving run: white, and such that its mean over {hold:.3g} s scatters by {scatter:.2g} {unit}: a guess.",
    )
    NOISE_OF_POINTS = (
        _NOTE,
        "Noise{direction!b}: a hold's mean torque scatters by {scatter:.2g} {unit}, as the points did about their fit.{far}",
    )
    NOISE_OF_OTHER_POINTS = (
        _CAUTION,
        (
            "Noise{direction!b}: a hold's mean torque scatters by {scatter:.2g} {unit}, "
            "as the points did about their fit of {other}.{far}"
        ),
    )
    FAR_POINTS = (
        _NOTE,
        " Their root mean square is {ratio:.2g} times that: a few points lie far off, and do not count here.",
    )

    # a joint in its loop
    EXTRAPOLATED = (
        _CAUTION,
        "The reference is {ratio:.2g} times as fast as anything measured: the model is extrapolated.",
    )
    REFERENCE_TAKEN = (
        _NOTE,
        "Reference: {amplitude:.3g} {unit} at {frequency:.3g} Hz; give adapt.amplitude and adapt.frequency.",
    )
    DEFAULT_PID = (
        _CAUTION,
        (
            "Default PID: K_p {K_p:.3g} {unit}, K_i and K_d to match, for {bandwidth:g} rad/s at this inertia "
            "(set adapt.gains to override)."
        ),
    )
    RATES_TAKEN = (
        _NOTE,
        "Learning rates: {rates!g} for {names!l}, which halve the error in about 1 s{still}; give adapt.gamma.",
    )
    RATE_OF_ZERO = _NOTE, "; zero where steady sliding shows nothing of a parameter"
    BRISTLE_FILLED = _CAUTION, "{name}{direction!b}: these data do not show it; {value:.3g} {unit}, {how}."
    DEFLECTION_OF_AMPLITUDE = _NOTE, "{share:g} of the amplitude in deflection"
    WITH_DAMPING_RATIO = _NOTE, "(15) with a damping ratio of {ratio:g}{inertia}"
    PLANT_IS_MODEL = (
        _CAUTION,
        "The plant is the identified model itself: backlash, flexibility and noise are not in the simulations.",
    )
    DRIVE_WITHOUT_LIMIT = (
        _CAUTION,
        "The drive gives the {quantity} that it is asked for, every {period:g} s, without limit.",
    )
    PAPER_REFERENCE = (
        _CAUTION,
        (
            "Reference: 1 rad sin(2 π f t), 0.2 Hz for Figs 5 to 8 and 0.5 Hz for the adaptation; "
            "the paper gives neither amplitude nor frequency."
        ),
    )
    PAPER_CONTROL = (
        _CAUTION,
        (
            "Control in torque: the PID's output is taken in N·m and its error in rad; "
            "the paper gives no unit of its control signal and no motor."
        ),
    )
    PAPER_INERTIA = (
        _CAUTION,
        "Inertia: (15) inverted, J = (σ₁ / 0.2)² / σ₀, the mean of the two directions; the paper gives none.",
    )
    PAPER_RATES = (
        _CAUTION,
        (
            "Learning rates: 20 for both gains, with e in rad; "
            "the paper's [0, 1] fits an error in degrees (20 per rad is 0.35 per degree)."
        ),
    )
    PAPER_SAMPLING = (
        _CAUTION,
        (
            "Sampling: controller, compensator and adaptation at 1 kHz; the paper ran continuous blocks. "
            "The position is measured as it is, unless an encoder is named."
        ),
    )
    PAPER_TABLE_2 = (
        _CAUTION,
        (
            "Table 2: the paper says wrist, its numbers are the gripper's; "
            "plant and model have its (+) parameters in both directions."
        ),
    )
    PAPER_FEED_FORWARD = _NOTE, "No inertia feed-forward, unless it is named."

    # what sensitivity is explored of
    ONE_DIRECTION_KNOWN = _CAUTION, "Only direction {direction} is known; it is taken for both."
    BRISTLE_ASSUMED = _CAUTION, "{name}: these data do not show it; assumed {value:.3g} {unit}, {how}."
    DEFLECTION_OF_TRAVEL = _NOTE, "{share:g} of the travel in deflection"
    WITH_GUESSED_INERTIA = _NOTE, " and a guessed inertia of {J:.2g} {unit}"
    AS_HELD = _NOTE, "as it was held in the fit"
    GRIPPER_FRICTION = (
        _NOTE,
        "Friction: gripper rotation (+) of Table 1, in both directions; the paper's own numbers.",
    )
    GRIPPER_INTERVALS = (
        _CAUTION,
        (
            "Intervals: those of the embedded gripper, whose logs are SIMULATED from the same numbers, put about these numbers; "
            "the paper gives none."
        ),
    )
    GRIPPER_NOISE = _CAUTION, "Noise: of the same simulated logs."
    GRIPPER_REFERENCE = (
        _CAUTION,
        "Reference: 1 rad at 0.5 Hz if no other is given, as in the adaptation's experiment; the paper names no motion.",
    )
    BOX_HELD = _CAUTION, "{name}: without a finite 95 % interval; it is held at {value:.3g} {unit}."
    BOX_CUT = (
        _CAUTION,
        "{name}: its interval reaches down to what cannot be; it is drawn from {low:.3g} {unit} on (assumed).",
    )
    SOBOL_NOT_ASKED = _NOTE, "Sobol indices were not asked for (samples: 0)."
    SOBOL_WITHOUT_INTERVALS = _NOTE, "No Sobol indices: no parameter has a finite interval."
    NO_SOBOL = _NOTE, "No Sobol indices: {why}."
    NO_FORMULAS = _NOTE, "No formulas: {why}."
    NOISE_OF_FIT = (
        _NOTE,
        "Noise: as the moving runs' fit leaves it, {rms:.3g} {unit} in an equation every {step:.3g} s{correlated}.",
    )
    TIMES_FOR_CORRELATION = _NOTE, ", and {ratio:.1f} times that for its correlation"
    NOISE_ASSUMED = (
        _CAUTION,
        "Noise: assumed white, {noise:.3g} {unit} ({share:.0%} of alpha_0) at 1 kHz; standard errors go in proportion.",
    )
    NOISE_OF_STATIC_FIT = _NOTE, "Noise: the scatter that the static fit leaves."
    HELD_AS_KNOWN = _CAUTION, "Held as known, because the joint's own fit has none: {names!l}."
    NOTHING_SEEN_OF = _CAUTION, "Nothing is seen of {name}."

    # friction models side by side
    USE_MODEL = _NOTE, "Use {model}: {why!m}."
    NO_MODEL = (
        _CAUTION,
        "None of the models with the terms that the fit supports can be fitted to so few points.",
    )
    LOWEST_BIC = _NOTE, "it has the lowest BIC{next}"
    LOWEST_BIC_OF_SUPPORTED = (
        _NOTE,
        "of the models with the terms that the fit supports it has the lowest BIC{next}",
    )
    NEXT_MODEL = _NOTE, " ({model} has {gap:.1f} more)"
    NEXT_HARDLY_WORSE = _NOTE, " (hardly worse: {model} has {gap:.1f} more)"
    AICC_PREFERS = _NOTE, "AICc prefers {model}"
    PEAK_NOT_SUPPORTED = _NOTE, "the Stribeck term is not identifiable from these data, as the fit found{gain}"
    PEAK_LOWERS_BIC = _NOTE, ", though it would lower the BIC by {gain:.1f} (the fit's warnings say why)"
    PEAK_OF_STICK_SLIP = _CAUTION, "but its Stribeck term rests on points that stick and slip"
    BRISTLE_NOT_SHOWN = _NOTE, "the motion does not show LuGre's bristle"
    LUGRE_IS_ITS_CURVE = _NOTE, "At constant velocity LuGre is its Stribeck curve, so it is not listed apart."
    LUGRE_UNSETTLED = (
        _CAUTION,
        "{model}, {directions}: the fit had not settled; its numbers can still improve.",
    )
    TOO_FEW_FOR_MODELS = _NOTE, "Too few points, or too much alike, for {models!m}."

    # two sessions compared: what became of a parameter
    ROSE = _NOTE, "Rose beyond the joint uncertainty."
    FELL = _NOTE, "Fell beyond the joint uncertainty."
    NO_CHANGE = _NOTE, "No change beyond the joint uncertainty."
    NOT_COMPARABLE = _NOTE, "Not comparable: {why}."
    IN_OTHER_DIRECTIONS = (
        _NOTE,
        "the {which} session has it in other directions; identify both with the same fit.directions",
    )
    NOT_IN_SESSION = _NOTE, "the {which} session does not have it"
    NOT_IDENTIFIABLE_IN = _NOTE, "it is not identifiable in {where}"
    OF_OTHER_STAGES = _NOTE, "the sessions have it from different stages"
    OPEN_IN = _NOTE, "its interval is open, or one-sided, in {where}"
    ONE_SESSION = _NOTE, "the {which} session"
    BOTH_SESSIONS = _NOTE, "both sessions"

    # two sessions compared: all in all
    NOTHING_COMPARED = (
        _CAUTION,
        "Nothing can be compared: no parameter has a closed interval from the same stage in both sessions.",
    )
    PARAMETERS_CHANGED = (
        _NOTE,
        ("{moved} of {compared} parameters changed beyond their joint uncertainty: {changes!l}.{sets}{rest}"),
    )
    CHANGED_BY = _NOTE, "{name} ({percent:+.1f} %)"
    CHANGED_BY_POWERS = _NOTE, "{name} ({percent:+.1e} %)"
    SETS_CHANGED_TOO = _NOTE, " As a set, though none alone, so did those of the fit {fits!m}."
    ONLY_SETS_CHANGED = (
        _NOTE,
        (
            "None of {compared} parameters changed beyond its joint uncertainty alone, but as a set those of {fits!m} did: "
            "the friction changed, and which of them is not told apart.{rest}"
        ),
    )
    NONE_CHANGED = _NOTE, "None of {compared} parameters changed beyond its joint uncertainty.{rest}"
    MORE_NOT_COMPARABLE = _NOTE, " {count} more cannot be compared."

    # two sessions compared: what a change may come from
    TORQUE_SCALE = (
        _NOTE,
        (
            "{joint}: friction and inertia changed by one share; "
            "that may be the torque's scale (motor constant, drive gain), not the friction."
        ),
    )
    ALPHA_0_ROSE = (
        _NOTE,
        "{joint}: alpha_0 rose{everywhere}; wear, dirt, a tighter preload or a colder joint may do that.",
    )
    ALPHA_0_FELL = _NOTE, "{joint}: alpha_0 fell{everywhere}; running in, a warmer joint or a lost preload may do that."
    ALPHA_2_ROSE = _NOTE, "{joint}: alpha_2 rose{everywhere}; a colder or stiffer lubricant may do that."
    ALPHA_2_FELL = _NOTE, "{joint}: alpha_2 fell{everywhere}; a warmer or thinner lubricant may do that."
    SIGMA_0_ROSE = _NOTE, "{joint}: sigma_0 rose{everywhere}; a tighter preload may do that."
    SIGMA_0_FELL = _NOTE, "{joint}: sigma_0 fell{everywhere}; wear or a lost preload may do that."
    INERTIA_ROSE = (
        _NOTE,
        (
            "{joint}: inertia rose{everywhere}; another load, or another scale of the torque (motor constant, drive gain), "
            "which would scale the friction alike, may do that."
        ),
    )
    INERTIA_FELL = (
        _NOTE,
        (
            "{joint}: inertia fell{everywhere}; another load, or another scale of the torque (motor constant, drive gain), "
            "which would scale the friction alike, may do that."
        ),
    )
    IN_BOTH_DIRECTIONS = _NOTE, " in both directions"

    # two sessions compared: what limits it
    IN_ONE_SESSION = _CAUTION, "In the {which} session alone: {names!l}."
    FILES_ALL_SHARED = (
        _CAUTION,
        (
            "{joint}: the sessions share data and are not independent: all of the files are the same in both. "
            "Errors of differences are overstated, and changes missed."
        ),
    )
    FILES_SHARED = (
        _CAUTION,
        (
            "{joint}: the sessions share data and are not independent: {same} of {files} of the files are the same in both. "
            "Errors of differences are overstated, and changes missed."
        ),
    )
    ONE_SIMULATED = _CAUTION, "{joint}: one session is SIMULATED, the other measured."
    FIT_DISTRUSTED = _CAUTION, "{joint}: the {source} fit is used only for what no other fit knows: {why}"
    MODELS_DIFFER = (
        _CAUTION,
        (
            "{joint}: {terms!l} is known of the {which} session alone by its {source} fit: the two models differ, and so may "
            "the other parameters without any change of the joint."
        ),
    )

    # what was counted, assumed and done where a file was read
    HEADER_LINES = _CAUTION, "Taken as header, not as data: line{count!e} {lines!l}{more}."
    HEADER_LINE = _NOTE, "{line} ({text})"
    MORE_LINES = _NOTE, ", and {count} more"
    DECIMAL_COMMA = _CAUTION, "Numbers have a decimal comma."
    RATE_DECLARED = _NOTE, "Time from the declared rate of {rate:g} Hz."
    ROWS_NOT_FINITE = _CAUTION, "{rows} row{rows!e} dropped: inf, nan or empty (first: row {first})."
    ROWS_BACKWARD = _CAUTION, "{rows} row{rows!e} dropped: time runs backward (first: row {first})."
    ROWS_REPEATED = _CAUTION, "{rows} row{rows!e} dropped: a time stamp repeats (first: row {first})."
    ROWS_OF_SHORT_STRETCHES = (
        _CAUTION,
        (
            "{rows} row{rows!e} dropped: stretches between gaps shorter than {least} samples, "
            "which cannot be differentiated."
        ),
    )
    SAMPLING = (
        _NOTE,
        "Sampling interval {step:.4g} s (median, {rate:.6g} Hz); jitter: at most {jitter:.2g} % off.",
    )
    GAPS = (
        _CAUTION,
        (
            "{gaps} gap{gaps!e} longer than {intervals:g} intervals ({seconds:.4g} s), "
            "the longest {longest:.4g} s; each stretch between gaps is treated on its own."
        ),
    )
    UNWRAPPED = _NOTE, "Position wraps at {period:.6g} {unit}: unwrapped {turns} time{turns!e}."
    TAKEN_EARLIER = _NOTE, "{signal} taken {delay:.4g} s earlier than logged: the declared delay."
    TAKEN_LATER = _NOTE, "{signal} taken {delay:.4g} s later than logged: the declared delay."
    MOTION_FROM_POSITION = (
        _NOTE,
        (
            "Velocity and acceleration from position: Butterworth low pass of order {order}, forward and backward, "
            "cut-off {cutoff:g} Hz{lowered}; then the derivatives of a quintic spline."
        ),
    )
    ACCELERATION_FROM_VELOCITY = (
        _NOTE,
        (
            "Acceleration from velocity: Butterworth low pass of order {order}, forward and backward, "
            "cut-off {cutoff:g} Hz{lowered}; then the derivatives of a quintic spline."
        ),
    )
    CUTOFF_LOWERED = _CAUTION, ", lowered from {asked:g} Hz, which is not below the Nyquist frequency"
    TORQUE_FROM_CURRENT = _NOTE, "Torque from current: k_t = {k_t:g} {unit}."
    TORQUE_FROM_VOLTAGE = _NOTE, "Torque from voltage by (8): k_t = {k_t:g} {unit}, R = {R:g} ohm."


NOT_IDENTIFIABLE = frozenset({Kind.UNSEEN_WIDE, Kind.UNSEEN_FAR, Kind.UNSEEN_COMPANION, Kind.UNSEEN_BEND})
"""Kinds by which a motion refuses a parameter."""
