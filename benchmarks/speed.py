"""How fast parts of an evaluation are on one core: medians of several rounds (least, most).

The kinds of work of a part are measured in turn, as the speed of a shared machine drifts, and in processor time, which
other programs hardly change.

poses         targets with an axis or an orientation beside points, 100 updates from the straight start; and how long
              each variant of the kernels takes to compile
clearance     links against each other and three obstacles, beside position error and torque
real-arms     axis targets, clearance and motors beside the paper's objectives
motor-bodies  cycles of seven lines with and without motor bodies and a column
reach-map     about 2,000 points with 50 directions each, and of 1,000 poses the share that is missed of those that 60
              random restarts of `aw.solve` find

    python benchmarks/speed.py PART ...
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from one_core import on_one_core

sys.path.insert(0, str(Path(__file__).parents[1]))

import armwright as aw
from armwright.kinematics.contact.clearance import clearances
from armwright.kinematics.devices import load_kernels
from armwright.kinematics.ik.ik import LANES, solve_postures
from armwright.problem.evaluation import evaluate_arrays
from armwright.problem.objectives import named_objectives
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.rotations import rotation_from_rpy
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import load_task
from armwright.tasks.targets import AXIS, ORIENTATION, position_targets
from armwright.tasks.task import Task
from tests.support.arms import paper_arms
from tests.support.robots import robot

N, ROUNDS = 4000, 7
N_CYCLES, CYCLE_ROUNDS = 256, 5
POSES, RESTARTS = 1000, 60
POINTS = load_task("target-1")
OBSTACLES = [
    {"kind": "ground", "z": -0.6},
    {"kind": "box", "center": [0.5, 0.0, 0.2], "size": [0.3, 0.7, 0.02], "yaw": 0.3},
    {"kind": "cylinder", "center": [0.3, 0.3, 0.0], "radius": 0.03, "height": 1.2},
]
REAL = Task.model_validate(
    {
        "name": "real",
        "targets": [{"position": point, "axis": [0.0, 0.0, -1.0]} for point in POINTS.target_positions.tolist()],
        "payload": 0.2,
        "obstacles": OBSTACLES,
        "objectives": ["position_error", "orientation_error", "collision", "torque_utilisation"],
    }
)
REAL_SPACE = DesignSpace.model_validate(
    {
        "name": "real", "joints": 6, "actuators": ["XL430-W250", "XM430-W350", "XM540-W270"], "safety_factor": 1.0,
        "link_section": {"tubes": [[0.03, 0.002]], "material": "aluminium"},
    }
)  # fmt: skip
CYCLE = Task.model_validate(
    {
        "name": "lines",
        "targets": [
            {"position": [0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.1 + 0.05 * (i % 2)], "axis": [0, 0, -1]}
            for i, angle in enumerate(np.linspace(-0.9, 0.9, 8).tolist())
        ],
        "payload": 0.1,
        "tool": {"tip": [0.0, 0.0, 0.1]},
        "cycle": {"closed": False, "time": 1.5, "steps": [{"to": i, "by": "line"} for i in range(1, 9)]},
        "obstacles": [{"kind": "ground", "z": -0.01}],
        "objectives": ["worst_error", "torque_utilisation", "mass"],
    }
)
CYCLE_SPACE = DesignSpace.model_validate(
    {
        "name": "six-axis", "joints": 6,
        "restrict": {f"joint_{j}": letter for j, letter in enumerate("YPPPYR", start=1)},
        "link": [0.05, 0.25], "origin_x": [-0.1, 0.1], "origin_y": [-0.1, 0.1], "origin_z": [0.0, 0.1],
        "mass": {"kind": "per_metre", "kg": 0.0121}, "bracket_mass": 0.0, "supply": 12.0, "actuators": ["XM540-W270"],
    }
)  # fmt: skip
MOTORS = ("XM540-W270", "AK60-6")  # a box and a cylinder
COLUMN = {"foot": -0.5}
BODIES = {
    "no bodies": {"motor_bodies": False},
    "motors": {"motor_bodies": True},
    "column": {"motor_bodies": False, "column": COLUMN},
    "motors and column": {"motor_bodies": True, "column": COLUMN},
}

Rates = dict[str, list[float]]


def measure(work: Mapping[str, Callable[[], object]], n: int, rounds: int) -> Rates:
    """Print and return (rounds,) units of work a second of each kind of work, which does n of them at a time."""
    for do in work.values():
        do()  # compiles and loads
    found = [{name: n / seconds(do) for name, do in work.items()} for _ in range(rounds)]
    rates = {name: [one[name] for one in found] for name in work}
    for name, one in rates.items():
        print(f"  {name:38s} {statistics.median(one):10.0f}   ({min(one):.0f}, {max(one):.0f})", flush=True)
    return rates


def compare(rates: Rates, name: str, other: str) -> None:
    """Print the ratio of two rates, measured in pairs."""
    ratios = [a / b for a, b in zip(rates[name], rates[other], strict=True)]
    print(f"  {name} / {other}: {statistics.median(ratios):.2f} ({min(ratios):.2f}, {max(ratios):.2f})", flush=True)


def seconds(do: Callable[[], object]) -> float:
    """Return the processor time that something takes [s]."""
    began = time.process_time()
    do()
    return time.process_time() - began


def poses() -> None:
    os.environ["WARP_CACHE_PATH"] = tempfile.mkdtemp(prefix="armwright-speed-")  # where nothing is compiled yet
    print("Targets of several kinds: designs/s, 8 targets")
    for kind in ("position", "pose"):
        taken = seconds(partial(load_kernels, "ik.ik_kernels", "cpu", "float32", LANES["cpu"], "revolute", kind))
        print(f"  kernels of kind {kind} compile in {taken:.1f} s", flush=True)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (8, 3))
    rotation = np.array([rotation_from_rpy(*angles) for angles in rng.uniform(-np.pi, np.pi, (8, 3))])
    rows = {
        "points": [0] * 8,
        "axes": [AXIS] * 8,
        "orientations": [ORIENTATION] * 8,
        "mixed": [0, AXIS, ORIENTATION, AXIS] * 2,
    }
    for joints in (6, 7):
        space = paper_space(joints)
        arms = stack_designs(space, space.matrix(space.sample(N, seed=0)))
        work: dict[str, Callable[[], object]] = {}
        for name, kind in rows.items():
            targets = replace(position_targets(8), n_angular=np.array(kind), rotation=rotation)
            work[f"D = {joints}, {name}"] = partial(solve_postures, arms, points, target_arrays=targets)
        rates = measure(work, N, ROUNDS)
        compare(rates, f"D = {joints}, axes", f"D = {joints}, points")


def clearance() -> None:
    task = Task.model_validate({"name": "clearance", "targets": POINTS.targets, "obstacles": OBSTACLES})
    space = paper_space(6)
    matrix = space.matrix(space.sample(N, seed=0))
    arms = stack_designs(space, matrix)
    q = evaluate_arrays(arms, Scene(task.target_positions, task.payloads, task.target_arrays)).q
    paper = Problem(task, space)
    with_clearance = Problem(task, space, objectives=named_objectives(["position_error", "torque", "collision"]))
    print("Clearance: designs/s, D = 6, 8 targets, 3 obstacles")
    rates = measure(
        {
            "position error and torque": lambda: paper.evaluate(matrix),
            "with collision": lambda: with_clearance.evaluate(matrix),
            "clearance alone": lambda: clearances(arms, q, task.obstacles),
            "self-clearance alone": lambda: clearances(arms, q),
        },
        N,
        ROUNDS,
    )
    compare(rates, "with collision", "position error and torque")
    single = min(seconds(lambda: clearances(arms[:1], q[:1], task.obstacles)) for _ in range(50))
    print(f"  clearance of one design: {1e3 * single:.2f} ms")


def real_arms() -> None:
    matrix = REAL_SPACE.matrix(REAL_SPACE.sample(N, seed=0))
    paper, real = Problem(POINTS, REAL_SPACE), Problem(REAL, REAL_SPACE)
    print("Real arms: designs/s, D = 6, 8 targets")
    measure(
        {
            "the paper's objectives, points alone": lambda: paper.evaluate(matrix),
            "axes, capsules, obstacles and motors": lambda: real.evaluate(matrix),
        },
        N,
        ROUNDS,
    )


def motor_bodies() -> None:
    matrix = CYCLE_SPACE.matrix(CYCLE_SPACE.sample(N_CYCLES, seed=0))
    work: dict[str, Callable[[], object]] = {}
    for motor in MOTORS:
        for name, bodies in BODIES.items():
            space = DesignSpace.model_validate(CYCLE_SPACE.model_dump() | {"actuators": [motor], **bodies})
            work[f"{motor}: {name}"] = partial(Problem(CYCLE, space).evaluate, matrix)
    print("Cycles a second with solid bodies")
    rates = measure(work, N_CYCLES, CYCLE_ROUNDS)
    for motor in MOTORS:
        for name, other in (("motors", "no bodies"), ("column", "no bodies"), ("motors and column", "motors")):
            compare(rates, f"{motor}: {name}", f"{motor}: {other}")


def reach_map() -> None:
    arms: dict[str, aw.UrdfArm | aw.Arm] = {name: aw.read_urdf(robot(name)) for name in ("ur5_robot", "panda")}
    arms["random, 6 joints"] = paper_arms(1, 6, 3)[0]
    print("Reach maps")
    for name, arm in arms.items():
        aw.reach_map(arm, spacing=0.5)  # compiles what is not compiled yet
        began = time.process_time()
        found = aw.reach_map(arm)
        taken = time.process_time() - began
        reached = found.bare.reached
        chosen = np.random.default_rng(0).choice(reached.size, POSES, replace=False)
        point, direction = np.unravel_index(chosen, reached.shape)
        peer = aw.solve(arm, found.points[point], axes=found.directions[direction], restarts=RESTARTS).reached[0]
        missed = float((peer & ~reached[point, direction]).sum() / peer.sum())
        print(
            f"  {name:18} {reached.size:8,} poses in {taken:5.2f} s, {reached.mean():6.1%} reached, "
            f"{missed:.1%} missed",
            flush=True,
        )


PARTS = {
    "poses": poses,
    "clearance": clearance,
    "real-arms": real_arms,
    "motor-bodies": motor_bodies,
    "reach-map": reach_map,
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="+", choices=PARTS, metavar="PART")
    parser.add_argument("--one-core", action="store_true", help="as each part is run")
    for part in parser.parse_args().parts:
        on_one_core(__file__, PARTS[part], part)
