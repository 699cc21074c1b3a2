"""From where to where the explorer's sliders go."""

from collections.abc import Mapping, Sequence
from typing import Any

from bristle.arrays import to_bound
from bristle.model import functions
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import fields_of, least_of
from bristle.model.vectorize import evaluate

_PIECES = {"alpha_0": 4.0, "v_s": 10.0, "sigma_0": 10.0}
"""Sliders that are logarithmic, and up to what factor of the identified value they go."""
_TIMES = 4.0
"""Up to how many times the identified value the other sliders go, from zero, or to both sides of it."""


def ranges(law: Law, sets: Sequence[Mapping[str, float | None]], fastest: float) -> dict[str, dict[str, Any]]:
    """Of each slider its ends, what the parameter may be at least, and whether it goes by the logarithm; as JSON.

    What else shapes a peak goes as far as it is searched. The fastest measured speed is given and has no slider.

    Args:
        law: of the friction.
        sets: the values that sliders are to show, both directions.
        fastest: measured speed, rad/s.
    """
    names = [name for name in fields_of(law) if name != FASTEST]
    rows = {name: [x for p in sets if (x := p[name]) is not None] for name in names}
    searched = {own.name: own.searched for own in law.peak.own}
    # What a parameter of one makes at that speed, of those that may be zero: that of others is no measure.
    columns = evaluate(functions.linear_shapes_function(law), fastest)
    named = zip(("alpha_0", "alpha_2", *law.coefficients), columns, strict=True)
    torques = {"alpha_1": 1.0} | {name: float(x) for name, x in named}
    found: dict[str, dict[str, Any]] = {}
    for name, values in rows.items():
        positive, least = [x for x in values if x > 0], least_of(name)
        if name in searched:
            ends = [*searched[name], *positive]
            own = {"low": min(ends), "high": max(ends), "log": True}
        elif name in _PIECES and positive:
            by = _PIECES[name]
            own = {"low": min(positive) / by, "high": max(positive) * by, "log": True}
        else:
            size = max(map(abs, values)) or max(rows["alpha_0"]) / torques.get(name, fastest)
            own = {"low": max(least, -_TIMES * size), "high": _TIMES * size, "log": False}
        found[name] = own | {"least": to_bound(least)}
    return found
