"""How fast designs are evaluated on one core, beside scikit-robot's own IK and a Pinocchio loop in Python.

Random arms of 4 joints at the 8 targets of target-1, 100 updates from the straight start each. Ours and Pinocchio's
go on to the gravity torque of the posture; scikit-robot is asked for the posture alone. The others' time includes
loading the URDF, once an arm. Where g++ is there, a yardstick by hand in C++ (yardstick.cpp) says what the machine has.
Then other numbers of joints and targets, double precision, and the memory that a million designs take.

    python benchmarks/evaluation.py
"""

import ctypes
import io
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
from skrobot.coordinates import Coordinates
from skrobot.model import RobotModel

from armwright.kinematics.arms.arm_arrays import ArmArrays, Precision, stack_arms
from armwright.kinematics.ik.ik import UPDATES, solve_postures
from armwright.problem.evaluation import evaluate
from armwright.problem.problem import Problem
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.arm_builder import stack_designs
from armwright.spaces.design_space import paper_space
from armwright.spaces.link_mass import MassPerMetre
from armwright.tasks.catalogue import load_task

TARGETS = load_task("target-1").target_positions
PROBLEM = Problem(load_task("target-1"))
ARMS = [paper_space().arm(design) for design in paper_space().sample(20_000, seed=0)]


def main() -> None:
    if "--memory" in sys.argv:
        print_memory_of_a_million()
        return
    if "--one-core" not in sys.argv:
        cores = len(os.sched_getaffinity(0))
        print("Evaluation: designs/s, 8 targets, D = 4, 100 updates")
        print(f"  armwright, {cores} cores {rate(armwright, len(ARMS)):10.0f}   (kernels alone {kernels_alone():.0f})")
        sys.stdout.flush()
        print(f"  designs as rows, {cores} cores {evaluate_alone():5.0f}")
        sys.stdout.flush()
        # In a process of its own, which never had more threads than that.
        subprocess.run(
            [sys.executable, __file__, "--one-core"],
            check=True,
            preexec_fn=lambda: os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1]),
        )
        # In another, whose peak is its own.
        subprocess.run([sys.executable, __file__, "--memory"], check=True)
        return
    ours = rate(armwright, len(ARMS))
    print(f"  armwright, 1 core  {ours:10.0f}   (kernels alone {kernels_alone():.0f})")
    print(f"  designs as rows    {evaluate_alone():10.0f}")
    print_joints_and_targets()
    print(f"  armwright, one design at a time: {single_design_ms():.2f} ms")
    compare_with_yardstick()
    for name, work, n in (("Pinocchio loop", pinocchio_loop, 20), ("scikit-robot", skrobot, 5)):
        theirs = rate(work, n)
        print(f"  {name:18s} {theirs:10.1f}   armwright is {ours / theirs:.0f} times as fast")


def rate(work: Callable[[int], None], n: int) -> float:
    """Designs a second: the best of three times n designs, after a first one that compiles and loads."""
    work(1)
    times: list[float] = []
    for _ in range(3):
        started = time.perf_counter()
        work(n)
        times.append(time.perf_counter() - started)
    return n / min(times)


