from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.data import bandwidth
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.identification.curve import friction_of, friction_points
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.identify import identify_joint
from bristle.identification.known_joint import as_identified
from bristle.identification.measured import measure
from bristle.identification.moving_runs import decimator, longest_decimation
from bristle.identification.static.crosscheck import full_fit
from bristle.identification.static.fit import PointInfo, fit_static, reconcile_static
from bristle.identification.static.grid import default_range, solve
from bristle.identification.static.problem import from_records
from bristle.model.parameters import Direction, Lugre, ParameterName
from bristle.model.rollout import rollout

from ..conftest import present
from ..names import parse
from .conftest import curve, experiment_file, fitted, holds, moved, posed, tones, way, white

STRONG = Lugre(0.02, 0.03, 0.04, 0.15, 1.0, 0.0)
INERTIA = 0.004
NARROW = 2.5  # hz: a low pass that takes of the motion what it does at its reversals


def moving(seed: int = 0, starts: tuple[int, ...] = (0,), noise: float = 2e-4) -> Record:
    """Eight seconds of a two-tone motion at 1 kHz with exact derivatives, friction (9), inertia, and noise on torque."""
    time = np.arange(8000) / 1000
    w1, w2 = 2 * np.pi * 0.4, 2 * np.pi * 1.1
    velocity = 0.6 * np.sin(w1 * time) + 0.3 * np.sin(w2 * time)
    acceleration = 0.6 * w1 * np.cos(w1 * time) + 0.3 * w2 * np.cos(w2 * time)
    torque = curve(velocity, STRONG) + INERTIA * acceleration + white(time.size, noise, seed)
    whole = Record(file="motion.csv", time=time, velocity=velocity, acceleration=acceleration, torque=torque)
    return replace(whole, starts=starts)


def values(
    record: Record, directions: tuple[str, ...], regressors: tuple[str, ...], inertia: float | None = None
) -> dict[ParameterName, float]:
    problem, _, _ = from_records([record], directions, regressors, 10, inertia)
    return dict(zip(problem.names, solve(problem, default_range(problem.velocity)).theta, strict=True))


def test_fits_of_moving_runs_find_the_truth() -> None:
    """sgn(v) and the Stribeck shape are formed before the filter, so noise-free data give back the exact parameters although both are smoothed."""
    found = values(moving(noise=0.0), ("+", "-"), ("inertia",))
    assert found[parse("inertia")] == pytest.approx(INERTIA, rel=1e-5)
    for name in ("alpha_0", "alpha_1", "alpha_2", "v_s"):
        assert [found[parse(name + sign)] for sign in "+-"] == pytest.approx([getattr(STRONG, name)] * 2, rel=1e-4)
    # a run at 500 Hz beside one at 200 Hz: equations as far apart, and without noise the exact parameters, by both routes
    fast, slow = moving(noise=0.0), thinned(moving(noise=0.0), slice(None, None, 5), "slow.csv")
    between = thinned(fast, slice(None, None, 2), "fast.csv")
    both = [replace(between, oversampled=2.5), slow]  # 500 Hz beside 200 Hz
    problem, (time, _), _ = from_records(both, ("both",), ("inertia",), 4, None)
    assert np.diff(time)[np.diff(time) > 0] == pytest.approx(0.02)
    found = dict(zip(problem.names, solve(problem, default_range(problem.velocity)).theta, strict=True))
    assert found[parse("inertia")] == pytest.approx(INERTIA, rel=1e-5)
    for name in ("alpha_0", "alpha_1", "alpha_2", "v_s"):
        assert found[parse(name)] == pytest.approx(getattr(STRONG, name), rel=1e-3)
    posed = dynamic_problem(both, (Direction.BOTH,), ("inertia",), 4, None, {})
    steps = [np.diff(m.smoothed(m.time)) for m in posed.motions]
    assert all(step == pytest.approx(0.02) for step in steps)
    # with the inertia fixed the rest comes out as when it is estimated, and it is no parameter any more
    fixed = values(moving(), ("both",), ("offset",), inertia=INERTIA)
    free = values(moving(), ("both",), ("inertia", "offset"))
    assert parse("inertia") not in fixed
    assert fixed[parse("alpha_2")] == pytest.approx(free[parse("alpha_2")], rel=0.01)
    # two routes agree: IPOPT on the law itself, through the same filter, and the grid; costs within 1e-6 relative
    problem, _, _ = from_records([moving()], ("both",), ("inertia", "offset"), 10)
    v_s_range = default_range(problem.velocity)
    grid = solve(problem, v_s_range)
    theta = min(full_fit(problem, v_s_range, starts=3), key=lambda end: float(np.sum(problem.residuals(end) ** 2)))
    cost = float(np.sum(problem.residuals(theta) ** 2))
    assert cost == pytest.approx(grid.cost, rel=1e-6)
    assert theta == pytest.approx(grid.theta, rel=2e-3, abs=1e-5)


