"""The explorer's physics: one JavaScript constant, `bristle`, with the functions that its page calls.

Every equation in it is printed from the CasADi functions that bristle itself evaluates, once for each friction law that
the page has; engine.js, which goes round them, holds loops alone, and says at its top what each function takes and
returns.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca

from bristle.control.adaptation import Adaptation, Law, Step, laws_for
from bristle.control.compensator import Compensator, Name, Reference, Velocity
from bristle.control.control_period import UNDISTURBED, LoopOptions, Numbers, after, at_rest, controlled, flat
from bristle.control.pid import Gains, Sliding
from bristle.control.symbolic import OF_ADAPTATION, OF_COMPENSATOR, setting_names, with_settings
from bristle.model import functions, time_refinement
from bristle.model.law import is_passive
from bristle.model.laws.gaussian import GAUSSIAN
from bristle.model.laws.parts import FASTEST, Expression
from bristle.model.laws.parts import Law as FrictionLaw
from bristle.model.parameters import SIGNED, Lugre, Motor, Pair, fields_of, least_of, lugre_of, pair_of
from bristle.questions.explorer import javascript
from bristle.simulation.joint_loop import JointLoop
from bristle.simulation.references import Sine

DURATION, SETTLE = 20.0, 10.0  # s: a run in the loop, and from when on its error counts
_SETTINGS = (*OF_COMPENSATOR, *OF_ADAPTATION, "limits", "gamma")
"""What is a number of a compensator and its adaptation, in the order in which a control period takes them."""
_LOGGED = ("position", "velocity", "deflection", "torque", "friction", "compensation")
"""What a control period logs beside the gains."""


class Way(NamedTuple):
    """What is compiled of a compensator: all that is no number."""

    name: Name
    velocity: Velocity = "reference"
    law: Law | None = None  # None: nothing adapts
    step: Step = "gradient"
    parameters: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """By which the script knows it."""
        parts = (self.name, self.velocity, *((self.law, self.step, *self.parameters) if self.law else ()))
        return " ".join(parts)


def script(loops: Sequence[JointLoop] = (), laws: Iterable[FrictionLaw] = (GAUSSIAN,)) -> str:
    """JavaScript that defines the constant `bristle`, and `module.exports` where there is a `module`; always the same text.

    It knows these friction laws and those of the loops. Its closed loop runs these joints, and any others that differ
    from them, or from the paper's, in numbers alone.
    """
    ways: dict[FrictionLaw, dict[Way, None]] = {
        law: dict.fromkeys(_ways(Compensator(), Adaptation()).values())
        for law in (*laws, *(loop.model.law for loop in loops))
    }
    for loop in loops:
        ways[loop.model.law] |= dict.fromkeys(_ways(loop.compensator, loop.adaptation).values())
    # The functions that the glue calls of any law, by their names there.
    T, g0, sigma_0, t, amplitude, frequency = map(_symbol, ("T", "g0", "sigma_0", "t", "amplitude", "frequency"))
    y = Sine(amplitude, frequency).position(t)
    y_t, displacement = ca.jacobian(y, t), functions.loading_displacement_function()(T, g0, sigma_0)[0]
    common = (
        _function("loadingDisplacement", [T, g0, sigma_0], displacement),
        _function("sine", [t, amplitude, frequency], y, y_t, ca.jacobian(y_t, t)),
    )
    parts = [
        'const bristle = (() => {\n"use strict";\n',
        javascript.HELPERS,
        *_constants({
            "FINE": time_refinement._FINE, "NEAR": time_refinement._NEAR, "MOST": time_refinement._MOST,
            "GAINS": Gains._fields, "SETTINGS": _SETTINGS, "LOGGED": _LOGGED, "FASTEST": FASTEST,
        }),
        *(javascript.printed(f, f.name()) for f in common),
        "const LAWS = {};\n",
        *(_of_law(law, tuple(own)) for law, own in ways.items()),
        Path(__file__).with_name("engine.js").read_text(encoding="utf-8"),
        '})();\nif (typeof module !== "undefined") module.exports = bristle;\n',
    ]  # fmt: skip  # a list of values
    return "".join(parts)


def loop_options(loop: JointLoop) -> dict[str, Any]:
    """What `bristle.closedLoop` takes, as plain JSON: the joint under its own adaptation, from its wrong start.

    All numbers may be changed there; `law` is a key of `laws`.
    """
    compensator, adaptation = loop.compensator, loop.adaptation
    return {
        "law": adaptation.law,
        "laws": {law: way.key for law, way in _ways(compensator, adaptation).items()},
        "plant": _by_direction(loop.plant),
        "model": _by_direction(loop.model),
        "start": {name: float(loop.start.get(name, 1.0)) for name in adaptation.parameters} | dict(loop.start),
        "J": float(loop.J),
        "gains": {name: float(x) for name, x in loop.gains._asdict().items()},
        "parameters": [*adaptation.parameters],
        "gamma": {law: [*loop.comparable_rates(law)] for law in laws_for(adaptation.parameters)},
        "limits": [*map(float, adaptation.limits)],
        **{name: float(getattr(compensator, name)) for name in OF_COMPENSATOR},
        **{name: float(getattr(adaptation, name)) for name in OF_ADAPTATION},
        "amplitude": float(loop.amplitude),
        "frequency": float(loop.frequency),
        "period": float(loop.period),
        "duration": DURATION,
        "settle": SETTLE,
    }


def _by_direction(pair: Pair[float]) -> dict[str, Any]:
    sets = {str(d): {name: float(x) for name, x in p._asdict().items()} for d, p in zip(SIGNED, pair, strict=True)}
    return {"law": pair.law.name, **sets}


def _ways(compensator: Compensator, adaptation: Adaptation) -> dict[str, Way]:
    """The ways in which a joint runs: `none`, `fixed`, and each law that can adapt these parameters."""
    fixed = Way(compensator.name, compensator.velocity)
    ways = {"none": Way("none"), "fixed": fixed}
    for law in laws_for(adaptation.parameters):
        ways[law] = fixed._replace(law=law, step=adaptation.step, parameters=adaptation.parameters)
    return ways


@cache
def _of_law(law: FrictionLaw, ways: tuple[Way, ...]) -> str:
    """The entry of one law in the script's `LAWS`: its parameters, its equations, and its loops in these ways."""
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
        *(javascript.printed(f, f.name()) for f in (*equations, *(f for pair in loops for f in pair))),
        f"const LOOPS = {{\n{''.join(table)}}};\n",
        f"return {{ {', '.join(named)} }};\n}})();\n",
    ]
    return "".join(parts)


