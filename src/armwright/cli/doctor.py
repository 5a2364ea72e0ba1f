"""Examine what is installed and configured, and whether it works."""

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata

from armwright.exceptions import ArmwrightError, ModelError
from armwright.extras import EXTRAS, install_command, is_installed, missing_packages
from armwright.llm.backend import CHECK, CHECK_FORMAT, CallError, Reply
from armwright.llm.configuration import configuration_path, configured_model
from armwright.llm.model_options import ModelOptions
from armwright.runs.config import versions
from armwright.text import one_line

OK, MISSING, WRONG = "ok", "--", "!!"

# Vendor, its client package, and the environment variables it needs; of names joined by "or", one is enough.
VENDORS = (
    ("openai-chat", "openai", ("OPENAI_API_KEY",)),
    ("anthropic", "anthropic", ("ANTHROPIC_API_KEY",)),
    ("google", "google.genai", ("GOOGLE_API_KEY or GEMINI_API_KEY",)),
    ("azure", "openai", ("AZURE_OPENAI_ENDPOINT", "AZURE_OPENAI_API_KEY", "OPENAI_API_VERSION")),
    ("openrouter", "openai", ("OPENROUTER_API_KEY",)),
    ("ollama", "openai", ()),
    ("vllm", "openai", ()),
)


@dataclass(frozen=True)
class Finding:
    """A line of the report; mark: ok, -- (missing, which matters only if wanted) or !! (wrong)."""

    mark: str
    subject: str
    message: str


def examine(options: ModelOptions | None = None) -> Iterator[Finding]:
    """Yield findings without sending anything. Values of keys are never shown."""
    yield Finding(OK, "versions", ", ".join(f"{name} {number}" for name, number in versions().items()))
    yield _kernels()
    yield from map(_extra, EXTRAS)
    yield from _vendors()
    yield _configured(options)


def try_model(options: ModelOptions | None = None) -> str:
    """Make one small call to the configured model.

    Raises:
        ModelError: No model is configured, or the call fails.
    """
    configured = configured_model(options)
    if configured is None:
        raise ModelError("no model is configured; give --model, or set ARMWRIGHT_MODEL")
    from armwright.llm.client import ModelClient

    client = ModelClient(configured.options)
    try:
        reply = client.ask(CHECK, CHECK_FORMAT)
    except CallError as fault:
        raise ModelError(f"{fault} ({fault.kind})") from fault
    cost = "price unknown" if reply.cost_usd is None else f"{reply.cost_usd:.6f} USD"
    return (
        f'{OK} call: {configured.options.model} answered "{_answer(reply)}" in {reply.seconds:.1f} s '
        f"(output {reply.output_mode}), "
        f"{reply.input_tokens} tokens in, {reply.output_tokens} out, {cost}"
        f"{client.note and f'; {client.note}'}"
    )


def _answer(reply: Reply) -> str:
    """Return the answer to the check on one line, out of its JSON if it is in the form that was asked for."""
    answer = reply.answer
    with suppress(ValueError, TypeError, KeyError):
        answer = str(json.loads(answer)["answer"])
    return one_line(answer, 60)


def _kernels() -> Finding:
    from armwright.problem.problem import Problem
    from armwright.tasks.catalogue import load_task

    problem = Problem(load_task("target-1"))
    try:
        problem.evaluate(problem.space.sample(2, seed=0))
    except ArmwrightError as fault:
        return Finding(WRONG, "kernels", str(fault))
    return Finding(OK, "kernels", "compiled and running on the CPU")


def _extra(extra: str) -> Finding:
    missing = missing_packages(extra)
    if missing:
        return Finding(MISSING, f"extra {extra}", f"{', '.join(missing)} not installed: {install_command(extra)}")
    found = (f"{name} {metadata.version(name)}" for name in EXTRAS[extra].values())
    return Finding(OK, f"extra {extra}", ", ".join(found))


def _vendors() -> Iterator[Finding]:
    for vendor, package, variables in VENDORS:
        if not (is_installed(package) and is_installed("pydantic_ai")):
            yield Finding(MISSING, vendor, f"not installed: {install_command('llm')}")
            continue
        found = {names: next(filter(os.environ.get, names.split(" or ")), None) for names in variables}
        unset = [names for names, name in found.items() if name is None]
        if unset:
            yield Finding(MISSING, vendor, f"{', '.join(unset)} not set in the environment")
        else:
            message = f"{', '.join(map(str, found.values()))} set" if found else "needs no key; its server must run"
            yield Finding(OK, vendor, message)


def _configured(options: ModelOptions | None) -> Finding:
    configured = None
    try:
        configured = configured_model(options)
        if configured is None:
            places = f"--model, ARMWRIGHT_MODEL, {configuration_path()}"
            return Finding(MISSING, "model", f"none is configured ({places}); the rules propose")
        from armwright.llm.client import ModelClient

        ModelClient(configured.options)
    except ArmwrightError as fault:
        return Finding(WRONG, "model", f"{configured}: {fault}" if configured else str(fault))
    return Finding(OK, "model", f"{configured}; --call tries it")
