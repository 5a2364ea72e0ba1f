"""Built-in tasks with a design space of their own."""

from pathlib import Path

import pytest

from armwright.cli.notes import space_note, unused_parts
from armwright.cli.options import load_problem
from armwright.problem.checks.instant import check_instantly
from armwright.spaces.design_space import builtin_spaces, default_space, load_space, paper_space
from armwright.tasks.catalogue import builtin_names

OWN = sorted(set(builtin_spaces()) & set(builtin_names()))


def test_a_task_brings_the_space_of_its_name() -> None:
    assert len(OWN) >= 6
    assert default_space("desk-sorting") == load_space("desk-sorting")
    assert default_space("target-1") == default_space("not built in") == paper_space()


def test_commands_take_the_space_of_the_task_and_say_so() -> None:
    own = load_problem("desk-sorting", None)
    assert own.space.name == "desk-sorting"
    assert "desk-sorting" in space_note(own)
    assert load_problem("desk-sorting", Path("autodesign"), objectives="mass").space.name == "autodesign"
    plain = load_problem("target-1", None)
    assert plain.space == paper_space()
    assert not space_note(plain)


@pytest.mark.parametrize("name", OWN)
def test_tasks_with_a_space_are_jobs_with_tool_motors_and_obstacles(name: str) -> None:
    problem = load_problem(name, None)
    task, space = problem.task, problem.space
    assert task.cycle is not None
    assert space.name == name
    assert task.tool.mass > 0.0
    assert task.obstacles
    assert "Assumed" in task.provenance
    assert 2 <= len(problem.objectives) <= 3
    assert len(task.reference_point or ()) == len(problem.objectives)
    assert all(record.price and record.speed for record in space.actuators)
    assert len({record.voltage for record in space.actuators}) == 1
    assert not check_instantly(problem)
    assert not unused_parts(problem)
