"""Rigid bodies of stacked arms: links with what they carry at their ends, and tools."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armwright.arrays import Array
from armwright.robot.link_inertia import point_inertia, tube_inertia


class PerArm:
    """Arrays over arms; a part of them is the same arrays of fewer arms."""

    def __getitem__(self, part: slice | NDArray[np.integer]) -> Self:
        values = vars(self).items()
        if isinstance(part, slice) and part.indices(n := len(next(iter(vars(self).values())))) == (0, n, 1):
            return self  # as often: making all arrays anew takes as long as a kernel
        return type(self)(**{name: None if value is None else value[part] for name, value in values})


@dataclass(frozen=True)
class Bodies(PerArm):
    """Rigid bodies of the links of N arms of up to D joints, in float64 whatever the precision of the arms.

    A link is a tube that carries a body at its end (`armwright.robot.arm.Link`).
    """

    mass: Array  # (N, D) of the tube [kg]
    com: Array  # (N, D, 3) of the tube, from its joint [m]
    offset: Array  # (N, D, 3) along the tube, from its joint to the next or to the end of the last link [m]
    section: Array  # (N, D) squares of outer and inner radius together [m²]
    end_mass: Array  # (N, D) of the body at its end [kg]
    end_mass_position: Array  # (N, D, 3) centre of that body, from the link's joint [m]
    end_inertia: Array  # (N, D, 3, 3) of that body about its centre, in the link's frame [kg m²]

    @property
    def total_mass(self) -> Array:
        """(N, D) mass of tube and carried body [kg]."""
        return self.mass + self.end_mass

    @property
    def total_com(self) -> Array:
        """(N, D, 3) centre of mass of tube and carried body, from the joint [m]."""
        total = self.total_mass[..., None]
        both = self.mass[..., None] * self.com + self.end_mass[..., None] * self.end_mass_position
        return both / np.where(total > 0.0, total, 1.0)

    @property
    def inertia(self) -> Array:
        """(N, D, 3, 3) about the total centre of mass, in the link's frame [kg m²]; equal to the exported files'."""
        tensor = tube_inertia(self.mass, self.offset, self.section) + self.end_inertia
        centre = self.total_com
        for mass, position in ((self.mass, self.com), (self.end_mass, self.end_mass_position)):
            tensor += point_inertia(mass, position - centre)
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
        inertia[own] += point_inertia(link_mass, link_com - com[own])
        inertia[own] += point_inertia(tools.mass, position - com[own]) + tools.inertia
    return RigidBodies(mass, com, inertia)


def joined(mass: Array, com: Array, added: Array, position: Array) -> tuple[Array, Array]:
    """Return mass (N,) [kg] and centre (N, 3) [m] of N bodies with masses added at some positions (N, 3) [m].

    A body to which nothing is added keeps its bits.
    """
    total = mass + added
    both = mass[:, None] * com + added[:, None] * position
    return total, np.where(added[:, None] > 0.0, both / np.where(total > 0.0, total, 1.0)[:, None], com)
