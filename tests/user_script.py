"""What a user writes, with every call that `bristle` offers: `.ci/run` has its types checked, and a test runs it."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import bristle

LAW = bristle.Lugre(alpha_0=0.02, alpha_1=0.006, alpha_2=0.04, v_s=0.07, sigma_0=6.0, sigma_1=0.02)


def steep(v: Any, v_s: Any, n: Any) -> Any:
    """A Stribeck peak of the user's own."""
    return (1 + (v / v_s) ** 2) ** -n


STEEP = bristle.Peak(
    name="users", title="user's", shape=steep, reach=3.0,
    own=(bristle.OwnParameter(name="users_n", symbol="n", units=("1", "1"), searched=(0.5, 3.0)),),
)  # fmt: skip  # a list of values


def of_arrays() -> bristle.Fit:
    rng = np.random.default_rng(0)
    v = np.concatenate([np.geomspace(0.015, 0.8, 12), -np.geomspace(0.015, 0.8, 12)])
    T = bristle.friction(v, LAW) + 2e-5 * rng.standard_normal(v.size)
    points: bristle.Fit = bristle.fit(v, T, directions="symmetric")
    values: dict[str, float] = points.params
    interval: pd.DataFrame = points.conf_int(0.9, "covariance")
    assert values["alpha_0"] > 0
    assert set(interval.columns) == {"lower", "upper"}
    bristle.register_law(STEEP, compete=False)
    assert "users_n" in bristle.fit(v, T, directions="symmetric", law="users").params

    t = np.arange(0, 8, 0.002)
    motion = 0.6 * np.sin(2.0 * t) + 0.3 * np.sin(5.3 * t)
    position = np.concatenate([[0.0], np.cumsum((motion[1:] + motion[:-1]) / 2)]) * 0.002
    torque = bristle.simulate(motion, 0.002, LAW) + 1e-3 * np.gradient(motion, t)
    torque += 1e-4 * rng.standard_normal(t.size)
    found: pd.DataFrame = bristle.find_segments(t, position, torque)
    assert "accepted" in found.columns

    load = 0.02 * np.interp(t, [0, 2, 6, 8], [0, 1, -1, 0])
    bend = np.cumsum(np.diff(load, prepend=0.0) / (6.0 * (1 - np.abs(load) / 0.026)))
    slow: bristle.Fit = bristle.fit_presliding(t, bend, load, breakaway=points)
    whole: bristle.Fit = bristle.fit_dynamic(
        t, position, torque, priors=[points, slow], directions="symmetric", inertia="1e-3 +/- 1e-4 kg*m^2"
    )
    added: float = whole.compensator(gamma=10.0).step(0.002, reference=(0.0, 0.5), position=0.001)
    assert np.isfinite(added)
    return points


def of_files(folder: Path) -> bristle.Results:
    """Logs in, results and a report out, and the questions that follow."""
    v = np.concatenate([np.geomspace(0.015, 0.8, 12), -np.geomspace(0.015, 0.8, 12)])
    T = bristle.friction(v, LAW) + 2e-5 * np.random.default_rng(0).standard_normal(v.size)
    log, wrist = folder / "points.csv", folder / "wrist.yaml"
    pd.DataFrame({"v [rad/s]": v, "tau [Nm]": T}).to_csv(log, index=False)
    text, guessed = bristle.draft(log, told=bristle.Told())
    wrist.write_text(text, encoding="utf-8")
    said: str = bristle.complete(wrist)[1]
    assert guessed
    assert said
    assert bristle.inspect(wrist).runs[0].kind == "points"

    fresh: bristle.Results = bristle.identify(wrist)
    bristle.report(wrist, folder=folder / "report")
    results = bristle.read_results(folder / "report" / "results.json")
    frame: pd.DataFrame = results.to_frame()
    assert frame.equals(fresh.to_frame())
    assert str(results.warnings) == str(fresh.warnings)
    assert not any(change.changed for change in bristle.compare(fresh, folder / "report" / "results.json").changes)
    return results


def questions(results: bristle.Results) -> None:
    planned: str = bristle.plan(results, velocities=4).reference_csv()
    assert bristle.explore(results).joints == tuple(joint.name for joint in results.joints)
    handed: bristle.Export = bristle.export(results, "json")
    assert handed.content
    assert results.export("urdf").content
    checked: pd.DataFrame = bristle.validate(results, repetitions=20, starts=2).to_frame()
    assert planned
    assert len(checked)
    assert bristle.report_of(bristle.sensitivity(results, samples=0)).text()
    assert results.plot().get_xlabel()
    reason = ""
    try:
        bristle.adapt(results)
    except ValueError as error:
        reason = str(error)
    assert "sigma_0" in reason  # of which points alone tell nothing
    try:
        watched: bristle.Fleet = bristle.fleet("catalog.csv", rate=2.0)
        reason = str(watched.findings.headline)
    except ValueError as error:
        reason = str(error)
    assert "rate" in reason or "bristle[fleet]" in reason  # whose extra may not be installed


def main() -> None:
    of_arrays()
    with tempfile.TemporaryDirectory() as folder:
        questions(of_files(Path(folder)))


if __name__ == "__main__":
    main()
