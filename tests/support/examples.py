"""The tasks among the examples, each with its space."""

import re
from pathlib import Path

from tests import ROOT

EXAMPLES = ROOT / "examples"


def example_tasks() -> dict[Path, Path | None]:
    """Return the space of each task file, None for the paper's; the command in its first comment names both."""
    spaces: dict[Path, Path | None] = {}
    for file in sorted(EXAMPLES.glob("*.yaml")):
        if file.stem.endswith("-space"):
            continue
        command = r"^#.*armwright (?:optimize|design) (\S+)(?: --space (\S+))?"
        ((task, space),) = re.findall(command, file.read_text(encoding="utf-8"), re.MULTILINE)
        assert (ROOT / task).samefile(file)
        spaces[file] = ROOT / space if space else None
    return spaces
