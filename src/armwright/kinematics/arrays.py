"""Arms stacked into arrays, as the kernels take them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from armwright.arm import AXES, Actuator, Arm, Link, Vector
from armwright.exceptions import ArmError, SettingsError, did_you_mean
from armwright.space import JOINT_AXES, CategoricalParameter, DesignSpace

MOST_JOINTS = 8
_AXIS_NUMBERS = {kind: AXES.index(axis) for kind, axis in JOINT_AXES.items()}
LARGEST_ANGLE = 2 * np.pi  # [rad], for which the kernels' sine is made

Precision = Literal["float32", "float64"]
Floats = NDArray[np.float32] | NDArray[np.float64]  # of an array's precision
Ints = NDArray[np.int32]

FLOATS = ("base", "lower", "upper", "offset", "com", "mass")
ARRAYS = (*FLOATS, "axis")  # of `ArmArrays`, with a row for each arm, that inverse kinematics takes


@dataclass(frozen=True)
class Actuation:
    """What turns the joints of N arms of D moving joints.

    effort: (N, D) the torque that may be asked of each [N m].
    price: (N,) of all together [USD]; NaN where one has none.
    base_mass: (N,) of the first, which stands with the base and loads no joint [kg].
    """

    effort: NDArray[np.float64]
    price: NDArray[np.float64]
    base_mass: NDArray[np.float64]

    def __getitem__(self, rows: slice) -> "Actuation":
        return Actuation(self.effort[rows], self.price[rows], self.base_mass[rows])


@dataclass(frozen=True)
class ArmArrays:
    """N arms of D moving joints each. A fixed joint moves nothing: its link is part of the one before it.

    All floats are of one precision. joint_numbers: (D,) places of the moving joints in the arm's own list of joints.
    """

    base: Floats  # (N, 3) [m]
    axis: Ints  # (N, D) 0, 1, 2 for local x, y, z
    lower: Floats  # (N, D) [rad]
    upper: Floats  # (N, D) [rad]
    offset: Floats  # (N, D, 3) from a joint to the next [m]
    com: Floats  # (N, D, 3) from a joint to the centre of mass of what it carries up to the next [m]
    mass: Floats  # (N, D) [kg]
    radius: Floats  # (N, D) of what goes from a joint to the next [m]; 0 where there is nothing
    joint_numbers: tuple[int, ...]
    n_joints: int
    actuation: Actuation | None = None  # where all moving joints have actuators

    def __len__(self) -> int:
        return len(self.base)

    def __getitem__(self, rows: slice) -> "ArmArrays":
        actuation = None if self.actuation is None else self.actuation[rows]
        return replace(self, **{name: getattr(self, name)[rows] for name in (*ARRAYS, "radius")}, actuation=actuation)

    @property
    def precision(self) -> Precision:
        return "float64" if self.base.dtype == np.float64 else "float32"

    @property
    def dof(self) -> int:
        """The number D of moving joints."""
        return self.axis.shape[1]


def checked_precision(name: str) -> Precision:
    """The name, if it is a precision's."""
    allowed = get_args(Precision)
    if name not in allowed:
        raise SettingsError(f'precision = "{name}" is not one of {", ".join(allowed)}.{did_you_mean(name, allowed)}')
    return cast("Precision", name)


def stack_arms(arms: Sequence[Arm], precision: Precision = "float32") -> ArmArrays:
    """The arms as arrays. They must share which of their joints are fixed."""
    if not arms:
        raise ArmError("no arms were given")
    kinds = tuple(joint.kind for joint in arms[0].joints)
    if "prismatic" in kinds:
        raise ArmError(f"joint {kinds.index('prismatic') + 1} is prismatic; the kernels take revolute and fixed joints")
    moving = tuple(number for number, kind in enumerate(kinds) if kind == "revolute")
    if not 1 <= len(moving) <= MOST_JOINTS:
        raise ArmError(f"the kernels take 1 to {MOST_JOINTS} moving joints, not {len(moving)}")
    for arm in arms:
        _check_alike(arm, kinds)
    rigid = [_rigid_groups(arm, moving) for arm in arms]
    joints = [[arm.joints[number] for number in moving] for arm in arms]
    return ArmArrays(
        base=np.array([base for base, _ in rigid], dtype=precision),
        axis=np.array([[AXES.index(j.axis) for j in row] for row in joints], dtype=np.int32),
        lower=-_never_above([[-j.lower for j in row] for row in joints], precision),
        upper=_never_above([[j.upper for j in row] for row in joints], precision),
        offset=np.array([[link.offset for link in links] for _, links in rigid], dtype=precision),
        com=np.array([[link.total_com for link in links] for _, links in rigid], dtype=precision),
        mass=np.array([[link.total_mass for link in links] for _, links in rigid], dtype=precision),
        radius=np.array([[link.radius for link in links] for _, links in rigid], dtype=precision),
        joint_numbers=moving,
        n_joints=len(kinds),
        actuation=_actuation([[joint.actuator for joint in row] for row in joints]),
    )


def _actuation(rows: Sequence[Sequence[Actuator | None]]) -> Actuation | None:
    """None where a joint has no actuator."""
    chosen = [[actuator for actuator in row if actuator is not None] for row in rows]
    if any(len(few) < len(row) for few, row in zip(chosen, rows, strict=True)):
        return None
    prices = [[np.nan if actuator.price is None else actuator.price for actuator in row] for row in chosen]
    return Actuation(
        effort=np.array([[actuator.effort for actuator in row] for row in chosen]),
        price=np.array(prices).sum(axis=1),
        base_mass=np.array([row[0].mass for row in chosen]),
    )


