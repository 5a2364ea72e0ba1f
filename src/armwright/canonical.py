"""Which designs are the same arm, for a task: they are recognised, and evaluated once.

Two designs are the same arm where one is the other with

- a last yaw whose link and tool lie on its axis, or not (it moves nothing);
- fixed modules, whose links go on where the link before ends, or one longer link;
- the same total length before and after the second of two yaws on one line, however it is divided;
- all mirrored in an upright plane, or several, in which the task is its own mirror image.

That holds to rounding, and as far as nothing is asked of an arm that tells them apart: an actuator, a workshop's
tolerance, the number of joints. Where such a thing is asked, only equal designs are the same.
"""

from collections.abc import Callable, Hashable, Sequence
from functools import cached_property

import numpy as np

from armwright.masses import MassPerLink
from armwright.parameters import Design
from armwright.problem import Problem
from armwright.symmetry import centre, is_mirrored
from armwright.task import Task

DIGITS = 9  # decimals [m], [rad] to which designs are compared
BLIND = {  # objectives and bounds that see no more than where the tip is, what holds it, and how long the arm is
    "position_error", "torque", "worst_error", "unreached_targets", "peak_torque", "rms_torque", "mass", "length",
}  # fmt: skip
TOLD = {"name", "targets", "payload", "objectives", "constraints", "reference_point", "description", "provenance"}
UPRIGHT = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "xy": (1.0, -1.0, 0.0)}  # normals of mirrors, by what they swap
SWAPPED = str.maketrans("RP", "PR")

Part = tuple[str, float, str]  # a module: letter, length of its link, direction
Place = tuple[float, float, float]
Key = tuple[Hashable, ...]


class SameArms:
    """Tells which designs of a problem are the same arm."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def key(self, design: Design) -> Key:
        """Equal for designs that are the same arm."""
        if not self._sees_no_more:
            return ("design", *sorted(design.params.items()))
        place, parts = design.origin, self._merged(self._parts(design))
        return min(_rounded(*mirror(place, parts)) for mirror in self._mirrors)

    @cached_property
    def _sees_no_more(self) -> bool:
        problem, space = self._problem, self._problem.space
        asked = {objective.name for objective in problem.objectives}
        asked |= {constraint.quantity.name for constraint in problem.constraints}
        own = {parameter.name.partition("_")[0] for parameter in space.parameters}
        low, high = space.joint_range
        return (
            asked <= BLIND
            and own <= {"origin", "n", "joint", "link", "direction"}
            and problem.tolerance == 0.0
            and not space.actuators
            and not isinstance(space.mass, MassPerLink)
            and set(space.joint_types) <= set("RPYF")
            and low == -high
            and space.mount == ("floor",)
            and not any(space.tool[:2])
            and _has_points_alone(problem.task)
        )

    def _parts(self, design: Design) -> list[Part]:
        usual = self._problem.space.link_directions[0]
        directions = design.directions or (usual,) * len(design.joints)
        return list(zip(design.joints, design.links, directions, strict=True))

    def _merged(self, parts: list[Part]) -> list[Part]:
        """Without what moves nothing, and with lengths on one line joined."""
        merged: list[Part] = []
        for letter, length, direction in parts:
            before = merged[-1] if merged else None
            if before is not None and letter == "F" and before[2] == direction:
                merged[-1] = (before[0], before[1] + length, direction)
            elif before is not None and letter == before[0] == "Y" and before[2] == direction == "+z":
                merged[-1:] = [("Y", 0.0, "+z"), ("Y", before[1] + length, "+z")]
            else:
                merged.append((letter, length, direction))
        while len(merged) > 1 and merged[-1][0] == "Y" and merged[-1][2] == merged[-2][2] == "+z":
            _, length, _ = merged.pop()
            merged[-1] = (merged[-1][0], merged[-1][1] + length, "+z")
        return merged

    @cached_property
    def _mirrors(self) -> list[Callable[[Place, Sequence[Part]], tuple[Place, list[Part]]]]:
        """What leaves the task as it is: nothing, mirrors, and one after the other."""
        points, payloads = self._problem.task.points, self._problem.task.payloads
        middle = centre(points)
        found = [_mirror("", middle)]
        if np.ptp(payloads) > 0.0:  # rare, and a mirror may exchange them
            return found
        for swaps, normal in UPRIGHT.items():
            if is_mirrored(points, np.array(normal) / np.linalg.norm(normal)):
                mirror = _mirror(swaps, middle)
                found += [_then(other, mirror) for other in found]
        return found


def _has_points_alone(task: Task) -> bool:
    """Whether a task has points to reach and nothing else: no obstacles, and whatever else may tell arms apart."""
    plain = Task(name=task.name, targets=tuple(map(tuple, task.points.tolist())))
    usual, own = (value.model_dump(exclude=TOLD) for value in (plain, task))
    return usual == own and plain.model_dump()["targets"] == task.model_dump()["targets"]


def _mirror(swaps: str, middle: np.ndarray) -> Callable[[Place, Sequence[Part]], tuple[Place, list[Part]]]:
    """A mirror through `middle` in the plane across x or y, or in the one that swaps both; none for "".

    A joint's axis is mirrored, too, and the way it turns; its limits are symmetric.
    """

    def mirrored(place: Place, parts: Sequence[Part]) -> tuple[Place, list[Part]]:
        x, y, z = place
        if swaps == "x":
            return (2 * middle[0] - x, y, z), [(a, length, _turned(way, "x")) for a, length, way in parts]
        if swaps == "y":
            return (x, 2 * middle[1] - y, z), [(a, length, _turned(way, "y")) for a, length, way in parts]
        if swaps == "xy":
            other = middle[0] + y - middle[1], middle[1] + x - middle[0], z
            return other, [(a.translate(SWAPPED), length, _swapped(way)) for a, length, way in parts]
        return place, list(parts)

    return mirrored


def _then(
    first: Callable[[Place, Sequence[Part]], tuple[Place, list[Part]]],
    second: Callable[[Place, Sequence[Part]], tuple[Place, list[Part]]],
) -> Callable[[Place, Sequence[Part]], tuple[Place, list[Part]]]:
    return lambda place, parts: second(*first(place, parts))


def _turned(direction: str, axis: str) -> str:
    return {"+": "-", "-": "+"}[direction[0]] + axis if direction[1] == axis else direction


def _swapped(direction: str) -> str:
    return direction[0] + {"x": "y", "y": "x", "z": "z"}[direction[1]]


def _rounded(place: Place, parts: Sequence[Part]) -> Key:
    numbers = [round(float(value), DIGITS) + 0.0 for value in place]  # no -0.0
    return (*numbers, *((letter, round(length, DIGITS), direction) for letter, length, direction in parts))
