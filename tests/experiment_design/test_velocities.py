from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from bristle.arrays import Array
from bristle.identification.static.batch import COARSE, Batch
from bristle.identification.static.grid import default_range
from bristle.identification.static.problem import from_points
from bristle.model import functions
from bristle.model.parameters import Direction
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design import excitation, loading, velocities
from bristle.questions.experiment_design import references as reference
from bristle.questions.experiment_design.excitation import (
    MotionProblem,
    best_motion,
    course,
    evaluate_motion,
    information,
    limited,
    plain_lines,
    within_torque,
)
from bristle.questions.experiment_design.loading import CYCLES, design_loading, loading_errors
from bristle.questions.experiment_design.references import PlannedRun
from bristle.questions.experiment_design.velocities import (
    DesignProblem,
    design,
    evaluate_design,
    nodes_of,
)
from bristle.simulation.bench import steady_points
from bristle.simulation.edro import TABLE_1, inertia
from bristle.simulation.fisher import covariance, gram, motion_jacobian, static_information, static_jacobian
from bristle.simulation.limits import Limits
from bristle.simulation.references import Multisine

from .conftest import spaced_speeds

P = TABLE_1["gripper rotation"].positive
RUNS = 12
LIMITS = Limits(
    position=(-0.5, 1.5), slowest=0.02, velocity=1.2, acceleration=15.0, torque=0.06, time=None, hold=3.0,
    frequency=8.0, rate=100.0,
)  # fmt: skip  # a list of values


def simulated_errors(own: DesignProblem, speeds: Array) -> Array:
    """How fits of these runs alone scatter, SIMULATED from the estimate with Gaussian noise, (4,), as the problem's names."""
    # half the width of the middle 68.3 % of the estimates, which a few fits that fail do not rule
    torques = steady_points(own.p, speeds, own.noise, np.random.default_rng(0), 20_000).T
    regression = from_points(speeds, torques[:, 0], ("both",), law=own.p.law)
    batch = Batch(replace(regression, shape=(), memory={}), torques, default_range(speeds), COARSE)
    found = dict(zip((name.name for name in regression.names), batch.theta, strict=True))
    low, high = np.percentile([found[name] for name in own.names], [15.87, 84.13], axis=1)
    return np.asarray((high - low) / 2)


def problem(low: float = 0.15, high: float = 0.8, relative: float = 0.0, **changed: object) -> DesignProblem:
    """Gripper rotation (+), from `low` v_s to `high` rad/s, with nothing known before."""
    given_ = {
        "p": P, "nodes": nodes_of(P.v_s, relative), "prior_information": np.zeros((4, 4)), "noise": 0.005 * P.alpha_0,
    }  # fmt: skip  # a list of values
    return DesignProblem(**{**given_, "low": low * P.v_s, "high": high, **changed})  # type: ignore[arg-type]  # of mixed types


