"""Call and cost budgets of a run, and its forecast."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic_ai.messages import ModelResponse
from pydantic_ai.usage import RequestUsage

from armwright import LlmProposer, ModelOptions
from armwright.exceptions import ModelError, ProposalError
from armwright.llm.backend import FREE_TEXT, AskOptions, LlmBackend, OutputFormat, Question, Reply
from armwright.llm.prices import describe_cost
from armwright.llm.responses import cost_of
from armwright.llm.servers import server_of
from armwright.llm.session import LlmSession
from armwright.study.progress import Progress, StudyResult
from tests.support import wire_formats as wires
from tests.support.chat_server import Answer, ChatServer, Request, designer
from tests.support.controlled_runs import PROBLEM
from tests.support.controlled_runs import run as short_run
from tests.support.wire_formats import llm_proposer

NO_FORMAT = OutputFormat({}, str)


def run(
    proposer: LlmProposer, out: Path | None = None, seen: list[Progress] | None = None, **settings: Any
) -> StudyResult:
    watch = None if seen is None else seen.append
    return short_run(out, proposer, **{"n_total": 12, "watch": watch, **settings})


def notes(seen: list[Progress]) -> list[str]:
    return [progress.note for progress in seen if progress.note]


class Greedy(LlmBackend):
    """Takes all requests that it may, each for 0.1 USD."""

    def __init__(self, most: int = 3) -> None:
        super().__init__("greedy", "scripted")
        self.most = most
        self.requests = 0
        self.asking = threading.Event()
        self.go_on = threading.Event()
        self._lock = threading.Lock()

    def ask(self, question: Question, options: AskOptions = FREE_TEXT) -> Reply:
        taken = min(self.most, options.most_requests or self.most)
        with self._lock:
            self.requests += taken
        self.asking.set()
        self.go_on.wait()
        return Reply("so be it", taken, cost_usd=0.1 * taken)


class Session(LlmSession):
    """Asks from many threads at a time."""

    def ask_together(self, threads: int, before_answers: Callable[[], None]) -> list[ProposalError | str]:
        came: list[ProposalError | str] = []

        def ask() -> None:
            try:
                came.append(self._ask(Question("p-0001", "answer", "Which?"), NO_FORMAT))
            except ProposalError as fault:
                came.append(fault)

        asked = [threading.Thread(target=ask) for _ in range(threads)]
        for thread in asked:
            thread.start()
        assert isinstance(self.backend, Greedy)
        self.backend.asking.wait()
        before_answers()
        self.backend.go_on.set()
        for thread in asked:
            thread.join()
        return came


@pytest.mark.parametrize(("most", "proposals"), [(1, 0), (2, 0), (3, 1), (5, 2), (50, 4)])
@pytest.mark.fast_cases(3)
def test_max_calls_bounds_the_requests_of_a_run(chat_server: ChatServer, most: int, proposals: int) -> None:
    seen: list[Progress] = []
    result = run(llm_proposer(chat_server.url, model="m", max_calls=most), seen=seen)
    assert len(chat_server.requests) <= most
    assert sum(trial.source == "llm" for trial in result.trials) == proposals
    assert result.summary["proposer"]["failures"] == ({"budget": 4 - proposals} if proposals < 4 else {})
    assert sum("max_calls" in note for note in notes(seen)) == (proposals < 4)  # said once


def test_budget_includes_earlier_sessions(chat_server: ChatServer, tmp_path: Path) -> None:
    """A larger budget resumes the calls."""
    run(llm_proposer(chat_server.url, model="m", max_calls=5), tmp_path / "run", n_total=6)
    again = run(llm_proposer(chat_server.url, model="m", max_calls=6), tmp_path / "run", n_total=12)
    assert len(chat_server.requests) == 6
    assert [trial.fault for trial in again.trials[10:]] == ["budget", None, None, "budget", None, None]
    more = run(llm_proposer(chat_server.url, model="m", max_calls=50), tmp_path / "run", n_total=15)
    assert more.trials[16].source == "llm"


def test_forecast_includes_a_known_price(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-test-of-a-forecast")
    forecast = LlmProposer("openai-chat:gpt-4o").forecast(PROBLEM, 20)
    assert forecast.startswith("20 proposals: about 41 calls, ")
    assert "USD by public prices" in forecast
    half = LlmProposer(ModelOptions(model="openai-chat:gpt-4o", answer="one-step")).forecast(PROBLEM, 20)
    assert half.startswith("20 proposals: about 21 calls, ")


@pytest.mark.parametrize(
    ("model", "address", "words"),
    [
        ("qwen3", "http://192.168.0.7:8080/v1", "price unknown"),
        ("qwen3", "https://models.example.com/v1", "price unknown"),
        ("gpt-4o", "https://models.example.com/v1", "price unknown"),
        ("gpt-4o", "https://api.openai.com/v1", "about 12.50 USD by public prices"),
        ("openai-chat:gpt-4o", "https://api.openai.com/v1", "about 12.50 USD by public prices"),
        ("ollama:qwen3:8b", None, "price unknown"),
        ("openai-chat:gpt-4o", None, "about 12.50 USD by public prices"),
        ("openai-chat:a-model-of-tomorrow", None, "price unknown"),
    ],
)
def test_price_depends_on_the_host(model: str, address: str | None, words: str) -> None:
    assert describe_cost(ModelOptions(model=model, base_url=address), 1, 10**6, 10**6) == words
    server = server_of(ModelOptions(model=model, base_url=address))
    if server is not None:
        usage = RequestUsage(input_tokens=10**6, output_tokens=10**6)
        response = ModelResponse([], usage=usage, model_name=server.model, provider_url=address)
        assert cost_of(response, server) == (12.5 if "12.50" in words else None)


@pytest.mark.parametrize("wire", ["openai", "anthropic"])
def test_max_cost_bounds_the_requests_of_a_run(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, wire: str
) -> None:
    """The price is the public one of the tokens counted by the server; all calls cost the same here."""
    free = run(wires.proposer(wire, chat_server, monkeypatch), n_total=3).summary["proposer"]
    each = free["cost_usd"] / free["calls"]
    assert each > 0.0
    chat_server.requests.clear()
    seen: list[Progress] = []
    result = run(wires.proposer(wire, chat_server, monkeypatch, max_cost=5.5 * each), seen=seen)
    proposer = result.summary["proposer"]
    assert (proposer["calls"], len(chat_server.requests)) == (5, 5)
    assert proposer["cost_usd"] == pytest.approx(5 * each)
    assert proposer["failures"] == {"budget": 2}
    assert sum("max_cost" in progress.note for progress in seen) == 1


def test_max_cost_without_a_price_stops_after_the_check(chat_server: ChatServer) -> None:
    with pytest.raises(ModelError, match="max_cost cannot hold"):
        run(llm_proposer(chat_server.url, model="m", max_cost=1.0))
    assert len(chat_server.requests) == 1  # the check, which showed that there is no price


@pytest.mark.parametrize("most", [4, 9])
def test_refused_answers_in_flight_stay_within_the_budget(chat_server: ChatServer, most: int) -> None:
    def answer(request: Request) -> Answer:
        return "no design" if "response_format" in request else designer(request)

    chat_server.answer = answer
    run(llm_proposer(chat_server.url, model="m", answer="one-step", max_calls=most), n_total=24, in_flight=4)
    assert len(chat_server.requests) == most


@pytest.mark.parametrize("budget", [{"max_calls": 10}, {"max_cost": 1.05}])
@pytest.mark.parametrize("threads", [3, 4, 8])
def test_concurrent_calls_share_one_budget(budget: dict[str, Any], threads: int) -> None:
    backend = Greedy()
    came = Session(backend, "asking", ModelOptions(**budget)).ask_together(threads, lambda: None)
    assert backend.requests == min(10, 3 * threads)
    assert [fault.kind for fault in came if isinstance(fault, ProposalError)] == ["budget"] * max(0, threads - 4)


def test_cancel_releases_calls_waiting_for_budget() -> None:
    backend = Greedy()
    session = Session(backend, "asking", ModelOptions(max_calls=3))
    came = session.ask_together(4, session.cancel)
    assert backend.requests == 3
    assert [fault.kind for fault in came if isinstance(fault, ProposalError)] == ["cancelled"] * 3
