"""Clearance against Coal, with link poses from Pinocchio."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import coal
import numpy as np
import pinocchio
import pytest
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import Precision, stack_arms
from armwright.kinematics.contact.clearance import clearances
from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.urdf_writer import to_urdf
from armwright.spaces.design_space import paper_space
from armwright.tasks.obstacles import Box, Cylinder, Ground, Mesh, Obstacle, Sphere
from tests.support.arms import moving_arms

Array = NDArray[np.float64]
NEAR = 1e-4  # [m], to which float32 is asked to agree; the oracle's own tolerance is 1e-6
SHAPES = ("box", "sphere", "cylinder", "ground", "mesh")


def random_obstacle(rng: np.random.Generator, kind: str, spread: float = 0.7, size: float = 1.0) -> Obstacle:
    center = tuple(rng.uniform(-spread, spread, 3).tolist())
    if kind == "box":
        rpy = tuple(rng.uniform(-3.0, 3.0, 3).tolist())
        return Box(kind="box", center=center, size=tuple((size * rng.uniform(0.02, 0.5, 3)).tolist()), rpy=rpy)
    if kind == "sphere":
        return Sphere(kind="sphere", center=center, radius=size * float(rng.uniform(0.02, 0.3)))
    if kind == "cylinder":
        axis = tuple(rng.normal(size=3).tolist())
        radius, height = (size * rng.uniform(0.02, 0.3, 2)).tolist()
        return Cylinder(kind="cylinder", center=center, radius=radius, height=height, axis=axis)
    if kind == "mesh":
        corners = tuple(map(tuple, (size * rng.uniform(0.02, 0.2, 3) * rng.normal(size=(30, 3))).tolist()))
        rpy = tuple(rng.uniform(-3.0, 3.0, 3).tolist())
        return Mesh(kind="mesh", mesh="fixture.stl", points=corners, position=center, rpy=rpy)
    return Ground(kind="ground", z=float(rng.uniform(-spread, spread)))


def coal_shape(obstacle: Obstacle) -> tuple[Any, coal.Transform3s]:
    """Return an obstacle in Coal; only the frame is ours, and it is tested separately."""
    solid = obstacle.solid
    at = coal.Transform3s(solid.rotation, np.array(solid.centre))
    match obstacle:
        case Box():
            return coal.Box(*obstacle.size), at
        case Sphere():
            return coal.Sphere(obstacle.radius), at
        case Cylinder():
            return coal.Cylinder(obstacle.radius, obstacle.height), at
        case Ground():
            return coal.Halfspace(np.array([0.0, 0.0, 1.0]), obstacle.z), coal.Transform3s.Identity()
        case Mesh():
            corners = coal.StdVec_Vec3s()
            corners.extend(obstacle.scale * np.array(obstacle.points))
            at = coal.Transform3s(solid.rotation, np.array(obstacle.position))
            return coal.Convex.convexHull(corners, False, "Qt"), at


def capsule(start: Array, end: Array, radius: float) -> tuple[Any, coal.Transform3s]:
    along = end - start
    long = float(np.linalg.norm(along))
    turn = pinocchio.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along / max(long, 1e-12)).matrix()
    return coal.Capsule(radius, long), coal.Transform3s(turn, (start + end) / 2)


def apart(one: tuple[Any, coal.Transform3s], other: tuple[Any, coal.Transform3s]) -> float:
    return coal.distance(one[0], one[1], other[0], other[1], coal.DistanceRequest(), coal.DistanceResult())


def agree(ours: float, theirs: float) -> bool:
    """Compare distances of separate shapes; for penetrating ones only the sign, as depths are defined differently."""
    return abs(ours - theirs) < NEAR if theirs > NEAR else ours < 2 * NEAR


def places_of(arm: Arm, q: Array) -> Array:
    """(D + 1, 3) joints and tip, by Pinocchio from the arm's URDF."""
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    tip = data.oMf[model.getFrameId("tip")].translation
    return np.array([*(data.oMi[j].translation for j in range(1, model.njoints)), tip])


def expected_self(places: Array, radii: Sequence[float]) -> float:
    found = np.inf
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    for i in range(len(radii)):
        for j in range(i + 2, len(radii)):
            spared = max(0.0, 2 * (radii[i] + radii[j]) - lengths[i + 1 : j].sum()) / 2
            if spared > min(lengths[i], lengths[j]):
                continue
            along_i, along_j = ((places[k + 1] - places[k]) / lengths[k] for k in (i, j))
            first = capsule(places[i], places[i + 1] - spared * along_i, radii[i])
            second = capsule(places[j] + spared * along_j, places[j + 1], radii[j])
            found = min(found, apart(first, second))
    return found


def expected_obstacles(places: Array, radii: Sequence[float], obstacles: Sequence[Obstacle]) -> float:
    found = np.inf
    for j, radius in enumerate(radii):
        start, end = places[j], places[j + 1]
        for obstacle in obstacles:
            shape, from_there = coal_shape(obstacle), start
            if j == 0:
                long = np.linalg.norm(end - start)
                if long <= 2 * radius:
                    continue
                from_there = start + 2 * radius / long * (end - start)
            distance = apart(capsule(from_there, end, radius), shape)
            foot = (coal.Sphere(radius), coal.Transform3s(np.eye(3), start))
            if j == 0 and apart(foot, shape) <= 0.0 and distance >= 0.0:
                continue
            found = min(found, distance)
    return found


