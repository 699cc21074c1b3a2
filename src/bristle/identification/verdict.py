"""The verdict on whether to use the identified values."""

import math
from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple

from bristle.errors import InputError
from bristle.findings import CAUTION, CRITICAL, Finding, Severity
from bristle.identification.known_joint import Known, Source, chosen, known_joint, moving_fits
from bristle.identification.results import Accuracy, Joint
from bristle.identification.shared_findings import NOT_IDENTIFIABLE


class Trust(StrEnum):
    """The verdict."""

    USE = "use"
    DO_NOT_USE = "do not use"


class Verdict(NamedTuple):
    """The verdict and its reason."""

    trust: Trust
    reason: Finding | None  # The most important finding, or None


_BY_WEIGHT = (
    "torque-unsigned unexplained misfit inertia-below-zero velocity-factor velocity-unrelated whole-positions count-unit "
    "count-contradicts effort-far-beyond links-not-removed joint-order gravity-direction links-oppose not-converged "
    "still-lower full-fit-lower undercut ipopt-undercuts "
    "v-s-unknowable static-too-few too-few-points indistinct strays stages-do-not-fit not-positive "
    "no-torque-constant acts-early feedback-unknown commands-at-once per-inertia one-speed-only "
    "stick-slip position-differs torque-drifts positions-disagree torques-doubted stick-slip-points "
    "inertia-doubted other-law lost-samples run-differs friction-drifts friction-by-position lacks-a-term lacks-unknown-term bursts "
    "reversals-left directions-differ residual-trend "
    "residual-ripple offset-or-friction drift-in-order takes-up-peak torque-delayed delay-or-presliding "
    "torque-drifts-in-runs friction-by-load clipped position-jumps "
    "position-held sampled-irregularly velocity-lags dead-zone torque-coarse loaded-at-start"
)
WEIGHTIEST_FIRST = {code: place for place, code in enumerate(_BY_WEIGHT.split())}
"""Order of findings without a known effect; others follow as they arose."""
_REPEATED = {"unseen", "converged-at-bound", "static-no-stribeck"}
"""Codes of a fit that repeat those of its values or directions."""


def verdict(joint: Joint) -> Verdict:
    """Whether to use the chosen values: friction is known as well as needed, and no finding about them is critical."""
    found, rows = value_warnings(joint), chosen(joint)
    if all(row.estimate.value is None for row in rows):
        static, moving = (x.outcome for x in joint.static.values()), (x.outcome for x in moving_fits(joint).values())
        why = _weightiest((*found, *joint.all_warnings(), *static, *moving))
        return Verdict(Trust.DO_NOT_USE, why[0] if why else None)
    known, levels = joint.accuracy, [row.estimate.value for row in rows if row.parameter.name == "alpha_0"]
    if known is None and not any(levels):
        message = (
            "Coulomb friction comes out as zero: an offset, viscous friction or another term takes up what is measured, and these "
            "data do not tell them apart. Move at several speeds, both ways, or leave a term out under fit.regressors."
            if 0 in levels
            else "It breaks away from rest, and no run slides steadily: stiffness and breakaway torque alone may be used. Move at several "
            "speeds, both ways; faster, where it sticks and slips."
            if joint.presliding is not None and joint.presliding.breakaway
            else "No run slides: the stiffness alone may be used. Move at several speeds, both ways."
        )
        worst = found[0] if found and found[0].severity is Severity.CRITICAL else None
        return Verdict(Trust.DO_NOT_USE, worst or Finding("no-curve", CRITICAL, message))
    if known is None:
        try:
            known_joint(joint)
        except InputError as bad:  # an impossible number
            found = (*found, Finding("impossible-value", CRITICAL, f"{str(bad).partition(': ')[2]}."))
    cause, wide = (next((x for x in found if x.code in codes), None) for codes in (_CAUSES, _CAUSES | _WIDENS))
    if critical := [x for x in found if x.severity is Severity.CRITICAL]:
        named = next((x for x in critical if x.code not in _SIZES), cause)
        return Verdict(Trust.DO_NOT_USE, named or critical[0])
    if known is not None and not known.band <= joint.need:
        return Verdict(Trust.DO_NOT_USE, _largest(joint, known, found[0] if found else None, wide))
    return Verdict(Trust.USE, None)


_CAUSES = {
    "inertia-doubted", "friction-drifts", "friction-by-position", "run-differs", "torque-drifts-in-runs", "torque-delayed", "friction-by-load",
    "dead-zone", "bursts", "reversals-left", "backlash", "flexible-drive", "position-jumps", "lost-samples", "clipped", "torque-missing",
    "torque-saturates",
}  # fmt: skip  # a list of values
_WIDENS = {"clipped-left-out", "dead-zone-left-out", "runs-scatter", "torque-coarse", "torques-doubted"}
"""Codes that explain large residuals, and those that explain wide errors."""
_SIZES = {"unexplained", "misfit"}  # codes that state the size of residuals


