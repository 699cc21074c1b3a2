"""What a plan starts from: each direction's parameters, how well they are known, and the noise of what will be measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bristle.arrays import Array
from bristle.data.encoder import resolution
from bristle.data.record import freeze
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.identification.fisher import STATIC
from bristle.identification.identify import Measured
from bristle.identification.known_model import DEFLECTION
from bristle.identification.limits import Limits
from bristle.identification.results import Estimate, Joint, StaticFit
from bristle.model import functions
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Lugre, Pair, unit
from bristle.model.vectorize import evaluate

_PEAK = 0.1
"""Stribeck amplitude to look for where none was found, as a share of alpha_0."""
_TORQUE = 0.02
"""Standard error of a hold's mean torque where nothing shows it, as a share of alpha_0."""
_EQUATION = 0.01
"""Time between independent equations of a moving run where there was none, s."""
_NORMAL = 1.4826
"""Standard deviation of normal noise over the median of its magnitude."""
_FEW = 4
_FAR = 1.5
"""A root mean square so many times the robust scatter is said."""
_EXACT = 1e-6
"""Relative standard error of what is given as exact."""
_INERTIAL = 0.1
"""Torque of the largest acceleration where no inertia is known, as a share of alpha_0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A joint as it is known before the next measurement."""

    tags: tuple[str, ...]
    """`+` and `-`, or one empty word where both directions share one set."""
    sets: Pair[float]
    """Estimates, with a guess where nothing was seen."""
    inertia: float
    guessed: tuple[str, ...]
    """Parameters that are guesses, by name with their tag."""
    names: tuple[str, ...]
    """Every parameter: six of each tag, then inertia."""
    estimate: Array
    """Their values, (p,)."""
    known: Array
    """Information gained so far, (p, p)."""
    given: tuple[str, ...]
    """Parameters that are given as exact and not estimated: an inertia without a standard error."""
    noise: Mapping[str, float]
    """Standard error of the mean torque of a hold by tag, N*m."""
    equation_noise: float
    """What one equation of a moving run scatters by, correlation of its residuals included, N*m."""
    equation_step: float
    """Time between equations, s."""
    resolution: float
    """One encoder count, rad; 0: not known."""
    assumptions: tuple[str, ...]

    def __post_init__(self) -> None:
        """Copy and freeze every array."""
        freeze(self)

    def p(self, tag: str) -> Lugre[float]:
        """The set of a tag."""
        return self.sets.negative if tag == "-" else self.sets.positive

    def key(self, bare: str, direction: str) -> str:
        """How a parameter of a direction, + or -, is named."""
        return bare + direction if direction in self.tags else bare

    def indices(self, tag: str, bare: Sequence[str]) -> list[int]:
        """Where some of a tag's parameters stand among the names."""
        return [self.names.index(name + tag) for name in bare]


def start_of(measured: Measured, joint: Joint, limits: Limits) -> Start:
    """What is known of an identified joint; what is not is guessed, each guess with a sentence.

    Raises InputError where nothing is known of its friction over velocity.
    """
    bare = "both" in joint.static or (joint.moving is not None and "alpha_0" in joint.moving.parameters)
    tags = ("",) if bare else ("+", "-")
    said: list[str] = []
    estimates = {tag: _estimates(joint, tag) for tag in tags}
    if not any("alpha_0" in own for own in estimates.values()):
        raise InputError(
            f"{joint.name}: nothing is known of its friction over velocity, from which a plan starts; add ramp, points or tracking runs"
        )
    for tag, other in (("+", "-"), ("-", "+")):
        if tag in tags and "alpha_0" not in estimates[tag]:
            estimates[tag] = {name: Estimate(value=e.value, unit=e.unit) for name, e in estimates[other].items()}
            said.append(f"Nothing is known of direction {tag}: it is taken to be as direction {other}.")
    J = _inertia(measured, joint)
    alpha_0 = max(own["alpha_0"].value or 0.0 for own in estimates.values())
    if J is None:
        J = _INERTIAL * alpha_0 / limits.acceleration
        said.append(
            f"Inertia: a guess, {J:.2g} {unit('inertia', joint.kind)}: {_INERTIAL:g} of alpha_0 at the largest acceleration; give inertia."
        )
    sets, guessed = {}, []
    for tag, own in estimates.items():
        sets[tag], missing = _filled(own, limits, J)
        guessed += [name + tag for name in missing]
        said += [_guess(name, tag, getattr(sets[tag], name), joint) for name in missing]
    names = (*(name + tag for tag in tags for name in Lugre._fields), "inertia")
    values = np.array([x for tag in tags for x in sets[tag]] + [J])
    given, exact = _declared(measured, joint, names)
    if exact:
        said.append(
            f"Inertia: {J:.4g} {unit('inertia', joint.kind)}, given as exact; intervals are those of the others."
        )
    noise, equation_noise, step = _noises(measured, joint, sets, limits, said)
    return Start(
        tags=tags,
        sets=Pair(sets[tags[0]], sets[tags[-1]]),
        inertia=J,
        guessed=tuple(guessed),
        names=names,
        estimate=values,
        known=_known(joint, names, estimates) + given,
        given=exact,
        noise=noise,
        equation_noise=equation_noise,
        equation_step=step,
        resolution=resolution(measured.experiment, [run.record for run in measured.runs]),
        assumptions=tuple(said),
    )


