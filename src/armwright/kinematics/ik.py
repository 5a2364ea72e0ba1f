"""The boundary of the kernels: numpy in, numpy out. Another kernel could stand behind it.

Arms are solved in chunks, so that beside arms and results only what a few chunks need is in memory: on the CPU by
threads, on a GPU one chunk after another.
"""

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armwright.exceptions import ArmError, FailureError, SettingsError
from armwright.kinematics.arm_arrays import (
    ARRAYS,
    FIXED,
    FLOATS,
    TOOL,
    ArmArrays,
    Floats,
    Precision,
    TargetKind,
    check_precision,
)
from armwright.kinematics.devices import Device, cores, load, resolve_device
from armwright.tasks.targets import ORIENTATION, TargetArrays

UPDATES = 100  # of the inverse kinematics, docs/method.md §2
BEFORE_THE_FIRST = 1e30  # stands for ∞, the limit gradient before the first update
LANES: dict[Device, int] = {"cpu": 8, "cuda": 1}  # targets that a thread solves side by side
FEW = 2  # lanes for as many targets or fewer at the end: half the time of 8 lanes, and the same bits,
MANY_ARMS = 1000  # but another variant to compile, in seconds, so only for so many arms
KEPT_ARMS = 256  # for so many at a time arrays are kept, as to make them anew takes as long as to solve a hundred arms
MOST_KEPT = 8  # such sets of arrays, by thread
SMALLEST_CHUNK = 32  # groups of targets; below it a thread costs more than it brings
LARGEST_CHUNK: dict[Device, int] = {"cpu": 2**22, "cuda": 2**30}  # [bytes]: a core's cache; any GPU's memory


@dataclass(frozen=True)
class Postures:
    """The kept postures of N arms at T targets."""

    q: Floats  # (N, T, D) joint angles [rad], or ways [m]
    reached: Floats  # (N, T, 3) position of the tip [m]
    torque: Floats  # (N, T, D) that holds the posture against gravity, +dV/dq [N m] or [N]
    angle: Floats  # (N, T) by which the tool is off the target's axis or orientation [rad]; 0 where it has none


