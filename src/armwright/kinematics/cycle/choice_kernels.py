"""Warp kernels of the choice among candidates of blocks, in float64: joint motions between them, and the best chain.

In `choose`, a thread finds the chain of an arm: for each candidate of the first block, the best chains to those of each
further block by dynamic programming. What already costs as much as the best chain so far is not continued. Of equally
good chains, that of the first candidates counts.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.cycle.costs import PEAK_SPEED, SPENT
from armwright.kinematics.cycle.path_math import path_math


@cache
def choice_kernels() -> SimpleNamespace:
    """Return the kernels."""
    real, cost_of = wp.float64, path_math().cost_of
    one, peak_speed = real(1.0), real(PEAK_SPEED)

    @kernel
    def joint_motions(
        q: wp.array4d(dtype=real), first: wp.array(dtype=int), end: wp.array(dtype=int), speed: wp.array2d(dtype=real),
        times: wp.array(dtype=real), costs: wp.array4d(dtype=real),
    ):  # fmt: skip
        """Compute the costs of joint motions from each candidate of a block to each of the next one.

        q: (N, K, S, D) [rad] or [m].  first: (B + 1,), end: (B,) samples of blocks.  speed: (N, D) [rad/s] or [m/s].
        times: (E,) of the motions [s], infinite where not stated.  costs: (N, E, K, K).
        """
        arm, motion, i = wp.tid()
        start, goal = end[motion], first[(motion + 1) % end.shape[0]]
        for j in range(q.shape[1]):
            cost = real(wp.static(SPENT))
            if not wp.isnan(q[arm, i, start, 0]) and not wp.isnan(q[arm, j, goal, 0]):
                cost = real(0.0)
                for d in range(q.shape[3]):
                    cost = wp.max(cost, wp.abs(q[arm, j, goal, d] - q[arm, i, start, d]) / speed[arm, d])
                cost += cost_of(peak_speed * cost / times[motion] - one)
            costs[arm, motion, i, j] = cost

    @kernel
    def choose(
        blocks: wp.array3d(dtype=real), edges: wp.array4d(dtype=real), arms: wp.array(dtype=int),
        total: wp.array3d(dtype=real), came_from: wp.array3d(dtype=int), choice: wp.array2d(dtype=int),
    ):  # fmt: skip
        """Choose the candidates of some arms.

        blocks: (N, B, K).  edges: (N, E, K, K), E = B if a joint motion closes the cycle.  arms: (n,).
        total: (n, 2, K) and came_from: (n, B, K) are scratch.  choice: (n, B), 0 if there is no chain.
        """
        row = wp.tid()
        arm, n_blocks, k = arms[row], blocks.shape[1], blocks.shape[2]
        least = real(wp.static(SPENT))
        for start in range(k):
            for j in range(k):
                total[row, 0, j] = real(wp.static(SPENT))
            total[row, 0, start] = blocks[arm, 0, start]
            for block in range(1, n_blocks):
                now = block % 2
                for j in range(k):
                    total[row, now, j] = real(wp.static(SPENT))
                for i in range(k):
                    so_far = total[row, 1 - now, i]
                    if so_far < least:
                        for j in range(k):
                            value = so_far + edges[arm, block - 1, i, j]
                            if value < total[row, now, j]:
                                total[row, now, j] = value
                                came_from[row, block, j] = i
                for j in range(k):
                    total[row, now, j] += blocks[arm, block, j]
            for j in range(k):
                value = total[row, (n_blocks - 1) % 2, j]
                if value < least and edges.shape[1] == n_blocks:
                    value += edges[arm, n_blocks - 1, j, start]
                if value < least:
                    least, at = value, int(j)
                    for step in range(n_blocks - 1):
                        choice[row, n_blocks - 1 - step] = at
                        at = came_from[row, n_blocks - 1 - step, at]
                    choice[row, 0] = start

    return SimpleNamespace(joint_motions=joint_motions, choose=choose)
