"""What a comparison reads of results files of schema bristle-results/1, which nothing writes any more."""

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, FailFast, Field

from bristle.arrays import JsonForm, Matrix
from bristle.diagnostics import Diagnostic, Kind
from bristle.identification.fits import Estimate
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import ParameterName

T = TypeVar("T")
Rows = Annotated[list[T], FailFast()]
"""A list whose first wrong item is told: a foreign file may have a million."""
_OUTCOMES = {"The fit did not converge; its numbers are not to be trusted.": Kind.NOT_CONVERGED}
"""Schema 1 has outcomes as sentences alone: those that count, as they were written then, whatever they are now."""


def _outcome(text: str) -> Diagnostic:
    return _OUTCOMES[text]() if text in _OUTCOMES else Kind.UNKNOWN(text=text)


class StaticFit1(BaseModel):
    """The fit of one direction."""

    parameters: dict[str, Estimate]
    degrees_of_freedom: int
    names: Rows[str] = Field(alias="free")
    covariance: Matrix


class MovingFit1(BaseModel):
    """All parameters from moving runs."""

    parameters: dict[ParameterName, Estimate]
    outcome: Annotated[Diagnostic, JsonForm(str, str, _outcome)]
    names: Rows[ParameterName] = Field(alias="free")
    covariance: Matrix


class PreslidingFit1(BaseModel):
    """sigma_0 of one direction, by the two methods that may be recommended."""

    edges: Estimate
    samples: Estimate
    recommended: str


class Joint1(BaseModel):
    """One joint."""

    kind: JointKind
    simulated: bool
    static: dict[str, StaticFit1]
    presliding: dict[str, PreslidingFit1]
    tracking: MovingFit1 | None
    joint_fit: MovingFit1 | None


class Input1(BaseModel):
    """One file that went in."""

    joint: str
    sha256: str


class Results1(BaseModel):
    """What bristle identified."""

    schema_: Literal["bristle-results/1"] = Field(alias="schema")
    inputs: Rows[Input1]
    joints: dict[str, Joint1]
