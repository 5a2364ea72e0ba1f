"""The command that repeats a run, from its settings."""

import re
import shlex
from collections.abc import Mapping
from typing import Any

from armwright.objectives import OBJECTIVES
from armwright.run_folder import FrontMethod, Method, RunConfig
from armwright.space import builtin_spaces, load_space
from armwright.task import builtin_names, load_task
from armwright.tolerance import TOLERANCE

OWN_TASK, OWN_SPACE = "TASK.yaml", "SPACE.yaml"  # where they are files of the user's
OF_PROPOSER = (
    "model", "base_url", "prompt", "memory", "answer", "proposals", "temperature", "model_seed", "output",
)  # fmt: skip
USUAL = {
    "sampler": "tpe", "n_init": 10, "n_step": 10, "n_total": 200, "prompt": "plus", "memory": "none",
    "answer": "two-step", "proposals": 1, "output": "auto",
}  # fmt: skip
AS_TOLD = (  # of a task: what makes it another
    "entries", "payload", "payload_factors", "target_noise", "restarts", "obstacles", "moves", "move_step", "move_time",
    "workspace", "constraints", "objectives", "reference_point",
)  # fmt: skip


def repeat_command(config: RunConfig, polished: bool = False, spent: int | None = None) -> str:
    """The command for a shell; what is as usual is left out.

    polished: whether the run was polished afterwards. spent: evaluations of a search for the whole front.
    A task or a space of the user's is named TASK.yaml or SPACE.yaml, a design to start with START-1.json: all stand in
    the run's config.yaml. Objectives,
    samplers and proposers that are code of the user's cannot be named: then it is empty.
    """
    name, task = config.task.name, config.task
    if any(record.name not in OBJECTIVES for record in config.objectives) or config.tolerance not in (0.0, TOLERANCE):
        return ""
    builtin = load_task(name) if name in builtin_names() or name.startswith("random-") else None
    alike = builtin is not None and all(getattr(builtin, key) == getattr(task, key) for key in AS_TOLD)
    words = [name if alike else OWN_TASK]
    said: dict[str, Any] = {}
    n_starts = 0
    known = {name: load_space(name).model_dump(exclude={"name"}) for name in builtin_spaces()}
    alike = [name for name, content in known.items() if content == config.space.model_dump(exclude={"name"})]
    if "paper" not in alike:
        said["space"] = alike[0] if alike else OWN_SPACE
    if isinstance(config.method, FrontMethod):
        begun = config.method.begin_with or {}
        said |= {"budget": spent, "from": begun.get("run"), "proposer": begun.get("proposer", {}).get("name")}
        command = "front"
    else:
        command = "optimize"
        if not _is_known(config.method):
            return ""
        said |= _study_options(config.method)
        n_starts = len(config.method.start)
    given = {key: value for key, value in said.items() if value is not None and value != USUAL.get(key)}
    options = [text for key, value in given.items() for text in (f"--{key.replace('_', '-')}", str(value))]
    options += [text for n in range(n_starts) for text in ("--start", f"START-{n + 1}.json")]
    options += ["--robust"] * (config.tolerance > 0.0)
    options += ["--overlap"] * ("in_flight" in given)
    line = shlex.join(["armwright", command, *words, *options, "--seed", str(config.seed)])
    return f"{line} && armwright polish RUN" if polished else line


def _study_options(method: Method) -> dict[str, Any]:
    proposer: Mapping[str, Any] = method.proposer or {"name": "none"}
    return {
        "proposer": proposer["name"],
        **{key: proposer.get(key) for key in OF_PROPOSER},
        "sampler": method.sampler,
        "n_init": method.n_init,
        "n_step": method.n_step,
        "n_total": method.n_total,
        "in_flight": method.in_flight,
        "polish_every": method.polish_every,
    }


def _is_known(method: Method) -> bool:
    """Whether the command line has names for its proposer and sampler."""
    proposer = (method.proposer or {}).get("name", "none")
    return proposer in ("none", "rules", "llm") and re.fullmatch("[a-z0-9-]+", method.sampler) is not None
