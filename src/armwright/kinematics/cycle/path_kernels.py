"""Warp kernels along lines of the tool, in float64: postures, each from the one before, and what they are off by.

In `follow`, a thread takes an arm from one posture through all samples of a block. Each sample is solved from the
posture of the sample before by damped least-norm updates (Nakamura & Hanafusa 1986): the joints move no more than the
line requires, so the joint path converges as samples are added. Unlike the inverse kinematics of `ik_kernels`, nothing
pulls joints to the middle of their range, since that would move the arm while the tool stands still.

On request the first updates also move the joints at random, by w less what moves the tool: J# (e - J w) + w (Liégeois
1977). Each candidate has its own w, the same for all arms and blocks.

A joint that an update would take beyond its limit stays at the limit for the rest of the sample.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.kinematics.cycle.costs import BLOCKED, LARGE_STEP, ON_LIMIT, SPENT, SUSPECT
from armwright.kinematics.cycle.path_math import path_math

UPDATES = 6  # at most, of a sample
CONVERGED = 1e-7  # [m], [rad]
MOVES = 2  # the first updates, that move aside as well
MAX_ROTATION = 0.3  # [rad] of any joint in one update
HOPELESS, HOPELESS_ANGLE = 0.02, 0.2  # [m], [rad] off at the first sample: the rest gets one update a sample


@cache
def path_kernels() -> SimpleNamespace:
    """Return the kernels."""
    base, steps = frame_math("float64"), path_math()
    real, Vector3, advance = base.real, base.Vector3, base.advance
    Path, Row, Square = steps.Path, steps.Row, steps.Square
    tool_error, solve_damped, cost_of = steps.tool_error, steps.solve_damped, steps.cost_of
    Columns = wp.types.matrix(shape=(MAX_JOINTS, 6), dtype=real)
    Values = wp.types.vector(length=MAX_JOINTS, dtype=real)
    hopeless, hopeless_angle = real(HOPELESS), real(HOPELESS_ANGLE)
    zero, one = real(0.0), real(1.0)
    converged, max_rotation, tiny = real(CONVERGED), real(MAX_ROTATION), real(1e-18)
    blocked, suspect = real(BLOCKED), real(SUSPECT)
    on_limit, large_step = real(ON_LIMIT), real(LARGE_STEP)

    @kernel
    def follow(
        path: Path, entry: wp.array3d(dtype=real), aside_by: real, q_path: wp.array4d(dtype=real),
        worst_off: wp.array3d(dtype=real), block_cost: wp.array3d(dtype=real),
    ):  # fmt: skip
        """Follow the samples of a block.

        entry: (N, B K, D) postures at the first sample of each block.  aside_by: standard deviation of w, as a share
        of each joint's range.  q_path: (N, K, S, D) [rad] or [m].  worst_off: (N, B, K) relative to the tolerance.
        block_cost: (N, B, K) least time along the lines, what they are off by, and what may jump.
        """
        arm, thread = wp.tid()
        n_candidates = q_path.shape[1]
        block = thread / n_candidates
        candidate = thread % n_candidates
        q, free, aside, begin = Values(), Values(), Values(), Values()
        columns = Columns()
        random = wp.rand_init(0, candidate)
        for j in range(path.dof):
            q[j] = entry[arm, thread, j]
            if path.motion[arm, j] < wp.static(FIXED):
                aside[j] = aside_by * (path.upper[arm, j] - path.lower[arm, j]) * real(wp.randn(random))
        if wp.isnan(q[0]):  # no candidate
            worst_off[arm, block, candidate] = real(wp.inf)
            block_cost[arm, block, candidate] = real(wp.static(SPENT))
            for sample in range(path.first[block], path.first[block + 1]):
                for j in range(path.dof):
                    q_path[arm, candidate, sample, j] = q[j]
            return
        updates = int(UPDATES)
        time, off, obstruction = real(0.0), real(0.0), real(0.0)
        for sample in range(path.first[block], path.first[block + 1]):
            kind = path.n_angular[sample]
            before = path.before[sample]
            for j in range(path.dof):
                free[j] = one
                if before < sample - 1:  # the way led back to it
                    q[j] = q_path[arm, candidate, before, j]
                begin[j] = q[j]
            distance, angle = real(0.0), real(0.0)
            for update in range(wp.static(UPDATES) + 1):
                x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
                p = path.base[arm]
                for j in range(path.dof):
                    motion = path.motion[arm, j]
                    axis, place, p, x, y, z = advance(motion, path.axis[arm, j], path.offset[arm, j], q[j], p, x, y, z)
                    for i in range(3):
                        columns[j, i] = place[i]  # for now
                        columns[j, i + 3] = axis[i]
                e, turn, angle, tool_x, tool_y, tool_z = tool_error(path, arm, sample, p, x, y, z)
                distance = wp.length(e)
                moves = aside_by > zero and update < wp.static(MOVES)
                if update >= updates or (distance < converged and angle < converged and not moves):
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
                    if moves:
                        for row in range(6):
                            error[row] -= columns[j, row] * aside[j]
                    if free[j] > zero:
                        for row in range(6):
                            for col in range(row + 1):
                                square[row, col] += columns[j, row] * columns[j, col]
                update_by = solve_damped(square, error, kind)
                largest = real(0.0)
                for j in range(path.dof):
                    change = wp.where(moves, aside[j], zero)
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
            off = wp.max(off, wp.max(distance / path.tolerance[sample], angle / path.angle_tolerance[sample]))
            if sample == path.first[block]:
                if distance > hopeless or angle > hopeless_angle:
                    updates = int(1)  # noqa: RUF046, UP018
            else:
                largest, slowest, margin = real(0.0), real(0.0), real(1.0)
                for j in range(path.dof):
                    change = wp.abs(q[j] - begin[j])
                    largest = wp.max(largest, change)
                    slowest = wp.max(slowest, change / path.speed[arm, j])
                    if path.motion[arm, j] < wp.static(FIXED):
                        margin = wp.min(margin, wp.min(q[j] - path.lower[arm, j], path.upper[arm, j] - q[j]))
                time += real(path.passes[sample]) * slowest
                jump = wp.where(largest > large_step, suspect, zero)
                obstruction = wp.max(obstruction, jump + wp.where(margin <= on_limit, blocked, zero))
            for j in range(path.dof):
                q_path[arm, candidate, sample, j] = q[j]
        worst_off[arm, block, candidate] = off
        block_cost[arm, block, candidate] = time + cost_of(off - one) + obstruction

    @kernel
    def tool_errors(path: Path, q: wp.array3d(dtype=real), errors: wp.array3d(dtype=real)):
        """Compare the tool with the samples.

        q: (N, S, D) [rad] or [m].  errors: (N, S, 2) distance of the tip [m] and angle of the tool [rad].
        """
        arm, sample = wp.tid()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = path.base[arm]
        for j in range(path.dof):
            _axis, _place, p, x, y, z = advance(
                path.motion[arm, j], path.axis[arm, j], path.offset[arm, j], q[arm, sample, j], p, x, y, z
            )
        e, _turn, angle, _x, _y, _z = tool_error(path, arm, sample, p, x, y, z)
        errors[arm, sample, 0] = wp.length(e)
        errors[arm, sample, 1] = angle

    return SimpleNamespace(real=real, Path=Path, follow=follow, tool_errors=tool_errors)
