"""Compares the numbers of two report folders one by one, to tell whether a change of the code changed an answer.

    python benchmarks/answers.py OLD NEW

OLD and NEW each hold a results.json, and perhaps tables of the compensation. Every number of either is looked up in the other by its place.
Where OLD is of schema 1 and NEW of schema 2, the old numbers are moved to their new places first, and what schema 2 alone has (positions and
times of segments, parameters held fixed, ...) is counted and not compared.
Allowed are, by what the number is: an estimate 1e-4 of its standard error where it is linear in the data for given v_s (static fits, and sigma_0 by
edges), 1e-2 where it is iterated; the ends of an interval by covariance 1e-3 and 1e-2 of its width, by profile 1e-2, by bootstrap nothing (the draws
are the same); a table of the compensation 1e-4; whatever has no standard error 1e-6, all relative. Sentences are counted, not compared.

Ends with 1 where a number differs by more, or stands on one side only.
"""

import json
import math
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

PLACES = 40
"""Differences that are printed."""
_SENTENCES = {"doubts", "warnings", "outcome", "verdict", "sentence", "notes", "advice", "level_source", "hold_out_by"}
_UNCOMPARED = {"schema", "bristle"}
_INTERVALS = {"interval", "covariance", "profile", "bootstrap"}


class Difference(NamedTuple):
    """One number that is not the same."""

    place: str
    first: Any
    second: Any
    share: float
    """Of what is allowed."""


