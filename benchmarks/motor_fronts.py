"""Motor bodies on the fronts of the tasks with cycles and motors: what ignoring them is worth, and where they are.

Each task is searched twice with one seed. `stay` is how many designs of the front of a search without bodies are
feasible when bodies count. For the front of a search with them, Coal and Pinocchio read the exported URDF and SRDF and
follow the exported trajectories: `least` is the smallest distance of a motor from another one, from a link that is not
next to it, or from an obstacle (of a motor at rest, only if it is inside). If it is positive, nothing overlaps.

    python benchmarks/motor_fronts.py [--evaluations 3000] [TASK ...]      # some 30 minutes on two cores
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import coal
import numpy as np
import pinocchio
from drivable import BUILT_IN, EXAMPLES, problem

import armwright as aw
from armwright.arrays import Array
from armwright.robot.arm import Arm
from armwright.robot.srdf import to_srdf
from armwright.robot.urdf_writer import to_urdf
from armwright.runs.cycle_export import TRAJECTORY, cycle_files, read_trajectory
from armwright.tasks.obstacles import Obstacle

EVERY = 4  # rows of a trajectory
Placed = tuple[coal.ShapeBase, coal.Transform3s]


@dataclass(frozen=True)
class Fronts:
    """What was found for a task."""

    task: str
    without: int
    stay: int
    with_bodies: int
    least: float


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--evaluations", type=int, default=3_000)
    parser.add_argument("tasks", nargs="*", default=[*BUILT_IN, *EXAMPLES])
    chosen = parser.parse_args()
    tasks = [name for name in chosen.tasks if problem(name).space.has_motor_bodies]
    print(f"{'task':20s} without   stay   with   least [mm]")
    with ProcessPoolExecutor(2) as pool:
        for one in pool.map(measure, tasks, [chosen.evaluations] * len(tasks)):
            print(
                f"{one.task:20s} {one.without:7d} {one.stay:6d} {one.with_bodies:6d} {1e3 * one.least:12.2f}",
                flush=True,
            )


def measure(name: str, evaluations: int) -> Fronts:
    """Search a task without and with motor bodies."""
    bodies = problem(name)
    space = bodies.space.model_validate(bodies.space.model_dump() | {"motor_bodies": False})
    ignorant = aw.find_front(aw.Problem(bodies.task, space), evaluations=evaluations, seed=0).history.front
    outcomes = bodies.evaluate([bodies.space.design(member.design.params) for member in ignorant])
    history = aw.find_front(bodies, evaluations=evaluations, seed=0).history
    evaluation = history.evaluation([member.number for member in history.front])
    least = np.inf
    for row, member in enumerate(history.front):
        text = cycle_files(bodies, member.arm, evaluation, row, name)[TRAJECTORY]
        trajectory = read_trajectory(text, bodies.task.target_names)
        least = min(least, motor_clearance(member.arm, trajectory.q, bodies.task.obstacles))
    stay = int((outcomes.violations <= 0.0).all(axis=1).sum()) if ignorant else 0
    return Fronts(name, len(ignorant), stay, len(history.front), least)


def motor_clearance(arm: Arm, q: Array, obstacles: tuple[Obstacle, ...]) -> float:
    """Return the least distance of a motor from all that it may hit [m].

    Args:
        arm: The arm.
        q: (K, D) values of its moving joints [rad] or [m].
        obstacles: The obstacles.
    """
    urdf = to_urdf(arm)
    model = pinocchio.buildModelFromXML(urdf)
    solids = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    solids.addAllCollisionPairs()
    pinocchio.removeCollisionPairsFromXML(model, solids, to_srdf(arm))
    motors = [i for i, solid in enumerate(solids.geometryObjects) if solid.name.startswith("motor_")]
    pairs = [pair for pair in solids.collisionPairs if pair.first in motors or pair.second in motors]
    data, placed = model.createData(), solids.createData()
    found = [np.inf]
    for posture in q[::EVERY]:
        pinocchio.updateGeometryPlacements(model, data, solids, placed, posture)
        bodies = [
            (solid.geometry, coal.Transform3s(at.rotation, at.translation))
            for solid, at in zip(solids.geometryObjects, placed.oMg, strict=True)
        ]
        found += [distance(bodies[pair.first], bodies[pair.second]) for pair in pairs]
        for i in motors:
            gaps = [distance(bodies[i], as_coal(obstacle)) for obstacle in obstacles]
            is_at_rest = solids.geometryObjects[i].parentJoint == 0
            found += [gap for gap in gaps if gap < 0.0 or not is_at_rest]
    return min(found)


def as_coal(obstacle: Obstacle) -> Placed:
    """Return an obstacle in Coal."""
    solid = obstacle.solid
    x, y, z = solid.half
    at = coal.Transform3s(solid.rotation, np.array(solid.centre))
    match obstacle.kind:
        case "box":
            return coal.Box(2 * x, 2 * y, 2 * z), at
        case "sphere":
            return coal.Sphere(x), at
        case "cylinder":
            return coal.Cylinder(x, 2 * z), at
        case "ground":
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), solid.centre[2]), coal.Transform3s.Identity()


def distance(one: Placed, other: Placed) -> float:
    """Return the signed distance of two solids [m]."""
    return coal.distance(*one, *other, coal.DistanceRequest(), coal.DistanceResult())


if __name__ == "__main__":
    main()
