"""The boundary of the kernels: numpy in, numpy out. Another kernel could stand behind it."""

import os
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armwright.kinematics.arrays import ArmArrays, Floats

UPDATES = 100  # of the inverse kinematics, docs/method.md §2
DEVICE = "cpu"
SMALLEST_CHUNK = 256  # (arm, target) pairs; below it a thread costs more than it brings


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
    wp, made = _ready(arms.dof)
    n, t = len(arms), len(targets)
    device_arms = _to_device(arms)
    device_targets = wp.array(np.ascontiguousarray(targets, dtype=np.float32), dtype=wp.vec3, device=DEVICE)
    q = wp.empty((n, t), dtype=made.joints, device=DEVICE)
    reached = wp.empty((n, t), dtype=wp.vec3, device=DEVICE)
    torque = wp.empty((n, t), dtype=made.joints, device=DEVICE)

    def launch(first: int, count: int) -> None:
        inputs = [device_arms, device_targets, updates, first, q, reached, torque]
        wp.launch(made.solve, dim=(count, t), inputs=inputs, device=DEVICE)

    chunks = _chunks(n, t)
    if len(chunks) == 1:
        launch(*chunks[0])
    else:
        for launched in [_pool().submit(launch, *chunk) for chunk in chunks]:
            launched.result()
    return Postures(q=q.numpy(), reached=reached.numpy(), torque=torque.numpy())


def update_once(arms: ArmArrays, targets: NDArray[np.float64], q: Floats, h_before: Floats) -> tuple[Floats, Floats]:
    """One update of the inverse kinematics from given angles; targets (N, 3), the rest (N, D)."""
    wp, made = _ready(arms.dof)
    arrays = [wp.array(np.float32(values), dtype=made.joints, device=DEVICE) for values in (q, h_before)]
    results = [wp.empty(len(arms), dtype=made.joints, device=DEVICE) for _ in range(2)]
    goals = wp.array(np.float32(targets), dtype=wp.vec3, device=DEVICE)
    wp.launch(made.update, dim=len(arms), inputs=[_to_device(arms), goals, *arrays, *results], device=DEVICE)
    return results[0].numpy(), results[1].numpy()


def _chunks(n: int, t: int) -> list[tuple[int, int]]:
    """(first, count) of the arms that each launch takes: some chunks a core, none too small."""
    size = max(-(-n // (4 * cores())), -(-SMALLEST_CHUNK // t))
    return [(first, min(size, n - first)) for first in range(0, n, size)]


def cores() -> int:
    """The processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), thread_name_prefix="armwright-kernels")


@cache
def _ready(dof: int) -> tuple[Any, Any]:
    """Warp and the kernels for `dof` joints, compiled and loaded, so that threads only launch."""
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with _silent_stderr():
        wp.init()
    from armwright.kinematics.kernels import kernels

    made = kernels(dof)
    made.solve.module.load(DEVICE)
    return wp, made


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
    on_device.base = wp.array(arms.base, dtype=wp.vec3, device=DEVICE)
    on_device.axis = wp.array(arms.axis, dtype=int, device=DEVICE)
    on_device.lower = wp.array(arms.lower, dtype=float, device=DEVICE)
    on_device.upper = wp.array(arms.upper, dtype=float, device=DEVICE)
    on_device.offset = wp.array(arms.offset, dtype=wp.vec3, device=DEVICE)
    on_device.com = wp.array(arms.com, dtype=wp.vec3, device=DEVICE)
    on_device.mass = wp.array(arms.mass, dtype=float, device=DEVICE)
    return on_device
