"""The moving fit with a simulated motor: voltage (or torque) in, position out, in windows (multiple shooting)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np
from scipy import sparse

from bristle.arrays import Array
from bristle.control.plant import Current, State, plant_step
from bristle.data.differentiation import between_gaps
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.identification.dynamic.problem import DynamicProblem, InitialState, Motion, Unknown, Values
from bristle.identification.moving_runs import LOADS
from bristle.model import law, motor
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import Law
from bristle.model.parameters import INERTIA, Direction, Motor, ParameterName, fields_of, pair_of
from bristle.workers import threads

_NO_MOTOR = Motor(1.0, 1.0, 0.0, 1.0)
_LOADS = tuple(ParameterName(name, Direction.SHARED) for name in LOADS)
HORIZON = 0.5  # length of a window, s, at most half of a segment
_EQUATIONS = 4  # least equations per window, beside three initial states
_SHORTEST = 16  # samples of a window
_RING = 1.0  # largest step of the plant, in radians of the bristle's ringing, sqrt(sigma_0 / J)
_MOST = 4  # most steps of the plant between samples


@dataclass(frozen=True, slots=True)
class Simulated:
    """The model of windows, simulated from their initial states."""

    motor: Motor[float]  # k_t and R of a voltage drive
    current: Current  # `motor.current` under a voltage, `motor.current_for` under a torque
    law: Law = GAUSSIAN

    def __call__(
        self, problem: DynamicProblem, known: Values, _: Sequence[dict[Unknown, Array]]
    ) -> list[tuple[Array, dict[Unknown, Array]]]:
        """Of each window measured less simulated position, rad, (N,), and the derivatives of the latter, (N,)."""
        windows = problem.motions
        directions, fields, states = problem.directions, fields_of(self.law), problem.initial_states
        # steps of the plant between two samples, a power of two that rarely changes during the fit
        J, stiffest = known[INERTIA], max(value for name, value in known.items() if name.name == "sigma_0")
        longest = max(float(window.step.max()) for window in windows)
        wanted = longest * np.sqrt(stiffest / J) / _RING if J > 0 else _MOST
        every, pair = 2 ** int(np.ceil(np.log2(np.clip(wanted, 1.0, _MOST)))), len(directions) == 2
        middle = (np.arange(every) + 0.5) / every  # of the steps of the plant between two samples
        friction = [known[ParameterName(name, d)] for d in (directions if pair else directions * 2) for name in fields]
        p = np.array([*friction, *(known.get(name, 0.0) for name in _LOADS), self.motor.k_t, self.motor.R])
        alike: dict[int, list[int]] = {}
        for k, window in enumerate(windows):
            alike.setdefault(window.time.size, []).append(k)
        simulated: dict[int, tuple[Array, dict[Unknown, Array]]] = {}
        for size, chosen in alike.items():  # windows of one length in one call
            x0 = np.array([[known[InitialState(name, k)] for name in states] for k in chosen]).T
            start = np.vstack(
                [x0, np.repeat(np.eye(3, 3 + 2 * len(fields) + len(LOADS)).T.reshape(-1, 1), len(chosen), axis=1)]
            )
            drives = [w.drive[:-1, None] + np.diff(w.drive)[:, None] * middle for w in (windows[k] for k in chosen)]
            steps = [np.repeat(windows[k].step / every, every) for k in chosen]
            inputs = np.vstack([np.concatenate([x.ravel() for x in drives]), np.concatenate(steps)])
            ends = _chain((size - 1) * every, every, self.current, self.law, len(chosen))(start, inputs, p)
            for k, first, rows in zip(chosen, start.T, np.split(np.asarray(ends), len(chosen), axis=1), strict=True):
                whole = np.concatenate([first[::3, None], rows], axis=1)
                begun, sets, loads = np.split(whole[1:], [3, 3 + 2 * len(fields)])
                by_set = sets if pair else sets[: len(fields)] + sets[len(fields) :]
                slopes: dict[Unknown, Array] = dict(zip(problem.friction_names, by_set, strict=True))
                slopes |= dict(zip(_LOADS, loads, strict=True))
                slopes |= {InitialState(name, k): row for name, row in zip(states, begun, strict=True)}
                simulated[k] = windows[k].measured - whole[0], slopes
        return [simulated[k] for k in range(len(windows))]


def simulation(
    records: Sequence[Record],
    posed: DynamicProblem,
    constants: Motor[float] | None,
    decimation: int,
    horizon: float | None = None,
) -> DynamicProblem:
    """The problem of the simulated motor, from that of the torque. Raises InputError without position or inertia."""
    if INERTIA not in posed.extra_names:
        raise InputError(
            "fit.predict: position simulates the motor, which needs an inertia; give it as inertia, or among fit.regressors"
        )
    by_voltage = constants is not None and all(r.voltage is not None for r in records)
    current = motor.current if by_voltage else motor.current_for
    plant = Simulated(constants if constants and by_voltage else _NO_MOTOR, current, posed.law)
    parts = [(r, part) for r in records for part in between_gaps(r)]
    windows: list[Motion] = []
    for (record, part), whole in zip(parts, posed.motions, strict=True):
        drive = record.voltage if by_voltage else record.torque
        if record.position is None or drive is None:
            raise InputError(f"{record.file}: fit.predict: position needs the position; name it under signals")
        every = record.decimation(decimation)
        usual = min(round(HORIZON / record.step), whole.time.size // 2)
        size = max(usual if horizon is None else round(horizon / record.step), _SHORTEST)
        if size < _EQUATIONS * every:
            raise InputError(
                f"{record.file}: fit.predict: a window of {size} samples holds {size // every} equations of {every} samples; expected at least "
                f"{_EQUATIONS}, more than it has unknowns at its start: lower fit.decimation, or measure longer"
            )
        for first in range(0, whole.time.size, size):  # equal windows, the last one shorter
            if whole.time.size - first < _SHORTEST:
                break
            samples = slice(first, min(first + size, whole.time.size))
            # means over blocks of samples, (blocks, samples), the last one longer
            n = samples.stop - first
            block = np.minimum(np.arange(n) // every, max(n // every - 1, 0))
            means = sparse.csr_array(((1 / np.bincount(block))[block], (block, np.arange(n))))
            windows.append(
                Motion(
                    file=record.file, continues_previous=first > 0, time=whole.time[samples],
                    velocity=whole.velocity[samples], torque=whole.torque[samples], extra=whole.extra[samples],
                    shifts={name: shift[samples] for name, shift in whole.shifts.items()},
                    smooth=None if every == 1 else means, measured=record.position[part][samples],
                    drive=drive[part][samples],
                )
            )  # fmt: skip  # a list of values
    return replace(
        posed, motions=tuple(windows), quantity="position", initial_states=("y0", "v0", "z0"), equations=plant
    )


def with_more_torque(problem: DynamicProblem, constant: str, share: float) -> DynamicProblem:
    """The problem with its drive changed by a share of a constant's standard error."""
    plant = problem.equations
    per = plant.motor.R / plant.motor.k_t if isinstance(plant, Simulated) else 1.0  # volts, or the torque itself
    moved = [
        replace(w, drive=w.drive + share * per * w.shifts[constant]) if constant in w.shifts else w
        for w in problem.motions
    ]
    return replace(problem, motions=tuple(moved))


