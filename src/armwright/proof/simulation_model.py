"""The MJCF of an arm in its task: with servos, friction, payload, obstacles, contacts and a keyframe per target.

`robot.mjcf` writes the arm alone. Here links are capsules, the solids of which `kinematics.clearance` measures the
distances, and touch exactly what it counts.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import accumulate
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from armwright.arrays import Array
from armwright.exceptions import ArmError
from armwright.problem.scene import Scene
from armwright.robot.arm import GRAVITY, Arm, Joint
from armwright.robot.collision_pairs import joined_by_column, joined_by_motors, joined_by_tip
from armwright.robot.link_geometry import Segment, moving_joints, segments, tip_position, tip_rpy
from armwright.robot.mjcf import (
    COMPILER,
    add_column,
    add_inertial,
    add_motor,
    add_scene,
    add_tip,
    add_tool,
    joint_attributes,
)
from armwright.robot.xml_text import number, numbers, to_xml
from armwright.tasks.obstacles import Obstacle, Solid
from armwright.tasks.tip_rules import Solids

TIMESTEP = 0.001  # [s]
NOTHING = 1e-9  # mass [kg] and moments of inertia [kg m²] of a payload that is not carried
# MuJoCo softens friction by default: a slow joint does not meet the whole of it, so the torque that should overcome it
# pushes the arm past where it should stop.
STIFF_FRICTION = {"solreffriction": f"{2.0 * TIMESTEP:g} 1", "solimpfriction": "0.999 0.999 0.001"}
STIFFNESS = 20.0  # [1/rad] or [1/m] position gain of a joint without actuator, relative to its peak torque

# Geoms touch if a type of one is among the affinities of the other.
OBSTACLE, LINK = 1, 2
TOUCHES_ALL = {"contype": str(LINK), "conaffinity": str(LINK | OBSTACLE)}
TOUCHES_LINKS = {"contype": str(LINK), "conaffinity": str(LINK)}
TOUCHES_NOTHING = {"contype": "0", "conaffinity": "0"}
# Contacts of tool and payload are measured, without force: what they may touch, they may touch.
NO_FORCE = {"priority": "1", "condim": "1", "solref": "-1e-6 -1e-6", "solimp": "0.0001 0.0001 0.001"}
TIP = {"contype": "0", "conaffinity": str(LINK | OBSTACLE), **NO_FORCE}
COLOURS = {"obstacle": "0.55 0.55 0.58 0.5", "target": "0.84 0.16 0.16 0.6", "payload": "0.95 0.77 0.06 0.7"}


def to_simulation_mjcf(
    arm: Arm, scene: Scene, target_names: Sequence[str], postures: Array, peak_torques: Array, name: str = "arm"
) -> str:
    """Return the MJCF of an arm in its surroundings.

    Moving joints are joint_1, joint_2, …, each with the actuators servo_1, … (position) and ff_1, … (torque), whose sum
    is limited to the actuator's peak torque, before the friction of its gear; `user` is this friction relative to the
    torque that the gear passes on. Link k is the capsule link_k, its actuator the sphere or body motor_k. The
    column below the base is the cylinder `column`, which touches no obstacle. Solid tools and payloads are the geoms
    `tool` and `payload`, whose contacts exert no force. A site target_NAME is at each target; its user data are the
    tolerance of the position [m], of the angle [rad], and how many angles count (2: the z axis, 3: all). The keyframe
    NAME is the posture there.

    postures: (T, J) values of the joints at the targets [rad] or [m].
    peak_torques: (D,) largest torques of the moving joints, for the gains of joints without actuators.
    """
    if arm.couplings:
        raise ArmError("an arm has joints that follow others, whose servos are not modelled; try to_mjcf(arm) alone")
    root = Element("mujoco", model=name)
    SubElement(root, "compiler", COMPILER)
    gravity = numbers((0.0, 0.0, -GRAVITY))
    option = SubElement(root, "option", gravity=gravity, timestep=number(TIMESTEP), integrator="RK4")
    # A motor touches the link before its carrier, a tool that before the last; what may not touch is excluded below.
    if arm.has_motor_bodies or (scene.tip_rules and scene.tip_rules.solids):
        SubElement(option, "flag", filterparent="disable")
    SubElement(SubElement(root, "default"), "geom", {**TOUCHES_NOTHING, "mass": "0"})
    world = add_scene(root, arm)
    _add_obstacles(root, world, scene.obstacles)
    _add_targets(world, scene, target_names, arm)
    body = SubElement(world, "body", name="base", pos=numbers(arm.base))
    if arm.column is not None:
        add_column(body, arm.column, {"name": "column", **TOUCHES_LINKS})
    names = {n: f"joint_{k}" for k, (n, _) in enumerate(moving_joints(arm), start=1)}
    motor_names = {n: f"motor{name.removeprefix('joint')}" for n, name in names.items()}
    for segment in segments(arm):
        if segment.joint.kind != "fixed":
            _add_motor(body, motor_names[segment.number], segment, arm)
        body = SubElement(body, "body", name=segment.name, pos=numbers(segment.position))
        if segment.joint.kind != "fixed":
            SubElement(body, "joint", _joint(names[segment.number], segment.joint))
        add_inertial(body, segment.link)
        if segment.link.length > 0.0:
            _add_link(body, segment)
    add_tip(body, arm)
    add_tool(body, arm)
    _add_payload(body, arm, scene)
    _add_exclusions(root, arm, motor_names)
    _add_actuators(root, arm, peak_torques)
    frames = SubElement(root, "keyframe")
    moving = [n - 1 for n, _ in moving_joints(arm)]
    for target, q in zip(target_names, postures[:, moving].tolist(), strict=True):
        SubElement(frames, "key", name=target, qpos=numbers(q), ctrl=numbers([*q, *np.zeros(len(q))]))
    return to_xml(root)


def _add_exclusions(root: Element, arm: Arm, motor_names: Mapping[int, str]) -> None:
    """Exclude the pairs of bodies whose contacts do not count; motor_names: by the number of the joint."""
    contact = SubElement(root, "contact")
    pairs = [(f"link_{first + 1}", f"link_{second + 1}") for first, second in uncounted_pairs(arm)]
    pairs += [(motor_names[joint + 1], f"link_{link + 1}") for joint, link in joined_by_motors(arm)]
    if arm.column is not None:
        motors, links = joined_by_column(arm)
        pairs += [("column", motor_names[joint + 1]) for joint in motors]
        pairs += [("column", f"link_{link + 1}") for link in links]
    motors, links = joined_by_tip(arm)
    pairs += [("payload", motor_names[joint + 1]) for joint in motors]
    pairs += [("payload", f"link_{link + 1}") for link in links]
    for first, second in pairs:
        SubElement(contact, "exclude", body1=first, body2=second)


def uncounted_pairs(arm: Arm) -> Iterator[tuple[int, int]]:
    """Yield pairs of links, counted from 0, whose distance `self_clearance` leaves out, or takes in part only.

    These are neighbours, rigidly connected links, and links so near along the arm that their ends always touch.
    """
    links, joints = arm.links, arm.joints
    travelled = list(accumulate((link.length for link in links), initial=0.0))
    for i, first in enumerate(links):
        for j in range(i + 1, len(links)):
            second = links[j]
            if first.length == 0.0 or second.length == 0.0:
                continue
            solid_between = any(link.length > 0.0 for link in links[i + 1 : j])
            moves = any(joint.kind != "fixed" for joint in joints[i + 1 : j + 1])
            slides = sum(max(joint.lower, -joint.upper, 0.0) for joint in joints[i + 1 : j + 1])
            between = travelled[j] - travelled[i + 1] + slides
            if not solid_between or not moves or between < 2.0 * (first.radius + second.radius):
                yield i, j


def _add_obstacles(root: Element, world: Element, obstacles: Sequence[Obstacle]) -> None:
    names = Counter(obstacle.name for obstacle in obstacles)
    for index, obstacle in enumerate(obstacles, start=1):
        solid = obstacle.solid
        label = obstacle.name if obstacle.name and names[obstacle.name] == 1 else f"{obstacle.name}{index}"
        geom = {"name": f"obstacle_{label}", **_geom(solid), "contype": str(OBSTACLE), "conaffinity": "0"}
        if solid.shape == "mesh":  # MuJoCo takes its convex hull
            geom |= {"mesh": geom["name"]}
            vertex = numbers(solid.hull.corners.ravel().tolist())
            SubElement(SubElement(root, "asset"), "mesh", name=geom["name"], vertex=vertex)
        SubElement(world, "geom", {**geom, "rgba": COLOURS["obstacle"]})


def _geom(solid: Solid) -> dict[str, str]:
    """Return type, size and place of a solid."""
    size = {
        "box": solid.half,
        "sphere": solid.half[:1],
        "cylinder": (solid.half[0], solid.half[2]),
        "mesh": solid.half,  # ignored
        "ground": (0.0, 0.0, 0.1),  # of a plane without end, and the spacing of its grid
    }[solid.shape]
    place = {"pos": numbers(solid.centre), "xyaxes": numbers(solid.rotation[:, :2].T.ravel().tolist())}
    return {"type": "plane" if solid.shape == "ground" else solid.shape, "size": numbers(size), **place}


def _add_targets(world: Element, scene: Scene, target_names: Sequence[str], arm: Arm) -> None:
    arrays = scene.target_arrays
    size = number(arm.links[-1].radius / 2.0)
    for t, name in enumerate(target_names):
        site = {"name": f"target_{name}", "pos": numbers(scene.targets[t].tolist()), "size": size}
        axes = numbers(arrays.rotation[t][:, :2].T.ravel().tolist())
        allowed = (float(arrays.tolerance[t]), float(arrays.angle_tolerance[t]), float(arrays.n_angular[t]))
        SubElement(world, "site", {**site, "xyaxes": axes, "user": numbers(allowed), "rgba": COLOURS["target"]})


def _joint(name: str, joint: Joint) -> dict[str, str]:
    """Return the attributes of a joint with its drive: rotor inertia, friction, and the limit before friction."""
    attributes, actuator = joint_attributes(name, joint), joint.actuator
    if actuator is None or joint.effort is None:
        return attributes
    travel = joint.travel
    drive = {
        "armature": (actuator.rotor_inertia or 0.0) / travel**2,
        "damping": (actuator.viscous_friction or 0.0) / travel**2,
        "frictionloss": (actuator.coulomb_friction or 0.0) / travel,
        "user": actuator.load_friction or 0.0,
    }
    most = joint.effort * (1.0 + (actuator.load_friction or 0.0)) / (1.0 + (actuator.limit_friction or 0.0))
    drive = {key: number(value) for key, value in drive.items() if value}
    friction = STIFF_FRICTION if {"frictionloss", "user"} & drive.keys() else {}
    return attributes | drive | friction | {"actuatorfrcrange": f"{number(-most)} {number(most)}"}


def _add_link(body: Element, segment: Segment) -> None:
    """Add the capsule of a link; the foot of the first one, where the arm is mounted, touches other links alone."""
    link, name = segment.link, segment.name
    end, radius = np.array(link.offset), link.radius
    share = min(1.0, 2.0 * radius / link.length) if segment.number == 1 else 0.0
    if 0.0 < share < 1.0:
        _add_capsule(body, "foot", np.zeros(3), share * end, radius, TOUCHES_LINKS)
    _add_capsule(body, name, share % 1.0 * end, end, radius, TOUCHES_LINKS if share == 1.0 else TOUCHES_ALL)


def _add_capsule(body: Element, name: str, start: Array, end: Array, radius: float, bits: dict[str, str]) -> None:
    shape = {"type": "capsule", "fromto": numbers([*start.tolist(), *end.tolist()]), "size": number(radius)}
    SubElement(body, "geom", {"name": name, **shape, "material": "link", **bits})


def _add_motor(body: Element, name: str, segment: Segment, arm: Arm) -> None:
    """Add the actuator of a joint to the link before: its body, or a sphere within the link's capsule, if any."""
    if segment.joint.body is not None:
        add_motor(body, segment, segment.joint.body, name, {"name": name, **TOUCHES_ALL})
        return
    before = arm.links[segment.number - 2] if segment.number > 1 else None
    counts = before is not None and before.length > 0.0
    radius = segment.link.radius if before is None else before.radius
    shape = {"type": "sphere", "pos": numbers(segment.position), "size": number(radius)}
    bits = TOUCHES_ALL if counts else TOUCHES_NOTHING
    SubElement(body, "geom", {"name": name, **shape, "material": f"joint_{segment.joint.nearest_axis}", **bits})


