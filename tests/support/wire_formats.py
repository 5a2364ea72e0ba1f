"""Wire formats of models, each with a proposer that uses it with a local server."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from armwright.llm.model_options import ModelOptions
from armwright.proposers.llm import LlmProposer
from tests.support.chat_server import ChatServer

OPENAI_KEY = "sk-proj-planted0openai0key0ABCDEFGH"
ANTHROPIC_KEY = "sk-ant-planted0anthropic0key0WXYZ"
SERVER_KEY = "planted0key0of0my0own0server"

# The model; None: one behind --base-url.
WIRES: Mapping[str, str | None] = {
    "own server": None,
    "openai": "openai-chat:gpt-4o",
    "anthropic": "anthropic:claude-sonnet-5",
}
OUTPUTS = ("tool", "native", "prompted")


def environment(server: ChatServer) -> dict[str, str]:
    """Keys, and the server in the place of the vendors."""
    return {
        "OPENAI_API_KEY": OPENAI_KEY,
        "OPENAI_BASE_URL": server.url,
        "ANTHROPIC_API_KEY": ANTHROPIC_KEY,
        "ANTHROPIC_BASE_URL": server.root,
        "ARMWRIGHT_API_KEY": SERVER_KEY,
    }


def llm_proposer(url: str, **options: Any) -> LlmProposer:
    """Ask the server at an address."""
    return LlmProposer(ModelOptions(**{"model": "test-model", "base_url": url, **options}))


def model_options(**options: Any) -> tuple[str, str]:
    """Return options of a model for a command line."""
    return "--model-options", json.dumps(options)


def proposer(wire: str, server: ChatServer, monkeypatch: pytest.MonkeyPatch, **options: Any) -> LlmProposer:
    """Speaks as `wire` says, to the test's server instead of the vendor's."""
    for name, value in environment(server).items():
        monkeypatch.setenv(name, value)
    model = WIRES[wire]
    return llm_proposer(server.url, **options) if model is None else LlmProposer(ModelOptions(model=model, **options))
