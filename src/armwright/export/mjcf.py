"""An arm as MJCF, MuJoCo's own format."""

from xml.etree import ElementTree

from armwright.arm import GRAVITY, Arm, Joint, Link
from armwright.export.shapes import (
    AXIS_VECTORS,
    BOUNDS,
    COLOURS,
    along,
    cylinder_inertia,
    inertia_tensor,
    marker_radius,
    middle,
    number,
    numbers,
    text_of,
    tip_place,
    tip_turn,
)

TYPES = {"revolute": "hinge", "prismatic": "slide"}  # a fixed joint is a body without a joint
SKY = {"builtin": "gradient", "rgb1": "0.97 0.97 0.98", "rgb2": "0.84 0.86 0.90", "width": "64", "height": "384"}
TIP_COLOUR = "0.07 0.07 0.07 1"


def to_mjcf(arm: Arm, name: str = "arm") -> str:
    """The MJCF of an arm: `base`, link_1 on joint_1, …, a site `tip`, and motor_1 on joint_1, ….

    Names, frames, masses, inertias and colours are those of `to_urdf`: link frames stand at their joints, and with all
    joints at 0 they are parallel to the world's. Each joint that moves has a motor with gear 1, limited to the torque
    of its actuator where it has one: its `ctrl` is the torque [N m], or the force [N], on that joint.

    What is drawn is for sight alone. It has no mass, as that of each link is stated, and touches nothing: links overlap
    at their joints, so contacts would push them out of any posture, and arms are searched without collisions, too.

    `python -m mujoco.viewer --mjcf=arm.xml` shows it.
    """
    root = ElementTree.Element("mujoco", model=name)
    # XYZ: roll, pitch and yaw about fixed axes, as in a URDF.
    compiler = {"angle": "radian", "autolimits": "true", "eulerseq": "XYZ", "inertiafromgeom": "false", **BOUNDS}
    ElementTree.SubElement(root, "compiler", compiler)
    ElementTree.SubElement(root, "option", gravity=numbers((0.0, 0.0, -GRAVITY)))
    defaults = ElementTree.SubElement(root, "default")
    ElementTree.SubElement(defaults, "geom", contype="0", conaffinity="0", mass="0")
    world = _add_scene(root, arm)
    body = ElementTree.SubElement(world, "body", name="base", pos=numbers(arm.base))
    place = (0.0, 0.0, 0.0)
    for n, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True), start=1):
        body = ElementTree.SubElement(body, "body", name=f"link_{n}", pos=numbers(place))
        _add_joint(body, f"joint_{n}", joint)
        _add_link(body, joint, link)
        place = link.offset
    turn = tip_turn(arm)
    tip = {"name": "tip", "pos": numbers(tip_place(arm)), "size": number(arm.links[-1].radius), "rgba": TIP_COLOUR}
    if any(turn):
        tip["euler"] = numbers(turn)
    ElementTree.SubElement(body, "site", tip)
    actuators = ElementTree.SubElement(root, "actuator")
    for n, joint in enumerate(arm.joints, start=1):
        if joint.kind != "fixed":
            motor = {"name": f"motor_{n}", "joint": f"joint_{n}", "gear": "1"}
            if joint.effort is not None:
                motor["ctrlrange"] = f"{number(-joint.effort)} {number(joint.effort)}"
            ElementTree.SubElement(actuators, "motor", motor)
    return text_of(root)


def _add_scene(root: ElementTree.Element, arm: Arm) -> ElementTree.Element:
    """The empty world, with light from one side and all that the arm can reach in sight."""
    x, y, z = arm.base
    size = arm.reach + arm.links[0].radius  # never 0
    # The viewer's camera stands 1.5 extents away and sees 22.5 degrees to each side: size = 1.5 extents * sin(22.5).
    ElementTree.SubElement(root, "statistic", center=numbers(arm.base), extent=number(1.75 * size))
    assets = ElementTree.SubElement(root, "asset")
    ElementTree.SubElement(assets, "texture", {"type": "skybox", **SKY})
    for material, rgba in COLOURS.items():
        ElementTree.SubElement(assets, "material", name=material, rgba=rgba)
    world = ElementTree.SubElement(root, "worldbody")
    ElementTree.SubElement(world, "light", pos=numbers((x - size, y - size, z + 2.0 * size)), dir="1 1 -2")
    return world


def _add_joint(body: ElementTree.Element, name: str, joint: Joint) -> None:
    if joint.kind == "fixed":
        return
    limits = f"{number(joint.lower)} {number(joint.upper)}"
    attributes = {"name": name, "type": TYPES[joint.kind], "axis": AXIS_VECTORS[joint.axis], "range": limits}
    ElementTree.SubElement(body, "joint", attributes)


def _add_link(body: ElementTree.Element, joint: Joint, link: Link) -> None:
    euler = numbers(along(link.offset))
    inertial = {"pos": numbers(link.total_com), "mass": number(link.total_mass)}
    if link.end_mass == 0.0:
        across, around = cylinder_inertia(link)
        inertial |= {"euler": euler, "diaginertia": f"{across} {across} {around}"}
    else:
        tensor = inertia_tensor(link)
        places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        inertial["fullinertia"] = " ".join(f"{tensor[place]:.17g}" for place in places)
    ElementTree.SubElement(body, "inertial", inertial)
    if link.length > 0.0:
        cylinder = {"type": "cylinder", "size": f"{number(link.radius)} {number(link.length / 2.0)}"}
        ElementTree.SubElement(
            body, "geom", {**cylinder, "pos": numbers(middle(link)), "euler": euler, "material": "link"}
        )
    marker = {"type": "sphere", "size": number(marker_radius(link)), "material": f"joint_{joint.axis}"}
    ElementTree.SubElement(body, "geom", marker)
