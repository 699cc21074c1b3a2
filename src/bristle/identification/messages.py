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

    # segments: why one is rejected

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
        "Off the law of the others by {deviations:.0f} standard deviations; fit.set_up: as-written would make it pass.",
    )
    EXCLUDED = _NOTE, "Excluded: fit.exclude names it."

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
    LACKS_A_TERM = _CAUTION, "The fit lacks a term. {advice}"

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
    RUNS_SCATTER = (
        _CAUTION,
        (
            "The {runs} runs differ by more than chance (chi-squared, 1 %): fitted apart, they scatter by "
            "{scatter:.2g} times their standard errors, {farthest} farthest from the median. The standard error is "
            "multiplied by {widened:.2g}, and the interval has Student's t of {freedom} degree{freedom!e} of freedom; "
            "look for what changed between the runs (temperature, load, wear)."
        ),
    )
    RUNS_MOVE = (
        _CAUTION,
        (
            "The {runs} runs differ by more than chance (F test, 1 %), {farthest} most: without each in turn the "
            "value moves {widened:.2g} times as much as its standard error says. That is multiplied by it, and the interval has "
            "Student's t of {freedom} degree{freedom!e} of freedom; look for what changed (temperature, load, wear)."
        ),
    )
    POINTS_FOR_PARAMETERS = _NOTE, "{points} points for {parameters} parameters"
    NO_BLOCKS = (
        _NOTE,
        (
            "No bootstrap: the residuals are correlated over so long that fewer than {least} blocks are left to "
            "resample."
        ),
    )
    AT_BOUND = _CAUTION, "At its physical bound of zero: the interval is one-sided."
    INTERVALS_AT_BOUND = _CAUTION, "At its physical bound of zero: the intervals are one-sided."
    REFITTED_FROM_GRID = _NOTE, "A profile found a lower cost than the grid; the fit was repeated from there."

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
            "{count} point{count!e} off the law of the others, left out: {points!m}. {other} To keep, write `set_up: as-written` under fit."
        ),
    )
    TO_LEAVE_OUT = _NOTE, "To leave out, leave `set_up: as-written` out."
    NOT_STRAYS = (
        _NOTE,
        "They stay: neighbours, the ends of the range, or more than a tenth of the points are no strays, but show what the law lacks.",
    )
    FALLS_OFF = (
        _NOTE,
        (
            "They are the slowest, and have less friction than the law: below {speed:.3g velocity} it falls towards 0, as a regularised "
            "law does, or they do not slide. Write `segments: {{minimum_velocity: {speed:.3g velocity}}}` to leave them out."
        ),
    )
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
    STATIC_AS_ASKED = _NOTE, "Coulomb and viscous friction alone are fitted, as fit.law asks."
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
    TOO_FEW_FOR_PEAK = _CAUTION, "{points} points are too few for a Stribeck term; at least {least} are needed."
    NO_STRIBECK = (
        _CAUTION,
        ("Stribeck term not identifiable{direction!d}: {why}; Coulomb and viscous friction alone are fitted."),
    )
    NO_PEAK = _CAUTION, "no sign of a Stribeck peak"
    LIKE_NOISE = _CAUTION, "noise alone would look as much like a Stribeck peak in {percent:.0f} % of cases"
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
    NO_STRIBECK_ASKED = _NOTE, "Not fitted: fit.law is coulomb-viscous."
    PEAK_LEFT_OUT = _CAUTION, "Not fitted, for fit.law is coulomb-viscous, although these data show a Stribeck term."
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

    # all parameters from a motion
    UNSEEN = _CAUTION, "Not identifiable from this motion: {names!l}."
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
    INERTIA_DOUBTED = (
        _CAUTION,
        (
            "The given inertia may be wrong: with {more:+.3g} +/- {error:.2g} {unit} added the moving runs fit "
            "better; omit inertia to have it fitted."
        ),
    )
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
    HELD_OUT_UNUSED = _NOTE, "Held-out presliding runs are not used: {files!l}."
    TRUTH_UNDECLARED = _CAUTION, "True parameters are given (truth), but the data are not declared simulated."

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

    # a joint in its loop
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

    # what sensitivity is explored of
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

    # where the torque at which slow loading slides, and the inertia, come from
    OF_STATIC_FIT = _NOTE, "the static fit"
    OF_MOVING_RUNS = _NOTE, "the moving runs"
    OF_EXPERIMENT_FILE = _NOTE, "the experiment file"
    OF_STATIC_FIT_WITHOUT_PEAK = _NOTE, "alpha_0 of the static fit, which shows no peak"
    OF_MOVING_RUNS_WITHOUT_PEAK = _NOTE, "alpha_0 of the moving runs, which show no peak"

    # how a fit of moving runs and a full fit ended, whether the stages agree, what was held out
    HELD_OUT_RUNS = _NOTE, "Hold-out: held-out runs."
    EACH_LEFT_OUT = _NOTE, "Hold-out: each point predicted from all others."

    # compensation

    # compensation: whether adaptation helps on a measured run


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
