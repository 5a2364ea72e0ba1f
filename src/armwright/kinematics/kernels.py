"""The kernels: forward kinematics, inverse kinematics and gravity torque, in Warp, float32.

One kernel solves one (arm, target) pair per thread; a factory makes it for each number of joints D, so
that all loops over joints are unrolled. The equations are those of docs/method.md; the
inverse kinematics is the solver of Chan & Dubey (1995) and Sugiura et al. (2007).
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does,
# and `float(0.0)` declares a variable that a loop may change.

from functools import cache
from typing import Any, NamedTuple

import warp as wp

LONGEST_STEP = wp.constant(0.1)  # [m] of the error that one update tries to close
LEAST_MANIPULABILITY = wp.constant(0.1)  # below it the update is damped
DAMPING = wp.constant(0.001)
LIMIT_MARGIN = wp.constant(0.017453293)  # [rad] = 1°, keeps the limit weight finite
CENTRING_GAIN = wp.constant(0.01)
GRAVITY = wp.constant(9.81)  # [m/s²] along -z
LARGEST = wp.constant(3.0e38)


@wp.struct
class Arms:
    """`ArmArrays` on the device."""

    base: wp.array(dtype=wp.vec3)  # (N,)
    axis: wp.array2d(dtype=int)  # (N, D)
    lower: wp.array2d(dtype=float)  # (N, D)
    upper: wp.array2d(dtype=float)  # (N, D)
    offset: wp.array2d(dtype=wp.vec3)  # (N, D)
    com: wp.array2d(dtype=wp.vec3)  # (N, D)
    mass: wp.array2d(dtype=float)  # (N, D)


class Kernels(NamedTuple):
    """For one number of joints D.

    solve: (arms, targets, updates, first arm) -> kept angles, reached point, gravity torque.
    update: one update of the inverse kinematics from given angles, for tests.
    """

    solve: Any
    update: Any
    joints: Any  # the vector type of D joint values


@wp.func
def turned(frame: wp.mat33, axis: int, angle: float):
    """The frame (its rows are the local x, y, z in the world) turned about its own axis."""
    s = wp.sin(angle)
    c = wp.cos(angle)
    x = frame[0]
    y = frame[1]
    z = frame[2]
    if axis == 0:
        return wp.matrix_from_rows(x, c * y + s * z, c * z - s * y)
    if axis == 1:
        return wp.matrix_from_rows(c * x - s * z, y, c * z + s * x)
    return wp.matrix_from_rows(c * x + s * y, c * y - s * x, z)


@wp.func
def to_world(frame: wp.mat33, v: wp.vec3):
    """A vector of the local frame in the world's."""
    return v[0] * frame[0] + v[1] * frame[1] + v[2] * frame[2]


@wp.func
def limit_gradient(q: float, lower: float, upper: float):
    """H of docs/method.md §2: how steeply the joint-limit criterion rises at q."""
    inside = wp.clamp(q, lower + LIMIT_MARGIN, upper - LIMIT_MARGIN)
    room = (upper - inside) * (inside - lower)
    span = upper - lower
    return wp.abs(span * span * (2.0 * inside - upper - lower) / (4.0 * room * room))


@wp.func
def centring(q: float, lower: float, upper: float):
    """The pull to mid-range, before its weight."""
    r = (lower + upper - 2.0 * q) / (upper - lower)
    return CENTRING_GAIN * r * wp.abs(r)


