import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import bristle
from bristle.findings import CAUTION, NOTE, Finding, Severity
from bristle.identification.fits import Estimate
from bristle.identification.known_joint import chosen
from bristle.identification.results import Accuracy, Joint
from bristle.identification.verdict import value_warnings, verdict
from bristle.page.plain import WIDTH, interval, pair, wrapped
from bristle.questions.joint_report.brief import LINES, brief_report, interval_lines
from bristle.questions.joint_report.sentences import known_to
from bristle.questions.joint_report.text import fit_report

from .conftest import HOSTILE, gripper, loaded
from .moving import UNSEEN, moving, tracked

CRITICAL = Finding("stages-do-not-fit", Severity.CRITICAL, "The stages contradict each other.")
LONG = tuple(
    Finding("unit-differs", CAUTION, f"The unit of signal {k} in a_long_name_of_a_file.csv is deg, and rad is declared: write `unit: deg`.")
    for k in range(20)
)  # fmt: skip  # a list of values


def words(text: str) -> str:
    """In one line."""
    return " ".join(text.split())


def test_values_bands_and_rows_of_the_brief(edro_results: Path) -> None:
    """Of every joint each parameter that `chosen` names: value, error, unit and interval in one line, and the fit that it comes from."""
    edro = bristle.read_results(edro_results)
    blocks = str(edro).split("\n\n")
    assert len(blocks) == len(edro.joints) + 2
    for joint, block in zip(edro.joints, blocks[1:], strict=False):
        first = f"{joint.name} (revolute, SIMULATED data): {verdict(joint).trust}. {known_to(joint, '+/-')}"
        assert words(block).startswith(first)
        for row in chosen(joint):
            e = row.estimate
            assert e.interval is not None
            shown = f"{pair(e.value, e.standard_error)} {e.unit}"
            assert re.search(
                rf"^  {re.escape(str(row.parameter))} +{re.escape(shown)} +{re.escape(interval(e.interval))} +joint fit$",
                block,
                re.M,
            )
        assert "; held-out torque within " in first
    # 10.03 % where 10 % is needed; what is known well enough has two digits
    joint = edro.joints[0]
    assert joint.accuracy is not None
    shown = [known_to(replace(joint, accuracy=replace(joint.accuracy, band=x)), "+/-") for x in (10.03, 9.9, 31.2)]
    assert [re.findall(r"known to \+/- (\S+)", x) for x in shown] == [["10.03"], ["9.9"], ["31"]]
    # a peak that is not claimed, and was in the fit, is told with the curve that has it
    peak, whole = {"alpha_1", "v_s"}, tracked()
    unseen = {
        x: replace(e, value=None, warnings=(UNSEEN,)) if x.name in peak else e for x, e in whole.parameters.items()
    }
    fixed = {x: e.value or 0.0 for x, e in whole.parameters.items() if x.name in peak}
    hidden = replace(
        moving("hidden"), static={}, joint_fit=None, tracking=replace(whole, parameters=unseen, fixed=fixed),
        accuracy=Accuracy(slowest=0.1, fastest=1.0, band=2.0, statistical=2.0, apart=0.0, share=1.0),
    )  # fmt: skip  # a list of values
    assert "with the fit's alpha_1" in words(brief_report([hidden]))
    # the line of friction: between the ends of each interval lies the value before it, and a wider band makes them wider
    assert joint.accuracy is not None
    wide = replace(joint, accuracy=replace(joint.accuracy, band=2 * joint.accuracy.band))
    ends = []
    for x in (joint, wide):
        (line,) = re.findall(r"friction: .*? parameter ", words(brief_report([x])))
        found = re.findall(r"(\S+) N\*m \[(\S+), (\S+)\]", line)
        assert len(found) == 4
        ends.append(np.array(found, dtype=float))
    assert (ends[0][:, 1] <= ends[0][:, 0]).all()
    assert (ends[0][:, 0] <= ends[0][:, 2]).all()
    assert (np.ptp(ends[1], axis=1) > np.ptp(ends[0], axis=1)).all()
    # in the full report, and three ways (slow loading two), each parameter has one line with its interval, none above 80 columns
    full, three = edro.text(full=True).splitlines(), list(interval_lines(edro.joints))
    assert max(map(len, [*full, *three, *wrapped(edro.outcomes())])) <= WIDTH
    for joint in edro.joints:
        assert joint.joint_fit is not None
        for name, e in joint.joint_fit.parameters.items():
            assert e.interval is not None
            assert any(
                line.split()[0] == f"{name}:" and line.endswith(interval(e.interval)) for line in full if line.strip()
            )
    rows = [line for line in three if re.match(r"[a-z]+_[a-z0-9]+[+-]? +\[", line)]
    assert len(rows) > 30
    assert all(len(re.findall(r"\[.+?\]", row)) == (2 if row.startswith("sigma_0") else 3) for row in rows)


