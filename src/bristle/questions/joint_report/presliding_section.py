"""What the page shows of presliding runs: results -> the values that its template names."""

from typing import Any

from bristle.diagnostics import Kind
from bristle.identification.fits import PreslidingFit
from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.page.columns import shown
from bristle.page.wording import WORK, direction, in_print, measured, pretty, span
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.presliding_figures import MOST_LOOPS, loops_drawn
from bristle.questions.joint_report.sentences import bias, choice, critical, median_breakaway, pair


def presliding_summary(joint: Joint) -> list[dict[str, Any]]:
    """As for a static fit: per direction which sigma_0 to use, the estimates, and how many warnings there are."""
    slow = joint.presliding
    return [
        {
            "direction": f"presliding {direction(d)}",
            "outcome": in_print(choice(fit)),
            "relative_error": None,
            "warnings": len(set(slow.warnings_of(d))),
            "critical": critical(fit.warnings),
            "estimates": [
                (name, pair(e), f"{pretty(e.unit)}{note}", span(e.interval))
                for name, e, note in (("sigma_0", fit.sigma_0, ""), ("sigma_1", fit.sigma_1, " (a prior)"))
            ],
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
    stiffness, torque = (pretty(unit(name, joint.kind)) for name in ("sigma_0", "torque"))
    slopes = {"slope": "torque on displacement", "inverse_slope": "inverse regression", "secant": "secant"}
    units = {name: f"{words} ({stiffness})" for name, words in slopes.items()} | {"loss": f"loss per cycle ({WORK})"}
    broken = tables.breakaway([joint]).rename(columns={"breakaway": f"torque ({torque})"})
    return {
        "fits": [_slow(joint, fit) for fit in slow.fits.values()],
        "table": shown(frame if joint.truth else frame.drop(columns=["true", "error_percent", "inside"])),
        "medians": [(d, in_print(median_breakaway(e))) for d, e in slow.breakaway.items()],
        "breakaway": shown(broken),
        "hysteresis": shown(tables.hysteresis([joint]).rename(columns=units)),
        "loops_left_out": len(slow.loops) - len(loops_drawn(slow.loops)),
        "most_loops": MOST_LOOPS,
    }


def _slow(joint: Joint, fit: PreslidingFit) -> dict[str, Any]:
    """One direction in words."""
    prior = fit.sigma_1
    return {
        "direction": fit.direction,
        "choice": in_print(choice(fit)),
        "bias": in_print(bias(fit, joint.kind)),
        "level": f"{measured(fit.level, fit.level_standard_error)} {pretty(unit('torque', joint.kind))}",
        "source": in_print(fit.level_source),
        "crossed": Kind.EDGES_CROSSED(loadings=len(fit.loadings), counts=fit.counts),
        "sigma_1": None if prior.value is None else f"{pair(prior)} {pretty(prior.unit)}",
        "prior": prior.warnings,
    }
