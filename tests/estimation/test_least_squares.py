"""A least-squares problem that knows no friction: in a linear one all intervals coincide; scales, blocks, several starts."""

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.estimation.bootstrap import bootstrap_at
from bristle.estimation.covariance import covariance, student
from bristle.estimation.multistart import MultistartSolution, solve_from_starts
from bristle.estimation.nonlinear import Block, LeastSquares, Minimum, Unknowns, minimise
from bristle.estimation.profile_likelihood import profiles


def unknowns(*names: str, logarithmic: tuple[str, ...] = ()) -> Unknowns[str]:
    """Free unknowns; those of logarithms are positive."""
    p, positive = len(names), np.array([name in logarithmic for name in names])
    return Unknowns(
        names=names,
        logarithmic=positive,
        scale=np.where(positive, 1.0, 2.0),
        lower=np.full(p, -np.inf),
        upper=np.full(p, np.inf),
        least=np.where(positive, 0.0, -np.inf),
    )


def line(measured: Array, columns: Array) -> LeastSquares[str]:
    """A linear problem in a, b and so on."""
    known = unknowns(*"abcdef"[: columns.shape[1]])

    def evaluate(x: Array) -> tuple[Array, Array]:
        """Modelled less measured, and the columns."""
        return columns @ known.natural(x) - measured, columns * known.slopes(x)

    return LeastSquares(unknowns=known, evaluate=evaluate)


def solved(problem: LeastSquares[str], values: Mapping[str, float]) -> MultistartSolution[str]:
    """The solution near some values."""
    own = problem.unknowns

    def solve(at: Mapping[str, float], most: int, _lowest: float) -> tuple[LeastSquares[str], Minimum]:
        """The problem and its minimum."""
        return problem, minimise(problem.evaluate, own.scaled(at), own.lower, own.upper, most, settled=1e-14)

    return solve_from_starts(solve, [values], lambda posed, minimum: (posed, minimum))


@given(values=st.tuples(st.floats(-1e3, 1e3), st.floats(1e-6, 1e6)))
def test_scaling_is_undone(values: tuple[float, float]) -> None:
    """Scaled values come back by name and one by one; the slopes are those of differences."""
    own = unknowns("a", "b", logarithmic=("b",))
    x = own.scaled(dict(zip("ab", values, strict=True)))
    assert list(own.values(x).values()) == pytest.approx(values, rel=1e-9)
    assert [float(own.natural_of(j, x[j])) for j in range(2)] == pytest.approx(values, rel=1e-9)
    slopes = (own.natural(x + 1e-6) - own.natural(x - 1e-6)) / 2e-6
    assert own.slopes(x) == pytest.approx(slopes, rel=1e-6, abs=1e-6)


def test_in_a_linear_problem_covariance_profile_and_bootstrap_coincide() -> None:
    """White noise: errors are the textbook's to a tenth, profile ends are Student's with them, and bootstrap-t's to what chance leaves."""
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((3000, 2))
    problem = line(columns @ [1.0, -2.0] + rng.standard_normal(3000), columns)
    solution = solved(problem, {"a": 0.0, "b": 0.0})
    matrix, freedom = solution.covariance, solution.freedom
    textbook, _ = covariance(columns, solution.minimum.cost)
    assert matrix == pytest.approx(textbook, rel=0.1, abs=0.1 * np.sqrt(textbook.diagonal().prod()))
    assert solution.widening == pytest.approx(1.0, abs=0.1)
    found, better = profiles(solution)
    drawn, _ = bootstrap_at(solution)
    assert better is None
    for j, name in enumerate(problem.unknowns.names):
        value, reach = solution.values[name], student(freedom) * np.sqrt(matrix[j, j])
        assert found[name].interval == pytest.approx((value - reach, value + reach), abs=1e-5 * reach)
        assert drawn[name][0] == pytest.approx([value - reach, value + reach], abs=0.2 * reach)


def test_blocks_that_err_together_widen_the_jackknife() -> None:
    """A mean of 40 blocks, each with an offset of its own: the jackknife's error is that of the mean of 40 numbers."""
    rng = np.random.default_rng(2)
    offsets = np.repeat(rng.standard_normal(40), 25)
    one = line(offsets, np.ones((1000, 1)))
    blocks = tuple(Block(slice(25 * k, 25 * k + 25), []) for k in range(40))
    problem = LeastSquares(unknowns=one.unknowns, evaluate=one.evaluate, blocks=blocks, independent=True)
    found = solved(problem, {"a": 1.0})
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(offsets.std() / np.sqrt(39), rel=1e-6)
    assert found.freedom == 39
    assert found.widening == pytest.approx(5.0, rel=0.05)


def test_the_lowest_of_several_minima_is_kept() -> None:
    """Of starts in three valleys the lowest end is the solution, and counted; a further start that shows nothing is passed over."""
    known = unknowns("a")

    def evaluate(x: Array) -> tuple[Array, Array]:
        """A cost with minima near -1 and 1, the latter lower; flat at 50."""
        a = float(known.natural(x)[0])
        if a > 40:
            return np.ones(3), np.zeros((3, 1))
        return np.array([a * a - 1, 0.2 * (a - 1), 1.0]), np.array([[2 * a], [0.2], [0.0]]) * known.slopes(x)

    problem = LeastSquares(unknowns=known, evaluate=evaluate)

    def solve(a: float, most: int, lowest: float) -> tuple[LeastSquares[str], Minimum]:
        """From a."""
        start = known.scaled({"a": a})
        return problem, minimise(evaluate, start, known.lower, known.upper, most, lowest=lowest)

    found = solve_from_starts(solve, [-1.5, 1.5, 50.0, 0.5], lambda posed, minimum: (posed, minimum))
    assert found.values["a"] == pytest.approx(1.0, abs=1e-3)
    assert (found.starts, found.reached) == (4, 2)


def test_ends_a_tenth_of_a_standard_error_apart_are_one() -> None:
    """A start whose cost is higher by less than a hundredth of a residual's variance has reached the lowest one, whatever the digits say."""
    costs = {0.0: 1.0, 1.0: 1.0 + 0.9e-2 / 100, 2.0: 1.0 + 1.2e-2 / 100}

    def solve(start: float, _most: int, _lowest: float) -> tuple[LeastSquares[str], Minimum]:
        """An end with the cost of its start, of 100 residuals and one unknown."""
        posed = LeastSquares(unknowns=unknowns("a"), evaluate=lambda _: (np.ones(100), np.ones((100, 1))))
        return posed, Minimum(np.zeros(1), costs[start], np.full(100, 0.1), np.ones((100, 1)), 1, converged=True)

    assert solve_from_starts(solve, [0.0, 1.0, 2.0], lambda posed, minimum: (posed, minimum)).reached == 2
