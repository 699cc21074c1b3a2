"""Orders of cogging and ripple: resolution of the positions, and which orders the data show."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import PERIODIC
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.score_test import Score, scores
from bristle.findings import NOTE, Finding
from bristle.identification.dynamic.claims import jacobian_and_residuals
from bristle.identification.dynamic.descent import solve_dynamic
from bristle.identification.dynamic.priors import posed_and_start
from bristle.identification.dynamic.residual_analysis import columns_of
from bristle.identification.measured import Measured, with_loads, with_options
from bristle.identification.moving_runs import directions, turn_of, with_orders
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.points import groups, point_regressors, points_problem

_MOST = 200  # orders tried
_AT_ONCE = 3  # most orders found


def with_periods(measured: Measured) -> Measured:
    """The same with the orders that the data show, if asked for. Raises InputError for too fine an order."""
    experiment, training = measured.experiment, measured.moving(hold_out=False)
    asked = [name for name in PERIODIC if name in (experiment.fit.regressors or ())]
    if not asked:
        return measured
    # the highest order with at least two equations per period
    every = experiment.fit.every
    moved = [np.abs(np.diff(r.position[:: r.decimation(every)])) for r in training if r.position is not None]
    steps = np.concatenate([np.zeros(0), *moved])
    whole, turn = turn_of(experiment.joint.kind)
    most = int(whole / 2 / float(np.median(steps[steps > 0]))) if steps.any() else np.iinfo(np.int64).max
    if isinstance(experiment.fit.orders, tuple):
        if too_fine := [k for k in experiment.fit.orders if k > most]:
            raise InputError(
                f"{experiment.path.name}: fit.orders: got {too_fine[0]}; expected at most {most}, half of a period between two "
                "equations of the moving runs: leave it out, lower fit.decimation, or measure slower"
            )
        return measured
    if training:
        problem, start = posed_and_start(experiment, directions(experiment, training), training, {}, None)
        known, rest, private = jacobian_and_residuals(problem, solve_dynamic(problem, start))
        tried = _tried(experiment, problem.position, most)
        columns = {k: private.off(columns_of(problem, with_orders(asked, (k,), experiment.joint.kind))) for k in tried}
    elif kept := measured.points(hold_out=False):  # orders up to half the number of points
        (sides, points), *_ = groups(experiment, kept)  # one solve of both directions
        posed = points_problem(points, sides, point_regressors(experiment), experiment.fit.friction)
        theta = solve(posed, default_range(posed.velocity)).theta
        known, rest = posed.jacobian(theta), posed.residuals(theta)
        tried = _tried(experiment, np.array([s.position for s in points], dtype=float), len(points) // 2)
        names = [name for k in tried for name in with_orders(asked, (k,), experiment.joint.kind)]
        placed = {
            s.place: s
            for run, found in zip(measured.runs, measured.segments, strict=True)
            for s in (with_loads(run.record, found, names) if run.kind == "ramp" else found)
        }
        linear = points_problem([placed[s.place] for s in points], sides, names, experiment.fit.friction).linear
        each = np.split(linear[:, linear.shape[1] - 2 * len(asked) * len(tried) :], max(len(tried), 1), axis=1)
        columns = dict(zip(tried, each, strict=False))
    else:
        known, rest, columns = np.zeros((0, 0)), np.zeros(0), {}
    orders, count, last = shown_orders(known, rest, columns), len(columns), max(columns, default=0)
    shown, named = with_options(measured, orders=orders), ", ".join(map(str, orders))
    then = f"they are fitted. To keep them, write orders: [{named}] under fit." if orders else "none is fitted."
    message = (
        f"Of {count} orders, up to {last} per {turn}, {named or 'none'} explain more of what the fit without them leaves than "
        f"chance does (F tests at 1 %, corrected for all orders tried): {then}"
    )
    numbers = {"tried": count, "last": last, "turn": turn, "orders": orders}
    note = Finding("orders-found" if orders else "no-orders", NOTE, message, numbers)
    return replace(shown, findings=(*shown.findings, note))


def shown_orders(known: Array, rest: Array, columns: Mapping[int, Array]) -> tuple[int, ...]:
    """The orders, three at most, whose columns (n, k) explain a fit's residuals (n,) beside `known` (n, p).

    Each passes an F test beside all others, corrected for all orders tried; the orders not chosen tell the noise.
    """

    def beside(tried: Sequence[int], others: Sequence[int], inflated: float = 1.0) -> dict[int, Score]:
        """The score of each order beside others."""
        basis = np.hstack([known, *(columns[x] for x in others)])
        return dict(zip(tried, scores(basis, rest, [columns[k] for k in tried], inflated), strict=True))

    chosen: list[int] = []
    while len(chosen) < min(_AT_ONCE, len(columns)):
        found = beside([k for k in columns if k not in chosen], chosen)
        chosen.append(max(found, key=lambda k: found[k].share))
    left = beside([k for k in columns if k not in chosen], chosen)
    shares = [x.share * rest.size / chdtri(columns[k].shape[1], 0.5) for k, x in left.items()]
    while chosen:
        noise = float(np.median(shares)) if shares else 1.0
        chance = {k: beside([k], [x for x in chosen if x != k], noise)[k].p for k in chosen}
        last = max(chosen, key=lambda k: chance[k])
        if chance[last] * len(columns) * _AT_ONCE < levels.SIGNIFICANCE:
            break
        chosen.remove(last)
    return tuple(sorted(chosen))


def _tried(experiment: Experiment, positions: Array, most: int) -> range:
    """Orders with a full period within the positions, up to a highest one."""
    (turn, _), reach = turn_of(experiment.joint.kind), float(np.ptp(positions))
    return range(max(int(np.ceil(turn / reach)), 1), min(most, _MOST) + 1) if reach > 0 else range(0)
