"""Targets from files of points: columns by name, units, tool directions and decimal commas."""

import csv
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armwright.exceptions import TaskError
from armwright.rotations import rotation_from_rpy
from armwright.tasks.points_file import TargetList, parse_points, read_points
from armwright.tasks.targets import Point, Target
from armwright.tasks.task import MAX_TARGETS, Task
from armwright.tasks.task_template import task_template
from armwright.yaml_documents import parse_document

PANDAS = ",x,y,z\n0,0.3,0.0,0.2\n1,0.3,0.1,0.2\n2,0.25,-0.1,0.3\n"
SURVEY = "id;z;y;x\n1;0.2;0.0;0.3\n2;0.2;0.1;0.3\n"
TUM = "# timestamp tx ty tz qx qy qz qw\n0.00 0.30 0.00 0.20 0 0 0 1\n0.05 0.30 0.10 0.20 0 0 0 1\n"
ZYX = "z,y,x\n200,0,300\n200,100,300\n"

lengths = st.floats(-0.9, 0.9).map(lambda value: round(value, 6))  # [m]
points = st.tuples(lengths, lengths, lengths)


def parsed(text: str, unit: str | None = None) -> TargetList:
    return parse_points(text, unit, "points.csv")


def positions(found: TargetList) -> list[Point]:
    return [target.position if isinstance(target, Target) else target for target in found.targets]


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("0.1,0.2,0.3\n", None, [(0.1, 0.2, 1.3)]),
        ("x,y,z\n100,200,300\n\n# note\n-1e2, 0, 5\n", "mm", [(0.1, 0.2, 1.3), (-0.1, 0.0, 1.005)]),
        ("\ufeffx;y;z\n1;2;3\n", "m", [(1, 2, 4)]),
        ("1\t2\t3\r\n", "m", [(1, 2, 4)]),
        ("1 2  3\n", "m", [(1, 2, 4)]),
        ("1;2;3;;\n;;;;\n4;5;6;;\n", "m", [(1, 2, 4), (4, 5, 7)]),
    ],
)
def test_points_are_read_in_metres_with_the_offset(
    tmp_path: Path, text: str, unit: str | None, expected: list[tuple[float, ...]]
) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text, encoding="utf-8", newline="")
    found = read_points(file, unit, (0.0, 0.0, 1.0))
    assert np.array(found.targets) == pytest.approx(np.array(expected))
    assert found.notes == ()


@pytest.mark.parametrize(
    ("text", "expected", "unused"),
    [
        (PANDAS, [(0.3, 0.0, 0.2), (0.3, 0.1, 0.2), (0.25, -0.1, 0.3)], "(unnamed)"),
        (SURVEY, [(0.3, 0.0, 0.2), (0.3, 0.1, 0.2)], "'id'"),
        (TUM, [(0.3, 0.0, 0.2), (0.3, 0.1, 0.2)], "'timestamp'"),
        (ZYX, [(300, 0, 200), (300, 100, 200)], ""),
        ('"Time (s)";"X";"Y";"Z"\n7;1;2;3\n', [(1, 2, 3)], "'Time (s)'"),
        ("# made by hand\n#x y z\n1 2 3\n", [(1, 2, 3)], ""),
        ("# z y x\n1 2 3\n", [(3, 2, 1)], ""),
        ("# measured on Monday\n1 2 3\n", [(1, 2, 3)], ""),
        ("# it's \"odd, here\n1,2,3\n", [(1, 2, 3)], ""),
        ("\tx\ty\tz\n0\t1\t2\t3\n", [(1, 2, 3)], "(unnamed)"),
        ("x [mm]  y [mm]  z [mm]\n100 200 300\n", [(0.1, 0.2, 0.3)], ""),
        ("x(mm),y [m],Z [mm]\n100,2,300\n", [(0.1, 2, 0.3)], ""),
        ("label,x,y,z\n\x1b[2J,1,2,3\n", [(1, 2, 3)], "'label'"),
    ],
)
def test_columns_are_found_by_name(text: str, expected: list[Point], unused: str) -> None:
    found = parsed(text)
    assert positions(found) == expected
    assert found.notes == ((f"columns not used: {unused}",) if unused else ())


