from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as options
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.data.experiment.load import Experiment, Run, load_experiment
from bristle.data.record import Record
from bristle.estimation.autocorrelation import inflation
from bristle.identification import model_selection
from bristle.identification.comparison import APART, ONE, SYMMETRIC, Comparison, Row
from bristle.identification.dynamic.fit import fit_tracking
from bristle.identification.dynamic.problem import dynamic_problem
from bristle.identification.fits import TrackingFit
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured, measure
from bristle.identification.model_selection import COULOMB, LUGRE, STRIBECK, VISCOUS, Candidate, rank_models
from bristle.identification.results import Joint
from bristle.identification.static.fit import fit_moving
from bristle.model.parameters import Lugre, Pair

from ..conftest import present
from ..names import parse
from ..sameness import of_kind
from .conftest import GRIPPER, OTHER, TONES, by_name, curve, experiment_file, moved, points_file, tones

FLAT = Lugre(0.02, 0.0, 0.04, 1.0, 6.0, 0.02)
SPEEDS = np.geomspace(0.015, 0.8, 12)
NOISE = 2e-4
WOBBLE = np.array([1e-4, -1e-4, 1e-4])
STEP = 2e-3


def points(folder: Path, plus: Lugre[float], minus: Lugre[float] | None, seed: int = 0, fit: str = "") -> Joint:
    """The joint identified from points of these sets, with noise."""
    rng = np.random.default_rng(seed)
    v = np.concatenate([SPEEDS, -SPEEDS]) if minus else SPEEDS
    torque = np.where(v > 0, curve(v, plus), curve(v, minus or plus)) + NOISE * rng.standard_normal(v.size)
    return joint_of(folder, v, torque, fit)


def joint_of(folder: Path, v: Array, torque: Array, fit: str = "") -> Joint:
    return identify_joint(measure(points_file(folder, v, torque, fit)))


def row(compared: Comparison, model: str, directions: str) -> Row:
    return present(compared.row(called(model, directions)))


def called(model: str, directions: str) -> str:
    """A model as its row is named."""
    return model if directions == ONE else f"{model}, {directions}"


def is_of(row: Row, model: str) -> bool:
    return row.name.partition(",")[0] == model


REFUSED = "the Stribeck term is not identifiable from these data, as the fit found"


def reasons(compared: Comparison, words: str) -> list[str]:
    return [why for why in map(str, compared.sentence.numbers["why"]) if words in why]


def used(compared: Comparison) -> Row:
    (found,) = (r for r in compared.rows if r.chosen)
    return found


def designs(v: Array) -> dict[tuple[str, str], Array]:
    """The columns of the linear models, (n, m)."""
    s, up = np.sign(v), v > 0
    one = [s, v]
    two = [np.where(up, s, 0), np.where(up, v, 0), np.where(up, 0, s), np.where(up, 0, v)]
    return {
        (COULOMB, SYMMETRIC): np.stack(one[:1], axis=1),
        (VISCOUS, SYMMETRIC): np.stack(one, axis=1),
        (COULOMB, APART): np.stack(two[::2], axis=1),
        (VISCOUS, APART): np.stack(two, axis=1),
    }


@pytest.mark.parametrize("seed", range(3))
def test_linear_models_are_least_squares_with_the_criteria_and_leave_one_out_by_their_definitions(
    tmp_path: Path, seed: int
) -> None:
    """For each linear model: rms by lstsq, BIC from the maximised Gaussian likelihood, hold-out from refits without each point."""
    # a model with more terms leaves no more: Coulomb within Coulomb + viscous within Stribeck, each symmetric one
    # within that per direction
    joint = points(tmp_path, GRIPPER, OTHER, seed)
    (compared,) = joint.models
    v = np.concatenate([SPEEDS, -SPEEDS])
    torque = np.concatenate([joint.static[d].torque for d in "+-"])
    n, scores = v.size, {}
    for (model, directions), columns in designs(v).items():
        own = row(compared, model, directions)
        rest = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
        assert own.rms == pytest.approx(np.sqrt(np.mean(rest**2)), rel=1e-9)
        assert own.parameters == columns.shape[1]
        variance, k = np.mean(rest**2), columns.shape[1] + 1
        likelihood = float(np.sum(-(rest**2) / (2 * variance) - 0.5 * np.log(2 * np.pi * variance)))
        scores[own] = k * np.log(n) - 2 * likelihood
        out = [
            torque[i] - columns[i] @ np.linalg.lstsq(np.delete(columns, i, 0), np.delete(torque, i), rcond=None)[0]
            for i in range(n)
        ]
        assert own.left_out == pytest.approx(100 * np.linalg.norm(out) / np.linalg.norm(torque), rel=1e-8)
    first = next(iter(scores))
    for own, bic in scores.items():
        assert own.bic - first.bic == pytest.approx(bic - scores[first], abs=1e-6)
    assert min(r.bic for r in compared.rows) == 0
    assert compared.effective == compared.n == n
    for directions in (SYMMETRIC, APART):
        left = [row(compared, m, directions).rms for m in (COULOMB, VISCOUS, STRIBECK)]
        assert left == sorted(left, reverse=True)
    for model in (COULOMB, VISCOUS, STRIBECK):
        assert row(compared, model, APART).rms <= row(compared, model, SYMMETRIC).rms * (1 + 1e-9)
    assert not any(is_of(r, LUGRE) for r in compared.rows)


