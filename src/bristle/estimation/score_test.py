"""One question of what a fit leaves: whether a column explains it, and what it would change.

A score test (Rao, 1948): the column, projected off the derivatives of all that is fitted, against the residuals. Nothing
is fitted anew; what would change is one Gauss-Newton step.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr
from scipy.special import fdtrc

from bristle.arrays import Array
from bristle.estimation.autocorrelation import inflation
from bristle.estimation.levels import SIGNIFICANCE
from bristle.findings import NOTE, Finding

LEAST = 0.05  # of the squares that the fit leaves: a candidate that explains less is not worth a sentence
MATTERS = 0.01  # of friction, rms, or a standard error of some parameter: a candidate that moves less is a note
_MANY = 100
"""Equations that tell how noise is correlated, and uneven, along a column; of fewer it is as along a slow one, at most, and even."""
_BESIDE, _RANK = 1e-6, 1e-10  # of its length: a column with less beside others is made of them; and known ones


class Score(NamedTuple):
    """What k columns explain of residuals, beside p known ones."""

    sizes: Array
    """How much of each column the residuals ask for, (k,)."""
    errors: Array
    """Standard errors of these, (k,)."""
    p: float
    """Probability of so much by chance."""
    share: float
    """Of the squares that the known ones leave ..."""
    squares: float
    """... and these."""


class Fitted(NamedTuple):
    """A fit of n equations, to first order."""

    known: Array
    """Derivatives of the residuals by all p unknowns, (n, p)."""
    rest: Array
    """The residuals: measured less modelled, (n,)."""
    errors: Array
    """Standard errors of the unknowns, (p,)."""
    of_friction: Array
    """Which of the unknowns are of friction, (p,), bool."""
    friction: float
    """Its rms."""
    weight: Array = np.ones(1)
    """What the equations are multiplied by in the fit, (n,), or one for all."""
    widened: bool = True
    """Whether the errors that are given are those of `explained`."""


class Candidate(NamedTuple):
    """What a fit may lack."""

    tell: Callable[[Score, int], Finding | None]
    """What is said of it where it explains what is left, and by which of its alternatives; None: it is refused."""
    columns: Sequence[Array]
    """Its alternatives, of which the best is taken, (n, k) each, in the unit of the residuals, without weights."""
    is_friction: bool = False
    """Whether what it explains is friction too."""


def scores(known: Array, rest: Array, columns: Sequence[Array], inflated: float = 1.0) -> list[Score]:
    """The test of some columns, (n, k) each, beside known ones, (n, p), on residuals, (n,), in an order in which they may be correlated.

    Each is tested alone. In directions at right angles b = D'r, whose variances are those of what is left, times what autocorrelation makes of them
    along each; or, of many, those of the products D r about their means, as there were nothing to explain, where these are larger.
    mean(b**2 / variance) is F. What is made of others is left out. Autocorrelation makes of a variance `inflated` times as much at least.
    """
    basis = _basis(known)
    left = rest - basis @ (basis.T @ rest)
    return [_score(basis, left, x, inflated) for x in columns]


def moved_by(known: Array, added: Array) -> Array:
    """How far each unknown, (p,), would move with what is added to the model, or to the data, (n,), to first order."""
    scale = np.maximum(np.linalg.norm(known, axis=0), 1e-300)
    return np.asarray(np.linalg.lstsq(known / scale, added, rcond=_RANK)[0] / scale)


def _basis(known: Array) -> Array:
    """Orthonormal columns that span some others, (n, p)."""
    lengths = np.linalg.norm(known, axis=0)
    if not lengths.any():
        return known[:, :0]
    Q, R, _ = qr(known / np.where(lengths > 0, lengths, 1.0), mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    return np.asarray(Q[:, size > _RANK * size[0]])


def _score(basis: Array, left: Array, columns: Array, inflated: float = 1.0) -> Score:
    """The same, of a basis of what is known, and of what that leaves."""
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
    # noise that is alike everywhere, and noise that differs along the column, and may be correlated there alone
    most, one = np.inf if n >= _MANY else inflation(rest), float(rest @ rest)
    correlated = np.array([max(min(inflation(rest, d), most), inflated) for d in directions.T])
    freedom = (n - p) / float(correlated.max()) - k
    if freedom < 1:
        return Score(sizes, errors, 1.0, share, share * total)
    variance = one / (n - p - k) * correlated
    if n >= _MANY:
        powers = n * np.var(directions * left[:, None], axis=0)  # as if there were nothing: few alone prove nothing
        uneven = powers * [max(inflation(x), inflated) for x in (directions * rest[:, None]).T]
        variance = np.maximum(variance, uneven * n / (n - p - k))
    errors[own] = np.sqrt(inverse**2 @ variance) / lengths[own]
    F = float(np.mean(b**2 / np.maximum(variance, 1e-300)))
    return Score(sizes, errors, float(fdtrc(k, freedom, F)), share, share * total)


class Explained(NamedTuple):
    """What candidates explain of what a fit leaves."""

    findings: list[Finding]
    left: Array
    """What they leave, (n,)."""
    errors: Array
    """Standard errors of the unknowns, (p,), with how far each would move with what was found."""


def explained(fit: Fitted, candidates: Sequence[Candidate]) -> Explained:
    """What the candidates explain of what a fit leaves, one after the other, beside those before.

    Each time the one that BIC likes best of those that are significant, corrected for all that were tried, and explain
    enough. The `effect` of a finding is what adding it would change: the friction, rms, under `torque`, and the parameter that moves
    farthest, in its standard errors, under `errors`. A finding that changes neither is a note.
    """
    n, waiting, basis = fit.rest.size, list(candidates), _basis(fit.known)
    tried, total, findings, errors = sum(len(x.columns) for x in waiting), 0.0, list[Finding](), fit.errors
    while True:
        left = fit.rest - basis @ (basis.T @ fit.rest)
        now = float(left @ left)
        total = total or now
        best: tuple[float, Candidate, int, Score] | None = None
        for candidate in waiting:
            which = _best(basis, left, fit.weight, candidate.columns)
            columns = fit.weight[:, None] * candidate.columns[which]
            found, k = _score(basis, left, columns), columns.shape[1] + 2 * (len(candidate.columns) > 1)
            bic = n * np.log1p(-min(found.share, 1 - 1e-12)) + k * np.log(n)
            if found.p * tried < SIGNIFICANCE and found.share * now > LEAST * total and (best is None or bic < best[0]):
                best = bic, candidate, which, found
        if best is None:
            return Explained(findings, left, errors)
        _, candidate, which, found = best
        waiting = [x for x in waiting if x is not candidate]
        finding = candidate.tell(found, which)
        if finding is not None:
            basis = _basis(np.hstack([basis, fit.weight[:, None] * candidate.columns[which]]))
            added = fit.weight * (candidate.columns[which] @ found.sizes)
            moved = moved_by(fit.known, added)
            errors = np.hypot(errors, moved)
            findings.append(_with_effect(fit, added, moved, finding, is_friction=candidate.is_friction))


def _best(basis: Array, left: Array, weight: Array, columns: Sequence[Array]) -> int:
    """Which of several columns, (n, k) each, explain most beside a basis; one after the other, for they may be many."""
    found = []
    for c in columns if len(columns) > 1 else ():
        beside = weight[:, None] * c
        beside = beside - basis @ (basis.T @ beside)
        moment = beside.T @ left
        found.append(float(moment @ np.linalg.pinv(beside.T @ beside, hermitian=True) @ moment))
    return int(np.argmax(found)) if found else 0


def _with_effect(fit: Fitted, added: Array, moved: Array, finding: Finding, *, is_friction: bool) -> Finding:
    """The finding, with what adding this to the model, (n,), which moves the unknowns, (p,), would change; a note where that is little."""
    friction = fit.known[:, fit.of_friction] @ moved[fit.of_friction]
    changed = (added if is_friction else 0.0) - friction
    torque = float(np.sqrt(np.mean(np.square(changed))))
    errors = float(np.max(np.abs(moved) / np.maximum(fit.errors, 1e-300), initial=0.0))
    little = max(torque, finding.effect.get("torque", 0.0)) < MATTERS * fit.friction and errors < 1
    told = replace(finding, effect={"torque": torque, "errors": errors, **finding.effect})
    if little:
        return replace(told, severity=NOTE)
    changes = [f"friction by {100 * torque / fit.friction:.2g} %"] if fit.friction else []
    if errors >= 0.1:  # of an error: less says nothing
        changes.append(f"a parameter by {errors:.2g} times its error{' without it' if fit.widened else ''}")
    said = f"It would change {' and '.join(changes)}{'; the errors given include that' if fit.widened else ''}."
    return replace(told, message=f"{finding.message} {said}")
