"""The array API, for notebooks: `identify` for arrays in place of files."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bristle.arrays import Array, as_floats
from bristle.data.columns import Key
from bristle.data.experiment.load import Experiment, Run, run_of_table
from bristle.data.experiment.schema import JointDescription, RunKind
from bristle.data.experiment.signals import Context
from bristle.data.experiment.yaml_file import validate
from bristle.data.text_table import RawTable
from bristle.errors import InputError, short, short_list
from bristle.identification.curve import curve
from bristle.identification.identify import identify_joint
from bristle.identification.known_joint import known_joint
from bristle.identification.measured import measured_of
from bristle.model.parameters import SIGNED, Kind, Lugre, Pair, fields_of, lugre_of, unit
from bristle.model.rollout import rollout
from bristle.questions.array_fit.fit import Fit, Stage

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
    """Coulomb, Stribeck and viscous friction (9) from points of velocity and torque, as `identify` finds it in a file.

    >>> import bristle
    >>> v = [-1.0, -0.6, -0.3, -0.15, -0.08, -0.04, -0.02, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 1.0]
    >>> T = [-0.059, -0.0431, -0.0312, -0.0254, -0.0241, -0.0250, -0.0252, 0.0251, 0.0250, 0.0241, 0.0254, 0.0312, 0.0431, 0.059]
    >>> found = bristle.fit(v, T, directions="symmetric")
    >>> round(found.params["alpha_0"], 4)
    0.0193
    >>> found.predict([0.5]).round(3)
    array([0.039])

    Args:
        data: velocities, rad/s (m/s where prismatic), (n,); or a data frame, whose columns the next arguments name.
        torque: of the drive, positive along positive velocity, N*m (N), (n,).
        velocity: the column of a data frame.
        position: rad (m), (n,), where gravity is among the regressors.
        units: of `velocity`, `torque` or `position` where they are not in SI, such as `{"velocity": "deg/s"}`.
        kind: of the joint, `revolute` or `prismatic`.
        options: as under `fit` in an experiment file: `directions`, `law`, `regressors`, `set_up`.

    Raises InputError in one sentence where an array is not n finite numbers (missing values are named by row), an option is
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
    return _fitted("static", _run_of("points", signals, units or {}, kind, options))


def find_segments(
    t: "ArrayLike | None",
    position: "ArrayLike",
    torque: "ArrayLike",
    *,
    velocity: "ArrayLike | None" = None,
    units: Mapping[str, str] | None = None,
    kind: Kind = "revolute",
) -> "pd.DataFrame":
    """The stretches of a run at constant velocity, each a point for `fit`, accepted or rejected with the reasons.

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
    `start` to before `stop`. Raises InputError in one sentence where an array is not n finite numbers.
    """
    experiment, run = _run_of("ramp", _signals(t, position, torque, velocity), units or {}, kind, {})
    return measured_of(experiment, (run,)).to_frame().drop(columns="file")


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

    Raises InputError in one sentence where an array is not n finite numbers, or the torque never grows slowly from zero.
    """
    others = [] if breakaway is None else [breakaway]
    signals = _signals(t, position, torque, None)
    own = _run_of("presliding", signals, units or {}, kind, {**_options_of(others), **options})
    return _fitted("presliding", own, others)


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
            `position_cutoff`, `fixed`, `shared`.

    Raises InputError in one sentence where an array is not n finite numbers, an option is unknown, or the motion cannot be
    fitted.
    """
    priors = [priors] if isinstance(priors, Fit) else priors
    if not all(isinstance(x, Fit) for x in priors):
        expected = "what fit, fit_presliding or fit_dynamic gave, in a list"
        raise InputError(f"priors: got {short(priors)}; expected {expected}")
    signals = _signals(t, position, torque, velocity)
    known = {} if inertia is None else {"inertia": inertia}
    own = _run_of("tracking", signals, units or {}, kind, {**_options_of(priors), **options}, **known)
    return _fitted("dynamic", own, priors, uncertainty=uncertainty)


