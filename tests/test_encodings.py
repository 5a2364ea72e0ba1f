"""Text is UTF-8 whatever the locale: code names the encoding of files and pipes, and commands work in the C locale."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support import command_line
from tests.torture.short import armwright

ROOT = Path(__file__).parents[1]
FOLDERS = ("src", "tests", "tools", "benchmarks", "examples", "optunahub")
ASCII: dict[str, str | None] = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": None}


def calls_without_encoding(code: ast.AST) -> Iterator[ast.Call]:
    """Yield calls that read or write text in the encoding of the locale."""
    for node in ast.walk(code):
        if not isinstance(node, ast.Call) or any(word.arg in ("encoding", None) for word in node.keywords):
            continue
        values = {word.arg: word.value.value for word in node.keywords if isinstance(word.value, ast.Constant)}
        words = [argument.value if isinstance(argument, ast.Constant) else None for argument in node.args]
        match node.func:
            case ast.Attribute(attr="read_text") if not words:  # ours has arguments
                yield node
            case ast.Attribute(attr="write_text") if len(words) == 1:  # ours has two
                yield node
            case ast.Name(id="open" | "fdopen") | ast.Attribute(value=ast.Name(id="os" | "io"), attr="fdopen" | "open"):
                is_low_level = isinstance(node.func, ast.Attribute) and node.func.attr == "open"
                if not is_low_level and "b" not in str(values.get("mode", words[1] if len(words) > 1 else "r")):
                    yield node
            case ast.Attribute(attr="open") if not words or str(words[0]).strip("rwaxt+") == "":  # Path.open
                if "b" not in str(values.get("mode", "")):
                    yield node
            case _ if values.get("text") or values.get("universal_newlines"):  # subprocess
                yield node


@pytest.mark.parametrize("folder", [name for name in FOLDERS if (ROOT / name).is_dir()])
def test_files_and_pipes_name_their_encoding(folder: str) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for call in calls_without_encoding(ast.parse(path.read_bytes()))
    ]
    assert found == []


@pytest.mark.slow
def test_commands_read_and_write_utf8_in_the_c_locale(in_folder: Path) -> None:
    """Output that the locale cannot show is replaced; files are the same as in any other locale."""
    task = "name: piece\ndescription: Pièce … ³ 腕\ntargets: [[0.3, 0.1, 0.2]]\n"
    Path("pièce.yaml").write_text(task, encoding="utf-8")
    study = ("optimize", "pièce.yaml", "--proposer", "rules", "--n-init", "4", "--n-total", "4")
    for command in ((*study, "--figures", "--out", "é-c"), ("check", "none…é.yaml")):
        done = armwright(*command, environment=ASCII)
        assert "Traceback" not in done.stderr
        assert done.returncode == (2 if "none…é.yaml" in command else 0), done.stderr
    assert command_line.armwright(*study, "--no-figures", "--out", "é-any").returncode == 0
    assert "Pièce … ³ 腕" in Path("é-c/config.yaml").read_text(encoding="utf-8")
    assert Path("é-c/config.yaml").read_bytes() == Path("é-any/config.yaml").read_bytes()
