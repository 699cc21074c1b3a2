"""Dates and times of day as text, in seconds: counted in whole nanoseconds, so that no digit of a late date is lost."""

import re
from typing import TYPE_CHECKING

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError, short

if TYPE_CHECKING:
    import pandas as pd

ISO = "iso"  # the unit of a time column that holds dates or times of day
_DAY = 86_400 * 10**9
_CLOCK = re.compile(r"\d\d?:\d\d:\d\d(\.\d+)?")
_POINTS = re.compile(r"\d\d?\.\d\d?\.\d{4} .*")
_MISSING = np.iinfo(np.int64).min  # pandas' integer for no date


def seconds_of_stamps(column: "pd.Series[str]", name: str) -> tuple[Array, int]:
    """Seconds since the first stamp of a column of text, (n,), nan where a cell is empty; and that stamp, ns.

    Stamps are ISO 8601 (`2024-05-01T12:00:00.123Z`, a blank in place of the T, with or without a zone), `01.05.2024 12:00:00` or times of day alone,
    which go on after midnight. One without a zone is taken as it is. Raises InputError, which names the row and calls the column `name`, where a
    cell is none.
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
        raise InputError(
            f"row {bad[0] + 1} of column {name} holds {short(column.iloc[bad[0]])}, and unit iso was declared; expected a time "
            "such as 2024-05-01T12:00:00.123Z, 01.05.2024 12:00:00 or 12:00:00.123, like the first, in 1678 to 2261"
        )
    if not filled.any():
        return np.full(text.size, np.nan), 0
    if _CLOCK.fullmatch(first):
        counted[filled] += _DAY * np.cumsum(np.diff(counted[filled], prepend=counted[filled][0]) < -_DAY // 2)
    origin = int(counted[filled][0])
    seconds = np.full(text.size, np.nan)
    seconds[filled] = (counted[filled] - origin) / 1e9
    return seconds, origin
