"""The servo's five sessions as a fleet of one: what changed and what did not, beside what `compare` says of pairs of them."""

from itertools import combinations
from pathlib import Path

import pandas as pd
import pytest

import bristle

SESSION = """
joint: {{name: servo}}
encoder_resolution: 6.283e-4 rad
signals:
  time:     {{rate: 1 kHz}}
  position: {{column: 0, unit: rad}}
  torque:   {{column: 4, unit: N*m}}
runs:
  - {{files: "${{BRISTLE_DATA}}/servo_lugre/Fs_{k}.txt", experiment: presliding}}
  - {{files: "${{BRISTLE_DATA}}/servo_lugre/sigma0_{k}.txt", experiment: presliding}}
"""


def test_five_sessions_of_a_servo(measured_data: Path, tmp_path: Path) -> None:
    """No change beyond the scatter between sessions; the first session's sigma_0- is unlike the others, to `compare` and to the fleet.

    `compare` finds nothing between any two of the last four sessions, and nothing but sigma_0- between the first and these. The fleet, with one
    session for a baseline, ranks that very step first, since the second session, and by about as much; it does not call it a change, since
    the scatter rests on four pairs of sessions, and says that; by the errors of the estimates alone it names this step and no other, as `compare`
    does.
    """
    distributed = pytest.importorskip("distributed", reason="needs the extra fleet")
    assert measured_data.is_dir()
    for k in range(1, 6):
        (tmp_path / f"{k}.yaml").write_text(SESSION.format(k=k), encoding="utf-8")
    catalog = pd.DataFrame(
        {
            "file": [str(tmp_path / f"{k}.yaml") for k in range(1, 6)],
            "unit": "servo",
            "session": [f"2026-05-0{k}" for k in range(1, 6)],
        }
    )
    with distributed.Client(processes=False, dashboard_address="127.0.0.1:0") as client:
        found = bristle.fleet(catalog, tmp_path / "out", client=client)
        early = bristle.fleet(catalog, tmp_path / "out", client=client, baseline=1)
    assert (found.identified, early.unchanged) == (5, 5)
    assert found.changed == early.changed == 0
    assert "scatter-of-few" in found.text()
    (alone,) = [note for note in found.findings.notes if note.code == "beyond-errors"]
    assert alone.numbers["steps"] == 1
    first = early.findings.changes.iloc[0]
    assert (first["parameter"], first["direction"]) == ("sigma_0", "-")
    assert first["since"] == pd.Timestamp("2026-05-02")
    results = [bristle.identify(tmp_path / f"{k}.yaml") for k in range(1, 6)]
    pairs = {(a, b): bristle.compare(results[a], results[b]).changes for a, b in combinations(range(5), 2)}
    moved = [(a, change) for (a, _), changes in pairs.items() for change in changes if change.changed]
    assert {(a, str(change.parameter)) for a, change in moved} == {(0, "sigma_0-")}
    assert all(abs((change.percent or 0.0) - first["percent"]) < 10 for _, change in moved)
