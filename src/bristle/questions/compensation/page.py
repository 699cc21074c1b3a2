"""The page of the compensated joint, and the section that it is on the embedded report."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.known_joint import SEED
from bristle.model.parameters import unit
from bristle.page.columns import Table, shown
from bristle.page.page import Drawing, Drawn, Templated, begun, drawn, tables_of, versions, write_page
from bristle.page.wording import in_print, number, pretty, symbol
from bristle.questions.compensation import figures, paper_experiments, tables
from bristle.questions.compensation.replay import Replay
from bristle.questions.compensation.study import Study
from bristle.workers import Share

_PACKAGE = "bristle.questions.compensation"
_WORSE = 1.1
_BEYOND = 3.0
"""v_s at which the gradients of the laws are told apart: the Stribeck term is gone there."""
_MOST_REPLAYS = 6
"""Replays drawn; the table has all."""


def write_adaptation(study: Study, folder: Path) -> Path:
    """Write the compensated joint as a page of its own: index.html, figures/ and tables/; returns the path of index.html. Raises as `write_page`."""
    files = tables_of(tables.all_tables(study))
    figures = drawn(drawings(study), files)
    return write_page(folder, _PACKAGE, "adapt.html", {**versions(SEED), **_compensation(study, figures)}, files)


def section(study: Study, share: Share = map) -> Templated:
    """The compensated joint as a page of the embedded report, its figures drawn by whoever shares the work."""
    return Templated(
        drawings={name: begun(x, share) for name, x in drawings(study).items()},
        context=partial(_compensation, study),
        package=_PACKAGE,
        template="adapt.html",
        files=tables_of(tables.all_tables(study)),
        about=dict(_worth_of_each(study)),
        adverse=tuple(_adverse(study)),
    )


def _as_good(study: Study) -> Iterator[Finding]:
    """Where the steady curve compensates as well as LuGre: the motion shows little of the bristle."""
    finest, first = max(row.bits for row in study.ablation), study.loops[0]
    best = (row for row in study.ablation if (row.bits, row.delay, row.share) == (finest, 0, 1.0) and not row.diverges)
    rms = {row.compensator: row.rms for row in best}
    stribeck, lugre = (rms.get(f"{name}, reference velocity") for name in ("Stribeck", "LuGre"))
    if stribeck and lugre and stribeck <= _WORSE * lugre:
        message = (
            f"The Stribeck curve compensates {first.name} as well as LuGre does on this motion: RMS error {1e3 * stribeck:.3g} and "
            f"{1e3 * lugre:.3g} {_milli(study)}, both driven by the reference velocity, with the finest encoder and no delay."
        )
        numbers = {"joint": first.name, "stribeck": 1e3 * stribeck, "lugre": 1e3 * lugre}
        yield Finding("stribeck-as-good", NOTE, message, numbers)


def _worth_of_each(study: Study) -> Iterator[tuple[str, str]]:
    """Per joint the RMS error of its slowest sine without and with the identified model."""
    for row in reversed(study.errors):  # the first of a joint is its slowest, and stays
        if not row.inertia:
            without, fed = (f"{1e3 * x:.3g} {_milli(study)}" for x in (row.without, row.identified))
            error = f"RMS position error (SIMULATED) at {row.frequency:g} Hz"
            yield row.joint, f"{error}: {without} without compensation, {fed} with"


def _adverse(study: Study) -> Iterator[Finding]:
    """Where adaptation leaves a larger error than the identified model alone does, by a tenth or more."""
    for row in study.errors:
        if row.adaptive > _WORSE * row.identified and not row.inertia:
            identified, adaptive, q = 1e3 * row.identified, 1e3 * row.adaptive, _milli(study)
            worse = f"Adaptation makes {row.joint} worse at {row.frequency:g} Hz"
            message = f"{worse}: RMS error {identified:.3g} {q} with the identified model, {adaptive:.3g} {q} adapted."
            numbers = {"joint": row.joint, "frequency": row.frequency, "identified": identified, "adaptive": adaptive}
            yield Finding("adaptation-worse", CAUTION, message, numbers)


def _compensation(study: Study, figures: Mapping[str, Drawn]) -> dict[str, Any]:
    """What the template of the compensated joint names."""
    names = [loop.name for loop in study.loops]
    title = names[0] if len(names) == 1 else f"{len(names)} joints"
    shown = context(study) | {"figures": figures}
    return {"title": title, "simulated": study.loops[0].simulated, "compensation": shown}


def drawings(study: Study) -> dict[str, Drawing]:
    """Its figures, by name."""
    label = f"of {study.loops[0].name}, compensated"
    every = draw(study).items()
    return {kind: Drawing(partial(f, study), f"compensation-{kind}", f"{kind} {label}") for kind, f in every}


def draw(study: Study) -> dict[str, Callable[[Study], Figure | None]]:
    """What draws each figure, by name; the one that takes longest first."""
    drawn: dict[str, Callable[[Study], Figure | None]] = {
        "ablation": figures.ablation_figure,
        "followed": figures.followed_figure,
        "errors": figures.errors_figure,
        "gains": figures.gains_figure,
        "adapted": figures.adapted_figure,
        "landings": figures.adaptation_map_figure,
        "gradients": figures.gradients_figure,
        "band": figures.band_figure,
    }
    replays = range(min(len(study.replays), _MOST_REPLAYS))
    return drawn | {f"replay-{k + 1}": partial(figures.replay_figure, at=k) for k in replays}


def context(study: Study) -> dict[str, Any]:
    """Everything that the template of the compensated joint names."""
    loop, kind = study.loops[0], study.loops[0].kind
    replays = tables.replay(study)  # with parameters as symbols; names of files stay as they are
    replays = replays.assign(**{name: replays[name].map(in_print) for name in ("begun", "shares", "verdict")})
    return {
        "joint": loop,
        "paper": study.paper,
        "kind": kind,
        "unit": pretty(unit("position", kind)),
        "law": study.adapted.adaptation.law,
        "step": "" if study.adapting.adaptation.step == "gradient" else study.adapting.adaptation.step,
        "gamma": ", ".join(number(g, 3) for g in study.adapting.adaptation.gamma),
        "assumptions": loop.assumptions,
        "table_2": shown(tables.table_2(study)),
        "worth": in_print(_worth(study)),
        "ends": " and ".join(f"{x.final:.3f}" for x in study.adapted.factors if x.law == study.adapted.adaptation.law),
        "adverse": [*_adverse(study), *_as_good(study)],
        "ablated": in_print(_ablated(study)),
        "shown": _captions(study),
        "band": study.band,
        "band_rms": [f"{1e3 * x:.3g}" for x in (*study.band.rms, study.band.rms_actual)] if study.band else [],
        "band_systematic": [f"{1e3 * x:.3g}" for x in (study.band and study.band.rms_systematic) or ()],
        "replays": shown(replays) if study.replays else None,
        "drawn": [f"replay-{k + 1}" for k in range(min(len(study.replays), _MOST_REPLAYS))],
        "of_replay": [
            (x.file, f"{in_print(_start(x))}, by the {x.adaptation.law} law", in_print(x.verdict)) for x in study.replays[:_MOST_REPLAYS]
        ],
        **_tables(study),
    }  # fmt: skip  # a table


def _worth(study: Study) -> Finding:
    """What LuGre feed-forward does to the first error, in numbers: that of the slow reference, without inertia feed-forward."""
    row, q = study.errors[0], _milli(study)
    without, identified, percent = 1e3 * row.without, 1e3 * row.identified, 100 * row.identified / row.without
    numbers = {"joint": row.joint, "frequency": row.frequency, "without": without, "identified": identified}
    change = f"the RMS error of {row.joint} at {row.frequency:g} Hz from {without:.3g} {q} to {identified:.3g} {q} ({percent:.2g} %)."
    if row.identified < row.without:
        return Finding("error-reduced", NOTE, f"LuGre feed-forward reduces {change}", numbers)
    return Finding("error-increased", CAUTION, f"LuGre feed-forward increases {change}", numbers)


def _ablated(study: Study) -> Finding:
    """How many of the ablation's cases fail, by how."""
    rows = study.ablation
    cycling, leading = sum(x.limit_cycle for x in rows), sum(x.over_compensated for x in rows)
    diverging = sum(x.diverges for x in rows)
    message = f"{cycling} of {len(rows)} cases end in a limit cycle, {leading} over-compensate, {diverging} diverge."
    numbers = {"tried": len(rows), "cycling": cycling, "leading": leading, "diverging": diverging}
    return Finding("ablated", NOTE, message, numbers)


