"""Rules that improve a study's front from its finished trials."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.proposers.rule_helpers import MIDDLE, draw_gap
from armwright.runs.history import FrontMember, History
from armwright.spaces.parameters import Design

PULL = 0.1  # base displacement [m] if all targets are missed in one direction
REACHED = 0.005  # error [m] below which a target no longer pulls the base
BENT = 0.35  # mean angle [rad] above which a joint is bent
TRIM = 0.8  # scale of a trimmed link
LEAST_SCALE, MAX_SCALE = 0.4, 1.6


@dataclass(frozen=True)
class Gap:
    """A step of the front between two neighbours."""

    area: float  # hypervolume that an ideal design in the gap would add
    low: FrontMember | None  # neighbour with the smaller position error; None at the edge of the reference box
    high: FrontMember | None  # neighbour with the smaller torque; None at the edge of the reference box
    more: float  # α-scaled torque of `low`
    less: float  # α-scaled torque of `high`

    @property
    def description(self) -> str:
        """The neighbours, as text."""
        if self.low is None:
            return "the front's end of least position error"
        if self.high is None:
            return "the front's end of least torque"
        return f"the front's gap between trials {self.low.number} and {self.high.number}"


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
    gap = wide_gap(inside, history.reference_point, rng)
    share = float(rng.uniform(*MIDDLE))
    low, high = gap.low, gap.high
    if low is not None and high is not None and low.design.joints == high.design.joints:
        design = between(low.design, high.design, share, history)
        return design, f"fills {gap.description}: between the two; {describe(design)}"
    sides = [side for side in (low, high) if side is not None]
    side = sides[int(rng.integers(len(sides)))]
    torque = share * gap.more + (1.0 - share) * gap.less
    scale = float(np.clip(np.sqrt(torque / max(side.values[1], 1e-9)), LEAST_SCALE, MAX_SCALE))
    design = scaled(history, side, scale)
    return design, f"fills {gap.description}: trial {side.number} at {scale:.2f} of its size; {describe(design)}"


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


def wide_gap(inside: list[FrontMember], reference_point: tuple[float, ...], rng: np.random.Generator) -> Gap:
    """Draw a step of the front by its area, including the steps at the edges of the reference box."""
    sides: list[FrontMember | None] = [None, *inside, None]
    corners = [(0.0, reference_point[1]), *((m.values[0], m.values[1]) for m in inside), (reference_point[0], 0.0)]
    gaps: list[Gap] = []
    for k, ((error, torque), (more_error, less_torque)) in enumerate(itertools.pairwise(corners)):
        area = (more_error - error) * (torque - less_torque)
        gaps.append(Gap(area, sides[k], sides[k + 1], torque, less_torque))
    return gaps[draw_gap([gap.area for gap in gaps], rng)]


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
