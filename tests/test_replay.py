"""A recorded run played again: equal to the bit, without a network."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from armwright.exceptions import ReplayError, SettingsError
from armwright.llm.transcript import Transcript
from armwright.problem import Problem
from armwright.proposers.choice import Wishes, choose_proposer
from armwright.proposers.llm import LlmProposer
from armwright.proposers.replay import ReplayProposer
from armwright.study import Progress, Run, optimize
from armwright.task import load_task
from tests.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer

PROBLEM = Problem(load_task("target-1"))
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 12, "seed": 1}


@pytest.fixture
def varied(chat_server: ChatServer) -> ChatServer:
    """Every answer is another design."""

    def answer(request: Request) -> Answer:
        if "response_format" not in request:
            return designer(request)
        n = len(chat_server.requests)
        return json.dumps(
            {**GOOD_DESIGN, "link_1": 0.1 + 0.001 * n, "expected_position_error": 1, "expected_torque": 2}
        )

    chat_server.answer = answer
    return chat_server


def recorded(server: ChatServer, out: Path, asking: dict[str, Any] | None = None, **settings: Any) -> Run:
    proposer = LlmProposer("test-model", server.url, **(asking or {}), origin="scripted")
    return optimize(PROBLEM, proposer=proposer, out=out, **{**SETTINGS, **settings})


def lines(folder: Path) -> list[dict[str, Any]]:
    trials = (folder / "trials.jsonl").read_text().splitlines()
    return [{key: value for key, value in json.loads(line).items() if key != "seconds"} for line in trials]


@pytest.mark.parametrize("asking", [{}, {"memory": "own", "prompt": "minus"}, {"answer": "one-step"}])
def test_a_replay_equals_its_record_to_the_bit(varied: ChatServer, tmp_path: Path, asking: dict[str, Any]) -> None:
    first = recorded(varied, tmp_path / "first", asking)
    varied.requests.clear()
    again = optimize(
        PROBLEM, proposer=ReplayProposer(tmp_path / "first", strict=True), out=tmp_path / "again", **SETTINGS
    )
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    assert not varied.requests
    # the account is the recorded one, and the origin stays what it was
    proposer = again.summary["proposer"]
    assert {key: proposer[key] for key in ("name", "calls", "tokens", "origin")} == {
        key: first.summary["proposer"][key] for key in ("name", "calls", "tokens", "origin")
    }
    assert (proposer["origin"], proposer["replay"], proposer["differing_prompts"]) == (
        "scripted", str(tmp_path / "first"), 0,
    )  # fmt: skip
    # and so a replay can be replayed
    third = optimize(
        PROBLEM, proposer=ReplayProposer(tmp_path / "again", strict=True), out=tmp_path / "third", **SETTINGS
    )
    assert lines(tmp_path / "third") == lines(tmp_path / "first")
    assert third.summary["proposer"]["calls"] == proposer["calls"]


def test_an_overlapped_run_is_replayed_with_its_arrivals(varied: ChatServer, tmp_path: Path) -> None:
    recorded(varied, tmp_path / "first", {"memory": "own"}, in_flight=2)
    optimize(PROBLEM, proposer=ReplayProposer(tmp_path / "first", strict=True), out=tmp_path / "again", **SETTINGS)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")


def test_failures_are_replayed_too(varied: ChatServer, tmp_path: Path) -> None:
    good = varied.answer
    varied.answer = lambda request: good(request) if len(varied.requests) not in (4, 5) else (400, "{}")
    run = recorded(varied, tmp_path / "first")
    assert sum(trial.fault is not None for trial in run.trials) == 2
    again = optimize(PROBLEM, proposer=ReplayProposer(tmp_path / "first"), out=tmp_path / "again", **SETTINGS)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    assert again.summary["proposer"]["failures"] == run.summary["proposer"]["failures"]


def test_a_spent_budget_is_replayed_too(varied: ChatServer, tmp_path: Path) -> None:
    recorded(varied, tmp_path / "first", {"max_calls": 5})
    optimize(PROBLEM, proposer=ReplayProposer(tmp_path / "first"), out=tmp_path / "again", **SETTINGS)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")


@pytest.mark.parametrize("stop", [4, 6, 10])
def test_a_replay_that_was_stopped_goes_on(varied: ChatServer, tmp_path: Path, stop: int) -> None:
    recorded(varied, tmp_path / "first")

    def interrupt(progress: Progress) -> None:
        if progress.doing == "finished" and progress.number == stop:
            raise KeyboardInterrupt

    for watch in (interrupt, None):
        try:
            optimize(
                PROBLEM, proposer=ReplayProposer(tmp_path / "first"), out=tmp_path / "again", watch=watch, **SETTINGS
            )
        except KeyboardInterrupt:
            continue
    assert lines(tmp_path / "again") == lines(tmp_path / "first")


def test_a_transcript_alone_is_enough(varied: ChatServer, tmp_path: Path) -> None:
    recorded(varied, tmp_path / "first")
    alone = tmp_path / "alone.jsonl"
    shutil.copy(tmp_path / "first" / "transcripts.jsonl", alone)
    optimize(PROBLEM, proposer=ReplayProposer(alone, strict=True), out=tmp_path / "again", **SETTINGS)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")


def test_a_prompt_that_differs_is_reported_and_strictly_an_error(varied: ChatServer, tmp_path: Path) -> None:
    recorded(varied, tmp_path / "first")
    file = tmp_path / "first" / "transcripts.jsonl"
    file.write_text(file.read_text().replace("You are an expert", "You are a layman", 1))
    notes: list[str] = []
    proposer = ReplayProposer(tmp_path / "first")
    run = optimize(PROBLEM, proposer=proposer, **SETTINGS, watch=lambda progress: notes.append(progress.note))
    assert [note for note in notes if note] == ["the prompt for scripted-0004 differs from the recorded one"]
    assert run.summary["proposer"]["differing_prompts"] == 1
    with pytest.raises(ReplayError, match="reasoning prompt for scripted-0004 differs"):
        optimize(PROBLEM, proposer=ReplayProposer(tmp_path / "first", strict=True), **SETTINGS)


def test_a_record_of_other_settings_is_said(varied: ChatServer, tmp_path: Path) -> None:
    """Proposals that were recorded for other trials are missing, each in words."""
    recorded(varied, tmp_path / "first")
    alone = tmp_path / "alone.jsonl"
    shutil.copy(tmp_path / "first" / "transcripts.jsonl", alone)
    notes: list[str] = []
    settings = {**SETTINGS, "n_init": 5}
    run = optimize(PROBLEM, proposer=ReplayProposer(alone), **settings, watch=lambda p: notes.append(p.note))
    assert run.trials[5].fault == "missing"
    assert "holds no proposal for trial 5, but for 4, 7, 10, 13; were n_init and n_step others?" in "".join(notes)
    assert run.summary["proposer"]["flagged"]


def test_what_cannot_be_replayed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="there is no"):
        ReplayProposer(tmp_path)
    (tmp_path / "transcripts.jsonl").write_text("")
    with pytest.raises(ReplayError, match="holds no proposal"):
        ReplayProposer(tmp_path)
    with pytest.raises(SettingsError, match="needs a run: replay:PATH"):
        choose_proposer(Wishes("replay:"))
    with pytest.raises(SettingsError, match="--replay-strict goes with"):
        choose_proposer(Wishes("rules", replay_strict=True))


def test_a_record_is_never_changed(varied: ChatServer, tmp_path: Path) -> None:
    """Not even its last line that a crash cut short."""
    recorded(varied, tmp_path / "first")
    file = tmp_path / "first" / "transcripts.jsonl"
    file.write_text(file.read_text() + '{"proposal": "llm-00')
    before = file.read_bytes()
    optimize(PROBLEM, proposer=ReplayProposer(tmp_path / "first"), **SETTINGS)
    assert file.read_bytes() == before
    assert len(Transcript(file, read_only=True).calls) == 9