def embedded(names: Sequence[str], own: Sequence[str], matrix: Array) -> Array:
    """Information of some parameters, (m, m), among all of them, (p, p)."""
    whole = np.zeros((len(names), len(names)))
    at = [names.index(name) for name in own]
    whole[np.ix_(at, at)] = matrix
    return whole


def inverse(matrix: Array) -> Array:
    """Of a covariance or an information, (p, p), whose parameters may differ by any factor in size."""
    size = np.sqrt(np.diag(matrix))
    return np.asarray(np.linalg.inv(matrix / size[:, None] / size) / size[:, None] / size, dtype=np.float64)


def _estimates(joint: Joint, tag: str) -> dict[str, Estimate]:
    """What each stage found of one direction, the moving runs with their priors first; without what has no value."""
    found: dict[str, Estimate] = {}
    slow = joint.presliding.fits.get(tag or "+") if joint.presliding else None
    static = joint.static.get(tag or "both")
    if slow is not None and slow.sigma_0.value and slow.sigma_0.value > 0:
        found["sigma_0"] = slow.sigma_0
    if static is not None:
        found |= {name: e for name, e in static.parameters.items() if name in STATIC}
    if joint.moving is not None:
        found |= {n: e for n in Lugre._fields if (e := joint.moving.parameters.get(n + tag)) and e.value is not None}
    return {name: e for name, e in found.items() if e.value}


def _inertia(measured: Measured, joint: Joint) -> float | None:
    """J, kg*m**2, as identified, else as the experiment file gives it; None where nothing tells it."""
    known = joint.moving.known.get("inertia") if joint.moving else None
    experiment = measured.experiment
    declared = experiment.inertia.value if experiment.inertia else None
    motor = experiment.motor_constants.inertia if experiment.motor_constants else None
    return next((J for J in (known, declared, motor) if J is not None and J > 0), None)


def _declared(measured: Measured, joint: Joint, names: Sequence[str]) -> tuple[Array, tuple[str, ...]]:
    """What the experiment file says of an inertia that no run was fitted for, as information, (p, p), and its name where it is exact."""
    given = measured.experiment.inertia
    if given is None or (joint.moving is not None and "inertia" in joint.moving.names):
        return np.zeros((len(names), len(names))), ()
    matrix = embedded(names, ["inertia"], np.array([[(given.standard_error or _EXACT * given.value) ** -2]]))
    return matrix, () if given.standard_error else ("inertia",)


def _filled(own: Mapping[str, Estimate], limits: Limits, J: float) -> tuple[Lugre[float], list[str]]:
    """One direction's set with guesses for what has no value, and their names."""
    alpha_0 = own["alpha_0"].value or 0.0
    sigma_0 = own["sigma_0"].value if "sigma_0" in own else alpha_0 / (DEFLECTION * limits.travel)
    guess = Lugre(
        alpha_0=alpha_0,
        alpha_1=_PEAK * alpha_0,
        alpha_2=0.1 * alpha_0 / limits.velocity,
        v_s=float(np.sqrt(limits.slowest * limits.velocity / 3)),
        sigma_0=sigma_0 or 0.0,
        sigma_1=float(evaluate(functions.presliding_damping(), sigma_0 or 0.0, J, DAMPING_RATIO)[0]),
    )
    missing = [name for name in Lugre._fields if name not in own]
    if {"alpha_1", "v_s"} & set(missing):  # neither is anything without the other
        missing = [n for n in Lugre._fields if n in missing or n in ("alpha_1", "v_s")]
    seen = {n: e.value for n, e in own.items() if e.value is not None and n not in missing}
    return guess._replace(**seen), missing


def _guess(name: str, tag: str, value: float, joint: Joint) -> str:
    why = {
        "alpha_1": f"{_PEAK:g} of alpha_0: no Stribeck peak was found, and this is the one to look for",
        "v_s": "amid the speeds, and anywhere among them in the design",
        "sigma_0": f"a bristle that bends by {DEFLECTION:g} of the travel",
        "sigma_1": f"(15), a damping ratio of {DAMPING_RATIO:g}",
        "alpha_2": "0.1 of alpha_0 at the fastest speed",
    }[name]
    where = f" ({tag})" if tag else ""
    return f"{name}{where}: a guess, {value:.3g} {unit(name, joint.kind)}, {why}."


