from collections.abc import Collection
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.signal import lfilter

import bristle
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment, find_segments
from bristle.data.differentiation import smoothed
from bristle.data.experiment.load import Run, load_experiment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation.multistart import MultistartSolution
from bristle.estimation.score_test import Fitted, explained
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.candidates import candidates
from bristle.identification.dynamic.descent import solve_dynamic
from bristle.identification.dynamic.problem import Unknown
from bristle.identification.fits import Estimate, StaticFit, TrackingFit
from bristle.identification.measured import Measured
from bristle.identification.moving_runs import loads_slowly, unrelated
from bristle.identification.point_checks import point_warnings
from bristle.identification.shared_findings import offset_or_friction
from bristle.identification.static.fit import refuse_opposing_points
from bristle.identification.static.points import points_problem
from bristle.identification.static.solution import solve_static
from bristle.model.parameters import Direction, Kind, Lugre, ParameterName
from bristle.simulation.bench import steady_points

from ..conftest import TRUTH, experiment, present, speeds
from ..names import named, parse
from .conftest import (
    GRIPPER,
    by_name,
    codes,
    experiment_file,
    fitted,
    holds,
    moved,
    points_file,
    posed,
    tones,
    value_of,
    white,
)

EMPTY = np.zeros(0)


def told(
    rest: Array,
    velocity: Array,
    time: Array = EMPTY,
    position: Array = EMPTY,
    parameters: Collection[str] = (),
    kind: Kind = "revolute",
    variance: float = 1e-6,
) -> list[Finding]:
    """What is said of residuals of a fit of Coulomb and viscous friction, (n,)."""
    known = np.stack([np.sign(velocity), velocity], axis=1)
    left = rest - known @ np.linalg.lstsq(known, rest)[0]
    fit = Fitted(known, left, np.full(2, variance), np.ones(2, dtype=bool), 1.0)
    return explained(fit, candidates(velocity, time, position, parameters, kind, 1)).findings


def test_what_is_planted_is_told_as_what_it_is() -> None:
    """A trend, a ripple or a term of the size of the noise is told, once and with the lines to write, and nothing else is."""
    rng = np.random.default_rng(3)
    noise, v, t, q = rng.normal(size=(4, 200))
    v, q = rng.uniform(0.0, 3.0, 200), 0.01 * q
    signals, ripple = (v, t, q, ["quadratic"]), np.sin(2 * np.pi * 7 * q / np.ptp(q))
    time, few = np.linspace(0, 20, 600), 0.3 * white(600, 1.0, 2)
    position, velocity = 2 * np.sin(time), 2 * np.cos(time)
    swing = (velocity, time, position, ["inertia"])
    turn, slow = np.linspace(0, 2 * np.pi, 800), np.full(800, 0.5)
    wave, both = np.sin(11 * turn) + 0.1 * white(800, 1.0, 5), ["inertia", "cogging_sin_4", "cogging_cos_4"]
    x = np.linspace(0, 1, 30)
    cases: list[tuple[Array, tuple[Any, ...], str, str]] = [
        (noise + 1.2 * (2 * v**2 - 6 * v), signals, "residual-trend", "vs velocity (p ="),
        (noise + 1.2 * t, signals, "residual-trend", "vs time (p ="),
        (noise + 1.2 * ripple, signals, "residual-ripple", "A ripple vs position of period"),
        # gravity over most of a turn, and drag
        (few + np.sin(position), swing, "lacks-a-term", "regressors: [inertia, gravity]"),
        (few + velocity * np.abs(velocity), swing, "lacks-a-term", "regressors: [inertia, quadratic]"),
        (few, swing, "", ""),
        # the order nearest to the period, beside those that were fitted
        (
            wave,
            (slow, EMPTY, turn, both),
            "residual-ripple",
            "write regressors: [inertia, cogging], orders: [4, 11] under fit",
        ),
        (wave, (slow, EMPTY, turn, ["cogging_sin_11", "cogging_cos_11"]), "residual-ripple", "is left (p = "),
        # axes that are empty, or constant, and residuals that are all zero, or fewer than eight
        (x, (np.ones(30),), "", ""),
        (x, (np.ones(30), np.ones(30), np.ones(30)), "", ""),
        (np.zeros(30), (x, x, x), "", ""),
        (x[:7], (x[:7], x[:7], x[:7]), "", ""),
    ]
    found = [(told(rest, *given), code, words) for rest, given, code, words in cases]
    assert [
        row for row in found if codes(row[0]) != [row[1]] * bool(row[1]) or row[2] not in str([*map(str, row[0])])
    ] == []
    assert "orders" not in str(found[7][0][0])


