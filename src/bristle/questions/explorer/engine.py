"""The explorer's physics: one JavaScript constant, `bristle`, printed from CasADi functions around engine.js."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca

from bristle.control.adaptation import Adaptation, Law, Step, laws_for
from bristle.control.compensator import Compensator, Name, Reference, Velocity
from bristle.control.control_period import UNDISTURBED, LoopOptions, Numbers, at_rest, flat, period_of
from bristle.control.pid import Gains
from bristle.control.symbolic import OF_ADAPTATION, OF_COMPENSATOR, setting_names, with_settings
from bristle.model import functions, time_refinement
from bristle.model.law import is_passive
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Expression
from bristle.model.laws.parts import Law as FrictionLaw
from bristle.model.parameters import SIGNED, Lugre, Motor, Pair, fields_of, least_of, lugre_of, pair_of
from bristle.model.printing import FUNCTIONS, INFIX, Language, Term, statements
from bristle.simulation.joint_loop import JointLoop
from bristle.simulation.references import Sine

DURATION, SETTLE = 20.0, 10.0  # of a run in the loop, and the start of its RMS error, s
_SETTINGS = (*OF_COMPENSATOR, *OF_ADAPTATION, "limits", "gamma")  # numbers of a compensator, in order
_LOGGED = ("position", "velocity", "deflection", "torque", "friction", "compensation")  # beside the gains
HELPERS = """\
// NaN counts as missing, as in C.
const fmin = (x, y) => (x <= y || y !== y ? x : y);
const fmax = (x, y) => (x >= y || y !== y ? x : y);
const copysign = (x, y) => (y < 0 || Object.is(y, -0) ? -Math.abs(x) : Math.abs(x));
"""  # of operations that `Math` lacks

_INFIX = {**INFIX, ca.OP_FMOD: "%"}
_TRUTH = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "===", ca.OP_NE: "!=="}
_HELPED = {ca.OP_FMIN: "fmin", ca.OP_FMAX: "fmax", ca.OP_COPYSIGN: "copysign"}
_OTHERS: dict[int, Callable[..., str]] = {
    ca.OP_ASSIGN: "{}".format,
    ca.OP_NEG: "-{}".format,
    ca.OP_SQ: "{0} * {0}".format,
    ca.OP_TWICE: "2 * {}".format,
    ca.OP_INV: "1 / {}".format,
    ca.OP_AND: "{} !== 0 && {} !== 0 ? 1 : 0".format,
    ca.OP_OR: "{} !== 0 || {} !== 0 ? 1 : 0".format,
    ca.OP_NOT: "{} === 0 ? 1 : 0".format,
    ca.OP_IF_ELSE_ZERO: "{} !== 0 ? {} : 0".format,
}


class Way(NamedTuple):
    """A compensator without its numbers."""

    name: Name
    velocity: Velocity = "reference"
    law: Law | None = None  # None: nothing adapts
    step: Step = "gradient"
    parameters: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Its key in the script."""
        parts = (self.name, self.velocity, *((self.law, self.step, *self.parameters) if self.law else ()))
        return " ".join(parts)


def script(loops: Sequence[JointLoop] = (), laws: Iterable[FrictionLaw] = (GAUSSIAN,)) -> str:
    """JavaScript that defines `bristle`, and exports it if there is a `module`, for some laws and loops."""
    ways: dict[FrictionLaw, dict[Way, None]] = {
        law: dict.fromkeys(_ways(Compensator(), Adaptation()).values())
        for law in (*laws, *(loop.model.law for loop in loops))
    }
    for loop in loops:
        ways[loop.model.law] |= dict.fromkeys(_ways(loop.compensator, loop.adaptation).values())
    # Functions of every law, by their names in engine.js.
    T, g0, sigma_0, t, amplitude, frequency = map(_symbol, ("T", "g0", "sigma_0", "t", "amplitude", "frequency"))
    y = Sine(amplitude, frequency).position(t)
    y_t, displacement = ca.jacobian(y, t), functions.loading_displacement_function()(T, g0, sigma_0)[0]
    common = (
        _function("loadingDisplacement", [T, g0, sigma_0], displacement),
        _function("sine", [t, amplitude, frequency], y, y_t, ca.jacobian(y_t, t)),
    )
    parts = [
        'const bristle = (() => {\n"use strict";\n',
        HELPERS,
        *_constants({
            "FINE": time_refinement._FINE, "NEAR": time_refinement._NEAR, "MOST": time_refinement._MOST,
            "GAINS": Gains._fields, "SETTINGS": _SETTINGS, "LOGGED": _LOGGED, "FASTEST": FASTEST,
        }),
        *(printed(f, f.name()) for f in common),
        "const LAWS = {};\n",
        *(_of_law(law, tuple(own)) for law, own in ways.items()),
        Path(__file__).with_name("engine.js").read_text(encoding="utf-8"),
        '})();\nif (typeof module !== "undefined") module.exports = bristle;\n',
    ]  # fmt: skip  # a list of values
    return "".join(parts)


