"""Messages about values of task and space files, as users get them wrong."""

import dataclasses
import re
import typing
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from armwright.exceptions import SpaceError, TaskError
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.targets import Target
from armwright.tasks.task import Task
from armwright.units import KEY_UNITS, read_quantity
from armwright.yaml_documents import parse_document

TARGETS = "name: t\ntargets: [[0.3, 0, 0.2]]\n"
PYDANTIC = re.compile(
    r"Input should|Field required|valid (tuple|number|integer|string|dict)|not permitted|value_error|should have"
)
# Keys of numbers without a unit
BARE = {
    "joints", "safety_factor", "payload_factors", "restarts", "weight", "axis", "points", "to", "gear_ratio",
    "reference_point", "resolution", "restrict", "grid", "range", "orientation", "count", "share", "at_voltages",
    "load_friction", "scale",
}  # fmt: skip


def task_fault(text: str) -> str:
    with pytest.raises(TaskError) as fault:
        parse_document(text, Task, TaskError, "task.yaml")
    return str(fault.value)


def space_fault(text: str) -> str:
    with pytest.raises(SpaceError) as fault:
        parse_document(text, DesignSpace, SpaceError, "space.yaml")
    return str(fault.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TARGETS + "axis: down", 'unknown key "axis". It is a key of targets and obstacles. Allowed:'),
        ("name: t\ntargets: [{position: [0.3, 0, 0.2], axis: down}]",
         'targets[0].axis: expected three numbers, got "down"; try [0, 0, -1]'),
        ("name: t\ntargets: [{position: [0.3, 0, 0.2], axsi: down}]", 'Did you mean "axis"?'),
        ("name: t\ntargets: [{position: [0.3, 0, 0.2], tolerance: 1 mm}]",
         'targets[0].tolerance: expected a number [m], got "1 mm"; try 0.001'),
        ('name: t\ntargets: ["0.3, 0, 0.2"]',
         'targets[0]: expected three numbers [m] or a record with the keys name, position, axis, orientation, '
         'tolerance, angle_tolerance, weight, on, into, got "0.3, 0, 0.2"; try [0.3, 0.0, 0.2]'),
        ("name: t\ntargets: [0.3, 0, 0.2]", "angle_tolerance, weight, on, into, got 0.3; try [[0.3, 0, 0.2]]"),
        ("name: t", "targets: expected a list, each entry three numbers [m] or a record with the keys name,"),
        (TARGETS + "payload: 200 g", 'a record with the keys mass, center, size, inertia, got "200 g"; try 0.2'),
        (TARGETS + "tool: {tip: [0, 0, 2000]}", "tip[2]: expected a number of at most 1000 m, got 2000"),
        (TARGETS + "objectives: price", 'objectives: expected a list of texts, got "price"; try ["price"]'),
        (TARGETS + "restarts: 1.6", "restarts: expected a whole number, got 1.6; try 2"),
        (TARGETS + "cycle: {steps: [{to: 1, by: lin}, {to: 1}]}",
         'cycle.steps[0].by: expected line or joint, got "lin"; try "line"'),
        ("name: my task\ntargets: [[0, 0, 0]]", 'got "my task"; try "my-task"'),
        ("targets: [[0, 0, 0]]", "name: expected text, but the key is missing"),
    ],
)  # fmt: skip
def test_mistakes_in_tasks_name_key_unit_and_way_out(text: str, message: str) -> None:
    assert message in task_fault(text)
    assert not PYDANTIC.search(task_fault(text))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("joints: [4]", "joints: expected a whole number or two whole numbers, got [4]; try 4"),
        ("joint_types: PY", 'expected one of R, P, Y, O, X, T, S, F, got "PY"; try [P, Y]'),
        ("joint_types: []", "joint_types: expected at least 1 entry, got 0"),
        ("link: 0.3", "link: expected two numbers [m], got 0.3; try [0.3, 0.3]"),
        ("link: [0.1, 40 cm]", 'link[1]: expected a number [m], got "40 cm"; try 0.4'),
        ("link_section: {tubes: [[30, 2]], material: aluminium}", "lengths are in metres: write 0.03 for 30 mm"),
        ("actuators: [{name: a, mass: -0.1, stall_torque: 2}]",
         "actuators[0].mass: expected a number of at least 0 kg, got -0.1"),
        ("actuators: [{name: a, mass: 82 g, stall_torque: 2}]",
         'actuators[0].mass: expected a number [kg], got "82 g"; try 0.082'),
        ("actuators: [{name: a, mass: 0.1, torque: 2}]",
         'actuators[0]: unknown key "torque". Did you mean "peak_torque"? Allowed: name, maker'),
        ("column: {diameter: 0.06}", 'column: unknown key "diameter". Did you mean "outer_diameter"?'),
        ("mass: {kind: per_meter, kg: 0.1}",
         'mass: kind: expected per_metre or per_link, got "per_meter". Did you mean "per_metre"?'),
        ("safety_factor: 0", "safety_factor: expected a number above 0, got 0"),
        ("parameters: {kp: {range: 3}}", "parameters: kp: range: expected two numbers, got 3"),
        ("travel: [a, b]", 'travel: expected a number [m/rad], got ["a", "b"]'),
    ],
)  # fmt: skip
def test_mistakes_in_spaces_name_key_unit_and_way_out(text: str, message: str) -> None:
    assert message in space_fault(text)
    assert not PYDANTIC.search(space_fault(text))


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-9, 9) | st.text("ab0.,- mgk", max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from("abxy"), inner, max_size=3),
    max_leaves=6,
)


@given(st.sampled_from(sorted({*Task.model_fields, *DesignSpace.model_fields} - {"custom"})), VALUES)
def test_messages_about_any_value_are_one_line_without_wording_of_the_library(key: str, value: Any) -> None:
    schema, error = (Task, TaskError) if key in Task.model_fields and key != "name" else (DesignSpace, SpaceError)
    content = {"name": "t", "targets": [[0.3, 0.0, 0.2]]} if schema is Task else {}
    message = ""
    try:
        parse_document(yaml.safe_dump({**content, key: value}), schema, error, "file.yaml")  # type: ignore[type-var]
    except (TaskError, SpaceError) as fault:
        message = str(fault)
    assert "\n" not in message
    assert not PYDANTIC.search(message), message


def numeric_keys(annotation: Any, key: str = "") -> set[str]:
    """Return the keys of a schema whose values hold real numbers."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        fields = {f.alias or name: f.annotation for name, f in annotation.model_fields.items()}
    elif isinstance(annotation, type) and dataclasses.is_dataclass(annotation):
        fields = typing.get_type_hints(annotation)
    else:
        inner = set[str]().union(*(numeric_keys(part, key) for part in typing.get_args(annotation)))
        return inner | ({key} if annotation in (float, int) else set())
    return set[str]().union(*(numeric_keys(part, name) for name, part in fields.items()))


def test_every_key_of_a_number_has_a_unit_or_none() -> None:
    keys = numeric_keys(Task) | numeric_keys(DesignSpace) | numeric_keys(Target)
    assert keys <= set(KEY_UNITS) | BARE


def test_quantities_are_read_in_their_unit() -> None:
    assert read_quantity("200 g", "kg") == pytest.approx(0.2)
    assert read_quantity("12", "V") == 12.0
    assert read_quantity("0,4", "m") == 0.4
    assert read_quantity("90°", "rad") == pytest.approx(1.5707963267948966)
    assert read_quantity("12 V", "m") is None
    assert read_quantity("much", "m") is None
