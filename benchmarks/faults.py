"""What bristle says of logs with a physical fault: whether it is right, warns, or is confident and wrong.

Each fault of `faulty_logs.py` is put into simulated logs, at two strengths and over seeds of its own. Every estimate that
has a value, of every fit, is held against the truth. Wrong is what lies more than three of its stated errors off (the
standard error, or a quarter of its 95 % interval where that is more). A wrong estimate is warned of where a warning is
critical or a caution, and
  - is about this estimate, or names it; or
  - is critical, and about its fit or about the joint and its signals as a whole; or
  - is a caution about these, of a kind that names the fault: each fault lists them.
A refusal counts where it is a sentence of bristle's own. Beside it stand clean controls.

    python benchmarks/faults.py [--seeds 5] [--controls 200] [--only NAME] [--jobs 2]

`--only clean` runs the controls alone.
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

import bristle
from bristle.errors import InputError
from bristle.findings import Finding, Severity
from bristle.identification.fits import Estimate
from bristle.identification.results import Joint
from bristle.model.parameters import Lugre, ParameterName
from faulty_logs import CLEAN, FAULTS, UNSEEN, Fault, J, Log

FLAT = {
    "no-stribeck", "static-no-stribeck", "unseen", "unseen-peak", "unseen-bend", "unseen-companion",
    "unseen-no-peak", "nothing-seen", "only-as-sum",
    "unseen-wide", "unseen-far", "only-sum-seen", "only-sum-seen-of-fit", "at-bound", "intervals-at-bound",
}  # fmt: skip  # a list
"""What says that alpha_1 or v_s is not identifiable."""
SERIOUS = {Severity.CRITICAL, Severity.CAUTION}


class Case(NamedTuple):
    """A log with a fault, or a clean one: what it is called, with which seed and strength."""

    name: str
    seed: int
    strength: float | None = None


class Verdict(NamedTuple):
    """What came of a case."""

    case: Case
    answer: str
    """`right`, `warned` or `silent`."""
    kinds: tuple[str, ...] = ()
    """That warned of what is wrong, or, of a clean log, of anything: severity and kind."""
    silent: tuple[str, ...] = ()
    errors: tuple[tuple[str, float], ...] = ()
    """Of a clean log: each standard error beside the truth, by fit and parameter."""
    withdrawn: tuple[str, ...] = ()
    """Of a clean log: parameters without a value."""


class Number(NamedTuple):
    """An estimate, its name, the fit that it is of, and the cautions and critical warnings about that fit."""

    fit: str
    name: str
    estimate: Estimate
    of_fit: tuple[Finding, ...]

    @property
    def bare(self) -> str:
        """Its name without a direction."""
        return ParameterName.parse(self.name).name


def identified(log: Log, folder: Path) -> Joint | str:
    """What bristle makes of a log by default, or the sentence by which it refuses it."""
    logs = [x for x in (log, log.beside) if x is not None]
    time = "{column: t, unit: s}" if log.rate is None else f"{{rate: {log.rate} Hz}}"
    runs, lines = "", []
    for k, x in enumerate(logs):
        write(x, folder / f"log{k}.csv")
        runs += f"  - {{files: log{k}.csv, experiment: {x.kind}}}\n"
    if log.kind != "points":
        lines += [f"  time: {time}", "  position: {column: q, unit: rad}"]
    if log.kind == "points" or log.velocity_logged:
        lines += ["  velocity: {column: v, unit: rad/s}"]
    signals = "\n".join([*lines, "  torque: {column: tau, unit: N*m}"])
    (folder / "e.yaml").write_text(
        f"joint: {{name: a}}\nsignals:\n{signals}\nruns:\n{runs}fit: {{{log.fit}}}\n{log.more}"
    )
    try:
        return bristle.identify(folder / "e.yaml").joints[0]
    except InputError as refusal:
        return str(refusal)


def write(log: Log, path: Path) -> None:
    """A log as a file."""
    columns = {"t": log.t, "q": log.q, "v": log.v, "tau": log.torque}
    np.savetxt(path, np.stack(list(columns.values()), axis=1), "%.9g", ",", header=",".join(columns), comments="")


def numbers(joint: Joint) -> Iterator[Number]:
    """Every estimate of every fit."""
    for d, static in joint.static.items():
        for bare, e in static.parameters.items():
            yield Number(f"static {d}", f"{bare}{d}" if d in {"+", "-"} else bare, e, static.warnings)
    for fit in (joint.tracking, joint.joint_fit):
        for name, e in fit.parameters.items() if fit else ():
            yield Number("moving" if fit is joint.tracking else "joint fit", str(name), e, fit.warnings if fit else ())
    slow = joint.presliding
    for d, one in slow.fits.items() if slow else ():
        yield Number("slow", f"sigma_0{d}", one.sigma_0, (*one.warnings, *(slow.warnings if slow else ())))
    for d, e in slow.breakaway.items() if slow else ():
        yield Number("slow", f"breakaway{d}", e, slow.warnings if slow else ())


def true_values(truth: Lugre[float]) -> dict[str, float]:
    """By the names of estimates; what a clean log does not have is zero."""
    return {**truth._asdict(), "inertia": J, "breakaway": truth.alpha_0 + truth.alpha_1, "offset": 0.0}


def stated_error(e: Estimate) -> float:
    """The standard error, or a quarter of the 95 % interval where that is more."""
    width = (e.interval[1] - e.interval[0]) / 4 if e.interval is not None else 0.0
    return max(e.standard_error or 0.0, width)


def is_wrong(number: Number, true: dict[str, float]) -> bool:
    """Whether an estimate has a value that lies more than three of its errors off."""
    value = number.estimate.value
    return (
        value is not None and number.bare in true and abs(value - true[number.bare]) > 3 * stated_error(number.estimate)
    )


def warns(w: Finding, number: Number, named_by: tuple[str, ...]) -> bool:
    """Whether a warning about the fit or the whole joint is about this estimate: critical, or it names the fault, or the number."""
    texts = str(list(w.numbers.values()))
    named = any(f"'{name}'" in texts for name in (number.name, number.bare))
    return w.severity is Severity.CRITICAL or (w.severity is Severity.CAUTION and (w.code in named_by or named))


def judged(joint: Joint, truth: Lugre[float], named_by: tuple[str, ...]) -> tuple[set[str], list[str]]:
    """The kinds that warn of wrong estimates, and the wrong estimates of which none does."""
    true, kinds, silent = true_values(truth), set[str](), []
    whole = (*joint.warnings, *(w for s in joint.segments if s.accepted for w in s.warnings))
    for number in numbers(joint):
        e = number.estimate
        if not is_wrong(number, true):
            continue
        said = {w.code for w in e.warnings if w.severity in SERIOUS}
        said |= {w.code for w in (*whole, *number.of_fit) if warns(w, number, named_by)}
        kinds |= said
        if not said:
            silent.append(
                f"{number.fit} {number.name} {e.value:.3g} +/- {stated_error(e):.2g} (true {true[number.bare]:.3g})"
            )
    return kinds, silent


def tried(case: Case) -> Verdict:
    """One case."""
    with tempfile.TemporaryDirectory() as folder:
        if case.strength is None:
            return controlled(case, CLEAN[case.name](case.seed), Path(folder))
        fault = {**FAULTS, **UNSEEN}[case.name]
        log = fault.change(fault.make(case.seed), case.strength)
        joint = identified(log, Path(folder))
    if isinstance(joint, str):
        return Verdict(case, "warned", ("refused",))
    kinds, silent = judged(joint, log.truth, fault.named_by)
    return Verdict(case, "silent" if silent else "warned" if kinds else "right", tuple(sorted(kinds)), tuple(silent))


def controlled(case: Case, log: Log, folder: Path) -> Verdict:
    """A clean log: what is falsely warned of, withdrawn or missed, and its errors.

    A warning is true where an estimate of its stage is wrong, or says of a joint without a Stribeck effect that it shows
    none, or of one that is not passive that it is not.
    """
    joint = identified(log, folder)
    if isinstance(joint, str):
        return Verdict(case, "silent", ("critical refused",), (joint,))
    true, every = true_values(log.truth), list(numbers(joint))
    flat = {"alpha_1", "v_s"} if not log.truth.alpha_1 else set()
    wrong = {x.fit.split()[0] for x in every if is_wrong(x, true)}
    said = {str(w): w for w in joint.all_warnings() if w.severity in SERIOUS}
    feeds_back = log.truth.sigma_1 * log.truth.alpha_1 > log.truth.alpha_0 * log.truth.alpha_2
    true_kinds = (FLAT if flat else set()) | ({"not-passive"} if feeds_back else set())
    false = [w for w in said.values() if stage(w) not in wrong and w.code not in true_kinds]
    _, silent = judged(joint, log.truth, ())
    names = {x.name for x in every if true.get(x.bare) and x.bare not in flat}
    return Verdict(
        case,
        "silent" if silent else "right",
        tuple(f"{w.severity} {w.code} of {stage(w) or 'the joint'}" for w in false),
        tuple(silent),
        tuple(
            (f"{x.fit} {x.name}", e / true[x.bare])
            for x in every
            if true.get(x.bare) and (e := x.estimate.standard_error)
        ),
        tuple(sorted(names - {x.name for x in every if x.estimate.value is not None})),
    )


def stage(w: Finding) -> str:
    """The stage that a warning is about, as fits are called here; empty: the joint."""
    called = {"static": "static", "moving runs": "moving", "joint fit": "joint", "presliding": "slow"}
    return called.get(w.subject[0], "") if w.subject else ""


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--controls", type=int, default=200)
    parser.add_argument("--only", default="")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.jobs) as pool:
        total = Counter[str]()
        print(f"{'fault':<40} {'right':>6} {'warned':>6} {'silent':>6}  warned by (confident and wrong)")
        for name in (x for x in FAULTS if asked.only in x):
            total += shown(name, FAULTS[name], asked.seeds, pool)
        print(f"{len(FAULTS)} faults: {', '.join(f'{total[x]} {x}' for x in ('right', 'warned', 'silent'))}")
        print("what no such data could show (not counted):")
        for name in (x for x in UNSEEN if asked.only in x):
            shown(name, UNSEEN[name], asked.seeds, pool)
        kinds = [x for x in CLEAN if asked.only in f"clean {x}"]
        each = asked.controls // len(CLEAN)
        if kinds and each:
            clean([Case(name, 1000 + k) for name in kinds for k in range(each)], pool)


def shown(name: str, fault: Fault, seeds: int, pool: ProcessPoolExecutor) -> Counter[str]:
    """Print one fault's row; its counts."""
    cases = [Case(name, seed, s) for s in fault.strengths for seed in range(seeds)]
    verdicts = list(pool.map(tried, cases))
    count = Counter(x.answer for x in verdicts)
    kinds = Counter(kind for x in verdicts for kind in x.kinds)
    wrong = [f"{x.silent[0]} at {x.case.strength:g}, seed {x.case.seed}" for x in verdicts if x.silent]
    words = ", ".join(f"{kind} {n}" for kind, n in kinds.most_common(4))
    print(f"{name:<40} {count['right']:>6} {count['warned']:>6} {count['silent']:>6}  {words}", flush=True)
    for text in wrong[:4]:
        print(f"{'':<62}({text})", flush=True)
    return count


