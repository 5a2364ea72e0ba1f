"""Replay of recorded runs: bit-identical and offline."""

import json
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from armwright import Problem, ReplayProposer, StudyResult, load_task, optimize
from armwright.exceptions import ReplayError, SettingsError
from armwright.llm.recording_file import read_recording
from armwright.llm.transcript import Transcript
from armwright.proposers import prompted
from armwright.proposers.factory import choose_proposer
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, designer
from tests.support.command_line import PATIENCE
from tests.support.controlled_runs import after, interrupt
from tests.support.wire_formats import llm_proposer

PROBLEM = Problem(load_task("target-1"))
SETTINGS: dict[str, Any] = {"n_init": 4, "n_step": 3, "n_total": 12, "seed": 1, "verify": False}


@pytest.fixture
def varied(chat_server: ChatServer) -> ChatServer:
    """Every answer is another design."""

    def answer(request: Request) -> Answer:
        if "response_format" not in request:
            return designer(request)
        n = len(chat_server.requests)
        return json.dumps({**GOOD_DESIGN, "link_1": 0.1 + 0.001 * n})

    chat_server.answer = answer
    return chat_server


def recorded(server: ChatServer, out: Path, asking: dict[str, Any] | None = None, **settings: Any) -> StudyResult:
    proposer = llm_proposer(server.url, origin="scripted", **asking or {})
    return optimize(PROBLEM, proposer=proposer, out=out, **{**SETTINGS, **settings})


def replayed(run: Path, out: Path | None = None, differing: int = 0, **settings: Any) -> StudyResult:
    again = optimize(PROBLEM, proposer=ReplayProposer(run), out=out, **{**SETTINGS, **settings})
    assert again.summary["proposer"]["differing_prompts"] == differing
    return again


def lines(folder: Path) -> list[dict[str, Any]]:
    trials = (folder / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    return [{key: value for key, value in json.loads(line).items() if key != "seconds"} for line in trials]


@pytest.mark.parametrize("asking", [{}, {"memory": "chat", "prompt": "minus"}, {"answer": "one-step"}])
def test_replay_equals_its_recording(varied: ChatServer, tmp_path: Path, asking: dict[str, Any]) -> None:
    first = recorded(varied, tmp_path / "first", asking)
    varied.requests.clear()
    again = replayed(tmp_path / "first", tmp_path / "again")
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    assert not varied.requests
    # the account is the recorded one, and the origin stays what it was
    own = again.summary["proposer"]
    told = first.summary["proposer"]
    assert all(own[key] == told[key] for key in ("name", "calls", "tokens", "origin"))
    assert (own["origin"], own["replay"], own["differing_prompts"]) == ("scripted", str(tmp_path / "first"), 0)
    # and so a replay can be replayed
    third = replayed(tmp_path / "again", tmp_path / "third")
    assert lines(tmp_path / "third") == lines(tmp_path / "first")
    assert third.summary["proposer"]["calls"] == own["calls"]


def test_late_answers_are_replayed_when_they_arrived(chat_server: ChatServer, tmp_path: Path) -> None:
    """The first two calls are answered only when five black-box trials have gone by."""
    late = threading.Event()
    designs = iter(PROBLEM.space.sample(50, 3))

    def answer(request: Request) -> Answer:
        if len(chat_server.requests) > 1:
            late.wait(PATIENCE)
        return json.dumps({**next(designs).params} if "response_format" in request else {"answer": "ready"})

    chat_server.answer = answer
    settings = {"n_total": 24, "in_flight": 4}
    run = recorded(chat_server, tmp_path / "first", {"answer": "one-step"}, watch=after(8, late.set), **settings)
    proposals = [trial for trial in run.trials if trial.proposal]
    assert len(proposals) == 8
    assert proposals[0].number - (proposals[0].feedback or 0) >= 5
    assert len({trial.asked or trial.number for trial in proposals}) == 8
    chat_server.requests.clear()
    replayed(tmp_path / "first", tmp_path / "again", **settings)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    assert not chat_server.requests


@pytest.mark.parametrize("asking", [{}, {"max_calls": 5}], ids=["faults", "budget"])
def test_failures_are_replayed(varied: ChatServer, tmp_path: Path, asking: dict[str, int]) -> None:
    good = varied.answer
    varied.answer = lambda request: good(request) if len(varied.requests) not in (4, 5) else (400, "{}")
    run = recorded(varied, tmp_path / "first", asking)
    assert sum(trial.fault is not None for trial in run.trials) == (3 if asking else 2)
    again = replayed(tmp_path / "first", tmp_path / "again")
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    assert again.summary["proposer"]["failures"] == run.summary["proposer"]["failures"]


@pytest.mark.parametrize("stop", [4, 6])
@pytest.mark.slow
def test_interrupted_replay_resumes(varied: ChatServer, tmp_path: Path, stop: int) -> None:
    """No recorded call is used twice."""
    first = recorded(varied, tmp_path / "first")
    for watch in (after(stop, interrupt), None):
        with suppress(KeyboardInterrupt):
            replayed(tmp_path / "first", tmp_path / "again", watch=watch)
    assert lines(tmp_path / "again") == lines(tmp_path / "first")
    played = [call for call in Transcript(tmp_path / "again" / "transcripts.jsonl").calls if call.proposal]
    assert len(played) == first.summary["proposer"]["calls"] - 1  # the check


def test_proposals_beyond_the_recording_are_missing(varied: ChatServer, tmp_path: Path) -> None:
    """They are counted and reported once, and the run is flagged."""
    recorded(varied, tmp_path / "first")
    notes: list[str] = []
    for n_total in (12, 20):
        again = replayed(
            tmp_path / "first", tmp_path / "again", n_total=n_total, watch=lambda progress: notes.append(progress.note)
        )
    assert lines(tmp_path / "again")[:16] == lines(tmp_path / "first")
    assert [trial.number for trial in again.trials if trial.fault == "missing"] == [16, 19, 22]
    assert [note for note in notes if note] == ["the record ends with trial 15"]
    assert again.summary["proposer"]["failures"] == {"missing": 3}
    assert again.summary["proposer"]["flagged"]


@pytest.mark.parametrize("in_flight", [None, 2])
def test_proposals_of_a_truncated_recording_are_missing(
    varied: ChatServer, tmp_path: Path, in_flight: int | None
) -> None:
    with pytest.raises(KeyboardInterrupt):
        recorded(varied, tmp_path / "first", watch=after(8, interrupt), in_flight=in_flight)
    there = len(lines(tmp_path / "first"))
    again = replayed(tmp_path / "first", tmp_path / "again")
    assert lines(tmp_path / "again")[:there] == lines(tmp_path / "first")
    turns = [trial for trial in again.trials if trial.proposal or trial.fault]
    assert len(turns) == 4
    assert {trial.fault for trial in turns if trial.number >= there} == {"missing"}


def test_differing_prompt_is_reported(varied: ChatServer, tmp_path: Path) -> None:
    recorded(varied, tmp_path / "first")
    file = tmp_path / "first" / "transcripts.jsonl"
    file.write_text(
        file.read_text(encoding="utf-8").replace("You are an expert", "You are a layman", 1), encoding="utf-8"
    )
    notes: list[str] = []
    replayed(tmp_path / "first", differing=1, watch=lambda progress: notes.append(progress.note))
    assert [note for note in notes if note] == ["the prompt for scripted-0004 differs from the recorded one"]


def test_recording_with_other_settings_is_reported(varied: ChatServer, tmp_path: Path) -> None:
    """Proposals recorded for other trials are missing, with a reason."""
    recorded(varied, tmp_path / "first")
    (tmp_path / "first" / "trials.jsonl").unlink()
    notes: list[str] = []
    run = replayed(tmp_path / "first", n_init=5, watch=lambda progress: notes.append(progress.note))
    assert run.trials[5].fault == "missing"
    assert "holds no proposal for trial 5; check n_init and n_step" in "".join(notes)
    assert run.summary["proposer"]["flagged"]


def test_invalid_recordings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="there is no"):
        ReplayProposer(tmp_path)
    optimize(PROBLEM, proposer="none", out=tmp_path / "run", n_init=1, n_total=1, verify=False)
    (tmp_path / "run" / "transcripts.jsonl").write_text("", encoding="utf-8")
    with pytest.raises(ReplayError, match="holds no proposal"):
        ReplayProposer(tmp_path / "run")
    with pytest.raises(SettingsError, match="needs a run: replay:PATH"):
        choose_proposer("replay:")


