"""Sobol indices by SALib: shares of an output's variance by each parameter alone, and with all others.

The parameters are drawn independently from a box by Saltelli's sampling: samples * (parameters + 2) evaluations.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.control.closed_loop import simulate
from bristle.control.control_period import LoopOptions
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate
from bristle.model import functions, parameters
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import Direction, Kind, Lugre, Pair, ParameterName
from bristle.model.periodic import rms_torque
from bristle.model.vectorize import evaluate
from bristle.progress import Progress, teller
from bristle.simulation.joint_loop import JointLoop

if TYPE_CHECKING:
    import pandas as pd

Box = Mapping[ParameterName, tuple[float, float]]  # intervals: `alpha_0` of both directions at once, `alpha_0+` of one
_Quantity = Literal["torque", "position"]
PERIODS, COUNTED = 2, 1  # of the reference in a closed loop, and the last of them that count: settled to 1 %
_TICKS = 9_000_000  # most control periods of all closed loops together: about half a minute
LEAST = 32  # least number of samples
_LONGEST, _COARSE = 300_000, 0.02  # most control periods of a loop, and longest of them over the reference's period
_BATCH, _ROWS = 128, 1024  # closed loops, and joints of the other outputs, between two calls of the progress


class Span(NamedTuple):
    """The interval from which one parameter is drawn."""

    parameter: ParameterName
    low: float
    high: float
    logarithmic: bool  # log-uniform, where the interval spans more than a decade; else uniform

    def at(self, share: Array) -> Array:
        """The values at shares 0 to 1 of the way from low to high."""
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


class Effect(NamedTuple):
    """Indices of one parameter, shares of the output's variance, each with the half-width of its 95 % interval."""

    parameter: ParameterName
    first: float  # alone
    first_half: float
    total: float  # with all interactions
    total_half: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """One output of a joint, and its indices."""

    name: str
    quantity: _Quantity  # of its unit
    effects: tuple[Effect, ...] = ()  # in the order of the box; empty where there are no indices
    mean: float = nan
    deviation: float = nan  # standard deviation over the box
    samples: int = 0
    evaluations: int = 0  # samples * (parameters + 2)
    reason: Finding | None = None  # why there are no indices

    def called(self, kind: Kind) -> str:
        """Its name, with `force` for joints that slide."""
        return self.name.replace("torque", parameters.effort(kind))

    def heading(self, kind: Kind) -> str:
        """Its name with a capital."""
        return f"{self.called(kind)[0].upper()}{self.called(kind)[1:]}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Global:
    """Global sensitivity of one joint, SIMULATED."""

    spans: tuple[Span, ...]
    outputs: tuple[Output, ...]  # RMS friction torque, breakaway torque, RMS error of the compensated loop
    amplitude: float  # of the reference, a sine, rad
    frequency: float  # Hz
    seed: int

    def to_frame(self, kind: Kind) -> "pd.DataFrame":
        """One row per output and parameter: interval, both indices with half-widths of their intervals, samples."""
        import pandas as pd

        rows = [
            {
                "output": output.called(kind), "parameter": str(drawn.parameter), "lower": drawn.low, "upper": drawn.high,
                "unit": parameters.unit(drawn.parameter.name, kind), "drawn": "log-uniform" if drawn.logarithmic else "uniform",
                "first": effect.first, "first_half": effect.first_half, "total": effect.total, "total_half": effect.total_half,
                "samples": output.samples, "evaluations": output.evaluations,
            }
            for output in self.outputs if output.effects
            for drawn, effect in zip(self.spans, output.effects, strict=True)
        ]  # fmt: skip  # a table
        return pd.DataFrame(rows)


def saltelli(spans: Sequence[Span], samples: int, seed: int) -> Array:
    """Saltelli's sample of the box, (samples * (p + 2), p); samples: a power of two."""
    shares = _salib().sample.sobol.sample(_problem(spans), samples, calc_second_order=False, seed=seed)
    return np.column_stack([span.at(share) for span, share in zip(spans, shares.T, strict=True)])


