"""An identified joint as a model: friction as numbers, as CasADi functions, and as a running compensator."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from bristle.arrays import Array, as_floats
from bristle.control.adaptation import Adaptation, Law
from bristle.control.compensator import Compensator, Name
from bristle.control.running import RunningCompensator
from bristle.data.experiment.load import Experiment
from bristle.errors import InputError
from bristle.identification.curve import drag_of, friction_of
from bristle.identification.known_joint import chosen, inertia_of, known_joint, rises_of, whole
from bristle.identification.results import Joint
from bristle.model import law as equations
from bristle.model.parameters import SIGNED, Pair

if TYPE_CHECKING:
    import pandas as pd


class Functions(NamedTuple):
    """The model as CasADi functions."""

    torque: ca.Function
    """(z, v) -> (T, dz): friction torque (3)-(5), N*m, and dz/dt, rad/s."""
    steady: ca.Function
    """(v) -> T: friction (9) of steady sliding, N*m."""


@dataclass(frozen=True, slots=True)
class JointModel:
    """The friction law of one joint; N and m where it slides."""

    joint: Joint
    experiment: Experiment | None = None
    """Source of an inertia that was not fitted, or None."""

    def friction(self, velocity: ArrayLike) -> Array:
        """Friction (9) with drag, N*m, at `velocity`, rad/s: 0 at rest, nan in an unknown direction.

        Raises InputError where nothing is known of friction vs velocity.
        """
        known = known_joint(self.joint)
        if not known.directions:
            raise InputError("friction: nothing is known of friction vs velocity; fit points or a motion")
        return friction_of(known, as_floats(velocity))

    @property
    def parameters(self) -> Pair[float]:
        """LuGre parameters of both directions, SI; an unknown bristle is filled in as for `bristle adapt`.

        Raises InputError where friction is not known in both directions, or nothing tells the inertia or travel for the
        filling.
        """
        known, J, travel = whole(self.joint), inertia_of(self.experiment, self.joint), self.joint.travel
        missing = {name for d in SIGNED for name in known.missing(d)}
        if ("sigma_1" in missing and J is None) or ("sigma_0" in missing and not travel):
            raise InputError(
                "compensator: the damping of the bristle is not known; fit a motion that shows it, or the inertia"
            )
        return known.pair(travel or 1.0, J or 1.0)

    def compensator(
        self,
        law: Law | None = "partial",
        gamma: float | tuple[float, ...] = 20.0,
        *,
        name: Name = "lugre",
        **settings: Any,
    ) -> RunningCompensator:
        """A compensator for a real-time loop: `step` gives the torque to add, (16)-(20); no regressor `quadratic`.

        Args:
            law: by which alpha_0 and alpha_2 adapt; None: they do not.
            gamma: learning rates, one for both or one each.
            name: of the compensator, as in `bristle.control.compensator`.
            settings: others of `Compensator`, such as `share` or `inertia`.

        Raises InputError as `parameters` does, or where a setting is not possible.
        """
        rates = gamma if isinstance(gamma, tuple) else (gamma, gamma)
        adaptation = None if law is None else Adaptation(law=law, gamma=rates)
        asked = Compensator(name=name, adaptation=adaptation, **settings)
        return RunningCompensator(asked, self.parameters, rises=rises_of(self.joint))

    def casadi(self) -> Functions:
        """The model without load as CasADi functions. Raises InputError as `parameters` does."""
        z, v, pair = ca.SX.sym("z"), ca.SX.sym("v"), self.parameters
        acting, sliding = equations.active(z, v, pair), equations.active(v, v, pair)
        drag = drag_of(known_joint(self.joint)) * equations.load_terms(0.0, v, 0.0, 0.0)["quadratic"]
        moving = [equations.torque(z, v, acting) + drag, equations.bristle_rate(z, v, acting)]
        return Functions(
            ca.Function("torque", [z, v], moving, ["z", "v"], ["T", "dz"]),
            ca.Function("steady", [v], [equations.steady_torque(v, sliding) + drag], ["v"], ["T"]),
        )

    def to_frame(self) -> "pd.DataFrame":
        """A row per parameter to use: value, standard error, ends of the 95 % interval, unit, and its fit."""
        import pandas as pd

        columns = ["parameter", "value", "standard_error", "lower", "upper", "unit", "from"]
        rows = [
            (str(x.parameter), x.estimate.value, x.estimate.total_error, *(x.estimate.interval or (None, None)), x.estimate.unit, str(x.source))
            for x in chosen(self.joint)
        ]  # fmt: skip  # a row
        numbers = dict.fromkeys(columns[1:5], np.float64)
        return pd.DataFrame(rows, columns=columns).astype(numbers).set_index("parameter")
