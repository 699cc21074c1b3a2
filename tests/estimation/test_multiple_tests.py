"""Many tests at once: SciPy's adjusted p-values, group by group, and Simes's test."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import false_discovery_control

from bristle.estimation.multiple_tests import false_discovery, false_discovery_within, simes

levels = arrays(float, st.integers(1, 40), elements=st.floats(1e-300, 1.0))


@given(levels, st.integers(0, 2**32))
def test_each_group_as_scipy_has_it(p: np.ndarray, seed: int) -> None:
    """Adjusted p-values are SciPy's, of all and of each group by itself, to the last digits of the smallest; Simes's is the least of its group."""
    group = np.random.default_rng(seed).integers(0, 4, p.size)
    np.testing.assert_allclose(false_discovery(p), false_discovery_control(p), rtol=1e-12)
    within, least = false_discovery_within(p, group), simes(p, group)
    for k in np.unique(group):
        own = false_discovery_control(p[group == k])
        np.testing.assert_allclose(within[group == k], own, rtol=1e-12)
        np.testing.assert_allclose(least[k], own.min(), rtol=1e-12)


def test_a_number_without_tests_has_no_evidence() -> None:
    """A group that no test has is 1, and no test at all is no group."""
    assert simes(np.array([0.01]), np.array([2])).tolist() == [1.0, 1.0, 0.01]
    assert simes(np.zeros(0), np.zeros(0, dtype=int)).size == 0
    assert false_discovery(np.zeros(0)).size == 0
