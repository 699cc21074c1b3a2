"""Levels of tests, and limits from which a finding is reported, a model chosen or data left out.

Each is a default: `changed_levels`, or `--level` of the command line, puts another in its place. Modules read them where
they apply, as `levels.NAME`. Tolerances and grids stand elsewhere.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from math import isfinite
from typing import Any

from bristle.errors import InputError, short

# Tests
CONFIDENCE = 0.95  # of every interval
NORMAL = 1.96  # standard errors: half the width of a normal interval of that confidence
SIGNIFICANCE = 0.01  # of a test that adds a term, leaves a point out or separates runs; Bonferroni over what it tries
RARE = 1e-3  # of a test that every experiment or fleet undergoes: one false alarm in a thousand
START_WORTH = 0.1  # p-value of a Stribeck term from which a descent starts with it; the fit is tested again
NO_SIGN = 0.5  # noise alone shows as much in half of all cases
NAMED = 0.05  # of compared sessions or joints (Holm): one false change in twenty comparisons
FALSE_DISCOVERIES = 0.05  # share among the joints of a fleet that are said to have changed: one in twenty
SURE = 3.0  # standard errors from which a sign, a difference or a contradiction is sure: 0.3 % by chance
NOISE = 3.3  # standard deviations that noise exceeds once in 2000 times: from there a pattern or a delay is real
DEVIATIONS = 4.0  # standard errors of a check that every record undergoes: 6e-5 of clean records
EARLY = 5.0  # standard errors by which a motion is before its command: impossible, so nearly no chance is allowed
LEAST_FREEDOM = 4.0  # degrees of freedom: a variance of fewer is too uncertain to be used

# Sizes of effects
ALL_LEFT = 0.8  # of what is left: a term that explains more is believed, however much it would change
AMPLIFIED = 8.0  # times what a term explains: one that would change friction by more is too like it
MATTERS = 0.01  # of friction, alpha_0, a level or a gain: a smaller effect is a note, or none
EXPLAINS = 0.05  # of squares or of a variance: a term or parameter that explains less is not reported
LINE_WIDTH, MOST_WAVES = 0.05, 0.1  # of a line's frequency: its half width; waves an equation: slower is no vibration
MOSTLY = 0.5  # of what a fit leaves: a cause that must be nearly all of it, and explains less, is none
RELATED = 0.1  # of the variance of a torque: its motion explains at least as much
POOR = 0.15  # of the measured torque: a larger pattern in what a fit leaves, and its parameters mean nothing
FACTOR = 1.5  # ratio from which reaches of intervals, errors of fits, residuals of runs or fitted sizes differ
MUCH_WORSE = 2.0  # ratio of residuals of two fits or at reversals (clean: 1.0 to 1.1): the worse is wrong
NEED = 10.0  # percent of friction: the required accuracy by default; an exported model that loses more is reported

# Logs
GAP = 5.0  # median intervals: nothing is interpolated or filtered across a longer one, by default
NOISIER = 5.0  # noise of a logged velocity over that of the slope of its position: it would hide what the motion shows
UNEVEN = 0.05  # of a sampling interval, standard deviation: less of it hides nothing
LONGEST_BRIDGE, BRIDGED, BRIDGED_NOISE = 200, 0.01, 1.5  # samples of a bridged gap, share of motion or noise it is off
SLOWER_FILE, AS_SLOW = 1.2, 1.1  # ratio of intervals, of rows: a file sampled more slowly, signals sampled as slowly
TIME_STEPS, LONGEST_STEP = (1e-5, 1.0), 100.0  # s, and usual steps: the column of a time grows in such steps
MOST_POINTS = 1000  # rows: more, without a time, are a log, and no velocity-torque pairs
TIME_UNITS = {"ms": 1.0, "us": 300.0, "ns": 3e5}  # least step of a time that has no unit: logs are faster than 3 Hz
FULL_TURN, LATEST = 0.1, 0.1  # of a turn: a jump of the position as near to one is a wrap; of a run: a delay is shorter
SHORTEST = 16  # samples of a segment between gaps: fewer cannot be filtered
JUMP = 10.0  # standard deviations of a step: noise of steps goes no further
HELD_READING = 3  # times that a reading repeats, and counts by which it then catches up: a held one, no rest
SAME_FACTOR, KNOWN_FACTOR = 0.05, 0.01  # within which two statements of a count, rate or gear agree; of a known factor
NEAR_COUNTS = 50.0  # counts: steps up to here tell the count; beyond, rounding in the log adds up
POWER_OF_TWO, COARSEST = 5e-5, 256  # counts a turn: in three other units, random ones are so near once in 2000 times
LARGEST_COUNT, ON_GRID = 0.5, 0.1  # rad or m: no encoder has a count so large; of a count: steps on a grid are nearer
MULTIPLES, ROUND_COUNT = 3, 1e-3  # multiples of a count that a constant speed makes; nearness to 1, 2 or 5 times 10**n
PILED, PILED_BESIDE = 4.0, 3  # clipped: the extreme is taken 4 times as often as any of the 3 levels next to it
CLIPPED, MOSTLY_CLIPPED = 0.005, 0.9  # of the samples at a limit: less is chance; with more, too little is left to fit
STAYS, STAYS_NOISE = 3e-3, 0.2  # of a limit, of its noise: friction changes by more while the speed doubles
FEW_CLIPPED, SHORT_LOG = 3, 200  # samples at a limit that are no chance: among points, and in a log of at most so many
NEXT_LEVEL, DISTINCT = 0.05, 0.9  # of a torque's range: a limit and the next value; of points: torques of their own
UNSIGNED, UNSIGNED_TURNS = 200, 4  # samples, and turns, that show that a torque has no sign
UNSIGNED_WAY, UNSIGNED_SLOW = 0.1, 0.1  # of the way, at least, in each direction; of the fastest speed at a turn
UNSIGNED_LOW = 0.2, 0.2  # share of turns; of the median torque of both strokes beside them: next to zero
DEAD_ZONE, DEAD_SAMPLES, DEAD_REST = 5e-4, 4, 0.001  # share at zero; samples, and turns; of the mean speed: rest
STARTS_LOADED, COARSE = 0.02, 64  # of the largest torque: a load at the start of slow loading; steps of a coarse torque
UNRELATED, FACTOR_KNOWN = 0.7, 2.0  # correlation of velocity and position, unless one is noise; ratio of its limits
COUNTED_TIMES, LAG = 1e-3, 1.0  # samples: stamps that deviate less were counted; a velocity that lags less is not late
PLAY, JUMP_TRAVEL = 25, 0.75  # samples about a reversal, where a jump is play; samples' travel: less is no jump
SLIPS = 0.1  # of their mean: jumps of a smaller range are no slips but counts under something that drifts
WHITE = -0.6  # lag-one correlation beside a cubic through neighbours: -0.8 of white noise, positive of a vibration
INERTIA_STANDS = (0.003, 0.25)  # of the inertia, of its standard error: by which a lower cut-off must raise it
OVER_BAND, OVER_BAND_LOADING = 4.0, 10.0  # least cut-off over the bandwidth; of slow loading: breakaway is a corner
OVER_SEEN, OVER_SEEN_HELD = 2.0, 0.5  # least cut-off over the frequency where a signal falls into noise; at held speeds
SHOWN, SHOWN_AGAIN = 4.0, 4.0  # times the noise: below, a spectrum shows nothing; times a frequency: a gap that ends it
BENDS, NO_NOISE = 0.01, 1e-6  # of a motion's power: less bends no friction; of an effort's: less noise is unmeasured
IN_BAND, UNEVEN_STEPS = 0.999, 0.01  # of the power: the bandwidth; of steps: more that differ from most are of counts
PER_BANDWIDTH, PER_CUTOFF = 16.0, 0.7  # equations per second over the bandwidth, and over the cut-off, at the least
BELOW_NYQUIST, LONG_SEGMENT = 0.8, 10.0  # of that frequency: a cut-off lowered to it; its periods, least, beside a rest
STILL, LET_GO = 0.02, 0.1  # of the fastest speed or largest travel: less is rest; of that: a hand may hold the joint
STILL_PERIODS, STILL_SECONDS = 5, 3.0  # periods of a cut-off, s, in which a joint at rest stays: at a slow turn fewer
RESTS, REST_COUNTS = 3, 2.1  # of what the low pass takes to ring out: the shortest rest; counts that it stays within
MOVED_COUNTS = 20  # counts from one rest to the next
JOINT_RESTS = 1e-3  # rad or m: a joint that goes no further rests

# A fit, and the choice of its model
WIDE, VAGUE = 0.5, 0.3  # relative standard errors: a parameter is not identifiable; a presliding curve has fewer knots
HARDLY_SEEN, HARDLY_SHOWN = 1e-2, 1e-3  # of the largest singular value, of a plan's eigenvalue: hardly seen below
MEMBERS = 0.3  # of its largest part: smaller parts of a direction that is hardly seen are not named
ALIKE, DEPENDENT = 50.0, 1e8  # condition number of set-ups whose columns are too similar; of dependent columns
USELESS = 100.0  # percent of friction: the error of no model
BIC_GAIN = 10.0  # very strong evidence (Kass and Raftery 1995), required of another law or of two directions
WORTH = 1.05  # ratio of errors on left-out parts from which a larger model is taken: less may be luck
CLEARLY = 0.75  # ratio of errors below which another set-up is clearly better than the one asked for
LOWER = 0.9  # ratio of residuals below which a term, a delay or a wider low pass is taken
BENT = 4.0  # ratio of costs from which a term that bends the whole curve, or a bristle that motions never pass, is kept
NO_COULOMB = 1e-3  # of the torque: less Coulomb friction is none
OPINIONS_APART = 5.0  # percent of friction: a second opinion that differs by less agrees
SLOWEST_SHOWN = 5  # equations: from the speed of the fifth slowest on, moving runs show the curve
ONE_RUN = 10.0  # ratio of standard errors without a run from which that run alone determines the parameter
LATEST_DELAY = 0.05  # s, of a log; a larger one stands for another term, such as friction that rises with load
BIAS_UNSURE, NAMED_ERRORS = 0.5, 0.1  # standard errors: a bias by counts is corrected; smaller effects are not named
# Of a curve: 93 % of clean ones lie within. Set on one half of the simulated joints of benchmarks/calibration.py
BIASED = 1.5  # times what the errors tell: filters, counts, settling and the choice of a set-up bend a curve too
PATTERN = 0.5  # of a pattern that a fit of a motion leaves: curves behind belts, or of strokes of 20 mrad, are off by half of it to all

# Least numbers
FEW, ENOUGH = 8, 20  # blocks, points, equations, levels, count edges: fewer tell nothing; below the second, not much
SPARE_POINTS = 4  # points beyond the parameters for a comparison by BIC
EQUATIONS_EACH, SAMPLES_EACH = 2, 4  # equations per unknown of a fit, samples per column for a test of a relation
SEVERAL = 5  # points, holds, joints of a type, independent samples: fewer show no order, no drift and no spread
JACKKNIFE_RUNS, VARIANCE_POINTS = 3, 10  # runs for a jackknife: two give one difference; points for a test of variance
PATTERN_EQUATIONS, INDEPENDENT = 300, 30  # equations, and independent ones, whose patterns are judged
UNEVEN_EQUATIONS = 100  # equations from which correlated and uneven noise is estimated along a column
RESOLVED = 5  # samples while a motion passes the bristle's deflection: fewer do not show its stiffness

# Constant velocities
HOLDS, LOADS = 0.79, 0.7  # shares of motion, of loading: with less a run tells more as a tracking run
LOADS_ALONE = 0.9  # share of loading from which a run needs no other runs
CURVE_SPEEDS, SAME_SPEED = 7, 0.1  # velocities of points, two more than a curve has numbers; nearer ones are one
HELD_SPEEDS = 4  # speeds held in all: points of fewer tell hardly more than a level
PLATEAU_BLOCKS = 6  # blocks in a plateau: enough to tell a drift from noise
SHORT_PLATEAU = 0.25  # of the typical plateau: what is shorter in time and in travel is a piece of something else
ONE_SPEED = 1.25  # ratio of fastest to slowest speed below which they count as one: no slope is known
SAME_PLATEAU, EDGE = 0.1, 3  # of the speed, ratio of lengths: a plateau so near, so much shorter, is an edge of another
FINER, FLAT, SETTLED = 1.05, 0.01, 1e-3  # ratio of explained samples that a finer cut needs; of a mean: flat; settled
CUT_DRIFT, CUT_SWING = 0.1, 0.05  # of the mean: a plateau drifts by no more; a smaller swing asks for no finer cut
MOVES, MOVES_SPEED = 5.0, 1e-3  # standard errors or counts, of the fastest speed, from which a mean speed is motion
STANDS, SWING_SAMPLES, SWING_WINDOWS = 0.1, 32, 16  # of a hold's speed: slower stands; of a hold, to show stick-slip
STICKS, SWINGS = 0.05, 0.3  # share of the time at rest, of the mean speed: beyond, a joint sticks and slips
DRIFTS, TRANSIENT, SCATTERS = 0.05, 0.999, 0.25  # of the mean speed: drift; to another speed; scatter without a mean
HUNTS, SATURATED = 0.1, 0.05  # share of the time moving backward, of samples at the largest torque, at the most
POSITION_DIFFERS, TORQUE_DRIFTS = 0.005, 0.1  # of a mean: a difference of the position's speed, and a drift, to report
ONE_STRAY_IN = 8  # points per stray at most, or two strays of few points: more are no exception
TOGETHER = 0.25  # of the largest fall of the cost: of many points, others above it are left out together
STRAYS, NEIGHBOURS = 0.1, 3  # share of strays, and strays in a row, from which they are a feature of the curve
NOT_SLIDING = 0.85  # of alpha_0 of faster points: slow points with less friction do not slide
IN_ORDER, DRIFTED = 0.9, 2.0  # rank correlation of speed and time that confounds them; residuals that a drift exceeds
CORRECTED = 0.2  # standard errors of a point: smaller corrections for settling are not made
ON_THE_WAY = 0.1  # of a hold's speed: the way to the hold counts from so near on
STRAIGHT = 2.0  # of a hold's largest distance from its line: so straight a way before the hold moves as fast

# Moving runs
AT_REST = 0.01  # of the total way: less in a direction is rest
OFTEN = 0.03  # of a direction's motion: speeds, alike to a quarter, at which it is compared with the other's
SWING = 0.1  # rad: over less, gravity cannot be told from a spring and a constant
ONE_RATE = 1.05  # ratio of sampling intervals that counts as one
SLOW_PASSES, SLOW_SHARE = 0.3, 0.5  # of a slow torque: most passes of its mean a cut-off period (noise 1.15), share
ROUGHER = 3.0  # ratio of (1 - lag-one correlation) from which a torque is noise beside its motion
FILTER_WEIGHT = 0.02  # of the weights of an equation: samples with less do not count
SLID = 5.0  # deflections g0 / sigma_0 after a reversal from which a joint slides: exp(-5) is left
FILTERED = 2.0  # periods of the position's cut-off about a reversal or an end: the low pass rounds the motion off there
TURNING, TURNING_BESIDE = 0.1, 2  # of the rms speed: slower equations, and two neighbours each, are at a reversal
INFLATED = 2  # ratio of variances by which correlation of points is reported
CORRELATED = 0.9  # lag-one correlation of residuals that are a pattern: noise is 1 - 0.9**2 at most
BURST, BURST_IN = 0.25, 0.01  # share of squares in so few equations: 0.08 for normal noise, 0.16 for Laplace's
REPEATED = 0.8  # of rows: where more stamps repeat the one before, their column is too coarse to be the time
NEARLY_ALL, NOISE_ADDS = 0.99, 1.1  # share of readings below a saturation, and ratio by which noise exceeds it

# Slow loading
LOADED, SHORTEST_LOADING = 0.2, 0.5  # of a presliding run's time; s: a shorter rise of torque begins a motion
SPRING, SIDED = 0.3, 0.5  # correlation of torque with position: on bristles; with direction: a joint slides
SLIDING, SLIDING_TIME = 0.8, 1 / 3  # of the largest torque: for longer, or within the next, a joint slides
SLIDING_TRAVEL = 0.2  # of the way: LuGre loaded up to 0.999 g0 takes 0.23
GOES_ON, HELD_MORE = 2.0, 1.02  # of the way before: less may be creep; of an onset's torque: held elsewhere, it is none
PIECE_END, SLIDING_END = 0.9, 0.99  # of the largest torque: a piece, a search for sliding, end there: later it falls
SLIDES_FASTER, SLIDES_COUNTS = 5.0, 3.0  # deviations of a speed by counts alone, counts of travel: less is no sliding
CLOSED_COUNTS = 1.5  # counts: ends of a cycle that are no further apart are one, but for rounding
LARGEST_BEND = {"revolute": 0.1, "prismatic": 0.005}  # rad, m: no bristle bends further
PROMINENT, CLOSED = 0.1, 0.1  # of the range of torque: a smaller turn is none; ends of a cycle are no further apart
KNOTS, PER_KNOT = (3, 6), 6  # of a curve: least (two do not tell it from its chords) and most; least points per knot
ONSET = 10.0  # times the speed of the first half of loading: sliding; a tenth below g0 LuGre's creep is as fast
REACH, NEAREST = 0.8, 0.97  # of g0: log(1 - T / g0) amplifies noise of T above; noise above the second is cut off
SOFTER = 0.05  # fall of the stiffness beyond LuGre's: viscous torque and filters cause less
OUTLIER = 0.2  # relative distance from the median breakaway torque

# Robots
BEYOND_LIMIT, SAMPLES_BEYOND = 0.01, 0.0005  # of a limit: rad, m or share of a speed; share of samples: less is noise
PEAK_EFFORT, NO_DRIVE = 1.5, 5.0  # of the URDF's effort: a peak, and more than any drive has
LINK_TORQUE = 0.05  # of a joint's torque: smaller link torques are not reported
LINKS_OFF = 0.1  # errors of the links' scale below are those of URDF masses
ORDER_BETTER = 0.5  # fall of the sum of log(relative error) by which another order of joints is right

# Sessions, fleets and other questions
LEAST_JOINTS = 10  # joints of a type for a shift common to them
BASELINE = 3  # first sessions of a joint, without a change: fewer show no scatter
TESTED_FREEDOM, FEW_FREEDOM = 1.5, 10.0  # degrees of freedom of the scatter over sessions: for a test; for no note
CLEAR = 2.0  # standard errors of a median or a scale: one consistent with zero is not compared, and not used
MANY_INSIDE = 0.8  # of true values that lie inside their 95 % intervals: fewer are explained
ONE_RATIO = 0.5  # of their mean: relative changes of a smaller range are one ratio, as of a torque constant
MIXED, MIXED_HOLDS = 0.25, 0.5  # of a run's motion, of holds with moves between them: more of another kind is reported
FINE_ENOUGH = 0.1  # of the statistical error of v_s: what a fine grid adds, which widens it by 0.5 %
POLISH_MOVES = 1e-3  # standard errors that a polished estimate moves by, at the most, where the grid was right
MOST_FAILED = 0.2  # share of data sets in which a method may fail and still set the scale of a figure
MOST_DECLINED = 0.5  # share of data sets without a finite interval beyond which v_s is not identifiable
UNFIT, UNCHANGED = 50.0, (0.3, 0.02)  # percent of friction that no model leaves; points, and share of it: no change
SLOWEST = 0.5  # of v_s: slower runs than this show the Stribeck term far better
WORSE_LOOP, DIVERGED = 1.1, 10.0  # RMS tracking error: ratio at which two differ; amplitudes of a loop that diverges
CYCLE_SWINGS, CYCLE_COUNTS, CYCLE_BEND = 4, 3.0, 0.02  # limit cycle: swings; width in counts, in bristle deflections
FASTER = 30.0  # largest speed of a reference over the fastest measured: the law is extrapolated so far at most

_DEFAULTS: dict[str, Any] = {name: value for name, value in vars().items() if name.isupper()}
del _DEFAULTS["CONFIDENCE"], _DEFAULTS["NORMAL"]  # all that is printed and drawn says 95 %


@contextmanager
def changed_levels(**to: Any) -> Iterator[None]:
    """Other levels in all that is done meanwhile, in this process and those that it begins; results name them.

    >>> import bristle
    >>> with bristle.changed_levels(BIC_GAIN=6.0):
    ...     results = bristle.identify("wrist.yaml")
    >>> results.joint().settings["levels"]
    'BIC_GAIN 6 (default 10)'

    Names, defaults and units are those of `bristle.estimation.levels`. Raises InputError where a name or a value is of
    no level.
    """
    for name, value in to.items():
        if name not in _DEFAULTS:
            near = get_close_matches(name.upper(), _DEFAULTS, 1) or ["BIC_GAIN"]
            raise InputError(
                f"level: got {short(name)}; expected a name in bristle/estimation/levels.py, such as {near[0]}"
            )
        if not _is_like(value, _DEFAULTS[name]):
            raise InputError(f"level {name}: got {short(value)}; expected a value in the form of {_DEFAULTS[name]}")
    before = {name: globals()[name] for name in to}
    put(to)
    try:
        yield
    finally:
        put(before)


def put(changed: Mapping[str, Any]) -> None:
    """Put these levels in force, as a new process does that another one begins."""
    globals().update(changed)


def changed() -> dict[str, Any]:
    """Levels that are not their defaults."""
    return {name: globals()[name] for name, value in _DEFAULTS.items() if globals()[name] != value}


def told() -> str:
    """Levels that are not their defaults, beside them, in a sentence; empty where all are."""
    return "; ".join(f"{name} {_text(value)} (default {_text(_DEFAULTS[name])})" for name, value in changed().items())


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def _is_like(value: Any, default: Any) -> bool:
    """Whether a value has the form of a default: a number, a count, several of them, or one for each kind."""
    if isinstance(default, Mapping):
        return (
            isinstance(value, Mapping)
            and value.keys() == default.keys()
            and all(_is_like(value[x], default[x]) for x in value)
        )
    if isinstance(default, tuple):
        return isinstance(value, list | tuple) and len(value) == len(default) and all(map(_is_like, value, default))
    number = int if isinstance(default, int) else int | float
    return isinstance(value, number) and not isinstance(value, bool) and isfinite(value)
