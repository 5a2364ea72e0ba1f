"""Problems with one objective, or with three: a run completes, resumes, and its numbers are moocore's."""

from dataclasses import replace
from pathlib import Path

import moocore
import numpy as np
import pytest

from armwright.exceptions import RunConflictError, RunFolderError, SettingsError, TaskError
from armwright.objectives import PAPER_OBJECTIVES, POSITION_ERROR, Objective
from armwright.problem import Problem
from armwright.report.figures import chosen_members, write_figures
from armwright.run_folder import read_run
from armwright.study import Run, optimize
from armwright.task import Task, load_task

SPREAD = Objective(
    name="spread",
    label="Spread",
    unit="rad",
    symbol="E_spread",
    words="how far the joints turn",
    each=lambda evaluation: np.abs(evaluation.q).sum(axis=-1),
)


class One(Problem):
    objectives = (POSITION_ERROR,)


class Three(Problem):
    objectives = (*PAPER_OBJECTIVES, SPREAD)


OPEN = load_task("target-1").model_copy(update={"reference_point": None})


def test_polish_within_a_study_of_one_objective() -> None:
    run = optimize(One(OPEN), proposer="none", n_init=3, n_total=8, polish_every=3)
    assert any(trial.refines is not None for trial in run.trials)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_an_objective_that_is_no_finite_number_is_refused(tmp_path: Path, number: float) -> None:
    class Broken(Problem):
        objectives = (POSITION_ERROR, replace(SPREAD, each=lambda e: np.full(e.position_error.shape, number)))

    with pytest.raises(SettingsError, match="objective spread of a design is"):
        optimize(Broken(OPEN), proposer="none", n_total=2, out=tmp_path / "run")


def bounded(*point: float) -> Task:
    return OPEN.model_copy(update={"reference_point": point})


PROBLEMS = [One(OPEN), One(bounded(5.0)), Three(OPEN), Three(bounded(5.0, 5.0, 60.0))]


def short(problem: Problem, n_total: int, out: Path | None = None) -> Run:
    return optimize(problem, proposer="rules", n_init=5, n_step=3, n_total=n_total, out=out)


@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_run_completes_resumes_and_counts_right(tmp_path: Path, problem: Problem) -> None:
    short(problem, 10, tmp_path / "run")
    run = short(problem, 30, tmp_path / "run")
    assert [trial.values for trial in run.trials] == [trial.values for trial in short(problem, 30).trials]
    assert run.resumed == 15
    assert {trial.source for trial in run.trials} == {"random", "rules", "bbo"}
    values = np.array([trial.values for trial in run.trials])
    assert values.shape == (35, len(problem.objectives))
    point = run.config.reference_point
    if problem.reference_point is None:
        first = values[:5][moocore.is_nondominated(values[:5])]
        assert point == pytest.approx(1.1 * first.max(axis=0))
    else:
        assert point == problem.reference_point
    assert point is not None
    front = np.flatnonzero(moocore.is_nondominated(values, keep_weakly=False))
    assert sorted(member.number for member in run.front) == front.tolist()
    inside = values[np.all(values < point, axis=1)]
    assert run.summary["hypervolume"]["final"] == pytest.approx(moocore.hypervolume(inside, ref=point))
    if len(point) == 1:
        assert run.summary["hypervolume"]["final"] == pytest.approx(point[0] - values.min())
    gained = [credit["hypervolume_gained"] for credit in run.summary["credit"].values()]
    assert sum(gained) == pytest.approx(run.summary["hypervolume"]["final"])


@pytest.mark.parametrize("problem", [One(OPEN), Three(OPEN)])
def test_its_folder_is_read_and_drawn_without_its_formulas(tmp_path: Path, problem: Problem) -> None:
    run = short(problem, 12, tmp_path / "run")
    config, history = read_run(tmp_path / "run")
    names = [objective.name for objective in problem.objectives]
    assert [objective.name for objective in history.problem.objectives] == names
    assert config == run.config
    assert [member.values for member in history.front] == [member.values for member in run.front]
    assert history.hypervolume == pytest.approx(run.hypervolume)
    drawn = {path.stem for path in write_figures(tmp_path / "run")}
    assert {"hypervolume", "credit", "arms"} <= drawn
    assert ("front" in drawn) == (len(names) > 1)
    titles = [title for title, _ in chosen_members(history)]
    assert all("position error" in title or "spread" in title or "nee" in title for title in titles)
    with pytest.raises(RunFolderError, match="an objective of its own"):
        history.problem.evaluate(problem.space.sample(1, 0))
    assert (tmp_path / "run" / "trials.csv").read_text().splitlines()[0].endswith(",".join(names))


def test_other_objectives_are_another_run(tmp_path: Path) -> None:
    short(Three(OPEN), 3, tmp_path / "run")
    with pytest.raises(RunConflictError, match="objectives: "):
        short(Problem(OPEN), 3, tmp_path / "run")


@pytest.mark.parametrize(("kind", "point"), [(One, (5.0, 5.0)), (Three, (5.0, 5.0)), (Problem, (5.0,))])
def test_a_reference_point_for_other_objectives_is_refused(kind: type[Problem], point: tuple[float, ...]) -> None:
    n = len(kind.objectives)
    with pytest.raises(TaskError, match=rf"reference_point of {len(point)} values .*; the problem minimises {n}: "):
        kind(bounded(*point))
