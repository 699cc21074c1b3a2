"""What the page of `bristle sensitivity` shows: tables, sentences, and the values that its template names."""

import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bristle.identification.fisher import names_of
from bristle.model.parameters import Lugre, unit
from bristle.page.columns import shown
from bristle.page.page import write_part
from bristle.page.wording import number, pretty, slugs, symbol
from bristle.questions.sensitivity import figures
from bristle.questions.sensitivity.local import claimed, ranked
from bristle.questions.sensitivity.sobol_figures import sobol_figure, sobol_frame, sobol_sentences
from bristle.questions.sensitivity.study import Expected, Exploration

_UNSEEN = 0.5
"""A parameter with a larger standard error than this share of its value is not identifiable from a measurement."""
_ANY = ("offset", "gravity", "inertia")
"""What may well be zero: identifiable with any finite standard error."""
_NAMED = 3
"""Parameters whose shares a sentence names."""
_COLUMNS = {
    "standard_error": "expected standard error", "percent": "of the value (%)", "own_standard_error": "of the joint's fit",
    "seen": "identifiable?",
}  # fmt: skip  # a table of words
_NAMES = re.compile(rf"\b(?:{'|'.join(Lugre._fields)})\b[+-]?")
Frame = pd.DataFrame


def write_sensitivity(x: Exploration, folder: Path) -> Path:
    """Write what was explored as a page with figures and tables; returns the path of index.html. Raises as `write_part` does."""
    kinds = ("time", "shares", "first", "map", "tornado")
    labels = (
        "derivatives over time", "shares of the torque", "first parameter over amplitude and frequency",
        "shares over amplitude and frequency", "tornado charts",
    )  # fmt: skip  # a list of values
    draw: dict[str, Any] = {
        kind: (partial(getattr(figures, f"{kind}_figure"), x), f"{label} of {x.name}")
        for kind, label in zip(kinds, labels, strict=True)
    }
    for k, expected in enumerate(x.expected):
        drawn = partial(figures.correlation_figure, x, expected)
        draw[f"correlation-{k + 1}"] = (drawn, f"correlation of estimates from {expected.what}")
    if x.sobol is not None:
        drawn_sobol = partial(sobol_figure, x.sobol, x.kind, name=x.name, simulated=x.simulated)
        draw["sobol"] = (drawn_sobol, f"Sobol indices of {x.name}")
    return write_part(folder, "bristle.questions.sensitivity", "sensitivity.html", context(x), draw, frames(x))


def frames(x: Exploration) -> dict[str, Frame]:
    """Every table by the name of its file."""
    found = {
        "parameters": parameters(x), "shares": shares(x), "map": mapped(x), "tornado": swings(x),
        "information": pd.concat([information(x, e) for e in x.expected], ignore_index=True),
    }  # fmt: skip  # a table
    if x.formulas is not None:
        found["formulas"] = pd.DataFrame(x.formulas.rows())
    if x.sobol is not None:
        found["sobol"] = sobol_frame(x.sobol, x.kind)
    return found


def parameters(x: Exploration) -> Frame:
    """One row per parameter: value, unit, 95 % interval, whether it was assumed."""
    sets = [x.model.p] if isinstance(x.model.p, Lugre) else list(x.model.p)
    values = [value for p in sets for value in p]
    rows = []
    for name, value in zip(names_of(x.model.p), values, strict=True):
        lower, upper = x.box.get(name, x.box.get(name.rstrip("+-"), (None, None)))
        rows.append(
            {
                "parameter": name, "value": value, "unit": unit(name.rstrip("+-"), x.kind), "lower": lower, "upper": upper,
                "assumed": name in x.model.assumed,
            }
        )  # fmt: skip  # a table
    return pd.DataFrame(rows).astype({"lower": object, "upper": object})