def _captions(study: Study) -> dict[str, str]:
    """What figures show, in a sentence with numbers, without its full stop, where no other words have it."""
    law, runs, loop = study.adapted.adaptation.law, study.adapted.runs, study.adapting
    settled = paper_experiments.SETTLE
    before, after = (
        f"{number(1e3 * float(runs[way].rms_error(settled)[0]), 3)} m{pretty(unit('position', loop.kind))}"
        for way in ("not adapted", law)
    )
    names = [symbol(name) for name in loop.adaptation.parameters]
    m = study.adaptation_map
    spans = []
    for k, name in enumerate(names):
        finite = [
            x for x in (*m.by_gamma[k].flat, *m.by_amplitude[k].flat) if np.isfinite(x)
        ]  # of loops that do not diverge
        ends = f"from {number(min(finite), 2)} to {number(max(finite), 2)}" if finite else "not finite"
        spans.append(f"{name} {ends}")
    v, found = study.gradients
    at = int(np.abs(v - _BEYOND * loop.plant.positive.v_s).argmin())
    told = ", ".join(f"{g[at]:.2g} by the {way} law" for way, g in found.items())
    return {
        "adapted": f"RMS position error after {settled:g} s: {before} not adapted, {after} adapted by the {law} law",
        "landings": f"Final ratios to the identified values: {', '.join(spans)}",
        "gradients": f"At {_BEYOND:g} vₛ the gradient of {names[0]} is {told}, relative to the largest of the total derivative",
    }


