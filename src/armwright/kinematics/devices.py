"""Devices that the kernels run on, and Warp with the kernels loaded on them."""

import os
import threading
import time
from collections.abc import Callable, Generator, Hashable, Iterable, Sequence
from contextlib import contextmanager, nullcontext
from functools import cache
from importlib import import_module
from typing import Any, Literal, cast, get_args

from armwright.exceptions import SettingsError, did_you_mean
from armwright.kinematics.kernel_cache import init_warp, make_cache_writable, report_cache_errors

Device = Literal["cpu", "cuda"]


def resolve_device(name: str, many: bool) -> Device:
    """Return the device for "cpu", "cuda" or "auto", which is CUDA if there is a GPU and `many` designs.

    A GPU and a CPU give different bits, so a run resolves its device once.
    """
    if name == "auto":
        return "cuda" if many and _has_cuda() else "cpu"
    if name not in get_args(Device):
        allowed = ("auto", *get_args(Device))
        raise SettingsError(f'device = "{name}" is not one of {", ".join(allowed)}.{did_you_mean(name, allowed)}')
    if name == "cuda" and not _has_cuda():
        raise SettingsError('device = "cuda": no NVIDIA GPU with its driver found; try device = "cpu" or "auto"')
    return cast("Device", name)


def usable_device(device: Device) -> Device:
    """Return the device, or the CPU if it is missing: runs of another machine can be read, drawn and verified."""
    return "cpu" if device == "cuda" and not _has_cuda() else device


def cores() -> int:
    """Return the number of processor cores that this process may use, at most OMP_NUM_THREADS if that is set."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    limit = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()
    return min(available, int(limit)) if limit.isdecimal() and int(limit) > 0 else available


class Compilation:
    """Compilation of kernels by this process, which happens once per machine and version.

    Attributes:
        seconds: Wall-clock time spent so far [s].
        announce: Called before the first kernel compiles.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.announce: Callable[[], None] = lambda: None
        self._has_begun = False

    @contextmanager
    def timed(self) -> Generator[None]:
        """Add the time of this context, and announce the first one."""
        if not self._has_begun:
            self._has_begun = True
            self.announce()
        started = time.monotonic()
        try:
            yield
        finally:
            self.seconds += time.monotonic() - started


compilation = Compilation()
_loading = threading.Lock()


def find_cache() -> None:
    """Initialise Warp, which finds the folder of compiled kernels that processes started from here on share."""
    with _loading:
        _warp()


def load_kernels(name: str, device: Device, *variant: Hashable) -> tuple[Any, Any]:
    """Return Warp and one variant of kernels, compiled and loaded on a device, so that threads only launch.

    Args:
        name: A module of this package, such as `ik.ik_kernels`; its function of the same name makes the variant.
        device: Where they run.
        variant: The arguments of that function.
    """
    with _loading:
        return _warp(), _kernels(name, device, *variant)


def _has_cuda() -> bool:
    with _loading:
        return bool(_warp().is_cuda_available())


@cache
def _warp() -> Any:
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    with report_cache_errors():
        init_warp(wp)
    return wp


@cache
def _kernels(name: str, device: Device, *variant: Hashable) -> Any:
    with report_cache_errors():
        made = getattr(import_module(f"{__package__}.{name}"), name.rpartition(".")[2])(*variant)
        parts = cast("Iterable[Any]", vars(made).values())
        _load_modules([part.module for part in parts if hasattr(part, "adj")], device)  # those of kernels
    return made


def _load_modules(modules: Sequence[Any], device: Device) -> None:
    """Load modules of kernels on a device; compile those that are not in the cache."""
    # Warp launches with this size on the CPU. Modules of another size would have to be compiled again.
    block_dim = 1 if device == "cpu" else None
    warp = _warp()
    for module in modules:
        folder = os.path.join(str(warp.config.kernel_cache_dir), module.get_module_identifier(block_dim))
        is_cached = os.path.exists(folder)
        if not is_cached:
            make_cache_writable(warp)
        with nullcontext() if is_cached else compilation.timed():
            module.load(device, block_dim)
