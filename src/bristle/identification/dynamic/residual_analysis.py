"""Terms that a moving fit lacks (`score_test`), and unexplained patterns of its residuals."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array
from bristle.control.plant import quantise
from bristle.data.differentiation import derivative, smoothed, usable
from bristle.data.record import Record
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation, lag_one
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import Candidate, Fitted, Score, explained, scores
from bristle.findings import CAUTION, Finding, unit_of
from bristle.identification.candidates import candidates
from bristle.identification.dynamic.claims import BRISTLE, jacobian_and_residuals
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    Motion,
    Unknown,
    Values,
    friction_and_load,
    modelled,
    sets_of,
)
from bristle.identification.moving_runs import load_columns
from bristle.model.parameters import INERTIA, Kind, ParameterName, of_friction, peak_parameters, unit

_LEAST = 1e-100  # of sigma_0: no division by zero
_WIDTHS = (0.005, 0.01, 0.015, 0.02, 0.03, 0.05, 0.1)  # of the largest speed, to pass the backlash
_ZONES = tuple(np.geomspace(0.01, 0.5, 9).tolist())  # of the largest torque: half the width of a dead zone
_TOPS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the largest torque: where a sensor or drive saturates
_BEFORE = (-1.0, -0.5, 0.0, 0.25, 0.5, 0.75, 1.0)  # of the inertia: before what twists; below 0: friction is there, too
_SMALL = 1e-5  # of the way: a shift of the position with a proportional torque
_RUNS = 64  # most runs that are asked whether their friction differs
_PHASE = 0.37  # of a count: the rest position of a simulated counting


class ResidualAnalysis(NamedTuple):
    """Analysis of a fit's residuals."""

    findings: list[Finding]
    errors: Array  # Scaled standard errors, (p,), with the effect of what was found; of bristle and peak widened by reversals
    friction: float = np.nan  # Of the model, rms, N*m
    late: tuple[float, float] = (0.0, np.inf)  # Delay of the logged torque and its standard error, s


