"""Fits of arrays: the joint that files of the same data would give, with a shorter way to its numbers."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bristle.arrays import Array, as_floats
from bristle.control.adaptation import Law
from bristle.control.compensator import Name
from bristle.control.running import RunningCompensator
from bristle.errors import InputError, short
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.findings import Finding, Severity
from bristle.identification.fits import Estimate, Uncertainty
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import load_columns, regressors_of, terms_of
from bristle.identification.results import Joint
from bristle.model.parameters import Direction, ParameterName
from bristle.page.plain import columns, interval, pair, wrapped
from bristle.page.wording import direction
from bristle.simulation.joint_model import JointModel

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Method = Literal["profile", "covariance", "bootstrap"]
METHODS: tuple[Method, ...] = ("profile", "covariance", "bootstrap")
Stage = Literal["static", "presliding", "dynamic"]


class _Row(NamedTuple):
    """One parameter of a fit."""

    name: str
    estimate: Estimate
    ways: Uncertainty | None
    freedom: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Fit:
    """Friction fitted to arrays, in SI: the curve (9) from points, the bristle from slow loading, or all of LuGre (3)-(5) from a motion.

    Parameters are named as in the paper, with their direction where each has its own: `alpha_0+`.
    """

    joint: Joint
    """Everything that was found, as `bristle.identify` gives it for files."""
    measured: Measured
    """What it was found from."""
    stage: Stage = "static"
    """Which part of the joint `params` and the like are of."""

    @property
    def params(self) -> dict[str, float]:
        """Each parameter, in SI; nan where the data do not show it, which `warnings` explains."""
        return {row.name: np.nan if row.estimate.value is None else row.estimate.value for row in self._rows()}

    @property
    def model(self) -> JointModel:
        """The joint as one model: friction, CasADi functions, a compensator."""
        return JointModel(self.joint, self.measured.experiment)

    @property
    def stderr(self) -> dict[str, float]:
        """The standard error of each, in SI; nan where there is none."""
        return {row.name: np.nan if (error := row.estimate.total_error) is None else error for row in self._rows()}

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Everything to know about the data, the fit and its parameters, each once; `str` makes the sentence."""
        return tuple(dict.fromkeys(self.joint.all_warnings()))

    def conf_int(self, level: float | None = None, method: Method | None = None) -> "pd.DataFrame":
        """Confidence intervals: a row for each parameter, with columns `lower` and `upper`, in SI.

        Args:
            level: of confidence, between 0 and 1; None: 0.95; by profile at most 0.95, by bootstrap 0.95.
            method: `profile` (where the cost, minimised over all else, reaches its threshold), `covariance` (Student's t) or
                `bootstrap` (of resampled residuals); None: the interval that the results state, which of points is the
                profile's, and at another level the covariance's. A motion has the first and the last with `uncertainty` only.

        Raises InputError where the level or the method is none of these, or no interval was made so. nan where there is no interval.
        """
        import pandas as pd

        if method not in (None, *METHODS):
            raise InputError(f"method: got {short(method)}; expected one of {', '.join(METHODS)}")
        level = levels.CONFIDENCE if level is None else level
        borne = {"profile": level <= levels.CONFIDENCE, "bootstrap": level == levels.CONFIDENCE}
        if not 0 < level < 1 or not borne.get(method or "", True):
            ends = {"profile": f"more than 0 and at most {levels.CONFIDENCE:g}", "bootstrap": f"{levels.CONFIDENCE:g}"}
            wanted = ends.get(method or "", "0 to 1")
            raise InputError(f"level: got {level!r}; expected {wanted}{f' by {method}' if method else ''}")
        if method in ("profile", "bootstrap") and all(row.ways is None for row in self._rows()):
            raise InputError(
                f"method: no interval by {method} was made; of a motion they are where fit_dynamic was given uncertainty=True"
            )
        rows = {row.name: _interval(row, level, method) for row in self._rows()}
        return pd.DataFrame.from_dict(rows, orient="index", columns=["lower", "upper"])

    def friction(self, velocity: ArrayLike) -> Array:
        """Friction (9) of steady sliding, N*m, in the shape of `velocity`, rad/s: 0 at rest, nan in a direction that is not known.

        Raises InputError where the fit knows nothing of friction vs velocity.
        """
        return self.model.friction(velocity)

    def predict(self, velocity: ArrayLike, position: ArrayLike | None = None) -> Array:
        """The torque of steady motion at some velocities, N*m, in the shape of `velocity`, rad/s: friction, and what else was fitted.

        `position`, rad, is needed where gravity, cogging or ripple was fitted. Raises InputError where it is missing, or nothing is known of
        friction vs velocity.
        """
        v = as_floats(velocity)
        fitted = {row.name: row.estimate.value or 0.0 for row in self._rows()}
        asked = [name for name in regressors_of(fitted.keys(), self.joint.kind) if name != "inertia"]
        placed = [name.partition("_")[0] for name in asked if "position" in terms_of(name).needs]
        if placed and position is None:
            raise InputError(f"predict: {placed[0]} was fitted; give the position too")
        q = np.broadcast_to(as_floats(0.0 if position is None else position), v.shape)
        columns = load_columns(asked, lambda name: np.ravel({"velocity": v, "position": q}[name]), v.size)
        return np.asarray(self.friction(v) + sum(fitted[n] * np.reshape(x, v.shape) for n, x in columns.items()))

    def compensator(
        self,
        law: Law | None = "partial",
        gamma: float | tuple[float, ...] = 20.0,
        *,
        name: Name = "lugre",
        **settings: Any,
    ) -> RunningCompensator:
        """A compensator of this joint for a loop in real time: arguments and errors as of `JointModel.compensator`.

        What was not identified of the bristle is filled in as for `bristle adapt`. Raises InputError where the friction is not
        known in both directions, nothing is known of the bristle or of the inertia that its damping rests on, or a setting
        cannot be.
        """
        return self.model.compensator(law, gamma, name=name, **settings)

    def to_frame(self) -> "pd.DataFrame":
        """One row for each parameter: value, standard error, ends of the 95 % interval, unit and warnings."""
        import pandas as pd

        of = {row.name: row.estimate for row in self._rows()}
        rows = {
            name: (e.value, e.standard_error, *(e.interval or (None, None)), e.unit, "; ".join(map(str, e.warnings)))
            for name, e in of.items()
        }
        columns = ["value", "standard_error", "lower", "upper", "unit", "warnings"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns).rename_axis("parameter")

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """What was measured and what the fit makes of it, drawn into `ax` or new axes, which are returned.

        Points over velocity with the fitted curve and its 95 % band; slow loading as torque over displacement; a motion as
        torque over time.
        """
        from bristle.questions.array_fit.figure import draw_stage

        return draw_stage(self.joint, self.stage, ax)

    def __repr__(self) -> str:
        """How the fit ended, its parameters with their errors and 95 % intervals, and what to be careful about; 80 columns wide."""
        ends, frame = self.conf_int(), self.to_frame()
        rows = [("parameter", "value +/- standard error", "95 % interval")]
        for name, value in self.params.items():
            low, high = map(float, ends.loc[name])
            shown = "not identifiable" if np.isnan(value) else f"{pair(value, self.stderr[name])} {frame.unit[name]}"
            rows.append((name, shown, "none" if np.isnan(low + high) else interval((low, high))))
        return "\n".join(wrapped([*_outcomes(self), *columns(rows), *_serious(self)]))

    def _repr_html_(self) -> str:
        """The table and the curve, for a notebook."""
        from bristle.questions.array_fit.figure import draw_stage, html

        frame, draw = self.to_frame().drop(columns="warnings"), partial(draw_stage, self.joint, self.stage)
        return html(" ".join(_outcomes(self)), _serious(self), frame, draw, "fit")

    def _rows(self) -> Iterator[_Row]:
        """Every parameter of this stage."""
        slow, moving = self.joint.presliding, self.joint.moving
        if self.stage == "static":
            for d, fit in self.joint.static.items():
                for name, e in fit.parameters.items():
                    yield _Row(_named(name, d), e, fit.uncertainty.get(name), fit.degrees_of_freedom)
        elif self.stage == "presliding":
            for d, x in slow.fits.items() if slow else ():
                yield _Row(_named("sigma_0", d), x.sigma_0, x.uncertainty.get("sigma_0"), x.degrees_of_freedom)
                yield _Row(_named("sigma_1", d), x.sigma_1, None, np.inf)
            for d, e in slow.breakaway.items() if slow else ():
                yield _Row(_named("breakaway", d), e, None, np.inf)
        else:
            for key, e in moving.parameters.items() if moving else ():
                yield _Row(str(key), e, moving.uncertainty.get(key) if moving else None, np.inf)


