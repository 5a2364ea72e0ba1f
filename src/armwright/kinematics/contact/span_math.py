"""Warp functions of how far parts of an arm move from posture to posture of a path: how soon they may be nearer.

Relative to an earlier part, no point of a later one moves by more than δ, the sum over the joints between them of a
joint's largest step times its lever, the length of the arm from there to that point. A pair that is farther apart than
the least clearance found so far, by g, cannot be nearer within g / δ postures, which are left out (conservative
advancement: Mirtich, Impulse-based dynamic simulation of rigid body systems, 1996).
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Precision
from armwright.kinematics.contact.solid_math import solid_math

MARGIN = 1e-5  # [m] for rounding
MOST = 1e6  # postures at once


@cache
def span_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    solid = solid_math(precision)
    real, Posed, Motors = solid.real, solid.Posed, solid.Motors
    Steps = wp.types.vector(length=MAX_JOINTS, dtype=real)
    margin, most, tiny = real(MARGIN), real(MOST), real(1e-12)

    @wp.func
    def largest_steps(arms: Posed, arm: int, first: int, end: int):
        """Return the largest step of each joint from one posture of a span to the next."""
        steps = Steps()
        for t in range(first + 1, end):
            for j in range(arms.motion.shape[1]):
                steps[j] = wp.max(steps[j], wp.abs(arms.q[arm, t, j] - arms.q[arm, t - 1, j]))
        return steps

    @wp.func
    def travel(arms: Posed, arm: int, steps: Steps, before: int, after: int, extent: real):
        """Return δ of points within `extent` of the end of the link `after` - 1, relative to the link `before` - 1."""
        lever, total = extent, real(0.0)
        for back in range(after - before):
            j = after - 1 - back
            lever += arms.reach[arm, j]
            if arms.motion[arm, j] < wp.static(PRISMATIC):
                total += steps[j] * lever
            elif arms.motion[arm, j] < wp.static(FIXED):
                total += steps[j]
        return total

    @wp.func
    def ahead(gap: real, way: real):
        """Return how many postures ahead a pair may be nearer than now known, which is nearer by a gap [m]."""
        if gap <= margin:
            return 1
        return 1 + int(wp.min((gap - margin) / wp.max(way, tiny), most))

    @wp.func
    def extent(arms: Posed, motors: Motors, arm: int, t: int, i: int):
        """Return the largest distance of a point of a body from the end of the last link before it [m]."""
        before, away = wp.min(i, arms.motion.shape[1]), motors.middle[arm, t, i] - arms.base[arm]
        if before > 0:
            away = motors.middle[arm, t, i] - arms.ends[arm, t, before - 1]
        return wp.length(away) + wp.length(motors.half[arm, i])

    return SimpleNamespace(Steps=Steps, largest_steps=largest_steps, travel=travel, ahead=ahead, extent=extent)
