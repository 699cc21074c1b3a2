"""What a new user gets from logs of real drives, and from logs that once failed: `python benchmarks/drives.py [NAME ...]`.

    BRISTLE_DATA=FOLDER python benchmarks/drives.py emps staubli --csv drives.csv

With `--page docs` the public logs are written up, well known or not, in docs/drives.md, a small figure for each.

Needs the folder of measured data that the tests use, named by BRISTLE_DATA, and beside it `../cases/logs`; both have a
README on each set. Nothing is written there: each entry gets a temporary folder with links to its logs. The logs are
drafted by `bristle.draft` (`bristle new`) with no more than a user must tell, or come with an experiment file, and are
identified with default settings. A held-out log is added to the draft afterwards, so that it has no part in it. Where
torque, voltage or columns must be computed first, a function here does it. `kinova_gen3_joint7/breakaway.csv` is no log
and has no entry. Beside each result stands what is right: published values, or what the READMEs say; numbers without a
name are Coulomb friction, then viscous friction, in SI.
"""

import argparse
import os
import re
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import bristle
from bristle.errors import InputError
from bristle.identification.curve import known_curve
from bristle.identification.known_joint import chosen, value_fits
from bristle.identification.results import Joint
from bristle.identification.verdict import verdict
from bristle.page.plain import interval, pair
from bristle.page.wording import axis, number

CASES = "../cases/logs/"
PUBLIC = {
    "emps": (
        "A prismatic drive with a ball screw",
        "EMPS, A. Janot, M. Gautier and M. Brunot, 2019, a public benchmark",
    ),
    "kinova_gen3_joint7": ("A robot's wrist at constant velocities", "Kinova Gen3, public without a licence"),
    "servo_lugre": ("A servo motor, the whole LuGre protocol", "public without a licence"),
    "arm_static": ("Velocity-torque points of two joints of an arm", "public without a licence"),
    "ur10e": ("A six-axis arm, all joints moving", "UR10e, public without a licence"),
    "bam_xl330": ("A small servo that swings a weight", "XL330, BAM of Rhoban, Apache-2.0"),
    "go2": ("A leg of a quadruped, commands alone", "sim2real-robot-identification of iit-DLSLab, BSD-3-Clause"),
    "staubli_tx40": ("Two axes of an industrial arm", "TX40, figaroh-plus, Apache-2.0"),
    "double_pendulum": ("Two direct drives", "double_pendulum of DFKI, BSD-3-Clause"),
    "so101": ("A hobby arm whose torque has no sign", "SAGE, Apache-2.0"),
}
"""Sets that others published, by the beginning of an entry's name: what they are, and whence."""
PRINTED = ("alpha_", "v_s", "sigma_0", "inertia", "gravity", "offset", "quadratic", "torque_constant")
"""Parameters whose names begin so."""
Prepared = Callable[[pd.DataFrame], pd.DataFrame]
"""A log with the columns that a user must compute first."""


class Entry(NamedTuple):
    """One set of logs, how it is described to bristle, and what is right."""

    name: str
    logs: str
    """Names and patterns, relative to the folder of data; a YAML file is taken as it is, with what lies beside it."""
    right: str
    told: str = ""
    """What `bristle new` must be told, as `signal=column,unit,scale` and `rate=1kHz`."""
    held_out: str = ""
    prepared: Prepared | None = None
    edited: Callable[[str], str] | None = None
    """What the user changes in the experiment file."""


def with_voltage(log: pd.DataFrame) -> pd.DataFrame:
    """The motor's voltage, supply * pwm / 885."""
    return log[["time", "position", "speed"]].assign(voltage=log.input_volts * log.pwm / 885)


def with_constants(text: str) -> str:
    """The published torque constants of the six-axis arm in place of free ones."""
    for constant in (10, 10.70, 8.46, 9.00, 9.48, 10.12):
        text = text.replace("torque_constant: free", f"torque_constant: {constant} N*m/A", 1)
    return text


def with_gravity(text: str) -> str:
    """The regressors, named by a user who knows that the joint has gravity."""
    return text + "\nfit: {regressors: [inertia, gravity]}\n"


