"""Load along moving runs, and the rise of the friction level with it (`law.load_levels`)."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import between_gaps
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.identification.moving_runs import LEVELS, extra_columns, needed, terms_of
from bristle.model.functions import load_levels_function
from bristle.model.parameters import ParameterName
from bristle.model.rollout import load_level
from bristle.model.vectorize import evaluate

_WEIGHTS = ("gravity", "links")  # regressors that are load
_SETTLED, _MOST = 1e-9, 60  # relative tolerance of the weights, and most iterations
_NAMES = tuple(dict.fromkeys(name for terms in LEVELS.values() for name in terms.names))
"""In the order of `law.load_levels`."""
LINEAR = tuple(name for name in _NAMES if not name.endswith("squared"))  # coefficients of a load itself


class Load(NamedTuple):
    """The load along N samples."""

    levels: tuple[str, ...]  # Coefficients of the rise of the friction level, m of them
    motor: Array  # Torque of the motor after the decimation filter, N*m, (N,)
    weights: tuple[str, ...]  # Coefficients of the torque of gravity and links, k of them
    columns: Array  # Signals that the weights multiply, (N, k)
    known: Array  # Torque of the links without a coefficient, N*m, (N,)

    def through(self, change: Callable[[Array], Array]) -> "Load":
        """The load of some samples, or of means of them: after a change of every signal, (N, ...)."""
        return self._replace(motor=change(self.motor), columns=change(self.columns), known=change(self.known))

    def by(self, values: Mapping[str, float]) -> tuple[Array, Array]:
        """The signal that each of `levels` multiplies, (m, N), and its derivative by each weight, (m, k, N)."""
        levels, by_links, _ = self._parts(values)
        return levels, -by_links[:, None, :] * self.columns.T

    def by_motor(self, values: Mapping[str, float]) -> Array:
        """Derivative of the level by the motor's torque, (N,)."""
        _, _, by_motor = self._parts(values)
        return np.asarray(np.array([values[name] for name in self.levels]) @ by_motor)

    def _parts(self, values: Mapping[str, float]) -> Array:
        """The levels, and their derivatives by the links' torque and the motor's, (3, m, N)."""
        weights = np.array([values[name] for name in self.weights])
        every = np.array(evaluate(load_levels_function(), self.motor, -(self.columns @ weights + self.known)))
        own = [_NAMES.index(name) for name in self.levels]
        return every.reshape(3, len(_NAMES), -1)[:, own]


def levels_of(regressors: Sequence[str]) -> tuple[str, ...]:
    """Coefficients of the level's rise among some regressors."""
    asked = {name for regressor in regressors if regressor in LEVELS for name in terms_of(regressor).names}
    return tuple(name for name in _NAMES if name in asked)


def load_is_known(records: Sequence[Record], regressors: Sequence[str]) -> bool:
    """Whether the torque of gravity or links is known or fitted."""
    return not {"gravity", "links"}.isdisjoint(regressors) or any(r.link_torque is not None for r in records)


def load_of(record: Record, regressors: Sequence[str], decimation: int) -> Load | None:
    """The load of a moving run; None unless asked for. Raises InputError where that of the links is unknown."""
    from scipy import signal

    levels, weighing = levels_of(regressors), [name for name in regressors if name in _WEIGHTS]
    if not levels:
        return None
    links = None if "links" in regressors else record.link_torque
    if levels != ("motor_load",) and not load_is_known([record], regressors):
        asked = next(name for name in regressors if name in LEVELS)
        raise InputError(
            f"fit.law: {asked} needs what gravity does to the joint; add gravity under fit.regressors, or identify the joint in a robot"
        )
    columns, n, motor = extra_columns(weighing, record), record.time.size, needed(record, "torque")
    if decimation > 1:  # through the decimation filter, segment by segment
        sections, torque, motor = signal.butter(4, 0.8 / decimation, output="sos"), motor, motor.copy()
        for part in between_gaps(record):
            motor[part] = signal.sosfiltfilt(sections, torque[part], padlen=min(part.stop - part.start - 1, 15))
    weighed = np.column_stack(list(columns.values())) if columns else np.zeros((n, 0))
    return Load(levels, motor, tuple(columns), weighed, np.zeros(n) if links is None else links)


def level_columns(
    record: Record, regressors: Sequence[str], decimation: int, weights: Mapping[str, float]
) -> dict[str, Array]:
    """What multiplies each coefficient of the level's rise in sliding, (N,), by name."""
    load = load_of(record, regressors, decimation)
    if load is None:
        return {}
    rises, _ = load.by({name: weights.get(name, 0.0) for name in load.weights})
    return dict(zip(load.levels, rises * np.sign(needed(record, "velocity")), strict=True))


def settled_weights(fitted: Callable[[Mapping[str, float]], Mapping[ParameterName, float]]) -> dict[str, float]:
    """Coefficients of gravity and links, iterated until a fit under their load returns them."""
    own = {name for regressor in _WEIGHTS for name in terms_of(regressor).names}
    weights = dict[str, float]()
    for _ in range(_MOST):
        found = {name.name: x for name, x in fitted(weights).items() if name.name in own}
        moved = max((abs(x - weights.get(name, 0.0)) for name, x in found.items()), default=0.0)
        weights = found
        if moved <= _SETTLED * max(map(abs, found.values()), default=0.0):
            break
    return weights


def friction_rise(rises: Mapping[str, float], load: Array) -> Array:
    """Rise of the level, N*m, (n,), by these coefficients under a load, N*m, (n,)."""
    rest = np.zeros_like(load)
    return load_level(rises, rest, load) if "link_load" in rises else load_level(rises, load, rest)
