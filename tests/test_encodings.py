"""Commands work in the C locale."""

from pathlib import Path

import pytest

from tests.support import command_line
from tests.torture.short import armwright

ASCII: dict[str, str | None] = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": None}


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
