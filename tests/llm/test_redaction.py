"""API keys never reach output or files, even if the server echoes them."""

import base64
import json
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.llm.redaction import PART, redacted
from armwright.text import map_text
from tests.support import wire_formats as wires
from tests.support.chat_server import GOOD_DESIGN, Answer, ChatServer, Request, Response, is_check, wants_design
from tests.support.command_line import armwright
from tests.support.wire_formats import ANTHROPIC_KEY, OPENAI_KEY, SERVER_KEY, WIRES

SHORT = ("--n-init", "4", "--n-step", "1", "--n-total", "6")
STUDY = ("optimize", "target-1", *SHORT, "--no-figures", "--out", "run")
KEYS = (OPENAI_KEY, ANTHROPIC_KEY, SERVER_KEY)


def run(server: ChatServer, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command with all keys in its environment."""
    return armwright(*arguments, **wires.environment(server))


def run_alone(server: ChatServer, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The same in a process of its own, in which libraries read what they log."""
    command = [sys.executable, "-m", "armwright", *arguments]
    env = {**os.environ, **wires.environment(server), **environment}
    return subprocess.run(command, capture_output=True, text=True, env=env, stdin=subprocess.DEVNULL, encoding="utf-8")


def model_of(wire: str, server: ChatServer, **options: str) -> tuple[str, ...]:
    model = WIRES[wire]
    if model is None:
        return ("--model", "m", *wires.model_options(base_url=server.url, **options))
    return ("--model", model, *wires.model_options(**options))


def words_of(file: Path) -> str:
    """What a file says; of a page what it is about, not the libraries that it carries."""
    text = file.read_bytes().decode("latin-1")
    data = re.search(r'id="content">([^<]*)<', text)
    return text if data is None else zlib.decompress(base64.b64decode(data[1])).decode("latin-1")


def no_key_in(text: str) -> None:
    """Neither whole, nor its beginning or end."""
    for key in KEYS:
        assert key not in text
        assert key[:12] not in text
        assert key[-8:] not in text


def sent_key(server: ChatServer) -> str:
    """What the request under way carries."""
    headers = server.headers[-1]
    return headers.get("x-api-key") or headers["authorization"].removeprefix("Bearer ")


def parrot(server: ChatServer) -> Callable[[Request], Answer]:
    """Repeats the key in what it answers: a design, an error, a value that is refused, a page, a wrong key."""
    answers = iter(["text", "text", "design", "rejected", "text", "value", "value", "value", *["page"] * 3, "key"])

    def answer(request: Request) -> Answer:
        key, kind = sent_key(server), next(answers)
        if kind == "text":
            assert not wants_design(request)
            words = f"Your key is {key}, in short {key[:14]}, or {key[:8]}****{key[-4:]}."
            return json.dumps({"answer": words}) if is_check(request) else words
        if kind == "design":
            return json.dumps({**GOOD_DESIGN, "reason": f"{key} told me, that is {key[-14:]}"})
        if kind == "value":
            return json.dumps({**GOOD_DESIGN, "joint_1": key, "link_1": f"{key} m"})
        if kind == "rejected":
            return 400, json.dumps({"error": {"message": f"{key} may not", "type": key, "code": key}})
        if kind == "page":
            headers = {"retry-after": "0", "set-cookie": key}
            return Response(f"<h1>500</h1><pre>{request}\nauthorization: {key}</pre>", 500, headers, "text/html")
        words = f"Incorrect API key provided: {key[:8]}{'*' * 20}{key[-4:]}. You can find your API key at …"
        return 401, json.dumps(
            {"error": {"message": words, "type": "invalid_request_error", "code": "invalid_api_key"}}
        )

    return answer


@pytest.mark.parametrize("wire", WIRES)
def test_keys_are_never_shown_or_written(chat_server: ChatServer, in_folder: Path, wire: str) -> None:
    chat_server.answer = parrot(chat_server)
    done = run(chat_server, *STUDY, *model_of(wire, chat_server))
    check_for_keys(done, chat_server, in_folder, done.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("wire", ["openai", "anthropic"])
def test_keys_are_not_logged_by_libraries(chat_server: ChatServer, in_folder: Path, wire: str) -> None:
    chat_server.answer = parrot(chat_server)
    logs = {f"{wire.upper()}_LOG": "debug"}
    done = run_alone(chat_server, *STUDY, "--json", *model_of(wire, chat_server), **logs)
    check_for_keys(done, chat_server, in_folder, done.stderr)
    assert "DEBUG] HTTP Re" in done.stderr


@pytest.mark.slow
def test_keys_are_not_on_the_page(chat_server: ChatServer, in_folder: Path) -> None:
    chat_server.answer = parrot(chat_server)
    study = [argument for argument in STUDY if argument != "--no-figures"]
    done = run(chat_server, *study, *model_of("own server", chat_server))
    assert "report.html" in {path.name for path in in_folder.rglob("*")}
    check_for_keys(done, chat_server, in_folder, done.stdout)


def check_for_keys(
    done: subprocess.CompletedProcess[str], chat_server: ChatServer, in_folder: Path, shown: str
) -> None:
    """No key in what the study shows and writes, whatever the server answered."""
    assert done.returncode == 0, done.stderr
    summary = json.loads((in_folder / "run" / "summary.json").read_text(encoding="utf-8"))
    assert summary["proposer"]["failures"] == {"rejected": 1, "answer": 1, "server": 1, "key": 2}
    assert sent_key(chat_server) in KEYS
    files = [path for path in in_folder.rglob("*") if path.is_file()]
    assert {"config.yaml", "transcripts.jsonl", "trials.jsonl", "summary.json"} <= {path.name for path in files}
    for path in files:
        no_key_in(words_of(path))
    no_key_in(done.stdout + done.stderr)
    assert "_API_KEY>" in (in_folder / "run" / "transcripts.jsonl").read_text(encoding="utf-8")
    assert "iteration 6/6" in shown
    assert "failed 5" in shown
    assert shown.count("no usable proposal") == 4  # the last fault is told once
    assert shown.count("no more requests are made in this session") == 1


def test_keys_are_hidden_when_the_first_call_fails(chat_server: ChatServer, in_folder: Path) -> None:
    chat_server.answer = lambda request: (401, json.dumps({"error": {"message": f"bad: {sent_key(chat_server)}"}}))
    done = run(chat_server, "optimize", "target-1", *SHORT, *model_of("openai", chat_server))
    assert done.returncode == 1
    assert done.stderr.startswith("armwright: openai-chat:gpt-4o: bad: <OPENAI_API_KEY> (HTTP 401)")
    assert len(done.stderr.splitlines()) == 1
    no_key_in(done.stdout + done.stderr)


@pytest.mark.slow
def test_keys_are_not_on_a_command_line(chat_server: ChatServer, in_folder: Path) -> None:
    """As every user of the machine sees them: of the study."""
    seen: set[str] = set()

    def answer(_request: Request) -> Answer:
        for command in Path("/proc").glob("[0-9]*/cmdline"):
            with suppress(OSError):  # it ended
                seen.add(command.read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        return json.dumps(GOOD_DESIGN)

    chat_server.answer = answer
    how = (*model_of("openai", chat_server, answer="one-step"), "--no-figures", "--out", "run")
    done = run_alone(chat_server, "optimize", "target-1", *SHORT, *how)
    assert done.returncode == 0, done.stderr
    own = [command for command in seen if str(in_folder) in command or "optimize target-1" in command]
    assert any("armwright optimize" in command for command in own)
    assert sent_key(chat_server) in KEYS
    no_key_in(" ".join(seen))


KEY = "sk-proj-abcdefghijklmnopqrstuvwxyz0123"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (f"key {KEY}!", "key <MY_KEY>!"),
        (f"{KEY}{KEY}", "<MY_KEY><MY_KEY>"),
        (f"key {KEY[:20]}", "key <MY_KEY>"),
        (f"ends in {KEY[-12:]}", "ends in <MY_KEY>"),
        ("sk-proj-************0123.", "<MY_KEY>."),
        ("sk-p...0123", "<MY_KEY>"),
        ("sk-proj-abc…", "<MY_KEY>"),
        ("sk-proj-***zz***z0123, sk-p****qrst...0123", "<MY_KEY>zz<MY_KEY>, <MY_KEY>qrst<MY_KEY>"),
        ("**bold**, 2**3, and so on...", "**bold**, 2**3, and so on..."),
        ("sk-other-*******9999", "sk-other-*******9999"),
        ("a short word: shortest", "a short word: shortest"),
    ],
)
def test_keys_are_redacted(monkeypatch: pytest.MonkeyPatch, text: str, shown: str) -> None:
    monkeypatch.setenv("MY_KEY", KEY)
    monkeypatch.setenv("SHORT_KEY", "short")
    assert redacted(text) == shown


@given(
    st.lists(
        st.one_of(
            st.builds(lambda a, b: KEY[min(a, b) : max(a, b)], st.integers(0, len(KEY)), st.integers(0, len(KEY))),
            st.sampled_from(["-", "***", "…", " ", "sk-", "\n"]),
        )
    )
)
def test_neither_a_beginning_nor_an_end_of_a_key_is_left(pieces: list[str]) -> None:
    with patch.dict(os.environ, {"MY_KEY": KEY}):
        shown = redacted("".join(pieces))
    assert KEY[:PART] not in shown
    assert KEY[-PART:] not in shown


@pytest.mark.parametrize("unit", ["-", "a-", "*", "a*", "..", "…", "a…", KEY[:14], KEY[-14:], f"{KEY[:5]}***"])
def test_redaction_of_long_texts_takes_linear_time(monkeypatch: pytest.MonkeyPatch, unit: str) -> None:
    """Such an answer once stopped a run for good."""
    monkeypatch.setenv("MY_KEY", KEY)
    shown = redacted(unit * (300_000 // len(unit)))
    assert KEY[:PART] not in shown


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("SORT_KEY", "origin_x"),
        ("PRIMARY_KEY", "universal"),
        ("CSRF_TOKEN", "position_error"),
        ("NEXT_TOKEN", "trial_10"),
        ("MY_SECRET", "remember the universal shoulder"),
    ],
)
def test_ordinary_words_are_not_redacted(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    text = "origin_x: a universal shoulder keeps the position_error small, as trial_10 shows; remember it"
    assert redacted(text) == text


@pytest.mark.parametrize(
    ("name", "value"), [("VLLM_API_KEY", "placeholder"), ("MY_PASSWORD", "s3cretword"), ("MY_SECRET", "a-b-" * 5)]
)
def test_sent_header_values_that_are_not_words_are_keys(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    assert redacted(f"it is {value}.") == f"it is <{name}>."


def test_only_text_values_of_an_answer_are_redacted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_API_KEY", "origin_x")
    monkeypatch.setenv("A_TOKEN", "12345678901234567890")
    content = {"origin_x": 12345678901234567890, "why": ["origin_x", None, True, {"origin_x": "is origin_x"}]}
    assert map_text(content, redacted) == {
        "origin_x": 12345678901234567890,
        "why": ["<MY_API_KEY>", None, True, {"origin_x": "is <MY_API_KEY>"}],
    }


def test_key_with_line_breaks_is_redacted_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_TOKEN", "first-piece\nsecond-piece\n")
    assert redacted("b'first-piece\\nsecond-piece\\n'") == "b'<MY_TOKEN>\\n<MY_TOKEN>\\n'"
