"""Warp kernels along lines of the tool, in float64: postures, each from the one before, and what they are off by.

In `follow`, a thread takes an arm from one posture through all samples of a block. Each sample is solved from the
posture of the sample before by damped least-norm updates (Nakamura & Hanafusa 1986): the joints move no more than the
line requires, so the joint path converges as samples are added. Unlike the inverse kinematics of `ik_kernels`, nothing
pulls joints to the middle of their range, since that would move the arm while the tool stands still.

A joint that an update would take beyond its limit stays at the limit for the rest of the sample.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import MAX_JOINTS, PRISMATIC
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel

UPDATES = 6  # at most, of a sample
CONVERGED = 1e-7  # [m], [rad]
DAMPING = 1e-6  # of the mean square singular value of J
MAX_ROTATION = 0.3  # [rad] of any joint in one update
HOPELESS, HOPELESS_ANGLE = 0.02, 0.2  # [m], [rad] off at the first sample: the rest gets one update a sample


@cache
def path_kernels() -> SimpleNamespace:
    """Return the kernels."""
    base = frame_math("float64")
    real, Vector3 = base.real, base.Vector3
    advance, axis_of = base.advance, base.axis_of
    Row = wp.types.vector(length=6, dtype=real)
    Square = wp.types.matrix(shape=(6, 6), dtype=real)
    Columns = wp.types.matrix(shape=(MAX_JOINTS, 6), dtype=real)
    Values = wp.types.vector(length=MAX_JOINTS, dtype=real)
    hopeless, hopeless_angle = real(HOPELESS), real(HOPELESS_ANGLE)
    zero, one, half = real(0.0), real(1.0), real(0.5)
    converged, max_rotation, tiny = real(CONVERGED), real(MAX_ROTATION), real(1e-18)
    damping = real(DAMPING)

    @wp.struct
    class Path:
        """Arms, and the samples of S poses in B blocks."""

        dof: int
        base: wp.array(dtype=Vector3)  # (N,)
        motion: wp.array2d(dtype=int)  # (N, D)
        lower: wp.array2d(dtype=real)  # (N, D)
        upper: wp.array2d(dtype=real)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        tool_axis: wp.array(dtype=Vector3)  # (N,)
        tool_side: wp.array(dtype=Vector3)  # (N,)
        first: wp.array(dtype=int)  # (B + 1,)
        n_angular: wp.array(dtype=int)  # (S,)
        position: wp.array(dtype=Vector3)  # (S,)
        x: wp.array(dtype=Vector3)  # (S,) of the tool
        y: wp.array(dtype=Vector3)  # (S,)
        z: wp.array(dtype=Vector3)  # (S,)

    @wp.func
    def in_frame(v: Vector3, x: Vector3, y: Vector3, z: Vector3):
        """Return the world components of a vector that is fixed in a frame."""
        return v[0] * x + v[1] * y + v[2] * z

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

    @kernel
    def follow(
        path: Path,
        entry: wp.array3d(dtype=real),
        q_path: wp.array4d(dtype=real),
        position_error: wp.array3d(dtype=real),
        angle_error: wp.array3d(dtype=real),
    ):
        """Follow the samples of a block.

        entry: (N, B K, D) postures at the first sample of each block.  q_path: (N, K, S, D) [rad] or [m].
        position_error: (N, K, S) [m].  angle_error: (N, K, S) [rad].
        """
        arm, thread = wp.tid()
        n_candidates = q_path.shape[1]
        block = thread / n_candidates
        candidate = thread % n_candidates
        q, free = Values(), Values()
        columns = Columns()
        for j in range(path.dof):
            q[j] = entry[arm, thread, j]
        updates = int(UPDATES)
        for sample in range(path.first[block], path.first[block + 1]):
            kind = path.n_angular[sample]
            for j in range(path.dof):
                free[j] = one
            distance, angle = real(0.0), real(0.0)
            for update in range(wp.static(UPDATES) + 1):
                x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
                p = path.base[arm]
                for j in range(path.dof):
                    motion = path.motion[arm, j]
                    axis = axis_of(motion, x, y, z)
                    place, p, x, y, z = advance(motion, path.offset[arm, j], q[j], p, x, y, z)
                    for i in range(3):
                        columns[j, i] = place[i]  # for now
                        columns[j, i + 3] = axis[i]
                e, turn, angle, tool_x, tool_y, tool_z = tool_error(path, arm, sample, p, x, y, z)
                distance = wp.length(e)
                if update >= updates or (distance < converged and angle < converged):
                    break
                # Rows: the position, then the rotation about the tool's own x, y and, for a frame, z.
                error = Row(e[0], e[1], e[2], wp.dot(turn, tool_x), wp.dot(turn, tool_y), wp.dot(turn, tool_z))
                square = Square()
                for j in range(path.dof):
                    motion = path.motion[arm, j]
                    axis = Vector3(columns[j, 3], columns[j, 4], columns[j, 5])
                    linear, angular = axis, Vector3()
                    if motion < wp.static(PRISMATIC):
                        linear = wp.cross(axis, p - Vector3(columns[j, 0], columns[j, 1], columns[j, 2]))
                        angular = axis
                    for i in range(3):
                        columns[j, i] = linear[i]
                    columns[j, 3] = zero
                    columns[j, 4] = zero
                    columns[j, 5] = zero
                    if kind > 0:
                        columns[j, 3] = wp.dot(angular, tool_x)
                        columns[j, 4] = wp.dot(angular, tool_y)
                    if kind > 2:
                        columns[j, 5] = wp.dot(angular, tool_z)
                    if free[j] > zero:
                        for row in range(6):
                            for col in range(row + 1):
                                square[row, col] += columns[j, row] * columns[j, col]
                update_by = solve_damped(square, error, kind)
                largest = real(0.0)
                for j in range(path.dof):
                    change = real(0.0)
                    for row in range(6):
                        change += columns[j, row] * update_by[row]
                    columns[j, 0] = free[j] * change
                    largest = wp.max(largest, wp.abs(columns[j, 0]))
                shorten = wp.min(one, max_rotation / wp.max(largest, tiny))
                for j in range(path.dof):
                    moved = q[j] + shorten * columns[j, 0]
                    q[j] = wp.clamp(moved, path.lower[arm, j], path.upper[arm, j])
                    if q[j] != moved:
                        free[j] = zero
            if sample == path.first[block] and (distance > hopeless or angle > hopeless_angle):
                updates = int(1)  # noqa: RUF046, UP018
            for j in range(path.dof):
                q_path[arm, candidate, sample, j] = q[j]
            position_error[arm, candidate, sample] = distance
            angle_error[arm, candidate, sample] = angle

    @kernel
    def tool_errors(path: Path, q: wp.array3d(dtype=real), errors: wp.array3d(dtype=real)):
        """Compare the tool with the samples.

        q: (N, S, D) [rad] or [m].  errors: (N, S, 2) distance of the tip [m] and angle of the tool [rad].
        """
        arm, sample = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = path.base[arm]
        for j in range(path.dof):
            _place, p, x, y, z = advance(path.motion[arm, j], path.offset[arm, j], q[arm, sample, j], p, x, y, z)
        e, _turn, angle, _x, _y, _z = tool_error(path, arm, sample, p, x, y, z)
        errors[arm, sample, 0] = wp.length(e)
        errors[arm, sample, 1] = angle

    return SimpleNamespace(real=real, Path=Path, follow=follow, tool_errors=tool_errors)
