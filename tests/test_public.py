"""The public face: what `import armwright as aw` offers."""

import ast
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armwright as aw
from tests import ROOT


def test_all_is_honest() -> None:
    assert list(aw.__all__) == sorted(aw._PLACES)
    for name, place in aw._PLACES.items():
        thing = getattr(aw, name)
        assert thing is getattr(import_module(f"armwright.{place}"), name)
        assert thing.__doc__
    with pytest.raises(AttributeError, match="nothing"):
        aw.nothing


def test_type_checkers_see_the_same_names() -> None:
    tree = ast.parse(Path(str(aw.__file__)).read_text())
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
    assert set(aw.__all__) == imported - {"Any", "TYPE_CHECKING", "import_module"}


@pytest.mark.slow
def test_the_python_of_the_readme_runs(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readme = (ROOT / "README.md").read_text()
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
