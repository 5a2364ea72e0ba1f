"""The public API of `import armwright as aw`."""

import ast
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from tests import ROOT


def test_public_names_match_the_stub() -> None:
    stub = ast.parse(Path(str(aw.__file__)).with_suffix(".pyi").read_text(encoding="utf-8"))
    imports = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    exported = {alias.asname: node.module for node in imports for alias in node.names}
    assert aw.__all__ == dir(aw) == sorted(exported)
    for name, module in exported.items():
        assert getattr(aw, name) is getattr(import_module(f"armwright.{module}"), name)
        assert getattr(aw, name).__doc__
    with pytest.raises(AttributeError, match="nothing"):
        aw.nothing


@pytest.mark.slow
def test_python_code_of_the_readme_runs(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    assert names["values"].shape == (1000, 2)
    assert np.all(np.isfinite(names["values"]))
    run = names["run"]
    assert run.hypervolume.shape == (200,)
    assert set(run.front[0].design.params) == {p.name for p in names["problem"].space.parameters}
    assert capsys.readouterr().out.rstrip().endswith("</robot>")
    assert (in_folder / "runs" / "mine" / "summary.json").exists()
    assert {"hypervolume.png", "front.png"} <= {path.name for path in aw.write_figures(Path("runs/mine"))}
