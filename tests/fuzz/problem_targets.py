"""Fuzz task, space and experiment files."""

import json
from functools import cache

from armwright.problem.problem import Problem
from armwright.runs.history import History
from armwright.spaces.design_space import DesignSpace, load_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task
from tests.fuzz.target import DefectError, file_of, folder

MAX_POSTURES = 300  # of an arm that is evaluated here: more takes longer, and is no other code


RICH_TASK = b"""\
name: rich
targets:
  - {name: corner, position: [0.4, 0.0, 0.1], axis: [0, 0, -1], tolerance: 0.002, angle_tolerance: 0.05, weight: 2}
  - {position: [0.4, 0.2, 0.1], orientation: [3.1416, 0, 1.5708]}
  - [0.1, 0.35, 0.5]
tool: {tip: [0.02, 0.0, 0.1], rpy: [0.0, 0.3, 0.0], mass: 0.3, center: [0.0, 0.0, 0.05], inertia: [3.0e-4, 3e-4, 0]}
payload: 0.5
payload_factors: [0.0, 1.2]
target_noise: 0.005
restarts: 2
obstacles:
  - {kind: ground, name: table, z: -0.2}
  - {kind: box, name: shelf, center: [0.4, 0.0, 0.3], size: [0.2, 0.6, 0.02], yaw: 0.1}
  - {kind: box, center: [0.4, 0.0, 0.3], size: [0.2, 0.6, 0.02], rpy: [0.1, 0.2, 0.3]}
  - {kind: sphere, center: [0.0, 0.4, 0.3], radius: 0.1}
  - {kind: cylinder, center: [0.2, 0.3, 0.5], radius: 0.03, height: 1.0, axis: [1, 0, 1]}
cycle:
  time: 1.5
  dwell: 0.1
  approach: 0.02
  tolerance: {path: 0.001, angle: 0.05}
  steps: [{to: corner, do: pick}, {to: 2, do: place, time: 2}, {to: 3}]
workspace: {low: [0.2, -0.3, 0.0], high: [0.6, 0.3, 0.4], points: 20}
objectives: [worst_error, torque, collision, path_error, dynamic_torque]
constraints: [mass <= 3, length >= 0.2, uncovered_fraction <= 0.9]
reference_point: [1.0, 5.0, 2.0, 3.0, 4.0]
description: What the arm has to do there.
provenance: Measured.
"""


BODY_TASK = b"""\
name: body
targets: [[0.4, 0.0, 0.1], [0.4, 0.2, 0.1]]
tool: {tip: [0, 0, 0.1], mass: 0.35, center: [0, 0, 0.05], inertia: [3.0e-4, 3.0e-4, 1.0e-4]}
payload: {mass: 0.5, center: [0, 0.01, 0.03], size: [0.06, 0.04, 0.06]}
payload_factors: [0.0, 1.2]
objectives: [worst_error, peak_torque]
"""


RICH_SPACE = b"""\
name: rich
joints: [2, 5]
joint_types: [R, P, Y, O, X, F]
joint_range: [-2.8, 2.8]
limit: [0.5, 2.5]
stroke: [0.1, 0.4]
travel: 0.02
origin_x: [-0.5, 0.5]
origin_z: [0.0, 0.0]
mount: [floor, ceiling, wall+x]
link: [0.05, 0.40]
link_directions: [+z, +x, -y]
link_section: {tubes: [[0.02, 0.001], [0.03, 0.002]], material: {density: 2700, youngs: 7.0e+10, shear: 2.7e+10}}
actuators:
  - XM540-W270
  - XL430-W250
  - {name: mine, maker: me, kind: servo, voltage: 12, mass: 0.3, stall_torque: 6.0, speed: 5.0, price: 120, source: me,
     rated_torque: 2.0, peak_torque: 7.0, corner_speed: 1.0, gear_ratio: 200, rotor_inertia: 0.01, backlash: 0.004,
     joint_stiffness: 200, current: 2.5, estimates: [rotor_inertia], width: 0.03, height: 0.05, depth: 0.04, note: so}
motor_bodies: false
safety_factor: 2.0
restrict: {joint_1: [R, P], origin_y: 0.0, link_3: [0.1, 0.2]}
grid: {link: 0.005, origin_x: 0.1}
tie: {link_2: link_1}
"""


def n_postures(problem: Problem) -> int:
    task = problem.task
    samples = len(task.plan(task.target_positions).sample().poses) if task.cycle else 0
    parts = len(task.targets) * (1 + task.restarts) + samples + sum(region.points for region in task.workspace)
    return parts * len(problem.scenes)


def used(problem: Problem) -> None:
    """Sample, evaluate, export and prompt as every run does."""
    from armwright.llm.prompt import design_prompt
    from armwright.robot.urdf_writer import to_urdf

    designs = problem.space.sample(2, 0)
    arms = [problem.arm(design) for design in designs]
    to_urdf(arms[0])
    for design in designs:
        if problem.space.design(design.params) != design:
            raise DefectError(f"a design that is not in its space: {design.params}")
    if n_postures(problem) <= MAX_POSTURES:
        problem.evaluate(designs)
    design_prompt(History(problem, [], 1, problem.reference_point), 0)


def same_when_kept(value: Task | DesignSpace) -> None:
    """Check that a value is read back unchanged from a run's settings."""
    from armwright.yaml_documents import dump_document

    content = value.model_dump(mode="json")
    json.dumps(content, allow_nan=False)
    text = dump_document(content)
    path = folder() / "kept.yaml"
    path.write_text(text, encoding="utf-8")
    again = load_task(path) if isinstance(value, Task) else load_space(path)
    if again != value:
        raise DefectError(f"{value!r} is read back as {again!r}")


def run_task(data: bytes) -> None:
    task = load_task(file_of(data, "task.yaml"))
    same_when_kept(task)
    used(Problem(task, rich_problem().space))


def run_space(data: bytes) -> None:
    space = load_space(file_of(data, "space.yaml"))
    same_when_kept(space)
    used(Problem(load_task("target-1"), space))


def run_experiment(data: bytes) -> None:
    from armwright.experiments.cells import MAX_CELLS, plan_cells
    from armwright.experiments.plan import load_experiment

    out = folder() / "out"
    plan, beside = load_experiment(str(file_of(data, "experiment.yaml")))
    if 2000 < len(plan.task_list) * len(plan.seed_list) * len(plan.methods) <= MAX_CELLS:
        return
    cells, skipped = plan_cells(plan, beside, out)
    for cell in [*cells, *skipped]:
        if not cell.folder.is_relative_to(out.resolve()) or ".." in cell.folder.parts:
            raise DefectError(f"{cell.folder} is not in {out}")


@cache
def a_problem() -> Problem:
    return Problem(load_task("target-1"))


@cache
def rich_problem() -> Problem:
    (folder() / "rich-space.yaml").write_bytes(RICH_SPACE)
    return Problem(load_task("target-1"), load_space(folder() / "rich-space.yaml"))
