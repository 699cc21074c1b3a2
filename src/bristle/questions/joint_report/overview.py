"""All joints of a report in one table: of each the friction to use, the error on what was held out, and how many warnings."""

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from bristle.diagnostics import Severity
from bristle.identification.fits import Estimate
from bristle.identification.known_joint import chosen
from bristle.identification.results import Joint
from bristle.model.parameters import Lugre, ParameterName
from bristle.page.wording import measured, number, pretty
from bristle.questions.joint_report.sentences import distinct

_SHOWN = (*Lugre._fields, "inertia", "torque_constant")


def overview(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row a joint: each parameter with its standard error, systematic part included; `-` where the data do not tell it.

    The columns are the parameters that at least one joint has, then the relative error of what was held out, percent,
    and how many warnings are critical and how many call for caution.
    """
    rows = [dict(_row(joint)) for joint in joints]
    names = sorted({name for row in rows for name in row if name not in _ENDS}, key=_place)
    told = [name for name in names if any(name in row and row[name] != _UNTOLD for row in rows)]
    table = [
        [joint.name, *(row.get(name, "") for name in (*told, *_ENDS))] for joint, row in zip(joints, rows, strict=True)
    ]
    return pd.DataFrame(table, columns=["joint", *told, *_ENDS])


def untold(joints: Sequence[Joint]) -> tuple[str, ...]:
    """The parameters that were looked for, and that the data of no joint tell."""
    rows = [row for joint in joints for row in chosen(joint) if row.parameter.name in _SHOWN]
    told = {row.parameter for row in rows if row.estimate.value is not None}
    return tuple(sorted({str(row.parameter) for row in rows} - set(map(str, told)), key=_place))


_ENDS = ("held out (%)", "critical", "cautions")
_UNTOLD = "-"


def _row(joint: Joint) -> Iterator[tuple[str, str]]:
    for row in chosen(joint):
        if row.parameter.name in _SHOWN:
            yield str(row.parameter), _cell(row.estimate)
    errors = [h.relative_error for fit in (joint.moving, *joint.static.values()) if fit for h in fit.hold_out][:1]
    yield _ENDS[0], number(errors[0], 2) if errors else ""
    warnings = distinct(tuple(joint.all_warnings()))
    for name, severity in zip(_ENDS[1:], (Severity.CRITICAL, Severity.CAUTION), strict=True):
        yield name, str(sum(x.severity is severity for x in warnings) or "")


def _cell(e: Estimate) -> str:
    if e.value is None:
        return _UNTOLD
    return f"{measured(e.value, float(np.hypot(e.standard_error or 0.0, e.systematic or 0.0)))} {pretty(e.unit)}"


def _place(name: str) -> tuple[int, str]:
    return _SHOWN.index(ParameterName.parse(name).name), name
