"""Local sensitivity: derivatives of the friction torque by each parameter along a sinusoidal motion.

    partial    p dT_f / dp  at fixed z
    total      p (dT_f / dp + dT_f / dz dz / dp)  along the whole motion

Both are in N*m. In a pair of sets a parameter changes by the same share in both directions.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array, result
from bristle.control.compensator import Reference
from bristle.errors import InputError
from bristle.model import functions
from bristle.model.parameters import Lugre, Pair, estimated_of, fields_of
from bristle.model.rollout import rollout_jacobian
from bristle.model.vectorize import evaluate
from bristle.simulation.fisher import cleared, of_estimated, values_of
from bristle.simulation.references import Sine

CLAIMED = frozenset({"alpha_0", "alpha_2"})  # the parameters that matter most by section 3.3 of the paper
DURATION, PERIOD = 10.0, 1e-3  # of a motion and its samples, s
_OFTEN = 200  # least samples of a period, and most periods in `DURATION`
FREQUENCIES = (1e-6, 1e4)  # lowest and highest of a motion, Hz


class SineMotion(NamedTuple):
    """A sinusoidal reference, amplitude sin(2 pi frequency t), with an undeflected bristle at the start."""

    amplitude: float  # rad
    frequency: float  # Hz
    duration: float = DURATION  # s
    period: float = PERIOD  # time between samples, s

    @property
    def course(self) -> Reference:
        """Position, velocity and acceleration at the samples."""
        return Sine(self.amplitude, self.frequency).sampled(self.duration, self.period)

    @property
    def top_speed(self) -> float:
        """rad/s."""
        return 2 * np.pi * self.frequency * self.amplitude


def motion(amplitude: float, frequency: float) -> SineMotion:
    """The motion of an amplitude, rad, > 0, and a frequency, Hz, over 10 s at 1 kHz, as in the paper.

    A slow motion lasts at least two periods; a fast one has 200 samples a period. Raises InputError where the frequency
    is outside `FREQUENCIES`.
    """
    low, high = FREQUENCIES
    if not low <= frequency <= high:
        raise InputError(
            f"frequency: got {frequency:g} Hz; expected {low:g} to {high:g} Hz: choose one at which the joint may move"
        )
    duration = max(min(DURATION, _OFTEN / frequency), 2 / frequency)
    return SineMotion(amplitude, frequency, duration, min(PERIOD * duration / DURATION, 1 / (_OFTEN * frequency)))


@result
class Local:
    """Derivatives along one motion."""

    names: tuple[str, ...]  # parameters of the columns: six of the paper's law
    time: Array  # s, (n,)
    velocity: Array  # rad/s, (n,)
    torque: Array  # T_f, N*m, (n,)
    partial: Array  # p dT_f / dp at fixed z, N*m, (n, 6)
    total: Array  # the same through the bristle, N*m, (n, 6)

    def shares(self, *, partial: bool = False, last: int | None = None) -> Array:
        """RMS of each derivative over the RMS of T_f, (6,), of the whole motion or its last samples."""
        window = slice(None if last is None else -last, None)
        slopes = (self.partial if partial else self.total)[window]
        return rms(slopes) / rms(self.torque[window])

    @property
    def ranking(self) -> tuple[str, ...]:
        """The parameters, the largest total share first."""
        return ranked(self.shares(), self.names)


def rms(values: Array) -> Array:
    """Root mean square over the samples, (n,) -> () or (n, k) -> (k,)."""
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))


def ranked(shares: Array, names: Sequence[str]) -> tuple[str, ...]:
    """Parameters, the largest of the shares, (6,), first."""
    return tuple(names[k] for k in np.argsort(-shares, kind="stable"))


def local(p: Lugre[float] | Pair[float], reference: SineMotion) -> Local:
    """Both derivatives of the friction torque along a motion, exact by CasADi."""
    velocity = reference.course.velocity
    rolled = rollout_jacobian(velocity, reference.period, p, 0.0)
    names, scaled = estimated_of(p.law), of_estimated(cleared(rolled.by_parameters), p) * values_of(p)
    # Partial derivatives of the set that acts at each z and v.
    acting: Sequence[float | Array] = p if isinstance(p, Lugre) else ()
    if not isinstance(p, Lugre):
        acting = evaluate(functions.active_function(p.law), rolled.z, velocity, *p.positive, *p.negative)
    _, _, *slopes = evaluate(functions.torque_sensitivity_function(p.law), rolled.z, velocity, *acting)
    by_name = dict(zip(fields_of(p.law), zip(acting, slopes, strict=True), strict=True))
    return Local(
        names=names, time=reference.period * np.arange(velocity.size, dtype=np.float64), velocity=velocity,
        torque=rolled.torque, partial=np.column_stack([np.multiply(*by_name[name]) for name in names]),
        total=scaled.reshape(velocity.size, -1, len(names)).sum(axis=1),
    )  # fmt: skip  # a list of values


@result
class Map:
    """Total shares in settled motion, over amplitude and frequency."""

    names: tuple[str, ...]  # the parameters that the shares are of
    amplitudes: Array  # rad, (a,), ascending
    frequencies: Array  # Hz, (f,), ascending
    shares: Array  # RMS of p dT_f / dp over the RMS of T_f, (a, f, 6)

    @property
    def first(self) -> NDArray[np.intp]:
        """Place in `names` of the parameter with the largest share, (a, f)."""
        return np.asarray(self.shares.argmax(axis=-1))

    @property
    def claim(self) -> NDArray[np.bool_]:
        """Whether alpha_0 and alpha_2 are the first two, (a, f)."""
        flat = self.shares.reshape(-1, self.shares.shape[-1])
        return np.array([claimed(row, self.names) for row in flat]).reshape(self.first.shape)


def claimed(shares: Array, names: Sequence[str]) -> bool:
    """Whether alpha_0 and alpha_2 have the two largest shares, (6,)."""
    return set(ranked(shares, names)[:2]) == CLAIMED


def grid(reference: SineMotion) -> tuple[Array, Array]:
    """Amplitudes (13,), rad, 1/1000 to 10 times the motion's, and frequencies (9,), Hz, 1/20 to 20 times."""
    third = np.arange(-9, 4) / 3
    return reference.amplitude * 10**third, reference.frequency * 10 ** (np.arange(-4, 5) / 3)


def sensitivity_map(p: Lugre[float] | Pair[float], amplitudes: Array, frequencies: Array) -> Map:
    """Total shares of a sine's third period from rest, for each amplitude (a,), rad, and frequency (f,), Hz."""
    cell = 1000  # samples of a period
    shares = np.empty((amplitudes.size, frequencies.size, len(estimated_of(p.law))))
    for i, j in np.ndindex(shares.shape[:2]):
        a, f = float(amplitudes[i]), float(frequencies[j])
        shares[i, j] = local(p, SineMotion(a, f, 3 / f, 1 / (cell * f))).shares(last=cell)
    return Map(names=estimated_of(p.law), amplitudes=amplitudes, frequencies=frequencies, shares=shares)
