from collections.abc import Mapping
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import bristle
from bristle.arrays import Interval
from bristle.data.experiment.schema import FitOptions
from bristle.estimation.levels import NORMAL
from bristle.identification.curve import band
from bristle.identification.fits import Estimate, StaticFit
from bristle.identification.presliding.fit import fit_presliding
from bristle.identification.results import Joint
from bristle.identification.static.fit import PointInfo, estimate_static, fit_static
from bristle.identification.static.problem import from_points
from bristle.identification.systematic import combined, statistical
from bristle.model.parameters import Lugre, least_of
from bristle.questions.joint_report.results_file import to_frame
from bristle.simulation.bench import steady_points

from ..conftest import present
from .conftest import G0, GRIPPER, codes, curve, error_of, holds, known, value_of
from .test_presliding import maxwell_slip, soft_loadings
from .test_repeats import loading

K, SHARE = 0.35, 0.05
SPEEDS = np.geomspace(0.15 * GRIPPER.v_s, 0.8, 20)
NOISE = 0.01 * GRIPPER.alpha_0
STEPPED = 0.01  # of a standard error: how far K is moved for a refit
WAYS = ("covariance", "profile", "bootstrap")
EDRO = Path(__file__).parents[2] / "datasets" / "edro"


def points(folder: Path, name: str, scale: str, **more: Any) -> Path:
    """An experiment of points of both directions, the torque a current times a scale; the same points for every scale."""
    v = np.concatenate([SPEEDS, -SPEEDS])
    T = curve(v, GRIPPER) + NOISE * np.random.default_rng(5).standard_normal(v.size)
    np.savetxt(folder / "points.csv", np.column_stack([v, T / K]), delimiter=",", header="v,i", comments="")
    torque = {"column": "i", "unit": "A", "scale": scale}
    signals = {"velocity": {"column": "v", "unit": "rad/s"}, "torque": torque}
    runs = [{"files": "points.csv", "experiment": "points"}]
    path = folder / f"{name}.yaml"
    path.write_text(
        yaml.safe_dump({"joint": {"name": "g"}, "signals": signals, "runs": runs, **more}), encoding="utf-8"
    )
    return path


def wrist(folder: Path, constant: str, kinds: tuple[str, ...], **more: Any) -> Joint:
    """The embedded wrist, whose torque comes from a voltage, with another torque constant and some of its runs."""
    document = yaml.safe_load((EDRO / "wrist.yaml").read_text(encoding="utf-8")) | more
    document["motor"]["torque_constant"] = constant
    runs = [run for run in document["runs"] if run["experiment"] in kinds and "hold_out" not in run]
    document["runs"] = [run | {"files": str(EDRO / run["files"])} for run in runs]
    path = folder / f"{len(list(folder.iterdir()))}.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return bristle.identify(path).joints[0]


def every(fits: Mapping[str, StaticFit]) -> list[tuple[str, str, Estimate]]:
    return [(d, name, e) for d, fit in fits.items() for name, e in fit.parameters.items()]


def of_stages(joint: Joint) -> list[tuple[str, str, str, Estimate]]:
    """Stage, direction, name and estimate of each parameter of static, presliding, moving and all runs."""
    assert joint.presliding is not None
    assert joint.joint_fit is not None
    found = [("static", d, name, e) for d, name, e in every(joint.static)]
    found += [("presliding", d, "sigma_0", fit.sigma_0) for d, fit in joint.presliding.fits.items()]
    for stage, whole in (("tracking", present(joint.tracking)), ("joint", joint.joint_fit)):
        found += [(stage, str(n.direction), n.name, e) for n, e in whole.parameters.items()]
    return found


@pytest.mark.slow
def test_intervals_cover_the_truth_where_the_torque_constant_is_off() -> None:
    """With 5 % of error in K, new in each of 400 sets, 92 to 98 % of the intervals hold the truth; without its part under half of alpha_0's."""
    rng = np.random.default_rng(0)
    truth = dict(zip(("alpha_0", "alpha_1", "alpha_2", "v_s"), GRIPPER, strict=False))
    inside, without = dict.fromkeys(truth, 0), 0
    for _ in range(400):
        true_K = K * (1 + SHARE * rng.standard_normal())
        T = steady_points(GRIPPER, SPEEDS, NOISE, rng, 1)[0] * K / true_K  # a current times the K that is believed
        found = estimate_static(from_points(SPEEDS, T, ("+",), shifts={"K": SHARE * T}), FitOptions(), "revolute")
        for name, value in truth.items():
            inside[name] += holds(found[name].interval, value)
        without += holds(statistical(found["alpha_0"]), GRIPPER.alpha_0)
    assert all(0.92 <= count / 400 <= 0.98 for count in inside.values()), inside
    assert without / 400 < 0.5


