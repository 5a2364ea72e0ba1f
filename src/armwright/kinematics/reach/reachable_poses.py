"""Poses that one arm reaches: points combined with directions of the tool axis.

Every pose is solved from the nearest of many random postures, and then from the postures found at neighbouring points
and directions, until no neighbour is left to start from. Random postures as starts: F. Zacharias, C. Borst,
G. Hirzinger: Capturing robot workspace structure: representing robot capabilities, IROS 2007.
"""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.ik.ik import solve_postures
from armwright.tasks.obstacles import Obstacle
from armwright.tasks.poses import Poses
from armwright.tasks.targets import AXIS

N_SAMPLES = 2**15  # random postures
N_STARTS = 8  # of them, those nearest to a pose
UPDATES = 40  # of the inverse kinematics from each start; starts are near
UPDATES_IN_GAPS = 300  # at poses of whose neighbours more than half are reached; close to limits it converges slowly
CHUNK = 2048  # poses
POINT_NEIGHBOURS, DIRECTION_NEIGHBOURS = 6, 4  # a grid's point has six nearest ones
RADIAN = 0.3  # of the reach: a distance that counts as much as one radian


@dataclass(frozen=True)
class PostureConditions:
    """What a posture has to satisfy besides its pose."""

    payload: float | None = None
    """Mass at the tip that the motors hold at rest, with the safety factor [kg]; None to ignore torques."""
    clearance: float | None = None
    """Least distance of links and motors from each other and from obstacles [m]; None to ignore it."""
    obstacles: tuple[Obstacle, ...] = ()  # the obstacles

    def hold(self, arm: ArmArrays, q: NDArray[np.floating], torque: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return whether (K, D) postures of one arm with these holding torques [N m] or [N] satisfy them."""
        satisfied = np.ones(len(q), dtype=np.bool_)
        if self.payload is not None:
            assert arm.actuation is not None, "expected an arm with actuators"
            allowed = arm.actuation.peak / arm.actuation.safety_factor[:, None]  # (1, D)
            satisfied &= (np.abs(torque) <= allowed).all(axis=1)
        if self.clearance is not None:
            own, free = clearances(arm, q[None].astype(np.float64), self.obstacles)
            satisfied &= np.minimum(own[0], free[0]) >= self.clearance
        return satisfied


@dataclass(frozen=True)
class FoundPoses:
    """The poses found, of P points and M directions."""

    reached: NDArray[np.bool_]  # (P, M)
    covered: NDArray[np.bool_]  # (P,) reached with the tool in any direction
    q: Array  # (P, M, D) posture of each pose that is reached [rad] or [m]; undefined for others


@dataclass(frozen=True)
class PostureSamples:
    """Random postures of an arm within its limits, the same in every call."""

    q: Array  # (S, D) [rad] or [m]
    tip: Array  # (S, 3) [m]
    axis: Array  # (S, 3) of the tool


def sample_postures(arm: ArmArrays, n: int = N_SAMPLES) -> PostureSamples:
    """Return random postures of one arm."""
    q = arm.random_postures(n)[:, 0]
    frames = forward_kinematics(arm, q[None])
    axis = frames.rotation[0, :, -1] @ arm.tool_axis[0].astype(np.float64)
    return PostureSamples(q, frames.tip[0], axis)


@dataclass(frozen=True)
class PoseSearch:
    """The search for postures of one arm at P points with M directions."""

    arm: ArmArrays  # one stacked arm
    samples: PostureSamples  # random postures of it
    points: Array  # (P, 3) positions of the tip [m]
    directions: Array  # (M, 3) unit vectors along the tool's z axis
    tolerance: float  # distance below which a pose is reached [m]
    angle_tolerance: float  # angle likewise [rad]
    n_starts: int = N_STARTS  # number of the nearest samples from which a pose is tried

    def find(self) -> FoundPoses:
        """Find the poses within the joint limits."""
        covered = self._flood(self.points, None)[0][:, 0]
        possible = np.repeat(covered[:, None], len(self.directions), axis=1)
        reached, q = self._flood(self.points, self.directions, possible=possible)
        return FoundPoses(reached, covered, q)

    def find_usable(self, bare: FoundPoses, conditions: PostureConditions) -> FoundPoses:
        """Find those of the poses found without conditions that also satisfy them."""
        solids = [obstacle.solid for obstacle in conditions.obstacles]  # in which the tip cannot be
        free = np.all([np.ones(len(self.points)), *(~solid.contains(self.points) for solid in solids)], axis=0)
        reached, q = self._flood(self.points, self.directions, conditions, bare.reached & free[:, None], bare.q)
        covered = reached.any(axis=1)
        also = self._flood(self.points, None, conditions, (bare.covered & free & ~covered)[:, None])[0]
        return FoundPoses(reached, covered | also[:, 0], q)

    def _flood(
        self,
        points: Array,
        directions: Array | None,
        conditions: PostureConditions | None = None,
        possible: NDArray[np.bool_] | None = None,
        first: Array | None = None,
    ) -> tuple[NDArray[np.bool_], Array]:
        """Return which poses (P, M) are found and their postures (P, M, D); M = 1 for any direction.

        Args:
            points: (P, 3) [m].
            directions: (M, 3); None for any direction.
            conditions: What the postures have to satisfy besides.
            possible: (P, M) False for poses that need not be tried.
            first: (P, M, D) postures to start from before others.
        """
        m = 1 if directions is None else len(directions)
        q, reached = np.zeros((len(points) * m, self.arm.dof)), np.zeros(len(points) * m, dtype=np.bool_)
        possible = np.ones(len(q), dtype=np.bool_) if possible is None else possible.reshape(-1)
        if not possible.any():
            return reached.reshape(-1, m), q.reshape(-1, m, self.arm.dof)
        nearest = _nearest_samples(self.samples, points, directions, self.n_starts)  # (K, S)
        starts = [self.samples.q[column] for column in nearest.T]
        if first is not None:
            starts.insert(0, first.reshape(q.shape))
        neighbours = _neighbours(points, directions)  # (K, B)
        untried = np.ones(neighbours.shape, dtype=np.bool_)

        def attempt(poses: NDArray[np.intp], start: Array, updates: int) -> None:
            there = None if directions is None else directions[poses % m]
            solved, valid = self._solve(points[poses // m], there, start, updates, conditions)
            q[poses[valid]], reached[poses[valid]] = solved[valid], True

        def spread(updates: int) -> None:
            while True:
                poses = np.flatnonzero(possible & ~reached)
                ready = reached[neighbours[poses]] & untried[poses]
                poses, ready = poses[ready.any(axis=1)], ready[ready.any(axis=1)]
                if not len(poses):
                    return
                slot = ready.argmax(axis=1)
                untried[poses, slot] = False
                attempt(poses, q[neighbours[poses, slot]], updates)

        for start in starts:
            poses = np.flatnonzero(possible & ~reached)
            attempt(poses, start[poses], UPDATES)
            spread(UPDATES)
        untried[:] = (possible & ~reached & (reached[neighbours].sum(axis=1) > neighbours.shape[1] / 2))[:, None]
        spread(UPDATES_IN_GAPS)
        return reached.reshape(-1, m), q.reshape(-1, m, self.arm.dof)

    def _solve(
        self, points: Array, directions: Array | None, start: Array, updates: int, conditions: PostureConditions | None
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return (K, D) postures at K poses [rad] or [m], and whether each is reached and satisfies the conditions."""
        arm, k = self.arm, len(points)
        q, valid = np.zeros((k, arm.dof)), np.zeros(k, dtype=np.bool_)
        rotation = np.tile(np.eye(3), (k, 1, 1))
        if directions is not None:
            rotation[:, :, 2] = directions  # x and y do not count
        limits = (np.full(k, self.tolerance), np.full(k, self.angle_tolerance))
        poses = Poses(points, rotation, np.full(k, 0 if directions is None else AXIS), *limits)
        load = 0.0 if conditions is None else conditions.payload or 0.0

        def solve(chunk: slice) -> None:
            some = poses[np.arange(k)[chunk]]
            found = solve_postures(
                arm,
                some.position,
                updates,
                initial_q=start[None, chunk],
                payload=np.full(len(some), load),
                target_arrays=some.arrays,
                precision=arm.precision,
            )
            q[chunk] = found.q[0]
            there = (found.distance(some.position)[0] < self.tolerance) & (found.angle[0] < self.angle_tolerance)
            if conditions is not None and there.any():
                there[there] = conditions.hold(arm, found.q[0][there], found.torque[0][there])
            valid[chunk] = there

        in_chunks(solve, k, CHUNK, "cpu")
        return q, valid


def _nearest_samples(samples: PostureSamples, points: Array, directions: Array | None, n: int) -> NDArray[np.intp]:
    """Return the (K, n) indices of the samples nearest to each pose."""
    if directions is None:
        return _query(samples.tip, points, n)
    size = RADIAN * np.linalg.norm(np.ptp(samples.tip, axis=0)) / 2
    poses = np.hstack([np.repeat(points, len(directions), axis=0), size * np.tile(directions, (len(points), 1))])
    return _query(np.hstack([samples.tip, size * samples.axis]), poses, n)


def _neighbours(points: Array, directions: Array | None) -> NDArray[np.intp]:
    """Return the (K, B) indices of the poses next to each pose: of the nearest points, then of the directions there."""
    m = 1 if directions is None else len(directions)
    point, direction = np.divmod(np.arange(len(points) * m), m)
    beside = [_nearest(points, POINT_NEIGHBOURS)[point] * m + direction[:, None]]
    if directions is not None:
        beside.append(point[:, None] * m + _nearest(directions, DIRECTION_NEIGHBOURS)[direction])
    return np.hstack(beside)


def _nearest(places: Array, n: int) -> NDArray[np.intp]:
    """Return the (P, B) indices of the up to n other places nearest to each of P."""
    return _query(places, places, min(n + 1, len(places)))[:, 1:]


def _query(places: Array, queries: Array, n: int) -> NDArray[np.intp]:
    """Return the (K, n) indices of the places nearest to each query, the nearest first."""
    from scipy.spatial import KDTree  # takes a quarter of a second to import

    nearest = cast("NDArray[np.intp]", KDTree(places).query(queries, k=n)[1])
    return nearest.reshape(len(queries), n)
