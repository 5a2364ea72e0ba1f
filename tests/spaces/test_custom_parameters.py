"""Custom parameters of a space: read, refused, sampled, searched and handed to evaluators."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

import armwright as aw
from armwright.exceptions import DesignError, SettingsError, SpaceError
from armwright.llm.answer import answer_schema, read_answer, read_text
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import design_prompt
from armwright.problem.reduction import without_joints
from armwright.runs.folder import read_run
from armwright.search.encoding import DesignEncoding
from armwright.search.front.variation import offspring
from armwright.spaces.optuna_distributions import distributions
from armwright.spaces.parameters import FloatParameter
from armwright.spaces.tolerance import length_columns
from armwright.yaml_documents import check_document

CUSTOM: dict[str, Any] = {
    "gear": {"range": [1, 3], "per": "joint"},
    "kp": {"range": [1, 200], "scale": "log", "unit": "N m/rad"},
    "cells": {"range": [1, 4], "integer": True},
    "belt": {"choices": ["gt2", "htd3"]},
}
TASK = aw.load_task("target-1").model_copy(update={"reference_point": None})


def space_of(parameters: dict[str, Any] = CUSTOM, **keys: Any) -> aw.DesignSpace:
    return check_document({"joints": 3, **keys, "parameters": parameters}, aw.DesignSpace, SpaceError, "space.yaml")


@aw.evaluator("stiffness_lack [rad/N m]", "mass_of_cells [kg]")
def measure(arm: aw.Arm, task: aw.Task, design: aw.Design) -> tuple[float, float]:
    """How far the arm yields, and how heavy its cells are."""
    params = design.params
    gears = [float(params[f"gear_{j}"]) for j in range(1, len(arm.joints) + 1)]
    cells = params["cells"]
    assert isinstance(cells, int)
    return 1.0 / float(params["kp"]) / min(gears), 0.05 * cells + (params["belt"] == "gt2")


def test_space_file_declares_parameters_after_the_built_in_ones(tmp_path: Path) -> None:
    file = tmp_path / "space.yaml"
    file.write_text(yaml.safe_dump({"joints": 3, "parameters": CUSTOM}, sort_keys=False), encoding="utf-8")
    space = aw.load_space(file)
    plain = aw.paper_space(3)
    assert space.parameters[: len(plain.parameters)] == plain.parameters
    names = ["gear_1", "gear_2", "gear_3", "kp", "cells", "belt"]
    assert [p.name for p in space.parameters[len(plain.parameters) :]] == names
    assert space.custom_names == set(names)
    assert space.model_dump(mode="json")["parameters"] == CUSTOM
    assert aw.DesignSpace.model_validate(space.model_dump(mode="json")) == space


def test_values_are_checked_in_their_own_types() -> None:
    space = space_of()
    params = dict(space.sample(1, 0)[0].params)
    assert type(space.design(params | {"cells": 3.0}).params["cells"]) is int
    for name, value in (("cells", 2.5), ("cells", 5), ("kp", 0.5), ("belt", "xl"), ("gear_2", 4.0)):
        with pytest.raises(DesignError, match=name):
            space.design(params | {name: value})
    with pytest.raises(DesignError, match="gear_4"):
        space.design(params | {"gear_4": 2.0})


def test_parameters_per_joint_are_active_for_modules_that_move() -> None:
    space = space_of(joints=[1, 3], joint_types=["P", "F"])
    for design in space.sample(50, 0):
        moving = {f"gear_{j}" for j, letter in enumerate(design.joints, start=1) if letter == "P"}
        assert {name for name in design.params if name.startswith("gear")} == moving
        assert space.design(design.params) == design
        assert space.designs(space.matrix([design])) == [design]


def test_samples_are_uniform_on_the_scale() -> None:
    designs = space_of().sample(4000, 1)
    kp = np.log([float(design.params["kp"]) for design in designs])
    assert np.histogram(kp, bins=4, range=(0.0, np.log(200.0)))[0] == pytest.approx(1000, rel=0.1)
    cells = [design.params["cells"] for design in designs]
    assert [cells.count(n) for n in (1, 2, 3, 4)] == pytest.approx([1000] * 4, rel=0.1)


def test_restrictions_grids_and_ties_apply() -> None:
    space = space_of(restrict={"kp": [10, 20], "belt": "gt2", "cells": 2}, grid={"gear": 0.5}, tie={"gear_3": "gear_2"})
    for design in space.sample(30, 0):
        gears = [float(design.params[f"gear_{j}"]) for j in (1, 2, 3)]
        assert 10 <= float(design.params["kp"]) <= 20
        assert (design.params["belt"], design.params["cells"]) == ("gt2", 2)
        assert all((2 * gear).is_integer() for gear in gears)
        assert gears[1] == gears[2]
    with pytest.raises(SpaceError, match="grid: kp: expected a parameter on a linear scale"):
        space_of(grid={"kp": 1.0})
    with pytest.raises(SpaceError, match="whole number"):
        space_of(grid={"cells": 0.5})
    with pytest.raises(SpaceError, match="whole numbers"):
        space_of(restrict={"cells": [1.5, 2]})


def test_custom_parameters_do_not_change_arms() -> None:
    space, plain = space_of(joints=[2, 4]), aw.paper_space().model_copy(update={"joints": (2, 4)})
    designs = space.sample(20, 3)
    bare = [plain.design({k: v for k, v in d.params.items() if k not in space.custom_names}) for d in designs]
    assert [space.arm(design) for design in designs] == [plain.arm(design) for design in bare]
    assert [space.parameters[i].name for i in length_columns(space)] == [
        plain.parameters[i].name for i in length_columns(plain)
    ]


def test_design_takes_the_custom_parameters_of_another_and_keeps_its_arm() -> None:
    space = space_of()
    one, other = space.sample(2, 0)
    mixed = space.with_custom(one, other)
    assert space.arm(mixed) == space.arm(one)
    assert {name: mixed.params[name] for name in space.custom_names} == {n: other.params[n] for n in space.custom_names}


def test_distributions_have_the_scale_and_the_type() -> None:
    found = distributions(space_of())
    assert found["kp"] == FloatDistribution(1.0, 200.0, log=True)
    assert found["cells"] == IntDistribution(1, 4)
    assert found["gear_2"] == FloatDistribution(1.0, 3.0)
    assert found["belt"] == CategoricalDistribution(("gt2", "htd3"))


def test_search_encodes_logarithmic_columns() -> None:
    space = space_of()
    encoding, matrix = DesignEncoding(space.parameters), space.matrix(space.sample(200, 0))
    units = encoding.units(matrix)
    assert units.min() >= 0.0
    assert units.max() <= 1.0
    assert encoding.from_units(units)[:, :-1] == pytest.approx(matrix[:, encoding.real][:, :-1])
    several = units.reshape(4, 50, -1)
    assert encoding.from_units(several).reshape(200, -1) == pytest.approx(encoding.from_units(units))
    kp = [p.name for p in space.parameters if isinstance(p, FloatParameter)].index("kp")
    assert units[:, kp] == pytest.approx(np.log(matrix[:, encoding.real[kp]]) / np.log(200.0))
    children = offspring(matrix, np.zeros(200, dtype=np.int64), encoding, 500, np.random.default_rng(0))
    for design in space.designs(children):
        assert space.design(design.params) == design


def test_reduction_renumbers_parameters_per_joint() -> None:
    space = space_of(joints=[2, 3])
    params = dict(space.sample(1, 0)[0].params) | {"n_joints": "3", "joint_3": "P", "link_3": 0.1}
    design = space.design(params | {f"gear_{j}": 0.5 + 0.5 * j for j in (1, 2, 3)})
    shorter = next(without_joints(space, design, np.array([False, True, False])))
    assert [shorter.params[f"gear_{j}"] for j in (1, 2)] == [1.0, 2.0]
    assert "gear_3" not in shorter.params


def test_evaluator_reads_the_parameters(tmp_path: Path) -> None:
    problem = aw.Problem(TASK, space_of(), evaluator=measure)
    run = aw.optimize(problem, proposer="rules", sampler="tpe", n_init=5, n_step=4, n_total=12, out=tmp_path / "run")
    for trial in run.trials:
        expected = measure(problem.arm(trial.design), TASK, trial.design)
        assert trial.values == expected
    proposed = {trial.design.params["kp"] for trial in run.trials if trial.source == "rules"}
    assert len(proposed) > 1
    _, stored = read_run(tmp_path / "run")
    assert [trial.design for trial in stored] == [trial.design for trial in run.trials]
    resumed = aw.optimize(
        problem, proposer="rules", sampler="tpe", n_init=5, n_step=4, n_total=14, out=tmp_path / "run"
    )
    assert [trial.design for trial in resumed.trials[:17]] == [trial.design for trial in run.trials]


def test_problem_refuses_evaluators_without_design_and_names_of_quantities() -> None:
    @aw.evaluator("reach [m]")
    def reach(arm: aw.Arm, task: aw.Task) -> float:
        return sum(link.length for link in arm.links)

    with pytest.raises(SettingsError, match="expected a function \\(arm, task, design\\)"):
        aw.Problem(TASK, space_of(), evaluator=reach)
    with pytest.raises(SettingsError, match='"mass" is the name of a quantity; try "my_mass"'):
        aw.Problem(TASK, space_of({"mass": {"range": [1, 2]}}), evaluator=measure)


def test_searches_without_evaluator_refuse_custom_parameters() -> None:
    problem = aw.Problem(TASK, space_of())
    for search in (aw.find_front, aw.optimize):
        with pytest.raises(
            SettingsError, match="no built-in objective depends on the parameters gear, kp, cells, belt"
        ):
            search(problem)


def test_prompts_describe_parameters_and_answers_are_read() -> None:
    problem = aw.Problem(TASK, space_of(), evaluator=measure)
    run = aw.optimize(problem, proposer="none", sampler="random", n_init=5, n_total=5, verify=False)
    for name in ("plus", "minus", "full"):
        text = design_prompt(run.history, 0, PromptOptions(prompt=name, answer="text"))
        assert "- GEAR = (gear_1, ..., gear_3): of each joint, 1 <= gear_j <= 3." in text
        assert "- KP: of the whole arm [N m/rad], 1 <= kp <= 200, on a logarithmic scale." in text
        assert "- CELLS: of the whole arm, a whole number, 1 <= cells <= 4." in text
        assert "- BELT: of the whole arm, gt2, htd3." in text
        assert "\nKP: kp\nCELLS: cells\nBELT: belt\nGEAR: (gear_1, ..., gear_3)\n" in text
    design = run.trials[0].design
    properties = answer_schema(problem, PromptOptions())["properties"]
    assert properties["cells"] == {"type": "integer", "description": "1 <= cells <= 4"}
    assert properties["belt"] == {"type": "string", "enum": ["gt2", "htd3"]}
    assert read_answer(dict(design.params), problem).design == design
    lines = """ORIGIN: (0.1, 0, 0.2)
JOINTS: (Y, P, P)
LINKS: (0.1, 0.2, 0.2)
**GEAR**: (1.5, 2, 3)
KP: 40 N m/rad
CELLS: 2
BELT: HTD3
REASON: soft"""
    answer = read_text(lines, problem)
    params = answer.design.params
    assert [params[f"gear_{j}"] for j in (1, 2, 3)] == [1.5, 2.0, 3.0]
    assert (params["kp"], params["cells"], params["belt"]) == (40.0, 2, "htd3")
    with pytest.raises(DesignError, match="kp = 300"):
        read_text(lines.replace("40 N m/rad", "300"), problem)
