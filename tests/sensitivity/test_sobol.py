import sys
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bristle.arrays import Array
from bristle.control.adaptation import Adaptation
from bristle.control.closed_loop import simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import LoopOptions
from bristle.findings import Finding, Severity
from bristle.identification.fits import Estimate
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import Lugre, Pair, ParameterName
from bristle.model.periodic import rms_torque
from bristle.model.rollout import rollout
from bristle.page.style import render_as
from bristle.questions.sensitivity import sobol
from bristle.questions.sensitivity.figures import sobol_figure
from bristle.questions.sensitivity.study import sobol_sentences
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop

from ..conftest import present
from ..names import named, parse

PAIR = edro.TABLE_1["gripper rotation"]
GRIPPER = PAIR.positive
SUBJECT = JointLoop(
    name="gripper rotation", kind="revolute", plant=PAIR, model=PAIR, J=edro.inertia(PAIR), gains=edro.PID_GAINS, amplitude=0.2, frequency=2.0,
    slow=0.5, period=1e-3, adaptation=Adaptation(), start={}, simulated=True,
)  # fmt: skip  # a list of values
BOX = named({"alpha_0": (0.015, 0.025), "alpha_1": (0.001, 0.01), "alpha_2": (0.03, 0.05)})


def ishigami(x: Array) -> Array:
    """The function sin a + 7 sin(b)**2 + 0.1 c**4 sin a, (n, 3) -> (n,)."""
    a, b, c = x.T
    return np.asarray(np.sin(a) + 7 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a))


def ishigami_exact() -> tuple[Array, Array]:
    """First-order and total indices of `ishigami` over [-pi, pi]**3, in closed form (Ishigami and Homma, 1990)."""
    b, pi = 0.1, np.pi
    alone = np.array([(1 + b * pi**4 / 5) ** 2 / 2, 49 / 8, 0.0])
    together = 8 * b**2 * pi**8 / 225
    whole = alone.sum() + together
    return alone / whole, (alone + np.array([1.0, 0.0, 1.0]) * together) / whole


def indices(
    function: Callable[[Array], Array], box: Mapping[ParameterName, tuple[float, float]], samples: int, seed: int = 0
) -> sobol.Output:
    """Those of any function, (n, p) -> (n,), as those of a joint are made."""
    spans = [sobol.Span(name, low, high, low > 0 and high > 10 * low) for name, (low, high) in box.items()]
    return sobol.analysed("x", "torque", spans, function(sobol.saltelli(spans, samples, seed)), seed)


def shares(found: sobol.Output) -> tuple[Array, Array]:
    return np.array([e.first for e in found.effects]), np.array([e.total for e in found.effects])


def repeated(pair: Pair[float], count: int = 1) -> Pair[Array]:
    """The same joint so many times."""
    return Pair(*(Lugre(*(np.full(count, x) for x in p)) for p in pair))


@pytest.fixture(autouse=True)
def _few_loops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sobol, "_TICKS", 1)


@pytest.fixture(scope="module")
def found() -> sobol.Global:
    """The gripper over a box of three parameters, with few loops."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sobol, "_TICKS", 1)
        return sobol.global_sensitivity(GRIPPER, BOX, SUBJECT, samples=1024)


@pytest.mark.parametrize(("seed", "order"), [(7, (0, 1, 2)), (0, (2, 0, 1))])
def test_ishigami(seed: int, order: tuple[int, ...]) -> None:
    """At N = 8192 every index of Ishigami's function is within 0.01 of its exact value, and within its own interval."""
    # parameters that change places take their indices with them
    back = np.argsort(order)
    names = {parse("abc"[k]): (-np.pi, np.pi) for k in order}
    own = indices(lambda x: ishigami(x[:, back]), names, 8192, seed)
    assert [e.parameter for e in own.effects] == [*names]
    halves = np.array([(e.first_half, e.total_half) for e in own.effects]).T
    for index, half, exact in zip(shares(own), halves, (x[list(order)] for x in ishigami_exact()), strict=True):
        assert index == pytest.approx(exact, abs=0.01)
        assert (np.abs(index - exact) <= half).all()
        assert 0.015 < half.max() < 0.05  # 1.96 standard errors of so many samples
    assert (own.samples, own.evaluations) == (8192, 8192 * 5)
    assert own.mean == pytest.approx(3.5, abs=0.01)


