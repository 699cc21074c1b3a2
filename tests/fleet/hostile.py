"""Findings of a simulated fleet with hostile names, of which some joints wore, some logs are clipped and some sessions failed."""

import numpy as np
import pandas as pd

from bristle.questions.fleet.findings import Findings, findings
from simulated_fleet import FleetDesign, fleet_estimates, fleet_truth

HOSTILE = "</script><img src=x onerror=\"document.title='run'\"><!-- {{ 7*7 }} \\u003c"
"""A unit's name that ends a script, loads an image and opens a comment."""
EXOTIC = "Zelle „Süd“ 'α' & <b>№ 7</b> 手首"  # a joint's name with quotes and letters of other scripts


def hostile_fleet(robots: int = 8, sessions: int = 8, failed: int = 3, worn: float = 0.2) -> Findings:
    """Two joints a robot; alpha_0 of the first joint of the first robot rises by half in its fifth session, and its log is clipped since.

    alpha_0 of the second joint of the second is twice that of its type.
    """
    rng = np.random.default_rng(1)
    design = FleetDesign(robots, 2, sessions, worn=worn, change=0.5)
    frame = fleet_estimates(design, fleet_truth(design, rng), rng)
    place = frame.groupby("unit", observed=True)["session"].rank("dense")
    own = (frame["unit"] == "robot-001") & (frame["joint"] == "J1")
    alpha_0 = frame["parameter"] == "alpha_0"
    rose = np.where(own & (place > 4) & alpha_0, 1.5, 1.0)
    rose = np.where((frame["unit"] == "robot-002") & (frame["joint"] == "J2") & alpha_0, 2.0, rose)
    names = {
        name: frame[name].astype(object).replace({"robot-001": HOSTILE, "J1": EXOTIC}) for name in ("unit", "joint")
    }
    frame = frame.assign(
        **names, **{name: rose * frame[name] for name in ("value", "standard_error", "lower", "upper")},
        file=names["unit"].str[-3:] + " ü.yaml", warnings=np.where(own & (place > 4), "clipped torque-drifts", "too-short"),
    )  # fmt: skip  # a list of values
    nothing = dict.fromkeys(
        ("parameter", "direction", "warnings", "severity", "value", "standard_error", "lower", "upper")
    )
    lost = frame.drop_duplicates(["unit", "joint"]).head(failed).assign(**nothing, file="=cut <off>.csv")
    lost = lost.assign(failure=[f"<i>file {k}</i>: ends in line 812; log it again" for k in range(len(lost))])
    whole = pd.concat([frame.astype(object), lost.astype(object)], ignore_index=True).infer_objects()
    return findings(whole.astype({"session": frame["session"].dtype}))
