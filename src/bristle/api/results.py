"""What `identify` returns, and reads back."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from bristle.diagnostics import Diagnostic, Severity
from bristle.errors import InputError, short, short_list
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.progress import Progress
from bristle.questions.compensation.study import Study

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """What was identified, joint by joint."""

    joints: tuple[Joint, ...]
    timings: dict[str, float] = field(default_factory=dict, compare=False)
    """Seconds spent, by name; no part of the result."""
    measured: tuple[Measured, ...] = field(default=(), compare=False, repr=False)
    """What each joint was identified from, for questions that follow; no part of the result."""

    @property
    def warnings(self) -> tuple[Diagnostic, ...]:
        """Every diagnostic about a joint, one of its stages or a fit, with the joint's name first in its subject."""
        return tuple(
            replace(x, subject=(joint.name, *x.subject)) for joint in self.joints for x in joint.fit_warnings()
        )

    @property
    def serious(self) -> tuple[Diagnostic, ...]:
        """Those of `warnings` that are critical, or call for caution; notes are not."""
        return tuple(warning for warning in self.warnings if warning.severity is not Severity.NOTE)

    def joint(self, name: str | None = None) -> Joint:
        """The joint of a name; without one the only joint. Raises InputError where there are several, or none of that name."""
        names = [joint.name for joint in self.joints]
        return self.joints[names.index(choose(names, name))]

    def measured_joint(self, name: str) -> Measured:
        """What the joint of a name was identified from. Raises InputError where that is not known."""
        for measured in self.measured:
            if measured.experiment.joint.name == name:
                return measured
        raise InputError(
            f"{name}: got results without their logs; expected what `identify` returned, or an experiment file"
        )

    def text(self) -> str:
        """The fit report, as the command line prints it."""
        from bristle.questions.joint_report.text import fit_report

        return fit_report(self.joints)

    def to_frame(self) -> "pd.DataFrame":
        """One row per joint, direction and parameter: value, unit, standard error, interval, warnings."""
        from bristle.questions.joint_report.results_file import to_frame

        return to_frame(self.joints)

    def to_json(self) -> str:
        """`results.json` of schema bristle-results/2."""
        from bristle.questions.joint_report.results_file import to_json

        return to_json(self.joints)

    def uncertainty(self) -> "pd.DataFrame":
        """One row per joint, fit and parameter: the 95 % interval by covariance, profile and bootstrap, and their warnings."""
        from bristle.questions.joint_report.interval_tables import uncertainty

        return uncertainty(self.joints)

    def write(self, folder: Path | str, progress: Progress | None = None, compensated: Study | None = None) -> Path:
        """Write the HTML report, results.json, timings.json, figures and tables into a folder; returns the path of index.html.

        With what `adapt` returned, its sections follow.
        Only what bristle made there before is replaced. Raises InputError where the folder cannot be used, with nothing half-written.
        """
        from bristle.questions.compensation.page import section
        from bristle.questions.joint_report.page import write_report

        title = self.joints[0].name if len(self.joints) == 1 else f"{len(self.joints)} joints"
        return write_report(
            self.joints,
            Path(folder),
            title=title,
            seed=0,
            timings=self.timings,
            progress=progress,
            appended=section(compensated) if compensated else None,
        )


def choose(names: Sequence[str], name: str | None) -> str:
    """The joint that is meant. Raises InputError where there are several and no name, or none of that name."""
    if name is None and len(names) != 1:
        raise InputError(f"got {len(names)} joints; expected one: say which with joint, one of {short_list(names)}")
    if name is not None and name not in names:
        raise InputError(f"joint: got {short(name)}; expected one of {short_list(names)}")
    return name or names[0]
