"""What the report says of its method: the equations, the shape of the curve, and what the paper leaves open."""

from importlib import resources

import numpy as np

from bristle.identification.curve import curve
from bristle.page.page import Drawing
from bristle.page.report import Section
from bristle.page.wording import number
from bristle.questions.joint_report.static_figures import FIG_1, FIG_1_V_S, stribeck_figure

INTRO = "Equation numbers are those of “Adaptive Friction Compensation: Application to a Robotic Manipulator”."


def method() -> tuple[Section, ...]:
    """The paragraphs of method.txt, each after what it is about, and the paper's Fig. 1."""
    text = resources.files("bristle.questions.joint_report").joinpath("method.txt").read_text(encoding="utf-8")
    steps, opened = (part.strip().split("\n\n") for part in text.split("\n\n\n"))
    v = np.linspace(1e-3, 0.5, 500)
    torque = curve(v, FIG_1.stribeck)
    low = int(np.argmin(torque))
    least, at = number(float(torque[low]), 3), number(float(v[low]), 2)
    caption = (
        f"Friction is highest at rest, {number(FIG_1.alpha_0 + FIG_1.alpha_1, 3)} N·m, and lowest at {at} rad/s, "
        f"{least} N·m, for vₛ = {FIG_1_V_S[1]} rad/s. Computed from (9), no data: α₀ = {FIG_1.alpha_0}, α₁ = "
        f"{FIG_1.alpha_1}, α₂ = {FIG_1.alpha_2} as in the paper; the three vₛ are assumed: the paper names none."
    )
    shape = Drawing(stribeck_figure, "fig1-stribeck", "the steady-state curve", caption, paper="Fig. 1")
    return _of(steps), Section("The shape of the curve", figure=shape), _of(opened)


def _of(paragraphs: list[str]) -> Section:
    title, *lines = (" ".join(x.split()) for x in paragraphs)
    pairs = (line.partition(": ") for line in lines)
    return Section(title, facts=tuple((about, said) for about, _, said in pairs))
