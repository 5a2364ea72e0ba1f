"""Where the kernels run: the device that a name stands for, and Warp with one variant loaded on it."""

import os
import threading
from collections.abc import Generator
from contextlib import contextmanager
from functools import cache
from typing import Any, Literal, cast, get_args

from armwright.exceptions import FailureError, SettingsError, did_you_mean
from armwright.kinematics.arm_arrays import Motions, Precision, TargetKind

Device = Literal["cpu", "cuda"]


def resolve_device(name: str, many: bool) -> Device:
    """The device that "cpu", "cuda" or "auto" stands for; "auto" is CUDA where it is there and the work is `many`.

    A GPU and a CPU give different bits, so a run asks once and keeps to the answer.
    """
    if name == "auto":
        return "cuda" if many and _has_cuda() else "cpu"
    if name not in get_args(Device):
        allowed = ("auto", *get_args(Device))
        raise SettingsError(f'device = "{name}" is not one of {", ".join(allowed)}.{did_you_mean(name, allowed)}')
    if name == "cuda" and not _has_cuda():
        raise SettingsError('device = "cuda": no NVIDIA GPU with its driver is here; take device = "cpu" or "auto"')
    return cast("Device", name)


def usable_device(device: Device) -> Device:
    """The device, or the CPU where it is not here: a run of another machine can still be read, drawn and verified."""
    return "cpu" if device == "cuda" and not _has_cuda() else device


def cores() -> int:
    """The processor cores that this process may use; no more than OMP_NUM_THREADS, where that is set."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    wished = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    return min(there, int(wished)) if wished.isdecimal() and int(wished) > 0 else there


_loading = threading.Lock()


def load(precision: Precision, lanes: int, motions: Motions, kind: TargetKind, device: Device) -> tuple[Any, Any]:
    """Warp and one variant of the kernels, compiled and loaded on a device, so that threads only launch."""
    with _loading:
        return _warp(), _load(precision, lanes, motions, kind, device)


def load_clearance(precision: Precision, device: Device) -> tuple[Any, Any]:
    """Warp and one variant of the kernels of clearance, likewise."""
    with _loading:
        return _warp(), _load_clearance(precision, device)


def _has_cuda() -> bool:
    with _loading:
        return bool(_warp().is_cuda_available())


@cache
def _warp() -> Any:
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with _said_where_it_is_kept(), _silent_stderr():
        wp.init()
    return wp


@cache
def _load(precision: Precision, lanes: int, motions: Motions, kind: TargetKind, device: Device) -> Any:
    with _said_where_it_is_kept():
        from armwright.kinematics.pose_kernels import pose_kernels
        from armwright.kinematics.position_kernels import position_kernels

        make = {"position": position_kernels, "pose": pose_kernels}[kind]
        kernels = make(precision, lanes, motions)
        for kernel in (kernels.solve_ik, kernels.keep_pose, kernels.static_torque):
            if kernel is not None:
                kernel.module.load(device)
    return kernels


@cache
def _load_clearance(precision: Precision, device: Device) -> Any:
    with _said_where_it_is_kept():
        from armwright.kinematics.clearance_kernels import clearance_kernels_of

        kernels = clearance_kernels_of(precision)
        for kernel in (kernels.place, kernels.part, kernels.clear):
            kernel.module.load(device)
    return kernels


@contextmanager
def _said_where_it_is_kept() -> Generator[None]:
    try:
        yield
    except OSError as fault:
        where = "" if fault.filename is None else f": {fault.filename}"
        raise FailureError(
            f"the compiled kernels cannot be kept: {fault.strerror or fault}{where}; "
            "set WARP_CACHE_PATH to a folder that can be written"
        ) from fault


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
