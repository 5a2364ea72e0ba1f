"""Print the prompt that a run would send to a language model."""

import os
from collections.abc import Callable
from pathlib import Path

from armwright.cli.streams import print_error, print_json, print_text
from armwright.exceptions import SettingsError
from armwright.llm.model_options import ModelOptions
from armwright.problem.problem import Problem
from armwright.runs.folder import CONFIG
from armwright.study.prompt_preview import preview, preview_after

WHAT = ("next", "schema")


def show_prompt(
    what: str,
    task: str,
    space: Path | None,
    load: Callable[[], Problem],
    options: ModelOptions,
    n_init: int,
    n_total: int,
    seed: int,
) -> None:
    """Print the prompt, or the schema of its answer.

    Args:
        what: One of WHAT.
        task: A run folder for the next prompt of that run; else the task of a new run.
        space: The design space of a new run, if stated.
        load: Loads the problem of a new run.
        options: The options of the model.
        n_init: Random trials of a new run.
        n_total: Counted trials of a new run.
        seed: Seed of a new run.
    """
    if what not in WHAT:
        raise SettingsError(f'--print-prompt "{what}": expected {" or ".join(WHAT)}')
    if os.path.isfile(os.path.join(task, CONFIG)):
        if space is not None:
            raise SettingsError(f"--space {space} is for a new run; {task} has its own")
        shown = preview_after(Path(task), options)
    else:
        shown = preview(load(), options, n_init=n_init, n_total=n_total, seed=seed)
    if what == "schema":
        print_json(shown.schema)
        return
    print_text(shown.prompt, end="")
    print_error(f"about {shown.tokens:,} tokens; for trial {shown.number}")
