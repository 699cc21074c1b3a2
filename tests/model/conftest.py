"""The parameter sets that these tests share: Table 1 of the paper, one pair per joint."""

import pytest

from bristle.model.parameters import Lugre, Pair

TABLE_1 = {
    "gripper": Pair(
        Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184), Lugre(0.0148, 0.0040, 0.0307, 0.0720, 4.5356, 0.0146)
    ),
    "wrist": Pair(
        Lugre(0.0704, 0.0145, 0.1362, 0.0320, 38.3236, 0.1168), Lugre(0.1058, 0.0107, 0.1200, 0.0710, 40.0495, 0.1162)
    ),
    "elbow": Pair(
        Lugre(0.1018, 0.0514, 0.2216, 0.1230, 59.3440, 0.2579), Lugre(0.0957, 0.0209, 0.1495, 0.0450, 38.4564, 0.1874)
    ),
    "base": Pair(
        Lugre(0.2371, 0.0285, 0.1394, 0.0750, 70.5845, 0.4673), Lugre(0.1731, 0.1098, 0.1338, 0.0620, 50.2721, 0.3908)
    ),
}


@pytest.fixture
def gripper() -> Lugre[float]:
    """The gripper's (+) set."""
    return TABLE_1["gripper"].positive


@pytest.fixture(params=list(TABLE_1))
def pair(request: pytest.FixtureRequest) -> Pair[float]:
    """Each joint of Table 1."""
    return TABLE_1[request.param]


@pytest.fixture(params=[(joint, k) for joint in TABLE_1 for k in (0, 1)], ids=lambda key: f"{key[0]}{'+-'[key[1]]}")
def table_set(request: pytest.FixtureRequest) -> Lugre[float]:
    """Each of the eight sets of Table 1."""
    joint, k = request.param
    return TABLE_1[joint][k]
