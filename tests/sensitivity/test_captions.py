"""What the figures of `bristle sensitivity` say first: a finding with its number, in degenerate studies too."""

import re
from dataclasses import replace

import numpy as np

from bristle.findings import NOTE, Finding
from bristle.identification.fisher import Information
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.questions.sensitivity.local import Map
from bristle.questions.sensitivity.report import report
from bristle.questions.sensitivity.sobol import Effect, Global, Output, ordered
from bristle.questions.sensitivity.study import Expected, SensitivityStudy

from ..names import parse

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


def test_captions_hold_the_numbers_of_the_study(known: SensitivityStudy) -> None:
    """Largest share, and extent of the paper's claim are those of the study's own tables."""
    found, frame = captions(known), known.to_frame()
    assert f"RMS torque, {100 * frame['total'].max():.2g} %" in found["shares"]
    assert f"the smallest, {100 * frame['total'].min():.2g} %" in found["shares"]
    assert f"{known.map.claim.sum()} of {known.map.claim.size} motions" in found["first"]


def test_the_largest_change_is_of_the_motion_and_of_its_second_period(known: SensitivityStudy) -> None:
    """A parameter that peaks at the beginning alone does not hide the one that does in the second period; a force is none in N·m."""
    total = np.zeros_like(known.local.total)
    total[0, 5], total[:, 0] = -7.0, 2.5
    found = captions(replace(known, local=replace(known.local, total=total), kind="prismatic"))["time"]
    half = known.local.time[(known.local.time <= 2 / known.motion.frequency).sum() // 2]
    assert found == (
        f"To first order, doubling σ₁ changes the force most, by up to 7 N at 0 s; in the second period α₀ does, by up to 2.5 N at {half:.3g} s."
    )
    total[0, 5] = 0.0
    alone = captions(replace(known, local=replace(known.local, total=total)))["time"]
    assert alone == "To first order, doubling α₀ changes the torque most, by up to 2.5 N·m at 0 s."


def test_a_claim_that_holds_nowhere_is_said(known: SensitivityStudy) -> None:
    """Where sigma_0 and sigma_1 lead on the whole map, the paper's two parameters have the two largest shares in 0 % of it."""
    shares = np.full((2, 3, 6), 0.01)
    shares[..., 4:] = 0.5
    shares[0, 0, 4], shares[1, 2, 4] = 1e-7, 1.25
    of = Map(names=known.map.names, amplitudes=np.ones(2), frequencies=np.ones(3), shares=shares)
    found = captions(replace(known, map=of))
    assert found["first"] == "α₀ and α₂ have the two largest shares in 0 % of the map, 0 of 6 motions."
    assert found["map"] == "The share of σ₀ varies most over the map, from less than 0.1 % to 120 %."


def test_the_strongest_correlation(known: SensitivityStudy) -> None:
    """It is off the diagonal and of two parameters that are seen; how many are not is said beside it or in its place."""
    strongest, none = "The strongest correlation, −0.50, is that of α₀ and vₛ", "There is no correlation to show: "
    matrices = {
        f"{strongest}.": [[1.0, 0.5], [0.5, 1.0]],
        f"{none}1 of 2 parameters cannot be estimated (×).": [[1.0, 0.0], [0.0, 0.0]],
        f"{none}2 of 2 parameters cannot be estimated (×).": [[0.0, 0.0], [0.0, 0.0]],
        f"{none}there is 1 parameter.": [[1.0]],
        f"{strongest}; 1 of 3 parameters cannot be estimated (×).": [[1.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 0.0]],
    }
    found = []
    for matrix in matrices.values():
        names = tuple(map(parse, ("alpha_0", "v_s", "sigma_1")[: len(matrix)]))
        information = Information(names=names, point=np.ones(len(names)), matrix=np.array(matrix))
        said = captions(replace(known, sobol=None, expected=(Expected("the motion", information, {}, ()),)))
        assert "sobol" not in said
        assert {"time", "shares", "first", "map"} <= said.keys()
        found.append(said["correlation-1"])
    assert found == [*matrices]


def test_the_largest_index(known: SensitivityStudy) -> None:
    """It is that of all outputs; how many of these have none is said beside it, or in its place."""
    nothing = Finding("nothing-changes-it", NOTE, "Nothing changes it.")
    bare = Output(name="breakaway torque", quantity="torque", reason=nothing)
    for outputs, expected in (
        ((WHOLE,), "vₛ has the largest total index, 0.951 ± 0.034 for the RMS friction torque."),
        (
            (bare, WHOLE),
            "vₛ has the largest total index, 0.951 ± 0.034 for the RMS friction torque; 1 of 2 outputs cannot be analysed.",
        ),
        ((bare,), "1 of 1 outputs cannot be analysed."),
    ):
        assert captions(replace(known, sobol=replace(SOBOL, outputs=outputs)))["sobol"] == expected
