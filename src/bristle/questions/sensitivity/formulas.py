"""The derivatives of the friction torque as formulas: CasADi's own expressions, walked instruction by instruction, collected and written down.

Sums and products are kept flat, like terms and like factors collected, so that an expression has one form: two formulas are the same formula
where their trees are equal. Nothing here knows a derivative; all come from `model.law` by CasADi.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import casadi as ca

from bristle.control.adaptation import printed
from bristle.model import law
from bristle.model.parameters import Lugre


class Name(NamedTuple):
    """A symbol."""

    name: str


class Call(NamedTuple):
    """A function of one argument: `abs`, `exp` or `sign`."""

    function: str
    argument: "Tree"


class Product(NamedTuple):
    """A number times powers of factors, each factor once; without factors a number."""

    number: Fraction
    powers: tuple[tuple["Tree", int], ...]


class Sum(NamedTuple):
    """Terms, no two of which differ by their numbers only."""

    terms: tuple["Tree", ...]


Tree = Name | Call | Product | Sum


def number(x: float | Fraction) -> Product:
    """A number as a tree."""
    return Product(Fraction(x), ())


def product(*factors: Tree) -> Tree:
    """Factors multiplied, like ones collected; a sum is not multiplied out."""
    size, powers = Fraction(1), dict[Tree, int]()
    for factor in factors:
        own = factor if isinstance(factor, Product) else Product(Fraction(1), ((factor, 1),))
        size *= own.number
        for base, power in own.powers:
            powers[base] = powers.get(base, 0) + power
    kept = tuple(sorted(((base, power) for base, power in powers.items() if power), key=repr))
    if size == 0:
        return number(0)
    return kept[0][0] if size == 1 and len(kept) == 1 and kept[0][1] == 1 else Product(size, kept)


def power(base: Tree, exponent: int) -> Tree:
    """A tree to a whole power, each factor of a product by itself."""
    own = base if isinstance(base, Product) else Product(Fraction(1), ((base, 1),))
    raised = Product(own.number**exponent, tuple((factor, n * exponent) for factor, n in own.powers))
    return product(raised)


def total(*terms: Tree) -> Tree:
    """Terms added, like ones collected."""
    shares: dict[Tree, Fraction] = {}
    for term in (part for t in terms for part in (t.terms if isinstance(t, Sum) else (t,))):
        size, rest = (
            (term.number, Product(Fraction(1), term.powers)) if isinstance(term, Product) else (Fraction(1), term)
        )
        bare = product(rest)
        shares[bare] = shares.get(bare, Fraction(0)) + size
    kept = [product(number(size), bare) for bare, size in shares.items() if size]
    if len(kept) < 2:
        return kept[0] if kept else number(0)
    return Sum(tuple(sorted(kept, key=repr)))


_OPERATIONS: dict[int, Callable[..., Tree]] = {
    ca.OP_ASSIGN: lambda a: a,
    ca.OP_ADD: total,
    ca.OP_SUB: lambda a, b: total(a, product(number(-1), b)),
    ca.OP_NEG: lambda a: product(number(-1), a),
    ca.OP_MUL: product,
    ca.OP_TWICE: lambda a: product(number(2), a),
    ca.OP_DIV: lambda a, b: product(a, power(b, -1)),
    ca.OP_INV: lambda a: power(a, -1),
    ca.OP_SQ: lambda a: power(a, 2),
    ca.OP_FABS: lambda a: Call("abs", a),
    ca.OP_EXP: lambda a: Call("exp", a),
    ca.OP_SIGN: lambda a: Call("sign", a),
}
"""What each of CasADi's operations makes of trees."""


