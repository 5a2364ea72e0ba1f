"""Tool and payload as bodies, and which obstacles they may touch: a surface on which a target rests, or a hole."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import did_you_mean
from armwright.rotations import rotation_from_rpy, rotation_to_axis
from armwright.tasks.obstacles import Obstacle, Shape, Solid
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
    allowed: (
        Array  # (S, O) depth of tool and payload in each obstacle that does not count [m]; APART, infinite in holes
    )
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
        found["tool"] = _solid("box", turn @ np.subtract(tool.center, tool.tip), np.eye(3), np.array(tool.size) / 2)
    if tool.radius is not None:
        half = np.array([tool.radius, tool.radius, tool.length / 2])
        found["tool"] = _solid("cylinder", turn @ np.array(tool.tip) / -2, turn @ rotation_to_axis(tool.tip), half)
    if payload is not None and payload.size is not None:
        found["payload"] = _solid("box", np.array(payload.center), np.eye(3), np.array(payload.size) / 2)
    return found


def placed(solid: Solid, position: Array, rotation: Array) -> Solid:
    """Return a solid of the tip frame in the world; position: (3,) of the tip [m].  rotation: (3, 3) of its frame."""
    return _solid(solid.shape, position + rotation @ solid.centre, rotation @ solid.rotation, np.array(solid.half))


def _solid(shape: Shape, centre: Array, rotation: Array, half: Array) -> Solid:
    (x, y, z), (a, b, c) = centre.tolist(), half.tolist()
    return Solid(shape, (x, y, z), rotation, (a, b, c))


def resting_surfaces(
    targets: Sequence[Target | None], arrays: TargetArrays, obstacles: Sequence[Obstacle], solids: Solids
) -> tuple[int | None, ...]:
    """Return the index of the obstacle that each of T targets rests on, None for none.

    It is the one that the target names, else the first one met along the tool's z axis, up to 5 cm beyond tip and
    payload. Without a direction, or a body, a target rests on nothing that it does not name.
    """
    names = [obstacle.name for obstacle in obstacles]
    reach = max([0.0, *(solid.centre[2] + solid.half[2] for name, solid in solids.items() if name == "payload")])
    share = np.arange(0.0, reach + BEYOND, STEP)[:, None]
    found: list[int | None] = []
    for target, n_angular, rotation in zip(targets, arrays.n_angular, arrays.rotation, strict=True):
        index = names.index(target.on) if target and target.on else None
        if target and not target.on and n_angular and solids and obstacles:
            ray = target.position + share * rotation[:, 2]
            inside = np.array([obstacle.solid.contains(ray, -STEP) for obstacle in obstacles])  # (O, S)
            index = int(inside[:, inside.any(axis=0).argmax()].argmax()) if inside.any() else None
        found.append(index)
    return tuple(found)


def check_names(targets: Sequence[Target | None], obstacles: Sequence[Obstacle]) -> None:
    """Raise ValueError if a target rests on or reaches into an obstacle that does not exist, or has no unique name."""
    names = [obstacle.name for obstacle in obstacles]
    for number, target in enumerate(targets, start=1):
        for word, name in (("on", target.on), ("into", target.into)) if target else ():
            if name and names.count(name) != 1:
                known = ", ".join(filter(None, names)) or "none has a name"
                raise ValueError(
                    f'target {target.name or number}: {word}: expected the name of one obstacle, got "{name}".'
                    f"{did_you_mean(name, names)} Obstacles: {known}"
                )
