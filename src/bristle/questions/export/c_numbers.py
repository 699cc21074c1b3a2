"""The numbers of the printed C: what each is called, what it is, its unit, and within which ends the arithmetic is sound."""

from typing import NamedTuple

from bristle.model.parameters import of_friction, unit
from bristle.questions.export.artefact import slug
from bristle.questions.export.exported import ExportedJoint

RANGES = {
    "alpha_0": (1e-5, 1e4),
    "alpha_1": (0.0, 1e4),
    "alpha_2": (0.0, 1e4),
    "v_s": (1e-5, 1e3),
    "sigma_0": (1e-1, 1e9),
    "sigma_1": (0.0, 1e4),
    "share": (0.0, 10.0),
    "inertia": (0.0, 1e4),
    "softness": (1e-6, 1e3),
    "observer_gain": (0.0, 1e4),
    "dead_zone": (0.0, 1e3),
    "leakage": (0.0, 1e3),
    "forgetting": (0.0, 10.0),
    "lower": (1e-3, 1.0),
    "upper": (1.0, 1e3),
    "gamma": (0.0, 1e6),
    "reference_position": (-1e6, 1e6),
    "reference_velocity": (-1e3, 1e3),
    "reference_acceleration": (-1e6, 1e6),
    "position": (-1e6, 1e6),
    "velocity": (-1e3, 1e3),
    "dt": (1e-6, 1.0),
}
"""Within which nothing overflows."""
SINGLE_ADAPTING = {
    "alpha_0": (1e-3, 1e3),
    "alpha_1": (0.0, 1e3),
    "sigma_1": (0.0, 1e3),
    "gamma": (0.0, 1e4),
    "observer_gain": (0.0, 1e3),
    "reference_position": (-1e4, 1e4),
    "position": (-1e4, 1e4),
}
"""The same of a compensator that adapts in single precision, where these are narrower: its gradients are squared."""
_WHAT = {
    "alpha_0": "Coulomb friction",
    "alpha_1": "Stribeck amplitude",
    "alpha_2": "viscous friction",
    "v_s": "Stribeck velocity",
    "sigma_0": "bristle stiffness",
    "sigma_1": "bristle damping",
    "share": "of the friction that is compensated",
    "inertia": "fed forward: times the reference acceleration",
    "softness": "v_0 of the Coulomb compensator",
    "observer_gain": "k of the observer",
    "dead_zone": "a position error below it teaches nothing",
    "leakage": "rate at which gains return to 1",
    "forgetting": "of least squares",
    "lower": "least gain",
    "upper": "largest gain",
    "deflection": "of the model's bristle",
    "reference_position": "where the joint is to be",
    "reference_velocity": "how fast it is to move",
    "reference_acceleration": "for the inertia",
    "position": "measured",
    "velocity": "that drives the model",
    "dt": "since the last step",
}
_SECONDS = {"dt": "s", "observer_gain": "1/s", "leakage": "1/s", "forgetting": "1/s"}
_LIKE = {
    "softness": "velocity",
    "dead_zone": "position",
    "deflection": "position",
    "reference_position": "position",
    "reference_velocity": "velocity",
    "reference_acceleration": "acceleration",
}
_LARGEST = 1e30
"""Of what has no range of its own."""


class CField(NamedTuple):
    """A number of a struct."""

    name: str
    unit: str
    what: str
    low: str
    high: str
    shown: str
    """Its range, for a reader."""


def identifier(joint: ExportedJoint) -> str:
    """What a joint's parameters are called in C."""
    return f"bristle_{slug([joint])}"


def ranges(name: str, *, adapts: bool) -> tuple[tuple[float, float], tuple[float, float]]:
    """Lowest and highest value of a number in double precision, and in single."""
    stem = stem_of(name)
    double = RANGES.get(stem, (-_LARGEST, _LARGEST))
    return double, SINGLE_ADAPTING.get(stem, double) if adapts else double


def c_field(name: str, *, adapts: bool) -> CField:
    """A number of a struct, of a compensator that adapts or does not."""
    double, single = ranges(name, adapts=adapts)
    low, high = (
        f"BR_C({digits(x)})" if x == y else f"BR_K({digits(x)}, {digits(y)})"
        for x, y in zip(double, single, strict=True)
    )
    shown = "[{:g}, {:g}]".format(*double) + ("" if single == double else " (single [{:g}, {:g}])".format(*single))
    stem = stem_of(name)
    return CField(name, _unit(name, stem), _meaning(name, stem), low, high, shown)


def stem_of(name: str) -> str:
    """What a number is of a kind: gamma_1 -> gamma, theta_alpha_0 -> theta."""
    return name.split("_", 1)[0] if name.startswith(("gamma_", "theta_", "sensitivity_", "covariance_")) else name


def _unit(name: str, stem: str) -> str:
    if stem in ("gamma", "covariance"):
        return "as docs/compensation.md has it"
    if stem == "inertia":
        return unit("inertia")
    if of_friction(stem) or stem in ("position", "velocity"):
        return unit(stem)
    if stem == "sensitivity":
        return unit("position")
    return _SECONDS.get(name) or (unit(_LIKE[name]) if name in _LIKE else "1")


def _meaning(name: str, stem: str) -> str:
    rest = name.removeprefix(f"{stem}_")
    by_stem = {
        "gamma": f"learning rate of adapted parameter {rest}",
        "theta": f"gain of {rest}: what it is multiplied by",
        "sensitivity": f"dz / d theta of {rest}",
        "covariance": "P of least squares",
    }
    return by_stem.get(stem) or _WHAT[name]


def digits(value: float) -> str:
    """A number with every digit."""
    return repr(float(value))