def test_what_is_planted_is_told_with_its_size() -> None:
    """Friction that falls by 1 from the beginning to the end, in both directions, is no trend of the torque, and is told as what it is."""
    rng, time = np.random.default_rng(4), np.linspace(0, 60, 200)
    velocity = rng.permutation(np.linspace(-1, 1, 200))
    (said,) = told(0.2 * rng.standard_normal(200) + np.sign(velocity) * (0.5 - time / 60), velocity, time)
    assert said.code == "friction-drifts"
    assert said.numbers["change"] == pytest.approx(-1, abs=0.15)
    assert said.effect["torque"] == -said.numbers["change"]
    # what a symmetric curve leaves of friction that is not - a constant, or a slope over speed - is told; what is odd in velocity is not
    rng = np.random.default_rng(6)
    velocity, noise = rng.uniform(-1, 1, 200), rng.normal(size=200)
    for even in (np.ones(200), np.abs(velocity)):
        assert "directions-differ" in codes(told(noise + even, velocity, parameters=["quadratic"]))
    assert not told(noise + velocity, velocity)
    # friction that grows with the position, or has a period, is no torque of the position
    position, velocity = np.sin(np.arange(2000) / 50), np.cos(np.arange(2000) / 50)
    sign, noise = np.sign(velocity), white(2000, 0.05, 8)
    for shape, words in ((position, "with the position, by about"), (np.cos(6 * np.pi * position), "a period of 0.33")):
        (said,) = told(noise + 0.2 * sign * shape, velocity, np.arange(2000.0), position)
        assert (said.code, said.numbers["share"] > 0.8) == ("friction-by-position", True)
        assert words in str(said)
        assert 0.1 < said.effect["torque"] < 0.2
    # a ripple of 5 % of friction, far above the noise, moves friction hardly; a direction that differs so does
    position = np.linspace(0, 40, 4000)
    velocity = np.where(np.arange(4000) % 400 < 200, 1.0, -1.0) * (1 + 0.3 * np.sin(position))
    shapes = 0.05 * np.sin(2 * np.pi * 8 * position / 40), np.full(4000, 0.05)
    said_of = [told(white(4000, 1e-3, 7) + x, velocity, EMPTY, position, variance=0.1)[0] for x in shapes]
    assert [(x.code, x.severity) for x in said_of] == [("residual-ripple", NOTE), ("directions-differ", CAUTION)]


@pytest.mark.slow
def test_little_is_said_where_nothing_is_wrong(tmp_path: Path) -> None:
    """White and correlated residuals without a trend give a warning in no more than 3 % of cases, as the 1 % of the correction promises."""
    rng = np.random.default_rng(4)
    time = np.linspace(0, 1, 400)
    white = rng.normal(size=(200, 400))
    cases = [*white[:100], *lfilter([1.0], [1.0, -0.7], white[100:])]
    said = [bool(told(x, rng.uniform(-1, 1, 400), time, rng.uniform(0, 1, 400))) for x in cases]
    assert np.mean(said) <= 0.03
    # of a hundred clean runs in the order of speed at most three have a warning of drift
    assert sum(bool(drifts(tmp_path, ramps(seed, SPEEDS, 0.0))) for seed in range(100)) <= 3
    # of 300 clean sets at most two are warned of an offset, and none where the viscous friction differs
    assert sum(bool(directions(seed, 0.0)) for seed in range(300)) <= 2
    other = TRUTH._replace(alpha_2=1.3 * TRUTH.alpha_2, alpha_0=0.8 * TRUTH.alpha_0)
    assert not any(directions(seed, 0.0, other) for seed in range(20))


