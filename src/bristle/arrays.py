"""The array that every floor of the house hands to the next."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
