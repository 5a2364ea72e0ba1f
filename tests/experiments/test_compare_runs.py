"""Comparisons of runs: statistics, tables, figures, and runs that cannot be compared."""

import csv
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pymoo.indicators.hv import HV
from scipy.stats import wilcoxon
from typer.testing import CliRunner

from armwright import Problem, Task, find_front, load_task, optimize, read_run
from armwright.cli.app import app
from armwright.exceptions import RunFolderError, SettingsError
from armwright.experiments.compare_runs import Comparison, compare_runs, compare_summaries
from armwright.experiments.run_record import RunSummary, find_runs, read_run_summary, shares_by_source
from armwright.experiments.statistics import interval, paired_test
from armwright.experiments.tables import markdown, write_tables
from armwright.pictures.comparison_figures import write_comparison_figures
from armwright.proof.front_gap import known_front
from tests.support.chat_server import ChatServer, wants_design
from tests.support.wire_formats import llm_proposer

SEEDS = range(3)
TASKS = ("target-1", "random-4")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run black box and rules on two tasks with three seeds, 12 counted trials each."""
    place = tmp_path_factory.mktemp("runs")
    for task in TASKS:
        for proposer in ("none", "rules"):
            for seed in SEEDS:
                optimize(
                    Problem(load_task(task)), proposer=proposer, n_init=4, n_step=4, n_total=12, seed=seed,
                    out=place / f"{task}-{proposer}-{seed}", verify=False,
                )  # fmt: skip
    return place


@pytest.fixture
def comparison(runs: Path) -> Comparison:
    return compare_runs(runs, baseline="BBO (12 trials)")


def changed(folder: Path, change: Callable[[dict], None]) -> None:
    """Change a run's summary."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    change(summary)
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")


def test_table_values_match_the_hypervolume_histories(runs: Path, comparison: Comparison) -> None:
    assert len(comparison.rows) == 4
    for row in comparison.rows:
        proposer = "none" if row.method.startswith("BBO (") else "rules"
        summaries = [
            json.loads((runs / f"{row.task}-{proposer}-{s}/summary.json").read_text(encoding="utf-8")) for s in SEEDS
        ]
        curves = np.array([summary["hypervolume"]["history"] for summary in summaries])
        assert curves.shape == (3, 12)
        assert row.e_hv == interval([summary["hypervolume"]["mean"] for summary in summaries])
        # METHOD 7: the mean over the trials of the mean, and of the deviation, over the seeds.
        assert row.e_hv.mean == pytest.approx(np.mean([np.mean(at) for at in curves.T]))
        assert row.sigma_hv == pytest.approx(np.mean([np.std(at) for at in curves.T]))
        assert row.final.mean == pytest.approx(curves[:, -1].mean())
        share = row.share_of_best_known
        assert share is None if row.task == "random-4" else share is not None and 0.0 < share.mean < 1.0
    assert len(comparison.contrasts) == 2
    for contrast in comparison.contrasts:
        ours, theirs = (
            [run.curve.mean() for run in comparison.runs_of(method, contrast.task)]
            for method in (contrast.method, contrast.baseline)
        )
        assert contrast.test == paired_test(ours, theirs)
        assert contrast.p_holm is None, "three pairs are too few for a test"


def test_methods_are_compared_with_each_that_they_name(runs: Path) -> None:
    records = [read_run_summary(runs / f"{TASKS[0]}-none-0", "none")]
    records += [replace(records[0], method=f"m{i}", seed=seed) for i in range(3) for seed in range(min(2, i + 1))]
    labels = ["none", "m0", "m1", "m2"]
    found = Comparison(records, labels, TASKS[:1], "none", {"m1": ["none", "m0"], "m2": ["m1", "gone"]})
    pairs = [(contrast.method, contrast.baseline, contrast.test.n) for contrast in found.contrasts]
    assert pairs == [("m0", "none", 1), ("m1", "none", 1), ("m1", "m0", 1), ("m2", "m1", 2)]
    text = markdown(found, "x")
    assert re.search(r"(?m)^\| m1 +\| 0, 1 +\| \*\*", text), "seeds are stated"
    assert not re.search(r"(?m)^\| m0 +\| 0 +\| \*\*", text), "only methods with the most runs can be the best"


def test_shares_by_source_add_up(comparison: Comparison) -> None:
    for task in comparison.tasks:
        for method in comparison.methods:
            shares = shares_by_source(comparison.runs_of(method, task))
            assert list(shares)[:2] == ["random", "bbo"]
            assert [share["trials"] for share in shares.values()] == ([4, 9, 3] if "rules" in method else [4, 12])
            for part in ("front", "gained"):
                assert sum(share[part] for share in shares.values()) == pytest.approx(1.0)


