"""SRDF in Pinocchio, and its disabled collision pairs against Coal."""

from collections import Counter
from itertools import combinations
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from armwright.robot.arm import Arm, Joint, Link, uniform_link
from armwright.robot.collision_pairs import disabled_collision_pairs, segment_distance
from armwright.robot.srdf import to_srdf
from armwright.robot.urdf_writer import to_urdf
from tests.support.arms import paper_arms
from tests.support.exported_arms import ARMS, MIXED, moving, odd_arms, postures
from tests.support.reference_kinematics import Array


class Geometry:
    """The solid links of an arm in Coal; all pairs of them."""

    def __init__(self, arm: Arm) -> None:
        self.model: Any = pinocchio.buildModelFromXML(to_urdf(arm))
        self.geometry: Any = pinocchio.buildGeomFromUrdfString(
            self.model, to_urdf(arm), pinocchio.GeometryType.COLLISION
        )
        self.geometry.addAllCollisionPairs()
        self.data: Any = self.model.createData()

    def pairs(self) -> set[tuple[int, int]]:
        """Of links from 0 that are looked at, also those that one fixed joint joins."""
        names = [shape.name for shape in self.geometry.geometryObjects]
        links = [int(name.removeprefix("link_").removesuffix("_0")) - 1 for name in names]
        return {(links[pair.first], links[pair.second]) for pair in self.geometry.collisionPairs}

    def distances(self, arm: Arm, q: Array) -> dict[tuple[int, int], float]:
        """Of all pairs [m]; 0 or below where they meet."""
        data = self.geometry.createData()
        pinocchio.updateGeometryPlacements(self.model, self.data, self.geometry, data, q)
        found: dict[tuple[int, int], float] = {}
        solid = [n for n, link in enumerate(arm.links) if link.length > 0.0]
        for pair in combinations(range(len(solid)), 2):
            index = self.geometry.findCollisionPair(pinocchio.CollisionPair(*pair))
            if index < len(self.geometry.collisionPairs):
                result = pinocchio.computeDistance(self.geometry, data, index)
                found[solid[pair[0]], solid[pair[1]]] = result.min_distance
        return found


def short_arms(n: int, seed: int) -> list[Arm]:
    """Arms of thick links that turn a little: some of their pairs always meet, some never."""
    rng = np.random.default_rng(seed)
    arms: list[Arm] = []
    for _ in range(n):
        joints: list[Joint] = []
        for kind in rng.choice(["revolute", "prismatic", "fixed"], 5, p=[0.6, 0.2, 0.2]):
            half = float(rng.uniform(0.01, 0.6)) * (0.1 if kind == "prismatic" else 1.0)
            joints.append(Joint(kind, rng.choice(["x", "y", "z"]), -half, half))
        links = (
            uniform_link(tuple(rng.uniform(-0.08, 0.08, 3).tolist()), 1.0, float(rng.uniform(0.005, 0.05)))
            for _ in joints
        )
        arms.append(Arm((0.0, 0.0, 0.0), tuple(joints), tuple(links)))
    return arms


PROVEN_OF = [*paper_arms(5, 4, 51), *odd_arms(5, 4, 52), *short_arms(30, 53), MIXED]


def test_disabled_collision_pairs_agree_with_coal() -> None:
    """In 50 postures each, and at the limits: pairs said to meet never or always do as said, and there are both."""
    reasons: Counter[str] = Counter()
    for arm in PROVEN_OF:
        geometry = Geometry(arm)
        settled = disabled_collision_pairs(arm)
        reasons.update(settled.values())
        lower, upper = geometry.model.lowerPositionLimit, geometry.model.upperPositionLimit
        for q in [*postures(arm, 50), lower, upper]:
            for pair, distance in geometry.distances(arm, q).items():
                if settled.get(pair) == "Never":
                    assert distance > 0.0
                if settled.get(pair) == "Always":
                    assert distance <= 0.0
    assert reasons["Never"] > 30
    assert reasons["Always"] > 10


def test_clear_collision_pairs_are_disabled() -> None:
    """Of pairs with two joints between, in 500 postures: where 5 mm of air are left beyond both radii, it is proven.

    Beyond the radii, as what is proven is proven of cylinders with round ends.
    """
    clear = 0
    for arm in short_arms(16, 54):
        geometry = Geometry(arm)
        settled, least = disabled_collision_pairs(arm), dict[tuple[int, int], float]()
        for q in postures(arm, 500):
            for pair, distance in geometry.distances(arm, q).items():
                least[pair] = min(distance, least.get(pair, np.inf))
        for (first, second), distance in least.items():
            if second - first == 2 and distance > arm.links[first].radius + arm.links[second].radius + 0.005:
                clear += 1
                assert settled[first, second] in ("Never", "Adjacent")  # the latter where all between is fixed
    assert clear > 2


