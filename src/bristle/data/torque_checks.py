"""Checks of the torque of a run by itself: limits, a dead zone, a load at the start, rounding."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bristle.data.encoder import smallest_step
from bristle.data.experiment.schema import RunKind
from bristle.data.record import OTHER_FILES, Record
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.levels import DEVIATIONS, PILED, PILED_BESIDE, UNSIGNED, UNSIGNED_TURNS
from bristle.findings import CAUTION, CRITICAL, Finding

_PARTS = 100  # parts of slow loading, of which the first tells with what it begins


def check_torque(record: Record, kind: RunKind) -> Iterator[Finding]:
    """Findings on the torque of a run; holds at constant velocity are judged as segments, but for rounding."""
    checks = {
        "ramp": (_coarse,),
        "points": (_clipped,),
        "presliding": (_clipped, _loaded_at_start, _coarse),
        "tracking": (_clipped, _unsigned, _dead_zone, _coarse),
    }
    yield from filter(None, (check(record, kind) for check in checks[kind]))


def at_limits(record: Record, kind: RunKind = "tracking") -> NDArray[np.bool_]:
    """Samples of a run that are clipped, or fill a gap: the true torque there is unknown, (n,).

    No clipped ones where they are nine tenths of all.
    """
    clipped = np.isin(record.time if record.torque is None else record.torque, _limits(record, kind))
    # 0.9 of the samples: where more are clipped, too little is left to fit
    clipped &= clipped.mean() < 0.9
    return clipped if record.filled is None else clipped | record.filled


def _limits(record: Record, kind: RunKind) -> list[float]:
    """The extreme torques, N*m, at which the torque stays; none of a torque from a voltage, which never does."""
    if record.torque is None or record.voltage is not None:
        return []
    if kind == "points":  # each has a torque of its own
        torque, velocity = record.torque, np.asarray(record.velocity)
        tips = list(dict.fromkeys((float(torque.max(initial=-np.inf)), float(torque.min(initial=np.inf)))))
        others = torque[~np.isin(torque, tips)]
        told = record.velocity is not None and np.unique(others).size >= 0.9 * others.size
        brakes = [x for x in tips if told and (velocity[torque == x] * x > 0).all()]
        speeds = {x: np.unique(velocity[torque == x]).size for x in brakes}
        return [x for x in speeds if speeds[x] + speeds.get(-x, 0) >= 3]  # not by chance
    part, few = 0.005, 8  # this share of the samples at least, and so many of them
    least = max(part * record.torque.size, few if record.torque.size > 200 else 3)
    ends = (record.torque.min(), record.torque.max())
    if max(np.count_nonzero(record.torque == end) for end in ends) < least:  # told before all levels are counted
        return []
    levels, counts = np.unique(record.torque, return_counts=True)
    # with fewer levels nothing can be said of how often one is taken; of few points most are levels of their own
    if levels.size <= min(20, record.torque.size // 4):
        return []
    padded = np.pad(counts, PILED_BESIDE)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * PILED_BESIDE + 1).copy()
    windows[:, PILED_BESIDE] = 0
    piled = (counts >= PILED * windows.max(axis=1)) & (counts >= least)
    alike = np.isclose(levels[0], -levels[-1], rtol=1e-6)  # one limit, of both directions
    gaps = np.diff(levels)
    # 0.05 of the range of a torque: how far its next value is from a limit, at the most
    near = {k for k in (0, -1) if not gaps.size or gaps[k] < 0.05 * gaps.sum()}  # a step jumps to its level
    at = [k for k in (0, -1) if k in near and (piled[k] or (alike and piled[-1 - k]))]
    if (piled[1:-1] & (levels[1:-1] != 0)).any():  # a command, which holds other values too
        return []
    return [float(levels[k]) for k in at]


def _clipped(record: Record, kind: RunKind) -> Finding | None:
    """Clipped samples, which are left out of points and moving runs; critical where half are."""
    limits = _limits(record, kind)
    if not limits or record.torque is None:
        return None
    if kind == "presliding":  # a joint that is held at its extreme torque stops, and one that is clipped moves on
        ends = record.torque.min(), record.torque.max()
        stays = (np.diff(record.torque) == 0) & np.isin(record.torque[1:], ends)
        moved = np.zeros(stays.size) if record.position is None else np.abs(np.diff(record.position))
        if not moved[stays].sum() > stays.mean() / 2 * moved.sum():
            return None
    share = float(np.isin(record.torque, limits).mean())
    left_out = kind != "presliding" and bool((at_limits(record, kind) & np.isin(record.torque, limits)).any())
    values = " and ".join(f"{x:.4g}" for x in limits)
    message = (
        f"The torque of {record.file}{OTHER_FILES} is clipped: {100 * share:.1f} % of its samples are exactly {values}. The "
        f"true torque there is unknown{'; they are left out' * left_out}; move slower or more gently, or widen the range of "
        "the drive or the sensor."
    )
    numbers = {"files": (record.file,), "share": share, "limits": values}
    if left_out:
        return Finding("clipped-left-out", CAUTION, message, numbers)
    return Finding("clipped", CRITICAL, message, numbers, {} if kind == "presliding" else {"torque": np.inf})


def _unsigned(record: Record, _: RunKind) -> Finding | None:
    """A torque that is a magnitude: where a joint goes both ways it falls to zero at turns, and never changes sign."""
    if record.torque is None or record.velocity is None or record.voltage is not None:
        return None
    size, speed = np.abs(record.torque), np.abs(record.velocity)
    turns = np.flatnonzero(np.diff(np.sign(record.velocity)))
    if size.size < UNSIGNED or turns.size < UNSIGNED_TURNS or record.torque.min() * record.torque.max() < 0:
        return None
    # 0.1 of the way in either direction; the least torque about each turn, below 0.1 of the fastest speed
    back = float(speed[record.velocity < 0].sum() / speed.sum())
    slow = np.where(speed <= 0.1 * speed.max(), size, np.inf)
    least = np.minimum.reduceat(slow, np.append(0, (turns[:-1] + turns[1:]) // 2))
    # a fiftieth of all samples within a twentieth of the range, or a fifth of the turns well below the usual
    next_to_zero = np.quantile(size, 0.02) <= 0.05 * size.max()
    if not 0.1 < back < 0.9 or not (next_to_zero or np.quantile(least, 0.2, method="lower") <= 0.2 * np.median(size)):
        return None
    beyond = "below" if record.torque.max() > 0 else "above"
    message = (
        f"The torque of {record.file}{OTHER_FILES} is a magnitude: zero or next to it where the joint turns, and never "
        f"{beyond} it, though it goes both ways. Whether it drives or brakes is not in it, so neither friction nor gravity "
        "can be told: log it with its sign, or what the drive was told to follow and its gains (signals.command)."
    )
    return Finding("torque-unsigned", CRITICAL, message, {"files": (record.file,)}, {"torque": np.inf})


def _loaded_at_start(record: Record, _: RunKind, deviations: float = DEVIATIONS) -> Finding | None:
    """Slow loading whose torque does not begin at zero, by the line through its first samples."""
    if record.torque is None or record.torque.size < _PARTS:
        return None
    first = max(record.torque.size // _PARTS, 20)  # the first part tells with what it begins
    time, torque = record.time[:first] - record.time[0], record.torque[:first]
    X = np.column_stack([np.ones(first), time])
    (begins, slope), (of_begins, _) = np.linalg.lstsq(X, torque, rcond=None)[0], np.linalg.inv(X.T @ X).diagonal()
    rest = torque - begins - slope * time
    error = np.sqrt(rest @ rest / (first - 2) * of_begins * inflation(rest))
    largest = float(np.abs(record.torque).max())
    # 0.02 of the largest torque of slow loading: what it begins with is told beyond this
    if abs(begins) <= max(deviations * error, 0.02 * largest):
        return None
    share = abs(begins) / largest
    message = (
        f"The torque of {record.file}{OTHER_FILES} begins at {begins:.3g}, {100 * share:.0f} % of its largest, and not at "
        "zero: an offset of the sensor makes sigma_0 too high in one direction and too low in the other. Subtract it, or "
        "begin without a load."
    )
    return Finding("loaded-at-start", CAUTION, message, {"files": (record.file,), "torque": begins, "share": share})


def _dead_zone(record: Record, _: RunKind, piled: float = PILED) -> Finding | None:
    """A torque of a moving joint that is exactly zero far too often where its sign changes."""
    torque, position = record.torque, record.position
    if torque is None or position is None or record.voltage is not None:
        return None
    zero = torque == 0
    # a dead zone takes at least 5e-4 of the samples, 4 of them, and 4 times as many as any other level
    if zero.sum() < max(5e-4 * torque.size, 4):
        return None
    if zero.sum() < piled * np.unique(np.abs(torque[~zero]), return_counts=True)[1].max(initial=0):
        return None
    starts, stops = (np.flatnonzero(np.diff(np.pad(zero.astype(int), 1)) == sign) for sign in (1, -1))
    whole = (starts > 0) & (stops < torque.size)
    crosses = torque[starts[whole] - 1] * torque[stops[whole]] < 0
    samples = (stops - starts)[whole]
    steps = np.abs(np.diff(position))
    inside = steps[zero[1:] & zero[:-1]]
    # 0.001 of the mean speed: a joint that is slower while its torque is zero rests
    rests = inside.size > 0 and inside.mean() < 0.001 * steps.mean()
    # 0.5 of the samples at zero, those that lie between torques of opposite sign
    if rests or samples[crosses].sum() < 0.5 * samples.sum():
        return None
    share = float(zero.mean())
    message = (
        f"The torque of {record.file}{OTHER_FILES} is exactly zero in {100 * share:.1f} % of the samples, wherever it changes "
        "its sign: its sensor or drive has a dead zone. What is cut off is missing from alpha_0, and reversals look softer; "
        "switch it off, or add it to the torque."
    )
    return Finding("dead-zone", CRITICAL, message, {"files": (record.file,), "share": share}, {"torque": np.inf})


def _coarse(record: Record, kind: RunKind) -> Finding | None:
    """A torque in so few steps that rounding does not average out: a hold is off by up to half a step."""
    torque = record.torque
    if torque is None or record.voltage is not None or torque.size < _PARTS:
        return None
    step, reach = smallest_step(torque), float(np.ptp(torque))
    # rounded coarsely: few levels, and more often than not the same one from sample to sample
    most, stays = 64, 0.5
    if not step or reach > most * step or np.mean(np.diff(torque) == 0) < stays:
        return None
    levels = round(reach / step) + 1
    message = (
        f"The torque of {record.file}{OTHER_FILES} comes in {levels} steps of {step:.2g} (SI): what it rounds off is not "
        "noise and does not average out. Numbers may be off by half a step, those of reversals by more; log it with more "
        "digits, or from a finer sensor."
    )
    effect = {"torque": step / 2} if kind == "ramp" else {}
    return Finding("torque-coarse", CAUTION, message, {"files": (record.file,), "step": step, "levels": levels}, effect)