def thinned(record: Record, samples: slice, file: str) -> Record:
    kept = {name: getattr(record, name)[samples] for name in ("time", "velocity", "acceleration", "torque")}
    return replace(record, file=file, **kept)


def test_filters_hold_outs_and_poorer_laws_of_moving_runs() -> None:
    """Each equation's kernel sums to one, and takes its samples from one segment only."""
    record = moving(starts=(0, 3000))
    problem, (time, _), dropped = from_records([record], ("both",), ("inertia",), 10)
    smooth = present(problem.smooth)
    assert smooth @ np.ones(record.time.size) == pytest.approx(np.ones(smooth.shape[0]), abs=1e-12)
    dense = smooth.toarray()
    first, second = dense[:, :3000].any(axis=1), dense[:, 3000:].any(axis=1)
    assert not (first & second).any()
    assert time.size == smooth.shape[0]
    assert dropped > 0
    # a record shorter than the filter's transient is refused with the number of samples that it takes
    short = thinned(moving(), slice(0, 100), "short.csv")
    with pytest.raises(ValueError, match=r"short\.csv: no segment between gaps is longer than \d+ samples"):
        from_records([short], ("both",), ("offset",), 10)
    # a regressor whose signal the run does not have is refused, naming the file and the signal
    bare = replace(moving(), file="bare.csv", acceleration=None)
    with pytest.raises(ValueError, match=r"bare\.csv: the fit needs acceleration"):
        from_records([bare], ("both",), ("inertia",), 10)
    # the relative error on a held-out run is 100 * norm(residual) / norm(torque) with the training run's parameters
    training, (time, position), _ = from_records([moving(0)], ("both",), ("inertia",), 10)
    other, _, _ = from_records([moving(1)], ("both",), ("inertia",), 10)
    where = PointInfo(time=time, position=position)
    fits, _ = fit_static(training, FitOptions(), "revolute", where, [("other.csv", other)])
    fit = fits["both"]
    theta: Array = solve(training, default_range(training.velocity)).theta
    by_hand = 100 * np.linalg.norm(other.residuals(theta)) / np.linalg.norm(other.torque)
    assert fit.hold_out[0].file == "other.csv"
    assert fit.hold_out[0].relative_error == pytest.approx(by_hand, rel=1e-9)
    # where LuGre's fit knows friction, or leaves less than half, the static fit keeps its numbers and says which to use; else it is as it was
    run = moved(5.0 * tones(np.arange(0, 8, 1e-3)), 1e-3, noise=2e-4)
    lugre = fitted(posed(run, decimation=5))
    problem, _, _ = from_records([run], ("both",), ("inertia",), 5)
    static, _ = fit_static(problem, FitOptions(), "revolute", PointInfo())
    fit = reconcile_static(static, lugre)["both"]
    assert fit.outcome.code == "static-superseded"
    assert fit.outcome.numbers["other"] == lugre.relative_error
    assert fit.parameters == static["both"].parameters
    assert fit.warnings == ()
    alpha_0 = lugre.parameters[parse("alpha_0")]
    blind = replace(lugre, parameters={parse("alpha_0"): replace(alpha_0, value=None)})
    assert reconcile_static(static, blind)["both"].outcome == fit.outcome
    blind = replace(blind, relative_error=0.6 * present(static["both"].relative_error))
    assert reconcile_static(static, blind) == reconcile_static(static, None) == static
    nothing = {"both": replace(static["both"], relative_error=None)}
    assert reconcile_static(nothing, lugre) == nothing


@pytest.mark.parametrize("samples", [5, 37, 100, 368, 369, 10_000])
def test_the_decimation_is_the_largest_that_a_run_is_long_enough_for(samples: int) -> None:
    """Of 10 at most: its transients take no more than a fifth of such a run, and those of one more do, or leave nothing."""
    found = longest_decimation(10, samples)
    assert decimator([np.array([samples])], found, "a.csv")[1] <= samples / 5
    if found < 10:
        with suppress(InputError):
            assert decimator([np.array([samples])], found + 1, "a.csv")[1] > samples / 5


