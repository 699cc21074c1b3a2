"""A joint's identified friction in a Python simulation of MuJoCo: both directions, exactly, at each step.

>>> friction = bristle.mujoco.Friction(model, "wrist", "results.json")  # doctest: +SKIP
>>> while data.time < 10:  # doctest: +SKIP
...     friction.apply(data)
...     mujoco.mj_step(model, data)
"""

from collections.abc import Callable
from functools import cache, partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from bristle.api.exporting import exported_joints
from bristle.api.identifying import read_if_results
from bristle.api.results import Results
from bristle.control.adaptation import Learnt
from bristle.control.compensator import CompensatorState, advanced
from bristle.control.plant import State, plant_step
from bristle.errors import InputError, short, short_list
from bristle.model import law, motor
from bristle.model.functions import cogging_function
from bristle.model.laws.parts import Law
from bristle.model.parameters import Motor, Pair, fields_of, pair_of, slides
from bristle.model.vectorize import bound
from bristle.questions.array_fit.fit import Fit
from bristle.questions.export.exported import ExportedJoint

_WORD = "bristle.mujoco"


class _Passed(NamedTuple):
    """A predicted step: deflection, rad, and velocity, rad/s, at its beginning and its end."""

    z: float
    v: float
    z_next: float
    v_next: float


class Friction:
    """The friction torque of one hinge or slide joint of a model, applied through `data.qfrc_applied`.

    Velocity and bristle are stepped together, by the exponential of their linear system, at the acceleration that the
    joint would have without this friction and at its effective inertia, 1 / (M**-1)_ii; the torque is the constant one
    that takes the joint there in one step. So a stiff bristle is stable in stick at any time step. Where friction rises
    with load, it does so with what actuators, `torque`, gravity and links do to the joint. It assumes:

    - the integrator is Euler, implicit or implicitfast: RK4 evaluates the forces four times in a step;
    - during a step all other forces are constant: actuators, gravity, springs, contacts and the friction of other joints;
    - the joint has no damping, frictionloss and LuGre actuator of its own, which would count twice.

    One object serves one `MjData`; several joints have one object each, applied one after the other, in any order.
    """

    def __init__(self, model: Any, joint: str, result: Results | Fit | ExportedJoint | Path | str) -> None:
        """Of the MuJoCo joint of that name.

        Args:
            model: `mujoco.MjModel`.
            joint: its name in the model; the identified joint is the one of that name, else the only one.
            result: results or their file, a fit of arrays, or a joint as `bristle.export` hands it over.

        Raises InputError where the model has no such joint, its integrator or the joint itself does not fit, or the
        joint's bristle or torque is not known.
        """
        import mujoco

        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint) < 0:
            names = short_list(short(model.joint(k).name) for k in range(model.njnt))
            raise InputError(f"{_WORD}: the model has no joint {short(joint)}; it has {names}")
        self._dof = int(model.joint(joint).dofadr[0])
        handed = _handed(result, joint).in_newton(_WORD).with_bristle(_WORD)
        kinds = {mujoco.mjtJoint.mjJNT_HINGE.value: "hinge", mujoco.mjtJoint.mjJNT_SLIDE.value: "slide"}
        got = kinds.get(int(model.joint(joint).type[0]), "neither hinge nor slide")
        expected = "slide" if slides(handed.kind) else "hinge"
        if got != expected:
            is_a = f"joint {short(joint)} of the model is {got}"
            raise InputError(f"{_WORD}: {is_a}; expected a {expected}, as the identified one")
        _check_model(model, joint)
        self._name, self._options = joint, model.opt
        whole, self._solve = mujoco.mjtStage.mjSTAGE_NONE.value, partial(mujoco.mj_solveM, model)
        self._forward: Callable[[Any], None] = lambda data: mujoco.mj_forwardSkip(model, data, whole, 1)  # no sensors
        self._one, self._response = np.zeros((1, model.nv)), np.zeros((1, model.nv))
        self._one[0, self._dof] = 1.0
        self._inputs, self._outputs = np.zeros(9), np.zeros(4)
        cogging = cogging_function(handed.cogging)
        self._cogging: Callable[[float], float] = lambda q: float(cogging(q)) if handed.cogging else 0.0
        self._place = int(model.joint(joint).qposadr[0])
        self._constants = np.array([*handed.pair.positive, *handed.pair.negative, handed.quadratic])
        self._rises, of_law = handed.rises, fields_of(handed.law)
        self._levels = [of_law.index("alpha_0"), len(of_law) + of_law.index("alpha_0")]
        self._alpha_0 = self._constants[self._levels]
        inputs = [self._inputs, self._constants]
        self._run: Callable[[], None] = bound(_coupled_step(handed.law), inputs, [self._outputs])
        self.reset()

    def reset(self, deflection: float = 0.0) -> None:
        """Restart with the bristle at a deflection, rad.

        Not needed after `mj_resetData`: where `data.time` has gone back, the bristle is not bent.
        """
        self._begun, self._step = -inf, 0.0
        self._before = self._after = _Passed(deflection, 0.0, deflection, 0.0)
        self._torque = 0.0

    @property
    def deflection(self) -> float:
        """Of the bristle when `apply` was called last, rad."""
        return self._after.z

    @property
    def torque(self) -> float:
        """Friction torque over the step that `apply` was called for last, N*m, positive against positive motion."""
        return self._torque

    def apply(self, data: Any, torque: float = 0.0) -> None:
        """Set `data.qfrc_applied` of the joint for the next step; call it right before each `mj_step(model, data)`.

        Args:
            data: `mujoco.MjData`, whose controls and forces on other joints are set.
            torque: your own on this joint, N*m: its `data.qfrc_applied` is set to this less friction and cogging.

        A second call at the same `data.time` begins from where the first one did. It evaluates the model's forward
        dynamics once. Raises InputError where a time step was left out since the last call.
        """
        applied, dof = data.qfrc_applied, self._dof
        applied[dof] = torque - self._cogging(float(data.qpos[self._place]))
        self._forward(data)
        if self._rises:  # what the motor gives, and what gravity and links do to the joint
            tau_m, tau_l = float(data.qfrc_actuator[dof]) + torque, float(data.qfrc_passive[dof] - data.qfrc_bias[dof])
            self._constants[self._levels] = self._alpha_0 + float(law.load_rise(self._rises, tau_m, tau_l))
        torque = float(applied[dof])
        self._solve(data, self._response, self._one)
        h, v = self._options.timestep, float(data.qvel[dof])
        last = self._last(data.time, v)
        self._inputs[:] = *last, v, data.qacc[dof], 1 / self._response[0, dof], self._step, h
        self._run()
        z, z_next, v_next, self._torque = self._outputs.tolist()
        self._begun, self._step, self._before, self._after = data.time, h, last, _Passed(z, v, z_next, v_next)
        applied[dof] = torque - self._torque

    def _last(self, time: float, v: float) -> _Passed:
        """The step that ends now; an empty one where there is none."""
        passed = time - self._begun
        if passed == 0:
            first = self._before
            return _Passed(first.z, v, first.z, v) if first.z == first.z_next and first.v == first.v_next else first
        if passed == inf or passed < 0:
            z = self._after.z if passed == inf else 0.0
            return _Passed(z, v, z, v)
        if abs(passed - self._step) > 1e-6 * self._step:  # beyond rounding
            why = f"was applied {passed:.6g} s ago, and a time step is {self._step:.6g} s"
            remedy = "call apply before every mj_step, or reset after a jump"
            raise InputError(f"{_WORD}: the friction of {short(self._name)} {why}; {remedy}")
        return self._after


