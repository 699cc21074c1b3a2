"""Losses of targets that cannot hold the joint's friction, and their best values.

A loss is the RMS torque error along stated motions, in percent. Simulators hold Coulomb and viscous friction, or one
LuGre set for both directions with a constant bias.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.estimation.linear import bounded_least_squares
from bristle.model import functions, law
from bristle.model.laws import gaussian
from bristle.model.laws.parts import Law
from bristle.model.parameters import Lugre, Pair, Stribeck, unit
from bristle.model.rollout import rollout, rollout_jacobian
from bristle.model.vectorize import evaluate
from bristle.page.wording import in_percent
from bristle.questions.export.exported import FREQUENCY, ExportedJoint
from bristle.simulation.references import Sine

_NONE = 1e-6  # percent: a smaller loss is rounding
_PERIODS = 3  # simulated from an undeflected bristle; the last one counts
_SAMPLES = 2000  # of a period
_SLOW = 0.1  # largest peak speed of the slow motion, over the fastest measured speed
_REACH = np.log(1e3)  # bound of a parameter about the mean of both directions, as a logarithm


class StatedMotion(NamedTuple):
    """A sine of the position, rad and Hz."""

    name: str
    amplitude: float
    frequency: float

    @property
    def velocity(self) -> Array:
        """rad/s, (n,), of all simulated periods."""
        time = self.step * np.arange(_PERIODS * _SAMPLES, dtype=np.float64)
        return np.asarray(Sine(self.amplitude, self.frequency).at(time).velocity)

    @property
    def step(self) -> float:
        """Between samples, s."""
        return 1 / (self.frequency * _SAMPLES)


class Loss(NamedTuple):
    """RMS torque error of a model along a motion."""

    motion: StatedMotion
    percent: float  # 100 * rms(model - friction) / rms(friction)


Friction = Callable[[Array, float], Array]  # (velocity (n,), step) -> torque (n,): rad/s, s, N*m


@dataclass(frozen=True, slots=True)
class OwnFriction:
    """The joint's own friction, as a value that can be cached."""

    law: Law
    curves: tuple[Stribeck[float], Stribeck[float]]
    pair: Pair[float] | None  # None without a bristle
    quadratic: float

    def __call__(self, v: Array, step: float) -> Array:
        """Torque, N*m; without a bristle that of the curve of friction vs velocity."""
        if self.pair is not None:
            own = lugre(self.pair)(v, step)
        else:
            positive, negative = (evaluate(functions.steady_torque_function(self.law), v, *p)[0] for p in self.curves)
            own = np.where(v < 0, negative, positive)
        terms, zero = functions.load_terms_function(), np.zeros_like(v)
        names = [terms.name_out(k) for k in range(terms.n_out())]
        return own + self.quadratic * evaluate(terms, zero, v, zero, zero)[names.index("quadratic")]


def friction_of(joint: ExportedJoint) -> OwnFriction:
    """The joint's own friction with v abs(v); without a bristle the curve of friction vs velocity."""
    return OwnFriction(joint.law, joint.curves, joint.pair if joint.has_bristle else None, joint.quadratic)


def lugre(p: Lugre[float] | Pair[float], bias: float = 0.0) -> Friction:
    """LuGre from an undeflected bristle, and a constant bias, N*m."""
    return lambda v, step: rollout(v, step, p, 0.0).torque + bias


def coulomb_viscous(coulomb: float, viscous: float) -> Friction:
    """Coulomb friction, N*m, and viscous friction, N*m*s/rad."""

    def torque(v: Array, step: float) -> Array:  # noqa: ARG001  # it has no memory
        by_coulomb, by_viscous = evaluate(functions.linear_shapes_function(), v)
        return coulomb * by_coulomb + viscous * by_viscous

    return torque


def stated_motions(joint: ExportedJoint) -> tuple[StatedMotion, ...]:
    """Sines at 0.5 Hz in medium and slow sliding, and with a bristle in presliding.

    Up to half of the fastest speed; the mean v_s, or a tenth of that speed; half of the deflection at breakaway.
    """
    w = 2 * np.pi * FREQUENCY
    peaked = [p.v_s for p in joint.curves if p.alpha_1 > 0]
    slow = min(float(np.mean(peaked)) if peaked else np.inf, _SLOW * joint.fastest)
    motions = [StatedMotion("medium", 0.5 * joint.fastest / w, FREQUENCY), StatedMotion("slow", slow / w, FREQUENCY)]
    if joint.has_bristle:
        bent = float(np.mean([(p.alpha_0 + p.alpha_1) / p.sigma_0 for p in joint.pair]))
        motions.append(StatedMotion("presliding", 0.5 * bent, FREQUENCY))
    return tuple(motions)


def all_motions(
    joint: ExportedJoint, amplitude: float | None = None, frequency: float | None = None
) -> tuple[StatedMotion, ...]:
    """The motion of the fit, by default up to the fastest measured speed at 0.5 Hz, then the stated ones."""
    f = frequency or FREQUENCY
    return StatedMotion("fitted", amplitude or joint.fastest / (2 * np.pi * f), f), *stated_motions(joint)