def test_p_is_shown_and_corrected_from_six_pairs_on(runs: Path, tmp_path: Path) -> None:
    records = [read_run_summary(folder) for folder in find_runs([runs])]
    more = [replace(run, seed=run.seed + 3) for run in records if run.task == "target-1"]
    comparison = compare_summaries([*records, *more], baseline="BBO (12 trials)")
    by_task = {contrast.task: contrast for contrast in comparison.contrasts}
    tested = by_task["target-1"]
    assert (tested.test.n, tested.p_holm) == (6, tested.test.p), "the only test"
    assert by_task["random-4"].p_holm is None
    write_tables(tmp_path, comparison, "x")
    rows = csv.DictReader((tmp_path / "contrasts.csv").read_text(encoding="utf-8").splitlines())
    shown = {row["task"]: (row["p"], row["p_holm"]) for row in rows}
    assert float(shown["target-1"][1]) == tested.test.p
    assert shown["random-4"] == ("", "")


def test_overall_contrast_counts_every_task_once(runs: Path) -> None:
    records = [read_run_summary(folder) for folder in find_runs([runs]) if "target-1" in folder.name]
    gains = [0.9, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6]

    def as_task(run: RunSummary, i: int) -> RunSummary:
        """Return the run on another task, with the hypervolume of rules scaled."""
        gain = gains[i] if "rules" in run.method else 1.0
        history = [gain * value for value in run.summary["hypervolume"]["history"]]
        summary = {**run.summary, "hypervolume": {**run.summary["hypervolume"], "history": history}}
        return replace(run, task=f"task-{i}", summary=summary)

    several = [as_task(run, i) for i in range(7) for run in records]
    (over,) = compare_summaries(several).overall
    means = {m: np.mean([run.curve.mean() for run in records if run.method == m]) for m in {r.method for r in records}}
    ours = next(mean for method, mean in means.items() if "rules" in method)
    ratios = np.array(gains) * ours / next(mean for method, mean in means.items() if "rules" not in method)
    assert over.ratio.mean == pytest.approx(ratios.mean())
    assert over.test.p == pytest.approx(wilcoxon(np.log(ratios)).pvalue)
    assert over.test.better == int(np.sum(ratios > 1.0))
    assert "## Over all tasks" in markdown(compare_summaries(several), "x")
    five = [run for run in several if run.task not in ("task-5", "task-6")]
    assert compare_summaries(five).overall == []


def test_flagged_runs_are_excluded_and_scripted_ones_marked(runs: Path, tmp_path: Path) -> None:
    place = shutil.copytree(runs, tmp_path / "runs")
    for seed in SEEDS:
        changed(place / f"target-1-rules-{seed}", lambda s: s["proposer"].update(origin="scripted", model="gpt-x"))
    changed(place / "target-1-rules-1", lambda s: s["proposer"].update(flagged=True, fallback_share=0.5))
    found = compare_summaries([read_run_summary(folder) for folder in find_runs([place])])
    assert [run.seed for run in found.runs if run.folder.name.startswith("target-1-rules")] == [0, 2]
    assert "excluded, because 50% of its proposals failed" in markdown(found, "x")
    assert "[scripted]" in markdown(found, "x")
    assert "gpt-x" not in markdown(found, "x")


def test_incomparable_runs_are_refused(runs: Path, tmp_path: Path) -> None:
    record = read_run_summary(runs / "target-1-none-0")
    for words, task, settings in (
        ("targets differ", Task(name="target-1", targets=((0.3, 0.0, 0.2),), reference_point=(5.0, 5.0)), {}),
        ("12 and 13 counted trials", load_task("target-1"), {"n_total": 13}),
    ):
        out = tmp_path / words.split()[0]
        optimize(Problem(task), proposer="none", n_init=4, seed=1, out=out, verify=False, **{"n_total": 12, **settings})
        with pytest.raises(SettingsError, match=words):
            compare_summaries([record, read_run_summary(out)])
    copy = shutil.copytree(runs / "target-1-none-0", tmp_path / "copy")
    with pytest.raises(SettingsError, match="leave one out"):
        compare_summaries([record, read_run_summary(copy)])
    with pytest.raises(SettingsError, match='no run has the method "x"'):
        compare_summaries([record], "x")
    (copy / "summary.json").unlink()
    with pytest.raises(RunFolderError, match="not finished"):
        read_run_summary(copy)
    with pytest.raises(SettingsError, match="no finished run"):
        compare_summaries([])


