"""A compensator with its state, for a real-time loop."""

from collections.abc import Mapping

from bristle.control.compensator import Compensator, Measurement, Reference, compiled, initial_state
from bristle.errors import InputError
from bristle.model import law
from bristle.model.parameters import Pair


class RunningCompensator:
    """`compensator.compiled` with its state. Not thread-safe."""

    def __init__(
        self,
        compensator: Compensator,
        parameters: Pair[float],
        position: float = 0.0,
        rises: Mapping[str, float] | None = None,
    ) -> None:
        """Start at rest at a position, rad, with parameters of both directions, nothing learnt.

        `rises` are coefficients by which friction rises with load (`law.load_levels`). Raises InputError where a
        parameter is not finite, or a coefficient unknown.
        """
        self.rises = dict(rises or {})
        known = law.load_levels(0.0, 0.0)
        if unknown := self.rises.keys() - known.keys():
            raise InputError(f"rises: got {min(unknown)}; expected coefficients among {', '.join(known)}")
        every = [pair for p in parameters for pair in zip(p._fields, p, strict=True)]
        wrong = [n for n, x in (*every, *self.rises.items()) if not abs(x) < float("inf")]
        if wrong:
            raise InputError(f"compensator: {wrong[0]} is not finite; expected the parameters of an identified joint")
        self.compensator, self.parameters = compensator, parameters
        self._seen = {velocity: compiled(compensator, parameters.law, velocity=velocity) for velocity in (False, True)}
        self.reset(position)

    def reset(self, position: float = 0.0) -> None:
        """Start again at rest at a position, rad, with gains of 1."""
        self._state = initial_state(self.compensator, self.parameters, position)

    def step(
        self,
        dt: float,
        reference: tuple[float, float] | tuple[float, float, float],
        position: float,
        velocity: float | None = None,
        load: tuple[float, float] | None = None,
    ) -> float:
        """The torque to add to the controller's, N*m, one control period after the last call.

        Args:
            dt: s since the last call, > 0.
            reference: position, velocity and, where the inertia is fed forward, acceleration: rad, rad/s, rad/s**2.
            position: measured, rad.
            velocity: measured, rad/s; None: from the position, where it is needed.
            load: what friction rises with, where it does: the torque that the motor gives, and that of gravity and links
                on the joint (of gravity alone, the torque that holds the joint, with the other sign), N*m; None: no load.

        Raises InputError where dt is no time, the load is not finite, or the joint's friction does not rise with it.
        """
        if not 0 < dt < float("inf"):
            raise InputError(f"dt: got {dt!r}; expected seconds since the last call, more than 0")
        run = self._seen[velocity is not None]
        if load is not None and not self.rises:
            raise InputError(
                "load: this compensator has no coefficients of a load; give it rises, or leave load out where friction does not rise with it"
            )
        level = 0.0  # what a load adds to alpha_0, N*m
        if load is not None:
            if not abs(load[0]) + abs(load[1]) < float("inf"):
                raise InputError(f"load: got {load[0]!r} and {load[1]!r}; expected the torques of motor and links, N*m")
            level = float(law.load_rise(self.rises, *load))
        asked = Reference(*(*reference, 0.0)[:3])._replace(level=level)
        self._state, torque = run(self._state, asked, Measurement(position, velocity), dt)
        return torque

    @property
    def gains(self) -> dict[str, float]:
        """Gains of the adapted parameters."""
        adaptation = self.compensator.adaptation
        return dict(zip(adaptation.parameters, self._state.learnt.theta, strict=True)) if adaptation else {}
