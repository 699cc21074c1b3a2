import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lfilter

from bristle.arrays import Array
from bristle.data.differentiation import estimate_motion
from bristle.data.record import Record
from bristle.estimation.nonlinear import minimise
from bristle.findings import Finding, Severity
from bristle.identification.dynamic import descent
from bristle.identification.dynamic.claims import bristle_doubts
from bristle.identification.dynamic.descent import fit, solve_dynamic
from bristle.identification.dynamic.encoder_bias import between_counts, without_count_bias
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import DynamicProblem, InitialState, Prior, dynamic_problem, residuals
from bristle.identification.dynamic.residual_analysis import pattern_left
from bristle.identification.fits import TrackingFit
from bristle.identification.moving_runs import moved_in
from bristle.identification.shared_findings import NOT_IDENTIFIABLE
from bristle.model.parameters import INERTIA, Lugre, Pair, ParameterName
from bristle.model.rollout import rollout

from ..conftest import present
from ..names import named, parse
from .conftest import (
    GRIPPER,
    OTHER,
    J,
    by_name,
    codes,
    error_of,
    fitted,
    holds,
    moved,
    posed,
    sides,
    tones,
    value_of,
    way,
    white,
    with_torque,
)

STEP = 1e-3
TIME = np.arange(0, 8, STEP)
V = tones(TIME)  # A velocity that shows all six parameters
TRUTH = by_name(GRIPPER)
Z0 = InitialState("z0", 0)  # what the only motion begins with
SETS = pytest.mark.parametrize("p", [GRIPPER, Pair(GRIPPER, OTHER)], ids=["one set", "pair"])


def record(
    p: Lugre[float] | Pair[float] = GRIPPER, noise: float = 0.0, seed: int = 0, v: Array = V, z0: float | None = None
) -> Record:
    return moved(v, STEP, p, noise, seed=seed, z0=z0)


def shifted(values: Mapping[ParameterName, float], factor: float = 1.25) -> dict[ParameterName, float]:
    return {name: value * factor ** (1 if k % 2 else -1) for k, (name, value) in enumerate(values.items())}


@SETS
@pytest.mark.parametrize("decimation", [1, 10])
def test_the_jacobian_is_that_of_differences(p: Lugre[float] | Pair[float], decimation: int) -> None:
    """Each column of the residuals' Jacobian is their central difference, filtered or not, z0 and inertia included."""
    problem = posed(record(p), sides(p), decimation)
    at = shifted(by_name(p), 1.1) | {Z0: 1e-4}
    _, jacobian = residuals(problem, at)
    for k, name in enumerate(problem.names):
        h = 1e-5 * (abs(at[name]) or 1e-4)
        up, down = (residuals(problem, {**at, name: at[name] + s * h})[0] for s in (1, -1))
        difference = (up - down) / (2 * h)
        size = np.abs(jacobian[:, k]).max()
        assert np.abs(jacobian[:, k] - difference).max() < 2e-4 * size + 1e-12


@SETS
def test_means_away_from_reversals_are_the_same_problem(p: Lugre[float] | Pair[float]) -> None:
    """Over less than half of the samples the modelled torque of each equation is the same to 2e-3 of friction, rms."""
    problem = posed(record(p), sides(p), 40)
    rough, at = problem.rough(), shifted(by_name(p)) | {Z0: 0.0}
    assert rough.rough() is rough
    assert rough.motions[0].time.size < problem.motions[0].time.size / 2
    off = residuals(rough, at)[0] - residuals(problem, at)[0]
    assert np.sqrt(np.mean(off**2)) < 2e-3 * GRIPPER.alpha_0
    assert rough.measured == pytest.approx(problem.measured, abs=0.02 * GRIPPER.alpha_0)


