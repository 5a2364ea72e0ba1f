"""Fuzz the files of a run folder and recordings that are replayed."""

import json
import shutil
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import armwright as aw
from armwright.exceptions import ArmwrightError
from armwright.runs.history import History
from tests.fuzz.problem_targets import a_problem
from tests.fuzz.target import DefectError, any_of, folder
from tests.support.chat_server import ChatServer
from tests.support.wire_formats import llm_proposer

EXISTING = {
    "name": "ur3", "joints": 6, "base": [0.0, 0.0, 0.0], "values": [1.0, 2.0],
    "facts": {
        "mass": {"label": "Mass", "unit": "kg", "explanation": "Of the arm.", "value": 11.0},
        "price": {"label": "Price", "unit": "USD", "explanation": "Of its parts.", "reason": "no actuators are named"},
    },
    "dominates": 1, "dominated_by": 0, "violated": [],
    "notes": ["the tip is here"],
}  # fmt: skip


@cache
def a_run() -> Path:
    """Return a small finished run with proposals of a scripted model, and its page."""
    from armwright.page.page import write_report

    there = folder() / "run"
    with ChatServer() as server:
        proposer = llm_proposer(server.url, memory="chat", origin="scripted")
        aw.optimize(a_problem(), proposer=proposer, n_init=3, n_step=2, n_total=4, out=there)
    write_report(there)
    (there / "existing_arms.json").write_text(json.dumps([EXISTING]), encoding="utf-8")
    return there


def copy_of_run(name: str) -> Path:
    """Return a folder for files of this process, at first a copy of the run."""
    there = folder() / name
    return there if there.exists() else Path(shutil.copytree(a_run(), there))


def seed_of_run(name: str) -> Callable[[], list[bytes]]:
    return lambda: [(a_run() / name).read_bytes()]


def of_run(name: str) -> Callable[[bytes], None]:
    """Return a target that reads a run folder in which this file has other content."""

    def run(data: bytes) -> None:
        there = copy_of_run("damaged")
        (there / name).write_bytes(data)
        try:
            looked_at(there)
        finally:
            shutil.copyfile(a_run() / name, there / name)

    return run


def looked_at(there: Path) -> None:
    """Read a run folder in every way."""
    from armwright.experiments.compare_runs import compare_runs
    from armwright.experiments.tables import markdown
    from armwright.page.content import RunContent
    from armwright.proof.export import export_design
    from armwright.proof.selection import pick_from
    from armwright.proposers.replay import ReplayProposer

    any_of(
        (
            lambda: pick_from(there, holds=True),
            lambda: export_design(there, None, "urdf"),
            lambda: RunContent(there).packed(),
            lambda: markdown(compare_runs(there), "runs", notes=()),
            lambda: replayed(ReplayProposer(there)),
        )
    )


def replayed(proposer: Any) -> None:
    """Use a recording as a replayed run does."""
    from armwright.runs.folder import read_run

    problem = a_problem()
    proposer.check()
    proposer.open(None)
    proposer.recorded_trials()
    proposer.summary()
    json.dumps(dict(proposer.settings()))
    trials = read_run(a_run())[1].trials
    for n in (3, 5):
        history = History(problem, trials[:n], 3, problem.reference_point)
        try:
            proposer.unused(history)
            problem.arm(proposer.propose(history, 0, n).design)
        except ArmwrightError:
            if n == 5:
                raise


def run_replay(data: bytes) -> None:
    from armwright.proposers.replay import ReplayProposer

    place = folder() / "record"
    place.mkdir(exist_ok=True)
    (place / "config.yaml").write_bytes((a_run() / "config.yaml").read_bytes())
    (place / "transcripts.jsonl").write_bytes(data)
    replayed(ReplayProposer(place))


def run_trials(data: bytes) -> None:
    """Read trials.jsonl as readers and a resumed run do."""
    from armwright.runs.folder import RunFolder, read_run

    place = folder() / "trials"
    if not place.exists():
        place.mkdir()
        shutil.copy(a_run() / "config.yaml", place)
    (place / "trials.jsonl").write_bytes(data)
    config, history = read_run(place)
    history.front, history.hypervolume
    with RunFolder(place) as run:
        if len(run.open_trials(config)) != len(history):
            raise DefectError("a resumed run has other trials than its readers")