def shares(x: Exploration) -> Frame:
    """RMS of p dT_f / dp over the RMS of T_f: total, at fixed z, and total over the last period; the largest total first."""
    columns = (x.local.shares(), x.local.shares(partial=True), x.settled)
    rows = [
        {"rank": k + 1, "parameter": name, **dict(zip(("total", "partial", "settled"), values, strict=True))}
        for k, name in enumerate(x.local.ranking)
        for values in [[float(column[Lugre._fields.index(name)]) for column in columns]]
    ]
    return pd.DataFrame(rows)


def mapped(x: Exploration) -> Frame:
    """One row per motion: amplitude, frequency, every parameter's share, which is first, and whether the paper's two are the first two."""
    a, f = np.meshgrid(x.map.amplitudes, x.map.frequencies, indexing="ij")
    own = x.map.shares.reshape(-1, len(Lugre._fields))
    frame = pd.DataFrame({"amplitude": a.ravel(), "frequency": f.ravel()})
    frame[list(Lugre._fields)] = own
    frame["first"] = [ranked(row)[0] for row in own]
    frame["claim"] = x.map.claim.ravel()
    return frame


def swings(x: Exploration) -> Frame:
    """One row per output and parameter: the output as it is, and at both ends of the parameter's interval."""
    columns = ("output", "value", "unit", "parameter", "at_low", "at_high")
    rows = [
        (chart.output, chart.value, unit(chart.quantity, x.kind), s.parameter, s.at_low, s.at_high)
        for chart in x.tornado
        for s in chart.swings
    ]
    return pd.DataFrame(rows, columns=list(columns))


def information(x: Exploration, expected: Expected) -> Frame:
    """One row per parameter of a measurement: expected standard error, in percent of the value, that of the joint's fit, whether it is seen."""
    info = expected.information
    rows = []
    for name, value, error in zip(info.names, info.point.tolist(), info.standard_errors.tolist(), strict=True):
        seen = error < _UNSEEN * abs(value) or (name.startswith(_ANY) and np.isfinite(error))
        rows.append(
            {
                "measurement": expected.what, "parameter": name, "value": value, "unit": unit(name.rstrip("+-"), x.kind),
                "standard_error": error if seen else None, "percent": 100 * error / abs(value) if seen and value else None,
                "own_standard_error": expected.errors.get(name), "seen": bool(seen),
            }
        )  # fmt: skip  # a table
    return pd.DataFrame(rows).astype({"standard_error": object, "percent": object, "own_standard_error": object})


def said(x: Exploration) -> list[str]:
    """What was found, in sentences."""
    own = x.local.shares()
    order = x.local.ranking
    listed = ", ".join(f"{symbol(name)} {number(float(own[Lugre._fields.index(name)]), 2)}" for name in order[:_NAMED])
    a = f"{number(x.motion.amplitude, 3)} {pretty(unit('position', x.kind))} at {number(x.motion.frequency, 3)} Hz"
    holds = "holds" if claimed(own) else "does not hold"
    first = f"The paper's claim that α₀ and α₂ matter most {holds} for {a}: RMS of p · dT/dp over that of T is {listed} (total)."
    frozen = ranked(x.local.shares(partial=True))
    other = f"At fixed z the order would be {', '.join(map(symbol, frozen[:_NAMED]))}: what the bristle does with a parameter counts."
    last = ranked(x.settled)
    if last[:_NAMED] != order[:_NAMED]:
        listed = ", ".join(f"{symbol(n)} {number(float(x.settled[Lugre._fields.index(n)]), 2)}" for n in last[:_NAMED])
        first += f" In its last period, when the bristle's first deflection is over: {listed}."
    rest = [_of_information(x, e) for e in x.expected]
    return [first, *([other] if frozen[:_NAMED] != order[:_NAMED] else []), *_where(x), *rest]


def _symbols(sentence: str) -> str:
    """A sentence with the parameters' names as their symbols, and its units in print."""
    return pretty(_NAMES.sub(lambda found: symbol(found[0]), sentence))


