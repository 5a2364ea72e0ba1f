"""Doctests of the public modules."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

import armwright as aw

SOURCES = Path(str(aw.__file__)).parent
MODULES = sorted(
    ".".join(("armwright", *file.relative_to(SOURCES).with_suffix("").parts))
    for file in SOURCES.rglob("*.py")
    if ">>> " in file.read_text(encoding="utf-8")
)
# What users call first.
SHOWN = (
    "Arm",
    "Problem",
    "builtin_tasks",
    "evaluate",
    "find_front",
    "hypervolume",
    "load_space",
    "load_task",
    "optimize",
    "paper_space",
    "solve",
    "to_urdf",
)


@pytest.mark.parametrize("module", MODULES)
def test_docstring_examples_of_a_module_run(module: str, in_folder: Path) -> None:
    output: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    results = [runner.run(test, out=output.append) for test in doctest.DocTestFinder().find(import_module(module))]
    assert sum(result.failed for result in results) == 0, "".join(output)
    assert sum(result.attempted for result in results) > 0


@pytest.mark.parametrize("name", SHOWN)
def test_public_functions_have_an_example(name: str) -> None:
    thing = getattr(aw, name)
    assert f"{thing.__module__}" in MODULES
    assert ">>> " in thing.__doc__