def analyse_residuals(problem: DynamicProblem, solution: MultistartSolution[Unknown], kind: Kind) -> ResidualAnalysis:
    """Terms that a fit of the torque lacks, to first order, and patterns that remain."""
    errors = solution.scaled_errors.copy()
    motions = problem.motions
    values: Values = {**problem.fixed, **solution.values}
    extra = np.array([values[name] for name in problem.extra_names])
    torque = modelled(problem, solution.values)
    friction = [T - (m.measured - m.torque) - m.extra @ extra for T, m in zip(torque, motions, strict=True)]
    seen = solution.scaled_errors < np.inf
    of = [isinstance(n, ParameterName) and of_friction(n.name) for n in solution.names]
    size = float(np.sqrt(np.mean(_equations(motions, friction) ** 2)))
    known, rest, private = jacobian_and_residuals(problem, solution)
    weight = problem.weight
    fit = Fitted(
        known, rest, solution.scaled_errors[seen], np.array(of, dtype=bool)[seen], size, weight, off=private.off
    )

    # candidates of any fit, then those of motions
    names = [*(name.name for name in problem.extra_names), *problem.given]
    every = candidates(problem.velocity, problem.time, problem.position, names, kind, len(problem.directions))

    def ask(tell: Callable[[Score, int], Finding | None], *columns: Sequence[Array], **how: bool) -> None:
        """Add a candidate with alternatives, each a column per motion, or several, (N, k)."""
        alternatives = [_equations(motions, x).reshape(problem.size, -1) for x in columns]
        every.append(Candidate(tell, alternatives, **how))

    lag = [-np.gradient(T, m.time) for T, m in zip(torque, motions, strict=True)]
    late, made = _equations(motions, lag), weight**2 * _made_by_counts(problem, solution)
    ask(partial(_delay, problem, solution, fit, late, made), lag, is_tried=True)
    ask(
        partial(_drift, size),
        [T * ((m.time - m.time[0]) / np.ptp(m.time) - 0.5) for T, m in zip(torque, motions, strict=True)],
        is_friction=True,
    )
    files = list(dict.fromkeys(m.file for m in motions))
    if len(files) > 1:  # against the others, of which the level takes up the mean
        ask(
            lambda found, which: run_differs(files[which], float(found.sizes[0]), found.share),
            *([T * (m.file == file) for T, m in zip(friction, motions, strict=True)] for file in files[:_RUNS]),
            is_friction=True,
        )
    weighs = [k for k, name in enumerate(names[: extra.size]) if name.startswith("gravity")]
    if weighs and all(m.load is None for m in motions):  # only if friction does not rise with load in the model
        load = [np.abs(m.extra[:, weighs] @ extra[weighs]) * np.sign(m.velocity) for m in motions]
        ask(partial(_by_load, problem.law.name), load, is_friction=True)
    if INERTIA not in problem.names and INERTIA.name not in problem.given:
        ask(partial(_inertia, kind), _accelerates(motions, 1.0))
    if problem.position_logged:
        shifted = partial(_shifted, problem, solution.values, torque)
        ways = ([-np.tanh(m.velocity / (width * problem.fastest)) for m in motions] for width in _WIDTHS)
        ask(_backlash, *([rubs + inert for rubs, inert in shifted(way)] for way in ways))
        ask(
            _flexible,
            *_twisted(shifted(torque), shifted(_accelerates(motions, values.get(INERTIA, 0.0)))),
            is_tried=True,
        )
    if (largest := max(float(np.abs(T).max()) for T in torque)) > 0:
        ask(partial(_dead_zone, largest), *([np.clip(T / (x * largest), -1, 1) for T in torque] for x in _ZONES))
        read = float(np.quantile(np.abs(np.concatenate([m.measured for m in motions])), levels.NEARLY_ALL))
        above = ([T - np.clip(T, -x * largest, x * largest) for T in torque] for x in _TOPS)
        ask(partial(_saturates, read, largest), *above)
        ask(partial(_bends, largest), [T * (T / largest) ** 2 for T in torque])
    lacks = explained(fit, every)
    patterns = pattern_left(problem, lacks.left)
    errors[seen] = lacks.errors
    worse = next((float(f.numbers["ratio"]) for f in patterns if f.code == "reversals-left"), 1.0)
    slow = (*BRISTLE, *peak_parameters(problem.law))
    errors[[isinstance(n, ParameterName) and n.name in slow for n in solution.names]] *= worse
    late_by = _without_counts(scores(known, rest, [private.off((weight * late)[:, None])])[0], made)
    return ResidualAnalysis([*lacks.findings, *patterns], errors, size, late_by)


def columns_of(problem: DynamicProblem, regressors: Sequence[str]) -> Array:
    """Weighted columns of some regressors, (n, k)."""
    rows = []
    for m in problem.motions:
        signals = {"position": m.position, "velocity": m.velocity}
        columns = load_columns(regressors, signals.__getitem__, m.time.size)
        rows.append(m.weighted(np.stack(list(columns.values()), axis=1)))
    return np.concatenate(rows)


