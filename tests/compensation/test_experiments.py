from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bristle.api.experiments import report_of
from bristle.arrays import Array
from bristle.control.adaptation import LAWS, Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.identification.measured import measure
from bristle.model.parameters import Lugre, Pair
from bristle.model.rollout import rollout
from bristle.questions.compensation import ablation, experiments
from bristle.questions.compensation import ablation as trying
from bristle.questions.compensation.ablation import SHARES, WAYS, AblationRow, ablate
from bristle.questions.compensation.experiments import (
    Errors,
    adapted,
    band,
    drifts,
    errors,
    followed,
    map_adaptation,
)
from bristle.questions.compensation.replay import Replay, replays
from bristle.questions.compensation.report import sections
from bristle.questions.compensation.study import Study, outcomes_of, study
from bristle.simulation.joint_loop import JointLoop, one_way

from ..conftest import present
from ..simulation.joints import GRIPPER, J, experiment, joint, joint_loop, share_of

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


def test_errors_are_those_of_fig_8(rows: dict[tuple[str, float, bool], Errors]) -> None:
    """At 1 rad, 0.2 Hz both figures of a joint are those of docs/paper.md, the error without compensation within 1 %, the ratio within 10 %."""
    for name in list(FIG_8):
        row, (without, left) = rows[name, 0.2, False], FIG_8[name]
        assert 1e3 * row.without == pytest.approx(without, rel=0.01)
        assert row.true / row.without == pytest.approx(left, rel=0.1)
    # friction compensation alone leaves over 30 % of the error of elbow and base; inertia feed-forward under 2 %
    for name in ("elbow pitch", "base rotation"):
        plain, fed = rows[name, 0.5, False], rows[name, 0.5, True]
        assert plain.true > 0.3 * plain.without
        assert fed.true < 0.02 * fed.without


def test_studies_show_what_the_paper_shows(rows: dict[tuple[str, float, bool], Errors]) -> None:
    """A right model errs as the true one does; one with a wrong alpha_0 errs more, and adapted less again."""
    wrong = rows["gripper rotation", 0.2, True]
    assert wrong.true < wrong.adaptive < 0.5 * wrong.identified
    for name in (*FIG_8,)[1:]:
        assert rows[name, 0.2, False].identified == rows[name, 0.2, False].true
    # figs 5 to 7 hold two periods of the slow sine; with the model the error is less than a tenth of that without
    one = joint_loop()
    runs = followed(one)
    assert [*runs] == ["without", "with"]
    for run in runs.values():
        np.testing.assert_array_equal(run.reference, one.sine(one.slow, 2 / one.slow).position)
    assert runs["with"].rms_error(5.0)[0] < 0.1 * runs["without"].rms_error(5.0)[0]
    assert not runs["without"].compensation.any()


