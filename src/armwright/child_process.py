"""Start processes that run modules of this package."""

import os
import subprocess
import sys
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any


def start_module(module: str, *arguments: object, **options: Any) -> subprocess.Popen[Any]:
    """Start `python -m MODULE` with the module path of this process, in a session of its own.

    It imports nothing from the working folder, which may hold somebody else's files (`-P`), and Ctrl-C in the terminal
    does not reach it. The options are those of `subprocess.Popen`; `env` holds variables besides those of this process.
    """
    command = [sys.executable, "-P", "-m", module, *map(str, arguments)]
    path = os.pathsep.join(filter(None, sys.path))
    environment = {**os.environ, "PYTHONPATH": path, **options.pop("env", {})}
    return subprocess.Popen(command, env=environment, start_new_session=True, **options)


def start_connected(module: str, **options: Any) -> tuple[subprocess.Popen[Any], "Connection[Any, Any]"]:
    """Start a module whose argument is the number of a file that connects it to this process; return our end, too."""
    ours, theirs = Pipe()
    with theirs:
        return start_module(module, theirs.fileno(), pass_fds=[theirs.fileno()], **options), ours
