"""Export of the compensator as one C99 header, printed from CasADi expressions into a template."""

import hashlib
import textwrap
from collections.abc import Iterator, Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.control.compensator import Compensator
from bristle.control.running import RunningCompensator
from bristle.control.symbolic import settings_of
from bristle.errors import InputError
from bristle.model.functions import cogging_function
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import Pair, has_own_unit, lugre_of, slides, unit
from bristle.page.wording import shortened
from bristle.questions.export import c_code
from bristle.questions.export.c_numbers import c_field, digits, identifier, range_of, stem_of
from bristle.questions.export.c_step import NamedFunction, PrintedStep, printed_joint, printed_step
from bristle.questions.export.export import Artefact, ExportTarget, Request, artefact_of, notes
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import losses, lugre, stated_motions

_STEPS, _DT, _HERTZ = 48, 5e-3, 2.5  # the test vector: steps, their length, s, and the frequency of its sine, Hz
_DOUBLE, _SINGLE = 1e-12, 5e-6  # tolerances of the test vector, over its largest torque


def numbers_of(joint: ExportedJoint) -> Pair[float]:
    """The joint's sets; without a bristle with a stiffness of 1, which is not used."""
    if joint.has_bristle:
        return joint.pair
    return Pair(*(lugre_of(joint.law)(**p._asdict(), sigma_0=1.0, sigma_1=0.0) for p in joint.curves))


def top_speed(joint: ExportedJoint) -> float:
    """Largest speed of the test vector, rad/s: half of the fastest measured one; of a law with terms beyond v_end."""
    beyond = [getattr(p, FASTEST) for p in joint.curves] if joint.law.terms else []
    return min(1.2 * max(beyond), 0.9 * range_of("velocity")[1]) if beyond else 0.5 * joint.fastest


def python_torque(joint: ExportedJoint, compensator: Compensator, inputs: dict[str, Array]) -> Array:
    """Torque of the compensator in Python from rest, N*m, (n,)."""
    rises = joint.rises
    running = RunningCompensator(compensator, numbers_of(joint), rises=rises)
    motion = ("dt", "reference_position", "reference_velocity", "reference_acceleration", "position", "velocity")
    rows = np.array([inputs[name] for name in (*motion, "motor_torque", "link_torque")]).T.tolist()
    return np.array(
        [
            running.step(h, (y_ref, v_ref, a_ref), y, v, (tau_m, tau_l) if rises else None)
            for h, y_ref, v_ref, a_ref, y, v, tau_m, tau_l in rows
        ]
    )


def header(joint: ExportedJoint, compensator: Compensator) -> str:
    """The header of one joint. Raises InputError for no compensator, or where a parameter is out of range."""
    if compensator.name == "none":
        raise InputError(
            "compensator: none has no code; expected coulomb, stribeck, lugre, lugre-feedback or lugre-observer"
        )
    rises = tuple(joint.rises)
    printed = printed_step(kind_of(compensator), joint.law, rises)
    given = settings_of(compensator) | joint.rises
    of_sets = [(name, getattr(p, name), joint.law) for p in numbers_of(joint) for name in printed.fields]
    for name, value, law in (*of_sets, *((name, given[name], GAUSSIAN) for name in printed.settings)):
        low, high = range_of(name, law)
        if not low <= value <= high:
            raise InputError(
                f"{joint.name}: {name}: got {value:g}; the C code takes {low:g} to {high:g}: check its unit"
            )
    rows = test_vector(joint, compensator, printed)
    peak = float(np.abs(rows[:, -1]).max())
    code = _code(kind_of(compensator), joint.law, rises)
    told = f"{joint.name}{joint.pair if joint.has_bristle else joint.curves}{sorted(given.items())}"
    guard = hashlib.sha256(told.encode("utf-8", "surrogatepass")).hexdigest()[:12].upper()
    a, about = compensator.adaptation, list(notes(joint))
    adapts = f", adapting {', '.join(a.parameters)} by the {a.law} law, {a.step} step" if a else ", without adaptation"
    about.append(f"compensator: {compensator.name}{adapts}")
    torque, cogging = unit("torque", joint.kind), list[str]()
    if joint.cogging:
        lines, (wave,) = c_code.printed(cogging_function(joint.cogging), lambda *_: "position")
        cogging = [*lines, f"return {wave.text};"]
    if slides(joint.kind) or has_own_unit(joint.kind):
        of = f"rad is {unit('position', joint.kind)}, and N*m {torque}"
        about.append(f"units below are those of a joint that turns; here {of}")
    comments = map(c_code.escaped, about)
    context = dict(
        joint=shortened(joint.name), name=identifier(joint), compensator=compensator.name,
        notes=[line for text in comments for line in textwrap.wrap(text, 140, break_on_hyphens=False)],
        double_only=compensator.name == "lugre-observer" and a is not None,
        guard=f"BRISTLE_{guard}", sets=[[digits(getattr(p, name)) for name in printed.fields] for p in numbers_of(joint)],
        cogging=cogging, torque_unit=torque, settings=[(name, digits(given[name])) for name in printed.settings],
        rows=[[*map(digits, row)] for row in rows], columns=printed.inputs,
        tolerances=(digits(_DOUBLE), digits(_SINGLE)), allowed=(digits(_DOUBLE * peak), digits(_SINGLE * peak)), **code,
    )  # fmt: skip  # a list of values
    return c_code.filled("bristle.h", context)