@pytest.mark.parametrize("make", [gripper, loaded, moving], ids=["points", "slow", "moving"])
@pytest.mark.parametrize("warnings", [(), LONG, (CRITICAL, *LONG)], ids=["as it is", "cautions", "critical"])
def test_what_is_critical_stands_whole_and_little_else(
    make: Callable[[], Joint], warnings: tuple[Finding, ...]
) -> None:
    """However much is found: the number, the reason, the table, all that is critical; of the rest whole sentences of a few lines, then codes."""
    joint = replace(make(), warnings=warnings).with_subjects()
    lines = brief_report([joint]).splitlines()
    assert max(map(len, lines)) <= WIDTH
    assert max(map(len, fit_report([joint]).splitlines())) <= WIDTH
    text, found, of_values = words("\n".join(lines)), verdict(joint), value_warnings(joint)
    of = ", SIMULATED data" if joint.simulated else ""
    assert text.startswith(f"{joint.name} ({joint.kind}{of}): {found.trust}. {known_to(joint, '+/-')}")
    critical = [x for x in of_values if x.severity is Severity.CRITICAL]
    assert (found.reason == CRITICAL) == (CRITICAL in warnings)
    for finding in critical:
        assert str(finding) in text
    told = [x for x in of_values if x not in critical and str(x) in text]
    assert sum(line.startswith("  caution") for line in lines) == len(told) <= LINES
    for finding in of_values:
        assert finding.code in text


def test_what_has_no_value_is_named_with_the_reason(joint: Joint) -> None:
    """Of what no run is about the table says what would show it; of what is not identifiable, that, and its bound where there is one."""
    text = words(brief_report([gripper()]))
    assert "sigma_0+, sigma_1+: not measured; slow loading or tracking runs would show them" in text
    opened = Finding("interval-open", CAUTION, "No finite interval: the data set no upper limit on v_s.")
    none = Estimate(value=None, unit="rad/s", warnings=(opened,))
    bound = Estimate(value=None, unit="N*m", interval=(0.0, 0.05), warnings=(opened,))
    fit = joint.static["+"]
    own = replace(fit, parameters={**fit.parameters, "v_s": none, "alpha_1": bound})
    text = words(brief_report([replace(joint, static={**joint.static, "+": own})]))
    assert "v_s+: not identifiable" in text
    assert "alpha_1+ < 0.05 N*m (95 %) static fit" in text
    # statistical and systematic error are one number in the table, and a sentence says so
    wide = replace(fit.parameters["alpha_0"], value=1.0, standard_error=0.03, systematic=0.04)
    told = Finding(
        "torque-uncertain",
        NOTE,
        "Torque: torque_constant 9.8 +/- 0.2 N*m/A.",
        {"constants": ("torque_constant 9.8 +/- 0.2 N*m/A",), "rest": ""},
    )
    own = replace(fit, parameters={**fit.parameters, "alpha_0": wide})
    text = words(brief_report([replace(joint, static={"+": own}, torque_scale=told)]))
    assert "alpha_0+ 1.000 +/- 0.050 N*m" in text
    assert "Standard errors include that of torque_constant 9.8 +/- 0.2 N*m/A." in text
    # a name with control characters or of many words takes no line of its own and no colour
    text = brief_report([replace(joint, name=f"a\x1b[31m\nuse {HOSTILE}"), joint])
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= max(WIDTH, len(HOSTILE) + 4)
