"""Which language model is configured. A key lying in the environment configures none: it must be named."""

import os
from dataclasses import dataclass
from pathlib import Path

from platformdirs import user_config_path
from pydantic import BaseModel

from armwright.exceptions import SettingsError
from armwright.yaml_documents import read_document


@dataclass(frozen=True)
class ModelName:
    """A model (`openai-chat:gpt-4o`), the server where it is not the vendor's own, and who named it."""

    model: str
    base_url: str | None
    named_by: str


class _ConfigurationFile(BaseModel, frozen=True, extra="forbid"):
    """What holds where neither an option nor the environment says otherwise."""

    model: str | None = None  # such as openai-chat:gpt-4o
    base_url: str | None = None  # of any OpenAI-compatible server


def configuration_path() -> Path:
    """The configuration file; it need not exist."""
    return user_config_path("armwright", appauthor=False) / "config.yaml"


def configured_model(model: str | None = None, base_url: str | None = None) -> ModelName | None:
    """The model by the option, else ARMWRIGHT_MODEL, else the configuration file; None where none is named.

    The address comes from the option, else ARMWRIGHT_BASE_URL, else, for a model of the file, from the file: a
    server of one's own in the file says nothing of a vendor's model that is named elsewhere.
    """
    base_url = base_url or os.environ.get("ARMWRIGHT_BASE_URL")
    if model:
        return ModelName(model, base_url, "--model")
    named = os.environ.get("ARMWRIGHT_MODEL")
    if named:
        return ModelName(named, base_url, "ARMWRIGHT_MODEL")
    path = configuration_path()
    if os.path.isfile(path):
        content = read_document(path, _ConfigurationFile, SettingsError)
        if content.model:
            return ModelName(content.model, base_url or content.base_url, str(path))
    return None