def _largest(joint: Joint, known: Accuracy, finding: Finding | None, cause: Finding | None) -> Finding:
    """The largest contribution to the width of the band."""
    of_findings = math.sqrt(max(known.band**2 - known.statistical**2 - known.apart**2 - known.sides**2, 0.0))
    largest = max(known.statistical, known.apart, known.sides, of_findings)
    # a missing term explains large errors and differing opinions
    if finding is not None and finding.effect.get("torque", 0.0) > 0 and known.sides != largest:
        return finding
    if known.apart == largest and cause is None:
        message = (
            f"A regression without a bristle on the same data ({known.opinion}) gives a friction that is {known.apart:.2g} % off "
            "this one, and explains the torque as well: one of them is wrong. Move slower and faster, both ways, for longer."
        )
        return Finding("opinions-differ", CRITICAL, message, {"apart": known.apart})
    if known.sides == largest:
        message = (
            f"These data do not distinguish an offset of the torque from friction that differs between the directions, which is {known.sides:.2g} % "
            f"of friction; their sum is known to {known.statistical:.2g} %. See whether the torque is zero where nothing loads the joint, and write "
            "`directions: symmetric` (an offset) or `separate` (friction) under fit (--directions)."
        )
        return Finding("offset-or-friction", CAUTION, message, {"share": known.sides})
    made = " and ".join(joint.uncertain_constants)
    if made and known.statistical == largest and known.constants**2 > known.statistical**2 / 2:
        message = f"Most of it is the error of {made}: measure that more closely."
        return Finding("too-uncertain", CRITICAL, message, {"band": known.band, "constants": known.constants})
    message = (
        "These data tell friction no better. Measure for longer, at more speeds, or with less noise in the torque."
    )
    return cause or Finding("too-uncertain", CRITICAL, message, {"band": known.band})


def value_warnings(joint: Joint) -> tuple[Finding, ...]:
    """Critical findings and cautions about the chosen values, most important first."""
    found = list(joint.warnings)
    for row in chosen(joint):
        codes = {x.code for x in row.estimate.warnings}
        if row.estimate.value is not None or NOT_IDENTIFIABLE.isdisjoint(codes):
            found += (x for x in row_warnings(joint, row) if x.code not in _REPEATED)
    return _serious(found)


def row_warnings(joint: Joint, row: Known) -> tuple[Finding, ...]:
    """All findings about one chosen value: of the joint, of its fit, and its own."""
    of_fit = _of_fit(joint, row) if row.estimate.value is not None else ()
    repeated = (x for x in of_fit if x.code not in _REPEATED)
    return tuple(dict.fromkeys((*joint.warnings, *repeated, *row.estimate.warnings)))


def other_warnings(joint: Joint) -> tuple[Finding, ...]:
    """Critical findings and cautions about everything else."""
    counted = value_warnings(joint)
    return tuple(warning for warning in _serious(joint.all_warnings()) if warning not in counted)


def _serious(warnings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings but notes, most important first."""
    return _weightiest(x for x in warnings if x.severity is not Severity.NOTE)


def _weightiest(warnings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Each finding once: critical first, then by effect and weight, notes last."""

    def place(x: Finding) -> tuple[float, ...]:
        effects = (-x.effect.get(of, 0.0) for of in ("torque", "errors"))
        weight = WEIGHTIEST_FIRST.get(x.code, len(WEIGHTIEST_FIRST))
        return x.severity is not Severity.CRITICAL, *effects, weight, x.severity is Severity.NOTE

    return tuple(sorted(dict.fromkeys(warnings), key=place))


def _of_fit(joint: Joint, row: Known) -> tuple[Finding, ...]:
    """Findings about the fit of a value, with its outcome and cross-check where they are no notes."""
    d, moving = str(row.parameter.direction), moving_fits(joint).get(row.source)
    if row.source is Source.PRESLIDING and joint.presliding is not None:
        return (*joint.presliding.fits[d].warnings, *joint.presliding.warnings)
    fit = joint.static[d] if row.source is Source.STATIC else moving
    if fit is None:
        return ()
    check = joint.crosscheck.get(d) if moving is None else None
    ended = (fit.outcome, *((check.verdict,) if check else ()))
    return (*(x for x in ended if x.severity is not Severity.NOTE), *fit.warnings)