def numbers(document: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every value of a JSON document with its place; of sentences, nothing but what stands before a colon."""
    if isinstance(document, dict) and {"kind", "text"} <= document.keys():
        yield place, document["text"].partition(":")[0]
    elif isinstance(document, dict):
        for key, value in document.items():
            if key not in _SENTENCES | _UNCOMPARED:
                yield from numbers(value, (*place, str(key)))
    elif isinstance(document, list):
        for index, value in enumerate(document):
            yield from numbers(value, (*place, str(index)))
    else:
        yield place, document.partition(":")[0] if isinstance(document, str) else document


def _renamed(fields: dict[str, Any], names: dict[str, str]) -> dict[str, Any]:
    return {names.get(name, name): value for name, value in fields.items()}


def _moving(fit: dict[str, Any] | None) -> dict[str, Any] | None:
    names = {"free": "names", "predicts": "quantity"}
    return fit and {k: x for k, x in _renamed(fit, names).items() if k != "crosscheck" or x is not None}


def _presliding(joint: dict[str, Any]) -> dict[str, Any] | None:
    """The presliding runs of a joint of schema 1."""
    fits, breakaway = {}, {}
    for d, fit in joint["presliding"].items():
        level, bias = fit["level"], {f"bias_{what}": x for what, x in fit["bias"].items()}
        own = {
            "level": level["value"],
            "level_standard_error": level["standard_error"],
            "level_source": level["source"],
        }
        fits[d] = {k: x for k, x in fit.items() if k not in {"level", "bias", "breakaway"}} | own | bias
        if fit["breakaway"]:
            breakaway[d] = fit["breakaway"]
    return {"fits": fits, "breakaway": breakaway, "loops": joint["hysteresis"]} if fits or joint["hysteresis"] else None


def _joint(name: str, joint: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    """A joint of schema 1 as schema 2 has it."""
    same = {k: x for k, x in joint.items() if k != "hysteresis"}
    checks = {
        d: check
        | {
            part: {name + d * (d in "+-"): x for name, x in check[part].items()}
            for part in ("parameters", "difference_in_se")
        }
        for d, check in joint["crosscheck"].items()
    }
    return same | {
        "name": name,
        "inputs": [{k: v for k, v in x.items() if k != "joint"} for x in document["inputs"] if x["joint"] == name],
        "static": {d: _renamed(fit, {"free": "names"}) for d, fit in joint["static"].items()},
        "crosscheck": checks,
        "presliding": _presliding(joint),
        "tracking": _moving(joint["tracking"]),
        "joint_fit": _moving(joint["joint_fit"]),
    }


def as_second(document: dict[str, Any]) -> dict[str, Any]:
    """A document of schema 1 with its numbers at their places in schema 2; one of schema 2 as it is."""
    if document["schema"] != "bristle-results/1":
        return document
    joints = {name: _joint(name, joint, document) for name, joint in document["joints"].items()}
    return {"schema": document["schema"], "bristle": document["bristle"], "joints": joints}


def _iterated(place: tuple[str, ...]) -> bool:
    return not {"static", "edges", "printed", "corrected"} & set(place)


def _scale(document: Any, place: tuple[str, ...]) -> tuple[float, float]:
    """What a difference at a place is divided by (0: by the number itself), and how much of that is allowed."""
    nodes = [document]
    for key in place:
        nodes.append(nodes[-1][int(key) if isinstance(nodes[-1], list) else key])
    owner = nodes[-2]
    if place[-1] == "value" and isinstance(owner, dict) and isinstance(owner.get("standard_error"), float):
        return owner["standard_error"], 1e-2 if _iterated(place) else 1e-4
    if (
        len(place) > 2
        and place[-2] in _INTERVALS
        and isinstance(owner, list)
        and len(owner) == 2
        and "free" not in place[-3:]
    ):
        ends = [float(x) for x in owner if x is not None]
        width = abs(ends[-1] - ends[0]) if len(ends) == 2 else math.inf
        loose = place[-2] == "profile" or _iterated(place)
        exact = place[-2] == "bootstrap"
        return (width if math.isfinite(width) else 0.0), 1e-9 if exact else 1e-2 if loose else 1e-3
    return 0.0, 1e-2 if _iterated(place) and {"joint_fit", "tracking", "consistency"} & set(place) else 1e-6


def compared(first: Any, second: Any) -> tuple[int, list[Difference]]:
    """How many numbers were compared, and those that differ by more than is allowed, the worst first."""
    old, new = dict(numbers(as_second(first))), dict(numbers(as_second(second)))
    if first["schema"] != second["schema"]:
        own = {place for place in new if place not in old}
        print(f"{len(own)} values stand in the newer schema alone: {dict(Counter(place[-1] for place in own))}")
        new = {place: value for place, value in new.items() if place in old}
    first = as_second(first)
    found = [
        Difference("/".join(p), old.get(p, "absent"), new.get(p, "absent"), math.inf) for p in old.keys() ^ new.keys()
    ]
    for place in old.keys() & new.keys():
        a, b = old[place], new[place]
        if a == b:
            continue
        if isinstance(a, bool) or isinstance(b, bool) or not all(isinstance(x, int | float) for x in (a, b)):
            found.append(Difference("/".join(place), a, b, math.inf))
            continue
        scale, allowed = _scale(first, place)
        share = abs(a - b) / ((scale or max(abs(a), abs(b))) * allowed)
        if not share <= 1:
            found.append(Difference("/".join(place), a, b, share))
    return len(old.keys() | new.keys()), sorted(found, key=lambda x: (-x.share, x.place))


def tables(first: Path, second: Path) -> tuple[int, list[Difference]]:
    """The same of the tables that only the compensation writes: Table 2, Fig. 8 and what goes beyond."""
    found: list[Difference] = []
    count = 0
    for name in ("table_2", "compensation_errors", "adaptation_map", "ablation", "controllers", "drift", "sampling"):
        pair = [folder / "tables" / f"{name}.csv" for folder in (first, second)]
        if not any(path.exists() for path in pair):
            continue
        one, two = (pd.read_csv(path) if path.exists() else pd.DataFrame() for path in pair)
        if one.shape != two.shape or list(one) != list(two):
            found.append(Difference(name, one.shape, two.shape, math.inf))
            continue
        count += one.size
        for column in one:
            for row, (a, b) in enumerate(zip(one[column], two[column], strict=True)):
                same = a == b or (pd.isna(a) and pd.isna(b))
                number = not same and all(isinstance(x, int | float) and not isinstance(x, bool) for x in (a, b))
                share = abs(a - b) / (1e-4 * max(abs(a), abs(b))) if number else math.inf
                if not same and share > 1:
                    found.append(Difference(f"{name}/{column}/{row}", a, b, share))
    return count, found


def _sentences(document: Any) -> int:
    text = json.dumps(document)
    return len(re.findall(r'"(?:doubts|warnings)": \[(?!\])', text))


def main() -> None:
    """Print what differs, and how many numbers do not."""
    first, second = map(Path, sys.argv[1:])
    old, new = (json.loads((folder / "results.json").read_text(encoding="utf-8")) for folder in (first, second))
    count, found = compared(old, new)
    more, beyond = tables(first, second)
    found += beyond
    for x in found[:PLACES]:
        share = "" if math.isinf(x.share) else f", {x.share:.3g} times what is allowed"
        print(f"{x.place}: {x.first} -> {x.second}{share}")
    where = Counter("/".join(x.place.split("/")[2:4]) for x in found)
    print(
        f"{count + more} values compared, {len(found)} differ by more than is allowed{': ' if found else ''}{dict(where) if found else ''}"
    )
    print(f"places with warnings: {_sentences(old)} and {_sentences(new)}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
