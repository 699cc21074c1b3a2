"""The experiment of a log: how long it holds constant velocities, loads the joint slowly, or moves otherwise."""

import re
from collections import defaultdict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import PurePath
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bristle.data.bandwidth import of_slow_loading
from bristle.data.constant_velocity.segments import Thresholds, find_segments
from bristle.data.differentiation import smoothed
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, find_loadings
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.model.parameters import Kind as JointKind

MovingKind = Literal["ramp", "presliding", "tracking"]
_SMOOTH = 10.0  # Hz: the low pass of the speed by which rest is told from motion


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretches:
    """Durations of what a run does, s."""

    held: float  # at constant velocity, in segments that would be accepted
    loaded: float  # slow loading below breakaway, and unloading
    broken: float  # sliding that such a loading ends in
    moving: float  # any other motion
    total: float
    speeds: tuple[float, ...] = ()  # velocities held, rad/s

    def __str__(self) -> str:
        whole = max(self._busy, 1e-300)
        parts = {"constant velocity": self.held, "slow loading": self.loaded, "sliding after it": self.broken}
        shares = {name: x / whole for name, x in (parts | {"other motion": self.moving}).items()}
        return ", ".join(f"{name} {share:.0%}" for name, share in shares.items() if share >= 0.005) or "no motion"

    @property
    def kind(self) -> MovingKind:
        """What it does most."""
        slides = self.loaded + self.broken + (self.held if len(self.speeds) < levels.HELD_SPEEDS else 0.0)
        if slides >= levels.LOADS * self._busy > 0 and self.loaded >= max(levels.LOADED * self.total, self.held):
            return "presliding"
        return "ramp" if self.held > self.moving + self.loaded + self.broken else "tracking"

    @property
    def _busy(self) -> float:
        """How long it moves or is loaded, s."""
        return self.held + self.loaded + self.broken + self.moving

    @property
    def is_loaded(self) -> bool:
        """Whether it is slow loading nearly all the time that it moves or is loaded."""
        return self.kind == "presliding" and self.loaded + self.broken >= levels.LOADS_ALONE * self._busy

    @property
    def steadily(self) -> bool:
        """Whether it does hardly anything but hold velocities, or holds a single one, as a log of a series does."""
        return len(self.speeds) == 1 or self.held >= levels.HOLDS * (self.held + self.moving + self.broken)

    def unused(self, kind: str) -> float:
        """Share of the motion that a fit of this kind leaves out; a tracking run is used whole."""
        of_kind = {"ramp": self.held, "presliding": self.loaded + self.broken}
        return 1 - of_kind[kind] / self._busy if kind in of_kind and self._busy else 0.0


def stretches(record: Record, joint: JointKind) -> Stretches:
    """Durations of what a run does, of a record with velocity, rad/s, and torque, N*m.

    Raises InputError where the record has neither.
    """
    held = [s for s in find_segments(record, Thresholds()) if s.accepted]
    n, step = record.time.size, record.step
    steady = _union([(s.start, s.stop) for s in held], n)
    loadings, spans = list[Loading](), list[tuple[int, int]]()
    with suppress(InputError):  # of a joint that slides
        for x in () if record.position is None else find_loadings(record, of_slow_loading(record)[0], None, None):
            long = x.time.size and x.time[-1] + 2 * step >= levels.SHORTEST_LOADING  # each end is known to a sample
            if long and x.displacement.max(initial=0.0) <= levels.LARGEST_BEND[joint]:
                loadings.append(x)
    for x in loadings:  # and where it does not break away what follows nearby
        start, stop = x.start, x.start + x.time.size
        if x.breakaway is None:
            q = np.asarray(record.position)
            far = np.abs(q[stop:] - q[stop - 1]) > levels.GOES_ON * np.ptp(q[start:stop])
            stop = stop + int(np.argmax(far)) if far.any() else n
        spans.append((start, stop))
    loaded = _union(spans, n) & ~steady
    # a joint that goes further than any bristle bends slides: with no breakaway, or with several, it sticks and slips
    far = record.position is not None and np.ptp(record.position) > levels.LARGEST_BEND[joint]
    slips = far and not 0 < sum(x.breakaway is not None for x in loadings) < levels.SEVERAL
    if slips or not _is_spring(record, loaded):
        loadings, loaded = [], np.zeros(n, dtype=bool)
    velocity = np.zeros(n) if record.velocity is None else record.velocity
    short = min(np.diff([*record.starts, n])) < 2
    speed = np.abs(velocity if short or _SMOOTH * step >= 0.5 else smoothed(record, velocity, _SMOOTH))
    moving = (speed > levels.STILL * speed.max(initial=0.0)) & ~steady & ~loaded

    # sliding of a joint that is loaded slowly, and so rests half of the time below its breakaway torque
    broken, torques = np.zeros(n, dtype=bool), [x.breakaway for x in loadings if x.breakaway is not None]
    if torques and record.torque is not None:
        below = np.abs(record.torque) < max(torques)
        if np.count_nonzero(loaded & below) >= 0.5 * np.count_nonzero(below):
            broken = moving
    times = {"held": steady, "loaded": loaded, "broken": broken, "moving": moving & ~broken}
    return Stretches(
        **{name: step * float(np.count_nonzero(mask)) for name, mask in times.items()},
        total=step * n,
        speeds=tuple(s.velocity for s in held),
    )