def test_adaptation_is_table_2_and_its_maps_hold_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gripper one way, from 0.3 alpha_0 and 0.5 alpha_2: `partial` ends within 0.02 of 0.84 and 1.05, `printed` leaves alpha_0 at 0.30."""
    found = adapted(one_way(joint_loop()))
    by = {(f.law, f.parameter): f for f in found.factors}
    assert [(*key, f.initial) for key, f in by.items()] == [
        (law, name, start) for law in LAWS for name, start in (("alpha_0", 0.3), ("alpha_2", 0.5))
    ]
    assert [*found.runs] == ["not adapted", *LAWS]
    assert by["partial", "alpha_0"].final == pytest.approx(0.84, abs=0.02)
    assert by["partial", "alpha_2"].final == pytest.approx(1.05, abs=0.02)
    assert by["partial", "alpha_0"].early > 0.80
    assert by["partial", "alpha_2"].early == pytest.approx(1.05, abs=0.05)
    assert by["printed", "alpha_0"].final == pytest.approx(0.30, abs=0.01)
    for name in ("alpha_0", "alpha_2"):  # with rates over the start it is the same law in other units
        assert by["partial-theta", name].final == pytest.approx(by["partial", name].final, rel=1e-9)
    late = {name: run.rms_error(16.0)[0] for name, run in found.runs.items()}
    assert late["partial"] < 0.2 * late["not adapted"]
    # a plan that adapts v_s is tried by the three laws that can
    plan = Adaptation(parameters=("alpha_0", "v_s"), gamma=(20.0, 1.0))
    assert [*adapted(one_way(joint_loop(adaptation=plan))).runs] == ["not adapted", "partial", "partial-theta", "total"]
    # at the plan's own rate, amplitude and frequency both maps hold what the adaptation ends at; shapes are those of their axes
    monkeypatch.setattr(experiments, "GAMMAS", (20.0, 50.0, 5.0))
    monkeypatch.setattr(experiments, "FREQUENCIES", (2.0, 1.0))
    monkeypatch.setattr(experiments, "AMPLITUDES", (1.0, 0.5, 2.0))
    one = one_way(joint_loop(adaptation=Adaptation(gamma=(20.0, 10.0)), frequency=0.6, amplitude=0.8))
    found = map_adaptation(one)
    ends = [f.final for f in adapted(one).factors if f.law == "partial"]
    assert found.by_gamma.shape == found.by_amplitude.shape == (2, 3, 2)
    np.testing.assert_allclose(found.by_gamma[:, 0, 1], ends, rtol=1e-12)
    np.testing.assert_allclose(found.by_amplitude[:, 0, 1], ends, rtol=1e-12)
    np.testing.assert_allclose(found.by_amplitude[:, 0, 0], found.by_gamma[:, 0, 0], rtol=1e-12)
    axes = np.concatenate([found.gammas, found.frequencies, found.amplitudes])
    np.testing.assert_allclose(axes, [20.0, 50.0, 5.0, 1.2, 0.6, 0.8, 0.4, 1.6])


def test_drifts_are_told_of_every_way_with_the_known_model_first() -> None:
    """Per frequency: known, fixed, the law at a quarter and all of its rate, without limits, normalised; the first is the measure of all."""
    found = drifts(joint_loop())
    ways = ["known", "fixed", "partial", "partial", "partial, without limits", "partial, normalised"]
    assert [(r.joint, r.frequency, r.way) for r in found] == [
        ("gripper rotation", f, w) for f in (0.2, 0.5) for w in ways
    ]
    for first in (0, 6):
        known, fixed, slow, quick, *_ = found[first : first + 6]
        assert np.isnan([known.gamma, fixed.gamma, known.largest_gain, fixed.largest_gain]).all()
        assert (slow.gamma, quick.gamma) == (5.0, 20.0)
        over = [row.over_known for row in found[first : first + 6]]
        assert over == pytest.approx([row.rms_error / known.rms_error for row in found[first : first + 6]])
        assert fixed.over_known == max(over)
    assert found[9].over_known < 1.5
    assert found[7].over_known > 2
    assert found[9].largest_gain == pytest.approx(1.5, abs=0.1)


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
        present(band(replace(one, draws=tuple(spread(model, rng, share) for _ in range(40))))) for share in (0.05, 0.15)
    )
    low, middle, high = narrow.rms
    assert low < min(middle, narrow.rms_actual) <= max(middle, narrow.rms_actual) < high
    inside = (narrow.lower <= narrow.actual) & (narrow.actual <= narrow.upper)
    assert inside.mean() > 0.8
    assert wide.rms[2] > narrow.rms[2]
    assert (narrow.joints, narrow.time[0]) == (40, pytest.approx(1 / one.slow))
    # what constants alone do to the RMS error is no part of the band's quantiles; a joint whose covariance is unknown has no band
    draws, by_constants = (tuple(spread(GRIPPER, rng, 0.1) for _ in range(20)) for _ in range(2))
    one = joint_loop(period=2e-3, draws=draws)
    assert band(replace(one, draws=())) is None
    without, beside = (present(band(x)) for x in (one, replace(one, draws_by_constants=by_constants)))
    assert without.rms_systematic is None
    assert beside.rms == pytest.approx(without.rms)
    alone = present(band(replace(one, draws=by_constants)))
    assert beside.rms_systematic == pytest.approx((alone.rms[0], alone.rms[2]))


def test_a_parameter_of_zero_divides_nothing() -> None:
    """A joint without viscous friction is adapted by every law, whatever the law of the plan, with finite gains."""
    pair = Pair(*(p._replace(alpha_2=0.0, sigma_1=0.0) for p in GRIPPER))
    for law in ("partial", "partial-theta", "total"):
        one = one_way(joint_loop(plant=pair, model=pair, adaptation=Adaptation(law=law)))
        rows = {x.law: x for x in adapted(one).factors if x.parameter == "alpha_2"}
        assert {"partial", "partial-theta", "total"} <= set(rows)
        assert all(np.isfinite(x.final) for x in rows.values())


@pytest.fixture(scope="module")
def compensated() -> Study:
    with pytest.MonkeyPatch.context() as patch:
        for module, name, few in (
            (experiments, "GAMMAS", (20.0,)), (experiments, "FREQUENCIES", (1.0,)), (experiments, "AMPLITUDES", (1.0,)),
            (ablation, "BITS", (20,)), (ablation, "DELAYS", (0,)), (ablation, "SHARES", (1.0,)),
        ):  # fmt: skip  # a table
            patch.setattr(module, name, few)
        return study([joint_loop()])


def test_a_study_shows_itself(compensated: Study, tmp_path: Path) -> None:
    """A row for each error, with the same numbers."""
    frame = compensated.to_frame()
    assert len(frame) == len(compensated.errors)
    assert frame["identified_model"].tolist() == [row.identified for row in compensated.errors]
    assert (frame["true_share"] * frame["without"]).tolist() == pytest.approx([row.true for row in compensated.errors])
    # one line each, without inertia feed-forward, with what is left of the error and where each factor ends
    found, lines = list(outcomes_of(compensated)), report_of(compensated).text().splitlines()
    plain = [row for row in compensated.errors if not row.inertia]
    rows = [row._asdict() for row in plain] + [factor._asdict() for factor in compensated.adapted.factors]
    assert [x.numbers for x in found] == rows
    assert lines == list(map(str, found))
    row, factor = plain[0], compensated.adapted.factors[0]
    left = f"{1e3 * row.identified:.3g} mrad ({100 * row.identified / row.without:.2g} %) with"
    assert f"RMS error {1e3 * row.without:.3g} mrad without, {left} and " in lines[0]
    assert f"{factor.parameter} from 0.3 to {factor.final:.3f} of its identified value." in lines[len(plain)]
    # each caption begins with SIMULATED; each figure has a name of its own
    drawn = [x for own in sections(compensated) for x in own.drawings]
    assert all(x.simulated for x in drawn)
    assert len({x.name for x in drawn}) == len(drawn)
    # with the same numbers, to six digits
    report_of(compensated).write(tmp_path / "a")
    written = pd.read_csv(tmp_path / "a" / "tables" / "compensation_errors.csv", comment="#")
    pd.testing.assert_frame_equal(written, compensated.to_frame(), check_dtype=False, rtol=1e-6)

    # where the steady curve leaves an error within a tenth of LuGre's, the page says so with both
    tried, told = {row.compensator: row for row in compensated.ablation}, []
    for share in (1.05, 1.2):
        stribeck = tried["Stribeck, reference velocity"]._replace(rms_error=share * tried[LUGRE].rms_error)
        shown = sections(replace(compensated, ablation=tuple((tried | {stribeck.compensator: stribeck}).values())))
        told += [x.numbers["stribeck"] for own in shown for x in own.findings if x.code == "stribeck-as-good"]
    assert told == [pytest.approx(1.05e3 * tried[LUGRE].rms_error)]


LUGRE = "LuGre, reference velocity"


@pytest.fixture(scope="module")
def tried() -> tuple[AblationRow, ...]:
    """The gripper with its true model, behind 20 bits, without delay and with one of five periods."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trying, "BITS", (20,))
        patch.setattr(trying, "DELAYS", (0, 5))
        return ablate(joint_loop())


