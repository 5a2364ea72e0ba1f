"""Warp functions of one update along a line of the tool, in float64: its error, and the damped system of the joints."""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.cycle.costs import BLOCKED, MOST_EXCESS

DAMPING = 1e-6  # of the mean square singular value of J


@cache
def path_math() -> SimpleNamespace:
    """Return the functions, and the arms and samples that they take."""
    base = frame_math("float64")
    real, Vector3, in_frame = base.real, base.Vector3, base.in_frame
    Row = wp.types.vector(length=6, dtype=real)
    Square = wp.types.matrix(shape=(6, 6), dtype=real)
    zero, one, half = real(0.0), real(1.0), real(0.5)
    damping, tiny = real(DAMPING), real(1e-18)
    blocked, most_excess = real(BLOCKED), real(MOST_EXCESS)

    @wp.struct
    class Path:
        """Arms, and the samples of S poses in B blocks."""

        dof: int
        base: wp.array(dtype=Vector3)  # (N,)
        motion: wp.array2d(dtype=int)  # (N, D)
        axis: wp.array2d(dtype=Vector3)  # (N, D)
        lower: wp.array2d(dtype=real)  # (N, D)
        upper: wp.array2d(dtype=real)  # (N, D)
        speed: wp.array2d(dtype=real)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        tool_axis: wp.array(dtype=Vector3)  # (N,)
        tool_side: wp.array(dtype=Vector3)  # (N,)
        first: wp.array(dtype=int)  # (B + 1,)
        before: wp.array(dtype=int)  # (S,) the sample from whose posture each one is followed
        passes: wp.array(dtype=int)  # (S,) how often the step to each one is driven
        n_angular: wp.array(dtype=int)  # (S,)
        tolerance: wp.array(dtype=real)  # (S,)
        angle_tolerance: wp.array(dtype=real)  # (S,)
        position: wp.array(dtype=Vector3)  # (S,)
        x: wp.array(dtype=Vector3)  # (S,) of the tool
        y: wp.array(dtype=Vector3)  # (S,)
        z: wp.array(dtype=Vector3)  # (S,)

    @wp.func
    def cost_of(excess: real):
        """Return the cost of exceeding a tolerance; excess: relative to the tolerance."""
        return wp.where(excess > zero, blocked * (one + wp.min(excess, most_excess)), zero)

    @wp.func
    def rotation_error(kind: int, s: Vector3, t: Vector3, a: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the rotation vector in the world from the tool s, t, a to the sample x, y, z [rad]."""
        v = wp.cross(a, z)
        cosine = wp.dot(a, z)
        if kind > 2:
            v = half * (wp.cross(s, x) + wp.cross(t, y) + v)
            cosine = half * (wp.dot(s, x) + wp.dot(t, y) + cosine - one)
        sine = wp.length(v)
        return (wp.atan2(sine, cosine) / wp.max(sine, tiny)) * v, wp.atan2(sine, cosine)

    @wp.func
    def tool_error(path: Path, arm: int, sample: int, p: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the vector from the tip to a sample, the rotation vector to it and its angle, and the tool's axes.

        p: the tip.  x, y, z: the last local frame.
        """
        tool_z = in_frame(path.tool_axis[arm], x, y, z)
        tool_x = in_frame(path.tool_side[arm], x, y, z)
        tool_y = wp.cross(tool_z, tool_x)
        turn, angle = Vector3(), real(0.0)
        kind = path.n_angular[sample]
        if kind > 0:
            turn, angle = rotation_error(kind, tool_x, tool_y, tool_z, path.x[sample], path.y[sample], path.z[sample])
        return path.position[sample] - p, turn, angle, tool_x, tool_y, tool_z

    @wp.func
    def solve_damped(square: Square, error: Row, kind: int):
        """Return the solution of the damped system, by Cholesky's factor in the lower triangle.

        kind: as `n_angular`. Rows of rotation that a target does not need become those of the identity.
        """
        trace = real(0.0)
        for i in range(6):
            trace += square[i, i]
        for i in range(6):
            square[i, i] += damping * trace / real(6.0) + tiny
        if kind == 0:
            square[3, 3] = one
            square[4, 4] = one
            error[3] = zero
            error[4] = zero
        if kind < 3:
            square[5, 5] = one
            error[5] = zero
        for i in range(6):
            for k in range(i):
                inner = square[i, k]
                for m in range(k):
                    inner -= square[i, m] * square[k, m]
                square[i, k] = inner / square[k, k]
                error[i] -= square[i, k] * error[k]
            inner = square[i, i]
            for m in range(i):
                inner -= square[i, m] * square[i, m]
            square[i, i] = wp.sqrt(wp.max(inner, tiny))
            error[i] = error[i] / square[i, i]
        for step in range(6):
            i = 5 - step
            for k in range(i + 1, 6):
                error[i] -= square[k, i] * error[k]
            error[i] = error[i] / square[i, i]
        return error

    return SimpleNamespace(
        Path=Path, Row=Row, Square=Square, cost_of=cost_of, tool_error=tool_error, solve_damped=solve_damped
    )
