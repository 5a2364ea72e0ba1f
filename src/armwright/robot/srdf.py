"""An arm as SRDF, which MoveIt needs in addition to its URDF."""

from xml.etree.ElementTree import Element, SubElement

from armwright.robot.arm import Arm
from armwright.robot.collision_pairs import disabled_collision_pairs, joined_by_column, joined_by_motors
from armwright.robot.link_geometry import home_position, moving_joints, number, to_xml

GROUP = "arm"


def to_srdf(arm: Arm, name: str = "arm") -> str:
    """Return the SRDF for the URDF of the same arm and name: the group `arm` from `base` to `tip`, and its home.

    Home is all joints at 0, or at the limit closest to it. Collision checks are disabled between neighbours, and for
    links that provably never or always collide (`disabled_collision_pairs`), between motor bodies and the links that
    they join (`joined_by_motors`), and between the column and what stands on it (`joined_by_column`). There is no end
    effector, since an arm ends at its tip, and no virtual joint, since the URDF itself has `world`.
    """
    robot = Element("robot", name=name)
    group = SubElement(robot, "group", name=GROUP)
    SubElement(group, "chain", base_link="base", tip_link="tip")
    state = SubElement(robot, "group_state", name="home", group=GROUP)
    for n, joint in moving_joints(arm):
        SubElement(state, "joint", name=f"joint_{n}", value=number(home_position(joint)))
    for (first, second), reason in disabled_collision_pairs(arm).items():
        pair = {"link1": f"link_{first + 1}", "link2": f"link_{second + 1}", "reason": reason}
        SubElement(robot, "disable_collisions", pair)
    for joint, link in joined_by_motors(arm):
        pair = {"link1": f"motor_{joint + 1}", "link2": f"link_{link + 1}", "reason": "Adjacent"}
        SubElement(robot, "disable_collisions", pair)
    if arm.column is not None:
        motors, links = joined_by_column(arm)
        for name in (*(f"motor_{j + 1}" for j in motors), *(f"link_{n + 1}" for n in links)):
            SubElement(robot, "disable_collisions", {"link1": "column", "link2": name, "reason": "Adjacent"})
    return to_xml(robot)
