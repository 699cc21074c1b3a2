"""One report of any question: the sections that the question builds, as a page, as text for the terminal, and as files."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pandas as pd

from bristle.findings import Finding
from bristle.page.columns import Table as Cells
from bristle.page.columns import shown
from bristle.page.page import Drawing, drawn, html, tables_of, versions, write_page
from bristle.page.wording import printable, slugs

_TEMPLATE = "bristle.page", "report.html"


class Table(NamedTuple):
    """A data frame as a CSV file and as a table of the page."""

    name: str
    """Of its file in tables/: lower case letters, digits, - and _. Tables of one name are parts of one frame."""
    title: str
    frame: pd.DataFrame
    """What the file holds."""
    part: pd.DataFrame | None = None
    """What the page shows of it; None: all. A column's heading is its name, and a parameter becomes its symbol."""
    note: str = ""
    """How to read it."""

    @property
    def cells(self) -> Cells:
        """Columns and rows of the page's table."""
        return shown(self.frame if self.part is None else self.part)


@dataclass(frozen=True, slots=True)
class Section:
    """One thought of a report. It knows no other section and no HTML; what it lacks is left out.

    The page shows title, text, findings, figure and table, in this order.
    """

    title: str
    """Without one the findings are in bold: the answer of the report."""
    _: KW_ONLY
    text: str = ""
    """Paragraphs, with an empty line between them."""
    findings: tuple[Finding, ...] = ()
    figure: Drawing | None = None
    """Its caption begins with a sentence that says what it shows, with a number."""
    table: Table | None = None
    lines: tuple[str, ...] | None = None
    """What the terminal prints of it; None: its findings."""
    turn: int = 0
    """The terminal prints small numbers first, and equal ones in the order of the page: there a conclusion comes last."""
    form: Literal["section", "part", "folded"] = "section"
    """A part has a smaller heading, as it belongs to the section above; what is folded opens with a click on its title."""


@dataclass(frozen=True, slots=True)
class Report:
    """What `report_of` makes of a result."""

    title: str
    sections: tuple[Section, ...]
    _: KW_ONLY
    about: str
    """What the report is about, in a sentence."""
    simulated: str = ""
    """What of it is SIMULATED, in a sentence; empty: nothing."""
    seed: int | None = None
    """Of the random numbers, where there are any."""
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    """Frames that become files and are not on the page, by name."""

    @property
    def frames(self) -> dict[str, pd.DataFrame]:
        """Every table, by the name of its file."""
        return dict(self.tables) | {s.table.name: s.table.frame for s in self.sections if s.table is not None}

    def text(self) -> str:
        """What the command prints: lines without control characters."""
        lines: list[str] = []
        for section in sorted(self.sections, key=lambda section: section.turn):
            lines += [x.flagged for x in section.findings] if section.lines is None else section.lines
        return "\n".join(map(printable, lines))

    def html(self) -> str:
        """The page. Its figures are part of it; its links to files need those that `write` puts beside it."""
        return html(*_TEMPLATE, self._named({}))

    def write(self, folder: Path | str) -> Path:
        """Write index.html, figures/ (SVG, PNG and CSV) and tables/ (CSV); returns the path of index.html.

        Only what bristle made in the folder is replaced. Raises InputError where the folder cannot be used, with nothing half-written.
        """
        files = tables_of(self.frames)
        return write_page(Path(folder), *_TEMPLATE, self._named(files), files)

    def _named(self, files: dict[str, bytes]) -> dict[str, Any]:
        """What the template names. Figures are rendered, into `files` as well."""
        sections = dict(zip(slugs([section.title for section in self.sections]), self.sections, strict=True))
        figures = drawn({slug: s.figure for slug, s in sections.items() if s.figure is not None}, files)
        return {**versions(self.seed), "report": self, "sections": sections, "figures": figures}
