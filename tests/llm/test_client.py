"""The language model proposer over HTTP, against a local server."""

import json
from pathlib import Path
from typing import Any

import pytest
from pydantic_ai.models.openai import OpenAIChatModel

from armwright.exceptions import ModelError, SettingsError
from armwright.llm import client as chat
from armwright.llm.transcript import Transcript
from armwright.problem.problem import Problem
from armwright.proposers.llm import LlmProposer
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, Response, designer, wants_design
from tests.support.wire_formats import llm_proposer

PROBLEM = Problem(load_task("target-1"))


def run(server: ChatServer, out: Path | None = None, n_total: int = 6, **options: Any) -> StudyResult:
    proposer = llm_proposer(server.url, **options)
    return optimize(PROBLEM, proposer=proposer, n_init=4, n_step=3, n_total=n_total, seed=0, out=out, verify=False)


def test_first_trial_of_each_block_is_from_the_model(chat_server: ChatServer, tmp_path: Path) -> None:
    result = run(chat_server, tmp_path / "run")
    assert [trial.source for trial in result.trials] == ["random"] * 4 + ["llm", "bbo", "bbo"] * 2
    expected = {name: value for name, value in GOOD_DESIGN.items() if name != "reason"}
    assert dict(result.trials[4].design.params) == expected
    assert result.trials[4].proposal == "llm-0004"
    # one check, then two calls a proposal
    assert len(chat_server.requests) == 1 + 2 * 2
    proposer = result.summary["proposer"]
    assert (proposer["name"], proposer["model"], proposer["origin"]) == ("llm", "test-model", "model")
    assert (proposer["calls"], proposer["failures"], proposer["call_failures"]) == (5, {}, {})
    assert (proposer["tokens"], proposer["input_tokens"], proposer["output_tokens"]) == (5 * 120, 5 * 100, 5 * 20)
    assert (proposer["cost_usd"], proposer["flagged"], proposer["overlap"]) == (None, False, None)


def test_prompt_contains_problem_feedback_and_instructions(chat_server: ChatServer) -> None:
    result = run(chat_server, n_total=1)
    reasoning, parameters = chat_server.prompts()[1:3]
    assert "(-0.450, -0.450, -0.450)" in reasoning
    assert "4 designs have been evaluated" in reasoning
    for word in ("ORIGIN", "JOINTS", "LINKS", "E_EACH", "P_IK", "TAU_IK", "E_ALL", "step by step", "Step 2", "(5, 5)"):
        assert word in reasoning
    best = min(result.trials[:4], key=lambda trial: trial.values[0])
    assert f"E_ALL: ({best.values[0]:.3f}, {best.values[1]:.3f})" in reasoning
    assert "ORIGIN: (0, 0.01, -0.1), and so on." in parameters  # the first answer is the second call's material
    assert chat_server.requests[2]["response_format"]["type"] == "json_schema"
    assert not any("temperature" in request or "seed" in request for request in chat_server.requests)


def test_per_target_objectives_sum_to_the_total(chat_server: ChatServer) -> None:
    run(chat_server, n_total=1)
    block = chat_server.prompts()[1].split("\nDesign ")[1]
    lines = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line)
    each = eval(lines["E_EACH"])
    total = eval(lines["E_ALL"])
    assert [sum(row[i] for row in each) for i in (0, 1)] == pytest.approx(total, abs=8 * 0.0006)


def test_minus_prompt_omits_only_the_analysis(chat_server: ChatServer) -> None:
    run(chat_server, n_total=1)
    run(chat_server, n_total=1, prompt="minus")
    plus, minus = (prompt for prompt in chat_server.prompts() if "TARGET" in prompt)
    assert "Step 1" not in minus
    assert "Think step by step" in minus
    assert set(minus.splitlines()) <= set(plus.splitlines())


def test_refused_design_is_returned_with_the_reason(chat_server: ChatServer, tmp_path: Path) -> None:
    refused = {**GOOD_DESIGN, "link_3": 1.4}

    def answer(request: Request) -> Answer:
        if wants_design(request) and len(request["messages"]) == 1:
            return json.dumps(refused)
        return designer(request)

    chat_server.answer = answer
    result = run(chat_server, tmp_path / "run", n_total=1)
    assert result.trials[4].source == "llm"
    assert "link_3 = 1.4 m is outside 0.03 <= link_3 <= 0.3 m" in chat_server.prompts()[-1]
    assert Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1].requests == 2


