"""Models of vendors and of OpenAI-compatible servers, called over a guarded HTTP client."""

import os
import re
from typing import Any

import httpx2
from openai import AsyncOpenAI, Omit
from pydantic_ai import exceptions as faults
from pydantic_ai.models import DEFAULT_HTTP_TIMEOUT, Model, create_async_httpx2_client, infer_model
from pydantic_ai.models.openai import OpenAIChatModel
from pydantic_ai.profiles import ModelProfile
from pydantic_ai.providers import infer_provider_class
from pydantic_ai.providers.openai_compatible import OpenAICompatibleProvider

from armwright.exceptions import MissingExtraError, SettingsError
from armwright.llm.redaction import redacted_line
from armwright.llm.servers import Server
from armwright.llm.transport import guard

# Chat templates of Qwen, Gemma and Mistral refuse a system message after the first; a user message they all accept.
_SYSTEM_FIRST = ModelProfile(supports_inline_system_prompts=False)
_NO_JSON_MODE = ModelProfile(supports_json_object_output=False)  # `prompted` asks the server for nothing
_PACKAGES = ("openai", "anthropic", "google")  # of the vendors' clients, in the extra `llm`


def vendor_model(name: str, seconds: float) -> Model:
    """Return a vendor's model; raises SettingsError if its name is unknown or its key is not set."""
    vendor, colon, _ = name.partition(":")
    if not colon:
        raise SettingsError(f'model "{name}": expected a vendor before it, such as openai-chat:{name}; or set base_url')
    try:
        model = infer_model(name)
    except faults.UserError as fault:
        key = re.search(r"\b[A-Z_]+_(?:API_KEY|ENDPOINT)\b", str(fault))
        reason = f"needs {key[0]}: set it in the environment" if key else f"cannot be used: {redacted_line(fault)}"
        raise SettingsError(f"model {name} {reason}") from fault
    except ImportError as fault:
        raise MissingExtraError(f"model {name} needs another package: {redacted_line(fault)}") from fault
    package = "" if model.provider is None else type(model.provider.client).__module__.partition(".")[0]
    if package not in _PACKAGES or vendor.startswith("gateway/"):
        return model  # over the vendor's own client, which follows no redirects
    make: Any = infer_provider_class(vendor)
    profile = _SYSTEM_FIRST if isinstance(model, OpenAIChatModel) else None
    same: Any = type(model)
    return same(model.model_name, provider=make(http_client=_http_client(seconds)), profile=profile)


def model_on(server: Server, seconds: float) -> Model:
    """Return a model behind an OpenAI-compatible server, which never receives a vendor's key."""
    server.check_address()
    client = AsyncOpenAI(
        base_url=server.address,
        api_key=os.environ.get(server.key_variable) or "no-key",
        default_headers={"OpenAI-Organization": Omit(), "OpenAI-Project": Omit()},  # pyright: ignore[reportArgumentType]
        http_client=_http_client(seconds),
    )
    provider = OpenAICompatibleProvider("openai-compatible", openai_client=client)
    return OpenAIChatModel(server.model, provider=provider, profile={**_SYSTEM_FIRST, **_NO_JSON_MODE})


def _http_client(seconds: float) -> httpx2.AsyncClient:
    """Return a guarded client; the deadline of a request is its `request_timeout`, which no other limit may cut."""
    return guard(create_async_httpx2_client(timeout=httpx2.Timeout(max(seconds, DEFAULT_HTTP_TIMEOUT), connect=5.0)))
