"""Experiment files in, results out."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from bristle.api.joints import read_if_results
from bristle.api.logs import JointLogs
from bristle.api.results import Results, choose
from bristle.api.sources import Source, measure_joints, names_of, open_all
from bristle.diagnostics import Severity
from bristle.errors import InputError
from bristle.identification.identify import identify_joint
from bristle.identification.measured import Measured
from bristle.identification.results import Joint
from bristle.progress import Progress


def identify(
    *experiments: Source,
    joint: str | None = None,
    progress: Progress | None = None,
    crosscheck: bool = False,
    uncertainty: bool = False,
    workers: int = 1,
) -> Results:
    """Identify the joints of one or more files, of a joint or a robot each; with none, the embedded Ed-Ro (simulated).

    >>> import bristle
    >>> results = bristle.identify("wrist.yaml")
    >>> results
    Results(joints=(Joint('points': static both),))
    >>> results.to_frame()[["parameter", "value"]].round(3).head(2)
      parameter  value
    0   alpha_0  0.019
    1   alpha_1  0.005

    Args:
        experiments: files, or what was loaded from them.
        joint: the only one of a robot that is identified; None: all.
        progress: told of every step.
        crosscheck: whether moving runs are fitted by CasADi and IPOPT as well, which takes long; the static fits always are.
        uncertainty: whether each parameter of moving runs gets its intervals by profile and bootstrap too; those of
            static and presliding fits always do.
        workers: processes among which the joints are shared out; in a script more than one need
            `if __name__ == "__main__":` around the call.

    Raises InputError in one sentence where a file cannot be used, or where two experiments name the same joint.
    """
    files = open_all(experiments)
    loaded, texts = [one for one, _ in files], [text for _, text in files]
    names = [name for one in loaded for name in names_of(one)]
    chosen = names if joint is None else [choose(names, joint)]
    asked = len(chosen)
    every: list[Measured] = []
    found: list[tuple[Joint, dict[str, float]]] = []
    with _pool(min(workers, asked)) as share:
        for one in loaded:
            every += [m for m in measure_joints(one, progress, share) if m.experiment.joint.name in chosen]
        work = partial(_timed, crosscheck=crosscheck, uncertainty=uncertainty)
        work = work if workers > 1 and asked > 1 else partial(work, progress=progress)
        waiting = iter(share(work, every))
        for done, measured in enumerate(every):
            if progress:
                progress(f"identifying {measured.experiment.joint.name}", done, asked)
            found.append(next(waiting))
    timings = {f"{joint.name}: {what}": seconds for joint, spent in found for what, seconds in spent.items()}
    return Results(joints=tuple(joint for joint, _ in found), timings=timings, logs=JointLogs.at_hand(every, texts))


def _timed(
    measured: Measured, crosscheck: bool, uncertainty: bool, progress: Progress | None = None
) -> tuple[Joint, dict[str, float]]:
    spent: dict[str, float] = {}
    try:
        joint = identify_joint(measured, spent, crosscheck=crosscheck, uncertainty=uncertainty, progress=progress)
    except InputError as error:
        if measured.link_inertia is None and not measured.findings:
            raise
        cause = next((w for w in measured.findings if w.severity is Severity.CRITICAL), error)
        raise InputError(f"{measured.experiment.joint.name}: {cause}") from error
    return joint, spent


@contextmanager
def _pool(workers: int) -> Iterator[Callable[..., Iterable[Any]]]:
    """What maps a function over joints: one after another, or in several processes."""
    if workers < 2:
        yield map
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    try:
        yield pool.map
    finally:  # what was not begun is not wanted any more
        pool.shutdown(cancel_futures=True)


def identified(
    *experiments: Source,
    joint: str | None = None,
    crosscheck: bool = False,
    uncertainty: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> Results:
    """`identify`; of one results file what that holds, and nothing is identified.

    Raises InputError as `identify` and `read_results` do.
    """
    if len(experiments) == 1:
        known = read_if_results(experiments[0])
        if isinstance(known, Results):
            return known
        experiments = (known,)
    return identify(
        *experiments, joint=joint, crosscheck=crosscheck, uncertainty=uncertainty, workers=workers, progress=progress
    )
