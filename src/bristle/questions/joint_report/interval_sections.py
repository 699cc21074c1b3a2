"""What the page shows of every interval three ways, and of how the runs scatter beside them."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.wording import FITS, counted, in_print, number, span
from bristle.questions.joint_report.interval_tables import WAYS, rows, scatter

INTRO = (
    "Each 95 % interval by the covariance of the exact Jacobian, by the profile of the cost (the parameter held, all "
    "others re-optimised), and by the bootstrap (fits of resampled data). Use the interval by profile; for fits of "
    "moving runs that by covariance. Where the bounds differ by more than 1.5x, the last column says why."
)


def intervals(joint: Joint, figures: Mapping[str, Drawing]) -> list[Section]:
    """A table per fit with each interval in one cell, the scatter of the runs, and a figure per fit."""
    every, by_fit = list(rows(joint)), dict[str, list[tuple[Any, ...]]]()
    for x in every:
        name = str(ParameterName(x.parameter, Direction(x.direction)))
        ends = (span(getattr(x.three, way)) for way in WAYS)
        warnings = " ".join(map(in_print, x.three.warnings))
        by_fit.setdefault(FITS.get(x.fit, x.fit), []).append((name, x.estimate.value, *ends, x.estimate.unit, warnings))
    columns = ["parameter", "value", *WAYS, "unit", "warnings"]
    sections = [
        Section("", table=Table("uncertainty", fit.capitalize(), part=pd.DataFrame(own, columns=columns)), form="part")
        for fit, own in by_fit.items()
    ]
    missing = [FITS[kind] for kind, fit in moving_fits(joint).items() if not fit.uncertainty]
    if missing and every:
        add = "Their profiles and bootstrap take time: bristle report … --uncertainty adds them."
        sections.append(Section("", text=f"Not included: {' and '.join(missing)}. {add}", form="part"))

    scattered = [
        (
            FITS.get(kind, kind), str(ParameterName(name, Direction(d))), number(x.before, 3), number(x.after, 3), f"{x.widened:.3g}",
            ", ".join(number(value) for value in x.by_run.values()),
        )
        for kind, d, name, x in scatter(joint)
    ]  # fmt: skip  # one row, one line
    if scattered:
        how = (
            "How far the runs' estimates scatter beside their own standard errors: √(χ² / (k − 1)) over k runs, 1 "
            "where chance "
            "alone tells them apart. Where that is significant at 1 %, standard errors and intervals are widened by it."
        )
        frame = pd.DataFrame(scattered, columns=["fit", "parameter", "before", "after", "error times", "each run"])
        table = Table("repeats", "Scatter over the runs", part=frame)
        sections.append(Section("Each run fitted apart", text=how, table=table, form="folded"))

    apart = sum(any(w.code == "intervals-differ" for w in x.three.warnings) for x in every)
    of = f"Of {counted(len(every), 'parameter')} of this joint {apart or 'none'}"
    caption = f"{of} {'has' if apart <= 1 else 'have'} bounds that differ by more than 1.5x."
    how = (
        "Per parameter: change of cost with all others re-optimised, 0 at the minimum and 1 at the 95 % threshold "
        "(dotted); bootstrap samples (grey); below, the intervals by covariance (top), profile and bootstrap (bottom); "
        "dashed: the estimate."
    )
    if held := " and ".join(own.symbol for own in joint.law.peak.own):
        caption += f" The drawn cost holds {held} at its estimate; the profile intervals are over all that the data allow of it."
    drawn = [x for kind, x in figures.items() if kind.startswith("uncertainty-")]
    if drawn:
        own = tuple(x._replace(caption=caption, how=how, data="uncertainty") for x in drawn)
        sections.append(Section("", figures=own, form="part"))
    return sections
