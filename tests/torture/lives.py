"""Kill commands at random moments and repeat them until they end, checking invariants.

A scenario is a command; the same command never killed is its reference. A kill falls at a random time after the command
has begun, up to the time that the reference took, so into its search or into what comes after (results, page, figures);
some fall into the start of the process. When a command ends by itself, what it left is compared with the reference, and
the next one begins anew.
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

from tests.support.run_locks import is_held

LOOK_SECONDS = 0.003
AT_START = 0.15  # of the kills
MAX_KILLS = 12  # of one run
SIGNALS = {"INT": [signal.SIGINT], "INT INT": [signal.SIGINT] * 2, "TERM": [signal.SIGTERM]}


@dataclass(frozen=True)
class Scenario:
    """A command, and what must hold of a folder and of the reference's."""

    arguments: Callable[[Path], Sequence[str]]
    """Of the command, for a folder."""
    check: Callable[[Path, Path], None]
    """Must hold after each kill."""
    same: Callable[[Path, Path], None]
    """Must hold at the end."""
    program: Sequence[str] = ("-m", "armwright")
    victims: Sequence[str] = ("process",)
    """Who is killed: the process, one of its workers, or all at once; or what SIGNALS the process gets."""


class Command:
    """A command under way, its words in a file."""

    def __init__(self, scenario: Scenario, folder: Path) -> None:
        self.folder, self.words = folder, folder.with_name(f"{folder.name}.words")
        with self.words.open("wb") as words:
            arguments = [sys.executable, *scenario.program, *scenario.arguments(folder)]
            self.process = subprocess.Popen(
                arguments, stdin=subprocess.DEVNULL, stdout=words, stderr=words, start_new_session=True
            )

    def is_begun(self) -> bool:
        """Whether Python and its modules are loaded, and the work begins."""
        return self.words.stat().st_size > 0 or is_held(self.folder)

    def wait_for(self, reached: Callable[[], bool]) -> None:
        """Wait until then, or until the command ends."""
        while self.process.poll() is None and not reached():
            threading.Event().wait(LOOK_SECONDS)

    def wait_seconds(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        self.wait_for(lambda: time.monotonic() >= until)

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
                has_begun = self.process.wait() == 0  # and then gives the cell to another worker
                assert has_begun or "2 local workers could not be started" in self.words.read_text(encoding="utf-8")
                return True
        return False

    def ends_well(self) -> None:
        assert self.process.wait() == 0, self.words.read_text(encoding="utf-8")


def kill_often(scenario: Scenario, place: Path, kills: int, seed: str) -> Counter[str]:
    """So many kills in folders below `place`; how many of each victim, and how many runs came to their end."""
    chance = random.Random(seed)
    whole = place / "whole"
    command = Command(scenario, whole)  # never killed
    started = time.monotonic()
    command.wait_for(command.is_begun)
    begun = time.monotonic()
    command.ends_well()
    start, work = begun - started, time.monotonic() - begun
    fell: Counter[str] = Counter()
    while fell.total() - fell["ended"] < kills:
        folder = place / f"run{fell['ended']}"
        left = min(chance.randint(1, MAX_KILLS), kills - fell.total() + fell["ended"])
        is_killed = True
        while is_killed:
            command = Command(scenario, folder)
            victim = chance.choice(scenario.victims)
            if left and victim not in SIGNALS and chance.random() < AT_START:
                command.wait_seconds(chance.uniform(0.0, start))
            elif left:  # Python tells of signals in its own way while it begins
                command.wait_for(command.is_begun)
                command.wait_seconds(chance.uniform(0.0, work))
            is_killed = left > 0 and command.kill(victim)
            left -= 1
            if is_killed:
                fell[victim] += 1
                scenario.check(folder, whole)
            else:
                command.ends_well()
            assert "Traceback" not in command.words.read_text(encoding="utf-8")
        scenario.same(folder, whole)
        fell["ended"] += 1
    return fell