SIGMA_0 = parse("sigma_0")


def run(step: float, p: Lugre[float] = GRIPPER, changed: Lugre[float] | None = None, forward: bool = False) -> Record:
    """Sixteen seconds of five tones, sampled this often from a simulation at 2 kHz; from the middle on with another joint, if given."""
    v = tones(np.arange(0, 16, 5e-4))
    v = np.abs(v) + 0.05 if forward else v
    whole, half = moved(v, 5e-4, p, 1e-4, seed=3), v.size // 2
    torque = present(whole.torque).copy()
    if changed is not None:
        torque[half:] = present(moved(v, 5e-4, changed, 1e-4, seed=3).torque)[half:]
    every = slice(None, None, round(step / 5e-4))
    signals = {n: getattr(whole, n)[every] for n in ("time", "velocity", "acceleration")}
    return replace(whole, torque=torque[every], **signals)


@cache
def resolved(count: float = 0.0) -> TrackingFit:
    """The fit of a run at 2 kHz through slow reversals, behind counts of that size."""
    return fitted(replace(posed(run(5e-4)), count=count))


def reasons(fit: TrackingFit, name: str) -> set[str]:
    """Why a parameter has no value; empty where it has one."""
    estimate = fit.parameters[parse(name)]
    return set() if estimate.value is not None else set(codes(estimate.warnings))


def test_a_bristle_that_the_motion_resolves_is_claimed(monkeypatch: pytest.MonkeyPatch) -> None:
    """At 2 kHz, through slow reversals, sigma_0 and sigma_1 have values whose intervals hold the truth."""
    for name in ("sigma_0", "sigma_1"):
        estimate = resolved().parameters[parse(name)]
        assert estimate.value is not None
        assert holds(estimate.interval, getattr(GRIPPER, name))
    # a count between g0 over the upper end of sigma_0's interval and g0 over sigma_0 hides the bristle; one below both does not
    fit = resolved()
    value, (_, high) = value_of(fit.parameters[SIGMA_0]), present(fit.parameters[SIGMA_0].interval)
    g0 = sum(fit.parameters[parse(name)].value or 0.0 for name in ("alpha_0", "alpha_1"))
    assert "unseen-below-count" in reasons(resolved(g0 / np.sqrt(value * high)), "sigma_0")
    assert not reasons(resolved(0.9 * g0 / high), "sigma_0")
    # a peak that is held at none is no parameter; one that is asked for by hand stays, however unsure
    problem = posed(run(1e-3, GRIPPER._replace(alpha_1=0.0)))
    auto, asked = (fitted(replace(problem, stribeck=model)).parameters for model in ("auto", "stribeck"))
    assert auto[parse("alpha_1")].value is None
    assert asked[parse("alpha_1")].value is not None
    assert asked[parse("v_s")].value is not None

    # it is said of the fit, and no parameter has a value, an error or an interval, a peak that is asked for among them
    def unfinished(*given: object, **options: object) -> MultistartSolution[Unknown]:
        solution: MultistartSolution[Unknown] = solve_dynamic(*given, **options)  # type: ignore[arg-type]
        return solution._replace(minimum=solution.minimum._replace(converged=False))

    monkeypatch.setattr("bristle.identification.dynamic.fit.solve_dynamic", unfinished)
    fit = fitted(replace(posed(run(1e-3)), stribeck="stribeck"))
    assert fit.outcome.code == "not-converged"
    assert {(e.value, e.standard_error, e.interval) for e in fit.parameters.values()} == {(None, None, None)}


