"""Short runs that tests watch and stop."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from armwright.llm.transcript import Call, Transcript
from armwright.problem.problem import Problem
from armwright.proposers.llm import LlmProposer
from armwright.proposers.proposer import Proposer
from armwright.study.front.search_budget import SearchProgress
from armwright.study.progress import Progress, StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import ChatServer
from tests.support.command_line import wait_until as wait_until
from tests.support.wire_formats import llm_proposer
from tests.torture.short import trials

PROBLEM = Problem(load_task("target-1"))
lines = trials
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 9, "seed": 2, "verify": False}


def run(out: Path | None, proposer: Proposer | str = "rules", **settings: Any) -> StudyResult:
    return optimize(PROBLEM, proposer=proposer, out=out, **{**SETTINGS, **settings})


def asks(server: ChatServer, **asking: Any) -> LlmProposer:
    return llm_proposer(server.url, **asking)


def calls(folder: Path) -> tuple[Call, ...]:
    return Transcript(folder / "transcripts.jsonl", read_only=True).calls


def after(number: int, act: Callable[[], object]) -> Callable[[Progress], None]:
    """Watches a study, and acts when this trial is finished."""

    def watch(progress: Progress) -> None:
        if progress.doing == "finished" and progress.number == number:
            act()

    return watch


def interrupt() -> None:
    raise KeyboardInterrupt


def cut(folder: Path, **kept: int) -> None:
    """Keep the first lines of a run's files, as a kill leaves them: cut(folder, trials=4)."""
    for name, n in kept.items():
        file = folder / f"{name}.jsonl"
        file.write_bytes(b"".join(file.read_bytes().splitlines(keepends=True)[:n]))


def interrupt_at(evaluations: int) -> Callable[[SearchProgress], None]:
    """Watches a direct search, and interrupts it after so many evaluations."""

    def watch(progress: SearchProgress) -> None:
        if progress.evaluations >= evaluations:
            interrupt()

    return watch
