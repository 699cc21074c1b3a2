"""An entry under runs: which files, which part of them, and what they hold."""

from typing import Annotated

from pydantic import BeforeValidator, Field, PlainValidator, StrictBool, model_validator

from bristle.data.experiment.schema import Label, RunKind, read_rows
from bristle.data.experiment.signals import Signals, quantity
from bristle.data.experiment.yaml_file import StrictModel
from bristle.errors import InputError, short

_MOST, _LONGEST = 1000, 4096
"""Patterns of an entry, and characters of one."""


class TimeRange(StrictModel):
    """A part of a run by its time, as logged; an end that is not given is the run's."""

    start: Annotated[float, quantity("s")] | None = Field(default=None, alias="from")
    to: Annotated[float, quantity("s")] | None = None

    @model_validator(mode="after")
    def _in_order(self) -> "TimeRange":
        if self.start is None and self.to is None:
            raise InputError("expected one end at least, as in {from: 2 s, to: 30 s}")
        if self.start is not None and self.to is not None and not self.start < self.to:
            raise InputError(f"got {self.start:g} s to {self.to:g} s; expected the earlier time first")
        return self


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

    @model_validator(mode="after")
    def _one_range(self) -> "RunFiles":
        if self.rows is not None and self.time is not None:
            raise InputError("got rows and time; expected one of them")
        if self.time is not None and self.experiment == "points":
            raise InputError("time: points have no time; give rows, as in rows: 2-40")
        return self
