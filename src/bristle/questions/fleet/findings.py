"""Findings of a fleet: joints that changed, units that differ from their type, and the quality of the data over time.

A joint's p-value is Simes's over the step tests of its parameters and directions. Benjamini and Hochberg's procedure over
all joints says which changed, and within these, at the rate times the share of joints that changed, which parameters
(Benjamini and Bogomolov, 2014). docs/fleet.md has the rest of the method.
"""

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from bristle.errors import InputError
from bristle.estimation import levels
from bristle.estimation.covariance import student
from bristle.estimation.robust import variance_interval
from bristle.findings import CAUTION, NOTE, Finding, Severity
from bristle.model.parameters import Direction, ParameterName
from bristle.page.wording import counted
from bristle.questions.fleet import changes, quantities
from bristle.questions.fleet import quality as data_quality
from bristle.questions.fleet.quantities import COVARIATES, Adjusted, QuantityKey, Roster

_MOST = 10_000  # most sessions of one joint


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """Tables of findings; docs/fleet.md lists their columns."""

    headline: Finding
    notes: tuple[Finding, ...]
    joints: pd.DataFrame
    changes: pd.DataFrame
    series: pd.DataFrame
    types: pd.DataFrame
    units: pd.DataFrame
    quality: pd.DataFrame
    warned: pd.DataFrame
    failures: pd.DataFrame
    rate: float
    baseline: int
    simulated: bool

    @property
    def changed(self) -> int:
        """Joints that changed."""
        return int(self.joints["changed"].sum())


def checked(rate: float | None, baseline: int | None) -> tuple[float, int]:
    """Rate and baseline, or their levels. Raises InputError where one is out of range."""
    rate = levels.FALSE_DISCOVERIES if rate is None else rate
    baseline = levels.BASELINE if baseline is None else baseline
    if not 0 < rate < 1:
        raise InputError(f"rate: got {rate:g}; expected a false discovery rate between 0 and 1, as 0.05")
    if not 1 <= baseline <= _MOST:
        raise InputError(f"baseline: got {baseline}; expected 1 to {_MOST} sessions")
    return rate, baseline


def findings(frame: pd.DataFrame, rate: float | None = None, baseline: int | None = None) -> Findings:
    """Findings of a dataset, against the first `baseline` sessions of each joint. Raises InputError as `checked`."""
    rate, baseline = checked(rate, baseline)
    whole, frame = frame, quantities.named_rows(frame)
    people, said = quantities.roster(frame), list[Finding]()
    every = list(_quantities(frame, people, said))
    known = [x for x in every if x.tested]
    tests = [changes.step_tests(x, baseline) for x in known]
    decided = changes.decide(tests, len(people.table), rate)
    steps = changes.change_rows(tests, decided, frame)
    joints = changes.ranked(people, steps, decided)
    parts = np.split(decided.named, np.cumsum([x.which.size for x in tests], dtype=int))  # and an empty one at the end
    # Sessions of each joint of each quantity before a change that was named, or all.
    settled = [np.bincount(x.one.of.joint) for x in tests]
    for most, test, named in zip(settled, tests, parts, strict=False):
        most[test.which[named]] = test.steps.after[named]
    units = changes.unit_rows(known, settled, people, rate)
    # Warnings of a joint that changed that began within a session of the step.
    warned = data_quality.warned(frame, people)
    step = joints.loc[joints["changed"], "sessions_after"].reindex(warned.index)
    fresh = warned.loc[(warned["of"] - step).abs() <= 1, "code"].sort_values().groupby(level=0).agg(" ".join)
    outside = units.loc[units["outside"].astype(bool), ["unit", "joint"]].drop_duplicates()
    odd = set(zip(outside["unit"], outside["joint"], strict=True))
    why = np.where(
        joints["sessions"] <= baseline,
        f"fewer than {baseline + 1} sessions",
        "no parameter has values with errors in enough sessions of its type",
    )
    joints = joints.assign(
        new_warnings=fresh.reindex(joints.index).fillna(""),
        outside=[pair in odd for pair in zip(joints["unit"], joints["joint"], strict=True)],
        untested=np.where(joints["adjusted_p"].notna(), "", why),
    )
    own = ["unit", "joint", *steps.columns.drop("number")]
    steps = steps.join(people.table[["unit", "joint"]], on="number")[own]
    order = ["changed", "p", "unit", "joint"]
    steps = steps.sort_values(order, ascending=[False, True, True, True], ignore_index=True)
    return Findings(
        headline=headline(joints, rate), notes=notes(whole, every, people, joints, said, baseline),
        joints=joints.reset_index(drop=True)[list(_JOINTS)], changes=steps, series=_series(known, settled, frame),
        types=_types(known, settled), units=units, quality=data_quality.quality(frame),
        warned=warned.reset_index(drop=True), failures=data_quality.failures(whole), rate=rate, baseline=baseline,
        simulated=bool((frame["simulated"] == True).any()),  # noqa: E712  # where it is known
    )  # fmt: skip  # a list of values