def tree_of(function: ca.Function) -> Tree:
    """The only output of a scalar CasADi function as a tree over the names of its inputs.

    Raises ValueError for an operation that has no place in a tree.
    """
    whole = function if function.is_a("SXFunction") else function.expand()
    work: dict[int, Tree] = {}
    found: Tree = number(0)  # a structurally zero output has no instruction
    for k in range(whole.n_instructions()):
        code, read, write = whole.instruction_id(k), whole.instruction_input(k), whole.instruction_output(k)
        if code == ca.OP_INPUT:
            work[write[0]] = Name(whole.name_in(read[0]))
        elif code == ca.OP_CONST:
            work[write[0]] = number(float(whole.instruction_constant(k)))
        elif code == ca.OP_OUTPUT:
            found = work[read[0]]
        elif code in _OPERATIONS:
            work[write[0]] = _OPERATIONS[code](*(work[r] for r in read))
        else:
            raise ValueError(f"{whole.name()}: CasADi operation number {code} cannot be written as a formula")
    return found


def replaced(tree: Tree, old: Tree, new: Tree) -> Tree:
    """The tree with each place where `old` stands holding `new`."""
    if tree == old:
        return new
    if isinstance(tree, Call):
        return Call(tree.function, replaced(tree.argument, old, new))
    if isinstance(tree, Product):
        return product(number(tree.number), *(power(replaced(base, old, new), n) for base, n in tree.powers))
    return total(*(replaced(term, old, new) for term in tree.terms)) if isinstance(tree, Sum) else tree


class Script(NamedTuple):
    """A way to write trees."""

    names: Mapping[str, str]
    calls: Mapping[str, str]
    times: str
    over: str
    raised: str
    bracket: str


TEXT = Script(
    {}, {"abs": "abs({})", "exp": "exp({})", "sign": "sign({})"}, "*", "{} / {}", "{}**{}", "({})"
)  # fmt: skip  # a table
"""As Python reads it."""
LATEX = Script(
    {"alpha_0": r"\alpha_0", "alpha_1": r"\alpha_1", "alpha_2": r"\alpha_2", "v_s": "v_s", "sigma_0": r"\sigma_0", "sigma_1": r"\sigma_1"},
    {"abs": r"\left|{}\right|", "exp": "e^{{{}}}", "sign": r"\operatorname{{sgn}}({})"}, r"\,", r"\frac{{{}}}{{{}}}", "{}^{{{}}}",
    r"\left({}\right)",
)  # fmt: skip  # a table
"""As LaTeX's mathematics reads it."""
_FIRST = ("alpha_0", "alpha_1", "alpha_2", "sigma_0", "sigma_1")
"""Factors that stand before all others, in this order; functions stand last."""


def written(tree: Tree, script: Script = TEXT) -> str:
    """A tree as text or as LaTeX."""
    if isinstance(tree, Name):
        return script.names.get(tree.name, tree.name)
    if isinstance(tree, Call):
        return script.calls[tree.function].format(written(tree.argument, script))
    if isinstance(tree, Sum):
        return _sum(tree, script)
    return _product(tree, script)


def _sum(tree: Sum, script: Script) -> str:
    """Terms with their signs, those without a minus first."""
    ordered = sorted(tree.terms, key=lambda term: (_negative(term), _order(term)))
    parts = [(_negative(term), written(_magnitude(term), script)) for term in ordered]
    text = "".join(f" {'-' if minus else '+'} {part}" for minus, part in parts)
    return text[3:] if text.startswith(" + ") else f"-{text[3:]}"


def _negative(term: Tree) -> bool:
    return isinstance(term, Product) and term.number < 0


def _magnitude(term: Tree) -> Tree:
    return product(number(-1), term) if _negative(term) else term


