from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.identification.fits import Estimate
from bristle.model.formula import as_text
from bristle.model.laws.registry import law_named
from bristle.questions.sensitivity.figures import colours, map_figure, time_figure
from bristle.questions.sensitivity.formulas import formulas
from bristle.questions.sensitivity.sobol import box_of, joints_at, ordered

from ..laws import DRAG, EXPONENT, OUTSIDE, motion, registered, truth_of
from ..names import named
from ..pages import page_text

OWN = {DRAG: "alpha_3", EXPONENT: "delta", OUTSIDE: "blunt"}
SYMBOLS = {DRAG: "α₃", EXPONENT: "δ", OUTSIDE: "β"}


@pytest.fixture(autouse=True, scope="module")
def known() -> Iterator[None]:
    with registered():
        yield


@pytest.mark.slow
def test_every_part_has_the_laws_own_parameter(tmp_path: Path) -> None:
    """Shares, map, tables, figures, Sobol indices and page tell of the law's own parameter, and none of v_end."""
    for name, own in OWN.items():
        # of points and a motion; fast, so that the loops of Sobol's indices are short
        study = bristle.sensitivity(motion(name), frequency=2.0, samples=32)
        # constant velocities and the motion expect an error of every parameter of the law that they can show
        motion_, steady = (e.information for e in study.expected)
        assert [str(x) for x in steady.names] == [n for n in study.local.names if n not in ("sigma_0", "sigma_1")]
        assert [str(x) for x in motion_.names][: len(study.local.names)] == list(study.local.names)
        law = study.model.p.law
        assert study.local.names == study.map.names
        assert set(study.to_frame().parameter) == set(study.local.names)
        report = bristle.report_of(study)
        for table in (report.frames["parameters"], *(e.to_frame(study.kind) for e in study.expected)):
            assert own in set(table.parameter)
            assert "v_end" not in set(table.parameter)
        assert own in report.frames["map"].columns
        assert len(time_figure(study).axes) == 1 + len(study.local.names)
        assert len([ax for ax in map_figure(study).axes if ax.get_visible()]) == 1 + len(study.local.names)
        text = page_text(report.write(tmp_path / law.name))
        assert SYMBOLS[name] in text
        assert "v_end" not in report.text()
        assert own in report.text()


def test_formulas_and_boxes_of_laws() -> None:
    """They hold the law's own parameter; (19) as printed, which is of the paper's peak, is not among them."""
    found = {name: formulas(law_named(name)) for name in OWN}
    for name, own in OWN.items():
        assert own in found[name].partial
        assert own in as_text(found[name].torque)
        assert not any(row.what.startswith("(19)") for row in found[name].rows())
    # alpha_3 multiplies v abs(v), v_end is in no formula, and one sentence says up to where they hold
    drag = found[DRAG]
    assert as_text(drag.partial["alpha_3"]) == "v*abs(v)"
    assert all("v_end" not in row.formula and "Piecewise" not in row.formula for row in drag.rows())
    assert [x.code for x in drag.sentences()] == ["total-derivatives", "formulas-as-measured"]
    # alpha_3 may be drawn from below zero, alpha_0 may not; v_end is never drawn, and is as it was in each joint
    p = truth_of(DRAG)
    spans = ordered(named({"alpha_3": (-0.01, 0.002), "alpha_0": (0.01, 0.02)}), p.law)
    assert [str(span.parameter) for span in spans] == ["alpha_0", "alpha_3"]
    joints = joints_at(bristle.Pair(p, p), spans, np.array([[0.011, -0.004]]))
    assert (joints.positive.alpha_0[0], joints.law) == (0.011, p.law)
    assert joints.negative._asdict()["alpha_3"][0] == -0.004
    assert joints.negative._asdict()["v_end"][0] == 0.8
    # an interval of alpha_3 on both sides of zero stays whole; that of a shape begins above zero; v_end is left out unsaid
    intervals = {"alpha_3": (-0.1, 0.3), "delta": (0.0, 2.0), "v_end": None}
    box, notes = box_of(named({name: Estimate(value=1.0, unit="1", interval=x) for name, x in intervals.items()}))
    assert box == named({"alpha_3": (-0.1, 0.3), "delta": (0.01, 2.0)})
    assert [x.code for x in notes] == ["box-cut"]
    # up to nine parameters no two share one
    assert len(set(colours(9))) == 9
