"""What any sheet states of its arm, whatever it is for: links, drawing, payload and errors over the reach."""

from typing import Any

from armwright.arrays import Array
from armwright.kinematics.arms.forward import link_lines
from armwright.kinematics.reach.reach_outline import reach_outline
from armwright.problem.over_reach import reach_lines
from armwright.robot.arm import Arm
from armwright.robot.axes import as_vector
from armwright.robot.link_geometry import home_posture
from armwright.sheet.record import Drawing, LinkLine

SIDE, TOP = (0, 2), (0, 1)  # axes of the views
ASSUMED = {  # of the values of any sheet
    "reach": "horizontal distance of the tip from the first joint; the outlines show the farthest point found in each "
    "of 72 directions around the base, without obstacles",
    "over the reach": "the least favourable of all postures found, in directions in which the arm reaches nearly as "
    "far as in any",
}


def arm_lines(arm: Arm, payload: float, targets: Array) -> dict[str, Any]:
    """Return these parts of a data sheet, by field; the payload [kg] moves with the tip, targets (T, 3) [m]."""
    return {
        "links": tuple(_link_line(arm, n) for n in range(1, len(arm.links) + 1)),
        "over_reach": reach_lines(arm, payload),
        "drawing": _drawing(arm, targets),
    }


def _link_line(arm: Arm, number: int) -> LinkLine:
    """Return the line of a link, from 1; its tube is stated if its wall is known."""
    link = arm.links[number - 1]
    mass = None if link.without_mass else link.mass
    diameter = None if link.wall is None or link.length == 0.0 else 2.0 * link.radius
    return LinkLine(number, link.length, diameter, None if diameter is None else link.wall, mass)


def _drawing(arm: Arm, targets: Array) -> Drawing:
    q = home_posture(arm)
    numbers = [*range(1, len(arm.links) + 1), 0]
    return Drawing(
        base=arm.base,
        is_at_zero=not any(q),
        links=tuple(
            (n, as_vector(start), as_vector(end)) for n, (start, end) in zip(numbers, link_lines(arm, q), strict=True)
        ),
        column=None if arm.column is None else arm.column.length,
        targets=tuple(map(as_vector, targets)),
        side=reach_outline(arm, SIDE),
        top=reach_outline(arm, TOP),
    )
