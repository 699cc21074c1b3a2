"""Functions of a compensator and of a simulated joint to be printed as C, of the numbers that they use."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca

from bristle.control import compensator as compensating
from bristle.control.adaptation import effective
from bristle.control.compensator import Compensator, Measurement, Reference
from bristle.control.plant import State, plant_step
from bristle.control.symbolic import SymbolicAdaptation, setting_names, with_settings
from bristle.model import functions, law, motor
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression, Law
from bristle.model.parameters import SIGNED, Motor, fields_of, pair_of
from bristle.questions.export.exported import WAYS

_INPUTS = (
    "reference_position", "reference_velocity", "reference_acceleration", "position", "velocity", "dt", "motor_torque", "link_torque",
)  # fmt: skip  # a list of names
JOINT = ("position", "velocity", "deflection")  # state of a simulated joint


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangingAdaptation(SymbolicAdaptation):
    """Adaptation that returns the change of each gain, which the C adds without loss in single precision."""

    def moved(self, theta: Expression, change: Expression) -> Expression:  # noqa: ARG002  # the C adds
        """The change alone."""
        return change


class NamedFunction(NamedTuple):
    """A function of groups of named numbers."""

    function: ca.Function
    inputs: tuple[tuple[str, ...], ...]  # the names of each input's elements
    outputs: tuple[str, ...]


class PrintedStep(NamedTuple):
    """A compensator to be printed."""

    fields: tuple[str, ...]  # parameters of a set that it uses
    settings: tuple[str, ...]  # numbers beside those of the pair
    memory: tuple[str, ...]
    inputs: tuple[str, ...]
    start: NamedFunction  # (settings) -> memory at rest
    advance: NamedFunction
    """(pair, settings, memory, inputs) -> memory after a control period, with changes of gains, and the torque, N*m."""
    gradient: NamedFunction | None
    """(pair, settings, memory) -> derivatives of the friction torque at given z by the acting set; None: no bristle."""


def sets_of(of: Law) -> tuple[str, ...]:
    """Names in C of the numbers of a pair."""
    return tuple(f"{WAYS[d]}.{name}" for d in SIGNED for name in fields_of(of))


@lru_cache(maxsize=64)
def printed_step(compensator: Compensator, of: Law = GAUSSIAN, rises: tuple[str, ...] = ()) -> PrintedStep:
    """A compensator for joints of a law, with the numbers that its torque depends on.

    `rises`: coefficients by which friction rises with load (`law.load_levels`), which are among the settings.
    """
    n, sets = compensating.adapted_count(compensator), sets_of(of)
    names = (*setting_names(n), *rises)
    q, s, w = ca.SX.sym("q", len(sets)), ca.SX.sym("s", len(names)), ca.SX.sym("w", len(_INPUTS))
    pair = pair_of(ca.vertsplit(q), of)
    own = dict(zip(names, ca.vertsplit(s), strict=True))
    symbolic = with_settings(compensator, own, ChangingAdaptation)
    at_rest = compensating.packed(compensating.initial_state(symbolic, pair))
    m = ca.SX.sym("m", len(at_rest))
    state = compensating.unpacked(ca.vertsplit(m), pair, n)
    y_ref, v_ref, a_ref, y, v, h, tau_m, tau_l = ca.vertsplit(w)
    level = law.load_rise({name: own[name] for name in rises}, tau_m, tau_l)
    new, T = compensating.step(symbolic, state, Reference(y_ref, v_ref, a_ref, level=level), Measurement(y, v), h)
    out = ca.densify(ca.vertcat(*compensating.packed(new), T))
    # Elements of the memory that the torque, the last of `out`, depends on, now or later.
    reach, rows = set[int](), [out.numel() - 1]
    while new_ones := {*_depends(out[rows], m)} - reach:
        reach |= new_ones
        rows = sorted(new_ones)
    kept = sorted(reach)
    # Names of the memory, in the order of `compensator.packed`.
    adapted = compensator.adaptation.parameters if compensator.adaptation else ()
    learnt = [f"{what}_{x}" for what in ("theta", "sensitivity") for x in adapted]
    learnt += [f"covariance_{a}_{b}" for a in adapted for b in adapted]
    memory = [("deflection", "velocity", "position", *learnt)[k] for k in kept]
    begun, told = [at_rest[k] for k in kept], [out[k] for k in (*kept, out.numel() - 1)]
    used = _depends(ca.vertcat(*told, *begun), s)
    used += [names.index(name) for name in ("lower", "upper") if n]
    given = _depends(ca.vertcat(*told), w)
    settings, inputs = [names[k] for k in used], [_INPUTS[k] for k in given]
    read = {sets[k].partition(".")[2] for k in _depends(ca.vertcat(*told), q)}
    groups = [(sets, q), (settings, s[used]), (memory, m[kept])]
    gradient = None
    if "deflection" in memory:
        z, v, a = state.deflection, state.velocity, symbolic.adaptation
        p = law.active(z, v, state.parameters)
        acting = effective(p, a, state.learnt.theta) if a else p
        _, _, *by = functions.torque_sensitivity_function(p.law)(z, v, *acting)
        gradient = _named("gradient", groups, fields_of(of), by)
    return PrintedStep(
        fields=tuple(name for name in fields_of(of) if name in read), settings=tuple(settings), memory=tuple(memory),
        inputs=tuple(inputs), start=_named("start", [(settings, s[used])], memory, begun),
        advance=_named("advance", [*groups, (inputs, w[given])], [*memory, "torque"], told),
        gradient=gradient,
    )  # fmt: skip  # a list of values


def _depends(out: Expression, by: Expression) -> list[int]:
    """Elements of a vector that some expressions depend on."""
    return [k for k, enters in enumerate(ca.which_depends(out, by, 1, False)) if enters]


@lru_cache(maxsize=16)
def printed_joint(of: Law = GAUSSIAN) -> NamedFunction:
    """`plant.plant_step`: (pair, joint, (inertia, torque, dt)) -> joint after dt seconds, and its friction, N*m."""
    sets = sets_of(of)
    q, x, w = ca.SX.sym("q", len(sets)), ca.SX.sym("x", 3), ca.SX.sym("w", 3)
    pair, (J, T, h) = pair_of(ca.vertsplit(q), of), ca.vertsplit(w)
    new = plant_step(State(*ca.vertsplit(x)), T, 0.0, h, pair, Motor(1.0, 1.0, 0.0, J), motor.current_for)
    friction = law.torque(new.deflection, new.velocity, law.active(new.deflection, new.velocity, pair))
    groups = [(sets, q), (JOINT, x), (("inertia", "torque", "dt"), w)]
    return _named("joint", groups, (*JOINT, "friction"), [*new, friction])


def _named(
    name: str, inputs: Sequence[tuple[Sequence[str], Expression]], outputs: Sequence[str], values: Sequence[Expression]
) -> NamedFunction:
    out = ca.densify(ca.vertcat(*(ca.SX(x) for x in values)))
    function = ca.Function(name, [x for _, x in inputs], [out], {"cse": True})
    return NamedFunction(function, tuple(tuple(names) for names, _ in inputs), tuple(outputs))
