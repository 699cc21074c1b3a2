"""What the page shows of moving runs: results -> the values that its template names."""

from typing import Any

from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.known_joint import moving_fits
from bristle.identification.results import Joint
from bristle.model.parameters import ParameterName, unit
from bristle.page.columns import Table, shown
from bristle.page.wording import FITS, MISSING, measured, number, pretty, span
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.dynamic_figures import MOST, SPAN, window
from bristle.questions.joint_report.sentences import bias_text, biased, pair, reached


def dynamic_summary(joint: Joint) -> list[dict[str, Any]]:
    """As for a static fit: per fit its outcome."""
    return [
        {
            "direction": FITS[kind],
            "outcome": fit.outcome,
            "n": f"{fit.n} equations",
            "relative_error": fit.relative_error,
        }
        for kind, fit in moving_fits(joint).items()
    ]


def dynamic_section(joint: Joint) -> dict[str, Any] | None:
    """Both fits side by side, hold-out runs, what counts added, and the stages compared; None without moving runs."""
    if joint.tracking is None:
        return None
    return {
        "fits": [_fit(joint, kind, fit) for kind, fit in moving_fits(joint).items()],
        "table": _side_by_side(joint),
        "hold_out": shown(tables.tracking_hold_out([joint])),
        "consistency": _compared(joint),
        "shown": _drawn(joint),
    }


def _fit(joint: Joint, kind: str, fit: TrackingFit) -> dict[str, Any]:
    """One fit in words."""
    return {
        "name": FITS[kind],
        "outcome": fit.outcome,
        "relative_error": number(fit.relative_error, 3),
        "rms": f"{number(fit.rms, 3)} {pretty(unit(fit.quantity, joint.kind))}",
        "n": fit.n,
        "stretches": len(fit.starts_of_runs),
        "windows": fit.windows,
        "condition": number(fit.condition, 2),
        "reached": reached(fit),
        "bias": [(name, pretty(bias_text(fit, name, bias, share))) for name, bias, share in biased(fit)],
        "looked_at_bias": bool(fit.count_bias),
        "check": fit.crosscheck,
    }


def _side_by_side(joint: Joint) -> Table:
    """One row per parameter; of each fit the value with its standard error, and the interval."""
    found = moving_fits(joint)
    names = dict.fromkeys(name for fit in found.values() for name in fit.parameters)
    heads = [head for kind in found for head in (FITS[kind], f"{FITS[kind]}, 95 %")]
    rows = [_row(name, [fit.parameters.get(name) for fit in found.values()]) for name in names]
    return Table(columns=("parameter", "unit", *heads), rows=tuple(rows))


def _row(name: ParameterName, estimates: list[Estimate | None]) -> tuple[str, ...]:
    known = [e for e in estimates if e is not None]
    cells = [cell for e in estimates for cell in ((pair(e), span(e.interval)) if e is not None else (MISSING, MISSING))]
    return (str(name), known[0].unit, *cells)


def _compared(joint: Joint) -> Table:
    """Each parameter from its own stage, the moving runs alone and all at once, value and error in one cell; the difference in standard errors."""
    rows = [
        (
            str(x.parameter),
            next(
                (
                    fit.parameters[x.parameter].unit
                    for fit in moving_fits(joint).values()
                    if x.parameter in fit.parameters
                ),
                "",
            ),
            x.stage,
            measured(x.stage_value, x.stage_error),
            measured(x.tracking_value, x.tracking_error),
            measured(x.joint_value, x.joint_error),
            x.difference_in_se,
            x.verdict,
        )
        for x in joint.consistency
    ]
    columns = ("parameter", "unit", "stage", "stage_value", "tracking_value", "joint_value", "difference", "verdict")
    return Table(columns=columns, rows=tuple(rows))


def _drawn(joint: Joint) -> dict[str, Any] | None:
    """Which part of which fit the figures show; None where nothing was fitted."""
    kind, fit = next(reversed(moving_fits(joint).items()), (None, None))
    if kind is None or fit is None or not fit.time.size:
        return None
    chosen = window(fit)
    return {
        "fit": FITS[kind],
        "quantity": fit.quantity,
        "from": number(float(fit.time[chosen.start]), 3),
        "to": number(float(fit.time[chosen.stop - 1]), 3),
        "stretch": 1 + sum(chosen.start >= start for start in fit.starts_of_runs[1:]),
        "stretches": len(fit.starts_of_runs),
        "span": SPAN,
        "thinned": fit.time.size > MOST,
        "most": MOST,
    }
