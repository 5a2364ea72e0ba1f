"""Servers that bend OpenAI's protocol: what is harmless is accepted, else one sentence says what is wrong."""

import gzip
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from armwright import LlmProposer, ModelOptions, Problem, load_task, optimize
from armwright.llm.backend import CHECK, CHECK_FORMAT, AskOptions, CallError, OutputFormat, Question, Reply
from armwright.llm.client import ModelClient
from armwright.llm.transport import MAX_RESPONSE
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, Response, completion, wants_design
from tests.support.wire_formats import environment

ANSWER = {"answer": "ready"}
QUESTION = Question("llm-0004", "answer", "Which?")
FORMAT = OutputFormat({"type": "object", "properties": {"answer": {"type": "string"}}}, json.dumps)
PROXY_PAGE = "<html><head><title>Sign in</title></head><body>to the <b>network</b></body></html>"
LEFT_OUT = object()

# Fields of a good completion that are other than OpenAI's, by the path to them.
HARMLESS: dict[str, dict[tuple[Any, ...], Any]] = {
    "empty finish reason": {("choices", 0, "finish_reason"): ""},
    "null finish reason": {("choices", 0, "finish_reason"): None},
    "unknown finish reason": {("choices", 0, "finish_reason"): "eos"},
    "number as finish reason": {("choices", 0, "finish_reason"): 3},
    "no finish reason": {("choices", 0, "finish_reason"): LEFT_OUT},
    "fractional time": {("created",): 1.5},
    "time as text": {("created",): "2026-01-01T00:00:00Z"},
    "nothing but choices": {(name,): LEFT_OUT for name in ("id", "object", "created", "model", "usage")},
    "numbers for names": {("id",): 7, ("model",): 5, ("object",): None},
    "null usage": {("usage",): None},
    "odd usage": {("usage",): {"prompt_tokens": "many", "completion_tokens": 2.0, "prompt_tokens_details": "none"}},
    "no role": {("choices", 0, "message", "role"): LEFT_OUT},
    "role of a bot": {("choices", 0, "message", "role"): "bot"},
    "no index": {("choices", 0, "index"): LEFT_OUT},
    "empty list of tool calls": {("choices", 0, "message", "tool_calls"): []},
    "null tool calls": {("choices", 0, "message", "tool_calls"): None},
    "list of parts": {("choices", 0, "message", "content"): [{"type": "text", "text": json.dumps(ANSWER)}]},
    "reasoning beside the answer": {("choices", 0, "message", "reasoning_content"): "Hm."},
    "unknown fields": {("x",): [1], ("choices", 0, "x"): {}, ("choices", 0, "message", "x"): None, ("error",): None},
    "other types of unused fields": {("service_tier",): 5, ("system_fingerprint",): 3, ("choices", 0, "logprobs"): "x"},
    "many choices": {("choices",): [completion(json.dumps(ANSWER), {})["choices"][0]] * 10_000},
}

# Responses without an answer, and what is said of them.
UNUSABLE: dict[str, tuple[Any, str]] = {
    "no choices": ({"choices": []}, 'answer: m: the response has no message: {"choices": []}'),
    "null choices": ({"choices": None}, 'answer: m: the response has no message: {"choices": null}'),
    "error": ({"error": {"message": "Model is busy", "code": "busy"}}, "answer: m: Model is busy"),
    "error as text": ({"error": "model not loaded"}, "answer: m: model not loaded"),
    "error beside choices": ({"error": {"message": "It broke"}, "choices": []}, "answer: m: It broke"),
    "error with a status": (
        {"error": {"message": "Provider returned error", "code": 502}},
        "server: m: Provider returned error (HTTP 502)",
    ),
    "rate limit": ({"error": {"message": "slow down", "code": "429"}}, "rate_limit: m: slow down (HTTP 429)"),
    "vLLM's error": ({"object": "error", "message": "bad thing", "code": 40301}, "answer: m: bad thing"),
    "FastAPI's error": ({"detail": "Not Found"}, "answer: m: Not Found"),
    "list": ([1], "answer: m: expected a JSON object, got [1]"),
    "HTML": (
        Response(PROXY_PAGE, content_type="text/html"),
        "answer: m: expected JSON, got text/html: Sign in to the network",
    ),
    "nothing": (Response(), "answer: m: expected JSON, got application/json: nothing"),
    "deep": (Response("[" * 9000), f"answer: m: expected JSON, got application/json: {'[' * 118} …"),
    "compressed": (
        Response(gzip.compress(b"0" * 10**7), headers={"Content-Encoding": "gzip"}),
        'answer: m: expected an uncompressed response, got Content-Encoding "gzip"',
    ),
}
REASONING = {"reasoning_content": f"The answer is {json.dumps(ANSWER)}"}


