"""Pairs of links whose collision check can be disabled, by proof.

A link is a solid cylinder along its segment, from its joint to the next. The capsule of its radius r about the segment
contains it. It contains the capsule of radius s = min(r, length / 2) about the segment shortened by s at each end. So
two links are apart if the distance of their segments exceeds the sum of both r, and collide if the distance of the
shortened segments is below the sum of both s.

The distance at the centre of a box of joint values bounds it in the whole box: rotating a joint by a changes the
distance of two segments by at most a R, where R is the largest distance of either of them from the axis of the joint,
and sliding by a changes it by at most a. If the bound is too weak, the box is halved.
"""

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np

from armwright.arrays import Array
from armwright.robot.arm import AXES, Arm, Joint, Link

Reason = Literal["Adjacent", "Never", "Always"]

MARGIN = 1e-6  # [m]; files have ten digits, and float64 rounds
MAX_BOXES = 50_000  # per pair; beyond it the search for a proof ends


def disabled_collision_pairs(arm: Arm) -> dict[tuple[int, int], Reason]:
    """Return pairs of links, counted from 0, that need no collision check, and the reason.

    Adjacent links have no solid link or no moving joint between them. Others collide in no posture within the joint
    limits (Never), or in every one (Always). Links without length are not solid.
    """
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    pairs: dict[tuple[int, int], Reason] = {}
    for i, first in enumerate(solid):
        for second in solid[i + 1 :]:
            rigid = all(joint.kind == "fixed" for joint in arm.joints[first + 1 : second + 1])
            neighbours = second == solid[i + 1]
            reason = "Adjacent" if rigid or neighbours else _proven(arm, first, second)
            if reason is not None:
                pairs[first, second] = reason
    return pairs


def joined_by_motors(arm: Arm) -> Iterator[tuple[int, int]]:
    """Yield pairs of a joint with a motor body and a solid link that need no collision check, counted from 0.

    A motor is a neighbour of the link that carries it, of the link that it moves, and of links without a solid link or
    a moving joint between. All other pairs count, and so do all pairs of motors.
    """
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    for j, joint in enumerate(arm.joints):
        if joint.body is None:
            continue
        before, after = [n for n in solid if n < j], [n for n in solid if n >= j]
        for n in before:
            rigid = all(one.kind == "fixed" for one in arm.joints[n + 1 : j])
            if rigid or n == before[-1]:
                yield j, n
        if after:
            yield j, after[0]


def joined_by_column(arm: Arm) -> tuple[list[int], list[int]]:
    """Return the motors, by joint, and the solid links that need no collision check with the column, counted from 0.

    These are the parts that do not move, and the first solid link. All others count.
    """
    first = next((j for j, joint in enumerate(arm.joints) if joint.kind != "fixed"), len(arm.joints))
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    motors = [j for j, joint in enumerate(arm.joints[: first + 1]) if joint.body is not None]
    return motors, [n for n in solid if n < first or n == solid[0]]


def _proven(arm: Arm, first: int, second: int) -> Reason | None:
    """Return Never or Always; None if neither holds or can be proven with MAX_BOXES boxes."""
    joints = arm.joints[first + 1 : second + 1]
    links = arm.links[first : second + 1]
    moving = [j for j, joint in enumerate(joints) if joint.kind != "fixed"]
    lower = np.array([joints[j].lower for j in moving])
    upper = np.array([joints[j].upper for j in moving])
    rates = np.array([_rate(joints, links, j) for j in moving])
    outer = links[0].radius + links[-1].radius + MARGIN
    inner = _inset(links[0]) + _inset(links[-1]) - MARGIN
    centres, halves = ((lower + upper) / 2)[None], ((upper - lower) / 2)[None]  # (B, D)
    done, open_reasons = 0, {"Never", "Always"}
    while len(centres) and done + len(centres) <= MAX_BOXES:
        done += len(centres)
        apart, near = _distances(joints, links, moving, centres)
        if np.any(apart <= outer):
            open_reasons.discard("Never")
        if np.any(near >= inner):
            open_reasons.discard("Always")
        if not open_reasons:
            return None
        spread = halves @ rates
        left = (apart - spread <= outer) if "Never" in open_reasons else (near + spread >= inner)
        centres, halves = _halved(centres[left], halves[left], rates)
    if len(centres):
        return None
    return "Never" if "Never" in open_reasons else "Always"


def _inset(link: Link) -> float:
    return min(link.radius, link.length / 2)


