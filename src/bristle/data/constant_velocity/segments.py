"""Constant-velocity segments of ramp runs: each candidate accepted or rejected, with its reason."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from bristle.arrays import UNWRITTEN, Array, Number
from bristle.data.constant_velocity.acceptance import Thresholds, evidence, reasons, sticks, usual_scale, warnings
from bristle.data.constant_velocity.changepoints import CandidateSpan, candidates
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import NOTE, Finding

__all__ = ["Segment", "Thresholds", "find_segments", "nothing_left"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """One candidate for a velocity-torque point."""

    file: str
    start: int
    """First sample of the record."""
    stop: int
    """One past the last sample."""
    velocity: Number
    """Mean velocity, rad/s."""
    torque: Number
    """Mean torque, N*m."""
    standard_error: float | None
    """Standard error of the mean torque, corrected for autocorrelation, N*m; None where it cannot be known."""
    accepted: bool
    reasons: tuple[Finding, ...] = ()
    """Why it was rejected, and what would have let it in."""
    warnings: tuple[Finding, ...] = ()
    """Why it is kept but not trusted fully (stick-slip)."""
    stick_slip: bool = False
    time: float | None = None
    """Middle of the segment, s from the start of its run."""
    position: float | None = None
    """Mean position, rad."""
    labels: Mapping[str, str] = field(default_factory=dict)
    """temperature and load of its run."""
    torque_shifts: Mapping[str, Number] = field(default_factory=dict, metadata=UNWRITTEN)
    """Change of the mean torque per standard error of each constant behind it, N*m, as in `Record`."""
    loads: Mapping[str, Number] = field(default_factory=dict, metadata=UNWRITTEN)
    """Means of what multiplies the parameters of gravity (`law.load_terms`), cogging, ripple; empty of a given point, whose position tells them."""
    swing: Number = field(default=0.0, metadata=UNWRITTEN)
    """Standard deviation of the velocity that is not noise, rad/s; 0 where noise hides it."""
    line: int | None = None
    """Of its first sample, the line in the file; None where that is not known."""
    last_line: int | None = None
    """The same of its last sample."""

    @property
    def place(self) -> tuple[str, int, int]:
        """File, first sample and one past the last, by which it is told from every other."""
        return self.file, self.start, self.stop

    @property
    def subject(self) -> tuple[str, ...]:
        """What a warning about it names."""
        return self.file, self.where

    @property
    def rows(self) -> tuple[int, int]:
        """Its first and last row, as `fit.exclude` names them: lines of a text file, else rows of data, from 1."""
        return (self.start + 1, self.stop) if self.line is None else (self.line, self.last_line or self.line)

    @property
    def where(self) -> str:
        """The same in words."""
        word, (first, last) = "row" if self.line is None else "line", self.rows
        return f"{word} {first}" if first == last else f"{word}s {first}-{last}"

    def __str__(self) -> str:
        return f"{' '.join(self.subject)} at {self.velocity:.3g}"


def find_segments(
    record: Record, thresholds: Thresholds, encoder_resolution: float | None = None
) -> tuple[Segment, ...]:
    """Every candidate of a ramp run, in order of time, accepted or rejected with its reasons; none crosses a gap.

    The candidates depend on the data alone; `thresholds` decide which are accepted, where None by the noise floor. The
    mean velocity is the slope of the position, whose count is `encoder_resolution`, rad, or its smallest step; without
    a position it is the mean of the velocity. Raises InputError where the record has no velocity, rad/s, or no torque,
    N*m.
    """
    if record.velocity is None or record.torque is None:
        remedy = "name position or velocity, and torque, under signals"
        raise InputError(f"{record.file}: a ramp run needs velocity and torque; {remedy}")
    edges = (*record.starts, record.time.size)
    cut = [s for start, stop in pairwise(edges) for s in candidates(record.velocity, record.torque, start, stop)]
    usual = usual_scale(record, cut, encoder_resolution)
    settling = _settling(record.velocity, cut)
    found = []
    for candidate, longer in zip(cut, settling, strict=True):
        e = evidence(record, candidate, usual)
        against = reasons(e, usual, thresholds)
        if longer is not None:
            message = f"Settling: it begins or ends the plateau in {record.where(longer.start, longer.stop)}."
            against = (Finding("settling", NOTE, message), *against)
        part = slice(candidate.start, candidate.stop)
        middle = (record.time[candidate.start] + record.time[candidate.stop - 1]) / 2 - record.time[0]
        found.append(
            Segment(
                file=record.file,
                start=candidate.start,
                stop=candidate.stop,
                line=None if record.lines is None else int(record.lines[candidate.start]),
                last_line=None if record.lines is None else int(record.lines[candidate.stop - 1]),
                velocity=e.velocity,
                torque=e.torque,
                standard_error=e.torque_error,
                accepted=not against,
                reasons=against,
                warnings=() if against else tuple(warnings(e)),
                stick_slip=not against and sticks(e),
                time=float(middle),
                position=None if record.position is None else float(record.position[part].mean()),
                torque_shifts={name: float(shift[part].mean()) for name, shift in record.torque_shifts.items()},
                swing=e.swing,
                labels=record.labels,
            )
        )
    return tuple(found)


def nothing_left(segments: Sequence[Segment], records: Sequence[Record]) -> str:
    """The message if no candidate is accepted: how many each threshold rejected."""
    counts = Counter(str(reason).partition(":")[0] for s in segments for reason in s.reasons)
    eaten = "; ".join(f"{what.lower()}: {count}" for what, count in counts.most_common()) or "no samples"
    total = f"{len(segments)} candidates in {len(records)} runs"
    message = f"No segment at constant velocity is left of {total} (rejected as {eaten})."
    longest = max((s for s in segments if s.reasons), key=lambda s: (-len(s.reasons), s.stop - s.start), default=None)
    nearest = f" Nearest, {longest.where} of {longest.file}: {longest.reasons[0]}" if longest else ""
    wrong = next((str(x) for r in records for x in r.warnings if x.code.startswith("velocity-")), None)
    return f"{message}{nearest} {wrong}" if wrong else message + nearest


def _settling(velocity: Array, cut: Sequence[CandidateSpan]) -> list[CandidateSpan | None]:
    """The plateau that each candidate begins or ends: 3 times as long, speeds within 10 % up to it, over 1/3 of it."""
    means = [float(np.mean(velocity[s.start : s.stop])) for s in cut]
    owner: list[CandidateSpan | None] = [None] * len(cut)
    for j, plateau in enumerate(cut):
        began = plateau.start - plateau.cut
        reach = (plateau.stop - began) / levels.EDGE
        for way in (-1, 1):
            k = j + way
            while (
                plateau.plateau
                and 0 <= k < len(cut)
                and abs(means[k] - means[j]) <= levels.SAME_PLATEAU * abs(means[j])
            ):
                s, before = cut[k], cut[k - way]
                touches = s.stop == before.start or s.start == before.stop
                away = began - s.start if way < 0 else s.stop - plateau.stop
                if not touches or away > reach:
                    break
                owner[k], k = plateau, k + way
    return owner
