"""Reconstruct the command of a run from its settings."""

import re
import shlex
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from armwright.llm.model_options import ModelOptions
from armwright.problem.objectives import OBJECTIVES
from armwright.runs.config import FrontMethod, Method, RunConfig
from armwright.spaces.design_space import builtin_spaces, default_space, load_space
from armwright.spaces.tolerance import TOLERANCE
from armwright.tasks.catalogue import builtin_names, load_task

CUSTOM_TASK, CUSTOM_SPACE = "TASK.yaml", "SPACE.yaml"  # placeholders for files of the user
DEFAULTS = {"sampler": "tpe", "n_init": 10, "n_step": 10, "n_total": 200}


def repeat_command(config: RunConfig, refined: bool = False, spent: int | None = None) -> str:
    """Return the shell command that repeats a run, without options at their defaults.

    Custom tasks, spaces and initial designs appear as TASK.yaml, SPACE.yaml and DESIGN-1.json; their content is
    in the run's config.yaml.

    Args:
        config: The settings of the run.
        refined: Whether the run was refined afterwards.
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
    settings: dict[str, Any] = {}
    n_designs = 0
    if _content(default_space(name)) != _content(config.space):
        settings["space"] = spaces[0] if spaces else CUSTOM_SPACE
    if isinstance(config.method, FrontMethod):
        first = config.method.initial_designs or {}
        settings |= {"evaluations": spent, "from": first.get("run"), "proposer": first.get("proposer", {}).get("name")}
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
    line = shlex.join(["armwright", command, name if is_builtin else CUSTOM_TASK, *options, "--seed", str(config.seed)])
    return f"{line} && armwright refine RUN" if refined else line


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
        "refine_every": method.refine_every,
    }


def _is_screen_off(method: Method) -> bool:
    return method.proposer is not None and method.sampler == "surrogate" and not method.screen


def _is_known(method: Method) -> bool:
    """Return whether the command line can name the proposer and the sampler."""
    proposer = (method.proposer or {}).get("name", "none")
    return proposer in ("none", "rules", "llm") and re.fullmatch("[a-z0-9-]+", method.sampler) is not None
