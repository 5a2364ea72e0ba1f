"""Arms stacked into arrays, as the kernels take them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from armwright.arm import AXES, Arm, Joint
from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError, did_you_mean
from armwright.modules import DIRECTIONS, MODULES, MOUNTS
from armwright.parameters import CategoricalParameter
from armwright.space import DesignSpace

MOST_JOINTS = 16
LARGEST_ANGLE = 2 * np.pi  # [rad], for which the kernels' sine is made
SLIDES, FIXED = 3, 6  # motions: 0 to 2 turn about local x, y, z, 3 to 5 slide along them, 6 does not move

Precision = Literal["float32", "float64"]
Motions = Literal["turning", "any"]  # what all joints of some arms do
Rows = Literal["position", "mixed"]  # what targets ask for: points alone, or of some which way the tool points, too
Floats = NDArray[np.float32] | NDArray[np.float64]  # of an array's precision
Ints = NDArray[np.int32]
_FLOATS = ("base", "lower", "upper", "offset", "com", "mass")
TOOL = ("tool_axis", "tool_side")  # that only targets with an axis or an orientation need
FLOATS = (*_FLOATS, *TOOL)
ARRAYS = (*_FLOATS, "motion")  # of `ArmArrays`, that all kernels of inverse kinematics read


@dataclass(frozen=True)
class Actuation:
    """What moves the joints of N arms of up to D joints.

    effort: (N, D) the torque that may be asked of each actuator [N m]; infinite where there is no joint to move.
    speed: (N, D) its largest [rad/s]; NaN where not known, infinite where there is no joint to move.
    price: (N,) of all together [USD]; NaN where one has none.
    """

    effort: Array
    speed: Array
    price: Array

    def __getitem__(self, rows: slice) -> "Actuation":
        return Actuation(self.effort[rows], self.speed[rows], self.price[rows])


@dataclass(frozen=True)
class Bodies:
    """What the links of N arms of up to D joints are made of, in float64 whatever the precision of the arms.

    A link is a solid cylinder, which carries a point mass at its end (`armwright.arm.Link`).
    """

    mass: Array  # (N, D) of the cylinder [kg]
    com: Array  # (N, D, 3) of the cylinder, from its joint [m]
    offset: Array  # (N, D, 3) along the cylinder, from its joint to the next or to the end of the last link [m]
    radius: Array  # (N, D) [m]
    end_mass: Array  # (N, D) [kg]
    end_place: Array  # (N, D, 3) from its joint [m]

    @property
    def total_mass(self) -> Array:
        """(N, D) of both [kg]."""
        return self.mass + self.end_mass

    @property
    def total_com(self) -> Array:
        """(N, D, 3) of both, from the joint [m]."""
        total = self.total_mass[..., None]
        both = self.mass[..., None] * self.com + self.end_mass[..., None] * self.end_place
        return both / np.where(total > 0.0, total, 1.0)

    @property
    def inertia(self) -> Array:
        """(N, D, 3, 3) of both about their centre, in the link's frame [kg m²]; as the exported files have it."""
        square = (self.offset**2).sum(axis=-1)
        long = np.sqrt(square)[..., None]
        axis = np.where(long > 0.0, self.offset / np.where(long > 0.0, long, 1.0), (0.0, 0.0, 1.0))
        around = axis[..., :, None] * axis[..., None, :]
        across_it = (self.mass * (3.0 * self.radius**2 + square) / 12.0)[..., None, None]
        around_it = (self.mass * self.radius**2 / 2.0)[..., None, None]
        tensor = across_it * (np.eye(3) - around) + around_it * around
        centre = self.total_com
        for mass, place in ((self.mass, self.com), (self.end_mass, self.end_place)):
            away = place - centre
            squared = (away**2).sum(axis=-1)[..., None, None] * np.eye(3)
            tensor += mass[..., None, None] * (squared - away[..., :, None] * away[..., None, :])
        return tensor

    def __getitem__(self, rows: slice) -> "Bodies":
        return Bodies(**{field.name: getattr(self, field.name)[rows] for field in fields(self)})


