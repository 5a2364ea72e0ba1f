"""Designs, built into arms: many as stacked arrays, or one as an `Arm`.

There are N designs of up to M modules. A module has up to K joints at one place, K = 2 if the space has a module of two
joints, else 1; its link follows the last joint. The D = M K joint slots of stacked arms are compacted: joints that an
arm has come first.
"""

from dataclasses import fields, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.actuation import FIXED_RATINGS, Actuation, actuation_at_joints
from armwright.kinematics.arms.arm_arrays import (
    FIXED,
    MOTION_AXES,
    PRISMATIC,
    ArmArrays,
    Precision,
    exact_arms,
    stack_columns,
    stack_tools,
)
from armwright.kinematics.arms.motor_bodies import bodies_in, body_values, without_bodies
from armwright.kinematics.arms.rigid_bodies import Bodies, Tools
from armwright.robot.arm import AXES, NO_INERTIA, Arm, Joint, Link, Vector
from armwright.robot.link_inertia import point_inertia, tube_inertia
from armwright.robot.motor_body import placed_body
from armwright.spaces.design_columns import DesignColumns, Indices
from armwright.spaces.joint_modules import DIRECTIONS, MODULES, MOUNTS, SIGNS, WORLD_AXES, mounted_body
from armwright.spaces.space_schema import SpaceSchema
from armwright.spaces.supply_voltages import supplied, supplied_ratings, supply_voltages
from armwright.spaces.tool_mount import mounted_tools
from armwright.tasks.tool import NO_TOOL, Tool

ORIGIN: Vector = (0.0, 0.0, 0.0)

_KINDS = {"revolute": 0, "prismatic": PRISMATIC, "fixed": FIXED}
_ABSENT = -1  # no joint in this slot of a module
# Local motions of each module's joints; a single joint is in the last slot
_PLANS = np.full((len(MODULES), 2), _ABSENT)
for _row, _module in zip(_PLANS, MODULES.values(), strict=True):
    for _slot, (_kind, _axis) in enumerate(_module.joints, start=2 - len(_module.joints)):
        _row[_slot] = _KINDS[_kind] + (0 if _kind == "fixed" else AXES.index(_axis))
_VECTORS = np.array(list(DIRECTIONS.values()))  # (directions, 3)
_UPRIGHT = tuple(DIRECTIONS).index("+z")  # from the surface that the arm is mounted on to the first joint


def stack_designs(
    space: SpaceSchema, matrix: Array, tool: Tool = NO_TOOL, precision: Precision = "float32"
) -> ArmArrays:
    """Build the arms of a matrix (N, P) of designs, with a tool at their end, as arrays of a precision for the kernels.

    Values outside the ranges of the space are allowed.
    """
    return _Parts(space, matrix).stacked(tool, precision)


def build_arm(space: SpaceSchema, matrix: Array, tool: Tool = NO_TOOL) -> Arm:
    """Build the arm of a single design; matrix: (1, P)."""
    return _Parts(space, matrix).arm(0, tool)