@pytest.mark.parametrize(
    "wrong",
    ["no JSON at all", json.dumps({**GOOD_DESIGN, "joint_1": "Z"}), json.dumps({**GOOD_DESIGN, "origin_x": None}), ""],
)
def test_repeatedly_refused_answer_becomes_a_black_box_trial(
    chat_server: ChatServer, tmp_path: Path, wrong: str
) -> None:
    calls: list[Request] = []

    def answer(request: Request) -> Answer:
        if not wants_design(request):
            return designer(request)
        calls.append(request)
        return designer(request) if len(calls) == 1 else wrong

    chat_server.answer = answer
    result = run(chat_server, tmp_path / "run")
    assert [trial.source for trial in result.trials[4:]] == ["llm", "bbo", "bbo", "bbo", "bbo", "bbo"]
    assert result.trials[7].fault == "answer"
    assert result.summary["proposer"]["failures"] == {"answer": 1}
    assert len(calls) == 1 + 3  # asked again at most twice
    failed = Transcript(tmp_path / "run" / "transcripts.jsonl").calls[-1]
    assert (failed.answer, failed.requests) == (wrong, 3)
    assert failed.error is not None
    assert failed.error.startswith("test-model: ")
    assert failed.fault == "answer"


def test_response_without_choices_becomes_a_black_box_trial(chat_server: ChatServer) -> None:
    empty = '{"id": "1", "object": "chat.completion", "created": 1, "model": "m", "choices": []}'
    chat_server.answer = lambda request: designer(request) if len(chat_server.requests) <= 3 else (200, empty)
    result = run(chat_server)
    assert (result.trials[7].source, result.trials[7].fault) == ("bbo", "answer")


def test_invalid_transcript_answer_is_requested_again(chat_server: ChatServer, tmp_path: Path) -> None:
    whole = run(chat_server, tmp_path / "run", n_total=1)
    for name, lines in (("trials.jsonl", 4), ("transcripts.jsonl", 3)):
        file = tmp_path / "run" / name
        text = "".join(file.read_text(encoding="utf-8").splitlines(keepends=True)[:lines])
        file.write_text(text.replace("0.2,", "9.9,"), encoding="utf-8")
    chat_server.requests.clear()
    assert [t.values for t in run(chat_server, tmp_path / "run", n_total=1).trials] == [t.values for t in whole.trials]
    assert len(chat_server.requests) == 2  # the check, and the parameters


def test_later_server_error_does_not_stop_the_run(chat_server: ChatServer) -> None:
    def answer(request: Request) -> Answer:
        return designer(request) if len(chat_server.requests) <= 3 else (400, '{"error": {"message": "broken"}}')

    chat_server.answer = answer
    result = run(chat_server)
    assert result.trials[7].source == "bbo"
    assert result.summary["proposer"]["failures"] == {"rejected": 1}


def test_model_failure_before_the_first_trial_is_an_error(chat_server: ChatServer, tmp_path: Path) -> None:
    chat_server.answer = lambda request: (401, '{"error": {"message": "no such key"}}')
    with pytest.raises(ModelError, match=r"test-model: .*no such key"):
        run(chat_server, tmp_path / "run")
    assert (tmp_path / "run" / "trials.jsonl").read_text(encoding="utf-8") == ""


def test_unreachable_server_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chat, "RETRY_SECONDS", 0.0)
    proposer = llm_proposer("http://127.0.0.1:9/v1")
    with pytest.raises(ModelError, match="test-model"):
        optimize(PROBLEM, proposer=proposer, n_total=1)


def test_hanging_server_is_an_error(chat_server: ChatServer) -> None:
    chat_server.answer = lambda request: Response(pace="never")
    with pytest.raises(ModelError, match=r"test-model: .*0\.2"):
        run(chat_server, timeout=0.2)


@pytest.mark.parametrize("timeout", [20.0, 300.0, 5000.0])
def test_every_request_has_the_timeout_of_the_user(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, timeout: float
) -> None:
    """The check included, in which a local server loads its model; neither client nor library cut it short."""
    limits: list[tuple[float, float]] = []
    request = OpenAIChatModel.request

    async def noted(self: OpenAIChatModel, messages: Any, settings: Any, parameters: Any) -> Any:
        assert self.provider is not None
        limits.append((settings["request_timeout"], self.provider.client.timeout.read))
        return await request(self, messages, settings, parameters)

    monkeypatch.setattr(OpenAIChatModel, "request", noted)
    run(chat_server, n_total=1, timeout=timeout)
    assert [seconds for seconds, _ in limits] == [timeout] * 3
    assert all(read >= seconds for seconds, read in limits)


