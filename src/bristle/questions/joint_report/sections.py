"""What each section of the pages shows: one function per section, results -> the values that its template names."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from bristle.findings import Finding, Severity
from bristle.identification.curve import band, curve
from bristle.identification.fits import Estimate
from bristle.identification.results import Joint
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import ParameterName, of_curve, unit
from bristle.page.columns import Table, shown
from bristle.page.page import Drawn, Section, versions
from bristle.page.style import MOST_POINTS
from bristle.page.wording import MISSING, direction, in_print, measured, number, pretty, slugs, span, symbol
from bristle.questions.joint_report import (
    dynamic_section,
    interval_tables,
    presliding_section,
    static_figures,
    tables,
)
from bristle.questions.joint_report.answer import answer, trusted
from bristle.questions.joint_report.captions_section import captions
from bristle.questions.joint_report.next_measurements import next_measurements
from bristle.questions.joint_report.sentences import agreement, critical

_LAW_NAMES = {
    "aicc": "ΔAICc",
    "bic": "ΔBIC",
    "left_out": "speeds left out (%)",
    "run_left_out": "runs left out (%)",
    "weight": "weight (%)",
    "in_force": "fitted?",
    "chosen": "chosen?",
}
_NAMES = {"aicc": "ΔAICc", "bic": "ΔBIC", "hold_out": "hold-out (%)", "recommended": "use it?"}


def report(
    joints: Sequence[Joint],
    title: str,
    seed: int | None,
    drawn: Mapping[str, Mapping[str, Drawn]],
    appended: Section | None,
) -> dict[str, Any]:
    """Everything that the templates of the report's pages name."""
    names = slugs([joint.name for joint in joints])
    small = {joint.name: drawn[joint.name]["small"] for joint in joints if "small" in drawn[joint.name]}
    return {
        "title": title,
        "answer": answer(joints, names, appended.about if appended else {}, small),
        "critical": [(joint.name, *found) for joint in joints for found in _critical(joint)],
        "adverse": appended.adverse if appended else (),
        "linked": any(joint.link_inertia is not None for joint in joints),
        "simulated": any(joint.simulated for joint in joints),
        "all_simulated": all(joint.simulated for joint in joints),
        "joints": [
            _joint(joint, slug, drawn[joint.name]) | {"first": k == 0}
            for k, (joint, slug) in enumerate(zip(joints, names, strict=True))
        ],
        "stribeck": drawn[""]["stribeck"],
        "fig_1": _fig_1(),
        **versions(seed),
    }


def _fig_1() -> dict[str, Any]:
    """What Fig. 1 shows: friction at rest, and the lowest with its speed, of the middle curve."""
    p = static_figures.FIG_1
    v = np.linspace(1e-3, 0.5, 500)
    T = curve(v, p.stribeck)
    k = int(np.argmin(T))
    return {
        "p": p,
        "v_s": static_figures.FIG_1_V_S,
        "rest": number(p.alpha_0 + p.alpha_1, 3),
        "least": (number(float(T[k]), 3), number(float(v[k]), 2)),
    }


def _joint(joint: Joint, slug: str, drawn: Mapping[str, Drawn]) -> dict[str, Any]:
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
        "models": _models(joint),
        "laws": _laws(joint),
        "presliding": presliding_section.presliding_section(joint),
        "tracking": dynamic_section.dynamic_section(joint),
        "uncertainty": interval_tables.interval_section(joint),
        "complete": _complete(joint),
        "shared": _shared(joint),
        "warnings": _warnings(joint),
        "captions": captions(joint),
        **trusted(joint),
        "next": [(_about(x), x) for x in next_measurements(joint)],
        "thinned": max((fit.velocity.size for fit in joint.static.values()), default=0) > MOST_POINTS,
        "most_points": MOST_POINTS,
        "of_paper": joint.law == GAUSSIAN,
        "to_use": bool(static_figures.curves_to_use(joint)),
        "held_shape": " and ".join(own.symbol for own in joint.law.peak.own),
        "banded": any(band(fit.velocity[:1], fit) is not None for d, fit in joint.static.items() if d != "shared"),
    }


def _summary(joint: Joint) -> dict[str, Any]:
    """How each fit ended; for simulated data how many intervals hold the truth."""
    fits = [
        {
            "direction": d,
            "outcome": str(fit.outcome),
            "n": f"{fit.n} points",
            "relative_error": fit.relative_error,
        }
        for d, fit in joint.static.items()
    ]
    fits += [*presliding_section.presliding_summary(joint), *dynamic_section.dynamic_summary(joint)]
    agreed = agreement(joint)
    return {
        "fits": fits,
        "critical": _critical(joint),
        "covered": _covered(joint),
        "agreement": in_print(agreed) if agreed else "",
    }