class _Parts:
    """Joints (N, M, K), links (N, M) and actuators of N designs, exact."""

    def __init__(self, space: SpaceSchema, matrix: Array) -> None:
        self._space = space
        columns = self._columns = DesignColumns(space, matrix)
        plan = _PLANS[columns.choices("joint", tuple(MODULES).index, space.joint_types[0])]  # (N, M, 2)
        if all(len(MODULES[kind].joints) == 1 for kind in space.joint_types):
            plan = plan[..., 1:]
        self._has = np.broadcast_to(columns.present[..., None], plan.shape) & (plan != _ABSENT)
        self._plan = np.where(self._has, plan, FIXED)  # motions in the axes of the base
        self._moves = self._plan < FIXED  # joints that need an actuator
        self._slides = (self._plan >= PRISMATIC) & self._moves
        self._stroke = columns.reals("stroke", space.min_stroke)  # (N, M) [m]
        actuators = space.arm_actuators
        self._motor = (
            columns.choices("motor", [a.name for a in actuators].index, actuators[0].name) if actuators else None
        )
        self._direction = columns.choices("direction", tuple(DIRECTIONS).index, space.link_directions[0])
        moves = np.asarray(self._moves.any(axis=2))
        self._volts = None if self._motor is None else supply_voltages(space, self._motor, moves)
        self._weigh()

    def _weigh(self) -> None:
        """Find the masses of links, and of the rails and actuators that modules add to the end of the link before."""
        space, columns, count = self._space, self._columns, self._moves.sum(axis=2)
        self._rails = np.where(self._slides[..., -1], space.link_mass(self._stroke, columns.tubes), 0.0)
        each = space.bracket_masses[0] if self._motor is None else _catalogue(space)[0][self._motor]
        self._carried = self._rails + count * each
        self._mass = np.where(columns.present, space.link_mass(columns.links, columns.tubes), 0.0)
        vectors = _rotate(_VECTORS[self._direction], columns.mount)
        self._middle = vectors * (columns.links / 2)[..., None]
        self._offset = vectors * columns.links[..., None]
        self._end_mass = np.concatenate([self._carried[:, 1:], np.zeros((columns.n, 1))], axis=1)
        self._end_shift, self._end_inertia = self._carried_bodies()

    def _carried_bodies(self) -> tuple[Array, Array]:
        """Return what each link carries at its end: rail, motors and their brackets, of the motor's shape.

        (N, M, 3) vectors from the end of the link to its centre of mass [m]; (N, M, 3, 3) inertia about it [kg m²].
        """
        space, columns, rails, carried = self._space, self._columns, self._rails, self._carried
        centre, tensor = np.zeros((*carried.shape, 3)), np.zeros((*carried.shape, 3, 3))
        if space.has_motor_bodies:
            bodies = self._motor_bodies = self._find_motor_bodies()
            centre = bodies["centre"][:, :, 0]
            tensor = ((carried - rails)[..., None] * bodies["gyration"][:, :, 0])[..., None] * np.eye(3)
        if rails.any():
            share = np.where(rails > 0.0, rails / np.where(carried > 0.0, carried, 1.0), 0.0)[..., None]
            rail = _rotate(np.eye(3)[self._plan[..., -1] % PRISMATIC] * self._stroke[..., None], columns.mount)
            both = share * (rail / 2) + (1.0 - share) * centre
            section = space.tube_values("section")[columns.tubes]
            tensor = tensor + tube_inertia(rails, rail, section) + point_inertia(rails, rail / 2 - both)
            centre, tensor = both, tensor + point_inertia(carried - rails, centre - both)
        nothing = np.zeros((columns.n, 1, 3, 3))
        return np.append(centre[:, 1:], nothing[..., 0], axis=1), np.append(tensor[:, 1:], nothing, axis=1)

    def _limits(self, sign: Array) -> tuple[Array, Array]:
        """Return (N, M, K) lower and upper limits [rad] or [m]; sign: 1 if an axis of the base is one of the world."""
        space, (low, high) = self._space, self._space.joint_range
        if space.limit is not None:
            upper = self._columns.reals("limit", space.limit[0])[..., None]
            lower = -upper
        else:
            lower, upper = np.full((1, 1, 1), low), np.full((1, 1, 1), high)
        lower = np.where(self._plan < PRISMATIC, lower, np.where(self._moves, 0.0, -1.0))
        upper = np.where(self._plan < PRISMATIC, upper, np.where(self._moves, self._stroke[..., None], 1.0))
        return np.where(sign < 0.0, 0.0 - upper, lower), np.where(sign < 0.0, 0.0 - lower, upper)

    def _world_axes(self) -> tuple[Indices, Array]:
        """Return the (N, M, K) world axis of each joint, and its sign (1 or -1) relative to the axis of the base."""
        own, mount = self._plan % PRISMATIC, self._columns.mount
        if not mount.any():
            return own, np.ones(own.shape)
        return WORLD_AXES[mount[:, None, None], own], SIGNS[mount[:, None, None], own]

    def stacked(self, tool: Tool, precision: Precision) -> ArmArrays:
        """Return the arms, stacked."""
        space, columns = self._space, self._columns
        axis, sign = self._world_axes()
        lower, upper = self._limits(sign)
        links, com = self._bodies()
        motion = np.where(self._moves, self._plan // PRISMATIC * PRISMATIC + axis, FIXED)
        travel = self._at_joints(np.where(self._slides, space.travel, 1.0))
        column, below = space.column, np.zeros(columns.n)  # (N,) length of the column [m]
        below = below if column is None else column.lengths(columns.matrix[:, 2])
        prices = space.tube_values("price_per_metre")[columns.tubes] * columns.links
        return exact_arms(
            precision,
            base=columns.matrix[:, :3],
            motion=np.ascontiguousarray(self._at_joints(motion), dtype=np.int32),
            axis=MOTION_AXES[self._at_joints(motion)],
            lower=self._at_joints(lower),
            upper=self._at_joints(upper),
            offset=self._after_joints(links.offset),
            com=self._after_joints(com),
            mass=self._after_joints(links.total_mass),
            radius=self._after_joints(self._of_links("radius", 0.0)),
            bending_stiffness=self._after_joints(self._of_links("bending_stiffness", np.inf), np.inf),
            torsional_stiffness=self._after_joints(self._of_links("torsional_stiffness", np.inf), np.inf),
            tool=_stacked_tools(tool)[columns.mount],
            n_joints=self._has.sum(axis=(1, 2)).astype(np.int32),
            travel=travel,
            length=np.cumsum(columns.links, axis=1)[:, -1],
            base_mass=self._carried[:, 0] + (0.0 if column is None else column.mass_per_metre * below),
            structure_price=np.cumsum(prices, axis=1)[:, -1]
            + (0.0 if column is None else column.price_per_metre * below),
            bodies=Bodies(*(self._after_joints(getattr(links, field.name)) for field in fields(Bodies))),
            actuation=self._actuation(travel),
            motor_bodies=bodies_in({k: self._at_joints(v) for k, v in self._motor_bodies.items()}, precision)
            if space.has_motor_bodies
            else None,
            columns=None if column is None else stack_columns(column.outer_diameter, below, precision),
        )

    def _at_joints(self, values: Any) -> Any:
        """Return values of slots (N, M, K, ...) as (N, D, ...), those of joints that an arm has first."""
        n, modules, n_slots, *size = values.shape
        flat = values.reshape(n, modules * n_slots, *size)
        if self._has.all():
            return flat
        order = np.argsort(~self._has.reshape(n, -1), axis=1, kind="stable")
        return flat[np.arange(n)[:, None], order]

    def _after_joints(self, values: Array, fill: float = 0.0) -> Any:
        """Return values of links (N, M, ...) at the last joints of their modules, (N, D, ...); `fill` at the others."""
        n, modules, *size = values.shape
        slots = np.full((n, modules, self._plan.shape[2], *size), fill)
        slots[:, :, -1] = values
        return self._at_joints(slots)

    def _of_links(self, name: str, without: float) -> Array:
        """Return the (N, M) values of links, from those of the tubes; `without` for links without length."""
        return np.where(self._columns.links > 0.0, self._space.tube_values(name)[self._columns.tubes], without)

    def _bodies(self) -> tuple[Bodies, Array]:
        """Return the links as bodies, (N, M, ...) each, and (N, M, 3) their centres of mass from the joint [m]."""
        mass, end_mass, place = self._mass, self._end_mass, self._offset + self._end_shift
        total = mass + end_mass
        both = mass[..., None] * self._middle + end_mass[..., None] * place
        com = np.where(end_mass[..., None] > 0.0, both / np.where(total > 0.0, total, 1.0)[..., None], self._middle)
        section = np.where(self._columns.present, self._space.tube_values("section")[self._columns.tubes], 0.0)
        return Bodies(mass, self._middle, self._offset, section, end_mass, place, self._end_inertia), com

    def _actuation(self, travel: Array) -> Actuation | None:
        if self._motor is None or self._volts is None:
            return None
        each = supplied_ratings(self._space, self._motor, self._volts)[:, :, None]
        ratings = np.where(self._moves[..., None], each, FIXED_RATINGS)
        count, prices = self._moves.sum(axis=2), _catalogue(self._space)[1]
        price = np.where(count > 0, count * prices[self._motor], 0.0).sum(axis=1)
        factor = np.full(self._columns.n, self._space.safety_factor)
        return actuation_at_joints(self._at_joints(ratings), travel, price, factor)

    def _carriers(self) -> Indices:
        """Return the (N, M) direction of the link before each module, or from the surface to the first joint."""
        return np.concatenate([np.full((self._columns.n, 1), _UPRIGHT), self._direction[:, :-1]], axis=1)

    def _find_motor_bodies(self) -> dict[str, NDArray[Any]]:
        """Return the bodies of actuators by field of `MotorBodies`, and their gyrations, (N, M, 1, ...)."""
        plan, mount = self._plan[..., 0], self._columns.mount[:, None]
        values = without_bodies(*self._plan.shape) | {"gyration": np.zeros((*self._plan.shape, 3))}
        for name, table in _body_table(self._space).items():
            found = table[self._motor, plan % PRISMATIC, self._carriers(), mount]
            values[name][self._moves] = found[self._moves[..., 0]]
        return values

    def arm(self, row: int, tool: Tool) -> Arm:
        """Return the arm of a row."""
        space, columns = self._space, self._columns
        x, y, z = columns.matrix[row, :3].tolist()
        return Arm(
            base=(x, y, z),
            joints=self._arm_joints(row),
            links=tuple(link for i in range(int(columns.present[row].sum())) for link in self._arm_links(row, i)),
            tool=mounted_tools(tool)[tuple(MOUNTS)[int(columns.mount[row])]],
            base_mass=float(self._carried[row, 0]),
            safety_factor=space.safety_factor,
            column=None if space.column is None else space.column.under(z),
        )

    def _arm_joints(self, row: int) -> tuple[Joint, ...]:
        space, mount = self._space, tuple(MOUNTS)[int(self._columns.mount[row])]
        axes, sign = self._world_axes()
        lower, upper = self._limits(sign)
        carriers = tuple(DIRECTIONS.values())
        joints: list[Joint] = []
        for i, slot in np.argwhere(self._has[row]).tolist():
            here, motion = (row, i, slot), int(self._plan[row, i, slot])
            if motion == FIXED:
                joints.append(Joint("fixed", AXES[int(WORLD_AXES[self._columns.mount[row], AXES.index("z")])]))
                continue
            actuator = None
            if self._motor is not None and self._volts is not None:
                actuator = supplied(space.actuators[int(self._motor[row, i])], float(self._volts[row, i]))
            body = None
            if space.has_motor_bodies and actuator is not None and actuator.shape is not None:
                carrier = carriers[int(self._carriers()[row, i])]
                body = mounted_body(placed_body(actuator.shape, AXES[motion % PRISMATIC], carrier), mount)
            kind, travel = ("revolute", 1.0) if motion < PRISMATIC else ("prismatic", space.travel)
            limits = float(lower[here]), float(upper[here])
            joints.append(Joint(kind, AXES[int(axes[here])], *limits, actuator, travel, body))
        return tuple(joints)

    def _arm_links(self, row: int, i: int) -> list[Link]:
        """Return the links of module `i`: massless ones between its joints, then its own."""
        tube = self._space.link_section.options[int(self._columns.tubes[row, i])]
        x, y, z = self._offset[row, i].tolist()
        u, v, w = self._end_shift[row, i].tolist()
        xx, yy, zz = map(tuple, self._end_inertia[row, i].tolist())
        length = float(self._columns.links[row, i])
        link = Link(
            offset=(x, y, z),
            mass=float(self._mass[row, i]),
            com=(x / 2, y / 2, z / 2),
            radius=tube.radius,
            end_mass=float(self._end_mass[row, i]),
            end_shift=(u, v, w),
            end_inertia=(xx, yy, zz),
            bending_stiffness=tube.bending_stiffness,
            torsional_stiffness=tube.torsional_stiffness,
            wall=tube.wall,
            price=tube.price_per_metre * length,
        )
        bare = {"end_mass": 0.0, "end_shift": ORIGIN, "end_inertia": NO_INERTIA}
        between = replace(link, offset=ORIGIN, mass=0.0, com=ORIGIN, price=0.0, **bare)
        return [between] * (int(self._has[row, i].sum()) - 1) + [link]


@cache
def _catalogue(space: SpaceSchema) -> tuple[Array, Array]:
    """Return mass with brackets [kg] and price [USD] of the A actuators of a space."""
    masses = np.array([one.mass for one in space.actuators]) + space.bracket_masses
    return masses, np.array([np.nan if one.price is None else one.price for one in space.actuators])


@cache
def _body_table(space: SpaceSchema) -> dict[str, NDArray[Any]]:
    """Return the values and gyrations of bodies by actuator, axis of the joint, direction of the link before, mount."""
    shapes = [actuator.shape for actuator in space.arm_actuators]
    size = len(shapes), len(AXES), len(DIRECTIONS), len(MOUNTS)
    values = without_bodies(*size) | {"gyration": np.zeros((*size, 3))}
    cases = product(enumerate(shapes), enumerate(AXES), enumerate(DIRECTIONS.values()), enumerate(MOUNTS))
    for (a, shape), (i, axis), (d, carrier), (m, mount) in cases:
        if shape is not None and mount in space.mount:
            body = mounted_body(placed_body(shape, axis, carrier), mount)
            for name, value in zip(values, (*body_values(body), body.gyration), strict=True):
                values[name][a, i, d, m] = value
    return values


@cache
def _stacked_tools(tool: Tool) -> Tools:
    """Return a tool for each mount."""
    return stack_tools(list(mounted_tools(tool).values()))


def _rotate(vectors: Array, mount: Indices) -> Array:
    """Rotate (N, M, 3) vectors from base axes into world axes."""
    if not mount.any():  # all on a floor
        return np.array(vectors)
    rotated = np.zeros(vectors.shape)
    for axis in range(3):
        world, sign = WORLD_AXES[mount, axis], SIGNS[mount, axis]
        np.put_along_axis(rotated, np.broadcast_to(world[:, None, None], (*vectors.shape[:2], 1)),
                          (sign[:, None] * vectors[..., axis])[..., None], axis=2)  # fmt: skip
    return rotated