def friction(velocity: "ArrayLike", of: Fit | Lugre[float]) -> Array:
    """Friction (9) of steady sliding, N*m, in the shape of `velocity`, rad/s, of a fit or of given parameters; 0 at rest.

    >>> import bristle
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.friction([0.0, 0.5, -0.5], law).round(3)
    array([ 0.  ,  0.04, -0.04])

    Raises InputError where a fit knows nothing of friction vs velocity.
    """
    if isinstance(of, Fit):
        return of.friction(velocity)
    v = as_floats(velocity)
    return np.asarray(np.where(v == 0, 0.0, curve(v, of.stribeck)))


def simulate(velocity: "ArrayLike", dt: float, of: Fit | Lugre[float] | Pair[float]) -> Array:
    """Friction torque (3)-(5), N*m, (n,), along a velocity, rad/s, (n,), sampled each `dt` s, from steady sliding on.

    >>> import bristle, numpy as np
    >>> law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    >>> bristle.simulate(np.full(3, 0.5), 1e-3, law).round(3)
    array([0.04, 0.04, 0.04])

    Args:
        velocity: linear between its samples.
        dt: > 0.
        of: a fit of a motion, or parameters, for both directions or for each.

    Raises InputError where the velocity is not n finite numbers, or a fit does not show the bristle in both directions.
    """
    if isinstance(of, Fit):
        known = known_joint(of.joint)
        for d in SIGNED:
            names = known.missing(d)
            if not known.has_law(d) or "sigma_0" in names or "sigma_1" in names:
                what = f"{', '.join(names) or 'friction vs velocity'} of direction {d}"
                raise InputError(f"simulate: {what} is not known; fit a motion that shows it, or give a Lugre")
        make = lugre_of(known.law)
        of = Pair(*(make(*(known.values(d)[name] for name in fields_of(known.law))) for d in SIGNED))
    v = as_floats(velocity)
    if v.ndim != 1:
        raise InputError(f"velocity has shape {v.shape}; expected one dimension, (n,)")
    if lost := np.count_nonzero(~np.isfinite(v)):
        raise InputError(f"velocity has {lost} of {v.size} values that are not finite; simulate the parts between them")
    if not (np.isfinite(dt) and dt > 0):
        raise InputError(f"dt: got {dt!r}; expected seconds between samples, more than 0")
    return rollout(v, float(dt), of).torque


def _signals(t: Any, position: Any, torque: Any, velocity: Any) -> dict[str, Any]:
    """Signals by name. Raises InputError where there is no time."""
    time = _seconds(position) if t is None else t
    if time is None:
        raise InputError("t: missing; give n times, or a series whose index is the time as position")
    return {"time": time, "position": position, "velocity": velocity, "torque": torque}


def _options_of(others: Sequence[Fit]) -> dict[str, Any]:
    """Directions and law of the first of other fits of the same joint, unless others are asked for."""
    return others[0].measured.experiment.fit.model_dump(include={"directions", "law"}) if others else {}


def _fitted(stage: Stage, own: tuple[Experiment, Run], others: Sequence[Fit] = (), *, uncertainty: bool = False) -> Fit:
    """The fit of a run together with those of other fits, as one experiment."""
    experiment, run = own
    runs = _together((experiment, (run,)), *((x.measured.experiment, x.measured.runs) for x in others))
    measured = measured_of(*runs)
    return Fit(joint=identify_joint(measured, uncertainty=uncertainty), measured=measured, stage=stage)


def _of_frame(frame: Any, column: Any, name: str) -> Any:
    """A column of a data frame. Raises InputError where there is none of that name."""
    if not isinstance(column, str) or column not in frame.columns:
        there = short_list(map(str, frame.columns))
        raise InputError(f"{name}: got {short(column)}; expected one of the data frame's columns: {there}")
    return frame[column].to_numpy()


_HERE = Path("arrays")  # in place of the experiment file, in results
_CALLED: dict[RunKind, str] = {"points": "points", "ramp": "holds", "presliding": "slow loading", "tracking": "motion"}


