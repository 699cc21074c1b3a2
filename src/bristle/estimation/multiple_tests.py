"""Multiple tests: Benjamini and Hochberg's false discovery rate (1995), Simes's test (1986)."""

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array


def false_discovery(p: Array) -> Array:
    """Adjusted p-values of Benjamini and Hochberg, (n,)."""
    order, adjusted = np.argsort(p, kind="stable"), np.empty(p.size)
    raised = np.minimum(p[order] * p.size / np.arange(1, p.size + 1), 1.0)
    adjusted[order] = np.minimum.accumulate(raised[::-1])[::-1]
    return adjusted


def false_discovery_within(p: Array, group: NDArray[np.intp]) -> Array:
    """The same within each group, (n,); groups are numbered from 0."""
    adjusted = np.empty(p.size)
    for rows in _groups(group):
        adjusted[rows] = false_discovery(p[rows])
    return adjusted


def simes(p: Array, group: NDArray[np.intp]) -> Array:
    """p-value of each group that none of its tests is false, (groups,); 1 without tests."""
    return np.array([false_discovery(p[rows]).min(initial=1.0) for rows in _groups(group)])


def _groups(group: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """The tests of each group, by its number."""
    return np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group)))[:-1]
