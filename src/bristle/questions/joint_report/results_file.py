"""Results as JSON (schema bristle-results/3, generated from the result classes) and as a tidy table."""

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from bristle import __version__
from bristle.identification.document import schema_of
from bristle.identification.known_joint import Known, chosen, moving_estimates, moving_fits, stage_estimates
from bristle.identification.results import Document, Joint, WrittenExperiment, adapter
from bristle.identification.samples import samples_of

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = (
    "joint", "direction", "parameter", "value", "unit", "standard_error", "systematic", "lower", "upper", "warnings", "source",
)  # fmt: skip  # a row


def schema() -> dict[str, Any]:
    """The JSON schema of `results.json`; every field is required."""
    return schema_of(adapter(), "bristle-results/3")


def to_json(joints: Sequence[Joint], experiments: Sequence[WrittenExperiment] = ()) -> str:
    """`results.json` of schema bristle-results/3.

    Floats keep all digits. An open bound is "inf" or "-inf"; a missing value is null. Fields with an entry per sample
    are under `samples`.
    """
    document = Document(
        bristle=__version__,
        joints={joint.name: joint for joint in joints},
        experiments=tuple(experiments),
        samples={joint.name: samples_of(joint) for joint in joints},
    )
    return adapter().dump_json(document, indent=1).decode() + "\n"


def to_frame(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction, parameter and source: value, unit, standard_error, lower, upper, warnings.

    A missing value is nan, an open bound infinite. Where a constant has an error, there is `systematic`. With other fits
    than static ones, there are `source`, the stage of a row: `static`, `presliding`, `joint` (all runs at once) or
    `tracking` (moving runs alone); and `use`, whether a row has the value to use.
    """
    frame = estimates(joints)
    rows = [(joint.name, row) for joint in joints for row in chosen(joint)]
    used = {(name, str(row.source), row.parameter.name, str(row.parameter.direction)) for name, row in rows}
    keys = frame[["joint", "source", "parameter", "direction"]].itertuples(index=False, name=None)
    frame["use"] = [key in used for key in keys]
    return frame if (frame["source"] != "static").any() else frame.drop(columns=["source", "use"])


def estimates(joints: Sequence[Joint]) -> "pd.DataFrame":
    """The rows of `to_frame`, always with `source`."""
    rows = []
    for joint in joints:
        rows += [(joint, row) for row in stage_estimates(joint)]
        # The joint fit, or else that of the moving runs alone.
        for source in list(moving_fits(joint))[-1:]:
            rows += [(joint, row) for row in moving_estimates(joint, source)]
    return _framed(rows)


def identified(joints: Sequence[Joint]) -> "pd.DataFrame":
    """One row per joint, direction and parameter, by `known_joint.chosen`."""
    return _framed((joint, row) for joint in joints for row in chosen(joint))


def _framed(rows: Iterable[tuple[Joint, Known]]) -> "pd.DataFrame":
    import pandas as pd

    cells = []
    for joint, row in rows:
        e, (name, direction) = row.estimate, row.parameter
        lower, upper = (math.nan, math.nan) if e.interval is None else e.interval
        value, error, systematic = (math.nan if x is None else x for x in (e.value, e.standard_error, e.systematic))
        known = (value, e.unit, error, systematic, lower, upper, "; ".join(map(str, e.warnings)), str(row.source))
        cells.append((joint.name, str(direction), name, *known))
    return declared(pd.DataFrame(cells, columns=list(COLUMNS)))


def declared(frame: "pd.DataFrame") -> "pd.DataFrame":
    """The frame without its column `systematic` where no constant has an error."""
    return frame.drop(columns="systematic") if frame["systematic"].isna().all() else frame