def loop_options(loop: JointLoop) -> dict[str, Any]:
    """Arguments of `bristle.closedLoop` as JSON: the joint under its own adaptation, from its wrong start."""
    compensator, adaptation = loop.compensator, loop.adaptation
    return {
        "law": adaptation.law, "laws": {law: way.key for law, way in _ways(compensator, adaptation).items()},
        "plant": _by_direction(loop.plant), "model": _by_direction(loop.model),
        "start": {name: float(loop.start.get(name, 1.0)) for name in adaptation.parameters} | dict(loop.start),
        "J": float(loop.J), "gains": {name: float(x) for name, x in loop.gains._asdict().items()},
        "parameters": [*adaptation.parameters],
        "gamma": {law: [*loop.comparable_rates(law)] for law in laws_for(adaptation.parameters)},
        "limits": [*map(float, adaptation.limits)],
        **{name: float(getattr(compensator, name)) for name in OF_COMPENSATOR},
        **{name: float(getattr(adaptation, name)) for name in OF_ADAPTATION}, "amplitude": float(loop.amplitude),
        "frequency": float(loop.frequency), "period": float(loop.period), "duration": DURATION, "settle": SETTLE,
    }  # fmt: skip  # a list of values


def _by_direction(pair: Pair[float]) -> dict[str, Any]:
    sets = {str(d): {name: float(x) for name, x in p._asdict().items()} for d, p in zip(SIGNED, pair, strict=True)}
    return {"law": pair.law.name, **sets}


def _ways(compensator: Compensator, adaptation: Adaptation) -> dict[str, Way]:
    """The compensators of a joint: `none`, `fixed`, and each law that can adapt these parameters."""
    fixed = Way(compensator.name, compensator.velocity)
    ways = {"none": Way("none"), "fixed": fixed}
    for law in laws_for(adaptation.parameters):
        ways[law] = fixed._replace(law=law, step=adaptation.step, parameters=adaptation.parameters)
    return ways


@cache
def _of_law(law: FrictionLaw, ways: tuple[Way, ...]) -> str:
    """The entry of a law in the script's `LAWS`: its parameters, equations, and loops."""
    equations, loops = _equations(law), [_loop(way, k, law) for k, way in enumerate(ways)]
    table = [
        f"  {json.dumps(way.key)}: {{ rest: rest{k}, period: period{k}, size: {rest.numel_out(0)} }},\n"
        for k, (way, (rest, _)) in enumerate(zip(ways, loops, strict=True))
    ]
    coefficients = ("alpha_0", "alpha_1", "alpha_2", *law.coefficients)
    constants = {
        "FIELDS": fields_of(law), "SHAPE": law.shape_parameters,
        "COEFFICIENTS": coefficients, "LEAST": [least_of(name) for name in coefficients],
    }  # fmt: skip  # a list of values
    named = [*constants, "LOOPS", *(equation.name() for equation in equations)]
    parts = [
        f"LAWS[{json.dumps(law.name)}] = (() => {{\n",
        *_constants(constants),
        *(printed(f, f.name()) for f in (*equations, *(f for pair in loops for f in pair))),
        f"const LOOPS = {{\n{''.join(table)}}};\n",
        f"return {{ {', '.join(named)} }};\n}})();\n",
    ]
    return "".join(parts)


def _constants(values: Mapping[str, Any]) -> list[str]:
    return [f"const {name} = {json.dumps(value)};\n" for name, value in values.items()]


def _equations(law: FrictionLaw) -> list[ca.Function]:
    """The functions of a law, by their names in engine.js; `q`: a pair, the positive set first, `p`: one set."""
    kind, count = lugre_of(law), len(fields_of(law))
    q, p = _symbol("q", 2 * count), _symbol("p", count)
    z, v, v0, v1, h = map(_symbol, ("z", "v", "v0", "v1", "h"))
    shape = [_symbol("v_s"), *(_symbol(f"own{k}") for k, _ in enumerate(law.peak.own))]

    def acting(z: Expression, v: Expression) -> Lugre[Any]:
        return kind(*functions.active_function(law)(z, v, *ca.vertsplit(q)))

    steady, (level, *viscous) = acting(v, v), functions.linear_shapes_function(law)(v)
    peak = functions.stribeck_shape_function(law)(v, *shape)
    step = functions.step_function(law)(v0, v1, h, *acting(z, v0 + v1))
    return [
        _function("steadyTorque", [v, q], functions.steady_torque_function(law)(v, *steady.stribeck)),
        _function("steadyColumns", [v, *shape], level, peak, *viscous),
        _function("steadyDeflection", [v, q], functions.steady_deflection_function(law)(v, *steady)[0]),
        _function("frictionTorque", [z, v, q], functions.torque_function(law)(z, v, *acting(z, v))),
        _function("bristleStep", [z, v0, v1, h, q], *step),
        _function("passive", [p], is_passive(kind(*ca.vertsplit(p)))),
    ]


