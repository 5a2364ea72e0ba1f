"""Batches of designs, built into stacked arms without building the arms one by one.

There are N designs of up to M modules. A module has up to K joints at one place, K = 2 if the space has a module of two
joints, else 1; its link follows the last joint. The D = M K joint slots of an arm are compacted: its joints come first.
"""

from dataclasses import dataclass, fields
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import FIXED_RATINGS, actuation_at_joints, ratings_of
from armwright.kinematics.arms.arm_arrays import (
    FIXED,
    PRISMATIC,
    ArmArrays,
    Precision,
    add_tools,
    round_down,
    stack_tools,
)
from armwright.kinematics.arms.columns import Columns, columns_of
from armwright.kinematics.arms.motor_bodies import MotorBodies, bodies_in
from armwright.kinematics.arms.rigid_bodies import Bodies, Tools
from armwright.robot.arm import AXES
from armwright.spaces.batch_bodies import motor_body_values
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.joint_modules import DIRECTIONS, MODULES, MOUNTS
from armwright.spaces.parameters import CategoricalParameter
from armwright.spaces.tool_mount import mounted_tools
from armwright.tasks.tool import NO_TOOL, Tool

Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]

_ABSENT = -1  # no joint in this slot of a module
_PLANS = np.full(
    (len(MODULES), 2), _ABSENT
)  # local motions of each module's joints; a single joint is in the last slot
for _row, _module in zip(_PLANS, MODULES.values(), strict=True):
    for _slot, (_kind, _axis) in enumerate(_module.joints, start=2 - len(_module.joints)):
        _row[_slot] = {"revolute": 0, "prismatic": PRISMATIC, "fixed": FIXED}[_kind]
        _row[_slot] += 0 if _kind == "fixed" else AXES.index(_axis)
# (mounts, 3) the world axis that each local axis lies along, and 1 if it points the same way, else -1
_WORLD_AXES = np.array([[AXES.index(world[1]) for world in row] for row in MOUNTS.values()])  # pyright: ignore[reportArgumentType]
_SIGNS = np.array([[1.0 if world[0] == "+" else -1.0 for world in row] for row in MOUNTS.values()])
_VECTORS = np.array(list(DIRECTIONS.values()))  # (directions, 3)


def stack_designs(
    space: DesignSpace, matrix: Array, tool: Tool = NO_TOOL, precision: Precision = "float32"
) -> ArmArrays:
    """Build the arms of a matrix of designs.

    Equal to the bit to `stack_arms` of the arms built one by one.

    Args:
        space: The design space.
        matrix: (N, P) designs, as from `DesignSpace.matrix`; values outside the ranges of the space are allowed.
        tool: The tool at the end of each arm.
        precision: The precision of the arrays that the kernels read.
    """
    columns = _Columns(space, matrix)
    joints, present = _joints(space, columns)
    n_slots = joints.plan.shape[2]
    motors = _motors(space, columns, joints) if space.actuators else None
    carried = _carried(space, columns, joints, motors)
    bodies, com = _bodies(space, columns, joints, carried)
    per_joint = {
        "motion": joints.motion,
        "lower": joints.lower,
        "upper": joints.upper,
        "travel": np.where(joints.prismatic, space.travel, 1.0),
        "offset": _in_last_slot(bodies.offset, n_slots),
        "com": _in_last_slot(com, n_slots),
        "mass": _in_last_slot(bodies.total_mass, n_slots),
        "radius": _in_last_slot(columns.of_links(space.tube_values("radius"), 0.0), n_slots),
    }
    for name in ("bending_stiffness", "torsional_stiffness"):
        per_joint[name] = _in_last_slot(columns.of_links(space.tube_values(name), np.inf), n_slots, np.inf)
    if motors is not None:
        per_joint["ratings"] = motors.ratings
    if space.has_motor_bodies:
        motor, direction = _motor_choices(space, columns), _link_directions(space, columns)
        values = motor_body_values(space, motor, joints.plan, direction, columns.mount)
        per_joint |= {f"body_{name}": value for name, value in values.items()}
    present = _flatten(present)
    flat = _compact({name: _flatten(values) for name, values in per_joint.items()}, present)
    n_joints = present.sum(axis=1).astype(np.int32)
    tools = _mounted(tool)[columns.mount]
    add_tools(tools, n_joints - 1, flat["offset"], flat["com"], flat["mass"])
    return ArmArrays(
        base=np.ascontiguousarray(matrix[:, :3], dtype=precision),
        motion=np.ascontiguousarray(flat["motion"], dtype=np.int32),
        lower=-round_down(-flat["lower"], precision),
        upper=round_down(flat["upper"], precision),
        offset=flat["offset"].astype(precision),
        com=flat["com"].astype(precision),
        mass=flat["mass"].astype(precision),
        radius=flat["radius"].astype(precision),
        bending_stiffness=flat["bending_stiffness"],
        torsional_stiffness=flat["torsional_stiffness"],
        tool=tools,
        tool_axis=tools.axis.astype(precision),
        tool_side=tools.side.astype(precision),
        payload_center=np.zeros((columns.n, 3), dtype=precision),
        payload_gyration=np.zeros((columns.n, 3, 3)),
        n_joints=n_joints,
        travel=flat["travel"],
        length=np.cumsum(columns.links, axis=1)[:, -1],
        base_mass=carried.mass[:, 0] + columns.of_column("mass_per_metre"),
        structure_price=np.cumsum(space.tube_values("price_per_metre")[columns.tubes] * columns.links, axis=1)[:, -1]
        + columns.of_column("price_per_metre"),
        bodies=_spread(bodies, present, n_slots),
        actuation=None
        if motors is None
        else actuation_at_joints(
            flat["ratings"], flat["travel"], motors.price, np.full(columns.n, space.safety_factor)
        ),
        motor_bodies=_motor_bodies(flat, precision) if space.has_motor_bodies else None,
        columns=columns.below_bases(precision),
    )


