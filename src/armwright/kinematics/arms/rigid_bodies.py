"""Rigid bodies of stacked arms: links with what they carry at their ends, and tools."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array


class PerArm:
    """Arrays over arms; a part of them is the same arrays of fewer arms."""

    def __getitem__(self, part: slice | NDArray[np.integer]) -> Self:
        values = vars(self).items()
        return type(self)(**{name: None if value is None else value[part] for name, value in values})


@dataclass(frozen=True)
class Bodies(PerArm):
    """Rigid bodies of the links of N arms of up to D joints, in float64 whatever the precision of the arms.

    A link is a solid cylinder that carries a point mass at its end (`armwright.robot.arm.Link`).
    """

    mass: Array  # (N, D) of the cylinder [kg]
    com: Array  # (N, D, 3) of the cylinder, from its joint [m]
    offset: Array  # (N, D, 3) along the cylinder, from its joint to the next or to the end of the last link [m]
    radius: Array  # (N, D) [m]
    end_mass: Array  # (N, D) [kg]
    end_mass_position: Array  # (N, D, 3) of the point mass, from the link's joint [m]

    @property
    def total_mass(self) -> Array:
        """(N, D) mass of cylinder and point mass [kg]."""
        return self.mass + self.end_mass

    @property
    def total_com(self) -> Array:
        """(N, D, 3) centre of mass of cylinder and point mass, from the joint [m]."""
        total = self.total_mass[..., None]
        both = self.mass[..., None] * self.com + self.end_mass[..., None] * self.end_mass_position
        return both / np.where(total > 0.0, total, 1.0)

    @property
    def inertia(self) -> Array:
        """(N, D, 3, 3) about the total centre of mass, in the link's frame [kg m²]; equal to the exported files'."""
        square = (self.offset**2).sum(axis=-1)
        length = np.sqrt(square)[..., None]
        axis = np.where(length > 0.0, self.offset / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
        along = axis[..., :, None] * axis[..., None, :]
        across_axis = (self.mass * (3.0 * self.radius**2 + square) / 12.0)[..., None, None]
        around_axis = (self.mass * self.radius**2 / 2.0)[..., None, None]
        tensor = across_axis * (np.eye(3) - along) + around_axis * along
        centre = self.total_com
        for mass, position in ((self.mass, self.com), (self.end_mass, self.end_mass_position)):
            tensor += _point_inertia(mass, position - centre)
        return tensor


@dataclass(frozen=True)
class Tools(PerArm):
    """Tools of N arms, in the frames of their last links, in float64 (`armwright.robot.arm.MountedTool`)."""

    tip: Array  # (N, 3) from the end of the last link to the tip [m]
    axis: Array  # (N, 3) z axis of the tip frame
    side: Array  # (N, 3) x axis of the tip frame
    mass: Array  # (N,) [kg]
    com: Array  # (N, 3) centre of mass, from the end of the last link [m]
    inertia: Array  # (N, 3, 3) about the centre of mass [kg m²]


@dataclass(frozen=True)
class RigidBodies:
    """What moves with each joint of N arms of up to D joints: a link with its actuators; the last one with the tool."""

    mass: Array  # (N, D) [kg]
    com: Array  # (N, D, 3) centre of mass, from the joint [m]
    inertia: Array  # (N, D, 3, 3) about the centre of mass, in the link's frame [kg m²]


def rigid_bodies(bodies: Bodies, tools: Tools, last: NDArray[np.integer]) -> RigidBodies:
    """Return the bodies that move with each joint of N arms of up to D joints; last: (N,) index of the last link."""
    mass, com, inertia = bodies.total_mass, bodies.total_com, bodies.inertia
    if tools.mass.any():
        own = np.arange(len(mass)), last
        position = bodies.offset[own] + tools.com
        link_mass, link_com = mass[own].copy(), com[own].copy()
        mass[own], com[own] = joined(link_mass, link_com, tools.mass, position)
        inertia[own] += _point_inertia(link_mass, link_com - com[own])
        inertia[own] += _point_inertia(tools.mass, position - com[own]) + tools.inertia
    return RigidBodies(mass, com, inertia)


def joined(mass: Array, com: Array, added: Array, position: Array) -> tuple[Array, Array]:
    """Return mass (N,) [kg] and centre (N, 3) [m] of N bodies with masses added at some positions (N, 3) [m].

    A body to which nothing is added keeps its bits.
    """
    total = mass + added
    both = mass[:, None] * com + added[:, None] * position
    return total, np.where(added[:, None] > 0.0, both / np.where(total > 0.0, total, 1.0)[:, None], com)


def _point_inertia(mass: Array, lever: Array) -> Array:
    """Return the inertia (..., 3, 3) of point masses (...) [kg] about points at (..., 3) from them [kg m²]."""
    squared = (lever**2).sum(axis=-1)[..., None, None] * np.eye(3)
    return mass[..., None, None] * (squared - lever[..., :, None] * lever[..., None, :])
