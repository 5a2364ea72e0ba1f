"""Examine what is installed and configured."""

import os
from collections.abc import Iterator
from importlib import metadata

from armwright.exceptions import ArmwrightError
from armwright.extras import DISTRIBUTIONS, EXTRAS, install_command, missing_packages
from armwright.llm.configuration import configuration_path, configured_model
from armwright.llm.model_options import ModelOptions
from armwright.problem.problem import Problem
from armwright.runs.config import versions
from armwright.tasks.catalogue import load_task

OK, MISSING, WRONG = "ok", "--", "!!"  # what is missing matters only if it is wanted

# The environment variables that vendors need; of names joined by "or", one is enough.
VENDORS = {
    "openai-chat": ("OPENAI_API_KEY",),
    "anthropic": ("ANTHROPIC_API_KEY",),
    "google": ("GOOGLE_API_KEY or GEMINI_API_KEY",),
    "azure": ("AZURE_OPENAI_ENDPOINT", "AZURE_OPENAI_API_KEY", "OPENAI_API_VERSION"),
    "openrouter": ("OPENROUTER_API_KEY",),
    "ollama": (),
    "vllm": (),
}


def examine(options: ModelOptions) -> Iterator[tuple[str, str]]:
    """Yield marks and findings without sending anything. Values of keys are never shown."""
    yield OK, "versions: " + ", ".join(f"{name} {number}" for name, number in versions().items())
    problem = Problem(load_task("target-1"))
    try:
        problem.evaluate(problem.space.sample(2, seed=0))
        yield OK, "kernels: compiled and running on the CPU"
    except ArmwrightError as fault:
        yield WRONG, f"kernels: {fault}"
    for extra, packages in EXTRAS.items():
        if missing := missing_packages(extra):
            yield MISSING, f"extra {extra}: {', '.join(missing)} not installed: {install_command(extra)}"
        else:
            found = (f"{name} {metadata.version(name)}" for name in (DISTRIBUTIONS.get(one, one) for one in packages))
            yield OK, f"extra {extra}: {', '.join(found)}"
    for vendor, variables in VENDORS.items() if not missing_packages("llm") else ():
        keys = {names: next(filter(os.environ.get, names.split(" or ")), None) for names in variables}
        if unset := [names for names, name in keys.items() if name is None]:
            yield MISSING, f"{vendor}: {', '.join(unset)} not set in the environment"
        else:
            set_ = f"{', '.join(map(str, keys.values()))} set"
            yield OK, f"{vendor}: {set_ if keys else 'needs no key; its server must run'}"
    yield _configured(options)


def _configured(options: ModelOptions) -> tuple[str, str]:
    configured = None
    try:
        configured = configured_model(options)
        if configured is None:
            places = f"--model, ARMWRIGHT_MODEL, {configuration_path()}"
            return MISSING, f"model: none is configured ({places}); the rules propose"
        from armwright.llm.client import ModelClient

        ModelClient(configured.options)
    except ArmwrightError as fault:
        return WRONG, f"model: {configured}: {fault}" if configured else f"model: {fault}"
    return OK, f"model: {configured}"
