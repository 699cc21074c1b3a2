import numpy as np
import pytest
from scipy import stats

from bristle.arrays import Array
from bristle.estimation import covariance as uncertainty
from bristle.estimation.linear import best_column_p_value
from bristle.identification.static.grid import Projected, default_range
from bristle.identification.static.problem import from_points


def test_covariance_of_a_straight_line_is_the_textbook_one() -> None:
    """For a linear model the covariance is s**2 (X'X)**-1 in closed form, and equals linregress' standard errors."""
    rng = np.random.default_rng(0)
    x = np.linspace(0, 1, 20)
    y = 1 + 2 * x + 0.1 * rng.standard_normal(20)
    line = stats.linregress(x, y)
    design = np.column_stack([x, np.ones(20)])
    residuals = y - design @ [line.slope, line.intercept]
    covariance, freedom = uncertainty.covariance(design, float(residuals @ residuals))
    assert np.sqrt(np.diag(covariance)) == pytest.approx([line.stderr, line.intercept_stderr], rel=1e-10)
    assert freedom == 18


def test_inflation_widens_as_fewer_points_would() -> None:
    """Residuals correlated over tau samples count as n / tau points: the variance grows by tau, freedom shrinks by it."""
    design = np.random.default_rng(1).standard_normal((100, 3))
    plain, _ = uncertainty.covariance(design, 2.0)
    wide, freedom = uncertainty.covariance(design, 2.0, 4.0)
    assert wide == pytest.approx(4 * plain)
    assert freedom == pytest.approx(100 / 4 - 3)


def test_p_value_is_uniform_where_there_is_no_peak(speeds: Array) -> None:
    """Without a Stribeck term the p-value falls below any level about that often: at 5 % and 20 %, over 400 sets, within 3 binomial deviations."""
    rng = np.random.default_rng(4)
    flat = 0.02 + 0.04 * speeds
    values = np.geomspace(*default_range(speeds), 48)
    p_values = []
    for _ in range(400):
        problem = from_points(speeds, flat + 1e-4 * rng.standard_normal(speeds.size), ("both",))
        projected = Projected(problem)
        off, length = projected.off(values)
        cost = projected.costs(values).min()
        p_values.append(best_column_p_value(off, length, projected.q, (projected.base_cost - cost) / cost, draws=1000))
    for level in (0.05, 0.20):
        seen = np.mean(np.array(p_values) <= level)
        assert abs(seen - level) <= 3 * np.sqrt(level * (1 - level) / 400) + 0.002
