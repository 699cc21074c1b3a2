"""The start of a plan: parameters of each direction, information about them, and the noise of measurements."""

from collections.abc import Mapping, Sequence

import numpy as np

from bristle.arrays import Array, result
from bristle.data.encoder import resolution
from bristle.errors import InputError
from bristle.estimation.autocorrelation import inflation
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.fits import Estimate, StaticFit
from bristle.identification.known_joint import (
    DEFLECTION,
    INERTIAL,
    assumed_damping,
    assumed_stiffness,
    guessed_inertia,
    inertia_of,
    known_joint,
    without_load,
)
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.model import parameters
from bristle.model.law import DAMPING_RATIO, viscous_rates
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import INERTIA, SIGNED, Direction, Lugre, Pair, ParameterName, unit
from bristle.simulation.limits import Limits

# Guesses over alpha_0: Stribeck amplitude, viscous friction at the fastest speed, noise of a hold's mean torque.
_PEAK, _VISCOUS, _TORQUE = 0.1, 0.1, 0.02
_EQUATION = 0.01  # time between independent equations without a moving run, s


@result
class Start:
    """A joint before the next measurement."""

    directions: tuple[Direction, ...]  # `+` and `-`, or `both` where they share one set
    sets: Pair[float]  # estimates and guesses
    guessed: tuple[ParameterName, ...]
    names: tuple[ParameterName, ...]  # parameters of each direction (six of the paper's law), then inertia
    estimate: Array  # their values, (p,)
    known: Array  # information so far, (p, p)
    given: tuple[ParameterName, ...]  # exact parameters: an inertia without a standard error
    noise: Mapping[Direction, float]  # standard error of the mean torque of a hold by direction, N*m
    equation_noise: float  # of one equation of a moving run, widened for correlation, N*m
    equation_step: float  # time between equations, s
    resolution: float  # one encoder count, rad; 0: not known
    assumptions: tuple[Finding, ...]

    @property
    def law(self) -> Law:
        """Friction law."""
        return self.sets.law

    def at(self, values: Array) -> Lugre[float] | Pair[float]:
        """One set or a pair with these values of all parameters, (p,)."""
        names, own = parameters.estimated_of(self.law), np.reshape(values[:-1], (len(self.directions), -1)).tolist()
        found = [p._replace(**dict(zip(names, x, strict=True))) for p, x in zip(self.sets, own, strict=False)]
        return found[0] if len(found) == 1 else Pair(*found)

    def p(self, direction: str) -> Lugre[float]:
        """The set of a direction."""
        return self.sets.negative if direction == Direction.NEGATIVE else self.sets.positive

    def direction_of(self, direction: Direction) -> Direction:
        """The direction, or `both` where the two share one set."""
        return direction if direction in self.directions else Direction.BOTH

    def indices(self, direction: Direction, names: Sequence[str]) -> list[int]:
        """Indices of a direction's parameters in `names`."""
        return [self.names.index(ParameterName(name, self.direction_of(direction))) for name in names]


