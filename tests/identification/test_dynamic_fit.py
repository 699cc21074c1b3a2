"""All parameters on moving data: the descent, the residuals' derivatives, intervals, what is not seen, priors, counts."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.estimation.nonlinear import minimise
from bristle.findings import Severity
from bristle.identification.dynamic import unknowns
from bristle.identification.dynamic.claims import bristle_doubts
from bristle.identification.dynamic.crosscheck import check_tracking
from bristle.identification.dynamic.encoder_bias import between_counts, without_count_bias
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import (
    DynamicProblem,
    InitialState,
    Prior,
    dynamic_problem,
    residuals,
    with_priors,
)
from bristle.identification.dynamic.starts import solve_dynamic
from bristle.identification.dynamic.unknowns import fit
from bristle.identification.dynamic.unknowns import least_squares as posed_about
from bristle.identification.dynamic.what_is_left import pattern_left
from bristle.identification.fits import TrackingFit
from bristle.identification.moving_runs import moved_in
from bristle.identification.shared_findings import NOT_IDENTIFIABLE
from bristle.model.parameters import INERTIA, SIGNED, Direction, Lugre, Pair, ParameterName
from bristle.model.rollout import rollout

from ..names import named, parse
from .conftest import GRIPPER

STEP = 1e-3
OTHER = Lugre(0.0148, 0.0040, 0.0307, 0.0720, 4.5356, 0.0146)
J = 1.27e-3
Z0 = InitialState("z0", 0)
"""What the only motion begins with."""


def motion(seconds: float = 8.0) -> tuple[Array, Array]:
    """Time and a velocity that shows all six parameters."""
    t = np.arange(0, seconds, STEP)
    lines = ((0.25, 0.3), (0.06, 1.3), (0.04, 3.1), (0.02, 7.0), (0.01, 12.0))
    v: Array = np.sum([a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines)], axis=0)
    return t, v


def record(
    p: Lugre[float] | Pair[float],
    noise: float = 0.0,
    seed: int = 0,
    velocity: Array | None = None,
    z0: float | None = None,
) -> Record:
    """A run at this velocity: torque of LuGre and of an inertia, with white noise."""
    t, v = motion()
    v = v if velocity is None else velocity
    acceleration = np.gradient(v, t[: v.size])
    torque = (
        rollout(v, STEP, p, z0).torque + J * acceleration + noise * np.random.default_rng(seed).standard_normal(v.size)
    )
    return Record(file="run.csv", time=t[: v.size], velocity=v, torque=torque, acceleration=acceleration)


def values_of(p: Lugre[float] | Pair[float]) -> dict[ParameterName, float]:
    """Parameters by name, with the inertia."""
    sets = {Direction.BOTH: p} if isinstance(p, Lugre) else dict(zip(SIGNED, p, strict=True))
    every = {ParameterName(name, d): value for d, own in sets.items() for name, value in own._asdict().items()}
    return every | {INERTIA: J}


def posed(run: Record, directions: tuple[str, ...] = ("both",), decimation: int = 1) -> DynamicProblem:
    """The problem of one run with its inertia."""
    return dynamic_problem([run], directions, ("inertia",), decimation, None)


def shifted(values: Mapping[ParameterName, float], factor: float = 1.25) -> dict[ParameterName, float]:
    """A start that is off by a factor, up and down in turn."""
    return {name: value * factor ** (1 if k % 2 else -1) for k, (name, value) in enumerate(values.items())}


@pytest.mark.parametrize("p", [GRIPPER, Pair(GRIPPER, OTHER)], ids=["one set", "pair"])
@pytest.mark.parametrize("decimation", [1, 10])
def test_the_jacobian_is_that_of_differences(p: Lugre[float] | Pair[float], decimation: int) -> None:
    """Each column of the residuals' Jacobian is their central difference, filtered or not, z0 and inertia included."""
    problem = posed(record(p), ("both",) if isinstance(p, Lugre) else ("+", "-"), decimation)
    at = shifted(values_of(p), 1.1) | {Z0: 1e-4}
    _, jacobian = residuals(problem, at)
    for k, name in enumerate(problem.names):
        h = 1e-5 * (abs(at[name]) or 1e-4)
        up, down = (residuals(problem, {**at, name: at[name] + s * h})[0] for s in (1, -1))
        difference = (up - down) / (2 * h)
        size = np.abs(jacobian[:, k]).max()
        assert np.abs(jacobian[:, k] - difference).max() < 2e-4 * size + 1e-12


@pytest.mark.parametrize("p", [GRIPPER, Pair(GRIPPER, OTHER)], ids=["one set", "pair"])
def test_without_noise_the_truth_comes_back(p: Lugre[float] | Pair[float]) -> None:
    """From a start that is off by a quarter, noise-free data give every parameter back."""
    problem = posed(record(p), ("both",) if isinstance(p, Lugre) else ("+", "-"))
    values, minimum = fit(problem, shifted(values_of(p)) | {Z0: 0.0})
    assert minimum.cost < 1e-16
    for name, true in values_of(p).items():
        assert values[name] == pytest.approx(true, rel=1e-4)


