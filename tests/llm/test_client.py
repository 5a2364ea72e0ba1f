"""The language model proposer over HTTP, against a local server."""

from pathlib import Path
from typing import Any

import pytest
from pydantic_ai.models.openai import OpenAIChatModel

from armwright import LlmProposer, ModelOptions, StudyResult, optimize
from armwright.exceptions import ModelError, SettingsError
from armwright.llm.transcript import Transcript
from tests.support.chat_server import GOOD_DESIGN, ChatServer, designer
from tests.support.controlled_runs import PROBLEM, cut
from tests.support.controlled_runs import run as short_run
from tests.support.wire_formats import llm_proposer


def run(server: ChatServer, out: Path | None = None, n_total: int = 6, **options: Any) -> StudyResult:
    return short_run(out, llm_proposer(server.url, **options), n_total=n_total)


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
    assert (proposer["cost_usd"], proposer["flagged"]) == (None, False)


def test_invalid_transcript_answer_is_requested_again(chat_server: ChatServer, tmp_path: Path) -> None:
    whole = run(chat_server, tmp_path / "run", n_total=1)
    cut(tmp_path / "run", trials=4, transcripts=3)
    file = tmp_path / "run" / "transcripts.jsonl"
    file.write_text(file.read_text(encoding="utf-8").replace("0.2,", "9.9,"), encoding="utf-8")
    chat_server.requests.clear()
    assert [t.values for t in run(chat_server, tmp_path / "run", n_total=1).trials] == [t.values for t in whole.trials]
    assert len(chat_server.requests) == 2  # the check, and the parameters


@pytest.mark.parametrize("timeout", [20.0, 5000.0])
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


def test_folder_of_an_unreachable_model_accepts_another_proposer(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        optimize(PROBLEM, proposer=llm_proposer("http://127.0.0.1:9/v1", model="m"), n_total=1, out=tmp_path / "run")
    assert optimize(PROBLEM, proposer="rules", n_init=2, n_total=1, out=tmp_path / "run").trials[2].source == "rules"


def test_answer_with_invalid_unicode_is_recorded(chat_server: ChatServer, tmp_path: Path) -> None:
    """JSON can hold a lone surrogate, which UTF-8 cannot."""
    chat_server.answer = lambda request: designer(request) if "response_format" in request else "so \ud800 be it"
    result = run(chat_server, tmp_path / "run", n_total=1)
    assert result.trials[4].source == "llm"
    assert Transcript(tmp_path / "run" / "transcripts.jsonl").calls[1].answer == "so ? be it"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"model": "m", "base_url": "http://user:secret@127.0.0.1:9/v1"}, "ARMWRIGHT_API_KEY"),
        ({"model": "m", "base_url": "http://127.0.0.1:9/v1", "answer": "text"}, 'answer "text" is for manual answers'),
        ({"model": "openai-chat:gpt-4o"}, "OPENAI_API_KEY"),
        ({"model": "gpt-4o"}, "openai-chat:gpt-4o"),
        ({"model": "opnai:gpt-4o"}, "Unknown model"),
    ],
)
def test_options_without_a_usable_model_are_refused(options: dict[str, str], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        LlmProposer(ModelOptions(**options))  # type: ignore[arg-type]
