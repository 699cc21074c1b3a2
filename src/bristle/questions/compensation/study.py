"""The compensation study of one or more joints: the paper's experiments, other studies, replays of measured runs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from bristle.control.closed_loop import Trajectory
from bristle.estimation import levels
from bristle.findings import CAUTION, NOTE, Finding
from bristle.model.parameters import unit
from bristle.progress import Progress, teller
from bristle.questions.compensation import ablation as ablating
from bristle.questions.compensation import experiments
from bristle.questions.compensation.ablation import AblationRow
from bristle.questions.compensation.experiments import AdaptationMap, Adapted, Band, Drift, Errors
from bristle.questions.compensation.replay import Replay
from bristle.simulation.edro import TABLE_2_ADAPTED
from bristle.simulation.joint_loop import JointLoop, one_way
from bristle.workers import Share, called

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """Results of a compensation study. Errors and drifts are of every joint, all else of the first."""

    loops: tuple[JointLoop, ...]
    adapting: JointLoop
    """The first joint with the friction of the adaptation: in the paper's Table 2 the positive one both ways."""
    paper: bool
    """Whether these are the paper's joints and experiments."""
    errors: tuple[Errors, ...]
    followed: dict[str, Trajectory]
    adapted: Adapted
    adaptation_map: AdaptationMap
    drifts: tuple[Drift, ...]
    ablation: tuple[AblationRow, ...]
    band: Band | None
    replays: tuple[Replay, ...] = ()

    def to_frame(self) -> "pd.DataFrame":
        """Fig. 8: a row per joint, frequency and inertia feed-forward; errors in rad (m)."""
        import pandas as pd

        rows = [(*x, *(share / x.without for share in (x.true, x.identified, x.adaptive))) for x in self.errors]
        columns = [
            "joint", "frequency", "inertia_feed_forward", "without", "true_model", "identified_model", "adaptive",
            "true_share", "identified_share", "adaptive_share",
        ]  # fmt: skip  # a list of names
        return pd.DataFrame(rows, columns=columns)

    def tables(self) -> "dict[str, pd.DataFrame]":
        """Tables by file name; errors in rad (m), errors of replays in percent."""
        import pandas as pd

        # Table 2: original value of each adapted parameter, and initial, early, final and the paper's ratio to it.
        plan, paper = self.adapting, TABLE_2_ADAPTED if self.paper else {}
        p, kind = plan.model.positive, plan.kind
        table_2 = [
            (x.law, x.parameter, getattr(p, x.parameter), unit(x.parameter, kind), x.initial, x.early, x.final, paper.get(x.parameter))
            for x in self.adapted.factors
        ]  # fmt: skip  # one row, one line
        of_table_2 = ["law", "parameter", "original", "unit", "initial", "at_4_s", "at_20_s", "paper"]
        # Final ratios over rate and frequency, and over amplitude and frequency.
        m, top = self.adaptation_map, max(plan.adaptation.gamma)
        by_gamma = ([(g, plan.amplitude) for g in m.gammas.tolist()], m.by_gamma)
        by_amplitude = ([(top, a) for a in m.amplitudes.tolist()], m.by_amplitude)
        mapped = [
            (name, *at, frequency, share)
            for places, shares in (by_gamma, by_amplitude)
            for name, of_name in zip(plan.adaptation.parameters, shares.tolist(), strict=True)
            for at, row in zip(places, of_name, strict=True)
            for frequency, share in zip(m.frequencies.tolist(), row, strict=True)
        ]
        replayed = [(x.file, x.adaptation.law, *x.relative_errors(), x.shares, str(x.verdict)) for x in self.replays]
        frames = {
            "compensation_errors": self.to_frame(),
            "table_2": pd.DataFrame(table_2, columns=of_table_2).astype({"paper": float}),
            "adaptation_map": pd.DataFrame(mapped, columns=["parameter", "gamma", "amplitude", "frequency", "adapted_share"]),
            "drift": pd.DataFrame(self.drifts, columns=list(Drift._fields)),
            "ablation": pd.DataFrame(self.ablation, columns=list(AblationRow._fields)),
        }  # fmt: skip  # a table
        columns = ["file", "law", "gains_of_1", "adapted", "shares", "verdict"]
        return frames | ({"replay": pd.DataFrame(replayed, columns=columns)} if replayed else {})


