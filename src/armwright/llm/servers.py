"""The server of a model, if it is not the vendor's: its address, its name for the model, and its key."""

import os
from dataclasses import dataclass
from urllib.parse import urlsplit

from armwright.exceptions import SettingsError
from armwright.llm.model_options import ModelOptions

SERVER_KEY = "ARMWRIGHT_API_KEY"  # for base_url, if the server wants a key

# Local servers with a vendor name: default address, and the environment variables of address and key.
_LOCAL = {
    "ollama": ("http://localhost:11434/v1", "OLLAMA_BASE_URL", "OLLAMA_API_KEY"),
    "vllm": ("http://localhost:8000/v1", "VLLM_BASE_URL", "VLLM_API_KEY"),
}


@dataclass(frozen=True)
class Server:
    """An OpenAI-compatible server."""

    address: str  # its base URL
    model: str  # its name for the model
    key_variable: str  # environment variable of its key; empty if none is sent

    def check_address(self) -> None:
        """Raise SettingsError if the address is not a plain HTTP URL; a key or a password does not belong there."""
        scheme, _, rest = self.address.partition("://")
        if "@" in rest.partition("/")[0] or "?" in rest or "#" in rest:
            raise SettingsError(f"base_url holds more than an address; put the server's key into {SERVER_KEY}")
        if scheme not in ("http", "https") or not _is_url(self.address):
            raise SettingsError(f"base_url {self.address}: expected an address such as http://localhost:8080/v1")


def server_of(options: ModelOptions) -> Server | None:
    """Return the server of a model; None for the vendor's own."""
    model = options.model or ""
    vendor, _, bare = model.partition(":")
    if options.base_url:
        return Server(options.base_url, model.removeprefix("openai-chat:"), "" if options.keyless else SERVER_KEY)
    if vendor in _LOCAL:
        default, address, key = _LOCAL[vendor]
        # Nobody named the default address, where another program of this machine may listen.
        named = SERVER_KEY if os.environ.get(address) else ""
        return Server(os.environ.get(address) or default, bare, key if os.environ.get(key) else named)
    return None


def describe_server(options: ModelOptions) -> str:
    """Return the address of a model's server and what key it receives, as a phrase; empty for the vendor's own."""
    server = server_of(options)
    if server is None:
        return ""
    if not os.environ.get(server.key_variable):
        if not (options.keyless and os.environ.get(SERVER_KEY)):
            return f" at {server.address}"
        return (
            f" at {server.address}, which {options.keyless} names and which does not receive {SERVER_KEY} "
            f"(set ARMWRIGHT_BASE_URL={server.address} to send it)"
        )
    return f" at {server.address}, with {server.key_variable}"


def _is_url(text: str) -> bool:
    """Return whether a URL has a host and, if any, a valid port."""
    try:
        parts = urlsplit(text)
        return bool(parts.hostname) and parts.port != 0 and text.isascii() and text.isprintable() and " " not in text
    except ValueError:  # invalid brackets or port
        return False