def start_of(measured: Measured, joint: Joint, limits: Limits) -> Start:
    """The start of a plan for an identified joint. Raises InputError where no friction vs velocity is known."""
    law, one_set = joint.law, known_joint(joint).directions == (Direction.BOTH,)
    directions = (Direction.BOTH,) if one_set else SIGNED
    assumptions = list(without_load(joint))
    estimates = {d: _estimates(joint, d) for d in directions}
    if not any("alpha_0" in seen for seen in estimates.values()):
        raise InputError(
            f"{joint.name}: nothing is known of its friction vs velocity, from which a plan starts; add ramp, points or tracking runs"
        )
    for d, other in zip(directions, reversed(directions), strict=True):
        if "alpha_0" not in estimates[d]:
            estimates[d] = {name: Estimate(value=e.value, unit=e.unit) for name, e in estimates[other].items()}
            taken = f"Direction {d} is not identified: it is assumed to be as direction {other}."
            assumptions.append(Finding("direction-taken", CAUTION, taken, {"direction": d, "other": other}))
    J = inertia_of(measured.experiment, joint)
    if J is None:
        J = guessed_inertia(max(seen["alpha_0"].value or 0.0 for seen in estimates.values()), limits.acceleration)
        said = f"a guess, {J:.2g} {unit('inertia', joint.kind)}: {INERTIAL:g} of alpha_0 at the largest acceleration"
        assumptions.append(Finding("inertia-guessed", CAUTION, f"Inertia: {said}; give inertia.", {"J": J}))
    sets, guessed = {}, []
    for d, seen in estimates.items():
        held = {name: x for name in law.more if (x := known_joint(joint).values(d).get(name)) is not None}
        sets[d], missing = _filled(law, seen, held, limits, J)
        guessed += [ParameterName(name, d) for name in missing]
        assumptions += [_guess(ParameterName(name, d), getattr(sets[d], name), joint) for name in missing]
    names = (*(ParameterName(name, d) for d in directions for name in parameters.estimated_of(law)), INERTIA)
    values = np.array([getattr(sets[d], name) for name, d in names[:-1]] + [J])
    known, exact = _known(joint, names, estimates), tuple[ParameterName, ...]()
    declared = measured.experiment.inertia
    if declared is not None and (joint.moving is None or INERTIA not in joint.moving.names):  # no run was fitted for it
        error = declared.standard_error or 1e-6 * declared.value
        known = known + embedded(names, [INERTIA], np.array([[error**-2]]))
        if not declared.standard_error:
            exact = (INERTIA,)
            said = f"{J:.4g} {unit('inertia', joint.kind)}, given as exact; intervals are those of the others"
            assumptions.append(Finding("inertia-exact", NOTE, f"Inertia: {said}.", {"J": J}))
    noise, equation_noise, step = _noises(measured, joint, sets, limits, assumptions)
    assumptions += [joint.torque_scale] if joint.torque_scale else []
    if constants := joint.uncertain_constants:
        stays = "Expected errors are those of the scatter: no run lowers the systematic error, of"
        numbers = {"constants": constants}
        assumptions.append(Finding("systematic-stays", NOTE, f"{stays} {' and '.join(constants)}.", numbers))
    return Start(
        directions=directions, sets=Pair(sets[directions[0]], sets[directions[-1]]), guessed=tuple(guessed),
        names=names, estimate=values, known=known, given=exact, noise=noise, equation_noise=equation_noise,
        equation_step=step, resolution=resolution(measured.experiment, [run.record for run in measured.runs]),
        assumptions=tuple(assumptions),
    )  # fmt: skip  # a list of values


def embedded(names: Sequence[ParameterName], members: Sequence[ParameterName], matrix: Array) -> Array:
    """Information of some parameters, (m, m), among all of them, (p, p)."""
    whole = np.zeros((len(names), len(names)))
    at = [names.index(name) for name in members]
    whole[np.ix_(at, at)] = matrix
    return whole


def inverse(matrix: Array) -> Array:
    """Inverse of a covariance or an information, (p, p), scaled to a unit diagonal."""
    size = np.sqrt(np.diag(matrix))
    return np.asarray(np.linalg.inv(matrix / size[:, None] / size) / size[:, None] / size, dtype=np.float64)


def _estimates(joint: Joint, direction: Direction) -> dict[str, Estimate]:
    """Estimates of one direction that are not zero; a sigma_0 of one direction counts for both."""
    known = known_joint(joint)
    seen = {
        name: e for name in parameters.estimated_of(joint.law) if (e := known.estimate(name, direction)) is not None
    }
    if direction is Direction.BOTH and "sigma_0" not in seen and (e := known.estimate("sigma_0", Direction.POSITIVE)):
        seen["sigma_0"] = e
    return {name: e for name, e in seen.items() if e.value}


