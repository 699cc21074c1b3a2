"""Directions, regressors, decimation and plausibility checks of moving runs, common to all fits."""

from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.data.differentiation import smoothed
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import PERIODIC, PlusMinus
from bristle.data.record import Record
from bristle.data.signal_checks import merged
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation, lag_one
from bristle.model.functions import load_terms_function, periodic_terms_function
from bristle.model.laws import registry
from bristle.model.parameters import Kind, periodic, slides
from bristle.model.vectorize import evaluate

_DROWNS = 1e9  # times the measured torque: a larger inertial torque leaves none of its digits
DIRECTIONS = {"+": 1.0, "-": -1.0}


class Regressor(NamedTuple):
    """A term that an experiment can ask for beside friction."""

    names: tuple[str, ...]
    needs: tuple[str, ...] = ()  # Signals that its columns are made of


REGRESSORS = {
    "inertia": Regressor(("inertia",), ("acceleration",)),
    "offset": Regressor(("offset",)),
    "gravity": Regressor(("gravity_sin", "gravity_cos"), ("position",)),
    "spring": Regressor(("spring",), ("position",)),
    "quadratic": Regressor(("quadratic",), ("velocity",)),
    "links": Regressor(("links",), ("link_torque",)),
}
LEVELS = {name: Regressor(coefficients) for name, coefficients in registry.LOADS.items()}
"""Loads by which the friction level rises: part of the law, fitted like regressors."""
LOADS = tuple(name for regressor in REGRESSORS.values() for name in regressor.names)  # in the order of `law.load_terms`
_NEEDED = ("position", "velocity", "acceleration", "link_torque")  # arguments of `law.load_terms`
_PER_METRE = "/m"  # suffix of an order of a prismatic joint
_ENDS = 5  # least length of a segment, in transients of the decimation filter
_KERNEL_TAIL, _DIED_OUT = 1e-4, 1e-8  # of its peak: where the kernel is cut, and where its transient ends


def terms_of(regressor: str) -> Regressor:
    """A regressor by name, such as `cogging_4`, or `cogging_4/m` of a prismatic joint."""
    known = REGRESSORS.get(regressor) or LEVELS.get(regressor)
    if known is not None:
        return known
    stem, _, order = regressor.removesuffix(_PER_METRE).partition("_")
    names = tuple(f"{stem}_{wave}_{order}" for wave in ("sin", "cos")) if order else ()
    return Regressor(names, ("position", "velocity") if stem == "ripple" else ("position",))


def with_orders(names: Sequence[str], orders: Sequence[int], kind: Kind) -> tuple[str, ...]:
    """The regressors with `cogging` and `ripple` expanded to their orders."""
    per = _PER_METRE if slides(kind) else ""
    each = {name: [f"{name}_{k}{per}" for k in orders] for name in PERIODIC}
    return tuple(one for name in names for one in each.get(name, [name]))


def turn_of(kind: Kind) -> tuple[float, str]:
    """Length that an order divides, rad or m, and its name."""
    return (1.0, "metre") if slides(kind) else (2 * np.pi, "turn")


def declared(experiment: Experiment) -> tuple[str, ...] | None:
    """The regressors in the file, with orders where these are known; None where it has none."""
    asked, orders = experiment.fit.regressors, experiment.fit.orders
    return with_orders(asked, orders, experiment.joint.kind) if asked and isinstance(orders, tuple) else asked


def regressors_of(parameters: Collection[str], kind: Kind) -> tuple[str, ...]:
    """The regressors that some parameters are of."""
    plain = [name for name, terms in REGRESSORS.items() if not set(terms.names).isdisjoint(parameters)]
    each = [with_orders((x[0],), (x[2],), kind)[0] for name in parameters if (x := periodic(name))]
    return (*plain, *dict.fromkeys(each))


def shows_gravity(kind: Kind, *positions: Array) -> bool:
    """Whether positions, rad, of a joint that turns are far enough apart to show gravity."""
    whole = np.concatenate([np.zeros(0), *positions])
    return bool(not slides(kind) and whole.size and np.ptp(whole) >= levels.SWING)


def needed(record: Record, name: str) -> Array:
    """A signal of the record by its name, (n,). Raises InputError where the run does not have it."""
    values: Array | None = getattr(record, name)
    if values is None:
        raise InputError(f"{record.file}: the fit needs {name}, which this run does not have; add it under signals")
    return values


