"""Implausible values of URDFs are notes; known arms have none."""

from pathlib import Path

import pytest

from armwright.robot.urdf_reader import read_urdf
from tests.support.robots import robot

WORDS = ("made up", "hardly has", "no body")


def odd(file: Path) -> list[str]:
    return [note for note in read_urdf(file).notes if any(word in note for word in WORDS)]


def arm(file: Path, mass: str = "1", inertia: str = "0.01 0.01 0.01", effort: str = "50", length: str = "0.3") -> Path:
    """Three joints; mass, inertia and effort are those of the last one."""
    parts = ['<link name="l0"/>']
    for n in (1, 2, 3):
        kg, moments, torque = (mass, inertia, effort) if n == 3 else ("1", "0.01 0.01 0.01", "1000")
        tensor = 'ixx="{}" iyy="{}" izz="{}"'.format(*moments.split())
        parts.append(
            f'<link name="l{n}"><inertial><mass value="{kg}"/><inertia {tensor}/></inertial></link>'
            f'<joint name="j{n}" type="revolute"><parent link="l{n - 1}"/><child link="l{n}"/><axis xyz="0 1 0"/>'
            f'<origin xyz="0 0 {length}"/><limit lower="-3" upper="3" effort="{torque}"/></joint>'
        )
    file.write_text(f'<robot name="r">{"".join(parts)}</robot>', encoding="utf-8")
    return file


@pytest.mark.parametrize(
    "name", ["so100", "so101", "ur3_robot", "ur10_robot", "xarm7", "z1", "kinova", "tiago_no_hand"]
)
def test_known_arms_are_plausible(name: str) -> None:
    assert odd(robot(name)) == []


@pytest.mark.parametrize(
    ("values", "note"),
    [
        ({}, None),
        ({"effort": "1000"}, "every joint states the same effort, 1000, which is probably made up"),
        ({"mass": "0.001", "inertia": "1e-7 1e-7 1e-7"}, "masses that a link hardly has: l3 0.001 kg"),
        ({"mass": "40"}, "masses that a link hardly has: l3 40 kg"),
        ({"mass": "40", "length": "0.8"}, None),
        ({"inertia": "1 1 1"}, "inertias that no body of that mass has: l3"),
        ({"inertia": "0.001 0.001 0.01"}, "inertias that no body of that mass has: l3"),
        ({"inertia": "0.01 0.01 -0.01"}, "inertias that no body of that mass has: l3"),
        ({"inertia": "0 0.01 0.01"}, None),  # of a thin rod
        ({"inertia": "0.005 0.005 0.01"}, None),  # of a thin disc
    ],
)
def test_implausible_values_are_noted(tmp_path: Path, values: dict[str, str], note: str | None) -> None:
    assert odd(arm(tmp_path / "arm.urdf", **values)) == ([] if note is None else [note])