SERVO = "position=0,rad velocity=1,rad/s torque=4,N*m rate=1kHz"
SERVO_RIGHT = "J 1.97e-4, Coulomb 0.031, viscous 2.5e-4, offset -0.0035, 2.2 %"
ARM = "ur10e/ur10e.urdf ur10e/trajectory_12_harmonics.csv ur10e/trajectory_8_harmonics.csv"
ARM_TOLD = "time=0 position=1-6 velocity=7-12 current=13-18"
ARM_RIGHT = """published viscous / Coulomb 21.3/12.5, 20.2/13.3, 10.4/5.0, 3.6/2.0, 2.5/2.7, 3.0/2.3; held-out errors 12.4, 9.2,
4.8, 13.6, 21.1, 14.9 %; torque constants 10.5, 11.6, 8.2, 7.6, -, -; no sigma_0, no sigma_1"""
LEG = """time=time,s position=q_FL_{0},rad velocity=dq_FL_{0},rad/s command=q_des_FL_{0},rad velocity_command=dq_des_FL_{0},rad/s
    kp={1}N*m/rad kd={2}N*m*s/rad"""
AXIS_1 = f"position=q1_motor,rad,{1 / 32} torque=i1,N*m,32 rate=2.5kHz"
AXIS_4 = f"position=q4_motor,rad,{-1 / 48} torque=i4,N*m,-48 rate=2.5kHz"
PENDULUM = "time=time,s position=pos_meas{0},rad velocity=vel_meas{0},rad/s torque=tau_meas{0},N*m"
PENDULUM_LOGS = ("double_pendulum/trajectory_00.csv", "double_pendulum/trajectory_03.csv")
BAM = "time=time,s position=position,rad velocity=speed,rad/s voltage=voltage,V torque_constant=0.3867N*m/A resistance=4.017ohm"
GRAVITY_SIM = "1.31 +/- 0.01, 0.01 +/- 0.07, 1.815 +/- 0.02; true 1.3, 0.05, 1.83"
GRAVITY_JOINT1 = "+ 13 to 14.7, - 11.6 to 13; gravity 39 (owner 38.5); the order of the files must not matter"
CART = f"time=0,s current=1,A position=2,m velocity=3,m/s torque_constant={0.0934 / 0.028}N/A"
ENTRIES = (
    Entry("emps", "emps/DATA_EMPS.mat", """published M 95.11, viscous 203.5, Coulomb 20.39, offset -3.17, 4.08 %, held out
        5.98 %; per direction M 95.15, viscous 166.7 / 240.4, Coulomb 20.14 / 20.63, 3.11 %, held out 4.96 %; no Stribeck peak""",
        "time=t,s position=qm,m torque=vir,V,35.15N/V", "emps/DATA_EMPS_PULSES.mat"),
    Entry("kinova_gen3_joint7", "kinova_gen3_joint7/velocity_*.csv", "1.326, alpha_1 0.198, v_s 0.092, viscous 0.754; wide; one direction",
        "position=1,rad velocity=2,rad/s current=5,A rate=999Hz torque_constant=7.6N*m/A"),
    Entry("servo_lugre J", "servo_lugre/J_*.txt", SERVO_RIGHT, SERVO),
    Entry("servo_lugre Fs", "servo_lugre/Fs_*.txt", "breakaway 0.0145, 0.0228, 0.0250; published 0.0230", SERVO),
    Entry("servo_lugre sigma0", "servo_lugre/sigma0_*.txt",
        "stiffness 5.0 to 5.3 (regression), 6.4 (secant), 8.0 (inverse regression); published 1.387; no Coulomb friction", SERVO),
    Entry("servo_lugre all", "servo_lugre/*.txt", f"{SERVO_RIGHT}; sigma_0 5 to 8", SERVO),
    Entry("arm_static joint 1", "arm_static/joint_1.csv",
        "+ without a stray: alpha_1 3.6 +/- 0.1, v_s 0.042, 0.7 %; - has a stray at 5.0e-4 rad/s", "velocity=velocity,rad/s torque=torque,N*m"),
    Entry("arm_static joint 3", "arm_static/joint_3.csv",
        "strays near 0.007 and 0.02 rad/s; without them a Stribeck peak, rms 0.034 / 0.023", "velocity=velocity,rad/s torque=torque,N*m"),
    Entry("ur10e joint 2 alone", "ur10e/joint_2_alone.csv", "published 13.3 / viscous 20.2; gravity large; no sigma_0, no sigma_1",
        "time=0,s position=2,rad velocity=8,rad/s current=14,A torque_constant=10.70N*m/A"),
    Entry("ur10e robot", ARM, ARM_RIGHT, ARM_TOLD, edited=with_constants),
    Entry("ur10e robot, free constants", ARM, ARM_RIGHT, ARM_TOLD),
    Entry("bam_xl330", "bam_xl330/kp400_*.csv", """friction rises with load: held-out error 29 % without a load term, 10 to 13 % with
        the right one; armature 0.0018; gravity 0.48""", BAM, "bam_xl330/kp100_*.csv", with_voltage),
    Entry("go2 hip", "go2/motion_0.csv", """0.171 +/- 0.004, viscous 0.231 +/- 0.007, inertia 0.028, held out 5.3 %; with a delay of
        10 ms 0.163, 0.246, 0.025, 4.2 %""", LEG.format("hip", 20, 1), "go2/motion_1.csv"),
    Entry("go2 thigh", "go2/motion_0.csv", "no reference", LEG.format("thigh", 20, 1), "go2/motion_1.csv"),
    Entry("go2 calf", "go2/motion_0.csv", "held out 11.8 %; with a delay of 10 ms 0.627, 0.528, inertia 0.044, 8.5 %",
        LEG.format("calf", 40, 2), "go2/motion_1.csv"),
    Entry("staubli_tx40 axis 1", "staubli_tx40/motion.csv",
        "published 6.97 / 8.11, inertia 1.24; or 6.8 +/- 0.6, 8.2 +/- 0.4, 1.11 +/- 0.06, held out 16 %", AXIS_1),
    Entry("staubli_tx40 axis 4", "staubli_tx40/motion.csv", "2.3 +/- 0.1, 1.5 +/- 0.06", AXIS_4),
    Entry("double_pendulum 1", PENDULUM_LOGS[0], "published 0.093; carries joint 2, 88 %: to be refused", PENDULUM.format(1), PENDULUM_LOGS[1]),
    Entry("double_pendulum 2", PENDULUM_LOGS[0], "published 0.078; 0.104 +/- 0.007, held out 34 %, from the other joint",
        PENDULUM.format(2), PENDULUM_LOGS[1]),
    Entry("so101 as logged", "so101/triangle_wave_state_motor.csv", "lists in cells: say how to name a joint",
        "position=positions,rad velocity=velocities,rad/s torque=torques,N*m"),
    Entry("so101 joint 5", "so101/triangle_wave_state_motor.csv", "the torque is a magnitude, in steps of 0.0228: say that it has no sign",
        "time=timestamp,us position=positions[4],rad velocity=velocities[4],rad/s torque=torques[4],N*m"),
    Entry("gravity_sim drafted", f"{CASES}gravity_sim/*.csv", GRAVITY_SIM),
    Entry("gravity_sim gs.yaml", f"{CASES}gs.yaml", GRAVITY_SIM),
    Entry("gravity_sim with regressors", f"{CASES}gs.yaml", GRAVITY_SIM, edited=with_gravity),
    Entry("gravity_sim, decimation 1", f"{CASES}gravity_sim_decimation1.yaml", GRAVITY_SIM),
    Entry("gravity_joint1 drafted", f"{CASES}gravity_joint1/*.csv", GRAVITY_JOINT1),
    Entry("gravity_joint1 in another order", f"{CASES}gravity_joint1/q1_p*.csv {CASES}gravity_joint1/q1_m*.csv", GRAVITY_JOINT1),
    Entry("gravity_joint1 gj.yaml", f"{CASES}gj.yaml", GRAVITY_JOINT1),
    Entry("gravity_joint1, decimation 1", f"{CASES}gravity_joint1_decimation1.yaml", GRAVITY_JOINT1),
    Entry("gravity_joint", f"{CASES}gravity_joint/*.csv", "about 1.8 to 2.3; gravity 1.8 to 2.8; wide errors"),
    Entry("relay_cart", f"{CASES}relay_cart.csv",
        "0.4 to 2 / 3.2 to 4.3 N, inertia 6.3 to 6.6: an offset or unequal friction, the data cannot tell which", CART),
    Entry("offset_one_speed", f"{CASES}offset_one_speed.csv", "friction 6.7 N at 12.5 mm/s, split unknown; offset 53"),
    Entry("offset_one_speed_nogap", f"{CASES}offset_one_speed_nogap.csv", "friction 6.7 N at 12.5 mm/s, split unknown; offset 53"),
    Entry("offset_one_speed_nogap on.yaml", f"{CASES}on.yaml", "friction 6.7 N at 12.5 mm/s, split unknown; offset 53"),
    Entry("presliding_real", f"{CASES}presliding_real.csv", "below breakaway (10.75): a bound, a stiffness, no Coulomb friction"),
    Entry("presliding_sine", f"{CASES}presliding_sine.csv", "below breakaway: a bound, a stiffness of 40000, no Coulomb friction"),
    Entry("resting_lsb", f"{CASES}resting_lsb.csv", "0.3105 +/- 0.0012, 0.34", "time=t,s position=q,rad velocity=dq,rad/s torque=tau,N*m"),
    Entry("makkar", f"{CASES}makkar.csv", "says: below 0.01 rad/s the torque falls towards 0, as a regularised law does"),
    Entry("points_20_to_10N", f"{CASES}points.yaml", "use; exact points of 5 / 15 / 35 / 0.07"),
    Entry("lugre_exact_noise_free", f"{CASES}lugre_exact_noise_free.csv", "use; exact", "time=t,s position=q,rad torque=tau,N*m"),
    Entry("step_test_volts", f"{CASES}step_test_volts.csv", "0.19 / 2.35 / 0.30 V (delay -10 ms); a step is no clipping"),
    Entry("step_test_volts as torque", f"{CASES}step_test_volts.csv", "0.19 / 2.35 / 0.30 V (delay -10 ms); a step is no clipping",
        "time=timestamp,s position=position,rad velocity=velocity,rad/s torque=voltage,N*m"),
    Entry("one_direction_stroke", f"{CASES}one_direction_stroke.mat", "only the sum is known: 14.5 + 54 v after a delay of 3 ms",
        "time=t,s velocity=v,m/s torque=F,N"),
    Entry("speed_in_1_per_min", f"{CASES}speed_in_1_per_min.csv", "read the unit of the header"),
    Entry("speed_in_1_per_min, columns told", f"{CASES}speed_in_1_per_min.csv", "read the unit of the header", "velocity=0 torque=1"),
    Entry("with_object", f"{CASES}with_object.mat", "read its arrays", "time=t,s position=q,rad torque=tau,N*m"),
    Entry("coarse-torque-ramp", f"{CASES}coarse-torque-ramp/x.yaml", "few levels of torque: wide, or refused"),
    Entry("wear-in-shuffled-speeds", f"{CASES}wear-in-shuffled-speeds/x.yaml", "drift over time named, with its size, 30 %; 0.8, 0.35, 0.6, 0.05"),
    Entry("short-holds x.yaml", f"{CASES}short-holds/x.yaml", "ramps, or motion; sigma_0 1000"),
    Entry("short-holds drafted", f"{CASES}short-holds/velocity.csv", "ramps, or motion; sigma_0 1000"),
    Entry("huge-horizon x.yaml", f"{CASES}huge-horizon/x.yaml", "one sentence"),
    Entry("huge-horizon h.yaml", f"{CASES}huge-horizon/h.yaml", "one sentence, or a result"),
    Entry("enabled-delay", f"{CASES}enabled-delay/x.yaml", "one sentence"),
)  # fmt: skip  # a table