def extra_columns(regressors: Sequence[str], record: Record) -> dict[str, Array]:
    """Columns of some regressors by parameter, (N,) each. Raises InputError where a signal is missing."""
    return load_columns(regressors, lambda signal: needed(record, signal), record.time.size)


def load_columns(regressors: Sequence[str], signal: Callable[[str], Array], n: int) -> dict[str, Array]:
    """Columns of some regressors by parameter (`law.load_terms`), (n,) each, from signals by name, SI, (n,)."""
    needs = {what for regressor in regressors for what in terms_of(regressor).needs}
    signals = [signal(what) if what in needs else np.zeros(n) for what in _NEEDED]
    terms = dict(zip(LOADS, evaluate(load_terms_function(), *signals), strict=True))
    columns = {name: terms[name] for regressor, x in REGRESSORS.items() if regressor in regressors for name in x.names}
    for regressor in regressors:
        if regressor.startswith(PERIODIC) and (names := terms_of(regressor).names):
            stem, _, order = regressor.removesuffix(_PER_METRE).partition("_")
            rate = int(order) * (2 * np.pi if regressor.endswith(_PER_METRE) else 1.0)
            waves = evaluate(periodic_terms_function(), *signals[:2], rate)
            columns |= zip(names, waves[:2] if stem == "cogging" else waves[2:], strict=True)
    return columns


def regressor_line(names: Collection[str], parameters: Collection[str] = ()) -> str:
    """The `regressors` line with these and those of some parameters."""
    wanted = [x for x in REGRESSORS if x in names or not set(parameters).isdisjoint(REGRESSORS[x].names)]
    wanted += [x for x in PERIODIC if any(name.partition("_")[0] == x for name in (*names, *parameters))]
    return f"regressors: [{', '.join(wanted)}]"


def torque_shifts(records: Sequence[Record]) -> dict[str, Array]:
    """Change of the torques of some records per standard error of each constant, (N,)."""
    names = dict.fromkeys(name for r in records for name in r.torque_shifts)
    return {name: np.concatenate([r.torque_shifts.get(name, np.zeros(r.time.size)) for r in records]) for name in names}


def regressors(experiment: Experiment) -> tuple[str, ...]:
    """Regressors of a moving fit: as declared, or inertia and, unless directions are separate, offset; loads last."""
    asked, (fixed, _) = declared(experiment), inertia(experiment)
    if asked is None:
        asked = ("inertia",) if experiment.fit.directions == "separate" else ("inertia", "offset")
    made_of = experiment.coasting.made_of if experiment.coasting else None
    known = {made_of, "inertia" if fixed is not None else None}
    return (*(r for r in asked if r not in known), *experiment.fit.load)


def given_by(records: Sequence[Record]) -> tuple[str, ...]:
    """Parameters of what the torque of coasting records was made of."""
    kinds = dict.fromkeys(r.made_of for r in records if r.made_of)
    return tuple(name for kind in kinds for name in REGRESSORS[kind].names)


def refuse_noise(experiment: Experiment, motion: Array, torque: Array, what: str, others: Array | None = None) -> None:
    """Raise InputError where the torque (n,) is unrelated to the motion (n,)."""
    if unrelated(motion, torque, others):
        if torque.min() >= 0 and motion.min() < 0 < motion.max():
            raise InputError(
                f"{experiment.path.name}: the torque is never below zero {what}, though the joint goes both ways: it is a magnitude, which does "
                "not show friction; log it with its sign, or name what the drive was told to follow, as in --column command=NAME"
            )
        raise InputError(
            f"{experiment.path.name}: the torque has nothing to do with the motion {what}, and is noise of {np.std(torque):.3g} "
            f"about {np.mean(torque):.3g} (SI); name the column of the torque under signals, or move against more friction than that noise"
        )


def loads_slowly(record: Record) -> bool:
    """Whether the torque of a record is mostly slow, as a commanded one, and not noise."""
    torque, cutoff = np.asarray(record.torque), record.cutoff
    slow = smoothed(record, torque, cutoff, noisy=True) if cutoff < 0.5 / record.step else torque
    passes = np.count_nonzero(np.diff(np.signbit(slow - slow.mean())))
    seldom = passes < max(levels.SLOW_PASSES * cutoff * torque.size * record.step, 2)
    return bool(seldom and np.var(slow) > levels.SLOW_SHARE * np.var(torque))


