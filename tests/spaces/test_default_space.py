"""Built-in tasks with a design space of their own."""

from pathlib import Path

import pytest

from armwright.cli.notes import space_note, unused_parts
from armwright.cli.options import load_problem
from armwright.page.repeat_command import repeat_command
from armwright.problem.checks.instant import check_instantly
from armwright.runs.config import FrontMethod
from armwright.spaces.design_space import builtin_spaces, default_space, load_space, paper_space
from armwright.study.run_settings import run_config
from armwright.tasks.catalogue import builtin_names

# A design of each, found by `armwright design`: base [m], joints, links [m], motors
KNOWN = {
    "box-palletising": (
        (0.0567, -0.0044, 0.0651),
        "YYPPPY",
        (0.1329, 0.1966, 0.3415, 0.365, 0.0895, 0.1159),
        "AK80-64 RobStride-04 AK80-64 RobStride-04 RobStride-06 RobStride-00",
    ),
    "casting-inspection": (
        (0.0995, 0.0462, 0.1461),
        "YPYPP",
        (0.0599, 0.092, 0.137, 0.2152, 0.0308),
        "XC430-W240 XM540-W150 XC430-W240 XM430-W350 XC430-W240",
    ),
    "desk-sorting": (
        (0.04, 0.0, 0.0553),
        "YPPP",
        (0.1327, 0.1868, 0.1063, 0.0304),
        "XM430-W210 XM540-W150 XC430-W240 XC430-W240",
    ),
    "dispensing": (
        (0.0321, 0.0668, 0.1587),
        "PRRYP",
        (0.1589, 0.194, 0.2085, 0.2279, 0.0371),
        "XM540-W270 XM540-W150 XM430-W350 XC430-W240 XC430-W240",
    ),
    "lathe-tending": (
        (-0.1261, 0.0235, 0.1874),
        "YPYPYP",
        (0.1295, 0.2014, 0.1476, 0.1573, 0.2545, 0.0622),
        "RobStride-04 RobStride-04 RobStride-04 RobStride-03 RobStride-02 RobStride-00",
    ),
    "screwing": (
        (0.05, -0.067, 0.1526),
        "YPPP",
        (0.0799, 0.1744, 0.2958, 0.0402),
        "RobStride-00 RobStride-00 RobStride-00 RobStride-05",
    ),
}
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


def test_repeated_command_leaves_out_the_space_of_the_task() -> None:
    config = run_config(load_problem("desk-sorting", None), FrontMethod(), 0)
    assert "--space" not in repeat_command(config, Path("run"))
    config = config.model_copy(update={"space": paper_space()})
    assert "--space paper" in repeat_command(config, Path("run"))


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


@pytest.mark.parametrize("name", OWN)
def test_tasks_with_a_space_have_feasible_designs(name: str) -> None:
    problem = load_problem(name, None)
    origin, joints, links, motors = KNOWN[name]
    params: dict[str, object] = {f"origin_{axis}": value for axis, value in zip("xyz", origin, strict=True)}
    params["n_joints"] = str(len(joints))
    for j, values in enumerate(zip(joints, links, motors.split(), strict=True), start=1):
        params |= dict(zip((f"joint_{j}", f"link_{j}", f"motor_{j}"), values, strict=True))
    outcome = problem.evaluate([problem.space.design(params)])[0]
    violated = [c.description for c, v in zip(problem.constraints, outcome.violations, strict=True) if v > 0.0]
    assert not violated
    assert all(value < limit for value, limit in zip(outcome.values, problem.reference_point or (), strict=True))
