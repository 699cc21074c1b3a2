import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bristle
from bristle.api import experiments
from bristle.arrays import Array
from bristle.findings import NOTE, Finding
from bristle.identification.identify import identify_joint
from bristle.identification.measured import measure
from bristle.model import functions
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import Lugre, Pair, fields_of
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design.start import start_of
from bristle.questions.sensitivity import study
from bristle.questions.sensitivity.joint import RANGE, of_joint, within
from bristle.questions.sensitivity.local import (
    FREQUENCIES,
    Map,
    SineMotion,
    claimed,
    grid,
    local,
    motion,
    sensitivity_map,
)
from bristle.questions.sensitivity.report import report
from bristle.questions.sensitivity.sobol import Effect, Global, Output, ordered
from bristle.questions.sensitivity.study import Expected, SensitivityStudy, findings
from bristle.simulation.edro import TABLE_1
from bristle.simulation.fisher import Information
from bristle.simulation.limits import limits_of

from ..conftest import FEW as TOO_FEW
from ..conftest import TRUTH, run, tree, write
from ..laws import DRAG, EXPONENT, OUTSIDE, registered, truth_of
from ..names import parse
from ..pages import assert_tables_are_named, page_text
from ..pages import findings as captions_of
from ..sameness import held, of_kind

FEW = settings(max_examples=25)
PAIR = TABLE_1["gripper rotation"]
P = PAIR.positive
PAPER = motion(1.0, 0.5)
SLOW_SMALL = motion(0.02, 0.2)
with registered():
    OF_LAWS = [truth_of(law) for law in (DRAG, EXPONENT, OUTSIDE)]
OF_LAWS_NAMED = ["a term that falls", "an exponent", "from outside"]
Study = study.SensitivityStudy
STEP = 1e-4  # relative, of the finite differences


def moved(p: Lugre[float] | Pair[float], name: str, share: float) -> Lugre[float] | Pair[float]:
    """The parameters with one of them larger by a share, in both directions."""
    if isinstance(p, Pair):
        return Pair(*(one._replace(**{name: getattr(one, name) * (1 + share)}) for one in p))
    return p._replace(**{name: getattr(p, name) * (1 + share)})


@pytest.mark.parametrize("p", [P, PAIR, *OF_LAWS], ids=["one set", "a pair", *OF_LAWS_NAMED])
@pytest.mark.parametrize("at", [PAPER, SLOW_SMALL], ids=["paper", "slow and small"])
def test_derivatives_are_differences_of_the_simulation(p: Lugre[float] | Pair[float], at: SineMotion) -> None:
    """Each total derivative is the extrapolated central difference of the simulated torque, to 1e-6 of its norm."""
    # each partial one is that of T_f (3)-(5) with z held as the simulation has it
    velocity, found = at.course.velocity, local(p, at)
    z = rollout(velocity, at.period, p, 0.0).z
    assert found.names == tuple(name for name in fields_of(p.law) if name != "v_end")

    def simulated(q: Lugre[float] | Pair[float]) -> Array:
        return rollout(velocity, at.period, q, 0.0).torque

    def held(q: Lugre[float] | Pair[float]) -> Array:
        acting = q if isinstance(q, Lugre) else evaluate(functions.active_function(q.law), z, velocity, *q[0], *q[1])
        return evaluate(functions.torque_function(q.law), z, velocity, *acting)[0]

    for k, name in enumerate(found.names):
        for torque, derivative in ((simulated, found.total[:, k]), (held, found.partial[:, k])):
            (near, far) = ((torque(moved(p, name, h)) - torque(moved(p, name, -h))) / (2 * h) for h in (STEP / 2, STEP))
            assert np.linalg.norm((4 * near - far) / 3 - derivative) <= 1e-6 * np.linalg.norm(derivative)


positive = st.floats(0.3, 3.0)
sets = st.builds(lambda *x: Lugre(*(a * b for a, b in zip(P, x, strict=True))), *[positive] * 6)
motions = st.builds(SineMotion, st.floats(0.003, 2.0), st.floats(0.1, 3.0), st.just(2.0), st.just(2e-3))


