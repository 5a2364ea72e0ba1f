"""Inverse kinematics and static torque of many arms at many targets: numpy in, numpy out.

The kernels behind it implement the weighted least-norm solution of Chan & Dubey (1995) with the steps of Sugiura et al.
(2007); `ik_kernels` names the source of each formula, docs/method.md §2 states them all.

Arms are solved in chunks, so memory holds arms, results and the arrays of a few chunks only.
"""

import threading
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armwright.arrays import Array
from armwright.exceptions import ArmError, SettingsError
from armwright.kinematics.arms.arm_arrays import (
    FIXED,
    ArmArrays,
    Floats,
    Motions,
    Precision,
    TargetKind,
    check_precision,
)
from armwright.kinematics.chunks import in_chunks
from armwright.kinematics.devices import Device, Loaded, cores, load_kernels, resolve_device
from armwright.tasks.targets import ORIENTATION, TargetArrays

UPDATES = 100  # of the inverse kinematics, docs/method.md §2
INITIAL_GRADIENT = 1e30  # stands for ∞, the limit gradient before the first update
LANES: dict[Device, int] = {"cpu": 8, "cuda": 1}  # targets that a thread solves side by side
FEW_LANES = 2  # for so few remaining targets of many arms: half the time of 8 lanes, and the same bits
MANY_ARMS = 1000  # for fewer arms compiling that variant costs more than it saves
BUFFERED_ARMS = 256  # chunks up to this size reuse buffers: allocating them takes as long as solving a hundred arms
MAX_BUFFERS = 8  # per thread
SMALLEST_CHUNK = 32  # groups of targets; smaller chunks cost a thread more time than they save
MAX_CHUNK: dict[Device, int] = {"cpu": 2**22, "cuda": 2**30}  # [bytes]: the cache of a core; memory of any GPU

Variant = tuple[Motions, TargetKind]  # of the kernels


@dataclass(frozen=True)
class Postures:
    """The best postures of N arms at T targets, the earliest of equals."""

    q: Floats  # (N, T, D) joint angles [rad] or displacements [m]
    reached: Floats  # (N, T, 3) position of the tip [m]
    torque: Floats  # (N, T, D) that holds the posture against gravity, +dV/dq [N m] or [N]
    angle: Floats  # (N, T) by which the tool is off the target's axis or orientation [rad]; 0 where it has none

    def distance(self, points: Array) -> Array:
        """Return the (N, T) distances of the tip from points (T, 3) [m]."""
        return np.linalg.norm(self.reached.astype(np.float64) - points, axis=-1)

    def nearer(self, other: "Postures", points: Array, metres_per_radian: Array | float) -> "Postures":
        """Return, per arm and target, the posture with the smaller distance, angles included; of equals this one."""
        mine, others = (np.hypot(each.distance(points), metres_per_radian * each.angle) for each in (self, other))
        better, pairs = others < mine, zip(vars(self).values(), vars(other).values(), strict=True)
        kept: list[Any] = [np.where(better[..., None] if a.ndim > better.ndim else better, b, a) for a, b in pairs]
        return Postures(*kept)