def of(tried: tuple[AblationRow, ...], compensator: str, delay: int = 0) -> dict[float, AblationRow]:
    return {r.share: r for r in tried if r.compensator == compensator and r.delay == delay}


def test_every_way_under_each_circumstance(tried: tuple[AblationRow, ...]) -> None:
    """One row for every compensator, encoder, delay and share, and one without compensation, which has no share."""
    expected = [(way, 20, d, s) for way in WAYS for d in (0, 5) for s in (SHARES if way != "none" else (0.0,))]
    assert [(r.compensator, r.encoder_bits, r.delay, r.share) for r in tried] == expected
    assert all(np.isfinite([r.rms_error, r.over_none]).all() for r in tried)
    # `none` without delay is what all others are relative to
    bare = of(tried, "none")[0.0].rms_error
    assert [row.over_none for row in tried] == pytest.approx([row.rms_error / bare for row in tried])
    # LuGre by reference velocity: with all of the true friction the error is less than half of that with any other share
    found = of(tried, LUGRE)
    assert all(found[1.0].rms_error < 0.5 * row.rms_error for share, row in found.items() if share != 1.0)
    assert found[1.0].over_none < 0.1
    # Coulomb friction by the measured velocity makes the held joint swing on at every share; nothing by the reference velocity does
    for way in WAYS:
        found = of(tried, way)
        if way.endswith("reference velocity") or way == "none":
            assert not any(r.limit_cycle for r in found.values())
    assert all(r.limit_cycle for r in of(tried, "Coulomb, measured velocity").values())
    # half of the model's parameters, v_s aside, compensate as the whole model does by half of its torque
    one = joint_loop()
    course, moving = trying._back_and_forth(one)
    case = replace(one.case(), resolution=trying._count(one, 20))
    run = simulate(LoopOptions(compensator=Compensator(share=0.5), encoder=True), [case], course, one.period)
    assert of(tried, LUGRE)[0.5].rms_error == pytest.approx(np.sqrt(np.mean(run.error[0, moving] ** 2)), rel=1e-9)


