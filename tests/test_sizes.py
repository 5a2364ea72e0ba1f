"""Files and functions of the package stay short enough to be read whole."""

import ast
from pathlib import Path

import armwright

ROOT = Path(armwright.__file__).parent
FILE_LINES = 400
FUNCTION_LINES = 150


def test_no_file_and_no_function_is_too_long() -> None:
    long: list[str] = []
    for file in sorted(ROOT.rglob("*.py")):
        text, name = file.read_text(encoding="utf-8"), file.relative_to(ROOT).as_posix()
        if (n := len(text.splitlines())) > FILE_LINES:
            long.append(f"{name}: {n} lines")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                n = (node.end_lineno or 0) - node.lineno + 1
                if n > FUNCTION_LINES:
                    long.append(f"{name}: {node.name} has {n} lines")
    assert not long
