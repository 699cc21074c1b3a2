"""Checks of position, logged velocity and time of a moving record: jumps, irregular sampling, a lag."""

from collections.abc import Iterator, Sequence

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps
from bristle.data.encoder import smallest_step
from bristle.data.experiment.signals import Context, Signals, si
from bristle.data.record import OTHER_FILES, OTHER_PLACES, Record
from bristle.data.sampling import BLOCK, DEVIATIONS, UNEVEN, jitter
from bristle.estimation.autocorrelation import inflation
from bristle.findings import CAUTION, Finding

SPANS = (1, 4, 16, 64, 256)  # samples over which travel is compared: noise hides a short one, a reversal a long one
FEWEST = 20  # spans that tell a factor, or a lag
_AROUND = 5  # samples on either side that tell the usual travel of one
_JUMP = 10.0  # standard deviations of a step, beyond which it is a jump: noise of steps is no worse
_NAMED = 4  # places in one sentence
_HELD = 3  # times that a reading repeats, and more counts that it then catches up by than the motion makes in a sample
_BESIDE = 20  # samples on either side of a held reading that tell its speed


def shortened(names: list[str]) -> tuple[str, ...]:
    """A few of the names, and how many more there are."""
    more = len(names) - _NAMED
    return tuple(names) if more <= 1 else (*names[:_NAMED], f"and {more} more")


def position_jumps(record: Record, signals: Signals, context: Context) -> Finding | None:
    """The caution on steps of the position in motion that neither speed nor time explains, or on lost samples."""
    if record.position is None or record.time.size < 2 * BLOCK:
        return None
    count = smallest_step(record.position)
    places, counted = [], True
    for s in between_gaps(record):
        if s.stop - s.start < 2 * BLOCK:
            continue
        intervals = np.diff(record.time[s]) / record.step
        found = _jumps(np.diff(record.position[s]), intervals, count)
        places += [(s.start + k, size, samples) for k, size, samples in found]
        # 1e-3 of a sampling interval: time stamps that deviate less were counted, not measured
        counted = counted and (not found or bool(np.ptp(intervals) <= 1e-3))
    if not places:
        return None
    _, sizes, travels = np.abs(np.array(places)).T
    if sizes.size > 20 and np.ptp(sizes) < 0.1 * sizes.mean() and np.median(travels) > _JUMP:
        return None  # alike, among next to no travel: the counts of an encoder under something that drifts
    word, rows = _rows(record, signals, [k + 1 for k, *_ in places])
    where = f"{record.file} {word}{'s' * (len(rows) > 1)} {', '.join(shortened(list(map(str, rows))))}"
    if counted and all(samples > 0 for *_, samples in places):
        place = f"{where} (about {sum(n for *_, n in places):.1f} samples)"
        message = (
            f"Samples are missing, or the encoder slipped: {place}{OTHER_PLACES}. The position jumps there by more than its "
            "speed explains, while the time goes on: speeds from it, and the acceleration there, are wrong. Log the time of "
            "each sample, or split the log."
        )
        return Finding("lost-samples", CAUTION, message, {"files": (place,)})
    largest = max((size for _, size, _ in places), key=abs)
    most = "up to " if len(places) > 1 else ""
    place = f"{where} (by {most}{abs(largest):.2g} {si('position', context)})"
    message = (
        f"The position jumps: {place}{OTHER_PLACES}. Neither its speed nor the time explains it, as where an encoder slips, "
        "misses counts or is reset: speeds from it, and the acceleration there, are wrong. Mend the encoder, or split the "
        "log there."
    )
    return Finding("position-jumps", CAUTION, message, {"files": (place,)})


