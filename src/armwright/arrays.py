"""The array type of the whole package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_OBJECTIVE = 1e60  # in magnitude; the hypervolume of five objectives stays finite
