"""Experiment files, and running each cell exactly once."""

import csv
import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import FailureError, SettingsError, TaskError
from armwright.experiments.cells import Cell, collect, plan_cells
from armwright.experiments.plan import (
    ExperimentPlan,
    builtin_files,
    builtin_text,
    load_experiment,
    suite_tasks,
    with_model,
)
from armwright.experiments.runner import run_cell
from armwright.experiments.tables import write_tables
from armwright.llm.model_options import ModelOptions
from armwright.llm.recording_file import shipped_recordings
from armwright.search.samplers import SAMPLERS
from tests.support.chat_server import ChatServer
from tests.torture.short import trials

SMALL: dict[str, Any] = {
    "name": "small",
    "tasks": ["target-1", "random-3"],
    "seeds": 2,
    "n_init": 4,
    "n_total": 6,
    "methods": {
        "bbo": {"label": "BBO", "proposer": "none"},
        "rules": {"label": "BBO/rules", "proposer": "rules", "n_step": 3},
    },
}


def plan_of(**changes: Any) -> ExperimentPlan:
    return ExperimentPlan.model_validate({**SMALL, **changes})


def file_of(folder: Path, **changes: Any) -> Path:
    file = folder / "small.yaml"
    file.write_text(yaml.safe_dump({**SMALL, **changes}), encoding="utf-8")
    return file


def asking(server: ChatServer) -> dict[str, Any]:
    """Return a method that calls the local server."""
    named = {"model": "test-model", "base_url": server.url, "origin": "scripted"}
    return {"label": "BBO/LLM+", "proposer": "llm", "n_step": 3, "model_options": named}


def invoke(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def run_here(file: Path, *options: str) -> Any:
    """Run an experiment with its cells in this process."""
    return invoke("experiment", file, "--workers", "0", "--no-figures", *options)


def method_of(cell: Cell) -> str:
    """The key of a cell's method."""
    return cell.folder.parts[-3]


def test_paper_experiment_matches_the_paper() -> None:
    plan = load_experiment("paper")[0]
    assert plan.task_list == ("target-1", "target-2", "target-3")
    assert (plan.seed_list, plan.n_init, plan.n_total) == ((0, 1, 2, 3, 4), 10, 200)
    asked = {key: method for key, method in plan.methods.items() if method.needs_a_model}
    steps = {key: method.n_step for key, method in asked.items() if method.model_options.prompt == "plus"}
    assert steps == {"llm-plus-5": 5, "llm-plus": 10, "llm-plus-50": 50}
    assert all(method.model_options.temperature == 0 for method in asked.values())
    assert plan.published["bbo"]["target-1"] == (6.70, 2.03)
    assert plan.published["llm-plus"]["target-3"] == (16.29, 1.53)


def test_builtin_experiments_load_from_their_printed_files(tmp_path: Path) -> None:
    for name in builtin_files():
        file = tmp_path / f"{name}.yaml"
        file.write_text(builtin_text(name), encoding="utf-8")
        assert load_experiment(str(file)) == (load_experiment(name)[0], tmp_path)
    assert load_experiment("suite")[0].task_list == suite_tasks()
    assert len(load_experiment("rules")[0].seed_list) == 20


def test_samplers_run_alone_and_with_rules(tmp_path: Path) -> None:
    plan = load_experiment("samplers")[0]
    pairs = {(method.sampler, method.proposer) for method in plan.methods.values()}
    assert pairs == {(sampler, proposer) for sampler in SAMPLERS for proposer in ("none", "rules")}
    cells, skipped = plan_cells(plan, tmp_path, tmp_path)
    assert not skipped
    seeds = Counter((cell.plan.sampler, cell.task_name) for cell in cells if cell.plan.proposer == "rules")
    assert seeds == {(name, task): 5 if name == "gp" else 20 for name in SAMPLERS for task in plan.task_list}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"methods": {"bbo": {"label": "BBO", "proposer": "ruls"}}},
            'got "ruls"; try "rules"',
        ),
        ({"baseline": "bob"}, 'Did you mean "bbo"'),
        (
            {"methods": {"llm": {"label": "L", "proposer": "llm", "model_options": {"temprature": 0}}}},
            r'methods\.llm\.model_options: unknown key "temprature"\. Did you mean "temperature"\?',
        ),
        ({"seeds": []}, "seeds"),
        ({"seeds": [1, 1]}, "each once"),
        ({"methods": {"a": {"label": "A"}, "b": {"label": "A"}}}, "same label"),
        ({"methods": {"../a": {"label": "A"}}}, "expected a name of at most 40 lowercase letters"),
        ({"methods": {"a": {"label": "A", "against": ["b"]}}}, r'methods\.a\.against names the unknown method "b"'),
    ],
)
def test_mistakes_in_experiment_files_are_reported(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        load_experiment(str(file_of(tmp_path, **changes)))


def test_unknown_experiments_methods_and_tasks_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match='Did you mean "paper"'):
        load_experiment("papr")
    with pytest.raises(SettingsError, match=r'has no method "rulez"\. Did you mean "rules"'):
        plan_cells(plan_of(), tmp_path, tmp_path, methods=["rulez"])
    for task, words in (("targt-1", "unknown task"), ("mine.yaml", "there is no file")):
        with pytest.raises(TaskError, match=words):
            plan_cells(plan_of(tasks=[task]), tmp_path, tmp_path)
    with pytest.raises(SettingsError, match=r'has no seed "2"\. Did you mean|has no seed "2"\. Available: 0, 1'):
        plan_cells(plan_of(), tmp_path, tmp_path, seeds=[2])
    with pytest.raises(FailureError, match="no cell of the experiment is finished"):
        collect(plan_of(), plan_cells(plan_of(), tmp_path, tmp_path)[0])