@lru_cache(maxsize=16)
def _chain(steps: int, every: int, current: Current, of: Law, windows: int) -> ca.Function:
    """Simulated windows: (start, inputs, parameters) -> y and its derivatives at every sample but the first."""
    count = 2 * len(fields_of(of))
    free = count + len(LOADS)  # the state's derivatives: by a pair of sets and the loads
    x, u, p = ca.SX.sym("x", 3), ca.SX.sym("u", 2), ca.SX.sym("p", free + 2)
    by = ca.SX.sym("by", 3, 3 + free)
    # ((y, v, z), (drive, h), (pair, inertia and other loads, k_t, R)) -> (y, v, z) after h
    sets, (J, *loads, k_t, R) = ca.vertsplit(p[:count]), ca.vertsplit(p[count:])
    drive, h = ca.vertsplit(u)
    state = State(*ca.vertsplit(x))
    middle = state.position + h / 2 * state.velocity
    _, *terms = law.load_terms(middle, state.velocity, 0.0, 0.0).values()
    load = -sum(parameter * term for parameter, term in zip(loads, terms, strict=True))
    new = ca.vertcat(*plant_step(state, drive, load, h, pair_of(sets, of), Motor(k_t, R, 0.0, J), current))
    source = ca.horzcat(ca.SX(3, 3), ca.jacobian(new, p)[:, :free])
    moved = ca.densify(ca.jacobian(new, x) @ by + source)
    both = ca.Function("both", [ca.vertcat(x, ca.vec(by)), u, p], [ca.vertcat(new, ca.vec(moved))], {"cse": True})
    start, inputs = ca.MX.sym("start", both.size1_in(0)), ca.MX.sym("inputs", 2, steps)
    constants = ca.MX.sym("p", free + 2)
    ends = both.mapaccum(steps)(start, inputs, ca.repmat(constants, 1, steps))
    one = ca.Function("chain", [start, inputs, constants], [ends[::3, every - 1 :: every]])
    return one if windows == 1 else one.map(windows, "thread", threads())
