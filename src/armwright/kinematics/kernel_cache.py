"""Where Warp keeps compiled kernels: the user's cache, or a temporary folder if that cannot be written."""

import logging
import os
import stat
import tempfile
from collections.abc import Generator
from contextlib import contextmanager, suppress
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
    """Initialise Warp; use a temporary cache if the user has no folder for it."""
    if PATH not in os.environ and not os.path.isabs(os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~"))):
        _use_temporary_cache()
    try:
        with _silent_stderr():
            warp.init()
    except OSError:
        if PATH in os.environ:
            raise
        _use_temporary_cache()
        warp.config.kernel_cache_dir = None  # it comes from the environment now
        with _silent_stderr():
            warp.init()


def make_cache_writable(warp: Any) -> None:
    """Use a temporary cache for a new kernel if Warp's cannot be written and the user named none."""
    if PATH in os.environ or os.access(warp.config.kernel_cache_dir, os.W_OK):
        return
    warp.config.kernel_cache_dir = os.path.join(_use_temporary_cache(), warp.config.version)
    os.makedirs(warp.config.kernel_cache_dir, exist_ok=True)


def _use_temporary_cache() -> str:
    """Return a temporary folder for kernels, name it to processes that this one starts, and say so."""
    folder = os.environ[PATH] = _private_folder()
    logging.getLogger(__name__).warning(
        "compiled kernels are kept in %s, as your cache folder cannot be written; %s names another one", folder, PATH
    )
    return folder


def _private_folder() -> str:
    """Return a folder that later processes find again and no other user can write: kernels in it are executed."""
    folder = os.path.join(tempfile.gettempdir(), f"armwright-kernels-{os.getuid()}")
    with suppress(FileExistsError):
        os.mkdir(folder, 0o700)
    status = os.lstat(folder)
    is_private = stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o022
    return folder if is_private else tempfile.mkdtemp(prefix="armwright-kernels-")


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
