import atexit
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any

import casadi as ca
import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.control.running import RunningCompensator
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import load_experiment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.identification.dynamic.claims import jacobian_and_residuals
from bristle.identification.dynamic.descent import solve_dynamic
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.dynamic.residual_analysis import columns_of
from bristle.identification.fits import Estimate, TrackingFit
from bristle.identification.known_joint import without_load
from bristle.identification.measured import measure, with_loads
from bristle.identification.moving_runs import load_columns, with_orders
from bristle.identification.periods import shown_orders
from bristle.identification.repeats import clustered
from bristle.identification.results import Joint
from bristle.identification.static.fit import estimate_static
from bristle.identification.static.points import points_problem
from bristle.identification.static.problem import from_records
from bristle.model import law
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.registry import LOADS, apart, law_named
from bristle.model.parameters import Direction, Lugre, Pair, ParameterName, of_load, unit
from bristle.model.parameters import Kind as JointKind
from bristle.model.rollout import rollout, rollout_into
from bristle.questions.compensation.replay import replays
from bristle.questions.joint_report.brief import brief_report
from bristle.questions.joint_report.report import full_text
from bristle.simulation.joint_loop import Carried, of_experiment

from ..conftest import present
from .conftest import curve, experiment_file, holds, way, white

P = Lugre(0.25, 0.08, 0.4, 0.05, 400.0, 1.0)
J, G, STEP = 0.08, 6.0, 0.004
LINK_LOAD = ParameterName("link_load", Direction.SHARED)
TIME = np.arange(0, 4, 1e-3)
VELOCITY = 0.3 * np.sin(3 * TIME) + 0.1 * np.sin(11 * TIME)
RISES = np.array([0.1 * np.abs(np.sin(2 * TIME)), 0.2 * (1 + np.cos(5 * TIME))])
EXACT = (0.0,) * 4  # A supply that errs in none of the logs
SETS = [P, Pair(P, P._replace(alpha_0=0.3))]


@pytest.mark.parametrize("p", SETS)
def test_levels_are_friction_and_differentiated(p: Lugre[float] | Pair[float]) -> None:
    """A level of 0.01 throughout is an alpha_0 that is 0.01 larger, exactly; dT/dc of a level c . L is that of central differences."""
    more = [one._replace(alpha_0=one.alpha_0 + 0.01) for one in ([p] if isinstance(p, Lugre) else p)]
    shifted = more[0] if len(more) == 1 else Pair(*more)
    level = np.full(VELOCITY.size, 0.01)
    assert np.array_equal(rollout(VELOCITY, 1e-3, p, level=level).torque, rollout(VELOCITY, 1e-3, shifted).torque)
    # of two different sets to 1e-4: where z changes sign within a step is not differentiated
    near, c = 1e-8 if isinstance(p, Lugre) else 1e-4, np.array([0.05, 0.03])
    count = 6 if isinstance(p, Lugre) else 12
    for z0 in (None, 1e-4):
        rows = [np.empty(VELOCITY.size) for _ in range(count + 3)]
        rollout_into(rows, VELOCITY, 1e-3, p, z0, level=np.vstack([c @ RISES, RISES]))
        for k, step in enumerate(1e-6 * np.eye(2)):
            up, down = (rollout(VELOCITY, 1e-3, p, z0, level=x @ RISES).torque for x in (c + step, c - step))
            assert rows[count + k] == pytest.approx((up - down) / 2e-6, abs=near * np.abs((up - down) / 2e-6).max())