@pytest.mark.slow
def test_runs_with_different_reference_points_share_their_maximum(tmp_path: Path) -> None:
    task = Task(name="mine", targets=load_task("shelf").targets)
    stated = task.model_copy(update={"reference_point": (0.5, 9.0)})
    for seed in SEEDS:
        for proposer in ("none", "rules"):
            optimize(Problem(task), proposer=proposer, n_init=4, n_total=6, n_step=3, seed=seed, verify=False,
                     out=tmp_path / f"{proposer}-{seed}")  # fmt: skip
    optimize(Problem(stated), sampler="random", proposer="none", n_init=4, n_total=6, verify=False, out=tmp_path / "s")
    find_front(Problem(task), evaluations=2000, out=tmp_path / "front")
    records = [read_run_summary(folder) for folder in find_runs([tmp_path])]
    own = [record.config.reference_point for record in records]
    assert len(set(own)) > 2
    found = compare_summaries(records)
    shared = tuple(max(values) for values in zip(*own, strict=True))
    assert found.widened == ["mine"]
    assert found.reference_point("mine") == shared
    assert found.runs
    for run in found.runs:
        values = read_run(run.folder)[1].values
        if len(run.curve):  # pymoo's hypervolume, after each counted trial
            assert run.curve == pytest.approx([HV(np.array(shared))(values[: 4 + i]) for i in range(1, 7)])
        assert run.final == pytest.approx(HV(np.array(shared))(values))
        if run.proposer:
            assert sum(run.gained.values()) == pytest.approx(1.0)
    text = markdown(found, "x")
    assert "mine: runs had different reference points" in text
    assert f"{shared[0]:.4g}, {shared[1]:.4g}" in text


def test_front_search_is_compared_with_studies(runs: Path, tmp_path: Path) -> None:
    find_front(Problem(load_task("target-1")), evaluations=1000, out=tmp_path / "front")
    found = compare_summaries([read_run_summary(folder) for folder in [runs / "target-1-none-0", tmp_path / "front"]])
    row = next(row for row in found.rows if row.method == "front search")
    assert row.e_hv is None
    assert row.final.mean > 8.0
    assert "front search" in markdown(found, "x")
    assert "hypervolume-methods.png" in {path.name for path in write_comparison_figures(tmp_path, found)}


def test_markdown_and_csv_tables_agree(comparison: Comparison, tmp_path: Path) -> None:
    comparison.published, comparison.published_in = {("BBO (12 trials)", "target-1"): (6.7, 2.03)}, "The Paper"
    files = write_tables(tmp_path, comparison, "All", ["one cell is missing"])
    assert {path.name for path in files} >= {"table.md", "table.csv", "contrasts.csv"}
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(comparison.rows) == 4
    for row in rows:
        assert f"{float(row['e_hv']):.2f} ({float(row['sigma_hv']):.2f})" in text
    for words in ("6.70 (2.03)", "The Paper", "one cell is missing", "the smallest p of 3 pairs is 0.25"):
        assert words in text
    assert all(line.endswith("|") for line in re.findall(r"(?m)^\|.*$", text))


@pytest.mark.slow
def test_all_comparison_figures_are_written(comparison: Comparison, tmp_path: Path) -> None:
    names = {path.stem for path in write_comparison_figures(tmp_path, comparison, samples=["BBO/rules (12 trials)"])}
    assert names >= {
        "targets", "area", "hypervolume-methods", "samples-target-1", "solution-1-target-1", "solution-2-target-1",
    }  # fmt: skip
    for name in names:
        assert (tmp_path / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        pdf = (tmp_path / "figures" / f"{name}.pdf").read_bytes()
        assert b"/FontFile2" in pdf, "the fonts are embedded, as TrueType"


@pytest.mark.slow
def test_reasons_with_markup_are_drawn_as_plain_text(tmp_path: Path, chat_server: ChatServer) -> None:
    words = "Step 1: $\\alpha_{x \x1b[31m and _no_ markup\n" + "reason " * 3000
    problem = Problem(load_task("target-1"))
    known = known_front(problem)
    best = json.dumps({**known.designs[0].params, "reason": "the most precise of all"})  # so it becomes Solution 1
    chat_server.answer = lambda request: best if wants_design(request) else words
    proposer = llm_proposer(chat_server.url, origin="scripted")
    optimize(problem, proposer=proposer, n_init=4, n_step=2, n_total=4, out=tmp_path / "run")
    found = compare_summaries([read_run_summary(tmp_path / "run", "no $\\alpha_{x markup")])
    names = {path.stem for path in write_comparison_figures(tmp_path, found)}
    assert "reasoning-target-1" in names


def test_compare_command(runs: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    result = runner.invoke(app, ["compare", str(runs), "--out", str(tmp_path / "out"), "--no-figures"])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "out" / "table.md").is_file()
    with pytest.raises(RunFolderError, match="there is no"):
        find_runs([tmp_path / "nothing"])
