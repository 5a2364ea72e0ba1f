"""Costs of chains of postures, in seconds or radians, from which one is chosen."""

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays

ON_LIMIT = 1e-6  # [rad] or [m] from the limit of a joint
LARGE_STEP = 0.5  # [rad] or [m] between coarse samples, where a jump is possible
SUSPECT = 100.0  # cost of such a step: above any detour, below what is certain to be infeasible
PEAK_SPEED = 1.875  # of a motion, relative to its mean speed
SPENT = 1e12  # cost of what there is not
BLOCKED = 1e3  # cost of a chain that is off by its tolerance, far above any detour
FAR = 1e30  # distance of postures from none, and cost of one that is not chosen
MOST_EXCESS = 1e6  # relative to a tolerance, beyond which more costs no more


def cost_of(excess: Array) -> Array:
    """Return the cost of exceeding a tolerance; excess: relative to the tolerance."""
    return np.where(excess > 0.0, BLOCKED * (1.0 + np.minimum(excess, MOST_EXCESS)), 0.0)


def joint_speeds(arms: ArmArrays) -> Array:
    """Return the (N, D) speeds of the joints, 1 rad/s or 1 m/s if unknown, for costs."""
    if arms.actuation is None:
        return np.ones(arms.motion.shape)
    speed = arms.actuation.no_load_speed
    return np.where(np.isfinite(speed), speed, 1.0)
