"""What `bristle fleet` says of simulated fleets of estimates whose truth is known: `python benchmarks/fleet.py [FLEETS] [WORDS]` (default 100).

200 robots of six joints, eight sessions over a year; 10 % between robots, 3 % between sessions, errors of 0.5 to 2 %; 5 % of the joints
wear by a step of alpha_0 in both directions, from a session from the fourth on. Rates are means over the fleets in percent, with standard
errors: joints said to have changed that had not; worn joints found; parameters wrongly named. "All at once" is Benjamini and Hochberg's procedure
over all tests of a fleet, for comparison. "Wrong joints" are so many a fleet; a step is off by so many sessions. In an
"unlike" fleet alpha_0 of one joint is always higher: how often it is called outside its type, and how many others are.
WORDS: only the settings whose names have them, as `small`.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import NamedTuple

import numpy as np
import pandas as pd

import datasets_path  # noqa: F401
from bristle.estimation.multiple_tests import false_discovery
from bristle.questions.fleet.findings import Findings, findings
from bristle.workers import pin
from simulated_fleet import FleetDesign, FleetTruth, fleet_estimates, fleet_truth

SEED = 20
UNLIKE = ("robot-001", "J1")
"""The joint that is not like its type, where one is."""


class Setting(NamedTuple):
    """One simulated kind of fleet, and how it is judged."""

    name: str
    design: FleetDesign
    one: bool = False
    """Whether alpha_0 in direction + alone is known: one test a joint."""
    logged: bool = True
    """Whether temperature is in the catalog."""
    unlike: float = 0.0
    """By which alpha_0 of the first robot's first joint is above what was drawn for it, always."""


SETTINGS = (
    Setting("one test a joint, 15 %", FleetDesign(change=0.15), one=True),
    Setting("one test a joint, 20 %", FleetDesign(change=0.20), one=True),
    Setting("all tests, 15 %", FleetDesign(change=0.15)),
    Setting("all tests, 20 %", FleetDesign(change=0.20)),
    Setting("one test, 10 K, logged, 15 %", FleetDesign(change=0.15, swing=10.0), one=True),
    Setting("all tests, 10 K, logged, 15 %", FleetDesign(change=0.15, swing=10.0)),
    Setting("one test, 10 K, not logged, 15 %", FleetDesign(change=0.15, swing=10.0), one=True, logged=False),
    Setting("all tests, 10 K, not logged, 15 %", FleetDesign(change=0.15, swing=10.0), logged=False),
    Setting("all tests, 10 K, not logged, no wear", FleetDesign(worn=0.0, swing=10.0), logged=False),
    Setting("all tests, no wear", FleetDesign(worn=0.0)),
    *(
        Setting(
            f"small: {robots} robots, {joints} joints, {sessions} sessions, no wear",
            FleetDesign(robots, joints, sessions, worn=0.0),
        )
        for robots, joints, sessions in ((1, 1, 5), (1, 6, 8), (3, 2, 6), (12, 2, 6), (12, 2, 12), (40, 2, 4))
    ),
    *(
        Setting(
            f"few points: 12 robots, {freedom} degrees of freedom, sessions alike, no wear",
            FleetDesign(12, 2, 9, worn=0.0, scatter=0.0, errors=(0.005, 0.005), freedom=freedom),
        )
        for freedom in (2, 4, 10)
    ),
    *(
        Setting(
            f"unlike: one of {robots} robots by {100 * more:.0f} %", FleetDesign(robots, 2, 6, worn=0.0), unlike=more
        )
        for robots in (8, 15, 40, 200)
        for more in (0.0, 0.5)
    ),
)


class Score(NamedTuple):
    """What came of one fleet."""

    false: float
    """Share of the joints said to have changed that had not."""
    power: float
    """Share of the worn joints that were found; nan where none is."""
    tests_false: float
    """Share of the parameters said to have changed that had not."""
    plain_tests: float
    """The same by Benjamini and Hochberg's procedure over all tests of the fleet at once."""
    plain_false: float
    """Share of the joints that this would accuse wrongly."""
    plain_power: float
    """Share of the worn joints that it would find."""
    accused: float
    """Joints wrongly said to have changed."""
    shift: float
    """Whether a shift common to a type is named."""
    error: float
    """Of the place of the step, sessions, mean over the worn joints that were found."""
    unlike: float
    """Whether the first robot's first joint is outside its type."""
    outside: float
    """Other joints that are."""


