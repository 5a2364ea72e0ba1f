"""Choice of one candidate per block, for the cycle as a whole, by dynamic programming."""

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array

IndexArray = NDArray[np.intp]


def choose_candidates(blocks: Array, edges: Array, closed: bool) -> IndexArray:
    """Return the (N, B) candidates with the least sum of costs.

    Args:
        blocks: (N, B, K) cost of each block from each of its candidates.
        edges: (N, E, K, K) cost of the joint motion from candidate i of block b to candidate j of the next one; of the
            last block to the first one if the cycle is closed by a joint motion (E = B), else E = B - 1.
        closed: Whether a joint motion leads from the last block to the first.
    """
    n, b, k = blocks.shape
    # total[:, s, j]: cost of the best chain from candidate s of the first block to candidate j of the present one.
    total = np.where(np.eye(k, dtype=bool), blocks[:, 0, :, None], np.inf)
    came_from: list[IndexArray] = []
    for block in range(1, b):
        through = total[:, :, :, None] + edges[:, block - 1, None]  # (N, s, i, j)
        came_from.append(through.argmin(axis=2))
        total = through.min(axis=2) + blocks[:, block, None]
    if closed:
        total = total + edges[:, b - 1].swapaxes(1, 2)  # from candidate j of the last block to s
    start, end = np.divmod(total.reshape(n, -1).argmin(axis=1), k)
    arm = np.arange(n, dtype=np.intp)
    choice = np.empty((n, b), dtype=np.intp)
    choice[:, -1] = end
    for block in range(b - 1, 0, -1):
        choice[:, block - 1] = came_from[block - 1][arm, start, choice[:, block]]
    return choice
