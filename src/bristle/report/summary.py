"""Results as JSON (schema bristle-results/1, generated from the models of `schema`) and as a tidy table."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bristle import __version__
from bristle.data.steady import Segment
from bristle.identification.estimate import Crosscheck, Estimate, Input, Joint, StaticFit
from bristle.report.schema import (
    Bound,
    CrosscheckJson,
    FitJson,
    HoldOutJson,
    InputJson,
    JointJson,
    ParameterJson,
    ResultsJson,
    SegmentJson,
)
from bristle.report.text import fit_report

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["fit_report", "schema", "to_frame", "to_json"]


def schema() -> dict[str, Any]:
    """The JSON schema of `results.json`."""
    document = ResultsJson.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document, "title": "bristle-results/1"}


def to_json(joints: Sequence[Joint]) -> str:
    """`results.json` of schema bristle-results/1.

    Floats keep every digit; an infinite bound is the string "inf" or "-inf"; what does not exist is null, with a doubt that says so.
    """
    results = ResultsJson(
        schema="bristle-results/1",
        bristle=__version__,
        inputs=[_input(joint, x) for joint in joints for x in joint.inputs],
        joints={joint.name: _joint(joint) for joint in joints},
    )
    return json.dumps(results.model_dump(by_alias=True), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def to_frame(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction and parameter: value, unit, standard_error, lower, upper, doubts (joined by `; `).

    What does not exist is nan; a bound that is open is infinite.
    """
    import pandas as pd

    columns = ["joint", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper", "doubts"]
    rows = [
        (joint.name, d, name, _float(e.value), e.unit, _float(e.standard_error), *_bounds(e), "; ".join(e.doubts))
        for joint in joints
        for d, fit in joint.static.items()
        for name, e in fit.parameters.items()
    ]
    return pd.DataFrame(rows, columns=columns)


def _float(x: float | None) -> float:
    return math.nan if x is None else x


def _bounds(e: Estimate) -> tuple[float, float]:
    return (math.nan, math.nan) if e.interval is None else e.interval


def _finite(x: float | None) -> float | None:
    return None if x is None or not math.isfinite(x) else float(x)


def _all_finite(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: _finite(x) for name, x in values.items()}


def _bound(x: float) -> Bound:
    return x if math.isfinite(x) else ("inf" if x > 0 else "-inf")


def _said(doubts: Iterable[str], **values: object) -> list[str]:
    """The doubts; and, where something is missing and no doubt says so, one that does."""
    doubts = list(doubts)
    missing = [name.replace("_", " ") for name, value in values.items() if value is None]
    return doubts or [f"There is no {name}: these data give none." for name in missing]


def _parameter(e: Estimate) -> ParameterJson:
    value, error = _finite(e.value), _finite(e.standard_error)
    known = e.interval is not None and not any(map(math.isnan, e.interval))
    interval = (_bound(e.interval[0]), _bound(e.interval[1])) if known and e.interval else None
    doubts = _said(e.doubts, value=value, standard_error=error, interval=interval)
    return ParameterJson(value=value, unit=e.unit, standard_error=error, interval=interval, doubts=doubts)


def _fit(fit: StaticFit) -> FitJson:
    rms, relative = _finite(fit.rms), _finite(fit.relative_error)
    return FitJson(
        parameters={name: _parameter(e) for name, e in fit.parameters.items()},
        rms=rms,
        relative_error=relative,
        n=fit.n,
        outcome=fit.outcome.value,
        doubts=_said(fit.doubts, rms=rms, relative_error=relative),
        hold_out=[HoldOutJson(file=h.file, relative_error=_finite(h.relative_error)) for h in fit.hold_out],
        degrees_of_freedom=fit.dof,
        free=list(fit.names),
        covariance=[[_finite(x) for x in row] for row in fit.covariance.tolist()],
        plain_grid=_all_finite(fit.plain),
        huber=_all_finite(fit.robust),
        without_stick_slip={name: _parameter(e) for name, e in fit.without_stick_slip.items()},
    )


def _crosscheck(check: Crosscheck) -> CrosscheckJson:
    difference = {name: _finite(check.difference_in_se.get(name)) for name in check.parameters}
    missing = [name for name, x in difference.items() if x is None]
    why = f"No difference in standard errors for {', '.join(missing)}: the grid fit gives no standard error."
    return CrosscheckJson(
        cost_grid=_finite(check.cost_grid),
        cost_full=_finite(check.cost_full),
        starts=check.starts,
        reached=check.reached,
        parameters=_all_finite(check.parameters),
        difference_in_se=difference,
        verdict=check.verdict,
        doubts=[why] if missing else [],
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
        reasons=list(s.reasons),
        doubts=_said(s.doubts, standard_error=error),
        stick_slip=s.stick_slip,
        labels=dict(s.labels),
    )


def _joint(joint: Joint) -> JointJson:
    return JointJson(
        kind=joint.kind,
        simulated=joint.simulated,
        assumptions=list(joint.assumptions),
        settings=dict(joint.settings),
        doubts=list(joint.doubts),
        truth={d: {k: float(v) for k, v in p._asdict().items()} for d, p in joint.truth.items()},
        static={d: _fit(fit) for d, fit in joint.static.items()},
        crosscheck={d: _crosscheck(check) for d, check in joint.crosscheck.items()},
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