def _delay(
    problem: DynamicProblem,
    solution: MultistartSolution[Unknown],
    fit: Fitted,
    column: Array,
    made: Array,
    found: Score,
    _: int,
) -> Finding | None:
    """Delay of the torque, or presliding if only reversals ask for it; `made` is due to counts, (n,)."""
    far = _far_from_reversals(problem, solution)
    (apart,) = scores(fit.known[far], fit.rest[far], [(fit.weight * column)[far, None]])
    (whole, error), (beyond, its_error) = _without_counts(found, made), _without_counts(apart, made[far])
    alike = beyond * whole > 0 and abs(beyond) > levels.NOISE * its_error
    if abs(whole) < levels.DEVIATIONS * error or (not alike and levels.DEVIATIONS * its_error < abs(whole)):
        return None  # sliding excludes a delay
    step = float(np.median(np.concatenate([m.step for m in problem.motions])))
    delay = beyond if alike else whole
    strokes = (np.ptp(m.time) / (1 + np.count_nonzero(np.diff(np.sign(m.velocity)))) for m in problem.motions)
    if abs(delay) > max(strokes):
        return None  # no delay is longer than a stroke
    when, samples = "earlier" if delay > 0 else "later", abs(delay) / step
    numbers = {"seconds": abs(delay), "samples": samples, "when": when, "delay": delay}
    if not alike:
        message = (
            f"At reversals the torque looks {abs(delay):.2g} s ({samples:.2g} samples) {'late' if delay > 0 else 'early'}: a delay, or presliding "
            f"that these data do not tell from one. If clocks differ, write `delay: {delay:.2g} s` for the torque's signal; else move over longer "
            "strokes."
        )
        return Finding("delay-or-presliding", CAUTION, message, numbers)
    taken = f"taken {abs(delay):.2g} s ({samples:.2g} samples) {when}"
    message = (
        f"The torque fits better when {taken}, which would explain {100 * apart.share:.0f} % of the residuals far from reversals: check the "
        f"time stamps, or add {delay:.2g} s to the delay of its signal and fit again (a voltage held until the next sample is half a "
        "sample early: its delay is negative)."
    )
    return Finding("torque-delayed", CAUTION, message, {**numbers, "share": apart.share})


def _without_counts(found: Score, made: Array) -> tuple[float, float]:
    """Delay less the part due to counts (n,), half of which is its error; both s."""
    delay, error = float(found.sizes[0]), float(found.errors[0])
    if not (made.any() and np.isfinite(error) and delay):
        return delay, error
    counts = float(made.sum()) * delay**2 / found.squares
    return delay - counts, float(np.hypot(error, counts / 2))


def _drift(friction: float, found: Score, _: int) -> Finding:
    by = float(found.sizes[0])
    how, why = (
        ("grows", "wears, cools down or is loaded more")
        if by > 0
        else ("falls", "wears in, warms up or is loaded less")
    )
    message = (
        f"The torque {how} by {100 * abs(by):.0f} % in the course of a run, all else alike, which would explain {100 * found.share:.0f} % of "
        f"what the fit leaves: the joint {why}, or its sensor drifts. Numbers are of the middle of the run; let it settle first, or fit its "
        "parts apart."
    )
    numbers = {"how": how, "by": abs(by), "share": found.share}
    return Finding("torque-drifts-in-runs", CAUTION, message, numbers, {"torque": abs(by) * friction})


def run_differs(file: str, by: float, share: float, effect: float | None = None) -> Finding:
    """That friction in a run is by a share higher than in others or, where its `effect` is given, N*m, than fitted: it is held out."""
    than, what = ("in the other runs", "the fit leaves") if effect is None else ("fitted", "is left of it")
    message = (
        f"Friction in {file}{', which is held out,' * (effect is not None)} is {100 * abs(by):.2g} % {'higher' if by > 0 else 'lower'} than "
        f"{than}, which explains {100 * share:.0f} % of what {what}: temperature, load or wear differ. Fit runs of each state apart."
    )
    numbers = {"file": file, "by": by, "share": share}
    return Finding("run-differs", CAUTION, message, numbers, {} if effect is None else {"torque": effect})


def held_out_differs(file: str, problem: DynamicProblem, values: Values, rest: Array) -> Finding | None:
    """Whether a factor on friction explains most of what a run that is held out leaves, (n,)."""
    friction, _ = friction_and_load(problem, values)
    by = float(friction @ rest) / max(float(friction @ friction), 1e-300)
    share = by**2 * float(friction @ friction) / max(float(rest @ rest), 1e-300)
    if share < levels.MOSTLY or abs(by) < levels.MATTERS:
        return None
    return run_differs(file, by, share, abs(by) * float(np.sqrt(np.mean(friction**2))))


