"""Runs with one and three objectives, named objectives, and payloads; against moocore and Pinocchio."""

from dataclasses import replace
from pathlib import Path

import moocore
import numpy as np
import pytest
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import RunFolderError, SettingsError, TaskError
from armwright.problem.arm_quantities import position_error
from armwright.problem.objective import Objective
from armwright.problem.objectives import OBJECTIVES, PAPER_OBJECTIVES, named_objectives
from armwright.problem.problem import Problem
from armwright.runs.folder import read_run
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task

SPREAD = Objective(
    name="spread",
    label="Spread",
    unit="rad",
    symbol="E_spread",
    description="how far the joints turn",
    each=lambda evaluation: np.abs(evaluation.q).sum(axis=-1),
)


ONE, THREE = (position_error,), (*PAPER_OBJECTIVES, SPREAD)


def one(task: Task) -> Problem:
    return Problem(task, objectives=ONE)


def three(task: Task) -> Problem:
    return Problem(task, objectives=THREE)


OPEN = load_task("target-1").model_copy(update={"reference_point": None})


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_nonfinite_objective_is_refused(tmp_path: Path, number: float) -> None:
    broken = (position_error, replace(SPREAD, each=lambda e: np.full(e.position_error.shape, number)))
    with pytest.raises(SettingsError, match="objective spread: expected a finite number"):
        optimize(Problem(OPEN, objectives=broken), proposer="none", n_total=2, out=tmp_path / "run")


def bounded(*point: float) -> Task:
    return OPEN.model_copy(update={"reference_point": point})


def short(problem: Problem, n_total: int, out: Path | None = None) -> StudyResult:
    return optimize(problem, proposer="rules", sampler="tpe", n_init=5, n_step=3, n_total=n_total, out=out)


@pytest.mark.parametrize(
    "problem",
    [
        pytest.param(one(OPEN), marks=pytest.mark.slow),
        three(bounded(5.0, 5.0, 60.0)),
    ],
)
def test_runs_of_one_and_three_objectives_complete_and_resume(tmp_path: Path, problem: Problem) -> None:
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
    gained = [one["hypervolume_gained"] for one in run.summary["attribution"].values()]
    assert sum(gained) == pytest.approx(run.summary["hypervolume"]["final"])


def test_run_folder_is_readable_without_custom_objectives(tmp_path: Path) -> None:
    problem = three(OPEN)
    run = optimize(problem, proposer="none", sampler="random", n_init=4, n_total=1, verify=False, out=tmp_path / "run")
    config, history = read_run(tmp_path / "run")
    assert [o.name for o in history.problem.objectives] == ["position_error", "torque", "spread"]
    assert config == run.config
    assert [member.values for member in history.front] == [member.values for member in run.front]
    with pytest.raises(RunFolderError, match="the custom objective"):
        history.problem.evaluate(problem.space.sample(3, 0))


@pytest.mark.parametrize(("objectives", "point"), [(ONE, (5.0, 5.0)), (THREE, (5.0, 5.0)), (PAPER_OBJECTIVES, (5.0,))])
def test_reference_point_for_other_objectives_is_refused(
    objectives: tuple[Objective, ...], point: tuple[float, ...]
) -> None:
    n = len(objectives)
    with pytest.raises(TaskError, match=rf"reference_point: expected {n} values .*, got {len(point)}"):
        Problem(bounded(*point), objectives=objectives)


LOADED = Task(name="loaded", targets=((0.3, 0.0, 0.2), (0.2, 0.2, 0.3), (0.2, -0.2, 0.4)), payload=(0.5, 0.2, 0.0))


def test_named_objectives_match_their_formulas() -> None:
    names = ["position_error", "torque", "worst_error", "unreached_targets", "peak_torque"]
    names += ["rms_torque", "mass", "length", "joints"]
    problem = Problem(LOADED, objectives=named_objectives(names[:5]))
    rest = Problem(LOADED, objectives=named_objectives(names[5:]))
    designs = problem.space.sample(50, 1)
    evaluation = problem.physics(designs)
    error, torque = evaluation.position_error, evaluation.joint_torques
    told = dict(zip(names, np.hstack([problem.evaluate(designs).values, rest.evaluate(designs).values]).T, strict=True))
    norms = np.linalg.norm(torque, axis=2)
    for row, design in enumerate(designs):
        arm = problem.arm(design)
        assert told["position_error"][row] == pytest.approx(sum(error[row]))
        assert told["torque"][row] == pytest.approx(40.0 * sum(norms[row]))
        assert told["worst_error"][row] == max(error[row])
        assert told["unreached_targets"][row] == sum(e >= 1e-3 for e in error[row])
        assert told["peak_torque"][row] == max(map(abs, torque[row].ravel()))
        assert told["rms_torque"][row] == pytest.approx((sum(n**2 for n in norms[row]) / 3) ** 0.5)
        assert told["mass"][row] == pytest.approx(sum(link.mass for link in arm.links), rel=1e-6)
        assert told["length"][row] == pytest.approx(sum(design.links), rel=1e-6)
        assert told["joints"][row] == len(design.joints)


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["masss"], 'unknown objective "masss".*Did you mean "mass"'),
        (["mass", "mass"], "1 to 5 different ones"),
        ([], "1 to 5 different ones"),
        (list(OBJECTIVES)[:6], "1 to 5 different ones"),
    ],
)
def test_invalid_objective_names_are_refused(names: list[str], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        named_objectives(names)


def test_objectives_option_drops_a_foreign_reference_point(tmp_path: Path) -> None:
    for names in ("position_error,mass", "position_error, torque"):
        out = str(tmp_path / names[-4:])
        options = ["--objectives", names, "--n-init", "4", "--n-total", "4", "--no-figures", "--out", out]
        assert CliRunner().invoke(app, ["optimize", "target-1", *options]).exit_code == 0
    assert read_run(tmp_path / "mass")[0].task.reference_point is None
    assert read_run(tmp_path / "rque")[0].task.reference_point == (5.0, 5.0)
