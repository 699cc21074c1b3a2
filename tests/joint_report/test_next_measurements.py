from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.results import Joint
from bristle.questions.joint_report.next_measurements import next_measurements

from ..sameness import of_kind
from .conftest import loaded, nothing_seen, only
from .moving import moving as all_stages
from .moving import tracked

CONVERGED = Finding("static-converged", NOTE, "Converged.")
NO_PEAK = Finding("static-no-stribeck", CAUTION, "Stribeck term not identifiable from these data.")


def changed(joint: Joint, v_s: dict[str, Any], **changes: Any) -> Joint:
    """Direction + alone, without stick-slip, with changes to its estimate of v_s and to its fit."""
    fit = joint.static["+"]
    parameters = {**fit.parameters, "v_s": replace(fit.parameters["v_s"], **v_s)}
    return replace(joint, static={"+": replace(fit, parameters=parameters, **changes)}, segments=())


def ranges(joint: Joint) -> list[tuple[float, float]]:
    """Every range of speeds that is proposed."""
    return [(x.numbers["low"], x.numbers["high"]) for x in next_measurements(joint) if "low" in x.numbers]


def moving(joint: Joint, **changes: Any) -> Joint:
    """As if the static fit of + rested on moving data, which pass through zero."""
    v = np.concatenate([[1.2e-24, 3e-9, 1e-5], joint.static["+"].velocity])
    return changed(joint, {"value": 0.01, "standard_error": 0.01, "interval": (0.0, np.inf)}, velocity=v, **changes)


def test_advice_follows_from_the_warnings(joint: Joint) -> None:
    """An open interval asks for slower speeds in a concrete range; stick-slip names the run; one direction asks for the other."""
    one = replace(changed(joint, {"interval": (0.0, 0.1)}, hold_out=()), segments=joint.segments)
    below, *others = next_measurements(one)
    assert (below.code, below.subject) == ("unlimited-below", ("static", "+"))
    assert [(x.code, dict(x.numbers)) for x in others] == [
        ("repeat-sticking", {"files": ("run_1.csv",)}),
        ("measure-direction", {"direction": "-"}),
        ("hold-back", {}),
    ]
    none = replace(joint, static={"both": replace(joint.static["+"], outcome=NO_PEAK)}, segments=())
    (said,) = next_measurements(none)
    assert (said.code, said.subject) == ("rises-below", ("static", "both"))
    assert str(said).endswith("five constant speeds from 0.008 to 0.015 rad/s.")


@pytest.mark.parametrize("outcome", [CONVERGED, NO_PEAK])
def test_no_speed_below_a_hundredth_of_the_fastest(joint: Joint, outcome: Finding) -> None:
    """Moving data pass through zero, but no advice asks for speeds near it; a range has room for five speeds."""
    own = moving(joint, outcome=outcome)
    fastest = float(own.static["+"].velocity.max())
    found = ranges(own)
    assert found
    for low, high in found:
        assert low >= fastest / 100
        assert high >= 1.4 * low
    said = of_kind(next_measurements(own), "rise-not-shown")
    assert bool(said) == (outcome is NO_PEAK)


@pytest.mark.parametrize("sticking", [0.0152, 0.0499, 0.101])
def test_no_speed_at_which_the_joint_sticks(joint: Joint, sticking: float) -> None:
    """Every speed that is proposed is faster than each at which a run of its direction sticks and slips; those of the other do not matter."""
    kept = joint.segments[0]
    stuck = replace(kept, velocity=sticking, stick_slip=True)
    other = replace(kept, velocity=-0.7, stick_slip=True)
    for own in (changed(joint, {"interval": (0.0, 0.1)}), moving(joint), moving(joint, outcome=NO_PEAK)):
        found = ranges(replace(own, segments=(stuck, other)))
        assert found
        assert min(low for low, _ in found) > sticking
        assert min(low for low, _ in found) < 0.7


def test_what_is_clear_needs_nothing(joint: Joint) -> None:
    """Without a warning there is no advice about speeds."""
    assert ranges(replace(joint, segments=())) == []


def test_hold_out_of_moving_runs_is_one() -> None:
    """Nobody is asked to hold back a run where a moving run was held back, or of slow loading alone."""
    whole = all_stages()
    static = {d: replace(fit, hold_out=()) for d, fit in whole.static.items()}
    assert not of_kind(next_measurements(replace(whole, static=static)), "hold-back")
    nothing: dict[str, Any] = {"static": {}, "crosscheck": {}, "segments": ()}
    for slow in (loaded(), only(loaded(), fits={"+": nothing_seen()})):
        assert not of_kind(next_measurements(replace(slow, **nothing)), "hold-back")
    bare = replace(whole, static=static, tracking=tracked(hold_out=()), joint_fit=None)
    assert of_kind(next_measurements(bare), "hold-back")
