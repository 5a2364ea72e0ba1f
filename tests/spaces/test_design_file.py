"""Initial designs from files."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import DesignError, RunConflictError, SettingsError
from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.spaces.design_file import read_design
from armwright.spaces.design_space import paper_space
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task

PROBLEM = Problem(load_task("target-1"))
GIVEN = PROBLEM.space.sample(2, 77)
OPTIONS: dict[str, Any] = {"proposer": None, "sampler": "tpe", "n_init": 5}


def test_initial_designs_are_the_first_trials(tmp_path: Path) -> None:
    run = optimize(PROBLEM, **OPTIONS, n_total=10, initial_designs=GIVEN, out=tmp_path / "run")
    assert [trial.source for trial in run.trials] == ["initial_design"] * 2 + ["random"] * 3 + ["bbo"] * 10
    assert [trial.design for trial in run.trials[:2]] == GIVEN
    assert [trial.values for trial in run.trials[:2]] == [tuple(row) for row in PROBLEM.evaluate(GIVEN).values.tolist()]
    without = optimize(PROBLEM, **OPTIONS, n_total=10)
    assert [t.design for t in run.trials[2:5]] == [t.design for t in without.trials[2:5]]  # drawn by their numbers
    config, history = read_run(tmp_path / "run")
    assert [dict(design.params) for design in GIVEN] == list(config.study.initial_designs)
    assert history.trials[0].source == "initial_design"
    again = optimize(PROBLEM, **OPTIONS, n_total=14, initial_designs=GIVEN, out=tmp_path / "run")
    assert again.resumed == 15
    with pytest.raises(RunConflictError, match="initial_designs"):
        optimize(PROBLEM, **OPTIONS, n_total=14, out=tmp_path / "run")


def test_invalid_initial_designs_are_refused() -> None:
    with pytest.raises(SettingsError, match="2 initial designs do not fit into the n_init = 1 first trials"):
        optimize(PROBLEM, n_init=1, initial_designs=GIVEN)
    with pytest.raises(DesignError, match="joint_5"):
        optimize(PROBLEM, initial_designs=paper_space(5).sample(1, 0))


def test_initial_design_from_an_earlier_run(tmp_path: Path) -> None:
    begun = CliRunner().invoke(
        app, ["optimize", "target-1", "--n-total", "10", "--no-figures", "--out", str(tmp_path / "a")]
    )
    assert begun.exit_code == 0, begun.output
    file = sorted((tmp_path / "a" / "designs").glob("*/design.json"))[0]
    options = ["--initial-design", str(file), "--n-total", "5", "--no-figures", "--out", str(tmp_path / "b")]
    result = CliRunner().invoke(app, ["optimize", "target-1", *options])
    assert result.exit_code == 0, result.output
    _, history = read_run(tmp_path / "b")
    assert history.trials[0].design.params == json.loads(file.read_text(encoding="utf-8"))["params"]
    config = (tmp_path / "b" / "config.yaml").read_text(encoding="utf-8")
    assert "initial_designs:" in config


def test_designs_of_any_run_are_read(tmp_path: Path) -> None:
    """A task with constraints adds keys to the records of its designs."""
    record = {"number": 3, "params": dict(GIVEN[0].params), "violations": {"mass <= 3": -0.1}, "facts": {}, "way": None}
    (tmp_path / "design.json").write_text(json.dumps(record), encoding="utf-8")
    assert read_design(tmp_path / "design.json", PROBLEM.space) == GIVEN[0]


def test_files_without_a_design_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(json.dumps({"params": {**GIVEN[0].params, "link_1": 3.0}}), encoding="utf-8")
    with pytest.raises(DesignError, match=r"mine.yaml: link_1 = 3 m is outside"):
        read_design(file, PROBLEM.space)
    file.write_text("params: 3", encoding="utf-8")
    with pytest.raises(DesignError, match="params"):
        read_design(file, PROBLEM.space)
    result = CliRunner().invoke(app, ["optimize", "target-1", "--initial-design", str(tmp_path / "none.json")])
    assert isinstance(result.exception, DesignError)
    assert "cannot read" in str(result.exception)
