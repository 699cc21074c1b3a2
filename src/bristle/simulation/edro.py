"""Ed-Ro: Table 1, the gains of (21), and the embedded data simulated with them."""

from pathlib import Path

from bristle.control.pid import Gains
from bristle.model.law import DAMPING_RATIO
from bristle.model.parameters import Lugre, Pair

TABLE_1: dict[str, Pair[float]] = {
    "gripper rotation": Pair(
        Lugre(0.0194, 0.0055, 0.0394, 0.0720, 6.1843, 0.0184), Lugre(0.0148, 0.0040, 0.0307, 0.0720, 4.5356, 0.0146)
    ),
    "wrist pitch": Pair(
        Lugre(0.0704, 0.0145, 0.1362, 0.0320, 38.3236, 0.1168), Lugre(0.1058, 0.0107, 0.1200, 0.0710, 40.0495, 0.1162)
    ),
    "elbow pitch": Pair(
        Lugre(0.1018, 0.0514, 0.2216, 0.1230, 59.3440, 0.2579), Lugre(0.0957, 0.0209, 0.1495, 0.0450, 38.4564, 0.1874)
    ),
    "base rotation": Pair(
        Lugre(0.2371, 0.0285, 0.1394, 0.0750, 70.5845, 0.4673), Lugre(0.1731, 0.1098, 0.1338, 0.0620, 50.2721, 0.3908)
    ),
}
"""LuGre parameters of each joint, positive and negative velocity."""

PID_GAINS: Gains[float] = Gains(K_p=3.0, K_i=1.2, K_d=0.2, filter_time=0.0)
"""The gains of (21), as if for radians and N*m: the paper does not say."""

TABLE_2_START: dict[str, float] = {"alpha_0": 0.3, "alpha_2": 0.5}
TABLE_2_ADAPTED: dict[str, float] = {"alpha_0": 0.84, "alpha_2": 1.05}
"""Shares of the gripper's parameters where the adaptation begins and ends."""


def inertia(pair: Pair[float]) -> float:
    """J, kg*m**2, by inversion of (15), the mean of two directions that differ by up to 20 %."""
    return sum((p.sigma_1 / (2 * DAMPING_RATIO)) ** 2 / p.sigma_0 for p in pair) / 2


def datasets_folder(name: str = "edro") -> Path:
    """The folder of an embedded data set, `edro` or `arm`. Raises FileNotFoundError where it is missing."""
    here = Path(__file__).resolve()
    for folder in (here.parents[1] / "datasets" / name, here.parents[3] / "datasets" / name):
        if folder.is_dir():
            return folder
    raise FileNotFoundError("the embedded data set is missing; reinstall bristle, or run it from a complete checkout")


def experiments() -> tuple[Path, ...]:
    """The four embedded experiment files, in the order of Table 1."""
    return tuple(datasets_folder() / f"{stem}.yaml" for stem in ("gripper", "wrist", "elbow", "base"))