STEP, SECONDS = 2e-3, 10.0
LINES = ((1.0, 0.3), (0.24, 1.3), (0.16, 3.1), (0.08, 7.0))  # amplitude, rad/s, and frequency, Hz, of the velocity
INERTIA = f"inertia: {J!r} kg*m**2\n"
GAP = (3.0, 5.0)


def motion(inertia: float = J, pair: Pair[float] = GRIPPER) -> tuple[Array, Array, Array]:
    """Time, velocity and torque of a joint of such friction and inertia."""
    t = np.arange(0, SECONDS, STEP)
    v = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(LINES)], axis=0)
    return t, v, rollout(v, STEP, pair, 0.0).torque + inertia * np.gradient(v, t)


def written(folder: Path, friction: float = 1.0, *, gap: bool = False) -> None:
    """The run of a gripper with so many times its Coulomb and viscous friction, as a log."""
    rows = zip(*motion(pair=Pair(*(share_of(p, friction) for p in GRIPPER))), strict=True)
    kept = (row for row in rows if not (gap and GAP[0] <= row[0] < GAP[1]))
    (folder / "run.csv").write_text("t,v,tau\n" + "".join(f"{a:.6g},{b:.12g},{c:.12g}\n" for a, b, c in kept), "utf-8")


def replayed(
    folder: Path, friction: float, one: JointLoop | None = None, more: str = INERTIA, *, gap: bool = False
) -> Replay:
    """That run, replayed with the gripper's model."""
    written(folder, friction, gap=gap)
    (found,) = replays(one or joint_loop(), joint(), measure(experiment(folder, "", more)))
    return found


