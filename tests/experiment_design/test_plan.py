import io
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import bristle
from bristle.arrays import Array
from bristle.errors import InputError
from bristle.findings import Finding, Severity
from bristle.identification.measured import Measured, measure
from bristle.model.parameters import Direction, ParameterName, Stribeck
from bristle.questions.experiment_design import excitation, figures
from bristle.questions.experiment_design.plan import Plan, check_plan
from bristle.questions.experiment_design.report import report
from bristle.questions.experiment_design.start import scatter, start_of
from bristle.questions.experiment_design.velocities import DesignProblem, design, evaluate_design
from bristle.simulation.bench import steady_points
from bristle.simulation.edro import experiments
from bristle.simulation.fisher import static_jacobian
from bristle.simulation.limits import Limits, limits_of

from ..conftest import TRUTH, Ran, few_motions_tried, run, speeds, write
from ..laws import DRAG, EXPONENT, OUTSIDE, motion, points, registered, truth_of
from ..pages import assert_tables_are_named, findings, page_text
from ..sameness import of_kind
from .conftest import spaced_speeds

PARTS = ("now", "with velocities", "with loading", "with motion")
Q, V, T = "position reference (rad)", "velocity reference (rad/s)", "torque reference (N*m)"


pytestmark = pytest.mark.usefixtures("few_motions")


def planned(folder: Path, options: str = "", *arguments: object, both: bool = True) -> Ran:
    """`bristle plan` of an experiment of points with these options under `plan`."""
    path = write(folder, speeds(both=both))
    path.write_text(path.read_text() + f"plan: {{{options}}}\n")
    return run("plan", path, "-o", folder / "next.csv", "--velocities", 4, *arguments)


def assert_within(frame: pd.DataFrame, position: tuple[float, float], velocity: float, acceleration: float) -> None:
    """Every reference keeps within its limits, and time goes on evenly."""
    step = frame["time (s)"].diff().iloc[1:]
    assert step.to_numpy() == pytest.approx(step.iloc[0])
    for _, own in frame[frame["experiment"] != "presliding"].groupby((frame["run"].diff() != 0).cumsum()):
        assert position[0] <= own[Q].min() <= own[Q].max() <= position[1]
        assert own[V].abs().max() <= velocity
        assert own[V].diff().abs().max() <= acceleration * step.iloc[0] * (1 + 1e-6)
        assert own[T].isna().all()