@dataclass(frozen=True)
class ArmArrays:
    """N arms of up to D joints. A shorter arm ends with fixed joints that have neither length nor mass.

    All floats that the kernels read are of one precision; the others are float64.
    """

    base: Floats  # (N, 3) [m]
    motion: Ints  # (N, D) 0 to 2: turns about local x, y, z; 3 to 5: slides along them; 6: fixed
    lower: Floats  # (N, D) [rad] or [m]; of a fixed joint ±1, so that nothing divides by 0
    upper: Floats  # (N, D) [rad] or [m]
    offset: Floats  # (N, D, 3) from a joint to the next, or to the tip of the tool [m]
    com: Floats  # (N, D, 3) from a joint to the centre of mass of what it carries up to the next [m]
    mass: Floats  # (N, D) [kg]
    radius: Floats  # (N, D) of the link after a joint [m]; 0 where there is none
    tool: Array  # (N, 3) from the end of the last link to the tip [m], in its own frame; a part of `offset`
    tool_axis: Floats  # (N, 3) the tool's own z in the world when all joints are at 0, and so in the last local frame
    tool_side: Floats  # (N, 3) the same of its x
    n_joints: Ints  # (N,) how many of the D an arm has
    travel: Array  # (N, D) of a joint for each radian of its actuator: 1 where it turns [m/rad]
    length: Array  # (N,) of all links [m]
    base_mass: Array  # (N,) of what stands with the base [kg]
    bodies: Bodies  # what only dynamics asks for
    actuation: Actuation | None = None  # where all moving joints have actuators

    def __len__(self) -> int:
        return len(self.base)

    def __getitem__(self, rows: slice) -> "ArmArrays":
        parts: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        cut: dict[str, Any] = {name: None if part is None else part[rows] for name, part in parts.items()}
        return ArmArrays(**cut)

    @property
    def precision(self) -> Precision:
        return "float64" if self.base.dtype == np.float64 else "float32"

    @property
    def dof(self) -> int:
        """The number D of joints that there is room for."""
        return self.motion.shape[1]

    @property
    def motions(self) -> Motions:
        return "turning" if np.all(self.motion < SLIDES) else "any"

    @property
    def starts_at_zero(self) -> bool:
        """Whether no joint's limits exclude 0."""
        return bool(np.all(self.lower <= 0.0) and np.all(self.upper >= 0.0))


def checked_precision(name: str) -> Precision:
    """The name, if it is a precision's."""
    allowed = get_args(Precision)
    if name not in allowed:
        raise SettingsError(f'precision = "{name}" is not one of {", ".join(allowed)}.{did_you_mean(name, allowed)}')
    return cast("Precision", name)


