"""What the checks of all targets share."""

from collections.abc import Mapping, Sequence

from bristle.errors import short, short_list
from bristle.page.wording import counted
from bristle.questions.export.coulomb_viscous import CoulombViscous
from bristle.questions.export.xml_edit import XmlDocument, attribute

Values = Mapping[str, tuple[float, float]]
"""Damping and friction, N*m*s/rad and N*m, by the joint's name."""


class Failed(str):
    """A line of a check that found an artefact wrong."""

    __slots__ = ()


def told_by(holds: bool, line: str, otherwise: str) -> str:
    """A line of a check, or what stands in its place where that does not hold."""
    return line if holds else Failed(otherwise)


class NotInstalled(Exception):  # noqa: N818  # no error: a check that cannot be made here
    """Why an artefact cannot be tried on this machine, and what to install."""


def as_read(name: str) -> str:
    """A name as a reader of XML has it once it is written: what XML cannot hold is replaced."""
    return XmlDocument.read(f"<_ n={attribute(name)}/>".encode(), "a name").root.attributes["n"]


def expected_values(found: Sequence[CoulombViscous]) -> Values:
    """What a reader of the XML must find, by the names that it has for the joints."""
    return {as_read(one.joint.name): (one.viscous, one.coulomb) for one in found}


def compared(who: str, held: Values, expected: Values) -> str:
    """A line: whether these joints have the values that were exported."""
    wrong = [name for name, values in expected.items() if held.get(name) != values]
    if wrong:
        return Failed(f"{who}: damping and friction are NOT as exported in {short_list(map(short, wrong))}")
    return f"{who}: damping and friction are as exported, to the last bit, in {counted(len(expected), 'joint')}"
