"""Runs with `memory: chat`: what the server sees, resumption, the model's context, replay."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import optuna
import pytest

from armwright import (
    LlmProposer,
    ProposalCallback,
    ReplayProposer,
    StudyLlmProposer,
    optimize,
)
from armwright.llm.backend import CallError, Question, Turn
from armwright.llm.conversation import RESULTS, conversation, new_part
from armwright.llm.model_options import ModelOptions, PromptOptions
from armwright.llm.prompt import design_prompt
from armwright.llm.transcript import Call, Transcript
from armwright.study.progress import Progress, StudyResult
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, is_check, wants_design
from tests.support.controlled_runs import PROBLEM, cut
from tests.support.controlled_runs import run as short_run
from tests.support.manual_answers import impatient
from tests.support.model_faults import FAULTS, openai_error
from tests.support.wire_formats import llm_proposer, proposer

Message = dict[str, Any]

# As servers put it.
TOO_LONG: dict[str, Answer] = {
    "openai": FAULTS["context"]["context too long"]["openai"],
    "llama-server": openai_error(400, "the request exceeds the available context size", "exceed_context_size_error"),
    "lm-studio": (400, '{"error": "Trying to keep the first 9000 tokens when context length is only 4096"}'),
    "by status": (413, "{}"),
}


def thinker(request: Request) -> Answer:
    """Have one idea for each state of a conversation, and take the design from the idea."""
    if is_check(request):
        return json.dumps({"answer": "ready"})
    messages = request["messages"]
    if not wants_design(request):
        return f"<think>Hm.</think>It is idea {len(messages)}."
    idea = re.search(r"idea (\d+)", str(messages[-1]["content"]))
    n = int(idea[1]) if idea else len(messages)
    return json.dumps({**GOOD_DESIGN, "link_1": 0.1 + n / 1000})


@pytest.fixture
def server(chat_server: ChatServer) -> ChatServer:
    chat_server.answer = thinker
    return chat_server


def run(asked: Any, out: Path | None = None, seen: list[Progress] | None = None, **schedule: int) -> StudyResult:
    return short_run(out, asked, watch=None if seen is None else seen.append, **schedule)


def chat(server: ChatServer, **options: Any) -> LlmProposer:
    return llm_proposer(server.url, memory="chat", **options)


def conversations(server: ChatServer, first_step: Callable[[Request], bool]) -> list[list[Message]]:
    """The messages of each question about a trial."""
    return [request["messages"] for request in server.requests if not is_check(request) and first_step(request)]


def free(request: Request) -> bool:
    return not wants_design(request)


def content(messages: list[Message], role: str) -> list[str]:
    return [message["content"] for message in messages if message["role"] == role]


def test_each_question_continues_the_conversation(server: ChatServer, tmp_path: Path) -> None:
    run(chat(server), tmp_path / "run")
    sent = conversations(server, free)
    assert [[message["role"] for message in messages] for messages in sent] == [
        ["user"],
        ["user", "assistant", "user"],
        ["user", "assistant", "user", "assistant", "user"],
    ]
    assert sent[2][:3] == sent[1]  # the same beginning, which providers can cache
    first, second, third = content(sent[2], "user")
    assert "# Task" in first
    assert "4 designs have been evaluated" in first
    for later, number in ((second, 7), (third, 10)):
        assert later.startswith(f"{RESULTS}\n\n{number} designs have been evaluated")
        assert "TARGET = " not in later
        assert "Step 3" in later
    asked = [call for call in Transcript(tmp_path / "run" / "transcripts.jsonl").calls if call.step == "reasoning"]
    assert [call.prompt for call in asked] == [first, second, third]  # only what is new is recorded


def test_turns_hold_the_reasoning_and_the_values(server: ChatServer) -> None:
    run(chat(server))
    answers = content(conversations(server, free)[-1], "assistant")
    for answer, idea in zip(answers, (1, 3), strict=True):
        thoughts, values = answer.split("\n\n")
        assert thoughts == f"It is idea {idea}."  # without what it thought before
        assert json.loads(values)["link_1"] == pytest.approx(0.1 + idea / 1000)
    seconds = conversations(server, wants_design)
    assert [len(messages) for messages in seconds] == [1, 1, 1]  # second questions stand alone


@pytest.mark.parametrize("output", ["tool", "native", "prompted"])
@pytest.mark.parametrize("wire", ["openai", "anthropic"])
def test_one_step_answers_are_turns_in_every_output_mode(
    server: ChatServer, monkeypatch: pytest.MonkeyPatch, wire: str, output: str
) -> None:
    asked = proposer(wire, server, monkeypatch, memory="chat", answer="one-step", output=output)
    result = run(asked)
    assert [trial.source for trial in result.trials[4::3]] == ["llm"] * 3
    messages = [m for m in conversations(server, wants_design)[-1] if m["role"] != "system"]
    assert [message["role"] for message in messages] == ["user", "assistant", "user", "assistant", "user"]
    said = json.dumps(messages[1]["content"])
    assert "a universal shoulder at the centre" in said
    assert "tool" not in said
    assert result.summary["proposer"]["calls"] == 4


def test_anthropic_is_asked_to_cache_the_conversation(server: ChatServer, monkeypatch: pytest.MonkeyPatch) -> None:
    run(proposer("anthropic", server, monkeypatch, memory="chat"))
    run(proposer("anthropic", server, monkeypatch))
    cached = ["cache_control" in request for request in server.requests]
    assert cached == [False, *[True, False] * 3, *[False] * 7]  # check, then reasoning and values


@pytest.mark.parametrize(("kept_calls", "kept_trials"), [(1, 4), (2, 4), (3, 6), (5, 7), (6, 10)])
def test_killed_run_resumes_with_the_same_conversation(
    server: ChatServer, tmp_path: Path, kept_calls: int, kept_trials: int
) -> None:
    whole = run(chat(server), tmp_path / "run")
    sent = conversations(server, free)
    cut(tmp_path / "run", transcripts=kept_calls, trials=kept_trials)
    server.requests.clear()
    again = run(chat(server), tmp_path / "run")
    assert [trial.values for trial in again.trials] == [trial.values for trial in whole.trials]
    resumed = conversations(server, free)
    assert resumed == sent[len(sent) - len(resumed) :]
    assert len(resumed) == 3 - kept_calls // 2


def limited(turns: int, refusal: Answer) -> Callable[[Request], Answer]:
    """Refuse conversations of more turns than this before the question."""
    return lambda request: refusal if len(request["messages"]) > 2 * turns + 1 else thinker(request)


@pytest.mark.parametrize("refusal", TOO_LONG)
def test_refusal_of_a_long_prompt_is_recognised(server: ChatServer, refusal: str) -> None:
    server.answer = lambda request: TOO_LONG[refusal]
    with pytest.raises(CallError) as fault:
        chat(server).backend.ask(Question("llm-0004", "reasoning", "Which?"))
    assert fault.value.kind == "context"


def test_oldest_turns_are_dropped_beyond_the_context(server: ChatServer, tmp_path: Path) -> None:
    server.answer = limited(4, TOO_LONG["openai"])
    result = run(chat(server), tmp_path / "run", n_total=10, n_step=1)
    assert [trial.source for trial in result.trials[4:]] == ["llm"] * 10
    sent = conversations(server, free)
    users = [content(messages, "user") for messages in sent]
    first = users[0][0]
    asked = [own[-1] for own in users]
    # The sixth question has five turns before it: two of the older four go, the first stays.
    assert [len(messages) // 2 for messages in sent] == [0, 1, 2, 3, 4, 5, 3, 4, 5, 3, 4, 5, 3]
    assert {own[0] for own in users} == {first}
    assert users[6] == [first, asked[3], asked[4], asked[5]]
    assert result.summary["proposer"]["call_failures"] == {"context": 3}
    assert result.summary["proposer"]["failures"] == {}
    calls = Transcript(tmp_path / "run" / "transcripts.jsonl").calls
    # A replay fails and drops as the run did.
    again = run(ReplayProposer(tmp_path / "run"), tmp_path / "again", n_total=10, n_step=1)
    assert [trial.values for trial in again.trials] == [trial.values for trial in result.trials]
    assert again.summary["proposer"]["differing_prompts"] == 0
    assert again.summary["proposer"]["calls"] == result.summary["proposer"]["calls"]
    played = Transcript(tmp_path / "again" / "transcripts.jsonl").calls
    assert [(call.prompt, call.fault) for call in played] == [(call.prompt, call.fault) for call in calls]


@pytest.mark.parametrize(
    ("options", "n_total", "turns", "last"),
    [
        ({}, 12, [10, 5, 3, 2, 1], None),  # three tries, then the next question finds a shorter conversation
        ({"max_calls": 23}, 11, [10], "context"),  # 21 calls were made; after the check, one try is left
    ],
    ids=["requests", "budget"],
)
def test_dropping_stays_within_the_requests_of_a_question(
    server: ChatServer, tmp_path: Path, options: dict[str, int], n_total: int, turns: list[int], last: str | None
) -> None:
    run(chat(server), tmp_path / "run", n_total=10, n_step=1)
    server.requests.clear()
    server.answer = limited(1, TOO_LONG["openai"])
    result = run(chat(server, **options), tmp_path / "run", n_total=n_total, n_step=1)
    assert [len(messages) // 2 for messages in conversations(server, free)] == turns
    assert result.trials[14].fault == "context"
    assert result.trials[-1].fault == last


def test_failed_proposals_are_no_turns(server: ChatServer) -> None:
    def answer(request: Request) -> Answer:
        refused = json.dumps({**GOOD_DESIGN, "link_1": 9.9})
        return refused if wants_design(request) and len(server.requests) < 6 else thinker(request)

    server.answer = answer
    result = run(chat(server))
    assert [trial.fault for trial in result.trials[4::3]] == ["answer", None, None]
    sent = conversations(server, free)
    assert [len(messages) for messages in sent] == [1, 1, 3]
    assert all("# Task" in messages[0]["content"] for messages in sent)


def test_manual_questions_of_a_chat_contain_what_is_new(tmp_path: Path) -> None:
    line = "ORIGIN: (0, 0.01, {0})\nJOINTS: (Y, P, R, P)\nLINKS: (0.2, 0.2, 0.2, 0.2)\n"
    for number in (4, 7):
        with pytest.raises(KeyboardInterrupt):
            run(impatient(tmp_path / "ask", memory="chat"), tmp_path / "run")
        (tmp_path / "ask" / f"{number:03d}-answer.md").write_text(line.format(number / 100), encoding="utf-8")
    first, second = ((tmp_path / "ask" / f"{number:03d}-prompt.md").read_text(encoding="utf-8") for number in (4, 7))
    assert "# Task" in first
    assert second.startswith(RESULTS)


def test_built_in_prompts_change_below_their_results_only() -> None:
    history = optimize(PROBLEM, proposer="rules", n_init=5, n_total=20, seed=0).history
    for name in ("plus", "minus", "full"):
        early, late = (design_prompt(history.before(n), n, PromptOptions(prompt=name)) for n in (5, 25))
        assert early.count(f"\n{RESULTS}\n") == late.count(f"\n{RESULTS}\n") == 1
        part = new_part(late, (Turn(early, "so be it"),))
        assert part.startswith(f"{RESULTS}\n\n25 designs")
        assert late.endswith(part)


def test_prompt_that_describes_another_problem_is_sent_whole() -> None:
    asked = "TARGET = [1]\n# Results so far\n1", "# Results so far\n2", "TARGET = [2]\n# Results so far\n3"
    turns = [Turn(question, "so be it") for question in asked]
    latest = "TARGET = [2]\n# Results so far\n4"
    assert new_part(latest, turns[:2]) == latest
    assert new_part(latest, turns) == "# Results so far\n4"
    assert new_part("TARGET = [1]\n# Results so far\n5", turns) == "TARGET = [1]\n# Results so far\n5"
    assert new_part("No such heading", turns) == "No such heading"
    assert new_part(latest, ()) == latest


def test_conversation_of_a_repeated_question_holds_its_last_answer() -> None:
    def call(proposal: str, step: str, answer: str, **more: Any) -> Call:
        return Call(proposal, step, f"? {proposal}", answer=answer, origin="model", model="m", **more)

    calls = [
        call("", "check", "ready"),
        call("llm-0004", "answer", "one"),
        call("llm-0007", "answer", "lost", fault="cancelled"),
        call("llm-0007", "answer", "two"),
        call("llm-0007", "answer", "three"),
        call("llm-0010", "answer", "four"),
    ]
    assert [turn.answer for turn in conversation(calls)] == ["one", "three", "four"]
    assert conversation(calls, 10) == conversation(calls[:-1])  # as it was then


def test_forecast_of_input_grows_with_the_square(server: ChatServer, tmp_path: Path) -> None:
    def tokens(forecast: str) -> int:
        found = re.search(r"([\d,]+) tokens in", forecast)
        assert found is not None
        return int(found[1].replace(",", ""))

    def of(n: int, memory: str) -> int:
        return tokens(llm_proposer(server.url, memory=memory).forecast(PROBLEM, n))

    assert of(1, "chat") == of(1, "none")
    once, twice = (of(n, "chat") - of(n, "none") for n in (10, 20))
    assert 3.5 < twice / once < 4.5
    run(chat(server), tmp_path / "run")  # a resumed run forecasts the rest of its conversation
    seen: list[Progress] = []
    run(chat(server), tmp_path / "run", n_total=12, seen=seen)
    assert tokens(seen[0].note) > 2 * of(1, "chat")


def test_optuna_study_continues_its_conversation(chat_server: ChatServer, tmp_path: Path) -> None:
    def answer(request: Request) -> Answer:
        return json.dumps({"parameters": {"x": 0.5}, "reason": "why not"}) if wants_design(request) else "0.5"

    chat_server.answer = answer
    options = ModelOptions(model="m", base_url=chat_server.url, memory="chat")
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    callback = ProposalCallback(StudyLlmProposer(options, "A parabola."), every=5)
    study.optimize(lambda trial: trial.suggest_float("x", 0, 1) ** 2, n_trials=16, callbacks=[callback])
    sent = conversations(chat_server, free)
    assert [len(messages) for messages in sent] == [1, 3, 5]
    assert "A parabola." in sent[2][0]["content"]
    assert sent[2][-1]["content"].startswith(RESULTS)
