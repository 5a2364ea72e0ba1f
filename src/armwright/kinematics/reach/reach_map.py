"""Reach maps: the share of directions in which an arm can hold its tool at each point of a grid.

The share is the reachability index of F. Zacharias, C. Borst, G. Hirzinger: Capturing robot workspace structure:
representing robot capabilities, IROS 2007. The points with all directions of the sphere are the dexterous workspace of
A. Kumar, K. J. Waldron: The workspaces of a mechanical manipulator, ASME J. Mechanical Design 103(3), 1981.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError
from armwright.files import naming_write_errors, replace_file
from armwright.kinematics.arms.arm_arrays import ArmArrays, stack_arms
from armwright.kinematics.ik.solve import ANGLE_REACHED, check_tolerances
from armwright.kinematics.reach.reachable_poses import (
    FoundPoses,
    PoseSearch,
    PostureConditions,
    PostureSamples,
    sample_postures,
)
from armwright.robot.arm import Arm
from armwright.robot.urdf_reader import UrdfArm
from armwright.rotations import cone_directions
from armwright.tasks.moments import MAX_MASS
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.targets import REACHED

N_POINTS = 2000  # of a grid with the default spacing
N_DIRECTIONS = 50
MAX_DIRECTIONS = 1000
MAX_POSES = 2_000_000
ROUNDING = 1e-9  # of a number of cubes
DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class PoseCoverage:
    """Which poses of a grid an arm reaches."""

    reached: NDArray[np.bool_]
    """(N, M) True for the points and directions that are reached."""
    covered: NDArray[np.bool_]
    """(N,) True for the points that are reached, with the tool in any direction."""
    q: Array
    """(N, M, J) a posture for each pose that is reached [rad] or [m], else NaN. Values of an arm read from a URDF are
    those of its file."""
    cell: float
    """Volume of the cube around each point [m³]."""

    @property
    def share(self) -> Array:
        """(N,) share of directions that are reached."""
        return self.reached.mean(axis=1)

    @property
    def volume(self) -> float:
        """Volume of the points that are reached in any direction [m³]."""
        return self.cell * int(self.covered.sum())

    def dexterous_volume(self, share: float = 1.0) -> float:
        """Return the volume of the points with at least this share of directions [m³]."""
        return self.cell * int((self.share >= share).sum())


@dataclass(frozen=True)
class ReachMap:
    """Reachable poses of an arm on a grid."""

    points: Array
    """(N, 3) centres of the cubes of the grid, z fastest, then y, then x [m]."""
    shape: tuple[int, int, int]
    """Number of points along x, y and z."""
    spacing: float
    """Distance of neighbouring points [m]."""
    directions: Array
    """(M, 3) unit vectors along the tool's z axis."""
    bare: PoseCoverage
    """The poses within the joint limits."""
    usable: PoseCoverage
    """Those of them that also satisfy the conditions on payload and clearance; `bare` without conditions."""

    def coordinates(self, axis: int) -> Array:
        """Return the (n,) coordinates of the points along x, y or z (0, 1 or 2) [m]."""
        return np.moveaxis(self.points.reshape(*self.shape, 3), axis, 0)[:, 0, 0, axis]

    def save(self, file: str | Path, **texts: str) -> None:
        """Write the map as NumPy arrays (npz): points, shape, spacing, directions, both coverages, and these texts."""
        arrays: dict[str, Any] = {
            f"{prefix}{name}": values
            for prefix, coverage in (("", self.bare), ("usable_", self.usable))
            for name, values in (
                ("reached", coverage.reached),
                ("covered", coverage.covered),
                ("share", coverage.share),
                ("q", coverage.q.astype(np.float32)),
            )
        }
        arrays |= {name: np.array(text) for name, text in texts.items()}
        content = BytesIO()
        np.savez_compressed(
            content,
            points=self.points,
            shape=np.array(self.shape),
            spacing=np.array(self.spacing),
            directions=self.directions,
            **arrays,
        )
        with naming_write_errors(Path(file)):
            replace_file(Path(file), content.getvalue())


