"""Column keys, checks of arrays, damaged files, and dates as seconds, for all readers of files.

Libraries raise nearly anything at a damaged file: each call of one stands alone in `reading`, so that no defect of
bristle passes for damage.
"""

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError, short, short_list

if TYPE_CHECKING:
    import pandas as pd


_WIDEST = 64  # columns of a matrix that are offered one by one
MAX_VALUES = 200_000_000  # most numbers that are read from one file: a small compressed file can hold very many


@dataclass(frozen=True, slots=True)
class Key:
    """A column: a name, a dotted path or a number; `index` picks a column of a matrix, from 0."""

    column: int | str
    index: int | None = None
    stamps: bool = False  # whether it holds dates or times of day, which become seconds since the first
    file: str | None = None  # another file than the rest of a run, as the experiment file names it

    def inside(self) -> "Key | None":
        """The matrix or list, and the index, that a name such as `q[2]` means; None: it means none."""
        match = re.fullmatch(r"(.+)\[(\d{1,6})\]", self.column) if isinstance(self.column, str) else None
        return None if match is None or self.index is not None else replace(self, column=match[1], index=int(match[2]))

    def __str__(self) -> str:
        return short(self.column) + ("" if self.index is None else f" index {self.index}")


@contextmanager
def reading(what: str, advice: str = "write it again") -> Iterator[None]:
    """One call of a library's reader.

    Whatever it raises means a damaged file, except errors of the system and of memory. Raises InputError, and what the
    system raises. Warnings of the reader are dropped: they precede a refusal, or numbers that are checked later.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except (InputError, MemoryError):
        raise
    except Exception as error:  # a library raises nearly anything at a damaged file
        if isinstance(error, OSError) and error.errno is not None:  # of the system
            raise
        raise InputError(f"is damaged, or no {what} ({error}); {advice}") from error


def numeric(value: Any, key: Key) -> Array:
    """A vector of numbers, or the column `key.index` of a matrix, as floats, (n,)."""
    while isinstance(value, np.ndarray) and value.dtype == object and value.size == 1:
        value = value.flat[0]
    if hasattr(value, "toarray"):
        raise InputError(f"column {key} is a sparse array; in MATLAB save full({key.column}) in its place")
    if not isinstance(value, np.ndarray) or value.dtype.kind not in "iufb":
        kinds = {"c": "complex numbers", "U": "text", "S": "text", "O": "cells", "V": "structs"}
        dtype = getattr(value, "dtype", None)
        what = "" if dtype is None else f", but {kinds.get(dtype.kind, f'values of type {dtype}')}"
        raise InputError(f"column {key} holds no plain array of numbers{what}; expected one real number per sample")
    bounded(value.size)
    return picked(value, value.shape, key)


def picked(source: Any, shape: tuple[int, ...], key: Key, *, rows_last: bool = False) -> Array:
    """The same of a source that is read as it is indexed.

    `rows_last`: the source is stored transposed, as MATLAB's matrices are in HDF5 files.
    """
    shape = shape[::-1] if rows_last else shape
    if not shape:
        raise InputError(f"column {key} holds a single number; expected one per sample")
    if key.index is not None and (len(shape) != 2 or key.index >= shape[1]):
        raise InputError(f"column {key}: the array has shape {shape}; index counts the columns of a matrix from 0")
    if key.index is None and np.prod(shape, dtype=float) != max(shape):
        which = f"say which column with index: 0 to {shape[-1] - 1}, or as in {key.column}[0]"
        raise InputError(f"column {key} is a matrix of shape {shape}; {which}")
    column = () if key.index is None else (key.index, slice(None)) if rows_last else (slice(None), key.index)
    with np.errstate(over="ignore", invalid="ignore"):  # of longer floats, which are then not finite
        return np.asarray(source[column], dtype=float).ravel()


def brought_to(time: Array, own: Array, values: Array, gap: float) -> Array:
    """Values, (m,), sampled at times `own`, s, (m,), linearly at other times, s, (n,); nan beyond them and in gaps.

    A value whose own time is not finite is no sample; an interval longer than `gap` median ones is a gap. Raises
    InputError where the own time runs backward, there are fewer than two samples, or none of the times lies between
    them.
    """
    good = np.isfinite(own) & np.isfinite(values)
    own, values = own[good], values[good]
    steps = np.diff(own)
    if (steps < 0).any():
        raise InputError(f"its own time runs backward in {int((steps < 0).sum())} rows; split the log there")
    once = np.append(True, steps > 0)[: own.size]
    own, values = own[once], values[once]
    if own.size < 2:
        raise InputError(f"{own.size} samples with a time of their own; expected a log with many")
    steps = np.diff(own)
    after = np.clip(np.searchsorted(own, np.nan_to_num(time, nan=own[0])), 1, own.size - 1)
    onto = np.interp(time, own, values, left=np.nan, right=np.nan)
    onto[(steps[after - 1] > gap * np.median(steps)) & (time != own[after]) & (time != own[after - 1])] = np.nan
    seen = time[np.isfinite(time)]
    inside = np.count_nonzero((own >= seen.min()) & (own <= seen.max())) if seen.size else 0
    if inside < 2 or not np.isfinite(onto).any():  # 2 samples of a signal with a time of its own that lie in a run
        rest = f"{seen.min():.6g} s to {seen.max():.6g} s" if seen.size else "nowhere"
        reaches = f"its own time, {own[0]:.6g} s to {own[-1]:.6g} s, has {inside} samples in that of the run, {rest}"
        raise InputError(f"{reaches}; check the unit of each, and that both count since the same instant")
    return onto


def place_of(key: Key, names: Sequence[str], what: str = "column") -> int:
    """The place of the column that a key names or counts. Raises InputError where none, or several, have its name."""
    if not (key.column < len(names) if isinstance(key.column, int) else key.column in names):
        raise InputError(f"no {what} named {key}; there are: {short_list(names)}")
    name = names[key.column] if isinstance(key.column, int) else key.column
    if names.count(name) > 1:
        which = "" if name == key.column else f", as {what} {key} is"
        raise InputError(f"several {what}s named {short(name)}{which}; give each its own name")
    return names.index(name)


def offered(name: str, shape: tuple[int, ...], dtype: "np.dtype[Any]") -> Iterator[str]:
    """The columns of an array: itself, if it is a vector, or those of a narrow matrix, as `q[2]`."""
    if dtype.kind not in "iufb":
        return
    if np.prod(shape, dtype=float) == max(shape, default=0) > 1:
        yield name
    elif len(shape) == 2 and shape[1] <= min(_WIDEST, shape[0] - 1):
        yield from (f"{name}[{k}]" for k in range(shape[1]))


def bounded(values: float, what: str = "") -> None:
    """Raise InputError where a file, or what is named, holds more numbers than are read."""
    if values > MAX_VALUES:
        raise InputError(f"{what}holds {values:.3g} numbers, over the limit of {MAX_VALUES}; cut it into several runs")


ISO = "iso"  # the unit of a time column that holds dates or times of day
_DAY = 86_400 * 10**9
_CLOCK = re.compile(r"\d\d?:\d\d:\d\d(\.\d+)?")
_POINTS = re.compile(r"\d\d?\.\d\d?\.\d{4} .*")
_MISSING = np.iinfo(np.int64).min  # pandas' integer for no date


def seconds_of_stamps(column: "pd.Series[str]", name: str) -> tuple[Array, int]:
    """Seconds since the first stamp of a column of text, (n,), nan where a cell is empty; and that stamp, ns.

    Stamps are ISO 8601 (`2024-05-01T12:00:00.123Z`, a blank in place of the T, with or without a zone), `01.05.2024
    12:00:00` or times of day alone, which go on after midnight. One without a zone is taken as it is. Raises
    InputError, which names the row and the column, where a cell is none.
    """
    import pandas as pd

    text = column.str.strip().str.replace(",", ".", regex=False)
    filled = text.notna().to_numpy()
    first = str(text[filled].iloc[0]) if filled.any() else ""
    text = text.where(text.str.len() <= 60)  # characters of a date with its time and its zone
    points = "%d.%m.%Y %H:%M:%S"
    if _CLOCK.fullmatch(first):
        clock = text.where(text.str.fullmatch(_CLOCK.pattern).fillna(False).astype(bool))
        counted = pd.to_timedelta(clock, errors="coerce").to_numpy("timedelta64[ns]").astype(np.int64)
    else:  # as pandas reads them in the format of the first one
        if _POINTS.fullmatch(first):
            whole = pd.to_datetime(text, format=points, errors="coerce", utc=True)
            parts = pd.to_datetime(text, format=f"{points}.%f", errors="coerce", utc=True)
            dates = parts.fillna(whole) if parts.notna().any() else whole
        else:
            dates = pd.to_datetime(text, format="ISO8601", errors="coerce", utc=True)
        dates = dates.where((dates.dt.year > 1677) & (dates.dt.year < 2262))
        counted = dates.dt.tz_localize(None).to_numpy("datetime64[ns]").astype(np.int64)
    bad = np.flatnonzero(filled & (counted == _MISSING))
    if bad.size:
        got = f"row {bad[0] + 1} of column {name} holds {short(column.iloc[bad[0]])}, and unit iso was declared"
        times = "2024-05-01T12:00:00.123Z, 01.05.2024 12:00:00 or 12:00:00.123"
        raise InputError(f"{got}; expected a time such as {times}, like the first, in 1678 to 2261")
    if not filled.any():
        return np.full(text.size, np.nan), 0
    if _CLOCK.fullmatch(first):
        counted[filled] += _DAY * np.cumsum(np.diff(counted[filled], prepend=counted[filled][0]) < -_DAY // 2)
    origin = int(counted[filled][0])
    seconds = np.full(text.size, np.nan)
    seconds[filled] = (counted[filled] - origin) / 1e9
    return seconds, origin