def random_postures(arms: Sequence[Arm], t: int, seed: int) -> Array:
    shape = (len(arms), t, len(arms[0].joints))
    return np.random.default_rng(seed).uniform(-2.4, 2.4, shape)


# Against Coal, with joints from Pinocchio


@pytest.mark.parametrize("kind", SHAPES)
def test_clearance_of_one_link_agrees_with_coal(kind: str) -> None:
    rng = np.random.default_rng(SHAPES.index(kind))
    arms = moving_arms(60, 1, 3)
    q = random_postures(arms, 1, 4)
    places = [places_of(arm, posture[0]) for arm, posture in zip(arms, q, strict=True)]
    n_free = n_hit = n_on = 0
    for _ in range(30):
        obstacle = random_obstacle(rng, kind, size=3.0)
        found = clearances(stack_arms(arms), q, [obstacle])[1][:, 0]
        for arm, at, ours in zip(arms, places, found.tolist(), strict=True):
            theirs = expected_obstacles(at, [arm.links[0].radius], [obstacle])
            n_free, n_hit, n_on = n_free + (NEAR < theirs < np.inf), n_hit + (theirs < -NEAR), n_on + (theirs == np.inf)
            assert ours == theirs == np.inf or agree(ours, theirs), (kind, ours, theirs)
    assert min(n_free, n_hit) > 60, "both occur"


@pytest.mark.parametrize("precision", ["float32", "float64"])
@pytest.mark.parametrize("dof", [3, 6, 8])
@pytest.mark.fast_cases(3)
def test_clearance_of_whole_arms_agrees_with_coal(dof: int, precision: Precision) -> None:
    rng = np.random.default_rng(dof)
    arms = [*moving_arms(12, dof, 1), *(paper_space(dof).arm(design) for design in paper_space(dof).sample(12, 1))]
    obstacles = [random_obstacle(rng, kind, 1.0) for kind in (*SHAPES[:3], *SHAPES[:3])]
    q = random_postures(arms, 3, 5)
    own, clear = clearances(stack_arms(arms, precision), q, obstacles)
    free = 0
    for n, arm in enumerate(arms):
        radii = [link.radius for link in arm.links]
        for t in range(q.shape[1]):
            places = places_of(arm, q[n, t])
            theirs = expected_self(places, radii), expected_obstacles(places, radii, obstacles)
            free += min(theirs) > NEAR
            assert agree(own[n, t], theirs[0]) or own[n, t] == theirs[0] == np.inf
            assert agree(clear[n, t], theirs[1])
    assert 6 < free < 69, "some arms are free, some are not"


