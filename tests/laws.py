"""Joints of laws beyond the paper's, simulated: of points, or of points and a motion; one law is registered from outside."""

from collections.abc import Iterator
from contextlib import contextmanager

import casadi as ca
import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.model.laws import registry
from bristle.model.laws.parts import OwnParameter, Peak
from bristle.model.parameters import Lugre, lugre_of

from .conftest import TRUTH

DRAG, EXPONENT, OUTSIDE = "lorentzian+quadratic", "free-exponent", "bell"
BLUNT = OwnParameter(name="blunt", symbol="β", units=("1", "1"), searched=(0.3, 4.0))
BELL = Peak(
    name=OUTSIDE, title="bell", shape=lambda v, v_s, blunt: ca.exp(-blunt * ca.log1p((v / v_s) ** 2)), own=(BLUNT,), reach=3.0
)  # fmt: skip  # a list of values
_OWN = {"alpha_3": -0.008, "delta": 1.4, "blunt": 1.5, "v_end": 0.8}


@contextmanager
def registered() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(registry, "_PARTS", dict(registry._PARTS))
        patch.setattr(registry, "_COMPETE", set(registry._COMPETE))
        registry.register_law(BELL, compete=False)
        yield


def truth_of(law: str) -> Lugre[float]:
    one = lugre_of(registry.law_named(law))
    return one(*TRUTH, **{name: _OWN[name] for name in one._fields[len(TRUTH) :]})


def points(law: str, truth: Lugre[float] | None = None, seed: int = 0) -> bristle.Fit:
    """Points of a joint whose law is known, both directions in one set."""
    v: Array = np.geomspace(0.2 * TRUTH.v_s, 0.8, 20)
    v = np.concatenate([v, -v])
    noise = 2e-5 * np.random.default_rng(seed).standard_normal(v.size)
    return bristle.fit(v, bristle.friction(v, truth or truth_of(law)) + noise, law=law, directions="symmetric")


def motion(law: str) -> bristle.Fit:
    t: Array = np.arange(0, 8, 0.002)
    v = 0.5 * np.sin(2.0 * t) + 0.25 * np.sin(5.3 * t)
    q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) * 0.002
    torque = bristle.simulate(v, 0.002, truth_of(law)) + 0.001 * np.gradient(v, t)
    noise = 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    return bristle.fit_dynamic(t, q, torque + noise, priors=points(law))