@SETS
def test_without_noise_the_truth_comes_back(p: Lugre[float] | Pair[float]) -> None:
    """From a start that is off by a quarter, noise-free data give every parameter back."""
    values, minimum = fit(posed(record(p), sides(p)), shifted(by_name(p)) | {Z0: 0.0})
    assert minimum.cost < 1e-16
    for name, true in by_name(p).items():
        assert values[name] == pytest.approx(true, rel=1e-4)
    # with noise it ends where SciPy's trust region does
    problem = posed(record(p, noise=3e-4), sides(p))
    start = shifted(by_name(p), 1.5) | {Z0: 0.0}
    _, minimum = fit(problem, start)
    variances = np.diag(np.linalg.inv(minimum.jacobian.T @ minimum.jacobian)) * minimum.cost / minimum.residuals.size
    of = descent.least_squares(problem, start)
    x, box = of.unknowns.scaled(start), (of.unknowns.lower, of.unknowns.upper)
    both = [lambda x, k=k: of.evaluate(x)[k] for k in (0, 1)]
    by_scipy = least_squares(both[0], x, both[1], box, x_scale="jac")
    assert 2 * by_scipy.cost == pytest.approx(minimum.cost, rel=1e-6)
    assert (np.abs(by_scipy.x - minimum.x)[:-1] < 0.1 * np.sqrt(variances)).all()


def test_intervals_hold_the_truth_and_follow_noise_and_priors() -> None:
    """Over forty repetitions with white noise, at least 87 % of the intervals of all seven parameters hold the truth."""
    hits = []
    for seed in range(40):
        found = fitted(posed(record(noise=3e-4, seed=seed), decimation=5)).parameters
        hits += [holds(found[name].interval, true) for name, true in TRUTH.items()]
    assert 0.87 < np.mean(hits) <= 1.0
    # residuals that are correlated over fifty samples give wider errors than white ones of the same size, and a warning
    even = white(V.size, 3e-4, 1)
    slow = np.convolve(even, np.ones(50) / np.sqrt(50), mode="same")
    torque = present(record().torque)
    one, other = (fitted(posed(replace(record(), torque=torque + noise))) for noise in (even, slow))
    alpha_0 = parse("alpha_0")
    assert error_of(other.parameters[alpha_0]) > 3 * error_of(one.parameters[alpha_0])
    assert "correlated" in codes(other.warnings)
    # with all speeds far below v_s only alpha_0 + alpha_1 is seen, as alpha_0, which is said; alpha_1 and v_s are not
    found = fitted(posed(record(noise=1e-5, v=0.03 * GRIPPER.v_s * V)))
    for name in map(parse, ("alpha_1", "v_s")):
        assert found.parameters[name].value is None
        assert found.parameters[name].interval == (0.0, np.inf)
        assert found.parameters[name].warnings[0].code in NOT_IDENTIFIABLE
    level = found.parameters[parse("alpha_0")]
    assert level.value == pytest.approx(GRIPPER.alpha_0 + GRIPPER.alpha_1, rel=0.01)
    # a prior as sure as the data moves an estimate about half of the way; a sure one all the way; and the error shrinks
    problem = posed(record(noise=3e-4), decimation=5)
    alone, v_s = fitted(problem), parse("v_s")
    value, error = value_of(alone.parameters[v_s]), error_of(alone.parameters[v_s])
    moves = []
    for share in (1.0, 1e-3):
        prior = Prior("static", (v_s,), np.array([value + 2 * error]), np.array([[1 / (share * error)]]))
        found = fitted(replace(problem, priors=(prior,), sigma=alone.rms)).parameters[v_s]
        assert error_of(found) < error
        moves.append((value_of(found) - value) / (2 * error))
    assert 0.25 < moves[0] < 0.75
    assert moves[1] == pytest.approx(1.0, abs=0.02)
    # of two runs, one ten times as noisy, the fit trusts the quiet one: its errors are near those of the quiet run alone
    quiet, noisy = record(noise=2e-4, seed=1), replace(record(noise=2e-3, seed=2), file="noisy.csv")
    together = dynamic_problem([quiet, noisy], ("both",), ("inertia",), 5, None)
    both = fit_tracking(together, TRUTH, "revolute", search=False)
    weights = [m.weight for m in both.problem.motions]
    assert weights[0] == pytest.approx(10 * weights[1], rel=0.1)
    alone = fitted(posed(quiet, decimation=5))
    for name in map(parse, ("alpha_0", "sigma_0")):
        assert error_of(both.fit.parameters[name]) < 1.1 * error_of(alone.parameters[name])


