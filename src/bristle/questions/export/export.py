"""An export as `bristle.export` returns it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path

from bristle.errors import InputError
from bristle.findings import CAUTION, Finding
from bristle.identification.verdict import Trust
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import unit
from bristle.page.output_folder import write_bytes
from bristle.questions.export.artefact import Artefact, ExportTarget, Request
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import told

_PLACES = {
    "c": "c_header.TARGET", "mujoco": "mjcf.TARGET", "mujoco-frictionloss": "mjcf.FRICTIONLOSS", "fmu": "fmu.TARGET",
    "urdf": "axes.URDF", "sdf": "axes.SDF", "isaac": "coulomb_viscous.ISAAC", "json": "json_document.TARGET", "matlab": "matlab.TARGET",
    "latex": "latex.TARGET",
}  # fmt: skip  # module, loaded when it is needed, and name of each target
TARGETS = tuple(_PLACES)  # in the order of docs/export.md


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
        """Write the file, by default with the joint's name; returns its path.

        Raises InputError where another file is there, or it cannot be written.
        """
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
    joints = joints if chosen.loaded else [x.without_load() for x in joints]
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
