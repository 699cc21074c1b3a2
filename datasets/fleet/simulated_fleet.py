"""A simulated fleet: robots of six joints, measured in sessions over a year; some joints wear by a step, and friction follows temperature.

Each joint's parameters are those of its type times a factor of its own, times the scatter of a session. What is simulated are
estimates with errors, for statistics, or the parameters behind logs.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtrit

from bristle.arrays import Array
from bristle.model import functions
from bristle.model.parameters import Pair, Stribeck, unit
from bristle.model.vectorize import evaluate
from bristle.simulation.edro import TABLE_1

BEGIN = np.datetime64("2026-01-12T08:00:00", "us")  # the first session of every robot
NAMES = Stribeck._fields
TYPES: dict[str, Pair[float]] = {f"J{k + 1}": TABLE_1[name] for k, name in enumerate((*TABLE_1, *list(TABLE_1)[:2]))}
"""Joint types, each with the friction of a joint of Table 1."""


class FleetDesign(NamedTuple):
    """What a fleet is like; standard deviations are of the logarithm."""

    robots: int = 200
    joints: int = 6
    sessions: int = 8
    between: float = 0.10
    """Scatter between robots."""
    scatter: float = 0.03
    """Scatter between the sessions of a joint."""
    errors: tuple[float, float] = (0.005, 0.02)
    """Of an estimate, uniform between these."""
    freedom: float = np.inf
    """Degrees of freedom of these errors, by chance larger or smaller than they are, and of the intervals."""
    worn: float = 0.05
    """Share of the joints that wear."""
    change: float = 0.15
    """By which their Coulomb friction rises."""
    unchanged: int = 3
    """Sessions before the first that may be worn."""
    swing: float = 0.0
    """Of temperature over the year, from its lowest to its highest, K; where there is any, it scatters by 1 K between sessions as well."""
    sensitivity: float = 0.01
    """Friction per K."""


class FleetTruth(NamedTuple):
    """What is behind the logs of a fleet."""

    session: NDArray[np.datetime64]
    """(robots, sessions)."""
    temperature: Array
    """Degrees Celsius, (robots, sessions)."""
    value: Array
    """Parameters by direction (+, -) and name, (robots, joints, sessions, 2, 4), SI."""
    worn: NDArray[np.bool_]
    """(robots, joints)."""
    since: NDArray[np.intp]
    """Index of the first worn session, (robots, joints)."""


def fleet_truth(design: FleetDesign, rng: np.random.Generator) -> FleetTruth:
    """A fleet drawn at random."""
    shape = (design.robots, design.joints)
    day = np.linspace(0.0, 365.0, design.sessions) + rng.uniform(-3, 3, (design.robots, design.sessions))
    season = design.swing / 2 * np.sin(2 * np.pi * day / 365.0)
    warmth = season + float(design.swing != 0) * rng.standard_normal(day.shape)
    worn = rng.random(shape) < design.worn
    since = rng.integers(min(design.unchanged, design.sessions - 1), design.sessions, shape)
    typical = np.array([[p.stribeck for p in pair] for pair in list(TYPES.values())[: design.joints]])
    size = (*shape, design.sessions, 2, len(NAMES))
    level = design.between * rng.standard_normal((*shape, 1, 2, len(NAMES)))
    level = level + design.scatter * rng.standard_normal(size)

    # All but v_s follows temperature; wear raises alpha_0, in both directions.
    level += design.sensitivity * warmth[:, None, :, None, None] * np.isin(NAMES, ("alpha_0", "alpha_1", "alpha_2"))
    after = worn[..., None] & (np.arange(design.sessions) >= since[..., None])
    level += np.log1p(design.change) * after[..., None, None] * np.isin(NAMES, "alpha_0")
    value = typical[None, :, None] * np.exp(level)
    times = BEGIN + np.round((day - day.min()) * 86400).astype("timedelta64[s]")
    return FleetTruth(times, 20.0 + warmth, value, worn, since)


def fleet_estimates(design: FleetDesign, truth: FleetTruth, rng: np.random.Generator) -> pd.DataFrame:
    """What identification would give of a fleet, in the columns of `bristle fleet`'s dataset: no log is simulated."""
    error = rng.uniform(*design.errors, truth.value.shape)
    value = truth.value * (1 + error * rng.standard_normal(truth.value.shape))
    robot, joint, session, d, name = np.unravel_index(np.arange(value.size), value.shape)
    robots = np.array([f"robot-{k + 1:03d}" for k in range(design.robots)])
    types, signs = np.array(list(TYPES)[: design.joints]), np.array(["+", "-"])
    few = np.isfinite(design.freedom)
    told = error * np.sqrt(rng.chisquare(design.freedom, error.shape) / design.freedom) if few else error
    se = (told * value).ravel()
    half = float(stdtrit(design.freedom, 0.975)) * se
    frame = pd.DataFrame({
        "unit": pd.Categorical(robots[robot]), "joint": pd.Categorical(types[joint]), "type": pd.Categorical(types[joint]),
        "session": truth.session[robot, session], "direction": pd.Categorical(signs[d]),
        "parameter": pd.Categorical(np.array(NAMES)[name]), "value": value.ravel(),
        "value_unit": pd.Categorical(np.array([unit(x) for x in NAMES])[name]), "standard_error": se,
        "lower": value.ravel() - half, "upper": value.ravel() + half,
        "temperature": truth.temperature[robot, session] if design.swing else np.nan, "load": np.nan,
    })  # fmt: skip  # a table
    constant = {
        "source": "static", "severity": "none", "warnings": "", "use": "use", "kind": "revolute", "tags": "",
        "file": "", "key": "", "failure": None,
    }  # fmt: skip  # a row
    return frame.assign(simulated=True, **{k: pd.Categorical([x] * len(frame)) for k, x in constant.items()})


SPEEDS, HOLD, RATE = 8, 0.8, 100.0  # of a ramp log: speeds in each direction, s at each, and Hz
COUNT = 1e-5  # of the encoder, rad
NOISE = 0.08  # of the logged torque, as a share of alpha_0: the mean over a hold is off by some 0.9 %


def ramp_log(value: Array, rng: np.random.Generator) -> pd.DataFrame:
    """A short log of imposed constant velocities: time (s), position (rad), torque (N*m); `value`: SI by direction (+, -) and name, (2, 4)."""
    ways = [Stribeck(*row) for row in value.tolist()]
    speeds = np.geomspace(min(p.v_s for p in ways) / 4, 1.0, SPEEDS)
    velocity = np.repeat(np.stack([speeds, -speeds], axis=1).ravel(), round(HOLD * RATE))
    forth, back = (evaluate(functions.steady_torque_function(p.law), velocity, *p)[0] for p in ways)
    torque, noise = (np.where(velocity > 0, *x) for x in ((forth, back), [NOISE * p.alpha_0 for p in ways]))
    time, counts = np.arange(velocity.size) / RATE, np.round(np.cumsum(velocity) / RATE / COUNT)
    logged = torque + noise * rng.standard_normal(velocity.size)
    return pd.DataFrame({"time": time, "position": counts * COUNT, "torque": logged})
