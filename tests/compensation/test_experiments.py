"""The paper's experiments in closed loop, and more: each against docs/paper.md, a formula, or another experiment."""

from dataclasses import replace

import numpy as np
import pytest

from bristle.control.adaptation import LAWS, Adaptation
from bristle.model.parameters import Lugre, Pair
from bristle.questions.compensation import parameter_studies
from bristle.questions.compensation.paper_experiments import Errors, adapted, errors, followed
from bristle.questions.compensation.parameter_studies import (
    band,
    compare_controllers,
    drifts,
    map_adaptation,
)
from bristle.simulation.joint_loop import one_way

from ..simulation.joints import GRIPPER, J, joint_loop

P = GRIPPER.positive
FIG_8 = {
    "gripper rotation": (15.3, 0.030), "wrist pitch": (63.9, 0.050), "elbow pitch": (85.2, 0.112), "base rotation": (108.4, 0.272),
}  # fmt: skip  # a table
"""Fig. 8 as docs/paper.md has it: RMS error without compensation, mrad, and the ratio to it with the true model."""


@pytest.fixture(scope="module")
def rows() -> dict[tuple[str, float, bool], Errors]:
    """Fig. 8 of the four joints, by joint, frequency and inertia feed-forward; the gripper's identified model is not quite right."""
    wrong = Pair(*(p._replace(alpha_0=1.1 * p.alpha_0) for p in GRIPPER))
    loops = (joint_loop(name, **({"model": wrong} if name.startswith("gripper") else {})) for name in FIG_8)
    found = [row for loop in loops for row in errors(loop)]
    assert [(r.joint, r.frequency, r.inertia) for r in found] == [
        (name, f, inertia) for name in FIG_8 for f in (0.2, 0.5) for inertia in (False, True)
    ]
    return {(r.joint, r.frequency, r.inertia): r for r in found}


@pytest.mark.parametrize("name", list(FIG_8))
def test_errors_are_those_of_fig_8(name: str, rows: dict[tuple[str, float, bool], Errors]) -> None:
    """At 1 rad, 0.2 Hz both figures of a joint are those of docs/paper.md, the error without compensation within 1 %, the ratio within 10 %."""
    row, (without, left) = rows[name, 0.2, False], FIG_8[name]
    assert 1e3 * row.without == pytest.approx(without, rel=0.01)
    assert row.true / row.without == pytest.approx(left, rel=0.1)


@pytest.mark.parametrize("name", ["elbow pitch", "base rotation"])
def test_at_half_a_hertz_inertia_dominates(name: str, rows: dict[tuple[str, float, bool], Errors]) -> None:
    """There friction compensation alone leaves more than 30 % of the error of elbow and base; with inertia feed-forward less than 2 %."""
    plain, fed = rows[name, 0.5, False], rows[name, 0.5, True]
    assert plain.true > 0.3 * plain.without
    assert fed.true < 0.02 * fed.without


def test_the_identified_model_is_the_one_that_is_shown_as_such(rows: dict[tuple[str, float, bool], Errors]) -> None:
    """A right model errs as the true one does; one with a wrong alpha_0 errs more, adapted less again, and torque is what friction asks for."""
    wrong = rows["gripper rotation", 0.2, True]
    assert wrong.true < wrong.adaptive < 0.5 * wrong.identified
    for name in (*FIG_8,)[1:]:
        row = rows[name, 0.2, False]
        assert row.identified == row.true
        assert row.torque_with == pytest.approx(row.torque_without, rel=0.1)


def test_compensation_is_followed_for_two_periods() -> None:
    """Figs 5 to 7 hold two periods of the slow sine; with the model the error is less than a tenth of that without."""
    one = joint_loop()
    runs = followed(one)
    assert [*runs] == ["without", "with"]
    for run in runs.values():
        assert run.time[-1] == pytest.approx(2 / one.slow)
        np.testing.assert_array_equal(run.reference, one.sine(one.slow, 2 / one.slow).position)
    assert runs["with"].rms_error(5.0)[0] < 0.1 * runs["without"].rms_error(5.0)[0]
    assert not runs["without"].compensation.any()