@pytest.mark.parametrize("why", ["unseen-fast", "unseen-below-count", "unseen-no-reversal", "unseen-halves"])
def test_a_bristle_that_the_motion_does_not_resolve_has_no_value(why: str) -> None:
    """Passed too fast, below an encoder count, without a reversal, or changing over the record, sigma_0 is not identifiable, for that reason."""
    # nor is sigma_1
    if why == "unseen-below-count":
        made = resolved(0.01)
    elif why == "unseen-fast":
        made = fitted(posed(run(1e-2, GRIPPER._replace(sigma_0=400.0, sigma_1=0.1))))
    elif why == "unseen-no-reversal":
        made = fitted(posed(run(5e-4, forward=True)))
    else:
        made = fitted(posed(run(5e-4, changed=GRIPPER._replace(sigma_0=12.0))))
    assert why in reasons(made, "sigma_0")
    assert reasons(made, "sigma_1")
    assert [made.parameters[parse(name)].interval for name in ("sigma_0", "sigma_1")] == [None, None]
    assert made.parameters[parse("alpha_0")].value is not None


@pytest.mark.parametrize("alpha_1", [0.0, GRIPPER.alpha_1])
def test_a_peak_that_is_left_out_is_taken_up(alpha_1: float) -> None:
    """Where a peak is there and left out by hand, alpha_2, which it moves by more than its error, says so; without a peak nothing does."""
    fixed = named({"alpha_1": 0.0, "v_s": 1.0})
    problem = replace(posed(run(1e-3, GRIPPER._replace(alpha_1=alpha_1))), fixed=fixed)
    fit = fitted(problem, {name: value for name, value in by_name(GRIPPER).items() if name not in fixed})
    said = {n.name for n, e in fit.parameters.items() if "takes-up-peak" in codes(e.warnings)}
    assert ("alpha_2" in said) == bool(said) == bool(alpha_1)
    assert said <= {"alpha_0", "alpha_2"}


SPEEDS = np.geomspace(0.1, 1.0, 10) * TRUTH.v_s * 10
NOISE = 3e-4
HELD = 300  # samples of a hold


def measured(folder: Path, runs: tuple[Run, ...], segments: tuple[tuple[Segment, ...], ...]) -> Measured:
    (folder / "wrist.yaml").write_text(experiment(), encoding="utf-8")
    return Measured(experiment=load_experiment(folder / "wrist.yaml"), runs=runs, segments=segments)


def fits(rms: float) -> dict[str, StaticFit]:
    alpha_0 = Estimate(value=TRUTH.alpha_0, unit="N*m")
    return {
        d: StaticFit(
            direction=d, parameters={"alpha_0": alpha_0}, rms=rms, relative_error=1.0, n=10, outcome=Finding("static-converged", NOTE, "Converged.")
        )
        for d in "+-"
    }  # fmt: skip  # a list of values


def ramps(seed: int, order: Array, drift: float) -> Record:
    """Three seconds at each speed, in this order and then backward again, with a torque that changes by a share of itself from first to last."""
    rng = np.random.default_rng(seed)
    v = np.repeat(np.concatenate([order, -order]), HELD)
    time = np.arange(v.size) / (HELD / 3)
    (torque,) = steady_points(TRUTH, v, NOISE, rng, 1)
    torque *= 1 + drift * time / time[-1]
    return Record(file="ramps.csv", time=time, velocity=v + 1e-3 * rng.standard_normal(v.size), torque=torque)


def drifts(folder: Path, record: Record) -> list[Finding]:
    """The warnings about the segments of a run taken together."""
    segments = find_segments(record, measured(folder, (), ()).experiment.segments)
    kept = [s for s in segments if s.accepted]
    runs = (Run(kind="ramp", record=record),)
    return list(point_warnings(measured(folder, runs, (segments,)), kept, fits(NOISE / np.sqrt(HELD))))


@pytest.mark.parametrize("drift", [-0.1, 0.3])
def test_a_drift_in_the_order_of_speed_is_said(tmp_path: Path, drift: float) -> None:
    """Runs that go from slow to fast, or back, while the torque drifts: with the drift's sign and size."""
    # speeds in random order cannot be mistaken for one
    for seed in range(5):
        for order, way in ((SPEEDS, "rises"), (SPEEDS[::-1], "falls")):
            (found,) = drifts(tmp_path, ramps(seed, order, drift))
            assert found.numbers["way"] == way
            assert np.sign(found.numbers["slope"]) == np.sign(drift)
            assert found.numbers["share"] == pytest.approx(abs(drift), rel=0.5)
        assert not drifts(tmp_path, ramps(seed, np.random.default_rng(seed).permutation(SPEEDS), drift))


