"""Joints built by hand from simulated points, so that the report is tested without the pipeline."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bristle.data.constant_velocity.segments import Segment
from bristle.data.experiment.schema import FitOptions
from bristle.data.record import Record
from bristle.data.slow_loading import Loading, Loop
from bristle.findings import CAUTION, CRITICAL, NOTE, Finding
from bristle.identification.curve import curve
from bristle.identification.fits import Crosscheck, Estimate, HoldOut, Presliding, PreslidingFit, StaticFit
from bristle.identification.results import Input, Joint
from bristle.identification.static.fit import PointInfo, fit_static
from bristle.identification.static.problem import from_points
from bristle.model.functions import loading_displacement_function
from bristle.model.parameters import Direction, Lugre, ParameterName, unit
from bristle.model.vectorize import evaluate
from bristle.page.page import encoded
from bristle.page.report import Section
from bristle.page.said import with_places
from bristle.questions.joint_report import results_file
from bristle.questions.joint_report.report import report

NAMES = ("alpha_0", "alpha_1", "alpha_2", "v_s")
TABLE_1 = {
    "+": Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184),
    "-": Lugre(0.0148, 0.0040, 0.0307, 0.0720, 4.5356, 0.0146),
}
NOISE = 2e-4
FEW_BELOW = Finding("slowest-too-fast", CAUTION, "Only 2 of 14 points lie below v_s in direction +.")
AGREE = Finding("routes-agree", NOTE, "Grid and full nonlinear fit agree.", {"worst": 1e-7, "reached": 7, "starts": 8})
HOSTILE = """<script>alert("$x$")</script>&amp; 'q' $\\frac{$ --> ]]>"""


def write_report(joints: Sequence[Joint], folder: Path, *, title: str = "t") -> Path:
    """The report of joints, with results.json beside it; returns the path of index.html."""
    files = {"results.json": encoded(results_file.to_json(joints))}
    return report(joints, title=title, seed=0, files=files).write(folder)


def sections_of(joint: Joint, file: str) -> dict[str, Section]:
    """The sections of one page of a joint's report, by their titles; those without one by the title of their table."""
    (found,) = (page for page in report([joint], title="t", seed=0).pages if page.file == file)
    return {x.title or (x.table.title if x.table else ""): x for x in found.sections}


def listed(joint: Joint) -> dict[str, str]:
    """What each finding on the page of a joint is about, by its code and by its text."""
    every = [with_places(x.findings) for x in sections_of(joint, "joints.html").values()]
    return {key: where for own in every for where, x in own for key in (x.code, str(x))}


def fitted(direction: str, seed: int = 0) -> StaticFit:
    """The fit of one direction of Table 1's gripper, with one run held out."""
    sign = 1 if direction == "+" else -1
    v = sign * np.geomspace(0.015, 0.8, 14)
    torque = curve(v, TABLE_1[direction].stribeck) + NOISE * np.random.default_rng(seed).standard_normal(v.size)
    (fit,) = fit_static(from_points(v, torque, (direction,)), FitOptions(), "revolute", PointInfo())[0].values()
    bare = {name: replace(e, warnings=()) for name, e in fit.parameters.items()}
    return replace(
        fit, parameters=bare, warnings=(FEW_BELOW,) if direction == "+" else (), hold_out=(HoldOut(file="held.csv", relative_error=1.25),),
        time=np.arange(v.size, dtype=float), position=np.linspace(-1, 1, v.size),
    )  # fmt: skip  # as above


STICKS = Finding("stick-slip", CAUTION, "Stick-slip: it rests.", {"swing": 0.4})


def segments(fits: Mapping[str, StaticFit]) -> tuple[Segment, ...]:
    """The points as segments; one sticks and slips, one is rejected, one has no standard error."""
    kept = [
        Segment(
            file=f"run_{k}.csv", start=100, stop=900, velocity=float(v), torque=float(T), standard_error=NOISE if k else None,
            accepted=True, stick_slip=k == 1, warnings=(STICKS,) if k == 1 else (), labels={"load": "1 kg"},
        )
        for fit in fits.values()
        for k, (v, T) in enumerate(zip(fit.velocity, fit.torque, strict=True))
    ]  # fmt: skip  # one point, one line
    wild = Segment(
        file="wild.csv", start=0, stop=20, velocity=30.0, torque=2.0, standard_error=0.1, accepted=False,
        reasons=(Finding("too-short", NOTE, "Too short: 0.02 s; 0.2 s is required.", {"duration": 0.02}),),
    )  # fmt: skip  # as above
    return (*kept, wild)