def test_boxes_and_seeds(found: sobol.Global) -> None:
    """Over four decades log(x) has the variance of a uniform one; over less than one decade x itself is uniform."""
    own = indices(lambda p: np.log(p[:, 0]) + p[:, 1], named({"x": (1e-2, 1e2), "y": (1.0, 9.0)}), 8192)
    variance = np.array([np.log(1e4) ** 2, 64.0])
    assert shares(own)[0] == pytest.approx(variance / variance.sum(), abs=0.01)
    assert own.deviation**2 == pytest.approx(variance.sum() / 12, rel=1e-2)
    # the box has the 95 % intervals as they are, cut where they reach what cannot be. Where there is none a finding says so; other
    # parameters are left out
    intervals: dict[str, tuple[float, tuple[float, float] | None]] = {
        "alpha_0+": (0.02, (0.01, 0.03)), "alpha_1+": (0.005, (-0.01, 0.02)), "v_s": (0.07, (-0.1, 0.2)),
        "sigma_0": (6.0, (3.0, np.inf)), "sigma_1": (0.02, None), "inertia": (0.1, (0.0, 0.2)),
    }  # fmt: skip  # a table
    estimates = named({name: Estimate(value=x, unit="-", interval=own) for name, (x, own) in intervals.items()})
    estimates[parse("alpha_2")] = Estimate(value=None, unit="-")
    box, said = sobol.box_of(estimates)
    assert box == named({"alpha_0+": (0.01, 0.03), "alpha_1+": (0.0, 0.02), "v_s": (pytest.approx(0.0007), 0.2)})
    assert [(d.code, str(d.numbers["name"])) for d in said] == [
        ("box-cut", "alpha_1+"), ("box-cut", "v_s"), ("box-held", "sigma_0"), ("box-held", "sigma_1"),
    ]  # fmt: skip  # a table
    assert [str(span.parameter) for span in sobol.ordered(box, GAUSSIAN)] == ["alpha_0+", "alpha_1+", "v_s"]
    # a seed fixes samples and bootstrap, zero too, and the order of the box changes nothing; another seed gives other numbers. Progress is
    # told before each batch, with one total, from none done to all but one
    told: list[tuple[str, int, int]] = []
    box, both = dict(reversed(BOX.items())), Pair(GRIPPER, GRIPPER)
    again = sobol.global_sensitivity(both, box, SUBJECT, samples=1024, progress=lambda *x: told.append(x))
    assert again == found
    assert [(done, total) for _, done, total in told] == [(k, len(told)) for k in range(len(told))]
    by_seed = [indices(ishigami, dict.fromkeys(map(parse, "abc"), (0.0, 1.0)), 64, seed) for seed in (0, 0, 1)]
    assert by_seed[0] == by_seed[1] != by_seed[2]


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_indices_of_a_joint_and_how_they_are_shown(found: sobol.Global, kind: JointKind) -> None:
    """For alpha_0 + alpha_1 of independent uniform parameters S_i = Var_i / sum Var, within 0.01."""
    # alpha_2 has nothing of it, and the mean is that of the sum
    own = found.outputs[1]
    variance = np.array([0.01**2, 0.009**2, 0.0])
    for index in shares(own):
        assert index == pytest.approx(variance / variance.sum(), abs=0.01)
    assert own.mean == pytest.approx(0.02 + 0.0055, rel=1e-4)
    # first-order indices sum to no more than one, and no total is below its first order, both within confidence. Torque and breakaway get
    # all samples, the loops as many as they can afford: a power of two each, times p + 2. Each bar is as high as its index, whiskers
    # are inside, each panel names output, unit and samples; a joint that slides has a force
    figure = sobol_figure(found, kind, name="<a> & $b$", simulated=True)
    assert [(x.samples, x.evaluations) for x in found.outputs] == [(1024, 5120), (1024, 5120), (32, 160)]
    for ax, own in zip(figure.axes, found.outputs, strict=True):
        first, total = shares(own)
        half, total_half = np.array([(e.first_half, e.total_half) for e in own.effects]).T
        assert first.sum() <= 1 + np.sqrt(np.sum(half**2))
        assert (total >= first - half).all()
        assert (first + half >= 0).all()
        bars = [bar.get_height() for x in ax.containers for bar in getattr(x, "patches", ())]
        assert bars == [*first, *total]
        low, high = ax.get_ylim()
        assert low < min(first - half)
        assert high > max(total + total_half)
        assert f"{own.samples} samples" in ax.texts[0].get_text()
    assert (" N;" in figure.axes[0].texts[0].get_text()) == (kind == "prismatic")
    assert ("force" in figure.axes[1].texts[0].get_text()) == (kind == "prismatic")
    assert "SIMULATED" in figure.axes[0].get_title(loc="left")
    # a panel without indices says why, and the legend stands in one that has them
    bare = replace(found.outputs[0], effects=(), reason=Finding("x", Severity.NOTE, "Nothing is known."))
    figure = sobol_figure(replace(found, outputs=(bare, *found.outputs[1:])), kind, name="x", simulated=False)
    assert "Nothing is known." in [text.get_text() for text in figure.axes[0].texts]
    assert [ax.get_legend() is not None for ax in figure.axes] == [False, True, False]
    nothing = replace(found, outputs=(bare, bare, bare))
    assert render_as(sobol_figure(nothing, kind, name="x", simulated=False), "svg")
    assert nothing.to_frame(kind).empty
    # one row for each output and parameter. The sentences name the largest first, what was drawn, the seed, and that it is simulated
    frame = found.to_frame("revolute")
    assert frame["total"].tolist() == [e.total for output in found.outputs for e in output.effects]
    assert frame["unit"].tolist()[:3] == ["N*m", "N*m", "N*m*s/rad"]
    said = sobol_sentences(found, "revolute")
    assert [x.code for x in said] == [*["sobol-indices"] * 3, "drawn-from", "indices-simulated"]
    assert str(said[1]).startswith("Breakaway torque: total index alpha_0 0.55 ± ")
    assert "alpha_2" not in str(said[1])


