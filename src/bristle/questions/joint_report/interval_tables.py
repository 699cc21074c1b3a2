"""Every interval three ways - covariance, profile, bootstrap - as one table."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import pandas as pd

from bristle.identification.fits import Estimate, Uncertainty
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName
from bristle.page.columns import shown
from bristle.page.wording import FITS, span

WAYS = ("covariance", "profile", "bootstrap")


class Row(NamedTuple):
    """One parameter of one fit."""

    fit: str
    """`static`, `presliding`, `tracking` or `joint`."""
    direction: str
    parameter: str
    estimate: Estimate
    three: Uncertainty


def rows(joint: Joint) -> Iterator[Row]:
    """Every parameter whose interval is known three ways, fit by fit."""
    for d, static in joint.static.items():
        yield from (Row("static", d, name, static.parameters[name], u) for name, u in static.uncertainty.items())
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        yield from (Row("presliding", d, name, slow.sigma_0, u) for name, u in slow.uncertainty.items())
    for kind, moving in moving_fits(joint).items():
        yield from (Row(kind, n.direction, n.name, moving.parameters[n], u) for n, u in moving.uncertainty.items())


def uncertainty(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit and parameter: the value, and lower and upper end by each way; nan where a way has none."""
    ends = [f"{way}_{end}" for way in WAYS for end in ("lower", "upper")]
    found = [
        (
            joint.name, x.fit, x.direction, x.parameter, x.estimate.value, x.estimate.unit,
            *(end for way in WAYS for end in getattr(x.three, way) or (None, None)), " ".join(map(str, x.three.warnings)),
        )
        for joint in joints
        for x in rows(joint)
    ]  # fmt: skip  # one row, one line
    columns = ["joint", "fit", "direction", "parameter", "value", "unit", *ends, "warnings"]
    return pd.DataFrame(found, columns=columns).astype(dict.fromkeys(["value", *ends], float))


def interval_section(joint: Joint) -> dict[str, Any]:
    """What the template names: a table per fit with each interval in one cell, by the fit's name, and which fits have none."""
    columns = ["parameter", "value", *WAYS, "unit", "warnings"]
    found: dict[str, list[tuple[Any, ...]]] = {}
    for x in rows(joint):
        name = str(ParameterName(x.parameter, Direction(x.direction)))
        ends = (span(getattr(x.three, way)) for way in WAYS)
        cells = (name, x.estimate.value, *ends, x.estimate.unit, " ".join(map(str, x.three.warnings)))
        found.setdefault(FITS.get(x.fit, x.fit), []).append(cells)
    tables = {fit: shown(pd.DataFrame(own, columns=columns)) for fit, own in found.items()}
    return {
        "tables": tables,
        "missing": [FITS[kind] for kind, fit in moving_fits(joint).items() if not fit.uncertainty],
    }
