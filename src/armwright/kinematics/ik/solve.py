"""Inverse kinematics of arms at poses, for use without a task."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError, TaskError
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.ik.ik import Postures, solve_postures
from armwright.robot.arm import Arm
from armwright.robot.urdf_reader import UrdfArm
from armwright.tasks.poses import Poses
from armwright.tasks.targets import AXIS, ORIENTATION, REACHED

ANGLE_REACHED = 1e-3  # [rad]
ORTHOGONAL = 1e-5  # deviation of R Rᵀ from the identity; float32 rotations pass
SHORTEST = 1e-6  # length of an axis


@dataclass(frozen=True)
class Solutions:
    """Joint values of m arms at n poses, the best of all starts."""

    q: Array
    """(m, n, D) joint angles [rad] or displacements [m], within the limits. D is the number of joints of the longest
    arm, fixed ones included; joints that an arm does not have, and fixed joints, are 0. Values of an arm read from
    a URDF are those of its file, for the joints `UrdfArm.joints`."""
    position_error: Array
    """(m, n) distance of the tip from the position [m]."""
    angle_error: Array
    """(m, n) angle of the tool from the axis or orientation [rad]; 0 without one."""
    reached: NDArray[np.bool_]
    """(m, n) True where both errors are below their tolerances."""


def solve(
    arms: Arm | UrdfArm | Sequence[Arm | UrdfArm],
    positions: ArrayLike,
    *,
    axes: ArrayLike | None = None,
    orientations: ArrayLike | None = None,
    tolerance: float = REACHED,
    angle_tolerance: float = ANGLE_REACHED,
    restarts: int = 0,
) -> Solutions:
    """Solve the inverse kinematics of every arm at every pose, within the joint limits.

    The first start is the straight arm; a joint that cannot be at 0 starts at the nearest limit. Poses that are not
    reached are solved again from further starts, the same in every call. Equal arms and poses give equal bits,
    independent of the other arms and poses of the call. A pose that is not reached is a result, never an error.

    Args:
        arms: One arm or m arms, such as `space.arm(design)` or `aw.read_urdf("arm.urdf")`.
        positions: (n, 3) of the tip in the world [m]. The base link of a URDF is at the origin.
        axes: (n, 3) directions of the tool's z axis in the world, of any length; the tool may rotate about them.
        orientations: (n, 3, 3) rotation matrices instead of axes, whose columns are the tool's axes in the world, as
            `Rotation.as_matrix()` of SciPy returns them. Of transforms T (n, 4, 4), pass `T[:, :3, 3]` as positions and
            `T[:, :3, :3]` as orientations.
        tolerance: Distance below which a position is reached [m].
        angle_tolerance: Angle below which an axis or orientation is reached [rad]. In the choice of the best posture,
            this angle counts as much as the distance `tolerance`.
        restarts: Number of further starts for poses that are not reached.

    Raises:
        ArmError: If there is no arm, or one with more than 16 joints.
        TaskError: If poses are empty, not finite, of another shape, or no directions.
        SettingsError: If a tolerance or the number of restarts is out of range.

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space(joints=6)
        >>> arms = [space.arm(design) for design in space.sample(3, seed=0)]
        >>> positions = [[0.3, 0.0, 0.2], [0.0, 0.3, 0.2]]
        >>> solutions = aw.solve(arms, positions, axes=[[0, 0, -1], [0, 0, -1]], restarts=4)
        >>> solutions.q.shape, solutions.reached.shape
        ((3, 2, 6), (3, 2))
    """
    given = [arms] if isinstance(arms, (Arm, UrdfArm)) else list(arms)
    for arm in given:
        if not isinstance(arm, (Arm, UrdfArm)):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ArmError(f"expected arms, got {arm!r:.80}; try aw.read_urdf for a file, space.arm for a design")
    check_tolerances(tolerance, angle_tolerance)
    if restarts < 0:
        raise SettingsError(f"restarts = {restarts} is below 0")
    arrays = stack_arms([arm.arm if isinstance(arm, UrdfArm) else arm for arm in given])
    poses = _stack(positions, axes, orientations, tolerance, angle_tolerance)
    postures = _best_postures(arrays, poses, restarts)
    return Solutions(postures.q.astype(np.float64), *_errors(postures, poses))


def check_tolerances(tolerance: float, angle_tolerance: float) -> None:
    """Raise SettingsError for a distance [m] or an angle [rad] that is no tolerance."""
    if not 0.0 < tolerance < np.inf or not 0.0 < angle_tolerance <= np.pi:
        raise SettingsError(
            f"expected tolerance > 0 m and 0 < angle_tolerance <= π rad, got {tolerance} and {angle_tolerance}"
        )


def _best_postures(arrays: ArmArrays, poses: Poses, restarts: int) -> Postures:
    """Return the first postures that reach their poses, else the nearest ones."""

    def solved(some: Poses, initial_q: Array | None = None) -> Postures:
        return solve_postures(arrays, some.position, initial_q=initial_q, target_arrays=some.arrays)

    best = solved(poses)
    for start in arrays.random_postures(restarts):
        missed = ~_errors(best, poses)[2]
        again = np.flatnonzero(missed.any(axis=0))  # of all arms, though some may have reached these poses
        if not len(again):
            break
        some = poses[again]
        before = Postures(*(values[:, again] for values in vars(best).values()))
        nearer = before.nearer(solved(some, start[:, None]), some.position, some.arrays.metres_per_radian)
        changed = missed[:, again]
        arm, pose = np.nonzero(changed)
        for name, values in vars(best).items():
            values[arm, again[pose]] = getattr(nearer, name)[changed]
    return best


def _errors(postures: Postures, poses: Poses) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return (m, n) distances [m], angles [rad], and whether both are below their tolerances."""
    distance = postures.distance(poses.position)
    angle = postures.angle.astype(np.float64)
    return distance, angle, (distance < poses.tolerance) & (angle < poses.angle_tolerance)


