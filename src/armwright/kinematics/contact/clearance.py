"""Clearance of posed arms from themselves and from obstacles: numpy in, numpy out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision
from armwright.kinematics.arms.motor_bodies import bodies_in, without_bodies
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.devices import Device, Loaded, cores, load_kernels
from armwright.tasks.obstacles import SHAPES, Obstacle, Solid
from armwright.tasks.tip_rules import Solids, TipRules

MAX_CHUNK: dict[Device, int] = {"cpu": 2**14, "cuda": 2**20}  # postures; on the CPU their links fit into a cache
SMALLEST_CHUNK = 256  # postures; smaller chunks cost a thread more time than they save


@dataclass(frozen=True)
class SpanClearances:
    """Least clearances of N arms in G spans of postures."""

    least: Array  # (2, 2, N, G) from the arm itself and from obstacles, each without and with the payload [m]
    at: NDArray[np.int32]  # (2, 2, N, G) index of the posture where it is

    def of(self, source: NDArray[np.intp]) -> "SpanClearances":
        """Return the clearances of spans that are the same as others; source: (N, G) which ones."""
        return SpanClearances(*(np.take_along_axis(each, source[None, None], axis=3) for each in (self.least, self.at)))

    def carrying(self, carries: NDArray[np.bool_]) -> tuple[Array, Array, NDArray[np.int32]]:
        """Return (N, G) self-clearance, obstacle clearance, and the posture of the smaller one.

        carries: (G,) whether the payload is carried.
        """
        own, free = np.where(carries, self.least[:, 1], self.least[:, 0])
        own_at, free_at = np.where(carries, self.at[:, 1], self.at[:, 0])
        return own, free, np.where(free < own, free_at, own_at)


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
    each = span_clearances(arms, q, np.arange(q.shape[1] + 1), obstacles, device, rules, most)
    own, free, _ = each.carrying(np.zeros(q.shape[1], dtype=np.bool_) if rules is None else rules.carries)
    return own, free


def span_clearances(
    arms: ArmArrays, q: Array, first: NDArray[np.intp], obstacles: Sequence[Obstacle] = (), device: Device = "cpu",
    rules: TipRules | None = None, most: float = np.inf, left_out: NDArray[np.bool_] | None = None,
) -> SpanClearances:  # fmt: skip
    """Return the least `clearances` in spans of postures, which are steps along a path.

    first: (G + 1,) index of the first of the T postures of each span, and T.
    rules: what may be touched at each of the T postures.
    left_out: (N, G) True for spans that are not measured, whose clearances are `most`.
    """
    n, t, _ = q.shape
    solids = _solids(tuple(obstacles), arms.precision, device)
    mask = np.zeros((n, len(first) - 1), dtype=np.bool_) if left_out is None else left_out
    least, at = np.empty((*mask.shape, 4), dtype=arms.precision), np.empty((*mask.shape, 4), dtype=np.int32)

    def measure(chunk: slice) -> None:
        part, links = arms[chunk], load_kernels("contact.clearance_kernels", device, arms.precision)
        posed, motors, at_tip = _bodies(part, q[chunk], first, mask[chunk], rules, links)
        columns = np.empty((0, 3)) if part.columns is None else part.columns
        given = (posed, motors, at_tip, solids, columns, links.kernels.real(most))
        links.launch("measure", mask[chunk].shape, *given, outputs=[least[chunk], at[chunk]])

    size = MAX_CHUNK[device] // t
    if device == "cpu":
        size = min(size, max(-(-n // cores()), SMALLEST_CHUNK // t))
    in_chunks(measure, n, max(1, size), device)
    found, posture = (np.moveaxis(each, 2, 0).reshape(2, 2, *mask.shape) for each in (least, at))
    return SpanClearances(found.astype(np.float64), posture)


def straight_motor_clearance(arms: ArmArrays, device: Device = "cpu") -> Array:
    """Return the (N,) smallest distance of two motor bodies with all joints at 0, or at the limit nearest to it [m].

    Motors that overlap there leave no room for the link between their joints.
    """
    motors = replace(arms, radius=np.zeros_like(arms.radius), columns=None)  # links of radius 0 are ignored
    straight = np.clip(0.0, arms.lower, arms.upper)[:, None].astype(np.float64)
    return clearances(motors, straight, device=device)[0][:, 0]


def _bodies(
    arms: ArmArrays, q: Array, first: NDArray[np.intp], left_out: NDArray[np.bool_], rules: TipRules | None,
    links: Loaded,
) -> tuple[Any, Any, Any]:  # fmt: skip
    """Return the links of a chunk of arms, their bodies, and tool and payload, as the kernel takes them."""
    offset = arms.offset.copy()
    offset[np.arange(len(arms)), arms.n_joints - 1] -= arms.tool.tip.astype(arms.precision)
    stroke = np.where(arms.prismatic, np.maximum(np.abs(arms.lower), np.abs(arms.upper)), 0.0)
    values = {name: getattr(arms, name) for name in ("base", "motion", "axis", "radius")} | {"offset": offset, "q": q}
    values |= {name: links.empty(q.shape, links.kernels.Vector3) for name in ("starts", "ends")}
    values |= {"reach": np.linalg.norm(offset, axis=2) + stroke, "first": first, "left_out": left_out}
    at_tip: Solids = {} if rules is None else rules.solids
    bodies = arms.motor_bodies
    if bodies is None:
        bodies = bodies_in(without_bodies(len(arms), arms.dof if at_tip else 0), arms.precision)
    tip, tool = _stacked(tuple(at_tip.values())), arms.tool
    shape = np.hstack([bodies.shape, np.tile(tip["shape"], (len(arms), 1))])
    size = (*q.shape[:2], shape.shape[1])
    body = {
        "shape": shape,
        "half": np.hstack([bodies.half, np.tile(tip["half"], (len(arms), 1, 1))]),
        "axis": bodies.axis,
        "centre": bodies.centre,
        "tip": tool.tip,
        "tip_into": np.stack([tool.side, np.cross(tool.axis, tool.side), tool.axis], axis=1),
        "middle": links.empty(size, links.kernels.Vector3),
        "into": links.empty(size, links.kernels.Matrix3),
        "n_lasting": size[2] - ("payload" in at_tip),
        "allowed": np.empty((0, 0)) if rules is None else rules.allowed,
    }
    return links.struct("Posed", values), links.struct("Motors", body), links.struct("Solids", tip)


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
