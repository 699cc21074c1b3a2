"""The document `results.json`, schema bristle-results/1, as pydantic models; extra keys are allowed where it is read."""

from typing import Literal

from pydantic import BaseModel, Field

Bound = float | Literal["inf", "-inf"]
"""An infinite bound is a string: JSON has no infinity."""


class ParameterJson(BaseModel):
    """One parameter."""

    value: float | None
    unit: str
    standard_error: float | None
    interval: tuple[Bound, Bound] | None
    doubts: list[str]


class HoldOutJson(BaseModel):
    """One hold-out run; relative_error in percent."""

    file: str
    relative_error: float | None


class FitJson(BaseModel):
    """The fit of one direction."""

    parameters: dict[str, ParameterJson]
    rms: float | None
    relative_error: float | None
    n: int
    outcome: str
    doubts: list[str]
    hold_out: list[HoldOutJson]
    degrees_of_freedom: int
    free: list[str]
    covariance: list[list[float | None]]
    plain_grid: dict[str, float | None]
    huber: dict[str, float | None]
    without_stick_slip: dict[str, ParameterJson]


class CrosscheckJson(BaseModel):
    """The full nonlinear fit beside the grid."""

    cost_grid: float | None
    cost_full: float | None
    starts: int
    reached: int
    parameters: dict[str, float | None]
    difference_in_se: dict[str, float | None]
    verdict: str
    doubts: list[str]


class SegmentJson(BaseModel):
    """One candidate for a velocity-torque point."""

    file: str
    start: int
    stop: int
    velocity: float | None
    torque: float | None
    standard_error: float | None
    accepted: bool
    reasons: list[str]
    doubts: list[str]
    stick_slip: bool
    labels: dict[str, str]


class JointJson(BaseModel):
    """One joint."""

    kind: Literal["revolute", "prismatic"]
    simulated: bool
    assumptions: list[str]
    settings: dict[str, str]
    doubts: list[str]
    truth: dict[str, dict[str, float]]
    static: dict[str, FitJson]
    crosscheck: dict[str, CrosscheckJson]
    segments: list[SegmentJson]


class InputJson(BaseModel):
    """One file that went in."""

    joint: str
    file: str
    sha256: str
    rows: int
    dropped: int
    notes: list[str]
    labels: dict[str, str]


class ResultsJson(BaseModel):
    """What bristle identified."""

    schema_: Literal["bristle-results/1"] = Field(alias="schema")
    bristle: str
    inputs: list[InputJson]
    joints: dict[str, JointJson]
