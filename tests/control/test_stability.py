"""The longest control period: refused before it diverges, and what is physical is not refused."""

import re
from dataclasses import replace

import numpy as np
import pytest

from bristle.control import closed_loop
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator, Reference
from bristle.control.control_period import Disturbance, LoopOptions
from bristle.control.pid import Gains
from bristle.control.stability import growth, refuse_long_period
from bristle.model.parameters import Motor, Pair
from bristle.simulation import edro

from .conftest import H, P, case, sine

BARE = LoopOptions(compensator=Compensator(name="none"))


def borne(options: LoopOptions, name: str, period: float) -> float:
    """The period that the refusal names, s."""
    with pytest.raises(ValueError, match="control period") as refused:
        simulate(options, [case(name)], sine(100 * period, 0.1, period), period)
    said = re.search(r"bears about (\S+) s", str(refused.value))
    assert said is not None
    return float(said[1])


def test_the_refusal_says_what_when_and_what_to_do() -> None:
    """A period of 0.1 s on the gripper with the paper's PID: what was got, how fast it grows, what it bears, what to do."""
    with pytest.raises(
        ValueError,
        match=r"^case 1: got a control period of 0\.1 s, in which the loop's fastest mode grows by a factor of 9\.1\d+; "
        r"the loop bears about 0\.013 s: shorten the period, or lower the gains or the delay$",
    ):
        simulate(LoopOptions(), [case("base rotation"), case("gripper rotation")], sine(10.0, 0.5, 0.1), 0.1)


@pytest.mark.parametrize("options", [BARE, replace(BARE, drive="voltage"), replace(BARE, delay=3)])
@pytest.mark.parametrize("name", ["gripper rotation", "wrist pitch"])
def test_below_the_bound_it_runs_and_above_it_diverges(
    options: LoopOptions, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a blow of a thousand breakaway torques, 0.9 of the named period brings the joint back; 1.2 of it, unrefused, loses it."""
    named = borne(options, name, 0.5)
    monkeypatch.setattr(closed_loop, "refuse_long_period", lambda *_: None)
    ends = []
    for h in (0.9 * named, 1.2 * named):
        zero, load = np.zeros(601), np.zeros(601)
        load[:5] = 1000 * case(name).plant.positive.alpha_0
        run = simulate(options, [case(name)], Reference(zero, zero, zero), h, Disturbance(load=load))
        blow, end = np.abs(run.error[0, :50]).max(), np.abs(run.error[0, -50:]).max()
        ends.append(end / blow)
    assert ends[0] < 0.1
    assert not ends[1] < 10


def test_the_paper_s_loops_are_borne() -> None:
    """Every joint of Table 1 with the paper's PID at 1 kHz, by torque and by voltage, up to five periods late; and sliding mode at any period."""
    cases = [case(name) for name in edro.TABLE_1]
    for delay in range(6):
        for options in (LoopOptions(delay=delay), LoopOptions(delay=delay, drive="voltage")):
            refuse_long_period(options, cases, H)
            assert (growth(options, cases, np.full(len(cases), H)) < 1e-4).all()
    slide = LoopOptions(controller="sliding", compensator=Compensator(name="none"))
    assert (growth(slide, cases, np.full(len(cases), 0.1)) > 0.1).any()
    refuse_long_period(slide, cases, 0.1)


@pytest.mark.parametrize("sigma_0", [6.0, 1e3, 1e4, 1e5])
def test_swings_in_stick_are_not_refused(sigma_0: float) -> None:
    """A bristle however stiff at 1 kHz: what grows in stick ends where the joint breaks away, and the loop tracks."""
    p = P._replace(sigma_0=sigma_0)
    run = simulate(BARE, [case("gripper rotation", plant=Pair(p, p))], sine(4.0, 0.5), H)
    assert run.peak_error(1.0)[0] < 0.06


def test_what_no_period_mends_is_not_blamed_on_the_period() -> None:
    """With too much integral for its damping the continuous loop is unstable itself; no gains at all do not grow; neither is refused."""
    p = P._replace(alpha_2=0.0)
    one = case("gripper rotation", plant=Pair(p, p), gains=Gains(1.0, 1000.0, 0.01, 0.0))
    free = replace(one, gains=Gains(0.0, 0.0, 0.0, 0.0))
    for h in (1e-4, 1e-3):
        refuse_long_period(BARE, [one], h)
        refuse_long_period(BARE, [free], 1000 * h)
        assert growth(BARE, [one], np.array([h])) > 1e-4
        assert growth(BARE, [free], np.array([1000 * h])) < 1e-4


@pytest.mark.parametrize("k", [0.5, 1.3, 2.5])
def test_growth_is_that_of_the_linear_loop(k: float) -> None:
    """An inertia with K_d = k J / h alone and no viscous friction: of (y, v, the last y) the modes are those of a matrix that a pencil writes."""
    J, h, p = 1e-3, 0.01, P._replace(alpha_2=0.0)
    one = case("wrist pitch", plant=Pair(p, p), motor=Motor(1.0, 1.0, 0.0, J), gains=Gains(0.0, 0.0, k * J / h, 0.0))
    step = np.array([[1 - k / 2, h, k / 2], [-k / h, 1.0, k / h], [1.0, 0.0, 0.0]])
    (found,) = growth(BARE, [one], np.array([h]))
    assert np.exp(found) == pytest.approx(np.abs(np.linalg.eigvals(step)).max(), rel=1e-3)


def test_cases_are_judged_as_if_each_were_alone() -> None:
    """In a batch every case has the growth that it has by itself, and a refusal names the worst."""
    gains = [Gains(3.0, 1.2, K_d, 0.0) for K_d in (0.2, 2.0, 5.0, 1.0)]
    cases = [case("gripper rotation", gains=g) for g in gains]
    every = growth(BARE, cases, np.full(len(cases), H))
    alone = [growth(BARE, [one], np.array([H]))[0] for one in cases]
    np.testing.assert_array_equal(every, alone)
    with pytest.raises(ValueError, match=r"^case 2: "):
        refuse_long_period(BARE, cases, H)
