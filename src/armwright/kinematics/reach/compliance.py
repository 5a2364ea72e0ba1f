"""Static displacement of the tip: links that bend and twist, joints that yield, backlash.

Displacements are small and the arm is statically determinate, so those of all parts add up (Castigliano's second
theorem; Timoshenko, Strength of Materials I, chapters 5 and 11). A link is a straight Euler-Bernoulli beam of constant
round section from its joint to the next, clamped at its joint. With its direction e, its length L, the force F and the
moment M on its end, its weight w per length, and the stiffness EI and GJ, its end rotates and moves relative to its
joint by

    φ = (M_b L + e × F L²/2 + e × w L³/6) / EI + M_t L / GJ
    u = (M_b L²/2 + e × F L³/3 + e × w L⁴/8) / EI × e

where M_t is the part of M along e, and M_b the rest. The tip moves by u + φ × r, with r from the end of the link to the
tip. A revolute joint of stiffness k rotates by its moment over k, a slide moves by its force over k.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armwright.arrays import Array
from armwright.kinematics.arms.arm_arrays import ArmArrays
from armwright.kinematics.arms.forward import Frames, forward_kinematics, jacobian_of
from armwright.kinematics.reach.reach_postures import ReachPostures
from armwright.robot.arm import GRAVITY

DOWN = np.array([0.0, 0.0, -GRAVITY])  # [m/s²]


@dataclass(frozen=True)
class Loads:
    """Masses that N arms in K postures hold; moments of mass are about the origin of the world."""

    link_mass: Array  # (N, 1, D) of the links themselves, uniform along their length [kg]
    link_moment: Array  # (N, K, D, 3) their mass times their centre [kg m]
    mass: Array  # (N, K, D) of everything at and after the end of each link [kg]
    moment: Array  # (N, K, D, 3) its mass times its centre [kg m]


@dataclass(frozen=True)
class Stiffness:
    """Stiffness of the parts of N arms of up to D joints; infinite for rigid ones."""

    bending: Array  # (N, D) E I of the link after each joint [N m²]
    torsional: Array  # (N, D) G J of that link [N m²]
    joints: Array  # (N, D) of each joint [N m/rad], or slide [N/m]


def own_loads(arms: ArmArrays, frames: Frames) -> Loads:
    """Return the masses of links, actuators, rails and tools."""
    bodies, tool = arms.bodies, arms.tool
    n, k, dof = frames.position.shape[:3]
    link_mass, end_mass = bodies.mass[:, None], bodies.end_mass[:, None]  # (N, 1, D)
    of_link = link_mass[..., None] * _in_world(frames, bodies.com)
    of_end = end_mass[..., None] * _in_world(frames, bodies.end_mass_position)
    tool_com = frames.from_tip(tool.com - tool.tip)
    after = np.zeros((n, k, dof + 1)), np.zeros((n, k, dof + 1, 3))
    after[0][:, :, 1:-1], after[1][:, :, 1:-1] = (link_mass + end_mass)[:, :, 1:], (of_link + of_end)[:, :, 1:]
    after[0][:, :, -1], after[1][:, :, -1] = tool.mass[:, None], tool.mass[:, None, None] * tool_com
    mass = _sums_from_end(after[0])[:, :, 1:] + end_mass
    return Loads(link_mass, of_link, mass, _sums_from_end(after[1])[:, :, 1:] + of_end)


def unit_payload(arms: ArmArrays, frames: Frames) -> Loads:
    """Return the mass of a payload of 1 kg, alone."""
    center = frames.from_tip(arms.payload_center)
    shape = frames.position.shape
    nothing = np.zeros((len(arms), 1, shape[2]))
    return Loads(nothing, np.zeros(shape), np.ones(shape[:3]), np.broadcast_to(center[:, :, None], shape))


def joint_loads(frames: Frames, loads: Loads) -> tuple[Array, Array]:
    """Return the (N, K, D, 3) forces [N] of the weight of loads on the joints, and its moments about them [N m]."""
    mass, moment = loads.mass + loads.link_mass, loads.moment + loads.link_moment
    return mass[..., None] * DOWN, _moments(mass, moment, frames.position)


def tip_displacements(arms: ArmArrays, frames: Frames, loads: Loads, stiffness: Stiffness) -> Array:
    """Return the (N, K, 3) displacements of the tips of N arms in K postures under the weight of loads [m]."""
    return _of_links(arms, frames, loads, stiffness) + _of_joints(arms, frames, loads, stiffness.joints)


def backlash_errors(arms: ArmArrays, frames: Frames, backlash: Array) -> Array:
    """Return the (N, K) sums over the joints of how far half their backlash moves the tip: an upper bound [m].

    backlash: (N, D) of joints [rad], or of slides [m]; 0 for fixed joints.
    """
    return tip_errors(arms, frames, (backlash / 2.0)[:, None])


def tip_errors(arms: ArmArrays, frames: Frames, errors: Array) -> Array:
    """Return the (N, K) sums over the joints of how far their errors move the tip: an upper bound [m].

    errors: (N, K, D) of joints [rad], or of slides [m].
    """
    lever = np.linalg.norm(jacobian_of(arms, frames), axis=2)  # (N, K, D)
    # A running sum has the same bits whatever the number of joints of other arms.
    return np.cumsum(lever * errors, axis=-1)[..., -1]


def deflections_over_reach(postures: ReachPostures, stiffness: Stiffness, payload: float) -> Array:
    """Return (F,) how far weight and a payload [kg] move the tip at fractions of the reach [m]; NaN without postures.

    The largest value of all postures found counts.
    """

    def moved(arms: ArmArrays, frames: Frames) -> Array:
        by_payload = payload * tip_displacements(arms, frames, unit_payload(arms, frames), stiffness)
        own = tip_displacements(arms, frames, own_loads(arms, frames), stiffness)
        return np.linalg.norm(own + by_payload, axis=-1)

    return _largest_over_reach(postures, moved)


def backlash_over_reach(postures: ReachPostures, backlash: Array) -> Array:
    """Return (F,) how far half of the backlash (1, D) moves the tip at most [m]; NaN without postures."""
    return _largest_over_reach(postures, lambda arms, frames: backlash_errors(arms, frames, backlash))


def _largest_over_reach(postures: ReachPostures, measure: Callable[[ArmArrays, Frames], Array]) -> Array:
    """Return (F,) the largest measure (1, K) of the postures at each fraction of the reach; NaN without any."""
    largest = np.full(len(postures.targets), np.nan)
    for found, is_there in postures.found():
        values = measure(postures.arms, forward_kinematics(postures.arms, found.q.astype(np.float64)))[0]
        largest = np.fmax(largest, np.where(is_there, values, np.nan))
    return np.fmax.reduce(postures.by_fraction(largest), axis=1)


def _of_links(arms: ArmArrays, frames: Frames, loads: Loads, stiffness: Stiffness) -> Array:
    """Return the (N, K, 3) displacements of the tips by bending and twist of the links [m]."""
    length = np.linalg.norm(arms.bodies.offset, axis=-1)[:, None, :, None]  # (N, 1, D, 1)
    span = np.where(length > 0.0, length, 1.0)
    bending, torsional = (values[:, None, :, None] for values in (stiffness.bending, stiffness.torsional))
    ends = _in_world(frames, arms.bodies.offset)
    direction = (ends - frames.position) / span
    moment = _moments(loads.mass, loads.moment, ends)
    twisting = (moment * direction).sum(axis=-1, keepdims=True) * direction
    bent = moment - twisting
    by_force = np.cross(direction, loads.mass[..., None] * DOWN)
    by_weight = np.cross(direction, loads.link_mass[..., None] / span * DOWN)
    rotation = (bent * length + by_force * (length**2 / 2.0) + by_weight * (length**3 / 6.0)) / bending
    rotation += twisting * length / torsional
    curve = (bent * (length**2 / 2.0) + by_force * (length**3 / 3.0) + by_weight * (length**4 / 8.0)) / bending
    moved = np.cross(curve, direction) + np.cross(rotation, frames.tip[:, :, None] - ends)
    return np.cumsum(moved, axis=2)[:, :, -1]


def _of_joints(arms: ArmArrays, frames: Frames, loads: Loads, stiffness: Array) -> Array:
    """Return the (N, K, 3) displacements of the tips by the motion of the joints [m]; stiffness: (N, D)."""
    force, moment = joint_loads(frames, loads)
    acting = np.where(arms.prismatic[:, None, :, None], force, moment)
    motion = arms.by_independent((acting * frames.axis).sum(axis=-1)) / stiffness[:, None]  # (N, K, D)
    return np.cumsum(jacobian_of(arms, frames) * motion[:, :, None], axis=-1)[..., -1]


def _moments(mass: Array, moment: Array, points: Array) -> Array:
    """Return the (N, K, D, 3) moments of weight about points [N m], from masses and their moments of mass."""
    return np.cross(moment - mass[..., None] * points, DOWN)


def _in_world(frames: Frames, local: Array) -> Array:
    """Return the (N, K, D, 3) world positions of points (N, D, 3) in the frames of the links."""
    return frames.position + (frames.rotation @ local[:, None, ..., None])[..., 0]


def _sums_from_end(values: Array) -> Array:
    """Return the sums of (N, K, D, ...) values from each index to the last."""
    return np.cumsum(values[:, :, ::-1], axis=2)[:, :, ::-1]
