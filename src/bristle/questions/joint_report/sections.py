"""What each section of the page shows: one function per section, results -> the values that its template names."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd
from markupsafe import Markup

from bristle.diagnostics import Diagnostic
from bristle.identification.results import Joint, StaticFit
from bristle.model.parameters import unit
from bristle.page.columns import Table, shown
from bristle.page.page import versions
from bristle.page.style import MOST_POINTS
from bristle.page.wording import direction, measured, pretty, slugs, span
from bristle.questions.joint_report import (
    dynamic_section,
    interval_tables,
    models_section,
    presliding_section,
    static_figures,
    tables,
)
from bristle.questions.joint_report.curves import band
from bristle.questions.joint_report.dynamic import agreement, moving_warnings
from bristle.questions.joint_report.dynamic_tables import table_1
from bristle.questions.joint_report.next_measurements import next_measurements
from bristle.questions.joint_report.presliding import presliding_warnings, whole_warnings


def page(
    joints: Sequence[Joint], title: str, seed: int | None, drawn: Mapping[str, Mapping[str, Markup]]
) -> dict[str, Any]:
    """Everything that the page's template names."""
    return {
        "title": title,
        "simulated": any(joint.simulated for joint in joints),
        "presliding": any(joint.presliding is not None for joint in joints),
        "tracking": any(joint.tracking is not None for joint in joints),
        "all_simulated": all(joint.simulated for joint in joints),
        "joints": [
            _joint(joint, slug, drawn[joint.name])
            for joint, slug in zip(joints, slugs([j.name for j in joints]), strict=True)
        ],
        "stribeck": drawn[""]["stribeck"],
        "fig_1": {"p": static_figures.FIG_1, "v_s": static_figures.FIG_1_V_S},
        **versions(seed),
    }


def _joint(joint: Joint, slug: str, drawn: Mapping[str, Markup]) -> dict[str, Any]:
    return {
        "joint": joint,
        "slug": slug,
        "figures": drawn,
        "summary": _summary(joint),
        "inputs": _inputs(joint),
        "segments": _segments(joint),
        "parameters": _parameters(joint),
        "comparison": _comparison(joint),
        "crosscheck": _crosscheck(joint),
        "hold_out": shown(tables.hold_out([joint])),
        "models": models_section.models_section(joint),
        "presliding": presliding_section.presliding_section(joint),
        "tracking": dynamic_section.dynamic_section(joint),
        "uncertainty": interval_tables.interval_section(joint),
        "complete": _complete(joint),
        "shared": _shared(joint),
        "warnings": _warnings(joint),
        "next": next_measurements(joint),
        "thinned": max((fit.velocity.size for fit in joint.static.values()), default=0) > MOST_POINTS,
        "most_points": MOST_POINTS,
        "banded": any(band(fit.velocity[:1], fit) is not None for d, fit in joint.static.items() if d != "shared"),
    }


def _summary(joint: Joint) -> dict[str, Any]:
    """The verdict: per direction the outcome and the static parameters; for simulated data how many intervals hold the truth."""
    fits = [
        {
            "direction": d,
            "outcome": str(fit.outcome),
            "n": f"{fit.n} points",
            "relative_error": fit.relative_error,
            "warnings": len(fit.warnings),
            "estimates": [
                (name, measured(e.value, e.standard_error), pretty(e.unit), span(e.interval))
                for name, e in fit.parameters.items()
            ],
        }
        for d, fit in joint.static.items()
    ]
    inside = table_1([joint])["inside"].dropna()
    covered = (int(inside.astype(bool).sum()), len(inside)) if len(inside) else None
    fits += [*presliding_section.presliding_summary(joint), *dynamic_section.dynamic_summary(joint)]
    verdicts = [(d, c.verdict) for d, c in joint.crosscheck.items()]
    return {"fits": fits, "covered": covered, "verdicts": verdicts, "agreement": agreement(joint)}


def _inputs(joint: Joint) -> dict[str, Any]:
    return {
        "files": joint.inputs,
        "rows": sum(x.rows for x in joint.inputs),
        "dropped": sum(x.dropped for x in joint.inputs),
        "labelled": any(x.labels for x in joint.inputs),
    }


def _segments(joint: Joint) -> dict[str, Any]:
    units = {name: f"{name} ({pretty(unit(name, joint.kind))})" for name in ("velocity", "torque")}
    units["standard_error"] = f"its standard error ({pretty(unit('torque', joint.kind))})"
    frame = tables.segments([joint]).rename(columns=units)
    kept = frame[frame["accepted"]].drop(columns=["accepted", "reasons", "stick_slip"])
    rejected = frame[~frame["accepted"]][["file", "start", "stop", units["velocity"], units["torque"], "reasons"]]
    return {"kept": shown(kept), "rejected": shown(rejected), "sticking": int(frame["stick_slip"].sum())}


def _parameters(joint: Joint) -> Table:
    """Those of static and slow runs, stage by stage."""
    frame = tables.parameters([joint])
    return _with_truth(joint, frame[frame["source"].isin(["static", "presliding"])].drop(columns="source"))


def _complete(joint: Joint) -> Table | None:
    """All parameters by the stage to use; None where there are static fits alone."""
    if joint.presliding is None and joint.tracking is None:
        return None
    frame = table_1([joint])
    frame.insert(3, "source", frame.pop("source"))
    return _with_truth(joint, frame)


def _with_truth(joint: Joint, frame: pd.DataFrame) -> Table:
    return shown(frame if joint.truth else frame.drop(columns=["true", "error_percent", "inside"]))


def _comparison(joint: Joint) -> Table:
    frame = tables.comparison([joint])
    if frame["without_stick_slip"].isna().all():
        frame = frame.drop(columns=["without_stick_slip", "without_standard_error"])
    return shown(frame)


def _crosscheck(joint: Joint) -> list[dict[str, Any]]:
    frame = tables.crosscheck([joint])
    return [
        {"direction": d, "check": check, "table": shown(frame[frame["direction"] == d].drop(columns="direction"))}
        for d, check in joint.crosscheck.items()
    ]


def _shared(joint: Joint) -> dict[str, Any]:
    """Regressors beside friction, and what two directions share."""
    extra = sorted(
        {name for fit in joint.static.values() for name in fit.parameters if not name.startswith(("alpha_", "v_s"))}
    )
    return {"extra": extra, "shared": "shared" in joint.static}


def _warnings(joint: Joint) -> list[tuple[str, str]]:
    """Each warning once, with what it is about."""
    found: dict[str, list[str]] = {}
    for where, warning in _all_warnings(joint):
        found.setdefault(str(warning), []).append(where)
    return [(", ".join(dict.fromkeys(where)), sentence) for sentence, where in found.items()]


def _all_warnings(joint: Joint) -> Iterable[tuple[str, Diagnostic]]:
    yield from (("", warning) for warning in joint.warnings)
    for d, fit in joint.static.items():
        yield from ((direction(d), warning) for warning in fit.warnings)
        yield from _parameter_warnings(d, fit)
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        yield from presliding_warnings(slow, joint.presliding.breakaway.get(d) if joint.presliding else None)
    yield from (("presliding", warning) for warning in whole_warnings(joint))
    yield from moving_warnings(joint)
    yield from ((f"{s.file} rows {s.start}-{s.stop}", warning) for s in joint.segments for warning in s.warnings)


def _parameter_warnings(d: str, fit: StaticFit) -> Iterable[tuple[str, Diagnostic]]:
    said = set(fit.warnings)
    for name, e in fit.parameters.items():
        yield from ((f"{direction(d)} {name}", warning) for warning in e.warnings if warning not in said)
