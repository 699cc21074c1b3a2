"""The document `results.json`, schema bristle-results/1, as pydantic models; extra keys are allowed where it is read."""

from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, FailFast, Field

T = TypeVar("T")

Bound = float | Literal["inf", "-inf"]
"""An infinite bound is a string: JSON has no infinity."""

Rows = Annotated[list[T], FailFast()]
"""A list whose first wrong item is told: a foreign file may have a million."""


class ParameterJson(BaseModel):
    """One parameter."""

    value: float | None
    unit: str
    standard_error: float | None
    interval: tuple[Bound, Bound] | None
    doubts: Rows[str]


class UncertaintyJson(BaseModel):
    """One parameter's 95 % interval by covariance, profile and bootstrap; null where a way has none."""

    covariance: tuple[Bound, Bound] | None
    profile: tuple[Bound, Bound] | None
    bootstrap: tuple[Bound, Bound] | None
    doubts: Rows[str]


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
    doubts: Rows[str]
    hold_out: Rows[HoldOutJson]
    degrees_of_freedom: int
    free: Rows[str]
    covariance: Rows[Rows[float | None]]
    plain_grid: dict[str, float | None]
    huber: dict[str, float | None]
    without_stick_slip: dict[str, ParameterJson]
    uncertainty: dict[str, UncertaintyJson] = {}


class CrosscheckJson(BaseModel):
    """The full nonlinear fit beside the grid."""

    cost_grid: float | None
    cost_full: float | None
    starts: int
    reached: int
    parameters: dict[str, float | None]
    difference_in_se: dict[str, float | None]
    verdict: str
    doubts: Rows[str]


class LevelJson(BaseModel):
    """g0, the torque at which slow loading slides."""

    value: float | None
    standard_error: float | None
    source: str


class BiasJson(BaseModel):
    """Relative bias of (14) with this encoder: where rest lies on a count edge, and over rest positions anywhere in a count."""

    on_edge: float | None
    mean: float | None
    spread: float | None


class PreslidingJson(BaseModel):
    """sigma_0 of one direction by four methods, and sigma_1 by (15), a prior."""

    printed: ParameterJson
    corrected: ParameterJson
    edges: ParameterJson
    samples: ParameterJson
    sigma_1: ParameterJson
    recommended: str
    level: LevelJson
    quantum: float
    counts: int
    bias: BiasJson
    breakaway: ParameterJson | None
    doubts: Rows[str]
    uncertainty: dict[str, UncertaintyJson] = {}


class HysteresisJson(BaseModel):
    """One closed cycle of torque over displacement; loss in J."""

    file: str
    start: int
    stop: int
    loss: float
    secant: Bound
    slope: float
    inverse_slope: Bound
    counts: int


class TrackingJson(BaseModel):
    """All parameters from moving runs: their direction stands at the end of their name, as in `alpha_0+`; shared ones stand bare."""

    predicts: Literal["torque", "position"]
    parameters: dict[str, ParameterJson]
    rms: float | None
    relative_error: float | None
    n: int
    outcome: str
    doubts: Rows[str]
    hold_out: Rows[HoldOutJson]
    starts: int
    reached: int
    condition: Bound | None
    free: Rows[str]
    covariance: Rows[Rows[float | None]]
    count_bias: dict[str, float | None]
    crosscheck: CrosscheckJson | None
    uncertainty: dict[str, UncertaintyJson] = {}


class ConsistencyJson(BaseModel):
    """One parameter from its own stage, from the moving runs alone, and from all at once; what the moving runs do not show is null."""

    parameter: str
    stage: str
    stage_value: float | None
    stage_error: float | None
    tracking_value: float | None
    tracking_error: float | None
    joint_value: float | None
    joint_error: float | None
    difference_in_se: float | None
    verdict: str


class ModelJson(BaseModel):
    """One friction model beside others; aicc and bic above the lowest, hold_out in percent; null where it does not exist."""

    model: str
    directions: str
    parameters: int
    rms: float | None
    relative_error: float | None
    aicc: float | None
    bic: float | None
    hold_out: float | None
    candidate: bool
    recommended: bool


class ModelsJson(BaseModel):
    """Friction models side by side on the same equations."""

    data: Literal["points", "moving runs"]
    n: int
    effective: float
    hold_out_by: str
    rows: Rows[ModelJson]
    sentence: str
    left_out: Rows[str]


class SegmentJson(BaseModel):
    """One candidate for a velocity-torque point."""

    file: str
    start: int
    stop: int
    velocity: float | None
    torque: float | None
    standard_error: float | None
    accepted: bool
    reasons: Rows[str]
    doubts: Rows[str]
    stick_slip: bool
    labels: dict[str, str]


class JointJson(BaseModel):
    """One joint."""

    kind: Literal["revolute", "prismatic"]
    simulated: bool
    assumptions: Rows[str]
    settings: dict[str, str]
    doubts: Rows[str]
    truth: dict[str, dict[str, float | None]]
    static: dict[str, FitJson]
    crosscheck: dict[str, CrosscheckJson]
    presliding: dict[str, PreslidingJson]
    hysteresis: Rows[HysteresisJson]
    tracking: TrackingJson | None
    joint_fit: TrackingJson | None
    consistency: Rows[ConsistencyJson]
    models: Rows[ModelsJson] = []
    segments: Rows[SegmentJson]


class InputJson(BaseModel):
    """One file that went in."""

    joint: str
    file: str
    sha256: str
    rows: int
    dropped: int
    notes: Rows[str]
    labels: dict[str, str]


class ResultsJson(BaseModel):
    """What bristle identified."""

    schema_: Literal["bristle-results/1"] = Field(alias="schema")
    bristle: str
    inputs: Rows[InputJson]
    joints: dict[str, JointJson]
