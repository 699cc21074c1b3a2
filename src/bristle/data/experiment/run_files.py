"""An entry under runs: which files, which part of them, and what they hold; paths and globs are relative to the experiment file."""

import glob
import os
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, PlainValidator, StrictBool

from bristle.data.experiment.schema import Label, RunKind, read_rows
from bristle.data.experiment.signals import Signals, quantity
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, check_name, short

_VARIABLE = re.compile(r"\$\{(\w+)\}")
_MOST, _LONGEST = 1000, 4096  # patterns of an entry, and characters of one


class TimeRange(StrictModel):
    """A part of a run by its time, as logged; an end that is not given is the run's."""

    start: Annotated[float, quantity("s")] | None = Field(default=None, alias="from")
    to: Annotated[float, quantity("s")] | None = None

    def _problems(self) -> Iterator[str]:
        if self.start is None and self.to is None:
            yield "expected one end at least, as in {from: 2 s, to: 30 s}"
        if self.start is not None and self.to is not None and not self.start < self.to:
            yield f"got {self.start:g} s to {self.to:g} s; expected the earlier time first"


def _read_files(value: object) -> str | tuple[str, ...]:
    """Read a path or glob, or a list of them."""
    several = tuple(value) if isinstance(value, list | tuple) else (value,)
    if not 1 <= len(several) <= _MOST or not all(isinstance(x, str) and 1 <= len(x) <= _LONGEST for x in several):
        raise InputError(
            f"got {short(value)}; expected a path or glob of at most {_LONGEST} characters, or a list of at most {_MOST} of them"
        )
    return str(value) if isinstance(value, str) else tuple(map(str, several))


class RunFiles(StrictModel):
    """One entry under runs: a file or several, and what they hold."""

    files: Annotated[str | tuple[str, ...], PlainValidator(_read_files)]
    """Paths or globs, relative to the experiment file; ${NAME} stands for an environment variable."""
    joined: StrictBool = False
    """Whether the files are parts of one run, in this order; else each is a run of its own."""
    rows: Annotated[tuple[int, int], BeforeValidator(read_rows)] | None = None
    """The part of each run that is used, in the lines or rows that `bristle inspect` prints, from 1."""
    time: TimeRange | None = None
    """The same by time."""
    experiment: RunKind
    hold_out: StrictBool = False
    temperature: Label | None = None
    load: Label | None = None
    signals: Signals | None = None
    """Signals that differ from the experiment's."""

    @property
    def patterns(self) -> tuple[str, ...]:
        """The paths or globs, of which there may be one."""
        return (self.files,) if isinstance(self.files, str) else self.files

    def _problems(self) -> Iterator[str]:
        if self.rows is not None and self.time is not None:
            yield "got rows and time; expected one of them"
        if self.time is not None and self.experiment == "points":
            yield "time: points have no time; give rows, as in rows: 2-40"


def sources_of(run: RunFiles, experiment: Path) -> list[list[tuple[Path, str]]]:
    """The files of each run of an entry, each with the name that results show: one of each, or all of the one that they are joined to.

    Raises InputError where a pattern matches none, or a file is named twice in a joined run.
    """
    found = [match for pattern in run.patterns for match in matches(pattern, experiment)]
    twice = [shown for shown, count in Counter(shown for _, shown in found).items() if count > 1]
    if twice:
        raise InputError(f"{experiment}: runs: files name {short(twice[0])} twice; name each file once")
    return [found] if run.joined else [[source] for source in found]


def matches(files: str, experiment: Path) -> list[tuple[Path, str]]:
    """Paths that a pattern matches, sorted by name, each with the name that results show.

    No variable in it is filled in. Raises InputError where there is none.
    """
    folder, variables = experiment.parent, {}
    for name in _VARIABLE.findall(files):
        if not os.environ.get(name):
            raise InputError(
                f"{experiment}: runs: files {short(files)} needs the environment variable {name}, which is not set; set it to a folder"
            )
        variables[name] = os.environ[name]
    pattern = _VARIABLE.sub(lambda match: variables[match[1]], files)
    if pattern.count("**") > 1:  # each may stand for any number of folders: together they search for ever
        raise InputError(
            f"{experiment}: runs: files {short(files)} has ** more than once; expected a glob such as logs/**/ramp*.csv"
        )
    try:
        if (folder / pattern).exists():
            found = [pattern]
        elif "**" not in pattern:
            found = sorted(glob.glob(pattern, root_dir=folder))  # noqa: PTH207  # Path.glob takes no absolute pattern
        else:  # glob.glob follows links, in circles where they go so
            root = Path(pattern).anchor
            base = Path(root) if root else folder
            below = (path.relative_to(base) for path in base.glob(pattern.removeprefix(root)))
            found = sorted(f"{root}{x}" for x in below if not any(p.startswith(".") and p != ".." for p in x.parts))
    except OSError as error:
        raise InputError(f"{experiment}: runs: files {short(files)} cannot be looked for ({error.strerror})") from error
    if not found:
        what = "matches no file" if glob.has_magic(pattern) else "is not a file"
        raise InputError(
            f"{experiment}: runs: files {short(files)} {what}; expected a path or glob relative to the folder of the experiment file"
        )
    sources = []
    for match in found:
        name = os.path.relpath(match, folder) if Path(match).is_absolute() else match
        filled = next(((key, value) for key, value in variables.items() if value in match), None)
        if filled is not None:  # the variable stands for its folder
            name = match.replace(filled[1], f"${{{filled[0]}}}", 1)
        shown = check_name(Path(name).as_posix(), f"{experiment}: runs: files: the file name")
        sources.append((folder / match, shown))
    return sources