def solve_postures(
    arms: ArmArrays,
    targets: NDArray[np.float64],
    updates: int = UPDATES,
    *,
    start: ArrayLike | None = None,
    payload: NDArray[np.float64] | None = None,
    target_arrays: TargetArrays | None = None,
    precision: Precision = "float32",
    device: Device = "cpu",
) -> Postures:
    """Inverse kinematics from a start, and the gravity torque of the posture kept.

    targets: (T, 3) [m]; how many is a question of memory alone.
    start: values [rad] or [m] that broadcast to (N, T, D); one beyond a joint's limit is moved to that limit. Without
    it all arms start straight, at 0; fixed joints stay there.
    payload: (T,) point masses that the tip carries at the targets [kg]; without it none.
    target_arrays: which way the tool should point, of T targets; without them, or if none says so, only points count.
    precision: of the results. "float64" takes arms of either precision, "float32" only its own.
    The same arm, target and start give the same bits on the same device, whatever is solved beside them.
    """
    if updates < 0:
        raise SettingsError(f"updates = {updates} is outside 0 <= updates")
    arms = _in_precision(arms, check_precision(precision))
    device = resolve_device(device, many=True)
    n, t, dof = len(arms), len(targets), arms.dof
    start = None if start is None and arms.ranges_include_zero else np.zeros(1) if start is None else start
    starts = None
    if start is not None:
        starts = np.where(arms.motion[:, None] == FIXED, 0.0, _broadcast(start, (n, t, dof)))
    kind = _kind_of(target_arrays)
    wanted = _wanted(targets, np.zeros(t) if payload is None else payload, target_arrays)
    q, reached, torque = (np.empty((n, t, columns), dtype=precision) for columns in (dof, 3, dof))
    solved = Postures(q, reached, torque, angle=np.zeros((n, t), dtype=precision))
    parts = _parts(n, t, LANES[device])

    def solve(chunk: slice) -> None:
        some_arms = arms[chunk]
        for some, lanes in parts:
            begin = None if starts is None else starts[chunk, some]
            found = _solve(some_arms, wanted[some], updates, begin, kind, lanes, device)
            for whole, part in zip((solved.q, solved.reached, solved.torque), found, strict=False):
                whole[chunk, some] = part
            if kind == "pose":
                solved.angle[chunk, some] = found[3][..., 0]

    groups = -(-t // LANES[device])
    size = max(1, LARGEST_CHUNK[device] // _bytes_of_one(arms, groups, LANES[device]))
    if device == "cuda":
        _one_after_another(solve, n, size)
    else:
        in_threads(solve, n, min(size, max(-(-n // (4 * cores())), -(-SMALLEST_CHUNK // groups))))
    return solved


def update_once(
    arms: ArmArrays,
    targets: NDArray[np.float64],
    q: Floats,
    h_before: Floats,
    target_arrays: TargetArrays | None = None,
) -> tuple[Floats, Floats]:
    """One update of the inverse kinematics of each arm at a target of its own, from given angles, on the CPU.

    targets: (N, 3) [m].  q, the limit gradients h_before, and both results: (N, D). All is of the arms' precision.
    target_arrays: of one target, for all arms.
    """
    shape = (len(arms), arms.dof)
    if q.shape != shape or h_before.shape != shape:
        raise ArmError(f"q and h_before must have the shape {shape}: arms, joints; not {q.shape} and {h_before.shape}")
    # Only the target's place relative to the base matters, so each arm is moved and all share the target 0.
    moved = replace(arms, base=np.asarray(arms.base - targets, dtype=arms.precision))
    lanes = LANES["cpu"]
    wp, kernels = load(arms.precision, lanes, arms.motions, _kind_of(target_arrays), "cpu")
    wanted = _wanted(np.zeros((1, 3)), np.zeros(1), target_arrays)
    at, q_last, h_last = (
        wp.array(_in_lanes(values, lanes), dtype=kernels.Lane, device="cpu")
        for values in (wanted[None], q[:, None], h_before[:, None])
    )
    _launch(moved, at[0], 1, q_last, h_last, wp, kernels)
    return _from_lanes(q_last.numpy())[:, 0], _from_lanes(h_last.numpy())[:, 0]


def _kind_of(target_arrays: TargetArrays | None) -> TargetKind:
    return "pose" if target_arrays is not None and target_arrays.oriented else "position"


def _wanted(
    targets: NDArray[np.float64], payload: NDArray[np.float64], target_arrays: TargetArrays | None
) -> NDArray[np.float64]:
    """(T, C) what the kernels are told of each target: C = 4 numbers of a point, 16 where any says more."""
    points = [targets, payload]
    if target_arrays is None or not target_arrays.oriented:
        return np.column_stack(points)
    frame = target_arrays.rotation.swapaxes(1, 2).reshape(-1, 9)  # the x, then y, then z that the tool should have
    asks, whole = np.float64(target_arrays.n_angular > 0), np.float64(target_arrays.n_angular == ORIENTATION)
    return np.column_stack([*points, frame, asks, whole, target_arrays.metres_per_radian])


def _parts(n: int, t: int, lanes: int) -> list[tuple[slice, int]]:
    """Which of T targets are solved in how many lanes."""
    rest = t % lanes
    if n < MANY_ARMS or not 0 < rest <= FEW < lanes:
        return [(slice(0, t), lanes)]
    full = [(slice(0, t - rest), lanes)] if t > rest else []
    return [*full, (slice(t - rest, t), FEW)]


def _solve(
    arms: ArmArrays,
    targets: NDArray[np.float64],
    updates: int,
    start: NDArray[np.float64] | None,
    kind: TargetKind,
    lanes: int,
    device: Device,
) -> list[NDArray[Any]]:
    """Kept angles, reached points, torques and, of poses, angles off of a chunk of arms, (N, T, ...).

    targets: (T, C) as of `_wanted`.
    """
    at = _in_lanes(targets[None], lanes)[0]
    begin = None
    if start is not None:
        begin = _in_lanes(np.clip(start, arms.lower[:, None], arms.upper[:, None]), lanes)
    if device == "cpu" and len(arms) <= _most_kept(arms, len(at), lanes):
        results = _kept_arrays(arms, at, updates, kind, lanes).solve(arms, at, begin)
    else:
        wp, kernels = load(arms.precision, lanes, arms.motions, kind, device)
        at_ = wp.array(at, dtype=kernels.Lane, device=device, copy=False)
        q_last = wp.zeros((len(arms), len(at), arms.dof), dtype=kernels.Lane, device=device)
        if begin is not None:
            q_last = wp.array(begin, dtype=kernels.Lane, shape=begin.shape[:-1], device=device, copy=False)
        h_last = wp.full(q_last.shape, BEFORE_THE_FIRST, dtype=kernels.Lane, device=device)
        results = [values.numpy() for values in _launch(arms, at_, updates, q_last, h_last, wp, kernels)]
    return [_from_lanes(values)[:, : len(targets)] for values in results]


class _KeptArrays:
    """What the kernels read and write on the CPU for some arms at a time, made once and filled again for others."""

    def __init__(self, arms: ArmArrays, at: NDArray[Any], updates: int, kind: TargetKind, lanes: int) -> None:
        wp, kernels = load(arms.precision, lanes, arms.motions, kind, "cpu")
        most, groups, dof = _most_kept(arms, len(at), lanes), len(at), arms.dof
        read = {name: getattr(arms, name) for name in (ARRAYS if kind == "position" else (*ARRAYS, *TOOL))}
        self._arms = {name: np.zeros((most, *some.shape[1:]), dtype=some.dtype) for name, some in read.items()}
        self._at = np.zeros(at.shape, dtype=arms.precision)
        self._q_last, self._h_last, *self._results = (
            np.zeros((most, groups, columns, lanes), dtype=arms.precision)
            for columns in (dof, dof, *_columns(dof, kernels))
        )
        held = replace(arms, **self._arms)
        at_, q_last, h_last, *results = (
            wp.array(values, dtype=kernels.Lane, shape=values.shape[:-1], device="cpu", copy=False)
            for values in (self._at, self._q_last, self._h_last, *self._results)
        )
        self._launch = wp.launch
        self._steps = _steps(held, at_, updates, q_last, h_last, results, wp, kernels)

    def solve(self, arms: ArmArrays, at: NDArray[Any], begin: NDArray[Any] | None) -> list[NDArray[Any]]:
        """Kept angles, reached points and torques, (N, G, ...) in lanes, as long as nothing else is solved here."""
        n = len(arms)
        for name, values in self._arms.items():
            values[:n] = getattr(arms, name)
        self._at[...] = at
        self._q_last[:n] = 0.0 if begin is None else begin
        self._h_last[:n] = BEFORE_THE_FIRST
        for kernel, inputs in self._steps:
            self._launch(kernel, (n, len(at)), inputs=inputs, device="cpu")
        return [values[:n] for values in self._results]


_kept = threading.local()


def _kept_arrays(arms: ArmArrays, at: NDArray[Any], updates: int, kind: TargetKind, lanes: int) -> _KeptArrays:
    """This thread's arrays for arms with as many joints and targets of a kind."""
    sets: dict[tuple[Any, ...], _KeptArrays] = _kept.__dict__.setdefault("sets", {})
    key = (arms.dof, arms.precision, arms.motions, len(at), updates, kind, lanes)
    if key not in sets:
        if len(sets) == MOST_KEPT:
            sets.clear()
        sets[key] = _KeptArrays(arms, at, updates, kind, lanes)
    return sets[key]


def _most_kept(arms: ArmArrays, groups: int, lanes: int) -> int:
    """For how many arms arrays are kept: fewer, down to none, where each has a great many targets."""
    return min(KEPT_ARMS, LARGEST_CHUNK["cpu"] // _bytes_of_one(arms, groups, lanes))


def _bytes_of_one(arms: ArmArrays, groups: int, lanes: int) -> int:
    """Four numbers for each joint and three for the tip in each lane, and the arm itself."""
    return ((4 * arms.dof + 3) * groups * lanes + 10 * arms.dof + 3) * arms.base.itemsize


def _launch(arms: ArmArrays, at: Any, updates: int, q_last: Any, h_last: Any, wp: Any, kernels: Any) -> list[Any]:
    """Kept angles, reached points, torques and, of poses, angles off, (N, G, ...) in lanes, on the same device.

    at: (G, C) what targets ask for, in lanes.  q_last, h_last: (N, G, D) in lanes; they move on.
    """
    device, dim = q_last.device, (len(arms), len(at))
    results = [wp.empty((*dim, n), dtype=kernels.Lane, device=device) for n in _columns(arms.dof, kernels)]
    for kernel, inputs in _steps(arms, at, updates, q_last, h_last, results, wp, kernels):
        wp.launch(kernel, dim, inputs=inputs, device=device)
    return results


def _columns(dof: int, kernels: Any) -> tuple[int, ...]:
    """Of the results: kept angles, reached points, torques and, of poses, angles off."""
    return (dof, 3, dof) if kernels.keep_pose is None else (dof, 3, dof, 1)


def _steps(
    arms: ArmArrays, at: Any, updates: int, q_last: Any, h_last: Any, results: list[Any], wp: Any, kernels: Any
) -> tuple[tuple[Any, list[Any]], ...]:
    """The kernels in their order, each with what it takes; results: as of `_columns`."""
    on_device = _on_device(arms, wp, kernels, q_last.device)
    kept, *held = results[:3]
    if kernels.keep_pose is None:
        return (
            (kernels.solve_ik, [on_device, at, updates, q_last, h_last, kept]),
            (kernels.static_torque, [on_device, at, q_last, kept, *held]),
        )
    vector = kernels.Arms.vars["base"].type.dtype
    tool = [wp.array(getattr(arms, name), dtype=vector, device=q_last.device, copy=False) for name in TOOL]
    return (
        (kernels.solve_ik, [on_device, *tool, at, updates, q_last, h_last, kept]),
        (kernels.keep_pose, [on_device, *tool, at, q_last, kept, results[3]]),
        (kernels.static_torque, [on_device, at, kept, kept, *held]),
    )


def _on_device(arms: ArmArrays, wp: Any, kernels: Any, device: Any) -> Any:
    """The arms as the kernels take them; on the CPU without copies, a quarter of a single design's time."""
    on_device = kernels.Arms()
    on_device.dof = arms.dof
    for name in ARRAYS:
        dtype = kernels.Arms.vars[name].type.dtype
        setattr(on_device, name, wp.array(getattr(arms, name), dtype=dtype, device=device, copy=False))
    return on_device


def _in_precision(arms: ArmArrays, precision: Precision) -> ArmArrays:
    """The arms in this precision; a rounded limit could be a wider one, so nothing is rounded here."""
    if arms.precision == precision:
        return arms
    if precision == "float32":
        raise ArmError('the arms are stacked in float64: solve them with precision="float64", or stack them in float32')
    return replace(arms, **{name: getattr(arms, name).astype(np.float64) for name in FLOATS})


def _broadcast(start: ArrayLike, shape: tuple[int, int, int]) -> NDArray[np.float64]:
    angles = np.asarray(start, dtype=np.float64)
    if not np.all(np.isfinite(angles)):
        raise ArmError("start: an angle is not a finite number [rad]")
    try:
        return np.broadcast_to(angles, shape)
    except ValueError:
        raise ArmError(
            f"start: angles of shape {angles.shape} do not broadcast to {shape}: arms, targets, moving joints"
        ) from None


def _in_lanes(values: NDArray[Any], lanes: int) -> NDArray[Any]:
    """(N, T, C) as (N, G, C, L): targets in groups of L lanes, the last one repeated to fill its group."""
    n, t, columns = values.shape
    groups = -(-t // lanes)
    filled = np.concatenate([values, np.repeat(values[:, -1:], groups * lanes - t, axis=1)], axis=1)
    return np.ascontiguousarray(filled.reshape(n, groups, lanes, columns).swapaxes(2, 3))


def _from_lanes(values: NDArray[Any]) -> NDArray[Any]:
    """(N, G, C, L) as (N, G L, C)."""
    lanes = values.swapaxes(2, 3)  # (N, G, L, C)
    return lanes.reshape(len(lanes), -1, lanes.shape[3])


def _one_after_another(solve: Callable[[slice], None], n: int, size: int) -> None:
    """Solves n arms in chunks of `size`; in halves of it, and halves of those, where the GPU has no memory for it."""
    first = 0
    while first < n:
        size = min(size, n - first)
        try:
            solve(slice(first, first + size))
        except RuntimeError as fault:
            if "out of memory" not in str(fault) and "Failed to allocate" not in str(fault):
                raise
            if size == 1:
                raise FailureError(
                    "one arm at all its targets does not fit into the GPU's memory; "
                    'free some of it, solve fewer targets at a time, or take device = "cpu"'
                ) from fault
            size //= 2
        else:
            first += size


def in_threads(solve: Callable[[slice], None], n: int, size: int) -> None:
    """Solves n arms in chunks of `size`, by as many threads as there are cores."""
    chunks = [slice(first, min(first + size, n)) for first in range(0, n, size)]
    if len(chunks) == 1:
        solve(chunks[0])
    else:
        for solving in [_pool().submit(solve, chunk) for chunk in chunks]:
            solving.result()


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), thread_name_prefix="armwright-kernels")


if hasattr(os, "register_at_fork"):  # a forked child has the pool's object, but not its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
