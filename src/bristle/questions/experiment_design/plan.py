"""What to measure next, all of it: constant velocities, slow loading and a tracking motion within limits, and the intervals to expect."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bristle.arrays import Array
from bristle.data.differentiation import stretches
from bristle.data.record import freeze
from bristle.data.slow_loading import Loading
from bristle.errors import InputError
from bristle.identification.fisher import STATIC, covariance, static_information
from bristle.identification.identify import Measured
from bristle.identification.limits import SAMPLES, Limits, followed, limits_of, shortened
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.parameters import Kind, Lugre, Pair, unit
from bristle.model.vectorize import evaluate
from bristle.questions.experiment_design import excitation as moving
from bristle.questions.experiment_design import references as reference
from bristle.questions.experiment_design import velocities as static
from bristle.questions.experiment_design.excitation import Drive, LoadingDesign, MotionDesign
from bristle.questions.experiment_design.references import PlannedRun
from bristle.questions.experiment_design.start import Start, embedded, inverse, start_of
from bristle.questions.experiment_design.velocities import Design, Task
from bristle.simulation.references import Hold, Multisine

Progress = Callable[[str, int, int], None]
VELOCITIES = 12
"""Runs at constant velocity in each direction."""
DURATION = 15.0
"""Longest tracking motion, s."""
AIMS = (*Lugre._fields, "inertia")
"""What a plan may be for."""
_WIDE = 0.2
"""Relative standard error beyond which the tracking motion is averaged over other joints as well."""
_OTHERS = 2
"""How many."""
_TENTH = 0.1
"""What torque noise of slow loading is referred to, s."""
_UNSURE = 1.0
"""Standard deviation of the logarithm of a guess."""
_SHORTEST_SHARE = 0.02
"""Of its time, that a plan may be cut to."""
_MOST = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """The constant velocities of one direction."""

    tag: str
    task: Task
    chosen: Design
    designs: Mapping[str, Design]
    """D-optimal (`all`), and c-optimal for each of `STATIC`."""
    spaced: Mapping[str, Design]
    """As many runs over the same range, `log` and `even`."""
    alone: Mapping[str, Design]
    """The same beside `planned`, which is what would be run for the same aim were nothing known yet; judged without what is known."""
    simulated: Mapping[str, Array]
    """Scatter of fits of the runs in `alone`, SIMULATED, (4,) each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What to measure next on one joint."""

    name: str
    kind: Kind
    simulated: bool
    """Whether what was measured so far is simulated."""
    aim: str
    """A parameter, or `all`."""
    limits: Limits
    start: Start
    directions: tuple[Direction, ...]
    loads: tuple[LoadingDesign, ...]
    motions: tuple[MotionDesign, ...]
    """The planned one, a plain multisine, and the measured one where there is any; by themselves beside what was known and the rest of the plan."""
    stages: Mapping[str, Array]
    """Standard errors of every parameter, (p,): `now`, and as expected `with velocities`, `with loading`, `with motion`; inf where not seen."""
    references: tuple[PlannedRun, ...]
    assumptions: tuple[str, ...]
    joint: Joint

    def __post_init__(self) -> None:
        """Freeze what mappings hold."""
        freeze(self)

    @property
    def free(self) -> list[int]:
        """Where the parameters stand that are not given as exact, among the start's names."""
        return [k for k, name in enumerate(self.start.names) if name not in self.start.given]

    @property
    def duration(self) -> float:
        """Of all references, s."""
        return sum(r.position.size for r in self.references) / self.limits.rate