def _rate(joints: tuple[Joint, ...], links: tuple[Link, ...], j: int) -> float:
    """Return the largest rate of the distance between the first and the last link by joint j [m/rad] or [m/m].

    links[j] comes before joint j and links[j + 1] after it. The end of a link next to the joint is as far from its axis
    as the link reaches across it; all other links may have any direction.
    """
    if joints[j].kind == "prismatic":
        return 1.0

    def beyond(parts: range, slides: range) -> float:
        strokes = sum(max(-joints[i].lower, joints[i].upper) for i in slides if joints[i].kind == "prismatic")
        return strokes + sum(links[i].length for i in parts)

    x, y, z = (value * (axis != joints[j].axis) for axis, value in zip(AXES, links[j + 1].offset, strict=True))
    after = math.hypot(x, y, z) + beyond(range(j + 2, len(links)), range(j + 1, len(joints)))
    x, y, z = (value * (axis != joints[j].axis) for axis, value in zip(AXES, links[j].offset, strict=True))
    before = math.hypot(x, y, z) + beyond(range(j), range(j))
    return min(after, before)


def _halved(centres: Array, halves: Array, rates: Array) -> tuple[Array, Array]:
    """Return both halves of each box, cut across the joint with the largest effect."""
    rows = np.arange(len(centres))
    widest = np.argmax(halves * rates, axis=1)
    halves = halves.copy()
    halves[rows, widest] /= 2
    step = np.zeros_like(halves)
    step[rows, widest] = halves[rows, widest]
    return np.concatenate([centres - step, centres + step]), np.concatenate([halves, halves])


def _distances(joints: tuple[Joint, ...], links: tuple[Link, ...], moving: list[int], q: Array) -> tuple[Array, Array]:
    """Return the distances (B,) of the segments of the first and the last link, and of the shortened ones [m]."""
    frames, positions = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for j, joint in enumerate(joints):
        positions = positions + frames @ np.array(links[j].offset)
        if j in moving:
            values = q[:, moving.index(j)]
            if joint.kind == "prismatic":
                positions = positions + frames[:, :, AXES.index(joint.axis)] * values[:, None]
            else:
                frames = frames @ _rotations(joint, values)
    start, end = np.zeros_like(positions), np.broadcast_to(np.array(links[0].offset), positions.shape)
    other_end = positions + frames @ np.array(links[-1].offset)
    cut, other_cut = (_inset(link) / link.length for link in (links[0], links[-1]))
    inner = (*_shortened(start, end, cut), *_shortened(positions, other_end, other_cut))
    return segment_distance(start, end, positions, other_end), segment_distance(*inner)


def _shortened(a: Array, b: Array, cut: float) -> tuple[Array, Array]:
    return a + cut * (b - a), b - cut * (b - a)


def _rotations(joint: Joint, angles: Array) -> Array:
    """Return (B, 3, 3) rotations of a joint by angles (B,) [rad]."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[joint.axis]
    matrices = np.tile(np.eye(3), (len(angles), 1, 1))
    matrices[:, i, i] = matrices[:, j, j] = np.cos(angles)
    matrices[:, j, i] = np.sin(angles)
    matrices[:, i, j] = -matrices[:, j, i]
    return matrices


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return (B,) the distances between the segments from a to b and from c to d, each (B, 3) [m].

    It is the distance of an end to the other segment, or that of the two lines if their nearest points are on both.
    """
    ends = [_point_distance(a, c, d), _point_distance(b, c, d), _point_distance(c, a, b), _point_distance(d, a, b)]
    u, v, w = b - a, d - c, c - a
    uu, vv, uv = _dot(u, u), _dot(v, v), _dot(u, v)
    across = uu * vv - uv * uv
    skew = across > 1e-14 * uu * vv  # else the lines are parallel, and an end is as near as any point
    safe = np.where(skew, across, 1.0)
    s, t = (_dot(w, u) * vv - _dot(w, v) * uv) / safe, (_dot(w, u) * uv - _dot(w, v) * uu) / safe
    on_both = skew & (s >= 0.0) & (s <= 1.0) & (t >= 0.0) & (t <= 1.0)
    between = np.linalg.norm(w + t[:, None] * v - s[:, None] * u, axis=1)
    return np.minimum(np.min(ends, axis=0), np.where(on_both, between, np.inf))


def _point_distance(p: Array, a: Array, b: Array) -> Array:
    """Return (B,) the distances of points p to the segments from a to b [m]."""
    along = b - a
    square = _dot(along, along)
    t = np.clip(_dot(p - a, along) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.linalg.norm(p - a - t[:, None] * along, axis=1)


def _dot(u: Array, v: Array) -> Array:
    return np.einsum("bi,bi->b", u, v)
