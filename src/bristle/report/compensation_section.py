"""What the page shows of the compensated joint: results -> the values that its template names; and its figures by name."""

from collections.abc import Callable
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from bristle.compensation.study import Study
from bristle.model.parameters import Kind, unit
from bristle.report import compensation_figures as figures
from bristle.report import compensation_tables as tables
from bristle.report.shown import shown
from bristle.report.wording import number, pretty

_MOST_REPLAYS = 6
"""Replays drawn; the table has all."""


def draw(study: Study) -> dict[str, Callable[[Study], Figure | None]]:
    """What draws each figure, by name."""
    drawn: dict[str, Callable[[Study], Figure | None]] = {
        "followed": figures.followed_figure,
        "errors": figures.errors_figure,
        "gains": figures.gains_figure,
        "adapted": figures.adapted_figure,
        "landings": figures.landings_figure,
        "gradients": figures.gradients_figure,
        "ablation": figures.ablation_figure,
        "band": figures.band_figure,
    }
    return drawn | {f"replay-{k + 1}": figures.replay_figure(k) for k in range(min(len(study.replays), _MOST_REPLAYS))}


def section(study: Study) -> dict[str, Any]:
    """Everything that the template of the compensated joint names."""
    subject, kind = study.subjects[0], study.subjects[0].kind
    q = pretty(unit("position", kind))
    errors = tables.compensation_errors(study)
    drift = tables.drift(study)
    return {
        "subject": subject,
        "paper": subject.name == "gripper rotation" and subject.simulated and len(study.subjects) > 1,
        "kind": kind,
        "unit": q,
        "law": study.adapted.adaptation.law,
        "step": "" if study.adapting.adaptation.step == "gradient" else study.adapting.adaptation.step,
        "gamma": ", ".join(number(g, 3) for g in study.adapting.adaptation.gamma),
        "assumptions": subject.assumptions,
        "errors": shown(_milli(errors)),
        "table_2": shown(tables.table_2(study)),
        "drift": shown(_drift(drift, q)),
        "ablation": shown(_ablation(tables.ablation(study), q)),
        "controllers": shown(_controllers(tables.controllers(study), kind)),
        "sampling": shown(_sampling(tables.sampling(study), q)),
        "counts": _counts(study),
        "band": study.band,
        "band_rms": [f"{1e3 * x:.3g}" for x in (*study.band.rms, study.band.rms_actual)] if study.band else [],
        "replays": shown(tables.replay(study)) if study.replays else None,
        "drawn": [f"replay-{k + 1}" for k in range(min(len(study.replays), _MOST_REPLAYS))],
        "of_replay": [
            (x.file, f"{x.begun}, by the {x.adaptation.law} law", x.verdict) for x in study.replays[:_MOST_REPLAYS]
        ],
    }


def _milli(frame: pd.DataFrame) -> pd.DataFrame:
    """Fig. 8's numbers as the page shows them: errors in thousandths."""
    errors = ("without", "true_model", "identified_model", "adaptive")
    frame = frame.drop(columns=["torque_without", "torque_with", "true_share"])
    frame[list(errors)] *= 1e3
    names = {"joint": "of", "frequency": "f (Hz)", "true_model": "true", "identified_model": "identified"}
    return frame.rename(
        columns=names | {"identified_share": "identified / without", "adaptive_share": "adaptive / without"}
    )


def _drift(frame: pd.DataFrame, q: str) -> pd.DataFrame:
    frame["rms_error"] = 1e3 * frame["rms_error"]
    names = {"joint": "of", "frequency": "frequency (Hz)", "rms_error": f"RMS error (m{q})"}
    return frame.rename(columns=names | {"over_known": "over known", "largest_gain": "farthest gain"})


def _ablation(frame: pd.DataFrame, q: str) -> pd.DataFrame:
    frame["rms_error"] = 1e3 * frame["rms_error"]
    names = {"rms_error": f"RMS error (m{q})", "over_none": "over none"}
    return frame.rename(columns=names | {"limit_cycle": "limit cycle", "over_compensated": "over-compensated"})


def _controllers(frame: pd.DataFrame, kind: Kind) -> pd.DataFrame:
    q, T = pretty(unit("position", kind)), pretty(unit("torque", kind))
    for column in ("rms_error", "peak_error"):
        frame[column] = 1e3 * frame[column]
    names = {"rms_error": f"RMS error (m{q})", "peak_error": f"peak error (m{q})", "rms_torque": f"RMS control ({T})"}
    return frame.rename(columns=names | {"chatter": f"chatter ({T}/s)", "energy": "energy (J)"})


def _sampling(frame: pd.DataFrame, q: str) -> pd.DataFrame:
    frame["period"], frame["distance"] = 1e3 * frame["period"], 1e3 * frame["distance"]
    return frame.rename(columns={"joint": "of", "period": "period (ms)", "distance": f"distance (m{q})"})


def _counts(study: Study) -> dict[str, int]:
    return {
        "tried": len(study.ablation),
        "cycling": sum(x.limit_cycle for x in study.ablation),
        "leading": sum(x.over_compensated for x in study.ablation),
        "diverging": sum(x.diverges for x in study.ablation),
    }
