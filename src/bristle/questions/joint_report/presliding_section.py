"""What the page shows of presliding runs: results -> the values that its template names."""

import math
from typing import Any

import pandas as pd

from bristle.identification.fits import PreslidingFit
from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.columns import shown
from bristle.page.wording import WORK, counted, direction, in_print, pretty
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.presliding_figures import MOST_LOOPS, loops_drawn
from bristle.questions.joint_report.sentences import bias, choice, level, median_breakaway, pair


def presliding_summary(joint: Joint) -> list[dict[str, Any]]:
    """As for a static fit: per direction which sigma_0 to use."""
    slow = joint.presliding
    return [
        {
            "direction": f"presliding {direction(d)}",
            "outcome": in_print(choice(fit)),
            "relative_error": None,
        }
        for d, fit in (slow.fits if slow else {}).items()
        if slow
    ]


def presliding_section(joint: Joint) -> dict[str, Any] | None:
    """sigma_0 side by side, breakaway and hysteresis; None without presliding runs."""
    slow = joint.presliding
    if slow is None:
        return None
    frame = tables.presliding([joint])
    frame.insert(3, "recommended", frame.pop("recommended"))
    torque = pretty(unit("torque", joint.kind))
    broken = tables.breakaway([joint]).rename(columns={"breakaway": f"torque ({torque})", "start": "first sample"})
    return {
        "fits": [_slow(joint, fit) for fit in slow.fits.values()],
        "table": shown(frame if joint.truth else frame.drop(columns=["true", "error_percent", "inside"])),
        "medians": [(d, in_print(median_breakaway(e))) for d, e in slow.breakaway.items()],
        "breakaway": shown(broken),
        "stiffness_unit": pretty(unit("sigma_0", joint.kind)),
        "amplitudes": shown(_amplitudes(joint)),
        "softens": any(warning.code == "softens" for fit in slow.fits.values() for warning in fit.warnings),
        "hysteresis": shown(_loops(joint)),
        "loops_left_out": len(slow.loops) - len(loops_drawn(slow.loops)),
        "most_loops": MOST_LOOPS,
        "bound": any(math.isinf(fit.level_standard_error) for fit in slow.fits.values()),
    }


def _amplitudes(joint: Joint) -> pd.DataFrame:
    """Stiffness against amplitude, narrow enough for the page: the unit of stiffness stands above it."""
    torque, position = (pretty(unit(name, joint.kind)) for name in ("torque", "position"))
    headings = {"torque": f"torque ({torque})", "displacement": f"displacement ({position})", "value": "stiffness"}
    return tables.stiffness([joint]).drop(columns="sigma_0").rename(columns=headings | {"lugre": "LuGre's own"})


def _loops(joint: Joint) -> pd.DataFrame:
    """Closed cycles, likewise: rows in one column, amplitudes as half of a range."""
    frame = tables.hysteresis([joint])
    torque, position = (pretty(unit(name, joint.kind)) for name in ("torque", "position"))
    rows = [f"{start}\u2013{stop}" for start, stop in zip(frame["start"], frame["stop"], strict=True)]
    frame = frame.assign(samples=rows)[
        [
            "file",
            "samples",
            "counts",
            "torque_amplitude",
            "displacement_amplitude",
            "slope",
            "inverse_slope",
            "secant",
            "loss",
        ]
    ]
    headings = {
        "torque_amplitude": f"\u00b1 torque ({torque})",
        "displacement_amplitude": f"\u00b1 displacement ({position})",
    }
    headings |= {"slope": "regression", "inverse_slope": "inverse", "loss": f"loss per cycle ({WORK})"}
    return frame.rename(columns=headings)


def _slow(joint: Joint, fit: PreslidingFit) -> dict[str, Any]:
    """One direction in words."""
    prior = fit.sigma_1
    return {
        "direction": fit.direction,
        "choice": in_print(choice(fit)),
        "bias": in_print(bias(fit, joint.kind)),
        "level": pretty(level(fit, joint.kind)),
        "source": in_print(fit.level_source),
        "crossed": f"{counted(len(fit.loadings), 'loading')} and {counted(fit.counts, 'count edge')} crossed.",
        "sigma_1": None if prior.value is None else f"{pair(prior)} {pretty(prior.unit)}",
        "prior": prior.warnings,
    }