@pytest.mark.parametrize(
    ("plus", "minus", "expected"),
    [
        (GRIPPER, OTHER, (STRIBECK, APART)),
        (GRIPPER, GRIPPER, (STRIBECK, SYMMETRIC)),
        (FLAT, FLAT._replace(alpha_2=0.06), (VISCOUS, APART)),
        (FLAT, FLAT, (VISCOUS, SYMMETRIC)),
        (GRIPPER, None, (STRIBECK, ONE)),
    ],
)
def test_the_model_that_made_the_data_is_advised(
    tmp_path: Path, plus: Lugre[float], minus: Lugre[float] | None, expected: tuple[str, str]
) -> None:
    """From clear data the advice is the model that made them, and the sentence names it."""
    (compared,) = points(tmp_path, plus, minus).models
    best = used(compared)
    assert compared.sentence.code == "use-model"
    assert compared.sentence.numbers["model"] == best.name == called(*expected)
    assert bool(reasons(compared, REFUSED)) == (expected[0] != STRIBECK)


@given(seed=st.integers(0, 10_000), alpha_1=st.sampled_from([0.0, 3e-4, 6e-4, 2e-3]))
@options(max_examples=12, deadline=None)
def test_advice_never_contradicts_the_fit(tmp_path_factory: pytest.TempPathFactory, seed: int, alpha_1: float) -> None:
    """Whatever the data: the advised model has a Stribeck term if and only if the fit keeps one, and is the best of those by BIC."""
    p = GRIPPER._replace(alpha_1=alpha_1)
    joint = points(tmp_path_factory.mktemp("x"), p, None, seed)
    (compared,) = joint.models
    kept = joint.static["+"].parameters["alpha_1"].value is not None
    best = used(compared)
    assert is_of(best, STRIBECK) == kept
    assert bool(reasons(compared, REFUSED)) == (not kept)
    assert best.bic == min(r.bic for r in compared.rows if r.candidate)


def test_too_few_points_are_said(tmp_path: Path) -> None:
    """Three speeds of one direction: no Stribeck curve, said; and one speed alone gives no comparison that needs two."""
    v = np.array([0.1, 0.3, 0.6])
    (compared,) = joint_of(tmp_path, v, curve(v, FLAT) + WOBBLE).models
    assert {r.name for r in compared.rows} == {COULOMB, VISCOUS}
    (few,) = of_kind(compared.left_out, "too-few-for-models")
    assert few.numbers["models"] == (f"{STRIBECK}, {ONE}",)
    v = np.array([0.1, 0.1 + 1e-9, 0.1 + 2e-9])
    found = joint_of(tmp_path, v, curve(v, FLAT) + WOBBLE).models
    assert [r.name for x in found for r in x.rows] == [COULOMB]
    # where the fit keeps no Stribeck term but a criterion would, the advice stays with the fit and says by how much the criterion differs
    static = points(tmp_path, FLAT, None).static
    assert static["+"].parameters["alpha_1"].value is None
    sizes = {COULOMB: 3.0, VISCOUS: 1.0, STRIBECK: 0.5}
    pairs = zip(sizes.items(), (1, 2, 4), strict=True)
    found = {(model, ONE): Candidate(np.full(50, x), k) for (model, x), k in pairs}
    judged = present(rank_models("points", found, 1.0, 100.0, static, None, ()))
    assert used(judged).name == VISCOUS
    (refused,) = reasons(judged, REFUSED)
    assert refused == f"{REFUSED}, though it would lower the BIC by {used(judged).bic:.1f} (the fit's warnings say why)"
    assert used(judged).bic == pytest.approx(50 * np.log(4) - 2 * np.log(50))