@pytest.fixture(scope="module")
def exact_and_uncertain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Joint, Joint]:
    """The joint of the same points by a K that is exact, and by one with an error."""
    folder = tmp_path_factory.mktemp("points")
    paths = [points(folder, name, f"{K}{error} N*m/A") for name, error in (("x", ""), ("s", f" +/- {SHARE * K}"))]
    exact, uncertain = (bristle.identify(path).joints[0] for path in paths)
    return exact, uncertain


def test_a_common_factor_is_one_of_every_parameter_but_v_s(exact_and_uncertain: tuple[Joint, Joint]) -> None:
    """The systematic error is |value| s / K, none of v_s, to rounding; by one constant, so fully correlated over parameters and directions."""
    _, joint = exact_and_uncertain
    constant = f"scale of torque {K:g} +/- {SHARE * K:g} N*m/A"
    for _, name, e in every(joint.static):
        factor = 0.0 if name == "v_s" else SHARE
        assert e.systematic == pytest.approx(abs(value_of(e)) * factor, rel=1e-9, abs=0)
        assert e.shifts == pytest.approx({constant: value_of(e) * factor}, rel=1e-9, abs=0)
    # values, standard errors and covariances are the same with and without it; an interval is wider by the part in quadrature, end by end
    exact, uncertain = exact_and_uncertain
    for (_, _, e), (d, name, s) in zip(every(exact.static), every(uncertain.static), strict=True):
        assert (e.value, e.standard_error, e.systematic, e.shifts) == (s.value, s.standard_error, None, {})
        assert e.warnings == s.warnings
        intervals = [(s.interval, e.interval)]
        ways = [x.static[d].uncertainty[name] for x in (uncertain, exact)]
        intervals += [(getattr(ways[0], way), getattr(ways[1], way)) for way in WAYS]
        for wide, narrow in intervals:
            below, above = (hypot(end - value_of(e), NORMAL * (s.systematic or 0.0)) for end in present(narrow))
            assert wide == pytest.approx((max(value_of(e) - below, 0.0), value_of(e) + above), rel=1e-12)
        assert statistical(s) == pytest.approx(e.interval, rel=1e-9)
    for joint, after in ((exact, "lower"), (uncertain, "systematic")):
        assert list(to_frame([joint]).columns)[5:7] == ["standard_error", after]
    # its half-width is that of the covariance and, in quadrature, 1.96 times the curve's own share
    fit = exact_and_uncertain[1].static["+"]
    exact = replace(fit, parameters={name: replace(e, shifts={}) for name, e in fit.parameters.items()})
    p, v = fit.values(), np.array([0.02, 0.3])
    wide, narrow = band(v, fit), band(v, exact)
    assert p is not None
    torque = curve(v, Lugre(*p, 1.0, 0.0))
    assert wide == pytest.approx(np.hypot(np.asarray(narrow), NORMAL * SHARE * torque), rel=1e-9)
    # no systematic error closes an open side, or takes a positive parameter below zero; an offset it does
    assert combined((0.0, np.inf), 1.0, 0.3) == (0.0, np.inf)
    assert combined((0.1, 2.0), 1.0, 1.0)[0] == 0.0
    assert combined((0.1, 2.0), 1.0, 1.0, least_of("offset"))[0] < 0.0
    assert combined((0.1, 2.0), 1.0, 1.0, least_of("quadratic"))[0] < 0.0
    assert combined((-1.0, 2.0), 0.5, 1.0)[0] < -1.0
    # of runs that differ chi-squared and errors are those without an error of K, which then widens these, all ways
    rng, noise = np.random.default_rng(0), 1e-3 * GRIPPER.alpha_0
    laws = [GRIPPER._replace(alpha_0=x * GRIPPER.alpha_0) for x in (1.0, 1.05, 0.95)]
    torques = [curve(SPEEDS, law) + noise * rng.standard_normal(SPEEDS.size) for law in laws]

    def fitted(share: float) -> StaticFit:
        whole, *own = (
            from_points(np.resize(SPEEDS, T.size), T, ("both",), shifts={"K": share * T} if share else {})
            for T in (np.concatenate(torques), *torques)
        )
        runs = [(f"run {k}", one) for k, one in enumerate(own)]
        return fit_static(whole, FitOptions(), "revolute", PointInfo(), runs=runs)[0]["both"]

    exact, uncertain = fitted(0.0), fitted(SHARE)
    assert uncertain.repeats == exact.repeats
    assert exact.repeats["alpha_0"].widened > 1
    for name, e in exact.parameters.items():
        s = uncertain.parameters[name]
        assert (s.value, s.standard_error, s.warnings) == (e.value, e.standard_error, e.warnings)
        assert_combined(s.interval, e.interval, s)
        for way in WAYS:
            assert_combined(getattr(uncertain.uncertainty[name], way), getattr(exact.uncertainty[name], way), s)


