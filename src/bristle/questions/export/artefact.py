"""What an export gives: files, what the target holds, and what it loses."""

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
    """What is asked of an export beside the joints."""

    into: bytes | None = None  # a model into which the values are merged, as it was read; None: a snippet
    into_name: str = ""  # what that file is called
    amplitude: float | None = None
    """Of the motion for which the values are the best, rad; None: up to the fastest measured speed."""
    frequency: float | None = None  # Hz
    compensator: Compensator = field(default_factory=Compensator)  # that is printed as C, with its adaptation


@dataclass(frozen=True, slots=True, kw_only=True)
class Artefact:
    """What one target takes."""

    name: str  # of the file, as it is called if no other name is asked for
    content: bytes
    holds: str  # a sentence: what of the friction is in it
    losses: Mapping[str, tuple[Loss, ...]] = field(default_factory=dict)
    """Of each joint, motion by motion; none: nothing is lost."""
    said: tuple[Finding, ...] = ()  # what else must be known of it, beside what is said of the joints


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportTarget:
    """A kind of artefact: who writes it, and of what."""

    write: Callable[[Sequence[ExportedJoint], Request], Artefact]
    single: bool = False  # whether it holds one joint
    fitted: bool = False  # whether its values are the best along a motion that can be asked for
    merges: bool = False  # whether it can be merged into a given model
    loaded: bool = False  # whether it has the load that friction rises with


def c_compiler() -> str | None:
    """Where this machine's C compiler is; None: there is none."""
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def notes(joint: ExportedJoint, found: Sequence[Loss] = ()) -> Iterator[str]:
    """What an artefact says of itself, a line each, unescaped: provenance, trust, parameters with intervals, what was assumed, and losses."""
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
    """A line of such for a comment of a script: printable ASCII, the rest as Python escapes it."""
    return ascii(one_line(line))[1:-1]


class Equation(NamedTuple):
    """One of them."""

    name: str
    latex: str  # its left side
    unit: str
    of: tuple[str, ...]  # what it is a function of beside the parameters: v, or z and v
    expression: Expression  # of symbols with these names and those of the parameters


def equations(joint: ExportedJoint) -> Iterator[Equation]:
    """What must be known of a law that is not the paper's; none of that.

    `level` g(v), then `rate` dz/dt and `torque` T_f where the bristle is known, else `steady`, the friction vs velocity.
    """
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
    """What a target takes; said are losses of more than 10 %, what is left out, and, of one that takes an armature, that there is none.

    `ending` stands behind the name of the joints, `counted` are terms that the values stand for.
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
        # torque that was identified beside the friction and the inertia, and that the values do not stand for
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
    """What a file of these joints is called: the joint's name in plain letters, or `robot`."""
    return "robot" if len(joints) > 1 else plain(joints[0].name, "_", 50)
