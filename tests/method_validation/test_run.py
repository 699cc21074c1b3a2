import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bristle
from bristle import identify
from bristle.arrays import Array
from bristle.estimation.levels import MOST_DECLINED
from bristle.identification.results import Joint
from bristle.identification.static import grid as static
from bristle.identification.static.batch import Batch
from bristle.identification.static.profiles import profiled
from bristle.questions.method_validation import report as figures
from bristle.questions.method_validation import run as running
from bristle.questions.method_validation import solvers as methods
from bristle.questions.method_validation.cases import MOST_POINTS, CaseSet, joint_cases, sweep
from bristle.questions.method_validation.report import drawings, resolution_said
from bristle.questions.method_validation.results import FREE, SAME_COST, RandomStarts, Validation
from bristle.questions.method_validation.run import POLISHED, REFINED, spread, validate
from bristle.questions.method_validation.solvers import ValidationCase, case_names
from bristle.questions.method_validation.verdict import overall, verdict
from bristle.simulation import edro
from bristle.simulation.bench import steady_points

from ..conftest import FEW, run, speeds, table, tree, write
from ..pages import assert_tables_are_named, findings, page_text
from ..sameness import held, without_sentences
from .conftest import EVEN, NONE_BELOW, WIDE, case_of, designs, quick

P = edro.TABLE_1["gripper rotation"].positive
NAMES = case_names(P.law)


def torques_of(case: ValidationCase, sets: int, seed: int = 0) -> Array:
    """Simulated data sets, (n, sets)."""
    rng = np.random.default_rng(seed)
    return np.ascontiguousarray(steady_points(case.truth, case.velocity, case.noise, rng, sets).T)


def test_the_sweep_is_what_it_says(joint: Joint) -> None:
    """Eight sets, two noise levels, three designs; the third has no speed below v_s; v_s lies within the grid's range; directions keep their sign."""
    cases = sweep().cases
    assert len(cases) == len({(c.label, c.design, c.noise) for c in cases}) == 8 * 2 * 3
    assert {c.truth for c in cases} == {p.stribeck for pair in edro.TABLE_1.values() for p in pair}
    assert all(c.v_s_range[0] < c.truth.v_s < c.v_s_range[1] for c in cases)
    assert all(np.all(c.velocity < 0) == ("(-)" in c.label) for c in cases)
    assert all((np.abs(c.velocity).min() > c.truth.v_s) == (c.design == designs()[NONE_BELOW]) for c in cases)
    # a joint's own cases have its velocities, its fitted parameters, its range of v_s, and its noise, corrected for four parameters
    case_set = joint_cases(joint)
    assert [c.label for c in case_set.cases] == ["wrist (+)", "wrist (-)"]
    for case, fit in zip(case_set.cases, joint.static.values(), strict=True):
        assert case.velocity.tolist() == fit.velocity.tolist()
        assert case.theta.tolist() == [fit.parameters[name].value for name in NAMES]
        assert case.noise == pytest.approx(np.sqrt(np.sum(fit.residuals**2) / (fit.n - 4)), rel=1e-12)
        assert case.v_s_range == pytest.approx(static.default_range(fit.velocity), rel=1e-12)
    louder = joint_cases(joint, 0.03)
    assert [c.noise for c in louder.cases] == pytest.approx([0.03 * c.truth.alpha_0 for c in louder.cases])


DIRECTIONS = st.sampled_from([1.0, -1.0])
VISCOUS = st.sampled_from([0.0, 1.0])


