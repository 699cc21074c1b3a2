"""The experiment file in SI, and its runs; m, N and kg replace rad, N*m and kg*m**2 where the joint is prismatic."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, StrictBool

from bristle.data.cleaning import make_record
from bristle.data.constant_velocity.acceptance import Thresholds
from bristle.data.experiment import schema
from bristle.data.experiment.constants import Constant, coasted, torque_constants, torque_shifts
from bristle.data.experiment.signals import DRIVE, GAINS, SIDED, Cleaning, Context, Gear, Signals, quantity, si
from bristle.data.experiment.tables import RunFiles, Source, joined, keys_of, matches, part_of, read_columns, sources_of
from bristle.data.experiment.yaml_file import StrictModel, parse, read_text, validate
from bristle.data.record import Record
from bristle.data.signal_checks import check_signals, check_units, velocity_factor
from bristle.data.text_table import RawTable, Reader, naming, read_table
from bristle.data.torque_checks import with_unknown
from bristle.errors import InputError, short
from bristle.findings import NOTE, Finding
from bristle.model.parameters import Kind as JointKind
from bristle.model.parameters import Lugre, Motor

_NAN = float("nan")


class Experiment(StrictModel):
    """An experiment file, validated, in SI."""

    path: Path
    joint: schema.JointDescription
    motor_constants: schema.MotorConstants | None = Field(default=None, alias="motor")
    inertia: Annotated[schema.PlusMinus, schema.read_constant("inertia", is_prior=True)] | None = None
    gravity: schema.Gravity | None = None
    """Known gravity: scales a torque that is known as a voltage, a current or a position error alone."""
    # size of one count on the side of the gear that the encoder is on, rad
    declared_count: Annotated[float, quantity("position", of_motor=True), Field(gt=0)] | None = Field(
        default=None, alias="encoder_resolution"
    )
    signals: Signals = Signals()
    runs: Annotated[tuple[RunFiles, ...], Field(min_length=1)]
    cleaning: Cleaning = Cleaning()
    segments: Thresholds = Thresholds()
    fit: schema.FitOptions = schema.FitOptions()
    coasting: Annotated[
        schema.Coasting | None, BeforeValidator(lambda x: ({} if x else None) if isinstance(x, bool) else x)
    ] = None
    """Of a joint that nothing drives, with what is known; `true`: nothing."""
    adapt: schema.AdaptOptions = schema.AdaptOptions()
    plan: schema.PlanOptions = schema.PlanOptions()
    simulated: StrictBool = False
    assumptions: tuple[schema.Shown, ...] = ()
    true_sets: dict[Literal["+", "-", "both"], schema.TrueSet] = Field(default_factory=dict, alias="truth")

    @property
    def motor(self) -> Motor[float] | None:
        """The motor as seen at the joint, k_t in N*m/A, R in ohm, L in H, J in kg*m**2; nan where not known, L 0."""
        m = None if self.motor_constants is None else self.motor_constants.at_joint()
        if m is None or m.torque_constant is None:
            return None
        R = m.resistance.value if m.resistance else _NAN
        return Motor(m.torque_constant.value, R, m.inductance, _NAN if m.inertia is None else m.inertia)

    @property
    def encoder_resolution(self) -> float | None:
        """Size of one count at the joint, rad."""
        return self.declared_count and self.declared_count * abs(self.context.to_joint("position"))

    @property
    def truth(self) -> dict[str, Lugre[float]]:
        """The true parameters by direction (+, -, both), where the data are simulated."""
        return {d: Lugre(**{name: _NAN if x is None else x for name, x in p}) for d, p in self.true_sets.items()}

    def signals_of(self, run: RunFiles) -> Signals:
        """The signals of a run: its own, else those of the experiment."""
        return (run.signals.over(self.signals) if run.signals else self.signals).timed()

    @property
    def torque_constants(self) -> tuple[Constant, ...]:
        """The constants that the torques of all runs are computed with, each once."""
        known = self.motor_constants, self.context, self.coasting
        return tuple(dict.fromkeys(x for run in self.runs for x in torque_constants(self.signals_of(run), *known)))

    @property
    def context(self) -> Context:
        """What the units of the file depend on."""
        gear = self.motor_constants.gear if self.motor_constants else None
        return Context(kind=self.joint.kind, resolution=self.declared_count, gear=gear)

    def _problems(self) -> Iterator[str]:
        if "both" in self.true_sets and len(self.true_sets) > 1:
            yield "truth: got both beside + or -; expected either both, or + and -"
        if self.coasting is not None:
            made, signals = self.coasting.made_of, [self.signals_of(run) for run in self.runs]
            got = [f"signals.{drive}" for x in signals if (drive := x.drive()) is not None]
            got += [f"a run of kind {run.experiment}" for run in self.runs if run.experiment != "tracking"]
            got += [f"fit.regressors: {made}"] if made in (self.fit.regressors or ()) else []
            got += ["inertia"] if made == "inertia" and self.inertia is not None else []
            if got:
                yield f"coasting: got {got[0]} beside it; expected tracking runs whose torque nothing but gravity and inertia makes"
        for k, run in enumerate(self.runs):
            yield from (f"runs.{k}: {problem}" for problem in self._problems_of(run))

    def _problems_of(self, run: RunFiles) -> Iterator[str]:
        signals = self.signals_of(run)
        drive, moving = signals.drive(), run.experiment != "points"
        if drive is None and self.coasting is None:
            yield "no torque; name one of torque, voltage and current, or command, under signals"
        if moving and signals.time is None:
            yield "no time; give a column, as in time: {column: t, unit: s}, or a rate, as in time: {rate: 1 kHz}, under signals"
        by_position = not {"gravity", *schema.PERIODIC}.isdisjoint(self.fit.regressors or ())
        needs_position = run.experiment == "presliding" or (run.experiment == "ramp" and by_position)
        if signals.position is None and (needs_position or signals.velocity is None):
            wanted = "position" if needs_position else "velocity" if not moving else "position (or velocity)"
            yield f"no {wanted}, which {run.experiment} runs need; name it under signals"
        if not moving and (signals.velocity is None or drive == "command"):
            yield "points are pairs of velocity and torque (or a current, or a voltage); name both under signals"
        constants = self.motor_constants
        alone = constants is None and len({self.signals_of(r).drive() for r in self.runs}) == 1
        lacks = [x for name, x in GAINS.items() if getattr(signals, name) and not (constants and getattr(constants, x))]
        if lacks and not (alone and lacks == ["kp"]):
            yield (
                f"the torque that a drive makes of a command needs motor.{lacks[0]} (--{lacks[0]}); add it, as in motor: {{kp: 20 N*m/rad, "
                "kd: 1 N*m*s/rad}; of a position command alone, without motor, friction is in rad, as a share of kp"
            )
        if signals.command is not None and signals.position is None:
            yield "no position, which a drive compares its command with; name it under signals"
        if self.gravity is not None and (drive in ("torque", None) or not alone or not moving):
            yield (
                "gravity: a known gravity scales a voltage, a current or a command without constants under motor; leave it out: "
                "of a torque gravity is found, and of a joint that coasts it stands under coasting"
            )
        k_t = constants and constants.torque_constant
        lacking = constants is None or k_t is None or (drive == "voltage" and constants.resistance is None)
        if drive in ("current", "voltage") and not alone and lacking:
            wanted, option = ("torque_constant", "--torque-constant") if k_t is None else ("resistance", "--resistance")
            yield f"torque from {drive} needs motor.{wanted} ({option}); add it, as in motor: {{torque_constant: 0.35 N*m/A, resistance: 2.1 ohm}}"

        gear = self.context.gear
        unsaid = [name for name in SIDED if gear and getattr(signals, name) is not None and getattr(gear, name) is None]
        if unsaid:
            yield f"motor.gear does not say on which side {unsaid[0]} was logged; add {unsaid[0]}: motor, or {unsaid[0]}: joint, to it"
        if not moving and signals.apart():
            yield f"points are pairs in rows, without time; leave out signals.{min(signals.apart())}.time"


def load_experiment(path: str | Path) -> Experiment:
    """The experiment of a YAML file; the data files are not read yet.

    Raises InputError in one sentence that names the file, the key or the line, what was got and what to do.
    """
    return experiment_of(read_text(Path(path)), Path(path))


def experiment_of(text: str, path: Path) -> Experiment:
    """The experiment of a YAML text with the path that it would have. Raises InputError as `load_experiment` does."""
    return experiment_from(parse(text, str(path)), path, str(path))


def experiment_from(data: dict[str, Any], path: Path, where: str) -> Experiment:
    """The experiment of a file's keys; errors open with `where`. Raises InputError as `load_experiment` does."""
    if "path" in data:
        raise InputError(f"{where}: unknown key 'path'; data files are named under runs, as files")
    data = {key: value for key, value in data.items() if value is not None}  # a heading with nothing under it

    # the joint's kind, resolution and gear, before they are validated: the units of all other keys depend on them
    joint, motor = data.get("joint"), data.get("motor")
    kind: JointKind = "prismatic" if isinstance(joint, dict) and joint.get("kind") == "prismatic" else "revolute"
    declared, gear = motor.get("gear") if isinstance(motor, dict) else None, None
    if isinstance(declared, dict):
        try:
            gear = Gear.model_validate(declared, context=Context(kind=kind))
        except ValueError:  # of one that is not valid its sides
            gear = Gear.model_construct(ratio=1.0, **{name: declared.get(name) for name in SIDED})
    context = Context(kind=kind, resolution=1.0 if "encoder_resolution" in data else None, gear=gear)
    return validate(Experiment, {**data, "path": path}, where, context)


