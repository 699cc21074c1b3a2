"""Exports of identified joints: C code, models for simulators, documents, and an interactive page."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bristle import __version__
from bristle.api.identifying import Known, identify, read_if_results
from bristle.api.results import Results
from bristle.control.compensator import Compensator
from bristle.data.experiment.load import Experiment
from bristle.data.units import positive_si
from bristle.errors import InputError, read_at_most
from bristle.findings import Finding
from bristle.identification.document import LARGEST
from bristle.identification.results import Joint
from bristle.model.parameters import unit
from bristle.progress import Progress
from bristle.questions.array_fit.fit import Fit
from bristle.questions.export.export import Export, Request, export_joints, joint_left_out, target
from bristle.questions.export.exported import ExportedJoint, Origin, exported
from bristle.simulation import edro
from bristle.simulation.joint_loop import JointLoop, of_experiment, of_paper
from bristle.workers import Share

if TYPE_CHECKING:
    from bristle.questions.explorer.page import Explorer


def export(
    known: Known,
    to: str,
    *,
    joint: str | None = None,
    into: Path | str | None = None,
    amplitude: float | str | None = None,
    frequency: float | str | None = None,
    compensator: str | None = None,
    adapt: str | None = None,
    step: str | None = None,
    progress: Progress | None = None,
) -> Export:
    """An identified joint in the form of another tool, and what that loses.

    >>> import bristle
    >>> handed = bristle.export("wrist.yaml", "urdf")
    >>> handed.write("wrist.urdf").name
    'wrist.urdf'

    Args:
        known: a file of a joint or of a robot, results or their file, or a fit of arrays.
        to: c, mujoco, mujoco-frictionloss, fmu, urdf, sdf, isaac, json, matlab or latex.
        joint: the only one; None: all, where the target holds several.
        into: a URDF, an SDF or an MJCF file into which the values are merged; the file itself is not changed.
        amplitude: of the sine on which a target without LuGre is fitted, rad or a quantity; None: up to the fastest speed.
        frequency: of that sine, Hz or a quantity; None: 0.5 Hz.
        compensator: that is printed as C; None: `adapt.compensator` of the experiment, or lugre.
        adapt: the law by which the C adapts; None: it does not.
        step: the step of that law; None: `adapt.step` of the experiment, or gradient.
        progress: told of every step.

    Raises InputError in one sentence where a file cannot be used, a joint lacks what the target needs, or the target does
    not have such an option.
    """
    target(to)
    if adapt is None and step is not None:
        raise InputError(f"step: got {step}, of an adaptation that is not asked for; give adapt as well")
    if to != "c" and (compensator or adapt):
        raise InputError(f"{to} holds no compensator; leave compensator and adapt out, or export to c")
    results, found, joints, refused = _handed(known, joint, progress)
    (first, experiment), *_ = found
    si = unit("position", first.kind)
    request = Request(
        into=None if into is None else read_at_most(Path(into), LARGEST, "a model, without meshes"),
        into_name="" if into is None else Path(into).name,
        amplitude=None if amplitude is None else positive_si("amplitude", amplitude, si),
        frequency=None if frequency is None else positive_si("frequency", frequency, "Hz"),
        compensator=_compensator(results, first, experiment, compensator, adapt, step),
    )
    return export_joints(joints, to, request, refused)


def exported_joints(known: Known, joint: str | None = None) -> tuple[ExportedJoint, ...]:
    """Identified joints, or one of them, as they are exported. Raises InputError as `export` does."""
    return _handed(known, joint, None)[2]


def _handed(
    known: Known, joint: str | None, progress: Progress | None
) -> tuple[Results, list[tuple[Joint, Experiment | None]], tuple[ExportedJoint, ...], tuple[Finding, ...]]:
    """Results, joints with their experiments as far as known, as they are exported, and why others cannot be.

    Raises InputError where none can.
    """
    source, digest = read_if_results(known), None
    if isinstance(known, Path | str) and source is not known:  # from a results file
        digest = sha256(read_at_most(Path(known), LARGEST, "a results file")).hexdigest()
    results = source if isinstance(source, Results) else identify(source, joint=joint, progress=progress)
    found = list[tuple[Joint, Experiment | None]]()
    for one in results.joints if joint is None or isinstance(known, Fit) else (results.joint(joint),):
        own: Experiment | None = None
        with suppress(InputError):
            own = results.logs.experiment_of(one)
        found.append((one, own))
    joints: list[ExportedJoint] = []
    refused: list[Finding] = []
    for of, experiment in found:
        logs, file = {log.file: log.sha256 for log in of.inputs}, experiment.path.name if experiment else None
        origin = Origin(bristle=__version__, results_sha256=digest, experiment=file, logs=logs)
        try:
            joints.append(exported(of, experiment, origin))
        except InputError as error:
            if len(refused) + 1 == len(found):
                raise
            refused.append(joint_left_out(error))
    return results, found, tuple(joints), tuple(refused)


def _compensator(
    results: Results, joint: Joint, experiment: Experiment | None, name: Any, law: Any, step: Any
) -> Compensator:
    """The compensator as asked for; its rates and the observer's gain are those of the joint's loop."""
    name = name or (experiment.adapt.compensator if experiment else None) or "lugre"
    if law is None and name != "lugre-observer":
        return Compensator(name=name)
    known = known_loop(results, joint)
    if isinstance(known, str):
        raise InputError(known)
    own = replace(known.compensator, name=name, observer_gain=known.observer_gain)
    if law is None:
        return own
    step, gamma = step or known.adaptation.step, known.comparable_rates(law)
    return replace(own, adaptation=replace(known.adaptation, law=law, step=step, gamma=gamma))


def explore(
    experiment: Known | None = None, *, joint: str | None = None, progress: Progress | None = None
) -> "Explorer":
    """An interactive page of the friction model that computes offline, with sliders for the parameters of each joint.

    >>> import bristle
    >>> page = bristle.explore("wrist.yaml")
    >>> page.joints
    ('points',)
    >>> page.write("explore.html").name
    'explore.html'

    Args:
        experiment: a file of a joint or of a robot, or what `identify` or a fit of arrays gave; None: the embedded Ed-Ro
            (simulated).
        joint: the only one on the page; None: all.
        progress: told of every step.

    Of results no log is read. Raises InputError in one sentence where a file cannot be used, or nothing is known of the
    friction over velocity.
    """
    from bristle.questions.explorer.page import explorer  # which draws, and a fit does not

    known = identify(joint=joint, progress=progress) if experiment is None else read_if_results(experiment)
    results = known if isinstance(known, Results) else identify(known, joint=joint, progress=progress)
    return explorer(*_known(results, None if isinstance(experiment, Fit) else joint))


def explorers(results: Results, share: Share) -> Iterator["Explorer | None"]:
    """The page of all joints, made by whoever shares the work; None where no friction over velocity is known."""
    return iter(share(_explorer, [_known(results)]))


def _explorer(known: "_Known") -> "Explorer | None":
    from bristle.questions.explorer.page import explorer

    with suppress(InputError):
        return explorer(*known)
    return None


_Known = tuple[Sequence[Joint], dict[str, JointLoop | str]]  # joints, and the loop of each or why there is none


def _known(results: Results, joint: str | None = None) -> _Known:
    joints = results.joints if joint is None else (results.joint(joint),)
    return joints, {found.name: known_loop(results, found) for found in joints}


def known_loop(results: Results, joint: Joint) -> JointLoop | str:
    """The loop of an identified joint, the paper's for the embedded ones, or the reason why there is none."""
    try:
        experiment = results.logs.experiment_of(joint)
        if experiment.path.parent.resolve() != edro.datasets_folder() or joint.name not in edro.TABLE_1:
            return of_experiment(experiment, joint)
    except InputError as error:
        return str(error)
    return of_paper([joint])[0]