class _Columns:
    """Reader of a matrix of designs, module by module.

    Attributes:
        present: (N, M) True for the modules that a design has.
        mount: (N,) index of the mount.
        links: (N, M) link lengths, 0 for absent modules [m].
        tubes: (N, M) indices of the tubes of links and rails.
    """

    def __init__(self, space: DesignSpace, matrix: Array) -> None:
        self._matrix, self._parameters, self._column_below = matrix, space.parameters, space.column
        self._column = {parameter.name: i for i, parameter in enumerate(self._parameters)}
        self.n, self.modules = len(matrix), space.max_joints
        self.present = np.ones((self.n, self.modules), dtype=bool)
        if "n_joints" in self._column:
            counts = self._indices("n_joints", int)
            self.present = np.arange(self.modules) < counts[:, None]
        mounts = tuple(MOUNTS)
        self.mount = np.full(self.n, mounts.index(space.mount[0]))
        if "mount" in self._column:
            self.mount = self._indices("mount", mounts.index)
        self.links = np.where(self.present, self.reals("link"), 0.0)
        names = space.tube_names
        self.tubes = self.choices("tube", names.index, names[0])
        if "tube" in self._column:
            self.tubes = np.repeat(self._indices("tube", names.index)[:, None], self.modules, axis=1)

    def of_links(self, per_tube: Array, without: float) -> Array:
        """Return the (N, M) values of links, from those of the tubes (K,); `without` for links without length."""
        return np.where(self.links > 0.0, per_tube[self.tubes], without)

    def of_column(self, per_metre: str) -> Array:
        """Return the (N,) values of the columns below the bases, from one per metre; 0 without columns."""
        if self._column_below is None:
            return np.zeros(self.n)
        return getattr(self._column_below, per_metre) * self._column_below.lengths(self._matrix[:, 2])

    def below_bases(self, precision: Precision) -> Columns | None:
        """Return the columns below the bases; None without columns."""
        if self._column_below is None:
            return None
        return columns_of(self._column_below.outer_diameter, self._column_below.lengths(self._matrix[:, 2]), precision)

    def _indices(self, name: str, index: Any) -> Any:
        """Return the (N,) `index` of each design's choice."""
        choices = cast("CategoricalParameter", self._parameters[self._column[name]]).choices
        return np.array([index(choice) for choice in choices])[self._matrix[:, self._column[name]].astype(np.intp)]

    def choices(self, kind: str, index: Any, default: str) -> Indices:
        """Return the (N, M) indices of the choices kind_1, kind_2, …; of `default` without such parameters."""
        names = [f"{kind}_{j}" for j in range(1, self.modules + 1)]
        columns = [
            self._indices(name, index) if name in self._column else np.full(self.n, index(default)) for name in names
        ]
        return np.stack(columns, axis=1)

    def reals(self, kind: str, default: float = 0.0) -> Array:
        """Return the (N, M) values of kind_1, kind_2, …; `default` without such parameters."""
        names = [f"{kind}_{j}" for j in range(1, self.modules + 1)]
        if all(name in self._column for name in names):
            first = self._column[names[0]]
            return self._matrix[:, first : first + self.modules]
        return np.full((self.n, self.modules), default)