def as_points(v: Array, T: Array) -> tuple[Segment, ...]:
    """Given points, a row each, of velocities, rad/s, and torques, N*m."""
    return tuple(
        Segment(file="p.csv", start=k, stop=k + 1, velocity=x, torque=t, standard_error=None, accepted=True)
        for k, (x, t) in enumerate(zip(v.tolist(), T.tolist(), strict=True))
    )


def test_holds_over_a_turn_carry_their_gravity(tmp_path: Path) -> None:
    """Holds that pass most of a turn: friction and gravity come back with the means of sin and cos, not with those of the middle."""
    rate, K = 200, 0.15 * TRUTH.alpha_0
    v = np.concatenate([np.full(int(min(4.0 / s, 20) * rate), x) for s in (0.05, *SPEEDS) for x in (s, -s)])
    time, q = np.arange(v.size) / rate, np.cumsum(v) / rate
    torque = steady_points(TRUTH, v, 0.05 * TRUTH.alpha_0, np.random.default_rng(0), 1)[0] + K * np.sin(q)
    columns = {"t": time, "q": q, "T": torque}
    path = experiment_file(tmp_path, columns, "ramp", "directions: symmetric, regressors: [gravity]")
    found = bristle.identify(path).joints[0].static["both"].parameters
    for name in ("alpha_0", "alpha_1", "alpha_2", "v_s"):
        assert found[name].value == pytest.approx(getattr(TRUTH, name), rel=0.03)
    assert found["gravity_sin"].value == pytest.approx(K, rel=0.03)


def directions(seed: int, offset: float, negative: Lugre[float] = TRUTH) -> list[Finding]:
    """What is said of points in both directions with an offset, or with another friction backward."""
    rng, v = np.random.default_rng(seed), speeds(both=False)
    names, values, parts = list[ParameterName](), dict[ParameterName, float](), []
    for p, sign, side in ((TRUTH, 1, Direction.POSITIVE), (negative, -1, Direction.NEGATIVE)):
        (torque,) = steady_points(p, sign * v, 1e-4, rng, 1)
        core = solve_static(points_problem(as_points(sign * v, torque + offset), (side,), ()), FitOptions(), "revolute")
        names += core.names
        values |= dict(zip(core.problem.names, core.solution.theta.tolist(), strict=True))
        parts.append(core)
    return offset_or_friction(names, values, block_diag(*(x.covariance for x in parts)), parts[0].freedom)


@pytest.mark.parametrize("offset", [-5e-4, 5e-3])
def test_a_constant_between_the_directions_is_an_offset_or_friction(offset: float) -> None:
    """An offset, or as much difference in alpha_0 alone, is one sentence that gives both readings; the same for either cause."""
    for seed in range(5):
        other = TRUTH._replace(alpha_0=TRUTH.alpha_0 - 2 * offset)
        for found in (directions(seed, offset), directions(seed, 0.0, other)):
            (said,) = found
            assert said.code == "offset-or-friction"
            assert said.numbers["offset"] == pytest.approx(offset, abs=1e-4)
            assert "offset among the regressors" in str(said)
            assert "cannot tell" in str(said)


# a torque that is none