@FEW
@given(sets, motions, positive, positive, positive)
def test_shares_are_without_units(p: Lugre[float], at: SineMotion, mass: float, length: float, rate: float) -> None:
    """In other units of torque, angle and time every share is the same."""
    units = (mass, mass, mass / (length * rate), length * rate, mass / length, mass / (length * rate))
    other = Lugre(*(x * u for x, u in zip(p, units, strict=True)))
    scaled = SineMotion(at.amplitude * length, at.frequency * rate, at.duration / rate, at.period / rate)
    found = local(p, at)
    np.testing.assert_allclose(local(other, scaled).shares(), found.shares(), rtol=1e-6, atol=1e-12)
    # T_f grows as alpha_0, alpha_1, alpha_2, sigma_0 and sigma_1 all do: their derivatives add up to T_f itself (Euler), total and partial
    own = [k for k, name in enumerate(Lugre._fields) if name != "v_s"]
    for derivatives in (found.total, found.partial):
        total = derivatives[:, own].sum(axis=1)
        np.testing.assert_allclose(total, found.torque, atol=1e-9 * np.abs(found.torque).max())


def test_maps_limits_and_documented_figures() -> None:
    """In fast sliding the total derivatives are those of the steady torque; at fixed z they are not."""
    # by alpha_0 it is the sign of v times alpha_0, by sigma_0 nothing
    found = local(P, PAPER)
    fast = (np.abs(found.velocity) > 10 * P.v_s) & (found.time > 1.0)
    np.testing.assert_allclose(found.total[fast, 0], P.alpha_0 * np.sign(found.velocity[fast]), rtol=2e-3)
    assert np.abs(found.total[fast, 4]).max() < 1e-2 * P.alpha_0
    partial = P.sigma_1 * np.abs(found.velocity[fast]) * np.sign(found.velocity[fast])
    np.testing.assert_allclose(found.partial[fast, 0], partial, rtol=2e-3)
    # the motion's own amplitude and frequency are on the map, with the shares of its last period. On the gripper's map fast wide motions
    # are alpha_2's, slow wide ones alpha_0's, tiny ones sigma_0's. The paper's claim, that alpha_0 and alpha_2 lead, holds for its motion
    # of 1 rad at 0.5 Hz and not for tiny ones; for 0.02 rad at 0.2 Hz sigma_0 comes before alpha_2
    found = sensitivity_map(P, *grid(PAPER))
    i, j = np.argmin(np.abs(found.amplitudes - 1.0)), np.argmin(np.abs(found.frequencies - 0.5))
    assert (found.amplitudes[i], found.frequencies[j]) == (1.0, 0.5)
    np.testing.assert_allclose(found.shares[i, j], local(P, PAPER).shares(last=2000), rtol=1e-3)
    first = np.array(Lugre._fields)[found.first]
    assert (first[i, j], first[-1, -1], first[6, 0], first[0, 0]) == ("alpha_2", "alpha_2", "alpha_0", "sigma_0")
    assert found.claim[i, j]
    assert not found.claim[:2].any()
    for at, leading in ((PAPER, ("alpha_2", "alpha_0")), (SLOW_SMALL, ("alpha_0", "sigma_0"))):
        own = local(P, at)
        assert own.ranking[:2] == leading
        assert claimed(own.shares(), Lugre._fields) == (at == PAPER)
    # within the bristle's reach, moved slowly, T = sigma_0 q: the share of sigma_0 is one, the others' nothing
    shares = sensitivity_map(P, np.array([1e-6]), np.array([1e-3])).shares[0, 0]
    assert shares[4] == pytest.approx(1.0, abs=1e-3)
    assert np.delete(shares, 4).max() < 1e-3
    # the table in docs/sensitivity.md is what the command prints, digit for digit: over 10 s at 1 kHz from an undeflected bristle
    lines = (Path(__file__).parents[2] / "docs" / "sensitivity.md").read_text(encoding="utf-8").splitlines()
    rows = {cells[1].strip(): cells[2:8] for line in lines if len(cells := line.split("|")) == 9}
    shares = {
        "1 rad, 0.5 Hz": local(P, PAPER).shares(),
        "the same, its last period": local(P, PAPER).shares(last=2000),
        "0.02 rad, 0.2 Hz": local(P, SLOW_SMALL).shares(),
    }
    for name, own in shares.items():
        assert [cell.strip() for cell in rows[name]] == [f"{share:.2g}" for share in own]


