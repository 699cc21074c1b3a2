"""Export to LaTeX: a plain `tabular` of the parameters; a law other than the paper's has its equations below."""

import re
from collections.abc import Iterator, Sequence

from bristle.model.formula import abbreviated, as_latex, formula_of, symbol_of
from bristle.model.parameters import SIGNED, Direction, Lugre, of_friction
from bristle.page.wording import FITS, measured, shortened, slugs, span
from bristle.questions.export.export import Artefact, ExportTarget, Request, equations, in_ascii, notes, slug
from bristle.questions.export.exported import ExportedJoint

_HOLDS = "each parameter, rounded to two digits of its standard error, with unit, 95 % interval and source"
_ESCAPED = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}",
    '"': "{''}", "-": "{-}",
}  # fmt: skip  # a table
_SIGNS = {Direction.POSITIVE: "^+", Direction.NEGATIVE: "^-"}
_PLAIN = {
    r"\operatorname": r"\mathrm", r"\text{": r"\mbox{",
    r"\begin{cases}": r"\left\{\begin{array}{ll}", r"\end{cases}": r"\end{array}\right.",
}  # fmt: skip  # SymPy's commands of packages, and plain LaTeX


def write_latex(joints: Sequence[ExportedJoint], request: Request) -> Artefact:  # noqa: ARG001  # nothing is lost along any motion
    """The table with caption and label, of several joints one below the other."""
    comments = "".join(f"% {in_ascii(line)}\n" for joint in joints for line in notes(joint))
    rows = []
    for joint in joints:
        rows += [rf"\multicolumn{{5}}{{l}}{{{latex_text(joint.name)}}} \\"] if len(joints) > 1 else []
        for one in joint.parameters:
            mark = "$^*$" if one.assumed else ""
            interval = "" if one.interval is None else _math(span(one.interval).replace("∞", r"\infty"))
            value = _math(measured(one.value, one.standard_error).replace("±", r"\pm"))
            unit = re.sub(r"\*\*([0-9])", r"$^\1$", one.unit).replace("*", r"\,")
            name, direction = one.parameter
            symbol = latex_text(name)
            if of_friction(name):
                paper = name if name == "v_s" else rf"\{name}"
                symbol = f"${paper if name in Lugre._fields else as_latex(symbol_of(name))}{_SIGNS.get(direction, '')}$"
            cells = (symbol, value + mark, unit, interval, latex_text(FITS.get(one.source, one.source)))
            rows.append(rf"{' & '.join(cells)} \\")
    laws = "".join(dict.fromkeys(text for joint in joints for text in _equations(joint)))
    whose = "of the joints" if len(joints) > 1 else f"of {latex_text(joints[0].name)}"
    simulated = " Identified from simulated data." if any(joint.simulated for joint in joints) else ""
    assumed = any(one.assumed for joint in joints for one in joint.parameters)
    marked = " Values with an asterisk are assumed, not identified." if assumed else ""
    told = "value $\\pm$ standard error, where there is one, and 95~\\% interval."
    table = "\n".join(rows)
    text = f"""\
{comments}\\begin{{table}}
\\centering
\\caption{{LuGre friction {whose}: {told}{simulated}{marked}}}
\\label{{tab:friction-{slugs([slug(joints)])[0]}}}
\\begin{{tabular}}{{lllll}}
\\hline
Parameter & Value & Unit & 95 \\% interval & Source \\\\
\\hline
{table}
\\hline
\\end{{tabular}}
{laws}\\end{{table}}
"""
    holds = f"{_HOLDS}; the equations of the law" if laws else _HOLDS
    return Artefact(name=f"{slug(joints)}.tex", content=text.encode("utf-8"), holds=holds)


def _equations(joint: ExportedJoint) -> Iterator[str]:
    """The equations of a law other than the paper's, of each direction if signs of coefficients differ."""
    found = [*equations(joint)]
    signs = [tuple(getattr(p, name) < 0 for name in joint.law.coefficients) for p in joint.curves]
    alike = signs[0] == signs[1]
    for p, d in list(zip(joint.curves, SIGNED, strict=True))[: 0 if not found else 1 if alike else 2]:
        signed = {name: getattr(p, name) for name in joint.law.coefficients}
        level = formula_of(found[0].expression, signed)
        lines = [f"Friction law {latex_text(joint.law.name)}" + ("" if alike else f", direction ${d}$")]
        for one in found:
            formula = formula_of(one.expression, signed)
            text = as_latex(formula if one.name == "level" else abbreviated(formula, level))
            for package, plain in _PLAIN.items():
                text = text.replace(package, plain)
            lines.append(f"${one.latex} = {text}$")
        yield "\n\\medskip\n" + " \\\\\n".join(lines) + "\n"


def _math(text: str) -> str:
    """Numbers in math mode, exponents as powers of ten."""
    return "$" + re.sub(r"e(?:\+|(-))0*([0-9]+)", r" \\times 10^{\1\2}", text) + "$"


def latex_text(text: str) -> str:
    """A text escaped for LaTeX, in at most 80 characters; letters without a glyph in plain LaTeX by their code."""
    line = shortened(" ".join(text.split()), 80).replace("…", "...")
    # All but ASCII, and letters of Western Europe that every font encoding of LaTeX has.
    odd = {c for c in line if not (c.isascii() or (c.isalpha() and "\u00c0" <= c <= "\u00ff" and c not in "ÐðÞþ"))}
    return "".join(_ESCAPED.get(c) or (f"[U+{ord(c):04X}]" if c in odd else c) for c in line)


TARGET = ExportTarget(write=write_latex)
