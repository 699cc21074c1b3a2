"""Drafts of experiment files from logs: kind of each run, regressors, directions."""

from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from bristle.data.experiment.draft import DraftedRun, Told, draft_experiment
from bristle.data.experiment.load import experiment_of, read_runs
from bristle.data.experiment.schema import RunKind
from bristle.data.experiment.yaml_file import parse
from bristle.data.robot.draft import OF_ROBOTS, draft_robot
from bristle.data.robot.motion import largest_gravity
from bristle.data.robot.robot_file import robot_of
from bristle.data.robot.urdf import read_urdf
from bristle.data.run_kinds import kinds_of, stretches
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.findings import Severity
from bristle.identification.measured import Measured, measure, with_options
from bristle.identification.moving_runs import DIRECTIONS, moved_in, refuse_opposing_runs, regressor_line
from bristle.identification.robot.measured import against_urdf
from bristle.identification.static import set_up
from bristle.identification.static.fit import refuse_opposing_points
from bristle.progress import Progress, teller

_ANY: RunKind = "ramp"  # kind as which a run is read first: with velocity, without acceleration


def draft_of_logs(
    files: Sequence[Path], told: Told, folder: Path | None = None, progress: Progress | None = None
) -> tuple[str, tuple[str, ...]]:
    """The text of an experiment file for logs, of a robot its URDF first, and a sentence on each guess.

    `told` is not guessed; file names are relative to `folder`. Raises InputError where something cannot be guessed.
    """
    tell = teller(progress, 3)
    tell("reading the logs")
    if own := [x for x in files if x.suffix.lower() in (".yaml", ".yml")]:
        raise InputError(
            f"{own[0]}: is an experiment file, which is identified as it is; expected logs to draft one from"
        )
    if files[0].suffix.lower() == ".urdf":
        of_one = (x.name for x in fields(told) if x.name not in OF_ROBOTS)
        if given := [name for name in of_one if getattr(told, name) not in (None, False, ())]:
            raise InputError(
                f"{files[0]}: {given[0]} is of one joint, and a robot has several; write it into the draft"
            )
        # a robot's file, and findings of its logs against its URDF
        text, guessed = draft_robot(files[0], files[1:], told, folder)
        path = (folder or files[0].parent) / f"the draft for {files[0].name}"
        against: dict[str, list[str]] = {}
        for name, findings in against_urdf(robot_of(parse(text, str(path)), path)).items():
            for w in findings:
                if w.severity is not Severity.NOTE:
                    against.setdefault(str(w), []).append(name)
        return text, (*guessed, *(f"{', '.join(names)}: {sentence}" for sentence, names in against.items()))
    files = (*files, *told.hold_out)
    if told.gravity and Path(told.gravity).suffix.lower() == ".urdf":
        told = replace(told, gravity=f"{largest_gravity(read_urdf(Path(told.gravity)), told.name):.6g} N*m")
    draft = draft_experiment(files, told, folder)
    path = (files[0].parent if folder is None else folder) / f"the draft for {files[0].name}"
    kept = [k >= len(files) - len(told.hold_out) for k in range(len(files))]
    runs = [DraftedRun("points", "neither time nor position is logged", hold) for hold in kept]
    said = list(draft.guessed)
    if told.coasting:
        runs = [DraftedRun("tracking", "the joint coasts", hold) for hold in kept]
    elif not draft.of_points:
        unsorted = experiment_of(draft.text([DraftedRun(_ANY)] * len(files)), path)
        read = read_runs(unsorted)
        tell("constant velocities, slow loading, other motion")
        found = [(run.record.file, stretches(run.record, unsorted.joint.kind)) for run in read]
        kinds = kinds_of(found)
        runs = [DraftedRun(kind, f"{does}", hold) for kind, (_, does), hold in zip(kinds, found, kept, strict=True)]
        counted = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        said.append(f"experiment: {counted}, by what the signals do")
        said += [
            f"experiment: {file} is a mixture ({does}), taken as {kind}; cut it into files of one kind to use the rest"
            for file, kind, (_, does) in zip(draft.files, kinds, found, strict=True)
            if does.unused(kind) > (levels.MIXED_HOLDS if kind == "ramp" else levels.MIXED)
        ]
    tell("regressors and directions")
    fit, why = _fit(draft.text(runs), path, told.directions)
    return draft.text(runs, fit), tuple(sentence for sentence in (*said, why) if sentence)


def _of_points(measured: Measured) -> set_up.BetterSetUp | None:
    """The set-up of points to begin with; plain unless its loads pay by BIC, beside v_s and the best directions, where both were measured."""
    points = measured.points(hold_out=False)
    proposal = set_up.trial_of_points(measured.experiment, points).proposed()
    loads = () if proposal is None else tuple(x for x in proposal.set_up.regressors if x != "offset")
    if proposal is None or not loads:
        return proposal
    bic, plain = (
        min(
            set_up.directions_of_points(with_options(measured, regressors=x).experiment, points).values(),
            default=np.inf,
        )
        for x in (loads, ())
    )
    return (
        replace(proposal, set_up=replace(proposal.set_up, regressors=()))
        if plain <= bic and plain < np.inf
        else proposal
    )


def _fit(text: str, path: Path, directions: str | None = None) -> tuple[str, str]:
    """The `fit` line of an experiment file, and a sentence on why; both empty where nothing can be tried."""
    measured = measure(experiment_of(text, path))
    points, moving = measured.points(hold_out=False), measured.moving(hold_out=False)
    if moving:
        refuse_opposing_runs(measured.experiment, moving)
    proposals = [_of_points(measured) if points else None]
    proposals += [set_up.trial_of_motion(measured.experiment, moving).proposed() if moving else None]
    known = [proposal for proposal in proposals if proposal is not None]
    if points and not any("gravity" in x.set_up.regressors for x in known):
        refuse_opposing_points(measured.experiment, points, ("offset",))
    if not known:
        return (f"fit: {{directions: {directions}}}" if directions else ""), ""
    ways = {np.sign(s.velocity) for s in points} if points else moved_in(moving)
    sided = "auto" if len(ways) == len(DIRECTIONS) else "separate"
    pays = {name for x in known for name in x.set_up.regressors} - {"offset"}
    lines = f"directions: {directions or sided}"
    lines += f", {regressor_line(pays)}" if pays or moving else ""
    none = "above 100 %: too few points to decide, so the plainest is taken"
    errors = (
        f"{f'{x.error:.2g} %' if x.error < levels.USELESS else none} (the plainest set-up: {x.asked_error:.2g} %)"
        for x in known
    )
    why = f"a first regression, without presliding, misses parts held out in turn by {', '.join(errors)}"
    return f"fit: {{{lines}}}   # {why}", f"fit: {lines}; {why}"
