"""Clearance of posed arms from themselves and from obstacles: numpy in, numpy out."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision
from armwright.kinematics.arms.motor_bodies import bodies_in, without_bodies
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.devices import Device, cores, load_kernels
from armwright.tasks.obstacles import SHAPES, Obstacle, Solid
from armwright.tasks.tip_rules import Solids, TipRules

MAX_CHUNK: dict[Device, int] = {"cpu": 2**14, "cuda": 2**20}  # postures; on the CPU their links fit into a cache
SMALLEST_CHUNK = 256  # postures; smaller chunks cost a thread more time than they save


def clearances(
    arms: ArmArrays, q: Array, obstacles: Sequence[Obstacle] = (), device: Device = "cpu",
    rules: TipRules | None = None, most: float = np.inf,
) -> tuple[Array, Array]:  # fmt: skip
    """Return the (N, T) self-clearance and obstacle clearance [m] of arms in postures q (N, T, D) [rad] or [m].

    These are the smallest distances of two links that are not neighbours, and of a link from an obstacle. The bodies of
    actuators count as well, if the arms have them: from each other, from links that they do not join, and from
    obstacles. A column below the base counts as a part of the arm; its distance from obstacles is ignored. Clearances
    are negative for overlaps, and infinite without obstacles or links to compare.

    rules: where the payload is carried at each of the T postures, and what tool and payload may touch there; None if
        neither counts.
    most: largest clearance of interest, which greater ones count as; 0 is fast for those who ask for overlaps alone.
    """
    n, t, _ = q.shape
    distances = np.empty((2, n, t))
    solids = _solids(tuple(obstacles), arms.precision, device) if obstacles else None

    def measure(chunk: slice) -> None:
        distances[:, chunk] = _distances(arms[chunk], q[chunk], solids, device, rules, most)

    size = MAX_CHUNK[device] // t
    if device == "cpu":
        size = min(size, max(-(-n // cores()), SMALLEST_CHUNK // t))
    in_chunks(measure, n, max(1, size), device)
    return distances[0], distances[1]


def straight_motor_clearance(arms: ArmArrays, device: Device = "cpu") -> Array:
    """Return the (N,) smallest distance of two motor bodies with all joints at 0, or at the limit nearest to it [m].

    Motors that overlap there leave no room for the link between their joints.
    """
    motors = replace(arms, radius=np.zeros_like(arms.radius), columns=None)  # links of radius 0 are ignored
    straight = np.clip(0.0, arms.lower, arms.upper)[:, None].astype(np.float64)
    return clearances(motors, straight, device=device)[0][:, 0]


def _distances(
    arms: ArmArrays, q: Array, solids: Any, device: Device, rules: TipRules | None, most: float
) -> NDArray[np.floating[Any]]:
    """Return the (2, N, T) clearances of a chunk of arms [m]."""
    dim, links = q.shape[:2], load_kernels("contact.clearance_kernels", device, arms.precision)
    own, free = (links.array(np.full(dim, most), links.kernels.real) for _ in range(2))
    offset = arms.offset.copy()
    offset[np.arange(len(arms)), arms.n_joints - 1] -= arms.tool.tip.astype(arms.precision)
    values = {name: getattr(arms, name) for name in ("base", "motion", "axis", "radius")} | {"offset": offset, "q": q}
    values |= {name: links.empty(q.shape, links.kernels.Vector3) for name in ("starts", "ends")}
    posed = links.struct("Posed", values)
    links.launch("link_axes", dim, posed)
    links.launch("self_clearance", dim, posed, own)
    if solids is not None:
        links.launch("obstacle_clearance", dim, posed, solids, free)
    if arms.columns is not None:
        links.launch("column_clearance", dim, posed, arms.columns, own)
    at_tip: Solids = {} if rules is None else rules.solids
    if arms.motor_bodies is not None or at_tip:
        motors = load_kernels("contact.motor_kernels", device, arms.precision)
        bodies = arms.motor_bodies or bodies_in(without_bodies(*q.shape[::2]), arms.precision)
        tip, tool, size = _stacked(tuple(at_tip.values())), arms.tool, (*dim, arms.dof + len(at_tip))
        body = {
            "shape": np.hstack([bodies.shape, np.tile(tip["shape"], (len(arms), 1))]),
            "half": np.hstack([bodies.half, np.tile(tip["half"], (len(arms), 1, 1))]),
            "middle": motors.empty(size, links.kernels.Vector3),
            "into": motors.empty(size, motors.kernels.Matrix3),
            "count": np.full(dim[1], size[2]) - (0 if rules is None else ("payload" in at_tip) & ~rules.carries),
            "allowed": np.empty((0, 0)) if rules is None else rules.allowed,
        }
        placed = motors.struct("Motors", body)
        frame = np.stack([tool.side, np.cross(tool.axis, tool.side), tool.axis], axis=1)
        at = motors.struct("Solids", tip)
        motors.launch("motor_frames", dim, posed, bodies.axis, bodies.centre, tool.tip, frame, at, placed)
        motors.launch("self_clearance", dim, posed, placed, own)
        if solids is not None:
            motors.launch("obstacle_clearance", dim, posed, placed, solids, free)
        if arms.columns is not None:
            motors.launch("column_clearance", dim, posed, placed, arms.columns, own)
    return np.stack([own.numpy(), free.numpy()])


@cache
def _solids(obstacles: tuple[Obstacle, ...], precision: Precision, device: Device) -> Any:
    """Return the obstacles as the kernels take them."""
    solids = _stacked([obstacle.solid for obstacle in obstacles])
    return load_kernels("contact.clearance_kernels", device, precision).struct("Solids", solids)


def _stacked(solids: Sequence[Solid]) -> dict[str, NDArray[Any]]:
    """Return the fields of `Solids`."""
    return {
        "shape": np.array([SHAPES.index(solid.shape) for solid in solids], dtype=np.int32),
        "centre": np.array([solid.centre for solid in solids]).reshape(-1, 3),
        "into": np.array([solid.rotation.T for solid in solids]).reshape(-1, 3, 3),
        "half": np.array([solid.half for solid in solids]).reshape(-1, 3),
        "corners": _padded([solid.hull.corners for solid in solids], 3),
        "planes": _padded([solid.hull.planes for solid in solids], 4),
    }


def _padded(rows: Sequence[Array], width: int) -> Array:
    """Return rows (n_i, width) as one array (N, n, width), the shorter ones repeated."""
    n = max((len(row) for row in rows), default=0)
    return np.array([np.resize(row, (n, width)) for row in rows]).reshape(len(rows), n, width)