def test_method_runs_its_share_of_the_seeds(tmp_path: Path) -> None:
    methods = {**SMALL["methods"], "few": {"label": "few", "seeds": [3, 1], "against": ["rules"]}}
    plan = plan_of(methods=methods, tasks=["target-1"], seeds=4)
    cells, skipped = plan_cells(plan, tmp_path, tmp_path)
    assert not skipped
    assert [cell.seed for cell in cells if method_of(cell) == "few"] == [1, 3]
    assert [cell.seed for cell in cells if method_of(cell) == "bbo"] == [0, 1, 2, 3]
    few, _ = plan_cells(plan, tmp_path, tmp_path, methods=["few", "rules"], seeds=[1, 2])
    assert [(method_of(cell), cell.seed) for cell in few] == [("rules", 1), ("few", 1), ("rules", 2)]


def test_two_runs_of_an_experiment_give_equal_tables(tmp_path: Path) -> None:
    plan = plan_of(tasks=["target-1"])
    for name in ("first", "second"):
        cells, _ = plan_cells(plan, tmp_path, tmp_path / name)
        assert not any(run_cell(cell).fault for cell in cells)
        write_tables(tmp_path / name, collect(plan, cells), "Experiment small")
    tables = {path.name for path in (tmp_path / "first").iterdir() if path.is_file()}
    assert tables >= {"table.md", "table.csv", "contrasts.csv", "sources.csv", "proposers.csv", "runs.csv"}
    for name in tables - {"runs.csv"}:
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes(), name


def test_task_and_space_files_next_to_the_experiment_are_found(tmp_path: Path) -> None:
    (tmp_path / "shelf.yaml").write_text(
        "name: shelf\ntargets: [[0.4, 0.0, 0.2]]\nreference_point: [1.0, 1.0]\n", encoding="utf-8"
    )
    (tmp_path / "three.yaml").write_text("joints: 3\n", encoding="utf-8")
    plan = plan_of(tasks=["shelf.yaml"], space="three.yaml")
    cells, _ = plan_cells(plan, tmp_path, tmp_path / "out")
    assert {cell.task_name for cell in cells} == {"shelf"}
    assert all(Path(cell.task).is_absolute() and Path(str(cell.space)).is_absolute() for cell in cells)
    outcome = run_cell(cells[0])
    assert not outcome.fault
    assert len(trials(cells[0].folder)[0]["params"]) == 9


