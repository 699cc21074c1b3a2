"""Arrays in, fits out: what `identify` does for files, for who sits in a notebook."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bristle.arrays import Array
from bristle.data.experiment.arrays import seconds
from bristle.errors import InputError, short, short_list
from bristle.model.parameters import Kind, Lugre, Pair
from bristle.questions.array_fit.fit import (
    Fit,
    along,
    fit_motion,
    fit_points,
    fit_slow_loading,
    segments_frame,
    simulated_torque,
    steady,
)

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike


def fit(
    data: "ArrayLike | pd.DataFrame",
    /,
    torque: "ArrayLike | str | None" = None,
    *,
    velocity: str | None = None,
    position: "ArrayLike | str | None" = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    **options: Any,
) -> Fit:
    """Coulomb, Stribeck and viscous friction (9) from points of velocity and torque: what `identify` gives for a file of them.

    >>> import bristle
    >>> v = [-1.0, -0.6, -0.3, -0.15, -0.08, -0.04, -0.02, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0]
    >>> T = [-0.059, -0.0431, -0.0312, -0.0254, -0.0241, -0.0250, -0.0252, 0.0251, 0.0250, 0.0241, 0.0254, 0.0312, 0.0431, 0.059]
    >>> found = bristle.fit(v, T, directions="symmetric")
    >>> round(found.params["alpha_0"], 4)
    0.0193
    >>> found.predict([0.5]).round(3)
    array([0.039])

    Args:
        data: velocities, rad/s (m/s where prismatic), (n,); or a data frame, of which `velocity`, `torque` and `position` name columns.
        torque: of the drive, positive along positive velocity, N*m (N), (n,).
        velocity: the column of a data frame.
        position: rad (m), (n,), where gravity is among the regressors.
        units: of `velocity`, `torque` or `position` where they are not in SI, such as `{"velocity": "deg/s"}`.
        kind: of the joint, `revolute` or `prismatic`.
        options: as under `fit` in an experiment file: `directions`, `law`, `regressors`, `set_up`.

    Raises InputError in one sentence where an array is no n finite numbers (missing values are named by row), an option is
    unknown, or the points cannot be fitted.
    """
    signals: dict[str, Any] = {"velocity": data, "torque": torque, "position": position}
    if hasattr(data, "columns"):
        signals = {"velocity": _of_frame(data, velocity, "velocity"), "torque": _of_frame(data, torque, "torque")}
        signals |= {} if position is None else {"position": _of_frame(data, position, "position")}
    elif velocity is not None:
        raise InputError("velocity: names a column of a data frame; got arrays, of which the first is the velocity")
    if signals["torque"] is None:
        raise InputError("torque: missing; give n torques beside n velocities, or name the column of a data frame")
    return fit_points(signals, units or {}, kind, options)


def find_segments(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    velocity: "ArrayLike | None" = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
) -> "pd.DataFrame":
    """The stretches of a run at constant velocity, each a point for `fit`: those that are kept and those that are not, with the reasons.

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 12, 0.002)
    >>> v = np.repeat([0.1, 0.3, 0.9], 2000)
    >>> T = 0.02 + 0.04 * v + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = bristle.find_segments(t, np.cumsum(v) * 0.002, T)
    >>> found[found.accepted].velocity.round(2).tolist()
    [0.1, 0.3, 0.9]

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        velocity: rad/s (m/s), (n,), where it is logged; else from the position.
        units: of what is not in SI, by `time`, `position`, `velocity`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.

    Returns a row for each stretch: velocity, torque, its standard error, accepted, reasons, warnings, and its samples from
    `start` to before `stop`. Raises InputError in one sentence where an array is no n finite numbers.
    """
    return segments_frame(_signals(t, position, torque, velocity), units or {}, kind)


def fit_presliding(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    breakaway: Fit | None = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    **options: Any,
) -> Fit:
    """The bristle's stiffness from a torque that loads the resting joint slowly: section 3.2, (13) to (15).

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 20, 0.002)
    >>> T = 0.02 * np.interp(t % 20, [0, 5, 15, 20], [0, 1, -1, 0])
    >>> dT = np.diff(T, prepend=0.0)
    >>> q = np.cumsum(dT / (6.0 * (1 - np.sign(dT) * T / 0.025)))
    >>> found = bristle.fit_presliding(t, q, T)
    >>> round(found.params["sigma_0+"], 1)
    6.0

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        breakaway: what `fit` gave for the same joint: its alpha_0 + alpha_1 is the torque at which the joint slides; None: from
            these data, where they slide, or a lower bound.
        units: of what is not in SI, by `time`, `position`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.
        options: as under `fit` in an experiment file: `breakaway_displacement`.

    Raises InputError in one sentence where an array is no n finite numbers, or the torque never grows slowly from zero.
    """
    return fit_slow_loading(_signals(t, position, torque, None), units or {}, kind, options, breakaway)


def fit_dynamic(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    velocity: "ArrayLike | None" = None,
    priors: Fit | Sequence[Fit] = (),
    inertia: float | str | None = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
    uncertainty: bool = False,
    **options: Any,
) -> Fit:
    """All of LuGre (3)-(5) from a motion, with inertia and what else makes torque, as far as the motion shows them.

    >>> import bristle, numpy as np
    >>> t = np.arange(0, 8, 0.002)
    >>> v = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    >>> q = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) * 0.002
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> T = bristle.simulate(v, 0.002, law) + 0.001 * np.gradient(v, t)
    >>> T += 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    >>> found = bristle.fit_dynamic(t, q, T, directions="symmetric")
    >>> round(found.params["alpha_0"], 3), round(found.params["inertia"], 4)
    (0.02, 0.001)

    Args:
        t: s, (n,); None: the index of `position`, which is a series.
        position: rad (m where prismatic), (n,).
        torque: of the drive, N*m (N), (n,).
        velocity: rad/s (m/s), (n,), where it is logged; else from the position.
        priors: what `fit` and `fit_presliding` gave for the same joint; all is then fitted together.
        inertia: kg*m**2 (kg), or a quantity such as `0.05 +/- 0.01 kg*m^2`, which is a prior; None: fitted.
        units: of what is not in SI, by `time`, `position`, `velocity`, `torque`.
        kind: of the joint, `revolute` or `prismatic`.
        uncertainty: whether each parameter gets its intervals by profile and bootstrap too, which takes longer.
        options: as under `fit` in an experiment file: `directions`, `law` (if not given, that of the first prior), `regressors`,
            `position_cutoff`, `predict`, `fixed`, `shared`.

    Raises InputError in one sentence where an array is no n finite numbers, an option is unknown, or the motion cannot be
    fitted.
    """
    priors = [priors] if isinstance(priors, Fit) else priors
    if not all(isinstance(x, Fit) for x in priors):
        raise InputError(
            f"priors: got {short(priors)}; expected what fit, fit_presliding or fit_dynamic gave, in a list"
        )
    signals = _signals(t, position, torque, velocity)
    return fit_motion(signals, units or {}, kind, options, priors, inertia, uncertainty=uncertainty)


def friction(velocity: "ArrayLike", of: Fit | Lugre[float]) -> Array:
    """Friction (9) of steady sliding, N*m, in the shape of `velocity`, rad/s, of a fit or of given parameters; 0 at rest.

    >>> import bristle
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.friction([0.0, 0.5, -0.5], law).round(3)
    array([ 0.  ,  0.04, -0.04])

    Parameters of another law are `lugre_of` it:

    >>> from bristle.model.laws.registry import law_named
    >>> from bristle.model.parameters import lugre_of
    >>> drag = lugre_of(law_named("lorentzian+quadratic"))(*law, alpha_3=0.01, v_end=1.0)
    >>> bristle.friction([0.5], drag).round(4)
    array([0.0426])

    Raises InputError where a fit knows nothing of friction vs velocity.
    """
    return of.friction(velocity) if isinstance(of, Fit) else steady(velocity, of)


def simulate(velocity: "ArrayLike", dt: float, of: Fit | Lugre[float] | Pair[float]) -> Array:
    """Friction torque (3)-(5), N*m, (n,), along a velocity, rad/s, (n,), with samples `dt` s apart, the bristle bent as in steady sliding at first.

    >>> import bristle, numpy as np
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.simulate(np.full(3, 0.5), 1e-3, law).round(3)
    array([0.04, 0.04, 0.04])

    Args:
        velocity: linear between its samples.
        dt: > 0.
        of: a fit of a motion, or parameters, for both directions or for each.

    Raises InputError where the velocity is no n finite numbers, or a fit does not show the bristle in both directions.
    """
    return simulated_torque(velocity, dt, of) if isinstance(of, Fit) else along(velocity, dt, of)


def _signals(t: Any, position: Any, torque: Any, velocity: Any) -> dict[str, Any]:
    """By name. Raises InputError where there is no time."""
    time = seconds(position) if t is None else t
    if time is None:
        raise InputError("t: missing; give n times, or a series whose index is the time as position")
    return {"time": time, "position": position, "velocity": velocity, "torque": torque}


def _of_frame(frame: Any, column: Any, name: str) -> Any:
    """A column of a data frame. Raises InputError where it has none of that name."""
    if not isinstance(column, str) or column not in frame.columns:
        raise InputError(
            f"{name}: got {short(column)}; expected one of the data frame's columns: {short_list(map(str, frame.columns))}"
        )
    return frame[column].to_numpy()
