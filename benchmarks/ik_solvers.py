"""Inverse kinematics of armwright beside EAIK, PyRoki, Pinocchio and scikit-robot, on the same poses.

Two arms of example-robot-data: UR5 (6 joints) and Panda (7 joints). Positions and orientations of the tip at random
postures within the limits, so that every pose can be reached. Each solver starts where it does by default; further
starts are random. All answers are clipped to the joint limits and checked by Pinocchio's forward kinematics: a pose is
reached within 1 mm and 1 mrad. Processor time on one core, which other programs on the machine hardly change, after a
first call that compiles. Solvers that are not installed are named and left out; EAIK and PyRoki (with JAX) are no
dependencies of armwright. The docstring of each solver says how it is used.

    python benchmarks/ik_solvers.py
"""

import importlib
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from one_core import on_one_core

import armwright as aw
from armwright.arrays import Array

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.robots import robot

ARMS = {"ur5_robot": "ee_link", "panda": "panda_hand_tcp"}  # tips by file
POSES, FEW = 1000, 100  # few for solvers that take milliseconds
MORE_STARTS = 8
NEAR = 1e-3  # [m] and [rad]
ROUNDS = 5  # the best counts, of fewer for solvers that take long
Solver = Callable[[Array], Array]  # from transforms (n, 4, 4) to joint values (n, D) in the URDF's order


class Work:
    """An arm, and what Pinocchio says of it."""

    def __init__(self, name: str, folder: Path) -> None:
        self.tip, self.urdf = ARMS[name], folder / f"{name}.urdf"
        _write_without_meshes(robot(name), self.urdf)
        self.model = pin.buildModelFromUrdf(str(self.urdf))
        self.data = self.model.createData()
        self.frame = self.model.getFrameId(self.tip)
        self.lower, self.upper = self.model.lowerPositionLimit, self.model.upperPositionLimit
        self.joints = list(self.model.names)[1:]
        self.poses = np.array([self.pose(q) for q in self.postures(POSES, 0)])

    def postures(self, n: int, seed: int) -> Array:
        return np.random.default_rng(seed).uniform(self.lower, self.upper, (n, self.model.nq))

    def pose(self, q: Array) -> Array:
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array(self.data.oMf[self.frame].homogeneous)

    def reached(self, q: Array, poses: Array) -> float:
        """The share of poses (n, 4, 4) that joint values (n, D) reach."""
        near = 0
        for values, pose in zip(np.clip(q, self.lower, self.upper), poses, strict=True):
            found = self.pose(values)
            angle = np.linalg.norm(pin.log3(found[:3, :3].T @ pose[:3, :3]))
            near += bool(np.linalg.norm(found[:3, 3] - pose[:3, 3]) < NEAR and angle < NEAR)
        return near / len(poses)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        works = [Work(name, Path(folder)) for name in ARMS]
        for solver, module, n in SOLVERS:
            try:
                importlib.import_module(module)
            except ImportError:
                print(f"{solver.__name__}: not installed")
                continue
            for restarts in (None,) if solver is eaik else (0, MORE_STARTS):
                for work in works:
                    print(
                        f"{solver.__name__:12s} {work.urdf.stem:10s} {measured(work, solver, n, restarts)}", flush=True
                    )


def measured(work: Work, solver: "Make", n: int, restarts: int | None) -> str:
    """Return the share of reached poses and the processor time of each, in words."""
    try:
        solve = solver(work, restarts or 0)
    except RuntimeError as error:
        return str(error)
    poses = work.poses[:n]
    solve(poses)  # compiles
    times: list[float] = []
    while len(times) < ROUNDS and sum(times) < 1.0:
        started = time.process_time()
        q = solve(poses)
        times.append(time.process_time() - started)
    starts = "" if restarts is None else f"{restarts} restarts, "
    return f"{starts}{work.reached(q, poses):.1%} of {n} poses, {1e6 * min(times) / n:.1f} µs for each"


def armwright(work: Work, restarts: int) -> Solver:
    arm = aw.read_urdf(work.urdf, tip=work.tip)

    def solve(poses: Array) -> Array:
        return aw.solve(arm, poses[:, :3, 3], orientations=poses[:, :3, :3], restarts=restarts).q[0]

    return solve


def eaik(work: Work, _: int) -> Solver:
    """Analytical: all solutions of a pose; the first within the limits that is no least-squares one counts."""
    from eaik.IK_URDF import UrdfRobot

    arm = UrdfRobot(str(work.urdf))
    zero = np.zeros(work.model.nq)
    from_tip = np.linalg.inv(work.pose(zero)) @ arm.fwdKin(zero)

    def first(answer: Any) -> Array:
        found, approximate = np.reshape(answer.Q, (-1, work.model.nq)), np.array(answer.is_LS, dtype=bool)
        inside = np.all((work.lower <= found) & (found <= work.upper), axis=1)
        best = np.flatnonzero(inside & ~approximate)
        return found[best[0]] if len(best) else zero

    def solve(poses: Array) -> Array:
        return np.array([first(answer) for answer in arm.IK_batched(poses @ from_tip, num_worker_threads=1)])

    return solve


