"""Which arm should I build for this task?

import armwright as aw

problem = aw.Problem(task=aw.load_task("target-1"), space=aw.paper_space(joints=4))
run = aw.optimize(problem, proposer="rules", n_total=200, seed=0, out="runs/mine")
print(run.hypervolume[-1], aw.to_urdf(run.front[0].arm))
"""

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

from armwright.extras import naming_extras

_MODULES = {
    alias.name: f"armwright.{node.module}"
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """Import the module of a public name when the name is first used."""
    if name not in _MODULES:
        raise AttributeError(f"module armwright has no attribute {name!r}")
    with naming_extras(f"armwright.{name}"):
        value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value


def __dir__() -> list[str]:
    return __all__
