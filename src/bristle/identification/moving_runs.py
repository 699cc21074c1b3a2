"""Moving runs as every fit of them takes them.

Directions, regressors, inertia, the decimation filter, and what is refused before any is fitted.
"""

from collections.abc import Sequence

import numpy as np
from scipy import signal, sparse

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import PlusMinus
from bristle.data.record import Record
from bristle.errors import InputError

_DROWNS = 1e9
"""Times the measured torque: an inertia's torque this large leaves nothing of it in the last digits."""
DIRECTIONS = {"+": 1.0, "-": -1.0}
_KERNEL_TAIL = 1e-8
"""Where the smoothing kernel is cut, relative to its peak."""


def needed(record: Record, name: str) -> Array:
    """A signal of the record by its name, (n,). Raises InputError where the run does not have it."""
    values: Array | None = getattr(record, name)
    if values is None:
        raise InputError(f"{record.file}: the fit needs {name}, which this run does not have; add it under signals")
    return values


def extra_columns(regressors: Sequence[str], record: Record) -> dict[str, Array]:
    """The columns of some regressors (inertia, offset, gravity) by parameter, each (N,).

    Raises InputError where the record lacks what one needs.
    """
    columns: dict[str, Array] = {}
    if "inertia" in regressors:
        columns["inertia"] = needed(record, "acceleration")
    if "offset" in regressors:
        columns["offset"] = np.ones(record.time.size)
    if "gravity" in regressors:
        columns |= gravity(needed(record, "position"))
    return columns


def torque_shifts(records: Sequence[Record]) -> dict[str, Array]:
    """What an error of each constant does to the torques of some records, one after the other, (N,), as in `Record`."""
    names = dict.fromkeys(name for r in records for name in r.torque_shifts)
    return {name: np.concatenate([r.torque_shifts.get(name, np.zeros(r.time.size)) for r in records]) for name in names}


def gravity(position: Array) -> dict[str, Array]:
    """The two columns of a gravity torque, gravity_sin sin(q) + gravity_cos cos(q); position in rad, (n,)."""
    return {"gravity_sin": np.sin(position), "gravity_cos": np.cos(position)}


def regressors(experiment: Experiment) -> tuple[str, ...]:
    """What a moving fit asks for: as declared, or inertia and, where directions are not separate, offset.

    A fixed inertia is not asked for.
    """
    asked: tuple[str, ...] | None = experiment.fit.regressors
    if asked is None:
        asked = ("inertia",) if experiment.fit.directions == "separate" else ("inertia", "offset")
    fixed, _ = inertia(experiment)
    return tuple(r for r in asked if r != "inertia" or fixed is None)


def refuse_opposing(experiment: Experiment, velocity: Array, torque: Array, what: str) -> None:
    """Raise InputError where the drive's torque (n,) opposes the velocity (n,).

    Friction opposes motion, so its sign is wrong.
    """
    if velocity.size and float(velocity @ torque) < 0 and np.median(torque * np.sign(velocity)) < 0:
        raise InputError(
            f"{experiment.path.name}: the torque opposes the velocity {what}; a drive's torque is positive along positive velocity: give it "
            "scale: -1 under signals, or its sign where it is a magnitude; or ask for fit.regressors that outweigh friction"
        )


def refuse_opposing_runs(experiment: Experiment, records: Sequence[Record]) -> None:
    """Raise InputError where the torque of moving runs opposes their velocity."""
    velocity, torque = (np.concatenate([_of(r, name) for r in records]) for name in ("velocity", "torque"))
    refuse_opposing(experiment, velocity, torque, "over the moving runs as a whole")


def refuse_mixed_rates(records: Sequence[Record]) -> None:
    """Raise InputError where moving runs were sampled at different rates: one decimation filter serves them all."""
    steps = {r.file: r.step for r in records}
    first, last = min(steps, key=lambda f: steps[f]), max(steps, key=lambda f: steps[f])
    if steps[last] > 1.05 * steps[first]:
        raise InputError(
            f"runs: tracking runs are sampled at different rates ({first} at {1 / steps[first]:.4g} Hz, {last} at {1 / steps[last]:.4g} Hz); "
            "fit them in experiments of their own, or resample one"
        )


def directions(experiment: Experiment, records: Sequence[Record]) -> tuple[str, ...]:
    """`both`, or those in which the records move."""
    moving = (d for d, sign in DIRECTIONS.items() if any((_of(r, "velocity") * sign > 0).any() for r in records))
    return tuple(moving) if experiment.fit.directions == "separate" else ("both",)


def inertia(experiment: Experiment) -> tuple[float | None, PlusMinus | None]:
    """The inertia where it is fixed, and where it is known with an error."""
    known = experiment.inertia
    if known is None:
        return None, None
    return (None, known) if known.standard_error else (known.value, None)


def _of(record: Record, name: str) -> Array:
    values: Array | None = getattr(record, name)
    return np.zeros(0) if values is None else values


def inertial(record: Record, inertia: float) -> Array:
    """Torque of a known inertia in a moving run, N*m, (n,).

    Raises InputError where it leaves nothing of the measured torque.
    """
    torque = inertia * needed(record, "acceleration")
    own, measured = float(np.abs(torque).max()), float(np.abs(needed(record, "torque")).max())
    if own > _DROWNS * measured > 0:
        raise InputError(
            f"{record.file}: an inertia of {inertia:.3g} takes {own:.3g} off a torque of {measured:.3g} at most (SI); check its unit"
        )
    return torque


def decimator(segments: Sequence[Array], decimation: int, file: str) -> tuple[sparse.csr_array, int]:
    """The filter as a matrix (equations, samples), for segments between gaps of given lengths.

    And how many samples its transients cost. Raises InputError where no segment is longer than the transients.
    """
    lengths = np.concatenate(segments).astype(int)
    samples = int(lengths.sum())
    if decimation == 1:
        return sparse.eye_array(samples, format="csr"), 0
    kernel = _kernel(decimation)
    half = kernel.size // 2
    ends = np.cumsum(lengths)
    pairs = zip(ends - lengths, ends, strict=True)
    centres = np.concatenate([np.arange(start + half, stop - half, decimation) for start, stop in pairs])
    if centres.size == 0:
        raise InputError(
            f"{file}: no segment between gaps is longer than {2 * half} samples, the transient of the decimation filter; "
            f"log longer, or set fit.decimation below {decimation}"
        )
    columns = (centres[:, None] + np.arange(-half, half + 1)).ravel()
    pointers = np.arange(0, columns.size + 1, kernel.size)
    smooth = sparse.csr_array((np.tile(kernel, centres.size), columns, pointers), shape=(centres.size, samples))
    return smooth, int(np.minimum(lengths, 2 * half).sum())


def _kernel(decimation: int) -> Array:
    """Impulse response of the zero-phase decimation filter, cut where it has died out; odd length, sum 1."""
    sections = signal.butter(4, 0.8 / decimation, output="sos")
    reach = 80 * decimation
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    response = signal.sosfiltfilt(sections, impulse, padtype=None)
    alive = np.flatnonzero(np.abs(response) > _KERNEL_TAIL * np.abs(response).max())
    half = int(max(reach - alive[0], alive[-1] - reach))
    kernel: Array = response[reach - half : reach + half + 1]
    kernel /= kernel.sum()
    return kernel
