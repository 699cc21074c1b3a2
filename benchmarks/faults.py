"""What a user reads of logs with a physical fault: the first line and the first reason, `python benchmarks/faults.py`.

Each fault of `faulty_logs.py` is put into SIMULATED logs, at two strengths and over seeds of its own. bristle is silent
where it says `use` and its curve is more than 10 % off the true one (RMS over the speeds, as in `calibration.py`). Where
it does not say `use`, its first reason is right if its code names the fault, and honest if it says that a pattern of
unknown cause is left; each fault lists its codes. A refusal is a sentence of bristle's own, and right where it has words
that the fault lists. Beside them stand clean controls: of how many nothing above a note is said about the values.

    python benchmarks/faults.py [--seeds 5] [--controls 200] [--only NAME] [--jobs 2] [--csv FILE]

`--only clean` runs the controls alone.
"""

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import bristle
from bristle.errors import InputError
from bristle.identification.curve import known_curve
from bristle.identification.verdict import value_warnings, verdict
from faulty_logs import CLEAN, FAULTS, UNSEEN, Log, curve, speeds

OFF = 10.0
"""%, of the curve: beyond it `use` is silence."""


class Case(NamedTuple):
    """A log with a fault, or a clean one: what it is called, with which seed and strength."""

    name: str
    seed: int
    strength: float | None = None


def drafted(log: Log, folder: Path) -> str:
    """A log as CSV, with the columns that its experiment logs, and the experiment file that is drafted of it."""
    names, paths = {"points": ("v", "tau")}, []
    for k, x in enumerate(x for x in (log, log.beside) if x is not None):
        columns = {"t": x.t, "q": x.q, "v": x.v, "tau": x.torque}
        moving = ("t", "q", "v", "tau")[0 if x.rate is None else 1 :]
        own = names.get(x.kind, moving if x.velocity_logged else tuple(name for name in moving if name != "v"))
        units = {"t": "s", "q": "rad", "v": "rad/s", "tau": "N*m"}
        header = ",".join(f"{name} [{units[name]}]" for name in own)
        paths.append(folder / f"log{k}.csv")
        table = np.stack([columns[name] for name in own], axis=1)
        np.savetxt(paths[-1], table, "%.9g", ",", header=header, comments="")
    told = bristle.Told(rate=None if log.rate is None else f"{log.rate} Hz")
    return bristle.draft(*paths, told=told)[0] + log.more


def tried(case: Case) -> dict[str, Any]:
    """What is said of one case, and how far its curve is off, %."""
    row: dict[str, Any] = case._asdict() | {"error": np.nan, "serious": ""}
    if case.strength is None:
        clean = log = CLEAN[case.name](case.seed)
        named_by: tuple[str, ...] = ()
    else:
        fault = {**FAULTS, **UNSEEN}[case.name]
        clean, named_by = fault.make(case.seed), fault.named_by
        log = fault.change(clean, case.strength)
    with tempfile.TemporaryDirectory() as place:
        file = Path(place) / "e.yaml"
        try:
            file.write_text(drafted(log, Path(place)))
            (joint,) = bristle.identify(file).joints
        except InputError as refusal:
            sentence = str(refusal)
            named = any(words in sentence for words in named_by)
            return row | {"trust": "refused", "code": sentence.replace(place, "")[:160], "named": named}
    found, v = verdict(joint), speeds(clean)
    code = found.reason.code if found.reason else ""
    true = curve(log, v)
    with suppress(InputError):  # no curve
        row["error"] = 100 * float(np.sqrt(np.mean((known_curve(joint, v)[0] - true) ** 2) / np.mean(true**2)))
    serious = dict.fromkeys(w.code for w in value_warnings(joint))
    row |= {"band": np.nan if joint.accuracy is None else joint.accuracy.band, "serious": " ".join(serious)}
    return row | {"trust": str(found.trust), "code": code, "named": code in named_by}


def main() -> None:
    """Try every case; print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--controls", type=int, default=200)
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--csv", type=Path, help="a row per case")
    asked = parser.parse_args()
    every = {**FAULTS, **UNSEEN}
    cases = [
        Case(name, seed, s)
        for name in every
        if asked.only in name
        for s in every[name].strengths
        for seed in range(asked.seeds)
    ]
    each = asked.controls // len(CLEAN)
    cases += [Case(name, 1000 + k) for name in CLEAN if asked.only in f"clean {name}" for k in range(each)]
    with ProcessPoolExecutor(asked.jobs, mp_context=get_context("spawn")) as pool:
        frame = pd.DataFrame(pool.map(tried, cases))
    if asked.csv is not None:
        frame.to_csv(asked.csv, index=False)
    frame["use"] = frame.trust == "use"
    frame["silent"] = frame.use & (frame.error > OFF)
    frame["honest"] = frame.code.isin({"lacks-unknown-term", "unexplained"})
    print(f"{len(frame)} SIMULATED logs")
    faulty, clean = frame[frame.name.isin(FAULTS)], frame[frame.strength.isna()]
    for title, part in (("faults", faulty), ("what no such data could show", frame[frame.name.isin(UNSEEN)])):
        if len(part):
            print(
                f"\n{title}\n{pd.DataFrame({n: of_fault(x) for n, x in part.groupby('name', sort=False)}).T.to_string()}"
            )
    others = faulty[~faulty.use]
    print(
        f"\nfaults: silent {faulty.silent.sum()} of {len(faulty)}; of {len(others)} that are not `use`, the first reason names"
    )
    print(
        f"{others.named.mean():.1%}, and says that a pattern of unknown cause is left in {(others.honest & ~others.named).mean():.1%}"
    )
    if len(clean):
        table = {name: of_clean(x) for name, x in (*clean.groupby("name", sort=False), ("all", clean))}
        print(f"\nclean controls\n{pd.DataFrame(table).T.to_string()}")


def of_fault(part: pd.DataFrame) -> "pd.Series[Any]":
    """Counts of one fault."""
    codes = part.code[~part.use].str.slice(0, 40).value_counts().head(3)
    counts = {name: int(part[name].sum()) for name in ("use", "silent", "named")}
    reasons = ", ".join(f"{code} {n}" for code, n in codes.items())
    return pd.Series(
        {"logs": len(part), **counts, "error": round(float(part.error.median()), 1), "first reasons": reasons}
    )


def of_clean(part: pd.DataFrame) -> "pd.Series[Any]":
    """Counts of clean logs."""
    codes = part.serious.str.split().explode().value_counts().head(4)
    quiet = f"{(part.serious == '').mean():.1%}"
    counts = {"logs": len(part), "use": int(part.use.sum()), "silent": int(part.silent.sum()), "quiet": quiet}
    return pd.Series(counts | {"findings above a note": ", ".join(f"{code} {n}" for code, n in codes.items())})


if __name__ == "__main__":
    main()
