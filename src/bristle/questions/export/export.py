"""Export of joints: options, targets, the artefact of a target, and the export as `bristle.export` returns it."""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import casadi as ca

from bristle.control.compensator import Compensator
from bristle.errors import InputError, one_line
from bristle.estimation import levels
from bristle.findings import CAUTION, Finding
from bristle.identification.known_joint import load_left_out
from bristle.identification.verdict import Trust
from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Expression
from bristle.model.parameters import INERTIA, fields_of, lugre_of, unit
from bristle.page.output_folder import write_bytes
from bristle.page.wording import measured, plain, span
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Loss, told

_PLACES = {
    "c": "c_header.TARGET", "mujoco": "mjcf.TARGET", "mujoco-frictionloss": "mjcf.FRICTIONLOSS", "fmu": "fmu.TARGET",
    "urdf": "axes.URDF", "sdf": "axes.SDF", "isaac": "coulomb_viscous.ISAAC", "json": "json_document.TARGET", "matlab": "matlab.TARGET",
    "latex": "latex.TARGET",
}  # fmt: skip  # module, loaded when it is needed, and name of each target
TARGETS = tuple(_PLACES)  # in the order of docs/export.md


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
    """The file of a target, with findings on losses and on terms left out, except those `counted` in its values."""
    said = list[Finding]()
    for name, found in losses.items():
        if large := [x for x in found if x.percent > levels.NEED]:
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Export:
    """One artefact of one target, of one joint or several."""

    to: str
    """The target's name."""
    joints: tuple[ExportedJoint, ...]
    request: Request
    artefact: Artefact

    @property
    def content(self) -> bytes:
        """Content of the file."""
        return self.artefact.content

    def text(self) -> str:
        """What the target holds and loses, and findings on the values; as `bristle export` prints it."""
        names = ", ".join(joint.name for joint in self.joints)
        lines = [f"Export to {self.to}: {names}", f"  holds: {self.artefact.holds}"]
        for joint in self.joints:
            if joint.simulated:
                lines.append(f"  {joint.name}: identified from SIMULATED data")
            if joint.law_name != GAUSSIAN.name:
                lines.append(f"  {joint.name}: friction law {joint.law_name}")
            if joint.trust is not Trust.USE:
                lines.append(f"  {joint.name}: {joint.trust}" + (f": {joint.reason}" if joint.reason else ""))
            if found := self.artefact.losses.get(joint.name):
                lines.append(f"  torque RMS error of {joint.name}: {told(found, joint)}")
            lines += (f"  {said.severity}: {joint.name}: {said.flagged}" for said in joint.said)
        return "\n".join([*lines, *(f"  {said.severity}: {said.flagged}" for said in self.artefact.said)]) + "\n"

    def __str__(self) -> str:
        return self.text()

    def write(self, path: Path | str | None = None) -> Path:
        """Write the file, by default with the joint's name. Raises InputError where another file is there."""
        path = Path(self.artefact.name if path is None else path)
        write_bytes(path, self.content)
        return path


def target(name: str) -> ExportTarget:
    """The target of this name. Raises InputError where there is none."""
    if name not in _PLACES:
        raise InputError(f"to: got {name!r}; expected one of {', '.join(TARGETS)}")
    module, _, own = _PLACES[name].partition(".")
    found: ExportTarget = getattr(import_module(f"bristle.questions.export.{module}"), own)
    return found


def export_joints(
    joints: Sequence[ExportedJoint], to: str, request: Request, refused: tuple[Finding, ...] = ()
) -> Export:
    """Export joints to a target; of several joints those that the target takes, with findings on the others.

    Raises InputError where an option or the number of joints does not fit the target, or no joint has what it needs.
    """
    chosen = target(to)
    if not chosen.loaded:
        joints = [replace(x, said=(*load_left_out(x.rises, x.kind), *x.said)) for x in joints]
    if chosen.single and len(joints) > 1:
        names = ", ".join(x.name for x in joints)
        raise InputError(
            f"{to} holds one joint, and the results have {len(joints)}: say which with joint, one of {names}"
        )
    if not chosen.fitted and (request.amplitude or request.frequency):
        raise InputError(f"{to} has no values that are fitted along a motion; leave amplitude and frequency out")
    if len({unit("position", x.kind) for x in joints}) > 1 and request.amplitude:
        raise InputError("amplitude: got one for joints that turn and joints that slide; say which joint with joint")
    if request.into is not None and not chosen.merges:
        raise InputError(f"into: {to} is written as a file of its own; leave into out")
    kept, left_out = list(joints), list[Finding]()
    for joint in joints if len(joints) > 1 else ():
        try:
            chosen.write([joint], request)
        except InputError as error:
            kept.remove(joint)
            left_out.append(joint_left_out(error))
    artefact = chosen.write(kept or joints[:1], request)
    said = (*refused, *left_out, *artefact.said)
    return Export(to=to, joints=tuple(kept), request=request, artefact=replace(artefact, said=said))


def joint_left_out(error: InputError) -> Finding:
    """A joint that is not exported, and why."""
    return Finding("export-joint-left-out", CAUTION, f"Left out: {error}", {"why": str(error)})
