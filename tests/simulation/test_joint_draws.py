"""Joints that the identified covariance allows: they scatter as it says, and could all exist."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bristle.identification import known_joint
from bristle.identification.fits import TrackingFit
from bristle.identification.systematic import shifted
from bristle.model.parameters import Lugre
from bristle.simulation.joint_loop import JointLoop, of_experiment

from .joints import GRIPPER, J, experiment, joint, tracked, values_of


def drawn(folder: Path, fit: TrackingFit) -> JointLoop:
    """The loop of a joint with that fit."""
    return of_experiment(experiment(folder), joint(fit))


def test_draws_have_the_mean_and_the_covariance_of_the_fit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Over many draws, errors being small, the mean is the fit's value to its own error and the covariance the fit's, correlations included."""
    n = 4000
    monkeypatch.setattr(known_joint, "DRAWS", n)
    values = values_of(GRIPPER)
    fit = tracked(values, 0.02)
    found = drawn(tmp_path, fit).draws
    rows = np.array([[*pair.positive, *pair.negative, inertia] for pair, inertia in found])
    errors = np.sqrt(np.diag(fit.covariance))
    assert rows.shape == (n, 13)
    assert (np.abs(rows.mean(axis=0) - [*values.values()]) < 5 * errors / np.sqrt(n)).all()
    np.testing.assert_allclose(
        np.cov(rows.T) / np.outer(errors, errors), fit.covariance / np.outer(errors, errors), atol=0.1
    )


@pytest.mark.parametrize("share", [0.02, 0.5, 3.0])
def test_draws_are_physical_and_repeat(tmp_path: Path, share: float) -> None:
    """However large the errors, alpha_0, v_s, sigma_0 and J of every draw are positive, the others not negative; and every run draws the same."""
    fit = tracked(values_of(GRIPPER), share)
    first, second = (drawn(tmp_path, fit).draws for _ in range(2))
    assert first == second
    assert len(first) == known_joint.DRAWS
    assert len(set(first)) == len(first)
    for pair, inertia in first:
        assert 0 < inertia < np.inf
        for p in pair:
            assert min(p.alpha_0, p.v_s, p.sigma_0) > 0
            assert min(p) >= 0
            assert np.isfinite(p).all()


def test_an_error_of_a_constant_moves_all_parameters_of_a_draw_together(tmp_path: Path) -> None:
    """By constants alone every parameter of a draw has the same factor, the inertia too; without errors of constants there are no such draws."""
    fit = tracked(values_of(GRIPPER), 1e-9)
    assert drawn(tmp_path, fit).draws_by_constants == ()
    moved = {name: shifted(e, {"K": 1e-3 * (e.value or 0.0)}) for name, e in fit.parameters.items()}
    loop = drawn(tmp_path, replace(fit, parameters=moved))
    for found in (loop.draws, loop.draws_by_constants):
        rows = np.array([[*pair.positive, *pair.negative, inertia] for pair, inertia in found])
        factors = rows / list(values_of(GRIPPER).values())
        assert np.abs(factors - factors[:, :1]).max() < 1e-5
        assert np.std(factors[:, 0]) == pytest.approx(1e-3, rel=0.3)


def test_without_a_covariance_nothing_is_drawn(tmp_path: Path) -> None:
    """A fit with no covariance, or with one that is not finite, has no draws."""
    fit = tracked(values_of(GRIPPER))
    for other in (replace(fit, names=()), replace(fit, covariance=np.full_like(fit.covariance, np.nan))):
        assert drawn(tmp_path, other).draws == ()


def test_a_parameter_that_both_directions_share_is_drawn_once(tmp_path: Path) -> None:
    """Of a fit with one set for both directions every draw has the same set twice."""
    both = {**GRIPPER.positive._asdict(), "inertia": J}
    for pair, _ in drawn(tmp_path, tracked(both, 0.1)).draws:
        assert pair.positive == pair.negative != Lugre(*GRIPPER.positive)
