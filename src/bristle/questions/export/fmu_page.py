"""The page inside an FMU: what it holds, where its numbers are from, its variables, and how it is stepped."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from bristle.errors import one_line
from bristle.page.page import encoded, tables_of
from bristle.page.report import Report, Section, Table

if TYPE_CHECKING:
    from bristle.questions.export.fmu import FmuVariable

_USE = (
    "A communication step is cut into equal internal steps, none longer than longest_step; the torque is held over it. The default longest_step is "
    "a fiftieth of the shorter one of two times, of both directions: sqrt(inertia / sigma_0) and inertia v_s / (alpha_0 + alpha_1). A value out of "
    "its range, a step of no length and a communication point that is not the end of the last step are refused, with the reason to the logger; "
    "the instance stays as it was."
)


def fmu_page(
    title: str, holds: str, lines: Sequence[str], variables: Sequence["FmuVariable"], *, simulated: bool
) -> dict[str, bytes]:
    """What the FMU says of itself, and the table beside it, by relative path; `lines` are those of `artefact.notes`."""
    frame = pd.DataFrame(
        {
            "name": v.name, "unit": v.unit, "what": f"{v.what}, {v.causality}, {v.variability}",
            "range": "" if v.start is None else f"{v.low!r} to {v.high!r}", "start value": "" if v.start is None else repr(v.start),
        }
        for v in variables
    )  # fmt: skip  # a table
    report = Report(
        title,
        (
            Section("Where the numbers are from", text="\n\n".join(one_line(line, 10_000) for line in lines)),
            Section("Variables", table=Table("variables", "Every variable, its range and its start", frame)),
            Section("Use", text=_USE),
        ),
        about=f"{holds[0].upper()}{holds[1:]}. FMI 2.0 for co-simulation: torque in; position, velocity, friction and the deflection z "
        "of the bristle out.",
        simulated="The joint was identified from simulated data." if simulated else "",
    )
    return {"index.html": encoded(report.html()), **tables_of(report.frames)}
