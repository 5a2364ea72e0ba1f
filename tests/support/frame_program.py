"""Arms as frames of Euler-Bernoulli beams in PyNite, a program for structures by others.

A joint is a short member, rigid except about its own axis (of a slide: along it), and a rigid one back to its place.
"""

import numpy as np
from numpy.typing import NDArray
from Pynite import FEModel3D

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.reach.compliance import Stiffness
from armwright.robot.arm import GRAVITY, Arm

Array = NDArray[np.float64]

RIGID = {"A": 1e9, "Iy": 1e8, "Iz": 1e8, "J": 1e8}  # E = G = 1
ARM = 0.07  # [m], length of the members of a joint


class _Frame:
    def __init__(self, base: Array) -> None:
        self.model, self.nodes, self.rng = FEModel3D(), 0, np.random.default_rng(0)
        self.model.add_material("unit", E=1.0, G=1.0, nu=0.0, rho=0.0)
        self.model.add_section("rigid", **RIGID)
        self.end, self.at = self._node(base), base
        self.model.def_support(self.end, True, True, True, True, True, True)

    def _node(self, position: Array) -> str:
        """A node a few nanometres off, because the program joins members to all nodes that they pass through."""
        self.nodes += 1
        return self.model.add_node(f"node {self.nodes}", *(position + self.rng.normal(0.0, 1e-9, 3)).tolist())

    def extend(self, position: Array, **section: float) -> str:
        """A member from the last node to a new one at a position; rigid without a section."""
        node = self._node(position)
        member = f"member {self.nodes}"
        if section:
            self.model.add_section(member, **{**RIGID, **section})
        self.model.add_member(member, self.end, node, "unit", member if section else "rigid")
        self.end, self.at = node, position
        return member

    def hang(self, mass: float, position: Array) -> None:
        """A mass that a rigid lever from the last node holds."""
        force = np.array([0.0, 0.0, -GRAVITY * mass])
        self.model.add_node_load(self.end, "FZ", force[2])
        for direction, value in zip(("MX", "MY", "MZ"), np.cross(position - self.at, force), strict=True):
            self.model.add_node_load(self.end, direction, value)


def frame_displacement(arm: Arm, q: Array, stiffness: Stiffness, payload: float, center: Array) -> Array:
    """Displacement (3,) of the tip under the arm's weight and a payload [m].

    q: (J,) [rad] or [m]. stiffness: (1, J). payload: [kg], at a centre (3,) from the tip in the last frame [m].
    """
    frames = forward_kinematics(stack_arms([arm], "float64"), q[None, None])
    rotations, positions, axes = (values[0, 0] for values in (frames.rotation, frames.position, frames.axis))
    frame = _Frame(np.array(arm.base))
    for j, (joint, link) in enumerate(zip(arm.joints, arm.links, strict=True)):
        spring = ARM * stiffness.joints[0, j]
        if joint.kind == "revolute":
            frame.extend(frame.at + ARM * axes[j], J=spring)
            frame.extend(positions[j])
        elif joint.kind == "prismatic":
            frame.extend(frame.at + ARM * axes[j], A=spring)
            frame.extend(positions[j])
        end = positions[j] + rotations[j] @ link.offset
        if link.length > 0.0:
            bending, torsional = stiffness.bending[0, j], stiffness.torsional[0, j]
            member = frame.extend(end, Iy=bending, Iz=bending, J=torsional)
            weight = -GRAVITY * link.mass / link.length
            frame.model.add_member_dist_load(member, "FZ", weight, weight)
        frame.hang(link.end_mass, positions[j] + rotations[j] @ link.end_mass_position)
    frame.hang(arm.tool.mass, frame.at + rotations[-1] @ arm.tool.com)
    if any(arm.tool.tip):
        frame.extend(frame.at + rotations[-1] @ arm.tool.tip)
    frame.hang(payload, frame.at + rotations[-1] @ center)
    frame.model.analyze_linear(check_stability=False)
    tip = frame.model.nodes[frame.end]
    return np.array([tip.DX["Combo 1"], tip.DY["Combo 1"], tip.DZ["Combo 1"]])
