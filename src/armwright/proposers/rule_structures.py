"""Arm structures that a designer would try, sized and placed by the targets."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from armwright.arrays import Array
from armwright.problem.problem import Problem
from armwright.robot.arm import Vector
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design

INNER_PULL = 0.05  # weight of targets within reach, relative to those beyond
ROUNDS = 60
SIZES = 24
LONGEST, SLACK = 1.25, 0.05  # largest length: share of the needed length, and beyond it [m]
FLAT = 0.1  # largest spread of targets in a plane, relative to the needed length
SWAPPED_AXES = str.maketrans("RP", "PR")


def shoulders(points: Array, reach: Array) -> Array:
    """Return the points (N, 3) [m] from which the targets are least out of reach in total.

    The targets are (T, 3) [m], the reach of the arms is (N,) [m].
    Minimises Σ max(0, ‖p_i - c‖ - reach) by Weiszfeld's iteration. The sum is flat where all targets are in reach, so
    these have a small weight. A point lies on every symmetry plane of the targets.
    """
    centre = np.repeat(points.mean(axis=0)[None], len(reach), axis=0)  # (N, 3)
    for _ in range(ROUNDS):
        distance = np.maximum(np.linalg.norm(points - centre[:, None], axis=-1), 1e-3)  # (N, T)
        weight = np.where(distance > reach[:, None], 1.0, INNER_PULL) / distance
        centre = weight @ points / weight.sum(axis=1)[:, None]
    return centre


def median(points: Array) -> Array:
    """Return the geometric median (3,) [m] of the targets, from which their distances are least in total."""
    return shoulders(points, np.zeros(1))[0]


def needed_length(points: Array) -> float:
    """Return the distance [m] from the geometric median to the farthest of `points` (T, 3)."""
    return float(np.linalg.norm(points - median(points), axis=1).max())


@dataclass(frozen=True)
class Structure:
    """A type of arm without its size and position."""

    name: str  # for the reason of a proposal
    joints: str  # joint types, from the base
    links: tuple[float, ...]  # link lengths, relative to the reach; 0 for the shortest that the space allows
    why: str  # for the reason of a proposal
    # base relative to the shoulder, in reaches. A base below lets the arm, which starts upright, bring its middle to
    # the targets
    offset: Vector = (0.0, 0.0, 0.0)
    # base relative to that [m]. A few centimetres or millimetres to the side decide towards which side the first joint
    # turns, and keep targets off the line of the straight arm, along which they cannot be approached
    shift: Vector = (0.0, 0.0, 0.0)
    flat_along: int | None = None  # axis across which the targets must lie in a plane; None if it suits all targets

    @property
    def mirrored(self) -> "Structure":
        """The structure with x and y exchanged, so that its first joint turns about the other axis."""
        (x, y, z), (a, b, c) = self.offset, self.shift
        return replace(self, joints=self.joints.translate(SWAPPED_AXES), offset=(y, x, z), shift=(b, a, c))


# The first five suit all targets. The lengths and offsets of the first four were found by searches on random tasks
# (`random_task`, seeds from 1000 on) and on grids, rings and boxes. The last four were read off the answers of a
# language model.
STRUCTURES = (
    Structure(
        "upper-arm", "RPYP", (0.03, 0.40, 0.03, 0.55),
        "shoulder without length, then upper arm and forearm",
        offset=(-0.04, -0.03, -0.015),
    ),
    Structure(
        "elbow", "RPYR", (0.07, 0.48, 0.14, 0.96),
        "universal shoulder below the targets, long forearm",
        offset=(-0.05, 0.01, -0.33),
    ),
    Structure(
        "forearm", "RPYR", (0.09, 0.39, 0.25, 0.78),
        "universal shoulder at the targets' own centre, long forearm",
        offset=(-0.05, 0.06, 0.01),
    ),
    Structure(
        "mast", "YYYP", (0.36, 0.14, 0.16, 0.09),
        "vertical axes, on which gravity has no torque, carry the tip up to the targets' centre",
        offset=(0.0, 0.015, -1.04),
    ),
    Structure(
        "column", "YYYY", (0.25, 0.25, 0.25, 0.25),
        "no torque at all: the tip stands still at the point that is nearest to all targets",
        offset=(0.0, 0.0, -1.0),
    ),
    # P turns level from a base at the targets' height, so the axes behind it stand vertical and carry nothing. The
    # short third link folds the arm to the side.
    Structure(
        "lying", "PRRR", (0.0, 0.38, 0.16, 0.46),
        "base at the targets' height; one P lays the arm down and the axes after it stand vertical",
        shift=(0.03, 0.015, 0.0), flat_along=2,
    ),
    # Two short P reach beyond the limits of one, so the arm also turns upside down. R stands vertical for targets at
    # the base's height, where P has no lever.
    Structure(
        "turnover", "PPRY", (0.0, 0.0, 0.5, 0.5),
        "two short P turn the arm all the way round; R stands vertical at the height of the base",
        shift=(-0.022, 0.0, -0.028), flat_along=0,
    ),
    # A link that stands or hangs has no lever; only the arm behind it, which R holds out, has one.
    Structure(
        "pole", "PPRY", (0.0, 0.5, 0.25, 0.25),
        "P turns a pole up or down, where it has no lever, and R holds an arm out at its end",
        shift=(-0.003, 0.0, -0.04), flat_along=0,
    ),
)  # fmt: skip


def fitted(structure: Structure, problem: Problem, lengths: Array) -> list[Design]:
    """Size and place a structure for the problem's targets, within its space.

    The lengths (N,) [m] are those of the arms, all links together.
    """
    space = problem.space
    reach = lengths / sum(structure.links)
    origins = shoulders(problem.task.target_positions, reach) + reach[:, None] * structure.offset + structure.shift
    joints, links = adapted(structure, space)
    return [space.clipped(origin, joints, size * links) for origin, size in zip(origins, reach, strict=True)]


def sizes(problem: Problem) -> Array:
    """Return the lengths (N,) [m] to try, from the shortest arm to one that reaches all targets.

    Error falls with the length and torque grows with its square, so that lengths at equal distances in the power 1.5
    enclose equal areas between neighbours on a front.
    """
    longest = LONGEST * needed_length(problem.task.target_positions) + SLACK
    shortest = min(problem.space.link[0] * problem.space.max_joints, longest)
    return np.linspace(math.pow(shortest, 1.5), math.pow(longest, 1.5), SIZES) ** (2 / 3)


def fitted_structures(problem: Problem) -> Iterator[tuple[Structure, Design]]:
    """Yield the structures that suit a problem, in both orientations and all sizes."""
    points, lengths = problem.task.target_positions, sizes(problem)
    for structure in STRUCTURES:
        for oriented, seen in ((structure, points), (structure.mirrored, points[:, (1, 0, 2)])):
            flat = structure.flat_along
            if flat is None or seen[:, flat].std() < FLAT * needed_length(seen):
                for design in fitted(oriented, problem, lengths):
                    yield structure, design


def adapted(structure: Structure, space: DesignSpace) -> tuple[str, Array]:
    """Return joints and relative links (D,) for a space's number of joints and its types.

    A column of Y joints grows and shrinks at its base. Other arms gain idle Y joints at the end, and lose first their Y
    joints, then their last ones.
    """
    joints, links = structure.joints, list(structure.links)
    column = joints.startswith("Y")
    while len(joints) > space.max_joints:
        j = 0 if column else joints.rfind("Y")
        joints = joints[:j] + joints[j + 1 :] if j >= 0 else joints[:-1]
        k = max(j - 1, 0) if j >= 0 else len(links) - 2
        links[k : k + 2] = [links[k] + links[k + 1]]
    while len(joints) < space.max_joints:
        joints = "Y" + joints if column else joints + "Y"
        k = 0 if column else len(links) - 1
        links[k : k + 1] = [links[k] / 2] * 2
    return "".join(_allowed(kind, space) for kind in joints), np.array(links)


def _allowed(kind: str, space: DesignSpace) -> str:
    choices = (kind, kind.translate(SWAPPED_AXES))
    return next((choice for choice in choices if choice in space.joint_types), space.joint_types[-1])