def _noises(
    measured: Measured, joint: Joint, sets: Mapping[str, Lugre[float]], limits: Limits, said: list[str]
) -> tuple[dict[str, float], float, float]:
    """Standard error of a hold's mean torque by tag, what an equation of a moving run scatters by, N*m, and the time between these, s."""
    T, moving = unit("torque", joint.kind), joint.moving
    noise: dict[str, float] = {}
    if measured.points(hold_out=False):
        noise = _scatters(joint, tuple(sets), said)
    if moving is not None and moving.quantity == "torque":
        step = float(np.median(np.diff(moving.time)))
        stretch = inflation(moving.residuals)
        equation = moving.rms * float(np.sqrt(stretch))
        said.append(
            f"Noise: an equation of a moving run, one in {step:.3g} s, scatters by {moving.rms:.2g} {T} as so far, "
            f"and counts for 1/{stretch:.2g}: residuals are correlated."
        )
        if not noise:
            noise = dict.fromkeys(sets, equation * float(np.sqrt(step / limits.hold)))
            said.append(
                f"Noise: a hold's mean torque scatters by {max(noise.values()):.2g} {T}, as those equations averaged over it."
            )
        return noise, equation, step
    if not noise:
        noise = {tag: _TORQUE * p.alpha_0 for tag, p in sets.items()}
        said.append(
            f"Noise: a hold's mean torque scatters by {max(noise.values()):.2g} {T}, {_TORQUE:g} of alpha_0: a guess."
        )
    worst = max(noise.values())
    said.append(
        f"Noise of a moving run: white, and such that its mean over {limits.hold:.3g} s scatters by {worst:.2g} {T}: a guess."
    )
    return noise, worst * float(np.sqrt(limits.hold / _EQUATION)), _EQUATION


def _scatters(joint: Joint, tags: Sequence[str], said: list[str]) -> dict[str, float]:
    """What points scatter by about their fit by tag, N*m, with a sentence each; of the other direction where one has no fit. Empty where none has."""
    T, found = unit("torque", joint.kind), dict[str, float]()
    fits = {tag: joint.static.get(tag or "both") for tag in tags}
    usable = [fit for fit in joint.static.values() if fit.names and fit.rms]
    for tag, own in fits.items():
        fit = own if own in usable else max(usable, key=lambda x: x.rms or 0.0, default=None)
        if fit is None:
            return {}
        found[tag], rms = scatter(fit)
        said.append(
            f"Noise{f' ({tag})' if tag else ''}: a hold's mean torque scatters by {found[tag]:.2g} {T}, as the points did about their fit"
            + ("." if fit is own else f" of {fit.direction}.")
            + (
                f" Their root mean square is {rms / found[tag]:.2g} times that: a few points lie far off, and do not count here."
                if rms > _FAR * found[tag]
                else ""
            )
        )
    return found


def scatter(fit: StaticFit) -> tuple[float, float]:
    """What points scatter by about their fit, N*m: 1.4826 times their median distance, which a few far ones do not rule; and root mean square.

    Both on the degrees of freedom that the fit has left. With fewer than `_FEW` of these, or half of the points on the curve, both are the second.
    """
    free = max(fit.n - len(fit.names), 1)
    more = float(np.sqrt(fit.n / free))
    rms = more * (fit.rms or 0.0)
    robust = more * _NORMAL * float(np.median(np.abs(fit.residuals))) if fit.residuals.size else 0.0
    return (robust if robust > 0 and free >= _FEW else rms), rms


def _known(joint: Joint, names: Sequence[str], estimates: Mapping[str, Mapping[str, Estimate]]) -> Array:
    """Information gained so far, (p, p): of the moving runs and what they were told, or else of each stage by itself."""
    fit = joint.moving
    if fit is not None:
        own = [n for n in fit.names if n in names and fit.parameters[n].standard_error]
        at = [fit.names.index(n) for n in own]
        return embedded(names, own, inverse(fit.covariance[np.ix_(at, at)]))
    whole = np.zeros((len(names), len(names)))
    for tag, found in estimates.items():
        static = joint.static.get(tag or "both")
        if static is not None and static.names:
            at = [k for k, n in enumerate(static.names) if n in STATIC]
            own = [static.names[k] + tag for k in at]
            whole += embedded(names, own, inverse(static.covariance[np.ix_(at, at)]))
        stiffness = found.get("sigma_0")
        if stiffness is not None and stiffness.standard_error:
            whole += embedded(names, [f"sigma_0{tag}"], np.array([[stiffness.standard_error**-2]]))
    return whole
