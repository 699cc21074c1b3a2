"""What `import bristle` offers. The command line only calls these."""

from bristle.api.arrays import find_segments, fit, fit_dynamic, fit_presliding, friction, simulate
from bristle.api.experiments import (
    adapt,
    compare,
    draft,
    inspect,
    plan,
    report,
    report_of,
    sensitivity,
    validate,
)
from bristle.api.exporting import explore, export
from bristle.api.fleets import Fleet, fleet
from bristle.api.identifying import identify
from bristle.api.results import Results, read_results
from bristle.data.experiment.draft import Told
from bristle.errors import InputError
from bristle.estimation.levels import changed_levels
from bristle.model.laws.parts import OwnParameter, Peak, ViscousTerm
from bristle.model.laws.registry import register_law
from bristle.model.parameters import Lugre, Pair
from bristle.questions.array_fit.fit import Fit
from bristle.questions.export.export import Export
from bristle.simulation.joint_model import JointModel

__all__ = [
    "Export", "Fit", "Fleet", "InputError", "JointModel", "Lugre", "OwnParameter", "Pair", "Peak", "Results",
    "Told", "ViscousTerm", "adapt", "changed_levels", "compare", "draft", "explore", "export", "find_segments",
    "fit", "fit_dynamic", "fit_presliding", "fleet", "friction", "identify", "inspect", "plan",
    "read_results", "register_law", "report", "report_of", "sensitivity", "simulate", "validate",
]  # fmt: skip  # a list of names
