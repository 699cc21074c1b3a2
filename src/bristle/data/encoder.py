"""The encoder's count: as an experiment declares it, or as the readings show it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bristle.arrays import Array
from bristle.data.record import Record

if TYPE_CHECKING:
    from bristle.data.experiment.load import Experiment

_NEAR, _ENOUGH = 50.0, 8
"""Steps of up to so many counts tell the count (beyond, rounding in the log adds up); so few of them may lie on a grid
by chance."""


def resolution(experiment: "Experiment", records: Sequence[Record]) -> float:
    """One encoder count, rad, as declared or as the positions show it; 0 where they keep to no grid."""
    steps = [smallest_step(r.position) for r in records if r.position is not None]
    return experiment.encoder_resolution or max(steps, default=0.0)


def smallest_step(position: Array) -> float:
    """The encoder's count, from the steps between the readings that occur, in the unit of position.

    0 where they keep to no grid.
    """
    levels = np.unique(position)
    if levels.size < 2:
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-3 * np.median(steps)]
    near = steps[steps < _NEAR * steps.min()]
    step = float(near.sum() / np.round(near / np.median(near[near < 1.5 * near.min()])).sum())
    on_grid = bool(np.abs(near / step - np.round(near / step)).max() < 0.1)
    return step if on_grid and (near.size >= _ENOUGH or levels.size <= position.size / 2) else 0.0