def test_now_is_what_was_identified(gripper: Plan) -> None:
    """Standard errors before the plan are those of the joint fit, and each part of the plan makes none larger; all of it makes each smaller."""
    fit = gripper.joint.moving
    assert fit is not None
    said = [fit.parameters[name].standard_error for name in gripper.start.names]
    errors = gripper.standard_errors
    assert errors["now"] == pytest.approx(said, rel=1e-3)
    assert tuple(errors) == PARTS
    assert (errors["with motion"] < errors["now"]).all()
    # no part makes one larger; velocities shrink the peak, loading sigma_0, the motion sigma_1 and the inertia, by a tenth at least
    at = {str(name): k for k, name in enumerate(gripper.start.names)}
    shrunk = {after: errors[after] / errors[before] for before, after in pairwise(PARTS)}
    assert max(x.max() for x in shrunk.values()) <= 1 + 1e-9
    for part, names in (
        ("with velocities", "v_s+ v_s- alpha_1+ alpha_1-"), ("with loading", "sigma_0+ sigma_0-"), ("with motion", "sigma_1+ sigma_1- inertia"),
    ):  # fmt: skip  # a table
        assert shrunk[part][[at[name] for name in names.split()]].max() < 0.9
    # speeds, runs, time and the intervals of alpha_0 and v_s, or of the aim, are those of the plan, also where one stays open
    then = 196 * gripper.standard_errors["with motion"][gripper.free] / np.abs(gripper.start.estimate[gripper.free])
    names = [gripper.start.names[k].name for k in gripper.free]
    speeds_ = np.unique(np.abs([v for x in gripper.velocities for v in x.velocities]))
    known = {aim: max(then[k] for k, name in enumerate(names) if name == aim) for aim in ("alpha_0", "v_s", "sigma_1")}
    (first, second, *_) = bristle.report_of(gripper).text().splitlines()
    assert first.startswith(
        f"gripper rotation: measure {speeds_.size} speeds from {speeds_[0]:.3g} to {speeds_[-1]:.3g} rad/s in 24 runs, 2 slow loadings and "
        f"a tracking motion, {gripper.duration / 60:.0f} min: predicted alpha_0 to +/- {known['alpha_0']:.2g} %, "
        f"v_s to +/- {known['v_s']:.2g} % (95 %)."
    )
    assert second == "  Planned for all parameters (identified from SIMULATED data)."
    assert (
        f": predicted sigma_1 to +/- {known['sigma_1']:.2g} % (95 %)." in replace(gripper, aim="sigma_1").worth.message
    )
    wide = np.where(np.arange(len(at)) == gripper.free[0], np.inf, errors["with motion"])
    opened = replace(gripper, standard_errors={**errors, "with motion": wide}).worth
    assert ": predicted alpha_0 not identifiable, v_s to +/- " in opened.message
    # table and text have the error by noise, the viscous share, and both together as the promised error
    columns = ("by_noise", "viscous_share", "standard_error")
    rows = table_of(gripper, "loading")[[*columns]].to_numpy(float).tolist()
    for (by_noise, viscous, whole), own in zip(rows, gripper.loadings, strict=True):
        assert whole == pytest.approx(np.hypot(by_noise, viscous * gripper.start.p(own.direction).sigma_0))
        assert f"{100 * viscous:.2g} %" in bristle.report_of(gripper).text()
        k = gripper.start.names.index(ParameterName("sigma_0", own.direction))
        before, after = gripper.standard_errors["with velocities"][k], gripper.standard_errors["with loading"][k]
        assert after**-2 - before**-2 == pytest.approx(whole**-2, rel=0.05)
    # every count is drawn within its axes and above the curve; the legend lies below all axes
    figure = figures.velocities_figure(gripper)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    for ax, own in zip(figure.axes, gripper.velocities, strict=True):
        frame, boxes = ax.get_window_extent(), [t.get_window_extent() for t in ax.texts if t.get_text().startswith("×")]
        assert len(boxes) == np.unique(own.chosen.speeds).size
        assert all(frame.x0 <= b.x0 and b.x1 <= frame.x1 and b.y1 <= frame.y1 for b in boxes)
        points = np.concatenate([ax.transData.transform(line.get_xydata()) for line in ax.lines])
        assert max(y for _, y in points) < min(b.y0 for b in boxes)
        assert legend.get_window_extent().y1 < frame.y0
    assert 0 <= legend.get_window_extent().x0 < legend.get_window_extent().x1 <= figure.bbox.x1


def test_designs_scatter_and_captions_are_the_plans(gripper: Plan) -> None:
    """For its own parameter each design is the best, what is known included: beside that for all, and evenly and log-spaced runs."""
    for own in gripper.velocities:
        count = own.chosen.speeds.size
        spaced = [evaluate_design(own.problem, spaced_speeds(own.problem, count, kind)) for kind in ("log", "even")]
        for k, aim in enumerate(Stribeck._fields):
            alone = design(own.problem, count, aim)
            assert all(alone.errors[k] <= 1.01 * x.errors[k] for x in (own.chosen, *spaced))
    # of many normal residuals the scatter is their standard deviation; with few degrees of freedom it is the root mean square
    residuals = np.random.default_rng(0).standard_normal(20_000)
    fit = replace(gripper.joint.static["+"], rms=1.0, n=residuals.size, residuals=residuals)
    assert scatter(fit) == pytest.approx(1.0, rel=0.02)
    assert scatter(replace(fit, n=5, residuals=residuals[:5], rms=0.3)) == pytest.approx(0.3 * 5**0.5)
    # captions have the plan's errors, runs and limits: the widest, the first and the last
    now, then = (relative(gripper, gripper.standard_errors[stage]) for stage in ("now", "with motion"))
    widest = int(np.argmax(then))
    numbers = [float(x) for x in re.findall(r"([\d.]+) %", said(gripper, "intervals"))]
    assert numbers == pytest.approx([then[widest], now[widest]], rel=0.05)
    for own, part in zip(gripper.velocities, said(gripper, "velocities").split("; "), strict=True):
        assert f": {own.chosen.speeds.size} runs at {np.unique(own.chosen.speeds).size} speeds, " in part
        assert f"{own.chosen.speeds.min():.3g} to {own.chosen.speeds.max():.3g} rad/s" in part
    peak = float(np.abs(gripper.references[-1].velocity).max())
    assert said(gripper, "motion").startswith(
        f"Peak velocity {peak:.3g} rad/s, {gripper.limits.velocity:.3g} rad/s allowed"
    )
    # a parameter that the plan leaves open is the widest
    errors = gripper.standard_errors["with motion"].copy()
    errors[0] = np.inf
    opened = replace(gripper, standard_errors={**gripper.standard_errors, "with motion": errors})
    assert said(opened, "intervals").startswith(
        "Largest standard error expected after the plan: >200 % of α₀ (+), from "
    )


