"""What the page of `bristle sensitivity` shows: its figures, and the values that its template names."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.model.parameters import Kind, effort, unit
from bristle.page.columns import shown
from bristle.page.page import write_part
from bristle.page.wording import in_percent, in_print, measured, number, pretty, symbol
from bristle.questions.sensitivity import figures
from bristle.questions.sensitivity.local import CLAIMED
from bristle.questions.sensitivity.sobol import Global
from bristle.questions.sensitivity.study import Expected, SensitivityStudy
from bristle.questions.sensitivity.tables import (
    information_table,
    parameter_table,
    share_table,
    sobol_table,
    tables,
)
from bristle.questions.sensitivity.text import findings, output_name, sobol_sentences

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
        "captions": captions(study),
        "assumptions": study.assumptions,
        "assumed": [symbol(name) for name in study.model.assumed],
        "parameters": shown(parameter_table(study).rename(columns={"assumed": "assumed?"})),
        "shares": shown(share_table(study).rename(columns={"partial": "at fixed z", "settled": "total, last period"})),
        "measurements": measurements,
        "formulas": _formulas(study),
        "sobol": None if study.sobol is None else shown(sobol_table(study.sobol, study.kind)),
        "sobol_sentences": [] if study.sobol is None else sobol_sentences(study.sobol, study.kind),
    }


def captions(study: SensitivityStudy) -> dict[str, str]:
    """What each figure shows, in a sentence with a number: the beginning of its caption."""
    found = {
        "time": _largest_change(study),
        "shares": _shares(study),
        "first": _claim(study),
        "map": _most_varied(study),
        **{f"correlation-{k + 1}": _correlation(expected) for k, expected in enumerate(study.expected)},
        "sobol": "" if study.sobol is None else _largest_index(study.sobol, study.kind),
    }
    return {name: f"{text}." for name, text in found.items() if text}


def _largest_change(study: SensitivityStudy) -> str:
    """The peak of what is drawn, and where another parameter has it, that of the second half, without the first deflection."""
    k = figures.in_view(study)
    (name, whole), (later, half) = (_peak(study, part) for part in (k, k[k.size // 2 :]))
    more = f"; in the second period {later} does, by up to {half}" if later != name else ""
    return f"To first order, doubling {name} changes the {effort(study.kind)} most, by up to {whole}{more}"


def _peak(study: SensitivityStudy, samples: NDArray[np.intp]) -> tuple[str, str]:
    """The parameter with the largest total derivative among samples; its size, and when."""
    total = np.abs(study.local.total[samples])
    sample, which = np.unravel_index(total.argmax(), total.shape)
    size = f"{number(total[sample, which], 2)} {pretty(unit('torque', study.kind))}"
    return symbol(study.local.names[which]), f"{size} at {number(study.local.time[samples][sample], 3)} s"


def _shares(study: SensitivityStudy) -> str:
    shares, order = dict(zip(study.local.names, study.local.shares().tolist(), strict=True)), study.local.ranking
    (most, largest), (least, smallest) = ((symbol(name), in_percent(shares[name])) for name in (order[0], order[-1]))
    return f"{most} has the largest total share of the RMS {effort(study.kind)}, {largest}, and {least} the smallest, {smallest}"


def _claim(study: SensitivityStudy) -> str:
    claim, names = study.map.claim, " and ".join(map(symbol, sorted(CLAIMED)))
    held = in_percent(float(claim.mean()))
    return f"{names} have the two largest shares in {held} of the map, {claim.sum()} of {claim.size} motions"


def _most_varied(study: SensitivityStudy) -> str:
    low, high = (end(study.map.shares, axis=(0, 1)) for end in (np.min, np.max))
    k = int((high - low).argmax())
    least = f"less than {in_percent(figures.LEAST)}" if low[k] < figures.LEAST else in_percent(low[k])
    return f"The share of {symbol(study.map.names[k])} varies most over the map, from {least} to {in_percent(high[k])}"


def _correlation(expected: Expected) -> str:
    """The largest of two parameters that are seen, then how many are not."""
    names, of = expected.information.names, len(expected.information.names)
    seen = np.flatnonzero(np.isfinite(expected.information.standard_errors))
    lost = f"{of - seen.size} of {of} parameters cannot be estimated (×)" if seen.size < of else ""
    if seen.size < 2:
        return f"There is no correlation to show: {lost or 'there is 1 parameter'}"
    between = np.triu(expected.information.correlation[np.ix_(seen, seen)], 1)
    i, j = np.unravel_index(np.abs(between).argmax(), between.shape)
    pair = f"{symbol(names[seen[i]])} and {symbol(names[seen[j]])}"
    return f"The strongest correlation, {figures.correlated(between[i, j])}, is that of {pair}" + (lost and f"; {lost}")


def _largest_index(sobol: Global, kind: Kind) -> str:
    """Over all outputs, then how many of them have none."""
    found = [(effect, x) for x in sobol.outputs if x.indices is not None for effect in x.indices.effects]
    bare = sum(x.indices is None for x in sobol.outputs)
    lost = f"{bare} of {len(sobol.outputs)} outputs cannot be analysed" if bare else ""
    if not found:
        return lost[:1].upper() + lost[1:]
    effect, output = max(found, key=lambda x: x[0].total)
    index = measured(effect.total, effect.total_half)
    name = output_name(output.name, kind)
    return f"{symbol(effect.parameter)} has the largest total index, {index} for the {name}" + (lost and f"; {lost}")


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
