"""`design` and `optimize` on the command line."""

import json
from pathlib import Path

import pytest

from tests.cli.test_cli import SHORT
from tests.support.command_line import armwright, refused


@pytest.mark.slow
def test_design_continues_its_run_and_starts_from_another(in_folder: Path) -> None:
    done = armwright("design", "target-1", "--evaluations", "3000", "--seed", "4", "--no-figures")
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for words in ("of the best known hypervolume", "robust", "budget spent", "a toy"):
        assert words in done.stdout
    assert (in_folder / "runs" / "target-1-design-seed4" / "summary.json").is_file()
    more = armwright("design", "target-1", "--evaluations", "4000", "--seed", "4", "--no-figures", "--json")
    summary = json.loads(more.stdout)
    assert summary["search"]["evaluations"] >= 4000
    assert summary["folder"] == "runs/target-1-design-seed4"

    armwright("optimize", "target-1", *SHORT, "--proposer", "none", "--out", "mine")
    again = armwright("optimize", "target-1", *SHORT, "--proposer", "none", "--out", "mine")
    assert "is finished; nothing was computed again" in again.stdout
    where = ("--from", "mine", "--no-figures", "--out", "from-run")
    from_run = armwright("design", "target-1", "--evaluations", "300", *where)
    assert from_run.returncode == 0, from_run.stderr


@pytest.mark.slow
def test_run_without_a_successful_evaluation_ends_with_an_error(in_folder: Path) -> None:
    """Values that are not finite do not stop a run early: other designs may have finite ones."""
    (in_folder / "mine.py").write_text(
        "import armwright as aw\n\n\n"
        '@aw.evaluator("reach [m]", "height [m]")\n'
        "def never(arm, task):\n"
        '    return float("nan"), 1.0\n\n\n'
        '@aw.evaluator("reach [m]", "height [m]")\n'
        "def sometimes(arm, task):\n"
        '    return (float("nan") if arm.base[0] > 0.0 else 1.0), 1.0\n',
        encoding="utf-8",
    )
    for name, code in (("never", 1), ("sometimes", 0)):
        how = ("--sampler", "tpe", "--evaluator", f"mine.py:{name}", "--out", name)
        done = armwright("optimize", "target-1", *SHORT, *how)
        assert done.returncode == code, done.stdout + done.stderr
        assert ("No evaluation succeeded" in done.stdout) == (name == "never")


@pytest.mark.parametrize(
    ("code", "args", "words"),
    [
        (2, ("design", "target-1", "--budget", "5 bananas"), 'budget = "5 bananas"'),
        (2, ("design", "target-1", "--evaluations", "0"), "a budget of 0 evaluations"),
        (2, ("design", "target-1", "--device", "cuda"), "no NVIDIA GPU"),
        (2, ("design", "target-1", "--device", "tpu"), 'device = "tpu" is not one of'),
        (1, ("design", "target-1", "--from", "nothing"), "not a run folder"),
    ],
)
def test_invalid_search_arguments_are_one_line(in_folder: Path, code: int, args: tuple[str, ...], words: str) -> None:
    assert words in refused(code, *args)
    assert not list(in_folder.glob("runs/*"))


def test_optimize_rejects_a_design_run(in_folder: Path) -> None:
    done = armwright("design", "target-1", "--evaluations", "300", "--no-figures", "--out", "run", "--json")
    assert json.loads(done.stdout)["search"]["ended_by"] == "budget"
    assert "holds a run with other settings" in refused(2, "optimize", "target-1", "--out", "run")
    assert "to replay" in refused(1, "optimize", "target-1", "--proposer", "replay:run", "--out", "other")


@pytest.mark.slow
def test_optimize_names_design_for_tasks_with_constraints(in_folder: Path) -> None:
    task = ("name: near", "targets: [[0.3, 0.0, 0.3], [0.2, 0.1, 0.4]]", "reference_point: [1, 1]")
    (in_folder / "free.yaml").write_text("\n".join(task), encoding="utf-8")
    (in_folder / "bound.yaml").write_text("\n".join([*task, "constraints: [worst_error <= 0.01]"]), encoding="utf-8")
    line = "`armwright design bound.yaml` suits this task better"
    assert line in armwright("optimize", "bound.yaml", *SHORT, "--out", "a").stdout
    assert line not in armwright("optimize", "bound.yaml", *SHORT, "--out", "a").stdout  # the run exists
    assert line not in armwright("optimize", "bound.yaml", *SHORT, "--proposer", "rules", "--out", "b").stdout
    assert "suits this task better" not in armwright("optimize", "free.yaml", *SHORT, "--out", "c").stdout
    json.loads(armwright("optimize", "bound.yaml", *SHORT, "--json", "--out", "d").stdout)
