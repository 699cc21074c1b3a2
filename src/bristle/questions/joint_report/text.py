"""The fit report as plain text, in the manner people know from lmfit."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.findings import Finding, Severity
from bristle.identification.fits import (
    Crosscheck,
    Estimate,
    Presliding,
    PreslidingFit,
    RunScatter,
    StaticFit,
    TrackingFit,
)
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import ParameterName, unit
from bristle.page.plain import columns, in_unit, interval, pair, wrapped
from bristle.page.said import with_places
from bristle.page.wording import FITS, WORK, counted, percent, printable, shortened
from bristle.questions.joint_report import sentences

_CORRELATED = 0.5
"""Correlations below this are not printed."""


def fit_report(joints: Sequence[Joint]) -> str:
    """Per joint and direction: outcome, statistics, parameters with errors and 95 % intervals, correlations, warnings, cross-check.

    Then presliding, moving runs, whether the stages agree, and where the codes of warnings are explained.
    """
    lines = [line for joint in joints for line in _joint(joint)]
    if any(joint.all_warnings() for joint in joints):
        lines.append("What a code in brackets means: bristle explain CODE")
    return "\n".join(wrapped(lines)) + "\n"


def _joint(joint: Joint) -> Iterator[str]:
    yield f"[[{printable(joint.name)}]] {joint.kind}{', SIMULATED data' if joint.simulated else ''}"
    said: set[str] = set()
    for where, warning in with_places((x for x in joint.all_warnings() if x.severity is Severity.CRITICAL), str):
        said.add(printable(str(warning)))
        yield f"    critical{f' ({printable(where)})' if where else ''}: {printable(warning.coded)}"
    yield from _sentences([*filter(None, (joint.torque_scale,)), *joint.warnings], said)
    for direction in dict.fromkeys((*joint.static, *joint.crosscheck)):
        if direction in joint.static:
            yield from _fit(direction, joint.static[direction], said)
        if direction in joint.crosscheck:
            yield from _check(joint.crosscheck[direction])
    if joint.presliding:
        yield from _presliding(joint, joint.presliding, said)
    for kind, moving in moving_fits(joint).items():
        yield from _tracking(joint, FITS[kind], moving, said)
    if joint.consistency:
        yield "  [[consistency]] Each parameter from a stage of its own, beside the moving runs."
    for x in joint.consistency:
        si = unit(x.parameter.name, joint.kind)
        own = f"{x.stage} {_with_unit(x.stage_value, x.stage_error, si)}"
        runs = f"moving runs {_with_unit(x.tracking_value, x.tracking_error, si)}"
        apart = "" if x.difference_in_se is None else f"; {x.difference_in_se:+.2f} standard errors apart"
        both = f"joint fit {_with_unit(x.joint_value, x.joint_error, si)}"
        yield f"    {f'{x.parameter}:':<13}{own}; {runs}{apart}; {both}. {printable(str(x.verdict))}"
    if joint.laws is not None:
        yield f"  [[laws on {joint.laws.data}]] fitted: {printable(joint.law_name)}. {printable(str(joint.laws.sentence))}"
    yield from (f"  [[models on {x.data}]] {printable(str(x.sentence))}" for x in joint.models)


def _heading(name: str, outcome: object, warnings: Sequence[Finding]) -> str:
    """How a fit ended, and that something critical about it stands above."""
    above = "Critical, see above. " * any(warning.severity is Severity.CRITICAL for warning in warnings)
    return f"  [[{name}]] {above}{printable(str(outcome))}"


def _fit(direction: str, fit: StaticFit, said: set[str]) -> Iterator[str]:
    points = f"{counted(fit.n, 'point' if fit.segments else 'sample')}, {counted(fit.degrees_of_freedom, 'degree')} of freedom"
    torque_unit = fit.parameters["alpha_0"].unit if "alpha_0" in fit.parameters else ""
    yield _heading(direction, fit.outcome, fit.warnings)
    yield f"    {'data':<15}= {points}"
    yield from _errors(fit, torque_unit * (fit.rms is not None))
    yield from _parameters("parameters", fit.parameters, said)
    yield from _repeats(fit.repeats)
    yield from _correlations(fit.names, fit.covariance)
    yield from _sentences(fit.warnings, said)


def _errors(fit: StaticFit | TrackingFit, si: str, of: str = "") -> Iterator[str]:
    """What it leaves, and how well it predicts runs that were not fitted."""
    yield f"    {'rms residual':<15}= {_number(fit.rms)} {si}".rstrip()
    yield f"    {'relative error':<15}= {_percent(fit.relative_error)}{of}"
    for held in fit.hold_out:
        yield f"    {'hold-out':<15}= {_percent(held.relative_error)} on {printable(held.file)}"


def _parameters(title: str, parameters: Mapping[Any, Estimate], said: set[str]) -> Iterator[str]:
    if not parameters:
        return
    yield f"    [[{title}]]{' with 95 % intervals' * any(e.interval is not None for e in parameters.values())}"
    yield from columns([(f"{name}:", *_cells(e)) for name, e in parameters.items()], indent=5)
    for name, e in parameters.items():
        yield from (f"        ({name}: {_once(warning, said)})" for warning in e.warnings)


def _cells(e: Estimate) -> tuple[str, ...]:
    """Value with its error and unit, the error in percent, the part that constants have in it, and the interval."""
    if e.value is None:
        return "not estimated", "", "" if e.interval is None else in_unit(interval(e.interval), e.unit)
    share = percent(e.value, e.standard_error)
    relative = "" if share is None else f"{share:.2g} %" if share < 99.5 else f"{share:.0f} %"
    beside = sentences.systematic(e, "systematic +/- {}")
    ends = "no interval" if e.interval is None else interval(e.interval)
    return in_unit(pair(e.value, e.standard_error), e.unit), relative, *([beside] if beside else []), ends


def _repeats(repeats: Mapping[Any, RunScatter]) -> Iterator[str]:
    """How far the runs scatter, before and after widening, and each run's estimate."""
    if repeats:
        yield "    [[scatter of the runs fitted apart, sqrt(chi2_red), before -> after widening]]"
    for name, x in repeats.items():
        runs = ", ".join(f"{value:.4g}" for value in x.by_run.values())
        yield f"      {f'{name}:':<13}{x.before:.2f} -> {x.after:.2f}, {len(x.by_run)} runs: {runs}"


