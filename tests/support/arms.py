"""Random arms for tests: of the paper's space, and irregular ones."""

import numpy as np

from armwright.robot.arm import AXES, Arm, Joint, Link
from armwright.spaces.design_space import paper_space

LIGHT = {"mass": {"kind": "per_metre", "kg": 0.0121}, "bracket_mass": 0.0}  # of a space: motors on the paper's links


def paper_arms(n: int, dof: int, seed: int) -> list[Arm]:
    """Arms of the paper's space: links along z, centre of mass half way, limits ±2.4 rad."""
    space = paper_space(dof)
    return [space.arm(design) for design in space.sample(n, seed)]


def general_arms(n: int, dof: int, seed: int) -> list[Arm]:
    """Arms with offsets in any direction, masses off the line, unequal limits, up to two fixed joints anywhere."""
    rng = np.random.default_rng([seed, dof])
    kinds = ["revolute"] * dof + ["fixed"] * int(rng.integers(0, 3))
    rng.shuffle(kinds)
    return [_general_arm(kinds, rng) for _ in range(n)]


def moving_arms(n: int, dof: int, seed: int) -> list[Arm]:
    """The same without fixed joints."""
    rng = np.random.default_rng([seed, dof])
    return [_general_arm(["revolute"] * dof, rng) for _ in range(n)]


def _general_arm(kinds: list[str], rng: np.random.Generator) -> Arm:
    joints = tuple(_general_joint(kind, rng) for kind in kinds)
    return Arm(base=_vector(rng, 1.0), joints=joints, links=tuple(_general_link(rng) for _ in kinds))


def _general_joint(kind: str, rng: np.random.Generator) -> Joint:
    axis = AXES[rng.integers(3)]
    if kind == "fixed":
        return Joint("fixed", axis)
    return Joint("revolute", axis, -float(rng.uniform(0.3, 3.1)), float(rng.uniform(0.3, 3.1)))


def _general_link(rng: np.random.Generator) -> Link:
    mass, radius = float(rng.uniform(0.001, 2.0)), float(rng.uniform(0.01, 0.05))
    return Link(offset=_vector(rng, 0.25), mass=mass, com=_vector(rng, 0.2), radius=radius)


def _vector(rng: np.random.Generator, size: float) -> tuple[float, float, float]:
    x, y, z = rng.uniform(-size, size, 3).tolist()
    return (x, y, z)