def _tables(study: Study) -> dict[str, Table]:
    """Tables under the words of the page, errors in thousandths."""
    q, T = (pretty(unit(name, study.loops[0].kind)) for name in ("position", "torque"))
    return {
        "errors": _table(
            tables.compensation_errors(study).drop(columns=["torque_without", "torque_with", "true_share"]),
            {
                "joint": "of", "frequency": "f (Hz)", "without": f"without (m{q})", "true_model": f"true (m{q})",
                "identified_model": f"identified (m{q})", "adaptive": f"adaptive (m{q})",
                "identified_share": "identified / without", "adaptive_share": "adaptive / without",
            },
            "without", "true_model", "identified_model", "adaptive",
        ),
        "drift": _table(
            tables.drift(study),
            {
                "joint": "of", "frequency": "frequency (Hz)", "rms_error": f"RMS error (m{q})", "over_known": "ratio to the known model",
                "largest_gain": "largest gain", "way": "scheme",
            },
            "rms_error",
        ),
        "ablation": _table(
            tables.ablation(study),
            {
                "encoder_bits": "encoder (bits)", "rms_error": f"RMS error (m{q})", "over_none": "ratio to uncompensated",
                "share": "compensated part", "chatter": f"chatter ({T}/s)", "limit_cycle": "limit cycle", "over_compensated": "over-compensated",
            },
            "rms_error",
        ),
        "controllers": _table(
            tables.controllers(study),
            {
                "rms_error": f"RMS error (m{q})", "peak_error": f"peak error (m{q})", "rms_torque": f"RMS control ({T})",
                "chatter": f"chatter ({T}/s)", "energy": "energy (J)",
            },
            "rms_error", "peak_error",
        ),
        "sampling": _table(
            tables.sampling(study), {"joint": "of", "period": "period (ms)", "distance": f"distance (m{q})"}, "period", "distance"
        ),
    }  # fmt: skip  # tables of words


def lines(study: Study) -> Iterator[str]:
    """The study in words, a line each."""
    yield from map(str, outcomes_of(study))
    for replay in study.replays:
        yield f"{replay.file}, {replay.adaptation.law} law, initialised at {_start(replay)}: {replay.verdict}"


def outcomes_of(study: Study) -> Iterator[Finding]:
    """What compensation does to each error without inertia feed-forward, and where each adapted parameter ends."""
    first, q = study.loops[0], _milli(study)
    for row in study.errors:
        if not row.inertia:
            without, identified, adaptive = 1e3 * row.without, 1e3 * row.identified, 1e3 * row.adaptive
            identified_percent, adaptive_percent = 100 * row.identified / row.without, 100 * row.adaptive / row.without
            message = (
                f"{row.joint}, {row.frequency:g} Hz: RMS error {without:.3g} {q} without, {identified:.3g} {q} "
                f"({identified_percent:.2g} %) with and {adaptive:.3g} {q} ({adaptive_percent:.2g} %) with adaptive compensation."
            )
            numbers = {
                "joint": row.joint, "frequency": row.frequency, "without": without, "unit": q, "identified": identified,
                "identified_percent": identified_percent, "adaptive": adaptive, "adaptive_percent": adaptive_percent,
            }  # fmt: skip  # a list of values
            yield Finding("errors-compensated", NOTE, message, numbers)
    reference = "true" if study.paper else "identified"
    for x in study.adapted.factors:
        message = f"{first.name}, {x.law}: {x.parameter} from {x.initial:g} to {x.final:.3f} of its {reference} value."
        numbers = {"joint": first.name, "law": x.law, "name": x.parameter, "initial": x.initial, "final": x.final}
        yield Finding("adapted-to", NOTE, message, numbers)


def _milli(study: Study) -> str:
    """The unit of a position error in thousandths: mrad (mm)."""
    return f"m{unit('position', study.loops[0].kind)}"


def _start(replay: Replay) -> str:
    """What a replayed model is initialised at."""
    return "the identified model" if replay.begun == "identified" else replay.begun


def _table(frame: pd.DataFrame, names: Mapping[str, str], *thousandths: str) -> Table:
    """A table as the page shows it: under other names, some columns in thousandths."""
    frame = frame.astype(dict.fromkeys(thousandths, float))
    frame[list(thousandths)] *= 1e3
    return shown(frame.rename(columns=dict(names)))