def refuse_opposing(
    experiment: Experiment, velocity: Array, torque: Array, what: str, others: Array | None = None
) -> None:
    """Raise InputError where the torque (n,) is noise, or opposes the velocity beside `others` (n, k)."""
    refuse_noise(experiment, velocity, torque, what, others)
    opposes = velocity.size and float(velocity @ torque) < 0 and np.median(torque * np.sign(velocity)) < 0
    if opposes and others is not None:
        basis = np.column_stack([np.sign(velocity), others])
        beside = np.linalg.lstsq(basis, torque, rcond=None)[0]
        rest, own = torque - basis @ beside, basis[:, 0] - others @ np.linalg.lstsq(others, basis[:, 0], rcond=None)[0]
        error = np.sqrt(inflation(rest) * (rest @ rest) / max(torque.size - beside.size, 1) / (own @ own))
        opposes = beside[0] < -levels.SURE * error
    if opposes:
        made = "check resistance and torque constant, by which it is computed from the voltage; " * (
            experiment.signals.drive() == "voltage"
        )
        raise InputError(
            f"{experiment.path.name}: the torque opposes the velocity {what}; {made}a drive's torque is positive along positive velocity: give it "
            "scale: -1 under signals (--scale torque=-1), or its sign where it is a magnitude; or ask for fit.regressors that outweigh friction"
        )


def unrelated(velocity: Array, torque: Array, others: Array | None = None) -> bool:
    """Whether a torque (n,) is noise: an F test at 1 % of sgn(v), v and, over time, `others`, (n, k)."""
    basis = np.column_stack([np.sign(velocity), velocity, *([] if others is None else [others])])
    if velocity.size < levels.SAMPLES_EACH * basis.shape[1] or np.median(np.abs(torque - np.median(torque))) == 0:
        return False  # a mostly constant torque is not noise
    if velocity.size and velocity.min() < 0 < velocity.max():
        basis, torque = basis - basis.mean(axis=0), torque - torque.mean()
    basis = basis[:, np.ptp(basis, axis=0) + np.abs(basis).max(axis=0) > 0]
    rest = torque - basis @ np.linalg.lstsq(basis, torque, rcond=None)[0]
    k, total, left = basis.shape[1], float(torque @ torque), float(rest @ rest)
    course = others is not None
    freedom = torque.size / (inflation(rest) if course else 1.0) - k - 1
    explained = 1 - left / total if total > 0 else 1.0
    smooth = 1 - lag_one(rest) < levels.ROUGHER * (1 - lag_one(velocity))
    if freedom < 1 or left <= 0 or (course and (smooth or explained > levels.RELATED)):
        return False
    return float(fdtrc(k, freedom, (total - left) / k / left * freedom)) > levels.SIGNIFICANCE


def refuse_opposing_runs(experiment: Experiment, records: Sequence[Record]) -> None:
    """Raise InputError where torque and motion of moving runs are unrelated or opposed, or the velocity is wrong."""
    if any(r.made_of for r in records):  # made from the motion
        return
    velocity, torque = (np.concatenate([_of(r, name) for r in records]) for name in ("velocity", "torque"))
    # columns of inertia, gravity and links, where known
    asked, sizes = ("inertia", "gravity", "links"), [r.time.size for r in records]
    motions = (load_columns(asked, partial(_of, r, size=n), n) for r, n in zip(records, sizes, strict=True))
    others = np.concatenate([np.column_stack(list(columns.values())) for columns in motions])
    if others[:, -1].any():  # links may outweigh friction, with any sign
        basis = np.column_stack([np.sign(velocity), velocity, others])
        torque = torque - others[:, -1] * np.linalg.lstsq(basis, torque, rcond=None)[0][-1]
    said = [d for r in records for d in r.warnings]
    turned = merged(d for d in said if d.code == "velocity-factor" and d.numbers["ratio"] < 0)
    if turned and float(velocity @ torque) < 0:  # the velocity has the wrong sign
        raise InputError(f"{experiment.path.name}: {turned[0]}")
    try:
        refuse_opposing(experiment, velocity, torque, "over the moving runs as a whole", others)
    except InputError as end:
        if counts := merged(d for d in said if d.code == "whole-positions"):  # counts in place of positions
            raise InputError(f"{experiment.path.name}: {counts[0]}") from end
        raise


def directions(experiment: Experiment, records: Sequence[Record]) -> tuple[str, ...]:
    """`both`, or those in which the records move."""
    return moved_in(records) if experiment.fit.directions == "separate" else ("both",)


