"""Chunks of arms: by threads on the CPU, one after another on a GPU."""

import os
import threading
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, partial

from armwright.exceptions import FailureError
from armwright.kinematics.devices import Device, cores

# Samples of paths per chunk: per thread on the CPU, per launch on a GPU.
SAMPLES: dict[Device, int] = {"cpu": 2**16, "cuda": 2**20}


def in_chunks(solve: Callable[[slice], None], n: int, size: int, device: Device) -> None:
    """Solve n arms in chunks of `size`; one chunk after another in a thread that itself solves a chunk."""
    if device == "cuda":
        _one_after_another(solve, n, size)
        return
    chunks = [slice(first, min(first + size, n)) for first in range(0, n, size)]
    if len(chunks) == 1 or threads() == 1:
        for chunk in chunks:
            solve(chunk)
    else:
        for running in [_pool().submit(solve, chunk) for chunk in chunks]:
            running.result()


def _one_after_another(solve: Callable[[slice], None], n: int, size: int) -> None:
    """Halve the chunks until they fit into the memory of the GPU."""
    first = 0
    while first < n:
        size = min(size, n - first)
        try:
            solve(slice(first, first + size))
        except RuntimeError as error:
            if "out of memory" not in str(error) and "Failed to allocate" not in str(error):
                raise
            if size == 1:
                raise FailureError(
                    "one arm at all its targets does not fit into the GPU's memory; "
                    'free some of it, solve fewer targets at a time, or use device = "cpu"'
                ) from error
            size //= 2
        else:
            first += size


_thread = threading.local()


def threads() -> int:
    """Return how many threads solve the chunks that this one needs."""
    return 1 if hasattr(_thread, "solves") else cores()


@contextmanager
def one_thread() -> Generator[None]:
    """Solve all chunks in this thread, since other processes use the other cores."""
    _thread.solves = True
    try:
        yield
    finally:
        del _thread.solves


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(cores(), "armwright-kernels", initializer=partial(setattr, _thread, "solves", True))


if hasattr(os, "register_at_fork"):  # a forked child has the pool's object, but not its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
