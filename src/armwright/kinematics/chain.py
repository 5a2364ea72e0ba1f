"""Where the joints of one arm are in one posture: float64, for drawings and exports."""

from collections.abc import Sequence

import numpy as np

from armwright.arm import AXES, Arm, Axis
from armwright.arrays import Array


def joint_positions(arm: Arm, q: Sequence[float] | Array) -> Array:
    """(J + 1, 3) positions of the joints and, last, of the tip [m]; q: (J,) [rad] or [m]."""
    frame = np.eye(3)  # columns: the local x, y, z in the world
    place = np.array(arm.base, dtype=np.float64)
    places: list[Array] = []
    for joint, link, value in zip(arm.joints, arm.links, q, strict=True):
        if joint.kind == "prismatic":
            place = place + frame[:, AXES.index(joint.axis)] * value
        places.append(place)
        if joint.kind == "revolute":
            frame = frame @ rotation(joint.axis, value)
        place = place + frame @ np.array(link.offset)
    return np.array([*places, place + frame @ np.array(arm.tool)])


def link_lines(arm: Arm, q: Sequence[float] | Array) -> list[Array]:
    """(2, 3) each: where the links, and the tool where there is one, begin and end [m]; q: as above."""
    places, frame = joint_positions(arm, q), np.eye(3)
    lines: list[Array] = []
    for joint, link, value, place in zip(arm.joints, arm.links, q, places[:-1], strict=True):
        if joint.kind == "revolute":
            frame = frame @ rotation(joint.axis, value)
        lines.append(np.array([place, place + frame @ np.array(link.offset)]))
    return [*lines, np.array([lines[-1][1], places[-1]])]


def rails(arm: Arm, q: Sequence[float] | Array) -> list[Array]:
    """(2, 3) each: where the rails of sliding joints begin and end [m]; q: as above."""
    places, frame = joint_positions(arm, q), np.eye(3)
    lines: list[Array] = []
    for joint, value, place in zip(arm.joints, q, places[:-1], strict=True):
        if joint.kind == "prismatic":
            along = frame[:, AXES.index(joint.axis)]
            lines.append(np.array([place + (limit - value) * along for limit in (joint.lower, joint.upper)]))
        elif joint.kind == "revolute":
            frame = frame @ rotation(joint.axis, value)
    return lines


def rotation(axis: Axis, angle: float) -> Array:
    """(3, 3) about local x, y or z by `angle` [rad]."""
    s, c = np.sin(angle), np.cos(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix
