"""`armwright design`: front searches in a run folder."""

import json
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from armwright import Problem, Task, find_front, load_task, optimize, read_run, write_figures
from armwright.exceptions import RunConflictError, RunFolderError, SettingsError
from armwright.pareto import front_mask, hypervolume
from armwright.proof.front_gap import known_front
from armwright.proof.results import read_summary
from armwright.proof.verification import verify_front
from armwright.search.front.front_search import SMALLEST_BATCH, FrontSearch
from armwright.spaces.design_space import default_space, paper_space
from armwright.study.front.direct_search import SHORT_FIRST_BATCH, FrontRun
from tests.support.controlled_runs import interrupt_at

PROBLEM = Problem(load_task("target-1"))


OPEN = Task(name="open", targets=((0.3, 0.0, 0.3), (0.2, 0.1, 0.4)))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> FrontRun:
    return find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path_factory.mktemp("front") / "run")


def test_trials_of_a_front_run_are_its_front(done: FrontRun) -> None:
    assert done.folder is not None
    values = done.history.values
    assert len(values) > 20
    assert front_mask(values).all()
    assert np.all(np.diff(values[:, 0]) > 0)
    assert np.all(values < 5.0)
    assert np.array_equal(PROBLEM.evaluate([trial.design for trial in done.history]).values, values)
    assert {trial.source for trial in done.history} == {"front_search"}
    config, read = read_run(done.folder)
    assert config == done.config
    assert read.trials == list(done.history.trials)


def test_front_run_writes_summary_and_designs(done: FrontRun) -> None:
    assert done.folder is not None
    summary = read_summary(done.folder)
    assert summary == json.loads(json.dumps(done.summary))
    assert summary is not None
    search = summary["search"]
    assert 6000 <= search["evaluations"] <= 6000 + 3000
    assert search["ended_by"] == "budget"
    # The history and the final value are of all that was found; designs that differ too little are left out.
    final = summary["hypervolume"]["final"]
    assert search["hypervolume_history"][-1][1] == pytest.approx(final, rel=5e-3)
    assert 0.99 * final < hypervolume(done.history.values, (5, 5)) <= final
    assert summary["front_gap"]["share"] == pytest.approx(final / summary["front_gap"]["hypervolume"])
    assert summary["verification"]["robust"] + summary["verification"]["sensitive"] == len(done.history)
    for member in done.front[:: len(done.front) // 5]:
        mujoco.MjModel.from_xml_path(str(done.folder / f"designs/{member.number:04d}/arm.urdf"))


@pytest.mark.slow
def test_resumed_front_run_equals_uninterrupted_one(done: FrontRun, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path / "run", watch=interrupt_at(3000))
    assert read_summary(tmp_path / "run") is None
    run = find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path / "run")
    assert 3000 <= run.resumed < 6000
    assert np.array_equal(run.history.values, done.history.values)
    assert [t.design for t in run.history] == [t.design for t in done.history]
    # Once more: nothing is left to do. A larger budget goes on.
    again = find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path / "run")
    assert again.summary == read_summary(tmp_path / "run")
    longer = find_front(PROBLEM, evaluations=8000, seed=1, out=tmp_path / "run")
    assert longer.resumed == run.summary["search"]["evaluations"]
    assert hypervolume(longer.history.values, (5, 5)) >= hypervolume(run.history.values, (5, 5))


@pytest.mark.slow
def test_resumed_front_run_of_a_cycle_is_screened_identically(tmp_path: Path) -> None:
    problem = Problem(load_task("dispensing"), default_space("dispensing"))
    whole = find_front(problem, evaluations=650, seed=1)
    with pytest.raises(KeyboardInterrupt):
        find_front(problem, evaluations=650, seed=1, out=tmp_path / "run", watch=interrupt_at(600))
    run = find_front(problem, evaluations=650, seed=1, out=tmp_path / "run")
    assert run.resumed == 600
    assert np.array_equal(run.history.values, whole.history.values)
    assert run.summary["search"]["evaluations"] == SHORT_FIRST_BATCH + 5 * SMALLEST_BATCH


@pytest.mark.slow
def test_smallest_arms_are_found_among_larger_ones() -> None:
    """The cheapest known arms of this task have four joints; with five, feasible ones are found much earlier."""
    problem = Problem(load_task("desk-sorting"), default_space("desk-sorting"))
    known = known_front(problem)
    assert known is not None
    assert problem.reference_point is not None
    run = find_front(problem, evaluations=1500, seed=0)
    assert len(run.front[0].design.joints) == len(known.designs[0].joints) == 4
    assert run.front[0].values[0] <= 1.1 * known.values[0, 0]
    assert run.summary["hypervolume"]["final"] > 0.95 * hypervolume(known.values, problem.reference_point)