def _named(name: str, direction: str) -> str:
    return str(ParameterName(name, Direction(direction)))


def _interval(row: _Row, level: float, method: Method | None) -> tuple[float, float]:
    """Of one parameter; nan where there is none."""
    e, ways, none = row.estimate, row.ways, (np.nan, np.nan)
    if e.value is None:
        return none
    if method is None and level == levels.CONFIDENCE:
        return e.interval or none
    made: tuple[float, float] | None = getattr(ways, method) if ways and method else None
    if made is not None and level == levels.CONFIDENCE:
        return made
    if method in (None, "covariance"):
        reach = student(row.freedom, level) * (e.total_error or np.nan)
        return e.value - reach, e.value + reach
    if made is None or ways is None or not ways.curve[0].size:
        return none
    # Where the profile passes the threshold of the level, which is F's quantile beside that of 95 %; F(1, n) is t squared.
    values, cost = ways.curve
    height = (student(row.freedom, level) / student(row.freedom)) ** 2
    least = int(np.argmin(cost))
    low = float(np.interp(-height, -cost[: least + 1], values[: least + 1]))
    high = float(np.interp(height, cost[least:], values[least:]))
    return low, high


def _outcomes(fit: Fit) -> Iterator[str]:
    """How each fit of this stage ended."""
    slow, moving = fit.joint.presliding, fit.joint.moving
    if fit.stage == "static":
        for d, static in fit.joint.static.items():
            error = "" if static.relative_error is None else f" Relative error {static.relative_error:.3g} %."
            yield f"{direction(d)}: {static.n} points. {static.outcome}{error}"
    elif fit.stage == "presliding":
        for d, one in slow.fits.items() if slow else ():
            yield f"{direction(d)}: {len(one.loadings)} loadings, g0 = {one.level:.4g} ({one.level_source})"
    elif moving is not None:
        yield f"{moving.n} equations. {moving.outcome} Relative error {moving.relative_error:.3g} %."


def _serious(fit: Fit) -> Iterator[str]:
    """What is critical about it, and what calls for caution."""
    return (f"{w.severity}: {w.coded}" for w in fit.warnings if w.severity is not Severity.NOTE)
