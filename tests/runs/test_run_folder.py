"""The files of a run, and damage to them."""

import csv
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from armwright import Problem, StudyResult, load_task, optimize, read_run, to_urdf
from armwright.exceptions import ArmwrightError, RunConflictError, RunFolderError
from armwright.proof.results import read_summary

PROBLEM = Problem(load_task("target-1"))


def short(out: Path, n_total: int = 8) -> StudyResult:
    return optimize(PROBLEM, proposer="rules", n_init=5, n_step=4, n_total=n_total, seed=0, out=out)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    return short(tmp_path_factory.mktemp("finished") / "run")


@pytest.fixture
def run(finished: StudyResult, tmp_path: Path) -> StudyResult:
    """Return a copy of a finished run, which a test may damage."""
    shutil.copytree(folder(finished), tmp_path / "run")
    return replace(finished, folder=tmp_path / "run")


def folder(run: StudyResult) -> Path:
    assert run.folder is not None
    return run.folder


def test_run_folder_has_the_documented_files(run: StudyResult) -> None:
    names = {path.name for path in folder(run).iterdir()} - {".lock"}
    results = {"trials.csv", "front.csv", "summary.json", "designs"}
    assert names == {"config.yaml", "trials.jsonl", *results}


def test_trials_are_one_json_line_each(run: StudyResult) -> None:
    lines = [json.loads(line) for line in (folder(run) / "trials.jsonl").read_text(encoding="utf-8").splitlines()]
    for line, trial in zip(lines, run.trials, strict=True):
        reason = ["reason"] if trial.source == "rules" else []
        assert list(line) == ["number", "source", "proposal", "params", "values", *reason, "seconds", "q"]
        assert line["number"] == trial.number
        assert line["params"] == dict(trial.design.params)
        assert line["values"] == list(trial.values)
        assert np.array_equal(np.float32(line["q"]), np.float32(run.history.evaluation([trial.number]).q[0]))
        assert set(line["seconds"]) == {"total", "sampling", "evaluation", "proposing"}


def test_config_reproduces_the_run(run: StudyResult) -> None:
    config = yaml.safe_load((folder(run) / "config.yaml").read_text(encoding="utf-8"))
    assert config["task"]["targets"][0] == [-0.45, -0.45, -0.45]
    assert config["method"]["proposer"] == {"name": "rules"}
    assert [config["method"][name] for name in ("sampler", "n_init", "n_step", "n_total")] == ["tpe", 5, 4, 8]
    assert config["seed"] == 0
    assert {"armwright", "optuna", "warp-lang", "python"} <= set(config["versions"])
    read, history = read_run(folder(run))
    assert read == run.config
    assert list(history) == list(run.trials)


def test_summary_has_the_documented_keys(run: StudyResult) -> None:
    summary = json.loads((folder(run) / "summary.json").read_text(encoding="utf-8"))
    assert summary == read_summary(folder(run)) == run.summary
    assert list(summary) == [
        *("task", "seed", "n_trials", "by_source", "hypervolume", "front_gap", "front_size", "verification"),
        *("duplicates", "attribution", "proposer", "proposer_bias", "seconds", "versions"),
    ]
    assert summary["by_source"] == {"random": 5, "rules": 2, "bbo": 6}
    assert list(summary["hypervolume"]) == ["reference_point", "final", "mean", "history"]
    assert len(summary["hypervolume"]["history"]) == 8
    assert summary["front_size"] == len(run.front)
    assert list(summary["attribution"]) == ["random", "rules", "bbo"]
    gained = [brought["hypervolume_gained"] for brought in summary["attribution"].values()]
    assert sum(gained) == pytest.approx(summary["hypervolume"]["final"])
    assert list(summary["proposer_bias"]) == ["proposer", "black_box"]


def test_front_designs_are_written_with_their_values(run: StudyResult) -> None:
    written = sorted(path.name for path in (folder(run) / "designs").iterdir())
    assert written == sorted(f"{member.number:04d}" for member in run.front)
    assert run.front
    for member in run.front:
        place = folder(run) / "designs" / f"{member.number:04d}"
        record = json.loads((place / "design.json").read_text(encoding="utf-8"))
        assert record["params"] == dict(member.design.params)
        assert record["source"] == member.source
        assert bool(record["reason"]) == (member.source == "rules")
        assert (record["objectives"]["position_error"], record["objectives"]["torque"]) == member.values
        assert sum(target["position_error"] for target in record["targets"]) == pytest.approx(member.values[0])
        norms = [sum(t**2 for t in target["joint_torques"]) ** 0.5 for target in record["targets"]]
        assert 40 * sum(norms) == pytest.approx(member.values[1])
        assert [target["target"] for target in record["targets"]] == [list(t) for t in PROBLEM.task.targets]
        assert {len(target["q"]) for target in record["targets"]} == {4}
        assert (place / "arm.urdf").read_text(encoding="utf-8") == to_urdf(member.arm, name=f"target-1-{member.number}")


