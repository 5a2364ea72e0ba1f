"""XML of the file formats: numbers as text, colours, and settings of MuJoCo."""

from collections.abc import Iterable
from xml.etree import ElementTree

COLOURS = {
    "link": "0.75 0.75 0.78 1",
    "joint_x": "0.84 0.37 0.00 1",
    "joint_y": "0.00 0.45 0.70 1",
    "joint_z": "0.00 0.62 0.45 1",
}

# MuJoCo refuses a moving body without mass and raises smaller values to these.
MIN_INERTIA = {"boundmass": "1e-12", "boundinertia": "1e-14"}  # [kg], [kg m²]
MUJOCO_COMPILER = {"fusestatic": "false", "discardvisual": "false", **MIN_INERTIA}


def number(value: float) -> str:
    """Format a number with ten digits."""
    return f"{value:.10g}"


def numbers(values: Iterable[float]) -> str:
    """Format numbers with ten digits each, separated by spaces."""
    return " ".join(number(value) for value in values)


def to_xml(root: ElementTree.Element) -> str:
    """Return the XML of the whole file, indented."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