def test_planned_velocities_are_the_best(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twelve runs planned for v_s alone give it at most 0.67 times the standard error of twelve log-spaced ones; simulated fits agree."""
    own = problem()
    planned, log = design(own, RUNS, "v_s"), evaluate_design(own, spaced_speeds(own, RUNS, "log"))
    assert planned.errors[3] <= 0.67 * log.errors[3]
    seen = [simulated_errors(own, speeds)[3] for speeds in (planned.speeds, log.speeds)]
    assert seen[0] <= 0.67 * seen[1]
    assert seen[0] == pytest.approx(planned.errors[3], rel=0.05)
    # far above v_s, where the peak's information is zero to the last digit, Coulomb and viscous friction are planned as without a peak
    own = problem(low=40.0, high=80 * P.v_s)
    assert not (static_jacobian(np.array([own.low]), P)[0, [1, 3]] ** 2).any()
    found = design(own, RUNS, "alpha_2")
    assert np.isfinite(found.errors[[0, 2]]).all()
    assert {*np.round(found.speeds, 9).tolist()} == {round(own.low, 9), round(own.high, 9)}
    # Kiefer and Wolfowitz: of 4 k runs n s'(v) F**-1 s(v) / noise**2 is at most 4 anywhere, and 4 at each speed run
    own = problem()
    found = design(own, RUNS)
    inverse = np.linalg.inv(static_information(found.speeds, P, own.noise))

    def reach(speeds: Array) -> Array:
        rows = static_jacobian(speeds, P) / own.noise
        return np.asarray(RUNS * np.einsum("np,pq,nq->n", rows, inverse, rows))

    assert reach(np.geomspace(own.low, own.high, 2000)).max() <= 4 * 1.001
    assert reach(found.speeds) == pytest.approx(4.0, rel=1e-3)
    assert (found.speeds.size, np.unique(found.speeds).size) == (RUNS, 4)
    # where all but alpha_2 is known, its runs all go to the fastest speed v, and its error is noise / (sqrt(n) v)
    own = problem(prior_information=np.diag([1e14, 1e14, 0.0, 1e14]))
    found = design(own, 9, "alpha_2")
    assert found.speeds == pytest.approx(np.full(9, own.high), rel=1e-6)
    assert found.errors[2] == pytest.approx(own.noise / (3 * own.high), rel=1e-3)
    # standard errors are those of the sum of both informations, and smaller than those of the runs alone; known runs move the design
    first = spaced_speeds(problem(), 6, "log")
    own = problem(prior_information=static_information(first, P, problem().noise))
    found = design(own, 6, "v_s")
    together = evaluate_design(problem(), np.concatenate([first, found.speeds]))
    assert found.errors == pytest.approx(together.errors, rel=1e-6)
    assert (found.errors < evaluate_design(problem(), found.speeds).errors).all()
    assert found.errors[3] < evaluate_design(own, design(problem(), 6, "v_s").speeds).errors[3]
    # with v_s known to a factor of two, the averaged design is worse at the estimate, and better at half of it
    there, here = (design(problem(relative=x), RUNS, "v_s").speeds for x in (0.7, 0.0))
    other = problem(p=P._replace(v_s=P.v_s / 2))
    assert evaluate_design(problem(), there).errors[3] > evaluate_design(problem(), here).errors[3]
    assert evaluate_design(other, there).errors[3] < 0.9 * evaluate_design(other, here).errors[3]
    # at little noise the scatter of fits of simulated runs is the predicted standard error of each parameter, within 3 %
    own = problem(noise=5e-4 * P.alpha_0)
    speeds = spaced_speeds(own, RUNS, "log")
    assert simulated_errors(own, speeds) == pytest.approx(evaluate_design(own, speeds).errors, rel=0.03)
    # ten times as many speeds to choose from lower the criterion by less than 1 %
    own, judged = problem(), velocities._Criterion(problem(), "all")
    usual = judged.value(design(own, RUNS).speeds)
    monkeypatch.setattr(velocities, "CANDIDATES", 10 * velocities.CANDIDATES)
    assert usual <= judged.value(design(own, RUNS).speeds) + 0.01


STEP = 0.01


def played(velocities: list[float], limits: Limits, deflection: float) -> list[PlannedRun]:
    """Each pass and the moves between, in order."""
    holds = [h for k, v in enumerate(velocities, 1) for h in reference.passes(v, k, deflection, limits)]
    found, at = [], sum(limits.position) / 2
    for where, hold in reference.ordered(holds, limits):
        found += [reference.played(reference.move_within(at, where, limits), STEP), reference.played(hold, STEP, where)]
        at = where + hold.travel
    return found


@settings(max_examples=25)
@given(
    speeds=st.lists(st.tuples(st.floats(0.05, 1.0), st.sampled_from([-1, 1])), min_size=1, max_size=6),
    low=st.floats(-3.0, 3.0),
    travel=st.floats(1.5, 6.0),
    acceleration=st.floats(3.0, 30.0),
    deflection=st.floats(1e-4, 0.01),
    hold=st.floats(0.3, 4.0),
)
def test_references_respect_every_limit(
    speeds: list[tuple[float, int]], low: float, travel: float, acceleration: float, deflection: float, hold: float
) -> None:
    """Positions, velocities and accelerations keep within their limits; position is the integral of velocity, and nowhere jumps."""
    limits = replace(LIMITS, position=(low, low + travel), velocity=1.0, acceleration=acceleration, hold=hold)
    found = played([v * sign for v, sign in speeds], limits, deflection)
    for r in found:
        assert limits.position[0] <= r.position.min() <= r.position.max() <= limits.position[1]
        assert np.abs(r.velocity).max() <= limits.velocity
        assert np.abs(np.diff(r.velocity)).max() <= limits.acceleration * STEP
        assert r.velocity[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-12)
        trapezoid = np.cumsum((r.velocity[1:] + r.velocity[:-1]) * STEP / 2)
        assert r.position[1:] - r.position[0] == pytest.approx(trapezoid, abs=limits.acceleration * STEP**2)
    assert all(abs(a.position[-1] - b.position[0]) <= 1e-9 for a, b in pairwise(found))


@settings(max_examples=25)
@given(speed=st.floats(0.02, 1.0), deflection=st.floats(1e-4, 0.01), hold=st.floats(0.5, 8.0))
def test_every_run_is_averaged_as_long_as_asked(speed: float, deflection: float, hold: float) -> None:
    """A run's passes add up to the averaging time, each at exactly its speed after a run-in of eight deflections and 0.6 s."""
    limits = replace(LIMITS, hold=hold)
    holds = reference.passes(-speed, 3, deflection, limits)
    assert sum(h.averaged for h in holds) == pytest.approx(hold)
    for h in holds:
        assert h.run_in * speed >= 8 * deflection * (1 - 1e-12)
        assert h.run_in >= 0.6
        r = reference.played(h, STEP)
        steady = np.flatnonzero(r.velocity == -speed)
        assert (np.diff(steady) == 1).all()
        assert (steady.size + 1) * STEP >= h.run_in + h.averaged
        assert r.position[-1] == pytest.approx(h.travel)
        assert r.run == 3


def test_motions_are_smooth_and_within_the_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between a velocity and the next the acceleration of a fine reference never jumps by more than a few percent of its peak."""
    hold = reference.passes(1.0, 1, 1e-3, replace(LIMITS, hold=0.5))[0]
    a = np.diff(reference.played(hold, 1e-4).velocity) / 1e-4
    assert np.abs(np.diff(a)).max() <= 0.01 * np.abs(a).max()
    # a speed at which nothing is left to average is refused in one sentence, and the fastest that is allowed leaves enough
    short = replace(LIMITS, position=(0.0, 0.3))
    with pytest.raises(ValueError, match=r"the travel of 0\.3 leaves"):
        reference.passes(1.0, 1, 1e-3, short)
    most = reference.fastest(1e-3, short)
    assert LIMITS.slowest < most < 1.0
    assert sum(h.averaged for h in reference.passes(most, 1, 1e-3, short)) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="too short for a hold"):
        reference.fastest(1e-3, replace(LIMITS, position=(0.0, 0.01)))
    # what a motion tells is J'J / noise**2 of friction through the bristle with the acceleration for the inertia, as the other route has it
    run = course(plain_lines(LIMITS), LIMITS, 2.0, 0.01)
    matrix, torque = information(run.velocity, run.acceleration, PROBLEM)
    other = gram(motion_jacobian(run.velocity, 0.01, PAIR, {"inertia": run.acceleration}), PROBLEM.noise)
    assert matrix == pytest.approx(other, rel=1e-9, abs=1e-9 * np.abs(other).max())
    assert torque > J * np.abs(run.acceleration).max() / 2
    found = evaluate_motion(plain_lines(LIMITS), replace(PROBLEM, duration=2.0))
    assert found.errors == pytest.approx(covariance(PROBLEM.prior_information + other)[0], rel=1e-6)
    # where it would take too much torque it is scaled down until it does not
    weak = replace(PROBLEM, limits=replace(LIMITS, torque=0.04))
    lines = plain_lines(LIMITS)
    assert evaluate_motion(lines, weak).torque > 0.04
    assert evaluate_motion(within_torque(lines, weak), weak).torque <= 0.04
    # its relative errors are smaller than those of a plain multisine, within the torque limit; the same each time; longer is better.
    # Planned for sigma_1 alone, its two errors are smaller than when planned for all
    monkeypatch.setattr(excitation, "TRIES", 10)
    monkeypatch.setattr(excitation, "STEPS", 60)
    calls: list[tuple[int, int]] = []
    found = best_motion(PROBLEM, lambda _, done, total: calls.append((done, total)))
    plain = evaluate_motion(within_torque(plain_lines(LIMITS), PROBLEM), PROBLEM)
    assert relative(found.errors) < 0.98 * relative(plain.errors)
    assert max(found.torque, plain.torque) <= LIMITS.torque
    assert found.errors.tolist() == best_motion(PROBLEM).errors.tolist()
    assert relative(evaluate_motion(found.lines, replace(PROBLEM, duration=8.0)).errors) < relative(found.errors)
    assert calls == [(k, 70) for k in range(70)]
    own = (5, 11)
    one = best_motion(replace(PROBLEM, aims=own))
    of_one, of_all = (relative(np.where(np.isin(range(13), own), x.errors, 0)) for x in (one, found))
    assert of_one < of_all


@pytest.mark.parametrize(("tag", "sign"), [("+", 1.0), ("-", -1.0)])
def test_loading_rises_to_its_peak_and_falls(tag: str, sign: float) -> None:
    """Torque begins and ends at zero, reaches the peak of its sign once a cycle, never beyond, and rises as slowly as planned."""
    plan = design_loading(Direction(tag), P, 0.0, 1e-4, 0.0)
    torque = sign * reference.played(reference.slow_loads(plan), STEP, run=7).torque
    assert torque[0] == torque[-1] == 0
    assert torque.min() >= 0
    assert torque.max() == pytest.approx(plan.peak, rel=1e-9)
    assert np.diff(torque).max() == pytest.approx(plan.peak * STEP / plan.rise)
    tops = (torque[1:-1] >= torque[:-2]) & (torque[1:-1] > torque[2:])
    assert tops.sum() == CYCLES


def test_loading_is_planned_for_the_error_that_it_has() -> None:
    """With g0 known, weighted straight lines through simulated count edges scatter by the error predicted for as many independent edges."""
    g0, edges, noise = P.alpha_0 + P.alpha_1, 40, 1e-4
    peak = 0.6 * g0
    reach = float(evaluate(functions.loading_displacement_function(), peak, g0, P.sigma_0)[0])
    predicted = loading._stiffness_error(P, peak, 0.0, noise, reach / edges, rise=0.1 * edges)
    y = reach * (np.arange(edges) + 0.5) / edges
    T = g0 * -np.expm1(-P.sigma_0 * y / g0)
    rng = np.random.default_rng(0)
    U = evaluate(functions.loading_displacement_function(), T + noise * rng.standard_normal((4000, edges)), g0, 1.0)[0]
    weight = 1 - T / g0
    slopes = np.polynomial.polynomial.polyfit(y, U.T, 1, w=weight)[1]
    assert slopes.mean() == pytest.approx(P.sigma_0, rel=0.02)
    assert predicted == pytest.approx(slopes.std(), rel=0.05)
    # half the noise is half the error where g0 is known; longer rises and finer encoders are no worse; an unsure g0 lowers the peak
    fine = P.alpha_0 / P.sigma_0 / 500
    known = design_loading(Direction.POSITIVE, P, 0.0, 1e-4, fine)
    scatter, viscous, _ = loading_errors(P, 0.0, 1e-4, fine, loading.RISES)
    halved = loading_errors(P, 0.0, 5e-5, fine, loading.RISES)[0]
    assert halved[np.isfinite(halved)] == pytest.approx(scatter[np.isfinite(scatter)] / 2)
    assert (np.diff(np.hypot(scatter, viscous * P.sigma_0), axis=0) <= 1e-9).all()
    assert known.error <= design_loading(Direction.POSITIVE, P, 0.0, 1e-4, 20 * fine).error
    unsure = design_loading(Direction.POSITIVE, P, 0.005 * P.alpha_0, 1e-4, fine)
    assert (unsure.share < known.share, unsure.error > known.error) == (True, True)
    reach = float(evaluate(functions.loading_displacement_function(), known.share * g0, g0, P.sigma_0)[0])
    assert (known.peak, known.counts) == pytest.approx((known.share * g0, reach / fine))
    assert design_loading(Direction.POSITIVE, P, 0.0, 1e-4, fine, share=0.5).rise == known.rise / 2
    # with hardly any noise the slowest rise is planned, its error is the viscous share; ten times the damping never makes the error smaller
    quiet = design_loading(Direction.POSITIVE, P, 0.0, 1e-9, 0.0)
    assert quiet.rise == loading.RISES[-1]
    assert quiet.error == pytest.approx(quiet.viscous_share * P.sigma_0, rel=1e-3)
    sets = (P, P._replace(sigma_1=10 * P.sigma_1))
    usual, damped = (design_loading(Direction.POSITIVE, p, 0.001 * P.alpha_0, 1e-4, 0.0) for p in sets)
    assert usual.error == pytest.approx(np.hypot(usual.noise_error, usual.viscous_share * P.sigma_0))
    assert (damped.error > usual.error, damped.share <= usual.share) == (True, True)
    # where the joint moves less than two counts below breakaway the error is infinite, and the peak the highest
    coarse = design_loading(Direction.NEGATIVE, P, 0.0, 1e-4, 1.1 * P.alpha_0 / P.sigma_0)
    assert (coarse.error, coarse.counts < 2, coarse.share) == (np.inf, True, loading.PEAKS[-1])


@pytest.mark.parametrize("share", [0.4, 0.6, 0.8])
@pytest.mark.parametrize("rise", [5.0, 25.0])
def test_what_loading_neglects_is_within_the_error_that_is_promised(rise: float, share: float) -> None:
    """sigma_0 of a simulated rise without noise is off by 0.4 to 1 times the viscous share, which is the promised error where there is no noise."""
    g0 = P.alpha_0 + P.alpha_1
    peak, time = share * g0, np.linspace(0.0, rise, 300)

    def speed(t: float, state: Array) -> tuple[float, float]:
        """dz/dt and velocity under the torque of time t, the bristle of (3) at no speed."""
        held = P.sigma_0 * state[0]
        v = (peak * t / rise - held) / (P.sigma_1 * (1 - held / g0) + P.alpha_2)
        return v * (1 - held / g0), v

    found = solve_ivp(speed, (0.0, rise), [0.0, 0.0], method="LSODA", t_eval=time, rtol=1e-9, atol=1e-13)
    T, x = peak * time[10:] / rise, found.y[1][10:]
    U = evaluate(functions.loading_displacement_function(), T, g0, 1.0)[0]
    slope = np.polynomial.polynomial.polyfit(x, U, 1, w=1 - T / g0)[1]
    row, column = loading.RISES.tolist().index(rise), int(np.abs(loading.PEAKS - share).argmin())
    promised = P.sigma_0 * loading_errors(P, 0.0, 1e-12, 0.0, loading.RISES)[1][row, column]
    assert 0.4 * promised < abs(slope - P.sigma_0) < promised


PAIR = TABLE_1["gripper rotation"]
J = inertia(PAIR)
VALUES = np.array([*PAIR.positive, *PAIR.negative, J])
PROBLEM = MotionProblem(
    sets=(PAIR,), inertias=(J,), prior_information=np.diag((0.05 * VALUES) ** -2), noise=4e-4, step=0.01,
    limits=LIMITS, duration=4.0, aims=tuple(range(13)),
)  # fmt: skip  # a list of values


def relative(errors: Array) -> float:
    return float(np.linalg.norm(errors / VALUES))


@settings(max_examples=15)
@given(
    st.lists(st.tuples(st.floats(1e-4, 5.0), st.floats(0.1, 8.0), st.floats(0.0, 6.3)), min_size=1, max_size=6),
    st.floats(1.5, 3.0),
)
def test_a_motion_stays_within_its_limits(sines: list[tuple[float, float, float]], duration: float) -> None:
    """Position, velocity and acceleration keep within their limits whatever is asked; it begins and ends at rest in the middle."""
    # scaled sines are not scaled again, keep frequencies and phases, and give the course of those asked for
    lines = Multisine(*np.array(sines).T)
    run = course(lines, LIMITS, duration, 0.01)
    assert LIMITS.position[0] <= run.position.min() <= run.position.max() <= LIMITS.position[1]
    assert np.abs(run.velocity).max() <= LIMITS.velocity
    assert np.abs(run.acceleration).max() <= LIMITS.acceleration
    assert run.position[[0, -1]] == pytest.approx(0.5)
    assert np.abs(run.velocity[[0, -1]]).max() <= 1e-9
    played = limited(lines, LIMITS, duration, 0.01)
    assert limited(played, LIMITS, duration, 0.01).amplitude == pytest.approx(played.amplitude, rel=1e-12)
    assert (played.frequency.tolist(), played.phase.tolist()) == (lines.frequency.tolist(), lines.phase.tolist())
    assert course(played, LIMITS, duration, 0.01).position == pytest.approx(run.position, abs=1e-12)
    wanted = evaluate_motion(lines, replace(PROBLEM, duration=duration)).lines
    assert wanted.amplitude == pytest.approx(played.amplitude)
