"""An export as `bristle.export` returns it: it says what is lost, and writes its file."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
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
from bristle.questions.export.targets import target


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
        """What the file holds."""
        return self.artefact.content

    def text(self) -> str:
        """What the target holds, what is lost, and what must be known of the values; as `bristle export` prints it."""
        return "\n".join(_lines(self)) + "\n"

    def __str__(self) -> str:
        return self.text()

    def write(self, path: Path | str | None = None) -> Path:
        """Write the file; by default as the joint is called, where one is. Returns its path.

        Raises InputError where another file is there already, or it cannot be written; nothing is half-written.
        """
        path = Path(self.artefact.name if path is None else path)
        write_bytes(path, self.content)
        return path


def export_joints(
    joints: Sequence[ExportedJoint], to: str, request: Request, refused: tuple[Finding, ...] = ()
) -> Export:
    """The joints as a target takes them; of several those that it takes, the others being named beside the `refused` ones.

    Raises InputError where the target is unknown, holds one joint and several are given, merges into nothing, or a joint lacks what it needs.
    """
    chosen = target(to)
    joints = joints if chosen.loaded else [x.without_load() for x in joints]
    if chosen.single and len(joints) > 1:
        raise InputError(
            f"{to} holds one joint, and the results have {len(joints)}: say which with joint, one of {', '.join(x.name for x in joints)}"
        )
    if not chosen.fitted and (request.amplitude or request.frequency):
        raise InputError(f"{to} has no values that are fitted along a motion; leave amplitude and frequency out")
    if len({unit("position", x.kind) for x in joints}) > 1 and request.amplitude:
        raise InputError("amplitude: got one for joints that turn and joints that slide; say which joint with joint")
    if request.into is not None and not chosen.merges:
        raise InputError(f"into: {to} is written as a file of its own; leave into out")
    kept, left_out = _takes(chosen, joints, request) if len(joints) > 1 else (tuple(joints), ())
    artefact = chosen.write(kept, request)
    return Export(
        to=to, joints=kept, request=request, artefact=replace(artefact, said=(*refused, *left_out, *artefact.said))
    )


def joint_left_out(error: InputError) -> Finding:
    """Of one of several joints, that it is not exported, and why."""
    return Finding("export-joint-left-out", CAUTION, f"Left out: {error}", {"why": str(error)})


def _takes(
    chosen: ExportTarget, joints: Sequence[ExportedJoint], request: Request
) -> tuple[tuple[ExportedJoint, ...], tuple[Finding, ...]]:
    """Of several joints those that a target takes, and why not the others. Raises InputError where it takes none."""
    kept, left_out = [], []
    for joint in joints:
        try:
            chosen.write([joint], request)
            kept.append(joint)
        except InputError as error:
            left_out.append(joint_left_out(error))
    if not kept:
        chosen.write(joints[:1], request)
    return tuple(kept), tuple(left_out)


def _lines(export: Export) -> Iterator[str]:
    names = ", ".join(joint.name for joint in export.joints)
    yield f"Export to {export.to}: {names}"
    yield f"  holds: {export.artefact.holds}"
    for joint in export.joints:
        if joint.simulated:
            yield f"  {joint.name}: identified from SIMULATED data"
        if joint.law_name != GAUSSIAN.name:
            yield f"  {joint.name}: friction law {joint.law_name}"
        if joint.trust is not Trust.USE:
            yield f"  {joint.name}: {joint.trust}" + (f": {joint.reason}" if joint.reason else "")
        if found := export.artefact.losses.get(joint.name):
            yield f"  torque RMS error of {joint.name}: {told(found, joint)}"
        for said in joint.said:
            yield f"  {said.severity}: {joint.name}: {said.flagged}"
    for said in export.artefact.said:
        yield f"  {said.severity}: {said.flagged}"
