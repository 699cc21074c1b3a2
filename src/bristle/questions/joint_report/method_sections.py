"""What the report says of its method: the equations, the shape of the curve, and what the paper leaves open."""

import numpy as np

from bristle.identification.curve import curve
from bristle.page.page import Drawing
from bristle.page.report import Page, Section
from bristle.page.wording import number
from bristle.questions.joint_report.static_figures import FIG_1, FIG_1_V_S, stribeck_figure

_STEPS = (
    (
        "Torque",
        "As logged; from current by the torque constant; or from voltage by (8), T = kₜ (V − kₜ v) / R, which holds at constant "
        "velocity.",
    ),
    (
        "Model",
        "The steady state (9) of the LuGre model (3)–(5), Tₛₛ(v) = (α₀ + α₁ exp(−(v/vₛ)²)) sgn(v) + α₂ v; another law, where one "
        "is fitted, has another peak or more viscous terms, and is named beside its joint.",
    ),
    (
        "Fit",
        "The cost (10) is linear in α₀, α₁, α₂ for a given vₛ (11)–(13). It is solved on a grid of vₛ, with α ≥ 0, and refined to "
        "the continuous minimum of the profile; the paper's plain grid is shown for comparison.",
    ),
    (
        "Intervals, 95 %",
        "Of static parameters from the profile of each (F distribution), all others re-optimised, with α ≥ 0; of fits of moving "
        "runs from the covariance at the minimum (Student's t). The page on uncertainty compares covariance, profile and bootstrap.",
    ),
    (
        "Presliding",
        "(4) gives T = g₀ (1 − exp(−σ₀ y / g₀)) vs the displacement y of slow loading from rest, with g₀ = α₀ + α₁. (14), "
        "σ₀ = T₁ / x₁ at the first displacement x₁ that is measured, takes a chord of this curve for its slope at rest, and is "
        "biased low. Its inverse, σ₀ = −(g₀ / x₁) ln(1 − T₁ / g₀), is exact where rest lies on a count edge. Edges: with "
        "U = −g₀ ln(1 − T / g₀), the slope of U vs y from count edge to count edge, in which the rest position cancels. Samples: "
        "the inverse slope of y vs U of all samples, with time as the instrument. σ₁ comes from (15), which assumes a damping "
        "ratio of 0.1.",
    ),
    (
        "Moving runs",
        "All six parameters of a direction at once, with inertia and offset where they are asked for. The measured velocity drives "
        "the model (3)–(5); torque and model go through the same filter before both are decimated, so that neither is delayed. "
        "Gauss-Newton steps with the exact Jacobian of the rollout, from several starts. Each segment between gaps has its own "
        "initial bristle state, which is estimated too. The covariance allows for residuals that are correlated. Where velocity "
        "comes from encoder counts, a parametric bootstrap (the fitted motion quantised again, from other rest positions) estimates "
        "the bias of each parameter, which is subtracted. The joint fit uses the estimates of the other stages as priors, with "
        "their covariance. Where parameters differ by direction, σ₀ switches with the sign of z and all others with the sign of v.",
    ),
    (
        "Derivatives",
        "They come from CasADi. The cross-check solves for all parameters at once with IPOPT, from several random starts.",
    ),
)
_OPEN = (
    ("Stiction", "It calls α₁ “stiction”; the breakaway level is α₀ + α₁."),
    (
        "Constants",
        "kₜ, R, L, J and the unit of the control signal are not given: any value used for Ed-Ro is an assumption. Its (15) implies "
        "an inertia that differs by up to 20 % between the two directions of one joint.",
    ),
    (
        "Directions",
        "Parameters differ by direction (Table 1), and the text does not say how to switch: here σ₀ switches with the sign of z, "
        "all others with the sign of v, which keeps the torque continuous.",
    ),
    ("Passivity", "LuGre is passive for α₂ > σ₁ α₁ / α₀; base rotation (−) of Table 1 violates it."),
    (
        "Adaptation",
        "(19) as printed is the derivative by α₁, not by α₀; and with rates ≥ 0 the gains move in the right direction only for "
        "e = y − y_ref, not for the PID's error.",
    ),
    (
        "Presliding",
        "(14) is biased low by the encoder's resolution, and ignores where inside a count the joint rests. (15) is a prior, not an "
        "estimate: J and the damping ratio are not measured by it.",
    ),
)


def method() -> Page:
    """The page."""
    v = np.linspace(1e-3, 0.5, 500)
    torque = curve(v, FIG_1.stribeck)
    low = int(np.argmin(torque))
    least, at = number(float(torque[low]), 3), number(float(v[low]), 2)
    caption = (
        f"Friction is highest at rest, {number(FIG_1.alpha_0 + FIG_1.alpha_1, 3)} N·m, and lowest at {at} rad/s, {least} N·m, for "
        f"vₛ = {FIG_1_V_S[1]} rad/s. Computed from (9), no data: α₀ = {FIG_1.alpha_0}, α₁ = {FIG_1.alpha_1}, α₂ = {FIG_1.alpha_2} "
        "as in the paper; the three vₛ are assumed: the paper names none."
    )
    shape = Drawing(stribeck_figure, "fig1-stribeck", "the steady-state curve", caption, paper="Fig. 1")
    about = "Equation numbers are those of “Adaptive Friction Compensation: Application to a Robotic Manipulator”."
    return Page(
        "method.html",
        "Method",
        "equations, and what the paper leaves open",
        (
            Section("From data to numbers", facts=_STEPS),
            Section("The shape of the curve", figure=shape),
            Section("What the paper leaves open", facts=_OPEN),
        ),
        text=about,
    )