def _critical(joint: Joint) -> list[tuple[str, Finding]]:
    """What is critical, with what it is about."""
    named = {x: [" ".join(map(direction, subject)) for subject in about] for x, about in critical(joint).items()}
    return [(", ".join(where), warning) for warning, where in named.items()]


def _covered(joint: Joint) -> str | None:
    """How many static intervals hold the value that was simulated; None where the truth is not known."""
    inside = tables.table_1([joint])["inside"].dropna()
    count, total = int(inside.astype(bool).sum()), len(inside)
    together = "; misses are not independent: the estimates of one direction come from the same data"
    more = together if count < 0.8 * total else ""
    return f"{count} of {total} true values lie inside their 95 % intervals{more}." if total else None


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
    passing = np.array([any(reason.code == "transient" for reason in x.reasons) for x in joint.segments], dtype=bool)
    kept = frame[frame["accepted"]].drop(columns=["accepted", "reasons", "stick_slip", "start", "stop"])
    rejected = frame[~frame["accepted"] & ~passing][["file", "where", units["velocity"], units["torque"], "reasons"]]
    return {
        "kept": shown(kept), "rejected": shown(rejected), "sticking": int(frame["stick_slip"].sum()), "passing": int(passing.sum()),
    }  # fmt: skip  # a list of values


def _parameters(joint: Joint) -> Table:
    """Those of static and slow runs, stage by stage."""
    frame = tables.parameters([joint])
    return _with_truth(joint, frame[frame["source"].isin(["static", "presliding"])].drop(columns="source"))


def _complete(joint: Joint) -> Table | None:
    """All parameters by the stage to use; None where there are static fits alone."""
    if joint.presliding is None and joint.tracking is None:
        return None
    frame = tables.table_1([joint])
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
    extra = sorted({name for fit in joint.static.values() for name in fit.parameters if not of_curve(name)})
    return {"extra": extra, "shared": "shared" in joint.static}


def _models(joint: Joint) -> list[dict[str, Any]]:
    """What the template names of each comparison."""
    frame, torque = tables.models([joint]), pretty(unit("torque", joint.kind))
    found = []
    for x in joint.models:
        own = frame[frame["data"] == x.data].drop(columns=["data", "joint", "candidate"])
        if own["hold_out"].isna().all():
            own = own.drop(columns="hold_out")
        for name in {"rms", "relative_error", "hold_out"} & set(own):
            own[name] = [float(f"{value:.4g}") for value in own[name]]
        own = own.round({"aicc": 1, "bic": 1}).rename(columns={**_NAMES, "rms": f"rms ({torque})"})
        found.append({"of": x, "table": shown(own), "effective": number(x.effective, 4)})
    return found


def _laws(joint: Joint) -> dict[str, Any] | None:
    """What the template names of the laws side by side; None where they were not compared."""
    if joint.laws is None:
        return None
    frame, torque = tables.laws([joint]).drop(columns=["joint", "data"]), pretty(unit("torque", joint.kind))
    if frame["run_left_out"].isna().all():
        frame = frame.drop(columns="run_left_out")
    for name in {"rms", "left_out", "run_left_out"} & set(frame):
        frame[name] = [float(f"{value:.4g}") for value in frame[name]]
    frame["weight"] = (100 * frame["weight"]).round(1)
    frame = frame.round({"aicc": 1, "bic": 1}).rename(columns={**_LAW_NAMES, "rms": f"rms ({torque})"})
    averaged = [
        {
            "name": symbol(name),
            "value": f"{measured(x.value, x.standard_error)} {pretty(unit(name.name, joint.kind))}",
            "ends": span(x.interval),
            "own": span(e.interval) if (e := _estimate(joint, name)) is not None else MISSING,
        }
        for name, x in joint.laws.averaged.items()
    ]
    return {"of": joint.laws, "table": shown(frame), "averaged": averaged, "law": joint.law}


def _estimate(joint: Joint, name: ParameterName) -> Estimate | None:
    fit = joint.static.get(name.direction)
    return None if fit is None else fit.parameters.get(name.name)


def _warnings(joint: Joint) -> list[tuple[str, list[tuple[str, Finding]]]]:
    """Cautions, then notes: each warning once, with what it is about. What is critical stands first on the page."""
    found: dict[str, tuple[Finding, list[str]]] = {}
    for warning in joint.all_warnings():
        found.setdefault(str(warning), (warning, []))[1].append(_about(warning))
    every = [(", ".join(filter(None, dict.fromkeys(where))), warning) for warning, where in found.values()]
    grouped = [
        (str(severity), [x for x in every if x[1].severity is severity])
        for severity in (Severity.CAUTION, Severity.NOTE)
    ]
    return [(severity, own) for severity, own in grouped if own]


def _about(x: Finding) -> str:
    """What a diagnostic is about, in words; empty where it is the joint as a whole."""
    return " ".join(map(direction, x.subject))
