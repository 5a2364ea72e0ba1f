"""How fast designs are evaluated, on one core, beside scikit-robot's own IK and a Pinocchio loop in Python.

The same work for all three: random arms of 4 joints at the 8 targets of target-1, 100 updates from the straight
start each, then the gravity torque of the posture kept.

    python benchmarks/evaluation.py
"""

import os
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin
from skrobot.model import RobotModel

from armwright.arm import Arm
from armwright.evaluation import evaluate
from armwright.export.urdf import to_urdf
from armwright.kinematics.solve import UPDATES
from armwright.space import paper_space
from armwright.task import load_task

TARGETS = load_task("target-1").points
ARMS = [paper_space().arm(design) for design in paper_space().sample(8000, seed=0)]


def rate(work: Callable[[int], None], n: int, repeats: int = 3) -> float:
    """Designs a second: the best of `repeats`, each of n designs."""
    work(1)
    times: list[float] = []
    for _ in range(repeats):
        started = time.perf_counter()
        work(n)
        times.append(time.perf_counter() - started)
    return n / min(times)


def armwright(n: int) -> None:
    evaluate(ARMS[:n], TARGETS)


def skrobot(n: int) -> None:
    for arm in ARMS[:n]:
        robot = RobotModel()
        robot.load_urdf_from_string(to_urdf(arm)) if hasattr(robot, "load_urdf_from_string") else _load(robot, arm)
        links = [robot.__dict__[f"link_{j}"] for j in range(1, 5)]
        from skrobot.coordinates import Coordinates

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
    """The solver as a roboticist writes it with Pinocchio and numpy: FK and Jacobian by the library, the rest by hand."""
    for arm in ARMS[:n]:
        model = pin.buildModelFromXML(to_urdf(arm))
        data = model.createData()
        tip = model.getFrameId("tip")
        for target in TARGETS:
            q = _solve(model, data, tip, target)
            pin.computeGeneralizedGravity(model, data, q)


def _solve(model: pin.Model, data: pin.Data, tip: int, target: np.ndarray) -> np.ndarray:
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    margin = np.radians(1.0)
    q = np.zeros(model.nq)
    kept, best = q, np.inf
    before = np.full(model.nq, np.inf)
    eye3, eye = np.eye(3), np.eye(model.nq)
    for _ in range(UPDATES):
        jacobian = pin.computeFrameJacobian(model, data, q, tip, pin.LOCAL_WORLD_ALIGNED)[:3]
        error = target - data.oMf[tip].translation
        distance = np.sqrt(error @ error)
        if distance < best:
            best, kept = distance, q
        step = error * min(1.0, 0.1 / max(distance, 1e-12))
        manipulability = np.sqrt(max(0.0, np.linalg.det(jacobian @ jacobian.T)))
        damping = 0.001 * (1 - manipulability / 0.1) ** 2 if manipulability < 0.1 else 0.0
        inside = np.clip(q, lower + margin, upper - margin)
        gradient = np.abs(
            (upper - lower) ** 2 * (2 * inside - upper - lower) / (4 * ((upper - inside) * (inside - lower)) ** 2)
        )
        weight = np.where(gradient >= before, 1 / (1 + gradient), 1.0)
        before = gradient
        pull = 0.01 * weight * np.sign(middle - q) * ((middle - q) / half) ** 2
        weighted = weight[:, None] * jacobian.T
        inverse = weighted @ np.linalg.inv(jacobian @ weighted + damping * eye3)
        q = np.clip(q + inverse @ step + (eye - inverse @ jacobian) @ pull, lower, upper)
    pin.framesForwardKinematics(model, data, q)
    error = target - data.oMf[tip].translation
    return q if np.sqrt(error @ error) < best else kept


def _load(robot: RobotModel, arm: Arm) -> None:
    import io

    file = io.StringIO(to_urdf(arm))
    file.name = "arm.urdf"
    robot.load_urdf_file(file)


def single_design_ms() -> float:
    """One design alone, as in a study [ms]."""
    started = time.perf_counter()
    for arm in ARMS[:500]:
        evaluate([arm], TARGETS)
    return (time.perf_counter() - started) / 500 * 1e3


def main() -> None:
    cores = sorted(os.sched_getaffinity(0))
    both = rate(armwright, 8000)
    os.sched_setaffinity(0, cores[:1])
    from armwright.kinematics import solve

    solve._pool.cache_clear()
    ours = rate(armwright, 8000)
    one = single_design_ms()
    theirs = {"Pinocchio loop": rate(pinocchio_loop, 10, 2), "scikit-robot": rate(skrobot, 4, 2)}
    os.sched_setaffinity(0, cores)
    print(
        "Evaluation of designs, 8 targets, D = 4, 100 updates, one core (parsing of the URDF included for the others)"
    )
    print(
        f"  armwright        {ours:10.0f} designs/s   (a single design {one:.2f} ms; {len(cores)} cores {both:.0f} designs/s)"
    )
    for name, value in theirs.items():
        print(f"  {name:16s} {value:10.1f} designs/s   armwright is {ours / value:.0f} times as fast")


if __name__ == "__main__":
    main()
