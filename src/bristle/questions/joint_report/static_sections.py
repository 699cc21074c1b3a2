"""What the pages show of static fits: parameters, curve, the same by other routes, and which law the data want."""

from collections.abc import Collection, Iterator, Mapping

import numpy as np
import pandas as pd

from bristle.identification.curve import friction_of, friction_points, shown_motion
from bristle.identification.known_joint import as_identified, moving_fits
from bristle.identification.results import Joint
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.parameters import of_curve, unit
from bristle.page.page import Drawing
from bristle.page.report import Section, Table
from bristle.page.style import MOST_POINTS
from bristle.page.wording import (
    FITS,
    counted,
    direction,
    in_print,
    measured,
    number,
    pretty,
    sentence,
    symbol,
)
from bristle.questions.joint_report import tables
from bristle.questions.joint_report.sentences import agreement

_HEADINGS = {
    "name": "", "bic": "ΔBIC", "left_out": "left out (%)", "chosen": "use it?",
}  # fmt: skip  # a table of words
"""Of the tables of laws and models."""


def parameters(joint: Joint) -> Iterator[Section]:
    """The parameters by the stage to use, those of static and slow runs alone, and what they depend on."""
    frame = tables.parameters([joint])
    own = tables.rounded(frame[frame["source"].isin(["static", "presliding"])].drop(columns="source"))
    extra = sorted({name for fit in joint.static.values() for name in fit.parameters if not of_curve(name)})
    notes = ["± one standard error."]
    notes += ["True: the value that was simulated; inside: whether the 95 % interval covers it."] * bool(joint.truth)
    if extra:
        notes.append(f"Fitted with friction, and subtracted from the torque in the figures: {', '.join(extra)}.")
    title, note = f"Parameters of {joint.name}", " ".join(notes)
    if joint.presliding is None and joint.tracking is None:
        yield Section("", table=Table("parameters", title, part=own, note=note), form="part")
    else:
        best = tables.rounded(tables.table_1([joint]))
        yield Section("", table=Table("table_1", title, part=best, note=note), form="part")
        if joint.tracking is not None and len(own):
            stages = "static and slow" if joint.presliding is not None else "static"
            alone = Table("", f"Parameters of {joint.name}, by stage", part=own)
            yield Section(f"From {stages} runs alone", table=alone, form="folded")
    if joint.assumptions:
        assumed = f"Assumed, not measured: {counted(len(joint.assumptions), 'point')} that the parameters depend on"
        text = "\n\n".join(map(in_print, joint.assumptions))
        yield Section(assumed, text=text, form="unfolded" if len(joint.assumptions) <= 3 else "folded")


def curve(joint: Joint, figures: Mapping[str, Drawing]) -> Drawing:
    """The curve with its points."""
    shown, known, motion = friction_points(joint), as_identified(joint), shown_motion(joint)
    if motion is not None:
        caption = [f"The fit leaves {number(motion.relative_error, 2)} % of the torque of the moving runs."]
    else:
        told = []
        for x in shown:
            left, norm = (np.linalg.norm(y) for y in (x.torque - friction_of(known, x.velocity), x.torque))
            if norm > 0 and np.isfinite(left):
                of = f"of the friction at {counted(x.velocity.size, 'point')}"
                told.append(f"{direction(x.direction)}: the curve leaves {number(float(100 * left / norm), 2)} % {of}")
        caption = [sentence("; ".join(told))]
    if any(x.velocity.size > MOST_POINTS for x in shown):
        caption.append(f"At most {MOST_POINTS} points are drawn per direction.")
    kinds = {
        "with 95 % error bars": any(x.segments for x in shown),
        "hollow: stick-slip": any(s.stick_slip for x in shown for s in x.segments),
        "crosses: rejected": any(not s.accepted for s in joint.segments),
        "rings: strays": any(fit.strays for fit in joint.static.values()),
        "what else was fitted taken off; those below the curve are of reversals and presliding": motion is not None,
    }
    points = "; ".join(("measured", *(kind for kind, there in kinds.items() if there)))
    band = "dotted where nothing is stated of it, and its 95 % band" if joint.accuracy else "without a band"
    law = "Equation (9)" if joint.law == GAUSSIAN else "The law"
    how = f"Points: {points}. Lines: {law} with the values to use, {band}. Below: magnitudes on a logarithmic axis."
    data = "points" if motion is None else ""
    return figures["curve"]._replace(caption=" ".join(caption), how=how, data=data, paper="Fig. 4")


def curve_and_residuals(joint: Joint, figures: Mapping[str, Drawing]) -> Iterator[Drawing]:
    """The curve, and what it leaves of the torque; a fit of moving runs shows that on its own figures."""
    yield curve(joint, figures)
    torque, found = pretty(unit("torque", joint.kind)), []
    for d, fit in joint.static.items():
        if d != "shared" and fit.residuals.size:
            rms, most = float(np.sqrt(np.mean(fit.residuals**2))), float(np.abs(fit.residuals).max())
            found.append(f"{direction(d)}: RMS residual {number(rms, 2)} {torque}, the largest {number(most, 2)}")
    how = "Measured minus fitted torque vs velocity, and vs position and time where they are known."
    if shown_motion(joint) is None:
        yield figures["residuals"]._replace(caption=sentence("; ".join(found)), how=how, data="points")