def _product(tree: Product, script: Script) -> str:
    sign, size = ("-" if tree.number < 0 else ""), abs(tree.number)
    groups: dict[int, list[Tree]] = {}
    for base, n in tree.powers:
        groups.setdefault(n, []).append(base)
    above = [(b, n) for n, bases in groups.items() if n > 0 for b in bases]
    below = [(b, -n) for n, bases in groups.items() if n < 0 for b in bases]
    if size == 1 and len(above) == len(below) == 1 and above[0][1] == below[0][1] > 1:  # (v / v_s)**2
        ratio = script.over.format(*(_factors([(side[0][0], 1)], 1, script) for side in (above, below)))
        return sign + script.raised.format(script.bracket.format(ratio), above[0][1])
    top = _factors(above, size.numerator, script)
    if not below and size.denominator == 1:
        return sign + top
    count = len(below) + (size.denominator != 1)
    bottom = _factors(below, size.denominator, script)
    if script is TEXT and count > 1:
        bottom = script.bracket.format(bottom)
    return sign + script.over.format(top, bottom)


def _factors(powers: Iterable[tuple[Tree, int]], size: int, script: Script) -> str:
    ordered = sorted(powers, key=lambda item: _order(item[0]))
    alone = len(ordered) == 1 and size == 1
    parts = [_factor(base, n, script, alone=alone) for base, n in ordered]
    return script.times.join([str(size), *parts] if size != 1 or not parts else parts)


def _factor(base: Tree, n: int, script: Script, *, alone: bool) -> str:
    text = written(base, script)
    if n == 1:
        return script.bracket.format(text) if isinstance(base, Sum) and not (alone and script is LATEX) else text
    return script.raised.format(text if isinstance(base, Name) else script.bracket.format(text), n)


def _order(tree: Tree) -> tuple[int, str]:
    """Where a factor or a term stands: parameters, other names, powers, sums, functions; each by its text."""
    if isinstance(tree, Name):
        return (_FIRST.index(tree.name) if tree.name in _FIRST else len(_FIRST), tree.name)
    rank = {Product: 1, Sum: 3, Call: 2}[type(tree)]
    first = min((_order(base) for base, _ in tree.powers), default=(0, "")) if isinstance(tree, Product) else (0, "")
    return (first[0], first[1]) if isinstance(tree, Product) else (len(_FIRST) + rank, written(tree))


@dataclass(frozen=True, slots=True, kw_only=True)
class Formulas:
    """The friction torque and its derivatives, each a tree over z, v and the parameters."""

    torque: Tree
    stribeck: Tree
    """g(v) (5)."""
    partial: dict[str, Tree]
    """The derivative of T_f by each parameter at fixed z, and by `z`."""
    steady: dict[str, Tree]
    """The derivative of the steady torque by each parameter: the total one once the bristle has settled."""
    printed: Tree
    """The right-hand side of (19), without -gamma and e."""

    @property
    def printed_is(self) -> tuple[str, ...]:
        """The parameters by which the partial derivative is, term by term, what (19) prints."""
        return tuple(name for name, tree in self.partial.items() if tree == self.printed)


def formulas() -> Formulas:
    """Everything that `bristle sensitivity --symbolic` prints, from `model.law` by CasADi."""
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), Lugre(*(ca.SX.sym(name) for name in Lugre._fields))
    inputs = [z, v, *p]

    def tree(expression: Any) -> Tree:
        """An expression of z, v and the parameters as a tree."""
        names = ["z", "v", *Lugre._fields]
        return tree_of(ca.Function("formula", inputs, [ca.densify(ca.SX(expression))], names, ["y"]))

    T, T_ss = law.torque(z, v, p), law.steady_torque(v, p)
    by = dict(zip(("z", *Lugre._fields), (z, *p), strict=True))
    return Formulas(
        torque=tree(T),
        stribeck=tree(law.stribeck(v, p)),
        partial={name: tree(ca.jacobian(T, x)) for name, x in by.items()},
        steady={name: tree(ca.jacobian(T_ss, x)) for name, x in by.items() if name != "z"},
        printed=tree(printed("alpha_0", z, v, p)),
    )


def abbreviated(tree: Tree, stribeck: Tree) -> Tree:
    """The tree with g standing for g(v)."""
    return replaced(tree, stribeck, Name("g"))
