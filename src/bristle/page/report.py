"""One report of any question: the sections that it builds, as pages, as text for the terminal, and as files."""

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pandas as pd

from bristle.findings import Finding
from bristle.page.output_folder import replace_files, zipped
from bristle.page.page import Drawing, cell_text, drawn, encoded, heading, html, tables_of, versions
from bristle.page.plain import columns, typed
from bristle.page.said import Link, Said, told, with_places
from bristle.page.wording import printable, slugs
from bristle.progress import Progress, step, teller


class Cells(NamedTuple):
    """A table of the page."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


class Table(NamedTuple):
    """A data frame as a CSV file and as a table of the page."""

    name: str
    """Of its file in tables/: lower case letters, digits, - and _. Tables of one name are parts of one frame.

    Empty: there is no file.
    """
    title: str
    frame: pd.DataFrame | None = None
    """What the file holds; None: what the report's own `tables` have of that name."""
    part: pd.DataFrame | None = None
    """What the page shows of it; None: all. A column's heading is its name, and a parameter becomes its symbol."""
    note: str = ""
    """How to read it; a page says it once."""

    @property
    def cells(self) -> Cells:
        """What the page shows, without the joint's name and without columns that say nothing in any row."""
        frame = next(x for x in (self.part, self.frame, pd.DataFrame()) if x is not None)
        telling = [frame.empty or any(x not in ("", ()) for x in frame[c].dropna()) for c in frame]
        frame = frame.loc[:, telling].drop(columns="joint", errors="ignore")
        rows = frame.astype(object).itertuples(index=False, name=None)
        return Cells(tuple(map(str, frame.columns)), tuple(rows))


class Cell(NamedTuple):
    """A value in an answer."""

    value: str = ""
    below: tuple[str, ...] = ()
    """Small lines under it, such as its interval."""


class Answered(NamedTuple):
    """One thing of an answer, such as a joint: a verdict on it, and its values."""

    name: Link
    line: tuple[Said, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]
    """Each begins with its label, such as a direction."""
    whole: tuple[Cell | Drawing, ...] = ()
    """One cell for each column beside the rows: a value that holds for all rows, or a small drawing."""


class Answer(NamedTuple):
    """The first screen of a report: for each thing, such as a joint, a verdict and values."""

    of: str
    """Heading of the column of row labels."""
    columns: tuple[tuple[str, str], ...]
    """Parameter and unit; no unit if the things have different ones."""
    things: tuple[Answered, ...]
    whole: tuple[str, ...] = ()
    """The headings of the columns beside the rows."""
    note: str = ""
    """How to read it."""


@dataclass(frozen=True, slots=True)
class Section:
    """One thought of a report. It knows no other section and no HTML; what it lacks is left out.

    The page shows title, text, facts, findings, answer, figures and table, in this order.
    """

    title: str
    """Without one the findings are in bold: the answer of the report."""
    _: KW_ONLY
    about: str = ""
    """Beside the title, smaller."""
    text: str | tuple[Said, ...] = ""
    """Paragraphs, with an empty line between them; or the parts of one."""
    facts: tuple[tuple[str, Said | tuple[Said, ...]], ...] = ()
    """Lines, each after what it is about."""
    findings: tuple[Finding, ...] = ()
    """Each stands once, after its subjects. A note has no link to its code, unless they are `coded`."""
    coded: bool = False
    answer: Answer | None = None
    figure: Drawing | None = None
    """Its caption begins with a sentence that says what it shows, with a number."""
    figures: tuple[Drawing, ...] = ()
    """Several, side by side where there is room."""
    table: Table | None = None
    lines: tuple[str, ...] | None = None
    """What the terminal prints of it; None: its findings."""
    turn: int = 0
    """The terminal prints small numbers first, and equal ones in the order of the page: there a conclusion comes last."""
    form: Literal["section", "part", "folded", "unfolded"] = "section"
    """A part has a smaller heading, as it belongs to the section above; what is folded opens with a click on its title, and
    what is unfolded closes with one."""
    id: str = ""
    """What links from other pages call it; empty: a name after its title."""

    @property
    def drawings(self) -> tuple[Drawing, ...]:
        """All that is to be drawn for it."""
        beside = (cell for x in self.answer.things for cell in x.whole) if self.answer else ()
        return tuple(x for x in (*beside, self.figure, *self.figures) if isinstance(x, Drawing))

    def plain(self) -> Iterator[str]:
        """The section for a terminal, without pictures and how to read them; lines may be longer than 80 columns."""
        title = self.title or (self.table.title if self.table else "")
        lines = [f"  [[{title}]]"] * bool(title)
        lines += [
            f"    {x}" for x in (self.text.split("\n\n") if isinstance(self.text, str) else [told(self.text)]) if x
        ]
        lines += [f"    {about}: {told(said)}" for about, said in self.facts]
        for where, x in with_places(self.findings, str):
            lines.append(f"    {x.severity}{f' ({where})' if where else ''}: {x.coded}")
        if self.table is not None:
            names, rows = self.table.cells
            cells = [map(heading, names), *(map(cell_text, row, names) for row in rows)]
            lines += columns([[typed(x) for x in row] for row in cells], indent=4) if rows else ()
        return (typed(printable(line)) for line in lines)