def test_cells_without_a_model_are_skipped_with_a_reason(tmp_path: Path) -> None:
    plan = load_experiment("n-step")[0]
    cells, skipped = plan_cells(plan, tmp_path, tmp_path)
    assert {one.plan.proposer for one in skipped} == {"llm"}
    assert "no language model is configured" in skipped[0].reason
    assert len({method_of(cell) for cell in cells}) == 5
    cells, skipped = plan_cells(with_model(plan, ModelOptions(model="gpt-x")), tmp_path, tmp_path)
    assert not skipped
    asking = [cell for cell in cells if cell.plan.needs_a_model]
    assert {cell.plan.model_options.model for cell in asking} == {"gpt-x"}
    assert sum(200 // cell.plan.n_step for cell in asking) == 3 * 5 * (100 + 40 + 20 + 4)


def test_replayed_methods_run_the_cells_with_a_recording(tmp_path: Path) -> None:
    plan = load_experiment("recorded")[0]
    cells, skipped = plan_cells(plan, tmp_path, tmp_path)
    replayed = {(method_of(cell), cell.replay) for cell in cells if cell.replay}
    assert {name for _, name in replayed} == set(shipped_recordings())
    assert len(cells) == 2 * 3 * 5 + len(replayed)
    assert {(one.task_name, one.reason) for one in skipped} == {
        (task, "there is no {task}-plus-n5-seed{seed}") for task in ("target-1", "target-3")
    }


@pytest.mark.slow
def test_experiment_command_runs_resumes_and_writes_tables(in_folder: Path) -> None:
    file = file_of(in_folder)
    result = invoke("experiment", file, "--workers", "2", "--no-figures")
    assert result.exit_code == 0, result.output
    assert "8 cells: 8 to run on 2 local workers, 0 finished before, 0 skipped" in result.output
    assert "With fewer than six seeds, no test can reject at 5 %" in result.output
    out = in_folder / "experiments" / "small"
    rows = list(csv.DictReader((out / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert {(row["task"], row["method"], row["runs"]) for row in rows} == {
        (task, method, "2") for task in ("target-1", "random-3") for method in ("BBO", "BBO/rules")
    }
    stamps = {path: path.stat().st_mtime_ns for path in out.glob("runs/**/trials.jsonl")}
    assert len(stamps) == 8
    again = run_here(file)
    assert "8 cells: nothing to run, 8 finished before" in again.output
    assert {path: path.stat().st_mtime_ns for path in stamps} == stamps
    more = run_here(file, "--seeds", "3", "--method", "bbo", "--json")
    assert more.exit_code == 0
    assert json.loads(more.stdout)["cells"] == 6


def test_tasks_are_checked_once_before_any_cell_runs(in_folder: Path) -> None:
    (in_folder / "heavy.yaml").write_text("name: heavy\ntargets: [[0.3, 0.0, 0.3]]\npayload: 500\n", encoding="utf-8")
    (in_folder / "far.yaml").write_text("name: far\ntargets: [[5, 0, 0.3]]\n", encoding="utf-8")
    result = run_here(file_of(in_folder, tasks=["heavy.yaml"], seeds=1, n_total=1, n_init=2))
    assert result.exit_code == 0, result.output
    assert result.output.count("warning: task heavy: payload: 500 kg") == 1
    stopped = run_here(file_of(in_folder, tasks=["target-1", "far.yaml"], name="other"))
    assert isinstance(stopped.exception, TaskError)
    assert str(stopped.exception).startswith("task far: target 1 (5, 0, 0.3) m is 4 m from the nearest allowed base")
    assert not list(in_folder.glob("experiments/other/runs/*"))


@pytest.mark.slow
def test_changed_method_does_not_reuse_an_existing_run(in_folder: Path) -> None:
    methods = {"rules": SMALL["methods"]["rules"]}
    assert run_here(file_of(in_folder, seeds=1, tasks=["random-3"], methods=methods)).exit_code == 0
    methods["rules"] = {**methods["rules"], "n_step": 2}
    result = run_here(file_of(in_folder, seeds=1, tasks=["random-3"], methods=methods))
    assert result.exit_code == 1
    assert "FAILED: BBO/rules, random-3, seed 0" in result.output
    assert "n_step: 3 stored, 2 requested" in result.output


@pytest.mark.slow
def test_failing_cell_is_reported_and_others_continue(in_folder: Path) -> None:
    blocked = in_folder / "experiments/small/runs/rules/target-1"
    blocked.mkdir(parents=True)
    (blocked / "seed1").write_text("a file where a folder should be", encoding="utf-8")
    result = run_here(file_of(in_folder))
    assert result.exit_code == 1
    assert "FAILED: BBO/rules, target-1, seed 1" in result.output
    assert "Traceback" not in result.output
    table = (in_folder / "experiments/small/table.md").read_text(encoding="utf-8")
    assert "FAILED: BBO/rules, target-1, seed 1" in table
    finished = list(in_folder.glob("experiments/small/runs/*/*/*/summary.json"))
    assert len(finished) == 7
    (blocked / "seed1").unlink()
    mended = run_here(file_of(in_folder))
    assert mended.exit_code == 0
    assert "1 to run" in mended.output


@pytest.mark.slow
def test_recorded_experiment_replays_without_a_model(in_folder: Path, chat_server: ChatServer) -> None:
    settings: dict[str, Any] = {"tasks": ["random-3"], "methods": {"llm": asking(chat_server)}}
    file = file_of(in_folder, **settings)
    done = run_here(file, "--out", "first")
    assert done.exit_code == 0, done.output
    assert f"2 of them ask test-model at {chat_server.url} for about 4 proposals in total" in done.output
    assert "[scripted]" in (in_folder / "first" / "table.md").read_text(encoding="utf-8")
    chat_server.requests.clear()
    replaying = {"label": "again", "proposer": "replay:first/runs/llm/{task}/seed{seed}", "n_step": 3}
    done = run_here(file_of(in_folder, tasks=["random-3"], methods={"llm": replaying}, seeds=3), "--out", "again")
    assert done.exit_code == 0, done.output
    assert not chat_server.requests
    assert "skipped: again, 1 cell: there is no first/runs/llm/{task}/seed{seed}" in done.output
    for seed in range(2):
        first, again = (trials(in_folder / place / f"runs/llm/random-3/seed{seed}") for place in ("first", "again"))
        assert [trial["params"] for trial in first] == [trial["params"] for trial in again]