def table_of(plan: Plan, name: str) -> pd.DataFrame:
    found = (section.table for section in bristle.report_of(plan).sections if section.table)
    return next(table.frame for table in found if table.name == name and table.frame is not None)


def test_references_are_read_back(gripper: Plan) -> None:
    """The file is what pandas reads back, within every limit; runs are numbered in order, torque only where the joint is loaded."""
    frame = pd.read_csv(io.StringIO(gripper.reference_csv()))
    pd.testing.assert_frame_equal(frame, gripper.reference_frame(), rtol=1e-8)
    limits = gripper.limits
    assert list(frame.columns) == ["time (s)", "experiment", "run", Q, V, T]
    assert_within(frame, limits.position, limits.velocity, limits.acceleration)
    kinds = frame.drop_duplicates(["experiment", "run"]).query("experiment != 'move'")
    assert kinds["experiment"].value_counts().to_dict() == {"ramp": 24, "presliding": 2, "tracking": 1}
    assert sorted(kinds["run"]) == list(range(1, 28))
    loaded = frame[frame["experiment"] == "presliding"]
    assert loaded[[Q, V]].isna().all().all()
    breakaway = max(p.alpha_0 + p.alpha_1 for p in gripper.start.sets)
    assert 0.2 * breakaway < loaded[T].abs().max() < 0.81 * breakaway
    assert frame["time (s)"].iloc[-1] == pytest.approx(gripper.duration - 1 / limits.rate)
    # each run of the file holds its planned velocity for the averaging time and more; together they are all that were planned
    frame = gripper.reference_frame()
    ramps = frame[frame["experiment"] == "ramp"]
    held = []
    for _, own in ramps.groupby("run"):
        speed = own[V].abs().max()
        assert (own[V].abs() == speed).sum() / gripper.limits.rate >= gripper.limits.hold
        held.append(speed if own[V].max() == speed else -speed)
    wanted = [(-1 if d.direction == "-" else 1) * v for d in gripper.velocities for v in d.chosen.speeds]
    assert sorted(held) == pytest.approx(sorted(wanted))
    # the written tracking reference is the sum of the sines that are stated, but for the fading at its ends
    frame, stated = pd.read_csv(io.StringIO(gripper.reference_csv())), table_of(gripper, "lines")
    own = frame[frame["experiment"] == "tracking"]
    time = own["time (s)"].to_numpy() - own["time (s)"].iloc[0]
    turns = 2 * np.pi * time[:, None] * stated["frequency"].to_numpy() + stated["phase"].to_numpy()
    kept = (time > 0.5) & (time < time[-1] - 0.5)
    expected = np.sin(turns) @ stated["amplitude"].to_numpy() + np.mean(gripper.limits.position)
    assert expected[kept] == pytest.approx(own[Q].to_numpy()[kept], abs=1e-9)


@pytest.fixture(scope="module")
def measured() -> Measured:
    return measure(experiments()[0])