def test_rms_torque_and_loops_that_are_afforded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A stiff joint without Stribeck has T = alpha_0 sgn v + alpha_2 v."""
    # its RMS over a sine is a closed form, for many joints at once
    alpha_0, alpha_2, one = np.linspace(0.01, 0.03, 40), np.linspace(0.05, 0.02, 40), np.ones(40)
    p = Lugre(alpha_0, 0 * one, alpha_2, one, 1e7 * one, 0 * one)
    V = 2 * np.pi * 0.5
    exact = np.sqrt(alpha_0**2 + 4 / np.pi * alpha_0 * alpha_2 * V + (alpha_2 * V) ** 2 / 2)
    assert rms_torque(Pair(p, p), 1.0, 0.5, samples=2000) == pytest.approx(exact, rel=3e-6)
    # a peak that lasts less than a sample is there: nodes lie as close as the smallest v_s asks for. The RMS is that of a rollout with a
    # hundred times the samples
    p, n = Lugre(0.02, 0.2, 0.001, 0.01, 500.0, 0.0), 20_000
    v = 2 * np.pi * 0.5 * np.cos(2 * np.pi * np.arange(2 * n + 1) / n)
    whole = rollout(v, 2 / n, p).torque[-n:]
    assert rms_torque(repeated(Pair(p, p)), 1.0, 0.5) == pytest.approx(np.sqrt(np.mean(whole**2)), rel=1e-3)
    # by default six parameters get 256 samples at the paper's reference; a long run gets the fewest, not none
    monkeypatch.undo()
    asked = [(6, 4000), (12, 4000), (6, 10**7), (1, 100)]
    assert [sobol._affordable(parameters, ticks) for parameters, ticks in asked] == [256, 128, 32, 16384]
    # a missing SALib is said at once, before anything is simulated, with the command that installs it
    monkeypatch.setitem(sys.modules, "SALib", None)
    told: list[object] = []
    with pytest.raises(ValueError, match=r"pip install 'bristle\[sensitivity\]'"):
        sobol.global_sensitivity(GRIPPER, BOX, SUBJECT, progress=lambda *x: told.append(x))
    assert not told


@pytest.mark.parametrize(("amplitude", "frequency", "periods"), [(1.0, 0.5, 3), (0.02, 0.2, 6), (1e-3, 0.2, 60)])
def test_rms_torque_is_that_of_the_rollout(amplitude: float, frequency: float, periods: int) -> None:
    """Both sets of a joint, sliding or not: a rollout that went on until it was periodic has the same RMS to 2e-4."""
    n = 2000
    k = np.arange(periods * n + 1)
    v = 2 * np.pi * frequency * amplitude * np.cos(2 * np.pi * k / n)
    z0 = None if amplitude > 0.01 else 0.0  # an elastic bristle forgets nothing: from the middle it has less far to go
    for pair in edro.TABLE_1.values():
        whole = rollout(v, 1 / (n * frequency), pair, z0).torque[-n:]
        found = rms_torque(repeated(pair, 3), amplitude, frequency)
        assert found == pytest.approx(np.sqrt(np.mean(whole**2)), rel=2e-4)


@settings(max_examples=25)
@given(st.floats(0.1, 10.0), st.floats(1e-3, 3.0), st.floats(0.05, 5.0))
def test_rms_torque_has_degree_one(factor: float, amplitude: float, frequency: float) -> None:
    """T_f is of degree one in all parameters but v_s, and directions may be exchanged."""
    # no joint of a batch sees another
    scaled = [p._replace(**{n: factor * x for n, x in p._asdict().items() if n != "v_s"}) for p in PAIR]
    both = Pair(*(Lugre(*(np.array(x) for x in zip(p, q, strict=True))) for p, q in zip(PAIR, scaled, strict=True)))
    plain, more = rms_torque(both, amplitude, frequency)
    assert more == pytest.approx(factor * plain, rel=1e-9)
    swapped = rms_torque(Pair(*reversed(both)), amplitude, frequency)
    assert swapped == pytest.approx([plain, more], rel=1e-3)
    assert rms_torque(repeated(PAIR), amplitude, frequency) == pytest.approx(plain, rel=1e-12)


def test_joints_that_are_drawn() -> None:
    """Over a box that is next to nothing the loop is that of the nominal plant and model, not of the subject's own."""
    p = GRIPPER._replace(alpha_0=0.05)
    own = sobol.global_sensitivity(p, named({"alpha_2": (0.0393999, 0.0394001)}), SUBJECT, samples=32).outputs[2]
    case = SUBJECT.case(plant=Pair(p, p), model=Pair(p, p))
    run = simulate(LoopOptions(compensator=SUBJECT.compensator), [case], SUBJECT.sine(2.0, 1.0), SUBJECT.period)
    assert own.mean == pytest.approx(run.rms_error(0.5).item(), rel=1e-4)
    # the error of the period that counts is within 1 % of that four periods later, at corners of a box of 20 %
    cases = [
        SUBJECT.case(plant=Pair(*(p._replace(alpha_0=a * p.alpha_0, alpha_2=b * p.alpha_2) for p in PAIR)))
        for a, b in ((0.8, 0.8), (1.2, 0.8), (0.8, 1.2), (1.2, 1.2))
    ]
    course = replace(SUBJECT, amplitude=1.0, frequency=0.5).sine(0.5, 12.0)
    error = simulate(LoopOptions(compensator=SUBJECT.compensator), cases, course, 1e-3).error
    counted, later = (np.sqrt(np.mean(error[:, k * 2000 : (k + 1) * 2000] ** 2, axis=1)) for k in (1, 5))
    assert counted == pytest.approx(later, rel=0.01)
    # a name with its sign moves that set only: half of it reaches the breakaway torque, which is the mean of both
    box = named({"alpha_0+": (0.01, 0.03), "alpha_1": (0.0, 0.01)})
    own = sobol.global_sensitivity(PAIR, box, SUBJECT, samples=1024).outputs[1]
    assert shares(own)[0] == pytest.approx([0.5, 0.5], abs=0.01)
    assert own.mean == pytest.approx((0.02 + PAIR.negative.alpha_0) / 2 + 0.005, rel=1e-4)
    # sigma_1 has no part in the breakaway torque: none, with the reason, where shares of no variance do not exist
    box = named({"sigma_1": (0.01, 0.02)})
    torque, breakaway, _ = sobol.global_sensitivity(GRIPPER, box, SUBJECT, samples=32).outputs
    assert torque.effects
    assert not breakaway.effects
    assert present(breakaway.reason).code == "nothing-changes-it"
    # a control period that the loop does not bear, a reference beyond it, or a plant with which it diverges, leaves the loop out. It has no
    # indices but the reason; the other outputs stand
    braked = replace(SUBJECT, compensator=Compensator(name="lugre-feedback"))
    cases = {
        "The loop diverges with 160": (GRIPPER, replace(SUBJECT, period=0.05, frequency=0.2, amplitude=1.0)),
        "more than 0.02 of": (GRIPPER, replace(SUBJECT, frequency=1e4)),
        "at most 300000 are": (GRIPPER, replace(SUBJECT, frequency=1e-6)),
        "diverges with 160 of the 160": (GRIPPER._replace(alpha_2=3.0), braked),
    }
    faults = []
    for said, (p, subject) in cases.items():
        *others, loop = sobol.global_sensitivity(p, BOX, subject, samples=32).outputs
        faults += [said] * (bool(loop.effects) or said not in str(loop.reason) or not all(x.effects for x in others))
    assert faults == []
