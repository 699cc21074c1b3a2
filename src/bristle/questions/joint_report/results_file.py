"""Results as JSON (schema bristle-results/1, generated from the models of `schema`) and as a tidy table."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from bristle import __version__
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.slow_loading import Loop
from bristle.diagnostics import Diagnostic
from bristle.identification.results import (
    Consistency,
    Crosscheck,
    Estimate,
    HoldOut,
    Input,
    Joint,
    ModelComparison,
    ModelRow,
    PreslidingFit,
    StaticFit,
    TrackingFit,
    Uncertainty,
)
from bristle.identification.results_schema import (
    BiasJson,
    Bound,
    ConsistencyJson,
    CrosscheckJson,
    FitJson,
    HoldOutJson,
    HysteresisJson,
    InputJson,
    JointJson,
    LevelJson,
    ModelJson,
    ModelsJson,
    ParameterJson,
    PreslidingJson,
    ResultsJson,
    SegmentJson,
    TrackingJson,
    UncertaintyJson,
)
from bristle.questions.joint_report.frame import to_frame
from bristle.questions.joint_report.presliding import bias_known, whole_warnings
from bristle.questions.joint_report.text import fit_report

__all__ = ["fit_report", "schema", "to_frame", "to_json"]


def schema() -> dict[str, Any]:
    """The JSON schema of `results.json`."""
    document = ResultsJson.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": "bristle-results/1"}


def to_json(joints: Sequence[Joint]) -> str:
    """`results.json` of schema bristle-results/1.

    Floats keep every digit; an infinite bound is the string "inf" or "-inf"; what does not exist is null, with a warning that says so.
    """
    results = ResultsJson(
        schema="bristle-results/1",
        bristle=__version__,
        inputs=[_input(joint, x) for joint in joints for x in joint.inputs],
        joints={joint.name: _joint(joint) for joint in joints},
    )
    return json.dumps(results.model_dump(by_alias=True), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(x: float | None) -> float | None:
    return None if x is None or not math.isfinite(x) else float(x)


def _all_finite(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _finite(x) for name, x in values.items()}


def _bound(x: float) -> Bound:
    return x if math.isfinite(x) else ("inf" if x > 0 else "-inf")


def _interval(ends: tuple[float, float] | None) -> tuple[Bound, Bound] | None:
    return None if ends is None or any(map(math.isnan, ends)) else (_bound(ends[0]), _bound(ends[1]))


def _said(warnings: Iterable[Diagnostic], **values: object) -> list[str]:
    """The warnings; and, where something is missing and no warning says so, one that does."""
    said = list(map(str, warnings))
    missing = [name.replace("_", " ") for name, value in values.items() if value is None]
    return said or [f"There is no {name}: these data give none." for name in missing]


def _parameter(e: Estimate) -> ParameterJson:
    value, error = _finite(e.value), _finite(e.standard_error)
    interval = _interval(e.interval)
    warnings = _said(e.warnings, value=value, standard_error=error, interval=interval)
    return ParameterJson(value=value, unit=e.unit, standard_error=error, interval=interval, doubts=warnings)


def _fit(fit: StaticFit) -> FitJson:
    rms, relative = _finite(fit.rms), _finite(fit.relative_error)
    return FitJson(
        parameters={name: _parameter(e) for name, e in fit.parameters.items()},
        rms=rms,
        relative_error=relative,
        n=fit.n,
        outcome=fit.outcome.value,
        doubts=_said(fit.warnings, rms=rms, relative_error=relative),
        hold_out=_hold_out(fit.hold_out),
        degrees_of_freedom=fit.dof,
        free=list(fit.names),
        covariance=_matrix(fit.covariance),
        plain_grid=_all_finite(fit.plain),
        huber=_all_finite(fit.robust),
        without_stick_slip={name: _parameter(e) for name, e in fit.without_stick_slip.items()},
        uncertainty=_three_ways(fit.uncertainty),
    )


def _three_ways(found: Mapping[Any, Uncertainty]) -> dict[str, UncertaintyJson]:
    return {
        str(name): UncertaintyJson(
            **{way: _interval(getattr(x, way)) for way in ("covariance", "profile", "bootstrap")},
            doubts=list(map(str, x.warnings)),
        )
        for name, x in found.items()
    }


def _hold_out(runs: Iterable[HoldOut]) -> list[HoldOutJson]:
    return [HoldOutJson(file=x.file, relative_error=_finite(x.relative_error)) for x in runs]


def _matrix(covariance: Array) -> list[list[float | None]]:
    return [[_finite(x) for x in row] for row in covariance.tolist()]


def _crosscheck(check: Crosscheck, direction: str = "") -> CrosscheckJson:
    difference = {name.within(direction): _finite(check.difference_in_se.get(name)) for name in check.parameters}
    missing = [name for name, x in difference.items() if x is None]
    why = f"No difference in standard errors for {', '.join(missing)}: the fit that it checks gives no standard error."
    return CrosscheckJson(
        cost_grid=_finite(check.cost_grid),
        cost_full=_finite(check.cost_full),
        starts=check.starts,
        reached=check.reached,
        parameters={name.within(direction): _finite(x) for name, x in check.parameters.items()},
        difference_in_se=difference,
        verdict=str(check.verdict),
        doubts=[why] if missing else [],
    )


def _presliding(fit: PreslidingFit, breakaway: Estimate | None) -> PreslidingJson:
    known = bias_known(fit)
    on_edge, mean, spread = (_finite(x) if known else None for x in (fit.bias_on_edge, fit.bias_mean, fit.bias_spread))
    error = _finite(fit.level_standard_error)
    return PreslidingJson(
        printed=_parameter(fit.printed),
        corrected=_parameter(fit.corrected),
        edges=_parameter(fit.edges),
        samples=_parameter(fit.samples),
        sigma_1=_parameter(fit.sigma_1),
        recommended=fit.recommended,
        level=LevelJson(value=_finite(fit.level), standard_error=error, source=fit.level_source),
        quantum=fit.quantum,
        counts=fit.counts,
        bias=BiasJson(on_edge=on_edge, mean=mean, spread=spread),
        breakaway=None if breakaway is None else _parameter(breakaway),
        doubts=_said(fit.warnings, bias=on_edge, standard_error_of_the_level=error),
        uncertainty=_three_ways(fit.uncertainty),
    )


def _tracking(fit: TrackingFit) -> TrackingJson:
    rms, relative = _finite(fit.rms), _finite(fit.relative_error)
    return TrackingJson(
        parameters={str(name): _parameter(e) for name, e in fit.parameters.items()},
        predicts=fit.quantity,
        rms=rms,
        relative_error=relative,
        n=fit.n,
        outcome=str(fit.outcome),
        doubts=_said(fit.warnings, rms=rms, relative_error=relative),
        hold_out=_hold_out(fit.hold_out),
        starts=fit.starts,
        reached=fit.reached,
        condition=None if math.isnan(fit.condition) else _bound(fit.condition),
        free=list(map(str, fit.names)),
        covariance=_matrix(fit.covariance),
        count_bias={str(name): _finite(x) for name, x in fit.bias.items()},
        crosscheck=None if fit.check is None else _crosscheck(fit.check),
        uncertainty=_three_ways(fit.uncertainty),
    )


def _consistency(x: Consistency) -> ConsistencyJson:
    numbers = {
        f"{stage}_{what}": _finite(getattr(x, f"{stage}_{what}"))
        for stage in ("stage", "tracking", "joint")
        for what in ("value", "error")
    }
    return ConsistencyJson(
        parameter=str(x.parameter),
        stage=x.stage,
        difference_in_se=_finite(x.difference),
        verdict=str(x.verdict),
        **numbers,
    )


def _models(x: ModelComparison) -> ModelsJson:
    return ModelsJson(
        data=x.data,
        n=x.n,
        effective=x.effective,
        hold_out_by=x.hold_out_by,
        rows=[_model(row) for row in x.rows],
        sentence=x.sentence,
        left_out=list(x.left_out),
    )


def _model(row: ModelRow) -> ModelJson:
    return ModelJson(
        model=row.model,
        directions=row.directions,
        parameters=row.parameters,
        rms=_finite(row.rms),
        relative_error=_finite(row.relative_error),
        aicc=_finite(row.aicc),
        bic=_finite(row.bic),
        hold_out=_finite(row.hold_out),
        candidate=row.candidate,
        recommended=row.recommended,
    )


def _hysteresis(loop: Loop) -> HysteresisJson:
    return HysteresisJson(
        file=loop.file,
        start=loop.start,
        stop=loop.stop,
        loss=loop.loss,
        secant=_bound(loop.secant),
        slope=loop.slope,
        inverse_slope=_bound(loop.inverse_slope),
        counts=loop.counts,
    )


def _segment(s: Segment) -> SegmentJson:
    error = _finite(s.standard_error)
    return SegmentJson(
        file=s.file,
        start=s.start,
        stop=s.stop,
        velocity=_finite(s.velocity),
        torque=_finite(s.torque),
        standard_error=error,
        accepted=s.accepted,
        reasons=list(map(str, s.reasons)),
        doubts=_said(s.warnings, standard_error=error),
        stick_slip=s.stick_slip,
        labels=dict(s.labels),
    )


def _joint(joint: Joint) -> JointJson:
    slow = joint.presliding
    return JointJson(
        kind=joint.kind,
        simulated=joint.simulated,
        assumptions=list(joint.assumptions),
        settings=dict(joint.settings),
        doubts=list(map(str, (*joint.warnings, *whole_warnings(joint)))),
        truth={d: _all_finite(p._asdict()) for d, p in joint.truth.items()},
        static={d: _fit(fit) for d, fit in joint.static.items()},
        crosscheck={d: _crosscheck(check, d) for d, check in joint.crosscheck.items()},
        presliding={d: _presliding(fit, slow.breakaway.get(d)) for d, fit in slow.fits.items()} if slow else {},
        hysteresis=[_hysteresis(loop) for loop in slow.loops] if slow else [],
        tracking=None if joint.tracking is None else _tracking(joint.tracking),
        joint_fit=None if joint.joint_fit is None else _tracking(joint.joint_fit),
        consistency=[_consistency(x) for x in joint.consistency],
        models=[_models(x) for x in joint.models],
        segments=[_segment(s) for s in joint.segments],
    )


def _input(joint: Joint, x: Input) -> InputJson:
    return InputJson(
        joint=joint.name,
        file=x.file,
        sha256=x.sha256,
        rows=x.rows,
        dropped=x.dropped,
        notes=list(x.notes),
        labels=dict(x.labels),
    )
