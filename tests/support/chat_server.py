"""A local model server with scripted answers.

It speaks OpenAI's chat completions (…/chat/completions) and Anthropic's messages (…/v1/messages). As with the chat
templates of Qwen, Gemma and Mistral, a system message must be the first, and the other roles alternate.
"""

import json
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Literal, Self

from armwright.llm.backend import CHECK

Request = dict[str, Any]

GOOD_DESIGN = {
    "origin_x": 0.0,
    "origin_y": 0.01,
    "origin_z": -0.1,
    **{f"joint_{j}": kind for j, kind in enumerate("YPRP", start=1)},
    **{f"link_{j}": 0.2 for j in range(1, 5)},
    "reason": "a universal shoulder at the centre",
}


@dataclass(frozen=True)
class Response:
    """A response to the byte.

    pace: whole; never: not one byte comes; drip: a byte now and then, without an end; flood: the body again and again,
        without an end; cut, gone: the connection ends after half of it, or before its first byte.
    """

    body: str | bytes = ""
    status: int = 200
    headers: Mapping[str, str] = field(default_factory=dict)
    content_type: str = "application/json"
    pace: Literal["whole", "never", "drip", "flood", "cut", "gone"] = "whole"


Answer = (
    str  # the model's text; where a tool is to be called, its arguments
    | tuple[int, str]  # an HTTP status with a body
    | Response
    | Mapping[str, Response]  # by wire format: openai, anthropic
)


OTHER_ROLES = json.dumps(
    {"error": {"message": "After the optional system message, conversation roles must alternate", "code": 400}}
)


def breaks_template(request: Request) -> bool:
    """Return whether a strict chat template refuses the roles of a request."""
    roles = ["user" if message["role"] == "tool" else message["role"] for message in request.get("messages", ())]
    roles = roles[1:] if roles[:1] == ["system"] else roles
    return roles != (["user", "assistant"] * len(roles))[: len(roles)]


def is_check(request: Request) -> bool:
    """Whether this is the question before the first trial."""
    return CHECK.prompt in json.dumps(request["messages"])


def wants_design(request: Request) -> bool:
    """Whether a schema is asked for: natively, by a tool, or by words in the prompt."""
    has_schema = bool(request.keys() & {"response_format", "output_config", "tools"})
    return not is_check(request) and (has_schema or "NewDesign" in json.dumps(request))


def designer(request: Request) -> Answer:
    """Thinks on a free question, and gives GOOD_DESIGN where a schema is asked for."""
    if is_check(request):
        return json.dumps({"answer": "ready"})
    return json.dumps(GOOD_DESIGN) if wants_design(request) else "ORIGIN: (0, 0.01, -0.1), and so on."


