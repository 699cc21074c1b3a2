"""The score test: it is the fit with the column, to first order, and is as rare as it says where nothing is."""

import numpy as np
import pytest
from scipy.signal import lfilter

from bristle.estimation.score_test import Candidate, Fitted, explained, moved_by, scores
from bristle.findings import CAUTION, Finding


def test_it_is_the_linear_fit_with_the_column() -> None:
    """Of a linear model the size, its share and what moves are those of least squares with the columns, exactly, in any unit."""
    rng = np.random.default_rng(0)
    known, columns, y = rng.normal(size=(200, 4)), rng.normal(size=(200, 2)) * [1.0, 1e-9], rng.normal(size=200)
    fitted = np.linalg.lstsq(known, y)[0]
    whole = np.linalg.lstsq(np.hstack([known, columns * [1.0, 1e9]]), y)[0]
    (found,) = scores(known, y - known @ fitted, [columns])
    assert found.sizes * [1.0, 1e-9] == pytest.approx(whole[4:])
    assert -moved_by(known, columns @ found.sizes) == pytest.approx(whole[:4] - fitted)
    left = float(np.sum((y - np.hstack([known, columns * [1.0, 1e9]]) @ whole) ** 2))
    assert found.squares == pytest.approx(float(np.sum((y - known @ fitted) ** 2)) - left)


def test_a_column_that_others_make_says_nothing() -> None:
    """What is known already, a column of zeros, or one of more samples than there are, is not significant; beside known ones of no rank too."""
    x = np.random.default_rng(1).normal(size=(30, 3))
    known = np.hstack([x, x[:, :1], np.zeros((30, 1))])
    y = np.random.default_rng(2).normal(size=30)
    for columns in (x[:, :2], np.zeros((30, 1))):
        assert scores(known, y, [columns])[0].p == 1.0
    assert scores(known[:4], y[:4], [y[:4, None]])[0].p == 1.0
    assert scores(known, y, [y[:, None]])[0].p < 1e-6


@pytest.mark.parametrize(("rho", "waves", "most"), [(0.0, 1, 0.08), (0.0, 90, 0.08), (0.5, 5, 0.09), (0.9, 20, 0.1)])
def test_it_is_as_rare_as_it_says(rho: float, waves: int, most: float) -> None:
    """Of noise that grows along the record, white or correlated, p < 0.05 in some 5 % of 500 draws, for a slow column and a fast one."""
    rng, n = np.random.default_rng(3), 600
    t = np.linspace(0, 1, n)
    noise = lfilter([1.0], [1.0, -rho], rng.normal(size=(500, n + 100)))[:, 100:] * (0.5 + t)
    known, column = np.stack([np.ones(n), t], axis=1), np.cos(2 * np.pi * waves * t)[:, None]
    p = [scores(known, x - known @ np.linalg.lstsq(known, x)[0], [column])[0].p for x in noise]
    assert 0.02 <= np.mean(np.array(p) < 0.05) <= most


def test_what_explains_most_is_told_first_and_what_it_makes_is_not_told() -> None:
    """Of a cause and a column that goes along with it the cause alone, then a second cause; one that is refused leaves room for the next."""
    rng, n = np.random.default_rng(5), 500
    cause, other, noise = rng.normal(size=(3, n))
    alike = cause + 0.3 * rng.normal(size=n)
    rest = cause + 0.5 * other + 0.1 * noise
    fit = Fitted(np.zeros((n, 0)), rest, np.zeros(0), np.zeros(0, dtype=bool), 1.0)

    def row(code: str, column: np.ndarray[tuple[int, ...], np.dtype[np.float64]], refused: bool = False) -> Candidate:
        return Candidate(
            lambda *_: None if refused else Finding(code, CAUTION, code), (column[:, None],), is_friction=True
        )

    found, left, _ = explained(fit, [row("alike", alike), row("other", other), row("cause", cause)])
    assert [x.code for x in found] == ["cause", "other"]
    assert np.std(left) == pytest.approx(0.1, rel=0.1)
    found, *_ = explained(fit, [row("alike", alike), row("cause", cause, refused=True)])
    assert [x.code for x in found] == ["alike"]