def in_own_unit(experiment: Experiment, asked: tuple[str, ...] | None) -> Experiment:
    """The experiment of a joint whose torque is in A, V or rad, or per inertia, with these regressors."""
    drive = experiment.signals_of(experiment.runs[0]).drive()
    error = "in m" if experiment.joint.kind == "prismatic" else "in rad"
    effort = {"voltage": "in V", "current": "in A", "command": error}.get(drive or "", "per inertia")

    def renamed(signals: Signals) -> Signals:
        logged = signals.voltage if drive == "voltage" else signals.current
        return signals.model_copy(update={"current": None, "voltage": None, "torque": logged})

    runs = tuple(r.model_copy(update={"signals": r.signals and renamed(r.signals)}) for r in experiment.runs)
    fit = experiment.fit
    changed = {
        "joint": experiment.joint.model_copy(update={"kind": f"{experiment.joint.kind} {effort}"}),
        "signals": renamed(experiment.signals),
        "runs": runs,
        "plan": experiment.plan.model_copy(update={"torque": None}),
        "fit": fit if asked == fit.regressors else fit.model_copy(update={"regressors": asked}),
    }
    return experiment.model_copy(update={**changed, "motor_constants": None, "inertia": None})


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run that was read."""

    kind: schema.RunKind
    record: Record
    hold_out: bool = False

    def having(self, **changed: Any) -> "Run":
        """The run with some fields of its record changed."""
        return replace(self, record=replace(self.record, **changed))


def read_runs(experiment: Experiment) -> tuple[Run, ...]:
    """Every run of the experiment as a record with velocity and torque; tracking runs have acceleration as well.

    Raises InputError in one sentence that names the file and what is wrong with it.
    """
    return tuple(
        Run(kind=run.experiment, record=read_run(experiment, run, sources), hold_out=run.hold_out)
        for run, sources in files_of(experiment)
    )


def files_of(experiment: Experiment) -> Iterator[tuple[RunFiles, list[Source]]]:
    """The entry and the files of each run, each file with the name that results show. Raises InputError where there is none."""
    yield from ((run, sources) for run in experiment.runs for sources in sources_of(run, experiment.path))


def run_of_table(experiment: Experiment, table: RawTable, shown: str) -> Run:
    """The only run of an experiment, from a table. Raises InputError as `read_runs`."""
    (run,) = experiment.runs
    return Run(kind=run.experiment, record=_record(experiment, run, table, shown), hold_out=run.hold_out)


def read_run(experiment: Experiment, run: RunFiles, sources: list[Source], read: Reader = read_table) -> Record:
    """One run as a record with velocity and torque. Raises InputError as `read_runs`."""
    return _record(experiment, run, *table_of_run(experiment, run, sources, experiment.signals_of(run), read))


def table_of_run(
    experiment: Experiment, run: RunFiles, sources: list[Source], signals: Signals, read: Reader = read_table
) -> tuple[RawTable, str]:
    """The columns of some signals of a run, and the name that results show. Raises InputError as `read_runs`."""

    def find(file: str) -> tuple[Path, str]:
        found = matches(file, experiment.path)
        if len(found) > 1 or len(list(sources_of(run, experiment.path))) > 1 or run.joined:
            remedy = "give each run an entry of its own, with its signals"
            raise InputError(f"{experiment.path}: runs: a signal of {short(file)} goes with one file; {remedy}")
        return found[0]

    gap = experiment.cleaning.gap
    names = [name for _, name in sources]
    shown = " + ".join(names[:3] if len(names) < 4 else [names[0], f"{len(names) - 1} more"])
    tables = [read_columns(signals, source, gap, experiment.context, find, read) for source in sources]
    table = tables[0] if len(tables) == 1 else joined(tables, names, gap)
    return part_of(table, run, shown)


def _record(experiment: Experiment, run: RunFiles, table: RawTable, shown: str) -> Record:
    signals = experiment.signals_of(run)
    labels = {name: value for name in ("temperature", "load") if (value := getattr(run, name)) is not None}
    points = run.experiment == "points"
    # what overflows is not finite, and treated as such
    with np.errstate(over="ignore", invalid="ignore"), naming(shown):
        record = make_record(
            shown, table, signals, experiment.cleaning, experiment.context, labels=labels, points=points,
            motor=experiment.motor_constants,
        )  # fmt: skip  # a list
        record = _complete(experiment, run.experiment, record, signals)
        if (gear := experiment.context.gear) is not None:
            logged = [name for name in (*SIDED, *DRIVE) if getattr(signals, name) is not None]
            moved = ", ".join(dict.fromkeys(name for name in logged if gear.at_motor(name))) or "no signal"
            unit = "" if experiment.joint.kind == "revolute" else " rad/m"
            message = f"Gear of ratio {gear.ratio:g}{unit}: logged at the motor, and brought to the joint: {moved}."
            note = Finding("gear-taken", NOTE, message, {"ratio": gear.ratio})
            record = replace(record, notes=(*record.notes, note))
        stated = {name: table.units.get(key, "") for name, key in keys_of(signals).items()}
        wrong = check_signals(record, run.experiment, signals, experiment.context)
        shifts = torque_shifts(record, signals, experiment.motor_constants, experiment.context, experiment.coasting)
    warnings = (*record.warnings, *check_units(shown, stated, signals), *wrong)
    record = replace(record, warnings=warnings, torque_shifts=shifts)
    record = with_unknown(record, run.experiment)
    return _placed(record) if run.experiment == "tracking" else record


def _placed(record: Record) -> Record:
    """The record with the integral of a velocity that is logged alone, without gaps, for its position: all but where it began is known."""
    if record.position is not None or record.velocity is None or len(record.starts) > 1:
        return record
    from scipy.integrate import cumulative_trapezoid

    position = cumulative_trapezoid(record.velocity, record.time, initial=0)
    message = (
        "No position is logged: it is taken as the integral of the velocity, from zero, so that gravity can be told."
    )
    note = Finding("position-integrated", NOTE, message)
    return replace(record, position=position, integrated=True, notes=(*record.notes, note))


def from_current(k_t: float, unit: str) -> Finding:
    """The note that the torque is the current times k_t, in that unit."""
    message = f"Torque from current: k_t = {k_t:g} {unit}."
    return Finding("torque-from-current", NOTE, message, {"k_t": k_t, "unit": unit})


def _complete(experiment: Experiment, kind: schema.RunKind, record: Record, signals: Signals) -> Record:
    """The record with torque and, but for points, velocity, for tracking acceleration, and the low pass that its kind needs."""
    from bristle.data.bandwidth import of_held_speeds, of_motion, of_slow_loading, without_noisy_velocity
    from bristle.data.differentiation import estimate_motion, let_go, with_rests, without_rests
    from bristle.model.motor import drive_torque

    fit, motor, drive = experiment.fit, experiment.motor, signals.drive()
    if kind == "tracking":
        record = record if experiment.coasting is None else let_go(record)
        # the slope of a position in another unit is no better
        factor = velocity_factor(record, signals, experiment.context)
        if fit.set_up != schema.AS_WRITTEN and (factor is None or factor.code != "velocity-factor"):
            record = without_noisy_velocity(record)
        record = with_rests(without_rests(estimate_motion(record, fit.position_cutoff or of_motion)))
        if experiment.coasting is not None:
            record = coasted(record, experiment.coasting, experiment.context)
    elif record.velocity is None:
        record = estimate_motion(record, of_held_speeds)
    if drive == "current" and motor is not None and record.torque is not None:
        note = from_current(motor.k_t, si("k_t", experiment.context))
        record = replace(record, torque=motor.k_t * record.torque, notes=(*record.notes, note))
    elif drive == "voltage" and motor is not None:
        unit = si("k_t", experiment.context)
        message = f"Torque from voltage by (8): k_t = {motor.k_t:g} {unit}, R = {motor.R:g} ohm."
        note = Finding("torque-from-voltage", NOTE, message, {"k_t": motor.k_t, "R": motor.R})
        torque = drive_torque(record.voltage, record.velocity, motor)
        record = replace(record, torque=torque, notes=(*record.notes, note))
    elif drive == "voltage":  # an effort in its own unit, as a current is without a motor
        record = replace(record, torque=record.voltage, voltage=None)
    if kind == "presliding" and record.torque is not None:
        cutoff, why = of_slow_loading(record)
        message = f"Torque of slow loading: low pass of {cutoff:.3g} Hz{why.message}."
        note = Finding("torque-smoothed", NOTE, message, {"cutoff": cutoff})
        record = replace(record, cutoff=cutoff, notes=(*record.notes, note))
    return record