_JOINTS = (
    "rank", "unit", "joint", "type", "sessions", "changed", "adjusted_p", "parameter", "direction", "percent", "percent_lower",
    "percent_upper", "since", "sessions_after", "new_warnings", "outside", "first", "latest", "file", "untested",
)  # fmt: skip  # a row


def _quantities(frame: pd.DataFrame, people: Roster, said: list[Finding]) -> Iterator[Adjusted]:
    """Each parameter and direction of each type; notes on values that are left out are added to `said`."""
    where = np.flatnonzero(people.usable)
    columns = [
        "parameter", "direction", "source", "value", "standard_error", "lower", "upper", "value_unit", *COVARIATES,
    ]  # fmt: skip  # a list of names
    used = frame.iloc[where][columns].reset_index(drop=True)
    used["joint"], used["type"] = people.joint[where], people.table["type"].to_numpy()[people.joint[where]]
    # Values of the fit from which most values of a joint's parameter come.
    series = ["joint", "parameter", "direction"]
    told = used[[*series, "source"]].astype(dict.fromkeys(("parameter", "direction", "source"), str))
    count_of = told.groupby([*series, "source"]).size().rename("count").reset_index()
    most_of = count_of.sort_values(["count", "source"], ascending=[False, True]).drop_duplicates(series)
    told = told.merge(most_of, on=series, how="left", suffixes=("", "_of_most"))
    same = (told["source"] == told["source_of_most"]).to_numpy()
    if not same.all():
        count = int((~same).sum())
        message = (
            f"{count} values come from another fit than most values of the same parameter of their joint, and are left out of the "
            "findings: two fits may differ without any change of the joint."
        )
        said.append(Finding("of-other-fits", NOTE, message, {"count": count}))
    found = []
    for key, rows in used[same].groupby(["type", "parameter", "direction"], observed=True, sort=True):
        units = rows["value_unit"].astype(str)
        (most, _), *others = Counter(units).most_common()
        for other, count in others:
            if not any(x.code == "mixed-value-units" and x.numbers["other"] == other for x in said):
                message = (
                    f"Type {key[0]} has values in {most} and in {other}; the {count} values in {other} are left out. "
                    "Give these joints a type of their own."
                )
                numbers = {"type": str(key[0]), "unit": most, "other": other, "count": count}
                said.append(Finding("mixed-value-units", CAUTION, message, numbers))
        at = rows.index.to_numpy()[(units == most).to_numpy()]
        one = quantities.quantity_of(QuantityKey(*map(str, key)), rows.loc[at], where[at], people)
        if one is not None:
            found.append(one)
    yield from (quantities.adjusted(one, len(found)) for one in found)


_TYPES = (
    dict.fromkeys(("type", "parameter", "direction", "value_unit"), "str") | dict.fromkeys(("joints", "sessions"), "int64")
    | dict.fromkeys((
        "mean", "mean_lower", "mean_upper", "spread_percent", "spread_lower", "spread_upper", "scatter_percent", "scatter_lower", "scatter_upper",
        "temperature_percent", "temperature_lower", "temperature_upper", "load_percent", "load_lower", "load_upper", "shift_percent", "shift_p",
    ), "float64")
)  # fmt: skip  # columns of the types, and their types


