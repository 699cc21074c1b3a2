"""Everything that is found out about which parameters of a joint matter: local, mapped and global sensitivity, and Fisher information."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.identification.fisher import STATIC, Information, motion_information, names_of, static_information
from bristle.identification.results import Joint
from bristle.model.parameters import Kind, Lugre, Pair, unit
from bristle.progress import Progress, teller
from bristle.questions.sensitivity.joint import Model
from bristle.questions.sensitivity.local import Local, Map, Motion, Tornado, grid, local, sensitivity_map, tornado
from bristle.questions.sensitivity.parameter_box import box_of
from bristle.questions.sensitivity.sobol import Global, global_sensitivity
from bristle.simulation.joint_loop import JointLoop

SAMPLES = 1024
"""Of the Sobol indices, if no other number is given."""
SEED = 0
_LEAST = 32
_STRIBECK = ("alpha_1", "v_s")
"""What a fit without a Stribeck term does not have."""
_NOISE = 0.05
"""Where no moving run tells the noise: this share of alpha_0, white, at 1 kHz."""
_STEPS = 5


class Expected(NamedTuple):
    """Fisher information of one measurement, beside what the joint's own fit has."""

    what: str
    information: Information
    errors: Mapping[str, float]
    """Standard errors of the joint's own fit, by name."""
    noise: str
    """What the noise is taken from; one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Exploration:
    """Everything that is found out about which parameters of a joint matter."""

    name: str
    kind: Kind
    simulated: bool
    model: Model
    motion: Motion
    box: Mapping[str, tuple[float, float]]
    """The parameters' 95 % intervals, by name."""
    local: Local
    settled: Array
    """Total shares over the last period of the motion, (6,)."""
    map: Map
    tornado: tuple[Tornado, ...]
    expected: tuple[Expected, ...]
    sobol: Global | None
    assumptions: tuple[str, ...]
    seed: int = SEED


_MOST = 2**17
"""Samples of the Sobol indices, with which a joint of six parameters takes some minutes."""


def check_samples(samples: int) -> None:
    """Raises InputError where so many samples cannot be drawn; 0 is no Sobol indices at all."""
    if samples and (not _LEAST <= samples <= _MOST or samples & (samples - 1)):
        raise InputError(
            f"samples: got {samples}; expected a power of two from {_LEAST} to {_MOST}, or 0 to leave the Sobol indices out"
        )


def explore(
    joint: Joint,
    asked: tuple[Model, Motion, JointLoop | str],
    samples: int = SAMPLES,
    progress: Progress | None = None,
) -> Exploration:
    """Local, mapped and global sensitivity and the information of a joint; `asked` as `of_joint` or `of_gripper` gives it.

    Raises InputError where so many samples cannot be drawn.
    """
    check_samples(samples)
    model, moved, subject = asked
    tell = teller(progress, _STEPS)
    tell("derivatives along the motion")
    near = local(model.p, moved)
    tell("map over amplitude and frequency")
    mapped = sensitivity_map(model.p, *grid(moved))
    box, said = box_of(model.estimates)
    tell("tornado charts and information")
    swings = tornado(model.p, box, moved) if box else ()
    expected = tuple(x for x in (_of_motion(joint, model, moved), _of_static(joint)) if x is not None)
    found, why = _sobol(model, box, moved, subject, samples, progress)
    return Exploration(
        name=joint.name, kind=joint.kind, simulated=joint.simulated, model=model, motion=moved, box=box, local=near,
        settled=near.shares(last=moved.samples), map=mapped, tornado=swings,
        expected=expected, sobol=found, assumptions=(*model.said, *said, *why),
    )  # fmt: skip  # a list of values


def _sobol(
    model: Model, box: Mapping[str, tuple[float, float]], moved: Motion, subject: JointLoop | str, samples: int,
    progress: Progress | None,
) -> tuple[Global | None, tuple[str, ...]]:  # fmt: skip
    """Sobol indices over the intervals, or the sentence why there are none."""
    if not samples:
        return None, ("Sobol indices were not asked for (samples: 0).",)
    if isinstance(subject, str) or not box:
        return None, (
            f"No Sobol indices: {subject if isinstance(subject, str) else 'no parameter has a finite interval'}.",
        )
    own = replace(subject, amplitude=moved.amplitude, frequency=moved.frequency)
    try:
        return global_sensitivity(model.p, box, own, samples=samples, seed=SEED, progress=progress), ()
    except InputError as error:
        return None, (f"No Sobol indices: {error}.",)