def _jumps(steps: Array, intervals: Array, count: float) -> list[tuple[int, float, float]]:
    """Places of jumps among steps (n,), over intervals (n,); by how much, and the travel of how many samples."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    windows = np.lib.stride_tricks.sliding_window_view(steps, _AROUND)
    inner = np.arange(_AROUND, steps.size - _AROUND)
    before, after = np.median(windows[inner - _AROUND], axis=1), np.median(windows[inner + 1], axis=1)
    usual = np.where(np.abs(before) > np.abs(after), before, after)
    off = steps[inner] - (before + after) / 2
    along, travel = steps[inner] * np.sign(usual), np.abs(usual) * np.maximum(intervals[inner], 1.0)
    excess = np.where(along > 0, np.maximum(along - travel, 0.0), along)  # a stop is none
    size = np.abs(excess)

    # the noise of the noisiest block about each, from the median of deviations
    blocks = np.array_split(np.abs(off), max(off.size // BLOCK, 1))
    padded = np.pad(np.array([np.median(b) for b in blocks]) / 0.6745, 1, mode="edge")
    widest = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    noise = np.repeat(widest, [b.size for b in blocks])

    # at a reversal, 25 samples about it, a jump is play; 0.75 samples' travel, and less is none
    side = np.sign(usual)
    one_way = minimum_filter1d(side, 51) * maximum_filter1d(side, 51) > 0
    found = (before * after > 0) & one_way & (size > 0.75 * np.abs(usual)) & (size > _JUMP * noise + 2 * count)
    found &= np.abs(np.convolve(off, np.ones(2 * _AROUND + 1), "same")) > 0.5 * np.abs(off)  # it does not come back
    best = [k for k in np.flatnonzero(found) if size[k] >= size[max(k - _AROUND, 0) : k + _AROUND + 1].max()]
    lost = np.where(excess < 0, excess - travel, excess)
    return [(int(inner[k]), float(lost[k]), float(lost[k] / abs(usual[k]))) for k in best]


def _rows(record: Record, signals: Signals, samples: Sequence[int]) -> tuple[str, list[int]]:
    """The word of the file for its rows, and the numbers of these samples: lines of text, else rows of data."""
    if record.lines is not None:
        return "line", [int(record.lines[k]) for k in samples]
    rate = None if signals.time is None else signals.time.rate
    return "row", [round(float(record.time[k]) * rate) + 1 if rate else k + 1 for k in samples]


def held_position(record: Record, signals: Signals) -> Finding | None:
    """The caution on readings that repeat in the midst of a motion, and then catch up: they were not refreshed."""
    if record.position is None or record.time.size < 2 * BLOCK:
        return None
    found = list[tuple[int, int]]()
    for s in between_gaps(record):
        position = record.position[s]
        steps = np.diff(position)
        moves = np.flatnonzero(steps)
        if not moves.size:
            continue
        # 0.05 share of the steps of a position that its count is sought in: the smallest that occur are no smaller than it
        count = float(np.quantile(np.abs(steps[moves]), 0.05))
        start, end, times = moves[:-1] + 1, moves[1:], np.diff(moves) - 1
        ok = (times >= _HELD) & (start >= _BESIDE) & (end + 1 + _BESIDE < position.size)
        start, end, times = start[ok], end[ok], times[ok]
        before, after = position[start] - position[start - _BESIDE], position[end + 1 + _BESIDE] - position[end + 1]
        speed, fastest = (before + after) / (2 * _BESIDE), np.maximum(np.abs(before), np.abs(after)) / _BESIDE
        caught, due = steps[end], speed * (times + 1)
        held = (before * after > 0) & (np.abs(caught - due) < 0.5 * np.abs(due))
        held &= np.abs(caught) > fastest + _HELD * count
        found += zip((s.start + start[held]).tolist(), times[held].tolist(), strict=True)
    if not found:
        return None
    word, (first,) = _rows(record, signals, [found[0][0]])
    place = f"{record.file} ({len(found)} times, first at {word} {first})"
    samples = int(np.median([n for _, n in found]))
    share = 100 * sum(n for _, n in found) / record.position.size
    message = (
        f"The position stays the same for {samples} samples of a motion and then catches up at once: {place}{OTHER_PLACES}, "
        f"{share:.2g} % of the samples. The reading was not refreshed: speeds from it, and the acceleration there, are wrong. "
        "Log each reading once, with the time at which it was taken."
    )
    return Finding("position-held", CAUTION, message, {"files": (place,), "samples": samples, "share": share})


def irregular_sampling(record: Record) -> Finding | None:
    """The caution on white noise of the position that grows with the speed: of unknown instants of sampling."""
    about = jitter(record, record.time / record.step)
    if about < UNEVEN:
        return None
    message = (
        f"The position of {record.file}{OTHER_FILES} is noisy in proportion to its speed, as if sampled {about:.2g} of a "
        "sample (standard deviation) off its time: this takes away from the inertia. Log the time at which each sample was "
        "taken, in the loop of the controller."
    )
    return Finding("sampled-irregularly", CAUTION, message, {"files": (record.file,), "jitter": about})


def travels(record: Record, spans: Sequence[int] = SPANS) -> Iterator[tuple[Array, Array, Array]]:
    """Travel of the position, of the integral of the logged velocity, and change of velocity, over spans of samples.

    Nothing without both signals.
    """
    if record.position is None or record.velocity is None or record.velocity_estimated:
        return
    area = np.concatenate([[0.0], np.cumsum((record.velocity[1:] + record.velocity[:-1]) / 2 * np.diff(record.time))])
    for span in spans:
        ends = [np.arange(s.start, s.stop, span) for s in between_gaps(record)]
        both = (record.position, area, record.velocity)
        moved, said, changed = (np.concatenate([np.diff(x[k]) for k in ends]) for x in both)
        yield moved, said, changed


def velocity_lag(record: Record) -> Finding | None:
    """The caution on a logged velocity that is late, or early, against the position.

    The integral of a velocity through one pole of time constant L is behind the position by L times its change; of one
    that is L late, to the first order. Regression over spans, with a factor and an offset beside it: noise of the
    velocity makes L smaller, no larger.
    """
    found = []
    for moved, said, changed in travels(record, SPANS[1:]):
        X = np.column_stack([changed, said, np.ones(said.size)])
        scale = np.sqrt((X**2).sum(axis=0))
        if said.size < FEWEST or not (np.isfinite(scale).all() and scale.all()):
            continue
        X /= scale
        if np.linalg.matrix_rank(X, tol=1e-6) < X.shape[1]:
            continue
        of_X = np.linalg.inv(X.T @ X)
        b = of_X @ (X.T @ moved)
        rest = moved - X @ b
        error = np.sqrt(of_X[0, 0] * (rest @ rest) / (said.size - 3) * inflation(rest))
        share = float(abs(b[0]) / np.sqrt(said @ said))
        found.append((float(b[0] / scale[0]), float(error / scale[0]), share))
    if not found:
        return None
    lag, error, share = max(found, key=lambda x: abs(x[0]) / max(x[1], 1e-12))
    # a lag is told beyond so many samples, where it changes the velocity by this share (rms)
    samples, matters = 1.0, 0.01
    if abs(lag) - samples * record.step < DEVIATIONS * error or share < matters:
        return None
    lags, why, remedy = (
        ("lags behind", "filtered", "it unfiltered") if lag > 0 else ("leads", "the command", "the measured one")
    )
    lag, samples, error = abs(lag), abs(lag) / record.step, error / record.step
    message = (
        f"The logged velocity of {record.file}{OTHER_FILES} {lags} its position by {lag:.2g} s ({samples:.2g} samples, "
        f"standard error {error:.2g}), as where it is {why}: friction at reversals and the inertia are wrong. Leave "
        f"`velocity` out under signals to have it estimated from the position, or log {remedy}."
    )
    numbers = {"files": (record.file,), "lag": lag, "samples": samples, "error": error, "remedy": remedy}
    return Finding("velocity-lags", CAUTION, message, numbers)