def _add_payload(body: Element, arm: Arm, scene: Scene) -> None:
    mass, shape = float(scene.payload.max()), scene.load_shape
    payload = SubElement(body, "body", name="payload", pos=numbers(tip_position(arm)), euler=numbers(tip_rpy(arm)))
    moments = [mass * value for value in shape.gyration] if mass > 0.0 else [NOTHING] * 3
    inertial = {"pos": numbers(shape.center), "mass": number(mass or NOTHING), "diaginertia": numbers(moments)}
    SubElement(payload, "inertial", inertial)
    solids: Solids = scene.tip_rules.solids if scene.tip_rules else {}
    for name, solid in solids.items():
        SubElement(payload, "geom", {"name": name, **_geom(solid), "rgba": COLOURS["payload"], **TIP})


def _add_actuators(root: Element, arm: Arm, peak_torques: Array) -> None:
    actuators = SubElement(root, "actuator")
    joints = [joint for _, joint in moving_joints(arm)]
    for k, (joint, peak) in enumerate(zip(joints, peak_torques.tolist(), strict=True), start=1):
        servo = {"name": f"servo_{k}", "joint": f"joint_{k}", "kp": number(_position_gain(joint, peak))}
        SubElement(actuators, "position", servo)
    for k in range(1, len(joints) + 1):
        SubElement(actuators, "motor", {"name": f"ff_{k}", "joint": f"joint_{k}", "gear": "1"})


def _position_gain(joint: Joint, peak: float) -> float:
    """Return the position gain of a joint [N m/rad] or [N/m].

    A position actuator of MuJoCo would damp the speed itself, not its deviation from the desired speed, so the damping
    gain of the servo would delay the tool by 0.05 to 0.2 s. The friction of the joint damps enough.
    """
    actuator = joint.actuator
    if actuator is None or actuator.position_gain is None:
        return STIFFNESS * (joint.effort or max(peak, NOTHING))
    return actuator.position_gain / joint.travel**2