@given(st.permutations(["name", "id", "x", "y", "z", "ax", "ay", "az"]), st.lists(points, min_size=1), st.data())
def test_the_order_of_columns_does_not_matter(order: list[str], given_points: list[Point], data: st.DataObject) -> None:
    delimiter = data.draw(st.sampled_from(",;\t"))
    rows: list[dict[str, Any]] = [
        {"name": f"p {i}", "id": 7 * i, "x": x, "y": y, "z": z, "ax": 0, "ay": y, "az": -1}
        for i, (x, y, z) in enumerate(given_points)
    ]
    text = io.StringIO()
    writer = csv.DictWriter(text, order, delimiter=delimiter)
    writer.writeheader()
    writer.writerows(rows)
    found = parsed(text.getvalue())
    assert found.targets == tuple(
        Target(name=f"p {i}", position=(x, y, z), axis=(0, y, -1)) for i, (x, y, z) in enumerate(given_points)
    )
    assert found.notes == ("columns not used: 'id'",)


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
@example([0.0, 1.0, 0.0, 1.0])  # gimbal lock
@example([1.0, 1.0, 1.0, 1.0])
@example([1.0, 0.0, -1.0, 0.0])
def test_quaternions_become_the_same_rotation(quaternion: list[float]) -> None:
    unit = np.array(quaternion) / np.linalg.norm(quaternion)
    (target,) = parsed("x,y,z,qw,qx,qy,qz\n1,2,3," + ",".join(f"{unit[i]:.17g}" for i in (3, 0, 1, 2))).targets
    assert isinstance(target, Target)
    assert target.rotation == pytest.approx(Rotation.from_quat(unit).as_matrix(), abs=1e-7)


def test_angles_are_read_in_their_unit() -> None:
    (target,) = parsed("Roll [deg],PITCH [rad],yaw [°],x,y,z\n180,0.5,-90,1,2,3\n").targets
    assert isinstance(target, Target)
    assert target.orientation == pytest.approx((math.pi, 0.5, -math.pi / 2))
    assert target.rotation == pytest.approx(rotation_from_rpy(math.pi, 0.5, -math.pi / 2), abs=1e-8)


@given(st.lists(points, min_size=1), st.sampled_from(";\t"))
def test_decimal_commas_are_read_and_noted(given_points: list[Point], delimiter: str) -> None:
    rows = [delimiter.join(f"{value:.6f}" for value in point) for point in given_points]
    with_points = parsed("\n".join(rows))
    with_commas = parsed("\n".join(rows).replace(".", ","))
    assert with_commas.targets == with_points.targets == tuple(given_points)
    cell = rows[0].split(delimiter)[0]
    assert with_commas.notes == (f"numbers have decimal commas: {cell.replace('.', ',')} is read as {cell}",)
    assert with_points.notes == ()


