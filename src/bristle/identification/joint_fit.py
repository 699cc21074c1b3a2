"""All stages of a joint under one set-up: static fit, moving runs, presliding."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from bristle.data.experiment.constants import torque_scale
from bristle.data.experiment.load import Experiment
from bristle.data.experiment.schema import GONE
from bristle.data.record import Record
from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.findings import CAUTION, NOTE, Finding
from bristle.identification.dynamic.priors import DynamicStages, fit_with_priors
from bristle.identification.dynamic.problem import Values
from bristle.identification.fits import Crosscheck, Estimate, Presliding, StaticFit, TrackingFit
from bristle.identification.measured import Measured, nothing_to_fit
from bristle.identification.moving_runs import (
    DIRECTIONS,
    loads_slowly,
    refuse_noise,
    refuse_opposing_runs,
    regressors,
    turn_of,
)
from bristle.identification.point_checks import point_warnings
from bristle.identification.presliding.fit import identify_presliding, with_damping
from bristle.identification.presliding.stiffness import KnownValue
from bristle.identification.results import Input, Joint
from bristle.identification.static.fit import fit_moving, fit_points, reconcile_static
from bristle.model.laws.registry import AUTO
from bristle.model.parameters import INERTIA, Direction, ParameterName, effort_unit, has_own_unit
from bristle.progress import Progress, step

_OF_MOVING_RUNS = Finding("of-moving-runs", NOTE, "the moving runs")


def fitted_joint(
    measured: Measured,
    asked_law: str,
    near: TrackingFit | Values | None = None,
    *,
    uncertainty: bool = False,
    progress: Progress | None = None,
) -> Joint:
    """All stages of a joint, fitted with the options in force; `asked_law` is `fit.law` as in the file.

    The moving fit begins at `near`; `uncertainty` adds its intervals by profile and bootstrap. Raises InputError where
    no run can be fitted.
    """
    experiment, training = measured.experiment, _training(measured)
    points, stages = measured.points(hold_out=False), DynamicStages()
    static: dict[str, StaticFit] = {}
    checks: dict[str, Crosscheck] = {}
    step(progress, "fitting friction vs velocity")
    if points:
        static, checks = fit_points(measured, points)
    elif not training and (not measured.slow or {run.kind for run in measured.runs} & {"ramp", "points"}):
        raise InputError(nothing_to_fit(measured))
    elif training:
        static = fit_moving(experiment, training, measured.moving(hold_out=True))
    if training:
        step(progress, "fitting the moving runs")
        held, load = measured.moving(hold_out=True), partial(_presliding, experiment, measured.slow)
        stages = fit_with_priors(
            experiment, training, held, static, load if measured.slow else None, near, static_is_apart=bool(points),
            uncertainty=uncertainty, progress=progress,
        )  # fmt: skip  # a list of values
        static = static if points else reconcile_static(static, stages.tracking)
        fit = stages.joint_fit or stages.tracking
        J = fit.parameters.get(INERTIA) if fit else None
        if stages.presliding is not None and experiment.inertia is None and J is not None and J.value:
            known = KnownValue(J.value, J.standard_error or 0.0, _OF_MOVING_RUNS, J.shifts)  # sigma_1 by (15)
            stages = stages._replace(presliding=with_damping(stages.presliding, known, experiment.joint.kind))
    elif measured.slow:
        step(progress, "fitting slow loading")
        stages = DynamicStages(presliding=_presliding(experiment, measured.slow, static))
    inputs = (
        Input(file=r.file, sha256=r.sha256, rows=r.rows, dropped=r.dropped, notes=r.notes, labels=r.labels)
        for r in (run.record for run in measured.runs)
    )
    return Joint(
        name=experiment.joint.name, kind=experiment.joint.kind, inputs=tuple(inputs),
        segments=tuple(s for candidates in measured.segments for s in candidates), static=static,
        crosscheck=checks, **stages._asdict(), warnings=tuple(_joint_warnings(measured, static)),
        torque_scale=torque_scale(experiment.torque_constants, simulated=experiment.simulated),
        travel=measured.travel, torque_constant=measured.torque_constant,
        link_inertia=None if has_own_unit(experiment.joint.kind) else measured.link_inertia,
        truth=experiment.truth, simulated=experiment.simulated, assumptions=experiment.assumptions,
        settings=_settings(experiment, asked_law, training),
    )  # fmt: skip  # a list of values


def _training(measured: Measured) -> tuple[Record, ...]:
    """The moving runs to fit. Raises InputError if they are missing, contradictory, or their torque is noise."""
    experiment, training = measured.experiment, measured.moving(hold_out=False)
    for record in measured.slow:
        q, torque = record.position, record.torque
        if q is not None and torque is not None and not loads_slowly(record):
            nothing = np.zeros((q.size, 0))
            refuse_noise(experiment, q - q.mean(), torque, f"of {record.file}, taken as presliding", nothing)
    if training:
        refuse_opposing_runs(experiment, training)
    elif load := experiment.fit.load[:1]:
        raise InputError(
            f"{experiment.path.name}: fit.law: {load[0]} needs a tracking run to fit; add one under runs, or leave the load out"
        )
    return training


def _presliding(
    experiment: Experiment, slow: Sequence[Record], fit: Mapping[str, StaticFit] | TrackingFit
) -> Presliding:
    """The presliding stage, with g0 from the static fits or from a fit of moving runs."""
    as_asked = experiment.fit.model == "coulomb-viscous"
    levels = {d: level for d in DIRECTIONS if (level := _breakaway_torque(fit, d, without_peak=as_asked)) is not None}
    J, of_file = experiment.inertia, Finding("of-experiment-file", NOTE, "the experiment file")
    known = None if J is None else KnownValue(J.value, J.standard_error or 0.0, of_file)
    return identify_presliding(
        slow, levels, known, experiment.fit, experiment.encoder_resolution, experiment.joint.kind
    )


def _breakaway_torque(
    fits: Mapping[str, StaticFit] | TrackingFit, direction: str, *, without_peak: bool
) -> KnownValue | None:
    """g0 = alpha_0 + alpha_1 of a direction with its error; without a Stribeck term alpha_0 is a lower bound of it."""
    moving = isinstance(fits, TrackingFit)
    fit = fits if isinstance(fits, TrackingFit) else fits.get(direction) or fits.get("both")
    if fit is None:
        return None
    estimates: Mapping[Any, Estimate] = fit.parameters
    level, peak = (
        [name, ParameterName(name, Direction(direction)), ParameterName(name, Direction.BOTH)]
        for name in ("alpha_0", "alpha_1")
    )
    terms = [key for key in (*level, *peak) if key in estimates and estimates[key].value]
    if not terms or terms[0] not in level:
        return None
    value = sum(estimates[key].value or 0.0 for key in terms)
    share = np.array([float(name in terms) for name in fit.names])
    error = float(np.sqrt(share @ fit.covariance @ share)) if share.size else 0.0
    source = _OF_MOVING_RUNS if moving else Finding("of-static-fit", NOTE, "the static fit")
    if len(terms) == 1:
        source = replace(source, message=f"alpha_0 of {source.message}, which shows no peak")
    if len(terms) == 1 and not without_peak:
        value, error = max(value - student(np.inf) * error, 0.0), np.inf
    constants = dict.fromkeys(c for key in terms for c in estimates[key].shifts)
    shifts = {c: sum(estimates[key].shifts.get(c, 0.0) for key in terms) for c in constants}
    return KnownValue(value, error, source, shifts)


def _joint_warnings(measured: Measured, static: dict[str, StaticFit]) -> Iterator[Finding]:
    experiment, kept = measured.experiment, measured.points(hold_out=False)
    yield from measured.warnings
    for key in experiment.fit.gone:
        message = f"fit.{key} is a key of earlier versions, and is not read as it was: {GONE[key]}."
        yield Finding("key-gone", CAUTION, message, {"key": key})
    told, of = {w.code for w in measured.warnings}, effort_unit(experiment.joint.kind)
    if experiment.coasting is not None and experiment.coasting.known is None:
        message = f"Nothing of the joint is known, so friction is per inertia, in {of}: write `coasting: {{inertia: 0.02 kg*m^2}}`, or its gravity."
        yield Finding("per-inertia", CAUTION, message, {"unit": of})
    elif has_own_unit(experiment.joint.kind) and "constant-unseen" not in told and measured.link_inertia is None:
        constant = "torque_constant: 0.35 N*m/A"
        lacks, lines = {
            "A": ("torque constant is", constant),
            "V": ("motor constants are", f"{constant}, resistance: 2.1 ohm"),
        }.get(of, ("gain of the drive is", f"kp: 20 {'N*m/rad' if of == 'rad' else 'N/m'}"))
        share = "" if of in ("A", "V") else ", as a share of kp, and alpha_2 holds what the drive damps"
        message = (
            f"No {lacks} given, so friction is in {of}{share}: write `motor: {{{lines}}}`, as seen at the joint, or "
            "the torque of a known gravity."
        )
        yield Finding("no-torque-constant", CAUTION, message, {"unit": of})
    if experiment.fit.directions == "separate" and len(set(static) & set(DIRECTIONS)) == 1:
        other = next(d for d in DIRECTIONS if d not in static)
        tried = sum(s.velocity * DIRECTIONS[other] > 0 for candidates in measured.segments for s in candidates)
        why = f"none of its {tried} candidate segments was kept" if tried else "it was not measured"
        message = f"Direction {other} is not identified: {why}."
        yield Finding("direction-unknown", CAUTION, message, {"direction": other, "tried": tried})
    # of kept segments, counted: each warning is listed with its segment
    told = {file for d in measured.warnings if d.code == "velocity-factor" for file in d.numbers["files"]}
    differ = sum(any(d.code == "position-differs" for d in s.warnings) for s in kept)
    if differ and not told:
        message = f"Position and velocity disagree in {differ} of {len(kept)} kept segments; the slope of the position is used."
        yield Finding("positions-disagree", CAUTION, message, {"differ": differ, "kept": len(kept)})
    others = sum(any(d.code not in {"position-differs", "stick-slip"} for d in s.warnings) for s in kept)
    if others:
        message = f"The torque of {others} of {len(kept)} kept segments is questionable; the list of segments says why."
        yield Finding("torques-doubted", CAUTION, message, {"doubted": others, "kept": len(kept)})
    unused = tuple(run.record.file for run in measured.runs if run.kind == "presliding" and run.hold_out)
    if unused:
        message = f"Held-out presliding runs are not used: {', '.join(unused)}."
        yield Finding("held-out-unused", NOTE, message, {"files": unused})
    yield from point_warnings(measured, kept, static)


def _settings(experiment: Experiment, asked_law: str, training: Sequence[Record]) -> dict[str, str]:
    """Options in force; `asked_law` is `fit.law` as in the file."""
    fit = experiment.fit
    law, loads = fit.friction, fit.load
    rising = "".join(f", rising with the {name.replace('-', ' ')}" for name in loads)
    found = ", which the data chose (fit.law overrules)" if asked_law == AUTO or asked_law != fit.law else ""
    settings = {
        "law": f"{'+'.join((law.name, *loads))}{found}: {law.title}{rising}",
        "directions": fit.directions,
        "set-up": fit.set_up,
        "model": fit.model,
    }
    if changed := levels.told():
        settings["levels"] = changed
    if isinstance(fit.orders, tuple):
        _, turn = turn_of(experiment.joint.kind)
        settings["orders"] = f"{', '.join(map(str, fit.orders)) or 'none'}, periods per {turn}"
    if training:
        settings["regressors"] = ", ".join(regressors(experiment)) or "none"
        chosen = ["fit.position_cutoff"] if fit.position_cutoff is None else []
        chosen += ["fit.decimation"] if "decimation" not in fit.model_fields_set else []
        if chosen:
            cutoffs = dict.fromkeys(f"{f(r.cutoff for r in training):.3g}" for f in (min, max))
            slowest = max(training, key=lambda r: r.step)
            every = fit.every * (1 if slowest.fine is None else round(slowest.step / slowest.fine.step))
            samples = f"one sample in {every}" if every > 1 else "all samples"
            by = f"by the spectra, {' and '.join(chosen)} overrule{'s'[len(chosen) - 1 :]}"
            settings["filters"] = f"low pass of {' to '.join(cutoffs)} Hz, {samples} ({by})"
        if (known := experiment.inertia) is not None:
            error = known.standard_error
            settings["inertia"] = f"{known.value:g} {f'+/- {error:g} (prior)' if error else '(fixed)'}"
    return settings
