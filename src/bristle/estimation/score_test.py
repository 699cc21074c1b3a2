"""Score tests (Rao, 1948) of columns that could explain a fit's residuals, with their effect to first order."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.autocorrelation import inflation
from bristle.findings import NOTE, Finding

_BESIDE, _RANK = 1e-3, 1e-10  # relative length of a column beside known ones, and relative rank of these


class Score(NamedTuple):
    """Test of k columns beside known ones."""

    sizes: Array  # Coefficients, (k,)
    errors: Array  # Their standard errors, (k,)
    p: float  # p-value
    share: float  # Explained share of the residuals' squares
    squares: float  # Explained squares


class Fitted(NamedTuple):
    """A fit of n equations to first order."""

    known: Array  # Derivatives of the residuals by all unknowns, (n, p)
    rest: Array  # Measured less modelled, (n,)
    errors: Array  # Standard errors of the unknowns, (p,)
    of_friction: Array  # Unknowns of friction, (p,), bool
    friction: float  # Rms friction
    weight: Array = np.ones(1)  # Factor on each equation, (n,) or (1,)
    widened: bool = True  # Whether the stated errors include the effects of `explained`
    off: Callable[[Array], Array] = np.asarray  # Columns, (n, k), less what private unknowns of blocks explain


class Candidate(NamedTuple):
    """A term that a fit may lack."""

    tell: Callable[[Score, int], Finding | None]  # (score, index of the alternative) -> finding, or None to refuse it
    columns: Sequence[Array]  # Alternatives, (n, k) each, in the unit of the residuals, unweighted
    is_friction: bool = False  # Whether it is friction itself
    is_tried: bool = False  # Whether a fit of its own will tell, however little it explains


def scores(known: Array, rest: Array, columns: Sequence[Array], inflated: float = 1.0) -> list[Score]:
    """Scores of columns, (n, k) each, beside known ones, (n, p), for residuals, (n,), each alone.

    F = mean(b**2 / variance) in orthogonal directions b = D'r; variances allow for correlation along each (at least
    `inflated`), and with many equations for uneven noise.
    """
    basis = _basis(known)
    left = rest - basis @ (basis.T @ rest)
    return [_score(basis, left, x, inflated) for x in columns]


def moved_by(known: Array, added: Array) -> Array:
    """Move of each unknown, (p,), by what is added to the model or the data, (n,), to first order."""
    scale = np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(known / scale, added, rcond=_RANK)[0] / scale)


def _basis(known: Array) -> Array:
    """Orthonormal basis of some columns, (n, p)."""
    lengths = np.linalg.norm(known, axis=0)
    if not lengths.any():
        return known[:, :0]
    Q, R, _ = qr(known / np.where(lengths > 0, lengths, 1.0), mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    return np.asarray(Q[:, size > _RANK * size[0]])


def _score(basis: Array, left: Array, columns: Array, inflated: float = 1.0) -> Score:
    """The score beside a basis, for residuals projected off it."""
    lengths = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    beside = columns / lengths
    beside = beside - basis @ (basis.T @ beside)
    own = np.linalg.norm(beside, axis=0) > _BESIDE
    sizes, errors, total = np.zeros(own.size), np.full(own.size, np.inf), float(left @ left)
    (n, p), k = basis.shape, int(own.sum())
    if not k or not total > 0 or n <= p + k:
        return Score(sizes, errors, 1.0, 0.0, 0.0)
    directions, R = np.linalg.qr(beside[:, own])
    b = directions.T @ left
    share, rest = min(float(b @ b) / total, 1.0), left - directions @ b
    inverse = np.linalg.pinv(R)
    sizes[own] = inverse @ b / lengths[own]
    # variances for even noise, and for noise that is uneven and correlated along the column
    most, one = np.inf if n >= levels.UNEVEN_EQUATIONS else inflation(rest), float(rest @ rest)
    correlated = np.array([max(min(inflation(rest, d), most), inflated) for d in directions.T])
    freedom = (n - p) / float(correlated.max()) - k
    if freedom < 1:
        return Score(sizes, errors, 1.0, share, share * total)
    variance = one / (n - p - k) * correlated
    if n >= levels.UNEVEN_EQUATIONS:
        powers = n * np.var(directions * left[:, None], axis=0)  # under the null hypothesis
        uneven = powers * [max(inflation(x), inflated) for x in (directions * rest[:, None]).T]
        variance = np.maximum(variance, uneven * n / (n - p - k))
    errors[own] = np.sqrt(inverse**2 @ variance) / lengths[own]
    F = float(np.mean(b**2 / np.maximum(variance, 1e-300)))
    return Score(sizes, errors, float(fdtrc(k, freedom, F)), share, share * total)


class Explained(NamedTuple):
    """Result of `explained`."""

    findings: list[Finding]
    left: Array  # Residuals beside what was found, (n,)
    errors: Array  # Standard errors, (p,), with the moves by what was found


def explained(fit: Fitted, candidates: Sequence[Candidate]) -> Explained:
    """Add the best candidate by BIC, one after another, as long as it is significant (Bonferroni) and explains enough.

    A finding's `effect` is the change of rms friction (`torque`) and the largest move in standard errors (`errors`);
    without either it is a note. A column that hardly differs from what is fitted turns any small pattern into a large
    change of friction: it is refused, unless it is tried, or explains nearly all that is left.
    """
    n, waiting, basis = fit.rest.size, list(candidates), _basis(fit.known)
    tried, total, findings, errors = sum(len(x.columns) for x in waiting), 0.0, list[Finding](), fit.errors
    while True:
        left = fit.rest - basis @ (basis.T @ fit.rest)
        now = float(left @ left)
        total = total or now
        best: tuple[float, Candidate, int, Score] | None = None
        for candidate in waiting:
            asked = [fit.off(fit.weight[:, None] * columns) for columns in candidate.columns]
            which = _best(basis, left, asked)
            found, k = _score(basis, left, asked[which]), asked[which].shape[1] + 2 * (len(asked) > 1)
            bic = n * np.log1p(-min(found.share, 1 - 1e-12)) + k * np.log(n)
            if (
                found.p * tried < levels.SIGNIFICANCE
                and found.share * now > levels.EXPLAINS * total
                and (best is None or bic < best[0])
            ):
                best = bic, candidate, which, found
        if best is None:
            return Explained(findings, left, errors)
        _, candidate, which, found = best
        waiting = [x for x in waiting if x is not candidate]
        added = fit.weight * (candidate.columns[which] @ found.sizes)
        moved = moved_by(fit.known, added)
        changed = (added if candidate.is_friction else 0.0) - fit.known[:, fit.of_friction] @ moved[fit.of_friction]
        torque = float(np.sqrt(np.mean(np.square(changed))))
        amplified = torque > levels.AMPLIFIED * np.sqrt(found.squares / n) and torque > levels.MATTERS * fit.friction
        doubtful = amplified and found.share < levels.ALL_LEFT and not candidate.is_tried
        if doubtful or (finding := candidate.tell(found, which)) is None:
            continue
        basis = _basis(np.hstack([basis, fit.off(fit.weight[:, None] * candidate.columns[which])]))
        errors = np.hypot(errors, moved)
        findings.append(_with_effect(fit, torque, moved, finding))


def _best(basis: Array, left: Array, columns: Sequence[Array]) -> int:
    """The alternative that explains most beside a basis."""
    found = []
    for c in columns if len(columns) > 1 else ():
        beside = c - basis @ (basis.T @ c)
        moment = beside.T @ left
        found.append(float(moment @ np.linalg.pinv(beside.T @ beside, hermitian=True) @ moment))
    return int(np.argmax(found)) if found else 0


def _with_effect(fit: Fitted, torque: float, moved: Array, finding: Finding) -> Finding:
    """The finding with the effect of its term on rms friction and on each unknown, (p,); a note if it is small."""
    errors = float(np.max(np.abs(moved) / np.maximum(fit.errors, 1e-300), initial=0.0))
    little = max(torque, finding.effect.get("torque", 0.0)) < levels.MATTERS * fit.friction and errors < 1
    told = replace(finding, effect={"torque": torque, "errors": errors, **finding.effect})
    if little:
        return replace(told, severity=NOTE)
    changes = [f"friction by {100 * torque / fit.friction:.2g} %"] if fit.friction else []
    if errors >= levels.NAMED_ERRORS:
        changes.append(f"a parameter by {errors:.2g} times its error{' without it' if fit.widened else ''}")
    said = f"It would change {' and '.join(changes)}{'; the errors given include that' if fit.widened else ''}."
    return replace(told, message=f"{finding.message} {said}")
