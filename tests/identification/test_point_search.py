from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.arrays import Array
from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.load import load_experiment
from bristle.errors import InputError
from bristle.findings import Finding, Severity
from bristle.identification.fits import StaticFit
from bristle.identification.static.points import search_points
from bristle.simulation import edro

from .conftest import GRIPPER, curve, points_file

SPEEDS = np.geomspace(0.005, 1.0, 22)
NOISE = 0.01 * GRIPPER.alpha_0


def torques() -> Array:
    """On the gripper's law with white noise, N*m."""
    return curve(SPEEDS, GRIPPER) + NOISE * np.random.default_rng(3).standard_normal(SPEEDS.size)


def static(path: Path) -> StaticFit:
    return bristle.identify(path).joints[0].static["+"]


def of(kinds: set[str], fit: StaticFit) -> list[Finding]:
    return [warning for warning in fit.warnings if warning.code in kinds]


ABOUT = {"strays", "strays-matter", "strays-left-out", "misfit", "resting-left-out"}


def test_clean_points_say_nothing(tmp_path: Path) -> None:
    """Without strays there is no such warning, no other fit, and every point is fitted."""
    fit = static(points_file(tmp_path, SPEEDS, torques()))
    assert (of(ABOUT, fit), fit.strays, fit.n) == ([], (), 22)
    # with `set_up: as-written` every point is fitted; the stray is named by its line, the fit without it beside; one that matters is
    # critical
    T = torques()
    T[20] += 20 * NOISE
    fit = static(points_file(tmp_path, SPEEDS, T, "set_up: as-written"))
    (stray,) = fit.strays
    assert (stray.file, stray.where, stray.velocity, stray.torque) == ("points.csv", "line 22", SPEEDS[20], T[20])
    (warning,) = of(ABOUT, fit)
    assert float(str(warning).partition("rad/s, ")[2].split()[0]) == pytest.approx(20, rel=0.4)
    assert (warning.code, warning.severity) == ("strays-matter", Severity.CAUTION)
    assert warning.effect["torque"] > 0
    assert fit.n == 22
    rest = static(points_file(tmp_path, np.delete(SPEEDS, 20), np.delete(T, 20), "set_up: as-written"))
    assert f"alpha_0 {rest.parameters['alpha_0'].value:.4g} +/-" in str(warning)
    for name, e in rest.parameters.items():
        assert warning.numbers[name] == pytest.approx(e.value)
    # points off the law because of drag, v * abs(v), are not left out, but the term is taken and comes back; a stray is left out
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    for share in (0.3, 0.5):
        drag = torques() + share * GRIPPER.alpha_2 / SPEEDS.max() * SPEEDS**2
        (joint,) = bristle.identify(points_file(tmp_path / "a", SPEEDS, drag)).joints
        fit = joint.static["+"]
        assert of({"strays", "strays-matter", "strays-left-out"}, fit) == []
        assert fit.n == SPEEDS.size
        (name,) = {"alpha_3", "quadratic"} & fit.parameters.keys()
        low, high = fit.parameters[name].interval or (0.0, 0.0)
        assert low < share * GRIPPER.alpha_2 / SPEEDS.max() < high
    T = torques()
    T[10] += 20 * NOISE
    (then,) = of({"strays", "strays-matter"}, static(points_file(tmp_path / "b", SPEEDS, T, "set_up: as-written")))
    assert "leave `set_up: as-written` out" in then.numbers["advice"]
    assert of({"strays-left-out"}, static(points_file(tmp_path / "b", SPEEDS, T)))
    # the same points with and without a standard error: five standard deviations of the others, but two of its own, are
    # chance
    T = torques()
    T[20] += 12 * NOISE
    found = []
    for own in (None, NOISE, 6 * NOISE):
        points = [
            Segment(file="a", start=k, stop=k + 1, velocity=v, torque=t, standard_error=own, accepted=True)
            for k, (v, t) in enumerate(zip(SPEEDS.tolist(), T.tolist(), strict=True))
        ]
        (search,) = search_points(load_experiment(edro.experiments()[0]), points)
        found.append(search.strays)
    assert found == [(20,), (20,), ()]
    # where the directions differ otherwise too an offset is noted with its size: half the difference of alpha_0
    v = np.concatenate([SPEEDS, -SPEEDS])
    other = GRIPPER._replace(alpha_0=0.8 * GRIPPER.alpha_0, alpha_2=1.3 * GRIPPER.alpha_2)
    T = np.concatenate([curve(SPEEDS, GRIPPER), -curve(SPEEDS, other)])
    joint = bristle.identify(points_file(tmp_path, v, T)).joints[0]
    (noted,) = [w for w in joint.warnings if w.code == "offset-left-out"]
    assert noted.numbers["offset"] == pytest.approx(0.1 * GRIPPER.alpha_0, rel=1e-6)
    assert noted.numbers["common"] == pytest.approx(0.9 * GRIPPER.alpha_0, rel=1e-6)


