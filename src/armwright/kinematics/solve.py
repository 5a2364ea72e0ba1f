"""The boundary of the kernels: numpy in, numpy out. Another kernel could stand behind it."""

import os
import threading
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.exceptions import FailureError
from armwright.kinematics.arrays import ArmArrays, Floats

UPDATES = 100  # of the inverse kinematics, docs/method.md §2
DEVICE = "cpu"
SMALLEST_CHUNK = 32  # groups of targets; below it a thread costs more than it brings


@dataclass(frozen=True)
class Postures:
    """The kept postures of N arms at T targets."""

    q: Floats  # (N, T, D) joint angles [rad]
    reached: Floats  # (N, T, 3) position of the tip [m]
    torque: Floats  # (N, T, D) that holds the posture against gravity, +dV/dq [N m]


def solve_postures(arms: ArmArrays, targets: NDArray[np.float64], updates: int = UPDATES) -> Postures:
    """Inverse kinematics from the straight start, and the gravity torque of the posture kept.

    targets: (T, 3) [m].  The same arm and target give the same bits whatever is solved beside them.
    """
    solved = _solve(arms, _in_lanes(targets[None])[0], updates, start=None)
    q, reached, torque = (_from_lanes(values.numpy())[:, : len(targets)] for values in solved[:3])
    return Postures(q, reached, torque)


def update_once(arms: ArmArrays, targets: NDArray[np.float64], q: Floats, h_before: Floats) -> tuple[Floats, Floats]:
    """One update of the inverse kinematics of each arm at a target of its own, from given angles.

    targets: (N, 3) [m].  q, the limit gradients h_before, and both results: (N, D).
    """
    # Only the target's place relative to the base matters, so each arm is moved and all share the target 0.
    moved = replace(arms, base=np.asarray(arms.base - targets, dtype=np.float32))
    start = _in_lanes(q[:, None]), _in_lanes(h_before[:, None])
    solved = _solve(moved, _in_lanes(np.zeros((1, 1, 3)))[0], 1, start)
    q_last, h_last = (_from_lanes(values.numpy())[:, 0] for values in solved[3:])
    return q_last, h_last


def _solve(arms: ArmArrays, targets: Floats, updates: int, start: tuple[Floats, Floats] | None) -> tuple[Any, ...]:
    """Kept angles, reached points, torques, last angles and last limit gradients, on the device.

    targets: (G, 3, L) in lanes.  start: angles and limit gradients, (N, G, D, L) each.
    """
    wp, kernels = _ready()
    n, groups, dof = len(arms), len(targets), arms.dof

    def array(values: Floats) -> Any:
        return wp.array(values, dtype=kernels.Lane, device=DEVICE)

    def empty(columns: int) -> Any:
        return wp.empty((n, groups, columns), dtype=kernels.Lane, device=DEVICE)

    if start is None:
        shape = (n, groups, dof, kernels.LANES)
        start = np.zeros(shape, np.float32), np.full(shape, kernels.LARGEST, np.float32)
    device_arms, device_targets = _to_device(arms), array(targets)
    q_last, h_last = array(start[0]), array(start[1])
    q_kept, reached, torque = empty(dof), empty(3), empty(dof)

    def launch(first: int, count: int) -> None:
        inputs = [device_arms, device_targets, updates, first, q_last, h_last, q_kept]
        wp.launch(kernels.descend, dim=(count, groups), inputs=inputs, device=DEVICE)
        inputs = [device_arms, device_targets, first, q_last, q_kept, reached, torque]
        wp.launch(kernels.hold, dim=(count, groups), inputs=inputs, device=DEVICE)

    chunks = _chunks(n, groups)
    if len(chunks) == 1:
        launch(*chunks[0])
    else:
        for launched in [_pool().submit(launch, *chunk) for chunk in chunks]:
            launched.result()
    return q_kept, reached, torque, q_last, h_last


def _in_lanes(values: NDArray[Any]) -> Floats:
    """(N, T, C) as (N, G, C, L): targets in groups of L lanes, the last one repeated to fill its group."""
    lanes = _ready()[1].LANES
    n, t, columns = values.shape
    groups = -(-t // lanes)
    filled = np.concatenate([values, np.repeat(values[:, -1:], groups * lanes - t, axis=1)], axis=1)
    return np.ascontiguousarray(filled.reshape(n, groups, lanes, columns).swapaxes(2, 3), dtype=np.float32)


def _from_lanes(values: Floats) -> Floats:
    """(N, G, C, L) as (N, G L, C)."""
    n, groups, columns, lanes = values.shape
    return values.swapaxes(2, 3).reshape(n, groups * lanes, columns)


def _chunks(n: int, groups: int) -> list[tuple[int, int]]:
    """(first, count) of the arms that each launch takes: some chunks a core, none too small."""
    size = max(-(-n // (4 * cores())), -(-SMALLEST_CHUNK // groups))
    return [(first, min(size, n - first)) for first in range(0, n, size)]


def cores() -> int:
    """The processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_loading = threading.Lock()


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), thread_name_prefix="armwright-kernels")


if hasattr(os, "register_at_fork"):  # a forked child has the pool's object, but not its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)


def _ready() -> tuple[Any, Any]:
    """Warp and the kernels, compiled and loaded, so that threads only launch."""
    with _loading:
        return _load()


@cache
def _load() -> tuple[Any, Any]:
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    try:
        with _silent_stderr():
            wp.init()
        from armwright.kinematics import kernels

        for kernel in (kernels.descend, kernels.hold):
            kernel.module.load(DEVICE)
    except OSError as fault:
        raise FailureError(
            f"the compiled kernels cannot be kept: {fault.strerror or fault}: {fault.filename}; "
            "set WARP_CACHE_PATH to a folder that can be written"
        ) from fault
    return wp, kernels


@contextmanager
def _silent_stderr() -> Generator[None]:
    """Drops what is written to the process's stderr meanwhile.

    Without an NVIDIA driver Warp's native code says so there, past every setting of its own.
    """
    try:
        kept = os.dup(2)
    except OSError:  # stderr is closed: nothing to silence
        yield
        return
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(sink)


def _to_device(arms: ArmArrays) -> Any:
    import warp as wp

    from armwright.kinematics.kernels import Arms

    on_device = Arms()
    on_device.dof = arms.dof
    on_device.base = wp.array(arms.base, dtype=wp.vec3, device=DEVICE)
    on_device.axis = wp.array(arms.axis, dtype=int, device=DEVICE)
    on_device.lower = wp.array(arms.lower, dtype=float, device=DEVICE)
    on_device.upper = wp.array(arms.upper, dtype=float, device=DEVICE)
    on_device.offset = wp.array(arms.offset, dtype=wp.vec3, device=DEVICE)
    on_device.com = wp.array(arms.com, dtype=wp.vec3, device=DEVICE)
    on_device.mass = wp.array(arms.mass, dtype=float, device=DEVICE)
    return on_device