def main() -> None:
    """Run the entries asked for; print what each gives."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="only entries whose name contains one of these")
    parser.add_argument("--csv", type=Path)
    parser.add_argument("--page", type=Path, metavar="DOCS", help="write drives.md and its figures into this folder")
    asked = parser.parse_args()
    if "BRISTLE_DATA" not in os.environ:
        parser.error("BRISTLE_DATA is not set; it names the folder of measured data")
    data, rows = Path(os.environ["BRISTLE_DATA"]).resolve(), list[dict[str, Any]]()
    for entry in (x for x in ENTRIES if not asked.names or any(name in x.name for name in asked.names)):
        for row in results(entry, data):
            rows.append(row)
            errors = f"hold-out {row['hold-out']}, in the fit {row['in the fit']}; {row['seconds']:.1f} s"
            print(f"{row['entry']}: {row['verdict']}; {errors}")
            for what in ("draft", "values", "reason", "right"):
                print(fill(f"{what}: {row[what]}", 118, initial_indent="    ", subsequent_indent="      "))
        print(flush=True)
        if asked.csv is not None:
            pd.DataFrame(rows).drop(columns="joint").to_csv(asked.csv, index=False)
    if asked.page is not None:
        write_page(rows, asked.page)
    ends = Counter(row["verdict"].partition(" [")[0] for row in rows)
    print(*(f"{what}: {n}" for what, n in ends.items()), f"{sum(row['seconds'] for row in rows):.0f} s", sep=", ")


def results(entry: Entry, data: Path) -> Iterator[dict[str, Any]]:
    """A row for each joint of an entry, or for its bad end."""
    row: dict[str, Any] = dict.fromkeys(
        ("entry", "verdict", "hold-out", "in the fit", "seconds", "draft", "values", "reason"), "-"
    )
    row |= {"entry": entry.name, "right": " ".join(entry.right.split()), "joint": None}
    began = time.process_time()
    with tempfile.TemporaryDirectory() as place:
        try:
            text = experiment(entry, data, Path(place))
            runs = Counter(re.findall(r"^  - \{.*experiment: (\w+(?:, hold_out)?)", text, re.M))
            fit = [line.partition("#")[0] for line in re.findall(r"^fit:.*", text, re.M)]
            row["draft"] = "; ".join([*(f"{n} {kind}" for kind, n in runs.items()), *fit])
            joints = bristle.identify(Path(place) / "experiment.yaml").joints
        except Exception as end:  # noqa: BLE001  # a defect is a row too
            what = "refused" if isinstance(end, InputError) else f"a defect, {type(end).__name__}"
            reason = str(end).replace(f"{place}{os.sep}", "")
            yield {**row, "verdict": what, "reason": reason, "seconds": time.process_time() - began}
            return
    seconds = (time.process_time() - began) / len(joints)
    for joint in joints:
        name = f"{entry.name} {joint.name}" if len(joints) > 1 else entry.name
        yield {**row, **of_joint(joint), "entry": name, "seconds": seconds, "joint": joint}


def write_page(rows: Sequence[dict[str, Any]], docs: Path) -> None:
    """`drives.md` of the public logs, and a figure of each friction curve with its band beside it, in `_static/drives`."""
    figures = docs / "_static" / "drives"
    figures.mkdir(parents=True, exist_ok=True)
    lines = [OPENING]
    for begins, (what, whence) in PUBLIC.items():
        own = [x for x in rows if x["entry"].startswith(begins)]
        lines += [f"## {what}", "", f"{whence[:1].upper()}{whence[1:]}.", "", HEADINGS]
        for row in own:
            found = re.findall(r"(\w+[+-]?) (\S+) \+/- (\S+) ", row["values"])
            cells = [", ".join(f"{v}±{e}" for n, v, e in found if n.startswith(stem)) or "–" for stem in SHOWN]
            joint = row["joint"]
            band = "–" if joint is None or joint.accuracy is None else f"±{number(joint.accuracy.band, 2)} %"
            fitted = "–" if row["in the fit"] == "-" else f"{row['in the fit']} in the fit"
            left = fitted if row["hold-out"] == "-" else row["hold-out"]
            says, seconds = row["verdict"].partition(" [")[0], f"{row['seconds']:.1f}"
            lines.append(f"| {' | '.join((row['entry'], says, band, *cells, left, seconds))} |")
        lines.append("")
        for row in own:
            stem = re.sub("[^a-z0-9]+", "-", row["entry"].lower()).strip("-")
            if row["joint"] is not None and drawn(row["joint"], figures / f"{stem}.svg"):
                lines.append(f"![{row['entry']}](_static/drives/{stem}.svg)")
        lines.append("")
        rights = dict.fromkeys(in_markdown(row["right"]) for row in own)
        lines.append(
            fill(f"- Right, as published or by least squares: {'; '.join(rights)}.", 118, subsequent_indent="  ")
        )
        for row in own:
            if row["reason"] not in ("none", "-"):
                why = re.split(r"(?<=[a-z)%])[.;:] ", in_markdown(row["reason"]))[0]
                lines.append(fill(f"- {row['entry']}: {why.rstrip('.')}.", 118, subsequent_indent="  "))
        lines.append("")
    (docs / "drives.md").write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


SHOWN = ("alpha_0", "alpha_2", "inertia")
HEADINGS = "| log | verdict | friction to | alpha_0 | alpha_2 | inertia | left of the torque | s |\n|---|---|---|---|---|---|---|---|"
OPENING = """<!-- written by: python benchmarks/drives.py --page docs -->
# What does bristle give on real drives?

