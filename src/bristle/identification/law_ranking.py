"""Which of some fitted friction laws the data want, by BIC and by speeds that were left out.

The paper's law is left only for one whose BIC is lower by more than 10, and whose squared error over five blocks of
speed, each left out in turn, is lower too: BIC alone takes up what the scatter looks like, an error at speeds that were
left out alone what happens to lie at one end.

A level that rises with the motor's torque makes a torque explain part of itself. The likelihood of T - f(T) has the
factor 1 - df/dT in each equation, so BIC loses 2 n' mean(log(1 - df/dT)), and an error at what was left out is that of
the torque which solves T = f(T): without both, such a law would win on noise.

With the equations of each solve, n of them of which n' are independent, and k parameters, the noise variance among
them, a law's BIC is the sum of n' log(RSS / n) + k log(n'). Its weight is exp(-BIC / 2) over the sum of all (Burnham
and Anderson, Model Selection and Multimodel Inference, 2002), and so is the average of a parameter over laws: its
variance is what each law leaves open, and how far it lies from the average.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Literal, NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.estimation.covariance import student
from bristle.findings import NOTE, Finding
from bristle.identification.model_criteria import power_of, scores
from bristle.identification.results import Averaged, LawComparison, LawRow
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.laws.registry import competing
from bristle.model.parameters import ParameterName

GAIN = 10.0
"""Of BIC, by which another law has to be better than the paper's."""
_SPREAD = 0.95
"""A law with less than this of the weights is not the only one that the data allow."""
_AVERAGED = ("alpha_0", "alpha_1", "alpha_2")
"""What means the same in every law: v_s does not."""
_WORTH = 1e-3
"""A law with a smaller weight does not move an average."""


class Solve(NamedTuple):
    """One of a law's solves: what its BIC is made of."""

    residuals: Array
    """(n,)."""
    parameters: int
    effective: float
    """How many of the equations are independent."""
    power: float
    """Sum of squares of what is explained."""
    itself: float = 0.0
    """Sum of log(1 - s) over the equations, s the share of a change of the torque that its own law makes of it."""


LeftOut = tuple[float | None, float | None]
"""100 * norm(error) / norm(measured), percent, over blocks of speed and over runs, each predicted from the others; None where these are too few."""
Known = dict[ParameterName, tuple[float, float, float]]
"""Value, standard error and its degrees of freedom of each parameter that is at no bound."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLaw:
    """A law fitted to every solve."""

    law: Law
    load: tuple[str, ...] = ()
    """By what its level rises, of `registry.LOADS`."""
    solves: tuple[Solve, ...]
    left_out: Callable[[], LeftOut]
    """Works out how it predicts what was left out."""
    known: Callable[[], Known]

    @property
    def name(self) -> str:
        """As `fit.law` takes it."""
        return "+".join((self.law.name, *self.load))

    @property
    def residuals(self) -> Array:
        """Of every equation, (n,)."""
        return np.concatenate([solve.residuals for solve in self.solves])


def ranked(
    data: Literal["points", "moving runs"], fitted: Sequence[FittedLaw | None], in_force: str, *, sparing: bool = False
) -> LawComparison | None:
    """Fitted laws as rows, with the one that the data want; None where there is none beside the paper's.

    Args:
        data: what the equations are about.
        fitted: each law; None where there were too few equations.
        in_force: the name of the law of the fits.
        sparing: whether errors at what is left out are worked out only where BIC prefers a law to the paper's: for those laws,
            and the ones that they are compared with.
    """
    found = [x for x in fitted if x is not None]
    paper = next((k for k, x in enumerate(found) if x.name == GAUSSIAN.name), None)
    if paper is None or len(found) < 2:
        return None
    marks = np.zeros((len(found), 2))  # AICc, nan where there are too few independent equations, and BIC
    for k, x in enumerate(found):
        for solve in x.solves:
            aicc, own = scores(*solve[:4])
            itself = -2 * solve.effective / solve.residuals.size * solve.itself
            marks[k] += np.nan if aicc is None else aicc + itself, own + itself
    bic = marks[:, 1] - marks[:, 1].min()
    weights = np.exp(-bic / 2) / np.exp(-bic / 2).sum()
    better = bic[paper] - bic > GAIN
    wanted = [
        not sparing or better[k] or (better.any() and (k == paper or x.name == in_force)) for k, x in enumerate(found)
    ]
    left_out = [x.left_out() if asked else (None, None) for x, asked in zip(found, wanted, strict=True)]
    chosen = _chosen(found, bic, left_out, paper)
    rows = tuple(
        LawRow(
            law=x.name,
            parameters=sum(solve.parameters for solve in x.solves),
            rms=float(np.sqrt(power_of(x.residuals) / x.residuals.size)),
            aicc=None if np.isnan(aicc) else float(aicc - np.nanmin(marks[:, 0])),
            bic=float(above),
            left_out=left[0],
            run_left_out=left[1],
            weight=float(weight),
            in_force=x.name == in_force,
            chosen=k == chosen,
        )
        for k, (x, aicc, above, left, weight) in enumerate(zip(found, marks[:, 0], bic, left_out, weights, strict=True))
    )
    return LawComparison(
        data=data,
        n=found[0].residuals.size,
        rows=rows,
        sentence=_sentence(rows, chosen, paper, asked=any(wanted)),
        averaged=_averaged(found, weights) if float(weights.max()) < _SPREAD else {},
    )


def _chosen(fitted: Sequence[FittedLaw], bic: Array, left_out: Sequence[LeftOut], paper: int) -> int:
    """The law of lowest BIC among those that are clearly better than the paper's, which else stays."""
    compete = {law.name for law in competing()}
    own, _ = left_out[paper]
    better = [
        k
        for k, x in enumerate(fitted)
        if x.law.name in compete and bic[paper] - bic[k] > GAIN and own is not None and (left_out[k][0] or np.inf) < own
    ]
    return min(better, key=lambda k: bic[k], default=paper)