def kinds_of(found: Sequence[tuple[str, Stretches]]) -> list[MovingKind]:
    """The experiment of each file: slow loading where it is nothing else, else that of most files with alike names.

    A motion among constant velocities is one of them that sticks and slips only where each of these is one velocity.
    Constant velocities are ramps where there is hardly anything else, and more of them than a curve has numbers; else
    such a run is a tracking one, which uses what lies between them too.
    """
    families = defaultdict[str, list[Stretches]](list)
    names = [re.sub(r"\d+(\.\d+)?", "#", PurePath(file).name) for file, _ in found]
    for name, (_, does) in zip(names, found, strict=True):
        families[name].append(does)
    kinds = list[MovingKind]()
    for name, (_, does) in zip(names, found, strict=True):
        own = [x.kind for x in families[name]]
        most = max(own, key=own.count)
        series = most != "ramp" or all(len(x.speeds) == 1 for x in families[name] if x.kind == "ramp")
        kinds.append(most if not does.is_loaded and 2 * own.count(most) > len(own) and series else does.kind)
    ramps = [does for kind, (_, does) in zip(kinds, found, strict=True) if kind == does.kind == "ramp"]
    speeds = np.sort([v for does in ramps for v in does.speeds])
    different = 1 + np.count_nonzero(np.diff(speeds) > levels.SAME_SPEED * np.abs(speeds[1:]))
    sizes = [np.abs(does.speeds) for does in ramps if does.speeds]
    single = all(x.max() <= levels.ONE_SPEED * x.min() for x in sizes)  # in each file
    if (single or different >= levels.CURVE_SPEEDS) and all(does.steadily for does in ramps):
        return kinds
    return ["tracking" if kind == "ramp" else kind for kind in kinds]


def _union(spans: Sequence[tuple[int, int]], n: int) -> NDArray[np.bool_]:
    mask = np.zeros(n, dtype=bool)
    for start, stop in spans:
        mask[start:stop] = True
    return mask


def _is_spring(record: Record, loaded: NDArray[np.bool_]) -> bool:
    """Whether torque goes with position in stretches that load; of a joint that slides it goes with the direction."""
    if record.position is None or record.torque is None or np.count_nonzero(loaded) < 2:
        return False
    bounds = np.flatnonzero(np.diff(loaded, prepend=False, append=False)).reshape(-1, 2)
    direction = np.sign(np.zeros(loaded.size) if record.velocity is None else record.velocity)
    q, side, T = (
        np.concatenate([x[start:stop] - x[start:stop].mean() for start, stop in bounds])
        for x in (record.position, direction, record.torque)
    )
    with_q, with_side = (float(x @ T) / max(float(np.linalg.norm(x)), 1e-300) for x in (q, side))
    size = np.abs(record.torque[loaded])
    high = float(np.mean(size > levels.SLIDING * np.quantile(size, 0.99)))
    whole = float(np.linalg.norm(T))
    slides = with_side > min(with_q, levels.SIDED * whole) and high > levels.SLIDING_TIME
    return with_q > levels.SPRING * whole and not slides
