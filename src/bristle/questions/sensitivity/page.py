"""What the page of `bristle sensitivity` shows: its figures, and the values that its template names."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from bristle.model.parameters import effort, unit
from bristle.page.columns import shown
from bristle.page.page import write_part
from bristle.page.wording import in_print, pretty, symbol
from bristle.questions.sensitivity import figures
from bristle.questions.sensitivity.study import SensitivityStudy
from bristle.questions.sensitivity.tables import (
    information_table,
    parameter_table,
    share_table,
    sobol_table,
    tables,
)
from bristle.questions.sensitivity.text import findings, sobol_sentences

_COLUMNS = {
    "standard_error": "expected standard error", "percent": "of the value (%)", "own_standard_error": "standard error of the joint's fit",
    "seen": "identifiable?",
}  # fmt: skip  # a table of words


def write_sensitivity(study: SensitivityStudy, folder: Path) -> Path:
    """Write what was found as a page with figures and tables; returns index.html. Raises as `write_part` does."""
    drawn: dict[str, Any] = {
        "time": (figures.time_figure, "derivatives over time"),
        "shares": (figures.shares_figure, "shares of the torque"),
        "first": (figures.first_figure, "first parameter vs amplitude and frequency"),
        "map": (figures.map_figure, "shares vs amplitude and frequency"),
        "tornado": (figures.tornado_figure, "tornado charts"),
    }
    draw: dict[str, Any] = {
        name: (partial(figure, study), f"{label} of {study.name}") for name, (figure, label) in drawn.items()
    }
    for k, expected in enumerate(study.expected):
        correlation = partial(figures.correlation_figure, study, expected)
        draw[f"correlation-{k + 1}"] = (correlation, f"correlation of estimates from {expected.what}")
    if study.sobol is not None:
        bars = partial(figures.sobol_figure, study.sobol, study.kind, name=study.name, simulated=study.simulated)
        draw["sobol"] = (bars, f"Sobol indices of {study.name}")
    return write_part(folder, "bristle.questions.sensitivity", "sensitivity.html", context(study), draw, tables(study))


def context(study: SensitivityStudy) -> Mapping[str, Any]:
    """What the template names."""
    measurements = [
        {
            "what": e.what, "noise": " ".join(map(in_print, e.noise)), "unseen": e.information.unseen,
            "table": shown(information_table(study, e).drop(columns="measurement").rename(columns=_COLUMNS)),
        }
        for e in study.expected
    ]  # fmt: skip  # a table
    return {
        "title": study.name,
        "simulated": study.simulated,
        "seed": None if study.sobol is None else study.seed,
        "effort": effort(study.kind),
        "T": pretty(unit("torque", study.kind)),
        "q": pretty(unit("position", study.kind)),
        "motion": study.motion,
        "findings": findings(study),
        "assumptions": study.assumptions,
        "assumed": [symbol(name) for name in study.model.assumed],
        "parameters": shown(parameter_table(study).rename(columns={"assumed": "assumed?"})),
        "shares": shown(share_table(study).rename(columns={"partial": "at fixed z", "settled": "total, last period"})),
        "measurements": measurements,
        "formulas": _formulas(study),
        "sobol": None if study.sobol is None else shown(sobol_table(study.sobol, study.kind)),
        "sobol_sentences": [] if study.sobol is None else sobol_sentences(study.sobol, study.kind),
    }


def _formulas(study: SensitivityStudy) -> dict[str, Any] | None:
    """Formulas as text and as LaTeX, and what they say of the printed (19); None where there are none."""
    if study.formulas is None:
        return None
    table = pd.DataFrame(study.formulas.rows())
    return {
        "sentences": study.formulas.sentences(),
        "text": shown(table[["what", "with_g"]].rename(columns={"with_g": "formula"})),
        "latex": shown(table[["what", "latex"]]),
    }
