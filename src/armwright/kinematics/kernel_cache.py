"""Where Warp keeps compiled kernels: the user's cache."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from armwright.exceptions import FailureError

PATH = "WARP_CACHE_PATH"  # environment variable of Warp


@contextmanager
def report_cache_errors() -> Generator[None]:
    """Turn an OSError inside the block into an error that says what to do."""
    try:
        yield
    except OSError as error:
        path = "" if error.filename is None else f": {error.filename}"
        raise FailureError(
            f"cannot write compiled kernels: {error.strerror or error}{path}; set {PATH} to a writable folder"
        ) from error


def init_warp(warp: Any) -> None:
    """Initialise Warp, which without a home would keep kernels in a folder `~` of the current one."""
    if PATH not in os.environ and not os.path.isabs(os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~"))):
        raise OSError("there is no home folder")
    with _silent_stderr():
        warp.init()


@contextmanager
def _silent_stderr() -> Generator[None]:
    """Drop what the process writes to stderr: Warp reports a missing NVIDIA driver there, whatever its log level."""
    try:
        stderr = os.dup(2)
    except OSError:  # stderr is closed: nothing to silence
        yield
        return
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, 2)
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(sink)
