"""Cycles of tasks: their syntax, their errors, and the motions that they stand for."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from armwright.exceptions import TaskError
from armwright.rotations import rotation_from_rpy
from armwright.tasks.motions import Block, CyclePlan, Motion
from armwright.tasks.poses import along_line
from armwright.tasks.targets import AXIS, ORIENTATION, REACHED
from armwright.tasks.task import Task
from armwright.tasks.tip_rules import APART
from armwright.yaml_documents import check_document, dump_document, parse_document

DOWN = [0, 0, -1]
POINTS = [[0.3, 0.0, 0.1], [0.3, 0.2, 0.1], [0.1, 0.3, 0.3]]
NAMED = [
    {"name": "bin", "position": POINTS[0], "axis": DOWN},
    {"name": "tray", "position": POINTS[1], "axis": DOWN},
    {"position": POINTS[2], "axis": [1, 0, 0]},
]


def task(cycle: Any, targets: Sequence[Any] = NAMED, **more: Any) -> Task:
    return check_document({"name": "cell", "targets": list(targets), "cycle": cycle, **more}, Task, TaskError, "cell")


def plan(cycle: Any, targets: Sequence[Any] = NAMED, **more: Any) -> CyclePlan:
    read = task(cycle, targets, **more)
    return read.plan(read.target_positions)


def steps(*entries: Any, **more: Any) -> dict[str, Any]:
    """A cycle through these targets, or steps."""
    return {**more, "steps": [entry if isinstance(entry, dict) else {"to": entry} for entry in entries]}


@pytest.mark.parametrize("target", [NAMED[0], {"name": "gate", "position": POINTS[0]}])
def test_cycle_round_trips_through_values_and_yaml(target: Any) -> None:
    last = {"to": 3, "by": "line"}
    entries = ({"to": target["name"], "do": "pick"}, {"to": 2, "do": "place", "time": 1.5}, last)
    more = {"dwell": 0.3, "time": 2.0, "tolerance": {"path": 0.001}}
    read = task(steps(*entries, **more), [target, *NAMED[1:]])
    assert Task.model_validate(read.model_dump()) == read
    assert Task.model_validate_json(read.model_dump_json()) == read
    again = parse_document(dump_document(read.model_dump(mode="json")), Task, TaskError, "again.yaml")
    assert again == read
    assert again.plan(again.target_positions).motions == read.plan(read.target_positions).motions
    assert again.target_names == read.target_names


@pytest.mark.parametrize(
    ("actions", "closed", "carried"),
    [
        (("pick", "place", None), True, (False, True, False)),
        (("place", None, "pick"), True, (True, False, False)),
        (("pick", None, "place"), False, (False, True, True)),
        ((None, "pick", None), False, (False, False, True)),
        ((None, None, None), True, (True, True, True)),
        ((None, None, None), False, (True, True, True)),
    ],
)
def test_payload_is_carried_between_pick_and_place(actions: Any, closed: bool, carried: Any) -> None:
    cycle = task(steps(*({"to": n, "do": do} for n, do in enumerate(actions, start=1)), closed=closed)).cycle
    assert cycle is not None
    assert cycle.carried() == carried


PICK, PLACE = {"to": 1, "do": "pick"}, {"to": 2, "do": "place"}


@pytest.mark.parametrize(
    ("cycle", "message"),
    [
        (steps(1, PLACE, closed=False), "cycle: step 2: place without a pick before it"),
        (steps({"to": 1, "do": "place"}, 2), "cycle: step 1: place without a pick before it"),
        (steps(PICK, PLACE, {"to": 3, "do": "place"}), "cycle: step 3: place without a pick before it"),
        (steps(PICK, {"to": 2, "do": "pick"}, closed=False), "cycle: step 2: pick without a place before it"),
        (steps("bin", "tary"), 'step 2: unknown target "tary". Did you mean "tray"? Names: bin, tray'),
        (steps(1, 4), "step 2: there is no target 4; targets are counted from 1 to 3"),
        (steps(1, 2, 2), "step 3: the tool is already there; leave the step out"),
        (steps(1, 2, 1), "step 1: the tool is already there; leave the step out"),
        (steps(1), "cycle.steps: expected at least 2 entries, got 1"),
        ("in-order", "cycle: expected in_order or a record with steps"),
        (steps({"to": 1, "dwell": 1}, 2), 'cycle.steps[0]: unknown key "dwell". It is a key of cycle. Allowed: to,'),
        (steps(1, {"to": 2.0}), "cycle.steps[1].to: expected text or a whole number, got 2.0; try 2"),
    ],
)
def test_mistaken_cycles_get_one_clear_line(cycle: Any, message: str) -> None:
    with pytest.raises(TaskError) as error:
        task(cycle)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


TWO = steps(1, {"to": 2, "by": "line"}, closed=False)


def at(number: int, **direction: Any) -> dict[str, Any]:
    return {"position": POINTS[number], **direction}


POST = {"kind": "box", "name": "post", "center": [0.3, 0.1, 0.1], "size": [0.05, 0.05, 0.4]}
CARRY = steps({"to": 1, "do": "pick"}, {"to": 2, "do": "place"}, approach=0.05)


@pytest.mark.parametrize(
    ("targets", "cycle", "more", "message"),
    [
        ([at(0, axis=DOWN), at(1, axis=[0, 0, 1])], TWO, {}, "step 2: the tool points the opposite way at the end of"),
        ([at(0, orientation=[0, 0, 0]), at(1, orientation=[np.pi, 0, 0])], TWO, {}, "step 2: the tool points the"),
        ([at(0, axis=DOWN), POINTS[1]], TWO, {}, "step 2: a line needs the same kind of direction at both ends"),
        ([at(0, axis=DOWN), at(1, orientation=[0, 0, 0])], TWO, {}, "step 2: a line needs the same kind of direction"),
        (POINTS, TWO, {"obstacles": [POST]}, 'step 2: the line goes through obstacle "post" at [0.3, 0.076, 0.1] m;'),
        ([at(0, name="bin"), at(1, name="bin")], TWO, {}, 'targets: two are named "bin"; give each its own name'),
        (POINTS[:2], TWO, {"payload": [0.1, 0.2]}, "payload: expected one value for the whole cycle"),
        (POINTS, steps("bin", 2), {}, 'step 1: unknown target "bin". The targets have no names; use their numbers'),
        (POINTS, CARRY, {}, "step 1: approach needs a target with an axis or an orientation"),
    ],
)
def test_cycles_that_no_arm_can_follow_are_refused(targets: Any, cycle: Any, more: Any, message: str) -> None:
    with pytest.raises(TaskError) as error:
        task(cycle, targets, **more)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_joint_motions_may_turn_the_tool_around_and_pass_over_obstacles() -> None:
    targets = [{"position": POINTS[0], "axis": DOWN}, {"position": POINTS[1], "axis": [0, 0, 1]}, POINTS[2]]
    post = {"kind": "box", "center": [0.3, 0.1, 0.1], "size": [0.05, 0.05, 0.4]}
    assert [motion.by for motion in plan(steps(1, 2, 3), targets, obstacles=[post]).motions] == ["joint"] * 3


def test_a_direction_may_be_added_at_the_same_place() -> None:
    targets = [POINTS[0], {"position": POINTS[0], "axis": DOWN}]
    assert len(plan(steps(1, 2, closed=False), targets).motions) == 1
    with pytest.raises(TaskError, match="step 1: the tool is already there"):
        plan(steps(1, 2), targets)


def test_motions_of_a_cycle_with_approach() -> None:
    """By hand: out of the bin, over to the tray, in; out of the tray, back over the bin, in."""
    found = plan(steps({"to": "bin", "do": "pick"}, {"to": "tray", "do": "place"}, approach=0.08))
    bin_, tray, over_bin, over_tray = 0, 1, 3, 4
    assert found.motions == (
        Motion(1, "line", bin_, over_bin, carries=True, arrives=False),
        Motion(1, "joint", over_bin, over_tray, carries=True, arrives=False),
        Motion(1, "line", over_tray, tray, carries=True, arrives=True),
        Motion(0, "line", tray, over_tray, carries=False, arrives=False),
        Motion(0, "joint", over_tray, over_bin, carries=False, arrives=False),
        Motion(0, "line", over_bin, bin_, carries=False, arrives=True),
    )
    assert found.blocks == (Block(over_tray, (2, 3)), Block(over_bin, (5, 0)))
    assert found.joint_motions == (4, 1)
    above = np.array([POINTS[0], POINTS[1]]) + np.array([0.0, 0.0, 0.08])
    assert found.poses.position[[over_bin, over_tray]] == pytest.approx(above)
    samples = found.sample()
    assert (samples.first.tolist(), samples.end.tolist()) == ([0, 5, 10], [0, 5])  # the ways out are the ways in
    into_tray, into_bin = [0, 1, 2, 3, 4], [5, 6, 7, 8, 9]
    assert [each.tolist() for each in samples.of_motion] == [
        into_bin[::-1], [], into_tray, into_tray[::-1], [], into_bin
    ]  # fmt: skip
    assert samples.before.tolist() == [0, 0, 1, 2, 3, 5, 5, 6, 7, 8]
    assert samples.passes.tolist() == [0, 2, 2, 2, 2] * 2
    # The tool goes in within the tolerance of the path, and has to be within the target's own at its end.
    assert samples.poses.tolerance[:5].tolist() == [0.002, 0.002, 0.002, 0.002, 0.001]


@pytest.mark.parametrize("cycle", [steps(1, 2, 3), steps(1, {"to": 2, "by": "line"}, 3), "in_order"])
def test_blocks_hold_each_line_once_and_start_where_joint_motions_end(cycle: Any) -> None:
    found = plan(cycle, POINTS)
    lines = [index for block in found.blocks for index in block.lines]
    assert sorted([*lines, *found.joint_motions]) == list(range(len(found.motions)))
    for block, joint in zip(found.blocks, found.joint_motions, strict=False):
        end = found.motions[block.lines[-1]].end if block.lines else block.entry
        assert found.motions[joint].start == end
    for number, joint in enumerate(found.joint_motions, start=1):
        assert found.motions[joint].end == found.blocks[number % len(found.blocks)].entry


def rotations(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (n, 3))


def test_orientation_along_a_line_equals_slerp_of_scipy() -> None:
    share = np.linspace(0.0, 1.0, 21)
    for first, last in rotations(40, 1).reshape(20, 2, 3):
        targets = [
            {"position": p, "orientation": rpy.tolist()} for p, rpy in zip(POINTS[:2], (first, last), strict=True)
        ]
        found = plan("in_order", targets)
        poses = along_line(found.poses, 0, 1, share)
        ends = Rotation.from_matrix([rotation_from_rpy(*first), rotation_from_rpy(*last)])
        assert poses.rotation == pytest.approx(Slerp([0.0, 1.0], ends)(share).as_matrix(), abs=1e-9)
        assert poses.position == pytest.approx(np.array(POINTS[0]) + share[:, None] * [0.0, 0.2, 0.0], abs=1e-12)
        assert (poses.n_angular == ORIENTATION).all()


def test_axis_along_a_line_takes_the_shortest_arc() -> None:
    share = np.linspace(0.0, 1.0, 21)
    axes = np.random.default_rng(2).normal(size=(40, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    for a, b in axes.reshape(20, 2, 3):
        found = plan("in_order", [{"position": p, "axis": x.tolist()} for p, x in zip(POINTS, (a, b), strict=False)])
        poses = along_line(found.poses, 0, 1, share)
        angle = np.arccos(a @ b)
        expected = (np.sin((1.0 - share) * angle)[:, None] * a + np.sin(share * angle)[:, None] * b) / np.sin(angle)
        assert poses.rotation[:, :, 2] == pytest.approx(expected, abs=1e-9)
        assert poses.rotation.swapaxes(1, 2) @ poses.rotation == pytest.approx(
            np.broadcast_to(np.eye(3), (21, 3, 3)), abs=1e-12
        )
        assert (poses.n_angular == AXIS).all()


def test_consecutive_lines_share_a_sample_and_finer_samples_keep_the_coarse_ones() -> None:
    found = plan(steps(*({"to": n, "by": "line"} for n in (1, 2, 3)), closed=False))
    coarse, fine = found.sample(), found.sample(4)
    assert coarse.of_motion[0][-1] == coarse.of_motion[1][0]
    step = np.linalg.norm(np.diff(coarse.poses.position, axis=0), axis=1)
    assert step.max() <= 0.02 + 1e-12
    z = coarse.poses.rotation[:, :, 2]
    assert np.arccos(np.clip((z[1:] * z[:-1]).sum(axis=1), -1.0, 1.0)).max() <= 0.1 + 1e-9
    assert fine.poses.position[::4] == pytest.approx(coarse.poses.position, abs=1e-12)
    assert fine.poses.rotation[::4, :, 2] == pytest.approx(z, abs=1e-12)


# What tool and payload may touch

PART = {"mass": 0.1, "center": [0, 0, 0.02], "size": [0.04, 0.04, 0.06]}  # reaches 50 mm beyond the tip
TABLE, BIN = (
    {"kind": "ground", "name": "table", "z": 0.0},
    {"kind": "box", "name": "bin", "center": [0.3, 0.0, 0.02], "size": [0.1, 0.1, 0.04]},
)


@pytest.mark.parametrize(
    ("height", "payload", "more", "wanted"),
    [
        (0.138, PART, {}, [APART, 0.003]),  # the box is 98 mm below the tip, 48 mm below the part
        (0.135, PART, {"into": "bin"}, [APART, np.inf]),
        (0.135, PART, {"on": "table"}, [0.003, APART]),
        (0.145, PART, {}, [APART, APART]),
        (0.095, 0.1, {}, [APART, APART]),  # neither tool nor payload is a body
    ],
)
def test_target_rests_on_what_is_first_met_unless_it_names_it(
    height: float, payload: Any, more: dict[str, Any], wanted: list[float]
) -> None:
    target = {"position": [0.3, 0.0, height], "axis": DOWN, "tolerance": 0.003, **more}
    read = task(None, [target, {"position": [0.3, 0.3, 0.5]}], payload=payload, obstacles=[TABLE, BIN])
    assert read.tip_rules.allowed.tolist() == [wanted, [APART, APART]]


def test_depths_are_allowed_on_the_lines_of_a_target_and_near_it() -> None:
    targets = [{**target, "position": [*target["position"][:2], 0.05], "axis": DOWN} for target in NAMED]
    cycle = steps({"to": "bin", "do": "pick"}, {"to": 3}, {"to": "tray", "do": "place"}, approach=0.1)
    found = plan(cycle, targets, payload=PART, obstacles=[TABLE, BIN])
    share = np.array([0.0, 0.05, 0.5, 0.95, 1.0])
    allowed = [found.rules(motion, share).allowed.max(axis=1).tolist() for motion in found.motions]
    line, apart = [REACHED] * 5, [APART] * 5
    # out of the bin, over to 3, over to the tray and into it, out of it, over to the bin and into it
    assert allowed == [line, [*apart[:3], REACHED, REACHED], [REACHED, REACHED, *apart[2:]], line, line, apart, line]
    assert [found.rules(motion, share).carries.all() for motion in found.motions] == [True] * 4 + [False] * 3
    samples = found.coarse_rules[: len(found.sample().poses)]
    assert samples.allowed.shape == (len(found.sample().poses), 2)
    ways_in = [found.sample().of_motion[index] for index, source in enumerate(found.source) if source == index]
    assert (samples.allowed.max(axis=1) == REACHED).sum() == 1 + sum(map(len, ways_in))
    assert found.source == (6, 1, 2, 3, 3, 5, 6)  # out of the bin and the tray as into them


def test_unknown_surface_is_named_with_those_that_exist() -> None:
    with pytest.raises(TaskError, match=r'target 1: on: expected the name of one obstacle, got "tabel"\. Did you mean'):
        task(None, [{**NAMED[0], "on": "tabel"}], obstacles=[TABLE])
    with pytest.raises(TaskError, match=r"into: .* Obstacles: none has a name"):
        task(None, [{**NAMED[0], "into": "hole"}], obstacles=[{"kind": "ground"}])


@pytest.mark.parametrize(
    ("tool", "message"),
    [
        ({"tip": [0, 0, 0.1], "radius": 0.02, "size": [0.1, 0.1, 0.1]}, "size or radius, got both"),
        ({"radius": 0.02}, "radius needs a tip"),
    ],
)
def test_tools_without_one_body_are_refused(tool: dict[str, Any], message: str) -> None:
    with pytest.raises(TaskError, match=message):
        task(None, tool=tool)