def _loop(way: Way, k: int, law: FrictionLaw) -> tuple[ca.Function, ca.Function]:
    """The loop at rest, and one control period of it, with an ideal drive.

    (position, settings) -> memory, and (memory, y, v, a, plant, model, J, gains, settings, h) -> memory, `_LOGGED`, and
    gains of the adapted parameters. Settings as in the script's `SETTINGS`, then gamma.
    """
    names = setting_names(len(way.parameters))
    settings = _symbol("settings", len(names))
    adapts = None
    if way.law:
        rates = (0.0,) * len(way.parameters)
        adapts = Adaptation(law=way.law, step=way.step, parameters=way.parameters, gamma=rates)
    kind = Compensator(name=way.name, velocity=way.velocity, adaptation=adapts)
    compensator = with_settings(kind, dict(zip(names, ca.vertsplit(settings), strict=True)))
    options, count = LoopOptions(compensator=compensator, law=law, model_law=law), 2 * len(fields_of(law))
    plant, model, gains = _symbol("plant", count), _symbol("model", count), _symbol("gains", 4)
    y, v, a, J, h = map(_symbol, ("y", "v", "a", "J", "h"))
    constants = Numbers(
        plant=pair_of(ca.vertsplit(plant), law), model=pair_of(ca.vertsplit(model), law), motor=Motor(1.0, 1.0, 0.0, J),
        gains=Gains(*ca.vertsplit(gains)), torque_limit=1e300, resolution=1.0, period=h,
    )  # fmt: skip  # a list of values
    now = period_of(options, constants)
    memory, given, _ = now.inputs
    log = now.log._asdict() | {"deflection": now.before.plant.deflection}
    new = ca.vertcat(*flat(now.after), *(log[name] for name in _LOGGED), *now.log.theta)
    undisturbed = ca.vertcat(*flat(UNDISTURBED._replace(reference=Reference(y, v, a))))
    period = ca.substitute(new, given, undisturbed)
    return (
        _function(f"rest{k}", [y, settings], *flat(at_rest(options, y))),
        _function(f"period{k}", [memory, y, v, a, plant, model, J, gains, settings, h], period),
    )


def _symbol(name: str, size: int = 1) -> Expression:
    return ca.SX.sym(name, size)


def _function(name: str, inputs: Sequence[Expression], *outputs: Expression) -> ca.Function:
    """A function of all outputs as one vector, with inputs named as their symbols."""
    names = [x.name() if x.is_scalar() else x[0].name().rsplit("_", 1)[0] for x in inputs]
    return ca.Function(name, [*inputs], [ca.densify(ca.vertcat(*outputs))], names, ["out"], {"cse": True})


def operation(code: int, operands: Sequence[Term]) -> Term:
    """CasADi's operation with this code as a JavaScript expression. Raises KeyError for erf and erfinv."""
    texts = [x.text for x in operands]
    if code in _INFIX:
        return Term(f" {_INFIX[code]} ".join(texts))
    if code in _TRUTH:
        return Term(f" {_TRUTH[code]} ".join(texts) + " ? 1 : 0")
    if code in FUNCTIONS and code != ca.OP_ERF:
        return Term(f"{_HELPED.get(code) or f'Math.{FUNCTIONS[code]}'}({', '.join(texts)})")
    return Term(_OTHERS[code](*texts))


def _number(value: float) -> str:
    text = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}.get(repr(value)) or repr(value).removesuffix(".0")
    return f"({text})" if text.startswith("-") else text


def printed(function: ca.Function, name: str) -> str:
    """A CasADi function in JavaScript with that name.

    Arguments are the inputs by name: a number, or an array of elements, column by column. A function of one number
    returns it; others write all elements of all outputs to their last argument, `out`.

    Raises ValueError where an operation has no counterpart.
    """
    arguments = [function.name_in(k) for k in range(function.n_in())]
    scalar = [function.numel_in(k) == 1 for k in range(function.n_in())]

    def operand(place: int, element: int) -> str:
        return arguments[place] if scalar[place] else f"{arguments[place]}[{element}]"

    javascript = Language("JavaScript", operation, _number, lambda name, value: f"const {name} = {value.text};")
    lines, outputs = statements(function, operand, javascript)
    if len(outputs) == 1:
        last = [f"return {outputs[0].text};"]
    else:
        arguments.append("out")
        last = [f"out[{k}] = {x.text};" for k, x in enumerate(outputs)]
    body = "".join(f"  {line}\n" for line in (*lines, *last))
    return f"function {name}({', '.join(arguments)}) {{\n{body}}}\n"