def text(x: Exploration) -> list[str]:
    """What the command line prints, a line each."""
    of = unit("torque", x.kind).replace("**", "^")
    lines = [
        f"{x.name}{' (SIMULATED data)' if x.simulated else ''}: RMS of p dT/dp over the RMS of T ({of}), by parameter"
    ]
    lines.append(f"  {'':<8} {'total':>9} {'fixed z':>9} {'settled':>9}")
    for _, name, *values in shares(x).itertuples(index=False, name=None):
        lines.append(f"  {name:<8} " + " ".join(f"{value:>9.2g}" for value in values))
    return [
        *lines,
        *said(x),
        *(() if x.sobol is None else sobol_sentences(x.sobol, x.kind)),
        *map(_symbols, x.assumptions),
    ]


def _where(x: Exploration) -> list[str]:
    """Where on the map the claim holds."""
    claim, a = x.map.claim, x.map.amplitudes
    q = pretty(unit("position", x.kind))
    parts = []
    for j in dict.fromkeys((0, int(np.argmin(np.abs(x.map.frequencies - x.motion.frequency))), claim.shape[1] - 1)):
        broken = np.flatnonzero(~claim[:, j])
        at = f"at {number(float(x.map.frequencies[j]), 2)} Hz"
        if broken.size == 0:
            parts.append(f"{at} at every amplitude")
        elif broken[-1] + 1 == a.size:
            parts.append(f"{at} not at the largest amplitude")
        else:
            parts.append(f"{at} from {number(float(a[broken[-1] + 1]), 2)} {q} up")
    first = [Lugre._fields[k] for k in np.unique(x.map.first)]
    ranks = f"First in rank somewhere: {', '.join(map(symbol, first))}."
    return [f"Of {claim.size} motions on the map it holds for {int(claim.sum())}: {', '.join(parts)}. {ranks}"]


def _of_information(x: Exploration, expected: Expected) -> str:
    """Which parameters a measurement sees, and which of its directions it hardly does."""
    frame = information(x, expected)
    lost = [symbol(name) for name in frame.loc[~frame["seen"], "parameter"]]
    start = f"From {expected.what} alone"
    found = f"{start} all of {', '.join(map(symbol, expected.information.names))} are identifiable"
    if lost:
        found = f"{start} {', '.join(lost)} would not be identifiable (standard error over half the value)"
    return " ".join([f"{found}.", *map(_symbols, expected.information.unseen)])


def context(x: Exploration) -> Mapping[str, Any]:
    """What the template names."""
    table = None if x.formulas is None else pd.DataFrame(x.formulas.rows())
    T = pretty(unit("torque", x.kind))
    informed = [
        {
            "what": e.what, "noise": _symbols(e.noise), "unseen": [*map(_symbols, e.information.unseen)],
            "table": shown(information(x, e).drop(columns="measurement").rename(columns=_COLUMNS)),
        }
        for e in x.expected
    ]  # fmt: skip  # a table
    return {
        "title": x.name,
        "simulated": x.simulated,
        "seed": None if x.sobol is None else x.seed,
        "kind": x.kind,
        "T": T,
        "q": pretty(unit("position", x.kind)),
        "motion": x.motion,
        "said": said(x),
        "assumptions": [*map(_symbols, x.assumptions)],
        "assumed": [symbol(name) for name in x.model.assumed],
        "parameters": shown(parameters(x).rename(columns={"assumed": "assumed?"})),
        "shares": shown(shares(x).rename(columns={"partial": "at fixed z", "settled": "total, last period"})),
        "informed": informed,
        "printed": [] if x.formulas is None else x.formulas.sentences(),
        "formulas": None if table is None else shown(table[["what", "with_g"]].rename(columns={"with_g": "formula"})),
        "latex": None if table is None else shown(table[["what", "latex"]]),
        "sobol": None if x.sobol is None else shown(sobol_frame(x.sobol, x.kind)),
        "sobol_said": () if x.sobol is None else sobol_sentences(x.sobol, x.kind),
        "slug": slugs([x.name])[0],
    }
