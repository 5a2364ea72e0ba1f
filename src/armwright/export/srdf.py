"""An arm as SRDF, what MoveIt needs beside its URDF."""

from xml.etree import ElementTree

from armwright.arm import Arm
from armwright.export.collisions import settled_pairs
from armwright.export.limits import home_of
from armwright.export.shapes import number, text_of

GROUP = "arm"


def to_srdf(arm: Arm, name: str = "arm") -> str:
    """The SRDF that belongs to `to_urdf` of the same arm and name: the group `arm` from `base` to `tip`, and its home.

    Home is all joints at 0, or at the limit nearest to it. Collisions are not looked for between neighbours, and
    where it is proven that two links never or always meet (`settled_pairs`). There is no end effector, as an arm ends
    at its tip, and no virtual joint, as the URDF itself has `world`.
    """
    robot = ElementTree.Element("robot", name=name)
    group = ElementTree.SubElement(robot, "group", name=GROUP)
    ElementTree.SubElement(group, "chain", base_link="base", tip_link="tip")
    state = ElementTree.SubElement(robot, "group_state", name="home", group=GROUP)
    for n, joint in enumerate(arm.joints, start=1):
        if joint.kind != "fixed":
            ElementTree.SubElement(state, "joint", name=f"joint_{n}", value=number(home_of(joint)))
    for (first, second), reason in settled_pairs(arm).items():
        pair = {"link1": f"link_{first + 1}", "link2": f"link_{second + 1}", "reason": reason}
        ElementTree.SubElement(robot, "disable_collisions", pair)
    return text_of(robot)
