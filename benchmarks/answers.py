"""Compares the numbers of two report folders one by one, to tell whether a change of the code changed an answer.

    python benchmarks/answers.py OLD NEW

OLD and NEW each hold a results.json, tables, or both. Every number of either is looked up in the other by its place. Allowed are, by what the number
is: an estimate 1e-4 of its standard error where it is linear in the data for given v_s (static fits, sigma_0 by edges), 1e-2 where it is iterated;
the ends of an interval by covariance 1e-3 and 1e-2 of its width, by profile 1e-2, by bootstrap nothing (the draws are the same); a table 1e-4;
whatever has no standard error 1e-6, all relative. A finding is its code and its severity, in any order; messages are not compared.

Ends with 1 where a number differs by more, or stands on one side only.
"""

import json
import math
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

PLACES = 40
"""Differences that are printed."""
_UNCOMPARED = {"schema", "bristle", "seconds"}
_TEXTS = {"warnings", "reasons", "notes", "verdict", "sentence", "finding"}
"""Columns of tables that hold messages."""
_INTERVALS = {"interval", "covariance", "profile", "bootstrap"}


class Difference(NamedTuple):
    """One number that is not the same."""

    place: str
    first: Any
    second: Any
    share: float
    """Of what is allowed."""


def numbers(document: Any, place: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Every value of a JSON document with its place; of a finding code and severity, as schema 2 has them too."""
    if isinstance(document, dict) and "severity" in document:
        code = str(document.get("code", document.get("kind"))).lower().replace("_", "-")
        yield place, f"{code} ({document['severity']})"
    elif isinstance(document, dict):
        for key, value in document.items():
            if key not in _UNCOMPARED:
                yield from numbers(value, (*place, str(key)))
    elif isinstance(document, list):
        said = [x for x in document if isinstance(x, dict) and "severity" in x]
        if said:
            yield place, ", ".join(sorted(x for item in said for _, x in numbers(item)))
            return
        for index, value in enumerate(document):
            yield from numbers(value, (*place, str(index)))
    else:
        yield place, document


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
    old, new = dict(numbers(first)), dict(numbers(second))
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
    """The same of all tables of both folders, messages apart."""
    found: list[Difference] = []
    count = 0
    for name in sorted({x.name for folder in (first, second) for x in (folder / "tables").glob("*.csv")}):
        pair = [folder / "tables" / name for folder in (first, second)]
        one, two = (pd.read_csv(path) if path.exists() else pd.DataFrame() for path in pair)
        if one.shape != two.shape or list(one) != list(two):
            found.append(Difference(name, one.shape, two.shape, math.inf))
            continue
        for column in (x for x in one if x not in _TEXTS | _UNCOMPARED):
            count += len(one)
            for row, (a, b) in enumerate(zip(one[column], two[column], strict=True)):
                same = a == b or (pd.isna(a) and pd.isna(b))
                number = not same and all(isinstance(x, int | float) and not isinstance(x, bool) for x in (a, b))
                share = abs(a - b) / (1e-4 * max(abs(a), abs(b))) if number else math.inf
                if not same and share > 1:
                    found.append(Difference(f"{name}/{column}/{row}", a, b, share))
    return count, found


def main() -> None:
    """Print what differs, and how many numbers do not."""
    first, second = map(Path, sys.argv[1:])
    results = [folder / "results.json" for folder in (first, second)]
    old, new = (json.loads(path.read_text(encoding="utf-8")) if path.exists() else {} for path in results)
    count, found = compared(old, new)
    more, beyond = tables(first, second)
    found += beyond
    for x in found[:PLACES]:
        share = "" if math.isinf(x.share) else f", {x.share:.3g} times what is allowed"
        print(f"{x.place}: {x.first} -> {x.second}{share}")
    where = Counter(x.place.partition("/")[0] for x in found)
    print(
        f"{count + more} values compared, {len(found)} differ by more than is allowed{f': {dict(where)}' if found else ''}"
    )
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
