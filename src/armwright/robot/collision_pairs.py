"""Which links of an arm need no look for collisions between them, by proof.

A link is a solid cylinder along its segment, from its joint to the next. It lies within all that is nearer to the
segment than its radius r. It holds all that is nearer than s = min(r, half its length) to the segment less s at each
end. So two links are apart where their segments are farther apart than both r together, and meet where the shorter
segments are nearer than both s together.

Of a box of joint values the middle tells the whole box: turning a joint by a changes the distance of two segments by
a R at most, R the farthest that one of them gets from the joint's axis (either: the distance changes by the part of
the motion along the shortest line between them, which both its ends have in common), and sliding by a changes it by a.
Where this is not enough the box is halved.
"""

import math
from typing import Literal

import numpy as np

from armwright.arrays import Array
from armwright.robot.arm import AXES, Arm, Joint, Link

Reason = Literal["Adjacent", "Never", "Always"]

MARGIN = 1e-6  # [m]; files have ten digits, and float64 rounds
MOST_BOXES = 50_000  # for a pair; beyond it nothing is proven


def disabled_collision_pairs(arm: Arm) -> dict[tuple[int, int], Reason]:
    """Pairs of links with a length, counted from 0, and why nothing has to be looked for between them.

    Adjacent: nothing solid or nothing that moves is between them. Never, Always: they meet in no posture, or in every
    one, within the joints' limits.
    """
    solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
    pairs: dict[tuple[int, int], Reason] = {}
    for place, first in enumerate(solid):
        for second in solid[place + 1 :]:
            still = all(joint.kind == "fixed" for joint in arm.joints[first + 1 : second + 1])
            neighbours = second == solid[place + 1]
            reason = "Adjacent" if still or neighbours else _proven(arm, first, second)
            if reason is not None:
                pairs[first, second] = reason
    return pairs


def _proven(arm: Arm, first: int, second: int) -> Reason | None:
    """Never or Always; None where neither is so, or is not found out with MOST_BOXES boxes."""
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
    while len(centres) and done + len(centres) <= MOST_BOXES:
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
    """The most that the distance of the first and the last link changes by joint j [m/rad] or [m/m].

    links[j] comes before joint j and links[j + 1] after it. A link that the joint carries has its end within its
    length across the axis of it; all others may stand anyhow.
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
    """Each box as two, cut across the joint that matters most."""
    rows = np.arange(len(centres))
    widest = np.argmax(halves * rates, axis=1)
    halves = halves.copy()
    halves[rows, widest] /= 2
    step = np.zeros_like(halves)
    step[rows, widest] = halves[rows, widest]
    return np.concatenate([centres - step, centres + step]), np.concatenate([halves, halves])


def _distances(joints: tuple[Joint, ...], links: tuple[Link, ...], moving: list[int], q: Array) -> tuple[Array, Array]:
    """(B,) and (B,): between the segments of the first and the last link, and between the shorter ones within [m]."""
    frames, places = np.broadcast_to(np.eye(3), (len(q), 3, 3)), np.zeros((len(q), 3))
    for j, joint in enumerate(joints):
        places = places + frames @ np.array(links[j].offset)
        if j in moving:
            values = q[:, moving.index(j)]
            if joint.kind == "prismatic":
                places = places + frames[:, :, AXES.index(joint.axis)] * values[:, None]
            else:
                frames = frames @ _rotations(joint, values)
    start, end = np.zeros_like(places), np.broadcast_to(np.array(links[0].offset), places.shape)
    other_end = places + frames @ np.array(links[-1].offset)
    cut, other_cut = (_inset(link) / link.length for link in (links[0], links[-1]))
    inner = (*_shortened(start, end, cut), *_shortened(places, other_end, other_cut))
    return segment_distance(start, end, places, other_end), segment_distance(*inner)


def _shortened(a: Array, b: Array, cut: float) -> tuple[Array, Array]:
    return a + cut * (b - a), b - cut * (b - a)


def _rotations(joint: Joint, angles: Array) -> Array:
    """(B, 3, 3)"""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[joint.axis]
    matrices = np.tile(np.eye(3), (len(angles), 1, 1))
    matrices[:, i, i] = matrices[:, j, j] = np.cos(angles)
    matrices[:, j, i] = np.sin(angles)
    matrices[:, i, j] = -matrices[:, j, i]
    return matrices


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """(B,) the distance between the segments a b and c d, each (B, 3) [m].

    It is that of an end to the other segment, or of the two lines where their nearest points are on both.
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
    """(B,) of points to segments."""
    along = b - a
    square = _dot(along, along)
    t = np.clip(_dot(p - a, along) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    return np.linalg.norm(p - a - t[:, None] * along, axis=1)


def _dot(u: Array, v: Array) -> Array:
    return np.einsum("bi,bi->b", u, v)