@lru_cache(maxsize=64)
def along(friction: Friction, motion: StatedMotion) -> tuple[Array, Array]:
    """Velocity, rad/s, and torque, N*m, over the last period, (n,) each, read-only."""
    v = motion.velocity
    found = v[-_SAMPLES:], friction(v, motion.step)[-_SAMPLES:]
    for array in found:
        array.setflags(write=False)
    return found


def losses(joint: ExportedJoint, model: Friction, motions: Sequence[StatedMotion]) -> tuple[Loss, ...]:
    """Losses of a model of the joint, by motion."""
    own = friction_of(joint)
    return tuple(Loss(motion, rms_percent(along(model, motion)[1], along(own, motion)[1])) for motion in motions)


def rms_percent(found: Array, true: Array) -> float:
    """RMS of the difference over the RMS of the true torque, percent."""
    return 100 * float(np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2)))


def best_coulomb_viscous(joint: ExportedJoint, motion: StatedMotion) -> tuple[float, float]:
    """Coulomb, N*m, and viscous friction, N*m*s/rad, by least squares, none negative."""
    v, T = along(friction_of(joint), motion)
    columns = np.column_stack(evaluate(functions.linear_shapes_function(), v))
    coulomb, viscous = bounded_least_squares(columns, T, np.zeros(2)).tolist()
    return coulomb, viscous


class SymmetricSet(NamedTuple):
    """One set of a joint whose directions differ."""

    parameters: Lugre[float]
    bias: float  # constant part of the friction, N*m, positive against positive motion

    @property
    def friction(self) -> Friction:
        """Its friction, as of a pair of equal sets, so that the loss of such a pair is exactly zero."""
        return lugre(Pair(self.parameters, self.parameters), self.bias)


def best_symmetric(joint: ExportedJoint, motions: Sequence[StatedMotion]) -> SymmetricSet:
    """The set of the paper's law and the bias by least squares along motions, each over the mean square of its torque.

    Trust-region steps with exact Jacobians in logarithms of the parameters; a parameter that is zero in both directions
    stays zero, and v_s without a Stribeck term stays. Equal directions of the paper's law keep their set.
    """
    return _best(friction_of(joint), joint.pair, joint.fastest, tuple(motions))


@lru_cache(maxsize=64)
def _best(own: OwnFriction, pair: Pair[float], fastest: float, motions: tuple[StatedMotion, ...]) -> SymmetricSet:
    """`best_symmetric`, cached: each joint of a robot is asked for alone and with the others."""
    # Similar sets of the paper's law: the peak vanishes at the same speed, viscous friction as at half the fastest.
    positive, negative = (
        Lugre(*p[:6])._replace(
            v_s=p.v_s * (p.law.peak.reach / gaussian.PEAK.reach),
            alpha_2=max(float(law.viscous_rate(fastest / 2, p)), 0.0),
        )
        for p in pair
    )
    if positive == negative and not own.quadratic and own.law == gaussian.GAUSSIAN:
        return SymmetricSet(positive, 0.0)
    mean = Lugre(*((p + n) / 2 for p, n in zip(positive, negative, strict=True)))
    torques = [along(own, motion)[1] for motion in motions]
    weights = [1 / float(np.sqrt(np.sum(T**2))) for T in torques]  # each motion counts the same
    wanted = list(zip(motions, torques, weights, strict=True))
    free = [k for k, (name, x) in enumerate(mean._asdict().items()) if x > 0 and (name != "v_s" or mean.alpha_1 > 0)]

    def held(x: Array) -> SymmetricSet:
        """The set at x: logarithms of the ratios of the free parameters to the mean, then the bias over alpha_0."""
        values = list(mean)
        for k, ratio in zip(free, np.exp(x[:-1]).tolist(), strict=True):
            values[k] *= ratio
        return SymmetricSet(Lugre(*values), mean.alpha_0 * float(x[-1]))

    def residuals(x: Array) -> Array:
        p, constant = held(x)
        return np.concatenate([
            weight * (rollout(motion.velocity, motion.step, p, 0.0).torque[-T.size :] + constant - T)
            for motion, T, weight in wanted
        ])  # fmt: skip  # one motion in a line

    def slopes(x: Array) -> Array:
        p, _ = held(x)
        rows = []
        for motion, T, weight in wanted:
            by = rollout_jacobian(motion.velocity, motion.step, p, 0.0).by_parameters[-T.size :]
            columns = [*(by[:, k] * p[k] for k in free), np.full(T.size, mean.alpha_0)]
            rows.append(weight * np.column_stack(columns))
        return np.concatenate(rows)

    from scipy.optimize import least_squares

    solved = least_squares(
        residuals, np.zeros(len(free) + 1), slopes, bounds=(-_REACH, _REACH), x_scale="jac", xtol=1e-10, ftol=1e-10
    )
    return held(np.asarray(solved.x, dtype=np.float64))


def told(found: Sequence[Loss], joint: ExportedJoint) -> str:
    """The losses with their motions, in one line."""
    q = unit("position", joint.kind)
    return ", ".join(
        f"{'0 %' if x.percent < _NONE else in_percent(x.percent / 100)} {x.motion.name} "
        f"({x.motion.amplitude:.3g} {q}, {x.motion.frequency:g} Hz)"
        for x in found
    )