def _of_motion(joint: Joint, model: Model, moved: Motion) -> Expected:
    """What the torque along the motion tells, beside the extra terms that the joint's own fit has to find as well."""
    noise, said = _noise(joint, model.p, moved.period)
    course, fit = moved.course, joint.moving
    columns = {
        "inertia": course.acceleration, "offset": np.ones_like(course.velocity),
        "gravity_sin": np.sin(course.position), "gravity_cos": np.cos(course.position),
    }  # fmt: skip  # a table
    fitted = fit.known if fit is not None else {"inertia": 0.0}
    extra = {name: column for name, column in columns.items() if name in (fit.names if fit is not None else fitted)}
    friction = names_of(model.p)
    names = (*friction, *extra)
    values = np.array(
        [*np.concatenate([model.p] if isinstance(model.p, Lugre) else model.p), *(fitted[n] for n in extra)]
    )
    matrix = motion_information(course.velocity, moved.period, model.p, noise, extra)
    held = [name for name in friction if name in model.assumed and name.startswith(_STRIBECK)]
    errors = {name: e.standard_error for name, e in model.estimates.items() if e.standard_error}
    if fit is not None:
        errors |= {name: e.standard_error for name, e in fit.parameters.items() if name in extra and e.standard_error}
    return _expected("the motion", Information(names=names, point=values, matrix=matrix), errors, said, held)


def _expected(what: str, full: Information, errors: Mapping[str, float], noise: str, held: Sequence[str]) -> Expected:
    """The information of all but what is held, which the joint's own fit does not have."""
    kept = [k for k, name in enumerate(full.names) if name not in held]
    names = tuple(full.names[k] for k in kept)
    info = Information(names=names, point=full.point[kept], matrix=full.matrix[np.ix_(kept, kept)])
    said = f"{noise} Held as known, because the joint's own fit has none: {', '.join(held)}." if held else noise
    return Expected(what, info, errors, said)


def _noise(joint: Joint, p: Lugre[float] | Pair[float], period: float) -> tuple[float, str]:
    """Standard deviation of the white noise of a torque sample at this period, N*m, and where it is from."""
    fit = joint.moving
    if fit is not None and fit.quantity == "torque" and fit.rms > 0:
        steps = np.diff(fit.time)
        between, stretch = float(np.median(steps[steps > 0])), inflation(fit.residuals)
        said = f"as the moving runs' fit leaves it, {fit.rms:.3g} {unit('torque', joint.kind)} in an equation every {between:.3g} s"
        wide = f", and {np.sqrt(stretch):.1f} times that for its correlation" if stretch > 1 else ""
        return fit.rms * float(np.sqrt(stretch * between / period)), f"Noise: {said}{wide}."
    level = p.alpha_0 if isinstance(p, Lugre) else (p.positive.alpha_0 + p.negative.alpha_0) / 2
    noise = _NOISE * level
    said = f"assumed white, {noise:.3g} {unit('torque', joint.kind)} ({_NOISE:.0%} of alpha_0) at 1 kHz; standard errors go in proportion"
    return noise * float(np.sqrt(1e-3 / period)), f"Noise: {said}."


def _of_static(joint: Joint) -> Expected | None:
    """What the joint's own constant velocities tell, at the scatter that was seen."""
    fits = {d: fit for d, fit in joint.static.items() if d in ("+", "-", "both") and fit.rms and fit.velocity.size}
    sets = {d: p for d, fit in fits.items() if (p := fit.values()) is not None}
    if not sets:
        return None
    names = tuple(name + ("" if len(sets) == 1 else d) for d in sets for name in STATIC)
    matrix = np.zeros((len(names), len(names)))
    errors: dict[str, float] = {}
    held: list[str] = []
    for k, (d, p) in enumerate(sets.items()):
        fit, own = fits[d], slice(4 * k, 4 * k + 4)
        scatter = float(np.sqrt(fit.residuals @ fit.residuals / max(fit.dof or fit.n - len(fit.names), 1)))
        matrix[own, own] = static_information(fit.velocity, p, scatter)
        known = dict(zip(names[own], (fit.parameters.get(name) for name in STATIC), strict=True))
        errors |= {name: e.standard_error for name, e in known.items() if e is not None and e.standard_error}
        held += [name for name, e in known.items() if e is None or e.value is None]
    values = np.concatenate([p[:4] for p in sets.values()])
    info = Information(names=names, point=values, matrix=matrix)
    return _expected("the constant velocities", info, errors, "Noise: the scatter that the static fit leaves.", held)