def _sentence(rows: Sequence[LawRow], chosen: int, paper: int, *, asked: bool) -> Finding:
    """Which law the data want, and why; `asked`: whether it was worked out what the laws predict of what is left out."""
    own, best = rows[paper], rows[chosen]
    if chosen != paper:
        gain, error, before = own.bic - best.bic, best.left_out, own.left_out
        message = (
            f"The data want {best.law}: its BIC is {gain:.1f} lower than the paper's law's, and at five blocks of speed, each left "
            f"out in turn, its error is {error:.3g} % of the torque instead of {before:.3g} %."
        )
        return Finding("law-wanted", NOTE, message, {"law": best.law, "gain": gain, "error": error, "before": before})
    other = min((row for row in rows if row is not own), key=lambda row: row.bic)
    gain = own.bic - other.bic
    if asked and own.left_out is None:
        message = "The data cannot ask for another law than the paper's: there are too few points to leave speeds out."
        return Finding("laws-too-few", NOTE, message)
    kept = "The data ask for no other law than the paper's:"
    lower, numbers = f"{kept} the BIC of {other.law} is {gain:.1f} lower", {"law": other.law, "gain": gain}
    if gain > GAIN:
        message = f"{lower}, but it predicts speeds that were left out no better."
        return Finding("law-not-predicting", NOTE, message, numbers)
    if gain > 0:
        return Finding("law-kept", NOTE, f"{lower}, less than the 10 asked for.", numbers)
    message = f"{kept} it has the lowest BIC ({other.law} has {-gain:.1f} more)."
    return Finding("law-best", NOTE, message, {"law": other.law, "gap": -gain})


def _averaged(fitted: Sequence[FittedLaw], weights: Array) -> Mapping[ParameterName, Averaged]:
    """What nearly all laws have by weight, over those that the data allow."""
    likely = [(x, weight) for x, weight in zip(fitted, weights.tolist(), strict=True) if weight > _WORTH]
    tables = [(x.known(), weight) for x, weight in likely]
    averaged = {}
    for name in reduce(or_, (dict.fromkeys(table) for table, _ in tables)):
        having = [(*table[name], weight) for table, weight in tables if name in table]
        value, error, freedom, shares = np.array(having).T
        if name.name in _AVERAGED and shares.sum() > _SPREAD:  # a law in which it is at a bound may lack it
            shares = shares / shares.sum()
            mean = float(shares @ value)
            own = float(shares @ np.sqrt(error**2 + (value - mean) ** 2))
            reach = student(float(freedom.min())) * own
            averaged[name] = Averaged(value=mean, standard_error=own, interval=(max(mean - reach, 0.0), mean + reach))
    return averaged
