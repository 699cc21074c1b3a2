"""A box of friction parameters: one interval for each that is drawn, the others held; and joints at points of it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.findings import CAUTION, Finding
from bristle.identification.fits import Estimate
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import (
    Direction,
    Pair,
    ParameterName,
    estimated_of,
    in_direction,
    is_positive,
    is_possible,
    least_of,
    lugre_of,
    of_friction,
)

DECADE = 10.0
"""An interval whose ends have a larger ratio is drawn log-uniformly."""
_SMALL = 0.01
"""Where the interval of a positive parameter reaches zero, the box begins at this share of its value."""


class Span(NamedTuple):
    """The interval from which one parameter is drawn."""

    parameter: ParameterName
    low: float
    high: float
    logarithmic: bool
    """Whether its logarithm is uniform, else itself."""

    def at(self, share: Array) -> Array:
        """The values at shares 0 to 1 of the way from low to high, in the logarithm where that is uniform."""
        if self.logarithmic:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


def spans_of(box: Mapping[ParameterName, tuple[float, float]]) -> tuple[Span, ...]:
    """The intervals of a box, in its order. Raises InputError where it is empty or one of them is not an interval."""
    if not box:
        raise InputError("box is empty; expected at least one parameter with its interval")
    for name, (low, high) in box.items():
        if not (np.isfinite([low, high]).all() and low < high):
            raise InputError(
                f"box: {name}: got [{low:g}, {high:g}]; expected finite numbers, low < high: "
                "leave out what is to stay as it is"
            )
    return tuple(Span(name, low, high, low > 0 and high > DECADE * low) for name, (low, high) in box.items())


def ordered(box: Mapping[ParameterName, tuple[float, float]], law: Law) -> tuple[Span, ...]:
    """The intervals in the order of the law's tuple, whatever the order of the box, so that this does not change the samples.

    They are of the law's parameters, of both directions at once or of one.

    Raises InputError where a name or an interval cannot be.
    """
    directions = (Direction.BOTH, Direction.POSITIVE, Direction.NEGATIVE)
    known = [ParameterName(name, d) for name in estimated_of(law) for d in directions]
    for name, (low, _) in box.items():
        whole = name._replace(direction=Direction.BOTH)
        if name not in known or (name != whole and whole in box):
            raise InputError(
                f"box: got {str(name)!r} among {', '.join(map(str, box))}; expected {', '.join(estimated_of(law))}, "
                "each for both directions, or with + and - for one"
            )
        if not is_possible(name.name, low):
            raise InputError(f"box: {name}: got a low end of {low:g}; expected a physical value, not below zero")
    return spans_of({name: box[name] for name in known if name in box})


def joints_at(pair: Pair[float], spans: Sequence[Span], points: Array) -> Pair[Array]:
    """Both sets of the joint at each point, each parameter (n,); points (n, p), one column for each of the spans."""
    drawn = {span.parameter: column for span, column in zip(spans, points.T, strict=True)}
    return Pair(
        *(
            lugre_of(pair.law)(
                *(
                    np.full(len(points), x) if (own := in_direction(drawn, name, d)) is None else own
                    for name, x in p._asdict().items()
                )
            )
            for d, p in zip("+-", pair, strict=True)
        )
    )


def box_of(
    estimates: Mapping[ParameterName, Estimate],
) -> tuple[dict[ParameterName, tuple[float, float]], tuple[Finding, ...]]:
    """The box of the 95 % intervals of friction parameters, and a diagnostic on each that is left out or cut.

    Parameters that are not of friction, or not estimated, are left out, and so are those without a finite interval, with
    a diagnostic. An interval is cut at its physical bound, with a diagnostic.
    """
    box: dict[ParameterName, tuple[float, float]] = {}
    notes = []
    for name, e in estimates.items():
        bare = name.name
        least = least_of(bare)
        if not of_friction(bare) or bare == FASTEST or e.value is None:
            continue
        if e.interval is None or not np.isfinite(e.interval).all() or not max(e.interval[0], least) < e.interval[1]:
            message = f"{name}: no finite 95 % interval; it is held at {e.value:.3g} {e.unit}."
            notes.append(Finding("box-held", CAUTION, message, {"name": name, "value": e.value}))
            continue
        low, high = e.interval
        if not is_possible(bare, low):
            low = _SMALL * min(e.value, high) if is_positive(bare) else least
            message = (
                f"{name}: its interval includes impossible values; it is drawn from {low:.3g} {e.unit} up (assumed)."
            )
            notes.append(Finding("box-cut", CAUTION, message, {"name": name, "low": low}))
        box[name] = (low, high)
    return box, tuple(notes)
