"""The public face: what `import armwright as aw` offers."""

import ast
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import armwright as aw


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


def test_the_dozen_lines_of_the_readme(in_folder: Path) -> None:
    problem = aw.Problem(space=aw.paper_space(joints=4), task=aw.load_task("target-1"))
    designs = problem.space.sample(1000, seed=0)
    values = problem.evaluate(designs)
    assert values.shape == (1000, 2)
    assert np.all(np.isfinite(values))
    run = aw.optimize(problem, proposer="rules", n_total=20, n_step=10, seed=0, out="runs/mine")
    assert run.hypervolume.shape == (20,)
    assert set(run.front[0].design.params) == {p.name for p in problem.space.parameters}
    assert len(run.front[0].values) == 2
    assert aw.to_urdf(run.front[0].arm).startswith("<?xml")
    assert (in_folder / "runs" / "mine" / "summary.json").exists()
    assert {"hypervolume.png", "front.png"} <= {path.name for path in aw.write_figures(Path("runs/mine"))}
