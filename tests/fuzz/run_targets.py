"""Fuzz the files of a run folder, and the recordings that are replayed."""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import armwright as aw
from armwright.exceptions import ArmwrightError
from armwright.runs.history import History
from tests.fuzz.problem_targets import a_problem
from tests.fuzz.target import DefectError, Target, any_of, folder
from tests.support.wire_formats import llm_proposer


@cache
def a_run() -> Path:
    """Return a small finished run with proposals of a scripted model, and its page."""
    from armwright.page.page import write_report
    from tests.support.chat_server import ChatServer, designer

    there = folder() / "run"
    with ChatServer() as server:
        server.answer = designer
        proposer = llm_proposer(server.url, memory="chat", origin="scripted")
        aw.optimize(a_problem(), proposer=proposer, n_init=3, n_step=2, n_total=4, out=there)
    write_report(there)
    (there / "existing_arms.json").write_text(
        json.dumps(
            [
                {
                    "name": "ur3", "joints": 6, "reach": 0.5, "mass": 11.0, "base": [0.0, 0.0, 0.0],
                    "values": [1.0, 2.0],
                    "measures": {"torque": 2.0, "torque_utilisation": None}, "dominates": 1, "dominated_by": 0,
                    "violated": [], "notes": ["the tip is here"],
                }
            ]
        )
    , encoding="utf-8")  # fmt: skip
    hints = [{"id": 1, "text": "a SCARA arm"}, {"id": 2, "text": "lower"}]
    (there / "control.json").write_text(json.dumps({"paused": True, "stop": False, "hints": hints}), encoding="utf-8")
    return there


@contextmanager
def damaged(name: str, data: bytes) -> Iterator[Path]:
    """Yield a copy of the run folder in which a file has other content."""
    there = folder() / "damaged"
    if not there.exists():
        shutil.copytree(a_run(), there)
    (there / name).write_bytes(data)
    try:
        yield there
    finally:
        for changed_file in (name, "control.json", "status.json"):
            shutil.copyfile(a_run() / changed_file, there / changed_file)


def looked_at(there: Path) -> None:
    """Read a run folder in every way."""
    from armwright.experiments.compare_runs import compare_runs
    from armwright.experiments.run_list import list_runs
    from armwright.experiments.tables import markdown
    from armwright.page.content import RunContent
    from armwright.proof.export import export_design
    from armwright.proof.selection import pick_from
    from armwright.proposers.replay import ReplayProposer
    from armwright.runs.control import Channel, add_hint, read_control, read_status

    any_of(
        (
            lambda: json.dumps(list_runs([there])),
            lambda: pick_from(there, robust=True),
            lambda: export_design(there, None, "urdf"),
            lambda: RunContent(there).packed(),
            lambda: markdown(compare_runs(there), "runs", notes=()),
            lambda: replayed(ReplayProposer(there)),
            lambda: (read_control(there), read_status(there)),
            lambda: add_hint(there, "x"),
            lambda: Channel(there).begin(0),
        )
    )


def replayed(proposer: Any) -> None:
    """Use a recording as a replayed run does."""
    problem = a_problem()
    proposer.check()
    proposer.open(None)
    proposer.recorded_trials()
    proposer.summary()
    json.dumps(dict(proposer.settings()))
    trials = _trials()
    for n in (3, 5):
        history = History(problem, trials[:n], 3, problem.reference_point)
        try:
            proposer.unused(history)
            problem.arm(proposer.propose(history, 0, n).design)
        except ArmwrightError:
            if n == 5:
                raise


@cache
def _trials() -> Any:
    from armwright.runs.folder import read_run

    return read_run(a_run())[1].trials


def of_run(name: str) -> Target:
    form = {"yaml": "yaml", "jsonl": "jsonl", "json": "json"}[name.rpartition(".")[2]]

    def run(data: bytes) -> None:
        with damaged(name, data) as there:
            looked_at(there)

    return Target(form, lambda: [(a_run() / name).read_bytes()], run, heavy=True)


def run_replay(data: bytes) -> None:
    from armwright.proposers.replay import ReplayProposer

    place = folder() / "record"
    place.mkdir(exist_ok=True)
    (place / "config.yaml").write_bytes((a_run() / "config.yaml").read_bytes())
    (place / "transcripts.jsonl").write_bytes(data)
    replayed(ReplayProposer(place))


def replay_seeds() -> list[bytes]:
    return [(a_run() / "transcripts.jsonl").read_bytes()]


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
