"""Imported for its effect alone: the simulators beside the datasets can then be imported, as in the tests."""

import sys
from pathlib import Path

DATASETS = Path(__file__).resolve().parents[1] / "datasets"
sys.path += [str(DATASETS / name) for name in ("fleet", "arm", "edro")]