def stack_arms(arms: Sequence[Arm], precision: Precision = "float32") -> ArmArrays:
    """The arms as arrays."""
    if not arms:
        raise ArmError("no arms were given")
    for arm in arms:
        _check(arm)
    n, dof = len(arms), max(len(arm.joints) for arm in arms)
    motion = np.full((n, dof), FIXED, dtype=np.int32)
    lower, upper, travel = np.full((3, n, dof), 1.0)
    lower *= -1.0
    mass, radius = np.zeros((2, n, dof))
    offset, com = np.zeros((2, n, dof, 3))
    bodies = Bodies(*(np.zeros((n, dof, *size)) for size in ((), (3,), (3,), (), (), (3,))))
    for i, arm in enumerate(arms):
        own = slice(len(arm.joints))
        motion[i, own] = [_motion(joint) for joint in arm.joints]
        lower[i, own] = [-1.0 if joint.kind == "fixed" else joint.lower for joint in arm.joints]
        upper[i, own] = [1.0 if joint.kind == "fixed" else joint.upper for joint in arm.joints]
        travel[i, own] = [joint.travel for joint in arm.joints]
        offset[i, own] = [link.offset for link in arm.links]
        offset[i, len(arm.joints) - 1] += arm.tool
        com[i, own] = [link.total_com for link in arm.links]
        mass[i, own] = [link.total_mass for link in arm.links]
        radius[i, own] = [link.radius if link.length > 0.0 else 0.0 for link in arm.links]
        for part in fields(Bodies):
            getattr(bodies, part.name)[i, own] = [getattr(link, part.name) for link in arm.links]
    return ArmArrays(
        base=np.array([arm.base for arm in arms], dtype=precision),
        motion=motion,
        lower=-_never_above(-lower, precision),
        upper=_never_above(upper, precision),
        offset=offset.astype(precision),
        com=com.astype(precision),
        mass=mass.astype(precision),
        radius=radius.astype(precision),
        tool=np.array([arm.tool for arm in arms]),
        tool_axis=np.array([arm.tool_axis for arm in arms], dtype=precision),
        tool_side=np.array([arm.tool_side for arm in arms], dtype=precision),
        n_joints=np.array([len(arm.joints) for arm in arms], dtype=np.int32),
        travel=travel,
        length=np.array([arm.length for arm in arms]),
        base_mass=np.array([arm.base_mass for arm in arms]),
        bodies=bodies,
        actuation=_actuation(arms, dof),
    )


def _motion(joint: Joint) -> int:
    return {"revolute": 0, "prismatic": SLIDES, "fixed": FIXED}[joint.kind] + (
        0 if joint.kind == "fixed" else AXES.index(joint.axis)
    )


def _check(arm: Arm) -> None:
    if len(arm.joints) > MOST_JOINTS:
        raise ArmError(f"the kernels take up to {MOST_JOINTS} joints, not {len(arm.joints)}")
    for number, joint in enumerate(arm.joints, start=1):
        if joint.kind == "revolute" and max(-joint.lower, joint.upper) > LARGEST_ANGLE:
            raise ArmError(f"joint {number} turns beyond ±2π rad: [{joint.lower:g}, {joint.upper:g}]")


def _actuation(arms: Sequence[Arm], dof: int) -> Actuation | None:
    """None where a moving joint has no actuator."""
    efforts, speeds = np.full((2, len(arms), dof), np.inf)
    prices = np.zeros(len(arms))
    for i, arm in enumerate(arms):
        for j, joint in enumerate(arm.joints):
            if joint.kind == "fixed":
                continue
            if joint.actuator is None:
                return None
            efforts[i, j] = joint.actuator.effort
            speeds[i, j] = np.nan if joint.actuator.speed is None else joint.actuator.speed
            prices[i] += np.nan if joint.actuator.price is None else joint.actuator.price
    return Actuation(efforts, speeds, prices)


