"""What the bases of a design space stand on: obstacles of a task, with a column or without."""

import math
from collections.abc import Sequence
from typing import Any

from armwright.exceptions import SpaceError, did_you_mean
from armwright.spaces.design_parameters import check_parameters
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import Range
from armwright.tasks.obstacles import Box, Cylinder, Ground, Obstacle

LEVEL = 1e-9  # sine of the largest tilt of a top face


def supported_space(space: DesignSpace, obstacles: Sequence[Obstacle]) -> DesignSpace:
    """Return the space with its bases on what they stand on in a task with these obstacles.

    With `base_on`, the base position is restricted to the top face of that obstacle: at its height, or above if there
    is a column, or above by at most the reach of a motor if motors are bodies. The column stands on it, else on the
    highest ground, else at z = 0. Applied twice, nothing changes.

    Raises:
        SpaceError: There is no such obstacle, it has no level top face, or the ranges of the base do not meet it.
    """
    changes: dict[str, Any] = {}
    grounds = [obstacle.z for obstacle in obstacles if isinstance(obstacle, Ground)]
    foot = max(grounds, default=0.0)
    if space.base_on:
        obstacle = _named(space, obstacles)
        faces = _top_face(space, obstacle)
        foot = faces["origin_z"][0]
        if space.column is not None:
            faces["origin_z"] = (foot, math.inf)
        elif space.has_motor_bodies:  # the first motor is between the face and the base
            reach = max(actuator.shape.reach for actuator in space.arm_actuators if actuator.shape is not None)
            faces["origin_z"] = (foot, foot + reach)
        changes |= {name: _narrowed(space, name, face, obstacle) for name, face in faces.items()}
    if space.column is not None and space.column.foot is None:
        changes["column"] = space.column.model_copy(update={"foot": foot})
    if not changes:
        return space
    placed = space.model_copy(update=changes)
    try:
        check_parameters(placed)
    except ValueError as fault:
        raise SpaceError(f"space {space.name}: base_on: {space.base_on}: {fault}") from None
    return placed


def _named(space: DesignSpace, obstacles: Sequence[Obstacle]) -> Obstacle:
    names = [obstacle.name for obstacle in obstacles if obstacle.name]
    if space.base_on not in names:
        known = f"Named obstacles of the task: {', '.join(names)}" if names else "The task names no obstacles"
        hint = did_you_mean(space.base_on, names)
        raise SpaceError(f'space {space.name}: base_on: unknown obstacle "{space.base_on}".{hint} {known}')
    return next(obstacle for obstacle in obstacles if obstacle.name == space.base_on)


def _top_face(space: DesignSpace, obstacle: Obstacle) -> dict[str, Range]:
    """Return the ranges of x, y and z on the top face [m]; of a cylinder or a turned box, the largest square in it."""
    solid = obstacle.solid
    (x, y, z), (a, b, c) = solid.centre, solid.half
    level = abs(solid.rotation[2, 2]) >= 1.0 - LEVEL
    match obstacle:
        case Ground():
            u = v = math.inf
        case Cylinder() if level:
            u = v = a / math.sqrt(2.0)
        case Box() if level:
            cosine, sine = abs(solid.rotation[0, 0]), abs(solid.rotation[0, 1])
            u, v = (a, b) if sine < LEVEL else (min(a, b) / (cosine + sine),) * 2
        case _:
            raise SpaceError(
                f"space {space.name}: base_on: expected an obstacle with a level top face, got {obstacle.describe()}; "
                "try an upright box or cylinder"
            )
    return {"origin_x": (x - u, x + u), "origin_y": (y - v, y + v), "origin_z": (z + c, z + c)}


def _narrowed(space: DesignSpace, name: str, face: Range, obstacle: Obstacle) -> Range:
    """Return the part of the range of a coordinate that lies on a face."""
    low, high = getattr(space, name)
    narrowed = max(low, face[0]), min(high, face[1])
    if narrowed[0] > narrowed[1]:
        where = f"{face[0]:g} m" if face[0] == face[1] else f"[{face[0]:g}, {face[1]:g}] m"
        raise SpaceError(
            f"space {space.name}: {name} = [{low:g}, {high:g}] m does not meet the top of {obstacle.name}, {where}, "
            f"where base_on puts the base; widen {name}"
        )
    return narrowed