def analysed(name: str, quantity: _Quantity, spans: Sequence[Span], values: Array | Finding, seed: int) -> Output:
    """An output, from its values at the points of `saltelli`, (samples * (p + 2),), or from why there are none."""
    if isinstance(values, Finding):
        return Output(name=name, quantity=quantity, reason=values)
    if not np.ptp(values) > 1e-12 * np.abs(values).max():
        flat = Finding("nothing-changes-it", NOTE, "None of the parameters drawn changes it.")
        return Output(name=name, quantity=quantity, reason=flat)
    by_kind = _salib().analyze.sobol.analyze(
        _problem(spans), values, calc_second_order=False, num_resamples=200, conf_level=levels.CONFIDENCE, seed=seed + 1
    )  # SALib takes a seed of zero for none
    columns = (by_kind[kind].tolist() for kind in ("S1", "S1_conf", "ST", "ST_conf"))
    return Output(
        name=name, quantity=quantity, mean=float(values.mean()), deviation=float(values.std()),
        effects=tuple(Effect(span.parameter, *row) for span, *row in zip(spans, *columns, strict=True)),
        samples=values.size // (len(spans) + 2), evaluations=values.size,
    )  # fmt: skip  # a list of values


def _problem(spans: Sequence[Span]) -> dict[str, Any]:
    """SALib's description of the unit cube."""
    names = [str(span.parameter) for span in spans]
    return {"num_vars": len(spans), "names": names, "bounds": [[0.0, 1.0] for _ in spans]}


def _salib() -> Any:
    """SALib. Raises InputError where it is not installed."""
    try:
        import SALib
        import SALib.analyze.sobol
        import SALib.sample.sobol
    except ImportError as error:
        raise InputError(
            "Sobol indices need SALib, which is not installed; install it with pip install 'bristle[sensitivity]'"
        ) from error
    return SALib


