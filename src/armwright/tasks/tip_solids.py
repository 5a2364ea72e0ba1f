"""Tool and payload as solids."""

from collections.abc import Mapping

import numpy as np

from armwright.arrays import Array
from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.obstacles import Shape, Solid
from armwright.tasks.payload import LoadShape
from armwright.tasks.tool import Tool


def tip_solids(tool: Tool, load: LoadShape) -> Mapping[str, Solid]:
    """Return `tool` and `payload` in the tip frame, those that are bodies."""
    found: dict[str, Solid] = {}
    turn = rotation_from_rpy(*tool.rpy).T  # from the tool's frame into the tip frame
    if tool.size is not None:
        found["tool"] = _solid("box", turn @ np.subtract(tool.center, tool.tip), np.eye(3), np.array(tool.size) / 2)
    if tool.radius is not None:
        half = np.array([tool.radius, tool.radius, tool.length / 2])
        found["tool"] = _solid("cylinder", turn @ np.array(tool.tip) / -2, turn @ rotation_to_axis(tool.tip), half)
    if any(load.size):
        found["payload"] = _solid("box", np.array(load.middle), np.eye(3), np.array(load.size) / 2)
    return found


def placed(solid: Solid, position: Array, rotation: Array) -> Solid:
    """Return a solid of the tip frame in the world; position: (3,) of the tip [m].  rotation: (3, 3) of its frame."""
    return _solid(solid.shape, position + rotation @ solid.centre, rotation @ solid.rotation, np.array(solid.half))


def _solid(shape: Shape, centre: Array, rotation: Array, half: Array) -> Solid:
    (x, y, z), (a, b, c) = centre.tolist(), half.tolist()
    return Solid(shape, (x, y, z), rotation, (a, b, c))