def checked(fit: StaticFit) -> Crosscheck:
    """A cross-check that agrees."""
    values = {ParameterName(n, Direction(fit.direction)): e.value or 0.0 for n, e in fit.parameters.items()}
    return Crosscheck(
        parameters=values, difference_in_se=dict.fromkeys(values, 1e-7), verdict=AGREE,
    )  # fmt: skip  # as above


def gripper(name: str = "gripper rotation") -> Joint:
    fits = {d: fitted(d, seed) for seed, d in enumerate(("+", "-"))}
    found = segments(fits)
    sides = {"+": found[: fits["+"].n], "-": found[fits["+"].n : -1]}
    fits = {d: replace(fit, segments=sides[d]) for d, fit in fits.items()}
    notes = (Finding("rows-not-finite", CAUTION, "3 rows dropped.", {"rows": 3}),)
    run = Input(file="run_0.csv", sha256="ab" * 32, rows=1000, dropped=3, notes=notes, labels={"load": "1 kg"})
    return Joint(
        name=name, kind="revolute", inputs=(run,), segments=found, static=fits, crosscheck={d: checked(fit) for d, fit in fits.items()},
        truth=TABLE_1, simulated=True, assumptions=("Torque constant 0.35 N*m/A: the paper gives none.",), settings={"directions": "separate"},
    )  # fmt: skip  # as above


QUANTUM = 2e-4  # one count of the encoder that saw the loadings, rad
FEW = Finding("few-counts", CAUTION, "Few encoder counts: 60 edges in 3 loadings.")
PRIOR = Finding("prior", CAUTION, "An assumption, not an estimate: (15) with an assumed damping ratio of 0.1.")
UNKNOWN_REST = Finding("whole-count", NOTE, "Assumes that the joint moves a whole count to the first edge.")


def loading(direction: str, phase: float, file: str, breakaway: float | None = None) -> Loading:
    """Slow loading of Table 1's gripper without noise, from rest at `phase` of a count (0 is an edge), counted by the encoder."""
    p = TABLE_1[direction]
    g0 = p.alpha_0 + p.alpha_1
    T = np.linspace(0.0, 0.9 * g0, 1501)
    y = evaluate(loading_displacement_function(), T, g0, p.sigma_0)[0] + phase * QUANTUM
    edges = np.arange(1, np.floor(y[-1] / QUANTUM) + 1)
    return Loading(
        file=file, direction=direction, start=40, time=np.linspace(0.0, 15.0, T.size), displacement=QUANTUM * np.floor(y / QUANTUM), torque=T,
        quantum=QUANTUM, edge_displacement=(edges - 0.5) * QUANTUM, edge_torque=np.interp(edges * QUANTUM, y, T), breakaway=breakaway, held=0.9 * g0,
    )  # fmt: skip  # as above


def slow_fit(direction: str) -> PreslidingFit:
    """sigma_0 of one direction from three loadings, as if the edges had found the truth, and (14) half of it."""
    p, warnings = TABLE_1[direction], (UNKNOWN_REST,)
    s, half = p.sigma_0, p.sigma_0 / 2
    stiffness = Estimate(value=s, unit=unit("sigma_0"), standard_error=0.01 * s, interval=(0.98 * s, 1.02 * s))
    first = Estimate(value=half, unit=unit("sigma_0"), warnings=warnings)
    return PreslidingFit(
        direction=direction, printed=first, sigma_0=stiffness,
        sigma_1=Estimate(value=p.sigma_1, unit=unit("sigma_1"), warnings=(PRIOR,)),
        degrees_of_freedom=40.0, level=p.alpha_0 + p.alpha_1, level_standard_error=2e-4,
        level_source=Finding("of-static-fit", NOTE, "the static fit"),
        quantum=QUANTUM, counts=60,
        loadings=tuple(loading(direction, phase, f"slow_{k}.csv") for k, phase in enumerate((0.1, 0.45, 0.8))),
        warnings=(FEW,) if direction == "+" else (),
    )  # fmt: skip  # as above