def _by_load(law: str, found: Score, _: int) -> Finding:
    by, error = float(found.sizes[0]), float(found.errors[0])
    message = (
        f"Friction changes with the load, by {by:.2g} +/- {error:.1g} of the gravity torque, which would explain {100 * found.share:.0f} % of "
        f"what the fit leaves, as in a gear: the model has none of it. Under fit, write `law: {law}+link-load`, or gear-load in its place; "
        "else numbers are of the load on average."
    )
    return Finding("friction-by-load", CAUTION, message, {"by": by, "error": error, "share": found.share, "law": law})


def _shifted(
    problem: DynamicProblem, values: Values, torque: Sequence[Array], behind: Sequence[Array]
) -> list[tuple[Array, Array]]:
    """Change of the torque where what rubs, and where the inertia, is behind the logged position by so much, rad, (N,) of each motion."""
    way, size = (max(float(np.ptp(x)) for x in each) for each in ([m.position for m in problem.motions], behind))
    small, motions, inert = _SMALL * way / max(size, 1e-300), list[Motion](), list[Array]()
    inertia = values.get(INERTIA, 0.0) if INERTIA in problem.extra_names else 0.0
    for m, by in zip(problem.motions, behind, strict=True):
        record = Record(file=m.file, time=m.time)
        off = smoothed(record, by, usable(record, problem.cutoff))
        motions.append(replace(m, velocity=m.velocity + small * derivative(record, off, 1)))
        inert.append(inertia * derivative(record, off, 2))
    moved = modelled(replace(problem, motions=tuple(motions)), values)
    return [((x - T) / small, of_inertia) for x, T, of_inertia in zip(moved, torque, inert, strict=True)]


def _accelerates(motions: Sequence[Motion], inertia: float) -> list[Array]:
    """The torque that accelerates an inertia, (N,) of each motion."""
    return [inertia * np.gradient(m.velocity, m.time) for m in motions]


def _twisted(
    by_torque: Sequence[tuple[Array, Array]], by_inertia: Sequence[tuple[Array, Array]]
) -> Iterator[list[Array]]:
    """Columns of a drive that twists by its torque less what accelerates a share of the inertia before that, for each of the shares."""
    for share in _BEFORE:
        yield [
            share * a - T + (1 - share) * (share * of_a - of_T)
            for (T, of_T), (a, of_a) in zip(by_torque, by_inertia, strict=True)
        ]


def _backlash(found: Score, _: int) -> Finding:
    twice = 2 * float(found.sizes[0])
    message = (
        f"At each reversal the position runs {'ahead' if twice > 0 else 'behind'} by {abs(twice):.2g}{unit_of('position')}, which would explain "
        f"{100 * found.share:.0f} % of what the fit leaves: backlash between the encoder and what rubs, or a rest at the reversal that the low "
        "pass smooths. Bristle and inertia take part of it up; log the position where it rubs."
    )
    return Finding("backlash", CAUTION, message, {"play": abs(twice), "share": found.share})


def _flexible(found: Score, which: int) -> Finding | None:
    """A drive that twists by compliance times the torque behind the inertia before it.

    Friction before it, a share f of all, is as a compliance of (1 - f)**2 as much, and (b - f) / (1 - f) for a share b of
    the inertia, while both sides turn together; where they do not, it looks ahead by friction alone, which a torque that is
    filtered does not.
    """
    compliance, error = float(found.sizes[0]), float(found.errors[0])
    where, sides = ("behind", "") if compliance > 0 else ("ahead of", ", with friction on both sides,")
    message = (
        f"What rubs is {where} the position by {abs(compliance):.2g} +/- {error:.1g}{unit_of('position')} per{unit_of('torque')}, which would "
        f"explain {100 * found.share:.0f} % of what the fit leaves: a belt, shaft or coupling between them twists{sides} or has backlash. "
        "Bristle and peak take part of it up; log the position where it rubs."
    )
    numbers = {"compliance": compliance, "error": error, "share": found.share, "before": _BEFORE[which]}
    told = compliance > 0 or (compliance < 0 and _BEFORE[which] == max(_BEFORE))
    return Finding("flexible-drive", CAUTION, message, numbers) if told else None


