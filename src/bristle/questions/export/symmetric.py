"""The best symmetric LuGre set, alone or with a constant bias: for simulators whose friction has one set for both directions."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.model import law
from bristle.model.laws import gaussian
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout, rollout_jacobian
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Friction, OwnFriction, StatedMotion, along, friction_of, lugre

_REACH = np.log(1e3)
"""How far a parameter may go from the mean of both directions, as a logarithm: what no motion shows would run away."""


class SymmetricSet(NamedTuple):
    """What a simulator holds of a joint whose directions differ."""

    parameters: Lugre[float]
    bias: float
    """Constant torque, N*m, that is part of the friction: positive against positive motion."""

    @property
    def friction(self) -> Friction:
        """Along a velocity; as a pair of two equal sets, so that what it loses of such a pair is exactly nothing."""
        return lugre(Pair(self.parameters, self.parameters), self.bias)


def best_symmetric(joint: ExportedJoint, motions: Sequence[StatedMotion], *, bias: bool = True) -> SymmetricSet:
    """The set and the bias of the least squared torque error along motions, each divided by the mean square of its torque.

    By trust-region steps with exact Jacobians, in logarithms of the parameters; one that is zero in both directions
    stays zero, and v_s is free only where there is a Stribeck term. Without `bias` that is zero. A joint of the paper's
    law whose directions are the same keeps their set as it is; of another law it is the closest set of the paper's.
    """
    return _best(friction_of(joint), joint.pair, joint.fastest, tuple(motions), bias)


@lru_cache(maxsize=64)
def _best(
    own: OwnFriction, pair: Pair[float], fastest: float, motions: tuple[StatedMotion, ...], bias: bool
) -> SymmetricSet:
    """The same, found once: of a robot, each joint is asked for alone and with the others."""
    positive, negative = (_gaussian(p, fastest) for p in pair)
    if positive == negative and not own.quadratic and own.law == gaussian.GAUSSIAN:
        return SymmetricSet(positive, 0.0)
    mean = Lugre(*((p + n) / 2 for p, n in zip(positive, negative, strict=True)))
    torques = [along(own, motion)[1] for motion in motions]
    weights = [1 / float(np.sqrt(np.sum(T**2))) for T in torques]  # each motion counts the same
    wanted = list(zip(motions, torques, weights, strict=True))
    free = [k for k, (name, x) in enumerate(mean._asdict().items()) if x > 0 and (name != "v_s" or mean.alpha_1 > 0)]
    level = mean.alpha_0 if bias else 0.0
    count = len(free) + bias

    def held(x: Array) -> SymmetricSet:
        """The set that the unknowns stand for: logarithms of the ratio of each free parameter to the mean, then the bias in units of `level`."""
        values = list(mean)
        for k, ratio in zip(free, np.exp(x[: len(free)]).tolist(), strict=True):
            values[k] *= ratio
        return SymmetricSet(Lugre(*values), level * float(x[-1]) if level else 0.0)

    def residuals(x: Array) -> Array:
        """Of all motions, one after the other."""
        p, constant = held(x)
        return np.concatenate([
            weight * (rollout(motion.velocity, motion.step, p, 0.0).torque[-T.size :] + constant - T)
            for motion, T, weight in wanted
        ])  # fmt: skip  # one motion in a line

    def slopes(x: Array) -> Array:
        """Their derivatives by the unknowns."""
        p, _ = held(x)
        rows = []
        for motion, T, weight in wanted:
            by = rollout_jacobian(motion.velocity, motion.step, p, 0.0).by_parameters[-T.size :]
            columns = [by[:, k] * p[k] for k in free] + [np.full(T.size, level)] * (count - len(free))
            rows.append(weight * np.column_stack(columns))
        return np.concatenate(rows)

    from scipy.optimize import least_squares

    solved = least_squares(
        residuals, np.zeros(count), slopes, bounds=(-_REACH, _REACH), x_scale="jac", xtol=1e-10, ftol=1e-10
    )
    return held(np.asarray(solved.x, dtype=np.float64))


def _gaussian(p: Lugre[float], fastest: float) -> Lugre[float]:
    """A set of the paper's law to begin with: the peak gone at the same speed, viscous friction as at half the fastest one."""
    v_s = p.v_s * (p.law.peak.reach / gaussian.PEAK.reach)
    return Lugre(*p[:6])._replace(v_s=v_s, alpha_2=max(float(law.viscous_rate(fastest / 2, p)), 0.0))
