"""Joints without a torque signal (volts, amperes, position error) whose known gravity gives the scale of the torque."""

from dataclasses import replace

import numpy as np

from bristle.data.experiment.constants import ONE, hangs_at
from bristle.data.experiment.load import Experiment, Run
from bristle.data.experiment.schema import PlusMinus
from bristle.data.experiment.signals import Signals
from bristle.findings import NOTE, Finding
from bristle.identification.measured import Measured, measure, measured_of
from bristle.identification.moving_runs import regressors
from bristle.identification.robot.links import link_scale, scale_beside_bristles, torque_constant
from bristle.model.parameters import effort, effort_unit, unit

_CONSTANTS = {"current": "torque_constant", "position error": "kp"}
"""Motor constant that turns an effort into torque; a voltage has none, because of its back-EMF."""
_DAMPED = {"voltage": "what the motor damps by its back-EMF", "position error": "what the drive damps"}
"""What alpha_2 then also holds."""


def measure_scaled(experiment: Experiment) -> Measured:
    """What an experiment measured, in N*m where a known gravity tells the scale. Raises InputError as `measure`."""
    measured, gravity = measure(experiment), experiment.gravity
    if gravity is None:
        return measured

    def with_gravity(run: Run) -> Run:
        record = run.record
        if run.kind != "tracking" or record.torque is None or record.acceleration is None:
            return run
        hangs = hangs_at(record, experiment.context, record.torque, record.acceleration, np.ones(record.time.size))
        return run.having(link_torque=gravity.value * np.sin(np.asarray(record.position) - hangs))

    own = measured.experiment
    asked = [name for name in regressors(own) if name != "gravity" and name not in own.fit.load]
    beside = own.model_copy(update={"fit": own.fit.model_copy(update={"regressors": (*asked, "links")})})
    records = [with_gravity(run).record for run in measured.runs if run.kind == "tracking" and not run.hold_out]
    seen = link_scale(beside, records)
    refined = scale_beside_bristles(beside, records, seen)
    kind, drive, of = experiment.joint.kind, effort(own.joint.kind), effort_unit(own.joint.kind)
    constant = torque_constant(refined if seen.told else seen, kind, of)
    if constant.value is None:
        return replace(measured, findings=(*measured.findings, *constant.warnings))

    # the effort in N*m, with the errors of scale and gravity
    K, name = constant.value, _CONSTANTS.get(drive)
    relative = (gravity.standard_error or 0.0) / gravity.value
    error = float(np.hypot(constant.standard_error or 0.0, K * relative))
    known = PlusMinus(value=K, standard_error=error)

    def scaled(signals: Signals) -> Signals:  # torque = scale times effort
        told = {"unit": of, "scale": f"{K!r} +/- {error!r} {constant.unit}"}
        return signals.model_copy(update={"torque": signals.torque and signals.torque.model_copy(update=told)})

    of_runs = (r if r.signals is None else r.model_copy(update={"signals": scaled(r.signals)}) for r in own.runs)
    changed = {"signals": scaled(own.signals), "runs": tuple(of_runs)}
    changed["motor_constants"] = ONE.model_copy(update={"kp": None, name: known}) if name else None
    as_written = {key: getattr(experiment, key) for key in ("joint", "inertia", "plan")}
    in_torque = own.model_copy(update=changed | as_written)
    (told,) = in_torque.torque_constants
    torques = [K * np.asarray(run.record.torque) for run in measured.runs]
    runs = tuple(
        run.having(torque=T, torque_shifts={str(told): T / K * error})
        for run, T in zip(measured.runs, torques, strict=True)
    )
    exact = "" if gravity.standard_error else ", assumed exact,"
    damped = f"; alpha_2 holds {_DAMPED[drive]}" if drive in _DAMPED else ""
    message = (
        f"{name or f'torque per {drive}'} {K:g} +/- {error:.2g} {constant.unit}, which the gravity of {gravity.value:g} "
        f"{unit('torque', kind)}{exact} takes{damped} (gravity overrules)."
    )
    found = Finding("scale-by-gravity", NOTE, message, {"scale": K, "error": error})
    return replace(measured_of(in_torque, runs), findings=(*measured.findings, found))