def geared_file(law: str, rises: float = 0.1, supply: tuple[float, ...] = EXACT) -> Path:
    """The experiment of a weight swung about four angles, a log each, with friction that rises with gravity's torque."""
    folder = Path(mkdtemp(prefix="bristle-geared-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    rng = np.random.default_rng(1)
    t, w, size = np.arange(0, 8, STEP), 2 * np.pi * np.array([[0.25], [0.7]]), np.array([[0.35], [0.12]])
    for k, (angle, off) in enumerate(zip((0.15, 0.5, 0.9, 1.3), supply, strict=True)):
        x = w * t + rng.uniform(0, 2 * np.pi, (2, 1))
        q, v, a = angle + (size * np.sin(x)).sum(0), (size * w * np.cos(x)).sum(0), -(size * w**2 * np.sin(x)).sum(0)
        T = rollout(v, STEP, P, level=rises * np.abs(G * np.sin(q))).torque + J * a + G * np.sin(q)
        T = (1 + off) * T + 0.02 * rng.standard_normal(t.size)
        fit = f"directions: symmetric, regressors: [inertia, gravity]{law and f', law: {law}'}"
        file = experiment_file(folder, {"t": t, "q": q, "v": v, "T": T}, fit=fit, file=str(k))
    file.write_text(file.read_text().replace("files: 3.csv", "files: [0.csv, 1.csv, 2.csv, 3.csv]"))
    return file


@cache
def geared(law: str, rises: float, supply: tuple[float, ...]) -> tuple[Path, Joint]:
    file = geared_file(law, rises, supply)
    return file, bristle.identify(file).joint()


def tracked(law: str, rises: float = 0.1, supply: tuple[float, ...] = EXACT) -> TrackingFit:
    return present(geared(law, rises, supply)[1].tracking)


@pytest.mark.slow
def test_ten_percent_of_the_load_is_recovered() -> None:
    """0.100 within 0.005, and within its interval, with a supply that errs by 2 % in each log too."""
    for supply in (EXACT, (0.02, -0.02, 0.015, -0.01)):
        fit = tracked("paper+link-load", supply=supply)
        assert geared("paper+link-load", 0.1, supply)[1].settings["law"].startswith("gaussian+link-load: Gaussian peak")
        assert fit.parameters[LINK_LOAD].value == pytest.approx(0.1, abs=0.005)
        assert holds(fit.parameters[LINK_LOAD].interval, 0.1)
        assert fit.load.size == fit.friction.size == fit.n


@pytest.mark.slow
def test_the_data_choose_the_load_that_is_there_and_none_that_is_not() -> None:
    """`auto` takes link-load where friction rises with gravity's torque; without a load it keeps the paper's law."""
    # without a word of a law friction gets the same; `law: paper` overrules, and a caution has the line to write
    loaded, bare = (geared("auto", rises, EXACT)[1].laws for rises in (0.1, 0.0))
    assert loaded is not None
    assert bare is not None
    assert (loaded.chosen.name, bare.chosen.name) == ("gaussian+link-load", "gaussian")
    assert {f"gaussian+{name}" for name in LOADS} <= {row.name for row in bare.rows}
    assert LINK_LOAD in tracked("auto").parameters
    for name, rises, found in (
        ("", 0.1, {"link_load": pytest.approx(0.1, abs=0.005)}),
        ("", 0.0, {}),
        ("paper", 0.1, {}),
    ):
        own = tracked(name, rises).parameters
        assert {n.name: e.value for n, e in own.items() if of_load(n.name)} == found
    (told,) = (w for w in tracked("paper").warnings if w.code == "friction-by-load")
    assert "law: gaussian+link-load" in str(told)


def test_names_of_loads_and_who_tells_them() -> None:
    """A load stands last in a law's name, beside any law, one at most; it is no part of the curve."""
    for name in LOADS:
        assert apart(f"lorentzian+quadratic+{name}") == ("lorentzian+quadratic", (name,))
        asked = FitOptions(law=f"paper+{name}")
        assert (asked.friction, asked.load) == (GAUSSIAN, (name,))
    assert FitOptions(law="paper+quadratic").friction == FitOptions(law="gaussian+quadratic").friction
    assert FitOptions(law="paper+quadratic+gear-load").load == ("gear-load",)
    for wrong in ("link-load", "gaussian+link-load+gear-load", "gaussian+heavy-load", "auto+link-load"):
        with pytest.raises(ValueError, match="expected"):
            FitOptions(law=wrong)
    with pytest.raises(KeyError):  # what a results file or an export holds is a curve
        law_named("gaussian+gear-load")
    # points alone cannot be fitted with a load: one sentence, not a fit without it
    v = np.geomspace(0.05, 1, 20)
    with pytest.raises(InputError, match="gear-load needs a tracking run"):
        bristle.fit(v, 0.1 + 0.05 * v + 1e-4 * np.sin(1e4 * v), law="paper+gear-load")
    # without gravity among the regressors nobody knows what the links bring: one sentence
    file = geared_file("paper+gear-load")
    file.write_text(file.read_text().replace("[inertia, gravity]", "[inertia]"))
    with pytest.raises(InputError, match="gear-load needs what gravity does"):
        bristle.identify(file)
    # of a mean over k runs with an offset each, the clustered error is the offsets' scatter over the root of k
    rng, offsets = np.random.default_rng(0), np.array([0.3, -0.1, 0.2, -0.4])
    noise = 1e-3 * rng.standard_normal((4, 500))
    x = offsets[:, None] + noise
    left = x - x.mean()
    parts = {str(k): (np.ones((500, 1)), row) for k, row in enumerate(left)}
    own = float(np.std(left) / np.sqrt(left.size))
    e = Estimate(value=float(x.mean()), unit="1", standard_error=own, interval=(-1.0, 1.0))
    found = clustered(["m"], parts, {"m": e}, 1999.0)["m"]
    assert found.widened * own == pytest.approx(np.std(x.mean(axis=1), ddof=1) / 2, rel=1e-9)
    assert list(found.by_run.values()) == pytest.approx(x.mean(axis=1).tolist())
    # with (motor, links) the torque in sliding rises by coefficient times load; a load that is no number is refused
    pair = Pair(P, P)
    run = RunningCompensator(Compensator(name="stribeck"), pair, rises={"gear_load": 0.1})
    bare, loaded = run.step(1e-3, (0.0, 0.3), 0.0), run.step(1e-3, (0.0, 0.3), 0.0, load=(3.0, -2.0))
    assert loaded - bare == pytest.approx(0.1 * 5.0, rel=1e-12)
    with pytest.raises(InputError, match="has no coefficients of a load"):
        RunningCompensator(Compensator(), pair).step(1e-3, (0.0, 0.3), 0.0, load=(3.0, -2.0))
    with pytest.raises(InputError, match="got gear; expected coefficients among link_load"):
        RunningCompensator(Compensator(), pair, rises={"gear": 0.1})
    with pytest.raises(InputError, match="expected the torques of motor and links"):
        run.step(1e-3, (0.0, 0.3), 0.0, load=(np.nan, 0.0))


def test_rows_with_the_drive_off_are_left_out(tmp_path: Path) -> None:
    """Where `enabled` is 0 the rows are gone, a note counts them, and what is before and after are segments apart."""
    t = np.arange(0, 10, 0.01)
    q, on = np.sin(t), ((t < 4) | (t > 4.03)).astype(int)
    T = 0.1 * np.sign(np.cos(t)) + 0.02 * np.cos(t)
    path = experiment_file(tmp_path, {"t": t, "q": q, "T": T, "driven": on})
    (run,) = measure(path).runs
    off = int((on == 0).sum())
    assert run.record.dropped == off
    assert run.record.starts == (0, int(np.flatnonzero(on == 0)[0]))
    (told,) = (n for n in run.record.notes if n.code == "rows-motor-off")
    assert told.numbers["rows"] == off
    # a flag without a column, or of a drive that was never on: one sentence
    t = np.array([0.0, 0.1, 0.2])
    path = experiment_file(tmp_path, {"t": t, "q": 2 * t, "T": t + 1, "driven": 0 * t})
    with pytest.raises(InputError, match="enabled is 0 in all 3 rows"):
        measure(path)
    path.write_text(path.read_text().replace("enabled: driven", "enabled: nothing"))
    with pytest.raises(InputError, match="no column named 'nothing'"):
        measure(path)


@pytest.mark.slow
def test_compensation_sees_the_load() -> None:
    """Along a reference the level is what gravity there raises it by, in model and plant; a replay with it leaves the noise alone."""
    # without it the replay leaves four times as much; adaptation gains the joint nothing beyond the load
    file, found = geared("paper+link-load", 0.1, EXACT)
    measured = measure(file)
    loop = of_experiment(measured.experiment, found)
    reference = loop.sine(0.5, 2.0, amplitude=0.5)
    assert reference.level == pytest.approx(0.1 * np.abs(G * np.sin(reference.position)), abs=0.01)
    there = replace(loop, centre=1.2).sine(0.5, 2.0, amplitude=0.5)
    assert there.level == pytest.approx(0.1 * np.abs(G * np.sin(1.2 + reference.position)), abs=0.01)
    assert any(w.code == "load-of-reference" for w in loop.assumptions)
    assert not any(w.code == "load-left-out" for w in loop.assumptions)
    options = LoopOptions(compensator=loop.compensator)
    run, bare = (simulate(options, [loop.case()], r, loop.period) for r in (reference, reference._replace(level=0.0)))
    assert np.ptp(run.friction) > np.ptp(bare.friction) + 0.1
    assert run.rms_error()[0] == pytest.approx(bare.rms_error()[0], rel=0.2)
    first = replays(loop, found, measured)[0]
    left = float(np.std((first.measured - first.fixed)[200:]))
    bare_torque = rollout(present(measured.runs[0].record.velocity), STEP, loop.model, 0.0).torque
    unloaded = float(np.std((first.measured - bare_torque)[200:]))
    assert left < 1.5 * 0.02
    assert unloaded > 2 * left
    # a level that rises with the motor's torque, friction included, is the one at which both agree; at a coefficient of 1 there is none
    file, fitted = geared("paper+link-load", 0.1, EXACT)
    loop = of_experiment(measure(file).experiment, fitted)
    loaded = replace(loop, carried=Carried({"gear_load": 0.2}, {"gravity_sin": G}))
    r = loaded.sine(0.5, 2.0)
    sets = [loop.model.positive if v > 0 else loop.model.negative for v in r.velocity]
    each = zip(r.velocity, sets, r.level, strict=True)
    T = np.array([float(ca.DM(law.steady_torque(v, law.loaded(p, x)))) for v, p, x in each])
    assert r.level == pytest.approx(0.2 * np.abs(loop.J * r.acceleration + 2 * G * np.sin(r.position) + T), rel=1e-7)
    with pytest.raises(InputError, match="no torque moves the joint"):
        replace(loop, carried=Carried({"gear_load": 1.0}, {"gravity_sin": G})).sine(0.5, 2.0)


@pytest.fixture(scope="module")
def embedded(edro_results: Path) -> tuple[Joint, Joint]:
    """A joint of the embedded report, and one like it whose friction rises with load by a tenth."""
    plain = bristle.read_results(edro_results).joint("wrist pitch")
    assert plain.joint_fit is not None
    known = plain.joint_fit.parameters
    row = replace(known[ParameterName("alpha_0", Direction.POSITIVE)], value=0.1, interval=(0.09, 0.11), unit="1")
    fit = replace(plain.joint_fit, parameters={**known, LINK_LOAD: row}, load=np.zeros(plain.joint_fit.n))
    return plain, replace(plain, joint_fit=fit, settings={"law": "gaussian+link-load: Gaussian peak"})


def test_joints_with_a_load_say_so(embedded: tuple[Joint, Joint], tmp_path: Path) -> None:
    """What is left out is named with how much it is, reports say which law and load the fits have; edited coefficients of no load are refused."""
    plain, loaded = embedded
    (told,) = without_load(loaded)
    assert (told.numbers["names"], told.numbers["rise"]) == (("link_load",), 0.1)
    assert not without_load(plain)
    assert loaded.law_name == "gaussian+link-load"
    assert "law: gaussian+link-load: Gaussian peak" in " ".join(brief_report([loaded]).split())
    assert not any(line.startswith("  law:") for line in brief_report([plain]).splitlines())
    assert "Fitted: gaussian+link-load (" in " ".join(full_text([loaded]).split())
    wrong: dict[str, dict[str, float]] = {
        "has none as coefficients": {"foo_load": 0.1},
        "has gear_load_squared as coefficients": {"gear_load_squared": 0.1},
        "expected those of one of link-load, motor-load": {"link_load": 0.1, "motor_load": 0.1},
    }
    document = json.loads(bristle.Results(joints=embedded[1:]).to_json())
    fit, path = document["joints"]["wrist pitch"]["joint_fit"], tmp_path / "results.json"
    known = fit["parameters"].pop("link_load")
    rest = fit["parameters"]
    for said, values in wrong.items():
        fit["parameters"] = {**rest, **{name: {**known, "value": value} for name, value in values.items()}}
        path.write_text(json.dumps(document))
        with pytest.raises(InputError, match=said):
            bristle.read_results(path)


JOINT = Lugre(0.3, 0.1, 0.05, 0.2, 100.0, 0.3)
WAVES = {
    "cogging_sin_4": 0.05, "cogging_cos_4": 0.02, "cogging_sin_11": 0.03, "cogging_cos_11": -0.02,
    "ripple_sin_4": 0.02, "ripple_cos_4": 0.01, "ripple_sin_11": 0.0, "ripple_cos_11": 0.01,
}  # fmt: skip  # a list of values
"""Amplitudes by parameter, N*m."""
ASKED = with_orders(("cogging", "ripple"), (4, 11), "revolute")
PERIOD = 4e-3


def moves(seconds: float = 8.0) -> tuple[Array, Array, Array]:
    """Time, position and velocity of a motion of two tones over more than a turn."""
    t = np.arange(0, seconds, PERIOD)
    v = 3.0 * np.sin(1.3 * t) + 1.2 * np.sin(3.7 * t)
    return t, way(v, PERIOD), v


def waves(q: Array, v: Array) -> Array:
    """The torque that repeats with the position, N*m, (n,), written out."""
    torque = np.zeros(q.size)
    for k in (4, 11):
        for name, wave in (("sin", np.sin(k * q)), ("cos", np.cos(k * q))):
            torque += WAVES[f"cogging_{name}_{k}"] * wave + WAVES[f"ripple_{name}_{k}"] * wave * np.sign(v)
    return torque


def record(seed: int, *, noise: float = 0.01, size: float = 1.0) -> Record:
    """A motion with friction (9), and so much of the torque that repeats."""
    t, q, v = moves()
    torque = curve(v, JOINT) + size * waves(q, v) + white(t.size, noise, seed)
    return Record(file="log.csv", time=t, position=q, velocity=v, torque=torque)


def bristles(seconds: float, size: float = 1.0) -> tuple[Array, Array, Array]:
    """Time, position and torque of the motion with friction of LuGre, an inertia, and so much of what repeats."""
    t, q, v = moves(seconds)
    torque = bristle.simulate(v, PERIOD, JOINT) + 0.01 * np.gradient(v, t) + size * waves(q, v)
    return t, q, torque + white(t.size, 0.01, 1)


@pytest.mark.slow
def test_orders_are_found_and_their_amplitudes_within_intervals() -> None:
    """Beside all LuGre parameters both orders are found in every one of 12 sets; of 60 clean sets at least 58 show none."""
    t, q, v = moves()
    torque, a = bristle.simulate(v, PERIOD, JOINT), np.gradient(v, t)
    plain = Record(file="log.csv", time=t, position=q, velocity=v, acceleration=a, torque=torque + 0.01 * a)
    problem = dynamic_problem([plain], ("+", "-"), ("inertia",), 8, None)
    signs = [Direction.POSITIVE, Direction.NEGATIVE]
    start = {ParameterName(name, d): x for name, x in JOINT._asdict().items() for d in signs}
    solution = solve_dynamic(problem, start | {ParameterName("inertia", Direction.SHARED): 0.01}, search=False)
    known, rest, private = jacobian_and_residuals(problem, solution)
    both = {k: with_orders(("cogging", "ripple"), (k,), "revolute") for k in range(2, 31)}
    columns = {k: private.off(columns_of(problem, names)) for k, names in both.items()}
    (m,), rng = problem.motions, np.random.default_rng(0)
    noise = [m.weighted(0.03 * rng.standard_normal(t.size)) for _ in range(60)]
    assert sum(shown_orders(known, rest + x, columns) == () for x in noise) >= 58
    repeats = m.weighted(waves(q, v))
    assert all(shown_orders(known, rest + repeats + x, columns) == (4, 11) for x in noise[:12])
    # of cogging and ripple of orders 4 and 11, the 95 % intervals hold the true amplitudes in 92 to 98 % of fifty sets,
    # whose noise is white
    held = []
    for seed in range(50):
        problem, _, _ = from_records([record(seed)], ("both",), ASKED, 1)
        found = estimate_static(problem, FitOptions(), "revolute")
        for name, true in WAVES.items():
            assert found[name].value == pytest.approx(true, abs=2e-3)
            held.append(holds(found[name].interval, true))
    assert 0.92 <= np.mean(held) <= 0.98


@pytest.mark.parametrize("size", [0.0, 1.0])
def test_a_fit_that_is_asked_to_finds_the_orders_and_says_so(size: float) -> None:
    """Cogging and ripple without orders get those that are there, told in a note and in the settings, or none; friction is the same."""
    found = bristle.fit_dynamic(
        *bristles(10.0, size), directions="symmetric", regressors=["inertia", "cogging", "ripple"]
    )
    (note,) = [w for w in found.joint.warnings if w.code in {"orders-found", "no-orders"}]
    assert (note.code == "orders-found") == (size > 0)
    assert found.joint.settings["orders"] == ("4, 11, periods per turn" if size else "none, periods per turn")
    amplitudes = {name: x for name, x in found.params.items() if name in WAVES}
    assert amplitudes == pytest.approx(WAVES if size else {}, abs=2e-3)
    assert found.params["alpha_0"] == pytest.approx(JOINT.alpha_0, rel=0.01)
    if size:
        q = np.array([0.3, 1.1])
        with pytest.raises(InputError, match="predict: cogging was fitted; give the position too"):
            found.predict(np.ones(2))
        wanted = curve(np.ones(2), JOINT) + waves(q, np.ones(2))
        assert found.predict(np.ones(2), q) == pytest.approx(wanted, abs=5e-3)
    # points scattered over a turn get the order of their cogging, and its amplitude; without any they get none
    rng = np.random.default_rng(2)
    v = np.tile(np.geomspace(0.03, 2.0, 30), 2) * np.repeat([1.0, -1.0], 30)
    q = rng.uniform(0, 2 * np.pi, v.size)
    torque = curve(v, JOINT) + 0.05 * size * np.cos(7 * q) + 0.003 * rng.standard_normal(v.size)
    found = bristle.fit(v, torque, position=q, directions="symmetric", regressors=["cogging"])
    wanted = {"cogging_sin_7": 0.0, "cogging_cos_7": 0.05} if size else {}
    assert {n: x for n, x in found.params.items() if "cogging" in n} == pytest.approx(wanted, abs=3e-3)


def test_what_is_held_out_is_predicted_with_the_same_orders(tmp_path: Path) -> None:
    """A run that was not fitted is predicted to its noise with the orders found in the others, and far worse without them."""
    t, q, torque = bristles(14.0)
    errors = {}
    for asked in ("[inertia]", "[inertia, cogging, ripple]"):
        fit = f"directions: symmetric, regressors: {asked}"
        for name, part in (("b", t >= 9), ("a", t < 9)):
            path = experiment_file(tmp_path, {"t": t[part], "q": q[part], "T": torque[part]}, fit=fit, file=name)
        held = "}, {files: b.csv, experiment: tracking, hold_out: true}]"
        path.write_text(path.read_text().replace("}]", held))
        found = bristle.identify(path).joints[0].tracking
        assert found is not None
        errors[asked] = found.hold_out[0].relative_error
    plain, repeating = errors.values()
    assert repeating < 0.3 * plain
    # orders of nothing, of none, that are no whole numbers or finer than the positions get one sentence, which says what is expected
    t, q, torque = bristles(4.0)
    for options, sentence in REFUSED:
        named: dict[str, Any] = {} if sentence.startswith("fit.orders: nothing") else {"regressors": ["cogging"]}
        with pytest.raises(InputError) as refused:
            bristle.fit_dynamic(t, q, torque, **named, **options)
        assert sentence in str(refused.value)
        assert "\n" not in str(refused.value)
    # runs and points without a position are refused, as for gravity
    some = np.ones(3)
    path = experiment_file(tmp_path, {"t": some, "v": some, "T": some}, fit="regressors: [ripple]")
    path.write_text(path.read_text().replace("tracking", "ramp"))
    with pytest.raises(InputError, match="no position, which ramp runs need; name it under signals"):
        load_experiment(path)
    with pytest.raises(InputError, match=r"fit\.regressors: cogging needs the position of every point"):
        bristle.fit(np.linspace(0.1, 1, 20), np.linspace(0.2, 0.3, 20), regressors=["cogging"], orders=[4])
    # a segment carries the means of its columns: zero over whole periods, whatever its middle is at
    t = np.arange(1000, dtype=float) / 1000
    q = 2 * np.pi * t / 4 + 0.3
    run = Record(file="a.csv", time=t, position=q, velocity=np.full(t.size, np.pi / 2), torque=np.zeros(t.size))
    found = Segment(
        file="a.csv", start=0, stop=t.size, velocity=1.0, torque=0.3, standard_error=None, accepted=True, position=1.0
    )
    asked = with_orders(("cogging", "ripple"), (4,), "revolute")
    (loaded,) = with_loads(run, (found,), asked)
    problem = points_problem([loaded], ("both",), asked)
    assert problem.linear[0, 2:] == pytest.approx(np.zeros(4), abs=1e-12)
    assert [name.name for name in problem.linear_names[2:]] == list(load_columns(asked, lambda _: q, q.size))


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"orders": [4]}, "fit.orders: nothing has orders; add cogging or ripple to fit.regressors, or leave it out"),
    ({"orders": [-4]}, "got -4; expected auto, or whole numbers from 1 to 100_000"),
    ({"orders": [4.5]}, "got 4.5; expected auto, or whole numbers"),
    ({"orders": "all"}, "got 'all'; expected auto, or whole numbers"),
    ({"orders": [4, 4]}, "got [4, 4]; expected auto, or up to 20 orders, each once"),
    ({"orders": [5000]}, "fit.orders: got 5000; expected at most"),
]
"""Orders that cannot be, and what is said of them."""


@pytest.mark.parametrize(("kind", "rate"), [("revolute", 4.0), ("prismatic in A", 8 * np.pi)])
def test_an_order_is_per_turn_or_per_metre(kind: JointKind, rate: float) -> None:
    """Order 4 is four periods a turn, or a metre; its amplitude has the unit of the torque, and a ripple turns with the motion."""
    q, v = np.linspace(0, 1, 50), np.linspace(-1, 1, 50)
    columns = load_columns(
        with_orders(("inertia", "cogging", "ripple"), (4,), kind), lambda name: {"position": q}.get(name, v), q.size
    )
    assert list(columns) == ["inertia", "cogging_sin_4", "cogging_cos_4", "ripple_sin_4", "ripple_cos_4"]
    assert columns["cogging_sin_4"] == pytest.approx(np.sin(rate * q))
    assert columns["ripple_cos_4"] == pytest.approx(np.cos(rate * q) * np.sign(v))
    assert {unit(name, kind) for name in list(columns)[1:]} == {unit("torque", kind)}
