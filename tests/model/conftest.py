"""The parameter sets that these tests share: Table 1 of the paper, one pair per joint."""

import pytest

from bristle.model.parameters import Lugre, Pair
from bristle.simulation.edro import TABLE_1


@pytest.fixture
def gripper() -> Lugre[float]:
    return TABLE_1["gripper rotation"].positive


@pytest.fixture(params=list(TABLE_1))
def pair(request: pytest.FixtureRequest) -> Pair[float]:
    """Each joint of Table 1."""
    return TABLE_1[request.param]


@pytest.fixture(params=[(joint, k) for joint in TABLE_1 for k in (0, 1)], ids=lambda key: f"{key[0]}{'+-'[key[1]]}")
def table_set(request: pytest.FixtureRequest) -> Lugre[float]:
    """Each of the eight sets of Table 1."""
    joint, k = request.param
    return TABLE_1[joint][k]
