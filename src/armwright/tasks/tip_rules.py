"""Which obstacles the tool and the payload may touch, and how deep: a surface on which a target rests, or a hole."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import did_you_mean
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.targets import Point, Target, TargetArrays

APART = -1.0  # depth of a pair that may not touch
BEYOND = 0.05  # [m] beyond tip and payload, within which a target rests on an obstacle
STEP = 5e-4  # [m] of the search for it


@dataclass(frozen=True)
class TipRules:
    """What the tip carries at S samples, and what it may touch there."""

    carries: NDArray[np.bool_]  # (S,) whether the payload is carried
    allowed: (
        Array  # (S, O) depth of tool and payload in each obstacle that does not count [m]; APART, infinite in holes
    )

    def __getitem__(self, part: NDArray[np.intp] | slice) -> "TipRules":
        return TipRules(self.carries[part], self.allowed[part])


def joined_rules(parts: Sequence[TipRules]) -> TipRules:
    """Return the rules of several series of samples, one after the other."""
    return TipRules(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("carries", "allowed")))


def resting_surfaces(
    targets: Sequence[Point | Target], arrays: TargetArrays, obstacles: Sequence[Obstacle], reach: float | None
) -> tuple[int | None, ...]:
    """Return the index of the obstacle that each of T targets rests on, None for none.

    It is the one that the target names, else the first one met beyond the tip along the tool's z axis. A target without
    a direction rests on nothing that it does not name.

    reach: how far the payload reaches beyond the tip [m]; None if neither tool nor payload is a body.
    """
    names = [obstacle.name for obstacle in obstacles]
    directed = np.flatnonzero(arrays.n_angular) if obstacles and reach is not None else []
    share = np.arange(0.0, (reach or 0.0) + BEYOND, STEP)[:, None]
    rays = [
        target.position + share * arrays.rotation[i, :, 2] for i in directed if isinstance(target := targets[i], Target)
    ]
    met = {}
    if rays:
        points = np.concatenate(rays)
        inside = [one.solid.contains(points, -STEP).reshape(len(rays), -1) for one in obstacles]
        # (O, T) number of the first point of each ray in each obstacle
        first = np.array([np.where(one.any(axis=1), one.argmax(axis=1), len(share)) for one in inside])
        met = {int(i): int(first[:, k].argmin()) for k, i in enumerate(directed) if first[:, k].min() < len(share)}
    named = (target.on if isinstance(target, Target) else "" for target in targets)
    return tuple(names.index(name) if name else met.get(i) for i, name in enumerate(named))


def allowed_depths(
    targets: Sequence[Point | Target],
    surfaces: Sequence[int | None],
    obstacles: Sequence[Obstacle],
    tolerance: Array,
) -> Array:
    """Return (T, O) how deep tool and payload may be in each obstacle at each target, as `TipRules.allowed` [m].

    tolerance: (T,) of the targets [m].
    """
    names = [obstacle.name for obstacle in obstacles]
    allowed = np.full((len(targets), len(obstacles)), APART)
    for index, (target, surface) in enumerate(zip(targets, surfaces, strict=True)):
        if surface is not None:
            allowed[index, surface] = tolerance[index]
        if isinstance(target, Target) and target.into:
            allowed[index, names.index(target.into)] = np.inf
    return allowed


def check_names(targets: Sequence[Point | Target], obstacles: Sequence[Obstacle]) -> None:
    """Raise ValueError if a target rests on or reaches into an obstacle that does not exist, or has no unique name."""
    names = [obstacle.name for obstacle in obstacles]
    for number, target in enumerate(targets, start=1):
        for word, name in (("on", target.on), ("into", target.into)) if isinstance(target, Target) else ():
            if name and names.count(name) != 1:
                known = ", ".join(filter(None, names)) or "none has a name"
                raise ValueError(
                    f'target {target.name or number}: {word}: expected the name of one obstacle, got "{name}".'
                    f"{did_you_mean(name, names)} Obstacles: {known}"
                )
