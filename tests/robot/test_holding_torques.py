"""Holding torques of commercial arms at named postures, with their published inertias, against Pinocchio."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from armwright.robot.urdf_reader import read_urdf
from tests.support.urdf_peers import seen_by_kernels

PAYLOAD = 2.0  # [kg]
UR_POSTURES = {  # [°]
    "stretched": (0, 0, 0, 0, 0, 0),
    "upright": (0, -90, 0, -90, 0, 0),
    "tool down": (0, -60, 90, -120, -90, 0),
    "low": (30, -20, 60, 20, 40, 10),
    "folded back": (-120, -150, -70, 80, -100, 45),
}


@dataclass(frozen=True)
class Row:
    """A joint in Denavit-Hartenberg parameters, and the link after it in the frame at its end."""

    a: float  # [m]
    d: float  # [m]
    alpha: float  # [°]
    mass: float  # [kg]
    com: tuple[float, float, float]  # [m]


# The maker's table: universal-robots.com, "DH parameters for calculations of kinematics and dynamics", UR5e.
UR5E = (
    Row(0.0, 0.1625, 90.0, 3.761, (0.0, -0.02561, 0.00193)),
    Row(-0.425, 0.0, 0.0, 8.058, (0.2125, 0.0, 0.11336)),
    Row(-0.3922, 0.0, 0.0, 2.846, (0.15, 0.0, 0.0265)),
    Row(0.0, 0.1333, 90.0, 1.37, (0.0, -0.0018, 0.01634)),
    Row(0.0, 0.0997, -90.0, 1.3, (0.0, 0.0018, 0.01634)),
    Row(0.0, 0.0996, 0.0, 0.365, (0.0, 0.0, -0.001159)),
)


@pytest.mark.parametrize("payload", [0.0, PAYLOAD])
def test_ur5e_is_held_as_its_published_table_says(tmp_path: Path, payload: float) -> None:
    """The table as a URDF is read as the same arm that Pinocchio builds from the table itself."""
    file = tmp_path / "ur5e.urdf"
    file.write_text(urdf_of(UR5E), encoding="utf-8")
    read = read_urdf(file)
    assert read.tip == "tool"
    angles = np.radians(list(UR_POSTURES.values()))
    theirs = gravity(model_of(UR5E, payload), angles, range(6))
    assert np.abs(theirs).max() > 50.0
    ours = seen_by_kernels(read.arm, np.stack([angles, 0.0 * angles, 0.0 * angles]), payload).gravity
    assert np.allclose(ours, theirs, atol=1e-9)


def gravity(model: pinocchio.Model, values: np.ndarray, places: Sequence[int]) -> np.ndarray:
    """Return Pinocchio's (T, J) [N m]; places: of the joints in its q, which must have one value each."""
    data, torques = model.createData(), []
    for row in values:
        q = pinocchio.neutral(model)
        q[list(places)] = row
        torques.append(pinocchio.computeGeneralizedGravity(model, data, q)[list(places)])
    return np.array(torques)


def point_mass(mass: float, at: Sequence[float] = (0.0, 0.0, 0.0)) -> pinocchio.Inertia:
    return pinocchio.Inertia(mass, np.array(at), np.zeros((3, 3)))


def model_of(rows: Sequence[Row], payload: float) -> pinocchio.Model:
    """Return the arm of a table with a payload at its end."""
    model, parent, end = pinocchio.Model(), 0, pinocchio.SE3.Identity()
    for i, row in enumerate(rows):
        parent = model.addJoint(parent, pinocchio.JointModelRZ(), end, f"joint_{i + 1}")
        turned = pinocchio.utils.rotate("x", np.radians(row.alpha))
        end = pinocchio.SE3(turned, np.array([row.a, 0.0, row.d]))
        model.appendBodyToJoint(parent, point_mass(row.mass, row.com), end)
    model.appendBodyToJoint(parent, point_mass(payload), end)
    return model


def urdf_of(rows: Sequence[Row]) -> str:
    """Return the URDF of a table: each link is fixed to the end of its joint."""
    parts, last = ['<link name="base"/>'], "base"
    for i, row in enumerate(rows, start=1):
        end = "tool" if i == len(rows) else f"end_{i}"
        x, y, z = row.com
        parts.append(
            f'<link name="shaft_{i}"/><joint name="joint_{i}" type="revolute"><parent link="{last}"/>'
            f'<child link="shaft_{i}"/><axis xyz="0 0 1"/><limit lower="-6.28" upper="6.28"/></joint>'
            f'<link name="{end}"><inertial><origin xyz="{x} {y} {z}"/><mass value="{row.mass}"/>'
            '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>'
            f'<joint name="end_joint_{i}" type="fixed"><parent link="shaft_{i}"/><child link="{end}"/>'
            f'<origin xyz="{row.a} 0 {row.d}" rpy="{float(np.radians(row.alpha))!r} 0 0"/></joint>'
        )
        last = end
    return f'<robot name="table">{"".join(parts)}</robot>'
