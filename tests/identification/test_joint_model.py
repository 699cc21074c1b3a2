import math
from pathlib import Path

import casadi as ca
import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.identification.joint_model import JointModel
from bristle.model.parameters import SIGNED

from ..conftest import speeds, write


@pytest.fixture(scope="module")
def joint(edro_results: Path) -> JointModel:
    return bristle.read_results(edro_results).model("wrist pitch")


def test_every_way_to_its_friction_agrees(joint: JointModel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`friction`, CasADi's steady torque, LuGre at the deflection where dz/dt = 0, and the table, at speeds of both signs."""
    v = np.array([-1.0, -0.02, 0.01, 0.6])
    steady, torque = joint.casadi().steady, joint.casadi().torque
    np.testing.assert_allclose(joint.friction(v), steady(v.reshape(1, -1)).full().ravel(), rtol=1e-12)
    for speed in v.tolist():
        p = joint.parameters[0 if speed > 0 else 1]
        z = math.copysign(p.alpha_0 + p.alpha_1 * math.exp(-((speed / p.v_s) ** 2)), speed) / p.sigma_0
        T, dz = torque(z, speed)
        assert float(dz) == pytest.approx(0.0, abs=1e-12)
        assert float(T) == pytest.approx(float(joint.friction(speed)), rel=1e-12)
    rows = joint.to_frame().to_dict("index")
    for d, p in zip(SIGNED, joint.parameters, strict=True):
        row = rows[f"alpha_0{d}"]
        assert row["lower"] < row["value"] < row["upper"]
        assert row["value"] == p.alpha_0
    # the derivative by the velocity is the difference quotient's
    steady, v = joint.casadi().steady, ca.SX.sym("v")
    slope = ca.Function("slope", [v], [ca.jacobian(steady(v), v)])
    h = 1e-6
    for speed in (-0.3, 0.02, 0.5):
        assert float(slope(speed)) == pytest.approx(float(steady(speed + h) - steady(speed - h)) / (2 * h), rel=1e-5)
    # without adaptation, and driven at one velocity for long, the compensator adds the friction of steady sliding
    running = joint.compensator(law=None)
    torque = 0.0
    for k in range(4000):
        torque = running.step(1e-3, (0.3e-3 * k, 0.3), 0.3e-3 * k)
    assert torque == pytest.approx(float(joint.friction(0.3)), rel=1e-6)
    # with `regressors: [quadratic]` friction is what was measured, and CasADi's has as much of it
    for module in ("curve", "joint_model"):
        monkeypatch.setattr(f"bristle.identification.{module}.drag_of", lambda _: 0.3)
    assert float(joint.casadi().steady(-0.7)) == pytest.approx(float(joint.friction(-0.7)), rel=1e-12)
    monkeypatch.undo()
    file, log = write(tmp_path, speeds()), pd.read_csv(tmp_path / "wrist.csv")
    torque = log.tau + 0.05 * log.v * log.v.abs()
    log.assign(tau=torque).to_csv(tmp_path / "wrist.csv", index=False)
    file.write_text(
        f"{file.read_text('utf-8')}fit: {{regressors: [quadratic], set_up: as-written}}\n", encoding="utf-8"
    )
    np.testing.assert_allclose(bristle.identify(file).model().friction(log.v), torque, rtol=0.02)


def test_what_is_not_known_is_said(tmp_path: Path) -> None:
    """Points in one direction give no friction in the other, and no compensator, in one sentence."""
    alone = bristle.identify(write(tmp_path, speeds(both=False))).model()
    assert np.isnan(alone.friction(-0.1))
    assert alone.friction(0.1) > 0
    with pytest.raises(bristle.InputError, match="a compensator needs"):
        alone.casadi()
