"""Warp functions that mirror a posture, so that it comes near another branch of the inverse kinematics.

A turn by π about an axis a reverses rotations about axes b perpendicular to it: R_a(π) R_b(φ) = R_b(-φ) R_a(π). So if a
joint about a turns by π, those about other axes up to the next joint about a are negated, and that one turns back, all
links stay where they are, if they lie on a line along a when straight. This is how shoulders and wrists flip. After the
last joint about a, the tool turns about itself. Joints on one line share one turn, which has two ways round.

An elbow: of a joint i and the next one m about the same axis, u leads from i to m and v from m to a joint k, in the
plane perpendicular to the axis. Mirrored at w = u + v, k stays where it is. Joint i turns by 2 ∠(u, w), joint m by
2 ∠(v, w) - 2 ∠(u, w), and joint k, if it is about the same axis, by -2 ∠(v, w), so that what follows stays as well. If
k is not, other joints are between, or links are off the line, an image is only near another branch, and the inverse
kinematics has to refine it.

A joint about -a counts as one about a, with its values negated. Joints that are neither parallel nor perpendicular to
others have no images.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import MAX_JOINTS, PRISMATIC
from armwright.kinematics.arms.frame_math import frame_math

AXES_OFF = 5e-3  # [rad] by which axes may miss what images assume, which the inverse kinematics refines
NARROW = 0.15  # of an arm's length, by which links may lie off the line that they are turned about


@cache
def branch_math() -> SimpleNamespace:
    """Return the functions, in float64."""
    base = frame_math("float64")
    real, Vector3 = base.real, base.Vector3
    Values = wp.types.vector(length=MAX_JOINTS, dtype=real)
    zero, two = real(0.0), real(2.0)
    pi, narrow, tiny = real(math.pi), real(NARROW), real(1e-9)
    off, parallel = real(AXES_OFF), real(math.cos(AXES_OFF))

    @wp.struct
    class Chain:
        """Arms, as far as images depend on them."""

        dof: int
        motion: wp.array2d(dtype=int)  # (N, D)
        axis: wp.array2d(dtype=Vector3)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        lower: wp.array2d(dtype=real)  # (N, D)
        upper: wp.array2d(dtype=real)  # (N, D)

    @wp.func
    def between(u: Vector3, w: Vector3, a: Vector3):
        """Return the angle from u to w about an axis that they are perpendicular to [rad]."""
        return wp.atan2(wp.dot(a, wp.cross(u, w)), wp.dot(u, w))

    @wp.func
    def sense(chain: Chain, arm: int, j: int, a: Vector3):
        """Return 1 for a joint that turns about an axis, -1 for one about the opposite one, 0 for any other."""
        cosine = wp.dot(a, chain.axis[arm, j])
        if chain.motion[arm, j] >= wp.static(PRISMATIC) or wp.abs(cosine) < parallel:
            return zero
        return wp.sign(cosine)

    @wp.func
    def links_across(chain: Chain, arm: int, a: Vector3, first: int, end: int):
        """Return the links of joints from `first` to before `end`, perpendicular to an axis, with all joints at 0."""
        links = Vector3()
        for j in range(first, end):
            links += chain.offset[arm, j] - wp.dot(chain.offset[arm, j], a) * a
        return links

    @wp.func
    def image_of(chain: Chain, arm: int, joint: int, is_elbow: bool, q: Values):
        """Return the image by an elbow or a turn about the axis of a joint; 2 if it is exact, 1 if near, 0 if none."""
        a = chain.axis[arm, joint]
        end, others = int(joint + 1), int(0)  # noqa: RUF046, UP018
        while end < chain.dof and sense(chain, arm, end, a) == zero:
            if chain.motion[arm, end] < wp.static(PRISMATIC):
                others += 1
                if wp.abs(wp.dot(chain.axis[arm, end], a)) > off:
                    return q, 0
            end += 1
        u, way = links_across(chain, arm, a, joint, end), real(0.0)
        if end < chain.dof:
            way = sense(chain, arm, end, a)
        if not is_elbow:
            if others == 0 and end < chain.dof:
                q[joint] = (q[joint] + way * q[end]) / two
                q[joint] = q[joint] - pi * wp.sign(q[joint])
                q[end] = way * q[joint]
                return q, wp.where(wp.length(u) < tiny, 2, 0)
            q[joint] = q[joint] + pi
            for j in range(joint + 1, end):
                if chain.motion[arm, j] < wp.static(PRISMATIC):
                    q[j] = -q[j]
            length = real(0.0)
            for j in range(chain.dof):
                length += wp.length(chain.offset[arm, j])
            if end < chain.dof:
                q[end] = q[end] - way * pi
            return q, wp.where(wp.length(u) < tiny, 2, wp.where(wp.length(u) < narrow * length, 1, 0))
        wrist = int(end + 1)
        # A joint about the line of its link moves nothing up to the next one.
        while (
            wrist < chain.dof
            and sense(chain, arm, wrist, a) == zero
            and wp.length(links_across(chain, arm, chain.axis[arm, wrist], wrist, wrist + 1)) < tiny
        ):
            wrist += 1
        if end == chain.dof:
            return q, 0
        bent = links_across(chain, arm, a, end, wrist)
        v = wp.cos(q[end]) * bent + way * wp.sin(q[end]) * wp.cross(a, bent)  # in the frame of u
        first, second = between(u, u + v, a), between(v, u + v, a)
        q[joint] = q[joint] + two * first
        q[end] = q[end] + way * two * (second - first)
        closing = real(0.0)
        if wrist < chain.dof:
            closing = sense(chain, arm, wrist, a)
            q[wrist] = q[wrist] - closing * two * second
        is_exact = bool(wrist == end + 1 and closing != zero and others == 0)
        return q, wp.where(wp.length(u) > tiny and wp.length(v) > tiny, wp.where(is_exact, 2, 1), 0)

    @wp.func
    def without_turns(chain: Chain, arm: int, q: Values):
        """Return a posture without whole turns, in which joints on one line share theirs if one is beyond its limit."""
        for j in range(chain.dof):
            if chain.motion[arm, j] < wp.static(PRISMATIC):
                middle = (chain.lower[arm, j] + chain.upper[arm, j]) / two
                q[j] = q[j] - two * pi * wp.round((q[j] - middle) / (two * pi))
        for j in range(chain.dof - 1):
            a = chain.axis[arm, j]
            way = sense(chain, arm, j + 1, a)
            if chain.motion[arm, j] < wp.static(PRISMATIC) and way != zero:
                beyond = q[j] != wp.clamp(q[j], chain.lower[arm, j], chain.upper[arm, j])
                if q[j + 1] != wp.clamp(q[j + 1], chain.lower[arm, j + 1], chain.upper[arm, j + 1]):
                    beyond = True
                if beyond and wp.length(links_across(chain, arm, a, j, j + 1)) < tiny:
                    q[j] = (q[j] + way * q[j + 1]) / two
                    q[j + 1] = way * q[j]
        return q

    return SimpleNamespace(real=real, Values=Values, Chain=Chain, image_of=image_of, without_turns=without_turns)
