"""Recommended designs, verified in the simulator, in summaries and by the command."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import armwright as aw
from armwright.problem.objectives import QUANTITIES
from armwright.proof.perturbations import ASSUMED, HEAVIER, MOVED, NOMINAL, SHIFTED, SUPPLY, Left, Survival
from armwright.proof.recommendation import candidates, recommend, unsafe_roles
from armwright.proof.results import read_summary
from armwright.proof.selection import pick, survival_of
from armwright.proof.simulated_run import Simulator
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from tests.proof.test_simulation import SPACE, Desk
from tests.support.command_line import armwright, refused


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run whose first trial is the desk arm."""
    desk = Desk(objectives=["peak_torque", "length"])
    folder = tmp_path_factory.mktemp("runs") / "desk"
    aw.optimize(
        desk.problem, proposer="none", n_init=1, n_total=1, initial_designs=[desk.design], verify=False, out=folder
    )
    return folder


def test_a_finished_run_states_what_is_verified(run: Path) -> None:
    summary = read_summary(run)
    assert summary is not None
    found = [one.pop("survival") for one in summary["recommended"]]
    assert summary["recommended"] == [
        {"role": role, "design": 0, "status": "verified", "demoted": [], "costs": ""}
        for role in ("knee", "least peak torque", "least length", "least price")
    ]
    assert [list(survival) for survival in found] == [["holds", "verdict", "perturbations", "assumed"]] * 4
    names = [one["name"] for one in found[0]["perturbations"]]
    assert names == [NOMINAL, MOVED, SUPPLY, HEAVIER, SHIFTED]
    assert found[0]["assumed"]["name"] == ASSUMED
    assert {file.name for file in (run / "designs" / "0000").iterdir()} >= {"arm.xml", "trajectory.csv"}


@pytest.mark.slow
def test_simulate_writes_and_prints_the_verdicts(run: Path) -> None:
    content = json.loads(armwright("simulate", run, "--json").stdout)
    assert (content["simulated"], content["passed"]) == (1, 1)
    (design,) = content["designs"]
    assert (design["design"], design["verdict"]) == (0, "pass")
    assert json.loads((run / "simulation.json").read_text(encoding="utf-8")) == content
    assert "#0, verified; holds; least with " in " ".join(armwright("simulate", run).stdout.split())


def test_simulate_refuses_what_it_cannot_drive(run: Path, tmp_path: Path) -> None:
    assert "has the designs 0 to" in refused(2, "simulate", run, "--design", "7")
    assert "use one of them" in refused(2, "simulate", run, "--design", "0", "--all")
    aw.optimize(aw.Problem(aw.load_task("target-1")), proposer="none", n_init=1, n_total=1, verify=False, out=tmp_path)
    assert "has no cycle" in refused(2, "simulate", tmp_path)


def test_pick_states_which_perturbations_a_design_survives(run: Path) -> None:
    summary = read_summary(run)
    assert summary is not None
    survival = summary["recommended"][0]["survival"]
    printed = " ".join(armwright("pick", run).stdout.split())
    assert survival["verdict"] in printed
    assert f"at worst {survival['assumed']['text']}" in printed
    (picked,) = json.loads(armwright("pick", run, "--json").stdout)
    assert picked["survival"] == survival
    _, history = read_run(run)
    assert survival_of(run, history, [0])[0] == survival
    evaluated = survival_of(run.parent, history, [0])[0]  # without a summary
    assert [one["name"] for one in evaluated["perturbations"]] == [one["name"] for one in survival["perturbations"]]


def test_designs_without_a_cycle_are_perturbed_if_they_have_constraints() -> None:
    for constraints, n in (([], 0), (["torque_utilisation <= 0.5"], 4)):
        content = {"name": "hold", "targets": [[0.3, 0.0, 0.2]], "payload": 0.5, "constraints": constraints}
        space = DesignSpace.model_validate(SPACE | {"motor_bodies": False})
        problem = aw.Problem(Task.model_validate(content), space)
        run = aw.optimize(problem, proposer="none", n_init=20, n_total=20, seed=0, verify=False)
        recommended = run.summary.get("recommended", [])
        assert len(recommended) == n
        for one in recommended:
            assert one["status"] == "not simulated"
            names = [found["name"] for found in one["survival"]["perturbations"]]
            assert names == [NOMINAL, MOVED, SUPPLY, HEAVIER, SHIFTED]
            assert one["survival"]["assumed"] is None  # mass and torques of the motors are stated


def test_designs_that_an_evaluator_measured_are_neither_simulated_nor_perturbed() -> None:
    @aw.evaluator("span [m]")
    def measure(arm: aw.Arm, task: aw.Task) -> float:
        return arm.length

    desk = Desk()
    problem = replace(desk.problem, evaluator=measure, objectives=measure.objectives)
    run = aw.optimize(problem, proposer="none", sampler="random", n_init=1, n_total=1, initial_designs=[desk.design])
    assert len(run.summary["recommended"]) == 2
    for one in run.summary["recommended"]:
        assert one["status"] == "not simulated: a custom evaluator measured it"
        assert one["survival"] is None