def test_paid_answers_are_not_requested_again(chat_server: ChatServer, tmp_path: Path) -> None:
    """After a kill between answer and trial, the recorded answer is used."""
    whole = run(chat_server, tmp_path / "whole")
    run(chat_server, tmp_path / "cut")
    trials = tmp_path / "cut" / "trials.jsonl"
    trials.write_text("".join(trials.read_text(encoding="utf-8").splitlines(keepends=True)[:7]), encoding="utf-8")
    chat_server.requests.clear()
    again = run(chat_server, tmp_path / "cut")
    assert [trial.values for trial in again.trials] == [trial.values for trial in whole.trials]
    assert [prompt.splitlines()[0] for prompt in chat_server.prompts()] == ["Answer with one word: ready"]


@pytest.mark.parametrize(("own", "sent"), [("own-planted-secret", "own-planted-secret"), (None, "no-key")])
def test_keys_of_other_hosts_are_never_sent_and_keys_never_written(
    chat_server: ChatServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: str | None, sent: str
) -> None:
    for name in ("OPENAI_API_KEY", "OPENAI_ORG_ID", "OPENAI_PROJECT_ID"):
        monkeypatch.setenv(name, "sk-planted-secret")
    if own is not None:
        monkeypatch.setenv("ARMWRIGHT_API_KEY", own)
    run(chat_server, tmp_path / "run", n_total=1)
    assert {headers["authorization"] for headers in chat_server.headers} == {f"Bearer {sent}"}
    assert not any("sk-planted" in value for headers in chat_server.headers for value in headers.values())
    written = [path.read_bytes() for path in (tmp_path / "run").rglob("*") if path.is_file()]
    assert written
    assert not any(b"planted-secret" in content for content in written)


def test_address_with_a_password_is_refused() -> None:
    with pytest.raises(SettingsError, match="ARMWRIGHT_API_KEY"):
        llm_proposer("http://user:secret@127.0.0.1:9/v1", model="m")


def test_finished_and_extended_runs_keep_their_usage(chat_server: ChatServer, tmp_path: Path) -> None:
    first = run(chat_server, tmp_path / "run", n_total=1)
    assert first.summary["proposer"]["calls"] == 3
    assert run(chat_server, tmp_path / "run", n_total=1).summary == first.summary
    longer = run(chat_server, tmp_path / "run", n_total=2)  # no proposal is due
    assert longer.summary["proposer"] == first.summary["proposer"]
    assert len(chat_server.requests) == 3


def test_folder_of_an_unreachable_model_accepts_another_proposer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chat, "RETRY_SECONDS", 0.0)
    with pytest.raises(ModelError):
        optimize(PROBLEM, proposer=llm_proposer("http://127.0.0.1:9/v1", model="m"), n_total=1, out=tmp_path / "run")
    assert optimize(PROBLEM, proposer="rules", n_init=2, n_total=1, out=tmp_path / "run").trials[2].source == "rules"


def test_answer_with_invalid_unicode_is_recorded(chat_server: ChatServer, tmp_path: Path) -> None:
    """JSON can hold a lone surrogate, which UTF-8 cannot."""
    chat_server.answer = lambda request: designer(request) if "response_format" in request else "so \ud800 be it"
    result = run(chat_server, tmp_path / "run", n_total=1)
    assert result.trials[4].source == "llm"
    assert Transcript(tmp_path / "run" / "transcripts.jsonl").calls[1].answer == "so ? be it"


def test_hosted_model_without_a_key_is_refused() -> None:
    with pytest.raises(SettingsError, match="OPENAI_API_KEY"):
        LlmProposer("openai-chat:gpt-4o")


@pytest.mark.parametrize(("model", "words"), [("gpt-4o", "openai-chat:gpt-4o"), ("opnai:gpt-4o", "Unknown model")])
def test_invalid_model_name_is_refused(model: str, words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        LlmProposer(model)


def test_text_answers_are_for_manual_use_only(chat_server: ChatServer) -> None:
    with pytest.raises(SettingsError, match='answer "text" is for manual answers; a model needs'):
        llm_proposer(chat_server.url, answer="text")


def test_unknown_prompt_name_is_refused(chat_server: ChatServer) -> None:
    with pytest.raises(SettingsError, match='Did you mean "plus"'):
        llm_proposer(chat_server.url, prompt="pluss")


def test_feedback_is_bounded_and_depends_only_on_the_seed(chat_server: ChatServer) -> None:
    proposer = llm_proposer(chat_server.url)
    history = optimize(PROBLEM, proposer="none", n_total=20).history
    prompts: list[str] = []
    for seed in (1, 1, 2):
        proposer.propose(history, seed, len(history))
        proposer.open(None)  # forgets the answer
        prompts.append([prompt for prompt in chat_server.prompts() if "TARGET" in prompt][-1])
    assert prompts[0] == prompts[1] != prompts[2]
    assert prompts[0].count("\nDesign ") == 10
