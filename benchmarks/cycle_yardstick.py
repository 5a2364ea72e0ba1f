"""What the machine has for whole cycles: desk-sorting evaluated from given postures, beside a yardstick in C++.

Designs near the best known front (lengths off by 2 % of their range), in batches of 64, on one core. Both sides get the
arms as arrays, and the posture at the first pose of each block that `Problem.evaluate` found. Both do this work:

lines       followed coarsely, then with as many samples as keep steps below 0.05 rad; errors at and between samples
torques     terms of gravity, drag and push with full tensors at all samples, and what the payload adds to them
clearance   at all samples, of the links as capsules from each other, from the desk and from the boxes
loads       least time of each motion at 33 instants, by the torque-speed lines, with less voltage and with a heavier
            payload; the torques of the drives, friction included

Neither side counts the bodies of motors, tool and payload, but both count their masses. Ours also does what the
yardstick leaves out: distances from joint limits, postures and holding torques at targets, root mean squares of
torques, and the choice of postures, with one candidate each. The yardstick lacks what these designs do not need: more
samples between those of a joint motion that nearly collides, more instants where a line is fast in a short part, and
the end of the search on lines that are out of reach.

Results are compared first. Then both are timed in turn, medians of seven. The last line is `Problem.evaluate`, from
designs to objectives.

    python benchmarks/cycle_yardstick.py
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from cycle_speed import near_front, problem_of
from numpy.typing import NDArray
from one_core import on_one_core

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, OBLIQUE, ArmArrays
from armwright.problem.evaluation import evaluate_arrays
from armwright.problem.problem import Problem
from armwright.problem.scene import Scene
from armwright.tasks.motions import CyclePlan, line_steps

NAME, DESIGNS, BATCH, ROUNDS = "desk-sorting", 256, 64, 7
REPEATS = 10  # of C++ in a round
AGREES = {"cycle time": 1e-4, "torque": 1e-4, "clearance": 5e-5, "path error": 1e-6}  # clearance, path error: [m]
FLAGS = ("-O3", "-march=native", "-Wno-psabi", "-ffast-math", "-fno-finite-math-only", "-std=c++17", "-shared", "-fPIC")
TENSOR = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)  # xx yy zz xy xz yz
LINKS = ("link", "bare", "radius", "lower", "upper", "mass", "com", "inertia")
DRIVES = ("peak", "no_load_speed", "falling_range", "rotor_inertia", "coulomb", "viscous", "limit_friction")

# The structs of C++
JOINT = np.dtype([("axis", "i8"), *((name, "f8", 6 if name == "inertia" else ()) for name in (*LINKS, *DRIVES))])
DESIGN = np.dtype([
    ("joints", "i8"), ("base", "f8", 3), ("safety", "f8"), ("load_com", "f8"), ("load_inertia", "f8", 6),
    ("joint", JOINT, 5), ("entry", "f8", (5, 4)),
])  # fmt: skip
JOB = np.dtype([
    *((name, "f8") for name in ("payload", "heavier", "voltage", "dwell", "ground")),
    ("line", "f8", (3, 3, 4)), ("box", "f8", (2, 2, 3)), ("motion", "i8", (12, 3)),
])  # fmt: skip
FOUND = np.dtype([("cycle_time", "f8"), ("path_error", "f8"), ("own", "f8"), ("clear", "f8"), ("torque", "f8", 5)])


def designs_of(arms: ArmArrays, entry: Array, payload: float) -> NDArray[Any]:
    """Return arms as C++ takes them; entry: (N, B, D)."""
    bodies, drives, last = arms.rigid_bodies, arms.actuation, (np.arange(len(arms)), arms.n_joints - 1)
    assert drives is not None
    assert np.all((arms.motion < OBLIQUE) | (arms.motion == FIXED))
    assert np.all(arms.axis >= 0.0)
    assert np.all(arms.tool_axis == (0, 0, 1))
    assert not any(each[..., :2].any() for each in (arms.offset, bodies.com, arms.payload_center))
    found = np.zeros(len(arms), DESIGN)
    found["joints"], found["base"], found["safety"] = arms.n_joints, arms.base, drives.safety_factor
    found["entry"] = entry.swapaxes(1, 2)
    found["load_com"] = arms.offset[last][:, 2] + arms.payload_center[:, 2]
    found["load_inertia"] = payload * arms.payload_gyration[:, *TENSOR]
    joint = found["joint"]
    joint["axis"], joint["link"], joint["bare"] = arms.motion, arms.offset[..., 2], arms.offset[..., 2]
    joint["bare"][last] -= arms.tool.tip[:, 2]
    joint["mass"], joint["com"], joint["inertia"] = bodies.mass, bodies.com[..., 2], bodies.inertia[..., *TENSOR]
    for name in ("radius", "lower", "upper"):
        joint[name] = getattr(arms, name)
    for name in DRIVES:
        joint[name] = getattr(drives, name)
    return found


def job_of(scene: Scene, plan: CyclePlan) -> NDArray[Any]:
    """Return the job as C++ takes it."""
    poses, blocks, motions = plan.poses, plan.blocks, plan.motions
    found = np.zeros(1, JOB)
    found["payload"], found["heavier"], found["voltage"] = scene.payload.max(), 0.1, 0.9  # shares of cycle_loads.py
    ground, *boxes = (obstacle.solid for obstacle in scene.obstacles)
    found["dwell"], found["ground"] = sum(plan.dwells), ground.centre[2]
    found["box"] = [(box.centre, box.half) for box in boxes]
    for b, block in enumerate(blocks):
        into, out = block.lines
        line = motions[into]
        assert (line.start, line.end) == (motions[out].end, motions[out].start)
        assert line_steps(poses, line.start, line.end) == 4
        found["line"][0, :, :, b] = *poses.position[[line.start, line.end]], poses.rotation[line.end, :, 2]
        for m, path in ((into, b), (out, b), (plan.joint_motions[b], len(blocks) + b)):
            found["motion"][0, m] = path, m == out, motions[m].carries
    assert ground.shape == "ground"
    assert all(box.shape == "box" and np.all(box.rotation == np.eye(3)) for box in boxes)
    assert all(time is None for time in plan.times)
    return found


def built(folder: Path) -> ctypes.CDLL:
    """Return the library, built anew."""
    source, library = Path(__file__).with_suffix(".cpp"), folder / "cycles.so"
    subprocess.run(["g++", *FLAGS, str(source), "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started


class Batch:
    """Designs near the front, evaluated by both."""

    def __init__(self, problem: Problem, matrix: Array) -> None:
        scene, entry = problem.scenes[0], problem.evaluate(matrix).entry
        plan, rules = scene.plan, scene.tip_rules
        assert plan is not None
        assert rules is not None
        assert entry is not None
        plan = replace(plan, tip_rules=replace(plan.tip_rules, solids={}))
        self.scene = replace(scene, plan=plan, tip_rules=replace(rules, solids={}))
        self.arms, self.entry = replace(problem.arms(matrix), motor_bodies=None), entry[:, 0]
        self.ours()
        self.found_in_cpp, self.job = np.zeros(len(matrix), FOUND), job_of(self.scene, plan)
        self.designs = designs_of(self.found.arms, self.entry, float(scene.payload.max()))

    def ours(self) -> None:
        self.found = evaluate_arrays(self.arms, self.scene, candidates=self.entry[:, :, None])
        _ = self.found.loads, self.found.self_clearance

    def in_cpp(self, library: ctypes.CDLL) -> None:
        job, designs, found = (
            ctypes.c_void_p(each.ctypes.data) for each in (self.job, self.designs, self.found_in_cpp)
        )
        library.cycles(job, len(self.designs), designs, found)

    def apart(self) -> dict[str, float]:
        """Return the largest differences, of torques relative to the largest of the joint."""
        theirs, loads, paths = self.found_in_cpp, self.found.loads, self.found.cycle_paths
        assert paths is not None
        torque = np.abs(loads.torques).max(axis=(1, 2))
        return {
            "cycle time": float(np.abs(theirs["cycle_time"] / loads.cycle_time - 1.0).max()),
            "torque": float((np.abs(theirs["torque"] - torque).max(axis=0) / torque.max(axis=0)).max()),
            "clearance": max(
                float(np.abs(theirs[name] - clearance.min(axis=1)).max())
                for name, clearance in (("own", paths.self_clearance), ("clear", paths.obstacle_clearance))
            ),
            "path error": float(np.abs(theirs["path_error"] - paths.path_error.max(axis=1)).max()),
        }


def main() -> None:
    if shutil.which("g++") is None:
        sys.exit("g++ is not there")
    problem, front = problem_of(NAME)
    matrix = near_front(problem, front, DESIGNS)
    batches = [Batch(problem, matrix[at : at + BATCH]) for at in range(0, DESIGNS, BATCH)]
    with tempfile.TemporaryDirectory() as folder:
        library = built(Path(folder))

    def theirs() -> None:
        for batch in batches:
            batch.in_cpp(library)

    def ours() -> None:
        for batch in batches:
            batch.ours()

    theirs()
    for name, limit in AGREES.items():
        apart = max(batch.apart()[name] for batch in batches)
        print(f"  {name:12} off by {apart:.1e} at most")
        if not apart < limit:
            sys.exit(f"{name}: expected less than {limit:g}")
    times = np.array([
        (
            seconds(lambda: [theirs() for _ in range(REPEATS)]) / REPEATS,
            seconds(ours),
            seconds(lambda: problem.evaluate(matrix)),
        )
        for _ in range(ROUNDS)
    ])  # fmt: skip
    rates, ratios = DESIGNS / np.median(times, axis=0), times[:, 0] / times[:, 1]
    print(f"  C++          {rates[0]:8.0f} designs a second")
    print(f"  armwright    {rates[1]:8.0f}, {np.median(ratios):.3f} of it ({ratios.min():.3f} to {ratios.max():.3f})")
    print(f"  evaluate     {rates[2]:8.0f}, with the choice of postures and all bodies", flush=True)


if __name__ == "__main__":
    on_one_core(__file__, main)