def plan(
    measured: Measured,
    joint: Joint,
    velocities: int = VELOCITIES,
    aim: str = "all",
    progress: Progress | None = None,
) -> Plan:
    """What to measure next on an identified joint.

    Args:
        measured: what it was identified from, with limits under `plan` in its experiment file.
        joint: as identified.
        velocities: runs at constant velocity in each direction.
        aim: the parameter whose interval is to shrink, one of `AIMS`, or `all`.
        progress: called with what is being done, how many steps are done, and how many there are.

    Raises InputError where the aim is no parameter, nothing is known of friction over velocity, or the limits leave nothing to plan.
    """
    check_plan(velocities, aim)
    tell = progress or (lambda *_: None)
    tell("velocities", 0, 1)
    limits, said = limits_of(measured)
    start = start_of(measured, joint, limits)
    _check_aim(start, aim)
    seen = joint.moving is not None and joint.moving.quantity == "torque"
    limits, capped = followed(limits, measured, start.equation_step if seen else None)
    directions, loads, limits, share = _within_time(measured, joint, start, limits, velocities, aim)
    known = start.known
    stages = {"now": covariance(known)[0]}
    for own in directions:
        at = [name + own.tag for name in STATIC]
        matrix = static_information(own.chosen.speeds, own.task.p, own.task.noise)
        known = known + embedded(start.names, at, matrix)
    stages["with velocities"] = covariance(known)[0]
    for load in loads:
        if np.isfinite(load.error):
            known = known + embedded(start.names, [start.key("sigma_0", load.tag)], np.array([[load.error**-2]]))
    stages["with loading"] = covariance(known)[0]
    drive = _drive(start, limits, known, aim, share)
    motion = moving.best_motion(drive, lambda done, total: tell("tracking motion", done, total))
    stages["with motion"] = motion.errors
    plain = moving.within_torque(moving.plain_lines(drive.limits), drive)
    motions = (motion, moving.judged("plain multisine", plain, drive), *_measured(measured, drive))
    return Plan(
        name=joint.name,
        kind=joint.kind,
        simulated=joint.simulated,
        aim=aim,
        limits=limits,
        start=start,
        directions=directions,
        loads=loads,
        motions=motions,
        stages=stages,
        references=_references(start, limits, directions, loads, motion),
        assumptions=(*said, *capped, *start.assumptions, *_assumed(joint, start, drive)),
        joint=joint,
    )


def check_plan(velocities: int, aim: str) -> None:
    """Whether so many velocities (4 to 1000, for there are four parameters) can be planned for an aim, which is one of `AIMS` or `all`.

    Raises InputError where they cannot.
    """
    if not len(STATIC) <= velocities <= _MOST:
        raise InputError(
            f"got {velocities} velocities; expected {len(STATIC)} to {_MOST}: four parameters take at least as many runs"
        )
    if aim not in (*AIMS, "all"):
        raise InputError(f"got {aim!r} as what to plan for; expected one of {', '.join(AIMS)}, or all")


def _check_aim(start: Start, aim: str) -> None:
    if aim in start.given:
        raise InputError(
            f"the {aim} is given as exact: there is nothing to plan for it; give its standard error, or leave it out of the experiment file"
        )


def deflection(p: Lugre[float]) -> float:
    """The largest steady deflection of the bristle, rad."""
    return (p.alpha_0 + p.alpha_1) / p.sigma_0


def _within_time(
    measured: Measured, joint: Joint, start: Start, limits: Limits, velocities: int, aim: str
) -> tuple[tuple[Direction, ...], tuple[LoadingDesign, ...], Limits, float]:
    """Velocities and loads, with every time shortened by one share where all of it would take longer than the limit."""
    share = 1.0
    while share > _SHORTEST_SHARE:
        short = shortened(limits, share)
        directions = tuple(_direction(start, tag, short, velocities, aim, share) for tag in start.tags)
        loads = tuple(_loads(measured, joint, start, d, short, share) for d in "+-")
        needed = _time(start, short, directions, loads, share * DURATION)
        if limits.time is None or needed <= limits.time:
            return directions, loads, short, share
        share *= min(0.9, limits.time / needed)
    raise InputError(
        f"{measured.experiment.path.name}: plan.time: {limits.time:g} s are too few for {velocities} velocities in each direction, loading and a "
        "motion; give more time or fewer velocities"
    )


def _direction(start: Start, tag: str, limits: Limits, velocities: int, aim: str, share: float) -> Direction:
    """All designs of one direction; where both share a set, each speed is run forth and back."""
    p = start.p(tag)
    both = 1.0 if tag else 0.5
    high = _allowed(p, reference.fastest(max(map(deflection, start.sets)), limits), limits)
    known, wide = _static_known(start, tag)
    guessed = f"v_s{tag}" in start.guessed
    task = Task(
        p=p,
        nodes=np.geomspace(limits.slowest, high / 2, static.NODES) if guessed else static.nodes_of(p.v_s, wide),
        known=known,
        noise=start.noise[tag] * float(np.sqrt(both / share)),
        low=limits.slowest,
        high=high,
    )
    aim = aim if aim in STATIC else "all"
    designs = {a: static.design(task, velocities, a) for a in ("all", *STATIC)}
    spaced = {kind: static.judged(task, static.spaced(task, velocities, kind)) for kind in ("log", "even")}
    fresh = replace(task, known=np.zeros_like(known))
    alone = {"planned": static.design(fresh, velocities, aim)}
    alone |= {kind: static.judged(fresh, d.speeds) for kind, d in spaced.items()}
    return Direction(
        tag=tag,
        task=task,
        chosen=designs[aim],
        designs=designs,
        spaced=spaced,
        alone=alone,
        simulated={kind: static.simulated_errors(task, d.speeds) for kind, d in alone.items()},
    )