Every public log that we have, as a new user has it: drafted by `bristle new` with no more than a user must tell,
identified by default settings, good or bad. What the owners published, or plain least squares gave, stands beside it.
Measured data are not part of bristle; where they are there,
`BRISTLE_DATA=FOLDER python benchmarks/drives.py --page docs` writes this page anew. Figures show the friction that was
identified, and its 95 % band, over the speeds that were measured. Values are in SI, with one standard error; "left" is
what the model leaves of a held-out torque, or of the fitted one.
"""


def in_markdown(text: str) -> str:
    """A text with what Markdown would take for its own marks as it is."""
    return re.sub(r"([*_<\[\]])", r"\\\1", text)


def drawn(joint: Joint, path: Path) -> bool:
    """A small figure of the joint's friction vs velocity with its band; whether there is one."""
    known = joint.accuracy
    if known is None:
        return False
    speeds = (
        np.linspace(known.slowest, known.fastest, 100) if known.fastest > known.slowest else np.array([known.slowest])
    )
    v = np.concatenate([-speeds[::-1], speeds])
    friction, half = known_curve(joint, v)
    if not np.isfinite(friction).any():
        return False
    with mpl.rc_context({"svg.hashsalt": path.stem, "svg.fonttype": "none", "font.size": 8}):
        figure = Figure(figsize=(3.4, 1.9), layout="constrained")
        ax = figure.subplots()
        for side in (v < 0, v > 0):
            mark = "-" if speeds.size > 1 else "o"
            ax.plot(v[side], friction[side], mark, color="C0", markersize=3)
            ax.fill_between(
                v[side], (friction - half)[side], (friction + half)[side], color="C0", alpha=0.25, linewidth=0
            )
        ax.axhline(0, color="0.6", linewidth=0.6)
        ax.set_xlabel(axis("velocity", joint.kind))
        ax.set_ylabel(axis("torque", joint.kind, "friction"))
        figure.savefig(path, metadata={"Date": None, "Creator": None})
    return True