def solve_postures(
    arms: ArmArrays,
    points: Array,
    updates: int = UPDATES,
    *,
    initial_q: ArrayLike | None = None,
    payload: Array | None = None,
    target_arrays: TargetArrays | None = None,
    restarts: int = 0,
    precision: Precision = "float32",
    device: Device = "cpu",
    motions: Motions | None = None,
) -> Postures:
    """Solve the inverse kinematics, and compute the gravity torque of the best posture.

    The same arm, target and initial posture give the same bits on the same device, independent of the batch.

    Args:
        arms: N arms of up to D joints.
        points: (T, 3) targets of the tip [m].
        updates: The number of updates.
        initial_q: Joint angles [rad] or displacements [m] that broadcast to (N, T, D), moved into the joint limits;
            None for 0. Fixed joints stay at 0.
        payload: (T,) masses of payloads [kg]; None for no payload.
        target_arrays: The axes and orientations of the T targets; None for points alone.
        restarts: The number of further, random starts, of which the best posture is kept.
        precision: The precision of the results. Arms in float32 can be solved in float64, not the reverse.
        device: The device to solve on.
        motions: The variant of the kernels, which gives the same bits; None for the one that these arms need.
    """
    if updates < 0:
        raise SettingsError(f"updates = {updates} is outside 0 <= updates")
    arms = _in_precision(arms, check_precision(precision))
    device = resolve_device(device, many=True)
    kind = _kind_of(target_arrays)
    columns = _target_columns(points, np.zeros(len(points)) if payload is None else payload, target_arrays)
    if initial_q is None and (arms.couplings is not None or not arms.ranges_include_zero):
        initial_q = 0.0
    variant = (motions or arms.motions, kind)
    best = _solve_all(arms, columns, updates, initial_q, variant, device)
    metres_per_radian = 0.0 if target_arrays is None else target_arrays.metres_per_radian
    for start in arms.random_postures(restarts):
        other = _solve_all(arms, columns, updates, start[:, None], variant, device)
        best = best.nearer(other, points, metres_per_radian)
    return best


