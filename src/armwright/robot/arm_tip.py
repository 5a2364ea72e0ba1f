"""Where the arm of a URDF ends: at the frame of its tool, before the joints of a gripper.

A last joint moves a gripper if its name says so, if a finger or a frame of the tool is beside it, or if it moves like a
jaw and no such frame is beyond it. A frame beyond it, or a range that no jaw has, are signs of the arm. If the signs
disagree, the user has to name the tip.
"""

import math
import re
from collections.abc import Mapping, Sequence

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError
from armwright.robot.urdf_xml import UrdfJoint

FINGERS = 2  # longest chain of joints of a branch that counts as a finger
STROKE, OPENING, WIDEST = 0.1, 2.1, 1.5 * math.pi  # of a jaw that slides [m], that turns, and of any that turns [rad]
SHUT = 0.15  # of the range of a jaw that turns: 0 is at most that far from one of its limits
ACROSS = 0.5  # largest cosine of the angle between the axes of a jaw and of the joint before it
FEWEST = 3  # joints of an arm before a joint that is a jaw by its motion
GRIPPER = re.compile(r"jaw|finger|( |_|joint)grip(per)?(_?joint)?\d*$", re.IGNORECASE)  # in names of link and joint
FRAMES = re.compile(r"(^|[_/])(tool\d*|tcp|tip|eef?|end_?effector|flange|frame)(_|$)", re.IGNORECASE)  # of a tool
# In names of other links
OTHERS = re.compile("jaw|finger|camera|optical|depth|imu|sensor|collision|_sc$", re.IGNORECASE)


def find_tip(base: str, joints: Mapping[str, Sequence[UrdfJoint]], where: str) -> str:
    """Return the link at the end of the only chain of a URDF from the base on; joints: those on each link.

    Raises:
        ArmError: If there are several chains, or it is not clear whether the last joint moves a gripper.
    """
    tree = _Tree(base, joints, where)
    link, axis = base, np.zeros(3)
    before: list[UrdfJoint] = []
    while branches := tree.branches(link, before):
        joint = branches[0]
        axis = joint.origin.rotation.T @ axis  # of the last joint that moves, in the frame beyond this one
        if len(branches) > 1 or (before and tree.is_gripper(joint, before, axis)):
            break
        if joint.kind != "fixed":
            axis = joint.axis
            before.append(joint)
        link = joint.child
    return tree.frames[before[-1].child if before else base][2]


class _Tree:
    """The links beyond a base."""

    def __init__(self, base: str, joints: Mapping[str, Sequence[UrdfJoint]], where: str) -> None:
        self._joints, self._where = joints, where
        self._deepest: dict[str, int] = {}  # independent joints of the longest chain beyond each link
        # What is fixed to each link: 1 for a frame of a tool, -1 for one of something else, how far, its name
        self.frames: dict[str, tuple[int, int, str]] = {}
        links = [base]
        for link in links:
            links += [joint.child for joint in joints[link]]
        for link in reversed(links):
            self._deepest[link] = max(map(self._beyond, joints[link]), default=0)
            own = -1 if OTHERS.search(link) else int(FRAMES.search(link) is not None)
            fixed = (self.frames[joint.child] for joint in joints[link] if joint.kind == "fixed")
            ends = [(own, 0, link), *((rank, n + 1, name) for rank, n, name in fixed)]
            self.frames[link] = max(ends, key=lambda end: end[:2])

    def _beyond(self, joint: UrdfJoint) -> int:
        """Return the number of independent joints of the longest chain from this joint on."""
        return joint.moves + self._deepest[joint.child]

    def branches(self, link: str, before: Sequence[UrdfJoint]) -> list[UrdfJoint]:
        """Return the joint in which an arm goes on; none at its end, several if these are fingers."""
        joints = [joint for joint in self._joints[link] if self._beyond(joint)]
        if not joints:  # but perhaps one that is coupled to a joint of the arm
            return [joint for joint in self._joints[link] if joint.mimics in [one.name for one in before]]
        arms = [joint for joint in joints if self._beyond(joint) > FINGERS]
        tools = [joint for joint in joints if joint.kind != "fixed" and self.frames[joint.child][0] > 0]
        if len(arms) > 1 or (len(joints) > 1 and not arms and (tools or not before)):
            names = ", ".join(joint.child for joint in joints)
            raise ArmError(f'{self._where} branches at the link "{link}" to {names}; name the tip (--tip LINK)')
        return arms or joints

    def is_gripper(self, joint: UrdfJoint, before: Sequence[UrdfJoint], axis: Array) -> bool:
        """Return True if a joint moves a gripper; axis: (3,) of the joint before it, in the frame of its child."""
        is_coupled = joint.mimics in [one.name for one in before]
        if self._beyond(joint) > 1 or joint.kind == "fixed" or is_coupled:
            return False
        beside, beyond = self.frames[joint.parent], self.frames[joint.child]
        lower, upper, slides = joint.lower or 0.0, joint.upper or 0.0, joint.kind == "prismatic"
        travel = math.inf if joint.kind == "continuous" else upper - lower
        is_shut = slides or min(-lower, upper) <= SHUT * travel  # at 0
        is_jaw = is_shut and 0.0 < travel <= (STROKE if slides else OPENING)
        is_across = len(before) >= FEWEST and abs(float(axis @ joint.axis)) < ACROSS
        last, own = (GRIPPER.search(f"{one.child} {one.name}") for one in (before[-1], joint))
        signs = {
            "its name": own and not last,
            "its motion": is_jaw and is_across and beyond[0] < 1,
            "the finger beside it": any(one.mimics == joint.name for one in self._joints[joint.parent]),
            f'"{beside[2]}" beside it': min(beside[:2]) > 0,
        }
        others = {f'"{beyond[2]}" beyond it': beyond[0] > 0, "its range": not slides and travel > WIDEST}
        gripper, arm = (" and ".join(sign for sign, holds in kind.items() if holds) for kind in (signs, others))
        if gripper and arm:
            raise ArmError(
                f'{self._where}: the joint "{joint.name}" may move a gripper ({gripper}) or the arm ({arm}); name the '
                f"tip: --tip {self.frames[before[-1].child][2]} without this joint, --tip {beyond[2]} with it"
            )
        return bool(gripper)
