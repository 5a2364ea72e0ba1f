"""Picking and exporting designs."""

import csv
import io
import json
from pathlib import Path

import mujoco
import pytest
import yourdfpy
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from armwright.cli.app import app
from armwright.exceptions import FailureError, SettingsError
from armwright.pareto import knee_index
from armwright.problem.conditions import Condition, read_condition
from armwright.proof.export import FORMATS
from armwright.proof.selection import numbers_of, pick, pick_from
from armwright.runs.folder import read_run
from armwright.runs.history import History


@pytest.fixture
def run(studied: Path) -> Path:
    return studied


@pytest.fixture
def history(run: Path) -> History:
    return read_run(run)[1]


def test_picked_designs_meet_the_conditions_and_are_sorted(history: History) -> None:
    conditions = [Condition("position_error", "<=", 2.0), Condition("length", "<", 0.6)]
    picked = pick(history, conditions, by="torque")
    told = [numbers_of(history, member) for member in history.front]
    meeting = [numbers for numbers in told if numbers["position_error"] <= 2.0 and numbers["length"] < 0.6]
    assert 0 < len(meeting) < len(history.front)
    assert [member.values[1] for member in picked] == sorted(numbers["torque"] for numbers in meeting)


def test_default_pick_is_the_knee(history: History) -> None:
    assert pick(history)[0].number == knee_index(history.values, (5.0, 5.0))
    assert len(pick(history)) == len(history.front)


def test_pick_can_be_restricted_to_designs_that_hold(run: Path) -> None:
    """Without constraints, these are the robust ones."""
    robust = json.loads((run / "summary.json").read_text(encoding="utf-8"))["verification"]["robust_numbers"]
    assert robust
    _, picked, _ = pick_from(run, holds=True)
    assert sorted(member.number for member in picked) == sorted(robust)


def test_empty_selection_names_the_reason(history: History) -> None:
    least = min(member.values[0] for member in history.front)
    with pytest.raises(FailureError, match=f"position_error <= 1e-06; the nearest has {least:.4g}"):
        pick(history, [Condition("torque", "<", 100.0), Condition("position_error", "<=", 1e-6)])
    both = [Condition("position_error", "<=", least), Condition("torque", "<", 0.2)]
    with pytest.raises(FailureError, match="all of these conditions at once"):
        pick(history, both)
    with pytest.raises(SettingsError, match=r'unknown quantity "torqe".*Did you mean "torque"'):
        pick(history, [Condition("torqe", "<", 1.0)])


@given(
    st.from_regex(r"[a-z_]{1,12}", fullmatch=True),
    st.sampled_from(["<=", ">=", "<", ">", "=="]),
    st.floats(allow_nan=False, allow_infinity=False),
)
def test_written_conditions_are_read_back(name: str, relation: str, bound: float) -> None:
    assert read_condition(f"{name} {relation}{bound!r}") == Condition(name, relation, bound)


@pytest.mark.parametrize(
    "words", ["", "torque", "torque<", "torque<=x", "__import__('os')<1", "a<1<2", "torque=1", "torque==1==2"]
)
def test_invalid_conditions_are_refused(words: str) -> None:
    with pytest.raises(SettingsError, match="expected a name, one of"):
        read_condition(words)


def test_conditions_know_the_number_of_joints_and_units(history: History) -> None:
    assert len(pick(history, [read_condition("joints == 4")])) == len(history.front)
    with pytest.raises(FailureError, match="joints < 4; the nearest has 4"):
        pick(history, [read_condition("joints<4")])
    by_unit = [pick(history, [read_condition(f"length<={text}")]) for text in ("0.6", "0.6 m", "600 mm", "60 cm")]
    assert all([m.number for m in picked] == [m.number for m in by_unit[0]] for picked in by_unit)
    with pytest.raises(SettingsError, match=r"length: expected a bound in m or mm or cm, got 0\.6 kg"):
        pick(history, [read_condition("length<=0.6 kg")])


def test_unknown_quantities_are_answered_with_all_that_exist(history: History) -> None:
    for name, known in (("n_joints", "joints"), ("weight", "mass"), ("manipulabilty", "manipulability")):
        with pytest.raises(SettingsError, match=f'"{name}". Did you mean "{known}".*Available: .*payload_capacity'):
            pick(history, [Condition(name, "<", 1.0)])


def invoke(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def test_every_export_format_is_written_and_loads(run: Path, tmp_path: Path) -> None:
    picked = json.loads(invoke("pick", run, "--where", "position_error<=1.5", "--by", "torque", "-n", "2", "--json"))
    assert len(picked) == 2
    number = picked[0]["number"]
    texts = {kind: invoke("export", run, "--design", number, "--format", kind) for kind in FORMATS}
    for kind, text in texts.items():
        invoke("export", run, "--design", number, "--format", kind, "--out", tmp_path / "deep" / kind)
        assert (tmp_path / "deep" / kind).read_text(encoding="utf-8") == text
    assert texts["urdf"] == (run / "designs" / f"{number:04d}" / "arm.urdf").read_text(encoding="utf-8")
    for kind in ("urdf", "ros2_control"):
        assert len(yourdfpy.URDF.load(io.StringIO(texts[kind])).actuated_joints) == 4
    assert mujoco.MjModel.from_xml_string(texts["mjcf"]).njnt == 4


def test_all_picked_designs_are_a_table_and_csv(run: Path, history: History) -> None:
    asked = ("pick", run, "--where", "joints==4", "--by", "torque", "--all")
    rows = list(csv.DictReader(io.StringIO(invoke(*asked, "--csv"))))
    records = json.loads(invoke(*asked, "--json"))
    assert [int(row["number"]) for row in rows] == [record["number"] for record in records]
    assert len(rows) == len(history.front)
    for row, record in zip(rows, records, strict=True):
        assert float(row["torque"]) == record["torque"]
        assert row["joint_1"] == record["joints"][0]
        assert float(row["joints"]) == len(record["joints"])
    table = invoke(*asked).splitlines()
    assert [line.split()[0] for line in table[2:]] == [row["number"] for row in rows]


def test_mistakes_are_reported(run: Path) -> None:
    for arguments, words in (
        (["export", str(run), "--design", "999"], "has the designs 0 to 49"),
        (["export", str(run), "--format", "urfd"], 'Did you mean "urdf"'),
        (["pick", str(run), "-n", "0"], "-n 0"),
    ):
        result = CliRunner().invoke(app, arguments)
        assert words in str(result.exception)
