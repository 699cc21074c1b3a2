"""The code tour: what docs/tour.md names is what one CSV passes, in that order."""

import re
import sys
from pathlib import Path
from types import FrameType

import bristle

from .conftest import speeds, write

ROOT = Path(__file__).parents[1]
SOURCE = f"{ROOT / 'src' / 'bristle'}/"
TOUR = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")


def test_the_tour_is_the_way_of_one_csv(tmp_path: Path) -> None:
    """Every step is called for one CSV of points, and the first calls come in the order of the page."""
    steps = re.findall(r"^\d+\. `(\S+\.py)` `(\w+)`", TOUR, re.MULTILINE)
    every = re.findall(r"`(\S+\.py)`\s+`(\w+)`", TOUR)
    called = dict[tuple[str, str], None]()

    def note(frame: FrameType, event: str, _: object) -> None:
        """A call of a function of the package."""
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(SOURCE):
            called.setdefault((code.co_filename.removeprefix(SOURCE), code.co_name))

    file, before = write(tmp_path, speeds()), sys.getprofile()
    sys.setprofile(note)
    try:
        found = bristle.identify(file)
    finally:
        sys.setprofile(before)
    assert set(every) - called.keys() == set()
    assert [step for step in called if step in steps] == steps
    assert len(steps) > 10
    assert found.joints[0].static["+"].parameters["alpha_0"].value is not None


def test_every_file_of_the_tour_is_there() -> None:
    """Files and folders named in passing exist too."""
    named = set(re.findall(r"`((?:\w+/)+(?:\w+\.py)?|\w+\.py)`", TOUR))
    assert len(named) > 10
    roots = (Path(SOURCE), ROOT)
    assert {name for name in named if not any((root / name).exists() for root in roots)} == set()
