"""Locks of run folders."""

import fcntl
from pathlib import Path


def is_held(folder: Path) -> bool:
    """Whether a process has locked a run folder for writing."""
    try:
        with (folder / ".lock").open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False
