"""What a fit lacks: each row of the table is told where it is planted, and nothing is where nothing is."""

from collections.abc import Collection

import numpy as np
import pytest
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.estimation.score_test import Fitted, explained
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.candidates import candidates
from bristle.model.parameters import Kind

EMPTY = np.zeros(0)


def told(
    rest: Array,
    velocity: Array,
    time: Array = EMPTY,
    position: Array = EMPTY,
    parameters: Collection[str] = (),
    kind: Kind = "revolute",
    friction: float = 1.0,
) -> list[Finding]:
    """What is said of residuals of a fit of Coulomb and viscous friction, (n,)."""
    known = np.stack([np.sign(velocity), velocity], axis=1)
    fit = Fitted(
        known, rest - known @ np.linalg.lstsq(known, rest)[0], np.full(2, 1e-6), np.ones(2, dtype=bool), friction
    )
    return explained(fit, candidates(velocity, time, position, parameters, kind)).findings


@pytest.mark.parametrize(
    ("axis", "code", "over"),
    [(1, "residual-trend", "velocity"), (2, "residual-trend", "time"), (3, "residual-ripple", None)],
)
def test_a_planted_trend_or_ripple_is_told(axis: int, code: str, over: str | None) -> None:
    """A trend over time or velocity, or a ripple over position, of the size of the noise is told, and nothing else is."""
    rng = np.random.default_rng(3)
    noise, velocity, time, position = rng.normal(size=(4, 200))
    velocity, position = rng.uniform(0.0, 3.0, 200), 0.01 * position
    signals = (noise, 2 * velocity**2 - 6 * velocity, time, position)
    shape = np.sin(2 * np.pi * 7 * position / np.ptp(position)) if axis == 3 else signals[axis]
    (said,) = told(noise + 1.2 * shape, velocity, time, position, ["quadratic"])
    assert (said.code, said.numbers.get("over")) == (code, over)
    assert said.numbers["p"] < 0.01


def test_friction_that_falls_is_told_with_its_size() -> None:
    """Friction that falls by 1 from the beginning to the end, in both directions, is no trend of the torque, and is told as what it is."""
    rng, time = np.random.default_rng(4), np.linspace(0, 60, 200)
    velocity = rng.permutation(np.linspace(-1, 1, 200))
    (said,) = told(0.2 * rng.standard_normal(200) + np.sign(velocity) * (0.5 - time / 60), velocity, time)
    assert said.code == "friction-drifts"
    assert said.numbers["change"] == pytest.approx(-1, abs=0.15)
    assert said.effect["torque"] == -said.numbers["change"]


def test_a_difference_between_directions_is_told() -> None:
    """What a symmetric curve leaves of friction that is not - a constant, or a slope over speed - is told; what is odd in velocity is not."""
    rng = np.random.default_rng(6)
    velocity, noise = rng.uniform(-1, 1, 200), rng.normal(size=200)
    for even in (np.ones(200), np.abs(velocity)):
        assert "directions-differ" in {x.code for x in told(noise + even, velocity, parameters=["quadratic"])}
    assert not told(noise + velocity, velocity)


@pytest.mark.parametrize(
    ("lacks", "line"), [(np.sin, "regressors: [inertia, gravity]"), (np.abs, "[inertia, quadratic]")]
)
def test_a_regressor_that_was_left_out_is_told_with_its_line(lacks: np.ufunc, line: str) -> None:
    """Gravity over most of a turn, and drag, are told as what they are, once, and nothing beside them."""
    rng, time = np.random.default_rng(2), np.linspace(0, 20, 600)
    position = 2 * np.sin(time)
    velocity = 2 * np.cos(time)
    shape = lacks(position) if lacks is np.sin else velocity * lacks(velocity)
    (said,) = told(0.3 * rng.standard_normal(600) + shape, velocity, time, position, ["inertia"])
    assert said.code == "lacks-a-term"
    assert line in str(said)
    assert not told(0.3 * rng.standard_normal(600), velocity, time, position, ["inertia"])


def test_a_ripple_says_which_lines_to_write() -> None:
    """The order nearest to its period, beside the regressors and orders that were fitted; none where it is fitted already."""
    rng = np.random.default_rng(5)
    position = np.linspace(0, 2 * np.pi, 800)
    velocity, rest = np.full(800, 0.5), np.sin(11 * position) + 0.1 * rng.standard_normal(800)
    (said,) = told(rest, velocity, EMPTY, position, ["inertia", "cogging_sin_4", "cogging_cos_4"])
    assert "write regressors: [inertia, cogging], orders: [4, 11] under fit" in str(said)
    (fitted,) = told(rest, velocity, EMPTY, position, ["cogging_sin_11", "cogging_cos_11"])
    assert "orders" not in str(fitted)
    (per_metre,) = told(rest, velocity, EMPTY, position / (2 * np.pi), (), "prismatic")
    assert "write regressors: [cogging], orders: [11] under fit" in str(per_metre)


@pytest.mark.slow
def test_noise_alone_is_rarely_told() -> None:
    """White and correlated residuals without a trend give a warning in no more than 3 % of cases, as the 1 % of the correction promises."""
    rng = np.random.default_rng(4)
    time = np.linspace(0, 1, 400)
    white = rng.normal(size=(200, 400))
    cases = [*white[:100], *lfilter([1.0], [1.0, -0.7], white[100:])]
    said = [bool(told(x, rng.uniform(-1, 1, 400), time, rng.uniform(0, 1, 400))) for x in cases]
    assert np.mean(said) <= 0.03


def test_what_moves_nothing_is_a_note() -> None:
    """A ripple of 5 % of friction that the noise is far below changes friction by next to nothing; a direction that differs by as much does."""
    rng = np.random.default_rng(7)
    position = np.linspace(0, 40, 4000)
    velocity = np.where(np.arange(4000) % 400 < 200, 1.0, -1.0) * (1 + 0.3 * np.sin(position))
    noise = 1e-3 * rng.standard_normal(4000)
    known = np.stack([np.sign(velocity), velocity], axis=1)
    said = {}
    for shape in (np.sin(2 * np.pi * 8 * position / 40), np.ones(4000)):
        rest = noise + 0.05 * shape
        rest = rest - known @ np.linalg.lstsq(known, rest)[0]
        fit = Fitted(known, rest, np.full(2, 0.1), np.ones(2, dtype=bool), 1.0)
        found, *_ = explained(fit, candidates(velocity, EMPTY, position, (), "revolute")).findings
        said[found.code] = found.severity
    assert said == {"residual-ripple": NOTE, "directions-differ": CAUTION}


def test_unknown_axes_and_exact_fits_are_not_told() -> None:
    """Axes that are empty, or constant, and residuals that are all zero, or fewer than eight, give no warning."""
    x = np.linspace(0, 1, 30)
    assert told(x, np.ones(30)) == []
    assert told(x, np.ones(30), np.ones(30), np.ones(30)) == []
    assert told(np.zeros(30), x, x, x) == []
    assert told(x[:7], x[:7], x[:7], x[:7]) == []
