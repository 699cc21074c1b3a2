"""Terms that any fit may lack, as candidates for the score test `explained`."""

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.estimation import levels
from bristle.estimation.score_test import Candidate, Score
from bristle.findings import CAUTION, Finding, unit_of
from bristle.identification.moving_runs import REGRESSORS, load_columns, regressor_line, shows_gravity, turn_of
from bristle.model.parameters import Kind, periodic, slides

_HARMONICS = 64  # most ripples tried


def candidates(
    velocity: Array, time: Array, position: Array, parameters: Collection[str], kind: Kind, directions: int
) -> list[Candidate]:
    """The candidates of n equations, SI; an unknown signal is empty.

    `parameters` are names that are fitted already, `directions` how many directions have a friction of their own.
    """
    n = velocity.size
    if n < levels.FEW:
        return []
    signals = {"time": time, "velocity": velocity, "position": position}
    scaled = {name: 2 * (x - x.min()) / np.ptp(x) - 1 for name, x in signals.items() if x.size == n and np.ptp(x) > 0}
    rows = list[Candidate]()
    # gravity is told from a spring only beside it
    springs = slides(kind) or "gravity_sin" in parameters
    possible = {"quadratic": True, "gravity": shows_gravity(kind, position), "spring": "position" in scaled and springs}
    for name in (x for x, is_possible in possible.items() if is_possible):
        if set(parameters).isdisjoint(REGRESSORS[name].names):
            columns = np.stack(list(load_columns((name,), signals.__getitem__, n).values()), axis=1)
            rows.append(Candidate(partial(_regressor, name, parameters), (columns,), is_friction=name == "quadratic"))
    both = velocity.min() < 0 < velocity.max()
    if both:  # with two frictions an offset shows at reversals only
        even = np.stack([np.ones(n), np.abs(velocity)], axis=1)
        rows.append(Candidate(partial(_directions, directions), (even[:, : 3 - directions],), is_friction=True))
    if both and "time" in scaled:  # a change of friction has the sign of the velocity
        change = _centred([scaled["time"], scaled["time"] ** 2]) * np.sign(velocity)[:, None]
        rows.append(Candidate(_wear, (change,), is_friction=True))
    for over, s in scaled.items():
        if not (both and over == "velocity"):  # even functions of velocity are covered by the directions
            rows.append(Candidate(partial(_trend, over), (_centred([s, s * s]),), is_friction=over == "velocity"))
    if "position" in scaled:
        # of friction, which turns with the motion; beside gravity it rises with the load, if with anything
        of_place = both and "gravity_sin" not in parameters
        signs = (None, np.sign(velocity)[:, None]) if of_place else (None,)
        for sign in signs:
            waves = _Waves(position, min(n // 4, _HARMONICS), sign)
            tell = partial(_ripple, waves.reach, parameters, kind, of_friction=sign is not None)
            rows.append(Candidate(tell, waves, is_friction=sign is not None))
    return rows


class _Waves(Sequence[Array]):
    """Cosine and sine of harmonics of the range of positions, rad, (n,), from the second on; (n, 2) each.

    Of friction times `sign`, (n, 1), after a trend over the positions.
    """

    def __init__(self, position: Array, count: int, sign: Array | None = None) -> None:
        self.reach, self.turns = float(np.ptp(position)), 2 * np.pi * (position - position.min())
        self.most, self.sign = count, sign

    def __len__(self) -> int:
        return self.most + (self.sign is not None)

    def __getitem__(self, k: Any) -> Any:
        if not k < len(self):
            raise IndexError
        s, order = self.turns / self.reach, k + 2 - (self.sign is not None)
        columns = [np.cos(order * s), np.sin(order * s)] if order > 1 else [s, (s - np.pi) ** 2]
        return _centred(columns) if self.sign is None else self.sign * _centred(columns)


def _centred(columns: Sequence[Array]) -> Array:
    """Columns, (n,) each, less their means, (n, k)."""
    X = np.stack(columns, axis=1)
    return np.asarray(X - X.mean(axis=0))


def _trend(over: str, found: Score, _: int) -> Finding:
    message = f"Residuals show a trend vs {over} (p = {found.p:.1g}), which explains {100 * found.share:.0f} % of their variance."
    return Finding("residual-trend", CAUTION, message, {"over": over, "p": found.p, "share": found.share})


def _directions(count: int, found: Score, _: int) -> Finding:
    """Of a symmetric curve that is not, or of two of which a part is an offset: what it leaves is even in velocity."""
    if count == 1:
        what, then = "Friction differs between the directions", "Fit the directions separately (directions: separate)."
    else:
        what = "Part of what alpha_0 differs by between the directions is an offset of the torque, or reversals are not LuGre's"
        then = "The curve is known; the two alpha_0 and the bristle's parameters are less so."
    message = f"{what} (p = {found.p:.1g}): it explains {100 * found.share:.0f} % of the residuals' variance. {then}"
    return Finding("directions-differ", CAUTION, message, {"p": found.p, "share": found.share})


def _wear(found: Score, _: int) -> Finding:
    change = 2 * float(found.sizes[0])
    message = (
        f"Friction {'grows' if change > 0 else 'falls'} by {abs(change):.2g}{unit_of('torque')} from the beginning to the end "
        f"(p = {found.p:.1g}), which explains {100 * found.share:.0f} % of the residuals' variance: it wears in or warms up. Repeat it "
        "on a joint that has settled."
    )
    numbers = {"change": change, "p": found.p, "share": found.share}
    return Finding("friction-drifts", CAUTION, message, numbers, {"torque": abs(change)})


def _regressor(name: str, parameters: Collection[str], found: Score, _: int) -> Finding:
    lines = regressor_line((name,), parameters)
    message = f"The fit lacks a term: under fit, {lines} would explain {100 * found.share:.0f} % of what is left."
    return Finding("lacks-a-term", CAUTION, message, {"lines": lines, "term": name, "share": found.share})


def _ripple(
    reach: float, parameters: Collection[str], kind: Kind, found: Score, which: int, *, of_friction: bool
) -> Finding:
    """For a period that divides the range of positions, rad, with the lines that would fit it; of friction a trend is the first."""
    amplitude, order = float(np.hypot(*found.sizes)), 0
    period = reach / (which + 2 - of_friction)
    fitted = {x[2] for name in parameters if (x := periodic(name))}
    if which or not of_friction:
        order = round(turn_of(kind)[0] / period)
    term = "ripple" if of_friction else "cogging"
    asked = f"{regressor_line((term,), parameters)}, orders: [{', '.join(map(str, sorted({*fitted, order})))}]"
    write = f" If motor or gear repeat so, write {asked} under fit." if order and order not in fitted else ""
    numbers = {"p": found.p, "share": found.share}
    if not of_friction:
        message = (
            f"A ripple vs position of period {period:.3g}{unit_of('position')} explains {100 * found.share:.0f} % of what is left "
            f"(p = {found.p:.1g}).{write}"
        )
        return Finding("residual-ripple", CAUTION, message, {"period": period, **numbers})
    where = f" with a period of {period:.3g}{unit_of('position')}" if which else ""
    message = (
        f"Friction varies with the position{where}, by about {amplitude:.2g}{unit_of('torque')} either way, which explains "
        f"{100 * found.share:.0f} % of what is left (p = {found.p:.1g}): something rubs or is tight there. Numbers are of all "
        f"positions on average.{write}"
    )
    return Finding("friction-by-position", CAUTION, message, {"amplitude": amplitude, **numbers})
