"""The friction torque and its derivatives as formulas, all from `model.law` by CasADi."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca

from bristle.control.adaptation import printed
from bristle.findings import NOTE, Finding
from bristle.model import law
from bristle.model.formula import Formula, abbreviated, as_latex, as_text, formula_of
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Law
from bristle.model.parameters import estimated_of, lugre_of


class Written(NamedTuple):
    """One formula as text."""

    what: str
    formula: str  # in Python
    with_g: str  # in Python, with g for g(v)
    latex: str  # with g for g(v)


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The friction torque of a law and its derivatives."""

    law: Law
    torque: Formula  # T_f (3)
    stribeck: Formula  # g(v) (5)
    partial: dict[str, Formula]  # derivatives of T_f by each parameter at fixed z, and by `z`
    steady: dict[str, Formula]  # derivatives of the steady torque by each parameter
    printed: Formula | None  # right-hand side of (19), without -gamma and e; None if the peak is not the paper's

    @property
    def printed_is(self) -> tuple[str, ...]:
        """Parameters whose partial derivative equals the printed (19), term by term."""
        return tuple(name for name, formula in self.partial.items() if formula == self.printed)

    def rows(self) -> tuple[Written, ...]:
        """Every formula, with its name."""
        by_parameter = {f"dT_f/d{name} at fixed z": self.partial[name] for name in estimated_of(self.law)}
        steady = {f"dT_ss/d{name}, steady sliding": formula for name, formula in self.steady.items()}
        others = {
            "T_f": self.torque, **by_parameter, "dT_f/dz": self.partial["z"], **steady,
        } | ({} if self.printed is None else {"(19) as printed, without -gamma_1 and e": self.printed})  # fmt: skip  # a table
        short = {what: abbreviated(formula, self.stribeck) for what, formula in others.items()}
        return (
            Written("g(v)", as_text(self.stribeck), as_text(self.stribeck), as_latex(self.stribeck)),
            *(Written(what, as_text(x), as_text(short[what]), as_latex(short[what])) for what, x in others.items()),
        )

    def sentences(self) -> tuple[Finding, ...]:
        """What the printed (19) is by CasADi's derivatives, and where the formulas hold."""
        found = []
        if self.printed is not None:
            same = ", ".join(f"dT_f/d{name}" for name in self.printed_is) or "none of these derivatives"
            extra = "" if "alpha_0" in self.printed_is else " It is not dT_f/dalpha_0, which it is said to be."
            message = f"The right-hand side of the paper's (19) is, term by term, {same}.{extra}"
            found.append(Finding("printed-is", NOTE, message, {"parameters": self.printed_is}))
        message = (
            "Total derivatives add dT_f/dz dz/dp, with z through the whole motion; "
            "in steady sliding they are those of T_ss above."
        )
        found.append(Finding("total-derivatives", NOTE, message))
        if self.law.terms:
            message = (
                f"Viscous friction is written as it is up to {FASTEST}, the fastest speed measured; where one of its "
                "coefficients is negative, it stays beyond as large as there."
            )
            found.append(Finding("formulas-as-measured", NOTE, message))
        return tuple(found)

    def text(self) -> str:
        """The output of `bristle sensitivity --symbolic`."""
        lines = ["Derivatives of the friction torque T_f (3)-(5), by CasADi.", ""]
        for row in self.rows():
            short = "" if row.with_g == row.formula else f"    = {row.with_g}\n"
            lines.append(f"{row.what}\n    = {row.formula}\n{short}    LaTeX: {row.latex}\n")
        return "\n".join([*lines, *map(str, self.sentences())])


def formulas(of: Law = GAUSSIAN) -> Formulas:
    """The formulas of a law up to the fastest measured speed. Raises InputError without SymPy, else as `formula_of`."""
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), lugre_of(of)(*map(ca.SX.sym, lugre_of(of)._fields))
    torque, steady = law.torque(z, v, p), law.steady_torque(v, p)
    estimated = [getattr(p, name) for name in estimated_of(of)]

    def written(expression: Any) -> Formula:
        return formula_of(expression, dict.fromkeys(of.coefficients, 0.0))

    return Formulas(
        law=of,
        torque=written(torque),
        stribeck=written(law.stribeck(v, p)),
        partial={x.name(): written(ca.jacobian(torque, x)) for x in (z, *estimated)},
        steady={x.name(): written(ca.jacobian(steady, x)) for x in estimated},
        printed=written(printed("alpha_0", z, v, p)) if of.peak == GAUSSIAN.peak else None,
    )
