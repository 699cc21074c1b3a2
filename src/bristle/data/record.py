"""Record: what one run measured, as a frozen and validated time series in SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, as_floats, freeze
from bristle.errors import InputError
from bristle.findings import Finding, unit_of

OTHER_FILES, OTHER_PLACES = unit_of("other_files"), unit_of("other_places")
"""Marks in the messages of warnings, where `merged` adds the files or places of other runs; printed as nothing."""
SIGNALS = ("position", "velocity", "torque", "voltage", "acceleration", "link_torque")  # along the time of a record


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """One run. Every signal is a read-only copy of shape (n,), n >= 1, finite.

    m, N and kg stand in for rad, N*m and kg*m**2 where prismatic. Raises InputError where a signal has another length,
    holds a value that is not finite, or time does not increase.
    """

    file: str  # where it came from, relative to the experiment file
    time: Array  # s, strictly increasing
    position: Array | None = None  # rad, unwrapped
    integrated: bool = False  # whether it is the integral of a velocity that is logged alone, from zero
    velocity: Array | None = None  # rad/s, as logged, or as estimated from position
    velocity_estimated: bool = False  # whether it is estimated
    torque: Array | None = None  # N*m: torque of the drive, positive along positive velocity
    torque_shifts: Mapping[str, Array] = field(default_factory=dict)
    """Change of the torque per standard error of each constant with an error, N*m, (n,)."""
    voltage: Array | None = None  # V, from which torque is computed by (8) once the velocity is known
    acceleration: Array | None = None  # rad/s**2, estimated
    made_of: Literal["", "gravity", "inertia"] = ""  # regressor of which the torque was made, where the joint coasts
    link_torque: Array | None = None  # N*m: torque of the links, from the URDF and the motion of all joints
    cutoff: float = 0.0  # of the low pass of its motion, or of the torque of slow loading, Hz; 0: none
    oversampled: float = 1.0  # how many times as fast as the slowest moving run of its experiment it was sampled
    starts: tuple[int, ...] = (0,)
    """First sample of each segment between gaps, across which nothing is differentiated, filtered or simulated."""
    rests: tuple[float, ...] = ()  # times at which the joint has come to rest, s
    rows: int = 0  # rows in the file
    dropped: int = 0  # rows of the file that are not in the record
    sha256: str = ""  # digest of the file's bytes
    notes: tuple[Finding, ...] = ()  # what was counted, assumed and done
    warnings: tuple[Finding, ...] = ()  # where its signals contradict one another, or themselves
    labels: Mapping[str, str] = field(default_factory=dict)  # Run-level labels: temperature, load
    lines: NDArray[np.intp] | None = None  # line of each sample in a text file, from 1, (n,); None where not known
    fine: "Record | None" = None  # all samples of a run of which this holds means; None: all are here
    unknown: NDArray[np.bool_] | None = None  # samples without a known torque: clipped, or in a gap, (n,); None: none
    step: float = field(init=False, default=float("nan"))  # median sampling interval, s; nan for a single sample

    def __post_init__(self) -> None:
        """Copy, freeze and check every array."""
        freeze(self)
        time = _frozen(self.time)
        object.__setattr__(self, "time", time)
        if time.ndim != 1 or time.size == 0:
            raise InputError(f"{self.file}: time has shape {time.shape}; expected one column with at least one row")
        steps = np.diff(time)
        if not (np.isfinite(time).all() and (steps > 0).all()):
            raise InputError(f"{self.file}: time must be finite and increase strictly from sample to sample")
        object.__setattr__(self, "step", float(np.median(steps)) if steps.size else float("nan"))
        for name in SIGNALS:
            value = getattr(self, name)
            if value is None:
                continue
            array = _frozen(value)
            if array.shape != time.shape or not np.isfinite(array).all():
                raise InputError(f"{self.file}: {name} must be finite and as long as time, {time.size} samples")
            object.__setattr__(self, name, array)
        shifts = {name: _frozen(values) for name, values in self.torque_shifts.items()}
        object.__setattr__(self, "torque_shifts", shifts)

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Whether the torque of each sample is not known, (n,)."""
        return np.zeros(self.time.size, dtype=bool) if self.unknown is None else self.unknown

    def where(self, start: int, stop: int) -> str:
        """The samples start to stop - 1 in words: lines of a text file, else rows of data, from 1."""
        first, last = (start + 1, stop) if self.lines is None else (int(self.lines[start]), int(self.lines[stop - 1]))
        word = "row" if self.lines is None else "line"
        return f"{word} {first}" if first == last else f"{word}s {first}-{last}"

    def decimation(self, asked: int) -> int:
        """Samples per equation, if `asked` are those of the slowest run: all are equally far apart in time."""
        return 1 if asked == 1 else round(asked * self.oversampled)


def _frozen(values: Array) -> Array:
    array = as_floats(values)
    array.setflags(write=False)
    return array
