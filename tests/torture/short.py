"""A short study on the command line for fault injection, also as an unprivileged user."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

N_TRIALS = 25
ASKED = (
    "optimize",
    "target-1",
    "--proposer",
    "rules",
    "--n-init",
    "5",
    "--n-step",
    "4",
    "--n-total",
    "20",
    "--seed",
    "3",
)
LEAST = ["setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner"]


def command(folder: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "armwright", *ASKED, "--out", str(folder), *more]


def armwright(*arguments: str | Path, **how: Any) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, to its end."""
    whole = [sys.executable, "-m", "armwright", *map(str, arguments)]
    return run(whole, **how)


def study(folder: Path, *more: str, **how: Any) -> subprocess.CompletedProcess[str]:
    """The short study, without figures unless `more` asks for them."""
    return run(command(folder, *(more or ("--no-figures",))), **how)


def run(
    arguments: Sequence[str], environment: Mapping[str, str | None] | None = None, **how: Any
) -> subprocess.CompletedProcess[str]:
    """environment: what differs from ours; None: not set."""
    said = {**os.environ, **(environment or {})}
    env = {name: value for name, value in said.items() if value is not None}
    return subprocess.run(arguments, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=env, **how)


def one_line(done: subprocess.CompletedProcess[str], code: int = 1) -> str:
    """The one line of an error; never a traceback."""
    assert done.returncode == code, done.stdout + done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("armwright: "), line
    return line


def as_a_plain_user(arguments: Sequence[str]) -> list[str]:
    """The same command, for whom modes of files count: root may do what they forbid."""
    if os.geteuid() != 0:
        return list(arguments)
    assert shutil.which("setpriv"), "as root, setpriv is needed (package util-linux)"
    return [*LEAST, *arguments]
