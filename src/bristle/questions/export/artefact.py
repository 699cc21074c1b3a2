"""Artefacts of an export: the file, what the target holds, and what it loses."""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import casadi as ca

from bristle.control.compensator import Compensator
from bristle.errors import one_line
from bristle.findings import CAUTION, Finding
from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression
from bristle.model.parameters import INERTIA, fields_of, lugre_of, unit
from bristle.page.wording import measured, plain, span
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import LARGE, Loss, told


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Options of an export."""

    into: bytes | None = None  # content of a model into which the values are merged; None: a new file
    into_name: str = ""  # name of that model's file
    amplitude: float | None = None  # of the motion of the fit, rad; None: up to the fastest measured speed
    frequency: float | None = None  # Hz
    compensator: Compensator = field(default_factory=Compensator)  # printed as C, with its adaptation


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefact:
    """The file of one target."""

    name: str  # default name of the file
    content: bytes
    holds: str  # the part of the friction that it holds, in words
    losses: Mapping[str, tuple[Loss, ...]] = field(default_factory=dict)  # of each joint, by motion; empty: none
    said: tuple[Finding, ...] = ()  # further findings, beside those of the joints


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportTarget:
    """A target of an export."""

    write: Callable[[Sequence[ExportedJoint], Request], Artefact]
    single: bool = False  # whether it holds one joint
    fitted: bool = False  # whether its values are fitted along a motion, which can be chosen
    merges: bool = False  # whether it can be merged into a given model
    loaded: bool = False  # whether it holds friction that rises with load


def c_compiler() -> str | None:
    """Path of this machine's C compiler, if any."""
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def notes(joint: ExportedJoint, found: Sequence[Loss] = ()) -> Iterator[str]:
    """Lines of a comment in an artefact: provenance, trust, parameters with intervals, assumptions, losses."""
    origin = joint.origin
    yield f"joint {joint.name} ({joint.kind}), identified by bristle {origin.bristle}"
    if joint.law_name != GAUSSIAN.name:
        yield f"friction law: {ascii(joint.law_name)[1:-1]}"
    if joint.simulated:
        yield "SIMULATED: the joint was identified from simulated data"
    yield f"results.json: sha256 {origin.results_sha256 or 'none, exported without a file'}"
    yield f"experiment: {origin.experiment or 'not known'}, {len(origin.logs)} logs"
    yield f"{joint.trust}" + (f": {joint.reason}" if joint.reason else "")
    for row in joint.parameters:
        value = f"{row.parameter} = {measured(row.value, row.standard_error).replace('±', '+/-')} {row.unit}"
        if row.interval is not None:
            value, source = f"{value}, 95 % {span(row.interval).replace('∞', 'inf')}", f"from {row.source}"
        else:
            source = "ASSUMED" if row.assumed else row.source
        yield f"{value}, {source}"
    if found:
        yield f"torque RMS error: {told(found, joint)}"
    for said in joint.said:
        yield f"{said.severity}: {said}"


def in_ascii(line: str) -> str:
    """A line in printable ASCII, with Python's escapes."""
    return ascii(one_line(line))[1:-1]


class Equation(NamedTuple):
    """An equation of a friction law."""

    name: str
    latex: str  # its left side
    unit: str
    of: tuple[str, ...]  # arguments beside the parameters: v, or z and v
    expression: Expression  # of symbols of the arguments and parameters


def equations(joint: ExportedJoint) -> Iterator[Equation]:
    """The equations of a law other than the paper's: g(v), then dz/dt and T_f, or without a bristle T_ss."""
    if joint.law == GAUSSIAN:
        return
    one, torque, velocity = lugre_of(joint.law), unit("torque", joint.kind), unit("velocity", joint.kind)
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), one(*(ca.SX.sym(name) for name in one._fields))
    yield Equation("level", "g(v)", torque, ("v",), law.stribeck(v, p))
    if joint.has_bristle:
        yield Equation("rate", r"\dot z", velocity, ("z", "v"), law.bristle_rate(z, v, p))
        yield Equation("torque", "T_f", torque, ("z", "v"), law.torque(z, v, p))
    else:
        yield Equation("steady", r"T_{\mathrm{ss}}(v)", torque, ("v",), law.steady_torque(v, p))


def artefact_of(
    joints: Sequence[ExportedJoint],
    target: str,
    ending: str,
    content: bytes,
    holds: str,
    losses: Mapping[str, tuple[Loss, ...]],
    *,
    counted: Sequence[str] = (),
    armature: bool = False,
) -> Artefact:
    """The file of a target, with findings on large losses, on terms left out, and on a missing armature.

    `ending`: of the file's name; `counted`: terms that the values include.
    """
    said = list[Finding]()
    for name, found in losses.items():
        if large := [x for x in found if x.percent > LARGE]:
            rms = ", ".join(f"{x.percent:.0f} % {x.motion.name}" for x in large)
            message = (
                f"{name}: {target} cannot hold this friction; the torque RMS error is {rms}. "
                "Where that matters, use a target that holds it (docs/export.md)."
            )
            numbers = {"joint": name, "target": target, "percent": tuple(x.percent for x in large)}
            said.append(Finding("export-loses", CAUTION, message, numbers))
    for joint in joints:
        # Identified torques beside friction and inertia that the values do not include.
        held = {*fields_of(joint.law), INERTIA.name, "links", "torque_constant", *counted}
        if names := tuple(str(x.parameter) for x in joint.parameters if x.parameter.name not in held):
            message = (
                f"{joint.name}: {target} does not hold {' and '.join(names)}, identified beside the friction; "
                "keep it in your own model of the load."
            )
            numbers = {"joint": joint.name, "target": target, "names": names}
            said.append(Finding("export-leaves-out", CAUTION, message, numbers))
        if armature and joint.rotor_inertia is None:
            message = f"{joint.name}: no inertia is known, and none is exported; the simulator keeps its own."
            said.append(Finding("export-without-inertia", CAUTION, message, {"joint": joint.name}))
    return Artefact(name=f"{slug(joints)}{ending}", content=content, holds=holds, losses=losses, said=tuple(said))


def slug(joints: Sequence[ExportedJoint]) -> str:
    """Stem of a file name: the joint's name in plain letters, or `robot`."""
    return "robot" if len(joints) > 1 else plain(joints[0].name, "_", 50)
