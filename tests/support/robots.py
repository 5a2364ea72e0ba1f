"""URDF files of commercial robots from test packages, and random ones."""

from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from armwright.robot.arm import Arm, Joint, Link
from armwright.robot.urdf_writer import to_urdf
from armwright.rotations import rotation_about, rotation_from_rpy
from tests.support.arms import _general_joint, _general_link, _vector


def robot(name: str) -> Path:
    """The one file that ends so of example-robot-data, else of scikit-robot."""
    for package in ("example-robot-data", "scikit-robot"):
        found = [file for file in metadata.files(package) or () if str(file).endswith(f"/{name}.urdf")]
        if found:
            return Path(str(found[0].locate())).resolve()
    raise LookupError(name)


def any_arm(seed: int, kinds: tuple[str, ...] = ("revolute", "prismatic", "fixed")) -> Arm:
    """An arm of 2 to 8 joints of any of these kinds, the first one moving, with nothing regular about it."""
    rng = np.random.default_rng([seed, 77])
    chosen = ["revolute", *rng.choice(kinds, rng.integers(1, 8))]
    joints = tuple(
        Joint("prismatic", "xyz"[rng.integers(3)], *sorted(rng.uniform(-0.3, 0.3, 2).tolist()))  # type: ignore[arg-type]
        if kind == "prismatic"
        else _general_joint(kind, rng)
        for kind in chosen
    )
    links: tuple[Link, ...] = tuple(_general_link(rng) for _ in chosen)
    return Arm(_vector(rng, 1.0), joints, links)


def with_frames_anyhow(arm: Arm, seed: int, off: float = 0.0) -> str:
    """The URDF of an arm, its links' frames turned anyhow, and some axes with them, so that they point the other way.

    off: turning joints stand off their zero by up to so much [rad].
    """
    rng = np.random.default_rng([seed, 78])
    robot = ElementTree.fromstring(to_urdf(arm))
    turns = {"world": np.eye(3)}
    for joint in robot.iter("joint"):
        parent, child = (joint.find(end).get("link") for end in ("parent", "child"))  # type: ignore[union-attr]
        turns[child] = _any_turn(rng)  # type: ignore[index]
        origin = joint.find("origin")
        place = np.array([float(value) for value in origin.get("xyz").split()])  # type: ignore[union-attr]
        before = turns[parent]  # type: ignore[index]
        axis = joint.find("axis")
        zero = np.eye(3)
        if axis is not None:
            direction = np.array([float(value) for value in axis.get("xyz").split()])  # type: ignore[union-attr]
            if joint.get("type") == "revolute":
                zero = rotation_about(direction, float(rng.uniform(-off, off)))
            if rng.random() < 0.5:
                direction = -direction
                limit = joint.find("limit")
                low, high = (float(limit.get(end)) for end in ("lower", "upper"))  # type: ignore[union-attr, arg-type]
                limit.attrib.update(lower=repr(-high), upper=repr(-low))  # type: ignore[union-attr]
            axis.set("xyz", _words(turns[child].T @ direction))  # type: ignore[index]
        origin.attrib.update(  # type: ignore[union-attr]
            xyz=_words(before.T @ place),
            rpy=_words(Rotation.from_matrix(before.T @ zero @ turns[child]).as_euler("xyz")),  # type: ignore[index]
        )
    for link in robot.iter("link"):
        com = link.find("inertial/origin")
        if com is not None:
            place, angles = (np.array([float(value) for value in com.get(key).split()]) for key in ("xyz", "rpy"))  # type: ignore[union-attr]
            turn = turns[link.get("name")].T  # type: ignore[index]
            com.set("xyz", _words(turn @ place))
            com.set("rpy", _words(Rotation.from_matrix(turn @ rotation_from_rpy(*angles)).as_euler("xyz")))
    return ElementTree.tostring(robot, encoding="unicode")


def _any_turn(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    return q * np.sign(np.linalg.det(q))


def _words(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
