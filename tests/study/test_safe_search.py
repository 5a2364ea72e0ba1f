"""The cheapest design that holds, found around a front of which no recommended design does."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import armwright as aw
from armwright.problem.problem import Problem
from armwright.proof.perturbations import HEAVIER, Left, Survival
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.spaces.parameters import Design
from armwright.study.front import direct_search, safe_search
from armwright.study.front.safe_search import find_safe_design
from armwright.tasks.task import Task

CONTENT: dict[str, Any] = {
    "name": "two",
    "targets": [[0.3, 0.1, 0.2], [0.2, 0.3, 0.1]],
    "constraints": ["length <= 1"],
    "objectives": ["position_error", "torque"],
    "reference_point": [2, 2],
}
HIGH = 0.0  # [m]; designs hold if their base is higher


@pytest.fixture(scope="module")
def history() -> History:
    return aw.find_front(Problem(Task.model_validate(CONTENT)), evaluations=500).history


def of(holds: bool) -> Survival:
    return Survival.of({HEAVIER: Left(HEAVIER, holds, "reserve 0.96 (heat of joint 1)", 0.96, None)})


def by_height(history: History, numbers: Sequence[int]) -> list[Survival]:
    return [of(float(history.trials[number].design.params["origin_z"]) > HIGH) for number in numbers]


def test_safe_design_is_the_cheapest_that_holds(history: History, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Design] = []

    def noted(grown: History, numbers: Sequence[int]) -> list[Survival]:
        asked.extend(grown.trials[number].design for number in numbers)
        return by_height(grown, numbers)

    monkeypatch.setattr(safe_search, "survival_of", noted)
    nothing_holds = {member.number: of(False) for member in history.front}
    found = find_safe_design(history, nothing_holds, lambda: math.inf, 0.0, seed=1)
    assert found is not None
    trial, survival = found
    assert survival.holds
    assert trial.number == len(history)
    assert trial.design.params["origin_z"] > HIGH
    assert max(trial.violations) <= 0.0
    assert history.problem.evaluate([trial.design]).values[0] == pytest.approx(trial.values, rel=1e-6)
    first = asked[: asked.index(trial.design)]
    assert all(float(design.params["origin_z"]) <= HIGH for design in first)
    cheapest = history.problem.evaluate([*first, trial.design]).values[:, 0]
    assert (cheapest <= trial.values[0] + 1e-6).all()
    assert find_safe_design(history, nothing_holds, lambda: 1.0, each=1.0, seed=1) is None  # there is no time
    monkeypatch.setattr(safe_search, "survival_of", lambda _, numbers: [of(False) for _ in numbers])
    assert find_safe_design(history, nothing_holds, lambda: math.inf, 0.0, seed=1) is None


def test_run_recommends_the_safe_design(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(safe_search, "survival_of", by_height)
    monkeypatch.setattr(
        direct_search, "front_survival", lambda history, _: {one.number: of(False) for one in history.front}
    )
    run = aw.find_front(Problem(Task.model_validate(CONTENT)), evaluations=500, out=tmp_path / "run")
    (one,) = run.summary["recommended"]
    assert (one["role"], one["design"]) == ("safe", len(run.history) - 1)
    assert one["costs"].startswith(f"compared with #{one['demoted'][0]['design']} (does not hold): position error ")
    assert run.summary["n_trials"] == len(read_run(tmp_path / "run")[1]) == len(run.history)
    record = json.loads((tmp_path / "run" / "designs" / f"{one['design']:04d}" / "design.json").read_text())
    assert record["survival"]["holds"]
