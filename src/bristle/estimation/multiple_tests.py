"""Many tests at once: Benjamini and Hochberg's false discovery rate (1995), and Simes's test (1986) that any of a group is false."""

import numpy as np
from numpy.typing import NDArray

from bristle.arrays import Array


def false_discovery(p: Array) -> Array:
    """Benjamini and Hochberg's adjusted p-values, (n,): the smallest rate of false discoveries at which each is one."""
    return false_discovery_within(p, np.zeros(p.size, dtype=np.intp))


def false_discovery_within(p: Array, group: NDArray[np.intp]) -> Array:
    """`false_discovery` of each group by itself, (n,); groups are numbered from 0."""
    order, raised = _raised(p, group)
    own = group[order]
    # the smallest from here to the end of its group: where a later group begins, its numbers are all larger
    place = raised.argsort(kind="stable").argsort(kind="stable") + own * p.size
    lowest = np.minimum.accumulate(place[::-1])[::-1] - own * p.size
    adjusted = np.empty(p.size)
    adjusted[order] = np.sort(raised, kind="stable")[lowest]
    return adjusted


def simes(p: Array, group: NDArray[np.intp]) -> Array:
    """Of each group the p-value that none of its tests is false, (groups,); 1 for a number that no test has."""
    order, raised = _raised(p, group)
    least = np.ones(int(group.max(initial=-1)) + 1)
    np.minimum.at(least, group[order], raised)
    return least


def _raised(p: Array, group: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array]:
    """The order by group and p-value, and in it each p-value times the tests of its group over its rank there, at most 1."""
    order = np.lexsort((p, group))
    own, count = group[order], np.bincount(group)
    rank = np.arange(p.size) - (np.cumsum(count) - count)[own] + 1
    return order, np.minimum(p[order] * count[own] / rank, 1.0)