def test_a_replay_is_of_every_sample(tmp_path: Path) -> None:
    """Time, velocity, torques and gains are of the run's samples; friction is the torque without that of inertia, given or identified."""
    t, v, torque = motion()
    for more in (INERTIA, ""):
        run = replayed(tmp_path, 1.0, None, more)
        assert run.file == "run.csv"
        np.testing.assert_allclose(run.time, t, atol=1e-9)
        assert run.measured.shape == run.fixed.shape == run.adapted.shape == t.shape
        assert run.theta.shape == (2, t.size)
        friction = rollout(v, STEP, GRIPPER, 0.0).torque
        assert np.abs(run.measured - friction)[50:-50].max() < 0.01 * np.abs(torque).max()
    # on a run of the model's own joint the gains stay at 1 to a hundredth, and the verdict is that adaptation changes nothing
    run = replayed(tmp_path, 1.0)
    np.testing.assert_allclose(run.theta, 1.0, atol=0.01)
    before, after = run.relative_errors()
    assert max(before, after) < 1.0
    assert run.verdict.code == "adaptation-idle"
    assert run.verdict.numbers == {"before": before, "after": after, "ratios": run.ratios}
    # where Coulomb and viscous friction are 1.5 times the model's, both shares go most of the way, the error halves, and the verdict says
    # so. Errors are 100 norm(measured - predicted) / norm(measured) from the middle of the run on, with gains of 1 and adapted
    run = replayed(tmp_path, 1.5)
    assert (np.abs(run.theta[:, -1] - 1.5) < 0.2).all()
    assert (np.diff(run.theta[:, ::1000], axis=1) > 0).all()
    before, after = run.relative_errors()
    late = slice(run.time.size // 2, None)
    for found, predicted in ((before, run.fixed), (after, run.adapted)):
        left = np.linalg.norm((run.measured - predicted)[late]) / np.linalg.norm(run.measured[late])
        assert found == pytest.approx(100 * float(left))
    assert before == pytest.approx(100 / 3, abs=1.0)
    assert after < 0.5 * before
    assert run.verdict.code == "adaptation-helps"
    assert run.shares in str(run.verdict)


def test_gains_rates_and_limits_of_replays(tmp_path: Path) -> None:
    """A run with a gap is replayed stretch by stretch: as without one up to the gap, then from the gains that it had before it."""
    whole, run = replayed(tmp_path, 1.5), replayed(tmp_path, 1.5, gap=True)
    before = np.flatnonzero(run.time < GAP[0])
    assert run.theta.shape == (2, run.time.size)
    assert run.time.size == whole.time.size - round((GAP[1] - GAP[0]) / STEP)
    assert run.time[before.size] - run.time[before[-1]] > GAP[1] - GAP[0]
    np.testing.assert_allclose(run.theta[:, : before.size - 50], whole.theta[:, : before.size - 50], atol=1e-3)
    np.testing.assert_allclose(run.theta[:, before.size], run.theta[:, before[-1]], rtol=0.02)
    assert (run.theta[:, before.size] > 1.05).all()
    assert (run.theta[:, -1] > run.theta[:, before.size]).all()
    assert run.relative_errors()[1] < 0.5 * run.relative_errors()[0]
    # the torque error teaches as an error of position over K_p: twice the gain with twice the rates is the same replay
    one = joint_loop()
    stiff = joint_loop(gains=one.gains._replace(K_p=2 * one.gains.K_p), adaptation=Adaptation(gamma=(40.0, 40.0)))
    first, second = (replayed(tmp_path, 1.5, own) for own in (one, stiff))
    np.testing.assert_allclose(first.theta, second.theta, rtol=1e-9)
    # where a gain ends at its upper limit the verdict is to leave the adaptation off, or to lower its rate
    one = joint_loop(adaptation=Adaptation(limits=(0.5, 1.2)))
    run = replayed(tmp_path, 1.5, one)
    assert run.theta.max() == pytest.approx(1.2)
    assert run.verdict.code == "gain-at-limit"
    # where the rate is so high that every sample overshoots, a model that was right explains less, and the verdict is to leave it off
    run = replayed(tmp_path, 1.0, joint_loop(adaptation=Adaptation(gamma=(0.0, 1e5), limits=(0.01, 100.0))))
    before, after = run.relative_errors()
    assert after > before + 10
    assert run.verdict.code == "adaptation-harms"
    # with rates of zero the torque that adapts is the one with gains of 1, but for where z passes zero within a sample
    run = replayed(tmp_path, 1.0, joint_loop(adaptation=Adaptation(gamma=(0.0, 0.0))))
    np.testing.assert_allclose(run.adapted, run.fixed, atol=1e-4 * np.abs(run.fixed).max())
    # where nothing but the inertia is known beside friction, a right model still explains the run
    written(tmp_path)
    measured = measure(experiment(tmp_path, "", ""))
    first = replays(joint_loop(), replace(joint(), tracking=None), measured)[0]
    assert first.relative_errors()[0] < 0.1
