"""Arm structures that a designer would try first, and their fit to a task and a space."""

from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.problem.problem import Problem
from armwright.proposers.rule_geometry import affordable_length, needed_length, shoulder
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Design

LONGEST = 10.0  # times the needed length; a bound in place of the torque budget
SLACK = 0.03  # length [m] beyond the needed length
SWAPPED_AXES = str.maketrans("RP", "PR")


@dataclass(frozen=True)
class Structure:
    """A type of arm without its size and position.

    Attributes:
        name: for the reason of a proposal.
        joints: for targets that spread more along x than along y; R and P are exchanged otherwise.
        links: link lengths, relative to the reach.
        offset: base relative to the shoulder, in reaches. A base below lets the arm, which starts upright, bring its
            middle to the targets; a small sideways offset keeps targets off the line of the straight arm, along which
            they cannot be approached.
        share: reach, relative to the length that the torque budget allows.
        why: for the reason of a proposal.
    """

    name: str
    joints: str
    links: tuple[float, ...]
    offset: tuple[float, float, float]
    share: float
    why: str


# Orders that are known from practice (shoulder and elbow as in a human arm, SCARA, mast, the paper's own solutions),
# with the lengths and offsets that a search found on random tasks (`random_task`, seeds 1000 to 1429) and on
# grids, rings and boxes; in the order of what each adds to those before it.
OPENING = (
    Structure(
        "elbow", "RPYR", (0.07, 0.48, 0.14, 0.96), (-0.05, 0.01, -0.33), 0.34,
        "universal shoulder amid the targets, half of the torque",
    ),
    Structure(
        "post", "RPRP", (0.28, 0.09, 0.26, 0.12), (-0.06, 0.10, -0.12), 0.14,
        "nearly no lever: the least torque, from where the targets are nearest",
    ),
    Structure(
        "two-arm", "PRPR", (0.13, 0.78, 0.80, 0.03), (-0.03, 0.04, -0.36), 0.51,
        "shoulder and elbow in the other plane, two long links that fold",
    ),
    Structure(
        "wrist", "RPRP", (0.04, 0.37, 0.55, 0.04), (-0.01, -0.05, -0.16), 0.34,
        "universal shoulder and elbow, short links at both ends",
    ),
    Structure(
        "forearm", "RPYR", (0.09, 0.39, 0.25, 0.78), (-0.05, 0.06, 0.01), 0.53,
        "universal shoulder at the targets' own centre, long forearm",
    ),
    Structure(
        "mast", "YYYP", (0.36, 0.14, 0.16, 0.09), (0.0, 0.015, -1.04), 0.19,
        "vertical axes, on which gravity has no torque, carry the tip up to the targets' centre",
    ),
    Structure(
        "long-arm", "RPYR", (0.05, 0.09, 0.18, 0.50), (-0.025, 0.0, -0.11), 1.63,
        "all the reach that is needed or affordable",
    ),
    Structure(
        "scara", "PRRR", (0.06, 0.45, 0.45, 0.12), (-0.05, 0.02, 0.01), 0.42,
        "base at the targets' height; one P lays the arm down and the axes after it stand vertical",
    ),
)  # fmt: skip


def fitted(structure: Structure, problem: Problem, torque: float) -> Design:
    """Size and place a structure for the problem's targets, within its space.

    Args:
        structure: type of arm.
        problem: gives targets and space.
        torque: α-scaled budget; inf for none.
    """
    space, points = problem.space, problem.task.target_positions
    reach = sized(structure.share, problem, torque)
    joints, offset = structure.joints, np.array(structure.offset)
    if across(points):
        joints, offset = joints.translate(SWAPPED_AXES), offset[[1, 0, 2]]
    origin = shoulder(points, reach) + reach * offset
    return space.clipped(
        origin, adapted_joints(joints, space), reach * np.array(divided(structure.links, space.max_joints))
    )


def sized(share: float, problem: Problem, torque: float) -> float:
    """Return a share of the reach [m] that the torque allows, limited to little more than the targets need."""
    points = problem.task.target_positions
    needed = needed_length(points)
    affordable = share * affordable_length(problem.space, len(points), torque, LONGEST * (needed + SLACK))
    return min(affordable, (0.6 + 0.5 * share) * needed + SLACK)


def across(points: Array) -> bool:
    """Return whether the targets spread more along y than along x.

    If so, the first joint should turn about y: gravity on an arm stretched along that axis has no torque about it.
    """
    spread = points.std(axis=0)
    return bool(spread[0] < spread[1])


def adapted_joints(joints: str, space: DesignSpace) -> str:
    """Adapt joint types to a space: shorten or continue them to its number of joints, of the allowed types."""
    while len(joints) < space.max_joints:
        joints += joints[-2:].translate(SWAPPED_AXES)
    return "".join(_allowed(kind, space) for kind in joints[: space.max_joints])


def _allowed(kind: str, space: DesignSpace) -> str:
    choices = (kind, kind.translate(SWAPPED_AXES))
    return next((choice for choice in choices if choice in space.joint_types), space.joint_types[-1])


def divided(links: tuple[float, ...], n: int) -> list[float]:
    """Divide the total length into `n` links by joining the last or halving the longest."""
    parts = list(links)
    while len(parts) > n:
        parts[-2:] = [parts[-2] + parts[-1]]
    while len(parts) < n:
        longest = int(np.argmax(parts))
        parts[longest : longest + 1] = [parts[longest] / 2] * 2
    return parts
