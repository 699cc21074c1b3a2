"""Findings that fits of points and of motion have in common."""

from bristle.findings import CAUTION, NOTE, Finding, unit_of


def at_bound() -> Finding:
    """Of an estimate at its physical bound."""
    return Finding("at-bound", CAUTION, "At its physical bound of zero: the interval is one-sided.")


def curve_held(fastest: float) -> Finding:
    """Of viscous friction that bends down, with the fastest speed that was measured, rad/s."""
    message = (
        f"Viscous friction bends down with speed (alpha_3 < 0). Faster than {fastest:.3g}{unit_of('velocity')}, the fastest speed "
        "measured, it is taken to stay as large as there."
    )
    return Finding("curve-held", CAUTION, message, {"fastest": fastest})


def lacks_a_term(advice: Finding) -> Finding:
    """Of a fit, with what to do about it."""
    return Finding("lacks-a-term", CAUTION, f"The fit lacks a term. {advice.message}", {"advice": advice})


def term_explains(lines: str, share: float) -> Finding:
    """That a fit lacks a term, which explains this share of the squares that it leaves, with the lines that add it."""
    message = (
        f"Under fit, write {lines}: beside all that is fitted it explains {100 * share:.0f} % of the squares that the fit leaves "
        "(an F test, to first order)."
    )
    return lacks_a_term(Finding("term-explains", NOTE, message, {"lines": lines, "share": share}))


def takes_up_peak() -> Finding:
    """Of a parameter beside a Stribeck term that is there, and left out."""
    message = (
        "It takes up part of a Stribeck term that these speeds show but do not bound: it describes the measured "
        "speeds, and no others."
    )
    return Finding("takes-up-peak", CAUTION, message)


def not_shown(names: tuple[object, ...]) -> Finding:
    """Of parameters that a motion does not show."""
    message = f"Not identifiable from this motion: {', '.join(map(str, names))}."
    return Finding("unseen", CAUTION, message, {"names": names})
