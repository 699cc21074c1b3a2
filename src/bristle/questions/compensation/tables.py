"""The compensated joint as tables: each function makes one DataFrame, which the page shows and `tables/*.csv` holds."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from bristle.model.parameters import unit
from bristle.questions.compensation.ablation import AblationRow
from bristle.questions.compensation.parameter_studies import Controlled, Drift, Sampled
from bristle.questions.compensation.study import Study
from bristle.simulation.edro import TABLE_2_ADAPTED


def compensation_errors(study: Study) -> pd.DataFrame:
    """Fig. 8: RMS errors in rad (m), torques in N*m (N), and what LuGre feed-forward leaves of the error without it."""
    rows = [(*x, *(share / x.without for share in (x.true, x.identified, x.adaptive))) for x in study.errors]
    columns = [
        "joint", "frequency", "inertia_feed_forward", "without", "true_model", "identified_model", "adaptive", "torque_without",
        "torque_with", "true_share", "identified_share", "adaptive_share",
    ]  # fmt: skip  # a list of names
    return pd.DataFrame(rows, columns=columns)


def table_2(study: Study) -> pd.DataFrame:
    """Table 2: each adapted parameter under each law: the original value, and initial, early and final shares; the paper's beside it."""
    p, kind = study.adapting.model.positive, study.adapting.kind
    paper = TABLE_2_ADAPTED if study.paper else {}
    rows = [
        (x.law, x.parameter, getattr(p, x.parameter), unit(x.parameter, kind), x.initial, x.early, x.final, paper.get(x.parameter))
        for x in study.adapted.factors
    ]  # fmt: skip  # one row, one line
    columns = ["law", "parameter", "original", "unit", "initial", "at_4_s", "at_20_s", "paper"]
    return pd.DataFrame(rows, columns=columns).astype({"paper": float})


def adaptation_map(study: Study) -> pd.DataFrame:
    """Where adapted parameters end over rate, amplitude and frequency."""
    m, plan = study.adaptation_map, study.adapting
    top, f = max(plan.adaptation.gamma), m.frequencies.tolist()
    by_gamma = ([(g, plan.amplitude) for g in m.gammas.tolist()], m.by_gamma)
    by_amplitude = ([(top, a) for a in m.amplitudes.tolist()], m.by_amplitude)
    rows = [
        (name, *at, frequency, share)
        for places, shares in (by_gamma, by_amplitude)
        for name, of_name in zip(plan.adaptation.parameters, shares.tolist(), strict=True)
        for at, row in zip(places, of_name, strict=True)
        for frequency, share in zip(f, row, strict=True)
    ]
    return pd.DataFrame(rows, columns=["parameter", "gamma", "amplitude", "frequency", "adapted_share"])


def replay(study: Study) -> pd.DataFrame:
    """One row per replayed run and start: torque left unexplained without and with adaptation, percent, where the gains end, and the verdict."""
    rows = [(x.file, x.begun, x.adaptation.law, *x.relative_errors(), x.shares, str(x.verdict)) for x in study.replays]
    return pd.DataFrame(rows, columns=["file", "begun", "law", "gains_of_1", "adapted", "shares", "verdict"])


def all_tables(study: Study) -> dict[str, pd.DataFrame]:
    """Every table by the name of its file; errors and distances in rad (m), torques in N*m (N), periods in s, energy in J."""
    rows: dict[str, tuple[type[Any], Sequence[Any]]] = {
        "drift": (Drift, study.drifts), "ablation": (AblationRow, study.ablation),
        "controllers": (Controlled, study.controllers), "sampling": (Sampled, study.sampling),
    }  # fmt: skip  # a table
    frames = {maker.__name__: maker(study) for maker in (compensation_errors, table_2, adaptation_map)}
    frames |= {name: pd.DataFrame(own, columns=list(row._fields)) for name, (row, own) in rows.items()}
    return frames | ({"replay": replay(study)} if study.replays else {})
