"""What the machine has for whole cycles: desk-sorting evaluated from given entry postures, and by hand in C++.

Designs near the best known front (lengths off by 2 %), batches of 64, one core. Both sides get the arms as arrays and
the posture at the first pose of each block that `Problem.evaluate` found, and do the same work in double precision:

    lines       followed coarsely, then with as many samples as keep steps below 0.05 rad; their errors, between too
    torques     gravity, drag and push with full tensors at all samples, and what the payload adds
    clearance   links as capsules from each other, the desk and the boxes, and between samples where they come near
    loads       the least time of each motion at 33 instants, by the torque-speed lines of the drives, with less
                voltage, and with a heavier payload; torques with friction, their largest of each joint

Left out on both sides: the choice of postures, bodies of motors, tool and payload (their masses count), the columns of
other spaces, loads across the axes of the drives. Left out in C++ alone: distances from joint limits, what belongs to
single targets (their postures, errors and holding torques), root mean squares and currents.

First the results are compared. Then both are timed in turn, medians of seven; the ratio is ours to C++. C++ has eight
samples in the lanes of its vectors (cycle_yardstick.cpp), or one.

    python benchmarks/cycle_yardstick.py [--designs 64] [--batches 4]
"""

import argparse
import ctypes
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])  # before kernels count cores

import numpy as np
from cycle_speed import near_front, problem_of

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays
from armwright.kinematics.cycle.cycle_loads import MORE_PAYLOAD, VOLTAGE_SHARE
from armwright.kinematics.cycle.cycle_path import CyclePaths
from armwright.problem.evaluation import Evaluation, evaluate_arrays
from armwright.problem.scene import Scene
from armwright.tasks.motions import CyclePlan

JOB, ROUNDS = "desk-sorting", 7
FLAGS = ("-O3", "-march=native", "-Wno-psabi", "-ffast-math", "-fno-finite-math-only", "-std=c++17", "-shared", "-fPIC")
TENSOR = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)  # xx yy zz xy xz yz


class Record(ctypes.Structure):
    """A struct of C++, and the arrays that it points to."""

    def __init__(self, **values: Any) -> None:
        self.arrays = {name: np.ascontiguousarray(value) for name, value in values.items() if np.ndim(value)}
        pointers = {name: array.ctypes.data for name, array in self.arrays.items()}
        super().__init__(**{name: pointers.get(name, value) for name, value in values.items()})


def fields(integers: str, reals: str, pointers: str) -> list[tuple[str, Any]]:
    kinds = (integers, ctypes.c_int), (reals, ctypes.c_double), (pointers, ctypes.c_void_p)
    return [(name, kind) for names, kind in kinds for name in names.split()]


class Arms(Record):
    _fields_ = fields(
        "n width", "", "joints axis base link bare radius lower upper mass com inertia load_z load_inertia peak no_load "
        "falling rotor coulomb viscous gear safety entry"
    )  # fmt: skip


class Job(Record):
    _fields_ = fields(
        "motions boxes", "payload heavier voltage dwell ground tolerance angle_tolerance",
        "start end along path backwards carries centre half",
    )  # fmt: skip


class Found(Record):
    _fields_ = fields("", "", "cycle_time torque clearance path_error")


def arms_of(arms: ArmArrays, entry: Array, payload: float) -> Arms:
    """Return arms as C++ takes them; entry: (N, B, D)."""
    n, dof = arms.motion.shape
    bodies, drives = arms.rigid_bodies, arms.actuation
    assert drives is not None
    assert np.all((arms.motion < 3) | (arms.motion == FIXED)) and np.all(arms.axis >= 0.0)
    assert not arms.offset[..., :2].any() and not bodies.com[..., :2].any() and np.all(arms.tool_axis == (0, 0, 1))
    bare = arms.offset[..., 2].astype(float)
    bare[np.arange(n), arms.n_joints - 1] -= arms.tool.tip[:, 2]
    load = payload * arms.payload_gyration
    return Arms(
        n=n, width=dof, joints=arms.n_joints, axis=arms.motion, base=arms.base.astype(float),
        link=arms.offset[..., 2].astype(float), bare=bare, radius=arms.radius.astype(float),
        lower=arms.lower.astype(float), upper=arms.upper.astype(float), mass=bodies.mass, com=bodies.com[..., 2],
        inertia=bodies.inertia[..., *TENSOR], load_z=arms.payload_center[:, 2].astype(float),
        load_inertia=load[..., *TENSOR], peak=drives.peak, no_load=drives.no_load_speed, falling=drives.falling_range,
        rotor=drives.rotor_inertia, coulomb=drives.coulomb, viscous=drives.viscous, gear=drives.limit_friction,
        safety=drives.safety_factor, entry=entry,
    )  # fmt: skip


