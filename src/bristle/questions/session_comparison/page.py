"""What the page and the terminal show of two sessions compared: a table of changes, one of the sets, and a figure per joint."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from bristle.identification.fits import Estimate
from bristle.page.columns import shown
from bristle.page.page import write_part
from bristle.page.plain import pair
from bristle.page.wording import counted, measured, number, percent, pretty, printable, shortened, slugs, symbol
from bristle.questions.session_comparison.figures import forest_figure
from bristle.questions.session_comparison.results import Change, Comparison

_NONE = 1e-99
"""p-values below this are shown as below it."""
_DRAWN = 30
"""Joints with a figure."""
_LEAST = f"< {_NONE:g}"
_NAMES = {"adjusted_p": "p (Holm)", "changed": "changed?"}


def changes(compared: Comparison) -> pd.DataFrame:
    """One row per joint and parameter: both values, their difference with its joint uncertainty, and the verdict; nan where not comparable."""
    rows = [
        (
            c.joint, c.parameter.name, c.parameter.direction, c.unit, c.source, *_pair(c.first), *_pair(c.second),
            c.difference, c.error, c.z, c.p, c.adjusted, c.changed, str(c.verdict),
        )
        for c in compared.changes
    ]  # fmt: skip  # one row, one line
    numbers = [
        "first_value",
        "first_error",
        "second_value",
        "second_error",
        "difference",
        "error",
        "z",
        "p",
        "adjusted_p",
    ]
    columns = ["joint", "parameter", "direction", "unit", "source", *numbers, "changed", "verdict"]
    frame = pd.DataFrame(rows, columns=columns).astype(dict.fromkeys(numbers, float))
    frame["changed"] = frame["changed"].astype(object)
    return frame


def sets(compared: Comparison) -> pd.DataFrame:
    """One row per fit whose parameters were compared all at once."""
    rows = [
        (
            x.joint,
            x.source,
            len(x.names),
            x.statistic,
            x.freedom,
            x.p,
            x.adjusted,
            x.changed,
            ", ".join(map(str, x.names)),
        )
        for x in compared.sets
    ]
    columns = ["joint", "source", "parameters", "F", "freedom", "p", "adjusted_p", "changed", "names"]
    return pd.DataFrame(rows, columns=columns)


def write_comparison(compared: Comparison, folder: Path) -> Path:
    """Write the comparison as a page with figures and tables into a folder; returns the path of index.html. Raises as `write_part` does."""
    joints = list(compared.kinds)
    drawn: dict[str, tuple[Callable[[], Figure | None], str]] = {
        f"{slug}-changes": (partial(forest_figure, compared, joint), f"both sessions of {joint}")
        for joint, slug in zip(joints[:_DRAWN], slugs(joints), strict=False)
    }
    frames = {"changes": changes(compared), "sets": sets(compared)}
    context = {
        "title": joints[0] if len(joints) == 1 else f"{len(joints)} joints",
        "seed": None,
        "compared": compared,
        "drawn": _DRAWN,
        "joints": [_joint(compared, joint, slug) for joint, slug in zip(joints, slugs(joints), strict=True)],
    }
    return write_part(folder, "bristle.questions.session_comparison", "compare.html", context, drawn, frames)


def _joint(compared: Comparison, joint: str, slug: str) -> dict[str, Any]:
    """What the template names of one joint."""
    own = [c for c in compared.changes if c.joint == joint]
    frame, whole = changes(replace(compared, changes=tuple(own))), sets(compared)
    table = frame[["parameter", "direction", "unit", "source"]].copy()
    table["first session"] = [measured(*_pair(c.first)) for c in own]
    table["second session"] = [measured(*_pair(c.second)) for c in own]
    table["difference (%)"] = [None if c.percent is None else round(c.percent, 2) for c in own]
    table = table.join(frame[["z", "adjusted_p", "changed"]]).round({"z": 2})
    comparable = frame["source"] != ""
    return {
        "name": joint,
        "slug": slug,
        "caption": caption(own),
        "changes": shown(_few_digits(table[comparable]).rename(columns=_NAMES)),
        "rest": shown(frame[~comparable][["parameter", "direction", "verdict"]]),
        "sets": shown(_few_digits(whole[whole["joint"] == joint].drop(columns=["names", "p"])).rename(columns=_NAMES)),
    }


def _few_digits(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with its p-values in two digits, or as below the least that is shown, and what is no number as None."""
    few = [_LEAST if p < _NONE else float(f"{p:.2g}") for p in frame["adjusted_p"]]
    frame = frame.assign(adjusted_p=pd.Series(few, index=frame.index, dtype=object))
    return frame.astype(object).where(frame.notna(), None)


def caption(changes: Sequence[Change]) -> str:
    """What the figure of one joint shows: the largest change in percent, or that none changed."""
    compared = [c for c in changes if c.changed is not None]
    of, moved = counted(len(compared), "parameter"), [c for c in compared if c.changed]
    if not moved:
        far = number(max((abs(c.z or 0.0) for c in compared), default=None), 2)
        return f"None of {of} changed beyond its joint uncertainty; differences are {far} standard errors at most."
    most = max(moved, key=lambda c: abs(c.percent or 0.0))
    way = "rose" if (most.difference or 0.0) > 0 else "fell"
    return f"{len(moved)} of {of} changed; the largest change: {symbol(most.parameter)} {way} by {_size(most)}."


def _size(c: Change) -> str:
    """Of a change, with its error: in percent of the first session's value, or in the parameter's unit where that is zero."""
    if c.first is None or c.percent is None:
        return f"{measured(abs(c.difference or 0.0), c.error)} {pretty(c.unit)}"
    return f"{measured(abs(c.percent), percent(c.first.value, c.error))} %"


def _pair(e: Estimate | None) -> tuple[float | None, float | None]:
    return (None, None) if e is None else (e.value, e.standard_error)


def text(compared: Comparison) -> str:
    """The comparison as plain text, without control characters."""
    return "\n".join(map(printable, _lines(compared)))


def _lines(compared: Comparison) -> Iterator[str]:
    for joint in compared.kinds:
        own = [c for c in compared.changes if c.joint == joint]
        yield f"[[{joint}]] {compared.kinds[joint]}{', SIMULATED data' if compared.simulated else ''}"
        yield from (_line(c) for c in own)
        yield from (
            f"  {x.source}, {len(x.names)} parameters as a set: F = {x.statistic:.3g}, p {_p(x.adjusted)} (Holm): "
            f"{'changed' if x.changed else 'no change'}"
            for x in compared.sets
            if x.joint == joint
        )
    yield from (f"warning: {x.coded}" for x in compared.warnings)
    yield str(compared.sentence)
    yield from (f"perhaps: {x}" for x in compared.hints)


def _line(c: Change) -> str:
    name = f"  {shortened(str(c.parameter), 12):<12}"
    if c.changed is None or c.first is None or c.second is None:
        return f"{name} {c.verdict}"
    a, b = (f"{pair(e.value, e.standard_error)} {c.unit}" for e in (c.first, c.second))
    return f"{name} {a} -> {b} ({c.source}): {number(c.z, 3)} standard errors, p {_p(c.adjusted)} (Holm). {c.verdict}"


def _p(p: float | None) -> str:
    """A p-value with its sign of comparison."""
    return _LEAST if p is not None and p < _NONE else f"= {number(p, 2)}"