def played(setting: Setting, seed: int) -> Score:
    """One fleet, simulated and judged."""
    rng = np.random.default_rng([SEED, seed])
    truth = fleet_truth(setting.design, rng)
    frame = fleet_estimates(setting.design, truth, rng)
    own = (frame["unit"] == UNLIKE[0]) & (frame["joint"] == UNLIKE[1]) & (frame["parameter"] == "alpha_0")
    for name in ("value", "standard_error", "lower", "upper"):
        frame[name] = frame[name].where(~own, (1 + setting.unlike) * frame[name])
    if setting.one:
        frame = frame[(frame["parameter"] == "alpha_0") & (frame["direction"] == "+")].reset_index(drop=True)
    if not setting.logged:
        frame = frame.assign(temperature=np.nan)
    return scored(findings(frame), truth)


def scored(found: Findings, truth: FleetTruth) -> Score:
    """The findings beside the truth."""
    robot, joint = np.nonzero(truth.worn)
    worn = {(f"robot-{r + 1:03d}", f"J{j + 1}"): int(truth.since[r, j]) for r, j in zip(robot, joint, strict=True)}
    said = found.joints[found.joints["changed"]]
    names = list(zip(said["unit"], said["joint"], strict=True))
    hits = [name for name in names if name in worn]
    tests = found.changes
    right = [pair in worn for pair in zip(tests["unit"], tests["joint"], strict=True)]
    real = np.array(right, dtype=bool) & (tests["parameter"] == "alpha_0").to_numpy()
    named = tests["changed"].to_numpy(bool)
    at_once = false_discovery(tests["p"].to_numpy(float)) <= found.rate
    accused = set(zip(tests["unit"][at_once], tests["joint"][at_once], strict=True))
    first = found.joints["sessions"] - found.joints["sessions_after"]
    outside = found.joints.loc[found.joints["outside"], ["unit", "joint"]]
    others = set(zip(outside["unit"], outside["joint"], strict=True)) - {UNLIKE}
    place = dict(zip(zip(found.joints["unit"], found.joints["joint"], strict=True), first, strict=True))
    return Score(
        false=(len(names) - len(hits)) / max(len(names), 1),
        power=len(hits) / len(worn) if worn else float("nan"),
        tests_false=float((named & ~real).sum() / max(named.sum(), 1)),
        plain_tests=float((at_once & ~real).sum() / max(at_once.sum(), 1)),
        plain_false=len(accused - worn.keys()) / max(len(accused), 1),
        plain_power=len(accused & worn.keys()) / len(worn) if worn else float("nan"),
        accused=len(names) - len(hits),
        shift=float(any(x.code == "common-shift" for x in found.notes)),
        error=float(np.mean([abs(place[x] - worn[x]) for x in hits])) if hits else float("nan"),
        unlike=float(len(others) < len(outside)),
        outside=len(others),
    )


def row(setting: Setting, scores: list[Score]) -> dict[str, str]:
    """The means over fleets, with standard errors."""
    table = pd.DataFrame(scores)
    mean, error = table.mean(), table.std() / np.sqrt(table.notna().sum())

    def percent(name: str) -> str:
        return "-" if np.isnan(mean[name]) else f"{100 * mean[name]:.1f} ± {100 * error[name]:.1f}"

    return {
        "fleet": setting.name, "false": percent("false"), "found": percent("power"), "false parameters": percent("tests_false"),
        "all at once: false tests": percent("plain_tests"), "false joints": percent("plain_false"), "found joints": percent("plain_power"),
        "wrong joints": f"{mean['accused']:.2f}", "fleets with one": f"{100 * (table['accused'] > 0).mean():.0f}",
        "shift named": f"{100 * mean['shift']:.0f}", "step off": f"{mean['error']:.2f}",
        "unlike found": percent("unlike"), "others outside": f"{mean['outside']:.2f}",
    }  # fmt: skip  # a table


def main(fleets: int, words: str = "") -> None:
    """Print the table of the settings whose names have some words."""
    settings = [x for x in SETTINGS if words in x.name]
    print(
        f"{fleets} simulated fleets each, seeds {SEED}, 0 to {fleets - 1}; false discovery rate asked: 5 %", flush=True
    )
    pin()  # for processes that load NumPy anew: one thread each
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        rows = [row(setting, list(pool.map(partial(played, setting), range(fleets)))) for setting in settings]
    print(pd.DataFrame(rows).to_string(index=False))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100, *sys.argv[2:3])