def test_vector(joint: ExportedJoint, compensator: Compensator, printed: PrintedStep) -> Array:
    """Inputs and torque of the compensator in Python from rest at position 0, (steps, inputs + 1).

    A sine up to `top_speed`, a standstill, and a sine in presliding. Inputs are numbers of single precision.
    """
    k = np.arange(1, _STEPS + 1)
    w = 2 * np.pi * _HERTZ
    speeds = np.where(k <= _STEPS // 2, top_speed(joint), np.where(k <= 2 * _STEPS // 3, 0.0, 0.02 * joint.fastest))
    t = _DT * k
    columns = {
        "reference_position": speeds / w * np.sin(w * t),
        "reference_velocity": speeds * np.cos(w * t),
        "reference_acceleration": -speeds * w * np.sin(w * t),
        "position": speeds / w * np.sin(w * t - 0.1),
        "velocity": speeds * np.cos(w * t - 0.1),
        "dt": np.full(k.size, _DT),
        "motor_torque": 2 * joint.curves[0].alpha_0 * np.sin(0.3 * w * t),
        "link_torque": joint.curves[0].alpha_0 * np.cos(0.2 * w * t),
    }
    given = {name: x.astype(np.float32).astype(np.float64) for name, x in columns.items()}
    torque = python_torque(joint, compensator, given)
    return np.column_stack([*(given[name] for name in printed.inputs), torque])


def kind_of(compensator: Compensator) -> Compensator:
    """The compensator with default numbers, which is printed the same."""
    a = compensator.adaptation
    kind = a and Adaptation(law=a.law, step=a.step, parameters=a.parameters, gamma=(0.0,) * len(a.parameters))
    return Compensator(name=compensator.name, velocity=compensator.velocity, adaptation=kind)


@cache
def _code(compensator: Compensator, law: Law, rises: tuple[str, ...]) -> dict[str, Any]:
    """The part of the template's context that is the same for all compensators of a kind, of a law and load."""
    printed = printed_step(compensator, law, rises)
    gradient = printed.gradient
    field = partial(c_field, adapts=compensator.adaptation is not None)
    parts: dict[str, Any] = {
        "loaded": bool(rises), "fields": [field(name, law) for name in printed.fields],
        "parameters": [*map(field, printed.settings)], "memory": [*map(field, printed.memory)],
        "inputs": [*map(field, printed.inputs)], "start": [*_lines(printed.start, ("p->",), "s->")],
        "gains": [name for name in printed.memory if stem_of(name) == "theta"],
        "advance": [*_lines(printed.advance, ("p->", "p->", "s->", "in->"), "next->")],
        "gradient": [*_lines(gradient, ("p->", "p->", "s->"), None)] if gradient else [],
        "simulate": [*_lines(printed_joint(law), ("p->", "j->", ""), "j->")] if gradient else [],
    }  # fmt: skip  # a list of values
    code = [line for name in ("start", "advance", "gradient", "simulate") for line in parts[name]]
    parts |= {"math": c_code.math_of(code), "units": {name: unit(name) for name in ("position", "velocity", "torque")}}
    digest = hashlib.sha256(repr(parts).encode()).hexdigest()
    return parts | {"code_hash": f"0x{digest[:8]}"}


def _lines(printed: NamedFunction, owners: Sequence[str], target: str | None) -> Iterator[str]:
    """Statements of a function whose inputs are members of the owners, and its outputs of the target, or an array."""

    def operand(place: int, element: int) -> str:
        return owners[place] + printed.inputs[place][element]

    lines, outputs = c_code.printed(printed.function, operand)
    yield from lines
    gains = [name for name in printed.outputs if stem_of(name) == "theta"]
    for k, (name, value) in enumerate(zip(printed.outputs, outputs, strict=True)):
        change = name in gains and printed.function.name() == "advance"
        place = f"out[{k}]" if target is None else f"change[{gains.index(name)}]" if change else target + name
        yield f"{place} = {value.text};"


def _write(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
    (joint,) = joints
    whole = request.compensator.name.startswith("lugre")

    def alone(v: Array, step: float) -> Array:
        """Torque of a compensator without a bristle at each velocity, N*m, (n,)."""
        running = RunningCompensator(request.compensator, numbers_of(joint))
        return np.array([running.step(step, (0.0, x), 0.0, x) for x in v.tolist()])

    model = lugre(joint.with_bristle("c with this compensator").pair) if whole else alone
    found = () if whole and not joint.quadratic else losses(joint, model, stated_motions(joint))
    content, holds = header(joint, request.compensator).encode("ascii"), _HOLDS[request.compensator.name]
    holds += f"; cogging by {identifier(joint)}_cogging(position)" if joint.cogging else ""
    counted = [*joint.rises, *joint.cogging_names]
    return artefact_of(joints, "c", ".h", content, holds, {joint.name: found} if found else {}, counted=counted)


_HOLDS = {
    "coulomb": "Coulomb friction alone, alpha_0 tanh(v / softness); no viscous friction, no Stribeck peak, no bristle",
    "stribeck": "friction vs velocity of both directions, without the bristle",
    **dict.fromkeys(
        ("lugre", "lugre-feedback", "lugre-observer"),
        "LuGre with both directions, to the last bit as bristle computes it",
    ),
}


TARGET = ExportTarget(write=_write, single=True, loaded=True)