def _allowed(p: Lugre[float], high: float, limits: Limits) -> float:
    """The fastest speed up to `high` at which steady sliding takes no more torque than the drive may give, rad/s."""
    speeds = np.geomspace(limits.slowest, high, static.CANDIDATES)
    fits = speeds[np.abs(evaluate(functions.steady_torque(), speeds, *p[:4])[0]) <= limits.torque]
    if fits.size < 2:
        raise InputError(
            f"the largest torque, {limits.torque:.3g}, does not carry the joint beyond {limits.slowest:.3g}; raise plan.torque"
        )
    return float(fits[-1])


def _static_known(start: Start, tag: str) -> tuple[Array, float]:
    """Information about the four static parameters of a tag whatever the others are, (4, 4), and the relative standard error of v_s.

    Nothing counts as known where one of them is a guess: what is known of the others then rests on there being no peak.
    """
    at = start.indices(tag, STATIC)
    seen = np.flatnonzero(np.diag(start.known) > 0).tolist()
    if any(name + tag in start.guessed for name in STATIC) or not set(at) <= set(seen):
        return np.zeros((len(STATIC), len(STATIC))), np.inf
    own = inverse(start.known[np.ix_(seen, seen)])
    among = [seen.index(k) for k in at]
    own = own[np.ix_(among, among)]
    return inverse(own), float(np.sqrt(own[3, 3]) / start.estimate[at[3]])


def _loads(measured: Measured, joint: Joint, start: Start, d: str, limits: Limits, share: float) -> LoadingDesign:
    """Slow loading in direction d."""
    p, own_noise = start.p(d), start.noise[start.key("", d)]
    at = [start.names.index(start.key(name, d)) for name in ("alpha_0", "alpha_1")]
    seen = [k for k in at if start.known[k, k] > 0]
    every = np.flatnonzero(np.diag(start.known) > 0).tolist()
    among = [every.index(k) for k in seen]
    spread = inverse(start.known[np.ix_(every, every)])[np.ix_(among, among)]
    error = float(np.sqrt(spread.sum())) if seen else own_noise
    slow = joint.presliding.fits.get(d) if joint.presliding else None
    noise = _loading_noise(slow.loadings, p, measured.experiment.fit.presliding_cutoff) if slow else 0.0
    noise = noise or own_noise * float(np.sqrt(limits.hold / share / _TENTH))
    return moving.loads(d, p, error, noise, start.resolution, share)


def _loading_noise(loadings: Sequence[Loading], p: Lugre[float], cutoff: float) -> float:
    """What a tenth of a second's mean torque scatters by at the count edges of measured loadings, N*m; 0 where there are too few edges."""
    g0, rest = p.alpha_0 + p.alpha_1, []
    for x in loadings:
        keep = x.edge_torque < moving.PEAKS[-1] * g0
        if keep.sum() > 2:
            y, y_T = evaluate(functions.loading_slope(), x.edge_torque[keep], g0, p.sigma_0)[:2]
            left = y - x.edge_displacement[keep]
            rest.append((left - left.mean()) / y_T)
    return float(np.std(np.concatenate(rest)) / np.sqrt(2 * cutoff * _TENTH)) if rest else 0.0


def _drive(start: Start, limits: Limits, known: Array, aim: str, share: float) -> Drive:
    """What the tracking motion is judged by."""
    free = [k for k, n in enumerate(start.names) if n not in start.given]
    every = free if aim == "all" else [k for k in free if start.names[k].rstrip("+-") == aim]
    relative = covariance(start.known)[0] / np.abs(start.estimate)
    guessed = np.array([n in start.guessed for n in start.names])
    wide = np.where(guessed, _UNSURE, np.where(np.isfinite(relative), np.minimum(relative, _UNSURE), 0.0))
    rng = np.random.default_rng(moving.SEED)
    drawn = [start.estimate]
    if wide.max() > _WIDE:
        drawn += [start.estimate * np.exp(wide * rng.standard_normal(wide.size)) for _ in range(_OTHERS)]
    sets = [Lugre(*x[:6]) if start.tags == ("",) else (Lugre(*x[:6]), Lugre(*x[6:12])) for x in drawn]
    step = min(
        start.equation_step, 1 / (SAMPLES * limits.frequency)
    )  # finer than the equations where it must be, of as much noise
    return Drive(
        sets=tuple(s if isinstance(s, Lugre) else Pair(*s) for s in sets),
        inertias=tuple(float(x[-1]) for x in drawn),
        known=known,
        noise=start.equation_noise * float(np.sqrt(start.equation_step / step)),
        step=step,
        limits=limits,
        duration=share * DURATION,
        aims=tuple(every),
    )


