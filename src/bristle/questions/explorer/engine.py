"""The explorer's physics: one JavaScript constant, `bristle`, with the functions that its page calls.

Every equation in it is printed from the CasADi functions that bristle itself evaluates; engine.js, which goes round
them, holds loops alone, and says at its top what each function takes and returns.
"""

from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca

from bristle.model import functions, time_refinement
from bristle.model.parameters import Lugre
from bristle.questions.explorer import javascript
from bristle.simulation.references import Sine

_GLUE = Path(__file__).with_name("engine.js")
_CONSTANTS = {
    "FINE": time_refinement._FINE,
    "NEAR": time_refinement._NEAR,
    "MOST": time_refinement._MOST,
}
"""Of the time refinement, as Python has them."""


@cache
def script() -> str:
    """JavaScript that defines the constant `bristle`, and `module.exports` where there is a `module`; always the same text."""
    parts = [
        javascript.HELPERS,
        *(f"const {name} = {value!r};\n" for name, value in _CONSTANTS.items()),
        *(javascript.printed(function, function.name()) for function in _equations()),
        _GLUE.read_text(encoding="utf-8"),
    ]
    return (
        'const bristle = (() => {\n"use strict";\n'
        + "".join(parts)
        + '})();\nif (typeof module !== "undefined") module.exports = bristle;\n'
    )


def _equations() -> list[ca.Function]:
    """The functions that the glue calls, by their names there; `q` is a pair, the positive set first, (12, 1)."""
    q, z, v, v0, v1, h = ca.SX.sym("q", 12), *(ca.SX.sym(name) for name in ("z", "v", "v0", "v1", "h"))
    acting = functions.active_function()
    pair = ca.vertsplit(q)
    by_v, at_z = Lugre(*acting(v, v, *pair)), Lugre(*acting(z, v, *pair))
    T, g0, sigma_0 = (ca.SX.sym(name) for name in ("T", "g0", "sigma_0"))
    t, amplitude, frequency, v_s = (ca.SX.sym(name) for name in ("t", "amplitude", "frequency", "v_s"))
    y = Sine(amplitude, frequency).position(t)  # type: ignore[arg-type]  # symbols
    y_t = ca.jacobian(y, t)
    over_step = Lugre(*acting(z, v0 + v1, *pair))
    linear = functions.linear_shapes_function()(v)
    shape = functions.stribeck_shape_function()(v, v_s)
    return [
        _function("steadyTorque", {"v": v, "q": q}, [functions.steady_torque_function()(v, *by_v.stribeck)]),
        _function("steadyJacobian", {"v": v, "q": q}, functions.steady_jacobian_function()(v, *by_v.stribeck)),
        _function("steadyColumns", {"v": v, "v_s": v_s}, [linear[0], shape, linear[1]]),
        _function("steadyDeflection", {"v": v, "q": q}, functions.steady_deflection_function()(v, *by_v)[:1]),
        _function("frictionTorque", {"z": z, "v": v, "q": q}, [functions.torque_function()(z, v, *at_z)]),
        _function(
            "bristleStep",
            {"z": z, "v0": v0, "v1": v1, "h": h, "q": q},
            functions.step_function()(v0, v1, h, *over_step),
        ),
        _function(
            "loadingDisplacement",
            {"T": T, "g0": g0, "sigma_0": sigma_0},
            functions.loading_displacement_function()(T, g0, sigma_0)[:1],
        ),
        _function("sine", {"t": t, "amplitude": amplitude, "frequency": frequency}, [y, y_t, ca.jacobian(y_t, t)]),
    ]


def _function(name: str, inputs: dict[str, Any], outputs: Any) -> ca.Function:
    """One function of all outputs as one vector."""
    return ca.Function(
        name, list(inputs.values()), [ca.densify(ca.vertcat(*outputs))], list(inputs), ["out"], {"cse": True}
    )
