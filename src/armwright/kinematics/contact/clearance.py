"""Clearance of posed arms from themselves and from obstacles: numpy in, numpy out."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision
from armwright.kinematics.arms.motor_bodies import NO_BODY, bodies_in, without_bodies
from armwright.kinematics.chunks import in_chunks, threads
from armwright.kinematics.devices import Device, load_kernels
from armwright.tasks.obstacles import SHAPES, Obstacle, Solid
from armwright.tasks.tip_rules import Solids, TipRules

MAX_CHUNK: dict[Device, int] = {"cpu": 2**16, "cuda": 2**20}  # postures
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
    (_, own), (_, free) = path_clearances(arms, q, range(q.shape[1] + 1), obstacles, device, rules, most)[0]
    return own, free


def path_clearances(
    arms: ArmArrays, q: Array, first: Sequence[int] | NDArray[np.intp], obstacles: Sequence[Obstacle] = (),
    device: Device = "cpu", rules: TipRules | None = None, most: float = np.inf,
    omitted: NDArray[np.bool_] | None = None,
) -> tuple[Array, NDArray[np.intp]]:  # fmt: skip
    """Return the smallest `clearances` in G spans of samples q (N, T, D), and the samples where they are.

    They are (2, 2, N, G): self-clearance and obstacle clearance, without the payload and with it where it is carried.
    The samples are (2, N, G), of the smaller of both.

    first: (G + 1,) first sample of each span, and T.
    omitted: (N, G) True for spans that are not measured.
    """
    (n, t, _), spans = q.shape, len(first) - 1
    distances, worst = np.empty((2, 2, n, spans)), np.empty((2, n, spans), dtype=np.intp)
    solids, at = _solids(tuple(obstacles), arms.precision, device), np.asarray(first, dtype=np.int32)
    left_out = np.zeros((n, spans), dtype=np.int32) if omitted is None else omitted.astype(np.int32)

    def measure(chunk: slice) -> None:
        distances[:, :, chunk], worst[:, chunk] = _distances(
            arms[chunk], q[chunk], at, left_out[chunk], solids, device, rules, most
        )

    size = MAX_CHUNK[device] // t
    if device == "cpu":
        size = min(size, max(-(-n // threads()), SMALLEST_CHUNK // t))
    in_chunks(measure, n, max(1, size), device)
    return distances, worst


def straight_motor_clearance(arms: ArmArrays, device: Device = "cpu") -> Array:
    """Return the (N,) smallest distance of two motor bodies with all joints at 0, or at the limit nearest to it [m].

    Motors that overlap there leave no room for the link between their joints.
    """
    motors = replace(arms, radius=np.zeros_like(arms.radius), columns=None)  # links of radius 0 are ignored
    straight = np.clip(0.0, arms.lower, arms.upper)[:, None].astype(np.float64)
    return clearances(motors, straight, device=device)[0][:, 0]


def _distances(
    arms: ArmArrays, q: Array, first: NDArray[np.int32], omitted: NDArray[np.int32], solids: Any, device: Device,
    rules: TipRules | None, most: float,
) -> tuple[NDArray[np.floating[Any]], NDArray[np.int32]]:  # fmt: skip
    """Return what `path_clearances` does of a chunk of arms."""
    loaded, (n, t, dof), tool = load_kernels("contact.clearance_kernels", device, arms.precision), q.shape, arms.tool
    offset = arms.offset.copy()
    offset[np.arange(n), arms.n_joints - 1] -= tool.tip.astype(arms.precision)
    bodies = arms.motor_bodies or bodies_in(without_bodies(n, dof), arms.precision)
    at_tip: Solids = {} if rules is None else rules.solids
    tip, n_bodies = _stacked(tuple(at_tip.values())), dof + 1 + len(at_tip)
    column = np.zeros((n, 1, 3)) if arms.columns is None else arms.columns[:, None]
    stands = np.where(column[..., 2] > 0.0, SHAPES.index("cylinder"), NO_BODY)
    values = {name: getattr(arms, name) for name in ("base", "motion", "axis", "radius")} | {"offset": offset, "q": q}
    values |= {
        "tip": tool.tip,
        "tip_into": np.stack([tool.side, np.cross(tool.axis, tool.side), tool.axis], axis=1),
        "shape": np.hstack([bodies.shape, stands, np.tile(tip["shape"], (n, 1))]),
        "half": np.hstack([bodies.half, column, np.tile(tip["half"], (n, 1, 1))]),
        "body_axis": bodies.axis,
        "centre": bodies.centre,
        "unloaded": n_bodies - ("payload" in at_tip),
        "carries": np.zeros(t, dtype=np.int32) if rules is None else rules.carries,
        "allowed": np.empty((0, 0)) if rules is None else rules.allowed,
    }
    kernels = loaded.kernels
    values |= {name: loaded.empty((n, t, dof), kernels.Vector3) for name in ("starts", "ends")}
    values |= {"middle": loaded.empty((n, t, n_bodies), kernels.Vector3)}
    values |= {"into": loaded.empty((n, t, n_bodies), kernels.Matrix3)}
    posed = loaded.struct("Posed", values)
    loaded.launch("pose", (n, t), posed, loaded.struct("Solids", tip))
    clearance = np.empty((2, 2, *omitted.shape), dtype=arms.precision)
    worst = np.empty((2, *omitted.shape), dtype=np.int32)
    loaded.launch("measure", omitted.shape, posed, solids, first, omitted, most, outputs=(clearance, worst))
    return clearance, worst


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