def _dead_zone(largest: float, found: Score, which: int) -> Finding | None:
    """A torque that misses a constant above it, and everything below."""
    missing = -float(found.sizes[0])
    message = (
        f"The torque reads hardly anything below {missing:.2g}{unit_of('torque')}, and as much too little above, which would explain "
        f"{100 * found.share:.0f} % of what the fit leaves: its sensor or drive has a dead zone. What is cut off is missing from alpha_0, and "
        "reversals look softer; switch it off, or add it to the torque."
    )
    said = Finding("torque-missing", CAUTION, message, {"torque": missing, "share": found.share}, {"torque": missing})
    return said if 1 / levels.FACTOR < missing / (_ZONES[which] * largest) < levels.FACTOR else None


def _saturates(read: float, largest: float, found: Score, which: int) -> Finding | None:
    """A torque that reads hardly more than some size; nearly all readings are below `read`."""
    top, missed = _TOPS[which] * largest, -float(found.sizes[0])
    left = top + (1 - 1 / levels.FACTOR) * (largest - top)
    message = (
        f"The torque reads hardly more than {top:.2g}{unit_of('torque')} where it is larger, which would explain {100 * found.share:.0f} % of "
        "what the fit leaves: its sensor or drive saturates. Move slower or more gently, or widen the range."
    )
    said = Finding("torque-saturates", CAUTION, message, {"torque": top, "share": found.share})
    return said if 1 / levels.FACTOR < missed < levels.FACTOR and read < levels.NOISE_ADDS * left else None


def _bends(largest: float, found: Score, _: int) -> Finding | None:
    """A torque whose reading is off by its cube, from saturation that sets in softly."""
    by = float(found.sizes[0])
    less, why = (
        ("less", "sensor or drive") if by < 0 else ("more", "motor, whose torque constant falls at large currents,")
    )
    message = (
        f"The torque reads ever {less} than it is the larger it is, by {100 * abs(by):.0f} % at {largest:.2g}{unit_of('torque')}, which would "
        f"explain {100 * found.share:.0f} % of what the fit leaves: its {why} saturates. Move slower or more gently, or take that off."
    )
    said = Finding("torque-saturates", CAUTION, message, {"torque": largest, "by": by, "share": found.share})
    # no reading changes its sign, and beside a law that saturates nothing else explains much
    return said if abs(by) < 1 and found.share > levels.MOSTLY else None


def _inertia(kind: Kind, found: Score, _: int) -> Finding:
    more, error, of = float(found.sizes[0]), float(found.errors[0]), unit(INERTIA.name, kind)
    message = (
        f"The given inertia and the torque do not fit together: with {more:+.3g} +/- {error:.2g} {of} added the moving runs fit better. One of "
        "them is wrong, or the torque constant, gear or scale that makes the torque; omit inertia to have it fitted as the torque has it."
    )
    return Finding("inertia-doubted", CAUTION, message, {"more": more, "error": error, "unit": of})


