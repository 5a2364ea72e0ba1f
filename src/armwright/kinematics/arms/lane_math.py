"""Types and Warp functions of numbers and vectors in lanes.

A lane is one target of an arm. What differs between lanes is arithmetic, never a branch: a condition is a mask of zeros
and ones.
"""

# Warp compiles these functions from their source: names are bound as Warp binds them, not as Python does.

from functools import cache
from types import SimpleNamespace

import warp as wp

from armwright.kinematics.arms.arm_arrays import Precision


@cache
def lane_math(precision: Precision, lanes: int) -> SimpleNamespace:
    """Return the variant for a precision and a number of lanes."""
    real, Vector3 = {"float32": (wp.float32, wp.vec3f), "float64": (wp.float64, wp.vec3d)}[precision]
    Lane = wp.types.vector(length=lanes, dtype=real)  # one number for each lane
    Wide = wp.types.vector(length=lanes, dtype=wp.float64)
    Vector = wp.types.matrix(shape=(3, lanes), dtype=real)  # one vector for each lane, in the world
    one = real(1.0)

    @wp.func
    def roots(x: Lane):
        """Return square roots."""
        result = Lane()
        for i in range(lanes):
            result[i] = wp.sqrt(x[i])
        return result

    @wp.func
    def at_least(a: Lane, b: Lane):
        """Return 1 where a >= b, else 0."""
        return real(0.5) * (wp.sign(a - b) + Lane(one))

    @wp.func
    def select(mask: Lane, a: Lane, b: Lane):
        """Return a where the mask is 1, b where it is 0, both to the bit."""
        return wp.cw_mul(mask, a) + wp.cw_mul(Lane(one) - mask, b)

    @wp.func
    def library_sine_cosine(angle: Lane):
        """Return sine and cosine, to the last bits."""
        s, c = Lane(), Lane()
        for i in range(lanes):
            s[i] = wp.sin(angle[i])
            c[i] = wp.cos(angle[i])
        return s, c

    @wp.func
    def polynomial_sine_cosine(angle: Lane):
        """Return sine and cosine for |angle| <= 2π, to 1e-6: polynomials for a quarter of the angle, doubled twice.

        The coefficients interpolate (sin h / h - 1) / h² and (cos h - 1 + h²/2) / h⁴ at Chebyshev's nodes of
        |h| <= π/2; they are within 3e-8.
        """
        h = 0.25 * angle
        x = wp.cw_mul(h, h)
        s = 2.634756392e-06 * x - Lane(1.982273949e-04)
        s = wp.cw_mul(s, x) + Lane(8.333242135e-03)
        s = wp.cw_mul(s, x) - Lane(1.666666596e-01)
        s = wp.cw_mul(s, wp.cw_mul(x, h)) + h
        c = -2.654606581e-07 * x + Lane(2.478608244e-05)
        c = wp.cw_mul(c, x) - Lane(1.388881255e-03)
        c = wp.cw_mul(c, x) + Lane(4.166666608e-02)
        c = wp.cw_mul(c, x) - Lane(0.5)
        c = wp.cw_mul(c, x) + Lane(1.0)
        s2 = 2.0 * wp.cw_mul(s, c)
        c2 = Lane(1.0) - 2.0 * wp.cw_mul(s, s)
        return 2.0 * wp.cw_mul(s2, c2), Lane(1.0) - 2.0 * wp.cw_mul(s2, s2)

    # float32 needs no more than the polynomials, which take a small part of the library's time.
    sine_cosine = polynomial_sine_cosine if precision == "float32" else library_sine_cosine

    @wp.func
    def scaled(factor: Lane, v: Vector):
        """Return a vector times a number."""
        return wp.matrix_from_rows(wp.cw_mul(factor, v[0]), wp.cw_mul(factor, v[1]), wp.cw_mul(factor, v[2]))

    @wp.func
    def dot(a: Vector, b: Vector):
        """Return the scalar product."""
        return wp.cw_mul(a[0], b[0]) + wp.cw_mul(a[1], b[1]) + wp.cw_mul(a[2], b[2])

    @wp.func
    def cross(a: Vector, b: Vector):
        """Return the vector product."""
        return wp.matrix_from_rows(
            wp.cw_mul(a[1], b[2]) - wp.cw_mul(a[2], b[1]),
            wp.cw_mul(a[2], b[0]) - wp.cw_mul(a[0], b[2]),
            wp.cw_mul(a[0], b[1]) - wp.cw_mul(a[1], b[0]),
        )

    @wp.func
    def in_frame(v: Vector3, x: Vector, y: Vector, z: Vector):
        """Return the world components of a vector that is fixed in a frame with these axes."""
        return v[0] * x + v[1] * y + v[2] * z

    @wp.func
    def vector_of(values: wp.array2d(dtype=Lane), group: int, first: int):
        """Return a vector from three columns of a group of targets."""
        return wp.matrix_from_rows(values[group, first], values[group, first + 1], values[group, first + 2])

    return SimpleNamespace(
        real=real, Vector3=Vector3, Lane=Lane, Wide=Wide, Vector=Vector, roots=roots, at_least=at_least, select=select,
        sine_cosine=sine_cosine, scaled=scaled, dot=dot, cross=cross, in_frame=in_frame, vector_of=vector_of,
    )  # fmt: skip