class Verdicts:
    """A simulator in which some designs fail."""

    members: Mapping[int, Any] = {}
    seconds = 0.0

    def __init__(self, failing: set[int]) -> None:
        self.failing = failing

    def __call__(self, number: int) -> Any:
        fails = number in self.failing
        reasons = ("joint_2 is at its torque limit",) if fails else ()
        return SimpleNamespace(result=SimpleNamespace(verdict="fail" if fails else "pass", reasons=reasons))


@pytest.fixture(scope="module")
def history() -> History:
    return aw.optimize(aw.Problem(aw.load_task("target-1")), proposer="none", n_total=40, verify=False).history


def test_failing_designs_are_demoted_with_their_reason(history: History) -> None:
    order = candidates(history)
    assert list(order) == ["knee", "least position error", "least torque"]
    for index, role in enumerate(("least position error", "least torque")):
        assert history.values[order[role][0], index] == min(member.values[index] for member in history.front)
    knee, second = order["knee"][:2]
    chosen = {one.role: one for one in recommend(history, {}, cast("Simulator", Verdicts({knee})))}
    assert (chosen["knee"].design, chosen["knee"].status) == (second, "verified")
    assert [(one.design, one.reason) for one in chosen["knee"].demoted] == [(knee, "joint_2 is at its torque limit")]
    for one in recommend(history, {}, cast("Simulator", Verdicts({member.number for member in history.front}))):
        assert one.design == order[one.role][0]
        assert one.status == "not verified: joint_2 is at its torque limit"


def survival(history: History, holding: set[int]) -> dict[int, Survival]:
    """Of the front: only some designs hold, the others are too heavy for a motor."""
    left = {False: Left(HEAVIER, False, "reserve 0.96 (torque of joint 2)", 0.96, None)}
    left[True] = Left(HEAVIER, True, "reserve 1.48 (torque of joint 2)", 1.48, None)
    return {one.number: Survival.of({HEAVIER: left[one.number in holding]}) for one in history.front}


def test_designs_that_hold_are_taken_before_better_ones_nearby(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulator = cast("Simulator", Verdicts(set()))
    order = candidates(history)["least torque"]
    found = survival(history, {order[-1]})
    monkeypatch.setattr("armwright.proof.recommendation.NEAR", 1e9)
    assert {one.design for one in recommend(history, found, simulator)} == {order[-1]}
    monkeypatch.setattr("armwright.proof.recommendation.NEAR", 1.0)
    (*others, safe) = recommend(history, found, simulator)
    replaced = unsafe_roles(history, found)
    assert replaced["least torque"] == order[0]
    assert (safe.role, safe.design) == ("safe", order[-1])
    assert {one.role: one.design for one in others} == dict.fromkeys(candidates(history), order[-1])
    assert [one.design for one in safe.demoted] == list(dict.fromkeys(replaced.values()))
    assert safe.demoted[0].reason == "does not hold: payload +10 % (reserve 0.96 (torque of joint 2))"
    assert safe.costs.startswith(f"compared with #{safe.demoted[0].design} (does not hold): position error ")
    nothing = recommend(history, survival(history, set()), simulator)
    assert [one.design for one in nothing] == [numbers[0] for numbers in candidates(history).values()]


def test_recommended_designs_are_not_simulated_without_time(history: History) -> None:
    simulator = SimpleNamespace(members={}, seconds=2.0)
    chosen = recommend(history, {}, cast("Simulator", simulator), left=lambda: 1.0)
    assert [one.design for one in chosen] == [numbers[0] for numbers in candidates(history).values()]
    assert {one.status for one in chosen} == {"not simulated: the time is up"}
    assert {one.survival for one in chosen} == {None}


@pytest.mark.slow
def test_cheapest_and_stiffest_designs_are_roles_where_they_are_known() -> None:
    """Errors and holding torque are none then: constraints see to them."""
    examples = Path(__file__).parents[2] / "examples"
    task = aw.load_task(examples / "6-price-task.yaml")
    space = aw.load_space(examples / "6-price-space.yaml")
    for objectives, ends in ((("mass", "cycle_time"), ["mass", "cycle time"]), (("position_error", "torque"), [])):
        changes = {"objectives": objectives, "reference_point": None}
        problem = aw.Problem(task.model_copy(update=changes), space)
        history = aw.find_front(problem, evaluations=300).history
        roles = candidates(history)
        assert list(roles) == ["knee", *(f"least {name}" for name in (*ends, "price", "deflection"))]
        for name in ("price", "deflection"):
            least, picked = roles[f"least {name}"][0], pick(history, by=name)[0].number
            assert np.ptp(QUANTITIES[name](history.evaluation([least, picked]))) == 0.0  # two may be equal


def test_a_design_that_holds_follows_one_that_fails_in_the_simulation(history: History) -> None:
    knee, _, third = candidates(history)["knee"][:3]
    chosen = recommend(history, survival(history, {knee, third}), cast("Simulator", Verdicts({knee})))
    assert [one.design for one in chosen if one.role == "knee"] == [third]
