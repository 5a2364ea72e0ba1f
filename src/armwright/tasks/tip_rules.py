"""Tool and payload as bodies, and which obstacles they may touch: a surface on which a target rests, or a hole."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import did_you_mean
from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.obstacles import Obstacle, Solid
from armwright.tasks.payload import Payload
from armwright.tasks.targets import Target, TargetArrays
from armwright.tasks.tool import Tool

APART = -1.0  # depth of a pair that may not touch
BEYOND = 0.05  # [m] beyond tip and payload, within which a target rests on an obstacle
STEP = 5e-4  # [m] of the search for it


Solids = Mapping[Literal["tool", "payload"], Solid]  # in the tip frame; those that are bodies


@dataclass(frozen=True)
class TipRules:
    """Tool and payload as bodies at S samples, and what they may touch there."""

    carries: NDArray[np.bool_]  # (S,) whether the payload is carried
    allowed: Array  # (S, O) their depth in each obstacle that does not count [m]; APART, infinite in holes
    solids: Solids

    def __getitem__(self, part: NDArray[np.intp] | slice) -> "TipRules":
        return TipRules(self.carries[part], self.allowed[part], self.solids)


def joined_rules(parts: Sequence[TipRules]) -> TipRules:
    """Return the rules of several series of samples, one after the other."""
    carries, allowed = (np.concatenate([getattr(part, name) for part in parts]) for name in ("carries", "allowed"))
    return TipRules(carries, allowed, parts[0].solids)


def tip_solids(tool: Tool, payload: Payload | None) -> Solids:
    """Return the tool and the payload that are bodies, in the tip frame."""
    found: dict[Literal["tool", "payload"], Solid] = {}
    turn = rotation_from_rpy(*tool.rpy).T  # from the tool's frame into the tip frame
    if tool.size is not None:
        x, y, z = tool.size
        box = Solid("box", (0.0, 0.0, 0.0), turn.T, (x / 2, y / 2, z / 2))
        found["tool"] = placed(box, turn @ np.subtract(tool.center, tool.tip), turn)
    if tool.radius is not None:
        half = tool.radius, tool.radius, tool.length / 2
        cylinder = Solid("cylinder", (0.0, 0.0, 0.0), rotation_to_axis(tool.tip), half)
        found["tool"] = placed(cylinder, turn @ np.array(tool.tip) / -2, turn)
    if payload is not None and payload.size is not None:
        x, y, z = payload.size
        found["payload"] = Solid("box", payload.center, np.eye(3), (x / 2, y / 2, z / 2))
    return found


def placed(solid: Solid, position: Array, rotation: Array) -> Solid:
    """Return a solid in the frame at `position` (3,) [m] with the axes `rotation` (3, 3) as columns."""
    x, y, z = (position + rotation @ solid.centre).tolist()
    return Solid(solid.shape, (x, y, z), rotation @ solid.rotation, solid.half)


def allowed_depths(
    targets: Sequence[Target | None], arrays: TargetArrays, obstacles: Sequence[Obstacle], solids: Solids
) -> Array:
    """Return (T, O) the depths that targets allow, as `TipRules.allowed` [m]; None for a target that is a mere point.

    A target rests on the obstacle that it names, else on the first one met along the tool's z axis, up to 5 cm beyond
    tip and payload. Without a direction, or a body, a target rests on nothing that it does not name.
    """
    reach = max([0.0, *(solid.centre[2] + solid.half[2] for name, solid in solids.items() if name == "payload")])
    share, allowed = np.arange(0.0, reach + BEYOND, STEP)[:, None], np.full((len(targets), len(obstacles)), APART)
    for i, target in enumerate(targets):
        if target and target.on:
            allowed[i, _named(target.on, "on", i, obstacles)] = arrays.tolerance[i]
        elif target and arrays.n_angular[i] and solids and obstacles:
            ray = target.position + share * arrays.rotation[i, :, 2]
            inside = np.array([obstacle.solid.contains(ray, -STEP) for obstacle in obstacles])  # (O, S)
            if inside.any():
                allowed[i, inside[:, inside.any(axis=0).argmax()].argmax()] = arrays.tolerance[i]
        if target and target.into:
            allowed[i, _named(target.into, "into", i, obstacles)] = np.inf
    return allowed


def _named(name: str, key: str, target: int, obstacles: Sequence[Obstacle]) -> int:
    """Return the index of the obstacle of this name; ValueError if there is none, or several."""
    names = [obstacle.name for obstacle in obstacles]
    if names.count(name) != 1:
        known = ", ".join(filter(None, names)) or "none has a name"
        raise ValueError(
            f'target {target + 1}: {key}: expected the name of one obstacle, got "{name}".'
            f"{did_you_mean(name, names)} Obstacles: {known}"
        )
    return names.index(name)
