"""Fuzz the files of a run folder, recordings that are replayed, and requests to the live server of a run."""

import asyncio
import json
import shutil
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import armwright as aw
from armwright.exceptions import ArmwrightError
from armwright.runs.history import History
from tests.fuzz.problem_targets import a_problem
from tests.fuzz.target import DefectError, any_of, folder
from tests.support.chat_server import ChatServer
from tests.support.wire_formats import llm_proposer

EXISTING = {
    "name": "ur3", "joints": 6, "base": [0.0, 0.0, 0.0], "values": [1.0, 2.0],
    "facts": {
        "mass": {"label": "Mass", "unit": "kg", "explanation": "Of the arm.", "value": 11.0},
        "price": {"label": "Price", "unit": "USD", "explanation": "Of its parts.", "reason": "no actuators are named"},
    },
    "dominates": 1, "dominated_by": 0, "violated": [],
    "notes": ["the tip is here"],
}  # fmt: skip
HINTS = [{"id": 1, "text": "a SCARA arm"}, {"id": 2, "text": "lower"}]


@cache
def a_run() -> Path:
    """Return a small finished run with proposals of a scripted model, and its page."""
    from armwright.page.page import write_report

    there = folder() / "run"
    with ChatServer() as server:
        proposer = llm_proposer(server.url, memory="chat", origin="scripted")
        aw.optimize(a_problem(), proposer=proposer, n_init=3, n_step=2, n_total=4, out=there)
    write_report(there)
    control = {"paused": True, "stop": False, "hints": HINTS}
    for name, content in (("existing_arms.json", [EXISTING]), ("control.json", control)):
        (there / name).write_text(json.dumps(content), encoding="utf-8")
    return there


def copy_of_run(name: str) -> Path:
    """Return a folder for files of this process, at first a copy of the run."""
    there = folder() / name
    return there if there.exists() else Path(shutil.copytree(a_run(), there))


def seed_of_run(name: str) -> Callable[[], list[bytes]]:
    return lambda: [(a_run() / name).read_bytes()]


def of_run(name: str) -> Callable[[bytes], None]:
    """Return a target that reads a run folder in which this file has other content."""

    def run(data: bytes) -> None:
        there = copy_of_run("damaged")
        (there / name).write_bytes(data)
        try:
            looked_at(there)
        finally:
            for changed_file in (name, "control.json", "status.json"):
                shutil.copyfile(a_run() / changed_file, there / changed_file)

    return run


def looked_at(there: Path) -> None:
    """Read a run folder in every way."""
    from armwright.experiments.compare_runs import compare_runs
    from armwright.experiments.run_list import list_runs
    from armwright.experiments.tables import markdown
    from armwright.page.content import RunContent, finished_content
    from armwright.proof.export import export_design
    from armwright.proof.selection import pick_from
    from armwright.proposers.replay import ReplayProposer
    from armwright.runs.control import Channel, add_hint, read_control, read_status

    any_of(
        (
            lambda: json.dumps(list_runs([there])),
            lambda: pick_from(there, holds=True),
            lambda: export_design(there, None, "urdf"),
            lambda: RunContent(there).packed(),
            lambda: finished_content(there),
            lambda: markdown(compare_runs(there), "runs", notes=()),
            lambda: replayed(ReplayProposer(there)),
            lambda: (read_control(there), read_status(there)),
            lambda: add_hint(there, "x"),
            lambda: Channel(there).begin(0),
        )
    )


def replayed(proposer: Any) -> None:
    """Use a recording as a replayed run does."""
    from armwright.runs.folder import read_run

    problem = a_problem()
    proposer.check()
    proposer.open(None)
    proposer.recorded_trials()
    proposer.summary()
    json.dumps(dict(proposer.settings()))
    trials = read_run(a_run())[1].trials
    for n in (3, 5):
        history = History(problem, trials[:n], 3, problem.reference_point)
        try:
            proposer.unused(history)
            problem.arm(proposer.propose(history, 0, n).design)
        except ArmwrightError:
            if n == 5:
                raise


def run_replay(data: bytes) -> None:
    from armwright.proposers.replay import ReplayProposer

    place = folder() / "record"
    place.mkdir(exist_ok=True)
    (place / "config.yaml").write_bytes((a_run() / "config.yaml").read_bytes())
    (place / "transcripts.jsonl").write_bytes(data)
    replayed(ReplayProposer(place))