def moved_in(records: Sequence[Record]) -> tuple[str, ...]:
    """Directions that make more than a hundredth of the total way of the records."""
    velocity = np.concatenate([_of(r, "velocity") for r in records])
    way = {d: float(np.maximum(velocity * sign, 0.0).sum()) for d, sign in DIRECTIONS.items()}
    return tuple(d for d, x in way.items() if x > levels.AT_REST * sum(way.values()))


def inertia(experiment: Experiment) -> tuple[float | None, PlusMinus | None]:
    """The fixed inertia, or else the one known with an error."""
    known = experiment.inertia
    if known is None:
        return None, None
    return (None, known) if known.standard_error else (known.value, None)


def _of(record: Record, name: str, size: int = 0) -> Array:
    """A signal of the record, (n,), or zeros."""
    values: Array | None = getattr(record, name)
    return np.zeros(size) if values is None else values


def known_torque(record: Record, inertia: float | None, regressors: Sequence[str]) -> Array | None:
    """Torque of a fixed inertia and of a robot's links, N*m, (n,). Raises InputError for too large an inertia."""
    links = None if "links" in regressors else record.link_torque
    if inertia is None:
        return links
    torque = inertia * needed(record, "acceleration")
    own, measured = float(np.abs(torque).max()), float(np.abs(needed(record, "torque")).max())
    if own > _DROWNS * measured > 0:
        raise InputError(
            f"{record.file}: an inertia of {inertia:.3g} takes {own:.3g} off a torque of {measured:.3g} at most (SI); check its unit"
        )
    return torque if links is None else torque + links


def decimator(
    segments: Sequence[Array], decimation: int, file: str, unknown: NDArray[np.bool_] | None = None
) -> tuple[sparse.csr_array, int]:
    """The decimation filter as a matrix (equations, samples) without `unknown` torques, and samples lost at ends."""
    lengths = np.concatenate(segments).astype(int)
    samples = int(lengths.sum())
    if decimation == 1:
        return _without(sparse.csr_array(sparse.eye_array(samples, format="csr")), unknown), 0
    kernel, half = _kernel(decimation, _KERNEL_TAIL), transient(decimation) // 2
    ends = np.cumsum(lengths)
    pairs = zip(ends - lengths, ends, strict=True)
    centres = np.concatenate([np.arange(start + half, stop - half, decimation) for start, stop in pairs])
    if centres.size == 0:
        raise InputError(
            f"{file}: no segment between gaps is longer than {2 * half} samples, the transient of the decimation filter; "
            f"log longer, or set fit.decimation below {decimation}"
        )
    columns = (centres[:, None] + np.arange(kernel.size) - kernel.size // 2).ravel()
    pointers = np.arange(0, columns.size + 1, kernel.size)
    smooth = sparse.csr_array((np.tile(kernel, centres.size), columns, pointers), shape=(centres.size, samples))
    return _without(smooth, unknown), int(np.minimum(lengths, 2 * half).sum())


def _without(smooth: sparse.csr_array, unknown: NDArray[np.bool_] | None) -> sparse.csr_array:
    """The equations, (m, n), without those that use marked samples, (n,); all if none would be left."""
    known = np.zeros(0, bool) if unknown is None else abs(smooth) @ unknown.astype(float) < levels.FILTER_WEIGHT
    return sparse.csr_array(smooth[known]) if known.any() and not known.all() else smooth


def longest_decimation(usual: int, samples: int) -> int:
    """The largest decimation, up to the usual one, whose transients cost at most a fifth of a segment."""
    return next((d for d in range(usual, 1, -1) if samples > _ENDS * transient(d)), 1)


def transient(decimation: int) -> int:
    """Samples that the decimation filter costs a segment."""
    return 0 if decimation == 1 else _kernel(decimation).size - 1


def _kernel(decimation: int, tail: float = _DIED_OUT) -> Array:
    """Impulse response of the zero-phase decimation filter, cut below this share of its peak; odd length, sum 1."""
    from scipy import signal

    sections = signal.butter(4, 0.8 / decimation, output="sos")
    reach = 80 * decimation
    impulse = np.zeros(2 * reach + 1)
    impulse[reach] = 1.0
    response = signal.sosfiltfilt(sections, impulse, padtype=None)
    alive = np.flatnonzero(np.abs(response) > tail * np.abs(response).max())
    half = int(max(reach - alive[0], alive[-1] - reach))
    kernel: Array = response[reach - half : reach + half + 1]
    kernel /= kernel.sum()
    return kernel