def test_clearance_of_nearly_parallel_segments_is_accurate() -> None:
    """Arms folded onto themselves, nearly in a plane, make common normals ill-conditioned."""
    rng = np.random.default_rng(0)
    arms = []
    for _ in range(500):
        lengths = rng.uniform(0.1, 0.3, 3)
        links = tuple(uniform_link((0.0, 0.0, long), 0.1, 0.01) for long in lengths.tolist())
        arms.append(Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", axis, -3.2, 3.2) for axis in ("z", "y", "y")), links))
    folds = rng.choice([0.0, np.pi / 2, -np.pi / 2, 1.5708, np.pi / 2 + 1e-4], (500, 1, 3))
    q = folds + rng.choice([0.0, 1e-7, 1e-5, 1e-3], folds.shape)
    own = clearances(stack_arms(arms), q)[0]
    exact = clearances(stack_arms(arms, "float64"), q)[0]
    assert own == pytest.approx(exact, abs=1e-5)
    for n in range(0, 500, 5):
        assert agree(own[n, 0], expected_self(places_of(arms[n], q[n, 0]), [0.01] * 3))


# What must hold whatever the arm


def test_penetration_depth_adds_axis_and_radius() -> None:
    """A rod straight through a large sphere, a plate and a pole; and two links that cross."""
    rod = Arm((0.0, 0.0, 0.0), (Joint("revolute", "x", -1, 1),), (uniform_link((0.0, 0.0, 1.0), 1.0, 0.02),))
    for obstacle, depth in (
        (Sphere(kind="sphere", center=(0.05, 0.0, 0.5), radius=0.2), 0.15 + 0.02),
        (Box(kind="box", center=(0.0, 0.0, 0.5), size=(1.0, 1.0, 0.1)), 0.05 + 0.02),
        (Cylinder(kind="cylinder", center=(0.0, 0.03, 0.5), radius=0.1, height=2.0, axis="x"), 0.07 + 0.02),
        (Cylinder(kind="cylinder", center=(0.0, 0.03, 0.5), radius=0.1, height=2.0, axis="z"), 0.07 + 0.02),
        (Ground(kind="ground", z=0.3), 0.3 - 0.04 + 0.02),
    ):
        found = clearances(stack_arms([rod]), np.zeros((1, 1, 1)), [obstacle])[1]
        assert found[0, 0] == pytest.approx(-depth, abs=1e-6), obstacle.describe()
    links = tuple(uniform_link((0.0, 0.0, long), 1.0, 0.02) for long in (0.5, 0.2, 0.5, 0.5))
    square = Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", "y", -3, 3) for _ in links), links)
    folded = np.array([[[0.0, np.pi / 2, np.pi / 2, np.pi / 2]]])  # the last crosses the first
    assert clearances(stack_arms([square]), folded)[0][0, 0] == pytest.approx(-0.04, abs=1e-6)


def test_links_of_no_radius_are_ignored() -> None:
    """Links of radius 0 count as if the arm ended before them."""
    arms = stack_arms(moving_arms(30, 6, 2))
    q = random_postures(moving_arms(30, 6, 2), 3, 0)
    obstacles = [random_obstacle(np.random.default_rng(5), kind) for kind in SHAPES[:3]]
    radius = arms.radius.copy()
    radius[:, 4:] = 0.0
    found = clearances(replace(arms, radius=radius), q, obstacles)
    shorter = stack_arms([Arm(a.base, a.joints[:4], a.links[:4]) for a in moving_arms(30, 6, 2)])
    assert np.array_equal(found, clearances(shorter, q[..., :4], obstacles))


def planar(lengths: Sequence[float], radius: float = 0.015) -> Arm:
    links = tuple(Link((0.0, 0.0, long), 0.1, (0.0, 0.0, long / 2), radius) for long in lengths)
    return Arm((0.0, 0.0, 0.0), tuple(Joint("revolute", "y", -3.1, 3.1) for _ in lengths), links)


@pytest.mark.parametrize("short", [0.0, 0.001, 0.02, 0.03, 0.05, 0.06, 0.2])
def test_straight_arm_is_clear_of_itself(short: float) -> None:
    """With middle links of any length the clearance is two radii; a folded arm penetrates itself."""
    arm = planar([0.2, short, 0.2, short, short, 0.2])
    straight = clearances(stack_arms([arm]), np.zeros((1, 1, 6)))[0][0, 0]
    assert straight >= 0.03 - 1e-6
    folded = np.array([[[0.0, 2.6, 0.5, 0.0, 0.0, 0.0]]])
    found = clearances(stack_arms([arm]), folded)[0][0, 0]
    assert (found < 0.0) == (short < 0.06)


def test_first_link_may_stand_on_an_obstacle_at_its_base() -> None:
    ground = [Ground(kind="ground", z=0.0)]

    def of(base: float, q: Sequence[float], *, lengths: Sequence[float] = (0.2, 0.3)) -> float:
        arm = replace(planar(lengths), base=(0.0, 0.0, base))
        return float(clearances(stack_arms([arm]), np.array([[q]]), ground)[1][0, 0])

    assert of(0.0, (0.0, 0.0)) == pytest.approx(0.2 - 0.015), (
        "upright on the ground: the second link's start is nearest"
    )
    assert of(-0.01, (0.0, 0.0)) == pytest.approx(0.19 - 0.015)
    assert of(0.0, (np.pi / 2, 0.0)) == pytest.approx(-0.015, abs=1e-6), "a link that lies in the table's surface"
    assert of(0.0, (2.0, 0.0)) < -0.1, "and one that goes down"
    assert of(0.1, (0.0, 0.0)) == pytest.approx(0.1 + 0.03 - 0.015), "above it, all but the foot counts"
    assert of(-0.3, (0.0, 0.0)) == pytest.approx(-0.27 - 0.015), "in it, too"
    assert of(0.0, (0.0,), lengths=(0.2,)) == np.inf
    wall = [Box(kind="box", center=(-0.5, 0.0, 0.0), size=(1.0, 2.0, 2.0))]
    arm = replace(planar((0.2, 0.3)), base=(0.0, 0.0, 0.0))
    out = clearances(stack_arms([arm]), np.array([[[np.pi / 2, 0.0]]]), wall)[1][0, 0]
    assert out == pytest.approx(0.2 - 0.015), "straight out of a wall"


def test_rigidly_connected_links_are_ignored() -> None:
    """A hook of three links, of which the last two hold still."""
    links = [uniform_link(offset, 0.1, 0.02) for offset in ((0.0, 0.0, 0.1), (0.05, 0.0, 0.0), (0.0, 0.0, -0.1))]
    hinge, fixed = Joint("revolute", "y", -2.0, 2.0), Joint("fixed", "z")
    hook = Arm((0.0, 0.0, 0.0), (hinge, fixed, fixed), tuple(links))
    moving = Arm((0.0, 0.0, 0.0), (hinge, hinge, hinge), tuple(links))
    found, _ = clearances(stack_arms([hook, moving]), np.zeros((2, 1, 3)))
    assert found[0, 0] == np.inf
    assert found[1, 0] == pytest.approx(0.05 - 0.04, abs=1e-6)
