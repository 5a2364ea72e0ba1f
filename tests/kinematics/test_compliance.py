"""Displacements of the tip against a frame program, closed forms and properties."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from armwright.kinematics.arms.arm_arrays import FIXED, ArmArrays, carrying, stack_arms
from armwright.kinematics.arms.forward import forward_kinematics
from armwright.kinematics.reach.compliance import (
    Stiffness,
    backlash_errors,
    backlash_over_reach,
    deflections_over_reach,
    own_loads,
    tip_displacements,
    unit_payload,
)
from armwright.kinematics.reach.reach_postures import postures_over_reach
from armwright.robot.arm import AXES, GRAVITY, Arm, Joint, Link, MountedTool, uniform_link
from armwright.tasks.payload import LoadShape
from tests.support.frame_program import frame_displacement

Array = NDArray[np.float64]
CENTER = (0.03, -0.02, 0.05)  # [m] of payloads, from the tip


def random_arm(seed: int) -> Arm:
    """An arm of 2 to 7 joints of all kinds with links in any direction, some of no length, end masses and a tool."""
    rng = np.random.default_rng(seed)
    kinds = rng.choice(["revolute", "prismatic", "fixed"], rng.integers(2, 8), p=[0.7, 0.2, 0.1])
    joints, links = [], []
    for kind in kinds:
        axis = AXES[rng.integers(3)]
        joints.append(Joint("fixed", axis) if kind == "fixed" else Joint(kind, axis, -0.3, 0.3))
        offset = rng.uniform(-0.3, 0.3, 3) * (rng.uniform() < 0.9)
        mass = float(rng.uniform(0.1, 2.0)) if offset.any() else 0.0
        shift = tuple(rng.uniform(-0.1, 0.1, 3).tolist())
        links.append(Link(tuple(offset.tolist()), mass, tuple((offset / 2).tolist()), 0.02, 0.5, shift))
    tool = MountedTool(tip=(0.02, 0.05, 0.1), mass=0.3, com=(0.01, 0.0, 0.04))
    return Arm((0.1, 0.2, 0.3), tuple(joints), tuple(links), tool)


def random_stiffness(arms: ArmArrays, seed: int) -> Stiffness:
    rng, shape = np.random.default_rng([seed, 1]), arms.motion.shape
    return Stiffness(rng.uniform(20.0, 200.0, shape), rng.uniform(10.0, 100.0, shape), rng.uniform(50.0, 500.0, shape))


def stacked(arm: Arm) -> ArmArrays:
    return carrying(stack_arms([arm], "float64"), LoadShape(CENTER))


def sag(arms: ArmArrays, q: Array, stiffness: Stiffness, payload: float = 0.0, own: bool = True) -> Array:
    """(N, K, 3) under the own weight and a payload; q: (N, K, D)."""
    frames = forward_kinematics(arms, q)
    held = payload * tip_displacements(arms, frames, unit_payload(arms, frames), stiffness)
    return held + tip_displacements(arms, frames, own_loads(arms, frames), stiffness) if own else held


@pytest.mark.parametrize("seed", range(12))
def test_displacement_agrees_with_a_frame_program(seed: int) -> None:
    arm = random_arm(seed)
    arms, rng = stacked(arm), np.random.default_rng([seed, 2])
    stiffness = random_stiffness(arms, seed)
    q = rng.uniform(-0.3, 0.3, (1, 3, arms.dof)) * (arms.motion < FIXED) * np.where(arms.prismatic, 1.0, 10.0)
    ours = sag(arms, q, stiffness, 0.7)[0]
    for posture, found in zip(q[0], ours, strict=True):
        theirs = frame_displacement(arm, posture, stiffness, 0.7, np.array(CENTER))
        assert np.linalg.norm(found - theirs) < 1e-3 * np.linalg.norm(theirs)


def test_backlash_error_bounds_every_combination_of_half_backlashes() -> None:
    arms, rng = stacked(random_arm(4)), np.random.default_rng(2)
    q = rng.uniform(-0.3, 0.3, (1, 1, arms.dof)) * (arms.motion < FIXED)
    backlash = rng.uniform(1e-4, 1e-3, arms.motion.shape)
    bound = backlash_errors(arms, forward_kinematics(arms, q), backlash)[0, 0]
    moved = q + np.array(list(itertools.product((-0.5, 0.5), repeat=arms.dof))) * backlash
    tips = forward_kinematics(arms, moved).tip[0]
    off = np.linalg.norm(tips - forward_kinematics(arms, q).tip[0], axis=-1).max()
    assert 0.2 * bound < off <= bound * (1.0 + 1e-3)


def test_errors_at_full_reach_are_those_of_a_cantilever() -> None:
    """A shoulder on an upright, rigid post, and one level link."""
    length, mass, payload, bending, stiffness, play = 0.5, 0.4, 1.5, 60.0, 900.0, 0.002
    joints = tuple(Joint("revolute", axis, -2.4, 2.4) for axis in ("z", "y"))
    links = (uniform_link((0.0, 0.0, 0.1), 0.2, 0.01), uniform_link((0.0, 0.0, length), mass, 0.01))
    postures = postures_over_reach(Arm((0.3, 0.1, 0.2), joints, links), (1.0,))
    rigid = np.array([[np.inf, bending]])
    (sag,) = deflections_over_reach(postures, Stiffness(rigid, rigid, np.full((1, 2), stiffness)), payload)
    force, weight = payload * GRAVITY, mass * GRAVITY / length
    moment = force * length + weight * length**2 / 2.0
    expected = (force * length**3 / 3.0 + weight * length**4 / 8.0) / bending + moment / stiffness * length
    assert sag == pytest.approx(expected, rel=1e-3)
    (error,) = backlash_over_reach(postures, np.full((1, 2), play))
    assert error == pytest.approx(2.0 * length * play / 2.0, rel=1e-3)  # both joints have the same lever