def run(seed: int) -> Record:
    """A moving run of a joint that differs between directions, with noise."""
    v = tones(np.arange(0.0, 6.0, STEP), TONES[:4])
    return moved(v, STEP, Pair(GRIPPER, OTHER), 2e-5, seed=seed, file=f"run{seed}.csv")


@pytest.fixture(scope="module", params=["separate", "symmetric"])
def on_motion(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Comparison, TrackingFit]:
    """The comparison on a moving run of a joint that differs between directions, and its fit, per direction or symmetric."""
    records, held = [run(0)], [run(1)]
    v = np.zeros(2)
    fit = f"directions: {request.param}, decimation: 2"
    experiment = load_experiment(experiment_file(tmp_path_factory.mktemp("moving"), {"t": v, "v": v, "T": v}, fit=fit))
    alone = whole(experiment, records, held, ("+", "-") if request.param == "separate" else ("both",))
    static = fit_moving(experiment, records, [])[0]
    runs = tuple(Run(kind="tracking", record=r, hold_out=r is held[0]) for r in (*records, *held))
    measured = Measured(experiment=experiment, runs=runs, segments=((), ()))
    compared = present(model_selection.compare_on_motion(measured, static, alone))
    return compared, alone


def whole(
    experiment: Experiment, records: list[Record], held: list[Record], directions: tuple[str, ...]
) -> TrackingFit:
    asked = model_selection.asked_regressors(experiment, directions, moving=True)
    start = by_name(GRIPPER if directions == ("both",) else Pair(GRIPPER, OTHER))
    start |= {parse("offset"): 0.0} if "offset" in asked else {}
    problem, test = (dynamic_problem(r, directions, asked, experiment.fit.every, None) for r in (records, held))
    return fit_tracking(problem, start, "revolute", [("held", test)], search=False).fit


def test_models_on_a_moving_run(on_motion: tuple[Comparison, TrackingFit]) -> None:
    """On moving runs the two are one model: the same residuals, parameters, criteria and hold-out error."""
    compared, _ = on_motion
    one, two = row(compared, COULOMB, SYMMETRIC), row(compared, COULOMB, APART)
    assert one.parameters == two.parameters
    assert one.rms == pytest.approx(two.rms, rel=1e-9)
    assert one.bic == pytest.approx(two.bic, abs=1e-6)
    assert one.left_out == pytest.approx(two.left_out, rel=1e-9)
    # LuGre made the run, per direction: it is advised so, whichever fit was asked for; the fit that was done is not done again
    compared, alone = on_motion
    best = used(compared)
    assert best.name == called(LUGRE, APART)
    done = row(compared, LUGRE, APART if parse("alpha_0+") in alone.parameters else SYMMETRIC)
    assert done.rms == pytest.approx(alone.rms, rel=1e-12)
    assert done.left_out == pytest.approx(alone.hold_out[0].relative_error, rel=1e-12)
    assert done.parameters == len(alone.names) + 1
    assert best.rms < 3e-5
    assert best.left_out is not None
    assert best.left_out < min(r.left_out or 0.0 for r in compared.rows if not is_of(r, LUGRE)) / 10
    assert len(compared.rows) == 8
    assert 1 < compared.effective < compared.n
    if done is best:
        assert compared.effective == pytest.approx(compared.n / inflation(alone.residuals))
    # the criteria of two models differ by n' times the logarithm of their residuals' ratio, plus the terms of their parameters; n' =
    # effective
    compared, _ = on_motion
    a, b = row(compared, VISCOUS, SYMMETRIC), row(compared, STRIBECK, SYMMETRIC)
    n = compared.effective
    assert b.bic - a.bic == pytest.approx(
        2 * n * np.log(b.rms / a.rms) + (b.parameters - a.parameters) * np.log(n), abs=1e-6
    )
    # without any sigma_0 LuGre is no candidate, however low its BIC, and the sentence says why
    compared, alone = on_motion
    blind = {n: replace(e, value=None) if n.name == "sigma_0" else e for n, e in alone.parameters.items()}
    keys = [(model, of) for of in (SYMMETRIC, APART) for model in (COULOMB, VISCOUS, STRIBECK, LUGRE)]
    rows = {key: row(compared, *key) for key in keys}
    found = {key: Candidate(np.full(compared.n, r.rms), r.parameters) for key, r in rows.items()}
    judged = present(rank_models("moving runs", found, 1.0, 1.0, {}, replace(alone, parameters=blind), ()))
    assert not is_of(used(judged), LUGRE)
    assert reasons(judged, "the motion does not show LuGre's bristle")
    assert is_of(min(judged.rows, key=lambda r: r.bic), LUGRE)