@FEW
@given(st.floats(1e-4, 1e3), st.floats(*FREQUENCIES))
def test_a_motion_has_whole_windows(amplitude: float, frequency: float) -> None:
    """At least two periods are seen, with at least 200 samples each, and no more than some 400 000 samples in all."""
    found = motion(amplitude, frequency)
    assert found.duration * frequency >= 2 * (1 - 1e-9)
    assert 1 / (frequency * found.period) >= 200 * (1 - 1e-9)
    assert found.duration / found.period <= 4e5
    assert found.top_speed == pytest.approx(2 * np.pi * amplitude * frequency)


def test_what_a_study_of_points_assumes_and_says(known: Study, folder: Path) -> None:
    """Points tell nothing of the bristle: sigma_0 and sigma_1 are assumed and said to be, and have no interval."""
    # what was fitted is what is used
    assert {name.name for name in known.model.assumed} == {"sigma_0", "sigma_1"}
    assert {name.name for name in known.box} == {"alpha_0", "alpha_1", "alpha_2", "v_s"}
    assumed = {x.numbers["name"]: str(x) for x in of_kind(known.assumptions, "bristle-assumed")}
    assert {*assumed} == {*known.model.assumed}
    hows = {"sigma_0": "from a deflection of 0.001 of the travel", "sigma_1": "and a guessed inertia of"}
    assert [said for name, said in assumed.items() if hows[name.name] not in said] == []
    p = known.model.p
    np.testing.assert_allclose((p if isinstance(p, Lugre) else p.positive)[:4], TRUTH[:4], rtol=0.05)
    assert known.motion.top_speed == pytest.approx(0.4, rel=0.05)
    # the information of the joint's own constant velocities gives the standard errors that its static fit has
    static = known.expected[1]
    assert static.what == "the constant velocities"
    for name, error in zip(static.information.names, static.information.standard_errors, strict=True):
        assert static.errors[name] == pytest.approx(error, rel=1e-6)
    # what matters most first, with its share; six parameters with three shares each, everything else found, and every assumption. Its
    # frame, which is its page's table, has a row for each parameter, the largest total share first
    first, *lines = bristle.report_of(known).text().splitlines()
    answer, *found = findings(known)
    leading, share = max(zip(known.local.names, known.local.shares(), strict=True), key=lambda x: x[1])
    assert first == answer.message
    assert first.startswith(f"{leading} matters most for ")
    assert f"is {share:.2g}, then " in first
    assert sum(line.split()[0] in Lugre._fields for line in lines[2:8]) == 6
    assert lines[8:] == [x.flagged for x in (*found, *known.assumptions)]
    frame = known.to_frame()
    assert tuple(frame["parameter"]) == known.local.ranking
    for column, shares in (("total", known.local.shares()), ("settled", known.settled)):
        assert dict(zip(frame["parameter"], frame[column], strict=True)) == dict(
            zip(Lugre._fields, shares, strict=True)
        )
    pd.testing.assert_frame_equal(bristle.report_of(known).frames["shares"], frame)
    # one joint, one guess: sigma_0 and sigma_1 are those that a plan starts from, whatever the amplitude
    measured = measure(folder / "e.yaml")
    joint, (limits, _) = identify_joint(measured), limits_of(measured)
    start = start_of(measured, joint, limits)
    for amplitude in (None, 0.01):
        p = of_joint(measured, joint, amplitude)[0].p
        for d, own in zip("+-", (p, p) if isinstance(p, Lugre) else p, strict=True):
            assert own[4:] == start.p(d)[4:]