class ChatServer:
    """answer: from a request's JSON to the answer; may be replaced at any time. requests: what came in."""

    def __init__(self) -> None:
        self.answer: Callable[[Request], Answer] = designer
        self.requests: list[Request] = []
        self.headers: list[dict[str, str]] = []
        self._released = threading.Event()  # lets go of whoever waits for a response that never ends
        self._port = 0
        self.start()

    @property
    def root(self) -> str:
        return f"http://127.0.0.1:{self._port}"

    @property
    def url(self) -> str:
        return f"{self.root}/v1"

    def prompts(self) -> list[str]:
        """The text of each question, in order."""
        return ["\n".join(str(message["content"]) for message in request["messages"]) for request in self.requests]

    def start(self) -> None:
        """Listens, after `stop` at the same address again."""
        self._server = ThreadingHTTPServer(("127.0.0.1", self._port), self._handler())
        self._server.daemon_threads = True
        self._port = self._server.server_port
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Is gone: connections are refused."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._released.set()
        self.stop()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                request = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                server.requests.append(request)
                server.headers.append({name.lower(): value for name, value in self.headers.items()})
                wire = "anthropic" if self.path.endswith("/messages") else "openai"
                with suppress(OSError):  # the client went away
                    answer = (400, OTHER_ROLES) if breaks_template(request) else server.answer(request)
                    self._send(_response(answer, request, wire))

            def _send(self, response: Response) -> None:
                if response.pace == "never":
                    server._released.wait()
                if response.pace in ("never", "gone"):
                    return
                data = response.body.encode() if isinstance(response.body, str) else response.body
                self.send_response_only(response.status)
                headers = {
                    "Content-Type": response.content_type,
                    "Content-Length": str(10**6 if response.pace == "drip" else len(data)),
                    **response.headers,
                }
                if response.pace == "flood":
                    del headers["Content-Length"]
                for name, value in headers.items():
                    self.send_header(name, value)
                self.end_headers()
                while response.pace == "flood":
                    self.wfile.write(data)
                if response.pace == "drip":
                    while not server._released.wait(0.02):
                        self.wfile.write(b" ")
                self.wfile.write(data[: len(data) // 2] if response.pace == "cut" else data)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        return Handler


def _response(answer: Answer, request: Request, wire: str) -> Response:
    if isinstance(answer, Response):
        return answer
    if isinstance(answer, Mapping):
        return answer[wire]
    if isinstance(answer, tuple):
        return Response(answer[1], answer[0])
    if wire == "openai":
        return Response(json.dumps(completion(answer, request)))
    content = message(answer, request)
    if request.get("stream"):
        return Response(streamed(content), content_type="text/event-stream")
    return Response(json.dumps(content))


def completion(text: str | None, request: Request, finish_reason: str = "stop", **said: Any) -> dict[str, Any]:
    """OpenAI's chat completion; said: more fields of the model's message."""
    said = {"role": "assistant", "content": text, **said}
    if text is not None and request.get("tools"):
        called = {"name": request["tools"][0]["function"]["name"], "arguments": text}
        said |= {"content": None, "tool_calls": [{"id": "call_1", "type": "function", "function": called}]}
        finish_reason = "tool_calls" if finish_reason == "stop" else finish_reason
    return {
        "id": "chatcmpl-1",
        "object": "chat.completion",
        "created": 1,
        "model": request.get("model", ""),
        "choices": [{"index": 0, "message": said, "finish_reason": finish_reason}],
        "usage": {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120},
    }


def message(text: str | None, request: Request, stop_reason: str = "end_turn") -> dict[str, Any]:
    """Anthropic's message."""
    content: list[dict[str, Any]] = [] if text is None else [{"type": "text", "text": text}]
    if text is not None and request.get("tools"):
        try:
            arguments = json.loads(text)
        except ValueError:
            arguments = None
        if isinstance(arguments, dict):  # else the model writes, and calls no tool
            content = [{"type": "tool_use", "id": "toolu_1", "name": request["tools"][0]["name"], "input": arguments}]
            stop_reason = "tool_use" if stop_reason == "end_turn" else stop_reason
    return {
        "id": "msg_1",
        "type": "message",
        "role": "assistant",
        "model": request.get("model", ""),
        "content": content,
        "stop_reason": stop_reason,
        "stop_sequence": None,
        "usage": {"input_tokens": 100, "output_tokens": 20},
    }


def streamed(content: Mapping[str, Any]) -> str:
    """Anthropic's message as a stream."""
    return sent_events(streamed_events(content))


def sent_events(events: Iterable[Mapping[str, Any]]) -> str:
    """Events on the wire."""
    return "".join(f"event: {event['type']}\ndata: {json.dumps(event)}\n\n" for event in events)


def streamed_events(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    end = {"stop_reason": content["stop_reason"], "stop_sequence": None}
    return [
        {"type": "message_start", "message": {**content, "content": [], "stop_reason": None}},
        *(event for i, block in enumerate(content["content"]) for event in _block_events(i, block)),
        {"type": "message_delta", "delta": end, "usage": {"output_tokens": content["usage"]["output_tokens"]}},
        {"type": "message_stop"},
    ]


def _block_events(index: int, block: Mapping[str, Any]) -> list[dict[str, Any]]:
    if block["type"] == "text":
        empty, delta = {"text": ""}, {"type": "text_delta", "text": block["text"]}
    else:
        empty, delta = {"input": {}}, {"type": "input_json_delta", "partial_json": json.dumps(block["input"])}
    return [
        {"type": "content_block_start", "index": index, "content_block": {**block, **empty}},
        {"type": "content_block_delta", "index": index, "delta": delta},
        {"type": "content_block_stop", "index": index},
    ]
