"""Which friction model to use, of those fitted to the same equations.

With k parameters, the noise variance among them, and the sum of squared residuals RSS of n equations, of which n' = n /
inflation are independent:

    AICc = n' log(RSS / n) + 2 k + 2 k (k + 1) / (n' - k - 1),    BIC = n' log(RSS / n) + k log(n')
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import log
from typing import Literal

import numpy as np

from bristle.arrays import Array
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import StaticFit, TrackingFit
from bristle.identification.results import ModelComparison, ModelRow

COULOMB, VISCOUS, STRIBECK, LUGRE = "Coulomb", "Coulomb + viscous", "Stribeck curve", "LuGre"
"""Each with the terms of the one before: Coulomb and viscous friction; the steady curve (9), with alpha_1 and v_s;
sigma_0 and sigma_1."""
SYMMETRIC, APART, ONE = "symmetric", "per direction", "one direction"
_EXACT = 1e-24
"""Of the measured power: residuals below are rounding."""
_SAME = 2.0
"""A difference in BIC below this is worth a bare mention."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCandidate:
    """A model fitted."""

    model: str
    directions: str
    parameters: int
    residuals: Array
    """(n,)."""
    hold_out: float | None
    """Percent."""
    settled: bool = True
    """Whether its fit came to its end."""
    values: Values = field(default_factory=dict)
    """Of a LuGre model: where it ended."""


def power_of(x: Array) -> float:
    """The sum of squares of x, (n,)."""
    return float(x @ x)


def rank_models(
    data: Literal["points", "moving runs"],
    candidates: Sequence[ModelCandidate],
    held_by: Finding | None,
    variance_inflation: float,
    power: float,
    static: Mapping[str, StaticFit],
    alone: TrackingFit | None,
    left_out: tuple[Finding, ...],
) -> ModelComparison | None:
    """The candidates as rows, with the one to use; None where there is none.

    Args:
        data: what the equations are about.
        candidates: the candidates, on the same n equations.
        held_by: what their `hold_out` is about; None where nothing was held out.
        variance_inflation: n over the number of independent equations.
        power: sum of squares of what they explain, (N*m)**2.
        static: static fits of these data.
        alone: the fit of all parameters to these data.
        left_out: what is not compared, and why.
    """
    if not candidates:
        return None
    n = candidates[0].residuals.size
    marks = [scores(c.residuals, c.parameters, n / variance_inflation, power) for c in candidates]
    lowest_aicc = min((aicc for aicc, _ in marks if aicc is not None), default=0.0)
    lowest_bic = min(bic for _, bic in marks)
    # whether a fit of these data keeps a Stribeck term in any direction, and shows the bristle
    shown = {name.name for name, e in (alone.parameters if alone else {}).items() if e.value is not None}
    peaks = [f.parameters["alpha_1"].value for f in static.values() if "alpha_1" in f.parameters]
    kept, seen = "alpha_1" in shown or any(x is not None for x in peaks), "sigma_0" in shown
    allowed = [k for k, c in enumerate(candidates) if (seen if c.model == LUGRE else (c.model == STRIBECK) == kept)]
    best = min(allowed, key=lambda k: marks[k][1], default=None)
    rows = tuple(
        ModelRow(
            model=c.model,
            directions=c.directions,
            parameters=c.parameters,
            rms=float(np.sqrt(power_of(c.residuals) / n)),
            relative_error=100 * float(np.sqrt(power_of(c.residuals) / power)) if power else None,
            aicc=None if aicc is None else aicc - lowest_aicc,
            bic=bic - lowest_bic,
            hold_out=c.hold_out,
            candidate=k in allowed,
            recommended=k == best,
        )
        for k, (c, (aicc, bic)) in enumerate(zip(candidates, marks, strict=True))
    )
    return ModelComparison(
        data=data,
        n=n,
        effective=n / variance_inflation,
        hold_out_by=held_by,
        rows=rows,
        sentence=_sentence(rows, static, kept=kept),
        left_out=left_out,
    )


def scores(residuals: Array, parameters: int, effective: float, power: float) -> tuple[float | None, float]:
    """AICc, None where there are too few independent equations, and BIC.

    Both up to a constant that all models of the same equations share.

    Args:
        residuals: (n,).
        parameters: fitted, the noise variance apart.
        effective: how many of the equations are independent.
        power: sum of squares of what is explained.
    """
    k = parameters + 1
    fit_term = effective * log(max(power_of(residuals), _EXACT * power, 1e-300) / residuals.size)
    spare = effective - k - 1
    return fit_term + 2 * k + 2 * k * (k + 1) / spare if spare > 0 else None, fit_term + k * log(effective)


def _sentence(rows: Sequence[ModelRow], static: Mapping[str, StaticFit], *, kept: bool) -> Finding:
    """Which to use and why."""
    allowed = sorted((r for r in rows if r.candidate), key=lambda r: r.bic)
    if not allowed:
        message = "None of the models with the terms that the fit supports can be fitted to so few points."
        return Finding("no-model", CAUTION, message)
    best, *rest = allowed
    lowest = "it has the lowest BIC"
    if len(rows) > len(allowed):
        lowest = f"of the models with the terms that the fit supports {lowest}"
    if rest:
        gap = rest[0].bic - best.bic
        lowest = f"{lowest} ({'hardly worse: ' * (gap < _SAME)}{_called(rest[0])} has {gap:.1f} more)"
    other = min((r for r in allowed if r.aicc is not None), key=lambda r: r.aicc or 0.0, default=best)
    prefers = [] if other is best else [f"AICc prefers {_called(other)}"]
    why, model = (lowest, *prefers, *_refused(rows, static, kept=kept)), _called(best)
    return Finding("use-model", NOTE, f"Use {model}: {'; '.join(map(str, why))}.", {"model": model, "why": why})


def _called(row: ModelRow) -> str:
    return row.model if row.directions == ONE else f"{row.model}, {row.directions}"


def _refused(rows: Sequence[ModelRow], static: Mapping[str, StaticFit], *, kept: bool) -> Iterator[Finding | str]:
    """What the fit does not support, and whether that it keeps the Stribeck term rests on points that stick and slip."""
    shown = [r for r in rows if r.model == STRIBECK]
    if not kept and shown and not any(f.outcome.code == "static-as-asked" for f in static.values()):
        gain = min(r.bic for r in rows if r.candidate) - min(r.bic for r in shown)
        lower = f", though it would lower the BIC by {gain:.1f} (the fit's warnings say why)" if gain > 0 else ""
        yield f"the Stribeck term is not identifiable from these data, as the fit found{lower}"
    if kept and any(f.outcome.code == "static-stick-slip" for f in static.values()):
        message = "but its Stribeck term rests on points that stick and slip"
        yield Finding("peak-of-stick-slip", CAUTION, message)
    if any(r.model == LUGRE and not r.candidate for r in rows):
        yield "the motion does not show LuGre's bristle"