@pytest.mark.slow
def test_front_run_starts_from_a_run(tmp_path: Path) -> None:
    study = optimize(PROBLEM, proposer="rules", n_total=30, seed=0, out=tmp_path / "study")
    run = find_front(PROBLEM, evaluations=500, seed=0, initial_designs=tmp_path / "study", out=tmp_path / "a")
    together = np.vstack([run.history.values, study.history.values])
    assert hypervolume(together, (5, 5)) <= run.summary["hypervolume"]["final"] * (1 + 1e-9)  # nothing is lost
    with pytest.raises(SettingsError, match="another task"):
        find_front(Problem(OPEN), initial_designs=tmp_path / "study")
    with pytest.raises(RunFolderError, match="not a run folder"):
        find_front(PROBLEM, initial_designs=tmp_path / "nothing")
    with pytest.raises(RunConflictError, match="initial_designs"):
        find_front(PROBLEM, evaluations=500, seed=0, out=tmp_path / "a")


def test_front_run_refuses_folders_of_other_runs(done: FrontRun, tmp_path: Path) -> None:
    with pytest.raises(RunConflictError, match="seed: 1 stored, 2 requested"):
        find_front(PROBLEM, evaluations=100, seed=2, out=done.folder)
    with pytest.raises(RunConflictError):
        optimize(PROBLEM, proposer="none", n_total=5, seed=1, out=done.folder)
    optimize(PROBLEM, proposer="none", n_init=2, n_total=2, seed=1, out=tmp_path / "study")
    with pytest.raises(RunConflictError):
        find_front(PROBLEM, evaluations=100, seed=1, out=tmp_path / "study")


def test_damaged_search_state_is_reported(tmp_path: Path) -> None:
    find_front(PROBLEM, evaluations=300, seed=1, out=tmp_path / "run")
    state = tmp_path / "run" / "search.npz"
    for content in (b"", b"PK\x03\x04 nothing", state.read_bytes()[:500]):
        state.write_bytes(content)
        with pytest.raises(RunFolderError, match=r"search\.npz is damaged"):
            find_front(PROBLEM, evaluations=600, seed=1, out=tmp_path / "run")
    before = read_run(tmp_path / "run")[1]
    state.unlink()
    anew = find_front(PROBLEM, evaluations=600, seed=1, out=tmp_path / "run")
    assert anew.summary["hypervolume"]["final"] >= hypervolume(before.values, (5, 5))


@pytest.mark.slow
def test_front_run_stopped_within_a_generation_resumes_identically(
    done: FrontRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    select, calls = FrontSearch._select, [0]  # pyright: ignore[reportPrivateUsage]

    def interrupted(self: FrontSearch, rows: Any, values: Any) -> None:
        calls[0] += 1
        if calls[0] in (1, 20):
            raise KeyboardInterrupt
        select(self, rows, values)

    monkeypatch.setattr(FrontSearch, "_select", interrupted)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path / "run")
    run = find_front(PROBLEM, evaluations=6000, seed=1, out=tmp_path / "run")
    assert run.resumed > 0
    assert np.array_equal(run.history.values, done.history.values)


@pytest.mark.slow
def test_front_outside_the_reference_box_is_kept_and_resumed(tmp_path: Path) -> None:
    content = {"name": "far", "targets": [[9.0, 0.0, 0.0]], "reference_point": [1.0, 1.0]}
    far = Task.model_validate(content | {"constraints": ["worst_error <= 12"]})
    for evaluations in (600, 900):
        run = find_front(Problem(far), evaluations=evaluations, out=tmp_path / "run")
        assert run.summary["hypervolume"]["final"] == 0.0
        assert front_mask(run.history.values).all()
        assert 0 < len(run.history) <= 300
        assert write_figures(tmp_path / "run")


@pytest.mark.slow
def test_gpu_run_is_verified_without_a_gpu(tmp_path: Path) -> None:
    find_front(PROBLEM, evaluations=300, out=tmp_path / "run")
    config = tmp_path / "run" / "config.yaml"
    config.write_text(config.read_text(encoding="utf-8").replace("device: cpu", "device: cuda"), encoding="utf-8")
    assert "device: cuda" in config.read_text(encoding="utf-8")
    verification = verify_front(read_run(tmp_path / "run")[1])
    assert verification is not None
    assert verification.robust.any()
    assert write_figures(tmp_path / "run")


def test_front_run_finds_a_missing_reference_point() -> None:
    run = find_front(Problem(OPEN), evaluations=2500, seed=0)
    assert run.folder is None
    assert run.config.reference_point == run.history.reference_point
    assert run.summary["hypervolume"]["final"] > 0.0
    assert run.summary["front_gap"] is None


def test_front_run_ends_at_a_stall() -> None:
    narrow = paper_space(1).model_copy(update={f"origin_{axis}": (0.0, 0.0) for axis in "xyz"})
    near = Task(name="near", targets=((0.2, 0.0, 0.2), (0.1, 0.1, 0.2)))
    run = find_front(Problem(near, narrow), evaluations=1_000_000, seed=0)
    assert run.summary["search"]["ended_by"] == "stall"
    assert run.summary["search"]["evaluations"] < 100_000