def experiment(entry: Entry, data: Path, place: Path) -> str:
    """The text of the experiment file, which is written into `place` beside links to the logs."""

    def put(patterns: str) -> list[Path]:
        """The logs that match, linked, or with the columns that must be computed."""
        found = [log for x in patterns.split() for log in sorted((data / x).parent.glob(Path(x).name))]
        for log in found:
            if entry.prepared is None:
                (place / log.name).symlink_to(log)
            else:
                entry.prepared(pd.read_csv(log)).to_csv(place / log.name, index=False)
        if not found:
            raise InputError(f"{patterns}: not in the folder of data")
        return [place / log.name for log in found]

    if entry.logs.endswith(".yaml"):
        put(f"{Path(entry.logs).parent}/*")
        text = (data / entry.logs).read_text(encoding="utf-8")
    else:
        words = dict(word.split("=", 1) for word in entry.told.split())
        more: dict[str, Any] = {
            name: words.pop(name) for name in ("rate", "torque_constant", "resistance", "kp", "kd") if name in words
        }
        parts = {signal: [*word.split(","), "", ""][:3] for signal, word in words.items()}
        columns, units, scales = ({signal: x[k] for signal, x in parts.items() if x[k]} for k in range(3))
        told = bristle.Told(columns=columns, units=units, scales=scales, **more)
        text, _ = bristle.draft(*put(entry.logs), told=told, folder=place)
    if entry.held_out:
        last, kind = re.findall(r"^(  - \{files: .*experiment: (\w+).*)$", text, re.M)[-1]
        lines = [f'  - {{files: "{log.name}", experiment: {kind}, hold_out: true}}' for log in put(entry.held_out)]
        text = text.replace(last, "\n".join([last, *lines]))
    text = text if entry.edited is None else entry.edited(text)
    (place / "experiment.yaml").write_text(text, encoding="utf-8")
    return text


def of_joint(joint: Joint) -> dict[str, str]:
    """Verdict, first reason, errors, and the values to use with their standard errors and 95 % intervals."""
    found, fits, values = verdict(joint), value_fits(joint), []
    for _, name, e in chosen(joint):
        if str(name).startswith(PRINTED):
            error = float(np.hypot(e.standard_error or np.nan, e.systematic or 0))
            value = "not identifiable" if e.value is None else f"{pair(e.value, error)} {e.unit}"
            values.append(f"{name} {value}" + (f" {interval(e.interval)}" if e.interval else ""))
    held = [f"{x.relative_error:.3g} %" for fit in fits for x in fit.hold_out]
    fitted = [f"{fit.relative_error:.3g} %" for fit in fits if fit.relative_error is not None]
    return {
        "verdict": f"{found.trust}" + (f" [{found.reason.code}]" if found.reason else ""),
        "hold-out": " ".join(held) or "-",
        "in the fit": " ".join(fitted) or "-",
        "values": "; ".join(values) or "none",
        "reason": str(found.reason or "none"),
    }


if __name__ == "__main__":
    main()