def arrays_of(space: DesignSpace, matrix: Array, precision: Precision = "float32") -> ArmArrays:
    """The arms that designs build, equal to the bit to `stack_arms` of their arms, without building them one by one.

    matrix: (N, P) designs as rows (`DesignSpace.matrix`); values beyond the space's ranges are built, too.
    """
    n = len(matrix)
    read = _Reader(space, matrix)
    there = read.there
    letter = read.choices("joint", tuple(MODULES).index, space.joint_types[0])  # (N, M)
    plan = _PLAN[letter]  # (N, M, 2) local motions; the link follows the second place
    wide = any(len(MODULES[kind].joints) > 1 for kind in space.joint_types)
    plan = plan if wide else plan[..., 1:]
    there = np.broadcast_to(there[..., None], plan.shape) & (plan != _NONE)  # (N, M, K)
    plan = np.where(there, plan, FIXED)
    axis, sign = _mounted(read, plan)
    slides = (plan >= SLIDES) & (plan < FIXED)
    lower, upper = _ranges(space, read, plan)
    lower, upper = np.where(sign < 0.0, 0.0 - upper, lower), np.where(sign < 0.0, 0.0 - lower, upper)
    links = np.where(read.there, read.reals("link"), 0.0)  # (N, M)
    mass = np.where(read.there, space.mass.masses(links), 0.0)
    middle = links / 2
    moving = (plan < FIXED).sum(axis=2)  # (N, M) joints of a module that need an actuator
    rails = np.where(slides[..., -1], space.mass.masses(read.reals("stroke", space.least_stroke)), 0.0)
    carried, actuation = rails, None
    if space.actuators:
        chosen = read.choices("motor", [a.name for a in space.arm_actuators].index, space.arm_actuators[0].name)
        efforts, speeds, masses, prices = _catalogue(space)
        carried = rails + moving * masses[chosen]
        price = np.where(moving > 0, moving * prices[chosen], 0.0).sum(axis=1)
        effort, speed = (np.where(plan < FIXED, each[chosen][..., None], np.inf) for each in (efforts, speeds))
        actuation = Actuation(effort, speed, price)
    ends = np.concatenate([carried[:, 1:], np.zeros((n, 1))], axis=1)  # a link carries what the next module begins with
    total = mass + ends
    direction = _direction(space, read)  # (N, M, 3)
    middles = direction * middle[..., None]
    along = direction * links[..., None]
    end_place = along + _shift(space, read, plan, rails, carried)
    both = (mass[..., None] * middles + ends[..., None] * end_place) / np.where(total > 0.0, total, 1.0)[..., None]
    centre = np.where(ends[..., None] > 0.0, both, middles)
    shape = plan.shape
    offset, com, masses_ = np.zeros((*shape, 3)), np.zeros((*shape, 3)), np.zeros(shape)
    offset[..., -1, :] = along
    com[..., -1, :] = centre
    masses_[..., -1] = total
    travel = np.where(slides, space.travel, 1.0)
    motion = np.where(plan < FIXED, plan // SLIDES * SLIDES + axis, FIXED)
    radius = np.zeros(shape)
    radius[..., -1] = np.where(links > 0.0, space.link_radius, 0.0)
    flat = {
        "radius": radius,
        "motion": motion, "lower": lower, "upper": upper, "offset": offset, "com": com, "mass": masses_,
        "travel": travel,
    }  # fmt: skip
    if actuation is not None:
        flat |= {"effort": actuation.effort, "speed": actuation.speed}
    places = shape[1] * shape[2]
    flat = {name: values.reshape(n, places, *values.shape[3:]) for name, values in flat.items()}
    there = there.reshape(n, places)
    n_joints = there.sum(axis=1).astype(np.int32)
    flat = _compact(flat, there)
    thick = np.where(read.there, space.link_radius, 0.0)
    bodies = _spread(Bodies(mass, middles, along, thick, ends, end_place), there, shape[2])
    tool = _tool(space, read)
    flat["offset"][np.arange(n), n_joints - 1] += tool
    return ArmArrays(
        base=np.ascontiguousarray(matrix[:, :3], dtype=precision),
        motion=np.ascontiguousarray(flat["motion"], dtype=np.int32),
        lower=-_never_above(-flat["lower"], precision),
        upper=_never_above(flat["upper"], precision),
        offset=flat["offset"].astype(precision),
        com=flat["com"].astype(precision),
        mass=flat["mass"].astype(precision),
        radius=flat["radius"].astype(precision),
        tool=tool,
        tool_axis=_turned(np.broadcast_to(_VECTORS[4], (n, 1, 3)), read.mount)[:, 0].astype(precision),
        tool_side=_turned(np.broadcast_to(_VECTORS[0], (n, 1, 3)), read.mount)[:, 0].astype(precision),
        n_joints=n_joints,
        travel=flat["travel"],
        length=np.cumsum(links, axis=1)[:, -1],
        base_mass=carried[:, 0],
        bodies=bodies,
        actuation=None if actuation is None else Actuation(flat["effort"], flat["speed"], actuation.price),
    )


_NONE = -1  # no joint at this place of a module
_PLAN = np.full((len(MODULES), 2), _NONE)  # local motions of each module's joints; a single one stands last
for _row, _module in zip(_PLAN, MODULES.values(), strict=True):
    for _place, (_kind, _axis) in enumerate(_module.joints, start=2 - len(_module.joints)):
        _row[_place] = {"revolute": 0, "prismatic": SLIDES, "fixed": FIXED}[_kind]
        _row[_place] += 0 if _kind == "fixed" else AXES.index(_axis)
# (mounts, axes) which axis of the world a local one lies along, and whether it points the same way (1) or not (-1)
_MOUNTED = np.array([[AXES.index(world[1]) for world in row] for row in MOUNTS.values()])  # pyright: ignore[reportArgumentType]
_SIGNS = np.array([[1.0 if world[0] == "+" else -1.0 for world in row] for row in MOUNTS.values()])
_VECTORS = np.array(list(DIRECTIONS.values()))


class _Reader:
    """The columns of a matrix of designs, module by module.

    there: (N, M) which modules a design has.  mount: (N,) the number of its mount.
    """

    def __init__(self, space: DesignSpace, matrix: Array) -> None:
        self._space, self._matrix = space, matrix
        self._at = {parameter.name: i for i, parameter in enumerate(space.parameters)}
        self.n, self.modules = len(matrix), space.most_joints
        self.there = np.ones((self.n, self.modules), dtype=bool)
        if "n_joints" in self._at:
            counts = self._numbers("n_joints", int)
            self.there = np.arange(self.modules) < counts[:, None]
        names = tuple(MOUNTS)
        self.mount = np.full(self.n, names.index(space.mount[0]))
        if "mount" in self._at:
            self.mount = self._numbers("mount", names.index)

    def _numbers(self, name: str, number: Any) -> Any:
        """(N,) the number of each design's choice."""
        choices = cast("CategoricalParameter", self._space.parameters[self._at[name]]).choices
        return np.array([number(choice) for choice in choices])[self._matrix[:, self._at[name]].astype(np.intp)]

    def choices(self, kind: str, number: Any, usual: str) -> NDArray[np.intp]:
        """(N, M) the numbers of the choices of kind_1, kind_2, …; of `usual` where there are no such parameters."""
        names = [f"{kind}_{j}" for j in range(1, self.modules + 1)]
        columns = [
            self._numbers(name, number) if name in self._at else np.full(self.n, number(usual)) for name in names
        ]
        return np.stack(columns, axis=1)

    def reals(self, kind: str, usual: float = 0.0) -> Array:
        """(N, M) the values of kind_1, kind_2, …; `usual` where there are no such parameters."""
        names = [f"{kind}_{j}" for j in range(1, self.modules + 1)]
        if all(name in self._at for name in names):
            first = self._at[names[0]]
            return self._matrix[:, first : first + self.modules]
        return np.full((self.n, self.modules), usual)


def _ranges(space: DesignSpace, read: _Reader, plan: NDArray[np.intp]) -> tuple[Array, Array]:
    """(N, M, K) lower and upper limits in the modules' own axes."""
    low, high = space.joint_range
    if space.limit is not None:
        upper = read.reals("limit", space.limit[0])[..., None]
        lower = -upper
    else:
        lower, upper = np.full((1, 1, 1), low), np.full((1, 1, 1), high)
    stroke = read.reals("stroke", space.least_stroke)[..., None]
    lower = np.where(plan < SLIDES, lower, np.where(plan < FIXED, 0.0, -1.0))
    upper = np.where(plan < SLIDES, upper, np.where(plan < FIXED, stroke, 1.0))
    return lower, upper


def _mounted(read: _Reader, plan: NDArray[np.intp]) -> tuple[NDArray[np.intp], Array]:
    """(N, M, K) the world's axis of each joint, and 1 where it points the same way as the module's own, else -1."""
    own = plan % SLIDES
    if not read.mount.any():
        return own, np.ones(own.shape)
    return _MOUNTED[read.mount[:, None, None], own], _SIGNS[read.mount[:, None, None], own]


def _direction(space: DesignSpace, read: _Reader) -> Array:
    """(N, M, 3) where the links leave to, in the world's axes."""
    chosen = read.choices("direction", tuple(DIRECTIONS).index, space.link_directions[0])
    return _turned(_VECTORS[chosen], read.mount)


def _shift(space: DesignSpace, read: _Reader, plan: NDArray[np.intp], rails: Array, carried: Array) -> Array | float:
    """(N, M, 3) from the end of each link to the centre of what the next module begins with, in the world's axes."""
    if not rails.any():
        return 0.0
    ways = np.where(rails > 0.0, rails / np.where(carried > 0.0, carried, 1.0), 0.0) * (
        read.reals("stroke", space.least_stroke) / 2
    )
    local = np.eye(3)[plan[..., -1] % SLIDES] * ways[..., None]
    shifts = np.zeros_like(local)
    shifts[:, :-1] = _turned(local, read.mount)[:, 1:]
    return shifts


def _tool(space: DesignSpace, read: _Reader) -> Array:
    """(N, 3) the tool's offset, in the world's axes."""
    return _turned(np.broadcast_to(np.array(space.tool), (read.n, 1, 3)), read.mount)[:, 0]


def _turned(vectors: Array, mount: NDArray[np.intp]) -> Array:
    """(N, M, 3) vectors in the base's own axes, in the world's."""
    if not mount.any():  # all stand on a floor
        return np.array(vectors)
    turned = np.zeros(vectors.shape)
    for axis in range(3):
        world, sign = _MOUNTED[mount, axis], _SIGNS[mount, axis]
        np.put_along_axis(turned, np.broadcast_to(world[:, None, None], (*vectors.shape[:2], 1)),
                          (sign[:, None] * vectors[..., axis])[..., None], axis=2)  # fmt: skip
    return turned


def _compact(arrays: dict[str, Any], there: NDArray[np.bool_]) -> dict[str, Any]:
    """Arrays (N, D, ...) with the joints that are there first, in their order."""
    if there.all():
        return arrays
    order = np.argsort(~there, axis=1, kind="stable")
    rows = np.arange(len(there))[:, None]
    return {name: values[rows, order] for name, values in arrays.items()}


def _spread(modules: Bodies, there: NDArray[np.bool_], places: int) -> Bodies:
    """Of joints, from bodies of modules (N, M): each follows the last of its module's places."""
    if places == 1:
        spread = {field.name: getattr(modules, field.name) for field in fields(Bodies)}
    else:
        spread: dict[str, Any] = {}
        for field in fields(Bodies):
            values = getattr(modules, field.name)
            n, m, *size = values.shape
            spread[field.name] = np.zeros((n, m, places, *size))
            spread[field.name][:, :, -1] = values
            spread[field.name] = spread[field.name].reshape(n, m * places, *size)
    return Bodies(**_compact(spread, there))


@cache
def _catalogue(space: DesignSpace) -> tuple[Array, Array, Array, Array]:
    """Effort [N m], speed [rad/s], mass [kg] and price [USD] of each of a space's actuators."""
    actuators = space.arm_actuators
    return (
        np.array([actuator.effort for actuator in actuators]),
        np.array([np.nan if actuator.speed is None else actuator.speed for actuator in actuators]),
        np.array([actuator.mass for actuator in actuators]),
        np.array([np.nan if actuator.price is None else actuator.price for actuator in actuators]),
    )


def _never_above(limits: Array, precision: Precision) -> Any:
    """In this precision: float32 of 2.4 rad is 1e-7 rad more, which no kept angle may be, so it is rounded down."""
    near = limits.astype(precision)
    return np.where(near > limits, np.nextafter(near, near.dtype.type(-np.inf)), near)