def test_recording_is_never_changed(varied: ChatServer, tmp_path: Path) -> None:
    """Not even a truncated last line is changed."""
    recorded(varied, tmp_path / "first")
    file = tmp_path / "first" / "transcripts.jsonl"
    file.write_text(file.read_text(encoding="utf-8") + '{"proposal": "llm-00', encoding="utf-8")
    before = file.read_bytes()
    replayed(tmp_path / "first")
    assert file.read_bytes() == before
    assert len(Transcript(file, read_only=True).calls) == 9


# Shipped recordings of a real model


@pytest.mark.slow
def test_shipped_recording_reaches_its_recorded_hypervolume() -> None:
    """Rounding differs between processors, so other black-box designs may be drawn; the model's stay the same."""
    name, mean, last = "target-2-plus-n5-seed0", 19.35, 20.36
    recording = read_recording(name)
    study = recording.config.study
    schedule = {"n_init": study.n_init, "n_step": study.n_step, "n_total": study.n_total}
    settings = {**schedule, "seed": recording.config.seed, "verify": False}
    run = optimize(recording.config.problem, proposer=ReplayProposer(name), **settings)
    proposed = [trial for trial in run.trials if trial.source == "llm"]
    assert [trial.proposal for trial in proposed] == [call.proposal for call in recording.calls]
    assert all(trial.reason for trial in proposed)
    assert float(run.hypervolume.mean()) == pytest.approx(mean, rel=0.03)
    assert float(run.hypervolume[-1]) == pytest.approx(last, rel=0.03)
    assert run.summary["proposer"]["calls"] == len(proposed)


def test_prompts_of_a_recording_are_shown_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(prompted, "design_prompt")  # today's templates are not used
    recording = read_recording("target-1-plus-seed0")
    # With another seed, the prompts would differ from the recorded ones.
    settings = {**SETTINGS, "n_init": 10, "n_step": 10}
    run = optimize(PROBLEM, proposer=ReplayProposer("target-1-plus-seed0"), out=tmp_path / "run", **settings)
    calls = Transcript(tmp_path / "run/transcripts.jsonl").calls
    assert [(call.prompt, call.answer) for call in calls] == [
        (c.prompt, c.answer) for c in recording.calls[: len(calls)]
    ]
    assert len(calls) == sum(trial.source == "llm" for trial in run.trials) == 2


def test_unknown_recording_is_refused_with_a_suggestion() -> None:
    with pytest.raises(ReplayError, match="Did you mean"):
        choose_proposer("replay:target-1-plus-seed9")