def _constants(values: Mapping[str, Any]) -> list[str]:
    """Values as constants of JavaScript, whose `Infinity` is JSON's as Python writes it."""
    return [f"const {name} = {json.dumps(value)};\n" for name, value in values.items()]


def _equations(law: FrictionLaw) -> list[ca.Function]:
    """The functions of a law that the glue calls, by their names there.

    `q` is a pair, the positive set first, for the paper's law (12, 1), and `p` one set.
    """
    kind, count = lugre_of(law), len(fields_of(law))
    q, p = _symbol("q", 2 * count), _symbol("p", count)
    z, v, v0, v1, h = map(_symbol, ("z", "v", "v0", "v1", "h"))
    shape = [_symbol("v_s"), *(_symbol(f"own{k}") for k, _ in enumerate(law.peak.own))]

    def acting(z: Expression, v: Expression) -> Lugre[Any]:
        """The set that acts there."""
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
    """What the loop remembers at rest, and one control period of it, by a drive that takes the torque; numbers are inputs.

    (position, settings) -> memory, and (memory, y, v, a, plant, model, J, gains, settings, h) -> memory, what is
    logged, and gains of the adapted parameters. Settings are as in the script's `SETTINGS`, then gamma.
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
        gains=Gains(*ca.vertsplit(gains)), sliding=Sliding(0.0, 0.0, 1.0, 0.0), torque_limit=1e300, resolution=1.0, period=h,
    )  # fmt: skip  # a list of values
    now = controlled(options, constants)
    memory, given, _ = now.inputs
    log = now.log._asdict() | {"deflection": now.memory.plant.deflection}
    new = ca.vertcat(*flat(after(options, now, now.sent)), *(log[name] for name in _LOGGED), *now.log.theta)
    undisturbed = ca.vertcat(*flat(UNDISTURBED._replace(reference=Reference(y, v, a))))
    period = ca.substitute(new, given, undisturbed)
    return (
        _function(f"rest{k}", [y, settings], *flat(at_rest(options, y))),
        _function(f"period{k}", [memory, y, v, a, plant, model, J, gains, settings, h], period),
    )


def _symbol(name: str, size: int = 1) -> Expression:
    """A column of so many symbols."""
    return ca.SX.sym(name, size)


def _function(name: str, inputs: Sequence[Expression], *outputs: Expression) -> ca.Function:
    """One function of all outputs as one vector; its inputs have the names of their symbols."""
    names = [x.name() if x.is_scalar() else x[0].name().rsplit("_", 1)[0] for x in inputs]
    return ca.Function(name, [*inputs], [ca.densify(ca.vertcat(*outputs))], names, ["out"], {"cse": True})