def assert_combined(wide: Interval | None, narrow: Interval | None, e: Estimate) -> None:
    """One interval is the other with the systematic error of an estimate in quadrature; neither exists without the other."""
    assert (wide is None) == (narrow is None)
    if wide is not None and narrow is not None:
        assert wide == pytest.approx(combined(narrow, value_of(e), e.systematic or 0.0), rel=1e-12)


@pytest.mark.parametrize(("softens", "bound"), [(True, False), (False, False), (False, True)])
def test_loadings_that_soften_or_scatter_widen_the_statistical_part_alone(*, softens: bool, bound: bool) -> None:
    """sigma_0 of loadings that soften, or differ, or only bound g0, moves as K does, and K widens what these widened; of sigma_1 no more is known."""
    stiff = GRIPPER.sigma_0 * np.array([1.0, 1.1, 0.9, 1.05])
    differ = [loading(x, f"run {k}", 2e-5, k) for k, x in enumerate(stiff.tolist())]
    own = soft_loadings(maxwell_slip, 0.0, 4, 1) if softens else differ
    level = known(max(x.held for x in own), np.inf) if bound else known(G0, 1e-4)
    J = known(0.01, 0.0)
    exact = fit_presliding(own, level, J, "revolute")
    shifts = {} if bound else {"K": SHARE * G0}
    off = [replace(x, shares={"K": SHARE}) for x in own]
    uncertain = fit_presliding(off, level._replace(shifts=shifts), J, "revolute")
    assert uncertain.repeats == exact.repeats
    assert softens or bound or exact.repeats["sigma_0"].widened > 1
    assert ("softens" in codes(exact.warnings)) == softens
    e, s = exact.sigma_0, uncertain.sigma_0
    assert (s.value, s.standard_error, s.warnings) == (e.value, e.standard_error, e.warnings)
    assert s.systematic == pytest.approx(SHARE * value_of(e), rel=1e-12)
    assert_combined(s.interval, e.interval, s)
    for way in WAYS:
        assert_combined(getattr(uncertain.uncertainty["sigma_0"], way), getattr(exact.uncertainty["sigma_0"], way), s)
    assert uncertain.sigma_1.standard_error is None
    assert uncertain.sigma_1.shifts == pytest.approx({"K": SHARE / 2 * value_of(exact.sigma_1)})


@pytest.mark.parametrize(
    ("scale", "simulated", "kind"),
    [
        (f"{K} N*m/A", False, "torque-exact"),
        (f"{K} N*m/A", True, None),
        (f"{K} ± 0.01 N*m/A", True, "torque-uncertain"),
        ("1", False, None),
        ("1 +/- 0.01", False, "torque-uncertain"),
    ],
)
def test_which_constants_are_taken_as_exact_is_said(
    tmp_path: Path, scale: str, kind: str | None, *, simulated: bool
) -> None:
    """In the text, with the line that would change it; not of simulated data, whose constants are known, nor of a measured torque."""
    path = points(tmp_path, "e", scale, simulated=simulated)
    if "A" not in scale:  # a torque that was logged as such
        path.write_text(path.read_text(encoding="utf-8").replace("unit: A", "unit: N*m"), encoding="utf-8")
    results = bristle.identify(path)
    said, uncertain = results.joints[0].torque_scale, int(kind == "torque-uncertain")
    assert (said and said.code) == kind
    assert said is None or str(said) in " ".join(results.text(full=True).split())
    assert (kind == "torque-exact") == ("give it, as in scale: 0.35 +/- 0.007 N*m/A for 2 %" in str(said))
    assert len(results.joints[0].uncertain_constants) == uncertain
    assert {len(e.shifts) for _, _, e in every(results.joints[0].static)} == {uncertain}


@pytest.mark.slow
def test_of_a_voltage_every_stage_moves_as_a_refit_does(tmp_path: Path) -> None:
    """Each stage's systematic error is by how much the whole identification moves with K; stages that share K do not average it out."""
    # of T = k (V - k w) / R the torque grows by s / k and loses k s / R w, which is viscous: alpha_2 moves by less
    kinds = ("ramp", "presliding", "tracking")
    joint, other = (wrist(tmp_path, f"{x} N*m/A", kinds) for x in (f"{K} +/- {SHARE * K}", K * (1 + STEPPED * SHARE)))
    after = {(stage, d, name): e for stage, d, name, e in of_stages(other)}
    for stage, d, name, e in of_stages(joint):
        moved = after[stage, d, name]
        if e.value is None or moved.value is None:
            continue
        (shift,) = e.shifts.values()
        if name == "v_s":
            assert abs(shift) < 0.1 * error_of(e)
            continue
        assert shift == pytest.approx((moved.value - e.value) / STEPPED, rel=0.02)
        viscous = K * SHARE * K / 2.1 if name == "alpha_2" else 0.0
        hundredth = 0.01 * error_of(e)  # what counts add, and is subtracted, is not linear in K
        assert shift == pytest.approx(SHARE * e.value - viscous, rel=0.01, abs=hundredth), name
        assert e.systematic == abs(shift)