def _measured(measured: Measured, drive: Drive) -> tuple[MotionDesign, ...]:
    """The longest motion measured so far, as if it had taken as long as the planned one; none where there is none."""
    parts = [(r, s) for r in measured.moving(hold_out=False) for s in stretches(r)]
    if not parts:
        return ()
    record, part = max(parts, key=lambda x: x[1].stop - x[1].start)
    if record.velocity is None or record.acceleration is None:
        return ()
    every = max(1, round(drive.step / record.step))
    v, a = record.velocity[part][::every], record.acceleration[part][::every]
    step = every * record.step
    matrix, torque = moving.information(v, a, replace(drive, step=step))
    own = matrix * (drive.duration / (v.size * step))
    empty = Multisine(np.zeros(0), np.zeros(0), np.zeros(0))
    return (
        MotionDesign(
            name="measured so far",
            lines=empty,
            duration=drive.duration,
            torque=torque,
            information=own,
            errors=covariance(drive.known + own)[0],
        ),
    )


def _holds(start: Start, limits: Limits, directions: Sequence[Direction]) -> list[Hold]:
    """Every pass of every run, numbered from 1."""
    bend = max(map(deflection, start.sets))
    runs = [
        (sign * v)
        for own in directions
        for v in own.chosen.speeds.tolist()
        for sign in {"+": (1,), "-": (-1,), "": (1, -1)}[own.tag]
    ]
    return [hold for k, v in enumerate(runs, 1) for hold in reference.passes(v, k, bend, limits)]


def _time(
    start: Start, limits: Limits, directions: Sequence[Direction], loads: Sequence[LoadingDesign], duration: float
) -> float:
    """What everything takes, s."""
    made = [*_ramps(start, limits, directions), *_slow(loads, 0, limits), *_to_middle(limits, limits.position[0])]
    return sum(r.position.size for r in made) / limits.rate + duration + 1 / limits.rate


def _ramps(start: Start, limits: Limits, directions: Sequence[Direction]) -> list[PlannedRun]:
    """The runs at constant velocity in the order to play, with the moves between them."""
    step, found = 1 / limits.rate, list[PlannedRun]()
    at = (limits.position[0] + limits.position[1]) / 2
    for where, hold in reference.ordered(_holds(start, limits, directions), limits):
        if abs(where - at) > 1e-9 * limits.travel:
            found.append(reference.move_reference(at, where, limits, step))
        found.append(reference.hold_reference(hold, where, step))
        at = where + hold.travel
    return found


def _slow(loads: Sequence[LoadingDesign], runs: int, limits: Limits) -> list[PlannedRun]:
    return [reference.load_reference(load, runs + k, moving.CYCLES, 1 / limits.rate) for k, load in enumerate(loads, 1)]


def _to_middle(limits: Limits, at: float) -> list[PlannedRun]:
    return [reference.move_reference(at, (limits.position[0] + limits.position[1]) / 2, limits, 1 / limits.rate)]


def _references(
    start: Start, limits: Limits, directions: Sequence[Direction], loads: Sequence[LoadingDesign], motion: MotionDesign
) -> tuple[PlannedRun, ...]:
    """Everything in the order to play: constant velocities, loading where they end, and the motion about the middle."""
    ramps = _ramps(start, limits, directions)
    runs = max(r.run for r in ramps)
    slow = _slow(loads, runs, limits)
    middle = _to_middle(limits, float(ramps[-1].position[-1]))
    last = reference.motion_reference(motion.lines, runs + len(slow) + 1, limits, motion.duration, 1 / limits.rate)
    return (*ramps, *slow, *middle, last)


def _assumed(joint: Joint, start: Start, drive: Drive) -> list[str]:
    """What the expected intervals rest on."""
    q = unit("position", joint.kind)
    said = [
        "The design is local: errors are those of the estimates, to first order; velocities are averaged over what v_s may be, the motion over "
        f"{len(drive.sets) - 1} other joints that may be.",
        "Each reference is followed exactly; friction is LuGre, the same everywhere and at any time.",
        f"A run-in of at least {reference.SETTLE:g} s, or {reference.DEFLECTIONS:g} bristle deflections of travel, precedes each hold: "
        "the bristle forgets over one.",
    ]
    if start.resolution:
        said.append(f"Encoder: {start.resolution:.3g} {q} a count.")
    else:
        said.append("Encoder: no count is known; loading is planned as if it were fine.")
    return said
