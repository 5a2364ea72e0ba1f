"""Devices that the kernels run on, and Warp with the kernels loaded on them."""

import os
import threading
import time
from collections.abc import Callable, Generator, Hashable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from armwright.exceptions import SettingsError, did_you_mean
from armwright.kinematics.kernel_cache import init_warp, report_cache_errors

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
_all_loaded: set[Hashable] = set()  # by `load_all_kernels`


def find_cache() -> None:
    """Initialise Warp, which finds the folder of compiled kernels that processes started from here on share."""
    with _loading:
        _warp()


@dataclass(frozen=True, eq=False)
class Loaded:
    """Warp and one variant of kernels on a device."""

    warp: Any
    kernels: Any
    device: Device

    def array(self, values: NDArray[Any], dtype: Any) -> Any:
        """Return values on the device, which are copied only if they have to be."""
        scalar, inner, _ = _layout(self.warp, dtype)
        values = np.ascontiguousarray(values, dtype=scalar)
        shape = values.shape[: values.ndim - inner]
        return self.warp.array(values, dtype=dtype, shape=shape, device=self.device, copy=False)

    def empty(self, shape: tuple[int, ...], dtype: Any) -> Any:
        """Return an array on the device."""
        return self.warp.empty(shape, dtype=dtype, device=self.device)

    def struct(self, name: str, values: Mapping[str, Any]) -> Any:
        """Return a struct of the kernels on the device; values: by the names of its fields."""
        kind = getattr(self.kernels, name)
        packed, arrays = kind.ctype(), list[Any]()
        for field, value in values.items():
            array, given = self._described(value, kind.vars[field].type)
            arrays.append(array)
            setattr(packed, field, given)
        return _Packed(packed, arrays)

    def launch(self, name: str, dim: tuple[int, ...], *inputs: Any, outputs: Sequence[NDArray[Any]] = ()) -> None:
        """Run a kernel with `dim` threads and these inputs, of which numpy arrays are put on the device.

        outputs: contiguous arrays in the precision of its last arguments, to be filled with them.
        """
        kernel = getattr(self.kernels, name)
        arguments = zip((*inputs, *outputs), kernel.adj.args, strict=True)
        described = [self._described(value, argument.type) for value, argument in arguments]
        self.warp.launch(kernel, dim, inputs=[given for _, given in described], device=self.device)
        if self.device == "cuda":
            for values, (found, _) in zip(outputs, described[len(inputs) :], strict=True):
                values[...] = found.numpy()

    def _described(self, value: Any, kind: Any) -> tuple[Any, Any]:
        """Return a value, kept as long as a kernel may read it, and what a kernel or a struct takes for it.

        Warp takes a descriptor of an array as it is; on the CPU, making its own array would take three times as long.
        """
        if not isinstance(value, np.ndarray):
            return value, value.__ctype__() if isinstance(value, self.warp.array) else value
        if self.device == "cuda":
            array = self.array(cast("NDArray[Any]", value), kind.dtype)
            return array, array.__ctype__()
        scalar, inner, descriptor = _layout(self.warp, kind.dtype)
        values = np.ascontiguousarray(cast("NDArray[Any]", value), dtype=scalar)
        outer, address = values.ndim - inner, values.__array_interface__["data"][0]
        return values, descriptor(address, 0, outer, values.shape[:outer], values.strides[:outer])


class _Packed:
    """A struct as kernels take it, with the arrays that it points to."""

    def __init__(self, ctype: Any, arrays: Sequence[Any]) -> None:
        self._ctype, self._arrays = ctype, arrays

    def __ctype__(self) -> Any:
        return self._ctype


@cache
def _layout(warp: Any, dtype: Any) -> tuple[Any, int, Any]:
    """Return the numbers that an array of this type consists of, in how many dimensions, and Warp's descriptor."""
    descriptor = cast("Any", type(warp.array(dtype=dtype).__ctype__()))
    scalar = warp.dtype_to_numpy(getattr(dtype, "_wp_scalar_type_", dtype))
    return scalar, len(getattr(dtype, "_shape_", ())), descriptor


def load_kernels(name: str, device: Device, *variant: Hashable) -> Loaded:
    """Return one variant of kernels, compiled and loaded on a device, so that threads only launch.

    name: a module of this package, such as `ik.ik_kernels`; its function of the same name makes the variant from its
    arguments, `variant`.
    """
    with _loading:
        return _loaded(name, device, *variant)


def load_all_kernels(variants: Iterable[tuple[str, *tuple[Hashable, ...]]], device: Device) -> None:
    """Load variants of kernels, each as `load_kernels` takes it, so that nothing is left to compile later."""
    with _loading:
        missing = [variant for variant in variants if (variant, device) not in _all_loaded]
        if missing:
            _load_modules([_made(*variant) for variant in missing], device)
            _all_loaded.update((variant, device) for variant in missing)


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
def _loaded(name: str, device: Device, *variant: Hashable) -> Loaded:
    kernels = _made(name, *variant)
    _load_modules([kernels], device)
    return Loaded(_warp(), kernels, device)


@cache
def _made(name: str, *variant: Hashable) -> Any:
    """Return a variant of kernels, not loaded yet."""
    _warp()
    return getattr(import_module(f"{__package__}.{name}"), name.rpartition(".")[2])(*variant)


def _load_modules(variants: Sequence[Any], device: Device) -> None:
    """Load modules of kernels on a device; compile those that are not in the cache, side by side."""
    # Warp launches with this size on the CPU. Modules of another size would have to be compiled again.
    block_dim = 1 if device == "cpu" else None
    parts = [part for variant in variants for part in cast("Iterable[Any]", vars(variant).values())]
    modules = list({id(part.module): part.module for part in parts if hasattr(part, "adj")}.values())  # of kernels
    cache_folder = str(_warp().config.kernel_cache_dir)
    with report_cache_errors():
        folders = (os.path.join(cache_folder, module.get_module_identifier(block_dim)) for module in modules)
        is_cached = all(map(os.path.exists, folders))
        with nullcontext() if is_cached else compilation.timed(), ThreadPoolExecutor(cores()) as pool:
            for loading in [pool.submit(module.load, device, block_dim) for module in modules]:
                loading.result()
