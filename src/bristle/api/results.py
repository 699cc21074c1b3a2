"""What `identify` returns, and reads back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from bristle.api.sources import JointLogs, path_of, placed
from bristle.errors import InputError, short, short_list
from bristle.findings import Finding
from bristle.identification.document import document_of, joints_of, reading, with_samples
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.identification.verdict import Trust, verdict
from bristle.progress import Progress
from bristle.questions.compensation.study import Study, adverse, worth_of_each
from bristle.questions.joint_report.results_file import to_frame, to_json
from bristle.questions.method_validation.cases import check_fitted
from bristle.questions.session_comparison.results import session_of
from bristle.simulation.joint_model import JointModel
from bristle.workers import Share

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from bristle.page.page import Drawing
    from bristle.questions.explorer.page import Explorer
    from bristle.questions.export.export import Export


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What was identified, joint by joint."""

    joints: tuple[Joint, ...]
    logs: JointLogs = field(default_factory=JointLogs, compare=False, repr=False)
    """What the joints were identified from, for questions that follow."""

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Every finding about a joint, one of its stages or a fit, with the joint's name first in its subject."""
        return tuple(replace(x, subject=(one.name, *x.subject)) for one in self.joints for x in one.fit_warnings())

    @property
    def not_to_be_used(self) -> tuple[str, ...]:
        """Names of the joints whose values are not to be used."""
        return tuple(joint.name for joint in self.joints if verdict(joint).trust is Trust.DO_NOT_USE)

    def joint(self, name: str | None = None) -> Joint:
        """The joint of a name, or the only one. Raises InputError where there are several, or none of that name."""
        names = [joint.name for joint in self.joints]
        return self.joints[names.index(choose(names, name))]

    def model(self, name: str | None = None) -> JointModel:
        """The joint of a name as one model: friction, CasADi functions, a compensator. Raises InputError as `joint` does.

        >>> import bristle
        >>> wrist = bristle.identify("wrist.yaml").model()
        >>> wrist.friction([-0.5, 0.0, 0.5]).round(3).tolist()
        [-0.04, 0.0, 0.04]
        >>> wrist.to_frame().loc["alpha_0", "unit"]
        'N*m'
        """
        joint = self.joint(name)
        measured = self.logs.read.get(joint.name)
        return JointModel(joint, None if measured is None else measured.experiment)

    @property
    def measured(self) -> tuple[Measured, ...]:
        """The data of each joint; logs are read if they were not. Raises InputError as `JointLogs.of` does."""
        return tuple(self.logs.of(joint) for joint in self.joints)

    def text(self, *, full: bool = False) -> str:
        """Of each joint the values to use, whether to trust them, and its warnings; with `full` every fit, as on the pages.

        80 columns wide, as `bristle identify` and `bristle identify --full` print it.
        """
        from bristle.questions.joint_report.brief import brief_report

        if full:
            return str(import_module("bristle.questions.joint_report.report").full_text(self.joints))
        return brief_report(self.joints)

    def __str__(self) -> str:
        return self.text()

    def outcomes(self) -> tuple[str, ...]:
        """How each fit ended, and the number of its warnings, a line each."""
        from bristle.questions.joint_report.brief import outcomes

        return tuple(outcomes(self.joints))

    def checks(self) -> str:
        """Each fit beside a full nonlinear one on the same data, and other laws and models, as on the page of cross-checks.

        Raises InputError where nothing was fitted that could be checked.
        """
        for joint in self.joints:
            check_fitted(joint)
        return str(import_module("bristle.questions.joint_report.report").full_text(self.joints, "checks.html"))

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint, direction and parameter: value, unit, standard error, interval, warnings."""
        return to_frame(self.joints)

    def to_json(self, folder: Path | str = ".") -> str:
        """`results.json` of schema bristle-results/3, which `read_results` reads; `folder` is where it will lie.

        From there it names the experiment files, whose logs are read again when a question needs them.
        """
        return to_json(self.joints, tuple(self.logs.written(Path(folder))))

    def uncertainty(self) -> "pd.DataFrame":
        """One row per joint, fit and parameter: the 95 % interval by covariance, profile and bootstrap, and their warnings."""
        from bristle.questions.joint_report.tables import uncertainty

        return uncertainty(self.joints)

    def write(
        self,
        folder: Path | str,
        progress: Progress | None = None,
        compensated: Study | None = None,
        explored: "Explorer | None" = None,
        *,
        mailed: bool = False,
        share: Share = map,
        begun: Mapping[str, Mapping[str, "Drawing"]] = MappingProxyType({}),
    ) -> Path:
        """Write the report into a folder: pages, results.json, figures, tables. Returns the index.html.

        What `adapt` and `explore` returned becomes pages as well; `mailed`: all of it also in one reproducible file,
        report.zip. `share` does the drawing, and `begun` are figures of joints by kind that are drawn already. Only what
        bristle made there before is replaced. Raises InputError where the folder cannot be used, with nothing
        half-written.
        """
        from bristle.page.page import encoded

        names, files = [joint.name for joint in self.joints], {"results.json": encoded(self.to_json(folder))}
        told: dict[str, Any] = {}
        if compensated is not None:
            worth, harms = dict(worth_of_each(compensated)), tuple(adverse(compensated))
            sections = import_module("bristle.questions.compensation.report").sections(compensated, share)
            told = {"worth": worth, "adverse": harms, "frames": compensated.tables(), "compensation": sections}
        if explored is not None:
            files["explore.html"] = encoded(explored.html)
        report = import_module("bristle.questions.joint_report.report").report(
            self.joints,
            title=names[0] if len(names) == 1 else f"{len(names)} joints", seed=0,
            explored=None if explored is None else explored.joints, begun=begun, files=files, **told,
        )  # fmt: skip  # a list of values
        index: Path = report.write(Path(folder), progress, mailed=mailed)
        return index

    def export(self, to: str, *, joint: str | None = None, **options: Any) -> "Export":
        """`bristle.export` of a joint, or of all."""
        from bristle.api.exporting import export

        return export(self, to, joint=joint, **options)

    def plot(self, joint: str | None = None, ax: "Axes | None" = None) -> "Axes":
        """What was measured on a joint and its fit, drawn into `ax` or new axes, which are returned.

        Points over velocity with the fitted curve and its 95 % band; where there are none, moving runs over time, or
        slow loading. Raises InputError as `joint` does.
        """
        from bristle.questions.array_fit.figure import draw_joint

        return draw_joint(self.joint(joint), ax)

    def _repr_html_(self) -> str:
        """Each joint's parameters and its curve, for a notebook."""
        from bristle.questions.array_fit.figure import joints_html

        return joints_html(self.joints, self.to_frame())


