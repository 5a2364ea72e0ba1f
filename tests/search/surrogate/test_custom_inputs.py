"""Custom parameters as inputs of the surrogate."""

from typing import Any

import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import SpaceError
from armwright.search.surrogate.cheap_features import custom_inputs
from armwright.search.surrogate.surrogate import Observations, Screen, Surrogate
from armwright.spaces.parameters import CategoricalParameter, FloatParameter
from armwright.yaml_documents import check_document

CUSTOM: dict[str, Any] = {
    "kp": {"range": [1, 100], "scale": "log"},
    "cells": {"range": [1, 4], "integer": True},
    "belt": {"choices": ["gt2", "htd3", "flat"]},
    "gear": {"range": [1, 3], "per": "joint"},
    "oil": {"choices": ["thin", "thick"], "per": "joint"},
}
TASK = aw.load_task("target-1").model_copy(update={"reference_point": None})


def space_of(parameters: dict[str, Any] = CUSTOM, **keys: Any) -> aw.DesignSpace:
    return check_document({"joints": 3, **keys, "parameters": parameters}, aw.DesignSpace, SpaceError, "space.yaml")


@aw.evaluator("lag [s]", "span [m]")
def lag(arm: aw.Arm, task: aw.Task, design: aw.Design) -> tuple[float, float]:
    """how late the arm is, and how long"""
    return 1.0 / float(design.params["kp"]), 0.1 + sum(link.length for link in arm.links)


def columns_of(space: aw.DesignSpace, n: int, **values: list[float | str]) -> dict[str, np.ndarray]:
    """Return the inputs of n random designs, some of whose parameters have these values."""
    matrix = space.matrix(space.sample(n, 0))
    for name, given in values.items():
        column = [p.name for p in space.parameters].index(name)
        matrix[:, column] = [space.parameters[column].encode(value) for value in given]
    custom = [p for p in space.parameters if p.name in space.custom_names]
    names = [p.name for p in custom if isinstance(p, FloatParameter)]
    names += [f"{p.name} {choice}" for p in custom if isinstance(p, CategoricalParameter) for choice in p.choices]
    return dict(zip(names, custom_inputs(space, space.normalised(matrix)).T, strict=True))


def test_numbers_are_on_their_scales_and_choices_are_indicators() -> None:
    belts = ["gt2", "htd3", "flat"]
    columns = columns_of(space_of(), 3, kp=[1, 10, 100], cells=[1, 4, 1], gear_2=[2.0, 3.0, 1.0], belt=belts)
    assert columns["kp"] == pytest.approx([-1.0, 0.0, 1.0])
    assert columns["cells"].tolist() == [-1.0, 1.0, -1.0]
    assert columns["gear_2"].tolist() == [0.0, 1.0, -1.0]
    assert np.array_equal(np.column_stack([columns[f"belt {choice}"] for choice in belts]), np.eye(3))


def test_parameters_of_joints_that_do_not_exist_are_zero() -> None:
    columns = columns_of(space_of(joints=[2, 3]), 2, n_joints=["2", "3"], oil_3=["thick", "thick"], gear_3=[3.0, 3.0])
    assert columns["gear_3"].tolist() == [0.0, 1.0]
    assert columns["oil_3 thin"].tolist() == [0.0, 0.0]
    assert columns["oil_3 thick"].tolist() == [0.0, 1.0]


def test_objective_of_a_custom_parameter_is_predicted_with_the_physics() -> None:
    problem = aw.Problem(TASK, space_of({"kp": CUSTOM["kp"]}), evaluator=lag)
    designs = problem.space.sample(40, 1)
    values = np.array([lag(problem.arm(design), TASK, design) for design in designs])
    matrix, none = problem.space.matrix(designs), np.zeros(20, dtype=bool)
    surrogate = Surrogate(problem)
    screen = Screen(surrogate, Observations(matrix[:20], values[:20], none, matrix[:0]))
    mean = screen.forecast(surrogate.features.describe(matrix[20:])).mean
    for objective in range(2):
        assert np.corrcoef(np.log(values[20:, objective]), mean[:, objective])[0, 1] > 0.7