def test_designs_that_left_the_front_are_removed(tmp_path: Path) -> None:
    short(tmp_path / "run", n_total=2)
    longer = short(tmp_path / "run", n_total=40)
    written = {path.name for path in (tmp_path / "run" / "designs").iterdir()}
    assert written == {f"{member.number:04d}" for member in longer.front}


@pytest.mark.parametrize("cut", [1, 20, 100])
def test_truncated_last_trial_is_repeated(run: StudyResult, tmp_path: Path, cut: int) -> None:
    trials = folder(run) / "trials.jsonl"
    whole = trials.read_bytes()
    trials.write_bytes(whole[:-cut])
    again = short(tmp_path / "run")
    assert again.resumed == 12
    assert [t.values for t in again.trials] == [t.values for t in run.trials]
    assert len(trials.read_bytes().splitlines()) == 13


def test_derived_files_are_rewritten(run: StudyResult, tmp_path: Path) -> None:
    summary = (folder(run) / "summary.json").read_bytes()
    for name in ("summary.json", "trials.csv", "front.csv"):
        (folder(run) / name).unlink()
    short(tmp_path / "run")
    assert (folder(run) / "summary.json").read_bytes() == summary
    with open(folder(run) / "trials.csv", newline="", encoding="utf-8") as file:
        assert [float(row["torque"]) for row in csv.DictReader(file)] == [trial.values[1] for trial in run.trials]
    with open(folder(run) / "front.csv", newline="", encoding="utf-8") as file:
        assert {int(row["number"]) for row in csv.DictReader(file)} == {member.number for member in run.front}


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda lines: [*lines[:3], b"{broken}\n", *lines[4:]], "line 4 is damaged"),
        (lambda lines: [*lines[:3], *lines[4:]], "line 4 is damaged (expected trial number 3, found 4)"),
        (lambda lines: [*lines[:3], lines[3].replace(b'"values": [', b'"values": [NaN, '), *lines[4:]], "line 4"),
        (lambda lines: [*lines[:3], lines[3].replace(b'"link_1": 0.', b'"link_1": 7.'), *lines[4:]], "link_1 = 7."),
        (lambda lines: [*lines[:3], lines[3].replace(b'"params"', b'"parms"'), *lines[4:]], "params: Field required"),
        (lambda lines: [b"[" * 100_000 + b"\n", *lines[1:]], "line 1 is damaged"),
        (lambda lines: [lines[0].replace(b'"values": [', b'"values": [1' + b"0" * 400 + b", "), *lines[1:]], "line 1"),
        (lambda lines: [lines[0].replace(b'"proposal": null', b'"proposal": 5'), *lines[1:]], "proposal"),
        (lambda lines: [re.sub(rb'"seconds": .*', b'"seconds": 3}', lines[0]), *lines[1:]], "seconds"),
    ],
)
def test_damaged_trials_are_reported_by_line_and_kept(
    run: StudyResult, tmp_path: Path, damage: object, words: str
) -> None:
    trials = folder(run) / "trials.jsonl"
    content = b"".join(damage(trials.read_bytes().splitlines(keepends=True)))  # type: ignore[operator]
    trials.write_bytes(content)
    with pytest.raises(RunFolderError) as refusal:
        short(tmp_path / "run")
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert trials.read_bytes() == content


def test_damaged_config_is_reported(run: StudyResult, tmp_path: Path) -> None:
    (folder(run) / "config.yaml").write_text("task: [", encoding="utf-8")
    with pytest.raises(RunFolderError, match=r"config.yaml is not valid YAML"):
        short(tmp_path / "run")


@pytest.mark.parametrize(
    ("name", "fault", "words"),
    [
        ("trials.jsonl", RunConflictError, r"holds results of a run .* but no trial in trials.jsonl"),
        ("config.yaml", RunFolderError, r"cannot read .*config\.yaml"),
    ],
)
def test_results_without_trials_or_config_are_not_overwritten(
    run: StudyResult, tmp_path: Path, name: str, fault: type[Exception], words: str
) -> None:
    (folder(run) / name).unlink()
    with pytest.raises(fault, match=words):
        short(tmp_path / "run")
    assert (folder(run) / "summary.json").exists()


@pytest.mark.parametrize("name", ["figures/mine.png", "notes.txt", "config.yaml", "designs/0001/arm.urdf"])
def test_folder_with_foreign_files_is_not_touched(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_text("mine: 1\n", encoding="utf-8")
    with pytest.raises(ArmwrightError, match=r"holds no run|unknown key"):
        short(tmp_path)
    assert (tmp_path / name).read_text(encoding="utf-8") == "mine: 1\n"


def test_folder_without_a_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="not a run folder"):
        read_run(tmp_path)
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(RunFolderError, match="cannot write"):
        short(tmp_path / "file")