def test_neighbouring_and_rigidly_joined_links_are_adjacent() -> None:
    """This applies across links without length and fixed joints; links that are not solid are left out."""
    turning, fixed = Joint("revolute", "y", -3.1, 3.1), Joint("fixed", "x")
    long, none = uniform_link((0.0, 0.0, 0.3), 1.0, 0.02), Link((0.0, 0.0, 0.0), 1.0, (0.0, 0.0, 0.0), 0.02)
    arm = Arm((0.0, 0.0, 0.0), (turning, turning, turning, fixed, fixed), (long, none, long, long, long))
    settled = disabled_collision_pairs(arm)
    assert settled.pop((0, 4)) == "Never"  # folded back, the last stands beyond the first
    assert settled == {(0, 2): "Adjacent", (2, 3): "Adjacent", (2, 4): "Adjacent", (3, 4): "Adjacent"}


def test_links_that_fold_onto_each_other_are_not_disabled() -> None:
    joints = tuple(Joint("revolute", "y", -3.1, 3.1) for _ in range(4))
    arm = Arm((0.0, 0.0, 0.0), joints, (uniform_link((0.0, 0.0, 0.2), 0.5, 0.03),) * 4)
    assert set(disabled_collision_pairs(arm).values()) == {"Adjacent"}
    assert len(disabled_collision_pairs(arm)) == 3


def test_coaxial_links_never_collide_beyond_a_neighbour() -> None:
    """With yaw joints only, over any range, the line stays a line."""
    joints = tuple(Joint("revolute", "z", -6.0, 6.0) for _ in range(4))
    settled = disabled_collision_pairs(Arm((0.0, 0.0, 0.0), joints, (uniform_link((0.0, 0.0, 0.2), 0.5, 0.03),) * 4))
    assert Counter(settled.values()) == {"Adjacent": 3, "Never": 3}


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.fast_cases(3)
def test_pinocchio_loads_pairs_and_home_posture(arm: Arm) -> None:
    geometry, text = Geometry(arm), to_srdf(arm)
    before = geometry.pairs()
    pinocchio.removeCollisionPairsFromXML(geometry.model, geometry.geometry, text)
    assert geometry.pairs() == before - set(disabled_collision_pairs(arm))
    if moving(arm):
        pinocchio.loadReferenceConfigurationsFromXML(geometry.model, text)
        home = geometry.model.referenceConfigurations["home"]
        assert home == pytest.approx([min(max(0.0, j.lower), j.upper) for _, j in moving(arm)])


def test_srdf_group_is_the_chain_from_base_to_tip() -> None:
    """Names follow the URDF, which has no other leaf; group_state names only moving joints."""
    srdf, urdf = ElementTree.fromstring(to_srdf(MIXED, "mixed")), ElementTree.fromstring(to_urdf(MIXED, "mixed"))
    assert srdf.get("name") == urdf.get("name")
    (chain,) = srdf.findall("group/chain")
    parents = {
        joint.find("child").attrib["link"]: joint.find("parent").attrib["link"] for joint in urdf.findall("joint")
    }
    link = chain.attrib["tip_link"]
    passed = 0
    while link != chain.attrib["base_link"]:
        link, passed = parents[link], passed + 1
    assert passed == len(MIXED.joints) + 1
    (state,) = srdf.findall("group_state")
    assert state.get("group") == srdf.find("group").get("name")
    assert [joint.get("name") for joint in state] == [f"joint_{number}" for number, _ in moving(MIXED)]


numbers = st.lists(st.floats(-1.0, 1.0).map(lambda value: round(value, 3)), min_size=12, max_size=12)


@given(numbers)
def test_segment_distance_agrees_with_bounded_least_squares(values: list[float]) -> None:
    """This includes parallel and crossing segments, and points."""
    a, b, c, d = np.array(values).reshape(4, 3)
    found = segment_distance(a[None], b[None], c[None], d[None])[0]
    solved = lsq_linear(np.array([b - a, c - d]).T, c - a, bounds=(0.0, 1.0), method="bvls")
    assert found == pytest.approx(np.sqrt(2.0 * solved.cost), abs=1e-7)


@pytest.mark.parametrize("name", ['<arm> & "friends"', "it's", "Ärmchen", "a]]>b"])
def test_names_are_escaped(name: str) -> None:
    assert ElementTree.fromstring(to_srdf(ARMS[0], name)).get("name") == name


def test_export_is_deterministic() -> None:
    assert to_srdf(MIXED) == to_srdf(MIXED)