def _correlations(names: Sequence[str | ParameterName], covariance: Array) -> Iterator[str]:
    error = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(error, error)
    pairs = [
        (float(correlation[i, k]), a, b)
        for i, a in enumerate(names)
        for k, b in enumerate(names)
        if i < k and abs(correlation[i, k]) > _CORRELATED
    ]
    if pairs:
        yield f"    [[correlations above {_CORRELATED}]]"
    for value, a, b in sorted(pairs, key=lambda pair: -abs(pair[0])):
        yield f"      C({a}, {b}) = {value:+.4f}"


def _check(check: Crosscheck, of: str = "the grid") -> Iterator[str]:
    yield "    [[cross-check]]"
    yield f"      {printable(str(check.verdict))}"
    if not check.agrees:
        yield f"      cost: {sentences.cost_change(check, of)}"


def _presliding(joint: Joint, slow: Presliding, said: set[str]) -> Iterator[str]:
    for d, fit in slow.fits.items():
        yield from _slow(joint, fit, slow.breakaway.get(d), said)
    torque, position, stiffness = (unit(name, joint.kind) for name in ("torque", "position", "sigma_0"))
    if slow.loops:
        yield "  [[hysteresis]] Regression of torque on displacement, inverse regression and secant differ because the loop is wide."
    for x in slow.loops:
        slopes = f"slope {_number(x.slope)}, inverse {_number(x.inverse_slope)}, secant {_number(x.secant)} {stiffness}"
        reach = f"+/-{_number(x.torque_amplitude)} {torque}, +/-{_number(x.displacement_amplitude)} {position}"
        where = f"{printable(x.file)} samples {x.start}-{x.stop}, {reach}"
        yield f"    {where}: {slopes}; loss {_number(x.loss)} {WORK} per cycle, {counted(x.counts, 'count')}"
    if slow.warnings:
        yield "  [[presliding as a whole]]"
    yield from _sentences(slow.warnings, said)


def _slow(joint: Joint, fit: PreslidingFit, breakaway: Estimate | None, said: set[str]) -> Iterator[str]:
    yield _heading(f"presliding {fit.direction}", sentences.choice(fit), fit.warnings)
    yield f"    {'data':<15}= {counted(len(fit.loadings), 'loading')}, {counted(fit.counts, 'count edge')}"
    yield f"    {'level g0':<15}= {sentences.level(fit, joint.kind).replace('±', '+/-')}, from {fit.level_source}"
    yield f"    {'bias of (14)':<15}= {sentences.bias(fit, joint.kind)}"
    if breakaway:
        yield f"    {'breakaway':<15}= {', '.join(filter(None, _cells(breakaway)))}"
        yield from (f"        ({_once(warning, said)})" for warning in breakaway.warnings)
    yield from _parameters("sigma_0", sentences.methods(fit), said)
    yield from _repeats(fit.repeats)
    yield from _parameters("sigma_1", {"sigma_1": fit.sigma_1}, said)
    yield from _sentences(fit.warnings, said)


def _tracking(joint: Joint, name: str, fit: TrackingFit, said: set[str]) -> Iterator[str]:
    yield _heading(name, fit.outcome, fit.warnings)
    yield f"    {'data':<15}= {fit.n} samples, {counted(len(fit.starts_of_runs), 'segment')}"
    yield from _errors(fit, unit("torque", joint.kind), " of the torque")
    yield f"    {'starts':<15}= {sentences.reached(fit)}"
    yield f"    {'condition':<15}= {_number(fit.condition)}"
    yield from _parameters("parameters", fit.parameters, said)
    yield from _repeats(fit.repeats)
    if added := sentences.biased(fit):
        yield "    [[what encoder counts added, which is taken off]]"
        yield from (f"      {f'{name}:':<13}{text}" for name, text in added.items())
    yield from _correlations(fit.names, fit.covariance)
    yield from _sentences(fit.warnings, said)


def _with_unit(value: float | None, error: float | None, si: str) -> str:
    return pair(value, error) + f" {si}" * (value is not None)


def _sentences(warnings: Sequence[Finding], said: set[str]) -> Iterator[str]:
    """Those that are not critical, which stand first of all; what stands above already by its beginning, in one line."""
    other = [warning for warning in warnings if warning.severity is not Severity.CRITICAL]
    again = [printable(str(warning)) for warning in other if printable(str(warning)) in said]
    for warning in other:
        if printable(str(warning)) not in again:
            yield f"    {warning.severity}: {_once(warning, said)}"
    if again:
        yield f"    as above: {'; '.join(shortened(sentence, 32) for sentence in again)}"


def _once(warning: Finding, said: set[str]) -> str:
    """Its sentence, or only the beginning where the joint's text has it above."""
    sentence = printable(str(warning))
    beginning = f"{shortened(sentence, 48)} (as above)"
    if sentence in said and len(beginning) < len(sentence):
        return beginning
    said.add(sentence)
    return printable(warning.coded)


def _number(x: float | None) -> str:
    return "none" if x is None or math.isnan(x) else f"{x:.4g}"


def _percent(x: float | None) -> str:
    return "none" if x is None or math.isnan(x) else f"{x:.3g} %"