def clean(cases: list[Case], pool: ProcessPoolExecutor) -> None:
    """Print how often clean logs are falsely warned of, withdrawn from or missed, and the errors that they get."""
    every = list(pool.map(tried, cases))
    print(
        f"{'clean controls':<24} {'joints':>6} {'critical':>8} {'cautions a joint':>16} {'withdrawn':>9} {'silent':>6}"
    )
    for name in (*dict.fromkeys(x.case.name for x in every), "all"):
        verdicts = [x for x in every if name in {x.case.name, "all"}]
        criticals = sum(any(k.startswith("critical") for k in x.kinds) for x in verdicts)
        kinds = Counter(k for x in verdicts for k in x.kinds)
        cautions = sum(n for kind, n in kinds.items() if kind.startswith("caution")) / len(verdicts)
        withdrawn, silent = (
            sum(bool(x) for x in found) for found in zip(*((v.withdrawn, v.silent) for v in verdicts), strict=True)
        )
        print(f"{name:<24} {len(verdicts):>6} {criticals:>8} {cautions:>16.2f} {withdrawn:>9} {silent:>6}")
        if name == "all":
            break
        print("    " + (", ".join(f"{kind} {n}" for kind, n in kinds.most_common()) or "no warning"))
        for x in [v for v in verdicts if v.silent or v.withdrawn][:5]:
            print(
                f"    {x.case.seed}: {'; '.join(x.silent)}{' withdrawn: ' if x.withdrawn else ''}{', '.join(x.withdrawn)}"
            )
        errors = {key: [e for x in verdicts for k, e in x.errors if k == key] for x in verdicts for key, _ in x.errors}
        shown = ", ".join(
            f"{key} {100 * float(np.median(e)):.2g}" for key, e in errors.items() if not key.startswith("static shared")
        )
        print(f"    standard error in % of the truth, median: {shown}")


if __name__ == "__main__":
    main()
