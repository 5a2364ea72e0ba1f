"""A commented task file to edit."""

import json
import re
import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from string import Template

import yaml

from armwright.files import check_name
from armwright.tasks.targets import Point, Target

EXAMPLE_TARGETS: tuple[Point, ...] = ((0.45, 0.0, 0.1), (0.45, 0.2, 0.3), (0.45, -0.2, 0.3))


def task_template(file: Path, targets: Sequence[Point | Target] = EXAMPLE_TARGETS) -> str:
    """Return a commented task file to edit, with these targets [m]; the stem of its path becomes the task's name."""
    text = (resources.files("armwright.tasks") / "template.yaml").read_text(encoding="utf-8")
    return Template(text).substitute(
        file=shlex.quote(str(file)),
        name=json.dumps(safe_name(file.stem)),
        targets="\n".join(f"  - {_on_a_line(target)}" for target in targets),
    )


def _on_a_line(target: Point | Target) -> str:
    content = target.model_dump() if isinstance(target, Target) else target
    return yaml.dump(content, Dumper=yaml.SafeDumper, default_flow_style=True, sort_keys=False, width=2**20).strip()


def safe_name(stem: str) -> str:
    """Return the stem of a file as a name that tasks, spaces and run folders accept."""
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", stem).strip("._-")[:64].rstrip(".") or "task"
    try:
        return check_name(name)
    except ValueError:
        return f"task-{name}"
