"""A key goes only to an address that the user names, never to one of somebody else's file."""

import json
from pathlib import Path

import pytest

from armwright import LlmProposer, ModelOptions
from armwright.llm.servers import describe_server, server_of
from tests.support.chat_server import GOOD_DESIGN, ChatServer
from tests.support.command_line import armwright
from tests.support.wire_formats import SERVER_KEY

STUDY = ("optimize", "target-1", "--n-init", "2", "--n-step", "2", "--n-total", "2", "--no-figures", "--out", "run")
KEY = {"ARMWRIGHT_API_KEY": SERVER_KEY}


@pytest.fixture
def server(chat_server: ChatServer) -> ChatServer:
    chat_server.answer = lambda _: json.dumps(GOOD_DESIGN)
    return chat_server


def experiment(url: str) -> tuple[str, ...]:
    """The command for an experiment that names a server in its file."""
    options = json.dumps({"model": "m", "base_url": url, "answer": "one-step"})
    method = f"{{llm: {{label: LLM, proposer: llm, model_options: {options}}}}}"
    Path("plan.yaml").write_text(
        f"name: theirs\ntasks: [target-1]\nseeds: 1\nn_init: 2\nn_total: 2\nmethods: {method}\n", encoding="utf-8"
    )
    return "experiment", "plan.yaml", "--no-figures", "--out", "out"


def ran(server: ChatServer, *command: str, key: str, **environment: str) -> str:
    """What a command prints that sends this key alone."""
    server.headers.clear()
    done = armwright(*command, **KEY, **environment)
    assert done.returncode == 0, done.stderr
    assert {headers.get("authorization", "") for headers in server.headers} == {f"Bearer {key}"}
    return done.stdout


def test_file_of_an_experiment_gets_no_key(server: ChatServer, in_folder: Path) -> None:
    shown = ran(server, *experiment(server.url), key="no-key")
    assert f"m at {server.url}, which plan.yaml names and which does not receive ARMWRIGHT_API_KEY" in shown
    assert f"set ARMWRIGHT_BASE_URL={server.url} to send it" in shown


def test_file_of_options_gets_no_key(server: ChatServer, in_folder: Path) -> None:
    Path("options.yaml").write_text(f"base_url: {server.url}\nanswer: one-step\n", encoding="utf-8")
    shown = ran(server, *STUDY, "--model", "m", "--model-options", "options.yaml", key="no-key")
    assert f"m at {server.url}, which options.yaml names and which does not receive" in shown


def test_address_of_the_environment_gets_the_key(server: ChatServer, in_folder: Path) -> None:
    for command in (experiment(server.url), (*STUDY, "--model", "m")):
        shown = ran(server, *command, key=SERVER_KEY, ARMWRIGHT_BASE_URL=f"{server.url}/")
        assert f"m at {server.url}" in shown
        assert "with ARMWRIGHT_API_KEY" in shown


def test_address_of_the_command_line_gets_the_key(server: ChatServer, in_folder: Path) -> None:
    options = ("--model-options", json.dumps({"base_url": server.url}))
    for command in (experiment(server.url), (*STUDY, "--model", "m")):
        assert f"m at {server.url}, with ARMWRIGHT_API_KEY" in ran(server, *command, *options, key=SERVER_KEY)


def test_address_of_the_users_configuration_gets_the_key(
    server: ChatServer, in_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = in_folder / "armwright" / "config.yaml"
    own.parent.mkdir()
    own.write_text(f"model: m\nbase_url: {server.url}\n", encoding="utf-8")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(in_folder))
    for command in (experiment(server.url), STUDY):
        ran(server, *command, key=SERVER_KEY)


def test_address_of_python_code_gets_the_key(server: ChatServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARMWRIGHT_API_KEY", SERVER_KEY)
    LlmProposer(ModelOptions(model="m", base_url=server.url)).check()
    assert {headers["authorization"] for headers in server.headers} == {f"Bearer {SERVER_KEY}"}


def test_options_without_an_address_keep_that_of_the_user() -> None:
    theirs = ModelOptions(temperature=0.5).named_in("theirs.yaml")
    own = ModelOptions(base_url="http://localhost:1/v1")
    assert theirs.with_defaults(own).keyless == ""
    assert own.with_defaults(ModelOptions(base_url="http://localhost:2/v1").named_in("theirs.yaml")).keyless == ""
    both = theirs.with_defaults(ModelOptions(base_url="http://localhost:2/v1").named_in("theirs.yaml"))
    assert both.keyless == "theirs.yaml"


@pytest.mark.parametrize("vendor", ["ollama", "vllm"])
def test_default_address_of_a_local_server_gets_its_own_key_alone(monkeypatch: pytest.MonkeyPatch, vendor: str) -> None:
    """Another program of the machine may listen there."""
    monkeypatch.setenv("ARMWRIGHT_API_KEY", SERVER_KEY)
    options = ModelOptions(model=f"{vendor}:m")
    server = server_of(options)
    assert server is not None
    assert server.key_variable == ""
    assert describe_server(options) == f" at {server.address}"
    monkeypatch.setenv(f"{vendor.upper()}_BASE_URL", "http://127.0.0.1:1/v1")
    assert describe_server(options) == " at http://127.0.0.1:1/v1, with ARMWRIGHT_API_KEY"
    monkeypatch.setenv(f"{vendor.upper()}_API_KEY", "own")
    assert describe_server(options) == f" at http://127.0.0.1:1/v1, with {vendor.upper()}_API_KEY"
