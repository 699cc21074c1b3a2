"""Every interval three ways - covariance, profile, bootstrap - as one table; and how the runs scatter beside them."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import pandas as pd

from bristle.identification.fits import Estimate, RunScatter, Uncertainty
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName
from bristle.page.plain import columns, interval
from bristle.page.wording import FITS, printable

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


def interval_lines(joints: Sequence[Joint]) -> Iterator[str]:
    """Each parameter's 95 % interval three ways, fit by fit, and the warnings about them, each once."""
    for joint in joints:
        by_fit: dict[str, list[Row]] = {}
        for row in rows(joint):
            by_fit.setdefault(row.fit, []).append(row)
        for fit, own in by_fit.items():
            yield f"{printable(joint.name)}, {FITS.get(fit, fit)}: 95 % intervals"
            for si in dict.fromkeys(x.estimate.unit for x in own):
                yield from columns([(si, *WAYS), *(_three_ways(x) for x in own if x.estimate.unit == si)], indent=0)
            said = {w: ParameterName(x.parameter, Direction(x.direction)) for x in own for w in x.three.warnings}
            yield from (f"  {name}: {printable(warning.flagged)}" for warning, name in said.items())


def _three_ways(row: Row) -> tuple[str, ...]:
    ends = (interval(getattr(row.three, way)) for way in WAYS)
    return str(ParameterName(row.parameter, Direction(row.direction))), *ends


def repeats(joints: Sequence[Joint]) -> pd.DataFrame:
    """One row per fit, parameter and run that was fitted apart: its estimate, and the scatter of all of them.

    `before` and `after` are sqrt(chi2_red) before and after widening, `widened` what the standard error is multiplied by.
    """
    found = [
        (joint.name, kind, d, name, file, value, x.before, x.after, x.widened)
        for joint in joints
        for kind, d, name, x in scatter(joint)
        for file, value in x.by_run.items()
    ]
    numbers = ["value", "before", "after", "widened"]
    columns = ["joint", "fit", "direction", "parameter", "file", *numbers]
    return pd.DataFrame(found, columns=columns).astype(dict.fromkeys(numbers, float))


def scatter(joint: Joint) -> Iterator[tuple[str, str, str, RunScatter]]:
    """Fit, direction and parameter, and how far it scatters over the runs."""
    for d, static in joint.static.items():
        yield from (("static", d, name, x) for name, x in static.repeats.items())
    for d, slow in (joint.presliding.fits if joint.presliding else {}).items():
        yield from (("presliding", d, name, x) for name, x in slow.repeats.items())
    for kind, moving in moving_fits(joint).items():
        yield from ((kind, n.direction, n.name, x) for n, x in moving.repeats.items())
