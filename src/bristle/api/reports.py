"""The report of what a question found."""

from importlib import import_module
from typing import TYPE_CHECKING

from bristle.errors import InputError
from bristle.questions.sensitivity.study import SensitivityStudy
from bristle.questions.session_comparison.results import Comparison

if TYPE_CHECKING:
    from bristle.page.report import Report

_ROOMS = {Comparison: "session_comparison", SensitivityStudy: "sensitivity"}
"""The question whose `report.py` makes sections of each kind of result; it is imported only then, for it draws."""


def report_of(result: Comparison | SensitivityStudy) -> "Report":
    """What was found, as sections: `text()` is what the command prints, `write(folder)` the page with its figures and tables.

    >>> import bristle
    >>> first = bristle.identify("wrist.yaml")
    >>> report = bristle.report_of(bristle.compare(first, first))
    >>> report.write("page").name, sorted(report.frames)
    ('index.html', ['changes', 'sets'])

    Args:
        result: what `compare` or `sensitivity` gave.

    Raises InputError where it is anything else.
    """
    room = _ROOMS.get(type(result))
    if room is None:
        raise InputError(f"got a {type(result).__name__}; expected what compare or sensitivity gave")
    made: Report = import_module(f"bristle.questions.{room}.report").report(result)
    return made