def read_results(path: Path | str) -> Results:
    """What `identify` returned, from its `results.json`, exact to the last bit; nothing is identified.

    >>> import bristle
    >>> _ = bristle.report("wrist.yaml", folder="report")
    >>> results = bristle.read_results("report/results.json")
    >>> results.joint().static["both"].parameters["alpha_0"].unit
    'N*m'
    >>> bristle.inspect(results).runs[0].record.file
    'points.csv'

    `plan`, `adapt` and `sensitivity` read the logs again, once asked, from where they stood; they must be as they were.
    Raises InputError in one sentence where the file is no results file, and OSError where it cannot be read.
    """
    path = path_of(path, "the path of a results.json")
    with reading(path) as found:
        document = document_of(with_samples(found))
        joints = joints_of(document)
        session_of(joints)  # which refuses numbers that are none
        texts = tuple(placed(x, path.parent) for x in document.experiments)
    return Results(joints=joints, logs=JointLogs(texts=texts))


def choose(names: Sequence[str], name: str | None) -> str:
    """The joint that is meant. Raises InputError where there are several and no name, or none of that name."""
    if name is None and len(names) != 1:
        raise InputError(f"got {len(names)} joints; expected one: say which with joint, one of {short_list(names)}")
    if name is not None and name not in names:
        raise InputError(f"joint: got {short(name)}; expected one of {short_list(names)}")
    return name or names[0]
