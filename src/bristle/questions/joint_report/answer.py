"""What the first screen of a report says: of each joint the values to use, whether to trust them, and why not."""

from collections.abc import Mapping, Sequence
from typing import Any

from bristle.identification.fits import Estimate
from bristle.identification.known_joint import Known, chosen
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import SIGNED, Direction, ParameterName, fields_of, in_direction, of_friction
from bristle.page.page import Drawn
from bristle.page.plain import in_unit
from bristle.page.wording import FITS, direction, in_symbols, measured, pretty, span, symbol
from bristle.questions.joint_report.brief import law_in_force
from bristle.questions.joint_report.sentences import known_to

_WORDS = {
    Trust.USE: ("use", "use"),
    Trust.DO_NOT_USE: ("do not use", "no"),
}

_NONE = "n.i."
"""In place of a value that the data do not identify."""


def answer(
    joints: Sequence[Joint], slugs: Sequence[str], about: Mapping[str, str], curves: Mapping[str, Drawn]
) -> dict[str, Any]:
    """What the template names: columns (parameter, unit where all joints have one), and a row a joint with a line a direction.

    Args:
        joints: as the report has them.
        slugs: one each.
        about: what compensation is worth, by joint; none where it was not simulated.
        curves: a small picture of each joint's curve, by joint.
    """
    names = tuple(dict.fromkeys(n for joint in joints for n in fields_of(joint.law) if n != FASTEST))
    known = {joint.name: {row.parameter: row for row in chosen(joint)} for joint in joints}
    units = {
        name: {pretty(row.estimate.unit) for rows in known.values() for p, row in rows.items() if p.name == name}
        for name in names
    }
    shared = {name: next(iter(own)) for name, own in units.items() if len(own) == 1}
    rows = [
        {
            "source": _source(known[joint.name]),
            "name": joint.name,
            "slug": slug,
            "simulated": joint.simulated,
            "directions": _directions(known[joint.name], joint.law, names, shared),
            "about": about.get(joint.name),
            "also": _also(known[joint.name]),
            "law": "".join(law_in_force(joint)).removeprefix("  law: "),
            "curve": curves.get(joint.name),
            **trusted(joint),
        }
        for joint, slug in zip(joints, slugs, strict=True)
    ]
    columns = [(name, "" if shared.get(name) == "1" else shared.get(name, "")) for name in names]
    labels = [f"{symbol(name)} ({unit})" if unit else symbol(name) for name, unit in columns]
    cells = [cell for row in rows for _, own in row["directions"] for cell in own]
    return {
        "columns": columns,
        "labels": labels,
        "joints": rows,
        "open": any(c["value"] == _NONE for c in cells),
        "loaded": any(joint.law_name != joint.law.name for joint in joints),
        "other_law": any(joint.law != GAUSSIAN for joint in joints),
    }


def trusted(joint: Joint) -> dict[str, Any]:
    """Whether to trust a joint's values, in words and as a class of the style sheet, and the one reason why not."""
    found = verdict(joint)
    word, css = _WORDS[found.trust]
    return {"trust": {"word": word, "css": css}, "reason": found.reason, "known": known_to(joint)}


def _directions(
    rows: Mapping[ParameterName, Known], law: Law, names: Sequence[str], shared: Mapping[str, str]
) -> list[tuple[str, list[dict[str, str]]]]:
    """A line a direction: the cells of some parameters, empty where the joint's law has none of that name."""
    found = [d for d in (*SIGNED, Direction.BOTH) if any(p.direction == d for p in rows if of_friction(p.name))]
    signed = [d for d in found if d in SIGNED] or found
    return [
        (
            "+/−" if d == Direction.BOTH else direction(d).strip("()"),
            [_cell(in_direction(rows, n, d), shared) if n in fields_of(law) else _BLANK for n in names],
        )
        for d in signed
    ]


def _source(rows: Mapping[ParameterName, Known]) -> str:
    """Where all values come from; empty where they come from several stages, and each cell says it."""
    found = {row.source for row in rows.values() if row.estimate.value is not None and of_friction(row.parameter.name)}
    return FITS.get(only, only) if len(found) == 1 and (only := found.pop()) else ""


_BLANK = {"value": "", "unit": "", "ends": "", "source": ""}


def _cell(row: Known | None, shared: Mapping[str, str]) -> dict[str, str]:
    if row is None or row.estimate.value is None:
        return {"value": _NONE, "unit": "", "ends": "", "source": ""}
    e = row.estimate
    unit = "" if shared.get(row.parameter.name) else pretty(e.unit)
    return {"value": _value(e), "unit": unit, "ends": span(e.interval), "source": FITS.get(row.source, row.source)}


def _value(e: Estimate) -> str:
    return measured(e.value, e.total_error)


def _also(rows: Mapping[ParameterName, Known]) -> str:
    """What was identified beside friction, such as the inertia."""
    told = [row for p, row in rows.items() if not of_friction(p.name) and row.estimate.value is not None]
    return ", ".join(
        f"{in_symbols(str(row.parameter.name)).replace('_', ' ')} {in_unit(_value(row.estimate), pretty(row.estimate.unit))}"
        for row in told
    )