@cache
def kernels(dof: int) -> Kernels:
    """The kernels for arms of `dof` moving joints."""
    D = wp.constant(dof)
    Joints = wp.types.vector(length=dof, dtype=float)
    Rows = wp.types.matrix(shape=(dof, 3), dtype=float)

    @wp.func
    def forward(arms: Arms, arm: int, q: Joints):
        """The tip, the joint axes and the joint positions in the world."""
        frame = wp.identity(n=3, dtype=float)
        tip = arms.base[arm]
        axes = Rows()
        places = Rows()
        for j in range(D):
            axis = arms.axis[arm, j]
            frame = turned(frame, axis, q[j])
            axes[j] = frame[axis]
            places[j] = tip
            tip += to_world(frame, arms.offset[arm, j])
        return tip, axes, places

    @wp.func
    def updated(
        arms: Arms, arm: int, q: Joints, h_before: Joints, error: wp.vec3, tip: wp.vec3, axes: Rows, places: Rows
    ):
        """Angles after one update, and the limit gradients H that the next one compares with."""
        dx = error * wp.min(1.0, LONGEST_STEP / wp.max(wp.length(error), 1.0e-12))
        jacobian = Rows()  # column j of J as row j
        weight = Joints()
        pull = Joints()
        h = Joints()
        # In float64: the products square the condition of J, and near the limits W can make it 1e5 worse.
        jjt = wp.mat33d()
        jwjt = wp.mat33d()
        for j in range(D):
            lower = arms.lower[arm, j]
            upper = arms.upper[arm, j]
            h[j] = limit_gradient(q[j], lower, upper)
            w = 1.0
            if h[j] >= h_before[j]:
                w = 1.0 / (1.0 + h[j])
            weight[j] = w
            pull[j] = w * centring(q[j], lower, upper)
            column = wp.cross(axes[j], tip - places[j])
            jacobian[j] = column
            wide = wp.vec3d(column)
            square = wp.outer(wide, wide)
            jjt += square
            jwjt += wp.float64(w) * square
            dx -= pull[j] * column  # J# dx + (I - J# J) y = y + J# (dx - J y)
        manipulability = wp.sqrt(wp.max(float(wp.determinant(jjt)), 0.0))
        lack = wp.max(0.0, 1.0 - manipulability / LEAST_MANIPULABILITY)
        k = DAMPING * lack * lack
        damping = wp.diag(wp.vec3d(wp.vec3(k, k, k)))
        v = wp.vec3(wp.inverse(jwjt + damping) * wp.vec3d(dx))
        result = Joints()
        for j in range(D):
            step = pull[j] + weight[j] * wp.dot(jacobian[j], v)
            result[j] = wp.clamp(q[j] + step, arms.lower[arm, j], arms.upper[arm, j])
        return result, h

    @wp.func
    def gravity_torque(arms: Arms, arm: int, q: Joints):
        """What each joint must hold against gravity, +dV/dq [N m]."""
        frame = wp.identity(n=3, dtype=float)
        place = arms.base[arm]
        axes = Rows()
        places = Rows()
        coms = Rows()
        for j in range(D):
            axis = arms.axis[arm, j]
            frame = turned(frame, axis, q[j])
            axes[j] = frame[axis]
            places[j] = place
            coms[j] = place + to_world(frame, arms.com[arm, j])
            place += to_world(frame, arms.offset[arm, j])
        torque = Joints()
        carried = 0.0  # mass beyond joint j
        moment = wp.vec3()  # mass times position beyond joint j
        for i in range(D):
            j = D - 1 - i
            carried += arms.mass[arm, j]
            moment += arms.mass[arm, j] * coms[j]
            lever = moment - carried * places[j]
            torque[j] = GRAVITY * (axes[j][0] * lever[1] - axes[j][1] * lever[0])
        return torque

    @wp.kernel(enable_backward=False, module="unique")
    def solve(
        arms: Arms,
        targets: wp.array(dtype=wp.vec3),
        updates: int,
        first: int,
        kept: wp.array2d(dtype=Joints),
        reached: wp.array2d(dtype=wp.vec3),
        torque: wp.array2d(dtype=Joints),
    ):
        i, t = wp.tid()
        arm = first + i
        target = targets[t]
        q = Joints()
        best_q = Joints()
        h = Joints()
        for j in range(D):
            h[j] = LARGEST
        tip, axes, places = forward(arms, arm, q)
        best_tip = tip
        best = wp.length(target - tip)
        for _ in range(updates):
            q, h = updated(arms, arm, q, h, target - tip, tip, axes, places)
            tip, axes, places = forward(arms, arm, q)
            distance = wp.length(target - tip)
            if distance < best:
                best = distance
                best_q = q
                best_tip = tip
        kept[arm, t] = best_q
        reached[arm, t] = best_tip
        torque[arm, t] = gravity_torque(arms, arm, best_q)

    @wp.kernel(enable_backward=False, module="unique")
    def update(
        arms: Arms,
        targets: wp.array(dtype=wp.vec3),
        q: wp.array(dtype=Joints),
        h_before: wp.array(dtype=Joints),
        q_after: wp.array(dtype=Joints),
        h_after: wp.array(dtype=Joints),
    ):
        arm = wp.tid()
        tip, axes, places = forward(arms, arm, q[arm])
        q_new, h_new = updated(arms, arm, q[arm], h_before[arm], targets[arm] - tip, tip, axes, places)
        q_after[arm] = q_new
        h_after[arm] = h_new

    return Kernels(solve, update, Joints)
