"""Sentences of findings that have no place of their own yet, by name."""

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
    "b": lambda direction: f" ({direction})" if direction in {"+", "-"} else "",
    "c": lambda numbers: ", ".join(f"{name} {number:.3g} %" for name, number in numbers),
    "d": in_direction,
    "e": lambda count: "" if count == 1 else "s",
    "g": lambda numbers: ", ".join(f"{number:.3g}" for number in numbers),
    "i": lambda ends: ", ".join(f"{name} {low:.4g} to {high:.4g}" for name, low, high in ends),
    "j": lambda words: " and ".join(str(_raw(x)) for x in words),
    "l": lambda words: ", ".join(str(_raw(x)) for x in words),
    "m": lambda words: "; ".join(str(_raw(x)) for x in words),
    "n": lambda numbers: ", ".join(f"{name} {number:.3g}" for name, number in numbers),
    "p": lambda numbers: ", ".join(f"{name} ({number:.1f})" for name, number in numbers),
    "t": lambda sentences: "".join(f" {_raw(sentence)}" for sentence in sentences),
    "w": lambda alone: "would make it pass" if alone else "would remove this reason, not the other",
    "x": lambda numbers: ", ".join(f"{name} {number:.2g}" for name, number in numbers),
}
"""Of a direction in brackets, of named percentages, of a direction, the ending of what is counted, of numbers, of named intervals, of lists of names
and of long things, of named numbers, the same in brackets, of sentences that follow, of whether a reason stands alone, and of named ratios."""
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

    # segments: why one is rejected
    TOO_SHORT = (
        _NOTE,
        "Too short: {duration:.3g} s; {asked}. A longer hold{option} {alone!w}.",
    )
    OR_MINIMUM_DURATION = _NOTE, ", or a segments.minimum_duration of {value} s,"
    TRANSIENT = (
        _NOTE,
        (
            "Transient: for {duration:.3g} s its velocity changes by {drift:.3g velocity} about a mean of {velocity:.3g velocity}, on the way "
            "from one speed to another; it is no plateau, and no setting makes it one."
        ),
    )
    DURATION_ASKED = _NOTE, "segments.minimum_duration requires {asked:.3g} s"
    DEPENDENT_TORQUE = _NOTE, "fewer than two of its torque samples are independent"
    SAMPLES_ASKED = _NOTE, "{count:g} independent samples require {asked:.3g} s"
    USUAL_ASKED = (
        _NOTE,
        "a quarter of this run's typical plateau, {duration:.3g} s or {travel:.3g} of travel, is required",
    )
    AT_REST = (
        _NOTE,
        (
            "At rest or below breakaway: its mean speed is {speed:.3g velocity}, and {wanted} is {least:.3g velocity}. More "
            "torque{option} {alone!w}."
        ),
    )
    NOISE_FLOOR = _NOTE, "the noise floor"
    MINIMUM_VELOCITY = _NOTE, "segments.minimum_velocity"
    OR_MINIMUM_VELOCITY = _NOTE, ", or a segments.minimum_velocity of {value},"
    ACCELERATING = (
        _NOTE,
        (
            "Accelerating: its velocity drifts by {drift:.3g velocity} about a mean of {velocity:.3g velocity}; {allowed:.3g velocity} is "
            "allowed. A steadier motion{option} {alone!w}."
        ),
    )
    OR_VELOCITY_TOLERANCE = _NOTE, ", or a segments.velocity_tolerance of {value},"
    HUNTING = (
        _NOTE,
        (
            "Hunting: it moves backward {backward:.0%} of the time; 10 % is allowed. A controller that does not "
            "oscillate {alone!w}."
        ),
    )
    UNSTEADY = (
        _NOTE,
        (
            "Stick-slip without a steady mean: the means of its eighths scatter by {scatter:.3g velocity} about "
            "{velocity:.3g velocity}; {allowed:.3g velocity} is allowed. A longer hold or a stiffer controller{option} {alone!w}."
        ),
    )
    UNSETTLED = (
        _NOTE,
        (
            "Below breakaway, or not settled: its torque changes by {drift:.3g torque}, more than its mean of "
            "{torque:.4g torque}. A longer hold at this speed {alone!w}."
        ),
    )
    SATURATED = (
        _NOTE,
        (
            "Saturated: {share:.0%} of its samples are at {limit}; 5 % is allowed. A lower speed, or a higher "
            "torque_limit, {alone!w}."
        ),
    )
    LIMIT_GIVEN = _NOTE, "segments.torque_limit, {limit:.4g torque}"
    LIMIT_SEEN = _NOTE, "the largest torque or voltage of the run"
    SETTLING = (
        _NOTE,
        (
            "Settling: it is the beginning or end of the plateau in {where}, which is judged "
            "separately; a hold of its own would make it pass."
        ),
    )

    POINT_AT_REST = _NOTE, "At rest: friction at zero velocity is not a function of velocity; remove such rows."

    POINT_TOO_SLOW = (
        _NOTE,
        "Slower than segments.minimum_velocity: {speed:.3g velocity}, and {least:.3g velocity} is required.",
    )
    BELOW_BREAKAWAY = (
        _NOTE,
        (
            "Below breakaway: at {speed:.3g velocity} its torque is {torque:.4g torque}, and that of the sliding points around it "
            "{expected:.4g torque}; "
            "leave it out, or measure there for longer."
        ),
    )
    STRAY_DROPPED = (
        _NOTE,
        "Off the law of the others by {deviations:.0f} standard deviations; fit.stray: report would make it pass.",
    )
    EXCLUDED = _NOTE, "Excluded: fit.exclude names it."

    # segments: what warns about one that is kept
    STICK_SLIP = (
        _CAUTION,
        (
            "Stick-slip: the velocity deviates by {swing:.0%} of its mean and is zero {resting:.0%} of the time; "
            "the mean torque is not the friction at the mean velocity."
        ),
    )
    POSITION_DIFFERS = (
        _CAUTION,
        (
            "The slope of the position, {slope:.4g velocity}, and the mean of the logged velocity, {logged:.4g velocity}, differ: "
            "check for missing samples, a wrong unit or a wrong sampling rate."
        ),
    )
    TORQUE_DRIFTS = (
        _CAUTION,
        (
            "The torque changes by {drift:.3g torque} over the segment (mean {torque:.4g torque}), more than its noise: it "
            "depends on position, temperature or time, or had not settled."
        ),
    )
    TORQUE_UNSURE = (
        _NOTE,
        "Fewer than two of the torque samples are independent; the standard error of the torque is unknown.",
    )

    # what a fit leaves
    SET_UP_PAYS = (
        _NOTE,
        (
            "Under fit, write {lines}: on parts of the data that were held out in turn the relative error then falls "
            "from {asked:.2g} to {error:.2g} %."
        ),
    )
    TERM_EXPLAINS = (
        _NOTE,
        (
            "Under fit, write {lines}: beside all that is fitted it explains {share:.0%} of the squares that the fit leaves "
            "(an F test, to first order)."
        ),
    )
    ORDERS_FOUND = (
        _NOTE,
        (
            "Of {tried} orders, from {first} to {last} per {turn}, {orders!l} explain more of what the fit without them leaves "
            "than chance does (F tests at 1 %, corrected for all orders tried): they are fitted. To keep them, write "
            "orders: [{orders!l}] under fit."
        ),
    )
    NO_ORDERS = (
        _NOTE,
        (
            "Of {tried} orders, up to {last} per {turn}, none explains more of what the fit leaves than chance does (F tests at 1 %, "
            "corrected for all orders tried): nothing that repeats with the position is fitted."
        ),
    )
    ORDER_TO_WRITE = _NOTE, "If motor or gear repeat so, write {lines} under fit."
    LACKS_A_TERM = _CAUTION, "The fit lacks a term. {advice}"
    UNEXPLAINED = (
        _CRITICAL,
        (
            "The relative error is {error:.2g} %, of which noise accounts for {noise:.2g} %: the model does not describe "
            "these data, so do not use its parameters.{advice!t}"
        ),
    )

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
    LINKS_TAKEN_OFF = (
        _NOTE,
        "The torque of the links, at most {largest:.3g} N*m, was taken off before segments were looked for.",
    )

    # signals: what contradicts another signal, or itself
    VELOCITY_FACTOR = (
        _CRITICAL,
        (
            "The position of {files!l} moves {ratio:.3g} times as far as its logged velocity says: one of the two is wrong by "
            "this factor, and with it friction against speed. What makes them agree: {remedy}."
        ),
    )
    VELOCITY_UNRELATED = (
        _CRITICAL,
        (
            "The logged velocity of {files!l} has nothing to do with its position (correlation {correlation:.2f}): name the "
            "right column under signals.velocity, or leave velocity out to have it estimated."
        ),
    )
    WHOLE_POSITIONS = (
        _CRITICAL,
        (
            "Every position of {files!l} is a whole number of {unit}: encoder counts. Write `unit: counts` under "
            "signals.position, and give encoder_resolution, such as `encoder_resolution: 4096 counts/rev`."
        ),
    )
    WHOLE_DEGREES = (
        _CAUTION,
        (
            "Every position of {files!l} is a whole number of deg: encoder counts (then write `unit: counts` under "
            "signals.position, and give encoder_resolution), or a sensor with steps of 1 deg, which hides inertia and v_s."
        ),
    )
    COUNT_UNIT = (
        _CRITICAL,
        (
            "The position of {files!l} changes in steps of {step:.4g} {unit}, {ratio:.4g} times the declared "
            "encoder_resolution: a wrong unit. Write {remedy} under signals.position; where the position is right, write "
            "`encoder_resolution: {step:.4g} {unit}`."
        ),
    )
    COUNT_CONTRADICTS = (
        _CRITICAL,
        (
            "The position of {files!l} changes in steps of {step:.4g} {unit}, {ratio:.4g} times the declared "
            "encoder_resolution: one of the two is wrong. Where the position is right, write `encoder_resolution: "
            "{step:.4g} {unit}`; else correct the unit or scale of signals.position, the gear included."
        ),
    )
    COUNT_BITS = (
        _NOTE,
        (
            "The position of {files!l} changes in steps of {step:.4g} {unit}, {ratio:.4g} times the declared "
            "encoder_resolution, a power of two: quadrature, or a different number of bits. Write `encoder_resolution: "
            "{step:.4g} {unit}`."
        ),
    )
    COUNT_ROUNDED = (
        _CAUTION,
        (
            "The position of {files!l} is rounded to steps of {step:.4g} {unit}, {ratio:.4g} times the declared "
            "encoder_resolution: log more digits, or write `encoder_resolution: {step:.4g} {unit}`."
        ),
    )
    COUNTS_OF_A_TURN = (
        _CAUTION,
        (
            "A turn of {files!l} has {declared:.6g} counts as declared, and {counts} with {remedy} under "
            "signals.position: a power of two, as encoders have. Check the unit."
        ),
    )
    CLIPPED = (
        _CAUTION,
        (
            "The torque of {files!l} is clipped: {share:.1%} of its samples are exactly {limits}. The true torque there "
            "is unknown; move slower or more gently, or widen the range of the drive or the sensor."
        ),
    )
    DEAD_ZONE = (
        _CAUTION,
        (
            "The torque of {files!l} is exactly zero in {share:.1%} of the samples, wherever it changes its sign: its sensor or drive "
            "has a dead zone. What is cut off is missing from alpha_0, and reversals look softer; switch it off, or add it to the torque."
        ),
    )
    TORQUE_COARSE = (
        _CAUTION,
        (
            "The torque of {files!l} comes in {levels} steps of {step:.2g} (SI): what it rounds off is no noise and does not average "
            "out. Numbers may be off by half a step, those of reversals by more; log it with more digits, or from a finer sensor."
        ),
    )
    LOADED_AT_START = (
        _CAUTION,
        (
            "The torque of {files!l} begins at {torque:.3g}, {share:.0%} of its largest, and not at zero: an offset of the sensor "
            "makes sigma_0 too high in one direction and too low in the other. Subtract it, or begin without a load."
        ),
    )
    LOST_SAMPLES = (
        _CAUTION,
        (
            "Samples are missing, or the encoder slipped: {files!m}. The position jumps there by more than its speed explains, while "
            "the time goes on: speeds from it, and the acceleration there, are wrong. Log the time of each sample, or split the log."
        ),
    )
    POSITION_JUMPS = (
        _CAUTION,
        (
            "The position jumps: {files!m}. Neither its speed nor the time explains it, as where an encoder slips, misses counts or "
            "is reset: speeds from it, and the acceleration there, are wrong. Mend the encoder, or split the log there."
        ),
    )
    POSITION_HELD = (
        _CAUTION,
        (
            "The position stays the same for {samples} samples of a motion and then catches up at once: {files!m}, {share:.2g} % "
            "of the samples. The reading was not refreshed: speeds from it, and the acceleration there, are wrong. Log each "
            "reading once, with the time at which it was taken."
        ),
    )
    STAMPS_JITTER = (
        _CAUTION,
        (
            "The time stamps of {files!l} jitter by {jitter:.2g} of a sample (standard deviation), while the position advances as if "
            "sampled regularly: speeds and accelerations are too noisy. Write `time: {line}` under signals."
        ),
    )
    SAMPLED_IRREGULARLY = (
        _CAUTION,
        (
            "The position of {files!l} is noisy in proportion to its speed, as if sampled {jitter:.2g} of a sample (standard "
            "deviation) off its time: this takes away from the inertia. Log the time at which each sample was taken, in the "
            "loop of the controller."
        ),
    )
    VELOCITY_LAGS = (
        _CAUTION,
        (
            "The logged velocity of {files!l} {lags} its position by {lag:.2g} s ({samples:.2g} samples, standard error {error:.2g}), "
            "as where it is {why}: friction at reversals and the inertia are wrong. Leave `velocity` out under signals to "
            "have it estimated from the position, or log {remedy}."
        ),
    )

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
    DIRECTIONS_DIFFER = (
        _CAUTION,
        (
            "Friction differs between the directions (p = {p:.1g}, corrected for {looks} tests): the difference "
            "explains {share:.0%} of the residuals' variance. Fit the directions separately (directions: "
            "separate)."
        ),
    )
    RESIDUAL_TREND = (
        _CAUTION,
        (
            "Residuals show a trend vs {over} (p = {p:.1g}, corrected for {looks} tests), which explains "
            "{share:.0%} of their variance."
        ),
    )
    RESIDUAL_RIPPLE = (
        _CAUTION,
        (
            "Residuals show a ripple vs position of period {period:.3g position} (p = {p:.1g}, corrected for {looks} "
            "tests), which explains {share:.0%} of their variance.{advice!t}"
        ),
    )
    CORRELATED = (
        _NOTE,
        ("Residuals are correlated (lag one {lag_one:.2f}); standard errors are multiplied by {widened:.1f} for it."),
    )

    # intervals of any fit
    RUNS_SCATTER = (
        _CAUTION,
        (
            "The {runs} runs differ by more than chance (chi-squared, 1 %): fitted apart, they scatter by "
            "{scatter:.2g} times their standard errors, {farthest} farthest from the median. The standard error is "
            "multiplied by {widened:.2g}, and the interval has Student's t of {freedom} degree{freedom!e} of freedom; "
            "look for what changed between the runs (temperature, load, wear)."
        ),
    )
    RUNS_CLUSTERED = (
        _NOTE,
        (
            "Its error counts what each of {runs} runs leaves as one number, since a load is told by runs together: it is "
            "{widened:.2g} times that of independent samples, and the interval has Student's t of {freedom} degree{freedom!e} of "
            "freedom."
        ),
    )
    INTERVALS_DIFFER = (
        _CAUTION,
        ("The 95 % bounds {sides!j} the estimate differ by more than 1.5x between the methods ({ends!i}): {reason}."),
    )
    COST_STAYS_LOW = (
        _CAUTION,
        (
            "the cost stays below the threshold to the end of the range, so the data do not bound the parameter "
            "on that side"
        ),
    )
    PROFILE_SKEWED = _CAUTION, "the profile is skewed, which a covariance cannot represent; use the profile"
    FEW_TO_RESAMPLE = _CAUTION, "{few} are few to resample; use the profile"
    UNEVEN_RESIDUALS = (
        _CAUTION,
        (
            "the residuals are less even or less independent than the covariance and the profile assume; use the "
            "widest interval"
        ),
    )
    POINTS_FOR_PARAMETERS = _NOTE, "{points} points for {parameters} parameters"
    RESIDUAL_BLOCKS = _NOTE, "{blocks} blocks of independent residuals"
    SAMPLE_BLOCKS = _NOTE, "{blocks} blocks of samples"
    EDGE_BLOCKS = _NOTE, "{blocks} blocks of count edges"
    NO_BOOTSTRAP = _NOTE, "No bootstrap: {few} are too few to resample; at least {least} are needed."
    NO_BLOCKS = (
        _NOTE,
        (
            "No bootstrap: the residuals are correlated over so long that fewer than {least} blocks are left to "
            "resample."
        ),
    )
    AT_BOUND = _CAUTION, "At its physical bound of zero: the interval is one-sided."
    INTERVALS_AT_BOUND = _CAUTION, "At its physical bound of zero: the intervals are one-sided."
    NO_BOOTSTRAP_AT_BOUND = (
        _CAUTION,
        (
            "At its physical bound of zero: the intervals are one-sided; there is no bootstrap, which does not "
            "respect bounds."
        ),
    )
    REFITTED_FROM_GRID = _NOTE, "A profile found a lower cost than the grid; the fit was repeated from there."
    REFITTED = _NOTE, "A profile found a lower cost than the fit; the fit was repeated from there."
    STILL_LOWER = _CRITICAL, "Profiles still find lower costs after {fits} new fits: do not use this fit."
    NOT_FITTED = _NOTE, "It was not fitted: there is nothing to profile or to resample."
    PROFILE_OPEN = (
        _CAUTION,
        (
            "No finite interval by the profile: with the other parameters re-optimised, every value on that side "
            "that a motion can show fits about as well."
        ),
    )
    PROFILE_UNSEEN = _CAUTION, "Not identifiable: {open}"
    PROFILE_ROUGH = (
        _NOTE,
        ("The profile is hard to compute here (fits along it ran out of iterations): its bounds are approximate."),
    )
    PROFILE_LOST = (
        _CAUTION,
        (
            "The profile is hard to compute here: the search for a bound was stopped, so a side without a bound "
            "may have one."
        ),
    )

    # static fits
    STRAYS = (
        _CAUTION,
        "{count} point{count!e} off the law of the others: {points!m}. {other} {advice}",
    )
    STRAYS_MATTER = (
        _CRITICAL,
        (
            "{count} point{count!e} off the law of the others: {points!m}. {other} That is more than one standard error of "
            "{moved!l}. {advice}"
        ),
    )
    STRAYS_LEFT_OUT = (
        _CAUTION,
        (
            "{count} point{count!e} off the law of the others, left out: {points!m}. {other} To keep, write `stray: report` under fit."
        ),
    )
    TO_LEAVE_OUT = _NOTE, "To leave out, write `stray: drop` under fit."
    TERM_FIRST = (
        _NOTE,
        "But a term that the fit lacks explains more than that: add it first (see below); then look which points are still off.",
    )
    STRAY_POINT = (
        _NOTE,
        "{file} {where} ({torque:.4g torque} at {velocity:.3g velocity}, {deviations:+.0f} standard deviations off)",
    )
    POINT_NAMED = _NOTE, "{file} {where} ({torque:.4g torque} at {velocity:.3g velocity})"
    WITHOUT_STRAYS = _NOTE, "Without: {values!l}; relative error {error:.2g} % instead of {now:.2g} %."
    WITH_STRAYS = _NOTE, "With: {values!l}; relative error {error:.2g} % instead of {now:.2g} %."
    PARAMETER_VALUE = _NOTE, "{name} {value:.4g}{name!u}"
    PARAMETER_WITH_ERROR = _NOTE, "{name} {value:.4g} +/- {error:.2g}{name!u}"
    MISFIT = (
        _CRITICAL,
        (
            "The law does not fit{direction!d}: more than {most} of {count} points would have to be left out, {points!m} first. "
            "Look at the residuals for what is missing; `exclude` under fit leaves out points that you know to be faulty."
        ),
    )
    RESTING_LEFT_OUT = (
        _NOTE,
        "{count} point{count!e} below breakaway left out{direction!d}: {points!m}; the joint does not slide there.",
    )
    STATIC_CONVERGED = _NOTE, "Converged."
    STATIC_AT_BOUND = _CAUTION, "A parameter lies at its physical bound; its interval is one-sided."
    STATIC_AT_EDGE = (
        _CRITICAL,
        "The best v_s lies at the edge of the range searched; these velocities do not bracket it.",
    )
    STATIC_NO_STRIBECK = (
        _CAUTION,
        "Stribeck term not identifiable from these data: Coulomb and viscous friction alone are fitted.",
    )
    STATIC_AS_ASKED = _NOTE, "Coulomb and viscous friction alone are fitted, as fit.model asks."
    STATIC_STICK_SLIP = (
        _CAUTION,
        "The Stribeck term depends on points that stick and slip; without them it is not identifiable.",
    )
    STATIC_TOO_FEW = _CRITICAL, "Too few points for the parameters; nothing is estimated."
    BOUND = _CAUTION, "{name} lies at its physical bound of zero; an unconstrained fit would make it negative."
    FEW_BELOW_V_S = (
        _CAUTION,
        (
            "Only {below} of {points} points lie below v_s{direction!d}; measure slower speeds to identify the "
            "Stribeck term."
        ),
    )
    ILL_CONDITIONED = (
        _CAUTION,
        (
            "Ill conditioned: the scaled Jacobian's condition number is {condition:.2g}; some parameters are "
            "strongly correlated."
        ),
    )
    FLAT_PROFILE = _CRITICAL, "v_s is not identifiable from these speeds{direction!d}: its profile is flat."
    ONE_SIDED_PROFILE = (
        _CAUTION,
        "The interval of v_s is one-sided{direction!d}: the data do not bound v_s from {side}.",
    )
    AT_EDGE = (
        _CRITICAL,
        "The best v_s lies at the edge of the range searched{direction!d}, {low:.3g velocity} to {high:.3g velocity}.",
    )
    SECOND_MINIMUM = (
        _CAUTION,
        "The cost has a second minimum{direction!d} at v_s = {v_s:.3g}, below the 95 % threshold.",
    )
    HUBER_DIFFERS = (
        _CAUTION,
        "Least squares and the Huber refit differ by more than two combined standard errors in {moved!p}.{points}",
    )
    RESPONSIBLE = _CAUTION, " Points responsible: {points!m}."
    TOO_FEW_FOR_PEAK = _CAUTION, "{points} points are too few for a Stribeck term; at least {least} are needed."
    NO_STRIBECK = (
        _CAUTION,
        ("Stribeck term not identifiable{direction!d}: {why}; Coulomb and viscous friction alone are fitted.{asked}"),
    )
    NO_PEAK = _CAUTION, "no sign of a Stribeck peak"
    LIKE_NOISE = _CAUTION, "noise alone would look as much like a Stribeck peak in {percent:.0f} % of cases"
    STRAYS_AS_WELL = _CAUTION, "{count} stray{count!e} from Coulomb and viscous friction would explain it as well"
    BEND = (
        _CAUTION,
        (
            "its v_s of {v_s:.3g velocity} would lie near the fastest speed, {fastest:.3g velocity}, so the term would bend the "
            "whole curve instead of dropping at low speed (speeds beyond {seen:g} v_s would decide)"
        ),
    )
    ONE_SPEED = (
        _CAUTION,
        (
            "its v_s of {v_s:.3g velocity} would lie below a third of the slowest speed, {slowest:.3g velocity}, so the term would "
            "depend on that one speed (slower ones would decide)"
        ),
    )
    TAKES_UP_PEAK = (
        _CAUTION,
        (
            "It takes up part of a Stribeck term that these speeds show but do not bound: it describes the measured "
            "speeds, and no others."
        ),
    )
    V_S_DOWN_TO_ZERO = (
        _CAUTION,
        "these speeds set no lower limit on v_s (slower ones would)",
    )
    V_S_UP_TO_ANY = (
        _CAUTION,
        "these speeds set no upper limit on v_s (faster ones, or more of them, would)",
    )
    NONE_BELOW_V_S = (
        _CAUTION,
        "no speed lies below its v_s of {v_s:.3g velocity} (the slowest is {slowest:.3g velocity}; slower ones would decide)",
    )
    NO_STRIBECK_ASKED = _NOTE, "Not fitted: fit.model is coulomb-viscous."
    PEAK_LEFT_OUT = _CAUTION, "Not fitted, for fit.model is coulomb-viscous, although these data show a Stribeck term."
    RANGE_ASKED = _NOTE, " fit.v_s_range limits v_s to {low:.3g velocity} to {high:.3g velocity}."
    ALPHA_1_OPEN = _CAUTION, "No finite interval: v_s has none, and alpha_1 grows with v_s."
    V_S_OPEN_BELOW = _CAUTION, "No finite interval: the data allow v_s down to zero."
    SHAPE_OPEN = _CAUTION, "No finite interval: the data allow it to the end of what is searched."
    FASTEST_MEASURED = _NOTE, "Not estimated: the fastest speed that was measured."
    V_S_OPEN_ABOVE = _CAUTION, "No finite interval: the data set no upper limit on v_s."
    TOO_FEW_POINTS = (
        _CRITICAL,
        "{points} points for {parameters} linear parameters: at least {least} are needed; measure more speeds.",
    )
    INDISTINCT = (
        _CRITICAL,
        (
            "The points do not separate the linear parameters (one speed only, or a regressor that never "
            "changes); measure more speeds."
        ),
    )
    STICK_SLIP_POINTS = (
        _CAUTION,
        "{sticking} of {points} points stick and slip; the fit without them is shown for comparison.",
    )
    NOTHING_WITHOUT = _CAUTION, "Without the points that stick and slip no fit is possible. {inner}"
    WITHOUT_STICK_SLIP = _NOTE, "Without the points that stick and slip: {inner}"
    SLOW_LEFT_OUT = (
        _NOTE,
        (
            "{slow} of {equations} samples are slower than fit.moving_above, {above:.3g velocity}, and were left out of "
            "the static fit; there its relative error is {error:.0f} %. At low speed and through reversals the "
            "torque depends on the bristles' history, which (9) does not describe."
        ),
    )

    # two routes to one fit
    FULL_FIT_LOWER = (
        _CRITICAL,
        (
            "The full nonlinear fit found a lower cost than the grid ({full:.6g} against {grid:.6g}); use neither"
            " before the cause is known. {reached} of {starts} random starts of the full fit reached its lowest "
            "cost."
        ),
    )
    GRID_LOWER = (
        _NOTE,
        "The grid found a lower cost than any start of the full nonlinear fit ({grid:.6g} against {full:.6g}).",
    )
    ROUTES_AGREE = (
        _NOTE,
        (
            "Grid and full nonlinear fit agree: the largest difference is {worst:.2g} standard errors. {reached} "
            "of {starts} random starts of the full fit reached its lowest cost."
        ),
    )
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
    STATIC_WITHOUT_PRESLIDING = (
        _CAUTION,
        (
            "The fit of all parameters, which knows presliding, finds {value:.4g} +/- {error:.2g} {unit} in the same runs, "
            "which is more than chance{trust}. The standard error here is multiplied by {factor:.2g} to reach "
            "it."
        ),
    )
    BELIEVE_MOVING = _NOTE, ": believe that one"
    MOVING_IN_DOUBT = _NOTE, "; but that fit is questionable itself, as its warnings say: believe neither"
    STATIC_SUPERSEDED = (
        _NOTE,
        (
            "Presliding decides these runs: the relative error is {error:.2g} % without it and {other:.2g} % with it. Use the "
            "fit of all parameters of the moving runs, not these numbers."
        ),
    )
    SEE_MOVING = _NOTE, "No number without presliding: see the fit of all parameters of the same runs."
    WIDENED_TO_MOVING = (
        _NOTE,
        "The standard error is multiplied by {factor:.2g} to reach {value:.4g} +/- {error:.2g} {unit} of the fit of all parameters.",
    )
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
    DIRECTION_UNKNOWN = _CAUTION, "Direction {direction} is not identified: {why}."
    NONE_KEPT = _CAUTION, "none of its {tried} candidate segments was kept"
    NOT_MEASURED = _CAUTION, "it was not measured"
    POSITIONS_DISAGREE = (
        _CAUTION,
        "Position and velocity disagree in {differ} of {kept} kept segments; the slope of the position is used.",
    )
    TORQUES_DOUBTED = (
        _CAUTION,
        "The torque of {doubted} of {kept} kept segments is questionable; the list of segments says why.",
    )
    OFFSET_LEFT_OUT = (
        _NOTE,
        (
            "An offset of the torque cannot be told from a difference of alpha_0, and is not fitted. If alpha_0 were {common:.4g torque} in both "
            "directions, the offset would be {offset:.3g} {unit}: see whether the torque is zero where nothing loads the joint."
        ),
    )
    LOSS_OF_STATIC_FIT = (
        _NOTE,
        "`loss: huber` is the static fit's; all parameters of the moving runs, and their models, are fitted by least squares.",
    )
    HELD_OUT_UNUSED = _NOTE, "Held-out presliding runs are not used: {files!l}."
    TRUTH_UNDECLARED = _CAUTION, "True parameters are given (truth), but the data are not declared simulated."

    # validation of the grid search
    POINTS_SIMULATED = (
        _NOTE,
        (
            "SIMULATED: torques are those of the model at the given velocities, with white Gaussian noise; no run"
            " is simulated, and the velocities have no error."
        ),
    )
    DIRECTIONS_ALONE = (
        _NOTE,
        ("Each direction is validated separately: what directions share (inertia, gravity, offset) is taken as known."),
    )
    NO_STRIBECK_TERM = _NOTE, "nothing to validate: {outcome}"
    POINTS_WITHOUT_NOISE = (
        _NOTE,
        "nothing to validate: the points lie on the model without noise; choose a noise level with --noise",
    )
    TOO_FEW_TO_VALIDATE = (
        _NOTE,
        "nothing to validate: {points} points were fitted; four parameters and their noise need at least 5",
    )
    NO_GRID_FIT = _NOTE, "nothing to validate: the grid fitted no friction curve."
    NOTHING_TRIED = _NOTE, "Nothing was validated."
    NEVER_UNDERCUT = (
        _NOTE,
        (
            "{fits} IPOPT fits from random starts within the grid's bounds ({starts} of them on the first data "
            "set of each case): none has a cost below the refined grid's by more than {same:g} relative (at most "
            "{deficit:.1g})."
        ),
    )
    UNDERCUT = (
        _CRITICAL,
        (
            "{fits} IPOPT fits from random starts within the grid's bounds ({starts} of them on the first data "
            "set of each case): the lowest cost is up to {deficit:.2g} relative below the refined grid's; do not "
            "use the grid before the cause is known."
        ),
    )
    DESIGN_VALIDATED = (
        _NOTE,
        (
            "{design}: random starts that end in another minimum: {other!c}; with v_s free, {outside:.3g} % find "
            "a lower cost outside the grid's range; v_s is not identifiable by any method in {unknowable} of "
            "{cases} cases; in {coarse} of the others a plain grid of {values} is too coarse."
        ),
    )
    V_S_KNOWABLE = (
        _NOTE,
        (
            "v_s is identifiable here ({below} of {speeds} speeds lie below it): its estimates scatter by "
            "{spread:.3g} % of the true value; no estimate returned in {declined:.3g} % of the repetitions."
        ),
    )
    V_S_UNKNOWABLE = (
        _CRITICAL,
        (
            "v_s is not identifiable here by any method ({below} of {speeds} speeds lie below it): no estimate "
            "returned in {declined:.3g} % of the repetitions, and the best fit's v_s has a median error of "
            "{bias:.3g} % of the true value and scatters by {spread:.3g} %. A solver that returns a number all "
            "the same returns noise."
        ),
    )
    IPOPT_NEVER_LOWER = (
        _NOTE,
        "From {starts} random starts within the grid's bounds IPOPT never finds a cost below the refined grid's.",
    )
    IPOPT_UNDERCUTS = (
        _CRITICAL,
        (
            "IPOPT finds a cost below the refined grid's, by {deficit:.2g} relative; do not use the grid before "
            "the cause is known."
        ),
    )
    POLISHING_STAYS = (
        _NOTE,
        (
            "IPOPT initialised at the grid's estimate stays there, within {shift:.1g} standard errors: the full "
            "fit adds nothing."
        ),
    )
    POLISHING_MOVES = (
        _CAUTION,
        (
            "IPOPT initialised at the grid's estimate moves by up to {shift:.2g} standard errors, at nearly the "
            "same cost."
        ),
    )
    STARTS_PART = (
        _NOTE,
        (
            "Random starts that end in another minimum, or before they reach one: {other!c}; without a Stribeck "
            "term: {flat!c}. The grid needs no start."
        ),
    )
    STARTS_AGREE = (
        _NOTE,
        (
            "Every random start of {solvers!l} ends in the grid's minimum: here the grid's only advantage is its "
            "computing time."
        ),
    )
    PLAIN_GRID_ERROR = (
        _NOTE,
        (
            "The paper's plain grid of {values} adds an error of v_s of {share:.3g} % of its standard error; "
            "{enough}. The refined grid adds none."
        ),
    )
    FINE_GRID = (
        _NOTE,
        (
            "the smallest of the grids tried that stays below {most:.3g} % has {values} values "
            "(a step divided by the root of 12 predicts {predicted})"
        ),
    )
    NO_FINE_GRID = _NOTE, "to stay below {most:.3g} % it would need about {predicted} values"
    LOWER_OUTSIDE_RANGE = (
        _CAUTION,
        (
            "With v_s free, {count} of {starts} starts find a lower cost outside the grid's range, at v_s from "
            "{low:.3g} to {high:.3g}: there the range determines v_s, not the data."
        ),
    )
    FIT_TIMES = _NOTE, "Computing time of one fit relative to the refined grid: {times!x}."
    PLAIN_GRID_ENOUGH = _NOTE, "A plain grid of {values} is faster than the refined grid, and fine enough here."

    # a plan of measurements
    PLAN_NARROWS = (
        _NOTE,
        (
            "In {duration:.3g} s the plan brings the widest 95 % interval from {before:.2g} % of the value ({widest}) to "
            "{after:.2g} % ({left}), as predicted.{opens}"
        ),
    )
    PLAN_OPENS = _NOTE, " Now {names!l} cannot be identified, which the plan changes."
    MOTION_WORSE = (
        _CAUTION,
        (
            "The planned motion tells less of {names!l} than the motion measured so far, for it serves all parameters at once;"
            " repeat the measured one as well where these matter most."
        ),
    )
    PLAN_LOCAL = (
        _NOTE,
        (
            "The design is local: errors are those at the estimates, to first order; velocities are averaged over"
            " the plausible values of v_s{others}."
        ),
    )
    AND_OTHER_JOINTS = _NOTE, ", the motion over {count} other plausible joints"
    REFERENCES_FOLLOWED = (
        _NOTE,
        "Each reference is followed exactly; friction is LuGre, independent of position and time.",
    )
    RUN_IN = (
        _NOTE,
        (
            "Each hold starts with a run-in of at least {settle:g} s, or {deflections:g} bristle deflections of "
            "travel; the bristle forgets its state over one deflection."
        ),
    )
    ENCODER_COUNT = _NOTE, "Encoder: {count:.3g} {unit} per count."
    ENCODER_FINE = _NOTE, "Encoder: the count is unknown; loading is planned as if the encoder were fine."
    STILL_UNSEEN = _CAUTION, "Even after this plan {names!l} would not be identifiable within these limits."
    SLOWEST_TOO_FAST = (
        _CAUTION,
        (
            "The slowest constant speed, {slowest:.3g} {unit}, is {ratio:.2g} times v_s{direction!d}: slower runs"
            " would show the Stribeck term far better. If a stiffer controller can hold them, lower "
            "plan.minimum_velocity."
        ),
    )
    FEW_VELOCITIES = (
        _CAUTION,
        (
            "The planned velocities{direction!d} have too few different values for a separate fit: identify them "
            "together with the runs so far."
        ),
    )

    # limits of a plan that nobody declared
    LIMIT_SPEED = _NOTE, "Fastest speed: {value:g} {unit}, the fastest measured; set plan.velocity to override."
    LIMIT_SLOWEST = (
        _NOTE,
        (
            "Slowest constant speed: {value:g} {unit}, the slowest measured that did not stick and slip; "
            "set plan.minimum_velocity to override."
        ),
    )
    LIMIT_SLOWEST_GUESSED = (
        _CAUTION,
        (
            "Slowest constant speed: {value:g} {unit}, {share:g} of the fastest: no run at constant velocity shows where the drive "
            "begins to stick and slip; set plan.minimum_velocity to override."
        ),
    )
    LIMIT_HOLD = _NOTE, "Averaged over: {value:g} {unit}, the usual hold so far; set plan.hold to override."
    LIMIT_HOLD_GUESSED = _CAUTION, "Averaged over: {value:g} {unit}, a guess; set plan.hold to override."
    LIMIT_POSITIONS = (
        _NOTE,
        (
            "Positions: {low:.3g} to {high:.3g} {unit}, as far as the measured runs went, in their coordinates; "
            "set plan.position to override."
        ),
    )
    LIMIT_POSITIONS_GUESSED = (
        _CAUTION,
        (
            "Positions: 0 to {high:.3g} {unit}, which the fastest hold needs: no run has positions; "
            "set plan.position to override."
        ),
    )
    LIMIT_ACCELERATION = (
        _NOTE,
        "Largest acceleration: {value:g} {unit}, the largest measured; set plan.acceleration to override.",
    )
    LIMIT_ACCELERATION_GUESSED = (
        _CAUTION,
        "Largest acceleration: {value:g} {unit}, {seconds:g} s from rest to the fastest speed; set plan.acceleration to override.",
    )
    LIMIT_LINKS = (
        _NOTE,
        (
            "Of the torque limit {links:.3g} {unit} are kept for the links, the most that they asked for in these runs; the other "
            "joints are planned to rest."
        ),
    )
    LIMIT_TORQUE = _NOTE, "Largest torque: {value:g} {unit}, the largest measured; set plan.torque to override."
    LIMIT_RATE = _CAUTION, "Rate of the references: {rate:g} Hz, a default; set plan.rate to override."
    LIMIT_FREQUENCY = (
        _CAUTION,
        (
            "Highest frequency of the motion: {frequency:.3g} Hz{capped}, which the controller must be able to follow; "
            "set plan.frequency to override."
        ),
    )
    AT_WHICH = _NOTE, ", at which {why}"
    FREQUENCY_LOWERED = (
        _CAUTION,
        "Highest frequency of the motion: {frequency:.3g} Hz, not the declared {declared:g} Hz: at {frequency:.3g} Hz {why}.",
    )
    CAPPED_BY_RATE = _NOTE, "plan.rate, {rate:g} Hz, gives {samples:g} samples to a period"

    # what a plan starts from
    DIRECTION_TAKEN = _CAUTION, "Direction {direction} is not identified: it is assumed to be as direction {other}."
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
    AMID_THE_SPEEDS = _NOTE, "in the middle of the speeds; the design allows any value among them"
    AMID_WHAT_IS_SEARCHED = _NOTE, "in the middle of where it is looked for"
    BENT_BRISTLE = _NOTE, "a bristle that bends by {share:g} of the travel"
    BY_DAMPING_RATIO = _NOTE, "(15), a damping ratio of {ratio:g}"
    VISCOUS_SHARE = _NOTE, "{share:g} of alpha_0 at the fastest speed"
    NOISE_OF_EQUATIONS = (
        _NOTE,
        (
            "Noise: a sample of a moving run, one every {step:.3g} s, scatters by {rms:.2g} {unit} as so far, "
            "and counts as 1/{inflation:.2g} of an independent one: residuals are correlated."
        ),
    )
    NOISE_OF_INDEPENDENT = (
        _NOTE,
        "Noise: a sample of a moving run, one every {step:.3g} s, scatters by {rms:.2g} {unit} as so far.",
    )
    NOISE_AVERAGED = (
        _NOTE,
        "Noise: a hold's mean torque scatters by {scatter:.2g} {unit}, that of those samples averaged over it.",
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
        " Their root mean square is {ratio:.2g} times that: a few points are outliers, and do not count here.",
    )

    # a joint in its loop
    EXTRAPOLATED = (
        _CAUTION,
        "The reference is {ratio:.2g} times as fast as anything measured: the model is extrapolated.",
    )
    REFERENCE_TAKEN = (
        _NOTE,
        "Reference: {amplitude:.3g} {unit} at {frequency:.3g} Hz; set adapt.amplitude and adapt.frequency to override.",
    )
    DEFAULT_PID = (
        _CAUTION,
        (
            "PID: default, K_p {K_p:.3g} {unit}, K_i and K_d to match, for {bandwidth:g} rad/s at this inertia "
            "(set adapt.gains to override)."
        ),
    )
    RATES_TAKEN = (
        _NOTE,
        "Learning rates: {rates!g} for {names!l}, which halve the error in about 1 s{still} (set adapt.gamma to override).",
    )
    RATE_OF_ZERO = _NOTE, "; zero where a parameter has no effect in steady sliding"
    BRISTLE_FILLED = (
        _CAUTION,
        "{name}{direction!b}: not identifiable from these data; assumed {value:.3g} {unit}, {how}.",
    )
    DEFLECTION_OF_AMPLITUDE = _NOTE, "from a deflection of {share:g} of the amplitude"
    WITH_DAMPING_RATIO = _NOTE, "from (15) with a damping ratio of {ratio:g}{inertia}"
    SHAPE_HELD = (
        _CAUTION,
        (
            "{names!l}: {value:.3g} is assumed, the middle of what is searched, since motion hardly shows it; add points at constant "
            "velocity, or give it under fit.fixed."
        ),
    )
    SAMPLED_FASTER = (
        _NOTE,
        "Sampled {ratio:.3g} times as fast as {slowest}: it is decimated by so much more, for equations as far apart.",
    )
    LOAD_LEFT_OUT = (
        _CAUTION,
        (
            "Friction rises with load in the fit ({names!j}), by {rise:.3g} {unit} under 1 {unit}; here the joint is taken without "
            "load."
        ),
    )
    LOAD_OF_REFERENCE = (
        _CAUTION,
        (
            "Friction rises with load ({names!j}): model and plant have it, by up to {rise:.3g} {unit} along the reference about "
            "position {centre:.3g} {at} (set adapt.centre to override); gravity itself is taken as compensated."
        ),
    )
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
            "Reference: 1 rad sin(2 pi f t), 0.2 Hz for Figs 5 to 8 and 0.5 Hz for the adaptation; "
            "the paper gives neither amplitude nor frequency."
        ),
    )
    PAPER_CONTROL = (
        _CAUTION,
        (
            "Control in torque: the PID's output is taken in N*m and its error in rad; "
            "the paper gives no unit of its control signal and no motor."
        ),
    )
    PAPER_INERTIA = (
        _CAUTION,
        "Inertia: (15) inverted, J = (sigma_1 / 0.2)**2 / sigma_0, the mean of the two directions; the paper gives none.",
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

    # what is handed over
    PEAK_TAKEN_AS_NONE = (
        _CAUTION,
        "{names!j}{direction!d}: not identifiable from these data; exported without a Stribeck peak, as alpha_1 = 0.",
    )
    EXPORT_JOINT_LEFT_OUT = _CAUTION, "Left out: {why}"
    EXPORT_WITHOUT_BRISTLE = (
        _CAUTION,
        "The bristle (sigma_0, sigma_1){direction!d} is not identified, and is not exported; losses are those of the friction curve.",
    )
    INTERVAL_WITH_ZERO = (
        _NOTE,
        "{name}: its 95 % interval holds zero; the value is exported, and the data do not tell it from none.",
    )
    INTERVAL_WITH_ZERO_IMPOSSIBLE = (
        _CAUTION,
        "{name}: its 95 % interval holds zero, which it cannot be; the exported value may be off by any factor.",
    )
    EXPORT_LOSES = (
        _CAUTION,
        (
            "{joint}: {target} cannot hold this friction; the torque RMS error is {losses!l}. "
            "Where that matters, use a target that holds it (docs/export.md)."
        ),
    )
    EXPORT_LEAVES_OUT = (
        _CAUTION,
        "{joint}: {target} does not hold {names!j}, identified beside the friction; keep it in your own model of the load.",
    )
    EXPORT_WITHOUT_INERTIA = (
        _CAUTION,
        "{joint}: no inertia is known, and none is exported; the simulator keeps its own.",
    )

    # what sensitivity is explored of
    ONE_DIRECTION_KNOWN = _CAUTION, "Only direction {direction} is known; it is used for both."
    BRISTLE_ASSUMED = _CAUTION, "{name}: not identifiable from these data; assumed {value:.3g} {unit}, {how}."
    DEFLECTION_OF_TRAVEL = _NOTE, "from a deflection of {share:g} of the travel"
    WITHOUT_INERTIA_UNDAMPED = _NOTE, "for no inertia is known, without which (15) gives no damping"
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
    BOX_HELD = _CAUTION, "{name}: no finite 95 % interval; it is held at {value:.3g} {unit}."
    BOX_CUT = (
        _CAUTION,
        "{name}: its interval includes impossible values; it is drawn from {low:.3g} {unit} up (assumed).",
    )
    SOBOL_NOT_ASKED = _NOTE, "Sobol indices were not asked for (samples: 0)."
    SOBOL_WITHOUT_INTERVALS = _NOTE, "No Sobol indices: no parameter has a finite interval."
    NO_SOBOL = _NOTE, "No Sobol indices: {why}."
    NO_FORMULAS = _NOTE, "No formulas: {why}."
    NOISE_OF_FIT = (
        _NOTE,
        "Noise: residuals of the moving runs' fit, {rms:.2g} {unit} per sample every {step:.3g} s{correlated}.",
    )
    TIMES_FOR_CORRELATION = _NOTE, ", times {ratio:.1f} for their correlation"
    NOISE_ASSUMED = (
        _CAUTION,
        "Noise: assumed white, {noise:.2g} {unit} ({share:.0%} of alpha_0) at 1 kHz; standard errors are proportional to it.",
    )
    NOISE_OF_STATIC_FIT = _NOTE, "Noise: the scatter of the points about the static fit."
    HELD_AS_KNOWN = _CAUTION, "Taken as known, because the joint's own fit has none: {names!l}."
    NOTHING_SEEN_OF = _CAUTION, "{name} is not identifiable."

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

    # friction laws side by side
    LAW_WANTED = (
        _NOTE,
        (
            "The data want {law}: its BIC is {gain:.1f} lower than the paper's law's, and at five blocks of speed, each left "
            "out in turn, its error is {error:.3g} % of the torque instead of {before:.3g} %."
        ),
    )
    LAW_BEST = (
        _NOTE,
        "The data ask for no other law than the paper's: it has the lowest BIC ({law} has {gap:.1f} more).",
    )
    LAW_KEPT = (
        _NOTE,
        "The data ask for no other law than the paper's: the BIC of {law} is {gain:.1f} lower, less than the 10 asked for.",
    )
    LAW_NOT_PREDICTING = (
        _NOTE,
        "The data ask for no other law than the paper's: the BIC of {law} is {gain:.1f} lower, but it predicts speeds that were left out no better.",
    )
    LAWS_TOO_FEW = (
        _NOTE,
        "The data cannot ask for another law than the paper's: there are too few points to leave speeds out.",
    )
    OTHER_LAW = (
        _CAUTION,
        (
            "Under fit, write `law: {law}` (or `law: auto`): its BIC is {gain:.1f} lower than that of {own}, and at speeds "
            "that were left out its error is {error:.3g} % of the torque instead of {before:.3g} %."
        ),
    )
    OVER_LAWS = (
        _CAUTION,
        (
            "Its interval takes the law as known, which the data chose. Over the laws that they allow it is "
            "{low:.3g} to {high:.3g} {unit}."
        ),
    )
    CURVE_HELD = (
        _CAUTION,
        (
            "Viscous friction bends down with speed (alpha_3 < 0). Faster than {fastest:.3g velocity}, the fastest speed "
            "measured, it is taken to stay as large as there."
        ),
    )

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
    OF_OTHER_LAWS = _NOTE, "it means another thing in the law of each session"
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
            "{joint}: friction and inertia changed by the same ratio; "
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

    # a fleet of joints
    FLEET_CHANGED = (
        _NOTE,
        (
            "{changed} of {tested} joints changed, at a false discovery rate of {rate:.3g} %; the clearest: {first}{more}."
        ),
    )
    JOINT_CHANGED = _NOTE, "{joint}, {name} by {percent:+.3g} % since {since}"
    AND_JOINTS = _NOTE, "; {count} other{count!e} changed as well"
    FLEET_UNCHANGED = (
        _NOTE,
        "None of {tested} joints changed beyond the scatter between sessions, at a false discovery rate of {rate:.3g} %.",
    )
    FLEET_UNTESTED = (
        _NOTE,
        "No joint was tested for a change; the notes say why.",
    )
    COMMON_SHIFT = (
        _CAUTION,
        (
            "{names!l} of all {joints} joints of type {type} shifted together, by up to {percent:+.2g} %: the cause is common to the type. "
            "The shift is taken off, and no joint is accused of it. {cause}"
        ),
    )
    SHIFT_UNLOGGED = _NOTE, "Temperature is not in the catalog; log it, for it does this."
    SHIFT_LOGGED = (
        _NOTE,
        "Temperature is taken off already; look for a new lot of grease, new firmware or another torque constant.",
    )
    WARNED_SINCE = (
        _CAUTION,
        (
            "{count} of the joints that changed have warnings since that they did not have before: {codes!l}. Look at their logs first; "
            "a failing sensor is not wear."
        ),
    )
    MIXED_VALUE_UNITS = (
        _CAUTION,
        (
            "Type {type} has values in {unit} and in {other}; the {count} values in {other} are left out. "
            "Give these joints a type of their own."
        ),
    )
    OF_OTHER_FITS = (
        _NOTE,
        (
            "{count} values come from another fit than most values of the same parameter of their joint, and are left out of the findings: "
            "two fits may differ without any change of the joint."
        ),
    )
    SCATTER_OF_FEW = (
        _CAUTION,
        (
            "The scatter between sessions of type {type} rests on {count} pairs of successive sessions, so only large changes are told from it; "
            "more joints of the type, or more sessions, narrow it."
        ),
    )
    BEYOND_ERRORS = (
        _NOTE,
        (
            "Type {type}: by the errors of the estimates alone, as compare judges two sessions, there are steps: {steps!m}{more}. "
            "Whether they are more than what sessions scatter by is not told from so few."
        ),
    )
    MORE_STEPS = _NOTE, ", {count} more"
    JOINTS_UNTESTED = _NOTE, "Not tested for a change: {count} joint{count!e}; {why!m}."
    UNTESTED_BY_SESSIONS = _NOTE, "{count} without values in more than {baseline} sessions"
    UNTESTED_BY_SCATTER = _NOTE, "{count} whose type has too few repeated sessions to tell the scatter between them"
    BASELINES_BEGUN = (
        _NOTE,
        "{count} joint{count!e} began anew at a session tagged baseline; the last: {joint} on {since}.",
    )
    SESSIONS_FAILED = _NOTE, "{failed} of {total} joint session{total!e} without a result; the first: {first}"
    SESSIONS_LEFT_OUT = _NOTE, "{count} joint session{count!e} left out of the findings; the first: {first}"
    VALUES_CRITICAL = (
        _NOTE,
        "{count} value{count!e} with a critical warning left out of the findings; the commonest: {codes!l}.",
    )

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
    LAWS_DIFFER = (
        _CAUTION,
        (
            "{joint}: the first session has the friction law {first}, the second {second}, so only parameters that mean "
            "the same in both are compared; to compare all, identify both sessions with one law, as `law: {second}` under fit."
        ),
    )
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
    UNIT_DIFFERS = (
        _CAUTION,
        (
            "Unit of {signal}: the header of {files!l} states {stated}, and {declared} is declared. Write {remedy}; where the header is "
            "wrong, correct it, or leave the unit out of it."
        ),
    )
    OWN_TIME = (
        _NOTE,
        (
            "{signal} has a time of its own ({samples} sample{samples!e}): linear between its samples, and missing in {outside} row{outside!e} of "
            "the run, beyond them or in their gaps."
        ),
    )
    FILES_JOINED = (
        _NOTE,
        "One run of {files!l}, in this order. Times that begin anew, and then follow after a gap: {restarts}.",
    )
    PART_TAKEN = _NOTE, "Of {total} rows {rows} are taken: {part}."
    GEAR_TAKEN = _NOTE, "Gear of ratio {ratio:g}{unit}: logged at the motor, and brought to the joint: {signals!l}."
    RATE_DECLARED = _NOTE, "Time from the declared rate of {rate:g} Hz."
    TIME_RECEIVED = _NOTE, "Times of {topics!l} are those at which messages were received, not those of a header."
    TOPICS_INTERPOLATED = (
        _NOTE,
        (
            "{topics!l} interpolated linearly at the stamps of {onto}; {rows} row{rows!e} outside them, or in gaps longer "
            "than {gap} intervals, left empty."
        ),
    )
    ROWS_NOT_FINITE = _CAUTION, "{rows} row{rows!e} dropped: inf, nan or empty (first: {first})."
    ROWS_MOTOR_OFF = (
        _NOTE,
        (
            "{rows} row{rows!e} left out (first: {first}): the drive is off there, the motor is open, and what it is given is no "
            "torque."
        ),
    )
    ROWS_BACKWARD = _CAUTION, "{rows} row{rows!e} dropped: time runs backward (first: {first})."
    ROWS_REPEATED = _CAUTION, "{rows} row{rows!e} dropped: a time stamp repeats (first: {first})."
    ROWS_OF_SHORT_SEGMENTS = (
        _CAUTION,
        (
            "{rows} row{rows!e} dropped: segments between gaps shorter than {least} samples, "
            "which cannot be differentiated."
        ),
    )
    SAMPLING = (
        _NOTE,
        "Sampling interval {step:.4g} s (median, {rate:.6g} Hz); jitter: at most {jitter:.0f} %.",
    )
    GAPS = (
        _CAUTION,
        (
            "{gaps} gap{gaps!e} longer than {intervals:g} intervals ({seconds:.4g} s), "
            "the longest {longest:.4g} s; each segment between gaps is treated separately."
        ),
    )
    UNWRAPPED = _NOTE, "Position wraps at {period:.6g} {unit}: unwrapped {turns} time{turns!e}."
    TAKEN_EARLIER = _NOTE, "{signal} taken {delay:.4g} s earlier than logged: the declared delay."
    TAKEN_LATER = _NOTE, "{signal} taken {delay:.4g} s later than logged: the declared delay."
    MOTION_FROM_POSITION = (
        _NOTE,
        (
            "Velocity and acceleration from position: Butterworth low pass of order {order}, forward and backward, "
            "cut-off {cutoff:.3g} Hz{why}; then the derivatives of a quintic spline."
        ),
    )
    ACCELERATION_FROM_VELOCITY = (
        _NOTE,
        (
            "Acceleration from velocity: Butterworth low pass of order {order}, forward and backward, "
            "cut-off {cutoff:.3g} Hz{why}; then the derivatives of a quintic spline."
        ),
    )
    TORQUE_SMOOTHED = _NOTE, "Torque of slow loading: low pass of {cutoff:.3g} Hz{why}."
    CUTOFF_ASKED = _NOTE, ", as asked"
    CUTOFF_OF_MOTION = (
        _NOTE,
        (
            ", for 99.9 % of the motion lies below {motion:.3g} Hz, and motion and effort show more than noise up to {shown:.3g} Hz "
            "(fit.position_cutoff overrules)"
        ),
    )
    CUTOFF_OF_HOLDS = _NOTE, ", half of the frequency up to which the position shows more than noise, {shown:.3g} Hz"
    CUTOFF_OF_LOADING = _NOTE, ", ten times the frequency below which 99.9 % of it lies, {own:.3g} Hz"
    CUTOFF_LOWERED = _CAUTION, ", lowered from {asked:g} Hz, which is not below the Nyquist frequency"
    TORQUE_FROM_CURRENT = _NOTE, "Torque from current: k_t = {k_t:g} {unit}."
    TORQUE_FROM_VOLTAGE = _NOTE, "Torque from voltage by (8): k_t = {k_t:g} {unit}, R = {R:g} ohm."

    # the constants that torques were computed with
    TORQUE_EXACT = (
        _NOTE,
        (
            "Torque: assuming {constants!j} exact: no interval contains that error, which is often the largest; "
            "give it, as in {line}."
        ),
    )
    TORQUE_UNCERTAIN = (
        _NOTE,
        (
            "Torque: every interval contains the error of {constants!j}, which moves the parameters together; "
            "its part is shown as systematic{rest}."
        ),
    )
    TORQUE_REST_EXACT = _NOTE, "; assuming {constants!j} exact"
    SYSTEMATIC_STAYS = (
        _NOTE,
        "Expected errors are those of the scatter: no run lowers the systematic error, of {constants!j}.",
    )
    SYSTEMATIC_DRAWN = (
        _NOTE,
        (
            "Joints are also drawn with the error of {constants!j}; where the controller makes its torque by the same "
            "constants that error cancels, and the range is narrower."
        ),
    )
    COMMON_CONSTANTS = (
        _NOTE,
        (
            "{joint}: {constants!j} is common to both sessions: its error moves both alike, and does not widen their "
            "difference."
        ),
    )
    OWN_CONSTANTS = (
        _NOTE,
        "{joint}: {constants!j} is of one session alone: its error widens the differences.",
    )

    # what to measure next, about the static fit of a direction
    MEASURE_SPEEDS = (
        _NOTE,
        ("Measure at least eight constant speeds, evenly spread in log(v) over two decades or what the joint allows."),
    )
    RISES_BELOW = (
        _NOTE,
        (
            "If friction rises at low speed, it does so below what was measured: try five constant speeds from "
            "{low:.2g} to {high:.2g} {unit}."
        ),
    )
    RISE_NOT_SHOWN = (
        _NOTE,
        (
            "If friction rises at low speed, these data do not show it: try five constant speeds from {low:.2g} to "
            "{high:.2g} {unit}."
        ),
    )
    FEW_POINTS_BELOW = (
        _NOTE,
        "Fewer than three points lie below v_s: measure five constant speeds from {low:.2g} to {high:.2g} {unit}.",
    )
    UNLIMITED_BELOW = (
        _NOTE,
        "Nothing limits v_s below: measure five constant speeds from {low:.2g} to {high:.2g} {unit}.",
    )
    UNLIMITED_ABOVE = _NOTE, "Nothing limits v_s above: measure more speeds from {low:.2g} to {high:.2g} {unit}."
    V_S_WIDE = (
        _NOTE,
        (
            "v_s is wide: measure more speeds, or longer runs, from {low:.2g} to {high:.2g} {unit}, where the curve "
            "bends."
        ),
    )
    ALPHA_2_WIDE = (
        _NOTE,
        "alpha_2 is wide: measure faster, {low:.2g} to {high:.2g} {unit}, where the viscous part is larger.",
    )

    # what to measure next, about a joint and its moving runs
    REPEAT_STICKING = (
        _NOTE,
        (
            "Repeat {files!l} with a stiffer velocity loop, or slightly faster: these runs stick and slip, so their "
            "mean torque is not the friction of steady sliding."
        ),
    )
    MEASURE_DIRECTION = _NOTE, "Measure direction {direction} at the same speeds: nothing is known of it."
    PEAK_OPEN = (
        _NOTE,
        (
            "The moving runs leave {names!j} open: add constant velocities below and around v_s (experiment: ramp), "
            "or move long and slowly there."
        ),
    )
    VISCOUS_OPEN = (
        _NOTE,
        "The moving runs leave {names!j} open: move faster, where the viscous part is larger.",
    )
    BRISTLE_OPEN = (
        _NOTE,
        (
            "The moving runs leave {names!j} open: add slow loading below breakaway (experiment: presliding), or turn "
            "often and slowly, by a few times the way in which friction builds up."
        ),
    )
    INERTIA_OPEN = _NOTE, "The moving runs leave {names!j} open: accelerate harder, or give the inertia."
    AVOID_COUNTS = (
        _NOTE,
        ("Encoder counts bias the moving runs: try fit.predict: position on the same logs, or a finer encoder."),
    )
    HOLD_BACK = (
        _NOTE,
        "Hold back one run (hold_out: true): the error on data that were not fitted is the one to trust.",
    )

    # which sigma_0 to use, and what (14) would be off by
    FROM_TRANSITIONS = (
        _NOTE,
        "sigma_0 from encoder transitions; insensitive to where inside a count the joint rests.",
    )
    FROM_SAMPLES = (
        _NOTE,
        "sigma_0 from all samples; no counts are seen in the displacement, so there are no edges to go by.",
    )
    SIGMA_0_AT_LEAST = _CAUTION, "No sigma_0 can be given; it is at least {least:.3g} {unit}."
    SIGMA_0_UNKNOWN = _CAUTION, "No sigma_0 can be given."
    BIAS_OF_PRINTED = (
        _NOTE,
        (
            "{on_edge:+.1%} where the joint rests on a count edge; {mean:+.0%} on average, with a spread of "
            "{spread:.0%}, where it rests anywhere in a count (one count is {count:.4g} {unit}; noise in the torque "
            "comes on top)."
        ),
    )
    BIAS_UNKNOWN = _NOTE, "unknown: that needs encoder counts and a sigma_0."
    EDGES_CROSSED = _NOTE, "{loadings} loading{loadings!e} and {counts} count edge{counts!e} crossed."
    MEDIAN_BREAKAWAY = _NOTE, "the median breakaway torque is {torque}{ends}."
    ENDS = _NOTE, ", 95 %: {ends}"

    # where the torque at which slow loading slides, and the inertia, come from
    OF_STATIC_FIT = _NOTE, "the static fit"
    OF_MOVING_RUNS = _NOTE, "the moving runs"
    OF_EXPERIMENT_FILE = _NOTE, "the experiment file"
    OF_STATIC_FIT_WITHOUT_PEAK = _NOTE, "alpha_0 of the static fit, which shows no peak"
    OF_MOVING_RUNS_WITHOUT_PEAK = _NOTE, "alpha_0 of the moving runs, which show no peak"
    OF_BREAKAWAY = _NOTE, "breakaway in direction {direction}{creep}"
    OF_ONE_BREAKAWAY = _CAUTION, "breakaway in direction {direction}{creep}; its error of {share:.0%} is a guess"
    CREEP_ADDED = _NOTE, ", with up to {share:.0%} added for the creep before it"
    OF_LARGEST_HELD = _CAUTION, "the largest torque held: no run breaks away"

    # simulated data: how many intervals hold what was simulated
    TRUTH_INSIDE = _NOTE, "{inside} of {count} true values lie inside their 95 % intervals{more}."
    MISSES_TOGETHER = (
        _NOTE,
        "; misses are not independent: the estimates of one direction come from the same data",
    )

    # how a fit of moving runs and a full fit ended, whether the stages agree, what was held out
    STARTS_REACHED = _NOTE, "{reached} of {starts} starts reached the lowest cost."
    NO_STARTS = _NOTE, "Initialised at the other stages' estimates alone."
    COST_HIGHER = (
        _NOTE,
        "the full fit's is higher by {change:.1g} of {first}'s; {reached} of {starts} starts reached it",
    )
    COST_LOWER = (
        _NOTE,
        "the full fit's is lower by {change:.1g} of {first}'s; {reached} of {starts} starts reached it",
    )
    COST_EQUAL = _NOTE, "the full fit's equals {first}'s; {reached} of {starts} starts reached it"
    STAGES_COMPARED = (
        _NOTE,
        (
            "{agreed} of {compared} parameters agree between their own stage and the moving data; the largest "
            "difference is {largest:.2g} standard errors ({name}){more}."
        ),
    )
    MORE_UNSEEN = _NOTE, "; {count} more not identifiable from the tracking runs"
    NONE_COMPARED = _NOTE, "The moving data show none of the parameters that the other stages know."
    HELD_OUT_RUNS = _NOTE, "Hold-out: held-out runs."
    EACH_LEFT_OUT = _NOTE, "Hold-out: each point predicted from all others."

    # sensitivity: which parameters matter
    CLAIM_HOLDS = (
        _NOTE,
        (
            "The paper's claim that alpha_0 and alpha_2 matter most holds for {amplitude:.3g} {unit} at "
            "{frequency:.3g} Hz: RMS of p dT/dp relative to that of T: {largest!x} (total).{settled}"
        ),
    )
    CLAIM_FAILS = (
        _NOTE,
        (
            "The paper's claim that alpha_0 and alpha_2 matter most does not hold for {amplitude:.3g} {unit} at "
            "{frequency:.3g} Hz: RMS of p dT/dp relative to that of T: {largest!x} (total).{settled}"
        ),
    )
    ONCE_SETTLED = _NOTE, " In its last period, after the bristle's first deflection: {largest!x}."
    OTHER_AT_FIXED_Z = (
        _NOTE,
        "At fixed z the order would be {names!l}: the bristle's response to a parameter matters.",
    )
    CLAIM_ON_MAP = (
        _NOTE,
        (
            "Of {motions} motions on the map it holds for {held}: {where!l}. Parameters that rank first somewhere: "
            "{first!l}."
        ),
    )
    AT_EVERY_AMPLITUDE = _NOTE, "at {frequency:.2g} Hz at every amplitude"
    NOT_AT_THE_LARGEST = _NOTE, "at {frequency:.2g} Hz not at the largest amplitude"
    FROM_AMPLITUDE = _NOTE, "at {frequency:.2g} Hz from {amplitude:.2g} {unit} up"
    ALL_TOLD = _NOTE, "From {what} alone all of {names!l} are identifiable.{more!t}"
    NOT_TOLD = (
        _CAUTION,
        "From {what} alone {names!l} would not be identifiable (standard error over half the value).{more!t}",
    )

    # sensitivity: Sobol indices
    SOBOL_INDICES = (
        _NOTE,
        "{output}: total index {indices!l}{more}; {samples} samples, {evaluations} evaluations.",
    )
    SOBOL_INDEX = _NOTE, "{name} {total:.2f} ± {half:.2f} ({first:.2f} alone)"
    INTERACTIONS = _NOTE, "; interactions account for {share:.2f}"
    NO_INDICES = _NOTE, "{output}: {why}"
    NOTHING_CHANGES_IT = _NOTE, "None of the parameters drawn changes it."
    PLANTS_REFUSED = _CAUTION, "Not every plant drawn can be run: {why}."
    LOOP_DIVERGES = (
        _CAUTION,
        "The loop diverges with {diverged} of the {drawn} plants drawn; narrow the box, or lower the gains.",
    )
    DRAWN_FROM = (
        _NOTE,
        (
            "Parameters are drawn uniformly unless stated otherwise, and independently, although those of a fit are "
            "correlated: {spans!l}. Seed {seed}."
        ),
    )
    DRAWN_SPAN = _NOTE, "{name} [{low:.3g}, {high:.3g}]"
    DRAWN_LOGARITHM = _NOTE, "{name} [{low:.3g}, {high:.3g}] (log-uniform)"
    INDICES_SIMULATED = (
        _NOTE,
        (
            "SIMULATED: a sine of {amplitude:.3g} {unit} at {frequency:.3g} Hz; in the loop the compensator keeps the "
            "nominal parameters while the plant is drawn. ± of an index is its {level:.0%} bootstrap interval, which "
            "is conservative for these samples."
        ),
    )

    # sensitivity: what the printed law of adaptation is
    PRINTED_IS = _NOTE, "The right-hand side of the paper's (19) is, term by term, {derivatives!l}.{extra}"
    PRINTED_IS_NONE = (
        _NOTE,
        "The right-hand side of the paper's (19) is, term by term, none of these derivatives.{extra}",
    )
    PRINTED_IS_ANOTHER = _NOTE, " It is not dT_f/dalpha_0, which it is said to be."
    FORMULAS_AS_MEASURED = (
        _NOTE,
        (
            "Viscous friction is written as it is up to {fastest}, the fastest speed measured; where one of its "
            "coefficients is negative, it stays beyond as large as there."
        ),
    )
    TOTAL_DERIVATIVES = (
        _NOTE,
        (
            "Total derivatives add dT_f/dz dz/dp, with z through the whole motion; in steady sliding they are those of "
            "T_ss above."
        ),
    )

    # compensation
    ERRORS_COMPENSATED = (
        _NOTE,
        (
            "{joint}, {frequency:g} Hz: RMS error {without:.3g} {unit} without, {identified:.3g} {unit} "
            "({identified_percent:.2g} %) with and {adaptive:.3g} {unit} ({adaptive_percent:.2g} %) with adaptive "
            "compensation."
        ),
    )
    ERROR_REDUCED = (
        _NOTE,
        (
            "LuGre feed-forward reduces the RMS error of {joint} at {frequency:g} Hz from {without:.3g} {unit} to "
            "{identified:.3g} {unit} ({percent:.2g} %)."
        ),
    )
    ERROR_INCREASED = (
        _CAUTION,
        (
            "LuGre feed-forward increases the RMS error of {joint} at {frequency:g} Hz from {without:.3g} {unit} to "
            "{identified:.3g} {unit} ({percent:.2g} %)."
        ),
    )
    ADAPTATION_WORSE = (
        _CAUTION,
        (
            "Adaptation makes {joint} worse at {frequency:g} Hz: RMS error {identified:.3g} {unit} with the identified "
            "model, {adaptive:.3g} {unit} adapted."
        ),
    )
    ADAPTED_TO = _NOTE, "{joint}, {law}: {name} from {initial:g} to {final:.3f} of its {reference} value."
    CURVE_MIXED = (
        _NOTE,
        "The friction curve{direction!d} mixes two fits, which are not one law: for the curve take the values of one of them.",
    )
    STRIBECK_AS_GOOD = (
        _NOTE,
        (
            "The Stribeck curve compensates {joint} as well as LuGre does on this motion: RMS error {stribeck:.3g} and {lugre:.3g} "
            "{unit}, both driven by the reference velocity, with the finest encoder and no delay."
        ),
    )
    ABLATED = (
        _NOTE,
        "{cycling} of {tried} cases end in a limit cycle, {leading} over-compensate, {diverging} diverge.",
    )

    # compensation: whether adaptation helps on a measured run
    GAIN_AT_LIMIT = (
        _CAUTION,
        (
            "A gain ended at its limit ({ratios!n}; {after:.3g} % of the friction torque is left unexplained instead of "
            "{before:.3g} %): widen adapt.limits if friction may have changed that much; otherwise leave it off, or "
            "lower gamma."
        ),
    )
    MODEL_UNFIT = (
        _CAUTION,
        (
            "The identified model leaves {before:.3g} % of this run's friction torque unexplained ({after:.3g} % adapted): check units, "
            "sign and columns of the run; until then its gains mean nothing."
        ),
    )
    ADAPTATION_HELPS = (
        _NOTE,
        (
            "It helps here: {after:.3g} % of the friction torque is left unexplained instead of {before:.3g} %, at ratios "
            "{ratios!n}."
        ),
    )
    ADAPTATION_IDLE = (
        _NOTE,
        (
            "It changes nothing here: {before:.3g} % of the friction torque is left unexplained without it, {after:.3g} % with "
            "it, at ratios {ratios!n}."
        ),
    )
    ADAPTATION_HARMS = (
        _CAUTION,
        (
            "Leave it off: {after:.3g} % of the friction torque is left unexplained instead of {before:.3g} %, at ratios "
            "{ratios!n}."
        ),
    )


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
    "stick-slip holds-swing position-differs torque-drifts positions-disagree torques-doubted stick-slip-points "
    "nothing-without other-law lacks-a-term lacks-unknown-term bursts reversals-left directions-differ residual-trend "
    "residual-ripple offset-or-friction drift-in-order takes-up-peak torque-delayed turns-late delay-or-presliding "
    "drift-of-rows drift-over-runs torque-drifts-in-runs friction-by-load clipped lost-samples position-jumps "
    "position-held stamps-jitter sampled-irregularly velocity-lags dead-zone torque-coarse loaded-at-start "
    "rows-not-finite rows-backward rows-repeated points-repeated rows-of-short-segments gaps count-bias counts-bias "
    "few-counts within-noise sigma-0-at-least count-rounded count-bias-unknown whole-degrees runs-scatter outlier "
    "stages-differ stage-differs static-without-presliding distrust-moving distrust-stage inertia-doubted "
    "huber-differs responsible intervals-differ cost-stays-low profile-skewed few-to-resample uneven-residuals "
    "profile-lost over-laws at-bound intervals-at-bound no-bootstrap-at-bound profile-open static-at-bound bound "
    "one-sided-profile alpha-1-open v-s-open-below v-s-open-above shape-open converged-at-bound g0-at-least strays "
    "strays-left-out constant-unseen static-no-stribeck no-stribeck like-noise no-peak bend one-speed "
    "v-s-down-to-zero v-s-up-to-any none-below-v-s too-few-for-peak peak-left-out profile-unseen unseen unseen-wide "
    "unseen-far unseen-companion unseen-peak unseen-no-peak unseen-unconverged unseen-too-few unseen-below-count "
    "unseen-in-counts unseen-biased strays-as-well unseen-no-reversal unseen-fast interval-with-zero-impossible "
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
