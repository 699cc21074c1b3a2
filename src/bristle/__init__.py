"""bristle: the friction of a joint, identified from simple experiments.

Logs go in; a LuGre model with honest uncertainty and a report one can hand over come out.

    results = bristle.identify("experiment.yaml")
    results.to_frame()
    results.write("reports/wrist")
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bristle.api import (
        Fleet,
        Results,
        adapt,
        compare,
        complete,
        draft,
        explore,
        export,
        find_segments,
        fit,
        fit_dynamic,
        fit_presliding,
        fleet,
        friction,
        identify,
        inspect,
        plan,
        read_export,
        read_results,
        report,
        report_of,
        sensitivity,
        simulate,
        validate,
    )
    from bristle.data.experiment.draft import Told
    from bristle.errors import InputError
    from bristle.identification.joint_model import JointModel
    from bristle.model.laws.parts import OwnParameter, Peak, ViscousTerm
    from bristle.model.laws.registry import register_law
    from bristle.model.parameters import Lugre, Pair
    from bristle.questions.array_fit.fit import Fit
    from bristle.questions.export.export import Export

__version__ = "0.1.0"
__all__ = [
    "Export",
    "Fit",
    "Fleet",
    "InputError",
    "JointModel",
    "Lugre",
    "OwnParameter",
    "Pair",
    "Peak",
    "Results",
    "Told",
    "ViscousTerm",
    "__version__",
    "adapt",
    "compare",
    "complete",
    "draft",
    "explore",
    "export",
    "find_segments",
    "fit",
    "fit_dynamic",
    "fit_presliding",
    "fleet",
    "friction",
    "identify",
    "inspect",
    "plan",
    "read_export",
    "read_results",
    "register_law",
    "report",
    "report_of",
    "sensitivity",
    "simulate",
    "validate",
]


def __getattr__(name: str) -> object:
    """Import the library when it is first used: `bristle --help` must not wait for it."""
    if name in __all__:
        from bristle import api

        return getattr(api, name)
    raise AttributeError(f"module 'bristle' has no attribute {name!r}")
