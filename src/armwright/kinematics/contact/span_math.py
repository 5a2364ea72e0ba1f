"""Warp functions of searches for the sample of a path at which a pair is nearest.

From one sample to the next, no point of the outer part of a pair moves farther, relative to the inner one, than the sum
of the steps of the joints between them, each times its lever. So a pair whose distance d exceeds the least one found is
not nearer within (d - least) / motion samples, which are skipped (conservative advancement: Mirtich, Impulse-based
Dynamic Simulation, 1996).
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC, Precision
from armwright.kinematics.arms.frame_math import frame_math

MARGIN = 3e-5  # [m] of distances, for their accuracy and rounding
ROUNDING = 1e-6  # [m] of motions


@cache
def span_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision."""
    base = frame_math(precision)
    real, Vector3, Matrix3 = base.real, base.Vector3, base.Matrix3
    Joints = wp.types.vector(length=MAX_JOINTS + 1, dtype=real)
    zero, one, two = real(0.0), real(1.0), real(2.0)
    margin, rounding, most_samples = real(MARGIN), real(ROUNDING), real(1e6)

    @wp.struct
    class Posed:
        """The links of N arms of up to D joints at T samples, and K bodies.

        These are the actuators of D joints, the column (body D), tool and payload.
        """

        base: wp.array(dtype=Vector3)  # (N,) [m]
        motion: wp.array2d(dtype=int)  # (N, D)
        axis: wp.array2d(dtype=Vector3)  # (N, D) of the joints
        offset: wp.array2d(dtype=Vector3)  # (N, D) [m]
        q: wp.array3d(dtype=real)  # (N, T, D) [rad] or [m]
        radius: wp.array2d(dtype=real)  # (N, D) [m], 0 for links to ignore
        tip: wp.array(dtype=Vector3)  # (N,) of the tool in the last link's frame [m]
        tip_into: wp.array(dtype=Matrix3)  # (N,) rotation from that frame into the tip frame
        shape: wp.array2d(dtype=int)  # (N, K), below 0 if there is none
        half: wp.array2d(dtype=Vector3)  # (N, K) [m]
        body_axis: wp.array2d(dtype=int)  # (N, D) as of `MotorBodies`
        centre: wp.array2d(dtype=Vector3)  # (N, D) likewise [m]
        unloaded: int  # number of bodies without the payload, which is the last one
        carries: wp.array(dtype=int)  # (T,) whether the payload is there
        allowed: wp.array2d(dtype=real)  # (T, O) depth of tool and payload that does not count [m], as of `TipRules`
        starts: wp.array3d(dtype=Vector3)  # (N, T, D) of the links' axes [m]
        ends: wp.array3d(dtype=Vector3)  # (N, T, D) [m]
        middle: wp.array3d(dtype=Vector3)  # (N, T, K) of the bodies [m]
        into: wp.array3d(dtype=Matrix3)  # (N, T, K) rotation into the body's frame

    @wp.struct
    class Reach:
        """What joints move from one sample of a span to the next, at most; frame j is that before joint j."""

        turn: Joints  # of frame j [rad]
        length: Joints  # of link j [m]
        far: Joints  # length of the arm up to frame j [m]
        shift: Joints  # of frame j by displacements, less the turns times the lengths up to their joints [m]

    @wp.struct
    class Search:
        """A search over the samples of a span."""

        first: int
        end: int
        t: int  # sample to look at
        nearest: real  # least distance so far [m]
        at: int  # its sample

    @wp.func(inline=True)
    def reach_of(arms: wp.ref[Posed], arm: int, first: int, end: int):
        """Return the reach of an arm in samples from `first` to `end`."""
        reach = Reach()
        for j in range(arms.motion.shape[1]):
            step, stroke, motion = real(0.0), real(0.0), arms.motion[arm, j]
            for t in range(first, end):
                stroke = wp.max(stroke, wp.abs(arms.q[arm, t, j]))
                if t > first:
                    step = wp.max(step, wp.abs(arms.q[arm, t, j] - arms.q[arm, t - 1, j]))
            turn, far, shift = reach.turn[j], reach.far[j], reach.shift[j]
            if motion < wp.static(PRISMATIC):
                turn += step
                shift -= step * far
            elif motion < wp.static(FIXED):
                far += stroke
                shift += two * step  # the parts of two links that do not count become shorter as well
            length = wp.length(arms.offset[arm, j])
            reach.length[j] = length
            reach.turn[j + 1] = turn
            reach.far[j + 1] = far + length
            reach.shift[j + 1] = shift
        return reach

    @wp.func(inline=True)
    def moved(reach: wp.ref[Reach], inner: int, outer: int, lever: real):
        """Return how far a point moves from a sample to the next, at most; it is within `lever` of its frame `outer`.

        inner: frame that it moves relative to.
        """
        turn = reach.turn[outer] - reach.turn[inner]
        return turn * (reach.far[outer] + lever) + reach.shift[outer] - reach.shift[inner]

    @wp.func(inline=True)
    def looked(search: wp.ref[Search], distance: real, lower: real, motion: real):
        """Return the search at the next sample to look at.

        distance: of a pair, which counts. lower: a lower bound of it whatever counts.  motion: as of `moved`. Depths
        of bodies that overlap may change faster than bodies move, so they are not skipped.
        """
        if distance < search.nearest:
            search.nearest = distance
            search.at = search.t
        search.t += 1
        skipped = (lower - wp.max(search.nearest, zero) - margin) / (motion + rounding)
        if skipped >= one:
            search.t += int(wp.min(skipped, most_samples))

    return SimpleNamespace(Posed=Posed, Reach=Reach, Search=Search, reach_of=reach_of, moved=moved, looked=looked)
