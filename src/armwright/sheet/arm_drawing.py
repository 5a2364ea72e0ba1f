"""The drawing of an arm, and what its sheet says of a link."""

from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.forward import link_lines
from armwright.kinematics.reach.reach_outline import reach_outline
from armwright.robot.arm import Arm, Vector
from armwright.sheet.record import Drawing, LinkLine

SIDE, TOP = (0, 2), (0, 1)  # axes of the views


def drawing_of(arm: Arm, targets: Array, zeros: Sequence[float] | None = None) -> Drawing:
    """Return the drawing of an arm.

    Args:
        arm: The arm.
        targets: (T, 3) [m], or none.
        zeros: Values of the joints that count as 0; 0 by default.
    """
    zeros = [0.0] * len(arm.joints) if zeros is None else zeros
    q = [min(max(zero, joint.lower), joint.upper) for joint, zero in zip(arm.joints, zeros, strict=True)]
    lines = [(_vector(start), _vector(end)) for start, end in link_lines(arm, q)]
    numbers = [*range(1, len(arm.links) + 1), 0]
    return Drawing(
        base=arm.base,
        is_at_zero=np.allclose(q, zeros),
        links=tuple((number, *line) for number, line in zip(numbers, lines, strict=True)),
        column=None if arm.column is None else arm.column.length,
        targets=tuple(_vector(target) for target in targets),
        side=reach_outline(arm, SIDE),
        top=reach_outline(arm, TOP),
    )


def link_line(arm: Arm, number: int) -> LinkLine:
    """Return the line of a link, from 1; its tube is stated if its wall is known."""
    link = arm.links[number - 1]
    diameter = None if link.wall is None or link.length == 0.0 else 2.0 * link.radius
    return LinkLine(number, link.length, diameter, None if diameter is None else link.wall, link.mass)


def _vector(values: Array) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