def pattern_left(problem: DynamicProblem, rows: Array) -> list[Finding]:
    """A finding on weighted residuals, (n,), that are a pattern, large at reversals, or concentrated in few equations."""
    correlation = lag_one(rows)
    if correlation > levels.CORRELATED:
        message = (
            f"What the fit leaves is a pattern and hardly any noise (correlation of neighbours {correlation:.2f}): the model lacks a "
            "term, and numbers may be further off than their errors say. Look at the residuals; friction that depends on load, "
            "position or temperature leaves such patterns."
        )
        return [Finding("lacks-unknown-term", CAUTION, message, {"lag_one": correlation})]
    squares, turns = rows**2, problem.turns
    total, few = float(squares.sum()), round(levels.BURST_IN * rows.size)
    if rows.size < levels.PATTERN_EQUATIONS or not total > 0 or rows.size < levels.INDEPENDENT * inflation(rows):
        return []
    if min(turns.sum(), (~turns).sum()) >= levels.ENOUGH:
        ratio = float(np.sqrt(squares[turns].mean() / max(squares[~turns].mean(), 1e-300)))
        if ratio > levels.MUCH_WORSE:
            message = (
                f"About reversals the fit leaves {ratio:.2g} times what it leaves elsewhere (rms): it does not describe how the joint "
                "turns, and numbers of the bristle, the peak and the inertia may be further off than their errors say. Backlash, a "
                "flexible coupling, a slipping encoder, and a torque that is late or filtered look like that; LuGre has none of them."
            )
            return [Finding("reversals-left", CAUTION, message, {"ratio": ratio})]
    worst = np.argsort(-squares)[:few]
    share = float(squares[worst].sum()) / total
    if share < levels.BURST:
        return []
    where = f"{problem.file[worst[0]]} at {problem.time[worst[0]]:.5g} s"
    message = (
        f"{100 * levels.BURST_IN:.0f} % of the equations hold {100 * share:.0f} % of what the fit leaves, most at {where}: that is not noise, "
        "and bends numbers further than their errors say. Look at the log there: an impact, lost samples, a reading not refreshed."
    )
    return [Finding("bursts", CAUTION, message, {"share": share, "few": levels.BURST_IN, "where": where})]


def _made_by_counts(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> Array:
    """Delay that counts add to each equation, (n,), times squares: -J alpha_2 a**2 by noise a of the acceleration."""
    inertia = solution.values.get(INERTIA, problem.fixed.get(INERTIA, 0.0))
    if not (problem.count and problem.cutoff and inertia):
        return np.zeros(problem.size)
    noises = []  # acceleration due to counts at another rest position, rad/s**2
    for m in problem.motions:
        record, noise = Record(file=m.file, time=m.time), np.zeros(m.time.size)
        if m.position.size:
            cutoff = usable(record, problem.cutoff)
            path = smoothed(record, m.position, cutoff) + _PHASE * problem.count
            off = np.asarray(quantise(path, problem.count)).ravel() - path
            noise = derivative(record, smoothed(record, off, cutoff), 2)
        noises.append(noise)
    sets = sets_of(problem, solution.values).values()
    return -inertia * (sum(p.alpha_2 for p in sets) / len(sets)) * _equations(problem.motions, noises) ** 2


def _equations(motions: Sequence[Motion], columns: Sequence[Array]) -> Array:
    """A column per motion, (N,) or (N, k) each, as unweighted equations, (n,) or (n, k)."""
    return np.concatenate([m.smoothed(c) for m, c in zip(motions, columns, strict=True)])


def _far_from_reversals(problem: DynamicProblem, solution: MultistartSolution[Unknown]) -> NDArray[np.bool_]:
    """Equations that see sliding samples alone, (n,)."""
    sets = sets_of(problem, solution.values).values()
    reach = levels.SLID * max((p.alpha_0 + p.alpha_1) / max(p.sigma_0, _LEAST) for p in sets)
    filtered = levels.FILTERED / problem.cutoff if problem.cutoff else 0.0
    far = []
    for m in problem.motions:
        # samples close to a reversal or to the start, in way or time
        v, t = m.velocity, m.time
        way = np.concatenate([[0.0], np.cumsum(np.abs(v[1:] + v[:-1]) / 2 * m.step)])
        turns = np.append(np.insert(np.flatnonzero(np.diff(np.sign(v))) + 1, 0, 0), t.size)
        interval = np.searchsorted(turns, np.arange(t.size), side="right") - 1
        before, after = turns[interval], turns[interval + 1]
        until = np.where(after < t.size, t[np.minimum(after, t.size - 1)] - t, np.inf)
        near = ((way - way[before] < reach) | (t - t[before] < filtered) | (until < filtered)).astype(float)
        far.append((near if m.smooth is None else abs(m.smooth) @ near) < levels.FILTER_WEIGHT)
    return np.concatenate(far)