@dataclass(frozen=True)
class _Joints:
    """Joints of N designs, (N, M, K) each."""

    plan: Indices  # motion in the axes of the base
    motion: Indices  # motion in world axes
    lower: Array  # [rad] or [m]
    upper: Array  # [rad] or [m]
    prismatic: Bools  # True for prismatic joints


@dataclass(frozen=True)
class _Motors:
    """Actuators of the modules of N designs."""

    mass: Array  # (N, M) of all actuators of a module, with their brackets [kg]
    ratings: Array  # (N, M, K, R) of each joint's
    price: Array  # (N,) of an arm [USD]


@dataclass(frozen=True)
class _Carried:
    """Masses that modules add to the end of the link before, the first one to the base, (N, M) each [kg]."""

    mass: Array  # rail and actuators
    rails: Array  # rails alone


def _joints(space: DesignSpace, columns: _Columns) -> tuple[_Joints, Bools]:
    """Return the joints, and (N, M, K) which of them a design has."""
    plan = _PLANS[columns.choices("joint", tuple(MODULES).index, space.joint_types[0])]  # (N, M, 2)
    if all(len(MODULES[kind].joints) == 1 for kind in space.joint_types):
        plan = plan[..., 1:]
    present = np.broadcast_to(columns.present[..., None], plan.shape) & (plan != _ABSENT)
    plan = np.where(present, plan, FIXED)
    axis, sign = _world_axes(columns, plan)
    lower, upper = _limits(space, columns, plan)
    lower, upper = np.where(sign < 0.0, 0.0 - upper, lower), np.where(sign < 0.0, 0.0 - lower, upper)
    motion = np.where(plan < FIXED, plan // PRISMATIC * PRISMATIC + axis, FIXED)
    return _Joints(plan, motion, lower, upper, (plan >= PRISMATIC) & (plan < FIXED)), present


def _limits(space: DesignSpace, columns: _Columns, plan: Indices) -> tuple[Array, Array]:
    """Return (N, M, K) lower and upper limits in the axes of the base [rad] or [m]."""
    low, high = space.joint_range
    if space.limit is not None:
        upper = columns.reals("limit", space.limit[0])[..., None]
        lower = -upper
    else:
        lower, upper = np.full((1, 1, 1), low), np.full((1, 1, 1), high)
    stroke = columns.reals("stroke", space.min_stroke)[..., None]
    lower = np.where(plan < PRISMATIC, lower, np.where(plan < FIXED, 0.0, -1.0))
    upper = np.where(plan < PRISMATIC, upper, np.where(plan < FIXED, stroke, 1.0))
    return lower, upper


def _motors(space: DesignSpace, columns: _Columns, joints: _Joints) -> _Motors:
    moves = joints.plan < FIXED  # (N, M, K) joints that need an actuator
    count = moves.sum(axis=2)
    motor = _motor_choices(space, columns)
    masses, prices, ratings = _catalogue(space)
    ratings = np.repeat(ratings[motor][:, :, None], moves.shape[2], axis=2)
    ratings[~moves] = FIXED_RATINGS
    return _Motors(
        mass=count * (masses[motor] + space.bracket_mass),
        ratings=ratings,
        price=np.where(count > 0, count * prices[motor], 0.0).sum(axis=1),
    )


def _motor_choices(space: DesignSpace, columns: _Columns) -> Indices:
    """Return the (N, M) index of the actuator of each module."""
    return columns.choices("motor", [a.name for a in space.arm_actuators].index, space.arm_actuators[0].name)


def _link_directions(space: DesignSpace, columns: _Columns) -> Indices:
    """Return the (N, M) index of the direction of each link."""
    return columns.choices("direction", tuple(DIRECTIONS).index, space.link_directions[0])


def _motor_bodies(flat: dict[str, Any], precision: Precision) -> MotorBodies:
    """Return the bodies of actuators; joints that an arm does not have come last, without bodies."""
    return bodies_in({field.name: flat[f"body_{field.name}"] for field in fields(MotorBodies)}, precision)


def _carried(space: DesignSpace, columns: _Columns, joints: _Joints, motors: _Motors | None) -> _Carried:
    """Return the masses of rails and actuators."""
    stroke = columns.reals("stroke", space.min_stroke)
    rails = np.where(joints.prismatic[..., -1], space.link_mass(stroke, columns.tubes), 0.0)
    if motors is not None:
        return _Carried(rails + motors.mass, rails)
    return _Carried(rails + (joints.plan < FIXED).sum(axis=2) * space.bracket_mass, rails)


@cache
def _catalogue(space: DesignSpace) -> tuple[Array, Array, Array]:
    """Return mass [kg], price [USD] and (A, R) ratings of the A actuators of a space."""
    actuators = space.arm_actuators
    return (
        np.array([actuator.mass for actuator in actuators]),
        np.array([np.nan if actuator.price is None else actuator.price for actuator in actuators]),
        np.array([ratings_of(actuator) for actuator in actuators]),
    )


def _bodies(space: DesignSpace, columns: _Columns, joints: _Joints, carried: _Carried) -> tuple[Bodies, Array]:
    """Return the links as bodies, (N, M, ...) each, and (N, M, 3) their centres of mass from the joint [m]."""
    links = columns.links
    mass = np.where(columns.present, space.link_mass(links, columns.tubes), 0.0)
    end_mass = np.concatenate([carried.mass[:, 1:], np.zeros((columns.n, 1))], axis=1)
    direction = _rotate(_VECTORS[_link_directions(space, columns)], columns.mount)  # (N, M, 3)
    middle = direction * (links / 2)[..., None]
    offset = direction * links[..., None]
    end_mass_position = offset + _end_shift(space, columns, joints.plan, carried)
    total = mass + end_mass
    carried_com = (mass[..., None] * middle + end_mass[..., None] * end_mass_position) / np.where(
        total > 0.0, total, 1.0
    )[..., None]
    radius = np.where(columns.present, space.tube_values("radius")[columns.tubes], 0.0)
    com = np.where(end_mass[..., None] > 0.0, carried_com, middle)
    return Bodies(mass, middle, offset, radius, end_mass, end_mass_position), com


def _end_shift(space: DesignSpace, columns: _Columns, plan: Indices, carried: _Carried) -> Array | float:
    """Return the (N, M, 3) vectors from the end of each link to the centre of the mass carried there [m]."""
    rails = carried.rails
    if not rails.any():
        return 0.0
    share = np.where(rails > 0.0, rails / np.where(carried.mass > 0.0, carried.mass, 1.0), 0.0)
    shift = share * (columns.reals("stroke", space.min_stroke) / 2)
    local = np.eye(3)[plan[..., -1] % PRISMATIC] * shift[..., None]
    shifts = np.zeros_like(local)
    shifts[:, :-1] = _rotate(local, columns.mount)[:, 1:]
    return shifts


def _world_axes(columns: _Columns, plan: Indices) -> tuple[Indices, Array]:
    """Return the (N, M, K) world axis of each joint, and its sign (1 or -1) relative to the axis of the base."""
    own = plan % PRISMATIC
    if not columns.mount.any():
        return own, np.ones(own.shape)
    mount = columns.mount[:, None, None]
    return _WORLD_AXES[mount, own], _SIGNS[mount, own]


def _rotate(vectors: Array, mount: Indices) -> Array:
    """Rotate (N, M, 3) vectors from base axes into world axes."""
    if not mount.any():  # all on a floor
        return np.array(vectors)
    rotated = np.zeros(vectors.shape)
    for axis in range(3):
        world, sign = _WORLD_AXES[mount, axis], _SIGNS[mount, axis]
        np.put_along_axis(rotated, np.broadcast_to(world[:, None, None], (*vectors.shape[:2], 1)),
                          (sign[:, None] * vectors[..., axis])[..., None], axis=2)  # fmt: skip
    return rotated


@cache
def _mounted(tool: Tool) -> Tools:
    """Return a tool for each mount."""
    return stack_tools(list(mounted_tools(tool).values()))


def _in_last_slot(values: Array, n_slots: int, fill: float = 0.0) -> Array:
    """Return values of modules (N, M, ...) in the last of K slots of each (N, M, K, ...); `fill` in the others."""
    n, modules, *size = values.shape
    slots = np.full((n, modules, n_slots, *size), fill)
    slots[:, :, -1] = values
    return slots


def _flatten(values: Any) -> Any:
    """Return (N, M, K, ...) as (N, M K, ...)."""
    n, modules, n_slots, *size = values.shape
    return values.reshape(n, modules * n_slots, *size)


def _compact(arrays: dict[str, Any], present: Bools) -> dict[str, Any]:
    """Move the joints (N, D, ...) that a design has to the front, in their order."""
    if present.all():
        return arrays
    order = np.argsort(~present, axis=1, kind="stable")
    rows = np.arange(len(present))[:, None]
    return {name: values[rows, order] for name, values in arrays.items()}


def _spread(bodies: Bodies, present: Bools, n_slots: int) -> Bodies:
    """Return the bodies of joints (N, D, ...), from those of modules (N, M, ...)."""
    spread = {field.name: getattr(bodies, field.name) for field in fields(Bodies)}
    if n_slots > 1:
        spread = {name: _flatten(_in_last_slot(values, n_slots)) for name, values in spread.items()}
    return Bodies(**_compact(spread, present))
