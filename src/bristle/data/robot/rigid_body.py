"""What a robot's links ask of each joint: gravity, inertia and coupling of the whole arm, by Pinocchio."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bristle.arrays import Array
from bristle.data.columns import reading
from bristle.data.experiment.schema import GRAVITY
from bristle.data.robot.urdf import Payload, Urdf
from bristle.errors import InputError, short_list

MAX_JOINTS = 100  # most joints that move: what Pinocchio keeps for a robot grows with their cube


@dataclass(frozen=True, slots=True)
class RigidBody:
    """A robot without friction, whose joints are in a given order; those that are not asked for rest at zero."""

    model: Any  # pinocchio's
    places: tuple[int, ...]  # where each joint stands among the model's

    def torques(self, q: Array, v: Array, a: Array, *, gravity: Sequence[float] | None = None) -> Array:
        """Torque of each joint along a motion, N*m or N, (n, joints): M(q) a + C(q, v) v + g(q).

        Position q, rad or m, velocity v and acceleration a are (n, joints), gravity, m/s**2, in the frame of the base, (3,);
        None: as the robot was made with.
        """
        import pinocchio

        model = self.model if gravity is None else _under(self.model, gravity)
        data = model.createData()
        order = np.argsort(self.places)
        rows = zip(*(np.ascontiguousarray(x[:, order]) for x in (q, v, a)), strict=True)
        # Pinocchio takes one sample a call, of some microseconds
        found = np.array([pinocchio.rnea(model, data, *row) for row in rows]).reshape(len(q), len(order))
        return np.asarray(found[:, list(self.places)])

    def inertias(self, q: Array) -> Array:
        """What each joint has to accelerate of the links while the others rest, kg*m**2 or kg, (n, joints): the diagonal of M(q)."""
        zero, unit = np.zeros_like(q), np.eye(q.shape[1])
        still = self.torques(q, zero, zero)
        moved = [self.torques(q, zero, zero + e)[:, k] for k, e in enumerate(unit)]
        return np.stack(moved, axis=1) - still


def largest_gravity(urdf: Urdf, name: str | None) -> float:
    """Torque of a joint's gravity a quarter turn from where it hangs, N*m, while the others rest at zero; None: of the only joint.

    Raises InputError as `rigid_body`, where no joint of several is named, or it slides, or its axis is vertical.
    """
    known = [joint.name for joint in urdf.joints]
    if name is None and len(known) != 1:
        raise InputError(
            f"{urdf.file}: has {len(known)} joints: {short_list(known)}; name the one of the log, as in --name {known[0]}"
        )
    body = rigid_body(urdf, [name or known[0]], (0.0, 0.0, -GRAVITY), None)
    still = np.zeros((2, 1))
    size = float(np.hypot(*body.torques(np.array([[0.0], [np.pi / 2]]), still, still)[:, 0]))
    if urdf.joint(name or known[0]).kind != "revolute" or not size > 1e-9:
        raise InputError(
            f"{urdf.file}: gravity makes no torque of {name or known[0]}, which slides, or turns about a vertical axis"
        )
    return size


def rigid_body(urdf: Urdf, names: Sequence[str], gravity: Sequence[float], payload: Payload | None) -> RigidBody:
    """The robot of a URDF with its joints in the order of `names`.

    Raises InputError where Pinocchio is missing or refuses the URDF, there is no such joint, or there are too many.
    """
    try:
        import pinocchio
    except ImportError as error:
        raise InputError(
            "robot.urdf needs Pinocchio, which is not installed; install it with pip install 'bristle[robot]', or leave robot out"
        ) from error
    if len(names) > MAX_JOINTS:
        raise InputError(f"got {len(names)} joints of {urdf.file}; expected at most {MAX_JOINTS}")
    own = [urdf.places[urdf.joint(name).name] for name in names]
    with reading("URDF that Pinocchio reads"):
        whole = pinocchio.buildModelFromXML(urdf.holding(payload) if payload else urdf.text)
        held = [k for k, name in enumerate(whole.names) if k and name not in own]
        model = pinocchio.buildReducedModel(whole, held, pinocchio.neutral(whole)) if held else whole
    places = tuple(int(model.joints[model.getJointId(name)].idx_v) for name in own)
    return RigidBody(_under(model, gravity), places)


def _under(model: Any, gravity: Sequence[float]) -> Any:
    import pinocchio

    own = pinocchio.Model(model)
    own.gravity.linear = np.asarray(gravity, dtype=float)
    return own
