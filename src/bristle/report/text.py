"""The fit report as plain text, in the manner people know from lmfit."""

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bristle.identification.estimate import Crosscheck, Estimate, Joint, StaticFit
from bristle.report.wording import percent, printable

_CORRELATED = 0.5
"""Correlations below this are not printed."""


def fit_report(joints: Sequence[Joint]) -> str:
    """Per joint and direction: outcome, statistics, parameters with errors and 95 % intervals, correlations, doubts, cross-check."""
    return "\n".join(line for joint in joints for line in _joint(joint)) + "\n"


def _joint(joint: Joint) -> Iterator[str]:
    yield f"[[{printable(joint.name)}]] {joint.kind}{', SIMULATED data' if joint.simulated else ''}"
    yield from _sentences("doubt", joint.doubts)
    for direction, fit in joint.static.items():
        yield from _fit(direction, fit)
        if direction in joint.crosscheck:
            yield from _check(joint.crosscheck[direction])
    for direction, check in joint.crosscheck.items():
        if direction not in joint.static:
            yield from _check(check)


def _fit(direction: str, fit: StaticFit) -> Iterator[str]:
    points = f"{fit.n} points, {fit.dof} degrees of freedom"
    yield f"  [[{direction}]] {fit.outcome.value}"
    yield f"    {'data':<15}= {points}"
    yield f"    {'rms residual':<15}= {_number(fit.rms)} {_torque_unit(fit)}".rstrip()
    yield f"    {'relative error':<15}= {_number(fit.relative_error)} %"
    for held in fit.hold_out:
        yield f"    {'hold-out':<15}= {_number(held.relative_error)} % on {printable(held.file)}"
    yield from _parameters("parameters", fit.parameters)
    yield from _correlations(fit)
    yield from _parameters("without the points that stick and slip", fit.without_stick_slip)
    yield from _sentences("doubt", fit.doubts)


def _parameters(title: str, parameters: Mapping[str, Estimate]) -> Iterator[str]:
    if not parameters:
        return
    yield f"    [[{title}]]"
    for name, e in parameters.items():
        yield f"      {name + ':':<13}{_estimate(e)}"
        yield from (f"        ({printable(doubt)})" for doubt in e.doubts)


def _estimate(e: Estimate) -> str:
    if e.value is None:
        return "not estimated"
    error = "" if (text := _number(e.standard_error)) == "none" else f" +/- {text}"
    share = percent(e)
    relative = "" if share is None else f" ({share:.2f} %)"
    interval = "no interval" if e.interval is None else f"[{_number(e.interval[0])}, {_number(e.interval[1])}]"
    return f"{e.value:<12.7g}{error}{relative} {e.unit}, 95 %: {interval}"


def _correlations(fit: StaticFit) -> Iterator[str]:
    error = np.sqrt(np.diag(fit.covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = fit.covariance / np.outer(error, error)
    pairs = [
        (float(correlation[i, k]), a, b)
        for i, a in enumerate(fit.names)
        for k, b in enumerate(fit.names)
        if i < k and abs(correlation[i, k]) > _CORRELATED
    ]
    if pairs:
        yield f"    [[correlations above {_CORRELATED}]]"
    for value, a, b in sorted(pairs, key=lambda pair: -abs(pair[0])):
        yield f"      C({a}, {b}) = {value:+.4f}"


def _check(check: Crosscheck) -> Iterator[str]:
    yield "    [[cross-check]]"
    yield f"      {printable(check.verdict)}"
    yield f"      cost: grid {check.cost_grid:.8g}, full {check.cost_full:.8g}; {check.reached} of {check.starts} starts reached it"


def _sentences(label: str, sentences: Sequence[str]) -> Iterator[str]:
    yield from (f"    {label}: {printable(sentence)}" for sentence in sentences)


def _torque_unit(fit: StaticFit) -> str:
    return fit.parameters["alpha_0"].unit if "alpha_0" in fit.parameters else ""


def _number(x: float | None) -> str:
    return "none" if x is None or math.isnan(x) else f"{x:.5g}"