def test_without_sympy_all_else_is_found(folder: Path, known: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without SymPy everything else is found and reported; the text says what is not there, with the command that installs it."""
    whole = bristle.report_of(known).frames.keys()
    monkeypatch.setitem(sys.modules, "sympy", None)
    found = bristle.sensitivity(folder / "e.yaml", samples=0)
    report = bristle.report_of(found)
    assert "No formulas: formulas need SymPy, which is not installed; install it with pip install" in report.text()
    assert report.frames.keys() == whole - {"formulas"}
    assert held(replace(found, assumptions=())) == held(replace(known, formulas=None, assumptions=()))


def test_which_joints_and_motions_can_be_explored(tmp_path: Path, known: Study, folder: Path) -> None:
    """A joint of which no friction was fitted has no sensitivity."""
    measured = measure(write(tmp_path, TOO_FEW))
    with pytest.raises(ValueError, match="nothing is known of its friction vs velocity"):
        of_joint(measured, identify_joint(measured))
    # a position that is one number throughout has no travel to guess a bristle from; it names plan.position
    measured = measure(folder / "e.yaml")
    run_ = measured.runs[0]
    still = replace(run_, record=replace(run_.record, position=np.ones(run_.record.rows)))
    with pytest.raises(ValueError, match=r"the position is 1 throughout; expected runs that move, or plan\.position"):
        of_joint(replace(measured, runs=(still,)), identify_joint(measured))
    # at the corners of what is accepted and of its maps every share is finite; just beyond, the motion is refused
    limits, p = limits_of(measured)[0], known.model.p
    (low, high), (slow, fast) = RANGE, FREQUENCIES
    speed, travel = limits.velocity / (2 * np.pi), limits.travel
    corners = (
        (low * travel, fast), (low * travel, 1.01 * speed / travel), (0.99 * high * travel, 1.01 * slow),
        (0.99 * high * speed / fast, fast), (0.99 * high * travel, speed / travel),
    )  # fmt: skip  # a list of values
    for amplitude, frequency in corners:
        at = within(motion(amplitude, frequency), "revolute", limits)
        amplitudes, frequencies = (x[[0, -1]] for x in grid(at))
        assert np.isfinite(local(p, at).shares()).all()
        assert np.isfinite(sensitivity_map(p, amplitudes, frequencies).shares).all()
    for amplitude, frequency, named in (
        (0.99 * low * travel, 1.0, "amplitude: got"), (1.01 * high * travel, 1e-5, "times the joint's travel: choose another"),
        (0.99 * low * speed / 1e-3, 1e-3, "peak speed: got"), (1.01 * high * speed, 1.0, "peak speed: got"),
        *((1.0, frequency, "choose one at which the joint may move") for frequency in (0.0, -1.0, 1e5, np.inf, np.nan)),
    ):  # fmt: skip  # a table
        with pytest.raises(ValueError, match=named):
            within(motion(amplitude, frequency), "revolute", limits)


def test_the_command_writes_a_page(folder: Path, known: Study, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The command prints what was found and writes index.html with a table and a figure of each kind."""
    # each caption begins with a sentence that holds a number, and each table has a name and a CSV file
    whole = replace(known, sobol=SOBOL)
    monkeypatch.setattr(experiments, "study_sensitivity", lambda *_: whole)
    ran = run("sensitivity", folder / "e.yaml", "-o", folder / "out", "--samples", 0)
    assert (ran.code, ran.said) == (0, [])
    assert "The paper's claim" in ran.out
    made = {path.relative_to(folder / "out").as_posix() for path in (folder / "out").rglob("*.*")}
    figures = ("time", "first", "map", "correlation-1", "correlation-2", "sobol")
    assert {f"figures/{name}.png" for name in figures} | {"index.html"} <= made
    assert {f"tables/{name}.csv" for name in ("shares", "map", "information", "formulas")} <= made
    page = page_text(folder / "out" / "index.html")
    assert "nan" not in page.lower()
    assert "in the friction of wrist" in page
    said = captions_of(page)
    assert len(said) == len(figures)
    assert [text for text in said if not re.search(r"\d", text)] == []
    assert_tables_are_named(folder / "out")
    monkeypatch.undo()
    # with --symbolic the derivatives are printed, the comparison with (19) last, and no file is made
    monkeypatch.chdir(tmp_path)
    ran = run("sensitivity", "--symbolic")
    assert ran.code == 0
    assert "sigma_0*sigma_1*z*abs(v)/g**2" in ran.out
    assert "It is not dT_f/dalpha_0" in ran.out
    assert not tree(tmp_path)


WHOLE = Output(
    name="RMS friction torque",
    quantity="torque",
    effects=(Effect(parse("alpha_0"), 0.1, 0.01, 0.2, 0.01), Effect(parse("v_s"), 0.9, 0.01, 0.9512, 0.034)),
    mean=1.0, deviation=1.0, samples=32, evaluations=128,
)  # fmt: skip  # a list of values
SPANS = ordered({parse("alpha_0"): (0.1, 0.2), parse("v_s"): (0.01, 0.02)}, GAUSSIAN)
SOBOL = Global(spans=SPANS, outputs=(WHOLE,), amplitude=1.0, frequency=1.0, seed=0)


def captions(study: SensitivityStudy) -> dict[str, str]:
    """The first sentence of each figure's caption, by the name of its file."""
    figures = (section.figure for section in report(study).sections)
    return {x.name: re.sub(r"(?<=[a-z0-9%)₀-₉ₛ±·])\. .*$", ".", x.caption) for x in figures if x is not None}


def test_captions_begin_with_what_was_found(known: SensitivityStudy) -> None:
    """Largest derivative and share, extent of the paper's claim and strongest correlation are those of the study's own tables."""
    assert f"{known.map.claim.sum()} of {known.map.claim.size} motions" in captions(known)["first"]
    # a force is none in N·m
    total = np.zeros_like(known.local.total)
    total[0, 5], total[:, 0] = -7.0, 2.5
    found = captions(replace(known, local=replace(known.local, total=total), kind="prismatic"))["time"]
    assert found == "To first order, doubling σ₁ changes the force most, by up to 7 N at 0 s."
    # where sigma_0 and sigma_1 lead on the whole map, the paper's two parameters have the two largest shares in 0 % of it
    shares = np.full((2, 3, 6), 0.01)
    shares[..., 4:] = 0.5
    shares[0, 0, 4], shares[1, 2, 4] = 1e-7, 1.25
    of = Map(names=known.map.names, amplitudes=np.ones(2), frequencies=np.ones(3), shares=shares)
    found = captions(replace(known, map=of))
    assert found["first"] == "α₀ and α₂ have the two largest shares in 0 % of the map, 0 of 6 motions."
    assert found["map"] == "The share of σ₀ varies most over the map, from less than 0.1 % to 120 %."
    # the strongest correlation is off the diagonal and of two parameters that are seen; how many are not is said beside it
    strongest = "The strongest correlation is that of α₀ and vₛ, −0.50"
    for matrix, expected in (
        ([[1.0, 0.5], [0.5, 1.0]], f"{strongest}."),
        ([[1.0, 0.0], [0.0, 0.0]], "No two parameters are correlated; 1 of 2 parameters cannot be estimated (×)."),
        ([[1.0]], "No two parameters are correlated."),
        (
            [[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]],
            f"{strongest}; 1 of 3 parameters cannot be estimated (×).",
        ),
    ):
        names = tuple(map(parse, ("alpha_0", "v_s", "sigma_1")[: len(matrix)]))
        information = Information(names=names, point=np.ones(len(names)), matrix=np.array(matrix))
        said = captions(replace(known, sobol=None, expected=(Expected("the motion", information, {}, ()),)))
        assert "sobol" not in said
        assert said["correlation-1"] == expected
    # the largest index is that of all outputs that have any
    bare = Output(name="breakaway torque", quantity="torque", reason=Finding("x", NOTE, "Nothing changes it."))
    for outputs, expected in (
        ((bare, WHOLE), "vₛ has the largest total index, 0.951 ± 0.034 for the RMS friction torque."),
        ((bare,), "No output can be analysed."),
    ):
        assert captions(replace(known, sobol=replace(SOBOL, outputs=outputs)))["sobol"] == expected