def timed(work: Callable[[], None]) -> float:
    """Seconds."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def armwright(n: int) -> None:
    evaluate(ARMS[:n], TARGETS)


def kernels_alone() -> float:
    """Designs a second from arms that are arrays already."""
    arrays = stack_arms(ARMS)

    def work(_: int) -> None:
        solve_postures(arrays, TARGETS)

    return rate(work, len(ARMS))


def evaluate_alone() -> float:
    """Designs a second from rows to both objectives."""
    matrix = PROBLEM.space.matrix(PROBLEM.space.sample(len(ARMS), seed=0))

    def work(n: int) -> None:
        PROBLEM.evaluate(matrix[:n])

    return rate(work, len(matrix))


def print_joints_and_targets() -> None:
    """A row for each number of joints and of targets: designs a second, and what one target takes."""
    points = np.random.default_rng(0).uniform(-0.6, 0.6, (64, 3))
    for dof, t, precision in (
        *((4, t, "float32") for t in (1, 2, 4, 7, 8, 9, 12, 16, 17, 32, 64)),
        *((dof, 8, "float32") for dof in range(1, 9)),
        (4, 8, "float64"),
    ):
        space = paper_space(dof)
        arrays = stack_designs(space, space.matrix(space.sample(2000, seed=0)), precision=precision)

        def work(_: int, t: int = t, arrays: ArmArrays = arrays, precision: Precision = precision) -> None:
            solve_postures(arrays, points[:t], precision=precision)

        designs = rate(work, 2000)
        print(f"  D = {dof}, T = {t:2d}, {precision}  {designs:10.0f}   {1e6 / designs / t:6.2f} µs a target")


def print_memory_of_a_million() -> None:
    """What the process grows by at its peak while a million designs are evaluated from rows, results included."""
    matrix = np.tile(PROBLEM.space.matrix(PROBLEM.space.sample(1000, seed=0)), (1000, 1))
    PROBLEM.evaluate(matrix[:10])
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    PROBLEM.evaluate(matrix)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(f"  a million designs at {len(TARGETS)} targets: {grown / 1024:.0f} MiB more at the peak")


def compare_with_yardstick() -> None:
    """The same arms and targets by hand-written C++, its 3 x 3 algebra in double precision (as ours) and in single."""
    library = built_yardstick()
    if library is None:
        print("  C++ yardstick: g++ is not there")
        return
    arrays, n = stack_arms(ARMS), len(ARMS)
    links = np.ascontiguousarray(arrays.offset[..., 2])
    targets = TARGETS.astype(np.float32)
    error, torque = np.zeros(n, np.float32), np.zeros(n, np.float32)

    def pointer(values: np.ndarray) -> ctypes.c_void_p:
        return values.ctypes.data_as(ctypes.c_void_p)

    def ours() -> None:
        solve_postures(arrays, TARGETS)

    evaluation = evaluate(ARMS, TARGETS)
    for wide, words in ((1, "double 3 x 3"), (0, "all float")):

        def theirs(wide: int = wide) -> None:
            library.yardstick(
                n, pointer(arrays.base), pointer(arrays.motion), pointer(links), ctypes.c_float(2.4),
                ctypes.c_float(MassPerMetre().kg), pointer(targets), UPDATES, wide, pointer(error), pointer(torque),
            )  # fmt: skip

        # In turn, as the speed of a shared machine drifts.
        seconds = np.array([(timed(theirs), timed(ours)) for _ in range(7)])
        ratios = seconds[:, 0] / seconds[:, 1]
        apart = error.mean() / evaluation.position_error.sum(axis=1).mean() - 1.0
        print(
            f"  C++, {words:12s}  {n / seconds[:, 0].min():10.0f}   the kernels make {np.median(ratios):.2f} of it "
            f"({ratios.min():.2f} to {ratios.max():.2f}; mean E_pos {apart:+.4%})"
        )


def built_yardstick() -> ctypes.CDLL | None:
    """The shared library of yardstick.cpp, built anew."""
    if shutil.which("g++") is None:
        return None
    source = Path(__file__).with_name("yardstick.cpp")
    with tempfile.TemporaryDirectory() as folder:
        built = Path(folder) / "yardstick.so"
        flags = [
            "-O3",
            "-march=native",
            "-Wno-psabi",
            "-ffast-math",
            "-fno-finite-math-only",
            "-std=c++17",
            "-shared",
            "-fPIC",
        ]
        subprocess.run(["g++", *flags, str(source), "-o", str(built)], check=True)
        return ctypes.CDLL(str(built))


def single_design_ms() -> float:
    """One design at a time, as in a study."""
    started = time.perf_counter()
    for arm in ARMS[:1000]:
        evaluate([arm], TARGETS)
    return time.perf_counter() - started


def skrobot(n: int) -> None:
    for arm in ARMS[:n]:
        file = io.StringIO(to_urdf(arm))
        file.name = "arm.urdf"
        robot = RobotModel()
        robot.load_urdf_file(file)
        links = [getattr(robot, f"link_{j}") for j in range(1, 5)]
        for target in TARGETS:
            robot.angle_vector(np.zeros(4))
            robot.inverse_kinematics(
                Coordinates(pos=target),
                move_target=robot.tip,
                link_list=links,
                rotation_axis=False,
                stop=UPDATES,
                thre=[0.0],
                rthre=[0.0],
                revert_if_fail=False,
                p_limit=0.1,
            )


def pinocchio_loop(n: int) -> None:
    """The solver as one writes it in Python: FK, Jacobian and torque by Pinocchio, the rest by numpy."""
    for arm in ARMS[:n]:
        model = pin.buildModelFromXML(to_urdf(arm))
        data = model.createData()
        tip = model.getFrameId("tip")
        for target in TARGETS:
            pin.computeGeneralizedGravity(model, data, _solve(model, data, tip, target))


def _solve(model: pin.Model, data: pin.Data, tip: int, target: np.ndarray) -> np.ndarray:
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    inner_lower, inner_upper = lower + np.radians(1.0), upper - np.radians(1.0)
    eye3, eye = np.eye(3), np.eye(model.nq)
    q = kept = np.zeros(model.nq)
    best, before = np.inf, np.full(model.nq, np.inf)
    for _ in range(UPDATES):
        J = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
        error = target - data.oMf[tip].translation
        distance = np.sqrt(error @ error)
        if distance < best:
            best, kept = distance, q
        step = error * min(1.0, 0.1 / max(distance, 1e-12))
        m = np.sqrt(max(0.0, np.linalg.det(J @ J.T)))
        k = 0.001 * (1 - m / 0.1) ** 2 if m < 0.1 else 0.0
        inside = np.clip(q, inner_lower, inner_upper)
        room = (upper - inside) * (inside - lower)
        h = np.abs((upper - lower) ** 2 * (2 * inside - upper - lower) / (4 * room**2))
        w = np.where(h >= before, 1 / (1 + h), 1.0)
        before = h
        y = 0.01 * w * np.sign(middle - q) * ((middle - q) / half) ** 2
        WJt = w[:, None] * J.T
        inverse = WJt @ np.linalg.inv(J @ WJt + k * eye3)
        q = np.clip(q + inverse @ step + (eye - inverse @ J) @ y, lower, upper)
    pin.framesForwardKinematics(model, data, q)
    error = target - data.oMf[tip].translation
    return q if np.sqrt(error @ error) < best else kept


if __name__ == "__main__":
    main()
