"""Results of moving runs as tables: both fits, their hold-out runs, how the stages agree, and all parameters in one table."""

from collections.abc import Sequence

import pandas as pd

from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import ParameterName
from bristle.questions.joint_report.frame import identified, with_truth


def table_1(joints: Sequence[Joint]) -> pd.DataFrame:
    """All parameters per direction, as in the paper's Table 1, each by the stage to use, with the truth where the data are simulated."""
    frame = with_truth(identified(joints), joints, 8)
    frame.insert(len(frame.columns) - 2, "source", frame.pop("source"))
    return frame


def tracking(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter, with the truth where the data are simulated, and what encoder counts had added."""
    columns = ["joint", "fit", "direction", "parameter", "value", "unit", "standard_error", "lower", "upper"]
    rows = [
        (joint.name, kind, name.direction, name.name, e.value, e.unit, e.standard_error, *(e.interval or (None, None)), fit.count_bias.get(name))
        for joint in joints
        for kind, fit in moving_fits(joint).items()
        for name, e in fit.parameters.items()
    ]  # fmt: skip  # one row, one line
    numbers = ["value", "standard_error", "lower", "upper", "count_bias"]
    frame = pd.DataFrame(rows, columns=[*columns, "count_bias"]).astype(dict.fromkeys(numbers, float))
    return with_truth(frame, joints, len(columns))


def tracking_hold_out(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and hold-out run: relative error of the prediction, and of the fit on its own data, percent."""
    rows = [
        (joint.name, kind, held.file, held.relative_error, fit.relative_error)
        for joint in joints
        for kind, fit in moving_fits(joint).items()
        for held in fit.hold_out
    ]
    return pd.DataFrame(rows, columns=["joint", "fit", "file", "relative_error", "relative_error_of_fit"])


def consistency(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per parameter that a stage of its own knows: that stage, the moving runs alone, the joint fit, and what follows."""
    numbers = ["stage_value", "stage_error", "tracking_value", "tracking_error", "joint_value", "joint_error"]
    rows = [
        (
            joint.name, x.parameter.direction, x.parameter.name, x.stage, *(getattr(x, name) for name in numbers),
            _unit(joint, x.parameter), x.difference_in_se, x.verdict,
        )
        for joint in joints
        for x in joint.consistency
    ]  # fmt: skip  # as above
    columns = ["joint", "direction", "parameter", "stage", *numbers, "unit", "difference_in_se", "verdict"]
    return pd.DataFrame(rows, columns=columns).astype(dict.fromkeys([*numbers, "difference_in_se"], float))


def _unit(joint: Joint, name: ParameterName) -> str:
    return next((fit.parameters[name].unit for fit in moving_fits(joint).values() if name in fit.parameters), "")