def _filled(
    law: Law, seen: Mapping[str, Estimate], held: Mapping[str, float], limits: Limits, J: float
) -> tuple[Lugre[float], list[str]]:
    """A direction's set, and names of its guesses; `held`: parameters of the law that were not fitted."""
    alpha_0 = seen["alpha_0"].value or 0.0
    missing = [
        name
        for name in parameters.estimated_of(law)
        if name not in seen and not (parameters.of_shape(name) and held.get(name))
    ]
    if {"alpha_1", "v_s"} & set(missing):  # parameters of a peak are meaningless without each other
        missing = [n for n in parameters.estimated_of(law) if n in missing or n in parameters.peak_parameters(law)]
    sigma_0 = (seen["sigma_0"].value if "sigma_0" in seen else assumed_stiffness(alpha_0, limits.travel)) or 0.0
    rates = viscous_rates(limits.velocity, law).items()
    viscous = {name: _VISCOUS * alpha_0 / (limits.velocity * float(rate)) for name, rate in rates}
    guess = {
        "alpha_0": alpha_0, "alpha_1": _PEAK * alpha_0, "v_s": float(np.sqrt(limits.slowest * limits.velocity / 3)),
        "sigma_0": sigma_0, "sigma_1": assumed_damping(sigma_0, J), **viscous, **{own.name: own.middle for own in law.peak.own},
        **({FASTEST: limits.velocity} if law.terms else {}),
    }  # fmt: skip  # a list of values
    guess |= {name: x for name, x in held.items() if x and name not in missing}
    guess |= {n: e.value for n, e in seen.items() if e.value is not None and n not in missing}
    return parameters.lugre_of(law)(**guess), missing


def _guess(parameter: ParameterName, value: float, joint: Joint) -> Finding:
    name, direction = parameter
    viscous = f"{_VISCOUS:g} of alpha_0 at the fastest speed"
    why = {
        "alpha_1": f"{_PEAK:g} of alpha_0: no Stribeck peak was found, and this is the one to look for",
        "v_s": "in the middle of the speeds; the design allows any value among them",
        "sigma_0": f"a bristle that bends by {DEFLECTION:g} of the travel",
        "sigma_1": f"(15), a damping ratio of {DAMPING_RATIO:g}",
    }.get(name, "in the middle of where it is looked for" if parameters.of_shape(name) else viscous)
    message = f"{name}{_named(direction)}: a guess, {value:.3g} {unit(name, joint.kind)}, {why}."
    return Finding("guessed", CAUTION, message, {"name": name, "direction": direction, "value": value})


def _named(direction: Direction) -> str:
    return f" ({direction})" if direction in SIGNED else ""


def _noises(
    measured: Measured, joint: Joint, sets: Mapping[Direction, Lugre[float]], limits: Limits, assumptions: list[Finding]
) -> tuple[dict[Direction, float], float, float]:
    """Noise of a hold's mean torque by direction and of an equation of a moving run, N*m, and step of equations, s."""
    T, moving = unit("torque", joint.kind), joint.moving
    noise = _scatters(joint, tuple(sets), assumptions) if measured.points(hold_out=False) else {}
    if moving is not None:
        step = float(np.median(np.diff(moving.time)))
        variance_inflation = inflation(moving.residuals)
        equation = moving.rms * float(np.sqrt(variance_inflation))
        message = f"Noise: a sample of a moving run, one every {step:.3g} s, scatters by {moving.rms:.2g} {T} as so far"
        if variance_inflation > 1:
            message += f", and counts as 1/{variance_inflation:.2g} of an independent one: residuals are correlated"
        numbers = {"step": step, "rms": moving.rms, "inflation": variance_inflation}
        assumptions.append(Finding("noise-of-equations", NOTE, f"{message}.", numbers))
        if not noise:
            worst = equation * float(np.sqrt(step / limits.hold))
            noise = dict.fromkeys(sets, worst)
            message = f"{_of_holds(worst, T)}, that of those samples averaged over it."
            assumptions.append(Finding("noise-averaged", NOTE, message, {"scatter": worst}))
        return noise, equation, step
    guessed, noise = not noise, noise or {d: _TORQUE * p.alpha_0 for d, p in sets.items()}
    worst = max(noise.values())
    if guessed:
        message = f"{_of_holds(worst, T)}, {_TORQUE:g} of alpha_0: a guess."
        assumptions.append(Finding("noise-of-holds-guessed", CAUTION, message, {"scatter": worst}))
    white = f"white, and such that its mean over {limits.hold:.3g} s scatters by {worst:.2g} {T}: a guess"
    numbers = {"hold": limits.hold, "scatter": worst}
    assumptions.append(Finding("noise-of-motion-guessed", CAUTION, f"Noise of a moving run: {white}.", numbers))
    return noise, worst * float(np.sqrt(limits.hold / _EQUATION)), _EQUATION