def client(server: ChatServer, **options: Any) -> ModelClient:
    return ModelClient(ModelOptions(**{"model": "m", "base_url": server.url, "output": "native", **options}))


def check(asked: ModelClient) -> Reply:
    return asked.ask(CHECK, AskOptions(CHECK_FORMAT))


def fault(call: Callable[[], object]) -> CallError:
    with pytest.raises(CallError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return caught.value


def changed(content: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Return a document with another value, or none, at a path."""
    inner = content
    for key in path[:-1]:
        inner = inner[key]
    if value is LEFT_OUT:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return content


@pytest.mark.parametrize("case", HARMLESS)
def test_harmless_oddities_are_accepted(chat_server: ChatServer, case: str) -> None:
    def answer(request: Request) -> Answer:
        content = completion(json.dumps(ANSWER), request)
        for path, value in HARMLESS[case].items():
            content = changed(content, path, value)
        return Response(json.dumps(content))

    chat_server.answer = answer
    asked = client(chat_server)
    assert json.loads(check(asked).answer) == ANSWER
    reply = asked.ask(QUESTION, AskOptions(FORMAT))
    assert (json.loads(reply.answer), reply.requests) == (ANSWER, 1)
    if case == "odd usage":
        assert (reply.input_tokens, reply.output_tokens) == (0, 2)


def test_completion_of_another_content_type_is_read(chat_server: ChatServer) -> None:
    chat_server.answer = lambda request: Response(
        json.dumps(completion(json.dumps(ANSWER), request)), content_type="text/plain"
    )
    assert json.loads(check(client(chat_server)).answer) == ANSWER


@pytest.mark.parametrize(
    "call", [{"function": {"arguments": ANSWER}}, {"id": None, "type": "x", "function": {}}], ids=str
)
def test_odd_tool_calls_are_read(chat_server: ChatServer, call: dict[str, Any]) -> None:
    def answer(request: Request) -> Answer:
        function = {"name": "final_result", "arguments": json.dumps(ANSWER), **call["function"]}
        return Response(json.dumps(completion(None, request, tool_calls=[{**call, "function": function}])))

    chat_server.answer = answer
    assert json.loads(check(client(chat_server, output="tool")).answer) == ANSWER


@pytest.mark.parametrize("case", UNUSABLE)
def test_response_without_an_answer_is_one_sentence(chat_server: ChatServer, case: str) -> None:
    content, words = UNUSABLE[case]
    chat_server.answer = lambda request: content if isinstance(content, Response) else Response(json.dumps(content))
    error = fault(lambda: check(client(chat_server)))
    assert f"{error.kind}: {error}" == words
    assert error.reply.requests == 0


@pytest.mark.parametrize("content", [None, "", []], ids=str)
def test_reasoning_is_no_answer(chat_server: ChatServer, content: Any) -> None:
    chat_server.answer = lambda request: Response(json.dumps(completion(content, {}, **REASONING)))
    for call in (lambda: check(client(chat_server)), lambda: client(chat_server).ask(QUESTION)):
        error = fault(call)
        assert error.kind == "answer"
        assert "m: the answer is empty after the model's reasoning; raise" in str(error)
        assert error.reply.requests >= 1  # which cost something


# Bounds.


@pytest.mark.parametrize("status", [200, 400, 500])
@pytest.mark.parametrize("pace", ["whole", "flood"])
def test_long_response_is_cut_off(chat_server: ChatServer, status: int, pace: Any) -> None:
    body = "x" * (MAX_RESPONSE + 1 if pace == "whole" else 100_000)
    chat_server.answer = lambda request: Response(body, status, pace=pace)
    error = fault(lambda: check(client(chat_server)))
    assert (error.kind, str(error)) == ("answer", "m: the response is longer than 8 MiB")
    assert len(chat_server.requests) == 1


def test_endless_stream_is_cut_off(chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in environment(chat_server).items():
        monkeypatch.setenv(name, value)
    event = 'event: ping\ndata: {"type": "ping"}\n\n' * 1000
    chat_server.answer = lambda request: Response(event, content_type="text/event-stream", pace="flood")
    error = fault(lambda: check(ModelClient(ModelOptions(model="anthropic:claude-sonnet-5"))))
    assert (error.kind, str(error)) == ("answer", "anthropic:claude-sonnet-5: the response is longer than 8 MiB")


def test_compression_is_not_asked_for(chat_server: ChatServer) -> None:
    check(client(chat_server))
    assert chat_server.headers[0]["accept-encoding"] == "identity"


# Redirects.

WIRES = ("m", "ollama:m", "vllm:m", "openai-chat:m", "openai-responses:m", "anthropic:m", "google:m", "azure:m")


@pytest.fixture
def other_server() -> Iterator[ChatServer]:
    with ChatServer() as server:
        yield server


@pytest.mark.parametrize("status", [301, 302, 303, 307, 308])
@pytest.mark.parametrize("model", WIRES)
@pytest.mark.fast_cases(3)
def test_redirects_are_refused(
    chat_server: ChatServer, other_server: ChatServer, monkeypatch: pytest.MonkeyPatch, model: str, status: int
) -> None:
    """The key and the prompt stay with the server that the user named."""
    addresses = {"OLLAMA_BASE_URL": chat_server.url, "VLLM_BASE_URL": chat_server.url}
    google = {"GOOGLE_API_KEY": "planted0google0key", "GOOGLE_GEMINI_BASE_URL": chat_server.root}
    azure = {"AZURE_OPENAI_API_KEY": "planted0azure0key0", "AZURE_OPENAI_ENDPOINT": chat_server.root}
    given = {**environment(chat_server), **addresses, **google, **azure, "OPENAI_API_VERSION": "2024-10-21"}
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    chat_server.answer = lambda request: Response(status=status, headers={"Location": f"{other_server.url}/x"})
    base_url = chat_server.url if model == "m" else None
    error = fault(lambda: check(ModelClient(ModelOptions(model=model, base_url=base_url))))
    expected = f"{model}: the server redirects to {other_server.url}/x, which is not followed; give the final base_url"
    assert (error.kind, str(error)) == ("answer", expected)
    assert len(chat_server.requests) == 1
    assert other_server.requests == []


# Chat templates: the test's server refuses a system message after the first, and two messages of the same role.


@pytest.mark.parametrize(
    "first", ["", '{"link_1": 7}', json.dumps({**GOOD_DESIGN, "link_3": 1.4})], ids=["empty", "left out", "range"]
)
@pytest.mark.parametrize("output", ["tool", "native", "prompted"])
@pytest.mark.parametrize("model", ["ollama:m", "vllm:m", "openai-chat:m"])
@pytest.mark.fast_cases(3)
def test_refused_design_returns_to_a_server_with_a_strict_template(
    chat_server: ChatServer, monkeypatch: pytest.MonkeyPatch, model: str, output: str, first: str
) -> None:
    def answer(request: Request) -> Answer:
        if not wants_design(request):
            return json.dumps(ANSWER)
        is_first = not any(message["role"] == "assistant" for message in request["messages"])
        return first if is_first else json.dumps(GOOD_DESIGN)

    for name in ("OLLAMA_BASE_URL", "VLLM_BASE_URL", "OPENAI_BASE_URL"):
        monkeypatch.setenv(name, chat_server.url)
    monkeypatch.setenv("OPENAI_API_KEY", "planted0key0of0nobody")
    chat_server.answer = answer
    proposer = LlmProposer(ModelOptions(model=model, output=output))
    run = optimize(Problem(load_task("target-1")), proposer=proposer, n_init=4, n_total=1, verify=False)
    assert (run.trials[4].source, run.trials[4].fault) == ("llm", None)