@cache
def _coupled_step(of: Law) -> ca.Function:
    """(last step, v, free acceleration, inertia, last h, h; constants) -> (z, z and v after h seconds, friction torque).

    `plant_step` predicts the end of each step. Where the joint ended elsewhere, as at a limit or by another joint's
    friction, the bristle moves by what its exact-exponential step along each of the two velocities differs by.
    """
    inputs, constants = ca.SX.sym("inputs", 9), ca.SX.sym("constants", 2 * len(fields_of(of)) + 1)
    z0, v0, z1, v1, v, a, J, h0, h = ca.vertsplit(inputs)
    *numbers, quadratic = ca.vertsplit(constants)
    pair = pair_of(numbers, of)
    z = z1 + _along(z0, v0, v, h0, pair) - _along(z0, v0, v1, h0, pair)
    drag = quadratic * law.load_terms(0.0, v, 0.0, 0.0)["quadratic"]
    new = plant_step(State(0.0, v, z), J * a, -drag, h, pair, Motor(1.0, 0.0, 0.0, J), motor.current_for)
    torque = J * (a - (new.velocity - v) / h)
    outputs = ca.vertcat(z, new.deflection, new.velocity, torque)
    return ca.Function("coupled_step", [inputs, constants], [ca.densify(outputs)], {"cse": True})


def _along(z: Any, v0: Any, v1: Any, h: Any, pair: Pair[Any]) -> Any:
    """The bristle after h seconds along a velocity that is linear in time."""
    return advanced(None, CompensatorState(pair, z, v0, 0.0, Learnt((), (), ())), v1, h)[0]


def _handed(result: Results | Fit | ExportedJoint | Path | str, name: str) -> ExportedJoint:
    """The joint of that name, or the only one."""
    if isinstance(result, ExportedJoint):
        return result
    known = read_if_results(result)
    if not isinstance(known, Results):
        raise InputError(f"{result}: is not a results file; expected results.json, results or a fit of arrays")
    names = [joint.name for joint in known.joints]
    if name not in names and len(names) != 1:
        have = f"the results have no joint {short(name)}, but {short_list(map(short, names))}"
        raise InputError(f"{_WORD}: {have}; rename one, or give one joint's results")
    return exported_joints(known, name if name in names else names[0])[0]


def _check_model(model: Any, name: str) -> None:
    """Raise InputError where the integrator does not hold a force over a step, or the joint has other friction."""
    import mujoco

    fits = ("EULER", "IMPLICIT", "IMPLICITFAST")
    integrator = mujoco.mjtIntegrator(model.opt.integrator).name.removeprefix("mjINT_")
    if integrator not in fits:
        why = f"the model's integrator is {integrator}, in which the friction is not held over a step"
        raise InputError(f"{_WORD}: {why}; set Euler, implicit or implicitfast")
    dof, joint = model.joint(name).dofadr[0], model.joint(name).id
    own = {x: getattr(model, f"dof_{x}")[dof] for x in ("damping", "frictionloss")}
    twice = [(f"{what} {value:.4g} of its own", "set it to 0 in the model") for what, value in own.items() if value]
    lugre = getattr(mujoco.mjtDyn, "mjDYN_DCMOTOR", None)
    if lugre is not None:
        transmissions = (mujoco.mjtTrn.mjTRN_JOINT.value, mujoco.mjtTrn.mjTRN_JOINTINPARENT.value)
        on_joint = np.isin(model.actuator_trntype, transmissions) & (model.actuator_trnid[:, 0] == joint)
        if np.any(on_joint & (model.actuator_dyntype == lugre.value) & (model.actuator_dynprm[:, 5] > 0)):
            twice.append(("a dcmotor with LuGre friction", "take it out of the model"))
    if twice:
        what, remedy = twice[0]
        raise InputError(f"{_WORD}: joint {short(name)} has {what}, and friction would count twice; {remedy}")
