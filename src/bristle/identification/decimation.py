"""The decimation filter of moving data, as a matrix."""

from collections.abc import Sequence

import numpy as np
from scipy import signal, sparse

from bristle.arrays import Array
from bristle.errors import InputError

_KERNEL_TAIL = 1e-8
"""Where the smoothing kernel is cut, relative to its peak."""


def decimator(stretches: Sequence[Array], decimation: int, file: str) -> tuple[sparse.csr_array, int]:
    """The filter as a matrix (equations, samples), for stretches of given lengths; and how many samples its transients cost.

    Raises InputError where no stretch is longer than the transients.
    """
    lengths = np.concatenate(stretches).astype(int)
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
            f"{file}: no segment without gaps is longer than {2 * half} samples, the transient of the decimation filter; "
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
