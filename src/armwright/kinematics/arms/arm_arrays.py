"""Arms stacked into arrays, the input of the kernels.

Arrays hold all joints. If some follow others, q = C s + o with the values s of the independent joints, and C has one
entry in each row: 1 for an independent joint, its factor for one that follows. Then J C is the Jacobian by s, Cᵀ τ are
the torques of the drives and Cᵀ M C is their mass matrix (R. Featherstone: Rigid Body Dynamics Algorithms, 2008,
chapter 3, explicit constraints). Values by s are those of all joints, 0 for those that follow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError, did_you_mean
from armwright.kinematics.arms.actuation import Actuation, actuation_of
from armwright.kinematics.arms.motor_bodies import MotorBodies, stack_bodies
from armwright.kinematics.arms.rigid_bodies import Bodies, PerArm, RigidBodies, Tools, joined, rigid_bodies
from armwright.robot.arm import AXES, Arm, Joint, Link, MountedTool
from armwright.tasks.payload import POINT_LOAD, LoadShape

MAX_JOINTS = 16
MAX_ANGLE = 2 * np.pi  # [rad], for which the kernels' sine is made
# Motions: 0 to 2 rotate about local x, y, z or the opposite, 3 about an oblique axis; 4 to 7 translate along these; 8
# is fixed.
OBLIQUE, PRISMATIC, FIXED = 3, 4, 8
MOTION_AXES = np.vstack([np.eye(4, 3), np.eye(4, 3), np.zeros((1, 3))])  # of designs, by motion

Precision = Literal["float32", "float64"]
# Of all joints of some arms: about x, y, z; others too; oblique ones too; or coupled ones too.
Motions = Literal["revolute", "any", "oblique", "coupled"]
TargetKind = Literal["position", "pose"]  # points alone, or some with an axis or orientation of the tool
Floats = NDArray[np.float32] | NDArray[np.float64]  # of an array's precision
Ints = NDArray[np.int32]

FLOATS = ("base", "axis", "lower", "upper", "offset", "com", "mass", "tool_axis", "tool_side", "payload_center")


@dataclass(frozen=True)
class ArmArrays(PerArm):
    """N arms of up to D joints. A shorter arm ends with fixed joints that have neither length nor mass.

    All floats that the kernels read are of one precision; the others are float64.
    """

    base: Floats  # (N, 3) [m]
    motion: Ints  # (N, D) as above
    axis: Floats  # (N, D, 3) unit vectors of axes in the local frames; 0 for fixed joints
    lower: Floats  # (N, D) [rad] or [m]; ±1 for fixed joints, so that nothing divides by 0
    upper: Floats  # (N, D) [rad] or [m]
    offset: Floats  # (N, D, 3) from a joint to the next, or to the tip of the tool [m]
    com: Floats  # (N, D, 3) from a joint to the centre of mass of what it carries up to the next, or the tool [m]
    mass: Floats  # (N, D) [kg]; of the last link with the tool
    radius: Floats  # (N, D) of the link after a joint [m]; 0 if there is none
    bending_stiffness: Array  # (N, D) EI of the link after a joint [N m²]; infinite without length, NaN if unknown
    torsional_stiffness: Array  # (N, D) GJ likewise [N m²]
    tool: Tools  # included in the last link's `offset`, `com` and `mass`
    tool_axis: Floats  # (N, 3) the tool's own z in the world with all joints at 0, and so in the last local frame
    tool_side: Floats  # (N, 3) likewise the tool's own x
    payload_center: Floats  # (N, 3) of a payload's mass, from the tip in the last local frame [m]
    payload_gyration: Array  # (N, 3, 3) inertia of a payload about that centre, per mass, in the same frame [m²]
    n_joints: Ints  # (N,) number of an arm's joints, at most D
    travel: Array  # (N, D) of a joint for each radian of its actuator: 1 for revolute joints [m/rad]
    length: Array  # (N,) of all links [m]
    base_mass: Array  # (N,) mass that does not move, the column included [kg]
    structure_price: Array  # (N,) of all links and of the column [USD]
    bodies: Bodies  # without tools; for dynamics alone
    no_mass: NDArray[np.str_] | None = None  # (N,) why a mass is not known and counts as 0; None if all are known
    couplings: Floats | None = None
    """(N, D, 3) of each joint the index of the joint that it follows, factor and offset [rad] or [m]: itself, 1 and 0
    of independent joints. None if all are independent."""
    actuation: Actuation | None = None  # None unless all independent joints have actuators
    motor_bodies: MotorBodies | None = None  # None if the bodies of actuators do not count
    columns: Floats | None = None
    """(N, 3) radius, radius, half the length of the upright cylinder below each base [m], length 0 without one; None
    if no base stands on a column."""

    def __len__(self) -> int:
        return len(self.base)

    @property
    def precision(self) -> Precision:
        """Precision of the arrays that the kernels read."""
        return "float64" if self.base.dtype == np.float64 else "float32"

    @property
    def dof(self) -> int:
        """Number D of joints of the longest arm, fixed ones included."""
        return self.motion.shape[1]

    @property
    def rigid_bodies(self) -> RigidBodies:
        """What moves with each joint, the tool included."""
        return rigid_bodies(self.bodies, self.tool, self.n_joints - 1)

    @property
    def motions(self) -> Motions:
        """The kernel variant that all arms need."""
        is_simple = self.couplings is None and np.all(self.motion < OBLIQUE)
        return "revolute" if is_simple else self.general_motions

    @property
    def general_motions(self) -> Motions:
        """The variant that these arms and others of their space need, whatever joints a batch happens to have."""
        if self.couplings is not None:
            return "coupled"
        return "oblique" if np.any(self.motion % PRISMATIC == OBLIQUE) else "any"

    @property
    def prismatic(self) -> NDArray[np.bool_]:
        """(N, D) True for joints that translate."""
        return (self.motion >= PRISMATIC) & (self.motion < FIXED)

    @property
    def opposed(self) -> NDArray[np.bool_]:
        """(N, D) True for joints that rotate about the opposite of x, y or z."""
        return (self.motion < OBLIQUE) & np.any(self.axis < 0.0, axis=-1)

    @property
    def ranges_include_zero(self) -> bool:
        """True if every joint can be at 0."""
        return bool(np.all(self.lower <= 0.0) and np.all(self.upper >= 0.0))

    @property
    def read_by_ik(self) -> dict[str, Any]:
        """The arrays that the kernels of inverse kinematics read."""
        own = ("motion", *FLOATS) if self.couplings is None else ("motion", "couplings", *FLOATS)
        return {name: getattr(self, name) for name in own}

    def coupled(self, q: Array) -> Array:
        """Return q (N, K, D) in which joints that follow others have the values C s + o [rad] or [m]."""
        if self.couplings is None:
            return q
        leader, factor, offset = np.moveaxis(self.couplings[:, None].astype(np.float64), -1, 0)
        return factor * np.take_along_axis(q, leader.astype(np.intp), axis=-1) + offset

    def by_independent(self, values: Array) -> Array:
        """Return derivatives by all joints (N, ..., D) as those by the independent ones: values C, 0 for others."""
        if self.couplings is None:
            return values
        leader, factor = self.couplings[..., 0, None], self.couplings[..., 1, None]
        matrix = np.where(leader == np.arange(self.dof), factor, 0.0)  # (N, D, D)
        return (values @ matrix.reshape(-1, *(1,) * (values.ndim - 3), *matrix.shape[1:])).astype(values.dtype)

    def limit_distance(self, q: Array) -> Array:
        """Return the (N, ...) smallest distance of a joint from its limits [rad] or [m]; q: (N, ..., D)."""
        return self.limit_distances(q).min(axis=-1)

    def limit_distances(self, q: Array) -> Array:
        """Return the (N, ..., D) distances of joints from their limits [rad] or [m]; q: (N, ..., D)."""
        lower, upper, motion = (
            values.reshape(len(self), *(1,) * (q.ndim - 2), self.dof)
            for values in (self.lower, self.upper, self.motion)
        )
        return np.where(motion == FIXED, np.inf, np.minimum(q - lower, upper - q))

    def random_postures(self, n: int) -> Array:
        """Return (n, N, D) postures within the limits, the same in every call [rad] or [m].

        Each has the same share of every joint's range for all arms, whatever their number of joints.
        """
        if n == 0:  # a generator takes as long as solving an arm
            return np.empty((0, *self.motion.shape))
        shares = np.random.default_rng(0).uniform(size=(n, MAX_JOINTS))[:, None, : self.dof]
        lower, upper = self.lower.astype(np.float64), self.upper.astype(np.float64)
        return np.where(self.motion == FIXED, 0.0, lower + shares * (upper - lower))


def check_precision(name: str) -> Precision:
    """Return `name` if it is a precision, else raise SettingsError."""
    allowed = get_args(Precision)
    if name not in allowed:
        raise SettingsError(f'precision = "{name}" is not one of {", ".join(allowed)}.{did_you_mean(name, allowed)}')
    return cast("Precision", name)


def stack_arms(arms: Sequence[Arm], precision: Precision = "float32") -> ArmArrays:
    """Stack N arms of at most MAX_JOINTS joints into arrays that the kernels read in a precision.

    Raises:
        ArmError: If there is no arm, or one that the kernels do not support.
    """
    if not arms:
        raise ArmError("expected at least one arm, got none")
    for arm in arms:
        _check(arm)
    n, dof = len(arms), max(len(arm.joints) for arm in arms)
    motion = np.full((n, dof), FIXED, dtype=np.int32)
    lower, upper, travel = np.full((3, n, dof), 1.0)
    lower *= -1.0
    mass, radius = np.zeros((2, n, dof))
    stiffness = np.full((2, n, dof), np.inf)  # bending and torsional
    offset, com, axis, couplings = np.zeros((4, n, dof, 3))
    followers = [arm.couplings for arm in arms]
    if any(followers):
        couplings[..., 0], couplings[..., 1] = np.arange(dof), 1.0
    bodies = Bodies(*(np.zeros((n, dof, *size)) for size in ((), (3,), (3,), (), (), (3,), (3, 3))))
    for i, arm in enumerate(arms):
        own = slice(len(arm.joints))
        for j, one in followers[i]:
            couplings[i, j] = one.leader, one.factor, one.offset
        motion[i, own] = [_motion(joint, bool(followers[i])) for joint in arm.joints]
        axis[i, own] = [joint.direction for joint in arm.joints]
        lower[i, own] = [-1.0 if joint.kind == "fixed" else joint.lower for joint in arm.joints]
        upper[i, own] = [1.0 if joint.kind == "fixed" else joint.upper for joint in arm.joints]
        travel[i, own] = [joint.travel for joint in arm.joints]
        offset[i, own] = [link.offset for link in arm.links]
        com[i, own] = [link.total_com for link in arm.links]
        mass[i, own] = [link.total_mass for link in arm.links]
        radius[i, own] = [link.radius if link.length > 0.0 else 0.0 for link in arm.links]
        stiffness[:, i, own] = np.transpose([_stiffness(link) for link in arm.links])
        for part in fields(Bodies):
            getattr(bodies, part.name)[i, own] = [getattr(link, part.name) for link in arm.links]
    no_mass = [arm.no_mass for arm in arms]
    return exact_arms(
        precision,
        base=np.array([arm.base for arm in arms]),
        motion=motion,
        axis=np.where(motion[..., None] == FIXED, 0.0, axis),
        lower=lower,
        upper=upper,
        offset=offset,
        com=com,
        mass=mass,
        radius=radius,
        bending_stiffness=stiffness[0],
        torsional_stiffness=stiffness[1],
        tool=stack_tools([arm.tool for arm in arms]),
        n_joints=np.array([len(arm.joints) for arm in arms], dtype=np.int32),
        travel=travel,
        length=np.array([arm.length for arm in arms]),
        base_mass=np.array([arm.standing_mass for arm in arms]),
        structure_price=np.array([arm.structure_price for arm in arms]),
        bodies=bodies,
        couplings=couplings.astype(precision) if any(followers) else None,
        no_mass=np.array(no_mass) if any(no_mass) else None,
        actuation=actuation_of(arms, travel),
        motor_bodies=stack_bodies(arms, dof, precision),
        columns=stack_columns(
            np.array([0.0 if arm.column is None else arm.column.outer_diameter for arm in arms]),
            np.array([0.0 if arm.column is None else arm.column.length for arm in arms]),
            precision,
        ),
    )


def exact_arms(
    precision: Precision, *, tool: Tools, n_joints: Ints, axis: Array, lower: Array, upper: Array, offset: Array,
    com: Array, mass: Array, base: Array, radius: Array, **others: Any,
) -> ArmArrays:  # fmt: skip
    """Return arms in a precision, from exact values of their fields.

    The last links get the tools, in place, which `offset`, `com` and `mass` lack. No limit is rounded to a wider one.
    """
    last = np.arange(len(n_joints)), n_joints - 1
    if tool.mass.any():
        mass[last], com[last] = joined(mass[last], com[last], tool.mass, offset[last] + tool.com)
    offset[last] += tool.tip
    floats = {"base": base, "axis": axis, "offset": offset, "com": com, "mass": mass, "radius": radius}
    floats |= {"tool_axis": tool.axis, "tool_side": tool.side}
    return ArmArrays(
        **{name: np.ascontiguousarray(values, dtype=precision) for name, values in floats.items()},
        lower=-_round_down(-lower, precision),
        upper=_round_down(upper, precision),
        tool=tool,
        payload_center=np.zeros((len(n_joints), 3), dtype=precision),
        payload_gyration=np.zeros((len(n_joints), 3, 3)),
        n_joints=n_joints,
        **others,
    )


def stack_tools(tools: Sequence[MountedTool]) -> Tools:
    """Stack tools into arrays."""
    return Tools(*(np.array([getattr(tool, part.name) for tool in tools]) for part in fields(Tools)))


def stack_columns(diameter: Array | float, length: Array, precision: Precision) -> Floats | None:
    """Return `ArmArrays.columns` of these diameters and lengths (N,) [m]."""
    if not length.any():
        return None
    radius = np.where(length > 0.0, np.asarray(diameter) / 2, 0.0)
    return np.stack([radius, radius, length / 2], axis=-1).astype(precision)


def carrying(arms: ArmArrays, shape: LoadShape) -> ArmArrays:
    """Return arms whose payloads have this shape in their tip frames."""
    if shape == POINT_LOAD and not arms.payload_center.any():
        return arms
    x, z = arms.tool.side, arms.tool.axis
    frame = np.stack([x, np.cross(z, x), z], axis=-1)  # (N, 3, 3) of the tip
    center = (frame @ np.array(shape.center)).astype(arms.precision)
    gyration = frame @ np.diag(shape.gyration) @ frame.swapaxes(-1, -2)
    return replace(arms, payload_center=center, payload_gyration=gyration)


def _round_down(limits: Array, precision: Precision) -> Any:
    """Return upper limits in this precision, none above its exact value.

    2.4 rad in float32 is 1e-7 rad above the limit, which no joint angle may exceed.
    """
    near = limits.astype(precision)
    return np.where(near > limits, np.nextafter(near, near.dtype.type(-np.inf)), near)


def _check(arm: Arm) -> None:
    if len(arm.joints) > MAX_JOINTS:
        raise ArmError(f"an arm has {len(arm.joints)} joints; the kernels support at most {MAX_JOINTS}")
    for number, joint in enumerate(arm.joints, start=1):
        if joint.kind == "revolute" and max(-joint.lower, joint.upper) > MAX_ANGLE:
            raise ArmError(
                f"joint {number}: limits [{joint.lower:g}, {joint.upper:g}] rad are outside [-2π, 2π]; narrow them"
            )


def _stiffness(link: Link) -> tuple[float, float]:
    """Return EI and GJ of a link [N m²]; infinite without length, NaN if unknown."""
    if link.length == 0.0:
        return math.inf, math.inf
    bending, torsional = link.bending_stiffness, link.torsional_stiffness
    return math.nan if bending is None else bending, math.nan if torsional is None else torsional


def _motion(joint: Joint, is_coupled: bool) -> int:
    """Return the motion of a joint; is_coupled: whether joints of its arm follow others, so none is `opposed`."""
    if joint.kind == "fixed":
        return FIXED
    is_along = sum(map(bool, joint.direction)) == 1 and not (is_coupled and min(joint.direction) < 0.0)
    axis = AXES.index(joint.nearest_axis) if is_along else OBLIQUE
    return axis + (PRISMATIC if joint.kind == "prismatic" else 0)