@dataclass(frozen=True, slots=True)
class Page:
    """A further page of a report. Without sections it is one of the report's files."""

    file: str
    name: str
    """In the menu, and its heading."""
    purpose: str
    """What it is for, in half a sentence."""
    sections: tuple[Section, ...] = ()
    _: KW_ONLY
    text: str = ""
    """Below its heading."""

    @property
    def heads(self) -> dict[str, Section]:
        """Its sections by their ids."""
        names = slugs([section.title for section in self.sections])
        return {x.id or f"{name}--section": x for name, x in zip(names, self.sections, strict=True)}


@dataclass(frozen=True, slots=True)
class Report:
    """What `report_of` makes of a result."""

    title: str
    sections: tuple[Section, ...]
    """Of its first page."""
    _: KW_ONLY
    about: str
    """What the report is about, in a sentence."""
    pages: tuple[Page, ...] = ()
    """Further ones, in the order of the menu."""
    simulated: str = ""
    """What of it is SIMULATED, in a sentence; empty: nothing."""
    seed: int | None = None
    """Of the random numbers, where there are any."""
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    """Frames that become files, and are on a page at most in part, by name."""
    files: Mapping[str, bytes] = field(default_factory=dict)
    """Others beside the pages, by relative path."""
    beside: Collection[str] = ()
    """What else in the folder is of the same question and stays, as the dataset of a fleet."""

    @property
    def frames(self) -> dict[str, pd.DataFrame]:
        """Every table, by the name of its file."""
        every = (x.table for page in self._menu for x in page.sections if x.table is not None)
        return dict(self.tables) | {x.name: x.frame for x in every if x.name and x.frame is not None}

    def text(self) -> str:
        """What the command prints: lines without control characters."""
        lines: list[str] = []
        for section in sorted(self.sections, key=lambda section: section.turn):
            lines += [x.flagged for x in section.findings] if section.lines is None else section.lines
        return "\n".join(map(printable, lines))

    def html(self) -> str:
        """The first page. Its figures are part of it; its links to files need those that `write` puts beside it."""
        ((_, text),) = self._texts(self._menu[:1], {}, lambda _: None)
        return text

    def write(self, folder: Path | str, progress: Progress | None = None, *, mailed: bool = False) -> Path:
        """Write the pages, figures/ (SVG, PNG and CSV) and tables/ (CSV); returns the path of index.html.

        The same report gives the same bytes. Only what bristle made in the folder is replaced. Raises InputError where the
        folder cannot be used, with nothing half-written.

        Args:
            folder: made where it does not exist.
            progress: called with what is being done, how many steps are done, and how many there are.
            mailed: whether all of it is written as report.zip in the folder as well.
        """
        files = {**tables_of(self.frames), **self.files}
        drawings = {x.draw for page in self._menu for section in page.sections for x in section.drawings}
        tell = teller(progress, len(drawings))
        texts = {name: encoded(text) for name, text in self._texts(self._menu, files, tell)}
        step(progress, "writing the report")
        every = {**files, **texts}
        replace_files(Path(folder), every | {"report.zip": zipped(every)} if mailed else every, self.beside)
        return Path(folder) / "index.html"

    @property
    def _menu(self) -> tuple[Page, ...]:
        return Page("index.html", "Answer", "", self.sections), *self.pages

    def _texts(
        self, pages: tuple[Page, ...], files: dict[str, bytes], tell: Callable[[str], None]
    ) -> Iterator[tuple[str, str]]:
        """File and text of each page, figures numbered through. They are rendered, each once, into `files` as well."""
        drawings = dict[Any, Drawing]()
        for x in (x for page in pages for section in page.sections for x in section.drawings):
            drawings.setdefault(x.draw, x)
        figures = drawn(drawings.values(), files, tell)
        common = {**versions(self.seed), "report": self, "figures": figures, "pages": self._menu}
        common["next_figure"] = count(1).__next__
        for page in (page for page in pages if page.file not in self.files):
            named = {**common, "here": page, "once": partial(_once, set())}
            yield page.file, html("bristle.page", "report.html", named)


def _once(told: set[str], text: str) -> str:
    """A text the first time, and nothing from then on."""
    new = text not in told
    told.add(text)
    return text * new
