"""Tubes of links: sections, masses, stiffness, parameters, prompts and data sheets."""

import json
import math
from typing import Any

import numpy as np
import pytest

from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.llm.answer import Answer, read_answer, read_text, written_answer
from armwright.llm.answer_format import design_in_lines
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import design_prompt
from armwright.robot.tubes import MATERIALS
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.spaces.parameters import CategoricalParameter
from armwright.tasks.catalogue import load_task
from tests.support.fixed_problem import FixedProblem, fixed_history

PRICED = {"density": 2700, "youngs": 70e9, "shear": 27e9, "price_per_kg": 12.0}
TUBES: dict[str, Any] = {"tubes": [[0.02, 0.0015], [0.03, 0.002]], "material": PRICED}


def space(**keys: Any) -> DesignSpace:
    return DesignSpace.model_validate({"joints": 3, "link_section": TUBES, **keys})


# Circular hollow sections of steel, EN 10210-2:2006, table B.3: mass [kg/m] and second moment of area [cm⁴].
@pytest.mark.parametrize(
    ("outer_mm", "wall_mm", "kg", "moment"),
    [(48.3, 3.2, 3.56, 11.6), (60.3, 3.2, 4.51, 23.5), (114.3, 5.0, 13.5, 257.0)],
)
def test_tubes_match_the_table_of_the_standard(outer_mm: float, wall_mm: float, kg: float, moment: float) -> None:
    section = {"tubes": [[1e-3 * outer_mm, 1e-3 * wall_mm]], "material": "steel"}
    (tube,) = space(link_section=section).link_section.options
    steel = MATERIALS["steel"]
    assert tube.mass_per_metre == pytest.approx(kg, rel=3e-3)
    assert tube.bending_stiffness == pytest.approx(steel.youngs * moment * 1e-8, rel=3e-3)
    assert tube.torsional_stiffness == pytest.approx(steel.shear * 2.0 * moment * 1e-8, rel=3e-3)


def test_section_without_a_material_keeps_the_paper() -> None:
    paper, stated = paper_space(), space(joints=4, link_section={"tubes": [[0.03, 0.015]]})
    assert stated.parameters == paper.parameters
    arm = paper.arm(paper.sample(1, 0)[0])
    assert [(link.radius, link.wall, link.bending_stiffness, link.price) for link in arm.links] == [
        (0.015, None, None, 0.0)
    ] * 4
    assert np.isnan(stack_arms([arm]).bending_stiffness).all()


@pytest.mark.parametrize(
    ("section", "names"),
    [
        ({"tubes": [[0.03, 0.002]]}, []),
        (TUBES, ["tube_1", "tube_2", "tube_3"]),
        ({**TUBES, "per_link": False}, ["tube"]),
    ],
)
def test_several_tubes_are_parameters(section: dict[str, Any], names: list[str]) -> None:
    parameters = [p for p in space(link_section=section).parameters if p.name.startswith("tube")]
    assert [p.name for p in parameters] == names
    assert all(isinstance(p, CategoricalParameter) and p.choices == ("20x1.5", "30x2") for p in parameters)


def test_each_link_has_its_own_tube() -> None:
    searched = space(joint_types=["S", "P"], restrict={"joint_2": "S"})
    (design,) = searched.sample(1, 0)
    design = searched.design({**design.params, "tube_1": "30x2", "tube_2": "20x1.5", "tube_3": "30x2"})
    arm = searched.arm(design)
    assert [link.radius for link in arm.links] == [0.015, 0.01, 0.015]
    assert [link.wall for link in arm.links] == [0.002, 0.0015, 0.002]
    per_metre = [2700 * math.pi * (r**2 - (r - w) ** 2) for r, w in ((0.015, 0.002), (0.01, 0.0015))]
    assert [link.mass / link.length for link in arm.links] == pytest.approx([per_metre[i] for i in (0, 1, 0)])
    assert arm.links[0].end_mass == pytest.approx(per_metre[1] * 0.3)  # the rail of the slide
    assert arm.structure_price == pytest.approx(12.0 * sum(link.mass for link in arm.links))


@pytest.mark.parametrize(
    ("lines", "values"),
    [
        ("TUBES: (20x1.5, 30x2, 20x1.5)", {"tube_1": "20x1.5", "tube_2": "30x2", "tube_3": "20x1.5"}),
        ("TUBES: 30x2, -", {"tube_1": "30x2"}),
        ("TUBE: 30x2", {"tube": "30x2"}),
    ],
)
def test_answers_name_tubes(lines: str, values: dict[str, str]) -> None:
    _, design = design_in_lines(f"ORIGIN: (0, 0, 0)\n{lines}")
    assert {name: value for name, value in design.items() if name.startswith("tube")} == values


@pytest.mark.parametrize("per_link", [True, False])
def test_prompts_ask_for_tubes_and_read_them_back(per_link: bool) -> None:
    searched = space(link_section={**TUBES, "per_link": per_link})
    problem = FixedProblem(load_task("target-1"), searched)
    text = design_prompt(fixed_history(problem), 3, PromptOptions(answer="text"))
    assert "by its outer diameter and wall in millimetres: 20x1.5, 30x2." in text
    assert ("\nTUBES: (tube_1, ..., tube_3)\n" if per_link else "\nTUBE: tube\n") in text
    for answer in (Answer(design, "so") for design in searched.sample(3, 1)):
        assert read_answer(json.loads(written_answer(answer)), problem) == answer
    (design,) = searched.sample(1, 2)
    origin, links = (", ".join(map(repr, values)) for values in (design.origin, design.links))
    tubes = f"TUBES: ({', '.join(design.tubes)})" if per_link else f"TUBE: {design.tubes[0]}"
    lines = f"ORIGIN: ({origin})\nJOINTS: ({', '.join(design.joints)})\nLINKS: ({links})\n{tubes}\n"
    assert read_text(lines, problem).design == design