@pytest.mark.usefixtures("few_motions")
def test_strays_are_left_out_of_everything(tmp_path: Path) -> None:
    """The fit, the cross-check, the models and a plan are those of a file without the point; the fit with it stands beside."""
    T = torques()
    T[6] += 20 * NOISE
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    path = points_file(tmp_path / "a", SPEEDS, T)
    bare = points_file(tmp_path / "b", np.delete(SPEEDS, 6), np.delete(T, 6))
    found = [bristle.identify(x) for x in (path, bare)]
    dropped, without = (x.joints[0] for x in found)
    for name, e in without.static["+"].parameters.items():
        assert dropped.static["+"].parameters[name].value == e.value
        assert dropped.static["+"].parameters[name].interval == e.interval
    assert dropped.crosscheck["+"].parameters == without.crosscheck["+"].parameters
    assert [m.rows for m in dropped.models] == [m.rows for m in without.models]
    plans = [bristle.plan(x, velocities=4).velocities[0].problem.noise for x in found]
    assert plans[0] == plans[1]
    (warning,) = of(ABOUT, dropped.static["+"])
    assert warning.code == "strays-left-out"
    assert {"alpha_0", "alpha_2"} <= warning.numbers.keys()
    (left_out,) = [s for s in dropped.segments if not s.accepted]
    assert [reason.code for reason in left_out.reasons] == ["stray-dropped"]


def test_points_that_are_left_out_or_misfit(tmp_path: Path) -> None:
    """At vanishing speed with half the friction a point did not slide: left out by default, with the reason; at ordinary speed it is a stray."""
    slow = np.concatenate([[1e-5], SPEEDS])
    T = np.concatenate([[0.5 * GRIPPER.alpha_0], torques()])
    joint = bristle.identify(points_file(tmp_path, slow, T)).joints[0]
    assert [s.line for s in joint.segments if not s.accepted] == [2]
    assert joint.segments[0].reasons[0].code == "below-breakaway"
    assert [w.code for w in of(ABOUT, joint.static["+"])] == ["resting-left-out"]
    assert joint.static["+"].n == 22
    # `fit.exclude` leaves out the lines that it names and no others, and refuses to name none
    T = torques()
    path = points_file(tmp_path, SPEEDS, T, "exclude: [{file: points.csv, rows: 8}, {file: points.csv, rows: 10-11}]")
    joint = bristle.identify(path).joints[0]
    assert [s.line for s in joint.segments if not s.accepted] == [8, 10, 11]
    assert {reason.code for s in joint.segments for reason in s.reasons} == {"excluded"}
    for entry in ("{file: points.csv, rows: 1}", "{file: other.csv, rows: 8}"):
        with pytest.raises(InputError, match=r"fit\.exclude: entry 1 names no point"):
            bristle.identify(points_file(tmp_path, SPEEDS, T, f"exclude: [{entry}]"))
    for rows in ("x", "3-2", "-1", "1.5", "[1]", "1-2-3", "true"):
        with pytest.raises(InputError, match="rows"):
            bristle.identify(points_file(tmp_path, SPEEDS, T, f"exclude: [{{file: points.csv, rows: {rows}}}]"))
    # points slower than `segments.minimum_velocity` are rejected, with the reason
    path = points_file(
        tmp_path, SPEEDS, torques(), more=f"segments: {{minimum_velocity: {float(SPEEDS[3])!r} rad/s}}\n"
    )
    joint = bristle.identify(path).joints[0]
    assert [s.accepted for s in joint.segments] == [False] * 3 + [True] * 19
    assert {s.reasons[0].code for s in joint.segments[:3]} == {"point-too-slow"}
    # where more than an eighth of the points would have to go, nothing is left out, and that is said
    T = torques()
    T[[3, 8, 13]] += NOISE * np.array([160, -60, 25])
    for set_up in ("as-written", "auto"):
        fit = static(points_file(tmp_path, SPEEDS, T, f"set_up: {set_up}"))
        (warning,) = of(ABOUT, fit)
        assert (warning.code, warning.severity, fit.n) == ("misfit", Severity.CAUTION, 22)
        assert warning.effect["torque"] == pytest.approx(fit.rms)