def run_trials(data: bytes) -> None:
    """Read trials.jsonl as readers and a resumed run do."""
    from armwright.runs.folder import RunFolder, read_run

    place = folder() / "trials"
    if not place.exists():
        place.mkdir()
        shutil.copy(a_run() / "config.yaml", place)
    (place / "trials.jsonl").write_bytes(data)
    config, history = read_run(place)
    history.front, history.hypervolume
    with RunFolder(place) as run:
        if len(run.open_trials(config)) != len(history):
            raise DefectError("a resumed run has other trials than its readers")


class LiveServer:
    """The live page's application, called without a network."""

    def __init__(self, folder: Path) -> None:
        from armwright.page.live_app import OpenPages, live_app
        from armwright.page.request_guard import Guard

        self.folder, self.key = folder, "the-key"
        self.app: Any = Guard(live_app(folder, OpenPages()), self.key, {"/"}, lambda host: host == "127.0.0.1:9")

    async def _ask(self, method: str, path: bytes, headers: list[tuple[bytes, bytes]], body: bytes) -> tuple[int, Any]:
        address, _, query = path.partition(b"?")
        scope = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method, "scheme": "http",
            "path": address.decode("utf-8", "replace"), "raw_path": address, "query_string": query, "root_path": "",
            "headers": headers, "client": ("127.0.0.1", 1), "server": ("127.0.0.1", 9),
        }  # fmt: skip
        parts, said = [body[:7], body[7:]], []

        async def receive() -> Any:
            part = parts.pop(0) if parts else b""
            return {"type": "http.request", "body": part, "more_body": bool(parts)}

        async def send(message: Any) -> None:
            said.append(message)

        await self.app(scope, receive, send)
        return said[0]["status"], said[0]["headers"]

    def ask(self, method: str, path: bytes, headers: Mapping[str, str], body: bytes = b"") -> tuple[int, Any]:
        """Return status and headers of the response."""
        given = [
            (name.lower().encode("latin-1", "replace"), value.encode("latin-1", "replace"))
            for name, value in headers.items()
        ]
        with ThreadPoolExecutor(1) as elsewhere:  # this thread may have a loop already: Playwright's
            return elsewhere.submit(lambda: asyncio.run(self._ask(method, path, given, body))).result()


@cache
def a_server() -> LiveServer:
    return LiveServer(copy_of_run("served"))


RIGHT = {
    "Host": "127.0.0.1:9",
    "Origin": "http://127.0.0.1:9",
    "Content-Type": "application/json",
    "X-Armwright-Key": "the-key",
}


def request_seeds() -> list[bytes]:
    actions = [{"action": action} for action in ("pause", "stop", "resume")]
    bodies = [json.dumps(action) for action in (*actions, {"action": "hint", "text": "lower, please"})]
    posts = [{"method": "POST", "path": "/control", "headers": RIGHT, "body": body} for body in bodies]
    paths = ("/run?designs=3&calls=1", "/file?design=2&format=mjcf", "/", "/control")
    gets = [{"method": "GET", "path": path, "headers": RIGHT, "body": ""} for path in paths]
    return [json.dumps(one).encode() for one in (*posts, *posts, *gets)]


def run_request(data: bytes) -> None:
    server = a_server()
    try:
        one = json.loads(data)
        method, path, headers, body = one["method"], one["path"], one["headers"], one["body"]
        headers = {str(name): str(value) for name, value in headers.items()}
    except (ValueError, RecursionError, KeyError, TypeError, AttributeError):
        method, path, headers, body = "POST", "/control", RIGHT, data
    if isinstance(method, str) and str(path).partition("?")[0] == "/events":
        return  # without an end
    if not isinstance(body, bytes):
        body = (body if isinstance(body, str) else json.dumps(body)).encode("utf-8", "replace")
    before = {path.name for path in server.folder.iterdir()}
    status, sent = server.ask(str(method)[:50], str(path).encode("utf-8", "replace"), headers, body)
    if status >= 500 and status != 503:
        raise DefectError(f"{status} for {method} {path}")
    names = {bytes(name).lower() for name, _ in sent}
    if not {b"x-content-type-options", b"content-security-policy", b"cache-control"} <= names:
        raise DefectError(f"headers are missing: {sent}")
    if {path.name for path in server.folder.iterdir()} - before - {"control.json", ".control.lock"}:
        raise DefectError("a request made a file")
    control = server.folder / "control.json"
    if control.is_file() and control.stat().st_size > 3_000:
        control.unlink()