def test_declared_and_undeclared_limits_are_said(measured: Measured, tmp_path: Path) -> None:
    """Each has its kind and value: a note where runs showed it, a caution where it is a guess; a declared one has none."""

    def said_of(found: Measured, asked: dict[str, object]) -> tuple[Limits, dict[str, Finding]]:
        options = found.experiment.plan.model_validate(asked)
        limits, said = limits_of(replace(found, experiment=found.experiment.model_copy(update={"plan": options})))
        return limits, {d.numbers["limit"]: d for d in said}

    limits, said = said_of(measured, {})
    shown = {
        "velocity": limits.velocity, "minimum_velocity": limits.slowest, "hold": limits.hold,
        "acceleration": limits.acceleration, "torque": limits.torque, "position": limits.position,
        "rate": limits.rate, "frequency": 10.0,
    }  # fmt: skip  # a table
    assert {kind: said[kind].numbers["value"] for kind in shown} == shown
    assert said.keys() == shown.keys()
    assert [key for key, d in said.items() if d.severity is not Severity.NOTE] == ["rate", "frequency"]
    declared = {"velocity": 1.0, "minimum_velocity": 0.01, "hold": 2.0, "position": (0.0, 1.0), "acceleration": 9.0}
    declared |= {"torque": 1.0, "rate": 200.0, "frequency": 20.0}
    limits, said = said_of(measured, declared)
    assert (limits.frequency, said) == (20.0, {})
    assert said_of(measured, {"rate": 50.0})[0].frequency == 5.0
    with pytest.raises(ValueError, match="expected at least 10000 Hz, ten samples of a period"):
        said_of(measured, {"frequency": 1000.0})
    limits, said = said_of(measure(write(tmp_path, speeds())), {})
    assert said["acceleration"].numbers["value"] == limits.acceleration
    assert said["position"].numbers["value"][1] == pytest.approx(limits.travel, rel=1e-2)
    guesses = {"acceleration", "position", "rate", "frequency"}
    assert {key for key, d in said.items() if d.severity is Severity.CAUTION} == guesses


def test_a_given_inertia_is_not_listed(tmp_path: Path) -> None:
    """An inertia without a standard error is said to be given, and is in no table; one with an error is; to plan for the first is refused."""
    path = write(tmp_path, speeds())
    bare = path.read_text()
    path.write_text(bare + "inertia: 1.3e-3 kg*m**2\n")
    found = bristle.plan(path, velocities=4)
    assert "inertia" not in found.to_frame()["parameter"].tolist()
    assert "\n  inertia" not in bristle.report_of(found).text()
    assert of_kind(found.assumptions, "inertia-exact")[0].numbers == {"J": 1.3e-3}
    with pytest.raises(ValueError, match="the inertia is given as exact"):
        bristle.plan(path, velocities=4, aim="inertia")
    path.write_text(bare + "inertia: 1.3e-3 +/- 1e-4 kg*m**2\n")
    assert "inertia" in bristle.plan(path, velocities=4).to_frame()["parameter"].tolist()
    # ten times the noise in one direction, and one far point, leave the other's noise as it is; the far point does not rule
    v = np.geomspace(0.2 * TRUTH.v_s, 0.8, 40)
    rng = np.random.default_rng(1)
    there, back = (steady_points(TRUTH, v, noise, rng, 1)[0] for noise in (2e-5, 2e-4))
    there[25] += 2e-3
    path = write(tmp_path, speeds())
    log = pd.DataFrame({"v": [*v, *-v], "tau": [*there, *-back]})
    log.to_csv(tmp_path / "wrist.csv", index=False)
    found = bristle.plan(path, velocities=4)
    assert found.start.noise[Direction.POSITIVE] < 1.2e-4  # root mean square: 3.3e-4
    assert found.start.noise[Direction.NEGATIVE] == pytest.approx(2e-4, rel=0.35)
    assert [d.problem.noise for d in found.velocities] == [found.start.noise[d.direction] for d in found.velocities]
    said = {d.numbers["direction"]: d.numbers for d in of_kind(found.assumptions, "noise-of-points")}
    assert {d: x["scatter"] for d, x in said.items()} == found.start.noise


