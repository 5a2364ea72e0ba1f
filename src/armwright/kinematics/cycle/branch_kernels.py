"""Warp kernel that tells the branches of the inverse kinematics apart, and mirrors known ones to find more."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import MAX_JOINTS, PRISMATIC
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.cycle.branch_math import branch_math
from armwright.kinematics.cycle.costs import FAR


@cache
def branch_kernels() -> SimpleNamespace:
    """Return the kernels."""
    mirrors = branch_math()
    real, Values, Chain = mirrors.real, mirrors.Values, mirrors.Chain
    image_of, without_turns = mirrors.image_of, mirrors.without_turns
    Exactness = wp.types.vector(length=2 * MAX_JOINTS, dtype=int)

    @wp.func
    def distance(q: wp.array4d(dtype=real), arm: int, block: int, row: int, other: Values, dof: int, enough: real):
        """Return the largest difference of a joint between a posture and another one, or one that is enough."""
        largest, j = real(0.0), int(0)  # noqa: RUF046, UP018
        while j < dof and largest < enough:
            largest = wp.max(largest, wp.abs(q[arm, block, row, j] - other[j]))
            j += 1
        return largest

    @kernel
    def find_branches(
        chain: Chain,
        q: wp.array4d(dtype=real),
        cost: wp.array3d(dtype=real),
        known: int,
        distinct: real,
        nearness: wp.array3d(dtype=real),
        found: wp.array4d(dtype=real),
    ):
        """Choose postures that differ, then add images, and images of images, the exact ones first, until it is full.

        The cheapest posture is chosen first, then each time the one with the least cost minus distance from those.
        Images may be beyond joint limits: another image of them may not.

        q: (N, B, S, D).  cost: (N, B, S), FAR at least for those not to choose.  known: the number chosen at most.
        distinct: between postures, nearer ones count as the same [rad] or [m].
        nearness: (N, B, S) of FAR, which those not to choose keep.  found: (N, B, K, D), NaN where nothing was found.
        """
        arm, block = wp.tid()
        count = int(0)  # noqa: RUF046, UP018
        image = Values()
        for _ in range(known):
            best, least = int(-1), real(wp.static(FAR))  # noqa: RUF046, UP018
            for row in range(q.shape[2]):
                value = cost[arm, block, row] - nearness[arm, block, row]
                if nearness[arm, block, row] >= distinct and value < least:
                    best, least = row, value
            if best < 0:
                break
            for j in range(chain.dof):
                image[j] = q[arm, block, best, j]
                found[arm, block, count, j] = image[j]
            for row in range(q.shape[2]):
                if cost[arm, block, row] < real(wp.static(FAR)):
                    near = nearness[arm, block, row]
                    nearness[arm, block, row] = wp.min(near, distance(q, arm, block, row, image, chain.dof, near))
            count += 1
        exactness = Exactness()  # 2 for exact images, 1 for near ones, 0 for none
        for candidate in range(2 * chain.dof):
            if chain.motion[arm, candidate / 2] < wp.static(PRISMATIC):
                _image, exact = image_of(chain, arm, candidate / 2, candidate % 2 == 1, image)
                exactness[candidate] = exact
        mirrored = int(0)  # noqa: RUF046, UP018
        for least_exact in range(2, 0, -1):
            before = mirrored  # those with exact images
            mirrored = int(0)  # noqa: RUF046, UP018
            while mirrored < count and known < found.shape[2]:
                for candidate in range(2 * chain.dof):
                    joint = candidate / 2
                    is_new = exactness[candidate] == least_exact or (mirrored >= before and exactness[candidate] == 2)
                    if is_new and count < found.shape[2]:
                        for j in range(chain.dof):
                            image[j] = found[arm, block, mirrored, j]
                        image, _exact = image_of(chain, arm, joint, candidate % 2 == 1, image)
                        image = without_turns(chain, arm, image)
                        valid, row = bool(is_new), int(0)  # noqa: RUF046, UP018
                        while valid and row < count:
                            valid = distance(found, arm, block, row, image, chain.dof, distinct) >= distinct
                            row += 1
                        if valid:
                            for j in range(chain.dof):
                                found[arm, block, count, j] = image[j]
                            count += 1
                mirrored += 1

    return SimpleNamespace(Chain=Chain, find_branches=find_branches)
