"""A local server in a thread, and requests to it."""

import http.client
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
import uvicorn

from tests.support.command_line import PATIENCE


@dataclass(frozen=True)
class Served:
    """A server of a page, at the address that the terminal shows, with the key."""

    address: str

    @property
    def port(self) -> int:
        return port_and_key(self.address)[0]

    @property
    def key(self) -> str:
        return port_and_key(self.address)[1]


@contextmanager
def running(serve: Callable[[], None]) -> Iterator[None]:
    """Run a server in a thread, and end it with the block, even if a page is open."""
    servers: list[uvicorn.Server] = []
    startup = uvicorn.Server.startup

    async def noting(self: uvicorn.Server, *arguments: Any, **options: Any) -> None:
        servers.append(self)
        await startup(self, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uvicorn.Server, "startup", noting)
        thread = threading.Thread(target=serve)
        thread.start()
        yield
        servers[0].should_exit = True
        thread.join()


def port_and_key(address: str) -> tuple[int, str]:
    """The port and the key in an address that a terminal shows."""
    server, _, key = address.partition("/#key=")
    return int(server.rpartition(":")[2]), key


def ask(port: int, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    """The status and body of an answer, with exactly these headers."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    given = {"Host": f"127.0.0.1:{port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host=True)
    if body is not None:
        given["Content-Length"] = str(len(body))
    for name, value in given.items():
        connection.putheader(name, value)
    connection.endheaders(body)
    response = connection.getresponse()
    found = response.status, response.read()
    connection.close()
    return found