@settings(max_examples=12)
@given(st.integers(0, 2), st.floats(1e-3, 0.1), st.integers(3, 1200), st.integers(0, 99), DIRECTIONS, VISCOUS)
def test_many_plain_grids_are_those_of_each(
    design: int, noise: float, count: int, seed: int, sign: float, viscous: float
) -> None:
    """A plain grid over many sets at once costs what the paper's costs set by set, bounds included, of which alpha_2 = 0 is one."""
    case = case_of(design, noise, sign)
    case = replace(case, truth=case.truth._replace(alpha_2=viscous * case.truth.alpha_2))
    torques = torques_of(case, 4, seed)
    together = methods.plain(case, torques, count)
    apart = np.stack([static.plain_grid(case.problem(x), case.v_s_range, count)[2] for x in torques.T], axis=1)
    assert methods.costs(case, torques, together) == pytest.approx(methods.costs(case, torques, apart), rel=1e-10)
    assert (together[:3] >= 0).all()
    step = (case.v_s_range[1] - case.v_s_range[0]) / (count - 1)
    on_grid = (together[3] - case.v_s_range[0]) / step
    assert on_grid == pytest.approx(np.round(on_grid), abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_solver_solves_the_same_problem(sign: float) -> None:
    """Begun near the truth, every solver ends in the minimum of the refined grid, in either direction, and stays within its bounds."""
    # on the model's own points without noise, grid and every solver, begun at half the truth, return the truth
    case = case_of(WIDE, 0.02, sign)
    torque, exact = torques_of(case, 1)[:, 0], methods.modelled(case, case.theta[:, None])
    solution = static.solve(case.problem(torque), case.v_s_range)
    assert methods.refined(case, exact)[:, 0] == pytest.approx(case.theta, rel=1e-6)
    solvers = methods.local_methods(case)
    assert {"IPOPT", "SciPy TRF", "lmfit"} <= set(solvers)
    for name, fit in solvers.items():
        end = fit(torque, 1.1 * case.theta)
        assert end == pytest.approx(solution.theta, rel=1e-4), name
        assert methods.costs(case, torque[:, None], end[:, None])[0] == pytest.approx(solution.cost, rel=1e-8), name
        assert fit(exact[:, 0], 0.5 * case.theta) == pytest.approx(case.theta, rel=1e-4), name


def test_starts_and_resolution() -> None:
    """Random starts fill the grid's bounds: each quarter of log(v_s)'s range, and of each alpha's, holds about a quarter of them."""
    case = case_of(EVEN)
    starts = methods.random_starts(case, 4000, np.random.default_rng(0))
    low, high = case.v_s_range
    v_s = np.log(starts[:, 3] / low) / np.log(high / low)
    for column in (*(starts[:, :3] / case.unknowns.scale[:3]).T, v_s):
        assert np.histogram(column, 4, (0, 1))[0] == pytest.approx(1000, abs=120)
    # where the grid is finer than the noise, the RMS error of its v_s is a step over the square root of 12, and the floor is the spread
    case = case_of(WIDE)
    torques = torques_of(case, 1500)
    grid = Batch(case.problem(torques[:, 0]), torques, case.v_s_range).theta
    found = running._resolution(grid, {n: methods.plain(case, torques, n) for n in (500, 1000)})
    low, high = case.v_s_range
    for count, error in zip(found.counts, found.error, strict=True):
        assert error == pytest.approx((high - low) / (count - 1) / np.sqrt(12), rel=0.06)
    assert found.floor == float(spread(grid[3]))


@settings(max_examples=20)
@given(seed=st.integers(0, 999), scale=st.floats(0.1, 10), shift=st.floats(-5, 5))
def test_spread_is_a_standard_deviation(seed: int, scale: float, shift: float) -> None:
    """Of Gaussian values `spread` is their standard deviation; it scales with them, is not shifted, and one outlier in a thousand hardly moves it."""
    values = np.random.default_rng(seed).standard_normal(20_000)
    assert float(spread(values)) == pytest.approx(1.0, abs=0.05)
    assert float(spread(scale * values + shift)) == pytest.approx(scale * float(spread(values)), rel=1e-9)
    values[:20] = 1e9
    assert float(spread(values)) == pytest.approx(1.0, abs=0.06)


@pytest.mark.parametrize("design", [WIDE, EVEN, NONE_BELOW])
@pytest.mark.parametrize("noise", [0.005, 0.05])
def test_ipopt_never_undercuts_the_refined_grid(design: int, noise: float) -> None:
    """From random starts within the grid's bounds IPOPT never ends more than 1e-6, relative, below the refined grid's cost."""
    case = case_of(design, noise)
    torques = torques_of(case, 12, seed=1)
    starts = methods.random_starts(case, 12, np.random.default_rng(2))
    fit = methods.ipopt(case)
    ends = np.stack([fit(t, x) for t, x in zip(torques.T, starts, strict=True)], axis=1)
    assert (ends[3] >= case.v_s_range[0] * (1 - 1e-9)).all()
    assert (ends[3] <= case.v_s_range[1] * (1 + 1e-9)).all()
    assert (ends[:3] >= 0).all()
    lowest = methods.costs(case, torques, methods.refined(case, torques))
    assert (methods.costs(case, torques, ends) > lowest * (1 - SAME_COST)).all()


def test_what_is_counted_of_grids_and_minima(validation: Validation) -> None:
    """`enough` is the first resolution from which on the error is at most a tenth of the floor."""
    uneven = replace(validation.cases[0].resolution, counts=(8, 16, 32), error=np.array([0.05, 0.2, 0.1]), floor=1.0)
    assert (uneven.enough, replace(uneven, floor=0.5).enough) == (32, None)
    # nothing within the range undercuts the refined grid; IPOPT begun there stays; plain grids approach it as they become finer
    for one in validation.cases:
        assert one.cost_deficit <= SAME_COST
        assert one.methods[REFINED].other_minimum == one.methods[REFINED].failed == 0.0
        assert one.resolution.error[-1] < one.resolution.error[0] / 10
    assert max(one.polish_shift for one in validation.cases[:2]) < 1e-3
    # a start is outside where v_s, set free, leaves the range at a lower cost; it does not count against the grid
    case = case_of(WIDE)
    final = np.tile(case.theta[:, None], 5)
    final[3] = [*(np.array([0.5, 0.5, 0.9, 1.0]) * case.v_s_range[0]), 2 * case.v_s_range[1]]
    cost = np.array([1 - 1e-5, 1 - 1e-7, 1.0, 1 - 1e-5, 1 - 1e-5])
    apart = RandomStarts(initial_v_s=np.ones(5), final={FREE: final}, best=case.theta, best_cost=1.0, cost={FREE: cost})
    found = replace(validation.cases[0], case=case, starts=apart)
    assert found.outside_range.tolist() == [True, False, False, False, True]
    (said,) = (x for x in verdict(found) if x.code == "lower-outside-range")
    assert said.numbers == {"count": 2, "starts": 5, "low": final[3, 0], "high": final[3, 4]}
    # a start is in another minimum where it ends more than 1e-6 above the lowest cost within the range; v_s set free does not count
    theta = np.array([[1.0, 1.0, 1.0], [0.1, 0.1, 0.1], [1e-6, 0.5, 0.5], [0.1, 0.1, 0.1]])
    starts = RandomStarts(
        initial_v_s=np.ones(3), final={"IPOPT": theta, FREE: theta}, best=theta[:, 1], best_cost=1.0,
        cost={"IPOPT": np.array([2.0, 1.0 + 5e-7, 1.0 + 5e-6]), FREE: np.array([0.5, 0.5, 0.5])},
    )  # fmt: skip  # a table
    assert starts.in_other_minimum("IPOPT").tolist() == [True, False, True]


def test_verdicts_hold_their_numbers(validation: Validation, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a speed below v_s bristle declines nearly always, and the verdict says that no method can know; elsewhere it never declines there."""
    known, noisy, blind = validation.cases
    assert (known.declined, known.not_identifiable, noisy.not_identifiable) == (0.0, False, False)
    assert blind.declined > MOST_DECLINED
    for result, kind, below, speeds_ in ((blind, "v-s-unknowable", 0, 12), (known, "v-s-knowable", 7, 16)):
        first = verdict(result)[0]
        assert (first.code, first.numbers["below"], first.numbers["speeds"]) == (kind, below, speeds_)
    assert "plain-grid-error" not in {x.code for x in verdict(blind)}
    # shares, resolution and times of the verdict are those counted, and the text says them
    numbers, text = {x.code: x.numbers for x in verdict(known)}, bristle.report_of(validation).text()
    share = 100 * known.resolution.share(500)
    ratio = known.methods[POLISHED].seconds / known.methods[REFINED].seconds
    assert (numbers["plain-grid-error"]["share"], dict(numbers["fit-times"]["times"])[POLISHED]) == (share, ratio)
    assert f"{share:.3g} % of its standard error" in text
    assert f"{POLISHED} {ratio:.2g}" in text
    other = [(name, 100 * known.starts.in_other_minimum(name).mean()) for name in known.starts.solvers]
    assert list(numbers.get("starts-part", {"other": other})["other"]) == other
    assert ("starts-part" in numbers) == any(share for _, share in other)
    assert [x.code for x in overall(validation)] == ["never-undercut", "design-validated", "design-validated"]
    # had IPOPT found less than the refined grid, verdict and summary would say so and by how much
    worse = replace(known, cost_deficit=3e-4)
    assert ("ipopt-undercuts", {"deficit": 3e-4}) in [(x.code, x.numbers) for x in verdict(worse)]
    claim = overall(replace(validation, cases=(worse,)))[0]
    assert (claim.code, claim.numbers["deficit"]) == ("undercut", 3e-4)
    # with every template replaced by its kind's name the verdicts are the same values
    before = held([*map(verdict, validation.cases), overall(validation)])
    without_sentences(monkeypatch)
    assert held([*map(verdict, validation.cases), overall(validation)]) == before


def test_intervals_of_bristle_cover_as_counted(validation: Validation) -> None:
    """Coverage of covariance and profile is that of the intervals of each set; the bootstrap is there only where v_s can be known."""
    one = validation.cases[1]
    rng = np.random.default_rng([validation.seed, 1])
    torques = np.ascontiguousarray(steady_points(one.case.truth, one.case.velocity, one.case.noise, rng, 60).T)
    solved = [(p, static.solve(p, one.case.v_s_range)) for p in map(one.case.problem, torques.T)]
    low, high = np.array([[profiled(p, x).intervals[name] for name in p.names] for p, x in solved]).T
    shares = {c.kind: c.share for c in one.coverage}
    inside = (low <= one.case.theta[:, None]) & (one.case.theta[:, None] <= high)
    assert shares["profile"] == pytest.approx(inside.mean(axis=1), abs=1e-12)
    assert all(0.8 < x <= 1 for c in one.coverage for x in c.share)
    assert [c.kind for c in validation.cases[2].coverage] == ["covariance", "profile"]
    assert [c.kind for c in one.coverage] == ["covariance", "profile", "bootstrap-t"]
    # where the truth has no Coulomb friction the tables name no noise in percent of it, and are written all the same
    without = replace(one, case=replace(one.case, truth=one.case.truth._replace(alpha_0=0.0)))
    assert replace(validation, cases=(without,)).to_frame()["noise_percent"].isna().all()
    # each case is announced before it is begun
    heard: list[tuple[str, int, int]] = []

    def stop(what: str, done: int, total: int) -> None:
        heard.append((what, done, total))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        validate(sweep(), progress=stop)
    assert heard == [("validating gripper rotation (+)", 0, 48)]


@pytest.fixture(scope="module")
def joint(tmp_path_factory: pytest.TempPathFactory) -> Joint:
    return identify(write(tmp_path_factory.mktemp("joint"), speeds())).joints[0]


def test_what_cannot_be_tried_is_skipped_and_said(
    joint: Joint, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a Stribeck term, points without noise, and as many as parameters, which moving runs may leave, are not tried, each with its reason."""

    def cases_of(v: Array, noise: float | None = None, stem: str = "e") -> tuple[Joint, CaseSet]:
        path = write(tmp_path, v, stem=stem)
        if noise is not None:
            (tmp_path / f"{stem}.csv").write_text(table(v, noise=noise))
        one = identify(path).joints[0]
        return one, joint_cases(one)

    # one fitted direction is enough, the other being said to have nothing to try
    fast, slow = np.linspace(1.0, 2.0, 12), speeds(both=False)
    flat, found = cases_of(fast, stem="flat")
    assert (found.cases, {*found.skipped}) == ((), {*flat.static})
    assert {reason.code for reason in found.skipped.values()} == {"no-stribeck-term"}
    _, found = cases_of(np.concatenate([slow, FEW[2:]]), stem="one")
    assert [c.label for c in found.cases] == ["wrist (+)"]
    assert [(d, x.code) for d, x in found.skipped.items()] == [("-", "no-stribeck-term")]
    exact, found = cases_of(slow, 1e-30, stem="exact")
    assert found.skipped["+"].code == "points-without-noise"
    assert len(joint_cases(exact, 0.01).cases) == 1
    fit = joint.static["+"]
    for n in (3, 4, 5):
        few = replace(fit, velocity=fit.velocity[:n], torque=fit.torque[:n], residuals=fit.residuals[:n])
        case_set = joint_cases(replace(joint, static=dict(joint.static) | {"+": few}))
        assert [reason.code for reason in case_set.skipped.values()] == ["too-few-to-validate"] * (n <= 4)
    # of more than 400 points 400 are simulated, with as much less noise: v_s keeps its standard error
    v = np.geomspace(0.15, 11.0, 1600) * P.v_s
    many, found = cases_of(v, 1e-3, stem="many")
    case = found.cases[0]
    assert (case.velocity.size, case.velocity.min(), case.velocity.max()) == (MOST_POINTS, v.min(), v.max())
    jacobian = case.problem(methods.modelled(case, case.theta[:, None])[:, 0]).jacobian(case.theta)
    thinned = case.noise * np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[3, 3])
    assert thinned == pytest.approx(many.static["+"].parameters["v_s"].standard_error, rel=0.15)
    # slow loading alone leaves nothing to check
    with pytest.raises(ValueError, match="got no ramp, points or tracking run that is fitted; add"):
        joint_cases(replace(joint, static={}))
    # lmfit is no dependency: where it is absent the others are tried
    monkeypatch.setattr(methods, "LMFIT", False)
    assert set(methods.local_methods(case_of(WIDE))) == {"IPOPT", "SciPy TRF"}


def test_figures_and_captions_say_what_was_found(validation: Validation) -> None:
    """Every figure says SIMULATED; axes carry units (m/s for a prismatic joint), and each solver is named."""
    one = validation.cases[0]
    cost, by_method = figures.cost_figure(one, "prismatic"), figures.methods_figure(one)
    for figure in (cost, by_method):
        assert "SIMULATED" in figure.axes[0].get_title(loc="left")
    assert "Stribeck velocity (m/s)" in {ax.get_xlabel() for ax in cost.axes}
    words = " ".join(cost.axes[0].get_legend_handles_labels()[1])
    assert all(name in words for name in ("IPOPT", "SciPy TRF", "refined grid"))
    assert [x.get_text() for x in by_method.axes[0].get_yticklabels()] == list(one.methods)
    # of how many starts each solver ends at the lowest cost, and how far off and how often the grid fails
    costs = {"IPOPT": [1.0, 1.0, 1.0], "SciPy TRF": [2.0, 1.0, 2.0]}
    ends = np.full((4, 3), 0.25)
    starts = replace(
        one.starts, initial_v_s=ends[3], final=dict.fromkeys(costs, ends), best=np.full(4, 0.5), best_cost=1.0,
        cost={name: np.array(cost) for name, cost in costs.items()},
    )  # fmt: skip  # a list of values
    failing = {REFINED: 0.0, "IPOPT, random start": 0.25, "SciPy TRF, random start": 0.5}
    off = np.full(4, -0.01 * one.case.truth.v_s)
    by_name = {name: replace(m, bias=off, failed=failing.get(name, 0.0)) for name, m in one.methods.items()}
    first, second = (x.caption for x in drawings(replace(one, starts=starts, methods=by_name), "prismatic", "case"))
    assert first.startswith(
        "The refined grid ends at vₛ = 0.5 m/s; of 3 random starts end at the lowest cost: IPOPT from 3, SciPy TRF from 1."
    )
    assert second.startswith(
        "The median error of vₛ by the refined grid is 1 %; it fails in 0 % of the data sets, a solver in up to 50 %."
    )
    # how many values a plain grid needs: the range over the cases, how many of them need more than was tried, and none
    counts = np.array(one.resolution.counts)
    for fine_from, expected in (
        ([125, 1000], "needs 125 to 1000 values for an error of vₛ below a tenth of its standard error."),
        (
            [64, None, None],
            "needs 64 to 64 values for an error of vₛ below a tenth of its standard error; in 2 of 3 cases no",
        ),
        ([None], "needs more values than were tried"),
        ([], "vₛ is not identifiable in any case"),
    ):
        errors = [np.where(counts >= (np.inf if n is None else n), 0.01, 1.0) for n in fine_from]
        cases = tuple(
            replace(one, declined=0.0, resolution=replace(one.resolution, floor=1.0, error=x)) for x in errors
        )
        assert expected in resolution_said(replace(validation, cases=cases)), fine_from


@pytest.mark.usefixtures("raster")
def test_the_page_holds_verdict_tables_and_figures(validation: Validation, tmp_path: Path) -> None:
    """The page says SIMULATED, escapes a hostile name, has each sentence, and its tables stand beside it as CSV, with every case and method."""
    # each caption begins with a sentence that holds a number, and each table has a name and a CSV file
    page = page_text(bristle.report_of(validation).write(tmp_path / "out"))
    assert [text for text in findings(page) if not re.search(r"\d", text)] == []
    assert_tables_are_named(tmp_path / "out")
    assert resolution_said(validation) in page
    assert "&lt;b&gt;three" in page
    assert "<b>three" not in page
    assert "SIMULATED data." in page
    assert "nan" not in page.lower()
    assert {p.stem for p in (tmp_path / "out" / "tables").iterdir()} == {"cases", "coverage"}
    cases = pd.read_csv(tmp_path / "out" / "tables" / "cases.csv")
    assert cases["declined_percent"].tolist() == [100 * one.declined for one in validation.cases]
    assert cases["ipopt_lead"].max() <= SAME_COST
    suffixes = sorted(p.suffix for p in (tmp_path / "out" / "figures").iterdir())
    assert suffixes == [".csv"] * 6 + [".png"] * 6 + [".svg"] * 6


def test_the_command_validates_and_writes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`bristle validate` prints the cross-check, the verdict of each direction and the summary, and writes the page where it was told."""
    quick(monkeypatch)
    path = write(tmp_path, speeds())
    ran = run("validate", path, "-o", tmp_path / "out", "--repetitions", 20, "--starts", 2, "--noise", 0.02)
    assert ran.code == 0
    for words in (
        *(f"[[({d}): Grid and full nonlinear fit agree" for d in "+-"), "wrist (-), SIMULATED, the 20 points measured",
        "The grid search holds: none of 16 IPOPT fits",
    ):  # fmt: skip  # a list of words
        assert words in ran.words
    assert (tmp_path / "out" / "index.html").is_file()
    monkeypatch.undo()
    # where a fit has no Stribeck term the command cross-checks it, says why nothing is tried, and ends well; too few points for any fit are
    # one sentence with the reason and what to do, and exit code 2. Neither writes a page
    flat, few = write(tmp_path, np.linspace(1.0, 2.0, 12), stem="flat"), write(tmp_path, FEW, stem="few")
    monkeypatch.chdir(tmp_path)
    before = tree(tmp_path)
    ran = run("validate", flat)
    assert ran.code == 0
    for words in (
        "agree: the largest difference is",
        "wrist +: nothing to validate: Stribeck term not",
        "Nothing was validated.",
    ):
        assert words in ran.words
    ran = run("validate", few)
    assert (ran.code, len(ran.said), ran.out) == (2, 1, "")
    assert "wrist: nothing to check: got no fit of friction vs velocity (Too few points" in ran.said[0]
    assert "add ramp, points or tracking runs" in ran.said[0]
    assert tree(tmp_path) == before


def test_the_api_validates_an_experiment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`bristle.validate` identifies first, or takes what is identified: all but the times is the same; another seed gives other data."""
    # the checks come before any work
    quick(monkeypatch)
    path = write(tmp_path, speeds(both=False))
    results = identify(path)
    first, again = (bristle.validate(x, repetitions=20, starts=2).cases[0] for x in (results, path))
    assert first.case.label == "wrist (+)"
    assert again.starts.final["IPOPT"].tolist() == first.starts.final["IPOPT"].tolist()
    assert again.methods[REFINED].bias.tolist() == first.methods[REFINED].bias.tolist()
    other = validate(joint_cases(results.joints[0]), repetitions=20, starts=2, seed=1).cases[0]
    assert other.starts.best.tolist() != first.starts.best.tolist()
    with pytest.raises(ValueError, match="repetitions: got 1"):
        bristle.validate("no such file", repetitions=1)
