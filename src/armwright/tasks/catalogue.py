"""Tasks by name: built-in tasks, the seeded family `random-N`, and task files."""

import os
import re
from functools import cache
from importlib import resources
from pathlib import Path

import numpy as np

from armwright.exceptions import TaskError, did_you_mean
from armwright.tasks.task import Task
from armwright.yaml_documents import parse_document, read_document

_FOLDER = resources.files("armwright.tasks") / "builtin"
_FIRST = ("target-", "autodesign-", "slideopt-")  # the paper's tasks, and those of related work
_RANDOM = re.compile(r"random-(0|[1-9]\d{0,8})")


def builtin_names() -> list[str]:
    """Return the names of the built-in tasks, the paper's first."""
    names = sorted(file.name.removesuffix(".yaml") for file in _FOLDER.iterdir() if file.name.endswith(".yaml"))
    return sorted(names, key=lambda name: [not name.startswith(prefix) for prefix in _FIRST])


def builtin_tasks() -> dict[str, Task]:
    """Return the built-in tasks by name.

    Examples:
        >>> import armwright as aw
        >>> {name: len(task.targets) for name, task in aw.builtin_tasks().items() if name.startswith("target")}
        {'target-1': 8, 'target-2': 9, 'target-3': 8}
    """
    return {name: _builtin(name) for name in builtin_names()}


@cache
def _builtin(name: str) -> Task:
    file = _FOLDER / f"{name}.yaml"
    return parse_document(file.read_text(encoding="utf-8"), Task, TaskError, file.name)


def load_task(name_or_path: str | Path) -> Task:
    """Load a built-in task by name, `random-N` of the seeded family, or the task of a YAML file.

    Raises:
        TaskError: If there is no such task, or the file does not describe one.

    Examples:
        >>> import armwright as aw
        >>> aw.load_task("target-1").targets[0]
        (-0.45, -0.45, -0.45)
        >>> aw.load_task("target-4")
        Traceback (most recent call last):
        armwright.exceptions.TaskError: unknown task "target-4". Did you mean "target-3"? ...
    """
    known = builtin_names()
    if str(name_or_path) in known:
        return _builtin(str(name_or_path))
    if seeded := _RANDOM.fullmatch(str(name_or_path)):
        return random_task(int(seeded[1]))
    path = Path(name_or_path)
    if os.path.isfile(path):  # unlike Path.is_file, False also for a name that is too long
        return read_document(path, Task, TaskError)
    if os.path.isdir(path):
        raise TaskError(f"{path} is a folder, not a task file")
    if path.suffix in (".yaml", ".yml"):
        raise TaskError(f"there is no file {path}; `armwright init {path}` writes a template")
    raise TaskError(
        f'unknown task "{name_or_path}".{did_you_mean(str(name_or_path), known)} '
        f"`armwright tasks` lists the {len(known)} built-in ones; random-N and YAML files also work"
    )


def random_task(seed: int) -> Task:
    """Return a task without symmetry from a seeded family, for benchmarks.

    It has 6 to 12 points, uniform in a box. The centre of the box is uniform in [-0.5, 0.5] x [-0.5, 0.5] x [0, 0.6] m,
    half its sides in [0.15, 0.6] m. The reference point is that of the paper's tasks.
    """
    rng = np.random.default_rng([0x61726D, seed])
    n = int(rng.integers(6, 13))
    centre = rng.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 0.6])
    half = rng.uniform(0.15, 0.6, 3)
    points = centre + half * rng.uniform(-1.0, 1.0, (n, 3))
    return Task(
        name=f"random-{seed}",
        targets=tuple((round(x, 4), round(y, 4), round(z, 4)) for x, y, z in points.tolist()),
        reference_point=(5.0, 5.0),
        description="Uniform points in a random box.",
        provenance=f"armwright.random_task({seed})",
    )
