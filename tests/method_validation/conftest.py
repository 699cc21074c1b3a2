"""The short validation that several tests look at, and the sweep's cases that it is of."""

import pytest

from bristle.questions.method_validation import run as running
from bristle.questions.method_validation.cases import CaseSet, sweep
from bristle.questions.method_validation.results import Validation
from bristle.questions.method_validation.run import validate
from bristle.questions.method_validation.solvers import ValidationCase

WIDE, EVEN, NONE_BELOW = range(3)


def case_of(design: int, noise: float = 0.05, sign: float = 1.0) -> ValidationCase:
    return next(
        c
        for c in sweep(noise).cases
        if c.label == f"gripper rotation ({'+' if sign > 0 else '-'})" and c.design == designs()[design]
    )


def designs() -> list[str]:
    return list(dict.fromkeys(c.design for c in sweep().cases))


def quick(patch: pytest.MonkeyPatch) -> None:
    """Fewer data sets for what takes long."""
    patch.setattr(running, "LOCAL_SETS", 6)
    patch.setattr(running, "BOOTSTRAP_SETS", 12)


@pytest.fixture(scope="session")
def validation() -> Validation:
    """A short validation of three cases: all can be known, little noise; all can be known, much noise; nothing can be known."""
    cases = (case_of(WIDE, 0.005), case_of(WIDE), case_of(NONE_BELOW, 0.005))
    with pytest.MonkeyPatch.context() as patch:
        quick(patch)
        return validate(CaseSet(title="<b>three", kind="prismatic", cases=cases), repetitions=60, starts=6)
