"""Off-line adaptation on measured runs.

The measured velocity drives the model, as in the feedback scheme. The gains learn from the torque error, converted to a
position error by the loop's proportional gain: e = (T_model - T_measured) / K_p, rad, which has the sign of y - y_ref.
So the rates are those of the loop. A run with gaps is replayed segment by segment, the gains continue.
"""

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation, effective, gradient, learn
from bristle.control.compensator import Compensator, CompensatorState, advanced, initial_state, packed, unpacked
from bristle.control.control_period import flat, no_friction, symbols
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.known_joint import rises_of
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import LEVELS, REGRESSORS, inertia, regressors, regressors_of
from bristle.identification.results import Joint
from bristle.model import law
from bristle.model.laws.parts import Law
from bristle.model.parameters import INERTIA
from bristle.model.rollout import rollout
from bristle.model.vectorize import chained
from bristle.simulation.joint_loop import JointLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class Replay:
    """One run, replayed with the identified model, with adapted gains and with gains of 1; arrays over its n samples."""

    file: str
    time: Array  # s, (n,)
    measured: Array  # friction torque: measured without inertia, offset and gravity, N*m, (n,)
    fixed: Array  # predicted with gains of 1, N*m, (n,)
    adapted: Array  # predicted with adapted gains, N*m, (n,)
    theta: Array  # gains: ratios to the identified parameters, (parameters, n)
    adaptation: Adaptation

    def relative_errors(self) -> tuple[float, float]:
        """100 norm(measured - predicted) / norm(measured) of the second half, gains of 1 and adapted, percent."""
        late, norm = slice(self.time.size // 2, None), np.linalg.norm
        over = float(norm(self.measured[late])) or 1.0
        before, after = (100 * float(norm((self.measured - x)[late])) / over for x in (self.fixed, self.adapted))
        return before, after

    @property
    def ratios(self) -> tuple[tuple[str, float], ...]:
        """Each parameter with its final ratio to the identified value."""
        return tuple(zip(self.adaptation.parameters, self.theta[:, -1].tolist(), strict=True))

    @property
    def shares(self) -> str:
        """`ratios` in words."""
        return ", ".join(f"{name} {share:.3g}" for name, share in self.ratios)

    @property
    def verdict(self) -> Finding:
        """Whether to switch the adaptation on."""
        before, after = self.relative_errors()
        (low, high), gains = self.adaptation.limits, self.theta[:, -1]
        numbers = {"before": before, "after": after, "ratios": self.ratios}
        left = f"{after:.3g} % of the friction torque is left unexplained instead of {before:.3g} %"
        if (
            (np.abs(gains - 1) > levels.MATTERS)
            & ((gains <= (1 + levels.MATTERS) * low) | (gains >= (1 - levels.MATTERS) * high))
        ).any():
            message = (
                f"A gain ended at its limit ({self.shares}; {left}): widen adapt.limits if friction may have changed that much; "
                "otherwise leave it off, or lower gamma."
            )
            return Finding("gain-at-limit", CAUTION, message, numbers)
        if before > levels.UNFIT:
            message = (
                f"The identified model leaves {before:.3g} % of this run's friction torque unexplained ({after:.3g} % adapted): check "
                "units, sign and columns of the run; until then its gains mean nothing."
            )
            return Finding("model-unfit", CAUTION, message, {"before": before, "after": after})
        little = max(levels.UNCHANGED[0], levels.UNCHANGED[1] * before)
        if after < before - little:
            return Finding("adaptation-helps", NOTE, f"It helps here: {left}, at ratios {self.shares}.", numbers)
        if after <= before + little:
            same = f"{before:.3g} % of the friction torque is left unexplained without it, {after:.3g} % with it"
            message = f"It changes nothing here: {same}, at ratios {self.shares}."
            return Finding("adaptation-idle", NOTE, message, numbers)
        return Finding("adaptation-harms", CAUTION, f"Leave it off: {left}, at ratios {self.shares}.", numbers)


def replays(loop: JointLoop, joint: Joint, measured: Measured) -> tuple[Replay, ...]:
    """Replays of tracking runs with the identified model: by the loop's law, and by its diagnostic law."""
    held, _ = inertia(measured.experiment)
    known = {INERTIA: loop.J} | (joint.moving.known if joint.moving is not None else {})
    model = loop.model
    fitted = regressors_of([name.name for name in known], joint.kind)
    rises = rises_of(joint)
    loads = (name for name, terms in LEVELS.items() if {*terms.names} == {*rises})
    own = (*regressors(measured.experiment), *(x for x in fitted if x not in REGRESSORS), *loads)
    asked, found = tuple(dict.fromkeys(own)), []
    for record in (run.record for run in measured.runs if run.kind == "tracking"):
        problem = dynamic_problem([record], ("both",), asked, 1, held)
        extra = np.array([known.get(name, 0.0) for name in problem.extra_names])
        weights = {name.name: x for name, x in zip(problem.extra_names, extra.tolist(), strict=True)}
        rising = []  # rise of alpha_0 with the load along each motion, N*m, (n,)
        for m in problem.motions:
            terms = () if m.load is None else m.load.levels
            columns = np.zeros((0, m.velocity.size)) if m.load is None else m.load.by(weights)[0]
            rising.append(np.array([rises[name] for name in terms]) @ columns)
        for a in (x for x in (loop.adaptation, loop.diagnostic_law) if x):
            parts, state = [], initial_state(Compensator(adaptation=a), model)
            for m, level in zip(problem.motions, rising, strict=True):
                friction = m.torque - m.extra @ extra
                state = state._replace(deflection=0.0, velocity=m.velocity[0])
                inputs = np.vstack([m.velocity, friction, np.append(0.0, m.step), level])
                run = _run(a, model.law, m.velocity.size)
                ends, log = run(packed(state), inputs, flat((model, loop.gains.K_p)))
                state = unpacked(np.asarray(ends).ravel().tolist(), model, len(a.parameters))
                fixed = rollout(m.velocity, m.step, model, 0.0, level=level).torque
                parts.append((m.time, friction, fixed, np.asarray(log)))
            time, friction, fixed, log = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
            found.append(Replay(
                file=record.file, time=time, measured=friction, fixed=fixed, adapted=log[0], theta=log[1:], adaptation=a,
            ))  # fmt: skip  # a list of values
    return tuple(found)


@lru_cache(maxsize=8)
def _run(a: Adaptation, of: Law, samples: int) -> ca.Function:
    """(memory, (velocity, friction, step, level), (pair, K_p)) -> (memory, (torque, gains))."""
    blank = no_friction(of)
    memory, own = symbols("memory", tuple(packed(initial_state(Compensator(adaptation=a), blank))))
    u, (v, friction, h, level) = symbols("u", (0.0,) * 4)
    q, (model, K_p) = symbols("q", (blank, 0.0))
    state = unpacked(own, model, len(a.parameters))
    z, learnt = advanced(a, state, v, h, level)
    p = law.active(z, v, state.parameters)
    T = law.torque(z, v, effective(p, a, learnt.theta, level))
    learnt = learn(a, learnt, gradient(a, z, v, p, learnt, level), (T - friction) / K_p, h)
    new = CompensatorState(state.parameters, z, v, state.position, learnt)
    tick = ca.Function("tick", [memory, u, q], [ca.vertcat(*packed(new)), ca.vertcat(T, *learnt.theta)], {"cse": True})
    return chained(tick, samples)
