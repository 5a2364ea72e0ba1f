"""A short study on the command line for fault injection, also as an unprivileged user, and what it leaves behind."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.support import command_line

N_TRIALS = 25
SETTINGS: dict[str, Any] = {"proposer": "rules", "n_init": 5, "n_step": 4, "n_total": 20, "seed": 3}
ASKED = [word for key, value in SETTINGS.items() for word in (f"--{key.replace('_', '-')}", str(value))]
LEAST = ["setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner"]
COST = {"seconds", "call_seconds"}  # what differs between equal runs


def study(folder: Path, *more: str) -> list[str]:
    """The short study, without figures unless `more` says otherwise."""
    return ["optimize", "target-1", *ASKED, "--out", str(folder), *(more or ("--no-figures",))]


def command(arguments: Sequence[str | Path]) -> list[str]:
    return [sys.executable, "-m", "armwright", *map(str, arguments)]


def armwright(*arguments: str | Path, **how: Any) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, to its end."""
    return run(command(arguments), **how)


def run(
    arguments: Sequence[str], environment: Mapping[str, str | None] | None = None, **how: Any
) -> subprocess.CompletedProcess[str]:
    """environment: what differs from ours; None: not set."""
    said = {**os.environ, **(environment or {})}
    env = {name: value for name, value in said.items() if value is not None}
    return subprocess.run(
        arguments, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=env, encoding="utf-8", **how
    )


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


def trials(folder: Path) -> list[dict[str, Any]]:
    """The whole lines of trials.jsonl, without what they cost."""
    file = folder / "trials.jsonl"
    content = file.read_bytes() if file.exists() else b""
    lines = content[: content.rfind(b"\n") + 1].splitlines()
    return [{key: value for key, value in json.loads(line).items() if key not in COST} for line in lines]


def n_lines(file: Path) -> int:
    return file.read_bytes().count(b"\n") if file.exists() else 0


def files(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}


def summary(folder: Path) -> Any:
    return _without_cost(json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def _without_cost(content: Any) -> Any:
    if isinstance(content, dict):
        return {key: _without_cost(value) for key, value in content.items() if key not in COST}
    return content


def is_beginning(folder: Path, whole: Path) -> None:
    """What lies there is the beginning of the reference: nothing doubled, nothing lost in between."""
    there = trials(folder)
    assert there == trials(whole)[: len(there)]


def is_same_run(folder: Path, whole: Path) -> None:
    """All files of a run are those of the reference, to the bit, but for what they cost; pictures by name."""
    assert trials(folder) == trials(whole)
    names = files(folder)
    assert names - {Path("transcripts.jsonl")} == files(whole) - {Path("transcripts.jsonl")}
    for name in names:
        if name.suffix in (".csv", ".urdf") or name.name == "design.json":
            assert (folder / name).read_bytes() == (whole / name).read_bytes(), name
    assert summary(folder) == summary(whole)


def is_resumed(folder: Path, whole: Path, *more: str) -> None:
    """The trials there are the reference's first ones, and the same command, in this process, completes the run."""
    is_beginning(folder, whole)
    done = command_line.armwright(*study(folder, *more))
    assert (done.returncode, done.stderr) == (0, "")
    is_same_run(folder, whole)
