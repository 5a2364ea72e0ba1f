"""Processes that commands start import nothing from the working folder."""

import ast
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import armwright
from tests.support.command_line import PATIENCE

# Modules that the processes import: Python's own, other packages' and ours.
PLANTED = (
    "json", "queue", "pickle", "logging", "threading", "socket", "multiprocessing", "numpy", "warp", "optuna", "dask",
    "distributed", "cloudpickle", "starlette", "uvicorn", "pydantic", "armwright", "sitecustomize", "usercustomize",
)  # fmt: skip
EVALUATOR = """
import armwright
import helper

@armwright.evaluator("reach [m]", "height [m]")
def reach(arm, task):
    return sum(link.length for link in arm.links), abs(arm.base[2])
"""
SHORT = ("--n-init", "3", "--n-step", "3", "--n-total", "3", "--no-figures", "--out", "run")
HOW = ("--evaluation-timeout", "60", "--workers", "2")
COMMANDS: dict[str, tuple[str, ...]] = {  # all that start processes, which one function does
    "workers with a timeout": ("optimize", "target-1", *SHORT, "--evaluator", "{there}/ev.py:reach", *HOW),
}


def test_one_function_starts_all_processes() -> None:
    root = Path(armwright.__file__).parent
    starters = {
        file.relative_to(root).as_posix()
        for file in root.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in ("subprocess.Popen", "subprocess.run", "os.system", "os.popen", "os.fork")
    }
    assert starters == {"child_process.py"}


@pytest.fixture
def planted(in_folder: Path) -> Path:
    """A working folder with modules that leave a note when they are imported."""
    for name in PLANTED:
        (in_folder / f"{name}.py").write_text(
            f'open("{in_folder}/note", "a").write("{name}\\n")\nraise SystemExit(3)\n', encoding="utf-8"
        )
    return in_folder


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_planted_modules_are_not_imported(planted: Path, tmp_path_factory: pytest.TempPathFactory, name: str) -> None:
    there = tmp_path_factory.mktemp("there")
    (there / "ev.py").write_text(EVALUATOR, encoding="utf-8")
    (there / "helper.py").write_text("", encoding="utf-8")
    for hidden in ("json", "queue", "pickle", "secrets", "statistics"):  # Python's own come first
        (there / f"{hidden}.py").write_text(f'open("{planted}/note", "a").write("{hidden}\\n")\n', encoding="utf-8")
    arguments = [argument.format(there=there) for argument in COMMANDS[name]]
    with started(*arguments) as process:
        _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    assert not (planted / "note").exists()


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[Any]]:
    """A command as its console script begins, which does not look for modules in the working folder."""
    heed: Callable[[], object] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    command = [sys.executable, "-P", "-m", "armwright", *arguments]
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, encoding="utf-8",
        preexec_fn=heed,
    ) as process:  # fmt: skip
        yield process
        process.kill()
