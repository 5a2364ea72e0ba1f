"""Validation and properties of Arm, Joint and Link."""

import math
from dataclasses import FrozenInstanceError, replace

import pytest

from armwright.exceptions import ArmError
from armwright.robot.arm import Arm, Joint, Link, uniform_link

TURN = Joint("revolute", "y", -1.0, 1.0)
LINK = uniform_link((0.0, 0.3, 0.4), 0.2, 0.015)


@pytest.mark.parametrize(
    ("kind", "axis", "lower", "upper", "words"),
    [
        ("revolute", "y", 1.0, -1.0, "expected lower < upper, got 1.0 and -1.0 rad"),
        ("prismatic", "z", 0.2, 0.1, "0.2 and 0.1 m"),
        ("revolute", "y", -math.inf, 1.0, r"finite: \[-inf, 1.0\] rad"),
        ("continuous", "y", -1.0, 1.0, '"continuous" is not one of revolute, prismatic, fixed'),
        ("revolute", "w", -1.0, 1.0, '"w" is not one of x, y, z'),
        ("revolute", (0.0, 0.6, 0.6), -1.0, 1.0, "nor a vector of length 1"),
    ],
)
def test_invalid_joints_are_refused(kind: str, axis: str, lower: float, upper: float, words: str) -> None:
    """An unknown kind is not taken for a fixed joint."""
    with pytest.raises(ArmError, match=words):
        Joint(kind, axis, lower, upper)


@pytest.mark.parametrize(
    ("offset", "mass", "com", "radius", "words"),
    [
        ((0.0, 0.0, 0.1), -0.1, (0.0, 0.0, 0.0), 0.01, "-0.1 kg and 0.01 m"),
        ((0.0, 0.0, 0.1), 0.1, (0.0, 0.0, 0.0), 0.0, "radius > 0 m"),
        ((0.0, 0.0, math.nan), 0.1, (0.0, 0.0, 0.0), 0.01, "finite"),
    ],
)
def test_invalid_links_are_refused(
    offset: tuple[float, ...], mass: float, com: tuple[float, ...], radius: float, words: str
) -> None:
    with pytest.raises(ArmError, match=words):
        Link(offset, mass, com, radius)


def test_invalid_arms_are_refused() -> None:
    for joints, links in (((), ()), ((TURN,), ()), ((TURN,), (LINK, LINK)), ((TURN, TURN), (LINK,))):
        with pytest.raises(ArmError, match=f"{len(joints)} joints, {len(links)} links"):
            Arm((0.0, 0.0, 0.0), joints, links)
    with pytest.raises(ArmError, match="base position must be finite"):
        Arm((0.0, math.nan, 0.0), (TURN,), (LINK,))


def test_reach_is_the_stretched_length_and_longest_stroke() -> None:
    """All links are in line, with the longest stroke in either direction."""
    slide = Joint("prismatic", "z", -0.3, 0.1)
    assert Arm((5.0, 5.0, 5.0), (TURN, Joint("fixed", "x"), slide), (LINK,) * 3).reach == pytest.approx(1.8)


def test_arms_are_hashable_values() -> None:
    """Arms are compared by content, hashable and immutable."""
    one, other = (Arm((0.0, 0.0, 0.0), (TURN,), (LINK,)) for _ in range(2))
    assert one == other
    assert len({one, other}) == 1
    for value, name in ((one, "base"), (TURN, "lower"), (LINK, "mass")):
        with pytest.raises(FrozenInstanceError):
            setattr(value, name, 1.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"bending_stiffness": 0.0}, "stiffness of a link: expected values above 0 N m²"),
        ({"wall": 0.02}, "at most its radius of 0.015 m, got 0.02 m"),
        ({"price": -1.0}, "price of a link: expected at least 0 USD"),
    ],
)
def test_link_refuses_impossible_tube(values: dict[str, float], message: str) -> None:
    with pytest.raises(ArmError, match=message):
        replace(uniform_link((0.0, 0.0, 0.2), 0.1, 0.015), **values)
