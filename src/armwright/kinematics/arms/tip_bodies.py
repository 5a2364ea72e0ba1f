"""Tool and payload of stacked arms as solid bodies at the ends of their last links."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.kinematics.arms.motor_bodies import NO_BODY
from armwright.kinematics.arms.rigid_bodies import PerArm, Tools
from armwright.rotations import rotation_to_axis
from armwright.tasks.obstacles import SHAPES
from armwright.tasks.payload import LoadShape

BOX, CYLINDER = SHAPES.index("box"), SHAPES.index("cylinder")


@dataclass(frozen=True)
class TipBodies(PerArm):
    """Tool and payload of N arms, in this order, in a frame at the end of the last link and parallel to that link's."""

    shape: NDArray[np.int32]  # (N, 2) index in SHAPES; NO_BODY if there is none
    half: NDArray[np.floating[Any]]  # (N, 2, 3) half edges in the body's frame; radius, radius, half the length [m]
    centre: NDArray[np.floating[Any]]  # (N, 2, 3) [m]
    into: NDArray[np.floating[Any]]  # (N, 2, 3, 3) rotation into the body's frame


def stack_tip_bodies(tools: Tools, load: LoadShape, precision: Any) -> TipBodies | None:
    """Return the bodies at the tips of N arms; None if there are none."""
    is_box, is_round = tools.size.any(axis=1), tools.radius > 0.0
    if not (is_box.any() or is_round.any() or any(load.size)):
        return None
    n, frame = len(tools.tip), tools.frame
    shape = np.full((n, 2), NO_BODY, dtype=np.int32)
    shape[:, 0] = np.where(is_box, BOX, np.where(is_round, CYLINDER, NO_BODY))
    shape[:, 1] = BOX if any(load.size) else NO_BODY
    length = np.linalg.norm(tools.tip, axis=1)
    cylinder = np.stack([tools.radius, tools.radius, length / 2], axis=1)
    half = np.stack(
        [np.where(is_box[:, None], tools.size / 2, cylinder), np.tile(np.array(load.size) / 2, (n, 1))], axis=1
    )
    payload = tools.tip + frame @ np.array(load.middle)
    centre = np.stack([np.where(is_box[:, None], tools.com, tools.tip / 2), payload], axis=1)
    into = np.stack([frame, frame], axis=1).swapaxes(-1, -2)
    tips, which = np.unique(tools.tip[is_round], axis=0, return_inverse=True)
    if len(tips):
        into[is_round, 0] = np.array([rotation_to_axis(tip).T for tip in tips])[which.reshape(-1)]
    return TipBodies(shape, *(values.astype(precision) for values in (half, centre, into)))