def _of_holds(scatter: float, T: str, direction: Direction = Direction.BOTH) -> str:
    return f"Noise{_named(direction)}: a hold's mean torque scatters by {scatter:.2g} {T}"


def _scatters(joint: Joint, directions: Sequence[Direction], assumptions: list[Finding]) -> dict[Direction, float]:
    """Scatter of the points about their fit, N*m, by direction, from another fit where a direction has none."""
    T, scatters = unit("torque", joint.kind), dict[Direction, float]()
    fits = {d: joint.static.get(d) for d in directions}
    usable = [fit for fit in joint.static.values() if fit.names and fit.rms]
    for d, own_fit in fits.items():
        fit = own_fit if own_fit in usable else max(usable, key=lambda x: x.rms or 0.0, default=None)
        if fit is None:
            return {}
        scatters[d] = scatter(fit)
        message = f"{_of_holds(scatters[d], T, d)}, as the points did about their fit"
        numbers = {"direction": d, "scatter": scatters[d]}
        if fit is own_fit:
            assumptions.append(Finding("noise-of-points", NOTE, f"{message}.", numbers))
        else:
            assumptions.append(Finding("noise-of-other-points", CAUTION, f"{message} of {fit.direction}.", numbers))
    return scatters


def scatter(fit: StaticFit) -> float:
    """Scatter of points about their fit, N*m: 1.4826 times the median distance, so that few outliers do not count.

    The RMS with fewer than four degrees of freedom, or half of the points on the curve; both by degrees of freedom.
    """
    free = max(fit.n - len(fit.names), 1)
    more = float(np.sqrt(fit.n / free))
    robust = 1.4826 * float(np.median(np.abs(fit.residuals))) if fit.residuals.size else 0.0
    return more * (robust if robust > 0 and free >= 4 else fit.rms or 0.0)


def _known(
    joint: Joint, names: Sequence[ParameterName], estimates: Mapping[Direction, Mapping[str, Estimate]]
) -> Array:
    """Information so far, (p, p): of the moving runs and of held shape parameters, or of each stage."""
    fit = joint.moving
    whole = np.zeros((len(names), len(names)))
    if fit is not None:
        at = [k for k, n in enumerate(fit.names) if n in names and fit.parameters[n].standard_error]
        told = {
            ParameterName(n, d): e for d, seen in estimates.items() for n, e in seen.items() if parameters.of_shape(n)
        }
        held = {n: e.standard_error**-2 for n, e in told.items() if n not in fit.names and e.standard_error}
        whole += embedded(names, list(held), np.diag(list(held.values()))) if held else 0.0
        return whole + embedded(names, [fit.names[k] for k in at], inverse(fit.covariance[np.ix_(at, at)]))
    for d, seen in estimates.items():
        static = joint.static.get(d)
        if static is not None and static.names:
            at = [k for k, n in enumerate(static.names) if parameters.of_curve(n) and ParameterName(n, d) in names]
            members = [ParameterName(static.names[k], d) for k in at]
            whole += embedded(names, members, inverse(static.covariance[np.ix_(at, at)]))
        stiffness = seen.get("sigma_0")
        if stiffness is not None and stiffness.standard_error:
            whole += embedded(names, [ParameterName("sigma_0", d)], np.array([[stiffness.standard_error**-2]]))
    return whole