def study(
    loops: Sequence[JointLoop], replays: Sequence[Replay] = (), progress: Progress | None = None, *, paper: bool = False
) -> Study:
    """The study of some loops; `paper`: with its Table 2. Raises InputError where a loop cannot be run."""
    return begin_study(loops, replays, progress, map, paper=paper)()


def begin_study(
    loops: Sequence[JointLoop], replays: Sequence[Replay], progress: Progress | None, share: Share, *, paper: bool
) -> Callable[[], Study]:
    """Begin `study` in the processes of `share`; the function returned waits for the end, and raises as `study`."""
    first = loops[0]
    adapting = one_way(first) if paper else first
    parts: list[tuple[str, partial[Any]]] = [  # the refusal of a loop that diverges first, then the longest
        *(("errors", partial(experiments.errors, loop)) for loop in loops),
        ("ablation", partial(ablating.ablate, first)),
        ("adaptation_map", partial(experiments.map_adaptation, adapting)),
        ("band", partial(experiments.band, first)),
        ("adapted", partial(experiments.adapted, adapting)),
        ("followed", partial(experiments.followed, first)),
        *(("drifts", partial(experiments.drifts, loop)) for loop in loops),
    ]
    results = iter(share(called, [run for _, run in parts]))

    def ended() -> Study:
        found: dict[str, Any] = {"errors": (), "drifts": ()}
        tell = teller(progress, len(parts))
        for name, _ in parts:
            tell(f"compensating: {name.replace('_', ' ')}")
            result = next(results)
            found[name] = found[name] + result if name in ("errors", "drifts") else result
        return Study(loops=tuple(loops), adapting=adapting, paper=paper, replays=tuple(replays), **found)

    return ended


def outcomes_of(study: Study) -> Iterator[Finding]:
    """The effect of compensation on each error without inertia feed-forward, and the final adapted parameters."""
    first, q = study.loops[0], thousandths(study)
    for row in study.errors:
        if not row.inertia:
            identified, adaptive = (
                f"{1e3 * x:.3g} {q} ({100 * x / row.without:.2g} %)" for x in (row.identified, row.adaptive)
            )
            message = (
                f"{row.joint}, {row.frequency:g} Hz: RMS error {1e3 * row.without:.3g} {q} without, {identified} with and {adaptive} with "
                "adaptive compensation."
            )
            yield Finding("errors-compensated", NOTE, message, row._asdict())
    reference = "true" if study.paper else "identified"
    for x in study.adapted.factors:
        message = f"{first.name}, {x.law}: {x.parameter} from {x.initial:g} to {x.final:.3f} of its {reference} value."
        yield Finding("adapted-to", NOTE, message, x._asdict())


def worth_of_each(study: Study) -> Iterator[tuple[str, str]]:
    """Name of each joint, and the RMS error at its slowest sine without and with the identified model."""
    for row in reversed(study.errors):  # the slowest sine of a joint comes last, and replaces the others
        if not row.inertia:
            without, fed = (f"{1e3 * x:.3g} {thousandths(study)}" for x in (row.without, row.identified))
            error = f"RMS position error (SIMULATED) at {row.frequency:g} Hz"
            yield row.joint, f"{error}: {without} without compensation, {fed} with"


def adverse(study: Study) -> Iterator[Finding]:
    """Errors that adaptation makes larger than the identified model alone does, by `worse_loop`."""
    for row in study.errors:
        if row.adaptive > levels.WORSE_LOOP * row.identified and not row.inertia:
            identified, adaptive, q = 1e3 * row.identified, 1e3 * row.adaptive, thousandths(study)
            worse = f"Adaptation makes {row.joint} worse at {row.frequency:g} Hz"
            message = f"{worse}: RMS error {identified:.3g} {q} with the identified model, {adaptive:.3g} {q} adapted."
            numbers = {"joint": row.joint, "frequency": row.frequency, "identified": identified, "adaptive": adaptive}
            yield Finding("adaptation-worse", CAUTION, message, numbers)


def thousandths(study: Study) -> str:
    """Unit of a position error on the page: mrad (mm)."""
    return f"m{unit('position', study.loops[0].kind)}"