def job_of(scene: Scene, plan: CyclePlan) -> Job:
    """Return the job as C++ takes it."""
    poses, blocks, source = plan.poses, plan.blocks, plan.source
    lines = [plan.motions[block.lines[0]] for block in blocks]
    path = [next((b for b, block in enumerate(blocks) if m in block.lines), 0) for m in range(len(plan.motions))]
    for b, m in enumerate(plan.joint_motions):
        path[m] = len(blocks) + b
    ground, *boxes = (obstacle.solid for obstacle in scene.obstacles)
    assert len(blocks) == 4 and all(source[block.lines[1]] == block.lines[0] for block in blocks)
    assert ground.shape == "ground" and all(box.shape == "box" and np.all(box.rotation == np.eye(3)) for box in boxes)
    assert all(time is None for time in plan.times) and len(plan.sample().poses) == 20
    return Job(
        motions=len(path), boxes=len(boxes), payload=float(scene.payload.max()), heavier=MORE_PAYLOAD,
        voltage=VOLTAGE_SHARE, dwell=sum(plan.dwells), ground=ground.centre[2],
        tolerance=plan.cycle.tolerance.largest_distance, angle_tolerance=plan.cycle.tolerance.largest_angle,
        start=poses.position[[line.start for line in lines]], end=poses.position[[line.end for line in lines]],
        along=poses.rotation[[line.end for line in lines], :, 2], path=np.array(path, np.int32),
        backwards=np.array([source[m] != m for m in range(len(path))], np.int32),
        carries=np.array([motion.carries for motion in plan.motions], np.int32),
        centre=np.array([box.centre for box in boxes]), half=np.array([box.half for box in boxes]),
    )  # fmt: skip


def built(folder: Path, lanes: int) -> ctypes.CDLL:
    """Return the library with so many samples in a vector."""
    source, library = Path(__file__).with_suffix(".cpp"), folder / f"cycles{lanes}.so"
    subprocess.run(["g++", *FLAGS, f"-DLANES={lanes}", str(source), "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))


def seconds(do: Callable[[], object]) -> float:
    started = time.perf_counter()
    do()
    return time.perf_counter() - started


class Batch:
    """Designs near the front, evaluated by both."""

    def __init__(self, problem: Any, matrix: Array) -> None:
        self.scene = problem.scenes[0]
        plan = self.scene.plan
        self.scene = replace(
            self.scene,
            plan=replace(plan, tip_rules=replace(plan.tip_rules, solids={})),
            tip_rules=replace(self.scene.tip_rules, solids={}),
        )
        self.arms = replace(problem.arms(matrix), motor_bodies=None)
        self.entry = problem.evaluate(matrix).entry[:, 0]
        self.theirs = Found(
            cycle_time=np.empty(len(matrix)), torque=np.empty(self.arms.motion.shape),
            clearance=np.empty((len(matrix), 2)), path_error=np.empty(len(matrix)),
        )  # fmt: skip
        self.ours()
        self.given = arms_of(self.found.arms, self.entry, float(self.scene.payload.max()))
        self.job = job_of(self.scene, plan)

    def ours(self) -> None:
        found = evaluate_arrays(self.arms, self.scene, candidates=self.entry[:, :, None])
        _ = found.loads, found.self_clearance
        self.found: Evaluation = found

    def in_cpp(self, library: ctypes.CDLL) -> None:
        library.cycles(*(ctypes.byref(each) for each in (self.given, self.job, self.theirs)))

    def apart(self) -> dict[str, float]:
        """Return the largest differences, torques relative to the largest of the joint."""
        theirs, loads, paths = self.theirs.arrays, self.found.loads, self.found.paths
        torque = np.abs(loads.torques).max(axis=(1, 2))
        clearance = np.stack([paths.self_clearance.min(axis=1), paths.obstacle_clearance.min(axis=1)], axis=1)
        return {
            "cycle time": float(np.abs(theirs["cycle_time"] / loads.cycle_time - 1.0).max()),
            "torque": float((np.abs(theirs["torque"] - torque).max(axis=0) / torque.max(axis=0).clip(1e-9)).max()),
            "clearance [m]": float(np.abs(theirs["clearance"] - clearance).max()),
            "path error [m]": float(np.abs(theirs["path_error"] - paths.path_error.max(axis=1)).max()),
        }


def main() -> None:
    b = Batch(p := problem_of(JOB)[0], near_front(p, problem_of(JOB)[1], 64))
    with tempfile.TemporaryDirectory() as folder:
        for lanes in (8, 4, 2, 1):
            lib = built(Path(folder), lanes)
            b.in_cpp(lib)
            print(lanes, b.apart())
            t = [(seconds(lambda: b.in_cpp(lib)), seconds(b.ours)) for _ in range(7)]
            a, o = np.median(t, axis=0)
            print(64 / a, 64 / o, a / o)


if __name__ == "__main__":
    main()
