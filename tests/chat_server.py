"""A small real server that speaks OpenAI's chat completions on 127.0.0.1 and answers as a test tells it."""

import json
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Self

Request = dict[str, Any]
Answer = str | tuple[int, str]  # text, or an HTTP status with a body

GOOD_DESIGN = {
    "origin_x": 0.0,
    "origin_y": 0.01,
    "origin_z": -0.1,
    **{f"joint_{j}": kind for j, kind in enumerate("YPRP", start=1)},
    **{f"link_{j}": 0.2 for j in range(1, 5)},
    "reason": "a universal shoulder at the centre",
}


def designer(request: Request) -> Answer:
    """Thinks on a free question, and gives GOOD_DESIGN where a schema is asked for."""
    return json.dumps(GOOD_DESIGN) if "response_format" in request else "ORIGIN: (0, 0.01, -0.1), and so on."


class ChatServer:
    """answer: from a request's JSON to the answer; may be replaced at any time. requests: what came in."""

    def __init__(self) -> None:
        self.answer: Callable[[Request], Answer] = designer
        self.requests: list[Request] = []
        self.headers: list[dict[str, str]] = []
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._server.server_port}/v1"

    def prompts(self) -> list[str]:
        """The text of each question, in order."""
        return ["\n".join(str(message["content"]) for message in request["messages"]) for request in self.requests]

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                request = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                server.requests.append(request)
                server.headers.append({name.lower(): value for name, value in self.headers.items()})
                answer = server.answer(request)
                status, body = answer if isinstance(answer, tuple) else (200, _completion(request, answer))
                data = body.encode()
                self.send_response(status)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, format: str, *args: Any) -> None:
                pass

        return Handler


def _completion(request: Request, text: str) -> str:
    return json.dumps(
        {
            "id": "chatcmpl-1",
            "object": "chat.completion",
            "created": 1,
            "model": request["model"],
            "choices": [
                {"index": 0, "message": {"role": "assistant", "content": text}, "finish_reason": "stop"},
            ],
            "usage": {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120},
        }
    )
