"""Tools of tasks, mounted on the ends of arms."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from armwright.arrays import Array
from armwright.robot.arm import Arm, MountedTool
from armwright.robot.axes import Vector, as_vector
from armwright.rotations import rotation_from_rpy
from armwright.spaces.joint_modules import DIRECTIONS, MOUNTS, Mount, mounted_vector
from armwright.tasks.tip_rules import tip_solids
from armwright.tasks.tool import NO_TOOL, Tool


@lru_cache(maxsize=64)
def mounted_tools(tool: Tool) -> Mapping[Mount, MountedTool]:
    """Return a tool as the arms of a design space carry it, for each mount."""
    base = [DIRECTIONS[axis] for axis in ("+x", "+y", "+z")]
    return {m: _mounted(tool, np.column_stack([mounted_vector(v, m) for v in base]), np.zeros(3)) for m in MOUNTS}


def with_tool(arm: Arm, tool: Tool) -> Arm:
    """Return an existing arm with a tool on its tip."""
    if tool == NO_TOOL:
        return arm
    z, x = np.array(arm.tool.axis), np.array(arm.tool.side)
    return replace(arm, tool=_mounted(tool, np.column_stack([x, np.cross(z, x), z]), np.array(arm.tool.tip)))


def carrying_tool(arm: Arm, tool: Tool) -> Arm:
    """Return an arm with a tool on its tip, unless it carries one already."""
    own = arm.tool
    is_bare = own.mass == 0.0 and not any(own.tip)
    return with_tool(arm, tool) if is_bare and own not in mounted_tools(tool).values() else arm


def _mounted(tool: Tool, frame: Array, start: Array) -> MountedTool:
    """Return a tool whose own frame has these axes (3, 3) and this origin (3,) [m] in the frame of the last link."""
    tip_frame, body = frame @ rotation_from_rpy(*tool.rpy), tip_solids(tool, None).get("tool")
    axes, moments = frame, np.array(tool.inertia)
    if body is not None and not any(tool.inertia):
        axes, moments = tip_frame @ body.rotation, tool.mass * body.gyration
    x, y, z = map(_vector, axes @ np.diag(moments) @ axes.T)
    return MountedTool(
        tip=_vector(start + frame @ tool.tip),
        axis=_vector(tip_frame[:, 2]),
        side=_vector(tip_frame[:, 0]),
        mass=tool.mass,
        com=_vector(start + frame @ tool.center),
        inertia=(x, y, z),
    )


def _vector(values: Array) -> Vector:
    return as_vector(values + 0.0)  # no -0.0