def global_sensitivity(
    p: Pair[float] | Lugre[float],
    box: Box,
    subject: JointLoop,
    *,
    samples: int = 1024,
    seed: int = 0,
    progress: Progress | None = None,
) -> Global:
    """Sobol indices of three outputs of a joint along the subject's reference, amplitude sin(2 pi frequency t).

    The outputs: RMS of T_f over a period of steady motion; breakaway torque alpha_0 + alpha_1, mean of both directions;
    RMS position error of the loop whose compensator has the model p while the plant is drawn, over the last of
    `PERIODS` periods from rest, with fewer samples. `box`: as of `box_of`; parameters that are not in it stay as in p.
    Raises InputError where SALib is not installed.
    """
    pair = Pair(p, p) if isinstance(p, Lugre) else p
    spans = ordered(box, pair.law)
    points = saltelli(spans, samples, seed)
    loop_points = saltelli(spans, min(samples, _affordable(len(spans), _ticks(subject))), seed)
    tell = teller(progress, -(-len(points) // _ROWS) - (-len(loop_points) // _BATCH))

    def torque(batch: Array) -> Array:
        """RMS of T_f, N*m."""
        tell("Sobol: friction torque")
        return rms_torque(joints_at(pair, spans, batch), subject.amplitude, subject.frequency)

    def error(batch: Array) -> Array:
        """RMS position error of loops with these plants and the model p, rad."""
        tell("Sobol: compensated loops")
        sets = [
            map(parameters.lugre_of(pair.law)._make, np.column_stack(p).tolist()) for p in joints_at(pair, spans, batch)
        ]
        cases = [subject.case(plant=Pair(*both), model=pair) for both in zip(*sets, strict=True)]
        course = subject.sine(subject.frequency, PERIODS / subject.frequency)
        run = simulate(LoopOptions(compensator=subject.compensator), cases, course, subject.period)
        return run.rms_error((PERIODS - COUNTED) / subject.frequency)

    def tracking() -> Array | Finding:
        """The loops' errors, or why there are none."""
        how = f"the reference is at {subject.frequency:g} Hz, the control period {subject.period:g} s"
        try:
            if subject.frequency * subject.period > _COARSE:
                raise InputError(f"{how}, more than {_COARSE:g} of the reference's period")
            if _ticks(subject) > _LONGEST:
                raise InputError(
                    f"{how}: one loop would take {_ticks(subject)} periods; at most {_LONGEST} are simulated"
                )
            errors = _batched(error, loop_points, _BATCH)
        except InputError as refused:
            return Finding("plants-refused", CAUTION, f"No indices of the loop's error: {refused}.")
        diverged, drawn = int(np.count_nonzero(~(errors < levels.DIVERGED * subject.amplitude))), errors.size
        message = f"The loop diverges with {diverged} of the {drawn} plants drawn; narrow the box, or lower the gains."
        lost = Finding("loop-diverges", CAUTION, message, {"diverged": diverged, "drawn": drawn})
        return lost if diverged else errors

    # g(0) = alpha_0 + alpha_1, the limit of (9) for v -> 0, N*m; mean of both directions.
    drawn = joints_at(pair, spans, points)
    steady = [evaluate(functions.steady_torque_function(p.law), 1e-200, *p.stribeck)[0] for p in drawn]
    breakaways = np.asarray(np.mean(steady, axis=0))
    outputs = (
        analysed("RMS friction torque", "torque", spans, _batched(torque, points, _ROWS), seed),
        analysed("breakaway torque", "torque", spans, breakaways, seed),
        analysed("RMS error of the simulated loop", "position", spans, tracking(), seed),
    )
    return Global(spans=spans, outputs=outputs, amplitude=subject.amplitude, frequency=subject.frequency, seed=seed)


def _ticks(subject: JointLoop) -> int:
    """Control periods of one loop."""
    return max(round(PERIODS / (subject.frequency * subject.period)), 1)


def _affordable(parameters: int, ticks: int) -> int:
    """The largest power of two of samples whose loops together take at most `_TICKS` control periods."""
    most: int = max(_TICKS // ((parameters + 2) * ticks), LEAST)
    return 1 << (most.bit_length() - 1)


def _batched(function: Callable[[Array], Array], points: Array, size: int) -> Array:
    return np.concatenate([function(points[first : first + size]) for first in range(0, len(points), size)])


def ordered(box: Box, law: Law) -> tuple[Span, ...]:
    """The intervals in the order of the law's parameters, on which the samples depend."""
    directions = (Direction.BOTH, Direction.POSITIVE, Direction.NEGATIVE)
    known = [ParameterName(name, d) for name in parameters.estimated_of(law) for d in directions]
    ends = [(name, *box[name]) for name in known if name in box]
    return tuple(Span(name, low, high, low > 0 and high > 10 * low) for name, low, high in ends)


def joints_at(pair: Pair[float], spans: Sequence[Span], points: Array) -> Pair[Array]:
    """The joint at each point, each parameter (n,); points (n, p), one column per span."""
    drawn = {span.parameter: column for span, column in zip(spans, points.T, strict=True)}
    sets = []
    for d, p in zip("+-", pair, strict=True):
        own = ((value, parameters.in_direction(drawn, name, d)) for name, value in p._asdict().items())
        sets.append(
            parameters.lugre_of(pair.law)(*(np.full(len(points), value) if x is None else x for value, x in own))
        )
    return Pair(*sets)


def box_of(estimates: Mapping[ParameterName, Estimate]) -> tuple[Box, tuple[Finding, ...]]:
    """The 95 % intervals of the friction parameters; a finding on each that is not finite, or is cut at a bound."""
    box, notes = dict[ParameterName, tuple[float, float]](), []
    for name, e in estimates.items():
        bare, least = name.name, parameters.least_of(name.name)
        if not parameters.of_friction(bare) or bare == FASTEST or e.value is None:
            continue
        if e.interval is None or not np.isfinite(e.interval).all() or not max(e.interval[0], least) < e.interval[1]:
            message = f"{name}: no finite 95 % interval; it is held at {e.value:.3g} {e.unit}."
            notes.append(Finding("box-held", CAUTION, message, {"name": name, "value": e.value}))
            continue
        low, high = e.interval
        if not parameters.is_possible(bare, low):
            low = 0.01 * min(e.value, high) if parameters.is_positive(bare) else least
            cut = f"{name}: its interval includes impossible values; it is drawn from {low:.3g} {e.unit} up (assumed)."
            notes.append(Finding("box-cut", CAUTION, cut, {"name": name, "low": low}))
        box[name] = (low, high)
    return box, tuple(notes)