@pytest.mark.usefixtures("raster")
def test_a_plan_is_written_beside_its_page(tmp_path: Path) -> None:
    """The page, its figures and tables are written, with the references; each caption says a number with a unit at once, each table has a name."""
    # references that have other bytes by then are not written over, which is said
    ran = planned(tmp_path, "rate: 20 Hz, frequency: 1 Hz", "--page", tmp_path / "page", "--for", "v_s")
    assert ran.code == 0, ran.err
    assert "for v_s" in ran.words
    page, found = page_text(tmp_path / "page" / "index.html"), findings(page_text(tmp_path / "page" / "index.html"))
    assert len(found) == page.count("<svg") == len(list((tmp_path / "page" / "figures").glob("*.png"))) == 3
    assert all(NUMBER.search(finding) for finding in found), found
    assert_tables_are_named(tmp_path / "page")
    assert "nan" not in page.lower().replace("resonan", "")
    assert (tmp_path / "page" / "tables" / "intervals.csv").is_file()
    (tmp_path / "next.csv").write_text("time,position\n0,0\n")
    ran = planned(tmp_path)
    assert ran.code == 2
    assert "is there already" in ran.said[0]
    assert (tmp_path / "next.csv").read_text() == "time,position\n0,0\n"


def test_what_is_not_known_is_guessed_and_said(tmp_path: Path) -> None:
    """Points of one direction: bristle, inertia and the other direction are guesses that the plan names, never nan."""
    # where constant velocities begin above v_s, it says that slower ones would show more
    path = write(tmp_path, speeds(both=False))
    path.write_text(path.read_text() + "plan: {minimum_velocity: 0.1 rad/s}\n")
    found = bristle.plan(path, velocities=4)
    guessed = {"sigma_0+", "sigma_1+", "sigma_0-", "sigma_1-"}
    assert guessed <= set(map(str, found.start.guessed))
    (taken,) = of_kind(found.assumptions, "direction-taken")
    assert str(taken) == "Direction - is not identified: it is assumed to be as direction +."
    assert of_kind(found.assumptions, "inertia-guessed")[0].numbers["J"] == found.start.estimate[-1]
    said = [d.numbers for d in of_kind(found.assumptions, "guessed")]
    assert [ParameterName(x["name"], x["direction"]) for x in said] == list(found.start.guessed)
    now = dict(zip(map(str, found.start.names), found.standard_errors["now"], strict=True))
    assert {now[name] for name in guessed} == {np.inf}
    assert "nan" not in bristle.report_of(found).text()
    assert "slowest-too-fast" in [warning.code for warning in found.warnings]
    assert all(np.isfinite(errors).all() for errors in (found.standard_errors["with motion"], found.start.estimate))


