"""Reconstruct the command of a run from its settings."""

import os
import re
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from armwright.llm.model_options import ModelOptions
from armwright.problem.objectives import OBJECTIVES
from armwright.runs.config import FrontMethod, Method, RunConfig
from armwright.spaces.design_space import builtin_spaces, default_space, load_space
from armwright.spaces.tolerance import TOLERANCE
from armwright.tasks.catalogue import builtin_names, load_task

DEFAULTS = {"sampler": "tpe", "n_init": 10, "n_step": 10, "n_total": 200}


def repeat_command(config: RunConfig, folder: Path, spent: int | None = None) -> str:
    """Return the shell command that repeats a run, without options at their defaults.

    Task and space are read from the run folder unless both are built in. Initial designs appear as DESIGN-1.json.

    Args:
        config: The settings of the run.
        folder: The run folder.
        spent: Evaluations of a direct search.

    Returns:
        The command; empty if objectives, sampler or proposer are custom code.
    """
    name = config.task.name
    if any(record.name not in OBJECTIVES for record in config.objectives) or config.tolerance not in (0.0, TOLERANCE):
        return ""
    builtin = load_task(name) if name in builtin_names() or re.fullmatch(r"random-\d+", name) else None
    is_builtin = builtin is not None and _content(builtin) == _content(config.task)
    spaces = [name for name in builtin_spaces() if _content(load_space(name)) == _content(config.space)]
    is_named = is_builtin and bool(spaces)
    settings: dict[str, Any] = {}
    n_designs = 0
    if is_named and _content(default_space(name)) != _content(config.space):
        settings["space"] = spaces[0]
    if isinstance(config.method, FrontMethod):
        settings |= {"evaluations": spent, "from": (config.method.initial_designs or {}).get("run")}
        command = "design"
    else:
        command = "optimize"
        if not _is_known(config.method):
            return ""
        settings |= _study_options(config.method)
        n_designs = len(config.method.initial_designs)
    given = {key: value for key, value in settings.items() if value is not None and value != DEFAULTS.get(key)}
    options = [text for key, value in given.items() for text in (f"--{key.replace('_', '-')}", str(value))]
    options += [text for n in range(n_designs) for text in ("--initial-design", f"DESIGN-{n + 1}.json")]
    if isinstance(config.method, Method) and _is_screen_off(config.method):
        options.append("--no-screen")
    options += ["--robust"] * (config.tolerance > 0.0)
    options += ["--seed", str(config.seed)]
    return shlex.join(["armwright", command, name if is_named else _path_of(folder), *options])


def _path_of(folder: Path) -> str:
    """Return a folder relative to the current one; its name alone if it is elsewhere, as a page may be sent around."""
    path = os.path.relpath(folder)
    return folder.resolve().name if path.startswith(os.pardir) else path


def _content(model: BaseModel) -> dict[str, Any]:
    """Return what distinguishes one task or space from another."""
    return model.model_dump(exclude={"name", "description", "provenance"})


def _study_options(method: Method) -> dict[str, Any]:
    proposer: Mapping[str, Any] = method.proposer or {"name": "none"}
    recorded: dict[str, Any] = {**proposer, "in_flight": method.in_flight}
    usual = {name: field.default for name, field in ModelOptions.model_fields.items() if name != "origin"}
    stated = {name: recorded[name] for name, value in usual.items() if recorded.get(name, value) != value}
    return {
        "proposer": proposer["name"],
        **ModelOptions.model_construct(**stated).command_options(),
        "sampler": method.sampler,
        "n_init": method.n_init,
        "n_step": method.n_step,
        "n_total": method.n_total,
    }


def _is_screen_off(method: Method) -> bool:
    return method.proposer is not None and method.sampler == "surrogate" and not method.screen


def _is_known(method: Method) -> bool:
    """Return whether the command line can name the proposer and the sampler."""
    proposer = (method.proposer or {}).get("name", "none")
    return proposer in ("none", "rules", "llm") and re.fullmatch("[a-z0-9-]+", method.sampler) is not None
