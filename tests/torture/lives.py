"""Kill commands at random moments and repeat them until they end, checking invariants.

A scenario is a command; the same command never killed is its reference. A kill falls, by chance, into the start of the
process, into its search (at a random amount of work) or into what comes after (results, page, figures; at a random
time). When a command ends by itself, what it left is compared with the reference, and the next one begins anew.
"""

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

LOOK_SECONDS = 0.003
SHARES = {"start": 0.15, "search": 0.45, "results": 0.4}  # of the kills
MAX_KILLS = 12  # of one run
STRIDE = 0.25  # of the whole search, the most between two kills in it
SIGNALS = {"INT": [signal.SIGINT], "INT INT": [signal.SIGINT] * 2, "TERM": [signal.SIGTERM]}
COST = {"seconds", "call_seconds"}  # what differs between equal runs


@dataclass(frozen=True)
class Scenario:
    """arguments: the command for a folder. progress: from a folder to the share of the search that lies there, 0 to 1.

    check: what must hold after each kill, of a folder and the reference. same: what must hold at the end.
    program: what is begun with the arguments; the command line as it is, unless told otherwise.
    victims: who is killed: the process, one of its workers, or all at once; or what signals the process gets.
    is_begun: whether Python and its modules are loaded, and the work begins.
    """

    arguments: Callable[[Path], Sequence[str]]
    progress: Callable[[Path], float]
    check: Callable[[Path, Path], None]
    same: Callable[[Path, Path], None]
    program: Sequence[str] = ("-m", "armwright")
    victims: Sequence[str] = ("process",)
    is_begun: Callable[["Command"], bool] = lambda command: command.words.stat().st_size > 0
    environment: Mapping[str, str] = field(default_factory=dict)


@dataclass
class Command:
    """A command under way, its words in files."""

    scenario: Scenario
    folder: Path

    def __post_init__(self) -> None:
        self.words = self.folder.with_name(f"{self.folder.name}.words")
        with self.words.open("wb") as words:
            self.process = subprocess.Popen(
                [sys.executable, *self.scenario.program, *self.scenario.arguments(self.folder)],
                stdin=subprocess.DEVNULL,
                stdout=words,
                stderr=words,
                env={**os.environ, **self.scenario.environment},
                start_new_session=True,
            )

    @property
    def goes_on(self) -> bool:
        return self.process.poll() is None

    def wait_for(self, reached: Callable[[], bool]) -> bool:
        """Waits until then, or until the command ends; whether it still goes on."""
        while self.goes_on and not reached():
            threading.Event().wait(LOOK_SECONDS)
        return self.goes_on

    def wait_seconds(self, seconds: float) -> bool:
        """The same for a time."""
        until = time.monotonic() + seconds
        return self.wait_for(lambda: time.monotonic() >= until)

    def kill(self, victim: str) -> bool:
        """Kills one who lives: `process`, `worker` or `all`; whether there was one. A worker's command goes on.

        `INT`, `INT INT` and `TERM` are signals to the process in place of that.
        """
        if victim == "worker":
            workers = [c for c in _children(self.process.pid) if "spawn_main" in " ".join(_line(c))]
            if not workers:
                return False
            random.choice(workers).kill()
            return True
        if not self.goes_on:
            return False
        if victim in SIGNALS:
            for number in SIGNALS[victim]:
                self.process.send_signal(number)
                self.wait_seconds(random.uniform(0.0, 0.05))
            return self.process.wait() in (130, -signal.SIGINT, -signal.SIGTERM)
        if victim == "all":
            os.killpg(self.process.pid, signal.SIGKILL)
        else:
            self.process.kill()
        return self.process.wait() == -signal.SIGKILL

    def said(self) -> str:
        return self.words.read_text(encoding="utf-8")


def _children(pid: int) -> list[psutil.Process]:
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _line(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.NoSuchProcess:
        return []


@dataclass(frozen=True)
class Times:
    """How long the reference took [s]: until the first work lay on disk, and from the last of it to the end."""

    start: float
    results: float


def run_whole(scenario: Scenario, folder: Path) -> Times:
    """The reference: never killed."""
    began = time.monotonic()
    command = Command(scenario, folder)
    command.wait_for(lambda: scenario.progress(folder) > 0.0)
    first = time.monotonic()
    command.wait_for(lambda: scenario.progress(folder) >= 1.0)
    done = time.monotonic()
    assert command.process.wait() == 0, command.said()
    return Times(first - began, time.monotonic() - done)


def kill_often(scenario: Scenario, place: Path, kills: int, seed: str) -> Counter[str]:
    """So many kills in folders below `place`; how many fell into which part, and how many runs came to their end."""
    chance = random.Random(seed)
    whole = place / "whole"
    times = run_whole(scenario, whole)
    fell: Counter[str] = Counter()
    while fell.total() - fell["ended"] < kills:
        folder = place / f"run{fell['ended']}"
        left = min(chance.randint(1, MAX_KILLS), kills - fell.total() + fell["ended"])
        while True:
            command = Command(scenario, folder)
            landed = _kill_once(command, chance, times) if left else ""
            left -= 1
            if not landed:
                assert command.process.wait() == 0, command.said()
            assert "Traceback" not in command.said(), command.said()
            if not landed:
                break
            fell[landed] += 1
            scenario.check(folder, whole)
        scenario.same(folder, whole)
        fell["ended"] += 1
    return fell


def _kill_once(command: Command, chance: random.Random, times: Times) -> str:
    """Kills at a random moment, and again where a worker was killed; into which part it fell, empty for none."""
    scenario, folder = command.scenario, command.folder
    part = chance.choices(list(SHARES), list(SHARES.values()))[0]
    victim = chance.choice(scenario.victims)
    if part == "start" and victim not in SIGNALS:  # of which Python itself tells in its own way while it begins
        goes_on = command.wait_seconds(chance.uniform(0.0, times.start))
    elif part in ("start", "search"):
        goal = min(1.0, scenario.progress(folder) + (part == "search") * chance.uniform(0.0, STRIDE))
        goes_on = command.wait_for(lambda: scenario.is_begun(command) and scenario.progress(folder) >= goal)
        goes_on = goes_on and command.wait_seconds(chance.uniform(0.0, 0.02))
    else:
        goes_on = command.wait_for(lambda: scenario.is_begun(command) and scenario.progress(folder) >= 1.0)
        goes_on = goes_on and command.wait_seconds(chance.uniform(0.0, times.results))
    if not goes_on or not command.kill(victim):
        return ""
    if victim == "worker":
        command.process.wait()  # it gives the cell to another worker
        assert command.process.returncode == 0, command.said()
        return "worker"
    return part


# What lies in a folder.


def trials(folder: Path) -> list[dict[str, Any]]:
    """The whole lines of trials.jsonl, without what they cost."""
    file = folder / "trials.jsonl"
    content = file.read_bytes() if file.exists() else b""
    lines = content[: content.rfind(b"\n") + 1].splitlines()
    return [{key: value for key, value in json.loads(line).items() if key not in COST} for line in lines]


def n_lines(file: Path) -> int:
    try:
        return file.read_bytes().count(b"\n")
    except FileNotFoundError:
        return 0


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


def files(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}


def summary(folder: Path) -> Any:
    return without_cost(json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def without_cost(content: Any) -> Any:
    """Without seconds, however deep."""
    if isinstance(content, dict):
        return {key: without_cost(value) for key, value in content.items() if key not in COST}
    return content
