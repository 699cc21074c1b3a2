"""The page of a trial: results -> tables, figures by name, and what the template names."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from bristle.identification.static.grid import PLAIN_GRID
from bristle.model.parameters import unit
from bristle.page.columns import Table, shown
from bristle.page.page import write_part
from bristle.page.wording import pretty, slugs
from bristle.questions.method_validation import figures
from bristle.questions.method_validation.intervals import BOOTSTRAPPED, COVERED
from bristle.questions.method_validation.results import FREE, SAME, Trial, Tried
from bristle.questions.method_validation.run import LOCAL, REFINED
from bristle.questions.method_validation.solvers import LMFIT, NAMES
from bristle.questions.method_validation.verdict import overall, verdict


def write_trial(trial: Trial, folder: Path) -> Path:
    """Write a trial as a page with figures and tables; returns the path of index.html. Raises as `write_page` does."""
    drawn, names = figures.showcase(trial), _names(trial)
    draw: dict[str, Any] = {
        "resolution": (lambda: figures.resolution_figure(trial), "error of the plain grid over its resolution")
    }
    for name, tried in zip(names, drawn, strict=True):
        label = tried.case.label
        draw[f"{name}-cost"] = (
            lambda t=tried: figures.landscape_figure(t, trial.subject.kind),
            f"cost over v_s of {label}",
        )
        draw[f"{name}-starts"] = (
            lambda t=tried: figures.starts_figure(t, trial.subject.kind),
            f"success over start of {label}",
        )
        draw[f"{name}-methods"] = (lambda t=tried: figures.methods_figure(t), f"v_s by each method of {label}")
    frames = {
        "cases": cases(trial),
        "methods": methods(trial),
        "coverage": coverage(trial),
        "resolution": resolution(trial),
    }
    return write_part(
        folder, "bristle.questions.method_validation", "trial.html", section(trial, drawn, names), draw, frames
    )


def text(trial: Trial, *, each: bool) -> Iterator[str]:
    """What the command line prints, a line each; with the verdict on `each` case, where these are few."""
    for direction, why in trial.subject.skipped.items():
        yield f"{trial.subject.title} {direction}: {why}"
    for one in trial.cases if each else ():
        yield f"{one.case.label}, SIMULATED, {one.case.design}, noise {one.case.noise:.3g}:"
        yield from (f"  {sentence}" for sentence in verdict(one))
    yield from overall(trial)


def section(trial: Trial, drawn: Any, names: list[str]) -> dict[str, Any]:
    """Everything that the template names."""
    own = [
        {
            "name": name,
            "case": tried.case,
            "noise": f"{tried.case.noise:.3g} {pretty(unit('torque', trial.subject.kind))}",
            "verdict": verdict(tried),
            "methods": _methods_of(tried),
        }
        for name, tried in zip(names, drawn, strict=True)
    ]
    return {
        "title": trial.subject.title,
        "seed": trial.seed,
        "trial": trial,
        "overall": overall(trial),
        "own": own,
        "cases": _rounded(_short(cases(trial))),
        "coverage": _rounded(_short(coverage(trial))),
        "local": min(LOCAL, trial.repetitions),
        "covered": min(COVERED, trial.repetitions),
        "bootstrapped": min(BOOTSTRAPPED, trial.repetitions),
        "lmfit": LMFIT,
        "same": f"{SAME:g}",
        "plain": PLAIN_GRID,
    }


def cases(trial: Trial) -> pd.DataFrame:
    """One row per case: what was simulated, and how local solvers and the plain grid did."""
    return pd.DataFrame([_case(tried) for tried in trial.cases])


def _case(tried: Tried) -> dict[str, object]:
    solvers = [name for name in tried.starts.ended if name != FREE]
    r = tried.resolution
    return {
        **_which(tried),
        "declined_percent": 100 * tried.declined,
        **{f"{name} elsewhere_percent": 100 * float(tried.starts.elsewhere(name).mean()) for name in solvers},
        "lower_beyond_percent": 100 * float(tried.beyond.mean()),
        "ipopt_lead": max(tried.beaten, 0.0),
        f"plain_{PLAIN_GRID}_error_percent": None if tried.blind else 100 * r.share(PLAIN_GRID),
        "values_needed": None if tried.blind or r.enough is None else str(r.enough),
    }


def methods(trial: Trial) -> pd.DataFrame:
    """One row per case, method and parameter."""
    rows = [
        {
            **_which(tried),
            "method": m.name,
            "repetitions": m.repetitions,
            "parameter": name,
            "truth": float(tried.case.theta[k]),
            "bias": float(m.bias[k]),
            "spread": float(m.spread[k]),
            "coverage_percent": 100 * float(m.coverage[k]),
            "failed_percent": 100 * m.failed,
            "elsewhere_percent": None if m.elsewhere is None else 100 * m.elsewhere,
            "seconds": m.seconds,
        }
        for tried in trial.cases
        for m in tried.methods.values()
        for k, name in enumerate(NAMES)
    ]
    return pd.DataFrame(rows)


def coverage(trial: Trial) -> pd.DataFrame:
    """One row per case and kind of interval: how often it covers, percent, by parameter."""
    rows = [
        {**_which(t), "interval": c.kind, "repetitions": c.repetitions}
        | {f"{name}_percent": 100 * float(x) for name, x in zip(NAMES, c.share, strict=True)}
        for t in trial.cases
        for c in t.coverage
    ]
    return pd.DataFrame(rows)


def resolution(trial: Trial) -> pd.DataFrame:
    """One row per case and plain grid: its error of v_s, and the statistical one."""
    rows = [
        {**_which(t), "values": n, "error": float(e), "floor": t.resolution.floor}
        for t in trial.cases
        for n, e in zip(t.resolution.counts, t.resolution.error, strict=True)
    ]
    return pd.DataFrame(rows)


def _which(tried: Tried) -> dict[str, object]:
    case = tried.case
    return {"of": case.label, "design": case.design, "noise_percent": 100 * case.noise / case.truth.alpha_0}


def _methods_of(tried: Tried) -> Table:
    """The methods of one case as the page shows them: v_s relative to the truth, and times over the refined grid's."""
    v_s, base = tried.case.truth.v_s, tried.methods[REFINED].seconds
    rows = [
        {
            "way": m.name,
            "sets": m.repetitions,
            "bias of v_s (%)": 100 * float(m.bias[3]) / v_s,
            "spread of v_s (%)": 100 * float(m.spread[3]) / v_s,
            **{f"covers {name} (%)": 100 * float(x) for name, x in zip(NAMES, m.coverage, strict=True)},
            "fails (%)": 100 * m.failed,
            "elsewhere (%)": None if m.elsewhere is None else 100 * m.elsewhere,
            "ms": 1e3 * m.seconds,
            "over refined": m.seconds / base,
        }
        for m in tried.methods.values()
    ]
    return _rounded(pd.DataFrame(rows))


def _short(frame: pd.DataFrame) -> pd.DataFrame:
    """The table of cases under the page's names."""
    return frame.rename(columns=lambda c: c.replace("_percent", " (%)").replace("_", " "))


def _rounded(frame: pd.DataFrame) -> Table:
    """Numbers to three digits, as text that stays a number."""
    columns = frame.select_dtypes("float").columns
    frame[columns] = frame[columns].map(lambda x: float(f"{x:.3g}"))
    return shown(frame.astype(object).where(frame.notna(), None))


def _names(trial: Trial) -> list[str]:
    return slugs(
        [
            f"{t.case.label} {t.case.design}".replace("(+)", "plus").replace("(-)", "minus")
            for t in figures.showcase(trial)
        ]
    )
