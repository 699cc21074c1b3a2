"""Every compensator behind encoders and delays: right compensation is best, over-compensation and limit cycles are marked."""

from dataclasses import replace

import numpy as np
import pytest

from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.questions.compensation import ablation as trying
from bristle.questions.compensation.ablation import SHARES, WAYS, AblationRow, ablate

from ..simulation.joints import joint_loop

LUGRE = "LuGre, reference velocity"


@pytest.fixture(scope="module")
def rows() -> tuple[AblationRow, ...]:
    """The gripper with its true model, behind 20 bits, without delay and with one of five periods."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trying, "BITS", (20,))
        patch.setattr(trying, "DELAYS", (0, 5))
        return ablate(joint_loop())


def of(rows: tuple[AblationRow, ...], compensator: str, delay: int = 0) -> dict[float, AblationRow]:
    """Rows of one compensator and delay, by share."""
    return {r.share: r for r in rows if r.compensator == compensator and r.delay == delay}


def test_every_way_is_tried_once_under_each_circumstance(rows: tuple[AblationRow, ...]) -> None:
    """One row for every compensator, encoder, delay and share, and one without compensation, which has no share."""
    expected = [(way, 20, d, s) for way in WAYS for d in (0, 5) for s in (SHARES if way != "none" else (0.0,))]
    assert [(r.compensator, r.encoder_bits, r.delay, r.share) for r in rows] == expected
    assert all(np.isfinite([r.rms_error, r.over_none, r.chatter]).all() for r in rows)


def test_without_compensation_the_ratio_is_one(rows: tuple[AblationRow, ...]) -> None:
    """`none` without delay is what all others are relative to, and leads nowhere."""
    assert of(rows, "none")[0.0].over_none == 1.0
    bare = of(rows, "none")[0.0].rms_error
    for row in rows:
        assert row.over_none == pytest.approx(row.rms_error / bare)
    assert not any(r.over_compensated for r in rows if r.compensator == "none")


def test_all_of_the_friction_is_the_best_share(rows: tuple[AblationRow, ...]) -> None:
    """LuGre by reference velocity: with all of the true friction the error is less than half of that with any other share."""
    found = of(rows, LUGRE)
    assert all(found[1.0].rms_error < 0.5 * row.rms_error for share, row in found.items() if share != 1.0)
    assert found[1.0].over_none < 0.1


@pytest.mark.parametrize("way", [way for way in WAYS if way.startswith(("LuGre", "Stribeck"))])
def test_more_than_all_of_the_friction_is_marked(rows: tuple[AblationRow, ...], way: str) -> None:
    """With the whole curve at 150 % the joint leads its reference and is marked over-compensated; at 50 % it lags and is not."""
    found = of(rows, way)
    assert found[1.5].over_compensated
    assert not found[0.5].over_compensated
    assert not found[0.75].over_compensated


def test_a_sign_fed_back_swings_a_held_joint(rows: tuple[AblationRow, ...]) -> None:
    """Coulomb friction by the measured velocity makes the held joint swing on at every share; nothing by the reference velocity does."""
    for way in WAYS:
        found = of(rows, way)
        if way.endswith("reference velocity") or way == "none":
            assert not any(r.limit_cycle for r in found.values())
    assert all(r.limit_cycle for r in of(rows, "Coulomb, measured velocity").values())


def test_a_delay_costs_what_measures(rows: tuple[AblationRow, ...]) -> None:
    """Five periods late, feed-forward still leaves less than a fifth of the error."""
    assert of(rows, LUGRE, 5)[1.0].over_none < 0.2


def test_a_share_of_the_model_is_that_share_of_its_torque(rows: tuple[AblationRow, ...]) -> None:
    """Half of the model's parameters, v_s aside, compensate as the whole model does by half of its torque."""
    one = joint_loop()
    course, moving = trying._back_and_forth(one)
    case = replace(one.case(), resolution=trying._count(one, 20))
    run = simulate(LoopOptions(compensator=Compensator(share=0.5), encoder=True), [case], course, one.period)
    assert of(rows, LUGRE)[0.5].rms_error == pytest.approx(np.sqrt(np.mean(run.error[0, moving] ** 2)), rel=1e-9)
