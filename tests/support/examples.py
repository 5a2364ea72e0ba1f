"""The tasks among the examples, each with its space and evaluator."""

import re
from pathlib import Path
from typing import NamedTuple

from tests import ROOT

EXAMPLES = ROOT / "examples"


class With(NamedTuple):
    """The space of a task, None for the paper's, and the place of its evaluator, if it has one."""

    space: Path | None
    evaluator: str | None


def example_tasks() -> dict[Path, With]:
    """Return the space and evaluator of each task file; the command in its first comment names them."""
    found: dict[Path, With] = {}
    for file in sorted(EXAMPLES.glob("*.yaml")):
        if file.stem.endswith("-space"):
            continue
        command = r"^#.*armwright (?:optimize|design) (\S+)(?: --space (\S+))?(?: --evaluator (\S+))?"
        ((task, space, evaluator),) = re.findall(command, file.read_text(encoding="utf-8"), re.MULTILINE)
        assert (ROOT / task).samefile(file)
        found[file] = With(ROOT / space if space else None, f"{ROOT}/{evaluator}" if evaluator else None)
    return found
