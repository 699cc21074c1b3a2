"""Sentences on moving runs and presliding, shared by page and text."""

import math

import numpy as np

from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.curve import stated_curve, tops_of
from bristle.identification.fits import Estimate, PreslidingFit, StaticFit, TrackingFit
from bristle.identification.known_joint import chosen, value_fits
from bristle.identification.results import Joint
from bristle.identification.verdict import value_warnings
from bristle.model.parameters import Kind, ParameterName, effort, unit
from bristle.page.wording import measured, number


def known_to(joint: Joint, plus_minus: str = "±", *, beside: bool = False) -> str:
    """How well friction is known, over which speeds, and the error of the torque, unless that is told `beside`."""
    known = joint.accuracy
    if known is None:
        told = any(row.parameter.name == "alpha_0" and row.estimate.value for row in chosen(joint))
        return "How well its friction is known was not computed." if told else "No friction vs velocity is known."
    short = not known.band <= joint.need
    digits = next(k for k in range(2, 17) if not short or number(known.band, k) != number(joint.need, k))
    need = f", where {plus_minus} {number(joint.need, 2)} % is needed" if short else ""
    to = f"to {plus_minus} {number(known.band, digits)} % (95 %)" if math.isfinite(known.band) else "to no stated error"
    ends = dict.fromkeys(number(x, 2) for x in (known.slowest, known.fastest))
    speeds = f"{'from' if len(ends) > 1 else 'at'} {' to '.join(ends)} {unit('v_s', joint.kind)}"
    # where the band is widest beside friction
    v = np.geomspace(known.slowest, known.fastest, 50)
    friction, half = stated_curve(joint, np.concatenate([v, -v]))
    shares = np.nan_to_num(100 * half / np.abs(friction), posinf=0.0).reshape(2, -1)
    shares = np.where(v <= np.array(tops_of(joint))[:, None], shares, 0.0).max(axis=0)
    if known.band < shares.max() / 2:
        at = number(float(v[shares.argmax()]), 2)
        speeds += f", at worst {plus_minus} {number(float(shares.max()), 2)} % at {at} {unit('v_s', joint.kind)}"
    assumed = ["commands are not held between samples"] * any(
        w.code == "commands-at-once" for w in value_warnings(joint)
    )
    if joint.torque_scale is not None and (exact := joint.torque_scale.numbers.get("exact")):
        assumed.append(f"{exact} exact")
    speeds += f", ASSUMED {' and '.join(assumed)}" if assumed else ""
    held = held_out(joint)
    left = error_left(joint)
    if left is None or (beside and held is not None):
        return f"Friction known {to} {speeds}{need}."
    what = effort(joint.kind)
    of_friction = friction_left(joint) if known.share < 0.5 and not beside else None
    share = "" if of_friction is None else f" ({number(of_friction, 2)} % of friction)"
    rest = f"; {'fitted' if held is None else 'held-out'} {what} within {number(left, 2)} %{share}"
    return f"Friction known {to} {speeds}{need}{rest}."


def held_out(joint: Joint) -> float | None:
    """The largest relative error of the values to use on held-out runs, percent; None without such runs."""
    return max((x.relative_error for fit in value_fits(joint) for x in fit.hold_out), default=None)


def error_left(joint: Joint) -> float | None:
    """`held_out`, or else the largest relative error on the fitted runs."""
    fitted = (fit.relative_error for fit in value_fits(joint) if fit.relative_error is not None)
    held = held_out(joint)
    return max(fitted, default=None) if held is None else held


def friction_left(joint: Joint) -> float | None:
    """`error_left` relative to friction, percent: the friction that compensation leaves on the joint's own runs.

    None where it is not known, or averages at constant velocity were fitted.
    """
    left, known = error_left(joint), joint.accuracy
    averages = any(isinstance(fit, StaticFit) and fit.segments for fit in value_fits(joint))
    if left is None or known is None or not known.share or averages:
        return None
    return left / known.share


def pair(e: Estimate) -> str:
    """Value, standard error and systematic error, if any: 0.30 ± 0.01 ± 0.02 (systematic)."""
    constants = "" if e.systematic is None or e.value is None else f" ± {number(e.systematic, 2)} (systematic)"
    return measured(e.value, e.standard_error) + constants


def biased(fit: TrackingFit) -> dict[ParameterName, str]:
    """Bias by encoder counts above `named_errors`, by parameter: -0.12 N*m/rad (-0.4 standard errors)."""
    found = {}
    for name, added in fit.count_bias.items():
        e = fit.parameters.get(name)
        if e is not None and e.standard_error and abs(added) > levels.NAMED_ERRORS * e.standard_error:
            found[name] = f"{added:+.3g} {e.unit} ({added / e.standard_error:+.1f} standard errors)"
    return found


def reached(fit: TrackingFit) -> str:
    """Number of starts that found the lowest cost."""
    if fit.starts == 1:
        return "Initialised at the other stages' estimates alone."
    return f"{fit.reached} of {fit.starts} starts reached the lowest cost."


def agreement(joint: Joint) -> str | None:
    """Number of parameters that agree between their own stage and the moving data; None without any."""
    known = {x.parameter: abs(x.difference_in_se) for x in joint.consistency if x.difference_in_se is not None}
    if not known:
        none = "The moving data show none of the parameters that the other stages know."
        return none if joint.consistency else None
    agreed, unseen = len(known) - sum(x.differs for x in joint.consistency), len(joint.consistency) - len(known)
    largest = max(known, key=lambda name: known[name])
    more = f"; {unseen} more not identifiable from the tracking runs" if unseen else ""
    return (
        f"{agreed} of {len(known)} parameters agree between their own stage and the moving data; "
        f"the largest difference is {known[largest]:.2g} standard errors ({largest}){more}."
    )


def methods(fit: PreslidingFit) -> dict[str, Estimate]:
    """The estimates of sigma_0 by method, of `METHODS`."""
    return {"printed": fit.printed, "edges" if fit.quantum else "samples": fit.sigma_0}


def choice(fit: PreslidingFit) -> Finding:
    """What sigma_0 is made of."""
    if fit.sigma_0.value is None:
        least = (fit.sigma_0.interval or (math.nan,))[0]
        if math.isnan(least):
            return Finding("sigma-0-unknown", CAUTION, "No sigma_0 can be given.")
        at_least = f"No sigma_0 can be given; it is at least {least:.3g} {fit.sigma_0.unit}."
        return Finding("sigma-0-at-least", CAUTION, at_least, {"least": least})
    if fit.quantum:
        insensitive = "sigma_0 from encoder transitions; insensitive to where inside a count the joint rests."
        return Finding("from-transitions", NOTE, insensitive)
    no_edges = "sigma_0 from all samples; no counts are seen in the displacement, so there are no edges to go by."
    return Finding("from-samples", NOTE, no_edges)


def level(fit: PreslidingFit, kind: Kind) -> str:
    """g0 with its error, or as a lower bound, and its unit."""
    at_least = math.isinf(fit.level_standard_error)
    value = measured(fit.level, None if at_least else fit.level_standard_error)
    return f"{'at least ' * at_least}{value} {unit('torque', kind)}"
