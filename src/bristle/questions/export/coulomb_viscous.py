"""Targets with Coulomb and viscous friction only: the best values along a motion, and their losses."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from bristle.errors import one_line
from bristle.model.parameters import unit
from bristle.page.wording import number
from bristle.questions.export.artefact import Artefact, ExportTarget, Request, artefact_of, notes
from bristle.questions.export.exported import ExportedJoint
from bristle.questions.export.loss import Loss, StatedMotion, all_motions, best_coulomb_viscous, coulomb_viscous, losses
from bristle.questions.export.xml_edit import XmlDocument, model_read


@dataclass(frozen=True, slots=True, kw_only=True)
class CoulombViscous:
    """The best values for one joint along a motion, N*m and N*m*s/rad."""

    joint: ExportedJoint
    motion: StatedMotion
    coulomb: float
    viscous: float
    losses: tuple[Loss, ...]


def best_values(joints: Sequence[ExportedJoint], request: Request, target: str) -> tuple[CoulombViscous, ...]:
    """The best values of each joint along the requested motion. Raises InputError as `in_newton`."""
    found = []
    for joint in (joint.in_newton(target) for joint in joints):
        motions = all_motions(joint, request.amplitude, request.frequency)
        coulomb, viscous = best_coulomb_viscous(joint, motions[0])
        lost = losses(joint, coulomb_viscous(coulomb, viscous), motions)
        found.append(CoulombViscous(joint=joint, motion=motions[0], coulomb=coulomb, viscous=viscous, losses=lost))
    return tuple(found)


def target_of(
    name: str,
    ending: str,
    holds: str,
    new: Callable[[Sequence[CoulombViscous]], bytes],
    merge: Callable[[XmlDocument, CoulombViscous], None] | None = None,
    model: tuple[str, str] = ("", ""),
    *,
    armature: bool = False,
) -> ExportTarget:
    """A target with the best values, which include v abs(v); other arguments as of `artefact_of`.

    `new` makes a file of them; `merge` puts those of a joint into a `model`, of this kind and root element.
    """

    def write(joints: Sequence[ExportedJoint], request: Request) -> Artefact:
        """The artefact. Raises InputError as `in_newton`, and where the model to merge into lacks the joint."""
        found = best_values(joints, request, name)
        if request.into is None or merge is None:
            content = new(found)
        else:
            document = model_read(request.into, request.into_name, *model)
            for one in found:
                merge(document, one)
            content = document.written()
        lost = {one.joint.name: one.losses for one in found}
        return artefact_of(joints, name, ending, content, holds, lost, counted=("quadratic",), armature=armature)

    return ExportTarget(write=write, fitted=True, merges=merge is not None)


def comment_lines(one: CoulombViscous, holds: str) -> Iterator[str]:
    """Lines of the comment beside the values."""
    kind, motion = one.joint.kind, one.motion
    yield (
        f"bristle: Coulomb {number(one.coulomb)} {unit('torque', kind)}, viscous {number(one.viscous)} {unit('alpha_2', kind)}: the least "
        f"squared torque error along a sine of {number(motion.amplitude)} {unit('position', kind)} at {motion.frequency:g} Hz"
    )
    yield one_line(holds)
    yield from map(one_line, notes(one.joint, one.losses))
