"""Makes the embedded data set again, byte for byte: `python datasets/edro/make.py [FOLDER]` (default: where this script is)."""

import sys
from pathlib import Path

import numpy as np
import yaml

import simulated_edro
from bristle.model.parameters import Lugre, unit
from bristle.simulation import edro
from virtual_bench import Logs

HEADER = "# SIMULATED by make.py from Table 1 of the paper; README.md marks what is assumed.\n"


def truth(p: Lugre[float]) -> dict[str, str]:
    """The true parameters, each with its unit."""
    return {name: f"{value} {unit(name)}" for name, value in p._asdict().items()}


def experiment(
    stem: str, title: str, runs: list[dict[str, object]], assumptions: tuple[str, ...] = simulated_edro.ASSUMPTIONS
) -> str:
    """The experiment file of one joint, as YAML, with its runs; `title` names the joint."""
    name = simulated_edro.SETTINGS[stem].name
    pair, motor = edro.TABLE_1[name], simulated_edro.motor(name)
    document = {
        "joint": {"name": title, "kind": "revolute"},
        "motor": {"torque_constant": f"{motor.k_t} N*m/A", "resistance": f"{motor.R} ohm"},
        "encoder_resolution": f"{simulated_edro.RESOLUTION:.10e} rad",
        "signals": {
            "time": {"column": "time", "unit": "s"},
            "position": {"column": "position", "unit": "rad"},
            "voltage": {"column": "voltage", "unit": "V"},
        },
        "runs": runs,
        "fit": {"position_cutoff": f"{simulated_edro.CUTOFF:g} Hz", "decimation": simulated_edro.DECIMATION},
        "simulated": True,
        "truth": {"+": truth(pair.positive), "-": truth(pair.negative)},
        "assumptions": list(assumptions),
    }
    return HEADER + yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=120)


def table(logs: Logs) -> str:
    """A log as CSV: time (s), position (rad), voltage (V); a count, 6e-6 rad, is more than the last digit."""
    rows = np.column_stack([logs.time, logs.position[0], logs.voltage[0]])
    digits = 2 if logs.time[1] > 5e-3 else 3
    return "time,position,voltage\n" + "".join(f"{t:.{digits}f},{y:.7f},{V:.5f}\n" for t, y, V in rows.tolist())


def write(path: Path, text: str) -> None:
    """Write a file whole or not at all."""
    temporary = path.with_suffix(path.suffix + ".tmp")
    temporary.write_bytes(text.encode())
    temporary.replace(path)


def main(folder: Path) -> None:
    """Write the four experiment files and their logs, and the example of slow plateaus that stick and slip."""
    for stem in simulated_edro.SETTINGS:
        runs: list[dict[str, object]] = [
            {"files": f"{stem}.csv", "experiment": "ramp"},
            {"files": f"{stem}_presliding.csv", "experiment": "presliding"},
            {"files": f"{stem}_tracking.csv", "experiment": "tracking"},
            {"files": f"{stem}_held_out.csv", "experiment": "tracking", "hold_out": True},
        ]
        write(folder / f"{stem}.yaml", experiment(stem, simulated_edro.SETTINGS[stem].name, runs))
        write(folder / f"{stem}.csv", table(simulated_edro.logs(stem, [0])))
        write(folder / f"{stem}_presliding.csv", table(simulated_edro.load_logs(stem, [0])))
        write(folder / f"{stem}_tracking.csv", table(simulated_edro.tracking_logs(stem, [0])))
        write(folder / f"{stem}_held_out.csv", table(simulated_edro.tracking_logs(stem, [0], held_out=True)))
    example = "base_paper_pid"
    title = f"{simulated_edro.SETTINGS['base'].name}, the paper's PID"
    runs = [{"files": f"{example}.csv", "experiment": "ramp"}]
    write(folder / f"{example}.yaml", experiment("base", title, runs, simulated_edro.PAPER_PID_ASSUMPTIONS))
    write(folder / f"{example}.csv", table(simulated_edro.paper_pid_logs("base", simulated_edro.PAPER_PID_SPEEDS)))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
