"""The paper's experiments 3.3 to 5 in closed loop, for any joint: Figs 5 to 12 and Table 2."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from bristle.control.adaptation import laws_for
from bristle.control.closed_loop import Trajectory, simulate
from bristle.control.compensator import Compensator
from bristle.control.control_period import Case, LoopOptions
from bristle.errors import InputError
from bristle.simulation.joint_loop import JointLoop
from bristle.simulation.references import stacked

LONG, SETTLE, SHORT = 30.0, 10.0, 20.0  # s: a run of Fig. 8, the start of its RMS error, a run of the adaptation
BARE = Compensator(name="none")


class Errors(NamedTuple):
    """A row of Fig. 8: RMS errors of one joint, rad, and torques, N*m."""

    joint: str
    frequency: float  # Hz
    inertia: bool  # whether inertia feed-forward is added, to all four
    without: float  # without friction compensation
    true: float  # LuGre feed-forward with the plant's parameters
    identified: float  # with the identified parameters
    adaptive: float  # with adaptation, initialised at the identified parameters
    torque_without: float  # RMS torque command without friction compensation
    torque_with: float  # with the identified parameters


def errors(loop: JointLoop) -> tuple[Errors, ...]:
    """Fig. 8 at both frequencies of a joint, without and with inertia feed-forward.

    Raises InputError where the loop diverges with the joint's compensator.
    """
    frequencies, own, found = (loop.slow, loop.frequency), loop.case(model=loop.plant), loop.case()
    references = [loop.sine(f, LONG) for f in frequencies]

    def run(compensator: Compensator, cases: Sequence[Case], J: float) -> Trajectory:
        """Both references for each pair of cases, with an inertia J fed forward."""
        options = LoopOptions(compensator=replace(compensator, inertia=J))
        return simulate(options, cases, stacked(references * (len(cases) // 2)), loop.period)

    rows = []
    for inertia in (False, True):
        J = loop.J if inertia else 0.0
        bare, steady = run(BARE, [found] * 2, J), run(loop.compensator, [own, own, found, found], J)
        moved = run(replace(loop.compensator, adaptation=loop.adaptation), [found] * 2, J)
        without, fed, adaptive = (t.rms_error(SETTLE).tolist() for t in (bare, steady, moved))
        if not max(fed) < 10 * loop.amplitude:
            raise InputError(
                f"{loop.name}: the loop diverges with {loop.compensator.name}; choose lugre, lower gains, or a shorter period"
            )
        asked, given = (t.rms_torque(SETTLE).tolist() for t in (bare, steady))
        rows += [
            Errors(loop.name, f, inertia, without[k], fed[k], fed[2 + k], adaptive[k], asked[k], given[2 + k])
            for k, f in enumerate(frequencies)
        ]
    return tuple(sorted(rows, key=lambda row: (row.frequency, row.inertia)))


def followed(loop: JointLoop) -> dict[str, Trajectory]:
    """Figs 5 to 7: the slow sine without friction compensation and with the identified model's."""
    reference = loop.sine(loop.slow, 2 / loop.slow)
    options = {"without": LoopOptions(compensator=BARE), "with": LoopOptions(compensator=loop.compensator)}
    return {name: simulate(w, [loop.case()], reference, loop.period) for name, w in options.items()}


class Factors(NamedTuple):
    """A row of Table 2: one parameter adapted by one law, as a ratio to the model's value."""

    law: str
    parameter: str
    initial: float
    early: float  # after a fifth of the run
    final: float


class Adapted(NamedTuple):
    """Figs 9 to 12 and Table 2: adaptation from wrong parameters by each law."""

    runs: Mapping[str, Trajectory]  # by law, and `not adapted`
    factors: tuple[Factors, ...]


def adapted(loop: JointLoop) -> Adapted:
    """Adaptation from the wrong start, by every law that can adapt the parameters."""
    plan, reference = loop.adaptation, loop.sine(loop.frequency, SHORT)
    case = loop.case(model=loop.wrong_start(loop.model))
    laws = laws_for(plan.parameters)
    ways = {"not adapted": None} | {law: replace(plan, law=law, gamma=loop.comparable_rates(law)) for law in laws}
    runs = {
        name: simulate(LoopOptions(compensator=replace(loop.compensator, adaptation=a)), [case], reference, loop.period)
        for name, a in ways.items()
    }
    factors = [
        Factors(law, name, begun, float(begun * theta[theta.size // 5]), float(begun * theta[-1]))
        for law in laws
        for name, theta in zip(plan.parameters, runs[law].theta[0], strict=True)
        for begun in [loop.start.get(name, 1.0)]
    ]
    return Adapted(runs, tuple(factors))