def _types(every: Sequence[Adjusted], settled: Sequence[NDArray[np.intp]]) -> pd.DataFrame:
    """A row per type, parameter and direction."""
    rows = []
    for one, most in zip(every, settled, strict=True):
        q, fit = one.of, one.fit
        low, high = variance_interval(fit.variance, float(np.median(one.known)), fit.freedom)
        shift = float(np.abs(q.percent(one.shift)).max()) if one.shift.size else np.nan
        row = {**q.key._asdict(), "value_unit": q.value_unit, "joints": q.now.sum(), "sessions": q.y.size}
        row |= _ends("scatter", 100 * np.sqrt(fit.variance), 100 * np.sqrt(low), 100 * np.sqrt(high))
        row |= {"shift_percent": shift, "shift_p": one.shift_p}
        for name in COVARIATES:
            row |= _ends(name, *one.effect(name))
        known = changes.population_of(one, most)
        if known is not None:
            reach = student(known.freedom) * known.mean_error
            typical = float(np.median(one.variance)) / max(float(np.median(most)), 1.0)
            low, high = variance_interval(known.variance, typical, known.freedom)
            middle = q.shown(np.array([known.mean, known.mean - reach, known.mean + reach]))
            row |= dict(zip(("mean", "mean_lower", "mean_upper"), middle.tolist(), strict=True))
            row |= _ends("spread", 100 * np.sqrt(known.variance), 100 * np.sqrt(low), 100 * np.sqrt(high))
        rows.append(row)
    return pd.DataFrame(rows, columns=list(_TYPES)).astype(_TYPES)


def _ends(name: str, percent: float, lower: float, upper: float) -> dict[str, float]:
    return {f"{name}_percent": percent, f"{name}_lower": lower, f"{name}_upper": upper}


def _series(every: Sequence[Adjusted], settled: Sequence[NDArray[np.intp]], frame: pd.DataFrame) -> pd.DataFrame:
    """A row per joint, parameter, direction and session, with the 95 % limits of one more session before a change."""
    names = ["unit", "joint", "parameter", "direction", "session", "value", "lower", "upper", "value_unit"]
    parts = [np.zeros((3, 0))]
    for one, most in zip(every, settled, strict=True):
        q = one.of
        mean, variance = changes.own_levels(one, most)
        reach = student(one.fit.freedom) * np.sqrt(variance[q.joint] + one.variance)
        reach = np.where(q.now[q.joint], reach, np.nan)
        parts.append(np.stack([q.shown(x) for x in (one.y, mean[q.joint] - reach, mean[q.joint] + reach)]))
    rows = np.concatenate([np.zeros(0, dtype=np.intp), *(one.of.rows for one in every)])
    level, low, high = np.concatenate(parts, axis=1)
    return frame.iloc[rows][names].assign(adjusted=level, limit_low=low, limit_high=high).reset_index(drop=True)


def headline(joints: pd.DataFrame, rate: float) -> Finding:
    """The number of joints that changed, and the clearest of them; `joints` are ranked."""
    tested, changed = joints["adjusted_p"].notna(), joints[joints["changed"]]
    if not tested.any():
        return Finding("fleet-untested", NOTE, "No joint was tested for a change; the notes say why.")
    numbers = {"changed": len(changed), "tested": int(tested.sum()), "rate": 100 * rate}
    at_rate = f"at a false discovery rate of {100 * rate:.3g} %"
    if changed.empty:
        message = f"None of {numbers['tested']} joints changed beyond the scatter between sessions, {at_rate}."
        return Finding("fleet-unchanged", NOTE, message, numbers)
    more = f"; {counted(len(changed) - 1, 'other')} changed as well" if len(changed) > 1 else ""
    message = f"{len(changed)} of {numbers['tested']} joints changed, {at_rate}; the clearest: {_step(changed.iloc[0])}{more}."
    return Finding("fleet-changed", NOTE, message, numbers)


