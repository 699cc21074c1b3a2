"""Friction models side by side, as a table and as the page shows them."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.columns import shown
from bristle.page.wording import number, pretty

_NAMES = {"aicc": "ΔAICc", "bic": "ΔBIC", "hold_out": "hold-out (%)", "recommended": "use it?"}


def models(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per joint, data and model: parameters, rms, relative error, AICc and BIC above the lowest, hold-out error, which to use."""
    columns = [
        "model",
        "directions",
        "parameters",
        "rms",
        "relative_error",
        "aicc",
        "bic",
        "hold_out",
        "candidate",
        "recommended",
    ]
    rows = [
        (joint.name, x.data, *(getattr(row, name) for name in columns))
        for joint in joints
        for x in joint.models
        for row in x.rows
    ]
    frame = pd.DataFrame(rows, columns=["joint", "data", *columns])
    numbers = ["rms", "relative_error", "aicc", "bic", "hold_out"]
    return frame.astype({**dict.fromkeys(numbers, float), "candidate": bool, "recommended": bool})


def models_section(joint: Joint) -> list[dict[str, Any]]:
    """What the template names of each comparison."""
    frame, torque = models([joint]), pretty(unit("torque", joint.kind))
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
