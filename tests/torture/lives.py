"""Kill commands at random moments and repeat them until they end, checking invariants.

A scenario is a command; the same command never killed is its reference. A kill falls, by chance, into the start of the
process, into its search (at a random amount of work) or into what comes after (results, page, figures; at a random
time). When a command ends by itself, what it left is compared with the reference, and the next one begins anew.
"""

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

LOOK_SECONDS = 0.003
SHARES = {"start": 0.15, "search": 0.45, "results": 0.4}  # of the kills
MAX_KILLS = 12  # of one run
STRIDE = 0.25  # of the whole search, the most between two kills in it
SIGNALS = {"INT": [signal.SIGINT], "INT INT": [signal.SIGINT] * 2, "TERM": [signal.SIGTERM]}


@dataclass(frozen=True)
class Scenario:
    """A command, and what must hold of a folder and of the reference's."""

    arguments: Callable[[Path], Sequence[str]]
    """Of the command, for a folder."""
    progress: Callable[[Path], float]
    """The share of the search that lies in a folder, 0 to 1."""
    check: Callable[[Path, Path], None]
    """Must hold after each kill."""
    same: Callable[[Path, Path], None]
    """Must hold at the end."""
    program: Sequence[str] = ("-m", "armwright")
    victims: Sequence[str] = ("process",)
    """Who is killed: the process, one of its workers, or all at once; or what SIGNALS the process gets."""
    is_begun: Callable[["Command"], bool] = lambda command: command.words.stat().st_size > 0
    """Whether Python and its modules are loaded, and the work begins."""


class Command:
    """A command under way, its words in a file."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        self.scenario, self.folder = scenario, folder
        self.words = folder.with_name(f"{folder.name}.words")
        with self.words.open("wb") as words:
            arguments = [sys.executable, *scenario.program, *scenario.arguments(folder)]
            self.process = subprocess.Popen(
                arguments, stdin=subprocess.DEVNULL, stdout=words, stderr=words, start_new_session=True
            )

    def wait_for(self, reached: Callable[[], bool]) -> bool:
        """Wait until then, or until the command ends; whether it still goes on."""
        while self.process.poll() is None and not reached():
            threading.Event().wait(LOOK_SECONDS)
        return self.process.poll() is None

    def wait_seconds(self, seconds: float) -> bool:
        until = time.monotonic() + seconds
        return self.wait_for(lambda: time.monotonic() >= until)

    def kill(self, victim: str) -> bool:
        """Kill one who lives; whether there was one. A worker's command goes on."""
        if self.process.poll() is not None:
            return False
        if victim == "worker":
            return self._kill_worker()
        if victim == "all":
            os.killpg(self.process.pid, signal.SIGKILL)
        for number in SIGNALS.get(victim, [signal.SIGKILL]):
            self.process.send_signal(number)
            if victim in SIGNALS:
                self.wait_seconds(random.uniform(0.0, 0.05))
        ends = (130, -signal.SIGINT, -signal.SIGTERM) if victim in SIGNALS else (-signal.SIGKILL,)
        return self.process.wait() in ends

    def _kill_worker(self) -> bool:
        with suppress(psutil.NoSuchProcess):
            children = psutil.Process(self.process.pid).children(recursive=True)
            workers = [child for child in children if "spawn_main" in " ".join(child.cmdline())]
            if workers:
                random.choice(workers).kill()
                return True
        return False

    def ends_well(self) -> None:
        assert self.process.wait() == 0, self.words.read_text(encoding="utf-8")


def kill_often(scenario: Scenario, place: Path, kills: int, seed: str) -> Counter[str]:
    """So many kills in folders below `place`; how many fell into which part, and how many runs came to their end."""
    chance = random.Random(seed)
    whole = place / "whole"
    began = time.monotonic()
    command = Command(scenario, whole)  # never killed
    command.wait_for(lambda: scenario.progress(whole) > 0.0)
    first = time.monotonic()
    command.wait_for(lambda: scenario.progress(whole) >= 1.0)
    done = time.monotonic()
    command.ends_well()
    times = {"start": first - began, "results": time.monotonic() - done}
    fell: Counter[str] = Counter()
    while fell.total() - fell["ended"] < kills:
        folder = place / f"run{fell['ended']}"
        left = min(chance.randint(1, MAX_KILLS), kills - fell.total() + fell["ended"])
        landed = "none yet"
        while landed:
            command = Command(scenario, folder)
            landed = _kill_once(command, chance, times) if left else ""
            left -= 1
            if landed:
                fell[landed] += 1
                scenario.check(folder, whole)
            else:
                command.ends_well()
            assert "Traceback" not in command.words.read_text(encoding="utf-8")
        scenario.same(folder, whole)
        fell["ended"] += 1
    return fell


def _kill_once(command: Command, chance: random.Random, times: dict[str, float]) -> str:
    """Kill at a random moment; into which part it fell, empty if the command was faster."""
    scenario, folder = command.scenario, command.folder
    part = chance.choices(list(SHARES), list(SHARES.values()))[0]
    victim = chance.choice(scenario.victims)
    if part == "start" and victim not in SIGNALS:  # of which Python itself tells in its own way while it begins
        goes_on = command.wait_seconds(chance.uniform(0.0, times["start"]))
    else:
        step = {"start": 0.0, "search": chance.uniform(0.0, STRIDE), "results": 1.0}[part]
        goal = min(1.0, scenario.progress(folder) + step)
        goes_on = command.wait_for(lambda: scenario.is_begun(command) and scenario.progress(folder) >= goal)
        goes_on = goes_on and command.wait_seconds(chance.uniform(0.0, times.get(part, 0.02)))
    if not goes_on or not command.kill(victim):
        return ""
    if victim == "worker":
        command.ends_well()  # it gives the cell to another worker
        return "worker"
    return part
