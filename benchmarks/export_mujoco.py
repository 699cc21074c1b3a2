"""What MuJoCo does with an exported joint, in one run: errors, losses and time.

    python benchmarks/export_mujoco.py       some 40 s; needs MuJoCo

The joint is the wrist pitch of the embedded report, whose directions differ.

(a) One set in both directions as `<dcmotor lugre>`, imposed sines at 0.5 Hz and 2 ms: torque RMS error against a rollout
of ten samples in each step. Beside it the same where the bristle gets the velocity of the middle of each step: what is
left without the first-order hold of MuJoCo's bristle.

(b) Both directions by `bristle.mujoco.Friction`, driven for 10 s by a torque from presliding through reversals to
sliding: velocity RMS error against SciPy's Radau. The torque is that of the beginning of each step, as a simulation
has it, and for comparison that of its middle; Radau has the continuous torque, or the one that is held over each step.

(c) What each fall-back loses of the joint's torque along four sines at 0.5 Hz. Values of frictionloss are the best
for the declared motion, the symmetric sets the best for that and the stated ones; all is what their equations hold,
then what MuJoCo makes of frictionloss and damping at 2 ms, whose dry friction is a soft constraint. Friction: its torque
over each step of 2 ms, driven so that the joint keeps to the sine, against the joint's mean torque over the step.

(d) Time of one step of the model of one joint, without and with Friction, ns: the least of several runs.
"""

from collections.abc import Iterator
from pathlib import Path
from time import perf_counter_ns

import mujoco
import numpy as np

import bristle
from bristle.arrays import Array
from bristle.model.parameters import Pair
from bristle.mujoco import Friction
from bristle.questions.export import mjcf
from bristle.questions.export.export import Request
from bristle.questions.export.exported import FREQUENCY, ExportedJoint
from bristle.questions.export.loss import (
    StatedMotion,
    all_motions,
    best_coulomb_viscous,
    best_symmetric,
    coulomb_viscous,
    friction_of,
    lugre,
    rms_percent,
)
from bristle.questions.export.mjcf import STEP
from bristle.simulation.references import Sine
from export_checks.fmu import radau_continuous, radau_held
from export_checks.mjcf import at_steps, frictionloss_played, last_period, step_times

RESULTS, JOINT = Path(__file__).parents[1] / "reports" / "edro" / "results.json", "wrist pitch"
"""`bristle report` writes the file."""
SECONDS, STEPS = 10.0, (0.002, 0.001)
RUNS, CALLS, SOLVED = 5, 20_000, 5
"""Runs that are timed, steps of each; passes in which the torque that keeps the joint to its motion is found."""
ONE = """<mujoco><option timestep="{h!r}" gravity="0 0 0"/><worldbody><body><joint name="{name}" axis="0 0 1" armature="{J!r}"/>
<inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/></body></worldbody><actuator><motor joint="{name}"/></actuator></mujoco>"""


def model_of(joint: ExportedJoint, h: float) -> "mujoco.MjModel":
    """One joint with the identified inertia, driven by a torque."""
    return mujoco.MjModel.from_xml_string(ONE.format(h=h, name=joint.name, J=joint.inertia))


def implementation(joint: ExportedJoint) -> Iterator[str]:
    """(a)."""
    p = joint.pair.positive
    model = mujoco.MjModel.from_xml_string(
        ONE.format(h=STEP, name=joint.name, J=joint.inertia).replace(
            f'<motor joint="{joint.name}"/>',
            f'<dcmotor joint="{joint.name}" lugre="{p.sigma_0!r} {p.sigma_1!r} {p.alpha_0!r} {p.alpha_0 + p.alpha_1!r} {p.v_s!r}" '
            f'damping="{p.alpha_2!r}" resistance="1" motorconst="1e-9"/>',
        )
    )
    for amplitude in (1.0, 0.1, 0.02):
        motion = StatedMotion("imposed", amplitude, FREQUENCY)
        true = at_steps(lugre(Pair(p, p)), motion)
        plain, middle = (rms_percent(imposed(model, motion, ahead), true) for ahead in (0.0, STEP / 2))
        yield f"  {amplitude:5g} rad: {plain:.2f} %  (velocity of the middle of the step: {middle:.4f} %)"


def imposed(model: "mujoco.MjModel", motion: StatedMotion, ahead: float) -> Array:
    """Friction torque of the last period, N*m, the bristle stepped by the velocity so much later."""
    data, sine, time = mujoco.MjData(model), Sine(motion.amplitude, motion.frequency), step_times(motion)
    torque = np.empty(time.size)
    for k, (now, then) in enumerate(zip(sine.at(time).velocity, sine.at(time + ahead).velocity, strict=True)):
        data.qpos[0], data.qvel[0] = 0.0, now
        mujoco.mj_forward(model, data)
        torque[k] = -data.qfrc_actuator[0] - data.qfrc_passive[0]
        data.qvel[0] = then
        mujoco.mj_step(model, data)
    return last_period(torque)


def drive(t: float) -> float:
    """N*m."""
    w = 2 * np.pi
    return float(0.16 * np.sin(0.2 * w * t) + 0.1 * np.sin(0.5 * w * t + 1) + 0.06 * np.sin(1.1 * w * t + 2))


def simulated(joint: ExportedJoint, h: float, ahead: float) -> Array:
    """Velocity at each time step, rad/s, with `Friction`."""
    model = model_of(joint, h)
    data, friction, v = mujoco.MjData(model), Friction(model, joint.name, joint), np.empty(round(SECONDS / h))
    for k in range(v.size):
        v[k], data.ctrl[0] = data.qvel[0], drive(k * h + ahead)
        friction.apply(data)
        mujoco.mj_step(model, data)
    return v


