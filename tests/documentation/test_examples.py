"""Run the examples as a user does."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import mujoco  # noqa: F401 (here, since its window library starts a process, which no fast test may)
import numpy as np
import pytest
from typer.testing import CliRunner

import armwright as aw
from armwright.cli.app import app
from armwright.kinematics.reach.compliance import Stiffness
from armwright.problem.evaluation import Evaluation
from armwright.problem.objectives import QUANTITIES
from armwright.proof.selection import pick_from
from armwright.runs.history import FrontMember
from tests.support.chat_server import Answer, ChatServer, Request
from tests.support.documentation import PAGES, commands
from tests.support.examples import EXAMPLES, example_tasks
from tests.support.frame_program import frame_displacement

# The other tasks are run by the pages that show them (test_pages.py).
SHOWN = {word for page in PAGES for command in commands(page) for word in command.text.split()}
TASKS = {task: given for task, given in example_tasks().items() if f"examples/{task.name}" not in SHOWN}


def run(example: str, *options: str) -> str:
    command = [sys.executable, "-W", "error", EXAMPLES / example, *options]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, encoding="utf-8").stdout


def told(server: ChatServer) -> tuple[str, ...]:
    return ("--model", "test-model", "--base-url", server.url, "--origin", "scripted")


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.stem)
@pytest.mark.slow
def test_example_tasks_that_no_page_shows_run(task: Path, tmp_path: Path) -> None:
    space, evaluator = TASKS[task]
    spaces = ["--space", str(space)] if space else []
    spaces += ["--evaluator", evaluator] if evaluator else []
    options = ["--n-init", "5", "--n-total", "10", "--no-figures", "--json", "--out", str(tmp_path / "run")]
    result = CliRunner().invoke(app, ["optimize", str(task), *spaces, *options])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["n_trials"] == 15


def knee_of(name: str, out: Path) -> tuple[FrontMember, Evaluation]:
    """The recommended arm of a direct search of an example, and its physics."""
    space = ["--space", str(EXAMPLES / "8-stiffness-space.yaml")]
    options = ["--evaluations", "2000", "--no-figures", "--out", str(out)]
    result = CliRunner().invoke(app, ["design", str(EXAMPLES / name), *space, *options])
    assert result.exit_code == 0, result.output
    history, (knee, *_), _ = pick_from(out)
    return knee, history.evaluation([knee.number])


@pytest.mark.slow
def test_bound_for_the_deflection_changes_the_recommended_arm(tmp_path: Path) -> None:
    """PyNite finds the same deflections."""
    diameters: list[list[float]] = []  # [mm]
    deflections: list[float] = []  # [m]
    for name in ("8-stiffness-unbounded-task.yaml", "8-stiffness-task.yaml"):
        knee, evaluation = knee_of(name, tmp_path / name)
        arms, payload = evaluation.arms, evaluation.payload
        drives = evaluation.drives
        stiffness = Stiffness(arms.bending_stiffness, arms.torsional_stiffness, drives.joint_stiffness)
        found = [
            frame_displacement(knee.arm, q, stiffness, float(payload[t]), np.array(evaluation.load_shape.center))
            for t, q in enumerate(evaluation.q[0])
        ]
        deflections.append(float(QUANTITIES["deflection"](evaluation)[0]))
        assert deflections[-1] == pytest.approx(np.linalg.norm(found, axis=1).max(), rel=1e-4)
        diameters.append([float(str(knee.design.params[f"tube_{j}"]).split("x")[0]) for j in (1, 2, 3)])
    assert deflections[0] > 0.01
    assert deflections[1] <= 0.001
    assert min(diameters[1]) > max(diameters[0])


@pytest.mark.slow
def test_scikit_learn_example_runs(chat_server: ChatServer) -> None:
    def answer(request: Request) -> Answer:
        if "response_format" not in request:
            return "A linear machine, I should say."
        parameters = {"classifier": "svc", "svc_kernel": "linear", "svc_C": 0.1}
        return json.dumps({"parameters": parameters, "reason": "few samples"})

    chat_server.answer = answer
    text = run("optuna_scikit_learn.py", "--n-trials", "10", *told(chat_server))
    assert re.search(r"Optuna alone: +accuracy 0\.\d{4} with \{'classifier'", text)
    assert re.search(r"  trial 9: accuracy 0\.97\d\d; few samples", text)
    assert "1 proposals by test-model, faults: none" in text
    prompt = chat_server.prompts()[0]
    assert "- forest_trees: whole number, 10 to 100 in steps of 10; conditional: " in prompt
    assert "always with classifier = forest" in prompt


@pytest.mark.slow
def test_zdt1_example_runs(chat_server: ChatServer) -> None:
    def answer(request: Request) -> Answer:
        if "response_format" not in request:
            return "All but the first at 0."
        parameters = {f"x{i:02d}": 0.0 for i in range(1, 31)} | {"x01": 0.25}
        return json.dumps({"parameters": parameters, "reason": "g = 1"})

    chat_server.answer = answer
    text = run("optuna_zdt1.py", "--n-trials", "40", *told(chat_server))
    alone, proposed = (float(volume) for volume in re.findall(r"hypervolume ([\d.]+)", text))
    assert proposed > alone
    assert "4 proposals by test-model, 4 of them on the front, faults: none" in text


@pytest.mark.slow
def test_example_without_a_model_falls_back_to_rules() -> None:
    """Rules propose instead."""
    said = run("optuna_zdt1.py", "--n-trials", "20")
    assert "No language model is configured (--model, ARMWRIGHT_MODEL): built-in rules propose instead." in said
    assert "2 proposals by rules" in said


@pytest.mark.slow
def test_python_code_of_the_optuna_page_runs(in_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = (EXAMPLES.parent / "docs" / "optuna.md").read_text(encoding="utf-8")
    asking, *others = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    compile(asking, "optuna.md", "exec")  # needs a model
    assert len(others) == 3
    (in_folder / "optunahub").symlink_to(EXAMPLES.parent / "optunahub")
    for code in others:
        exec(code, {})
    assert capsys.readouterr().out == "3 Counter()\n"


def test_mujoco_example_follows_the_ik_postures() -> None:
    """Strong motors bring the tip to the IK posture, up to the deflection by gravity."""
    follow = aw.load_evaluator(f"{EXAMPLES}/mujoco_simulation.py:follow")
    problem = aw.Problem(aw.load_task("target-1"))
    designs = problem.space.sample(3, 0)
    errors = problem.evaluate(designs).values[:, 0]
    for design, error in zip(designs, errors, strict=True):
        distance, work = follow(problem.arm(design), problem.task)
        assert distance == pytest.approx(error, abs=0.02)  # m, of six to nine targets together
        assert work > 0.0


def codesign() -> tuple[Any, aw.Problem, list[aw.Design]]:
    """The module of the example of arm and controller, its problem, and designs that the controller keeps stable."""
    evaluator = aw.load_evaluator(f"{EXAMPLES}/design_and_control.py:drive")
    space = aw.load_space(EXAMPLES / "9-codesign-space.yaml")
    task = aw.load_task(str(EXAMPLES / "9-codesign-task.yaml"))
    calm = {"kp": 5.0, "kd": 0.1, "pace_loaded": 0.5, "pace_empty": 0.5}
    sampled = space.sample(40, 0)
    feasible = (aw.Problem(task, space).evaluate(sampled).violations <= 0.0).all(axis=1)
    designs = [space.design({**design.params, **calm}) for design, ok in zip(sampled, feasible, strict=True) if ok]
    return sys.modules[evaluator.measure.__module__], aw.Problem(task, space, evaluator=evaluator), designs[:3]


@pytest.mark.slow
def test_codesign_example_needs_softer_motion_for_smaller_errors() -> None:
    """Slower and stiffer arms follow more closely; the same design has the same values each time."""
    _, problem, designs = codesign()
    for design in designs:
        duration, energy, error = problem.evaluate([design]).values[0]
        assert tuple(problem.evaluate([design]).values[0]) == (duration, energy, error)
        fast = problem.space.design({**design.params, "pace_loaded": 1.5, "pace_empty": 1.5})
        soft = problem.space.design({**design.params, "kp": 1.0})
        assert problem.evaluate([fast]).values[0, 0] < duration
        assert min(problem.evaluate([fast]).values[0, 2], problem.evaluate([soft]).values[0, 2]) > error > 0.0
        assert energy > 0.0


@pytest.mark.slow
def test_gears_of_the_codesign_example_trade_torque_for_speed() -> None:
    module, problem, designs = codesign()
    arm = problem.arm(designs[0])
    geared = module.Drives.of(module.geared(arm, designs[0]))
    bare, gears = module.Drives.of(arm), [float(designs[0].params[f"gear_{j}"]) for j in (1, 2, 3)]
    assert geared.peak == pytest.approx(bare.peak * gears * module.EFFICIENCY)
    assert geared.no_load == pytest.approx(bare.no_load / gears)
    torque = geared.limited(np.full(3, 1e3), geared.no_load / 2.0)
    assert np.all(torque <= geared.peak)
    assert geared.limited(np.full(3, 1e3), 2.0 * geared.no_load).tolist() == [0.0] * 3
    assert geared.limited(np.full(3, -1e3), 2.0 * geared.no_load) == pytest.approx(-geared.peak)