def _stack(
    positions: ArrayLike,
    axes: ArrayLike | None,
    orientations: ArrayLike | None,
    tolerance: float,
    angle_tolerance: float,
) -> Poses:
    position = _finite("positions", positions, (3,))
    n, n_angular = len(position), 0
    rotation = np.tile(np.eye(3), (n, 1, 1))
    if axes is not None and orientations is not None:
        raise TaskError("expected axes or orientations, got both; an orientation states all axes")
    if axes is not None:
        direction, n_angular = _finite("axes", axes, (3,), n), AXIS
        length = np.linalg.norm(direction, axis=1, keepdims=True)
        if not np.all(length > SHORTEST):
            raise TaskError(
                f"axes: row {int(length.argmin())} has no direction; try [0, 0, -1] for a tool that points down"
            )
        rotation[:, :, 2] = direction / length  # x and y do not count
    if orientations is not None:
        rotation, n_angular = _finite("orientations", orientations, (3, 3), n), ORIENTATION
        off = np.abs(rotation @ rotation.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
        if off.max() > ORTHOGONAL or np.linalg.det(rotation).min() < 0.0:
            raise TaskError(
                "orientations: expected rotation matrices, right-handed, with orthogonal columns of length 1"
            )
    return Poses(position, rotation, np.full(n, n_angular), np.full(n, tolerance), np.full(n, angle_tolerance))


def _finite(name: str, given: ArrayLike, each: tuple[int, ...], n: int | None = None) -> Array:
    """Return the array (n, *each) of at least one row; TaskError if it is another."""
    try:
        values = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise TaskError(f"{name}: expected numbers, got {given!r:.80}") from None
    expected = ", ".join(map(str, ("n" if n is None else n, *each)))
    if values.shape[1:] != each or not len(values) or n not in (None, len(values)):
        raise TaskError(f"{name}: expected shape ({expected}), n >= 1, got {values.shape}")
    if not np.all(np.isfinite(values)):
        raise TaskError(f"{name}: row {int(np.argwhere(~np.isfinite(values))[0, 0])} is not finite")
    return values