REFUSED = {
    "": "has no points",
    "x,y,z\n": "has no points",
    "1,2\n3,4\n": "line 1: expected three numbers x, y, z, got '1', '2'",
    "1,2,3,4\n": "line 1: expected a header, as there are 4 columns",
    "0,1,0,2,0,3\n": "decimal commas need semicolons or tabs",
    "1,2,3\n4,five,6\n": "line 2: y: expected a finite number, got 'five'",
    "O.1,0.2,0.3\n0.1,0.2,0.3\n": "line 1: x: expected a finite number",
    "1,2,nan\n": "line 1: z: expected a finite number, got 'nan'",
    "nan,inf,nan\n": "line 1: x: expected a finite number, got 'nan'",
    "x,y,z\n1,,3\n": "line 2: y: expected a finite number, got ''",
    "x,y,z\n1,2\n": "line 2: z: expected a finite number, got ''",
    "x,y,z\n1,2,1e999\n": "line 2: z: expected a finite number",
    "x,y,z\n1,2,1_0\n": "line 2: z: expected a finite number",
    "x y z\n0 1 2 3\n": "line 2: expected 3 columns as in the first line, got 4",
    "a,b,c\nd,e,f\n": "line 1: expected columns x, y, z, got no x, y, z; rename columns (columns: 'a', 'b', 'c')",
    "lon,x,y\n1,2,3\n": "got no z",
    "# y x height\n1 2 3\n": "line 1: expected columns x, y, z, got no z",
    "x,y,z,X\n1,2,3,4\n": "expected one column x, got two",
    "x,y,z,tx\n1,2,3,4\n": "expected one column x, got two",
    "x,y,z,roll [deg],yaw [deg]\n1,2,3,4,5\n": "expected columns roll, pitch, yaw, got no pitch",
    "x,y,z,qx,qy,qz\n1,2,3,0,0,0\n": "got no qw",
    "x,y,z,ax\n1,2,3,0\n": "got no ay, az",
    "x,y,z,ax,ay,az,qx,qy,qz,qw\n1,2,3,0,0,1,0,0,0,1\n": "expected one kind of tool direction",
    "x,y,z,roll,pitch,yaw\n1,2,3,0,0,0\n": '"roll": expected roll [rad] or roll [deg]',
    "x,y,z,ax [m/s²],ay,az\n1,2,3,0,0,1\n": '"ax [m/s²]": expected no unit',
    "x,y,z,ax,ay,az\n1,2,3,0,0,0\n": "line 2: axis",
    "x,y,z,qx,qy,qz,qw\n1,2,3,0,1,0,1\n": "expected a quaternion of length 1",
    "x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,0\n": "expected a quaternion of length 1",
    "x,y,z,roll [deg],pitch [deg],yaw [deg]\n1,2,3,0,720,0\n": "line 2: orientation",
    "x [inch],y [inch],z [inch]\n1,2,3\n": '"x [inch]": expected x [m] or x [mm]',
    "x [mm],y [mm],z\n1,2,3\n": "expected a unit in each of 'x [mm]', 'y [mm]', 'z' or in none",
    "name,x,y,z\na,1,2,3\nb,1,2,3\na,1,2,4\n": 'line 4: the name "a" is also in line 2',
    "name,x,y,z\n1,1,2,3\n": "line 2: name: expected a letter",
    "x;y;z\n0,1;0.2;0\n": "line 2: '0,1' has a decimal comma, but '0.2' in line 2 a decimal point",
    "x;y;z\n1.000,5;2;3\n": "line 2: x: expected a finite number",
    'name,x,y,z\n"a,1,2,3\n': "line 2: expected cells separated by ','",
    "name,x,y,z\n" + "a" * 200_000 + ",1,2,3\n": "line 2: expected cells separated by ','",
    "1,2,3\n" * (MAX_TARGETS + 1): "expected at most 10,000 points, got 10,001",
}  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: repr(text[:40]))
def test_what_is_wrong_or_ambiguous_is_refused(text: str) -> None:
    with pytest.raises(TaskError) as refusal:
        parsed(text)
    assert str(refusal.value).startswith("points.csv")
    assert REFUSED[text] in str(refusal.value)


def test_a_unit_that_the_header_contradicts_is_refused(tmp_path: Path) -> None:
    text = "x [mm],y [mm],z [mm]\n100,200,300\n"
    assert parsed(text).targets == parsed(text, "mm").targets == ((0.1, 0.2, 0.3),)
    with pytest.raises(TaskError, match=r'"x \[mm\]" states mm, but the unit is set to m; use mm'):
        parsed(text, "m")
    assert parsed("x [mm],y,z\n100,200,300\n", "mm").targets == ((0.1, 0.2, 0.3),)
    with pytest.raises(TaskError, match='unit: expected m or mm, got "inch"'):
        parsed(text, "inch")
    (tmp_path / "points.csv").write_bytes(b"\xff\xfex")
    with pytest.raises(TaskError, match="UTF-8"):
        read_points(tmp_path / "points.csv")


targets = st.builds(
    Target,
    name=st.sampled_from(("on", "no", "a b", "x.1")),
    position=points,
    axis=st.tuples(st.floats(-1, 1), st.floats(-1e-9, 1e-9), st.floats(0.5, 1)),
)


@given(targets | points)
def test_template_holds_the_targets(target: Target | Point) -> None:
    text = task_template(Path("mine.yaml"), [target])
    task = parse_document(text, Task, TaskError, "mine.yaml")
    assert task.targets == (target,)
    assert len(yaml.safe_load(text)["targets"]) == 1
