"""Payloads that motors hold, against Pinocchio, closed forms and the evaluation with these payloads."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from armwright.kinematics.reach.payload_limits import held_payloads
from armwright.kinematics.reach.reach_postures import postures_over_reach
from armwright.problem.compliance_quantities import payload_capacity
from armwright.problem.evaluation import evaluate
from armwright.robot.arm import GRAVITY, Actuator, Arm, Joint, uniform_link
from armwright.tasks.moments import MAX_MASS
from tests.support.arms import moving_arms
from tests.support.exported_arms import carrying_peer

FACTOR = 1.5
TARGETS = [[0.3, 0.2, 0.1], [-0.2, 0.4, 0.3], [0.1, -0.3, -0.2]]


def driven(arm: Arm, peak: float) -> Arm:
    motor = Actuator("motor", 0.0, peak, tilting_limit=1e9)
    joints = tuple(replace(joint, actuator=motor) for joint in arm.joints)
    return replace(arm, joints=joints, safety_factor=FACTOR)


def test_motors_are_at_their_limit_with_the_largest_payload() -> None:
    """By Pinocchio's gravity torques of the arm with a massive body at its tip."""
    arms = [driven(arm, 60.0) for arm in moving_arms(12, 5, 3)]
    evaluation = evaluate(arms, TARGETS, payload=0.3)
    capacity = payload_capacity.each(evaluation)
    assert (capacity > 0.0).mean() > 0.3
    for i, arm in enumerate(arms):
        for t in range(len(TARGETS)):
            body = pinocchio.Inertia(float(capacity[i, t]), np.zeros(3), np.zeros((3, 3)))
            torques = carrying_peer(arm, body).gravity(evaluation.q[i, t])
            share = FACTOR * np.abs(torques).max() / 60.0
            assert share == pytest.approx(1.0, rel=1e-4) if capacity[i, t] > 0.0 else share > 1.0


def test_upright_axes_hold_any_payload() -> None:
    links = (uniform_link((0.2, 0.0, 0.0), 0.1, 0.01),) * 2
    arm = Arm((0.0, 0.0, 0.0), (Joint("revolute", "z", -2.0, 2.0),) * 2, links)
    assert payload_capacity(evaluate([driven(arm, 0.1)], [[0.3, 0.1, 0.0]])) == [MAX_MASS]


def planar_arm(peak: float) -> Arm:
    """A turret, a shoulder and an elbow with links of 0.1, 0.3 and 0.2 m, each of 0.2 kg."""
    joints = tuple(Joint("revolute", axis, -2.4, 2.4) for axis in ("z", "y", "y"))
    links = tuple(uniform_link((0.0, 0.0, length), 0.2, 0.01) for length in (0.1, 0.3, 0.2))
    return driven(Arm((0.4, -0.2, 0.3), joints, links), peak)


def test_payload_at_full_reach_has_the_closed_form() -> None:
    found = held_payloads(postures_over_reach(planar_arm(12.0), (1.0,)))
    assert found.reach == pytest.approx(0.5, rel=1e-3)
    own = 0.2 * GRAVITY * (0.15 + 0.4)
    # The tip may be 1 % of the reach off.
    assert found.payloads[0] == pytest.approx((12.0 / FACTOR - own) / (0.5 * GRAVITY), rel=5e-3)


def test_payload_at_full_reach_is_that_of_the_worst_posture() -> None:
    """A shoulder of two axes may hold the arm by one that stands upright, which carries nothing."""
    arm = planar_arm(12.0)
    shoulder = tuple(Joint("revolute", axis, -2.4, 2.4, arm.joints[0].actuator) for axis in ("y", "x"))
    universal = replace(arm, joints=(*shoulder, *arm.joints[1:]), links=(arm.links[0], uniform_link((0, 0, 0), 0, 0.01),
                                                                       *arm.links[1:]))  # fmt: skip
    (found,) = held_payloads(postures_over_reach(universal, (1.0,))).payloads
    own = 0.2 * GRAVITY * (0.05 + 0.25 + 0.5)
    assert found == pytest.approx((12.0 / FACTOR - own) / (0.6 * GRAVITY), rel=5e-2)