def arrays_of(space: DesignSpace, matrix: NDArray[np.float64], precision: Precision = "float32") -> ArmArrays:
    """The arms that designs build, equal to the bit to `stack_arms` of their arms, without building them one by one.

    matrix: (N, P) designs as rows (`DesignSpace.matrix`).
    """
    n, dof = len(matrix), space.joints
    links = matrix[:, 3 + dof : 3 + 2 * dof]
    lower, upper = _limits(*space.joint_range, precision)
    offset = np.zeros((n, dof, 3), dtype=precision)
    offset[..., 2] = links
    mass, middle = space.mass.masses(links), links / 2
    actuation = None
    if space.actuators:
        chosen = _chosen_actuators(space, matrix)
        efforts, masses, prices = _catalogue(space)
        actuation = Actuation(efforts[chosen], prices[chosen].sum(axis=1), masses[chosen[:, 0]])
        ends = np.concatenate([masses[chosen[:, 1:]], np.zeros((n, 1))], axis=1)  # a link carries the next joint's
        total = mass + ends
        middle = np.where(ends > 0.0, (mass * middle + ends * links) / np.where(total > 0.0, total, 1.0), middle)
        mass = total
    com = np.zeros((n, dof, 3), dtype=precision)
    com[..., 2] = middle
    return ArmArrays(
        base=np.ascontiguousarray(matrix[:, :3], dtype=precision),
        axis=_chosen(space, matrix, "joint_", _AXIS_NUMBERS).astype(np.int32),
        lower=np.full((n, dof), lower, dtype=precision),
        upper=np.full((n, dof), upper, dtype=precision),
        offset=offset,
        com=com,
        mass=np.ascontiguousarray(mass, dtype=precision),
        radius=np.full((n, dof), space.link_radius, dtype=precision),
        joint_numbers=tuple(range(dof)),
        n_joints=dof,
        actuation=actuation,
    )


def _chosen_actuators(space: DesignSpace, matrix: NDArray[np.float64]) -> NDArray[np.intp]:
    """(N, D) places of the joints' actuators in the space's list."""
    if len(space.actuators) == 1:
        return np.zeros((len(matrix), space.joints), dtype=np.intp)
    return _chosen(space, matrix, "motor_", {record.name: i for i, record in enumerate(space.actuators)})


def _chosen(
    space: DesignSpace, matrix: NDArray[np.float64], prefix: str, numbers: Mapping[str, int]
) -> NDArray[np.intp]:
    """(N, D) the numbers of the categories in the columns of the parameters whose names begin so."""
    columns = [i for i, parameter in enumerate(space.parameters) if parameter.name.startswith(prefix)]
    choices = [cast("CategoricalParameter", space.parameters[i]).choices for i in columns]
    picked = [
        np.array([numbers[choice] for choice in c])[matrix[:, i].astype(np.intp)]
        for i, c in zip(columns, choices, strict=True)
    ]
    return np.stack(picked, axis=1)


@cache
def _catalogue(space: DesignSpace) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Effort [N m], mass [kg] and price [USD] of each of a space's actuators."""
    actuators = space.arm_actuators
    return (
        np.array([actuator.effort for actuator in actuators]),
        np.array([actuator.mass for actuator in actuators]),
        np.array([np.nan if actuator.price is None else actuator.price for actuator in actuators]),
    )


@cache
def _limits(lower: float, upper: float, precision: Precision) -> tuple[Any, Any]:
    return -_never_above([[-lower]], precision)[0, 0], _never_above([[upper]], precision)[0, 0]


def _never_above(limits: list[list[float]], precision: Precision) -> Any:
    """In this precision: float32 of 2.4 rad is 1e-7 rad more, which no kept angle may be, so it is rounded down."""
    near = np.array(limits, dtype=precision)
    return np.where(near > np.array(limits), np.nextafter(near, near.dtype.type(-np.inf)), near)


def _check_alike(arm: Arm, kinds: tuple[str, ...]) -> None:
    if tuple(joint.kind for joint in arm.joints) != kinds:
        raise ArmError("arms that are evaluated together must have the same number and kinds of joints")
    for number, joint in enumerate(arm.joints, start=1):
        if joint.kind == "revolute" and max(-joint.lower, joint.upper) > LARGEST_ANGLE:
            raise ArmError(f"joint {number} turns beyond ±2π rad: [{joint.lower:g}, {joint.upper:g}]")
        if joint.kind == "revolute" and not joint.lower <= 0.0 <= joint.upper:
            raise ArmError(f"joint {number}: the inverse kinematics starts at 0 rad, which its limits exclude")


def _rigid_groups(arm: Arm, moving: tuple[int, ...]) -> tuple[Vector, Sequence[Link]]:
    """The first moving joint's position, and one link for each moving joint with all fixed ones after it."""
    if len(moving) == len(arm.joints):
        return arm.base, arm.links
    base = np.array(arm.base)
    for link in arm.links[: moving[0]]:
        base = base + link.offset
    ends = (*moving[1:], len(arm.joints))
    return _vector(base), [_join(arm.links[start:end]) for start, end in zip(moving, ends, strict=True)]


def _join(links: Sequence[Link]) -> Link:
    if len(links) == 1:
        return links[0]
    offset, moment, mass = np.zeros(3), np.zeros(3), 0.0
    for link in links:
        moment = moment + link.total_mass * (offset + np.array(link.total_com))
        offset = offset + link.offset
        mass += link.total_mass
    com = moment / mass if mass > 0.0 else offset
    return Link(_vector(offset), mass, _vector(com), links[0].radius)


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
