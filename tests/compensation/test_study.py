"""A study carries itself: its table, its words and its page are those of what was tried."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bristle.api.experiments import report_of
from bristle.questions.compensation import ablation, parameter_studies
from bristle.questions.compensation.report import sections
from bristle.questions.compensation.study import Study, outcomes_of, study

from ..simulation.joints import joint_loop


@pytest.fixture(scope="module")
def compensated() -> Study:
    """The gripper with its true model, on small maps."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name, few in (
            (parameter_studies, "GAMMAS", (20.0,)), (parameter_studies, "FREQUENCIES", (1.0,)), (parameter_studies, "AMPLITUDES", (1.0,)),
            (ablation, "BITS", (20,)), (ablation, "DELAYS", (0,)), (ablation, "SHARES", (1.0,)),
        ):  # fmt: skip  # a table
            patch.setattr(module, name, few)
        return study([joint_loop()])


def test_its_frame_is_fig_8(compensated: Study) -> None:
    """A row for each error, with the same numbers."""
    frame = compensated.to_frame()
    assert len(frame) == len(compensated.errors)
    assert frame["identified_model"].tolist() == [row.identified for row in compensated.errors]
    assert (frame["true_share"] * frame["without"]).tolist() == pytest.approx([row.true for row in compensated.errors])


def test_its_text_has_a_line_for_each_error_and_each_adapted_parameter(compensated: Study) -> None:
    """One line each, without inertia feed-forward, with what is left of the error and where each factor ends."""
    found = list(outcomes_of(compensated))
    plain = [row for row in compensated.errors if not row.inertia]
    factors = compensated.adapted.factors
    assert report_of(compensated).text().splitlines() == list(map(str, found))
    assert [x.code for x in found] == ["errors-compensated"] * len(plain) + ["adapted-to"] * len(factors)
    for said, row in zip(found, plain, strict=False):
        assert said.numbers["unit"] == "mrad"
        assert (said.numbers["without"], said.numbers["identified"]) == (1e3 * row.without, 1e3 * row.identified)
        assert said.numbers["identified_percent"] == 100 * row.identified / row.without
    for said, factor in zip(found[len(plain) :], factors, strict=True):
        ends = {"law": factor.law, "name": factor.parameter, "initial": factor.initial, "final": factor.final}
        assert ends.items() <= said.numbers.items()


@pytest.mark.parametrize(("share", "said"), [(1.05, True), (1.2, False)])
def test_a_stribeck_curve_as_good_as_lugre_is_said(compensated: Study, share: float, said: bool) -> None:
    """Where the steady curve leaves an error within a tenth of LuGre's, the page says so with both."""
    rows = {row.compensator: row for row in compensated.ablation}
    lugre = rows["LuGre, reference velocity"]
    stribeck = rows["Stribeck, reference velocity"]._replace(rms_error=share * lugre.rms_error)
    tried = (rows | {stribeck.compensator: stribeck}).values()
    shown = sections(replace(compensated, ablation=tuple(tried)))
    found = [x for section in shown for x in section.findings if x.code == "stribeck-as-good"]
    assert [x.numbers["stribeck"] for x in found] == ([pytest.approx(1e3 * share * lugre.rms_error)] if said else [])


def test_every_figure_of_a_simulation_says_so(compensated: Study) -> None:
    """Each caption begins with SIMULATED; each figure has a name of its own."""
    drawn = [x for own in sections(compensated) for x in own.drawings]
    assert all(x.simulated for x in drawn)
    assert len({x.name for x in drawn}) == len(drawn)


def test_its_page_has_the_table_of_its_frame(compensated: Study, tmp_path: Path) -> None:
    """With the same numbers, to six digits."""
    report_of(compensated).write(tmp_path / "a")
    written = pd.read_csv(tmp_path / "a" / "tables" / "compensation_errors.csv", comment="#")
    pd.testing.assert_frame_equal(written, compensated.to_frame(), check_dtype=False, rtol=1e-6)


def test_a_map_shows_every_final_ratio(compensated: Study) -> None:
    """A gain that ends at zero has the colour of the smallest ratio, one of a loop that diverges none; the caption counts the finite ones."""
    twice = np.tile(compensated.adaptation_map.by_gamma, 3)
    twice[..., 0], twice[..., 1], twice[..., 2] = 0.0, np.nan, 2.0
    m = compensated.adaptation_map._replace(frequencies=np.array([0.1, 0.2, 0.5]), by_gamma=twice, by_amplitude=twice)
    study = replace(compensated, adaptation_map=m)
    landings = next(x for own in sections(study) for x in own.drawings if x.name == "compensation-landings")
    figure = landings.draw()
    assert figure is not None
    image = figure.axes[0].images[0]
    shown: np.ma.MaskedArray[Any, Any] = np.ma.asarray(image.norm(np.asarray(image.get_array(), dtype=float)))
    assert shown[0, 0] == 0
    assert np.ma.getmaskarray(shown).sum() == 1
    assert landings.caption.partition(". ")[0].endswith("α₂ from 0 to 2")
