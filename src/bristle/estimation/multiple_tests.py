"""Many tests at once: Benjamini and Hochberg's false discovery rate (1995), and Simes's test (1986) that any of a group is false."""

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array


def false_discovery(p: Array) -> Array:
    """Benjamini and Hochberg's adjusted p-values, (n,): the smallest rate of false discoveries at which each is one."""
    order, adjusted = np.argsort(p, kind="stable"), np.empty(p.size)
    raised = np.minimum(p[order] * p.size / np.arange(1, p.size + 1), 1.0)
    adjusted[order] = np.minimum.accumulate(raised[::-1])[::-1]
    return adjusted


def false_discovery_within(p: Array, group: NDArray[np.intp]) -> Array:
    """`false_discovery` of each group by itself, (n,); groups are numbered from 0."""
    adjusted = np.empty(p.size)
    for rows in _groups(group):
        adjusted[rows] = false_discovery(p[rows])
    return adjusted


def simes(p: Array, group: NDArray[np.intp]) -> Array:
    """Of each group the p-value that none of its tests is false, (groups,); 1 for a number that no test has."""
    return np.array([false_discovery(p[rows]).min(initial=1.0) for rows in _groups(group)])


def _groups(group: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """The tests of each group, by its number."""
    return np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group)))[:-1]