def test_bad_input_and_interrupts_leave_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 2, one sentence that names what is wrong, and no file."""
    failed = []
    for options, arguments, named in (
        ("", ("--for", "gamma"), "got 'gamma' as what to plan for; expected one of alpha_0"),
        ("", ("--velocities", "3"), "got 3 velocities; expected 4 to 1000"),
        ("", ("--velocities", "x"), "--velocities"),
        ("position: [1 rad, 0 rad]", (), "plan.position: got 1 to 0; expected the smaller value first"),
        ("position: [0 rad, 0.001 rad]", (), "too short for a hold"),
        ("velocity: 1 m", (), "plan.velocity: unit"),
        ("minimum_velocity: 1 rad/s, velocity: 0.5 rad/s", (), "plan.minimum_velocity: got 1; expected less than"),
        ("minimum_velocity: 1 rad/s", (), "the slowest constant speed, 1, is not below the fastest"),
        ("torque: 1 mN*m", (), "the largest torque, 0.001, does not carry the joint"),
        ("time: 5 s", (), "plan.time: 5 s are too few"),
        ("rate: 1 Hz", (), "plan.rate: got 1 Hz; expected at least 20 Hz"),
        ("rate: 40 Hz, frequency: 5 Hz", (), "plan.rate: got 40 Hz; expected at least 50 Hz, ten samples of a period"),
        ("frequency: 0.1 Hz", (), "plan.frequency: got 0.1 Hz; expected at least 0.2 Hz"),
        ("speed: 1 rad/s", (), "unknown key 'plan.speed'"),
    ):
        ran = planned(tmp_path, options, *arguments)
        if ran.code != 2 or len(ran.said) != 1 or named not in ran.said[0] or (tmp_path / "next.csv").exists():
            failed.append((options, arguments, ran))
    assert failed == []
    # what the experiment file declares is what the references keep to, said by no assumption; the total time too
    limits = (
        "position: [-20 deg, 0.6 rad], velocity: 0.5 rad/s, minimum_velocity: 0.02 rad/s, acceleration: 4 rad/s**2, "
        "torque: 0.2 N*m, time: 150 s, hold: 2 s, frequency: 3 Hz, rate: 50 Hz"
    )
    ran = planned(tmp_path, limits, "--velocities", 5)
    assert ran.code == 0, ran.err
    assert "to override" not in ran.words
    frame = pd.read_csv(tmp_path / "next.csv")
    tracked = frame.loc[frame["experiment"] == "tracking", V].to_numpy()
    spectrum = np.abs(np.fft.rfft(tracked * np.hanning(tracked.size))) ** 2
    frequency = np.fft.rfftfreq(tracked.size, 0.02)
    assert spectrum[frequency > 3.5].sum() < 1e-3 * spectrum.sum()
    assert_within(frame, (-np.deg2rad(20), 0.6), 0.5, 4.0)
    assert frame["time (s)"].iloc[-1] <= 150
    assert frame["time (s)"].iloc[1] == 0.02
    held = frame[frame["experiment"] == "ramp"].groupby("run")[V].apply(lambda v: v.abs().max())
    assert held.size == 10
    assert held.min() >= 0.02

    (tmp_path / "next.csv").unlink()

    # Ctrl-C while the motion is sought: exit code 130 and no file, whole or half
    def interrupted(*_: object) -> None:
        """As a user presses Ctrl-C."""
        raise KeyboardInterrupt

    monkeypatch.setattr(excitation, "best_motion", interrupted)
    ran = planned(tmp_path, "", "--page", tmp_path / "page")
    assert ran.code == 130
    assert sorted(p.name for p in tmp_path.iterdir()) == ["wrist.csv", "wrist.yaml"]


NUMBER = re.compile(r"\d (%|s|runs|times|(rad|m)(/s)?|N(·m)?)(?![\w/])")
"""A number with its unit, or with what it counts."""


def captions(plan: Plan) -> dict[str, str]:
    """What the caption of each figure begins with, by the name of its file."""
    return {figure.name: figure.caption for section in report(plan).sections for figure in section.drawings}


def test_each_caption_begins_with_a_number(tmp_path: Path) -> None:
    """Of a slide, and of one law for both directions: each figure says a number with a unit at once."""
    for aim, changes, more in (
        ("all", {"{name: ": "{kind: prismatic, name: ", "rad/s": "m/s", "N*m": "N"}, ""),
        ("alpha_0", {}, "fit: {directions: symmetric}\nplan: {minimum_velocity: 0.5 rad/s}\n"),
    ):
        path = write(tmp_path, speeds())
        text = path.read_text()
        for old, new in changes.items():
            text = text.replace(old, new)
        path.write_text(text + more)
        found = [*captions(bristle.plan(path, velocities=4, aim=aim)).values()]
        assert [bool(NUMBER.search(x)) for x in found] == [True] * 3
        assert not re.search("nan|inf|None|e[+-]0", " ".join(found))
        assert not changes or "rad" not in " ".join(found)


def said(plan: Plan, figure: str) -> str:
    return captions(plan)[f"plan-{figure}"]


def relative(plan: Plan, errors: Array) -> Array:
    """Percent of the value."""
    return np.asarray(100 * errors / np.abs(plan.start.estimate))


OWN = {DRAG: "alpha_3", EXPONENT: "delta", OUTSIDE: "blunt"}


@pytest.fixture(scope="module")
def known() -> Iterator[None]:
    """The law from outside is known, and few motions are tried."""
    with registered(), few_motions_tried():
        yield


@pytest.fixture(scope="module", params=OWN)
def plan(request: pytest.FixtureRequest, known: None) -> Plan:  # noqa: ARG001  # laws that are planned for
    return bristle.plan(motion(request.param))


def problem(law: str) -> DesignProblem:
    p = truth_of(law)
    size = len(p.law.shape_parameters) + len(p.law.coefficients) + 3
    nothing = np.zeros((size, size))
    return DesignProblem(p=p, nodes=np.full(5, p.v_s), prior_information=nothing, noise=1e-4, low=0.015, high=0.8)


def test_the_laws_own_parameter_is_planned_for(plan: Plan) -> None:
    """Each part of the plan tells no less of it than before, all of it more; tables have it, and v_end is in none."""
    own = OWN[plan.joint.law.name]
    k = [str(name) for name in plan.start.names].index(own)
    errors = [plan.standard_errors[part][k] for part in ("now", "with velocities", "with loading", "with motion")]
    assert np.isfinite(errors).all()
    assert (np.diff(errors) <= 1e-9 * errors[0]).all()
    assert errors[-1] < 0.9 * errors[0]
    assert "v_end" not in {name.name for name in plan.start.names}
    assert any(row.startswith(own) for row in plan.to_frame()["parameter"])
    assert (own == OWN[OUTSIDE]) == ("β" in bristle.report_of(plan).html())  # its symbol, also of a law from outside
    # before the law is known any law's parameter counts, then its own alone, v_end never
    check_plan(12, "alpha_3")
    for aim in ("v_end", "stiffness"):
        with pytest.raises(InputError, match="as what to plan for"):
            check_plan(12, aim)
    with pytest.raises(InputError, match="expected one of alpha_0"):
        bristle.plan(points(EXPONENT), aim="alpha_3")
    # without a peak all of it is a guess, its shape in the middle of where it is looked for, which is said
    fit = points(EXPONENT)
    static = fit.joint.static["both"]
    none = {
        name: replace(e, value=None) for name, e in static.parameters.items() if name in ("alpha_1", "v_s", "delta")
    }
    bare = replace(fit.joint, static={"both": replace(static, parameters={**static.parameters, **none})})
    start = start_of(fit.measured, bare, bristle.plan(fit, velocities=5).limits)
    assert {name.name for name in start.guessed} == {"alpha_1", "v_s", "delta", "sigma_0", "sigma_1"}
    assert start.sets.positive._asdict()["delta"] == pytest.approx(np.sqrt(0.5 * 4.0))
    (shape,) = (x for x in start.assumptions if x.numbers.get("name") == "delta")
    assert str(shape).endswith("in the middle of where it is looked for.")


@pytest.mark.usefixtures("known")
@pytest.mark.parametrize("law", OWN)
def test_runs_planned_for_the_laws_own_parameter_beat_spaced_ones(law: str) -> None:
    """Ten runs that are c-optimal for it give it a smaller error than ten spaced ones, and than the D-optimal ones."""
    own, k = problem(law), problem(law).names.index(OWN[law])
    planned = design(own, 10, OWN[law])
    others = [design(own, 10), *(evaluate_design(own, spaced_speeds(own, 10, kind)) for kind in ("log", "even"))]
    assert planned.errors[k] < min(x.errors[k] for x in others)
    # the derivative of steady torque by each parameter that is estimated is its central difference, to 1e-6
    p, v = truth_of(law), np.geomspace(0.01, 1.2, 30)
    found = static_jacobian(v, p)
    for k, name in enumerate(problem(law).names):
        x = getattr(p, name)
        up, down = (bristle.friction(v, p._replace(**{name: x * (1 + h)})) for h in (1e-5, -1e-5))
        difference = (up - down) / (2e-5 * x)
        assert np.linalg.norm(difference - found[:, k]) <= 1e-6 * np.linalg.norm(found[:, k])