def test_the_adaptation_is_table_2() -> None:
    """The gripper one way, from 0.3 alpha_0 and 0.5 alpha_2: `partial` ends within 0.02 of 0.84 and 1.05, `printed` leaves alpha_0 at 0.30."""
    found = adapted(one_way(joint_loop()))
    by = {(f.law, f.parameter): f for f in found.factors}
    assert [*by] == [(law, name) for law in LAWS for name in ("alpha_0", "alpha_2")]
    assert [*found.runs] == ["not adapted", *LAWS]
    assert {f.initial for (_, name), f in by.items() if name == "alpha_0"} == {0.3}
    assert {f.initial for (_, name), f in by.items() if name == "alpha_2"} == {0.5}
    assert by["partial", "alpha_0"].final == pytest.approx(0.84, abs=0.02)
    assert by["partial", "alpha_2"].final == pytest.approx(1.05, abs=0.02)
    assert by["partial", "alpha_0"].early > 0.80
    assert by["partial", "alpha_2"].early == pytest.approx(1.05, abs=0.05)
    assert by["printed", "alpha_0"].final == pytest.approx(0.30, abs=0.01)
    for name in ("alpha_0", "alpha_2"):  # with rates over the start it is the same law in other units
        assert by["partial-theta", name].final == pytest.approx(by["partial", name].final, rel=1e-9)
    late = {name: run.rms_error(16.0)[0] for name, run in found.runs.items()}
    assert late["partial"] < 0.2 * late["not adapted"]


def test_the_printed_law_is_left_out_where_it_is_not_typeset() -> None:
    """A plan that adapts v_s is tried by the three laws that can."""
    plan = Adaptation(parameters=("alpha_0", "v_s"), gamma=(20.0, 1.0))
    found = adapted(one_way(joint_loop(adaptation=plan)))
    assert [*found.runs] == ["not adapted", "partial", "partial-theta", "total"]