def reach_map(
    arm: Arm | UrdfArm,
    *,
    box: ArrayLike | None = None,
    spacing: float | None = None,
    axis: ArrayLike = DOWN,
    half_angle: float = math.pi,
    n_directions: int = N_DIRECTIONS,
    payload: float | None = None,
    clearance: float | None = None,
    obstacles: Sequence[Obstacle] = (),
    tolerance: float = REACHED,
    angle_tolerance: float = ANGLE_REACHED,
) -> ReachMap:
    """Compute which directions of the tool axis an arm reaches at each point of a grid.

    Joint limits hold. The tool may rotate about its axis. Equal arguments give equal bits. The search for postures is
    not exhaustive: it misses about one in a hundred reachable poses.

    Args:
        arm: An arm, such as `space.arm(design)` or `aw.read_urdf("arm.urdf")`, whose base link is at the origin.
        box: The corners (2, 3) with the smallest and largest coordinates [m]; by default around all that the tip
            reaches in random postures.
        spacing: Distance of neighbouring points [m]; by default such that there are about 2,000.
        axis: Middle of the cone of directions, of any length.
        half_angle: Half the opening angle of the cone [rad]; π for all directions.
        n_directions: Number of directions in the cone.
        payload: Mass at the tip that the motors have to hold at rest, with the safety factor of the arm [kg]; None to
            ignore torques.
        clearance: Least distance of the arm from itself and from obstacles [m]; None for 0 with obstacles, and to
            ignore it without.
        obstacles: Obstacles, such as those of a task. Links, motors and the tip have to be outside; the tool itself is
            ignored.
        tolerance: Distance below which a point is reached [m].
        angle_tolerance: Angle below which a direction is reached [rad].

    Raises:
        ArmError: If the arm has more than 16 joints, or no actuators although there is a payload.
        SettingsError: If an argument is out of range, or the grid has too many poses.

    Examples:
        >>> import armwright as aw
        >>> space = aw.paper_space(joints=5)
        >>> arm = space.arm(space.sample(1, seed=0)[0])
        >>> found = aw.reach_map(arm, spacing=0.4, n_directions=12)
        >>> found.directions.shape, bool(found.bare.dexterous_volume(0.5) <= found.bare.volume)
        ((12, 3), True)
    """
    if not isinstance(arm, (Arm, UrdfArm)):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise ArmError(f"expected an arm, got {arm!r:.80}; try aw.read_urdf for a file, space.arm for a design")
    check_tolerances(tolerance, angle_tolerance)
    directions = _directions(axis, half_angle, n_directions)
    arrays = stack_arms([arm.arm if isinstance(arm, UrdfArm) else arm])
    conditions = _conditions(arrays, payload, clearance, obstacles)
    samples = sample_postures(arrays)
    low, high = _corners(box, samples)
    points, shape, spacing = _grid(low, high, spacing, len(directions))
    search = PoseSearch(arrays, samples, points, directions, tolerance, angle_tolerance)
    bare = search.find()
    usable = bare if conditions is None else search.find_usable(bare, conditions)
    coverage = _coverage(bare, spacing**3)
    others = coverage if usable is bare else _coverage(usable, spacing**3)
    return ReachMap(points, shape, spacing, directions, coverage, others)


def _coverage(found: FoundPoses, cell: float) -> PoseCoverage:
    return PoseCoverage(found.reached, found.covered, np.where(found.reached[..., None], found.q, np.nan), cell)


def _directions(axis: ArrayLike, half_angle: float, n: int) -> Array:
    """Return (M, 3) directions; SettingsError for a cone that is none."""
    middle = np.asarray(axis, dtype=np.float64)
    if middle.shape != (3,) or not np.all(np.isfinite(middle)) or not np.linalg.norm(middle) > 0.0:
        raise SettingsError(
            f"axis: expected a direction x, y, z, got {axis}; try (0, 0, -1) for a tool that points down"
        )
    if not 0.0 <= half_angle <= math.pi:
        raise SettingsError(f"half_angle = {half_angle}: expected 0 to π rad; π stands for all directions")
    if not 1 <= n <= MAX_DIRECTIONS:
        raise SettingsError(f"n_directions = {n}: expected 1 to {MAX_DIRECTIONS}")
    return cone_directions(middle, half_angle, n)


def _conditions(
    arm: ArmArrays, payload: float | None, clearance: float | None, obstacles: Sequence[Obstacle]
) -> PostureConditions | None:
    """Return what postures have to satisfy, None for nothing."""
    if payload is not None and not 0.0 <= payload <= MAX_MASS:
        raise SettingsError(f"payload = {payload}: expected 0 to {MAX_MASS:g} kg")
    if payload is not None and arm.actuation is None:
        raise ArmError("payload: expected an arm with actuators or efforts at all joints; without, leave it out")
    if payload is not None and arm.no_mass is not None:
        raise ArmError(f"payload: expected an arm of known mass, but {arm.no_mass[0]}; leave it out")
    if clearance is not None and not 0.0 <= clearance < math.inf:
        raise SettingsError(f"clearance = {clearance}: expected 0 m or more")
    if obstacles and clearance is None:
        clearance = 0.0
    if payload is None and clearance is None:
        return None
    return PostureConditions(payload, clearance, tuple(obstacles))


def _corners(box: ArrayLike | None, samples: PostureSamples) -> tuple[Array, Array]:
    """Return the corners of the grid [m]."""
    if box is None:
        return samples.tip.min(axis=0), samples.tip.max(axis=0)
    corners = np.asarray(box, dtype=np.float64)
    if corners.shape != (2, 3) or not np.all(np.isfinite(corners)) or np.any(corners[0] > corners[1]):
        raise SettingsError(f"box: expected [[x, y, z], [x, y, z]] with low <= high [m], got {corners.tolist()}")
    return corners[0], corners[1]


def _grid(low: Array, high: Array, spacing: float | None, m: int) -> tuple[Array, tuple[int, int, int], float]:
    """Return the centres (N, 3) of the cubes that fill a box [m], their numbers along x, y and z, and their side."""
    sides = high - low
    if spacing is None:
        n_sides = int((sides > 0.0).sum())
        spacing = float((sides[sides > 0.0].prod() / N_POINTS) ** (1 / n_sides)) if n_sides else 1.0
    if not 0.0 < spacing < math.inf:
        raise SettingsError(f"spacing = {spacing}: expected more than 0 m")
    counts = np.maximum(1.0, np.ceil(sides / spacing - ROUNDING))
    if counts.prod() * m > MAX_POSES:
        raise SettingsError(
            f"the grid has {counts.prod():,.0f} points x {m} directions, more than {MAX_POSES:,} poses; try a larger "
            f"spacing than {spacing:g} m, or fewer directions"
        )
    shape = (int(counts[0]), int(counts[1]), int(counts[2]))
    index = np.stack(np.unravel_index(np.arange(math.prod(shape)), shape), axis=1)  # (N, 3)
    return (low + high) / 2 + spacing * (index - (counts - 1.0) / 2), shape, spacing