def _solve_all(
    arms: ArmArrays, columns: Array, updates: int, initial_q: ArrayLike | None, variant: Variant, device: Device
) -> Postures:
    """Solve all arms at the targets (T, C), in chunks."""
    if (opposed := arms.opposed).any():  # the kernels rotate about x, y and z, by the opposite angle
        sign = np.where(opposed, -1.0, 1.0).astype(arms.precision)[:, None]
        lower, upper = np.where(opposed, -arms.upper, arms.lower), np.where(opposed, -arms.lower, arms.upper)
        mirrored = replace(arms, axis=np.where(opposed[..., None], -arms.axis, arms.axis), lower=lower, upper=upper)
        start = None if initial_q is None else sign * np.asarray(initial_q)
        found = _solve_all(mirrored, columns, updates, start, variant, device)
        return replace(found, q=sign * found.q, torque=sign * found.torque)
    n, t, dof = len(arms), len(columns), arms.dof
    initial = None
    if initial_q is not None:
        initial = np.where(arms.motion[:, None] == FIXED, 0.0, _broadcast(initial_q, (n, t, dof)))
    whole = [np.empty((n, t, size), dtype=arms.precision) for size in _result_sizes(dof)]
    parts = _parts(n, t, LANES[device])

    def solve(chunk: slice) -> None:
        chunk_arms = arms[chunk]
        for part, lanes in parts:
            part_initial = None if initial is None else initial[chunk, part]
            results = _solve(chunk_arms, columns[part], updates, part_initial, variant, lanes, device)
            for values, solved in zip(whole, results, strict=True):
                values[chunk, part] = solved

    groups = -(-t // LANES[device])
    size = max(1, MAX_CHUNK[device] // _bytes_of_one(arms, groups, LANES[device]))
    if device == "cpu":
        size = min(size, max(-(-n // (4 * cores())), -(-SMALLEST_CHUNK // groups)))
    in_chunks(solve, n, size, device)
    q, reached, torque, angle = whole
    return Postures(q, reached, arms.by_independent(torque), angle[..., 0])


def _kind_of(target_arrays: TargetArrays | None) -> TargetKind:
    return "pose" if target_arrays is not None and target_arrays.oriented else "position"


def _target_columns(points: Array, payload: Array, target_arrays: TargetArrays | None) -> Array:
    """Return the (T, C) input of the kernels: C = 4 if all targets are points, else 16."""
    columns = [points, payload]
    if target_arrays is None or not target_arrays.oriented:
        return np.column_stack(columns)
    axes = target_arrays.rotation.swapaxes(1, 2).reshape(-1, 9)  # x, then y, then z of the tool at the target
    has_axis, has_frame = np.float64(target_arrays.n_angular > 0), np.float64(target_arrays.n_angular == ORIENTATION)
    return np.column_stack([*columns, axes, has_axis, has_frame, target_arrays.metres_per_radian])


def _parts(n: int, t: int, lanes: int) -> list[tuple[slice, int]]:
    """Split T targets by the number of lanes that solve them."""
    rest = t % lanes
    if n < MANY_ARMS or not 0 < rest <= FEW_LANES < lanes:
        return [(slice(0, t), lanes)]
    full = [(slice(0, t - rest), lanes)] if t > rest else []
    return [*full, (slice(t - rest, t), FEW_LANES)]


def _solve(
    arms: ArmArrays, columns: Array, updates: int, initial_q: Array | None, variant: Variant, lanes: int, device: Device
) -> list[NDArray[Any]]:
    """Return joint angles, tip positions, torques and angle errors of a chunk of arms, (N, T, ...)."""
    grouped = _in_lanes(columns[None], lanes)[0]
    if initial_q is not None:
        initial_q = np.clip(initial_q, arms.lower[:, None], arms.upper[:, None])
        initial_q = _in_lanes(arms.coupled(initial_q), lanes)
    loaded = load_kernels("ik.ik_kernels", device, arms.precision, lanes, *variant)
    if device == "cpu" and len(arms) <= _buffered_arms(arms, len(grouped), lanes):
        results = _thread_buffers(arms, grouped, updates, loaded).solve(arms, grouped, initial_q)
    else:
        results = _solve_once(arms, grouped, updates, initial_q, loaded)
    return [_from_lanes(values)[:, : len(columns)] for values in results]


def _solve_once(
    arms: ArmArrays, columns: NDArray[Any], updates: int, initial_q: NDArray[Any] | None, loaded: Loaded
) -> list[NDArray[Any]]:
    """Return the results (N, G, ...) in lanes of a chunk too large for buffers."""
    lane, dim = loaded.kernels.Lane, (len(arms), len(columns))
    shape = (*dim, arms.dof)
    start = loaded.warp.zeros(shape, lane, device=loaded.device) if initial_q is None else loaded.array(initial_q, lane)
    gradients = loaded.warp.full(shape, INITIAL_GRADIENT, lane, device=loaded.device)
    results = [loaded.empty((*dim, size), lane) for size in _result_sizes(arms.dof)]
    for kernel, inputs in _steps(arms, loaded.array(columns, lane), updates, start, gradients, results, loaded):
        loaded.warp.launch(kernel, dim, inputs=inputs, device=loaded.device)
    return [values.numpy() for values in results]


class _Buffers:
    """Arrays that the kernels read and write on the CPU, filled again for each chunk of arms."""

    def __init__(self, arms: ArmArrays, columns: NDArray[Any], updates: int, loaded: Loaded) -> None:
        (groups, _, lanes), dof = columns.shape, arms.dof
        n = _buffered_arms(arms, groups, lanes)
        read = arms.read_by_ik.items()
        self._arms = {name: np.zeros((n, *values.shape[1:]), dtype=values.dtype) for name, values in read}
        self._columns = np.zeros(columns.shape, dtype=arms.precision)
        self._q_last, self._h_last, *self._results = (
            np.zeros((n, groups, size, lanes), dtype=arms.precision) for size in (dof, dof, *_result_sizes(dof))
        )
        columns_, q_last, h_last, *results = (
            loaded.array(values, loaded.kernels.Lane)
            for values in (self._columns, self._q_last, self._h_last, *self._results)
        )
        self._launch = loaded.warp.launch
        self._steps = _steps(replace(arms, **self._arms), columns_, updates, q_last, h_last, results, loaded)

    def solve(self, arms: ArmArrays, columns: NDArray[Any], initial_q: NDArray[Any] | None) -> list[NDArray[Any]]:
        """Return the results (N, G, ...) in lanes; the next call overwrites them."""
        n = len(arms)
        for name, values in self._arms.items():
            values[:n] = getattr(arms, name)
        self._columns[...] = columns
        self._q_last[:n] = 0.0 if initial_q is None else initial_q
        self._h_last[:n] = INITIAL_GRADIENT
        for kernel, inputs in self._steps:
            self._launch(kernel, (n, len(columns)), inputs=inputs, device="cpu")
        return [values[:n] for values in self._results]


_local = threading.local()


def _thread_buffers(arms: ArmArrays, columns: NDArray[Any], updates: int, loaded: Loaded) -> _Buffers:
    """Return the buffers of this thread for arms of this size and as many targets."""
    buffers: dict[tuple[Any, ...], _Buffers] = _local.__dict__.setdefault("buffers", {})
    key = (loaded, arms.dof, len(columns), updates)
    if key not in buffers:
        if len(buffers) == MAX_BUFFERS:
            buffers.clear()
        buffers[key] = _Buffers(arms, columns, updates, loaded)
    return buffers[key]


def _buffered_arms(arms: ArmArrays, groups: int, lanes: int) -> int:
    """Return how many arms fit into buffers: the more targets, the fewer, down to none."""
    return min(BUFFERED_ARMS, MAX_CHUNK["cpu"] // _bytes_of_one(arms, groups, lanes))


def _bytes_of_one(arms: ArmArrays, groups: int, lanes: int) -> int:
    """Return the memory of an arm and its results: four numbers per joint and three for the tip in each lane."""
    return ((4 * arms.dof + 3) * groups * lanes + 10 * arms.dof + 3) * arms.base.itemsize


def _result_sizes(dof: int) -> tuple[int, ...]:
    """Return the sizes of the results: joint angles, tip position, torques and angle error."""
    return (dof, 3, dof, 1)


def _steps(
    arms: ArmArrays, columns: Any, updates: int, q_last: Any, h_last: Any, results: list[Any], loaded: Loaded
) -> tuple[tuple[Any, list[Any]], ...]:
    """Return the kernels in their order, each with its inputs.

    columns: (G, C) targets in lanes.  q_last, h_last: (N, G, D) in lanes, updated in place.  results: of the sizes
    `_result_sizes`.
    """
    on_device = loaded.struct("Arms", {"dof": arms.dof, **arms.read_by_ik})
    return (
        (loaded.kernels.solve_ik, [on_device, columns, updates, q_last, h_last, results[0]]),
        (loaded.kernels.static_torque, [on_device, columns, q_last, *results]),
    )


def _in_precision(arms: ArmArrays, precision: Precision) -> ArmArrays:
    """Return the arms in this precision. Nothing is rounded here: a rounded limit could be a wider one."""
    if arms.precision == precision:
        return arms
    if precision == "float32":
        raise ArmError('the arms are stacked in float64; use precision="float64", or stack them in float32')
    wide = {name: values.astype(np.float64) for name, values in arms.read_by_ik.items() if name != "motion"}
    return replace(arms, **wide)


def _broadcast(initial_q: ArrayLike, shape: tuple[int, int, int]) -> Array:
    angles = np.asarray(initial_q, dtype=np.float64)
    if not np.all(np.isfinite(angles)):
        raise ArmError("initial_q: expected finite angles [rad]")
    try:
        return np.broadcast_to(angles, shape)
    except ValueError:
        raise ArmError(
            f"initial_q: angles of shape {angles.shape} do not broadcast to {shape}: arms, targets, joints"
        ) from None


def _in_lanes(values: NDArray[Any], lanes: int) -> NDArray[Any]:
    """Return (N, T, C) as (N, G, C, L): targets in groups of L lanes, the last target repeated to fill its group."""
    n, t, columns = values.shape
    groups = -(-t // lanes)
    filled = np.concatenate([values, np.repeat(values[:, -1:], groups * lanes - t, axis=1)], axis=1)
    return np.ascontiguousarray(filled.reshape(n, groups, lanes, columns).swapaxes(2, 3))


def _from_lanes(values: NDArray[Any]) -> NDArray[Any]:
    """Return (N, G, C, L) as (N, G L, C)."""
    lanes = values.swapaxes(2, 3)  # (N, G, L, C)
    return lanes.reshape(len(lanes), -1, lanes.shape[3])