def test_what_is_unseen_scarce_or_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two columns that are the same but for noise: the warning names both parameters, and that they are seen as a sum only."""
    problem = posed(record())
    doubled = replace(
        problem,
        extra_names=(INERTIA, parse("offset")),
        motions=tuple(
            replace(m, extra=np.column_stack([m.extra[:, 0], m.extra[:, 0] * (1 + 1e-7 * m.time)]))
            for m in problem.motions
        ),
    )
    found = fitted(doubled, {**TRUTH, INERTIA: 0.6 * J, parse("offset"): 0.4 * J})
    (told,) = (warning for warning in found.warnings if warning.code == "only-as-sum")
    assert list(map(str, told.numbers["all"])) == ["inertia", "offset"]
    # a motion that leaves fewer equations than twice the unknowns has no values, however well it fits, and says how many are needed
    run = record(noise=2e-4)
    for every, few in ((40, True), (1, False)):
        signals = {n: getattr(run, n)[::every] for n in ("time", "velocity", "acceleration", "torque")}
        problem = posed(replace(run, **signals), decimation=5)
        for asked in (problem, replace(problem, stribeck="stribeck")):
            found = fitted(asked).parameters.values()
            assert all((e.value is None) is few for e in found)
            assert ("unseen-too-few" in {w.code for e in found for w in e.warnings}) is few
    # a fixed parameter is no unknown, keeps its value, and makes the others surer
    run, sigma_1 = record(noise=3e-4), parse("sigma_1")
    free = fitted(posed(run, decimation=5))
    problem = dynamic_problem([run], ("both",), ("inertia",), 5, None, {sigma_1: GRIPPER.sigma_1})
    held = fitted(problem, {name: value for name, value in TRUTH.items() if name != sigma_1})
    assert sigma_1 not in held.names
    assert held.fixed == {sigma_1: GRIPPER.sigma_1}
    for name in (parse("sigma_0"), INERTIA):
        assert error_of(held.parameters[name]) <= error_of(free.parameters[name]) * 1.02
    # what is worse than no model at all tells nothing: no parameter has a value, however small its error; a good fit has
    problem = posed(record(noise=2e-4), decimation=5)
    assert fitted(problem).parameters[parse("alpha_0")].value is not None
    monkeypatch.setattr(DynamicProblem, "extent", property(lambda _: 1e-9))
    assert {e.value for e in fitted(problem).parameters.values()} == {None}
    monkeypatch.undo()
    # two segments, each begun with a deflection of its own, give the truth; the deflections come back too
    both = record(z0=2e-3), record(z0=-1e-3)
    v, T, a = (np.concatenate([getattr(x, n) for x in both]) for n in ("velocity", "torque", "acceleration"))
    time = np.concatenate([TIME, TIME + TIME[-1] + 5.0])
    problem = posed(Record(file="two.csv", time=time, starts=(0, V.size), velocity=v, torque=T, acceleration=a))
    assert [str(name) for name in problem.names[-2:]] == ["z0[0]", "z0[1]"]
    later = InitialState("z0", 1)
    values, minimum = fit(problem, shifted(TRUTH, 1.1) | {Z0: 0.0, later: 0.0})
    assert minimum.cost < 1e-16
    assert [values[Z0], values[later]] == pytest.approx([2e-3, -1e-3], rel=1e-4)


def test_a_stiff_bristle_converges() -> None:
    """sigma_0 = 1e5 at up to 2 mrad/s: the fit converges, to the truth within its interval."""
    stiff = GRIPPER._replace(sigma_0=1e5, sigma_1=2.0, v_s=1e-3)
    truth = by_name(stiff)
    run = record(stiff, 1e-5, v=2e-3 / np.abs(V).max() * V)
    found = fit_tracking(posed(run), shifted(truth, 1.1), "revolute").fit
    assert found.outcome.code in {"converged", "converged-at-bound"}
    assert sum(holds(found.parameters[name].interval, true) for name, true in truth.items()) >= 6
    # where a joint hardly slides between reversals, a late torque is a caution that names both causes, and no line to change
    soft = GRIPPER._replace(sigma_0=GRIPPER.sigma_0 / 10)
    late = with_torque(record(soft, 2e-5, v=0.3 * V), lambda T: np.interp(TIME - 5e-3, TIME, T))
    found = fitted(posed(late, decimation=5), by_name(soft))
    (said,) = [d for d in found.warnings if d.code in {"torque-delayed", "delay-or-presliding"}]
    assert (said.code, said.severity) == ("delay-or-presliding", Severity.CAUTION)
    assert "presliding" in str(said)
    assert "to the delay of" not in str(said)
    # an inertia fixed 5 % too high is named with what to add, and nothing else is blamed; the right one is not
    for factor in (1.0, 1.05):
        problem = dynamic_problem([record(noise=2e-4)], ("both",), (), 2, factor * J)
        warnings = fitted(problem, by_name(GRIPPER, None)).warnings
        said = [d for d in warnings if d.code in {"inertia-doubted", "torque-delayed"}]
        added = [float(str(d).split("with ")[1].split()[0]) for d in said]
        assert added == pytest.approx([(1 - factor) * J] * (factor > 1), rel=0.2)


def counted(quantum: float, torque: Array, place: float = 0.0) -> Record:
    """The run as an encoder shows it that rests at a place in a count."""
    position = quantum * np.floor(way(V, STEP) / quantum + place)
    return estimate_motion(Record(file="run.csv", time=TIME, position=position, torque=torque), 40.0)


def behind_counts(
    quantum: float, noise: float, place: float = 0.0, count: float = 0.0
) -> tuple[TrackingFit, TrackingFit]:
    """The fit behind an encoder, and that without the bias of its counts."""

    def pose(records: Sequence[Record], fixed: Mapping[ParameterName, float]) -> DynamicProblem:
        return replace(dynamic_problem(records, ("both",), ("inertia",), 5, None, fixed), count=count)

    run = counted(quantum, present(record(noise=noise).torque), place)
    found = fit_tracking(pose([run], {}), TRUTH, "revolute", search=False)
    return found.fit, without_count_bias(found, [run], pose, quantum)


def test_coarse_counts_bias_and_the_bootstrap_takes_it_off() -> None:
    """With an encoder so coarse that counts bias the fit, the corrected estimates are nearer to the truth, and a warning says what was done."""
    found, better = behind_counts(2 * np.pi / 2**15, 0.0)
    names = list(map(parse, ("alpha_0", "alpha_2", "sigma_0")))
    off = [np.array([(f.parameters[n].value or 0.0) / TRUTH[n] - 1 for n in names]) for f in (found, better)]
    assert np.linalg.norm(off[1]) < 0.6 * np.linalg.norm(off[0])
    assert "count-bias" in codes(better.warnings)
    # with a count of a micro-radian, however the filters end, no estimate moves by a tenth of its standard error
    found, better = behind_counts(1e-6, 2e-4, place=0.5)
    for name, bias in better.count_bias.items():
        assert abs(bias) < 0.1 * error_of(found.parameters[name]), name
    # its position is off by no more than the readings, its velocity by a third at most; beside a noise above the count nothing changes
    position, quantum = way(V, STEP), 2 * np.pi / 2**12
    run = Record(file="run.csv", time=TIME, position=quantum * (np.floor(position / quantum) + 0.5))
    read = estimate_motion(run, 100.0)
    smooth = between_counts(read, quantum)
    assert smooth.position is not None
    assert np.std(smooth.position - position) < quantum / np.sqrt(12)
    assert np.std(np.asarray(smooth.velocity) - V) < np.std(np.asarray(read.velocity) - V) / 3
    assert between_counts(read, quantum / 10).velocity == pytest.approx(read.velocity)


@pytest.mark.parametrize("bits", [9, 17])
def test_a_bend_of_a_few_counts_is_withdrawn_and_one_of_many_is_right(bits: int) -> None:
    """With a count of three bends sigma_0 has neither value nor interval; with an eightieth of one its interval holds the truth."""
    quantum = 2 * np.pi / 2**bits
    sigma_0 = behind_counts(quantum, 2e-4, count=quantum)[1].parameters[parse("sigma_0")]
    assert (sigma_0.value is None) == (sigma_0.interval is None) == (bits == 9)
    assert sigma_0.interval is None or holds(sigma_0.interval, GRIPPER.sigma_0)


@pytest.mark.parametrize("samples", [0.0, 1.0, 0.5, -1.0])
def test_a_torque_logged_late_is_named_with_its_delay(samples: float) -> None:
    """A torque shifted by half a sample or more is named, with a delay within a fifth of the true one; one in time is not."""
    late = with_torque(record(noise=2e-4), lambda T: np.interp(TIME - samples * STEP, TIME, T))
    fixed = named({"alpha_1": GRIPPER.alpha_1, "v_s": GRIPPER.v_s})
    start = {name: value for name, value in TRUTH.items() if name not in fixed}
    found = fitted(replace(posed(late, decimation=2), fixed=fixed), start)
    said = [d for d in found.warnings if d.code == "torque-delayed"]
    assert [d.numbers["delay"] for d in said] == pytest.approx([samples * STEP] * bool(samples), rel=0.2)
    told = [float(re.findall(r"add (\S+) s to the delay", str(d))[0]) for d in said]
    assert told == pytest.approx([samples * STEP] * bool(samples), rel=0.2)
    assert all(("earlier" if samples > 0 else "later") in str(d) for d in said)


@pytest.mark.parametrize(("bits", "delay"), [(12, 0.0), (14, 0.0), (24, 0.0), (24, 3e-3)])
def test_counts_and_presliding_are_no_delay(bits: int, delay: float) -> None:
    """Behind encoders that hide presliding, and behind fine ones, no delay is named where there is none; a true one behind a fine one is."""
    count, torque = 2 * np.pi / 2**bits, present(record(noise=2e-4).torque)
    problem = posed(counted(count, np.interp(TIME - delay, TIME, torque)), decimation=5)
    found = fitted(replace(problem, count=count, cutoff=40.0, position_logged=True))
    said = [d.numbers["delay"] for d in found.warnings if d.code == "torque-delayed"]
    assert said == pytest.approx([delay] * bool(delay), rel=0.2)


def test_what_is_left_in_a_few_moments_is_named() -> None:
    """Even noise says nothing, in 200 records; drift is called a pattern, more about reversals is named by how much, large misses by where."""
    problem = posed(record())
    rng = np.random.default_rng(0)
    even = rng.standard_normal((200, V.size))
    assert not any(pattern_left(problem, rows) for rows in even)
    assert not any(pattern_left(problem, rows) for rows in lfilter([1.0], [1.0, -0.8], even))
    for rows in lfilter([1.0], [1.0, -0.97], even):
        (said,) = pattern_left(problem, rows)
        assert said.code == "lacks-unknown-term"
        assert said.numbers["lag_one"] == pytest.approx(0.97, abs=0.02)
    slow = np.abs(V) < 0.1 * np.sqrt(np.mean(V**2))
    for times in (4.0, 10.0):
        (said,) = pattern_left(problem, np.where(slow, times, 1.0) * even[0])
        assert said.code == "reversals-left"
        assert 0.6 * times < said.numbers["ratio"] < 1.1 * times
    fast = int(np.argmax(np.abs(V)))
    (said,) = pattern_left(problem, even[0] + 100.0 * (np.abs(np.arange(V.size) - fast) < 5))
    assert said.code == "bursts"
    where = said.numbers["where"]
    assert float(where.split()[-2]) == pytest.approx(problem.time[fast], abs=0.01)
    assert pattern_left(problem, np.zeros(V.size)) == []
    # a run at rest shows no parameter; it is refused in one sentence
    with pytest.raises(ValueError, match=r"run\.csv: at rest throughout"):
        posed(record(v=np.zeros(8000)))
    # a direction in which less than a hundredth of the way is gone is none; two hundredths are one
    there = np.abs(V[:-100])
    for back, directions in ((0.005, ("+",)), (0.02, ("+", "-"))):
        velocity = np.append(there, np.full(100, -back * there.sum() / 100))
        assert moved_in([record(v=velocity)]) == directions


def test_descents_respect_bounds_and_find_minima() -> None:
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
    # a start where nothing depends on anything is refused, as is one without a finite cost, or whose derivatives have no squares
    box = np.full(1, -np.inf), np.full(1, np.inf)
    with pytest.raises(ValueError, match="the gradient is zero"):
        minimise(lambda _: (np.ones(3), np.zeros((3, 1))), np.zeros(1), *box)
    for row, slope in ((np.nan, 1.0), (1.0, 1e200)):
        start = np.full(3, row), np.full((3, 1), slope)
        with pytest.raises(ValueError, match="the cost is not finite"):
            minimise(partial(lambda at, _: at, start), np.zeros(1), *box)
    # where one set for both directions ends without a peak, or in one too narrow to matter, each direction still gets its own
    uneven = Pair(
        GRIPPER._replace(alpha_1=0.1 * GRIPPER.alpha_0), OTHER._replace(alpha_1=0.8 * OTHER.alpha_0, v_s=0.03)
    )
    problem, truth = posed(record(uneven, 1e-5), ("+", "-"), 10), by_name(uneven)
    whole = solve_dynamic(problem, {name: x * (1e-2 if name.name == "v_s" else 1.0) for name, x in truth.items()})
    for name, true in truth.items():
        assert whole.values[name] == pytest.approx(true, rel=0.02)
    # from a start without Stribeck terms, v_s beyond all speeds, one descent ends without them, several find both
    problem, truth = posed(record(Pair(GRIPPER, OTHER), 1e-5), ("+", "-"), 10), by_name(Pair(GRIPPER, OTHER))
    start = {name: {"alpha_1": 0.0, "v_s": 0.5}.get(name.name, x) for name, x in truth.items()}
    alone, whole = solve_dynamic(problem, start, search=False), solve_dynamic(problem, start)
    assert all(x == 0 for name, x in alone.values.items() if name.name == "alpha_1")
    assert whole.minimum.cost < 1e-3 * alone.minimum.cost
    for name, true in truth.items():
        assert whole.values[name] == pytest.approx(true, rel=0.01)


def test_a_bristle_is_found_from_any_start_and_beside_what_is_fixed() -> None:
    """Whether the start takes it for a hundred times softer or ten thousand times stiffer, though over sigma_0 the cost has many minima."""
    for factor in (0.01, 0.1, 1e4):
        problem = posed(record(noise=1e-5), decimation=5)
        found = solve_dynamic(problem, {n: x * (factor if n.name == "sigma_0" else 1.0) for n, x in TRUTH.items()})
        assert found.values[parse("sigma_0")] == pytest.approx(GRIPPER.sigma_0, rel=1e-3)
    # whatever else is given as exact, from a start that is a fifth off sigma_0 is found, and what is given stays
    for fixed in (("alpha_0",), ("alpha_1", "v_s"), ("sigma_1",), ("alpha_0", "alpha_1")):
        problem = posed(record(noise=1e-5), decimation=5)
        given = {name: x for name, x in TRUTH.items() if name.name in fixed}
        start = {name: 1.2 * x for name, x in TRUTH.items() if name not in given}
        found = solve_dynamic(replace(problem, fixed={**problem.fixed, **given}), start)
        assert found.values.keys().isdisjoint(given)
        assert found.values[parse("sigma_0")] == pytest.approx(GRIPPER.sigma_0, rel=1e-3)


def test_a_bend_that_noise_makes_hides_no_coulomb_friction() -> None:
    """Of a joint without a Stribeck effect, in much noise, a term that is not significant leaves alpha_0 its value, and the doubt which sum it is."""
    flat = Pair(GRIPPER._replace(alpha_1=0.0), OTHER._replace(alpha_1=0.0))
    start = {name: 0.2 if name.name == "v_s" else x for name, x in by_name(Pair(GRIPPER, OTHER)).items()}
    problem = posed(record(flat, 0.02, 15, v=0.5 * V), ("+", "-"), 20)
    found = fit_tracking(problem, start, "revolute").fit.parameters[parse("alpha_0-")]
    assert abs(value_of(found) - OTHER.alpha_0) < 3 * error_of(found) < 0.3 * OTHER.alpha_0
    # in what the halves of a record differ, and by how many standard errors, does not change with the size of the Jacobian's columns
    softer = present(record(GRIPPER._replace(sigma_0=0.5 * GRIPPER.sigma_0), 2e-4).torque)
    both = with_torque(record(noise=2e-4), lambda T: np.where(np.arange(V.size) < V.size // 2, T, softer))
    solved = fit_tracking(posed(both, decimation=5), TRUTH, "revolute", search=False)
    minimum, estimates = solved.solution.minimum, solved.fit.parameters
    told = bristle_doubts(solved.problem, solved.solution, estimates)
    assert "unseen-halves" in codes(told.values())
    for size in (1e-170, 1e-3, 1e100):
        other = solved.solution._replace(minimum=minimum._replace(jacobian=size * minimum.jacobian))
        again = bristle_doubts(solved.problem, other, estimates)
        assert {name: d.code for name, d in again.items()} == {name: d.code for name, d in told.items()}
        for name, d in told.items():
            if d.code == "unseen-halves":
                assert again[name].numbers["apart"] == pytest.approx(d.numbers["apart"], rel=1e-6)


@pytest.mark.parametrize("v_s", [1e-4, 1e-3, GRIPPER.v_s])
def test_a_peak_of_which_there_is_no_sign_hides_no_bristle(v_s: float) -> None:
    """Of a joint without a Stribeck effect sigma_0 is found, from whatever v_s the fit starts: a peak below all speeds is taken for no bristle."""
    flat = GRIPPER._replace(alpha_1=0.0)
    start = by_name(GRIPPER._replace(v_s=v_s, alpha_1=5 * GRIPPER.alpha_0))
    fit_of = fit_tracking(posed(record(flat, 2e-4), decimation=5), start, "revolute").fit
    found, peak = (fit_of.parameters[parse(name)] for name in ("sigma_0", "alpha_1"))
    assert peak.value is None
    assert abs(value_of(found) - flat.sigma_0) < 4 * error_of(found) < 0.4 * flat.sigma_0


PLANTED: list[tuple[dict[str, float], dict[str, object]]] = [
    ({"every": 10}, {}), ({"every": 10, "drag": 0.05}, {"lacks-a-term": "regressors: [inertia, quadratic]"}),
    ({"every": 10, "gravity": 0.01}, {"lacks-a-term": "regressors: [inertia, gravity]"}), ({"noise": 2e-4}, {}),
    ({"noise": 2e-4, "drift": 0.1}, {"torque-drifts-in-runs": ("grows", pytest.approx(0.1, rel=0.1))}),
    ({"noise": 2e-4, "drift": -0.3}, {"torque-drifts-in-runs": ("falls", pytest.approx(0.3, rel=0.1))}),
    ({"noise": 2e-4, "inertia": -3.0}, {"inertia-below-zero": Severity.CRITICAL}), ({"known gravity": 0.05}, {}),
    ({"known gravity": 0.05, "load": 0.2}, {"friction-by-load": (True, pytest.approx(0.2, rel=0.2))}),
    ({"pair": 1.0, "every": 10}, {}),
    ({"pair": 1.0, "every": 10, "offset": 2e-3}, {"offset-or-friction": pytest.approx(2e-3, rel=0.2)}),
    ({"pair": 1.0, "every": 10, "offset": -2e-3}, {"offset-or-friction": pytest.approx(-2e-3, rel=0.2)}),
]  # fmt: skip  # a list of values
"""What a torque has that its fit does not, N*m or a share, with its noise and its decimation, and what is said of it."""
SIZES: dict[str, Callable[[Finding], object]] = {
    "lacks-a-term": lambda d: next(x for x in re.findall(r"regressors: \[inertia, \w+\]", str(d))),
    "torque-drifts-in-runs": lambda d: (d.numbers["how"], d.numbers["by"]),
    "inertia-below-zero": lambda d: d.severity,
    "friction-by-load": lambda d: ("law: gaussian+link-load" in str(d), d.numbers["by"]),
    "offset-or-friction": lambda d: d.numbers["offset"],
}
"""Of each of these findings, what tells how much it is."""


@pytest.mark.parametrize(("planted", "wanted"), PLANTED, ids=str)
def test_what_the_torque_has_and_the_fit_lacks_is_named_with_its_size(
    planted: dict[str, float], wanted: dict[str, object]
) -> None:
    """Drag, gravity, a drift, an inertia below zero, friction that grows with the load, an offset: that one, its size, its line; else nothing."""
    more = dict.fromkeys(("drag", "gravity", "drift", "inertia", "known gravity", "load", "offset", "pair"), 0.0)
    more |= {"noise": 1e-4, "every": 5} | planted
    p = Pair(GRIPPER, GRIPPER) if more["pair"] else GRIPPER
    q = (2 if more["known gravity"] else 1) * np.cumsum(V) * STEP
    known = more["known gravity"] * np.sin(q)

    def changed(T: Array) -> Array:
        out: Array = T * (1 + more["drift"] * (TIME / TIME[-1] - 0.5))
        out = (
            out
            + more["drag"] * V * np.abs(V)
            + more["gravity"] * np.sin(q)
            + more["inertia"] * J * np.gradient(V, TIME)
        )
        return out + known + more["load"] * np.abs(known) * np.sign(V) + more["offset"]

    run = replace(with_torque(record(p, more["noise"]), changed), position=None if more["pair"] else q)
    regressors = ("inertia", "gravity") if more["known gravity"] else ("inertia",)
    problem = dynamic_problem([run], sides(p), regressors, int(more["every"]), None)
    found = fitted(problem, by_name(p) | dict.fromkeys(problem.extra_names[1:], 0.0)).warnings
    assert [(d.code, SIZES[d.code](d)) for d in found if d.code in SIZES] == [*wanted.items()]


def swung(inertia: float) -> tuple[Array, Array, Array]:
    """Time, velocity and torque of twenty seconds of two tones."""
    t = np.arange(0, 20, STEP)
    v = tones(t, ((0.5, 0.2), (0.2, 0.53)))
    return t, v, rollout(v, STEP, GRIPPER).torque + inertia * np.gradient(v, t)


def read_through(t: Array, position: Array, torque: Array, inertia: float) -> TrackingFit:
    """The fit of what was read, through a low pass of 8 Hz."""
    read = estimate_motion(Record(file="run.csv", time=t, position=position, torque=torque), 8.0)
    return fitted(replace(posed(read, decimation=5), cutoff=8.0, position_logged=True), by_name(GRIPPER, inertia))


@pytest.mark.parametrize("play", [0.0, 5e-4])
def test_backlash_is_named_with_its_size(play: float) -> None:
    """A position that runs ahead by half the play in the direction of motion is a caution with the play, within a fifth; without it there is none."""
    # what it moves each parameter by is in its interval, which holds the truth
    t, v, torque = swung(0.01)
    ahead = way(v, STEP) + play / 2 * np.tanh(v / (0.02 * np.abs(v).max()))
    found = read_through(t, ahead, torque + white(t.size, 2e-4), 0.01)
    played = [d.numbers["play"] for d in found.warnings if d.code == "backlash"]
    assert played == pytest.approx([play] * (play > 0), rel=0.2)
    for name, true in by_name(GRIPPER, 0.01).items():
        assert holds(found.parameters[name].interval, true), name


@pytest.mark.parametrize(
    ("code", "share"),
    [("torque-missing", 0.0), *((c, x) for c in ("torque-missing", "torque-saturates") for x in (0.05, 0.1))],
)
def test_what_a_sensor_keeps_is_named_with_its_size(code: str, share: float) -> None:
    """A torque of which a share of the largest is missing about zero, or beyond four such shares, under noise: its size; else neither is said."""
    t, v, whole = swung(0.05)
    largest = np.abs(whole).max()
    top = (1 - 4 * share) * largest
    missing = share * largest if code == "torque-missing" else np.maximum(np.abs(whole) - top, 0)
    torque = whole - np.sign(whole) * np.minimum(np.abs(whole), missing) + white(t.size, 5e-4)
    found = read_through(t, way(v, STEP), torque, 0.05).warnings
    said = [d for d in found if d.code in {"torque-missing", "torque-saturates"}]
    assert codes(said)[:1] == [code] * bool(share)
    for d in said[:1]:
        assert d.numbers["torque"] == pytest.approx(share * largest if code == "torque-missing" else top, rel=0.2)
