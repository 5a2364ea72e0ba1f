"""Warp kernel of inverse dynamics by recursive Newton-Euler (Luh, Walker & Paul 1980), one posture per thread, float64.

Along a motion, joint values are q(s) with the share s(t). The torque is

    gravity(q) + drag(q, q_s, q_ss) s'² + push(q, q_s) s'',   push = M q_s,   drag = M q_ss + C(q, q_s) q_s

(Bobrow et al. 1985). The kernel computes the three terms from one pass of forward kinematics, and on demand those of
the whole wrench of each joint, of which the torque is one component.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import FIXED, MAX_JOINTS, PRISMATIC
from armwright.kinematics.arms.frame_math import frame_math
from armwright.kinematics.arms.ik_math import kernel
from armwright.robot.arm import GRAVITY


@cache
def dynamics_kernels() -> SimpleNamespace:
    """Return the kernel."""
    base = frame_math("float64")
    real, Vector3, Matrix3, advance = base.real, base.Vector3, base.Matrix3, base.advance
    Vectors = wp.types.matrix(shape=(MAX_JOINTS, 3), dtype=real)
    Wrench = wp.types.vector(length=6, dtype=real)
    zero, one, two = real(0.0), real(1.0), real(2.0)

    @wp.struct
    class Bodies:
        """Arms as rigid bodies."""

        dof: int
        base: wp.array(dtype=Vector3)  # (N,)
        motion: wp.array2d(dtype=int)  # (N, D)
        axis: wp.array2d(dtype=Vector3)  # (N, D)
        offset: wp.array2d(dtype=Vector3)  # (N, D)
        mass: wp.array2d(dtype=real)  # (N, D)
        com: wp.array2d(dtype=Vector3)  # (N, D)
        inertia: wp.array2d(dtype=Matrix3)  # (N, D) about the centre of mass
        payload_mass: real
        payload_com: wp.array(dtype=Vector3)  # (N,) from the tip, in the last frame
        payload_inertia: wp.array(dtype=Matrix3)  # (N,) about its centre of mass, in the last frame

    @wp.func
    def accelerated(acceleration: Vector3, alpha: Vector3, omega: Vector3, lever: Vector3):
        """Return the acceleration of a point of a body, from that of another point at a lever."""
        return acceleration + wp.cross(alpha, lever) + wp.cross(omega, wp.cross(omega, lever))

    @wp.func
    def wrench(
        mass: real, inertia: Matrix3, frame: Matrix3, lever: Vector3, acceleration: Vector3, alpha: Vector3,
        omega: Vector3,
    ):  # fmt: skip
        """Return the force and the moment about a joint that move a body with its centre of mass at a lever."""
        force = mass * accelerated(acceleration, alpha, omega, lever)
        local = wp.transpose(frame)
        spin = local * omega
        moment = frame * (inertia * (local * alpha) + wp.cross(spin, inertia * spin))
        return force, moment + wp.cross(lever, force)

    @kernel
    def torque_terms(
        bodies: Bodies, q: wp.array3d(dtype=real), q_s: wp.array3d(dtype=real), q_ss: wp.array3d(dtype=real),
        motion_of: wp.array(dtype=int), source: wp.array2d(dtype=int), terms: wp.array4d(dtype=real),
        wrenches: wp.array4d(dtype=Wrench),
    ):  # fmt: skip
        """Compute the terms of the torque along motions that take no other one's path.

        q, q_s, q_ss: (N, S, D) joint values and their derivatives by the share [rad] or [m].  motion_of: (S,) motion of
        each sample.  source: (N, M) motion whose path each one takes.  terms: (N, S, 6, D) gravity, drag and push, and
        what the payload adds to each [N m] or [N].  wrenches: (N, S, 6, D) likewise the force on each link and the
        moment about its joint, in its frame [N], [N m]; empty if they are not wanted.
        """
        arm, sample = wp.tid()
        if source[arm, motion_of[sample]] != motion_of[sample]:
            return
        # Frames of all links: position of the joint, its axis, and the x and y axes of what it carries.
        place, axis, along_x, along_y = Vectors(), Vectors(), Vectors(), Vectors()
        x, y, z = Vector3(one, zero, zero), Vector3(zero, one, zero), Vector3(zero, zero, one)
        p = bodies.base[arm]
        for j in range(bodies.dof):
            a, here, p, x, y, z = advance(
                bodies.motion[arm, j], bodies.axis[arm, j], bodies.offset[arm, j], q[arm, sample, j], p, x, y, z
            )
            place[j] = here
            axis[j] = a
            along_x[j] = x
            along_y[j] = y
        tip = p
        for term in range(3):
            force, moment = Vectors(), Vectors()  # on each link, about the joint
            omega, alpha, acceleration = Vector3(), Vector3(), Vector3()
            if term == 0:
                acceleration = Vector3(zero, zero, real(GRAVITY))  # as of a base that accelerates upwards
            before = bodies.base[arm]
            if bodies.dof > 0:
                before = place[0]
            for j in range(bodies.dof):
                motion = bodies.motion[arm, j]
                a = axis[j]
                rate = real(0.0)
                change = real(0.0)
                if term == 1:
                    rate = q_s[arm, sample, j]
                    change = q_ss[arm, sample, j]
                if term == 2:
                    change = q_s[arm, sample, j]
                here = place[j]
                lever = here - before
                acceleration = accelerated(acceleration, alpha, omega, lever)
                if motion < wp.static(PRISMATIC):
                    alpha = alpha + change * a + rate * wp.cross(omega, a)
                    omega = omega + rate * a
                elif motion < wp.static(FIXED):
                    acceleration = acceleration + change * a + (two * rate) * wp.cross(omega, a)
                before = here
                frame = wp.matrix_from_cols(along_x[j], along_y[j], wp.cross(along_x[j], along_y[j]))
                lever = frame * bodies.com[arm, j]
                f, n = wrench(bodies.mass[arm, j], bodies.inertia[arm, j], frame, lever, acceleration, alpha, omega)
                force[j] = f
                moment[j] = n
            # The payload moves with the last link; x, y, z are its axes.
            frame = wp.matrix_from_cols(x, y, z)
            lever = tip - before + frame * bodies.payload_com[arm]
            carried_force, carried_moment = wrench(
                bodies.payload_mass, bodies.payload_inertia[arm], frame, lever, acceleration, alpha, omega
            )
            total_force, total_moment = Vector3(), Vector3()
            after = before
            for step in range(bodies.dof):
                j = bodies.dof - 1 - step
                here = place[j]
                total_moment = total_moment + wp.cross(after - here, total_force) + moment[j]
                carried_moment = carried_moment + wp.cross(after - here, carried_force)
                total_force = total_force + force[j]
                load, added = real(0.0), real(0.0)
                if bodies.motion[arm, j] < wp.static(PRISMATIC):
                    load, added = wp.dot(axis[j], total_moment), wp.dot(axis[j], carried_moment)
                elif bodies.motion[arm, j] < wp.static(FIXED):
                    load, added = wp.dot(axis[j], total_force), wp.dot(axis[j], carried_force)
                terms[arm, sample, term, j] = load
                terms[arm, sample, 3 + term, j] = added
                if wrenches.shape[1] > 0:
                    local = wp.matrix_from_rows(along_x[j], along_y[j], wp.cross(along_x[j], along_y[j]))
                    f, n = local * total_force, local * total_moment
                    wrenches[arm, sample, term, j] = Wrench(f[0], f[1], f[2], n[0], n[1], n[2])
                    f, n = local * carried_force, local * carried_moment
                    wrenches[arm, sample, 3 + term, j] = Wrench(f[0], f[1], f[2], n[0], n[1], n[2])
                after = here

    return SimpleNamespace(real=real, Bodies=Bodies, torque_terms=torque_terms)
