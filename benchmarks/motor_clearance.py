"""Clearance of motor bodies by Coal and Pinocchio, which read the exported URDF."""

import coal
import numpy as np
import pinocchio

from armwright.arrays import Array
from armwright.robot.arm import Arm
from armwright.robot.collision_pairs import joined_by_column, joined_by_motors
from armwright.robot.urdf_writer import to_urdf
from armwright.tasks.obstacles import Obstacle

EVERY = 4  # rows of a trajectory
Placed = tuple[coal.ShapeBase, coal.Transform3s]


def motor_clearance(arm: Arm, q: Array, obstacles: tuple[Obstacle, ...]) -> float:
    """Return the least distance of a motor from another one, a link that is not next to it, or an obstacle [m].

    Args:
        arm: The arm.
        q: (K, D) values of its moving joints [rad] or [m].
        obstacles: The obstacles. A motor at rest counts against them only if it is inside.
    """
    urdf = to_urdf(arm)
    model = pinocchio.buildModelFromXML(urdf)
    solids = pinocchio.buildGeomFromUrdfString(model, urdf, pinocchio.GeometryType.COLLISION)
    solids.addAllCollisionPairs()
    names = [solid.name.removesuffix("_0") for solid in solids.geometryObjects]
    motors = [i for i, name in enumerate(names) if name.startswith("motor_")]
    touching = {frozenset((f"motor_{j + 1}", f"link_{n + 1}")) for j, n in joined_by_motors(arm)}
    touching |= {frozenset(("column", f"motor_{j + 1}")) for j in joined_by_column(arm)[0]}
    pairs = [
        pair
        for pair in solids.collisionPairs
        if (pair.first in motors or pair.second in motors)
        and frozenset((names[pair.first], names[pair.second])) not in touching
    ]
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
