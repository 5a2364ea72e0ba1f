"""Fuzz URDF files, point files and the expressions of options."""

from pathlib import Path

import armwright as aw
from armwright.tasks.task import Task
from tests.fuzz.target import DefectError, any_of, file_of


def urdf_seeds() -> list[bytes]:
    from tests.support.robots import any_arm, with_frames_anyhow

    with_all = b"""<?xml version="1.0"?>
<robot name="r"><link name="base"><inertial><mass value="1.5"/><origin xyz="0 0 0.1" rpy="0 0 0"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial><visual><geometry>
<cylinder radius="0.1" length="1"/></geometry></visual></link><link name="a"/>
<link name="b"><inertial><mass value="0.5"/></inertial></link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><origin xyz="0 0 0.2" rpy="0 0 1.5708"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="0" upper="0.3"
effort="100" velocity="1"/></joint><joint name="f" type="fixed"><parent link="b"/><child link="tip"/>
<origin xyz="0 0 0.3"/></joint></robot>"""
    return [with_all, *(with_frames_anyhow(any_arm(seed), seed).encode() for seed in range(6))]


def run_urdf(data: bytes) -> None:
    from armwright.robot.urdf_reader import read_urdf
    from armwright.robot.urdf_writer import to_urdf

    read = read_urdf(file_of(data, "arm.urdf"))
    to_urdf(read.arm)
    if len(read.joints) <= 8:
        aw.compare_arms("target-1", [read], base=(0.0, 0.0, 0.0))


def run_points(data: bytes) -> None:
    from armwright.exceptions import TaskError
    from armwright.tasks.points_file import read_points
    from armwright.tasks.task_template import task_template
    from armwright.yaml_documents import parse_document

    found = read_points(file_of(data, "points.csv"), None, (0.0, 1.0, 0.0))
    if not all(map(str.isprintable, found.notes)):
        raise DefectError(f"notes that are no line: {found.notes!r}")
    parse_document(task_template(Path("x y.yaml"), found.targets), Task, TaskError, "x y.yaml")


POINTS = [
    b"x,y,z\n100,200,300\n# so\n\n1,2,3\n", b"1;2;3\r\n4;5;6\r\n", b"\tx\ty\tz\n0\t0.1\t2\t3\n",
    b"\xef\xbb\xbf1 2 3\n", b"# timestamp tx ty tz qx qy qz qw\n0.5 0.3 0.0 0.2 0 0 0 1\n",
    b"name;x [mm];y [mm];z [mm];roll [deg];pitch [deg];yaw [deg]\n\"left one\";100,5;0;0,5;180;0;90\n",
    b"ax,ay,az,x,y,z\n0,0,-1,1,2,3\n",
]  # fmt: skip


def run_words(data: bytes) -> None:
    """Read expressions of options and task files; none of them is evaluated as code."""
    from armwright.problem.conditions import read_condition
    from armwright.problem.constraints import read_constraints
    from armwright.study.front.search_budget import read_seconds

    text = data.decode("utf-8", "replace")
    reads = (read_condition, read_seconds, lambda words: read_constraints(words.split("\n")))
    any_of((lambda read=read: read(text)) for read in reads)


WORDS = [
    b"position_error<=0.05", b"torque>1e3", b"5s", b"2.5min", b"1e6", b"100_000",
    b"mass <= 3\nlength >= 0.2",
]  # fmt: skip
