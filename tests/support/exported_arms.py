"""Arms to export, and their URDF in Pinocchio as the oracle of the other formats.

That this is our arm is what test_urdf, test_mjcf and test_kinematics prove.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pinocchio

from armwright.robot.arm import Actuator, Arm, Joint, Link, MountedTool, uniform_link
from armwright.robot.urdf_writer import to_urdf
from tests.support import reference_kinematics as reference
from tests.support.arms import general_arms, paper_arms
from tests.support.reference_kinematics import Array

# Every kind of joint and link in one: no mass, no length, downward, limits that leave out 0, a motor at an end.
MIXED = Arm(
    (0.1, -0.2, 0.3),
    (
        Joint("fixed", "x"),
        Joint("prismatic", "z", 0.1, 0.4, Actuator("slider", 0.3, 1.5, 4.0), travel=0.02),
        Joint("revolute", "y", -1.0, 2.0, Actuator("servo", 0.15, 4.5)),
        Joint("fixed", "z"),
        Joint("revolute", "x", -0.5, 0.7),
    ),
    (
        Link((0.0, 0.0, 0.2), 0.0, (0.0, 0.0, 0.1), 0.02),
        replace(uniform_link((0.1, 0.0, 0.05), 0.4, 0.02), end_mass=0.15),
        Link((0.0, 0.0, 0.0), 0.3, (0.0, 0.01, 0.0), 0.02),
        uniform_link((0.0, 0.0, -0.1), 0.2, 0.02),
        Link((0.0, 0.12, 0.0), 0.0, (0.0, 0.0, 0.0), 0.01, end_mass=0.25),
    ),
    tool=MountedTool((0.01, -0.02, 0.03), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), 0.2, (0.01, 0.02, 0.03)),
    base_mass=0.3,
)

# Likewise without actuators: a joint and a link that are fixed, no mass, no length, downward
BARE = Arm(
    (0.1, -0.2, 0.3),
    (Joint("fixed", "x"), Joint("prismatic", "z", -0.1, 0.4), Joint("revolute", "y", -1.0, 2.0), Joint("fixed", "z")),
    (
        Link((0.0, 0.0, 0.2), 0.0, (0.0, 0.0, 0.1), 0.02),
        uniform_link((0.1, 0.0, 0.0), 0.4, 0.02),
        Link((0.0, 0.0, 0.0), 0.3, (0.0, 0.0, 0.0), 0.02),
        uniform_link((0.0, 0.0, -0.1), 0.2, 0.02),
    ),
)


def a_body(rng: np.random.Generator) -> dict[str, Any]:
    """Mass, centre and inertia of three bars at right angles, turned anyhow."""
    bars = rng.uniform(1e-4, 1e-2, 3)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    tensor = turn @ np.diag(bars.sum() - bars) @ turn.T
    tensor = (tensor + tensor.T) / 2.0
    return {
        "mass": float(rng.uniform(0.1, 2.0)),
        "com": tuple(rng.uniform(-0.1, 0.1, 3).tolist()),
        "inertia": tuple(tuple(row) for row in tensor.tolist()),
    }


def odd_arms(n: int, dof: int, seed: int) -> list[Arm]:
    """General arms; about half of their joints slide by what they would turn [m], half of their links end in a mass.

    Their tools point anywhere, and half of them have mass.
    """
    rng = np.random.default_rng([seed, dof])
    arms: list[Arm] = []
    for arm in general_arms(n, dof, seed):
        joints = (replace(j, kind="prismatic") if j.kind != "fixed" and rng.random() < 0.5 else j for j in arm.joints)
        links = (replace(link, end_mass=float(max(0.0, rng.uniform(-1.0, 1.0)))) for link in arm.links)
        axis, side = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2].tolist()
        tool = rng.uniform(-0.1, 0.1, 3).tolist()
        mounted = MountedTool(tuple(tool), tuple(axis), tuple(side))
        if rng.random() < 0.5:
            mounted = replace(mounted, **a_body(rng))
        arms.append(Arm(arm.base, tuple(joints), tuple(links), mounted))
    return arms


ARMS = [*paper_arms(2, 4, 41), *(arm for dof in (1, 3, 6, 8) for arm in odd_arms(2, dof, 42)), MIXED]


def moving(arm: Arm) -> list[tuple[int, Joint]]:
    """(number from 1, joint) of the joints that move."""
    return [(number, joint) for number, joint in enumerate(arm.joints, start=1) if joint.kind != "fixed"]


def postures(arm: Arm, n: int = 5) -> Array:
    """(n, D) random values of the joints that move, within their limits [rad] or [m]."""
    joints = [joint for _, joint in moving(arm)]
    lower, upper = ([getattr(joint, end) for joint in joints] for end in ("lower", "upper"))
    return np.random.default_rng(43).uniform(lower, upper, (n, len(joints)))


def full(arm: Arm, q: Array) -> Array:
    """(J,) with 0 for what is fixed."""
    every = np.zeros(len(arm.joints))
    every[[number - 1 for number, _ in moving(arm)]] = q
    return every


def load(arm: Arm) -> float:
    """The arm's weight at its reach [N m], the size of its torques."""
    return reference.GRAVITY * (sum(link.total_mass for link in arm.links) + arm.tool.mass) * max(1.0, arm.reach)


class Peer:
    """A URDF in Pinocchio."""

    def __init__(self, urdf: str) -> None:
        self.model: Any = pinocchio.buildModelFromXML(urdf)
        self.data: Any = self.model.createData()

    def tip(self, q: Array, prefix: str = "") -> Array:
        """(4, 4) pose of the tip in the world."""
        pinocchio.framesForwardKinematics(self.model, self.data, q)
        return np.array(self.data.oMf[self.model.getFrameId(f"{prefix}tip")].homogeneous)

    def jacobian(self, q: Array) -> Array:
        """(6, D) of the tip: its velocity and angular velocity in the world by joint speeds."""
        frame, axes = self.model.getFrameId("tip"), pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return np.array(pinocchio.computeFrameJacobian(self.model, self.data, q, frame, axes)).reshape(6, -1)

    def gravity(self, q: Array) -> Array:
        """(D,) [N m] or [N]."""
        return np.array(pinocchio.computeGeneralizedGravity(self.model, self.data, q))

    def mass_matrix(self, q: Array) -> Array:
        """(D, D); only the upper half of Pinocchio's is filled."""
        upper = np.triu(pinocchio.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T


@lru_cache(maxsize=256)
def peer_of(arm: Arm) -> Peer:
    return Peer(to_urdf(arm))


def carrying_peer(arm: Arm, body: pinocchio.Inertia) -> Peer:
    """Pinocchio's model of an arm with a body in its tip frame."""
    peer = Peer(to_urdf(arm))
    frame = peer.model.frames[peer.model.getFrameId("tip")]
    peer.model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    peer.data = peer.model.createData()
    return peer