def driven(joint: ExportedJoint) -> Iterator[str]:
    """(b)."""
    for h in STEPS:
        times = np.asarray(h * np.arange(round(SECONDS / h)), dtype=np.float64)
        true = radau_continuous(joint, drive, times)
        held = np.append(0.0, radau_held(joint, np.array([drive(t) for t in times]), h)[:-1])
        begin, middle = (simulated(joint, h, ahead) for ahead in (0.0, h / 2))
        yield (
            f"  {1000 * h:g} ms: {rms_percent(begin, true):.2f} %; against the torque held {rms_percent(begin, held):.4f} %; "
            f"torque of the middle of each step {rms_percent(middle, true):.4f} %"
        )


def applied(joint: ExportedJoint, motion: StatedMotion) -> Array:
    """Torque of `Friction` over each step of the last period, N*m, driven so that the joint keeps to the motion."""
    model, time = model_of(joint, STEP), step_times(motion)
    data, friction, torque = mujoco.MjData(model), Friction(model, joint.name, joint), np.empty(time.size)
    sine = Sine(motion.amplitude, motion.frequency)
    for k, (v, after) in enumerate(zip(sine.at(time).velocity, sine.at(time + STEP).velocity, strict=True)):
        data.qvel[0] = v
        for _ in range(SOLVED):
            data.ctrl[0] = joint.inertia * (after - v) / STEP + friction.torque
            friction.apply(data)
        torque[k] = friction.torque
        mujoco.mj_step(model, data)
    return last_period(torque)


def over_steps(joint: ExportedJoint, motion: StatedMotion) -> Array:
    """The joint's mean torque over each time step of the last period, N*m."""
    time = STEP / 20 * np.arange(20 * step_times(motion).size + 1, dtype=np.float64)
    velocity = np.asarray(Sine(motion.amplitude, motion.frequency).at(np.asarray(time, dtype=np.float64)).velocity)
    torque = friction_of(joint)(velocity, STEP / 20)
    return last_period(((torque[1:] + torque[:-1]) / 2).reshape(-1, 20).mean(axis=1))


def fall_backs(joint: ExportedJoint) -> Iterator[str]:
    """(c)."""
    motions = all_motions(joint)
    models = {
        "frictionloss and damping": coulomb_viscous(*best_coulomb_viscous(joint, motions[0])),
        "symmetric LuGre and bias": best_symmetric(joint, motions).friction,
    }
    bent = np.mean([(p.alpha_0 + p.alpha_1) / p.sigma_0 for p in joint.pair])
    sines = [StatedMotion("", float(a), FREQUENCY) for a in (1.0, 0.1, 0.02, bent / 2)]
    yield f"  {'amplitude, rad':32}" + "".join(f"{x.amplitude:>9.3g}" for x in sines)
    artefact = mjcf.FRICTIONLOSS.write([joint], Request())
    compiled = mujoco.MjModel.from_xml_string(artefact.content.decode())
    played = (frictionloss_played(mujoco, compiled, joint, x) for x in sines)
    true = [at_steps(friction_of(joint), x) for x in sines]
    lost = {
        name: [rms_percent(at_steps(f, x), T) for x, T in zip(sines, true, strict=True)] for name, f in models.items()
    }
    soft = {"... as MuJoCo has both": [rms_percent(T, t) for T, t in zip(played, true, strict=True)]}
    first = dict(list(lost.items())[:1])
    for name, percents in (first | soft | lost).items():
        yield row(name, percents)
    yield row("bristle.mujoco.Friction", [rms_percent(applied(joint, x), over_steps(joint, x)) for x in sines], 2)


def row(name: str, percents: list[float], digits: int = 0) -> str:
    """One line of the table."""
    return f"  {name:32}" + "".join(f"{x:>7.{digits}f} %" for x in percents)


def time_of_step(joint: ExportedJoint) -> Iterator[str]:
    """(d)."""
    model = model_of(joint, 0.002)
    data, friction = mujoco.MjData(model), Friction(model, joint.name, joint)
    data.ctrl[0] = 0.2

    def run(*, with_friction: bool) -> float:
        """Nanoseconds a step."""
        begun = perf_counter_ns()
        for _ in range(CALLS):
            if with_friction:
                friction.apply(data)
            mujoco.mj_step(model, data)
        friction.reset()
        return (perf_counter_ns() - begun) / CALLS

    free, both = (min(run(with_friction=there) for _ in range(RUNS)) for there in (False, True))
    yield f"  mj_step {free:.0f} ns; with Friction {both:.0f} ns, of which apply takes {both - free:.0f} ns"


def main() -> None:
    """All parts."""
    joint = bristle.export(RESULTS, "json", joint=JOINT).joints[0]
    print(f"MuJoCo {mujoco.__version__}, {joint.name} of {RESULTS.parent.name}/{RESULTS.name}")
    parts = {
        "(a) one set, imposed at 2 ms: torque RMS error": implementation,
        "(b) both directions by Friction, driven for 10 s: velocity RMS error against Radau": driven,
        "(c) torque RMS error of the joint's friction": fall_backs,
        "(d) time of a step": time_of_step,
    }
    for title, part in parts.items():
        print(title)
        for line in part(joint):
            print(line, flush=True)


if __name__ == "__main__":
    main()