def test_maps_hold_the_adaptation_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the plan's own rate, amplitude and frequency both maps hold what the adaptation ends at; shapes are those of their axes."""
    monkeypatch.setattr(parameter_studies, "GAMMAS", (20.0, 50.0, 5.0))
    monkeypatch.setattr(parameter_studies, "FREQUENCIES", (2.0, 1.0))
    monkeypatch.setattr(parameter_studies, "AMPLITUDES", (1.0, 0.5, 2.0))
    one = one_way(joint_loop(adaptation=Adaptation(gamma=(20.0, 10.0)), frequency=0.6, amplitude=0.8))
    found = map_adaptation(one)
    ends = [f.final for f in adapted(one).factors if f.law == "partial"]
    assert found.by_gamma.shape == (2, 3, 2)
    assert found.by_amplitude.shape == (2, 3, 2)
    np.testing.assert_allclose(found.by_gamma[:, 0, 1], ends, rtol=1e-12)
    np.testing.assert_allclose(found.by_amplitude[:, 0, 1], ends, rtol=1e-12)
    np.testing.assert_allclose(found.by_amplitude[:, 0, 0], found.by_gamma[:, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(found.gammas, [20.0, 50.0, 5.0])
    np.testing.assert_allclose(found.frequencies, [1.2, 0.6])
    np.testing.assert_allclose(found.amplitudes, [0.8, 0.4, 1.6])


def test_drifts_are_told_of_every_way_with_the_known_model_first() -> None:
    """Per frequency: known, fixed, the law at a quarter and all of its rate, without limits, normalised; the first is the measure of all."""
    found = drifts(joint_loop())
    ways = ["known", "fixed", "partial", "partial", "partial, without limits", "partial, normalised"]
    assert [(r.joint, r.frequency, r.way) for r in found] == [
        ("gripper rotation", f, w) for f in (0.2, 0.5) for w in ways
    ]
    for first in (0, 6):
        known, fixed, slow, quick, *_ = found[first : first + 6]
        assert known.over_known == 1.0
        assert np.isnan([known.gamma, fixed.gamma, known.largest_gain, fixed.largest_gain]).all()
        assert (slow.gamma, quick.gamma) == (5.0, 20.0)
        assert fixed.over_known == max(r.over_known for r in found[first : first + 6])
        for row in found[first : first + 6]:
            assert row.over_known == pytest.approx(row.rms_error / known.rms_error)
    assert found[9].over_known < 1.5
    assert found[7].over_known > 2
    assert found[9].largest_gain == pytest.approx(1.5, abs=0.1)


def test_a_thin_sliding_mode_chatters() -> None:
    """On the gripper the thinnest layer chatters at least ten times as much as the PID; the widest is the PD that the PID contains."""
    bare, fed, wide, _, thin = compare_controllers(joint_loop())
    assert (bare.controller, fed.controller) == ("PID alone", "PID with LuGre feed-forward")
    assert thin.controller.startswith("sliding mode, layer")
    assert thin.chatter > 10 * bare.chatter
    assert wide.chatter == pytest.approx(bare.chatter, rel=0.1)
    assert wide.rms_error == pytest.approx(bare.rms_error, rel=0.1)
    assert fed.rms_error < 0.2 * bare.rms_error
    assert all(r.rms_error < r.peak_error for r in (bare, fed, wide, thin))


def spread(pair: Pair[float], rng: np.random.Generator, share: float) -> tuple[Pair[float], float]:
    """A joint near another: every parameter and the inertia times a factor that scatters by that share."""
    factors = np.exp(share * rng.standard_normal(13))
    sets = (Lugre(*(np.array(p) * f).tolist()) for p, f in zip(pair, factors[:12].reshape(2, 6), strict=True))
    return Pair(*sets), float(J * factors[12])


def test_the_band_holds_the_truth_that_it_was_drawn_for() -> None:
    """Where the truth lies within the identified covariance, its RMS error is within the band's, its error mostly inside; a wider one is wider."""
    rng = np.random.default_rng(0)
    model, _ = spread(GRIPPER, rng, 0.05)
    one = joint_loop(model=model, period=2e-3)
    narrow, wide = (
        band(replace(one, draws=tuple(spread(model, rng, share) for _ in range(40)))) for share in (0.05, 0.15)
    )
    assert narrow is not None
    assert wide is not None
    low, middle, high = narrow.rms
    assert low < narrow.rms_actual < high
    assert low < middle < high
    inside = (narrow.lower <= narrow.actual) & (narrow.actual <= narrow.upper)
    assert inside.mean() > 0.8
    assert wide.rms[2] > narrow.rms[2]
    assert narrow.joints == 40
    assert narrow.time[0] == pytest.approx(1 / one.slow)
    assert narrow.rms_actual == pytest.approx(np.sqrt(np.mean(narrow.actual**2)))


def test_errors_of_constants_are_a_part_of_the_band() -> None:
    """What they do to the RMS error alone stands beside the band of all causes, and is no part of its quantiles; without them it is None.

    A joint whose covariance is unknown has no band.
    """
    rng = np.random.default_rng(0)
    draws, by_constants = (tuple(spread(GRIPPER, rng, 0.1) for _ in range(20)) for _ in range(2))
    one = joint_loop(period=2e-3, draws=draws)
    assert band(replace(one, draws=())) is None
    without, beside = band(one), band(replace(one, draws_by_constants=by_constants))
    assert without is not None
    assert beside is not None
    assert without.rms_systematic is None
    assert beside.rms == pytest.approx(without.rms)
    alone = band(replace(one, draws=by_constants))
    assert alone is not None
    assert beside.rms_systematic == pytest.approx((alone.rms[0], alone.rms[2]))


def test_rates_of_zero_leave_the_map_at_its_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """With rates of zero nothing moves, over the whole map."""
    for name in ("GAMMAS", "FREQUENCIES", "AMPLITUDES"):
        monkeypatch.setattr(parameter_studies, name, (1.0,))
    found = map_adaptation(joint_loop(adaptation=Adaptation(gamma=(0.0, 0.0))))
    np.testing.assert_array_equal(found.by_gamma.ravel(), [0.3, 0.5])


def test_the_plans_own_law_has_the_plans_own_rates(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the law of the plan, its row of Table 2 ends where the map at the same rate does."""
    for name in ("GAMMAS", "FREQUENCIES", "AMPLITUDES"):
        monkeypatch.setattr(parameter_studies, name, (20.0,) if name == "GAMMAS" else (1.0,))
    for law in ("partial", "partial-theta", "total"):
        one = one_way(joint_loop(adaptation=Adaptation(law=law, gamma=(100.0, 100.0))))
        ends = [x.final for x in adapted(one).factors if x.law == law]
        np.testing.assert_allclose(map_adaptation(one).by_gamma.ravel(), ends, rtol=1e-9)


def test_a_parameter_of_zero_divides_nothing() -> None:
    """A joint without viscous friction is adapted by every law, whatever the law of the plan, with finite gains."""
    pair = Pair(*(p._replace(alpha_2=0.0, sigma_1=0.0) for p in GRIPPER))
    for law in ("partial", "partial-theta", "total"):
        one = one_way(joint_loop(plant=pair, model=pair, adaptation=Adaptation(law=law)))
        rows = {x.law: x for x in adapted(one).factors if x.parameter == "alpha_2"}
        assert {"partial", "partial-theta", "total"} <= set(rows)
        assert all(np.isfinite(x.final) for x in rows.values())