def test_two_routes_agree() -> None:
    """SciPy's least_squares, given the same residuals and no Jacobian of ours, ends where the descent ends, to 1e-3 standard errors."""
    problem = posed(record(GRIPPER, noise=3e-4), decimation=5)
    start = shifted(values_of(GRIPPER), 1.1) | {Z0: 0.0}
    values, minimum = fit(problem, start)
    about = posed_about(problem, start)

    def rows(x: Array) -> Array:
        return about.evaluate(x)[0]

    first = about.unknowns.scaled(start)
    other = least_squares(rows, first, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert 2 * other.cost == pytest.approx(minimum.cost, rel=1e-8)
    errors = np.sqrt(
        np.diag(np.linalg.inv(minimum.jacobian.T @ minimum.jacobian)) * minimum.cost / minimum.residuals.size
    )
    assert (np.abs(other.x - about.unknowns.scaled(values)) < 1e-2 * errors)[:-1].all()


@pytest.mark.parametrize("p", [GRIPPER, Pair(GRIPPER, OTHER)], ids=["one set", "pair"])
def test_many_samples_have_the_minimum_that_few_of_them_lead_to(
    p: Lugre[float] | Pair[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit that begins on every eighth sample ends where one that does not ends, to 1e-2 standard errors; where those show nothing, too."""
    problem = posed(record(p, noise=3e-4), ("both",) if isinstance(p, Lugre) else ("+", "-"))
    start = shifted(values_of(p), 1.5) | {Z0: 0.0}
    plain, minimum = fit(problem, start)
    monkeypatch.setattr(unknowns, "_LARGE", 1)
    thinned, other = fit(problem, start)
    assert other.steps < minimum.steps
    assert other.cost == pytest.approx(minimum.cost, rel=1e-9)
    spread = np.sqrt(
        np.diag(np.linalg.inv(minimum.jacobian.T @ minimum.jacobian)) * minimum.cost / other.residuals.size
    )
    assert (np.abs(other.x - minimum.x) < 1e-2 * spread).all()
    assert thinned.keys() == plain.keys()


def test_samples_that_show_nothing_do_not_end_a_fit_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where every eighth sample is at rest, the fit ends where it would have, had it not looked at those alone."""
    t, v = motion()
    problem = posed(record(GRIPPER, noise=3e-4, velocity=np.where(np.arange(t.size) % 8 == 0, 0.0, v)))
    start = shifted(values_of(GRIPPER), 1.1) | {Z0: 0.0, INERTIA: 0.0}
    plain, _ = fit(problem, start)
    monkeypatch.setattr(unknowns, "_LARGE", 1)
    assert fit(problem, start)[0] == pytest.approx(plain, rel=1e-6)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Over forty repetitions with white noise, at least 87 % of the intervals of all seven parameters hold the truth."""
    truth, hits = values_of(GRIPPER), []
    for seed in range(40):
        found = fit_tracking(posed(record(GRIPPER, 3e-4, seed), decimation=5), truth, "revolute", search=False).fit
        hits += [_holds(found, name, true) for name, true in truth.items()]
    assert 0.87 < np.mean(hits) <= 1.0


def _holds(found: TrackingFit, name: ParameterName, true: float) -> bool:
    interval = found.parameters[name].interval
    return interval is not None and interval[0] <= true <= interval[1]


def test_correlated_noise_widens_the_intervals() -> None:
    """Residuals that are correlated over fifty samples give wider errors than white ones of the same size, and a warning."""
    run, rng = record(GRIPPER), np.random.default_rng(1)
    white = 3e-4 * rng.standard_normal(run.time.size)
    slow = np.convolve(white, np.ones(50) / np.sqrt(50), mode="same")
    assert run.torque is not None
    fits = [
        fit_tracking(posed(replace(run, torque=run.torque + noise)), values_of(GRIPPER), "revolute", search=False).fit
        for noise in (white, slow)
    ]
    errors = [found.parameters[parse("alpha_0")].standard_error for found in fits]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[1] > 3 * errors[0]
    assert any(warning.code == "correlated" for warning in fits[1].warnings)


def test_slow_motion_does_not_tell_alpha_0_from_alpha_1() -> None:
    """With all speeds far below v_s only alpha_0 + alpha_1 is seen: alpha_1 and v_s have no value.

    alpha_0 is that sum, and a warning says so.
    """
    v = 0.03 * GRIPPER.v_s * motion()[1]
    found = fit_tracking(posed(record(GRIPPER, 1e-5, velocity=v)), values_of(GRIPPER), "revolute", search=False).fit
    for name in map(parse, ("alpha_1", "v_s")):
        assert found.parameters[name].value is None
        assert found.parameters[name].interval == (0.0, np.inf)
        assert found.parameters[name].warnings[0].code in NOT_IDENTIFIABLE
    assert any(warning.code == "only-sum-seen" for warning in found.parameters[parse("alpha_0")].warnings)
    assert any(warning.code == "only-sum-seen-of-fit" for warning in found.warnings)
    assert found.parameters[parse("alpha_0")].value == pytest.approx(GRIPPER.alpha_0 + GRIPPER.alpha_1, rel=0.01)


def test_the_unseen_direction_is_named() -> None:
    """Two columns that are the same but for noise: the warning names both parameters, and that they are seen as a sum only."""
    run = record(GRIPPER)
    problem = posed(run)
    doubled = replace(
        problem,
        extra_names=(INERTIA, parse("offset")),
        motions=tuple(
            replace(m, extra=np.column_stack([m.extra[:, 0], m.extra[:, 0] * (1 + 1e-7 * m.time)]))
            for m in problem.motions
        ),
    )
    start = {**values_of(GRIPPER), INERTIA: 0.6 * J, parse("offset"): 0.4 * J}
    found = fit_tracking(doubled, start, "revolute", search=False).fit
    (told,) = (warning for warning in found.warnings if warning.code == "only-as-sum")
    assert list(map(str, told.numbers["all"])) == ["inertia", "offset"]


def test_a_stiff_bristle_converges() -> None:
    """sigma_0 = 1e5 at up to 2 mrad/s: the fit converges, to the truth within its interval."""
    stiff = GRIPPER._replace(sigma_0=1e5, sigma_1=2.0, v_s=1e-3)
    v = 2e-3 / np.abs(motion()[1]).max() * motion()[1]
    truth = values_of(stiff)
    found = fit_tracking(posed(record(stiff, 1e-5, velocity=v)), shifted(truth, 1.1), "revolute").fit
    assert found.outcome.code in {"converged", "converged-at-bound"}
    assert sum(_holds(found, name, true) for name, true in truth.items()) >= 6


def test_each_segment_has_its_own_deflection_and_no_gap_is_crossed() -> None:
    """Two segments, each begun with a deflection of its own, give the truth; the deflections come back too."""
    first, second = record(GRIPPER, z0=2e-3), record(GRIPPER, z0=-1e-3)
    gap = first.time[-1] + 5.0
    velocity, torque, acceleration = (
        np.concatenate([np.asarray(getattr(x, n)) for x in (first, second)])
        for n in ("velocity", "torque", "acceleration")
    )
    time, starts = np.concatenate([first.time, second.time + gap]), (0, first.time.size)
    joined = Record(
        file="two.csv", time=time, starts=starts, velocity=velocity, torque=torque, acceleration=acceleration
    )
    problem = posed(joined)
    assert problem.names[-2:] == (Z0, InitialState("z0", 1))
    assert [str(name) for name in problem.names[-2:]] == ["z0[0]", "z0[1]"]
    values, minimum = fit(problem, shifted(values_of(GRIPPER), 1.1) | {Z0: 0.0, InitialState("z0", 1): 0.0})
    assert minimum.cost < 1e-16
    assert values[Z0] == pytest.approx(2e-3, rel=1e-4)
    assert values[InitialState("z0", 1)] == pytest.approx(-1e-3, rel=1e-4)


def test_a_prior_pulls_as_far_as_it_is_sure() -> None:
    """A prior as sure as the data moves an estimate about half of the way; a sure one all the way; and the error shrinks."""
    problem = posed(record(GRIPPER, 3e-4), decimation=5)
    alone = fit_tracking(problem, values_of(GRIPPER), "revolute", search=False).fit
    v_s = parse("v_s")
    e = alone.parameters[v_s]
    assert e.value is not None
    assert e.standard_error is not None
    moved = []
    for share in (1.0, 1e-3):
        error = share * e.standard_error
        prior = Prior("static", (v_s,), np.array([e.value + 2 * e.standard_error]), np.array([[1 / error]]))
        found = fit_tracking(with_priors(problem, [prior], alone.rms), values_of(GRIPPER), "revolute", search=False).fit
        value, own = found.parameters[v_s].value, found.parameters[v_s].standard_error
        assert value is not None
        assert own is not None
        assert own < e.standard_error
        moved.append((value - e.value) / (2 * e.standard_error))
    assert 0.25 < moved[0] < 0.75
    assert moved[1] == pytest.approx(1.0, abs=0.02)


def test_coarse_counts_bias_and_the_bootstrap_takes_it_off() -> None:
    """With an encoder so coarse that counts bias the fit, the corrected estimates are nearer to the truth, and a warning says what was done."""
    t, v = motion()
    position = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)])
    quantum = 2 * np.pi / 2**15
    counted = Record(
        file="run.csv", time=t, position=quantum * np.floor(position / quantum), torque=record(GRIPPER).torque
    )

    def pose(records: Sequence[Record], fixed: Mapping[ParameterName, float]) -> DynamicProblem:
        return dynamic_problem(records, ("both",), ("inertia",), 5, None, fixed)

    run = estimate_motion(counted, 40.0)
    truth = values_of(GRIPPER)
    found = fit_tracking(pose([run], {}), truth, "revolute", search=False)
    better = without_count_bias(found, [run], pose, quantum)
    off = [
        np.array([(f.parameters[n].value or 0.0) / truth[n] - 1 for n in map(parse, ("alpha_0", "alpha_2", "sigma_0"))])
        for f in (found.fit, better)
    ]
    assert np.linalg.norm(off[1]) < 0.6 * np.linalg.norm(off[0])
    assert any(warning.code == "count-bias" for warning in better.warnings)


def test_counts_too_fine_to_matter_take_nothing_off() -> None:
    """With a count of a micro-radian, however the filters end, no estimate moves by a tenth of its standard error."""
    t, v = motion()
    position, quantum = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)]), 1e-6
    counted = Record(
        file="run.csv",
        time=t,
        position=quantum * np.round(position / quantum),
        torque=record(GRIPPER, noise=2e-4).torque,
    )

    def pose(records: Sequence[Record], fixed: Mapping[ParameterName, float]) -> DynamicProblem:
        return dynamic_problem(records, ("both",), ("inertia",), 5, None, fixed)

    run = estimate_motion(counted, 40.0)
    found = fit_tracking(pose([run], {}), values_of(GRIPPER), "revolute", search=False)
    better = without_count_bias(found, [run], pose, quantum)
    for name, bias in better.count_bias.items():
        error = found.fit.parameters[name].standard_error
        assert error is not None
        assert abs(bias) < 0.1 * error, name


def test_the_motion_between_the_counts_is_nearer_to_the_truth() -> None:
    """Its position is off by no more than the readings, its velocity by a third at most; beside a noise above the count nothing changes."""
    t, v = motion()
    position, quantum = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)]), 2 * np.pi / 2**12
    run = Record(file="run.csv", time=t, position=quantum * (np.floor(position / quantum) + 0.5))
    read = estimate_motion(run, 100.0)
    smooth = between_counts(read, quantum)
    assert smooth.velocity is not None
    assert smooth.position is not None
    assert read.velocity is not None
    assert np.std(smooth.position - position) < quantum / np.sqrt(12)
    assert np.std(smooth.velocity - v) < np.std(read.velocity - v) / 3
    assert between_counts(read, quantum / 10).velocity == pytest.approx(read.velocity)


@pytest.mark.parametrize("bits", [9, 17])
def test_a_bend_of_a_few_counts_is_withdrawn_and_one_of_many_is_right(bits: int) -> None:
    """With a count of three bends sigma_0 has neither value nor interval; with an eightieth of one its interval holds the truth."""
    t, v = motion()
    position, quantum = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)]), 2 * np.pi / 2**bits
    torque = record(GRIPPER, noise=2e-4).torque
    counted = Record(file="run.csv", time=t, position=quantum * np.floor(position / quantum), torque=torque)

    def pose(records: Sequence[Record], fixed: Mapping[ParameterName, float]) -> DynamicProblem:
        return replace(dynamic_problem(records, ("both",), ("inertia",), 5, None, fixed), count=quantum)

    run = estimate_motion(counted, 40.0)
    solved = fit_tracking(pose([run], {}), values_of(GRIPPER), "revolute", search=False)
    sigma_0 = without_count_bias(solved, [run], pose, quantum).parameters[parse("sigma_0")]
    assert (sigma_0.value is None) == (sigma_0.interval is None) == (bits == 9)
    assert sigma_0.interval is None or sigma_0.interval[0] <= GRIPPER.sigma_0 <= sigma_0.interval[1]


@pytest.mark.parametrize("samples", [1.0, 0.5, -1.0])
def test_a_torque_logged_late_is_named_with_its_delay(samples: float) -> None:
    """A torque shifted by half a sample or more is named, with a delay within a fifth of the true one; one in time is not."""
    t, _ = motion()
    run = record(GRIPPER, noise=2e-4)
    assert run.torque is not None
    late = replace(run, torque=np.interp(t - samples * STEP, t, run.torque))
    fixed = named({"alpha_1": GRIPPER.alpha_1, "v_s": GRIPPER.v_s})
    start = {name: value for name, value in values_of(GRIPPER).items() if name not in fixed}
    said = [
        [
            str(d)
            for d in fit_tracking(
                replace(posed(r, decimation=2), fixed=fixed), start, "revolute", search=False
            ).fit.warnings
            if d.code == "torque-delayed"
        ]
        for r in (run, late)
    ]
    assert said[0] == []
    (sentence,) = said[1]
    assert float(re.findall(r"add (\S+) s to the delay", sentence)[0]) == pytest.approx(samples * STEP, rel=0.2)
    assert ("earlier" if samples > 0 else "later") in sentence


@pytest.mark.parametrize(
    ("bits", "delay", "named"), [(12, 0.0, False), (14, 0.0, False), (24, 0.0, False), (24, 3e-3, True)]
)
def test_counts_and_presliding_are_no_delay(bits: int, delay: float, named: bool) -> None:
    """Behind encoders that hide presliding, and behind fine ones, no delay is named where there is none; a true one behind a fine one is."""
    t, v = motion()
    count, run = 2 * np.pi / 2**bits, record(GRIPPER, noise=2e-4)
    assert run.torque is not None
    position = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)])
    late = np.interp(t - delay, t, run.torque)
    counted = Record(file="run.csv", time=t, position=count * np.floor(position / count), torque=late)
    problem = dynamic_problem([estimate_motion(counted, 40.0)], ("both",), ("inertia",), 5, None)
    found = fit_tracking(replace(problem, count=count, cutoff=40.0), values_of(GRIPPER), "revolute", search=False).fit
    said = [d.numbers["delay"] for d in found.warnings if d.code == "torque-delayed"]
    assert bool(said) is named
    assert said == pytest.approx([delay] * named, rel=0.2)


def test_a_motion_without_sliding_cannot_tell_a_delay_from_presliding() -> None:
    """Where a joint hardly slides between reversals, a late torque is a caution that names both causes, and no line to change."""
    soft = GRIPPER._replace(sigma_0=GRIPPER.sigma_0 / 10)
    t, _ = motion()
    run = record(soft, noise=2e-5, velocity=0.3 * motion()[1])
    assert run.torque is not None
    late = replace(run, torque=np.interp(t - 5e-3, t, run.torque))
    found = fit_tracking(posed(late, decimation=5), values_of(soft), "revolute", search=False).fit
    (said,) = [d for d in found.warnings if d.code in {"torque-delayed", "delay-or-presliding"}]
    assert said.code == "delay-or-presliding"
    assert said.severity is Severity.CAUTION
    assert "presliding" in str(said)
    assert "to the delay of" not in str(said)


def test_what_is_left_in_a_few_moments_is_named() -> None:
    """Even noise says nothing, in 200 records; drift is called a pattern, more about reversals is named by how much, large misses by where."""
    _, v = motion()
    problem = posed(record(GRIPPER, noise=0.0))
    rng = np.random.default_rng(0)
    white = rng.standard_normal((200, v.size))
    assert not any(pattern_left(problem, rows) for rows in white)
    assert not any(pattern_left(problem, rows) for rows in lfilter([1.0], [1.0, -0.8], white))
    for rows in lfilter([1.0], [1.0, -0.97], white):
        (said,) = pattern_left(problem, rows)
        assert said.code == "lacks-unknown-term"
        assert said.numbers["lag_one"] == pytest.approx(0.97, abs=0.02)
    slow = np.abs(v) < 0.1 * np.sqrt(np.mean(v**2))
    for times in (4.0, 10.0):
        (said,) = pattern_left(problem, np.where(slow, times, 1.0) * white[0])
        assert said.code == "reversals-left"
        assert 0.6 * times < said.numbers["ratio"] < 1.1 * times
    fast = int(np.argmax(np.abs(v)))
    (said,) = pattern_left(problem, white[0] + 100.0 * (np.abs(np.arange(v.size) - fast) < 5))
    assert said.code == "bursts"
    (where,) = said.numbers["where"]
    assert float(where.split()[-2]) == pytest.approx(problem.time[fast], abs=0.01)
    assert pattern_left(problem, np.zeros(v.size)) == []


def test_hardly_more_equations_than_unknowns_estimate_nothing() -> None:
    """A motion that leaves fewer equations than twice the unknowns has no values, however well it fits, and says how many are needed."""
    run = record(GRIPPER, noise=2e-4)
    for part, few in ((slice(0, None, 40), True), (slice(None), False)):
        assert run.torque is not None
        assert run.velocity is not None
        assert run.acceleration is not None
        less = replace(
            run,
            time=run.time[part],
            velocity=run.velocity[part],
            acceleration=run.acceleration[part],
            torque=run.torque[part],
        )
        problem = posed(less, decimation=5)
        for asked in (problem, replace(problem, stribeck="stribeck")):
            found = fit_tracking(asked, values_of(GRIPPER), "revolute", search=False).fit
            assert all((e.value is None) is few for e in found.parameters.values())
            said = {w.code for e in found.parameters.values() for w in e.warnings}
            assert ("unseen-too-few" in said) is few


@pytest.mark.parametrize("added", [0.0, -3.0])
def test_an_inertia_below_zero_is_critical(added: float) -> None:
    """A torque that falls with the acceleration makes a fit of which nothing is believed; the joint's own does not."""
    run = record(GRIPPER, noise=2e-4)
    assert run.torque is not None
    assert run.velocity is not None
    fallen = replace(run, torque=run.torque + added * J * np.gradient(run.velocity, run.time))
    warnings = fit_tracking(posed(fallen, decimation=5), values_of(GRIPPER), "revolute", search=False).fit.warnings
    said = [d for d in warnings if d.code == "inertia-below-zero"]
    assert [d.severity for d in said] == [Severity.CRITICAL] * (added < 0)


def test_a_wrong_inertia_that_was_given_is_named() -> None:
    """With the inertia fixed 5 % too high, a warning names it and what is to be added, and nothing else is blamed; with the right one none does."""
    run, start = record(GRIPPER, noise=2e-4), {n: x for n, x in values_of(GRIPPER).items() if n != INERTIA}
    said = []
    for factor in (1.0, 1.05):
        problem = dynamic_problem([run], ("both",), (), 2, factor * J)
        warnings = fit_tracking(problem, start, "revolute", search=False).fit.warnings
        said.append([d for d in warnings if d.code in {"inertia-doubted", "torque-delayed"}])
    assert said[0] == []
    (warning,) = said[1]
    assert float(str(warning).split("with ")[1].split()[0]) == pytest.approx(-0.05 * J, rel=0.2)


def test_rest_shows_nothing_and_is_refused() -> None:
    """A run at rest shows no parameter; it is refused in one sentence."""
    still = Record(
        file="rest.csv", time=motion()[0], velocity=np.zeros(8000), torque=np.zeros(8000), acceleration=np.zeros(8000)
    )
    with pytest.raises(ValueError, match=r"rest\.csv: at rest throughout"):
        posed(still)


def test_a_fit_that_leaves_more_than_was_measured_gives_no_number(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is worse than no model at all tells nothing: no parameter has a value, however small its error; a good fit has."""
    problem = posed(record(GRIPPER, noise=2e-4), decimation=5)
    values = values_of(GRIPPER)
    assert fit_tracking(problem, values, "revolute", search=False).fit.parameters[parse("alpha_0")].value is not None
    monkeypatch.setattr(DynamicProblem, "extent", property(lambda _: 1e-9))
    found = fit_tracking(problem, values, "revolute", search=False).fit
    assert {e.value for e in found.parameters.values()} == {None}


def test_a_peak_of_one_direction_is_found_though_one_set_for_both_has_none() -> None:
    """Where one set for both directions ends without a peak, or in one too narrow to matter, each direction still gets its own."""
    uneven = Pair(
        GRIPPER._replace(alpha_1=0.1 * GRIPPER.alpha_0), OTHER._replace(alpha_1=0.8 * OTHER.alpha_0, v_s=0.03)
    )
    problem, truth = posed(record(uneven, 1e-5), ("+", "-"), 10), values_of(uneven)
    start = {name: x * (1e-2 if name.name == "v_s" else 1.0) for name, x in truth.items()}
    whole = solve_dynamic(problem, start)
    for name, true in truth.items():
        assert whole.values[name] == pytest.approx(true, rel=0.02)


def test_noise_about_rest_is_no_direction() -> None:
    """A direction in which less than a hundredth of the way is gone is none; two hundredths are one."""
    there = np.abs(motion()[1][:-100])
    for back, sides in ((0.005, ("+",)), (0.02, ("+", "-"))):
        velocity = np.append(there, np.full(100, -back * there.sum() / 100))
        assert moved_in([record(GRIPPER, velocity=velocity)]) == sides


def test_the_descent_respects_its_bounds() -> None:
    """Where the free minimum lies beyond a bound, the descent ends on the bound, at the least cost there; and it takes few steps when linear."""
    rng = np.random.default_rng(0)
    A, b = rng.standard_normal((30, 3)), rng.standard_normal(30)
    free = minimise(lambda x: (A @ x - b, A), np.zeros(3), np.full(3, -np.inf), np.full(3, np.inf))
    np.testing.assert_allclose(free.x, np.linalg.lstsq(A, b, rcond=None)[0], atol=2e-5)
    assert free.steps <= 4
    lower = free.x + np.array([0.1, -1.0, -1.0])
    held = minimise(lambda x: (A @ x - b, A), lower + 1, lower, np.full(3, np.inf))
    assert held.x[0] == lower[0]
    gradient = A.T @ (A @ held.x - b)
    assert gradient[0] > 0
    np.testing.assert_allclose(gradient[1:], 0.0, atol=1e-4)


def test_a_zero_gradient_is_an_error() -> None:
    """A start where nothing depends on anything is refused, as is one without a finite cost."""
    box = np.full(1, -np.inf), np.full(1, np.inf)
    with pytest.raises(ValueError, match="the gradient is zero"):
        minimise(lambda _: (np.ones(3), np.zeros((3, 1))), np.zeros(1), *box)
    with pytest.raises(ValueError, match="the cost is not finite"):
        minimise(lambda _: (np.full(3, np.nan), np.ones((3, 1))), np.zeros(1), *box)
    with pytest.raises(ValueError, match="the cost is not finite"):  # whose derivatives have no squares
        minimise(lambda _: (np.ones(3), np.full((3, 1), 1e200)), np.zeros(1), *box)


@pytest.mark.parametrize(
    "p", [GRIPPER, pytest.param(Pair(GRIPPER, OTHER), marks=pytest.mark.slow)], ids=["one set", "pair"]
)
def test_ipopt_finds_the_same(p: Lugre[float] | Pair[float]) -> None:
    """The same problem as one CasADi chain solved by IPOPT ends at the same cost, with every parameter within a tenth of its standard error."""
    run = record(p, 3e-4, velocity=motion(3.0)[1])
    found = fit_tracking(
        posed(run, ("both",) if isinstance(p, Lugre) else ("+", "-"), 5), values_of(p), "revolute", search=False
    )
    check = check_tracking(found)
    assert check.agrees
    assert check.reached == check.starts
    assert max(map(abs, check.difference_in_se.values())) < 0.1


def test_what_is_fixed_stays() -> None:
    """A fixed parameter is no unknown, keeps its value, and makes the others surer."""
    run, truth = record(GRIPPER, 3e-4), values_of(GRIPPER)
    free = fit_tracking(posed(run, decimation=5), truth, "revolute", search=False).fit
    sigma_1 = parse("sigma_1")
    problem = dynamic_problem([run], ("both",), ("inertia",), 5, None, {sigma_1: GRIPPER.sigma_1})
    own = {name: value for name, value in truth.items() if name != sigma_1}
    held = fit_tracking(problem, own, "revolute", search=False).fit
    assert sigma_1 not in held.names
    assert held.fixed == {sigma_1: GRIPPER.sigma_1}
    for name in (parse("sigma_0"), INERTIA):
        before, after = free.parameters[name].standard_error, held.parameters[name].standard_error
        assert before is not None
        assert after is not None
        assert after <= before * 1.02


def test_a_noisy_run_counts_for_less() -> None:
    """Of two runs, one ten times as noisy, the fit trusts the quiet one: its errors are near those of the quiet run alone."""
    quiet, noisy = record(GRIPPER, 2e-4, seed=1), replace(record(GRIPPER, 2e-3, seed=2), file="noisy.csv")
    truth = values_of(GRIPPER)
    both = fit_tracking(
        dynamic_problem([quiet, noisy], ("both",), ("inertia",), 5, None), truth, "revolute", search=False
    )
    alone = fit_tracking(posed(quiet, decimation=5), truth, "revolute", search=False).fit
    weights = [m.weight for m in both.problem.motions]
    assert weights[0] == pytest.approx(10 * weights[1], rel=0.1)
    for name in map(parse, ("alpha_0", "sigma_0")):
        own, other = both.fit.parameters[name].standard_error, alone.parameters[name].standard_error
        assert own is not None
        assert other is not None
        assert own < 1.1 * other


def test_each_direction_found_alone_leads_to_both() -> None:
    """From a start that is good in one direction and far off in the other, with others no better, the minimum of both is found."""
    run = record(Pair(GRIPPER, GRIPPER), 1e-5)
    problem = posed(run, ("+", "-"), 10)
    good = values_of(Pair(GRIPPER, GRIPPER))
    far = {"v_s": 0.003}
    start = {n: x * far.get(n.name, 1.0) if n.direction == "-" else x for n, x in good.items()}
    alone = solve_dynamic(problem, start, search=False)
    whole = solve_dynamic(problem, start)
    assert whole.minimum.cost < 0.5 * alone.minimum.cost
    for name, true in good.items():
        assert whole.values[name] == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize("factor", [0.01, 0.1, 1e4])
def test_a_bristle_is_found_from_any_start(factor: float) -> None:
    """Whether the start takes it for a hundred times softer or ten thousand times stiffer, though over sigma_0 the cost has many minima."""
    problem, truth = posed(record(GRIPPER, 1e-5), decimation=5), values_of(GRIPPER)
    start = {name: x * (factor if name.name == "sigma_0" else 1.0) for name, x in truth.items()}
    found = solve_dynamic(problem, start)
    assert found.values[parse("sigma_0")] == pytest.approx(GRIPPER.sigma_0, rel=1e-3)


@pytest.mark.parametrize("fixed", [("alpha_0",), ("alpha_1", "v_s"), ("sigma_1",), ("alpha_0", "alpha_1")])
def test_a_bristle_is_searched_for_beside_what_is_fixed(fixed: tuple[str, ...]) -> None:
    """Whatever else is given as exact, from a start that is a fifth off sigma_0 is found, and what is given stays."""
    problem, truth = posed(record(GRIPPER, 1e-5), decimation=5), values_of(GRIPPER)
    given = {name: x for name, x in truth.items() if name.name in fixed}
    start = {name: 1.2 * x for name, x in truth.items() if name not in given}
    found = solve_dynamic(replace(problem, fixed={**problem.fixed, **given}), start)
    assert found.values.keys().isdisjoint(given)
    assert found.values[parse("sigma_0")] == pytest.approx(GRIPPER.sigma_0, rel=1e-3)


@pytest.mark.parametrize("v_s", [0.3, 0.5])
def test_a_peak_that_the_start_lost_is_found(v_s: float) -> None:
    """From a start without Stribeck terms, whose v_s lies beyond all speeds, one descent ends without them, several find both."""
    problem = posed(record(Pair(GRIPPER, OTHER), 1e-5), ("+", "-"), 10)
    truth = values_of(Pair(GRIPPER, OTHER))
    start = {name: {"alpha_1": 0.0, "v_s": v_s}.get(name.name, x) for name, x in truth.items()}
    alone = solve_dynamic(problem, start, search=False)
    whole = solve_dynamic(problem, start)
    assert all(x == 0 for name, x in alone.values.items() if name.name == "alpha_1")
    assert whole.minimum.cost < 1e-3 * alone.minimum.cost
    for name, true in truth.items():
        assert whole.values[name] == pytest.approx(true, rel=0.01)


def test_a_bend_that_noise_makes_hides_no_coulomb_friction() -> None:
    """Of a joint without a Stribeck effect, in much noise, a term that is not significant leaves alpha_0 its value, and the doubt which sum it is."""
    flat = Pair(GRIPPER._replace(alpha_1=0.0), OTHER._replace(alpha_1=0.0))
    start = {name: 0.2 if name.name == "v_s" else x for name, x in values_of(Pair(GRIPPER, OTHER)).items()}
    run = record(flat, 0.02, 15, velocity=0.5 * motion()[1])
    found = fit_tracking(posed(run, ("+", "-"), 20), start, "revolute").fit.parameters[parse("alpha_0-")]
    assert found.value is not None
    assert found.standard_error is not None
    assert abs(found.value - OTHER.alpha_0) < 3 * found.standard_error < 0.3 * OTHER.alpha_0
    assert "only-sum-seen" in [warning.code for warning in found.warnings]


@pytest.mark.parametrize(
    ("drag", "gravity", "wanted"), [(0.05, 0.0, "quadratic"), (0.0, 0.01, "gravity"), (0.0, 0.0, "")]
)
def test_a_regressor_that_was_left_out(drag: float, gravity: float, wanted: str) -> None:
    """Drag or gravity that the fit was not asked for is a caution with the lines that ask for it; of a clean run nothing is said."""
    run = record(GRIPPER, 1e-4)
    v = run.velocity if run.velocity is not None else np.zeros(0)
    q = np.cumsum(v) * STEP
    assert run.torque is not None
    run = replace(run, position=q, torque=run.torque + drag * v * np.abs(v) + gravity * np.sin(q))
    found = fit_tracking(posed(run, ("both",), 10), values_of(GRIPPER), "revolute", search=False).fit.warnings
    said = [str(d) for d in found if d.code == "lacks-a-term"]
    assert [f"regressors: [inertia, {wanted}]" in text for text in said] == [True] * bool(wanted)


@pytest.mark.parametrize("offset", [0.0, 2e-3, -2e-3])
def test_an_offset_of_moving_runs_is_an_offset_or_friction(offset: float) -> None:
    """A constant torque is said to be one or a difference in alpha_0, with its size; without one nothing is said."""
    run = record(Pair(GRIPPER, GRIPPER), 1e-4)
    assert run.torque is not None
    problem = posed(replace(run, torque=run.torque + offset), ("+", "-"), 10)
    fit_of = fit_tracking(problem, values_of(Pair(GRIPPER, GRIPPER)), "revolute", search=False).fit
    said = [d for d in fit_of.warnings if d.code == "offset-or-friction"]
    assert len(said) == bool(offset)
    for d in said:
        assert d.numbers["offset"] == pytest.approx(offset, rel=0.2)


@pytest.mark.parametrize("drift", [0.0, 0.1, -0.3])
def test_a_torque_that_drifts_is_named_with_how_far(drift: float) -> None:
    """A torque that grows or falls over the run is a caution with by how much; a steady one, with its noise, none."""
    run = record(GRIPPER, 2e-4)
    assert run.torque is not None
    drifting = replace(run, torque=run.torque * (1 + drift * (run.time / run.time[-1] - 0.5)))
    found = fit_tracking(posed(drifting, decimation=5), values_of(GRIPPER), "revolute", search=False).fit.warnings
    said = [d for d in found if d.code == "torque-drifts-in-runs"]
    assert len(said) == bool(drift)
    for d in said:
        assert d.numbers["by"] == pytest.approx(abs(drift), rel=0.1)
        assert d.numbers["how"] == ("grows" if drift > 0 else "falls")


@pytest.mark.parametrize("play", [0.0, 5e-4])
def test_backlash_is_named_with_its_size(play: float) -> None:
    """A position that runs ahead by half the play in the direction of motion is a caution with the play, within a fifth; without it there is none.

    What it moves each parameter by is in its interval, which holds the truth.
    """
    t, inertia = np.arange(0, 20, STEP), 0.01
    v = 0.5 * np.sin(2 * np.pi * 0.2 * t) + 0.2 * np.sin(2 * np.pi * 0.53 * t + 1)
    path = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)])
    torque = rollout(v, STEP, GRIPPER).torque + inertia * np.gradient(v, t)
    torque += 2e-4 * np.random.default_rng(0).standard_normal(t.size)
    ahead = path + play / 2 * np.tanh(v / (0.02 * np.abs(v).max()))
    read = estimate_motion(Record(file="run.csv", time=t, position=ahead, torque=torque), 8.0)
    problem = replace(dynamic_problem([read], ("both",), ("inertia",), 5, None), cutoff=8.0)
    start = {**values_of(GRIPPER), INERTIA: inertia}
    found = fit_tracking(problem, start, "revolute", search=False).fit
    played = [d.numbers["play"] for d in found.warnings if d.code == "backlash"]
    assert played == pytest.approx([play] * (play > 0), rel=0.2)
    for name, true in {**values_of(GRIPPER), INERTIA: inertia}.items():
        low, high = found.parameters[name].interval or (0.0, np.inf)
        assert low < true < high


@pytest.mark.parametrize("share", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("code", ["torque-missing", "torque-saturates"])
def test_what_a_sensor_keeps_is_named_with_its_size(code: str, share: float) -> None:
    """A torque of which a share of the largest is missing about zero, or beyond four such shares, under noise: its size; else neither is said."""
    t, inertia = np.arange(0, 20, STEP), 0.05
    v = 0.5 * np.sin(2 * np.pi * 0.2 * t) + 0.2 * np.sin(2 * np.pi * 0.53 * t + 1)
    whole = rollout(v, STEP, GRIPPER).torque + inertia * np.gradient(v, t)
    largest = np.abs(whole).max()
    top = (1 - 4 * share) * largest
    missing = share * largest if code == "torque-missing" else np.maximum(np.abs(whole) - top, 0)
    torque = whole - np.sign(whole) * np.minimum(np.abs(whole), missing)
    torque += 5e-4 * np.random.default_rng(0).standard_normal(t.size)
    path = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * STEP)])
    read = estimate_motion(Record(file="run.csv", time=t, position=path, torque=torque), 8.0)
    problem = replace(dynamic_problem([read], ("both",), ("inertia",), 5, None), cutoff=8.0)
    found = fit_tracking(problem, {**values_of(GRIPPER), INERTIA: inertia}, "revolute", search=False).fit.warnings
    said = [d for d in found if d.code in {"torque-missing", "torque-saturates"}]
    assert [d.code for d in said][:1] == [code] * bool(share)
    for d in said[:1]:
        assert d.numbers["torque"] == pytest.approx(share * largest if code == "torque-missing" else top, rel=0.2)


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_friction_that_grows_with_the_load_is_named(share: float) -> None:
    """Under gravity, friction that is a share of it more is a caution with that share; with gravity alone there is none."""
    run = record(GRIPPER, 1e-4)
    assert run.velocity is not None
    assert run.torque is not None
    q = 2 * np.cumsum(run.velocity) * STEP
    gravity = 0.05 * np.sin(q)
    loaded = replace(run, position=q, torque=run.torque + gravity + share * np.abs(gravity) * np.sign(run.velocity))
    problem = dynamic_problem([loaded], ("both",), ("inertia", "gravity"), 5, None)
    start = values_of(GRIPPER) | dict.fromkeys(problem.extra_names[1:], 0.0)
    found = fit_tracking(problem, start, "revolute", search=False).fit.warnings
    said = [d for d in found if d.code == "friction-by-load"]
    assert len(said) == bool(share)
    for d in said:
        assert d.numbers["by"] == pytest.approx(share, rel=0.2)


@pytest.mark.parametrize("v_s", [1e-4, 1e-3, GRIPPER.v_s])
def test_a_peak_of_which_there_is_no_sign_hides_no_bristle(v_s: float) -> None:
    """Of a joint without a Stribeck effect sigma_0 is found, from whatever v_s the fit starts: a peak below all speeds is taken for no bristle."""
    flat = GRIPPER._replace(alpha_1=0.0)
    start = values_of(GRIPPER._replace(v_s=v_s, alpha_1=5 * GRIPPER.alpha_0))
    fit_of = fit_tracking(posed(record(flat, 2e-4), decimation=5), start, "revolute").fit
    found, peak = (fit_of.parameters[parse(name)] for name in ("sigma_0", "alpha_1"))
    assert peak.value is None
    assert found.value is not None
    assert found.standard_error is not None
    assert abs(found.value - flat.sigma_0) < 4 * found.standard_error < 0.4 * flat.sigma_0


def test_the_halves_of_a_record_are_compared_in_any_unit() -> None:
    """In what the halves of a record differ, and by how many standard errors, does not change with the size of the Jacobian's columns."""
    v = motion()[1]
    run = record(GRIPPER, 2e-4, velocity=v)
    assert run.torque is not None
    softer = record(GRIPPER._replace(sigma_0=0.5 * GRIPPER.sigma_0), 2e-4, velocity=v)
    assert softer.torque is not None
    both = replace(run, torque=np.where(np.arange(v.size) < v.size // 2, run.torque, softer.torque))
    solved = fit_tracking(posed(both, decimation=5), values_of(GRIPPER), "revolute", search=False)
    minimum, estimates = solved.solution.minimum, solved.fit.parameters
    told = bristle_doubts(solved.problem, solved.solution, estimates)
    assert "unseen-halves" in {d.code for d in told.values()}
    for size in (1e-170, 1e-3, 1e100):
        other = solved.solution._replace(minimum=minimum._replace(jacobian=size * minimum.jacobian))
        again = bristle_doubts(solved.problem, other, estimates)
        assert {name: d.code for name, d in again.items()} == {name: d.code for name, d in told.items()}
        for name, d in told.items():
            if d.code == "unseen-halves":
                assert again[name].numbers["apart"] == pytest.approx(d.numbers["apart"], rel=1e-6)