def hold_out(joint: Joint, fits: Collection[str], how: str = "") -> Iterator[Section]:
    """The error of some fits on runs that were not fitted; `how`: more about it."""
    frame = tables.hold_out([joint])
    frame = frame[frame["fit"].isin(fits)]
    if len(frame):
        note = f"Relative error: 100 · ‖measured − predicted‖ / ‖measured‖ on runs that were not fitted{how}."
        yield Section("", table=Table("hold_out", "Held-out runs", part=frame, note=note), form="part")


def correlations(joint: Joint) -> Iterator[Section]:
    """Pairs of estimates of one fit that are correlated by more than a half."""
    found = []
    fits = {direction(d): fit for d, fit in joint.static.items()}
    for name, fit in (fits | {FITS[kind]: fit for kind, fit in moving_fits(joint).items()}).items():
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = fit.covariance / np.sqrt(np.outer(*[np.diag(fit.covariance)] * 2))
        pairs = [(abs(shares[k]), k) for k in zip(*np.triu_indices(len(fit.names), 1), strict=True)]
        named = [
            f"{symbol(fit.names[i])} and {symbol(fit.names[k])} {shares[i, k]:+.2f}"
            for x, (i, k) in sorted(pairs, reverse=True)
            if x > 0.5
        ]
        found += [(name, "; ".join(named))] * bool(named)
    if found:
        yield Section("Correlations above 0.5", facts=tuple(found), form="folded")


def checks(joint: Joint, _: Mapping[str, Drawing]) -> list[Section]:
    """The same numbers by other routes, and whether another law or model would do."""
    return [*_crosscheck(joint), *_laws(joint), *_models(joint), *_stages(joint)]


def _crosscheck(joint: Joint) -> Iterator[Section]:
    """Each fit beside a full nonlinear one on the same data."""
    checks = {direction(d): check for d, check in joint.crosscheck.items()}
    frame = tables.crosscheck([joint])
    if checks:
        yield Section("Full nonlinear fit", form="part")
    for d, check in checks.items():
        own = frame[frame["direction"].map(direction) == d].drop(columns="direction")
        table = Table("crosscheck", "Grid and full fit", part=own)
        title = f"{d}: {in_print(check.verdict)}"
        yield Section(title, table=table, form="folded" if check.agrees else "unfolded")


def _laws(joint: Joint) -> Iterator[Section]:
    found = joint.laws
    if found is None:
        return
    fitted = f"Fitted: {joint.law_name} ({joint.law.title}). On {found.data}, {found.n} samples:"
    yield Section("Which friction law?", text=fitted, form="part")
    yield Section("", findings=(found.sentence,), form="part")
    how = (
        "All on the same points or samples, those that do not belong left out, a Stribeck term in every direction. "
        "ΔBIC: difference to the lowest. Left out: error, relative to the torque, at five "
        "blocks of speed, each predicted from the others. fit.law: auto leaves the paper's law "
        "(gaussian) only for one whose BIC is lower by more than 10 and that predicts the speeds left out better."
    )
    yield Section("All laws", table=_compared("laws", tables.laws([joint]), joint, how), form="folded")


def _compared(name: str, frame: pd.DataFrame, joint: Joint, how: str) -> Table:
    """Models or laws side by side."""
    part = frame.drop(columns=["data", "candidate", *(["left_out"] if name == "models" else [])])
    columns = {**_HEADINGS, "name": name.removesuffix("s"), "rms": f"rms ({pretty(unit('torque', joint.kind))})"}
    return Table(name, name.capitalize(), part=part.rename(columns=columns), note=how)


def _models(joint: Joint) -> Iterator[Section]:
    how = (
        "All on the same data, with the directions and regressors of the fit. ΔBIC: difference to the lowest; it weighs "
        "the residuals of the independent samples against the number of parameters, and lower is better. Stribeck curve: "
        "Coulomb, viscous and Stribeck friction, (9), which LuGre is at constant velocity. Recommended: the lowest BIC "
        "among the models whose terms the fits above support."
    )
    if joint.models:
        yield Section("Which friction model?", form="part")
    for x in joint.models:
        frame = tables.models([joint])
        independent = "" if x.n == x.effective else f", of which {number(x.effective, 4)} count as independent"
        yield Section("", text=f"On {x.data}, {x.n} samples{independent}:", findings=(x.sentence,), form="part")
        table = _compared("models", frame[frame["data"] == x.data], joint, how)
        yield Section("All models", table=table, form="folded")


def _stages(joint: Joint) -> Iterator[Section]:
    """Each parameter from its own stage, the moving runs alone and all at once."""
    if not joint.consistency:
        return
    rows = [
        (
            str(x.parameter), unit(x.parameter.name, joint.kind), x.stage, measured(x.stage_value, x.stage_error),
            measured(x.tracking_value, x.tracking_error), measured(x.joint_value, x.joint_error), x.difference_in_se, in_print(x.verdict),
        )
        for x in joint.consistency
    ]  # fmt: skip  # one row, one line
    columns = ["parameter", "unit", "stage", "stage_value", "tracking_value", "joint_value", "difference", "verdict"]
    how = (
        "± one standard error. Difference: moving runs alone minus the separate stage, in combined standard errors; "
        "chance alone exceeds 2.6 in one case in a hundred."
    )
    frame = pd.DataFrame(rows, columns=columns).astype({"difference": float})
    yield Section("Do the stages agree?", form="part")
    table = Table("consistency", "Stages compared", part=frame, note=how)
    yield Section(in_print(agreement(joint)), table=table, form="folded")
