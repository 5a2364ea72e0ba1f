"""Which language model is configured. A key in the environment configures none: the model must be named."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from platformdirs import user_config_path

from armwright.exceptions import SettingsError
from armwright.llm.model_options import ModelOptions
from armwright.llm.servers import describe_server
from armwright.yaml_documents import check_document, parse_document, read_document


@dataclass(frozen=True)
class ConfiguredModel:
    """Options that name a model, and where its name comes from."""

    options: ModelOptions
    named_by: str

    def __str__(self) -> str:
        """Return the model, its server and who named it, in one phrase."""
        return f"{self.options.model}{describe_server(self.options)}, named by {self.named_by}"


def configuration_path() -> Path:
    """Return the path of the user's configuration file, which need not exist."""
    return user_config_path("armwright", appauthor=False) / "config.yaml"


def load_model_options(source: str | None = None, **direct: Any) -> ModelOptions:
    """Return the options of `--model-options`, overridden by single options of the command line.

    The source is a YAML file, or a mapping in place ("{temperature: 0}"). `direct` fields are None if not given.

    Raises:
        SettingsError: The file cannot be read, or a key or a value is not valid.
    """
    given = {name: value for name, value in direct.items() if value is not None}
    options = check_document(given, ModelOptions, SettingsError, "command line")
    if source is None:
        return options
    if source.lstrip().startswith("{"):
        stated = parse_document(source, ModelOptions, SettingsError, "--model-options")
    else:
        stated = read_document(Path(source), ModelOptions, SettingsError).named_in(source).approved(own_addresses())
    return options.with_defaults(stated)


def own_addresses() -> tuple[str | None, ...]:
    """Return the addresses that the environment and the user's configuration file name: those may receive a key."""
    return os.environ.get("ARMWRIGHT_BASE_URL"), _defaults().base_url


def configured_model(options: ModelOptions | None = None) -> ConfiguredModel | None:
    """Return the options completed by the environment and the user's configuration file; None if no model is named.

    The model's name comes from the options, else from ARMWRIGHT_MODEL, else from the configuration file. The address
    comes from the options, else from ARMWRIGHT_BASE_URL. That of the configuration file is used only with the model
    of the same file, since it says nothing of a model named elsewhere. The file's other settings are defaults for
    every model.
    """
    given = options or ModelOptions()
    path, defaults = configuration_path(), _defaults()
    named = {"--model": given.model, "ARMWRIGHT_MODEL": os.environ.get("ARMWRIGHT_MODEL"), str(path): defaults.model}
    named_by = next((place for place, model in named.items() if model), None)
    if named_by is None:
        return None
    base_url = given.base_url or os.environ.get("ARMWRIGHT_BASE_URL")
    if named_by == str(path):
        base_url = base_url or defaults.base_url
    found = {"model": named[named_by], "base_url": base_url}
    return ConfiguredModel(given.with_defaults(defaults).model_copy(update=found), named_by)


def _defaults() -> ModelOptions:
    """Return the options in the user's configuration file; empty if there is none."""
    path = configuration_path()
    return read_document(path, ModelOptions, SettingsError) if os.path.isfile(path) else ModelOptions()
