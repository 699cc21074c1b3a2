from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.robot.motion import MAX_JOINTS, RigidBody, rigid_body
from bristle.data.robot.urdf import Payload, read_urdf
from bristle.errors import InputError

from .arms import ARM, NAMES, NO_PINOCCHIO, J, L, M, inertial, pendulum

pytest.importorskip("pinocchio", reason=NO_PINOCCHIO)
G = 9.81
DOWN = (0.0, 0.0, -G)
HOME = np.array([0.3, 0.5, 1.1, -0.4, 0.4, 0.7])


def body_of(folder: Path, text: str, names: tuple[str, ...], payload: Payload | None = None) -> RigidBody:
    path = folder / "robot.urdf"
    path.write_text(text, encoding="utf-8")
    return rigid_body(read_urdf(path), names, DOWN, payload)


def torques(body: RigidBody, *parts: Array) -> Array:
    """Along a motion of position, velocity and acceleration, (n, joints) each."""
    q, v, a = parts
    return body.torques(q, v, a)


@pytest.fixture(scope="module")
def arm_body() -> RigidBody:
    return rigid_body(read_urdf(ARM), NAMES, DOWN, None)


def motion(n: int) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of six joints over three seconds, (n, 6)."""
    t = np.linspace(0.0, 3.0, n)[:, None]
    w, p = np.random.default_rng(0).uniform(1.0, 4.0, (2, 6))
    return HOME + 0.4 * np.sin(w * t + p), 0.4 * w * np.cos(w * t + p), -0.4 * w**2 * np.sin(w * t + p)


@given(q=st.floats(-6, 6), v=st.floats(-5, 5), a=st.floats(-20, 20))
def test_a_pendulum_has_the_torque_of_a_pendulum(
    tmp_path_factory: pytest.TempPathFactory, q: float, v: float, a: float
) -> None:
    """M g l sin q + (J + m l**2) a, at any velocity."""
    body = body_of(tmp_path_factory.mktemp("swing"), pendulum(), ("swing",))
    found = body.torques(np.array([[q]]), np.array([[v]]), np.array([[a]]))
    assert found[0, 0] == pytest.approx(M * G * L * np.sin(q) + (J + M * L**2) * a, abs=1e-9)
    assert body.inertias(np.array([[q]]))[0, 0] == pytest.approx(J + M * L**2)


def test_torques_and_payloads_of_an_arm(arm_body: RigidBody, tmp_path: Path) -> None:
    """The torque of some joints is that of all where the others stand still at zero; with the names reversed, it is reversed with the motion."""
    few = ("elbow", "shoulder")
    own = rigid_body(read_urdf(ARM), few, DOWN, None)
    at = [NAMES.index(name) for name in few]
    parts = motion(20)
    whole = [np.zeros_like(x) for x in parts]
    for full, x in zip(whole, parts, strict=True):
        full[:, at] = x[:, at]
    some = torques(own, *(x[:, at] for x in parts))
    assert some == pytest.approx(torques(arm_body, *whole)[:, at], abs=1e-9)
    turned = rigid_body(read_urdf(ARM), NAMES[::-1], DOWN, None)
    assert torques(turned, *(x[:, ::-1] for x in parts)) == pytest.approx(torques(arm_body, *parts)[:, ::-1], abs=1e-9)
    assert turned.inertias(parts[0][:, ::-1]) == pytest.approx(arm_body.inertias(parts[0])[:, ::-1], abs=1e-9)
    # upside down, what stands still asks for the opposite torque
    q, rest = HOME[None, :], np.zeros((1, 6))
    assert arm_body.torques(q, rest, rest, gravity=(0.0, 0.0, G)) == pytest.approx(-arm_body.torques(q, rest, rest))
    # a point of mass at the tool asks for the torque of a URDF that has it as a link
    text = ARM.read_text(encoding="utf-8")
    load = Payload(mass=2.5, center=(0.03, -0.02, 0.1), link="tool")
    fixed = (
        f'<link name="load">{inertial(2.5)}</link><joint name="held" type="fixed"><parent link="tool"/><child link="load"/>'
        '<origin xyz="0.03 -0.02 0.1"/></joint></robot>'
    )
    q, v, a = motion(20)
    merged = body_of(tmp_path, text.replace("</robot>", fixed), NAMES).torques(q, v, a)
    assert body_of(tmp_path, text, NAMES, load).torques(q, v, a) == pytest.approx(merged, abs=1e-9)
    # what joints and links are called changes no torque: Pinocchio's own names, a payload's, or the same for both
    parts = motion(10)
    for old, new in (
        ("elbow", "universe"), ("forearm", "universe"), ("base", "world"), ("forearm", "elbow"),
        ("forearm", "bristle_payload"), ("wrist_roll", "roll & pitch"), ("turret", "Tür 1"),
    ):  # fmt: skip  # a list of values
        quoted = new.replace("&", "&amp;")
        text = ARM.read_text(encoding="utf-8").replace(f'"{old}"', f'"{quoted}"')
        body = body_of(tmp_path, text, tuple(new if x == old else x for x in NAMES))
        assert torques(body, *parts) == pytest.approx(torques(arm_body, *parts), abs=1e-12), new
    # a prismatic joint upwards asks for m (g + a)
    text = pendulum(kind="prismatic").replace("0 1 0", "0 0 1")
    found = body_of(tmp_path, text, ("swing",)).torques(np.array([[0.2]]), np.array([[1.0]]), np.array([[3.0]]))
    assert found[0, 0] == pytest.approx(M * (G + 3.0))
    # a joint that is none, a payload on no link, and more joints than Pinocchio can hold, in one sentence each
    for names, payload, told in (
        (("knee",), None, r"joint 'knee' is none of arm\.urdf; expected one of turret"),
        (NAMES, Payload(mass=1.0, center=(0.0, 0.0, 0.0), link="claw"), r"robot\.payload\.link: got 'claw'"),
        (("turret",) * (MAX_JOINTS + 1), None, rf"got {MAX_JOINTS + 1} joints"),
    ):
        with pytest.raises(InputError, match=told):
            rigid_body(read_urdf(ARM), names, DOWN, payload)