def test_noise_is_told_from_a_torque_and_from_a_wrong_sign(tmp_path: Path) -> None:
    """Noise, white or through a low pass, has nothing to do with a motion in at least 95 of 100 records; friction ten times below it has."""
    for level in (0.01, 10.0):
        t = np.arange(5000) / 500
        v = np.sin(2 * np.pi * 0.5 * t) + 0.4 * np.sin(2 * np.pi * 1.3 * t)
        others = np.column_stack([np.gradient(v, t), np.sin(v), np.cos(v)])
        missed = 0
        for seed in range(100):
            noise = level * np.random.default_rng(seed).standard_normal(t.size + 7)
            torque = noise[7:] if seed % 2 else np.convolve(noise, np.ones(8) / 8, "valid")
            missed += not unrelated(v, torque + 0.1 * level, others)
            assert not unrelated(v, noise[7:] + 0.1 * level * np.sign(v), others)
        assert missed <= 5
    # cycles of a slow torque, noisy too, are commanded, however little the position follows; noise is not
    for reach in (0.8, 1.1, 1.3):
        t, rng = np.arange(20_000) / 500, np.random.default_rng(8)
        cycle = reach * np.interp(t % 20, [0, 5, 15, 20], [0, 1, -1, 0]) + 0.05 * rng.standard_normal(t.size)
        noise = rng.standard_normal(t.size)
        slow = smoothed(Record(file="a", time=t), noise, 1.5)
        said = [loads_slowly(Record(file="a", time=t, torque=x, cutoff=2.0)) for x in (cycle, noise, slow)]
        assert said == [True, False, False]
    # points that oppose the motion about an offset are refused; gravity may drive
    (tmp_path / "wrist.yaml").write_text(experiment(), encoding="utf-8")
    own = load_experiment(tmp_path / "wrist.yaml")
    v, rng = speeds(both=False), np.random.default_rng(1)
    (friction,) = steady_points(TRUTH, v, 1e-3, rng, 1)
    both = np.concatenate([v, -v])
    for way in (1.0, -1.0):
        points = as_points(both, way * np.concatenate([friction, -friction]) + 0.1)
        refuse_opposing_points(own, points, ("gravity",))
        if way < 0:
            with pytest.raises(InputError, match="scale: -1"):
                refuse_opposing_points(own, points, ("offset",))
        else:
            refuse_opposing_points(own, points, ("offset",))
    # a velocity in deg/s read as rad/s in a moving run is the first warning of the joint, and critical
    (joint,) = bristle.identify(logged(tmp_path, 180 / np.pi)).joints
    first = joint.warnings[0]
    assert first.code == "velocity-factor"
    assert first.numbers["ratio"] == pytest.approx(np.pi / 180, rel=0.02)
    assert "`unit: deg/s` under signals.velocity" in str(first)


def test_torques_of_noise_and_of_nothing_and_wrong_signs(tmp_path: Path) -> None:
    """Moving and slow runs alike: the sentence says noise, and not which sign to give."""
    for kind in ("tracking", "presliding"):
        for level in (1e-3, 1.0):
            t = np.arange(4000) / 500
            path = experiment_file(tmp_path, {"t": t, "q": 0.01 * np.sin(1.5 * t), "T": white(t.size, level, 4)}, kind)
            with pytest.raises(InputError, match=r"nothing to do with the motion .* is noise of") as caught:
                bristle.identify(path)
            assert "scale" not in str(caught.value)
    # where the torque goes with the position and the velocity against it, the sign of the velocity is what is asked for
    for factor in (-1.0, -60.0):
        with pytest.raises(InputError, match=r"log\.csv moves -.* opposite sign of `scale` under signals\.velocity"):
            bristle.identify(logged(tmp_path, factor))
    # points of no torque, or of one whose square is none, a stray apart, are fitted, and no offset is told
    for level in (0.0, 1e-162):
        speeds = np.geomspace(0.01, 1.0, 12)
        v = np.concatenate([speeds, -speeds])
        (joint,) = bristle.identify(points_file(tmp_path, v, np.sign(v) * level + (np.arange(24) == 5))).joints
        assert joint.static["+"].strays
        assert "offset-or-friction" not in codes(joint.warnings)


def logged(folder: Path, factor: float) -> Path:
    """An experiment of one moving run whose velocity is logged times a factor."""
    t = np.arange(4000) / 500
    q = 0.4 * np.sin(2 * np.pi * 0.4 * t) + 0.1 * np.sin(2 * np.pi * 1.1 * t)
    v = np.gradient(q, t)
    (friction,) = steady_points(TRUTH, v, 1e-4, np.random.default_rng(0), 1)
    columns = {"t": t, "q": q, "v": factor * v, "T": friction + 1e-3 * np.gradient(v, t)}
    return experiment_file(folder, columns, fit="directions: symmetric")
