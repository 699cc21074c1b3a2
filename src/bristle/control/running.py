"""A compensator that remembers its state: one call for each control period of a loop in real time."""

from bristle.control.compensator import Compensator, Measurement, Reference, compiled, initial_state
from bristle.errors import InputError
from bristle.model.parameters import Pair


class RunningCompensator:
    """What `compensator.compiled` does, with the state kept inside. One thread at a time."""

    def __init__(self, compensator: Compensator, parameters: Pair[float], position: float = 0.0) -> None:
        """Of a joint at rest at a position, rad, with its parameters in both directions; nothing is learnt yet.

        Raises InputError where a parameter is not finite.
        """
        wrong = [n for p in parameters for n, x in zip(p._fields, p, strict=True) if not abs(x) < float("inf")]
        if wrong:
            raise InputError(f"compensator: {wrong[0]} is not finite; expected the parameters of an identified joint")
        self.compensator, self.parameters = compensator, parameters
        self._seen = {velocity: compiled(compensator, parameters.law, velocity=velocity) for velocity in (False, True)}
        self.reset(position)

    def reset(self, position: float = 0.0) -> None:
        """Begin anew: at rest at a position, rad, the bristle not bent, all gains 1."""
        self._state = initial_state(self.compensator, self.parameters, position)

    def step(
        self,
        dt: float,
        reference: tuple[float, float] | tuple[float, float, float],
        position: float,
        velocity: float | None = None,
    ) -> float:
        """The torque to add to the controller's, N*m, one control period after the last call.

        Args:
            dt: s since the last call, > 0.
            reference: position, velocity and, where the inertia is fed forward, acceleration: rad, rad/s, rad/s**2.
            position: measured, rad.
            velocity: measured, rad/s; None: from the position, where it is needed.

        Raises InputError where dt is no time.
        """
        if not 0 < dt < float("inf"):
            raise InputError(f"dt: got {dt!r}; expected seconds since the last call, more than 0")
        run = self._seen[velocity is not None]
        self._state, torque = run(self._state, Reference(*(*reference, 0.0)[:3]), Measurement(position, velocity), dt)
        return torque

    @property
    def gains(self) -> dict[str, float]:
        """What each adapted parameter is multiplied by; 1 at first."""
        adaptation = self.compensator.adaptation
        return dict(zip(adaptation.parameters, self._state.learnt.theta, strict=True)) if adaptation else {}
