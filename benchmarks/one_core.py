"""Run a script on one core."""

import os
import subprocess
import sys
from collections.abc import Callable


def on_one_core(script: str, main: Callable[[], None], *arguments: str) -> None:
    """Run `main` of a script in a process of its own, which never had more threads than that."""
    if "--one-core" in sys.argv:
        main()
        return
    subprocess.run(
        [sys.executable, script, "--one-core", *arguments],
        check=True,
        preexec_fn=lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1]),
    )
