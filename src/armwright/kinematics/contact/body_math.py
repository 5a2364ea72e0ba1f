"""Warp functions of clearance along a span of postures: of actuators, tool and payload from other parts of the arm.

Bounds exclude distant pairs. docs/method.md §13 defines the distances and which pairs count.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, Precision
from armwright.kinematics.contact.convex_math import convex_math
from armwright.kinematics.contact.solid_math import solid_math
from armwright.kinematics.contact.span_math import span_math


@cache
def body_math(precision: Precision) -> SimpleNamespace:
    """Return the functions in this precision. Each returns the lower of a clearance and its own, and the posture."""
    solid, span = solid_math(precision), span_math(precision)
    real, Posed, Motors, Solids, Steps = solid.real, solid.Posed, solid.Motors, solid.Solids, span.Steps
    from_link, separation = solid.from_link, convex_math(precision).separation
    extent, travel, ahead = span.extent, span.travel, span.ahead
    zero = real(0.0)

    @wp.func
    def nearer_than_link(
        arms: Posed, motors: Motors, arm: int, i: int, k: int, first: int, end: int, way: real, nearest: real, at: int
    ):
        """Clearance of body i from link k; way: what they move from posture to posture."""
        size = motors.half[arm, i]
        t = int(first)
        while t < end:
            frame, start = motors.into[arm, t, i], arms.starts[arm, t, k]
            d, v = frame * (start - motors.middle[arm, t, i]), frame * (arms.ends[arm, t, k] - start)
            found = from_link(motors.shape[arm, i], size, d, v, arms.radius[arm, k], nearest)
            if found < nearest:
                nearest, at = found, t
            t += ahead(found - nearest, way)
        return nearest, at

    @wp.func
    def body_from_links(
        arms: Posed, motors: Motors, arm: int, i: int, first: int, end: int, steps: Steps, nearest: real, at: int
    ):
        """Clearance of a body from links that it does not join."""
        dof, is_path = arms.motion.shape[1], end > first + 1
        before = wp.min(i, dof)
        way, size = real(0.0), extent(arms, motors, arm, first, i)
        links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for k in range(before, dof):
            if arms.radius[arm, k] > zero:
                if links_between > 0:
                    if is_path:
                        way = travel(arms, arm, steps, before, k + 1, arms.radius[arm, k])
                    nearest, at = nearer_than_link(arms, motors, arm, i, k, first, end, way, nearest, at)
                links_between += 1
        links_before = int(0)  # noqa: RUF046, UP018
        n_joints = int(0)  # noqa: RUF046, UP018
        reach = real(0.0)  # [m] along the arm, from the end of link k to tool and payload
        for back in range(before):
            k = before - 1 - back
            r = arms.radius[arm, k]
            if r > zero:
                # A link whose round end reaches up to the tool always touches it.
                if links_before > 0 and n_joints > 0 and (i < dof or reach > r):
                    if is_path:
                        way = travel(arms, arm, steps, k + 1, before, size)
                    nearest, at = nearer_than_link(arms, motors, arm, i, k, first, end, way, nearest, at)
                reach += wp.length(arms.ends[arm, first, k] - arms.starts[arm, first, k])
                links_before += 1
            if arms.motion[arm, k] < wp.static(FIXED):
                n_joints += 1
        return nearest, at

    @wp.func
    def body_from_bodies(
        arms: Posed, motors: Motors, arm: int, i: int, others: int, count: int, first: int, end: int, steps: Steps,
        nearest: real, at: int,
    ):  # fmt: skip
        """Clearance of a body from bodies `others` to before `count`.

        Tool and payload are parts of the last link: they count from what is not next to it, and not from each other.
        """
        dof, kind, size = arms.motion.shape[1], motors.shape[arm, i], motors.half[arm, i]
        links_between = int(0)  # noqa: RUF046, UP018 (Warp's way to declare what changes in a loop)
        for k in range(i, dof):
            if arms.radius[arm, k] > zero:
                links_between += 1
        for j in range(others, count):
            other, other_size = motors.shape[arm, j], motors.half[arm, j]
            if other >= 0 and (j < dof or links_between > 1):
                way = real(0.0)
                if end > first + 1:
                    other_extent = extent(arms, motors, arm, first, j)
                    way = travel(arms, arm, steps, wp.min(i, dof), wp.min(j, dof), other_extent)
                t = int(first)
                while t < end:
                    frame, d = motors.into[arm, t, i], motors.middle[arm, t, j] - motors.middle[arm, t, i]
                    found = wp.length(d) - wp.length(size) - wp.length(other_size)
                    if found < nearest:
                        between = motors.into[arm, t, j] * wp.transpose(frame)
                        found = separation(frame * d, kind, size, between, other, other_size, Solids(), 0, nearest)
                        if found < nearest:
                            nearest, at = found, t
                    t += ahead(found - nearest, way)
        return nearest, at

    return SimpleNamespace(body_from_links=body_from_links, body_from_bodies=body_from_bodies)
