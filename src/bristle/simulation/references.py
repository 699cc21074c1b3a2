"""Reference motions and loads as few numbers; `at` samples them at times, s, (n,), with continuous acceleration."""

from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from bristle.arrays import Array
from bristle.control.compensator import Reference
from bristle.model import functions
from bristle.model.laws.parts import Expression
from bristle.model.vectorize import evaluate

_SMOOTH = Polynomial([0.0, 0.0, 3.0, -2.0])  # from one velocity to the next
_TRAVELLED = _SMOOTH.integ()
_ACROSS = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # from one position to the next, at rest at both
STEEPEST = float(_SMOOTH.deriv()(0.5))  # largest acceleration of a hold's ramp, times its duration over its velocity
FASTEST = float(_ACROSS.deriv()(0.5))  # largest velocity of a move, over its mean
HARDEST = float(np.abs(_ACROSS.deriv(2)(_ACROSS.deriv(3).roots().real)).max())
"""Largest acceleration of a move, times its duration squared over its way."""


class Sine(NamedTuple):
    """amplitude sin(2 pi frequency t), rad and Hz."""

    amplitude: float
    frequency: float

    def position(self, t: Expression) -> Expression:
        """At a CasADi symbol of time, rad."""
        return self.amplitude * ca.sin(2 * np.pi * self.frequency * t)

    def sampled(self, duration: float, period: float) -> Reference:
        """From 0 to the duration, every period, s."""
        return self.at(period * np.arange(round(duration / period) + 1, dtype=np.float64))

    def at(self, time: Array) -> Reference:
        """With velocity and acceleration."""
        A, w = self.amplitude, 2 * np.pi * self.frequency
        return Reference(A * np.sin(w * time), A * w * np.cos(w * time), -A * w * w * np.sin(w * time))


class Multisine(NamedTuple):
    """A sum of sines, faded in and out: rad, Hz and rad, (k,) each."""

    amplitude: Array
    frequency: Array
    phase: Array

    def at(self, time: Array, duration: float, rest: float = 0.5) -> Reference:
        """About zero, fading over `rest` at both ends of the duration, s."""
        sines = (x[:, None] for x in self)
        x, x_t, x_tt = evaluate(functions.faded_sine_function(), time, *sines, duration, rest)
        return Reference(x.sum(axis=0), x_t.sum(axis=0), x_tt.sum(axis=0))


class Hold(NamedTuple):
    """A pass at constant velocity, from rest to rest."""

    run: int  # Index of its run
    velocity: float  # rad/s, signed
    run_in: float  # Time at that velocity before averaging, s
    averaged: float  # Averaging time, s
    ramp: float  # Time from rest to the velocity, s

    @property
    def travel(self) -> float:
        """rad, signed."""
        return self.velocity * (self.run_in + self.averaged + self.ramp)

    @property
    def duration(self) -> float:
        """S."""
        return self.ramp + (self.run_in + self.averaged) + self.ramp

    def at(self, time: Array, start: float = 0.0) -> Reference:
        """From a position, rad."""
        falls = self.ramp + (self.run_in + self.averaged)
        up, down = (np.clip((time - t) / self.ramp, 0.0, 1.0) for t in (0.0, falls))
        flat = np.clip(time - self.ramp, 0.0, falls - self.ramp)
        way = self.ramp * _TRAVELLED(up) + flat + self.ramp * (down - _TRAVELLED(down))
        slope = _SMOOTH.deriv()
        return Reference(
            start + self.velocity * way,
            self.velocity * (_SMOOTH(up) - _SMOOTH(down)),
            self.velocity / self.ramp * (slope(up) - slope(down)),
        )


class Move(NamedTuple):
    """From rest to rest elsewhere, rad, in so many s."""

    start: float
    stop: float
    duration: float

    def at(self, time: Array) -> Reference:
        """At rest after its duration."""
        s, way = np.clip(time / self.duration, 0.0, 1.0), self.stop - self.start
        return Reference(
            self.start + way * _ACROSS(s),
            way / self.duration * _ACROSS.deriv()(s),
            way / self.duration**2 * _ACROSS.deriv(2)(s),
        )


class SlowLoads(NamedTuple):
    """An open-loop presliding experiment: torque peaks below breakaway, slowly up and faster down."""

    peaks: tuple[float, ...]  # N*m, signed
    rise: float = 25.0  # Time to each peak, s
    fall: float = 4.0  # Time from it back to zero, s
    rest: float = 1.0  # Before the first and after the last peak, s
    pause: float = 0.0  # Between peaks, s

    @property
    def duration(self) -> float:
        """S."""
        return float(self._turns()[-1])

    def at(self, time: Array) -> Reference:
        """A torque, at a position of zero."""
        torques = [0.0, 0.0, *(x for peak in self.peaks for x in (peak, 0.0, 0.0))]
        still = np.zeros(time.size)
        return Reference(still, still, still, np.interp(time, self._turns(), torques))

    def _turns(self) -> Array:
        """Times of turns, s."""
        steps = [self.rise, self.fall, self.pause] * len(self.peaks)
        return np.cumsum([0.0, self.rest, *steps[:-1], self.rest])


def stacked(references: Sequence[Reference]) -> Reference:
    """References of one length as one, (cases, n)."""
    whole = ([np.broadcast_to(x, r.position.shape) for x in r] for r in references)
    return Reference(*map(np.stack, zip(*whole, strict=True)))