def pyroki(work: Work, restarts: int) -> Solver:
    """The costs and weights of its own example, for all poses and starts at once; the best start counts."""
    import jax
    import jax.numpy as jnp
    import jaxlie
    import jaxls
    import pyroki as pk
    import yourdfpy

    arm = pk.Robot.from_urdf(yourdfpy.URDF.load(str(work.urdf), load_meshes=False))
    link = jnp.array(arm.links.names.index(work.tip), dtype=jnp.int32)
    order = [arm.joints.actuated_names.index(joint) for joint in work.joints]
    variable = arm.joint_var_cls(0)
    starts = np.vstack([variable.default_factory(), work.postures(restarts, 1)[:, np.argsort(order)]])

    def one(pose: jax.Array, start: jax.Array) -> tuple[jax.Array, jax.Array]:
        target = jaxlie.SE3.from_matrix(pose)
        costs = [
            pk.costs.pose_cost_analytic_jac(arm, variable, target, link, pos_weight=50.0, ori_weight=10.0),
            pk.costs.limit_cost(arm, variable, weight=100.0),
        ]
        q = (
            jaxls.LeastSquaresProblem(costs, [variable])
            .analyze()
            .solve(
                initial_vals=jaxls.VarValues.make([variable.with_value(start)]),
                verbose=False,
                linear_solver="dense_cholesky",
                trust_region=jaxls.TrustRegionConfig(lambda_initial=1.0),
            )[variable]
        )
        clipped = jnp.clip(q, arm.joints.lower_limits, arm.joints.upper_limits)
        found = jaxlie.SE3(arm.forward_kinematics(clipped)[link])
        return q, jnp.linalg.norm((found.inverse() @ target).log())

    every = jax.jit(jax.vmap(jax.vmap(one, (None, 0)), (0, None)))

    def solve(poses: Array) -> Array:
        q, off = map(np.asarray, every(jnp.array(poses), jnp.array(starts)))
        return q[np.arange(len(poses)), np.nan_to_num(off, nan=np.inf).argmin(axis=1)][:, order]

    return solve


def pinocchio(work: Work, restarts: int) -> Solver:
    """The loop of its documentation (closed-loop inverse kinematics), with the joints clipped to their limits."""
    model, data = work.model, work.data
    joint = model.frames[work.frame].parentJoint
    to_tip = model.frames[work.frame].placement
    starts = [pin.neutral(model), *work.postures(restarts, 1)]

    def one(target: pin.SE3, q: Array) -> tuple[bool, Array]:
        for _ in range(1000):
            pin.forwardKinematics(model, data, q)
            between = data.oMi[joint].actInv(target)
            error = pin.log(between).vector
            if np.linalg.norm(error) < 1e-4:
                return True, q
            jacobian = -pin.Jlog6(between.inverse()) @ pin.computeJointJacobian(model, data, q, joint)
            step = -jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-12 * np.eye(6), error)
            q = np.clip(pin.integrate(model, q, 0.1 * step), work.lower, work.upper)
        return False, q

    def solve(poses: Array) -> Array:
        answers: list[Array] = []
        for pose in poses:
            target = pin.SE3(pose).act(to_tip.inverse())
            for start in starts:
                reached, q = one(target, np.clip(start, work.lower, work.upper))
                if reached:
                    break
            answers.append(q)
        return np.array(answers)

    return solve


def scikit_robot(work: Work, restarts: int) -> Solver:
    """Its batch solver, on JAX if that is installed, else on numpy."""
    from skrobot.coordinates import Coordinates
    from skrobot.model import RobotModel

    arm = RobotModel()
    arm.load_urdf_file(str(work.urdf))
    joints = [getattr(arm, joint) for joint in work.joints]
    middle = np.clip(np.zeros(len(joints)), work.lower, work.upper)

    def solve(poses: Array) -> Array:
        for joint, value in zip(joints, middle, strict=True):
            joint.joint_angle(value)
        answers = arm.batch_inverse_kinematics(
            [Coordinates(pos=pose[:3, 3], rot=pose[:3, :3]) for pose in poses],
            move_target=getattr(arm, work.tip),
            joint_list=joints,
            rotation_mask=True,
            position_mask=True,
            thre=NEAR,
            rthre=NEAR,
            attempts_per_pose=1 + restarts,
            retry_seed="random",
            random_initial_range=1.0,
            select_closest_to_initial=False,
        )[0]
        return np.array(answers, dtype=np.float64)

    return solve


def _write_without_meshes(source: Path, to: Path) -> None:
    """Fingers are fixed, since no solver is asked to move them."""
    tree = ElementTree.parse(source)
    for link in tree.iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    for joint in tree.iter("joint"):
        if "finger" in str(joint.get("name")):
            joint.set("type", "fixed")
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)
    tree.write(to)


Make = Callable[[Work, int], Solver]
SOLVERS: tuple[tuple[Make, str, int], ...] = (
    (armwright, "armwright", POSES),
    (eaik, "eaik", POSES),
    (pyroki, "pyroki", FEW),
    (pinocchio, "pinocchio", FEW),
    (scikit_robot, "skrobot", POSES),  # last, as it switches JAX to double precision
)

if __name__ == "__main__":
    on_one_core(__file__, main)