def _run_of(
    what: RunKind,
    signals: Mapping[str, Any],
    units: Mapping[str, str],
    kind: Kind,
    options: Mapping[str, Any],
    **more: Any,
) -> tuple[Experiment, Run]:
    """The experiment of one run whose signals are arrays, and the run.

    Signals are anything that NumPy takes for n numbers, None where not measured, with units such as `deg/s` of those
    that are not in SI; options are as under `fit` in an experiment file, and `more` other keys of it, where a number is
    in SI.

    Raises InputError where a signal is not n finite numbers, or a unit, the kind or an option is unknown.
    """
    joint = {"name": "joint", "kind": kind}
    validate(JointDescription, joint, "joint", None)  # before units are asked of its kind
    if not isinstance(units, Mapping):
        raise InputError(f"units: got {short(units)}; expected units by signal, as {{'velocity': 'deg/s'}}")
    columns = {name: _column(name, values) for name, values in signals.items() if values is not None}
    if unknown := set(units) - set(columns):
        raise InputError(f"units: got {short(min(unknown))}; expected one of {', '.join(columns)}")
    sizes = {name: x.size for name, x in columns.items()}
    if len(set(sizes.values())) > 1:
        raise InputError(f"arrays differ in length: {', '.join(f'{name} has {n}' for name, n in sizes.items())}")
    si = {name: "s" if name == "time" else unit(name, kind) for name in columns}
    declared = {name: {"column": name, "unit": units.get(name, si[name])} for name in columns}
    data = {
        "path": _HERE,
        "joint": joint,
        "signals": declared,
        "runs": [{"files": _CALLED[what], "experiment": what}],
        "cleaning": {"non_finite": "refuse"},
        "fit": dict(options),
        **{
            name: f"{float(x)!r} {unit(name, kind)}" if isinstance(x, int | float) and x is not True else x
            for name, x in more.items()
        },
    }
    experiment = validate(Experiment, data, str(_HERE), Context(kind=kind))
    table = RawTable(
        columns={Key(name): x for name, x in columns.items()},
        rows=next(iter(sizes.values()), 0),
        sha256=hashlib.sha256(b"".join(x.tobytes() for x in columns.values())).hexdigest(),
    )
    return experiment, run_of_table(experiment, table, _CALLED[what])


def _together(
    first: tuple[Experiment, tuple[Run, ...]], *others: tuple[Experiment, tuple[Run, ...]]
) -> tuple[Experiment, tuple[Run, ...]]:
    """The runs of several experiments as one, with the options and joint of the first; each run and each name once."""
    files, runs, names = list[Any](), list[Run](), set[str]()
    for experiment, own in (first, *others):
        for entry, run in zip(experiment.runs, own, strict=True):
            if any(run.record.sha256 == x.record.sha256 and run.kind == x.kind for x in runs):
                continue
            name, count = run.record.file, 2
            while name in names:
                name, count = f"{run.record.file} {count}", count + 1
            names.add(name)
            files.append(entry.model_copy(update={"files": name, "signals": experiment.signals_of(entry)}))
            runs.append(replace(run, record=replace(run.record, file=name)))
    return first[0].model_copy(update={"runs": tuple(files)}), tuple(runs)


def _seconds(index: Any) -> Any:
    """The index of a series as time, from the first date; None where it counts rows or there is none."""
    index = getattr(index, "index", None)
    return None if callable(index) or type(index).__name__ == "RangeIndex" else _in_seconds(index)


def _in_seconds(values: Any) -> Any:
    """Dates and durations as s from the first one; other values unchanged."""
    kind = getattr(getattr(values, "dtype", None), "kind", "")
    if kind not in ("m", "M"):
        return values
    array = np.asanyarray(values, dtype="M8[ns]" if kind == "M" else None)  # in UTC, if they have a time zone
    return (array - array[:1] if kind == "M" else array) / np.timedelta64(1, "s")


def _column(name: str, values: Any) -> Array:
    values = _in_seconds(values) if name == "time" else values
    if getattr(getattr(values, "dtype", None), "kind", "-") in "cmM":
        raise InputError(f"{name}: got numbers of type {values.dtype}; expected n real numbers")
    try:
        column = as_floats(values)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of numbers ({error}); expected n numbers") from error
    if column.ndim != 1:
        expected = f"expected (n,), as of one column of a data frame, frame[{name!r}]"
        raise InputError(f"{name} has shape {column.shape}; {expected}")
    missing = np.flatnonzero(~np.isfinite(column))
    if missing.size:
        rows = f"{missing.size} of {column.size} rows, first in row {missing[0]} (from 0)"
        raise InputError(f"{name} is missing or not finite in {rows}; leave these rows out")
    return column
