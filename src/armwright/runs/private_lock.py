"""Locks of files that no other user can open: whoever can read a file can lock it, and so block a run."""

from contextlib import suppress
from pathlib import Path

from filelock import BaseFileLock, FileLock

OWNER_ONLY = 0o600


def private_lock(path: Path, timeout: float) -> BaseFileLock:
    """Return a lock to be acquired within `timeout` [s]; its file is closed to others, even if it was open to them."""
    with suppress(OSError):  # there is none yet, or it is another user's
        if not path.is_symlink():
            path.chmod(OWNER_ONLY)
    return FileLock(path, timeout=timeout, mode=OWNER_ONLY)