def notes(
    frame: pd.DataFrame,
    every: Sequence[Adjusted],
    people: Roster,
    joints: pd.DataFrame,
    left_out: Sequence[Finding],
    baseline: int,
) -> tuple[Finding, ...]:
    """Notes on a dataset, its quantities and ranked joints, cautions first; `left_out`: those on values left out."""
    said = list(left_out)
    # Shifts common to a type, one sentence for all its parameters.
    shifted = [x for x in every if x.knots.size]
    for type_ in dict.fromkeys(x.of.key.type for x in shifted):
        own = [x for x in shifted if x.of.key.type == type_]
        names = tuple(str(ParameterName(x.of.key.parameter, Direction(x.of.key.direction))) for x in own)
        count = max(int(x.of.now.sum()) for x in own)
        percent = max((float(y) for x in own for y in x.of.percent(x.shift)), key=abs)
        logged = any("temperature" in x.of.names for x in own)
        cause = (
            "Temperature is already corrected for; look for a new lot of grease, new firmware or another torque constant."
            if logged
            else "Temperature is not in the catalog; log it, because it can cause this."
        )
        message = (
            f"{', '.join(names)} of all {count} joints of type {type_} shifted together, by up to {percent:+.2g} %: the cause is "
            f"common to the type. The shift is taken off, and no joint is accused of it. {cause}"
        )
        numbers = {"type": type_, "names": names, "joints": count, "percent": percent, "temperature_logged": logged}
        said.append(Finding("common-shift", CAUTION, message, numbers))

    warned = joints.loc[joints["changed"] & (joints["new_warnings"] != ""), "new_warnings"]
    if len(warned):
        codes = data_quality.most_common(code for x in warned for code in x.split())
        message = (
            f"{len(warned)} of the joints that changed have warnings since that they did not have before: {', '.join(codes)}. "
            "Look at their logs first; a failing sensor is not wear."
        )
        said.append(Finding("warned-since", CAUTION, message, {"count": len(warned), "codes": codes}))

    # Types whose scatter rests on few differences.
    few = [x for x in every if levels.TESTED_FREEDOM <= x.fit.freedom < levels.FEW_FREEDOM]
    for type_ in dict.fromkeys(x.of.key.type for x in few):
        count = max(int((x.of.joint[1:] == x.of.joint[:-1]).sum()) for x in few if x.of.key.type == type_)
        message = (
            f"The scatter between sessions of type {type_} rests on {count} pairs of successive sessions, so only large changes "
            "are told from it; more joints of the type, or more sessions, narrow it. bristle compare judges two sessions by "
            "their own errors."
        )
        said.append(Finding("scatter-of-few", CAUTION, message, {"type": type_, "count": count}))

    # Joints that are not tested, sessions without a result, and values that are left out.
    not_tested = joints[joints["untested"] != ""]
    if count := len(not_tested):
        short = int(not_tested["untested"].str.startswith("fewer").sum())
        why = [f"{short} without values in more than {baseline} sessions"] * (short > 0)
        if count > short:
            why.append(f"{count - short} whose type has too few repeated sessions to estimate the scatter between them")
        message = f"Not tested for a change: {counted(count, 'joint')}; {'; '.join(why)}."
        said.append(Finding("joints-untested", NOTE, message, {"count": count, "short": short}))
    keys = ["unit", "joint", "session"]
    if len(failed := frame[frame["failure"].notna()]):
        count, total, first = (*(len(x[keys].drop_duplicates()) for x in (failed, frame)), failed["failure"].iloc[0])
        message = f"{count} of {counted(total, 'joint session')} without a result; the first: {first}"
        said.append(Finding("sessions-failed", NOTE, message, {"failed": count, "total": total}))
    rows = frame[(frame["severity"] == "critical") & frame["value"].notna()]
    if len(rows):
        codes = data_quality.most_common(
            str(code) for code in data_quality.codes_of(rows)["code"] if data_quality.severity(code) == "critical"
        )
        message = f"{counted(len(rows), 'value')} with a critical warning left out of the findings; the commonest: {', '.join(codes)}."
        said.append(Finding("values-critical", NOTE, message, {"count": len(rows), "codes": codes}))

    # Joints with a new baseline, by a tag.
    anew = people.table[people.table["now"] & people.table.duplicated(["unit", "joint"], keep=False)]
    if len(anew):
        last = anew.sort_values("first", kind="stable").iloc[-1]
        message = (
            f"{counted(len(anew), 'joint')} began anew at a session tagged baseline; "
            f"the last: {last['unit']} {last['joint']} on {last['first']:%Y-%m-%d}."
        )
        said.append(Finding("baselines-begun", NOTE, message, {"count": len(anew)}))
    return tuple(sorted(said, key=lambda x: list(Severity).index(x.severity)))


def _step(row: "Mapping[Hashable, Any] | pd.Series[Any]") -> str:
    name = ParameterName(row["parameter"], Direction(row["direction"]))
    return f"{row['unit']} {row['joint']}, {name} by {row['percent']:+.3g} % since {row['since']:%Y-%m-%d}"
