"""Payload, deflection and backlash of an arm over its reach, and its drawing."""

from collections.abc import Sequence

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.compliance import Stiffness, backlash_over_reach, deflections_over_reach
from armwright.kinematics.forward import link_lines
from armwright.kinematics.payload_limits import held_payloads
from armwright.kinematics.reach_outline import reach_outline
from armwright.kinematics.reach_postures import ReachPostures, postures_over_reach
from armwright.robot.arm import Arm, Vector
from armwright.runs.datasheet.joint_lines import known
from armwright.runs.datasheet.sheet import Drawing, LinkLine, ReachLine

FRACTIONS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # of the reach
SIDE, TOP = (0, 2), (0, 1)  # axes of the views


def reach_lines(arm: Arm, payload: float) -> tuple[ReachLine, ...]:
    """Return a line for each fraction of the reach, the largest last; payload: what moves the tip [kg]."""
    postures = postures_over_reach(arm, FRACTIONS)
    nothing = np.full(len(FRACTIONS), np.nan)
    drives = postures.arms.actuation
    held = nothing if drives is None or np.isnan(drives.peak).any() else np.array(held_payloads(postures).payloads)
    play = nothing if drives is None else backlash_over_reach(postures, drives.backlash)
    columns = zip(FRACTIONS, held, _deflections(postures, payload), play, strict=True)
    return tuple(
        ReachLine(fraction, fraction * postures.reach, known(most), known(sag), known(error))
        for fraction, most, sag, error in columns
    )


def _deflections(postures: ReachPostures, payload: float) -> Array:
    """Return (F,) the deflection at fractions of the reach [m]; NaN if a stiffness is not known."""
    arms, drives = postures.arms, postures.arms.actuation
    if drives is None:
        return np.full(postures.fractions, np.nan)
    stiffness = Stiffness(arms.bending_stiffness, arms.torsional_stiffness, drives.joint_stiffness)
    return deflections_over_reach(postures, stiffness, payload)


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