def closed_cycle(file: str, loss: float = 3e-5) -> Loop:
    """An ellipse of torque over displacement with one slope in the middle, of which nothing depends on noise."""
    turn = np.linspace(0.0, 2 * np.pi, 401)
    return Loop(
        file=file, start=100, stop=500, position=0.002 * np.cos(turn - 0.6) + 0.3, torque=0.01 * np.cos(turn), loss=loss, torque_amplitude=0.01,
        displacement_amplitude=0.002, secant=5.0, slope=4.1, inverse_slope=6.1, counts=20,
    )  # fmt: skip  # as above


def loaded(name: str = "gripper rotation", file: str = "slow_2.csv") -> Joint:
    """The gripper with presliding runs in both directions, two of which break away, and four closed cycles."""
    torque = Estimate(value=0.025, unit=unit("torque"), standard_error=5e-4, interval=(0.024, 0.026))
    slow = Presliding(
        fits={d: slow_fit(d) for d in ("+", "-")},
        breakaway={"+": torque},
        breakaways=(loading("+", 0.3, file, 0.02), loading("+", 0.6, "slow_3.csv", 0.025)),
        loops=tuple(closed_cycle(file, loss) for loss in (3e-5, 4e-5, 5e-5, 6e-5)),
        warnings=(Finding("outlier", CAUTION, f"{file} is an outlier."),),
    )
    return replace(gripper(name), presliding=slow)


def only(joint: Joint, **changes: Any) -> Joint:
    """The joint with changes to what its presliding runs showed."""
    assert joint.presliding is not None
    return replace(joint, presliding=replace(joint.presliding, **changes))


def nothing_seen(direction: str = "+") -> PreslidingFit:
    """A fit of data without encoder counts in which the joint did not move: no sigma_0, but a lower bound."""
    noise = Finding("within-noise", CAUTION, "The displacement stays within the encoder's noise.", {"least": 12.5})
    no_damping = Finding("no-sigma-1", NOTE, "No estimate: (15) needs J and sigma_0, but there is no sigma_0.")
    bound = Estimate(value=None, unit="N*m/rad", interval=(12.5, float("inf")), warnings=(noise,))
    return replace(
        slow_fit(direction), printed=bound, sigma_0=bound,
        sigma_1=Estimate(value=None, unit="N*m*s/rad", warnings=(no_damping,)), quantum=0.0, counts=0, warnings=(),
    )  # fmt: skip  # a list of changes


def bare() -> Joint:
    """A prismatic joint of which nearly nothing is known: no value, no error, infinite bounds, nan."""
    warnings = (Finding("too-few-points", CRITICAL, "0 points for 2 linear parameters."),)
    missing = Estimate(value=None, unit="N", warnings=warnings)
    wide = Estimate(value=1.0, unit="N*s/m", standard_error=float("nan"), interval=(-float("inf"), float("inf")))
    nothing = StaticFit(
        direction="both", parameters={"alpha_0": missing, "alpha_1": missing, "alpha_2": wide, "v_s": replace(missing, unit="m/s")},
        rms=None, relative_error=None, n=0, outcome=Finding("static-too-few", CRITICAL, "Too few points."), warnings=warnings,
    )  # fmt: skip  # as above
    return Joint(name="slide", kind="prismatic", inputs=(), segments=(), static={"both": nothing}, crosscheck={})


@pytest.fixture(scope="session")
def joint() -> Joint:
    return gripper()


@pytest.fixture(scope="session")
def slow() -> Joint:
    return loaded()


@pytest.fixture(scope="session")
def slide() -> Joint:
    return bare()


@pytest.fixture(scope="session")
def record() -> Record:
    """A ramp run of 10 s."""
    t = np.linspace(0.0, 10.0, 1001)
    return Record(file="run_0.csv", time=t, velocity=np.where(t < 1, t, 1.0), torque=None, rows=1001)
