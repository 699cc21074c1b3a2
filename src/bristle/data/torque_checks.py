"""Checks of the torque of a run by itself: limits, a dead zone, a load at the start, rounding."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bristle.data.encoder import smallest_step
from bristle.data.experiment.schema import RunKind
from bristle.data.record import OTHER_FILES, Record
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation, white_noise
from bristle.findings import CAUTION, CRITICAL, Finding

_PARTS = 100  # parts of slow loading, of which the first tells with what it begins


def check_torque(record: Record, kind: RunKind) -> Iterator[Finding]:
    """Findings on the torque of a run; holds at constant velocity are judged as segments, but for what is about zero."""
    checks = {
        "ramp": (_dead_zone, _coarse),
        "points": (_clipped,),
        "presliding": (_clipped, _loaded_at_start, _coarse),
        "tracking": (_clipped, _unsigned, _dead_zone, _coarse),
    }
    yield from filter(None, (check(record, kind) for check in checks[kind]))


def with_unknown(record: Record, kind: RunKind) -> Record:
    """The record with the samples whose torque is not known, of points or a motion, and a finding on a limit behind noise.

    Clipped samples, those in a dead zone that takes nothing off others, those that fill a gap, and those at a limit to
    which noise was added, unless they are most of a motion.
    """
    unknown = at_limits(record, kind)
    at = _at_noisy_limits(record) if kind in ("tracking", "ramp") else None
    if at is None:
        return replace(record, unknown=unknown) if unknown.any() else record
    share = float(at.mean())
    left_out = kind == "tracking" and share < levels.MOSTLY_CLIPPED
    message = (
        f"The torque of {record.file}{OTHER_FILES} is clipped before noise is added: {100 * share:.1f} % of its samples are at a limit, however "
        f"fast it moves. The true torque there is unknown{'; they are left out' * left_out}; move slower or more gently, or widen the range of "
        "the drive or the sensor."
    )
    numbers = {"files": (record.file,), "share": share}
    told = Finding("clipped", CRITICAL, message, numbers, {"torque": np.inf})
    if left_out:
        unknown, told = unknown | at, Finding("clipped-left-out", CAUTION, message, numbers)
    return replace(record, unknown=unknown, warnings=(*record.warnings, told))


def at_limits(record: Record, kind: RunKind = "tracking") -> NDArray[np.bool_]:
    """Samples of points or a motion that are clipped, or in a dead zone, unless most are, or fill a gap, (n,)."""
    unknown = np.zeros(record.time.size, dtype=bool)
    if kind in ("tracking", "points") and record.torque is not None:
        unknown = np.isin(record.torque, _limits(record, kind))
    if kind == "tracking" and (dead := _in_dead_zone(record)) is not None and dead[1]:
        unknown |= dead[0]
    unknown &= unknown.mean() < levels.MOSTLY_CLIPPED
    return unknown | record.lost


def _limits(record: Record, kind: RunKind) -> list[float]:
    """The extreme torques, N*m, at which the torque stays; none of a torque from a voltage, which never does."""
    if record.torque is None or record.voltage is not None:
        return []
    if kind == "points":  # each has a torque of its own
        torque, velocity = record.torque, np.asarray(record.velocity)
        tips = list(dict.fromkeys((float(torque.max(initial=-np.inf)), float(torque.min(initial=np.inf)))))
        others = torque[~np.isin(torque, tips)]
        told = record.velocity is not None and np.unique(others).size >= levels.DISTINCT * others.size
        brakes = [x for x in tips if told and (velocity[torque == x] * x > 0).all()]
        speeds = {x: np.unique(velocity[torque == x]).size for x in brakes}
        return [x for x in speeds if speeds[x] + speeds.get(-x, 0) >= levels.FEW_CLIPPED]
    few = levels.FEW if record.torque.size > levels.SHORT_LOG else levels.FEW_CLIPPED
    least = max(levels.CLIPPED * record.torque.size, few)
    ends = (record.torque.min(), record.torque.max())
    if max(np.count_nonzero(record.torque == end) for end in ends) < least:  # told before all values are counted
        return []
    values, counts = np.unique(record.torque, return_counts=True)
    # with fewer values nothing can be said of how often one is taken; of few points most are values of their own
    if values.size <= min(levels.ENOUGH, record.torque.size // 4):
        return []
    padded = np.pad(counts, levels.PILED_BESIDE)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * levels.PILED_BESIDE + 1).copy()
    windows[:, levels.PILED_BESIDE] = 0
    piled = (counts >= levels.PILED * windows.max(axis=1)) & (counts >= least)
    alike = np.isclose(values[0], -values[-1], rtol=1e-6)  # one limit, of both directions
    gaps = np.diff(values)
    near = {k for k in (0, -1) if not gaps.size or gaps[k] < levels.NEXT_LEVEL * gaps.sum()}
    at = [k for k in (0, -1) if k in near and (piled[k] or (alike and piled[-1 - k]))]
    if (piled[1:-1] & (values[1:-1] != 0)).any():  # a command, which holds other values too
        return []
    return [float(values[k]) for k in at]


def _at_noisy_limits(record: Record) -> NDArray[np.bool_] | None:
    """Samples at a limit to which noise was added, in either direction, or at the same in both, (n,), or None.

    Torques there pile up, and stay whatever the motion does.
    """
    from scipy.ndimage import binary_erosion

    torque, velocity = record.torque, record.velocity
    if torque is None or velocity is None or record.voltage is not None or torque.size < _PARTS:
        return None
    noise = white_noise(torque)
    reach, walls, stay = levels.NOISE * noise, list[float](), list[bool]()
    columns = [np.ones(torque.size), velocity, *([] if record.acceleration is None else [record.acceleration])]
    for x in (torque, -torque) if noise else ():
        walls.append(float(np.median(x[x > x.max() - 2 * reach])))
        at, below = (np.abs(x - walls[-1] + k * reach) < reach for k in (0, 2))
        piled = np.count_nonzero(at) > max(levels.PILED * np.count_nonzero(below), levels.CLIPPED * x.size, levels.FEW)
        within, stays = binary_erosion(at, iterations=levels.PILED_BESIDE), levels.STAYS * walls[-1]
        speed = np.abs(velocity[within])
        speed = speed[speed > levels.STILL * np.abs(velocity).max()]
        told = speed.size > 0 and levels.SURE * noise < stays * np.sqrt(speed.size)
        slow, fast = np.quantile(speed, (0.05, 0.95)) if told else (1.0, 1.0)
        X, y = np.column_stack(columns)[within], x[within]
        moved = float(np.std(X @ np.linalg.lstsq(X, y, rcond=None)[0])) if told else np.inf
        stay.append(bool(piled and fast > levels.MUCH_WORSE * slow and moved < min(stays, levels.STAYS_NOISE * noise)))
    if not any(stay):
        return None
    alike = abs(walls[0] - walls[1]) < reach
    beyond = [x > wall - reach for x, wall, own in zip((torque, -torque), walls, stay, strict=True) if own or alike]
    return np.asarray(np.any(beyond, axis=0))


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
    left_out = bool((at_limits(record, kind) & np.isin(record.torque, limits)).any())
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
    few = size.size < levels.UNSIGNED or turns.size < levels.UNSIGNED_TURNS
    if few or record.torque.min() * record.torque.max() < 0:
        return None
    back = float(speed[record.velocity < 0].sum() / speed.sum())
    slow = np.where(speed <= levels.UNSIGNED_SLOW * speed.max(), size, np.inf)
    least = np.minimum.reduceat(slow, np.append(0, (turns[:-1] + turns[1:]) // 2))
    # beside a turn both strokes have more, where the weight of a joint has more in one alone
    strokes = np.array([np.median(x) for x in np.split(size, turns + 1)])
    (at_turns, low), way = levels.UNSIGNED_LOW, levels.UNSIGNED_WAY
    falls = np.mean(least <= low * np.minimum(strokes[:-1], strokes[1:])) >= at_turns
    if not (way < back < 1 - way and falls):
        return None
    beyond = "below" if record.torque.max() > 0 else "above"
    message = (
        f"The torque of {record.file}{OTHER_FILES} is a magnitude: zero or next to it where the joint turns, and never "
        f"{beyond} it, though it goes both ways. Whether it drives or brakes is not in it, so neither friction nor gravity "
        "can be told: log it with its sign, or what the drive was told to follow and its gains (signals.command)."
    )
    return Finding("torque-unsigned", CRITICAL, message, {"files": (record.file,)}, {"torque": np.inf})


def _loaded_at_start(record: Record, _: RunKind) -> Finding | None:
    """Slow loading whose torque does not begin at zero, by the line through its first samples."""
    if record.torque is None or record.torque.size < _PARTS:
        return None
    first = max(record.torque.size // _PARTS, levels.ENOUGH)  # the first part tells with what it begins
    time, torque = record.time[:first] - record.time[0], record.torque[:first]
    X = np.column_stack([np.ones(first), time])
    (begins, slope), (of_begins, _) = np.linalg.lstsq(X, torque, rcond=None)[0], np.linalg.inv(X.T @ X).diagonal()
    rest = torque - begins - slope * time
    error = np.sqrt(rest @ rest / (first - 2) * of_begins * inflation(rest))
    largest = float(np.abs(record.torque).max())
    if abs(begins) <= max(levels.DEVIATIONS * error, levels.STARTS_LOADED * largest):
        return None
    share = abs(begins) / largest
    message = (
        f"The torque of {record.file}{OTHER_FILES} begins at {begins:.3g}, {100 * share:.0f} % of its largest, and not at "
        "zero: an offset of the sensor makes sigma_0 too high in one direction and too low in the other. Subtract it, or "
        "begin without a load."
    )
    return Finding("loaded-at-start", CAUTION, message, {"files": (record.file,), "torque": begins, "share": share})


def _in_dead_zone(record: Record) -> tuple[NDArray[np.bool_], float] | None:
    """Samples of a moving joint in a dead zone, (n,): exactly zero far too often where the sign changes, beside the next values.

    With the size below which all torques read zero; 0 where larger ones are less by it: they go on to zero then.
    """
    torque, way = record.torque, record.velocity if record.position is None else record.position
    if torque is None or way is None or record.voltage is not None:
        return None
    zero = torque == 0
    if zero.sum() < max(levels.DEAD_ZONE * torque.size, levels.DEAD_SAMPLES):
        return None
    beside = np.unique(np.abs(torque[~zero]), return_counts=True)[1][: levels.PILED_BESIDE]
    if zero.sum() < levels.PILED * beside.max(initial=0):
        return None
    starts, stops = (np.flatnonzero(np.diff(np.pad(zero.astype(int), 1)) == sign) for sign in (1, -1))
    whole = (starts > 1) & (stops < torque.size - 1)
    starts, stops = starts[whole], stops[whole]
    crosses, samples = torque[starts - 1] * torque[stops] < 0, stops - starts
    steps = np.abs(way[1:] if record.position is None else np.diff(way))
    inside = steps[zero[1:] & zero[:-1]]
    rests = inside.size > 0 and inside.mean() < levels.DEAD_REST * steps.mean()
    if rests or crosses.sum() < levels.DEAD_SAMPLES or samples[crosses].sum() < 0.5 * samples.sum():
        return None
    # torques that go on to zero are beside it by less than a step between samples, evenly, and so the least of many by little
    edges, next_to = (torque[np.append(starts - k, stops + k - 1)] for k in (1, 2))
    sizes, steps = np.abs(edges), np.abs(next_to - edges)
    as_small = (1 - sizes.min() / (2 * np.median(sizes))) ** sizes.size
    return zero, float(sizes.min()) * bool(as_small < levels.RARE and np.mean(sizes > steps) > levels.MOSTLY)


def _dead_zone(record: Record, kind: RunKind) -> Finding | None:
    """A dead zone; of a moving run its samples are left out where it takes nothing off the others."""
    if (found := _in_dead_zone(record)) is None:
        return None
    share, size = float(found[0].mean()), found[1]
    told = (
        f"The torque of {record.file}{OTHER_FILES} is exactly zero in {100 * share:.1f} % of the samples, wherever it changes "
        "its sign: its sensor or drive has a dead zone"
    )
    numbers = {"files": (record.file,), "share": share, "torque": size}
    if size and kind == "tracking":
        return Finding(
            "dead-zone-left-out", CAUTION, f"{told}, below {size:.3g}. They are left out; switch it off.", numbers
        )
    message = (
        f"{told}, and reversals look softer. Switch it off; where it is taken off larger values too, alpha_0 lacks it: add it to "
        "the torque."
    )
    return Finding("dead-zone", CRITICAL, message, numbers, {"torque": np.inf})


def _coarse(record: Record, kind: RunKind) -> Finding | None:
    """A torque in so few steps that rounding does not average out: a hold is off by up to half a step."""
    torque = record.torque
    if torque is None or record.voltage is not None or torque.size < _PARTS:
        return None
    step, reach = smallest_step(torque), float(np.ptp(torque))
    if not step or reach > levels.COARSE * step or np.mean(np.diff(torque) == 0) < 0.5:
        return None
    steps = round(reach / step) + 1
    message = (
        f"The torque of {record.file}{OTHER_FILES} comes in {steps} steps of {step:.2g} (SI): what it rounds off is not "
        "noise and does not average out. Numbers may be off by half a step, those of reversals by more; log it with more "
        "digits, or from a finer sensor."
    )
    effect = {"torque": step / 2} if kind == "ramp" else {}
    return Finding("torque-coarse", CAUTION, message, {"files": (record.file,), "step": step, "levels": steps}, effect)
