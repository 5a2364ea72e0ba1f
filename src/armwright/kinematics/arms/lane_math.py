"""Types and Warp functions of numbers in lanes.

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
    def norm_squared(x: Lane, y: Lane, z: Lane):
        """Return the square of a vector's length."""
        return wp.cw_mul(x, x) + wp.cw_mul(y, y) + wp.cw_mul(z, z)

    return SimpleNamespace(
        real=real, Vector3=Vector3, Lane=Lane, Wide=Wide,
        roots=roots, at_least=at_least, select=select, sine_cosine=sine_cosine, norm_squared=norm_squared,
    )  # fmt: skip
