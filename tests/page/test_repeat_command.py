"""The command that a page offers repeats its run."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import armwright as aw
from armwright.cli.app import app
from armwright.page.repeat_command import repeat_command
from armwright.runs.folder import read_run

SHORT: dict[str, Any] = {"n_init": 4, "n_total": 6, "verify": False}


def problem(name: str) -> aw.Problem:
    task = aw.load_task("target-1").model_copy(update={"name": name, "reference_point": (4.0, 4.0)})
    return aw.Problem(task, aw.paper_space(joints=3))


@pytest.mark.parametrize("searched", ["studied", "direct"])
def test_command_repeats_a_run_of_files_of_the_user(
    searched: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = Path("runs/mine")
    if searched == "studied":
        aw.optimize(problem("mine"), proposer="rules", seed=3, out=folder, **SHORT)
    else:
        aw.find_front(problem("mine"), evaluations=100, seed=3, out=folder)
    config, history = read_run(folder)
    command = repeat_command(config, folder, spent=100 if searched == "direct" else None)
    program, *words = shlex.split(command)
    assert (program, words[1]) == ("armwright", "runs/mine")
    result = CliRunner().invoke(app, [*words, "--out", "runs/again", "--no-figures"])
    assert result.exit_code == 0, result.output
    repeated, again = read_run(Path("runs/again"))
    assert repeated.task == config.task
    assert repeated.space == config.space
    assert np.array_equal(again.values, history.values)


def test_built_in_task_and_space_are_named_and_a_folder_elsewhere_keeps_its_path_to_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    aw.optimize(aw.Problem(aw.load_task("target-1")), proposer="none", out="plain", **SHORT)
    config, _ = read_run(Path("plain"))
    assert repeat_command(config, Path("plain")).startswith("armwright optimize target-1 --")
    aw.optimize(problem("mine"), proposer="none", out="elsewhere", **SHORT)
    config, _ = read_run(Path("elsewhere"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert repeat_command(config, tmp_path / "elsewhere").startswith("armwright optimize elsewhere --")