def moving_file(folder: Path, fit: str = "", *, short: bool = False) -> Path:
    """A tracking run of 20 s with presliding, SIMULATED; besides one of 0.3 s if need be."""
    t = np.arange(0, 20, 2e-3)
    v = np.sum([a * np.sin(2 * np.pi * f * t + a) for a, f in ((0.3, 0.3), (0.1, 1.3), (0.05, 3.1))], axis=0)
    T = rollout(v, 2e-3, Lugre(0.25, 0.08, 0.4, 0.05, 400.0, 1.0)).torque + white(t.size, 0.005)
    columns = {"t": t, "v": v, "T": T}
    if short:
        experiment_file(folder, {name: x[:150] for name, x in columns.items()}, file="short")
    file = experiment_file(folder, columns, fit=f"directions: symmetric{fit}", file="long")
    file.write_text(file.read_text().replace("long.csv", "[long.csv, short.csv]" if short else "long.csv"))
    return file


def test_a_short_run_is_fitted_with_what_it_has(tmp_path: Path) -> None:
    """With one run of 150 samples no filter is longer than leaves something of it; a decimation that was asked for stays, and is refused."""
    measured = measure(moving_file(tmp_path, short=True))
    every = measured.experiment.fit.every
    assert every <= longest_decimation(100, 150)
    with pytest.raises(InputError, match=r"short.csv: no segment .* below 10"):
        identify_joint(measure(moving_file(tmp_path, ", decimation: 10", short=True)))
    # a free exponent without points at constant velocity is held in the middle of its range, which is a caution; a given one is not
    for given, said in (("", ["1.41"]), (", fixed: {delta: 2.0}", [])):
        joint = identify_joint(measure(moving_file(tmp_path, f", law: free-exponent{given}")))
        fit = present(joint.moving)
        told = [w for w in fit.warnings if w.code == "shape-held"]
        assert [f"{w.numbers['value']:.3g}" for w in told] == said
        # the report draws the values to use, and beside them friction along the motion, which the law explains
        (shown,) = friction_points(joint)
        left = shown.torque - friction_of(as_identified(joint), shown.velocity)
        assert shown.velocity.size == fit.n
        assert np.median(np.abs(left)) < 0.02 * np.median(np.abs(shown.torque))
    # a run of which rows are lost is fitted by the stretches that its filter fits into, the others counted, and finds the friction
    file = moving_file(tmp_path)
    rows = np.loadtxt(tmp_path / "long.csv", delimiter=",", skiprows=1)
    lost = np.r_[3000:3100, 3120:3200, 6000:6050, 6200:6300]
    np.savetxt(tmp_path / "long.csv", np.delete(rows, lost, axis=0), delimiter=",", header="t,v,T", comments="")
    joint = identify_joint(measure(file))
    assert joint.inputs[0].dropped == 20 + 150
    assert holds(present(joint.tracking).parameters[parse("alpha_0")].interval, 0.25)


@pytest.mark.slow
def test_a_low_pass_that_takes_motion_is_widened(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where spectra would cut the motion off, the fit goes through the widest filter that leaves no more, and is right; a good one stays."""
    t = np.arange(0, 12, 0.002)
    v = 0.6 * np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t) + 0.2 * np.sin(13.0 * t)
    q = way(v, 0.002)
    law = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)
    T = bristle.simulate(v, 0.002, law) + 0.001 * np.gradient(v, t)
    T = T + 1e-4 * np.random.default_rng(0).standard_normal(t.size)
    usual = bristle.fit_dynamic(t, q, T, directions="symmetric")
    chosen, why = bandwidth.of_motion(usual.measured.moving(hold_out=False)[0])
    assert f"{chosen:.3g} Hz" in usual.joint.settings["filters"]
    monkeypatch.setattr(bandwidth, "of_motion", lambda _: (NARROW, why))
    widened = bristle.fit_dynamic(t, q, T, directions="symmetric")
    asked = bristle.fit_dynamic(t, q, T, directions="symmetric", position_cutoff=f"{NARROW} Hz")
    assert f"{6.3 * NARROW:.3g} Hz" in widened.joint.settings["filters"]
    off = [abs(fit.params["alpha_0"] / law.alpha_0 - 1) for fit in (usual, widened, asked)]
    assert max(off[:2]) < 0.001, off
    assert off[2] > 0.01, off
