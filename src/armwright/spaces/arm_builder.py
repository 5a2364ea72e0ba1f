"""The arm that a design builds."""

from dataclasses import replace
from typing import cast

from armwright.robot.arm import Actuator, Arm, Axis, Joint, Link, Vector
from armwright.robot.motor_body import MotorBody, placed_body
from armwright.spaces.joint_modules import (
    DIRECTIONS,
    Direction,
    Mount,
    mounted,
    mounted_body,
    mounted_vector,
)
from armwright.spaces.parameters import Design
from armwright.spaces.space_schema import SpaceSchema
from armwright.spaces.tool_mount import mounted_tools
from armwright.tasks.tool import Tool

ORIGIN: Vector = (0.0, 0.0, 0.0)


class ArmBuilder:
    """Builder of the joints and links of one design; modules are counted from 0."""

    def __init__(self, space: SpaceSchema, design: Design, tool: Tool) -> None:
        self._space, self._design, self._params, self._tool = space, design, design.params, tool
        self._modules = design.modules
        self._lengths = design.links
        self._mount: Mount = space.mount_of(design)
        self._actuators = {actuator.name: actuator for actuator in space.arm_actuators}

    def arm(self) -> Arm:
        """Return the arm."""
        every = range(len(self._modules))
        return Arm(
            base=self._design.origin,
            joints=tuple(self._joint(i, slot) for i in every for slot in range(len(self._modules[i].joints))),
            links=tuple(link for i in every for link in self._links(i)),
            tool=mounted_tools(self._tool)[self._mount],
            base_mass=self._carried_mass(0),
            safety_factor=self._space.safety_factor,
            column=None if self._space.column is None else self._space.column.under(self._design.origin[2]),
        )

    def _joint(self, i: int, slot: int) -> Joint:
        kind, local_axis = self._modules[i].joints[slot]
        axis, sign = mounted(local_axis, self._mount)
        if kind == "fixed":
            return Joint(kind, axis)
        lower, upper = self._limits(i)
        if sign < 0.0:
            lower, upper = 0.0 - upper, 0.0 - lower  # no -0.0
        travel = self._space.travel if kind == "prismatic" else 1.0
        return Joint(kind, axis, lower, upper, self._actuator(i), travel, self._body(i, local_axis))

    def _body(self, i: int, local_axis: Axis) -> MotorBody | None:
        """Return the body of the actuator of a module, if it counts."""
        actuator = self._actuator(i)
        if not self._space.motor_bodies or actuator is None or actuator.shape is None:
            return None
        carrier = DIRECTIONS[self._direction(i - 1) if i else "+z"]
        return mounted_body(placed_body(actuator.shape, local_axis, carrier), self._mount)

    def _limits(self, i: int) -> tuple[float, float]:
        """Return the joint limits of a module along its local axis [rad] or [m]."""
        if self._modules[i].is_prismatic:
            return 0.0, self._stroke(i)
        if self._space.limit is None:
            return self._space.joint_range
        limit = float(self._params.get(f"limit_{i + 1}", self._space.limit[0]))
        return -limit, limit

    def _links(self, i: int) -> list[Link]:
        """Return the links of a module: massless ones between its joints, then its own."""
        x, y, z = mounted_vector(DIRECTIONS[self._direction(i)], self._mount)
        length, tube = self._lengths[i], self._space.link_section.options[self._space.tube_of(self._design, i)]
        link = tube.link((x * length, y * length, z * length), self._link_mass(i, length), length)
        if i + 1 < len(self._modules):
            link = replace(link, end_mass=self._carried_mass(i + 1), end_shift=self._carried_shift(i + 1))
        return [tube.link(ORIGIN, 0.0, 0.0)] * (len(self._modules[i].joints) - 1) + [link]

    def _link_mass(self, i: int, length: float) -> float:
        """Return the mass of this length of a module's tube [kg]."""
        return float(self._space.link_mass(length, self._space.tube_of(self._design, i)))

    def _direction(self, i: int) -> Direction:
        return cast("Direction", self._params.get(f"direction_{i + 1}", self._space.link_directions[0]))

    def _stroke(self, i: int) -> float:
        return float(self._params.get(f"stroke_{i + 1}", self._space.min_stroke))

    def _actuator(self, i: int) -> Actuator | None:
        """Return the actuator of each joint of a module."""
        if not self._actuators:
            return None
        return self._actuators[str(self._params.get(f"motor_{i + 1}", self._space.arm_actuators[0].name))]

    def _carried_mass(self, i: int) -> float:
        """Return the mass at the start of a module: its actuators with their brackets, and its rail [kg]."""
        module = self._modules[i]
        if not module.is_actuated:
            return self._rail_mass(i)
        actuator = self._actuator(i)
        mass = 0.0 if actuator is None else actuator.mass
        return self._rail_mass(i) + len(module.joints) * (mass + self._space.bracket_mass)

    def _rail_mass(self, i: int) -> float:
        return self._link_mass(i, self._stroke(i)) if self._modules[i].is_prismatic else 0.0

    def _carried_shift(self, i: int) -> Vector:
        """Return the vector from the start of a module to the centre of the mass there: a rail's is at its middle."""
        rail = self._rail_mass(i)
        if not rail:
            return ORIGIN
        ((_, axis),) = self._modules[i].joints
        distance = rail / self._carried_mass(i) * (self._stroke(i) / 2)
        x, y, z = mounted_vector(DIRECTIONS[cast("Direction", f"+{axis}")], self._mount)
        return (distance * x, distance * y, distance * z)
