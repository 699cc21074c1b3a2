"""A fit of velocity-torque arrays: the joint that files of the same points would give, with a shorter way to its numbers."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import fdtri

from bristle.arrays import Array
from bristle.data.experiment.arrays import run_of_arrays
from bristle.diagnostics import Diagnostic
from bristle.errors import InputError, short
from bristle.estimation.covariance import LEVEL, student
from bristle.identification.fits import Estimate, StaticFit, Uncertainty
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured, measured_of
from bristle.identification.moving_runs import load_columns
from bristle.identification.results import Joint
from bristle.identification.static.curve import curve
from bristle.model.parameters import Direction, Kind, ParameterName

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Method = Literal["profile", "covariance", "bootstrap"]
METHODS: tuple[Method, ...] = ("profile", "covariance", "bootstrap")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Fit:
    """Friction over velocity, fitted to points: T = alpha_0 + alpha_1 exp(-(v / v_s)**2) + alpha_2 v, (9), in SI.

    Parameters are named as in the paper, with their direction where each has its own: `alpha_0+`.
    """

    joint: Joint
    """Everything that was found, as `bristle.identify` gives it for files."""
    measured: Measured
    """What it was found from."""

    @property
    def params(self) -> dict[str, float]:
        """Each parameter, in SI; nan where the points do not show it, which `warnings` explains."""
        return {name: np.nan if e.value is None else e.value for name, e in self._estimates()}

    @property
    def stderr(self) -> dict[str, float]:
        """The standard error of each, statistical and systematic together; nan where there is none."""
        return {
            name: float(np.hypot(np.nan if e.standard_error is None else e.standard_error, e.systematic or 0.0))
            for name, e in self._estimates()
        }

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """Everything to know about the points, the fit and its parameters, each once; `str` makes the sentence."""
        return tuple(dict.fromkeys(self.joint.all_warnings()))

    def conf_int(self, level: float = LEVEL, method: Method = "profile") -> "pd.DataFrame":
        """Confidence intervals: a row for each parameter, with columns `lower` and `upper`, in SI.

        Args:
            level: of confidence, between 0 and 1; by profile at most 0.95, by bootstrap 0.95.
            method: `profile` (where the cost, minimised over all else, reaches its threshold), `covariance` (Student's t) or
                `bootstrap` (of resampled residuals). Statistical, each of them.

        Raises InputError where the level or the method is none of these. nan where there is no interval.
        """
        import pandas as pd

        if method not in METHODS:
            raise InputError(f"method: got {short(method)}; expected one of {', '.join(METHODS)}")
        if not 0 < level < 1 or (method == "profile" and level > LEVEL) or (method == "bootstrap" and level != LEVEL):
            wanted = {"profile": f"more than 0 and at most {LEVEL:g}", "bootstrap": f"{LEVEL:g}"}.get(method, "0 to 1")
            raise InputError(f"level: got {level!r}; expected {wanted} by {method}")
        rows = {
            str(ParameterName(name, Direction(d))): self._interval(fit, name, level, method)
            for d, fit in self.joint.static.items()
            for name in fit.parameters
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=["lower", "upper"])

    def predict(self, velocity: ArrayLike, position: ArrayLike | None = None) -> Array:
        """The torque at some velocities, N*m, in the shape of `velocity`, rad/s: friction, and what else was fitted.

        `position`, rad, is needed where gravity was. nan where the direction was not measured. Raises InputError where the
        position is missing, or nothing was fitted.
        """
        v = np.asarray(velocity, dtype=float)
        torque = np.full(v.shape, np.nan)
        for d, fit in self.joint.static.items():
            law, sign = fit.values(), {"+": 1.0, "-": -1.0}.get(d)
            own = np.isfinite(v) if sign is None else v * sign > 0
            if law is not None:
                torque[own] = curve(v[own], law)
        torque[v == 0] = 0.0  # friction of a joint at rest is any up to breakaway
        loads = {n: e.value or 0.0 for fit in self.joint.static.values() for n, e in fit.parameters.items()}
        asked = [name for name in self.measured.experiment.fit.regressors or () if name != "inertia"]
        if "gravity" in asked and position is None:
            raise InputError("predict: gravity was fitted; give the position too")
        signals = {
            "velocity": v,
            "position": np.broadcast_to(np.asarray(0.0 if position is None else position), v.shape),
        }
        columns = load_columns(asked, lambda name: np.ravel(signals[name]), v.size)
        return np.asarray(torque + sum(loads[n] * np.reshape(x, v.shape) for n, x in columns.items()))

    def to_frame(self) -> "pd.DataFrame":
        """One row for each parameter: value, standard error, ends of the 95 % interval, unit and warnings."""
        import pandas as pd

        rows = [
            {
                "value": e.value, "standard_error": e.standard_error, "lower": (e.interval or (None, None))[0],
                "upper": (e.interval or (None, None))[1], "unit": e.unit, "warnings": "; ".join(map(str, e.warnings)),
            }
            for _, e in self._estimates()
        ]  # fmt: skip  # a row
        return pd.DataFrame(rows, index=pd.Index([name for name, _ in self._estimates()], name="parameter"))

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """The points, the fitted curve and its 95 % band over velocity, drawn into `ax` or new axes, which are returned."""
        from bristle.questions.array_fit.figure import draw

        return draw(self, ax)

    def __repr__(self) -> str:
        """The fit report, as the command line prints it."""
        from bristle.questions.array_fit.figure import text

        return text(self)

    def _repr_html_(self) -> str:
        """The table and the curve, for a notebook."""
        from bristle.questions.array_fit.figure import html

        return html(self)

    def _estimates(self) -> Iterator[tuple[str, Estimate]]:
        return (
            (str(ParameterName(name, Direction(d))), e)
            for d, fit in self.joint.static.items()
            for name, e in fit.parameters.items()
        )

    def _interval(self, fit: StaticFit, name: str, level: float, method: Method) -> tuple[float, float]:
        """Of one parameter that has a value; nan where there is none."""
        e, ways = fit.parameters[name], fit.uncertainty.get(name)
        if e.value is None or (ways is None and method != "covariance"):
            return np.nan, np.nan
        if method == "covariance" and ways is not None and ways.covariance is not None and level == LEVEL:
            return ways.covariance
        if method == "covariance":
            reach = float(student(fit.degrees_of_freedom, level)) * (
                np.nan if e.standard_error is None else e.standard_error
            )
            return e.value - reach, e.value + reach
        if method == "bootstrap":
            return (np.nan, np.nan) if ways is None or ways.bootstrap is None else ways.bootstrap
        return _by_profile(ways, level, fit.degrees_of_freedom)


def _by_profile(ways: Uncertainty | None, level: float, freedom: float) -> tuple[float, float]:
    """Where the profile passes the threshold of a level, which is F's quantile beside that of 95 %."""
    if ways is None or ways.profile is None or level == LEVEL:
        return (np.nan, np.nan) if ways is None or ways.profile is None else ways.profile
    values, cost = ways.curve
    if not values.size:
        return np.nan, np.nan
    height = float(fdtri(1, freedom, level) / fdtri(1, freedom, LEVEL))
    least = int(np.argmin(cost))
    low = float(np.interp(-height, -cost[: least + 1], values[: least + 1]))
    high = float(np.interp(height, cost[least:], values[least:]))
    return low, high


def fit_points(signals: Mapping[str, Any], units: Mapping[str, str], kind: Kind, options: Mapping[str, Any]) -> Fit:
    """The fit of velocity-torque points; arguments and errors as of `bristle.fit`."""
    experiment, run = run_of_arrays("points", signals, units, kind, options)
    measured = measured_of(experiment, (run,))
    return Fit(joint=identify_joint(measured), measured=measured)
