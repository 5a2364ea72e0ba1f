"""Rules that improve a study's front from its finished trials."""

import itertools
from collections.abc import Callable

import numpy as np

from armwright.arrays import Array
from armwright.proposers.rule_helpers import MIDDLE, draw_gap
from armwright.runs.history import FrontMember, History
from armwright.spaces.parameters import Design

PULL = 0.1  # base displacement [m] if all targets are missed in one direction
REACHED = 0.005  # error [m] below which a target no longer pulls the base
BENT = 0.35  # mean angle [rad] above which a joint is bent
TRIM = 0.8  # scale of a trimmed link
SCALES = (0.4, 1.6)  # smallest and largest


def members_inside(history: History) -> list[FrontMember]:
    """Return the front members inside the reference box, sorted by position error; none without a box."""
    corner = history.reference_point
    return [] if corner is None else [m for m in history.front if np.all(np.array(m.values) < corner)]


def fill(history: History, inside: list[FrontMember], rng: np.random.Generator) -> tuple[Design, str]:
    """Return a design for the middle of a wide gap of the front.

    Neighbours with equal joints are interpolated. Otherwise one neighbour is scaled, since torque grows with the square
    of the length, and its base is moved towards the targets that it misses.
    """
    assert history.reference_point is not None
    most_error, most_torque = history.reference_point[:2]
    corners = [(0.0, most_torque), *((m.values[0], m.values[1]) for m in inside), (most_error, 0.0)]
    steps = list(itertools.pairwise(corners))
    k = draw_gap([(end[0] - start[0]) * (start[1] - end[1]) for start, end in steps], rng)  # by the area of each
    share = float(rng.uniform(*MIDDLE))
    sides = inside[max(0, k - 1) : k + 1]  # one neighbour at the edges of the reference box
    if len(sides) == 2:
        low, high = sides
        gap = f"the front's gap between trials {low.number} and {high.number}"
        if low.design.joints == high.design.joints:
            design = between(low.design, high.design, share, history)
            return design, f"fills {gap}: between the two; {describe(design)}"
    else:
        gap = f"the front's end of least {'position error' if k == 0 else 'torque'}"
    side = sides[int(rng.integers(len(sides)))]
    (_, more), (_, less) = steps[k]
    scale = float(np.clip(np.sqrt((share * more + (1.0 - share) * less) / max(side.values[1], 1e-9)), *SCALES))
    design = scaled(history, side, scale)
    return design, f"fills {gap}: trial {side.number} at {scale:.2f} of its size; {describe(design)}"


def trim(history: History, inside: list[FrontMember], rng: np.random.Generator) -> tuple[Design, str]:
    """Shorten the link of a front member that loads the joints most: length times torque of the joints before it."""
    member = inside[int(rng.integers(len(inside)))]
    carried = by_module(history, member, np.abs(history.evaluation([member.number]).motor_torques[0]).mean(axis=0))
    links = np.array(member.design.links)
    j = int(np.argmax(links * np.cumsum(carried)))
    links[j] *= TRIM
    space = history.problem.space
    design = space.clipped(pulled_origin(history, member), member.design.joints, links, member.design)
    return design, f"trims link {j + 1} of trial {member.number}, which weighs most on its joints; {describe(design)}"


def swap(history: History, inside: list[FrontMember], rng: np.random.Generator) -> tuple[Design, str]:
    """Change the axis of the least used joint of a front member, often to Y, which carries no gravity torque."""
    member = inside[int(rng.integers(len(inside)))]
    angles = history.evaluation([member.number]).q[0]  # (T, D) [rad]
    j = int(np.argmin(by_module(history, member, np.ptp(angles, axis=0))))
    joints, types = member.design.joints, history.problem.space.joint_types
    others = [kind for kind in types if kind != joints[j]] or [joints[j]]
    other = "Y" if "Y" in others and rng.random() < 0.5 else others[int(rng.integers(len(others)))]
    design = history.problem.space.clipped(
        pulled_origin(history, member), joints[:j] + other + joints[j + 1 :], member.design.links, member.design
    )
    return design, f"turns joint {j + 1} of trial {member.number}, the least used, into {other}; {describe(design)}"


Rule = Callable[[History, list[FrontMember], np.random.Generator], tuple[Design, str]]
RULES: dict[str, Rule] = {"fill": fill, "trim": trim, "swap": swap}


def between(a: Design, b: Design, share: float, history: History) -> Design:
    """Interpolate from `b` (share 0) to `a` (1), two designs with equal joints."""
    origin, links = (
        share * np.array(u) + (1.0 - share) * np.array(v) for u, v in ((a.origin, b.origin), (a.links, b.links))
    )
    return history.problem.space.clipped(origin, a.joints, links, a)


def scaled(history: History, member: FrontMember, scale: float) -> Design:
    """Return the member with its links scaled about the shoulder and its base moved towards missed targets."""
    angles = by_module(history, member, np.abs(history.evaluation([member.number]).q[0]).mean(axis=0))
    height = upright_height(member.design, angles)
    origin = pulled_origin(history, member) + np.array([0.0, 0.0, (1.0 - scale) * height])
    links = scale * np.array(member.design.links)
    return history.problem.space.clipped(origin, member.design.joints, links, member.design)


def by_module(history: History, member: FrontMember, values: Array) -> Array:
    """Return the maximum (M,) of the joint values (J,) over the joints of each module."""
    modules = np.array(member.design.module_of_joint)
    return np.array([values[: len(modules)][modules == m].max() for m in range(len(member.design.joints))])


def upright_height(design: Design, angles: Array) -> float:
    """Return the height [m] of the links that stay upright, up to the first bent R or P joint.

    `angles` (M,) are mean absolute joint angles [rad].
    """
    height = 0.0
    for kind, bend, link in zip(design.joints, angles, design.links, strict=True):
        if kind != "Y" and bend > BENT:
            break
        height += link
    return height


def pulled_origin(history: History, member: FrontMember) -> Array:
    """Return the base (3,) [m], moved along the mean direction to missed targets: a step of gradient descent."""
    evaluation = history.evaluation([member.number])
    miss = evaluation.targets - evaluation.reached[0]  # (T, 3)
    error = evaluation.position_error[0][:, None]  # (T, 1)
    reached = np.maximum(evaluation.target_arrays.stated_tolerance[:, None], REACHED)  # (T, 1)
    direction = np.where(error > reached, miss / np.maximum(error, reached), 0.0)
    return np.array(member.design.origin) + PULL * direction.mean(axis=0)


def describe(design: Design) -> str:
    """Describe joints, total length and base."""
    x, y, z = design.origin
    return f"{design.joints}, {sum(design.links):.2f} m long, base at ({x:.2f}, {y:.2f}, {z:.2f}) m"
