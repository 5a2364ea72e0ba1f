"""Compare existing arms with the designs of a run."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import armwright as aw
from armwright.exceptions import ArmError, FailureError, MissingExtraError, RunFolderError, SettingsError, TaskError
from armwright.existing import base_placement
from armwright.existing.base_placement import placed
from armwright.existing.compare_arms import (
    EXISTING_ARMS,
    ArmComparison,
    ComparedArm,
    compare_arms,
    dominance_counts,
    read_existing_arms,
)
from armwright.kinematics.arms.arm_arrays import stack_arms
from armwright.page.page import write_report
from armwright.pictures.figures import draw_front, write_figures
from armwright.pictures.style import RC
from armwright.problem.objectives import QUANTITIES, named_objectives
from armwright.robot.actuators import named_actuator
from armwright.robot.mounting import Mounting
from armwright.robot.robot_descriptions import find_urdf
from armwright.robot.urdf_reader import read_urdf
from armwright.runs.folder import read_run
from armwright.runs.history import History
from armwright.sheet.design_sheet import design_sheet
from armwright.sheet.urdf_sheet import urdf_sheet
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task
from armwright.tasks.tool import Tool
from tests.support.browser import Tab
from tests.support.command_line import armwright, refused
from tests.support.robots import robot

EXAMPLES = Path(__file__).parents[2] / "examples"
TASK = Task(name="feeder", targets=((0.4, -0.2, 0.1), (0.4, 0.2, 0.1), (0.1, 0.35, 0.5)), payload=(0.5, 0.5, 0.0))
SPACE = DesignSpace(
    joints=3,
    origin_z=(0.0, 0.0),
    origin_x=(-0.5, 0.5),
    link=(0.05, 0.4),
    link_section={"tubes": [[0.06, 0.004]], "material": "aluminium"},  # type: ignore[arg-type]
)
WITH_MOTORS = SPACE.model_copy(update={"actuators": (named_actuator("XM540-W270"),)})
UR5, PANDA = robot("ur5_robot"), robot("panda")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arms") / "run"
    aw.optimize(aw.Problem(TASK, SPACE), proposer="none", sampler="random", n_init=10, n_total=30, out=folder)
    return folder


@pytest.fixture
def short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few bases are tried."""
    monkeypatch.setattr(base_placement, "GENERATIONS", 5)


@pytest.fixture
def history(run: Path) -> History:
    return read_run(run)[1]


@pytest.fixture(scope="module")
def compared(run: Path) -> ArmComparison:
    return compare_arms(TASK, [UR5, PANDA], run)


def test_exported_design_compared_as_existing_arm_keeps_its_values(run: Path, history: History) -> None:
    """Compare the front's URDFs at the bases of their designs."""
    members = history.front[:4]
    files = [run / "designs" / f"{member.number:04d}" / "arm.urdf" for member in members]
    comparison = compare_arms(TASK, files, run, base=(0.0, 0.0, 0.0))
    for member, arm in zip(members, comparison.arms, strict=True):
        assert arm.values == pytest.approx(member.values, rel=1e-3, abs=1e-4)
        assert arm.value("mass") == pytest.approx(member.arm.mass)
        assert arm.value("reach") == pytest.approx(design_sheet(run, member.number).over_reach[-1].distance, rel=1e-3)
        assert arm.joints == 3
        assert (arm.value("position_error"), arm.value("torque")) == arm.values
    assert len({arm.name for arm in comparison.arms}) == 4  # all files are called arm.urdf
    assert comparison.places == 0


def test_base_search_beats_random_positions_within_the_ranges_of_the_space(compared: ArmComparison) -> None:
    """No other of 1000 positions that reaches all targets needs clearly less torque."""
    rng = np.random.default_rng(5)
    for arm, file in zip(compared.arms, (UR5, PANDA), strict=True):
        x, y, z = arm.base
        assert -0.5 <= x <= 0.5
        assert -1.0 <= y <= 1.0
        assert z == 0.0
        arm_at_origin = read_urdf(file).arm
        first = compared.placed[list(compared.arms).index(arm)].base
        assert np.subtract(first, arm.base) == pytest.approx(arm_at_origin.base)  # on the first axis of both arms
        others = rng.uniform((-0.5, -1.0, 0.0), (0.5, 1.0, 0.0), (1000, 3))
        moved = [replace(arm_at_origin, base=tuple(np.add(arm_at_origin.base, place).tolist())) for place in others]
        evaluation = compared.problem.physics(stack_arms(moved))
        missed = np.maximum(evaluation.position_error - 1e-3, 0.0).sum(axis=1)
        torque = 40 * np.linalg.norm(evaluation.joint_torques, axis=2).sum(axis=1)
        assert arm.value("unreached_targets") == 0
        assert arm.value("torque") <= 1.01 * torque[missed == 0.0].min()  # type: ignore[operator]


@pytest.mark.usefixtures("short_search")
def test_equal_seeds_give_equal_bases() -> None:
    first, again, other = (compare_arms(TASK, [PANDA], space=SPACE, seed=seed).arms[0].base for seed in (0, 0, 1))
    assert first == again != other


def test_base_search_prefers_positions_that_meet_the_constraints() -> None:
    task = TASK.model_copy(update={"constraints": ("manipulability >= 0.05", "clearance >= 0.1")})
    (light,) = compare_arms(TASK, [UR5], space=SPACE).arms
    (moved,) = compare_arms(task, [UR5], space=SPACE).arms
    (placed,) = compare_arms(task, [UR5], space=SPACE, base=light.base).arms
    assert placed.violated == ("manipulability >= 0.05 (it has 0.00361)",)
    assert moved.violated == ()
    assert moved.value("unreached_targets") == 0


def test_base_is_turned_where_the_first_joint_does_not_reach() -> None:
    """The first joint of the SO-101 turns by 110° to either side, so it sees nothing behind its base."""
    behind = Task(name="behind", targets=((-0.2, 0.05, 0.1), (-0.2, -0.05, 0.1), (-0.25, 0.0, 0.15)))
    space = SPACE.model_copy(update={"origin_x": (0.0, 0.0), "origin_y": (0.0, 0.0)})
    so101 = robot("so101")
    (unturned,) = compare_arms(behind, [so101], space=space, base=(0.0, 0.0, 0.0)).arms
    (turned,) = compare_arms(behind, [so101], space=space).arms
    (again,) = compare_arms(behind, [so101], space=space, base=(*turned.base, turned.yaw)).arms
    assert unturned.value("unreached_targets") == 3
    assert turned.value("unreached_targets") == 0
    assert abs(turned.yaw) > 1.0
    assert again == turned
    before = behind.model_copy(update={"targets": tuple((-x, y, z) for x, y, z in behind.target_positions.tolist())})
    (needless,) = compare_arms(before, [so101], space=space).arms
    assert needless.value("unreached_targets") == 0
    assert needless.yaw == 0.0  # a turn would save less than 1 % of the torque


def values_of(arm: ComparedArm) -> dict[str, float | None]:
    return {name: fact.value for name, fact in arm.facts.items()}


def test_designs_and_arms_have_the_values_of_their_data_sheets(run: Path, compared: ArmComparison) -> None:
    for design in compared.designs[:3]:
        sheet = design_sheet(run, int(design.name[1:].split()[0]))
        assert {name: fact.value for name, fact in sheet.facts.items()} == values_of(design)
        assert tuple(value for value, _ in sheet.objectives.values()) == design.values
    for arm, file in zip(compared.arms, (UR5, PANDA), strict=True):
        placement = placed(compared.problem, read_urdf(file), 0, Mounting(arm.base, arm.yaw))
        sheet = urdf_sheet(placement)
        assert {name: fact.value for name, fact in sheet.facts.items()} == values_of(arm)
        assert sheet.violated == arm.violated
        assert tuple(value for value, _ in sheet.objectives.values()) == arm.values
        used = max(joint.peak_utilisation for joint in sheet.joints)  # type: ignore[type-var]
        assert used == pytest.approx(arm.value("torque_utilisation"))


def test_dominance_counts_match_pairwise_comparison(history: History) -> None:
    values = np.array([member.values for member in history.front])
    anywhere = np.random.default_rng(1).uniform(0, 9, (9, 2))
    for point in [*values, values.min(axis=0), values.max(axis=0) + 1.0, *anywhere]:
        better = sum(all(p <= v) and any(p < v) for p, v in ((point, row) for row in values))  # type: ignore[arg-type]
        worse = sum(all(v <= p) and any(v < p) for p, v in ((point, row) for row in values))  # type: ignore[arg-type]
        assert dominance_counts(point.tolist(), (), history) == (better, worse)
    assert dominance_counts((values.min(axis=0) - 1e-9).tolist(), (), history) == (len(values), 0)
    assert dominance_counts((1.0, None), (), history) is None


def test_run_folder_keeps_existing_arms_for_figures_and_page(run: Path, compared: ArmComparison, tab: Tab) -> None:
    comparison = compare_arms(TASK, [UR5, PANDA], run)
    kept = read_existing_arms(run, 2)
    assert kept == comparison.arms == compared.arms
    assert {"front.png"} <= {path.name for path in write_figures(run)}
    history = read_run(run)[1]
    with matplotlib.rc_context(RC):
        near = replace(kept[0], name="near", values=tuple(0.5 * np.array(history.reference_point)))
        far = replace(kept[1], name="far", values=(1e-3, 1e6))
        (axes,) = draw_front(history, [near, far, replace(kept[1], name="odd", values=(None, 1.0))]).axes
    entries = [text.get_text() for text in axes.figure.legends[0].get_texts()]
    assert entries[-2:] == ["a: near", "b: far, beyond, at 0.001, 1,000,000"]
    assert "existing arm" in entries
    assert {"a", "b"} <= {text.get_text() for text in axes.texts}
    tab.open(write_report(run))
    trace = tab.ask('(({ x, y, text }) => ({ x, y, text }))(pareto.data.find((one) => one.name === "existing arm"))')
    assert (trace["text"], trace["y"]) == (["ur5_robot", "panda"], [arm.values[1] for arm in kept])


def test_page_shows_existing_arms_beside_the_recommended_designs(tmp_path: Path, tab: Tab) -> None:
    """The recommended designs state the same reach, payload and quantities as the comparison computes for them."""
    task, space = (EXAMPLES / f"6-price-{part}.yaml" for part in ("task", "space"))
    run = tmp_path / "run"
    aw.find_front(aw.Problem(aw.load_task(task), aw.load_space(space)), evaluations=300, out=run)
    comparison = compare_arms(task, [UR5], run, prices={"ur5_robot": 28000.0})
    tab.open(write_report(run))
    stated, (arm,) = table(tab), comparison.arms
    assert stated[arm.name]["Price"] == "28,000 USD"
    assert stated[arm.name]["Deflection"] == "–"
    designs = {design.name: design for design in comparison.designs}
    shown = [name for name in stated if name != arm.name]
    assert set(shown) & set(designs)
    for name in shown:
        assert stated[name]["On this task"] == "meets all constraints"
    for name in set(shown) & set(designs):
        design, held = designs[name], designs[name].value("payload_at_full_reach")
        assert held is not None
        assert stated[name]["Reach"] == design.facts["reach"].text
        assert stated[name]["Payload at full reach"] == f"{held:.3g} kg"
        assert stated[name]["Deflection"] == design.facts["deflection"].text
    tab.page.locator("#existing button").last.click()
    assert tab.page.locator("#existing tr.chosen button").inner_text() == shown[-1]
    assert tab.faults == []


def table(tab: Tab) -> dict[str, dict[str, str]]:
    """Return the page's table of existing arms: the cells of each arm by the heads of their columns."""
    heads = tab.ask("[...document.querySelectorAll('#existing th')].map((one) => one.firstChild.textContent)")
    rows = tab.ask(
        "[...document.querySelectorAll('#existing tbody tr')].map((r) => [...r.cells].map((c) => c.innerText))"
    )
    return {row[0]: dict(zip(heads, row, strict=True)) for row in rows}


@pytest.mark.usefixtures("short_search")
def test_arm_of_unknown_mass_has_no_torque_and_is_not_compared(run: Path, history: History, tmp_path: Path) -> None:
    """One link without a mass leaves all masses, torques and payloads open, but neither reach nor speeds."""
    file, cycle = tmp_path / "light.urdf", {"time": 2.0, "steps": [{"to": 1}, {"to": 2}]}
    file.write_text(
        re.sub(
            r'(<link name="forearm_link">.*?)<inertial>.*?</inertial>', r"\1", UR5.read_text("utf-8"), flags=re.DOTALL
        ),
        encoding="utf-8",
    )
    whole, light = compare_arms(TASK, [UR5, file], run, base=(-0.2, 0.0, 0.0)).arms
    loads = {name for name, quantity in QUANTITIES.items() if "masses" in quantity.needs}
    assert light.values[1] is light.dominates is light.dominated_by is None
    for name in {"payload_at_full_reach", *loads}:
        assert light.value(name) is None
        assert whole.value(name) is None or light.facts[name].reason == "no mass is stated for forearm_link"
    for name in light.facts.keys() - {"payload_at_full_reach", *loads}:
        assert light.value(name) == whole.value(name)
    assert "no mass is stated for forearm_link, so masses, torques and payloads are not known" in light.notes
    searched = compare_arms(TASK, [file], space=SPACE).arms[0]
    assert searched.value("unreached_targets") == 0
    moving = TASK.model_copy(update={"cycle": Task(name="c", targets=TASK.targets, cycle=cycle).cycle})  # type: ignore[arg-type]
    there = placed(aw.Problem(moving, WITH_MOTORS), read_urdf(file), 0, Mounting((-0.2, 0.0, 0.0)))
    with_task, alone = urdf_sheet(there), urdf_sheet(read_urdf(file))
    assert all(joint.torque is joint.peak_utilisation is joint.tilting_moment is None for joint in with_task.joints)
    assert all(joint.speed_utilisation for joint in with_task.joints[:1])
    assert with_task.violated == ()
    for sheet in (with_task, alone):
        assert [link.mass is None for link in sheet.links] == [False, False, True, False, False, False]
        assert sheet.masses == ()
        assert {line.payload for line in sheet.over_reach} == {None}
        assert sheet.facts["mass"].text == "not stated (no mass is stated for forearm_link)"
    with pytest.raises(
        ArmError, match="payload: expected an arm of known mass, but no mass is stated for forearm_link"
    ):
        aw.reach_map(read_urdf(file), spacing=0.5, payload=0.1)


def test_arm_whose_masses_are_all_zero_is_of_unknown_mass(tmp_path: Path) -> None:
    file = tmp_path / "nothing.urdf"
    file.write_text(re.sub(r'<mass value="[^"]*"', '<mass value="0"', UR5.read_text("utf-8")), encoding="utf-8")
    read = read_urdf(file).arm
    assert read.no_mass.startswith("no mass is stated for shoulder_link, upper_arm_link")
    file.write_text(aw.to_urdf(read), encoding="utf-8")
    again = "no mass is stated for link_1, link_2, link_3, link_4, link_5, link_6"
    assert read_urdf(file).arm.no_mass == again


@pytest.mark.slow
def test_unknown_price_and_effort_are_not_compared(tmp_path: Path) -> None:
    problem = aw.Problem(
        TASK, WITH_MOTORS, objectives=named_objectives(["position_error", "mass", "price", "torque_utilisation"])
    )
    aw.optimize(problem, proposer="none", sampler="random", n_init=4, n_total=4, out=tmp_path / "run")
    silent = tmp_path / "silent.urdf"
    silent.write_text(UR5.read_text(encoding="utf-8").replace('effort="', 'effort="0" was="'), encoding="utf-8")
    ur5, without = compare_arms(TASK, [UR5, silent], tmp_path / "run", base=(0.0, 0.0, 0.0)).arms
    assert (ur5.values[2], without.values[2]) == (None, None)
    assert ur5.values[3] == ur5.value("torque_utilisation") != None  # noqa: E711
    assert (without.values[3], without.value("torque_utilisation")) == (None, None)
    assert (ur5.dominates, ur5.dominated_by) == (None, None)
    assert any("price unknown" in note for note in ur5.notes)
    assert any("not every joint states an effort" in note for note in without.notes)
    assert write_figures(tmp_path / "run")


@pytest.mark.slow
def test_stated_prices_are_compared_and_bounded(tmp_path: Path) -> None:
    task = TASK.model_copy(update={"constraints": ("price <= 20000", "self_clearance >= 0.01")})
    problem = aw.Problem(task, WITH_MOTORS, objectives=named_objectives(["position_error", "price"]))
    aw.optimize(problem, proposer="none", sampler="random", n_init=4, n_total=4, verify=False, out=tmp_path / "run")
    prices = {"ur5_robot": 28_000.0, "panda": 15_000.0}
    found = compare_arms(task, [UR5, PANDA], tmp_path / "run", base=(0.0, 0.0, 0.0), prices=prices)
    ur5, panda = found.arms
    assert [(arm.value("price"), arm.values[1]) for arm in (ur5, panda)] == [(28e3, 28e3), (15e3, 15e3)]
    assert ur5.violated == ("price <= 20000 (it has 28,000)",)
    assert (ur5.dominates, ur5.dominated_by, panda.violated) == (None, None, ())
    assert panda.dominates is not None
    assert "unknown whether it meets self_clearance >= 0.01" in panda.notes
    assert {design.value("price") for design in found.designs} == {3 * 482.89}


def test_existing_arm_drives_a_cycle_of_stated_durations() -> None:
    """A URDF states effort and speed; what else a drive can do is unknown, and so is the fastest cycle."""
    cycle = {"time": 2.0, "steps": [{"to": 1}, {"to": 2}, {"to": 3}]}
    task = Task(name="feeder", targets=TASK.targets, payload=0.5, cycle=cycle, objectives=["dynamic_torque", "price"])  # type: ignore[arg-type]
    (ur5,) = compare_arms(task, [UR5], space=WITH_MOTORS, base=(-0.2, 0.0, 0.0)).arms
    peak = ur5.value("peak_torque")
    assert peak is not None
    assert ur5.values[0] > peak  # type: ignore[operator]
    assert ur5.values[1] is None
    unknown = ("collision", "dynamic_utilisation", "thermal_utilisation", "voltages")
    assert {f"unknown whether it meets {name} <= {int(name != 'collision')}" for name in unknown} < set(ur5.notes)
    fastest = task.model_copy(update={"cycle": task.cycle.model_copy(update={"time": "fastest"})})  # type: ignore[union-attr]
    assert compare_arms(fastest, [UR5], space=WITH_MOTORS, base=(-0.2, 0.0, 0.0)).arms[0].values == (None, None)


def test_carousel_needs_the_torque_of_its_own_inertia(tmp_path: Path) -> None:
    """A quarter turn of 0.2 kg m² in 1 s, of which the minimum jerk accelerates with 5.77 times the angle at most."""
    inertial = '<mass value="5"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.15" iyz="0" izz="0.2"/>'
    limit = '<limit lower="-2" upper="2" effort="1" velocity="20"/>'
    file = tmp_path / "carousel.urdf"
    file.write_text(
        f'<robot name="r"><link name="a"/><link name="b"><inertial>{inertial}</inertial></link><link name="c"/>'
        f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>{limit}</joint>'
        '<joint name="k" type="fixed"><parent link="b"/><child link="c"/><origin xyz="0.4 0 0"/></joint></robot>',
        encoding="utf-8",
    )
    side, cycle = 0.4 * np.sqrt(0.5), {"time": 1.0, "steps": [{"to": 1}, {"to": 2}]}
    task = Task(
        name="turn", targets=((side, side, 0.0), (side, -side, 0.0)), cycle=cycle, objectives=["dynamic_torque"]
    )  # type: ignore[arg-type]
    (arm,) = compare_arms(task, [file], base=(0.0, 0.0, 0.0)).arms
    assert arm.values[0] == pytest.approx(0.2 * 5.7735 * np.pi / 2, rel=2e-3)
    assert any("an effort of its file" in one for one in arm.violated)


def test_slides_of_existing_arms_use_the_travel_of_the_space(tmp_path: Path) -> None:
    """The force is unchanged; the torque follows from the travel of the space."""
    tiago = read_urdf(robot("tiago_no_hand"))
    (plain,) = compare_arms(TASK, [tiago], base=(0.0, 0.0, 0.0), space=SPACE.model_copy(update={"travel": 1.0})).placed
    (geared,) = compare_arms(TASK, [tiago], base=(0.0, 0.0, 0.0), space=SPACE).placed
    assert [joint.kind for joint in geared.joints].count("prismatic") == 1
    for one, other in zip(plain.joints, geared.joints, strict=True):
        assert (one.effort, one.speed) == pytest.approx((other.effort, other.speed))
        assert other.travel == (SPACE.travel if other.kind == "prismatic" else 1.0)


def test_invalid_arguments_are_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="expected at least one arm"):
        compare_arms(TASK, [])
    with pytest.raises(TaskError, match="is a run of the task feeder, with other targets, another tool"):
        compare_arms("target-1", [UR5], run)
    for other in ({"payload": 1.0}, {"tool": Tool(mass=0.5)}):
        with pytest.raises(TaskError, match="another tool or other payloads"):
            compare_arms(TASK.model_copy(update=other), [UR5], run)
    with pytest.raises(SettingsError, match="the run has its own space"):
        compare_arms(TASK, [UR5], run, space=SPACE)
    with pytest.raises(ArmError, match="there is no file"):
        compare_arms(TASK, ["none.urdf"])
    with pytest.raises(ArmError, match="is a folder"):
        compare_arms(TASK, [tmp_path])
    with pytest.raises(RunFolderError):
        compare_arms(TASK, [UR5], tmp_path / "none")


@pytest.mark.slow
def test_arm_is_found_by_name_in_robot_descriptions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use robot_descriptions with a repository that is already cached."""
    place = tmp_path / "cache" / "example-robot-data-here" / "example-robot-data"
    urdf = place / "robots" / "ur_description" / "urdf" / "x.urdf"
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("ROBOT_DESCRIPTION_COMMIT", "here")
    panda = place / "robots" / "panda_description" / "urdf" / "panda.urdf"
    for file, content in ((panda, PANDA.read_bytes()), (urdf, b"")):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content)
    git = ["git", "-C", str(place), "-c", "user.name=a", "-c", "user.email=a@b.invalid"]
    for command in (["init", "-q", "-b", "here"], ["add", "."], ["commit", "-q", "-m", "a"]):
        subprocess.run([*git, *command], check=True)
    assert find_urdf("Panda") == panda
    assert compare_arms(TASK, ["Panda"], base=(0.0, 0.0, 0.0)).arms[0].joints == 7
    with pytest.raises(ArmError, match=r'has no URDF "pandda"\. Did you mean "panda"\?'):
        find_urdf("pandda")
    with pytest.raises(ArmError, match="no URDF"):
        find_urdf("viper_mj")


@pytest.mark.slow
def test_arm_names_without_network_or_package_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Report a missing network and a missing package."""
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    for name in ("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "all_proxy"):
        monkeypatch.setenv(name, "http://127.0.0.1:9")
    with pytest.raises(FailureError, match=r"cannot give the URDF of z1: fatal: .*a local URDF file") as fault:
        find_urdf("z1")
    assert "\n" not in str(fault.value)
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(MissingExtraError, match=r'pip install "armwright\[arms\]"'):
        find_urdf("panda")


@pytest.mark.usefixtures("short_search")
def test_compare_arms_command_prints_table_json_and_errors(run: Path, in_folder: Path) -> None:
    Path("task.yaml").write_text(json.dumps(TASK.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    done = armwright("compare-arms", "task.yaml", UR5, PANDA, "--run", run, "--no-figures", "--price", "panda=15000")
    assert done.returncode == 0, done.stderr
    assert "…" not in done.stdout
    for word in ("ur5_robot", "1,500 places", "dominated by", "15,000.00 USD", 'tip is the link "ee_link"'):
        assert word in done.stdout
    told = json.loads(
        armwright("compare-arms", "task.yaml", UR5, "--run", run, "--base", "0,0.1,0", "--no-figures", "--json").stdout
    )
    assert told["arms"][0]["base"] == [0.0, 0.1, 0.0]
    assert told["designs"][0]["values"] == list(read_run(run)[1].front[0].values)
    turned = armwright("compare-arms", "task.yaml", UR5, "--base", "0,0.1,0,90", "--json").stdout
    assert json.loads(turned)["arms"][0]["yaw"] == pytest.approx(np.pi / 2)
    (run / EXISTING_ARMS).unlink()
    for options, words in (
        (("--base", "0,0,0,nan"), '--base "0,0,0,nan": expected three numbers with commas'),
        (("--tip", "tool1"), 'Did you mean "tool0"?'),
        (("--price", "ur5"), '--price "ur5": expected ARM=USD'),
        (("--price", "ur5_robot=1", "--price", "ur5_robot=2"), "expected one price of ur5_robot, got two"),
        (("--price", "ur5_rob=1e4"), 'unknown arm "ur5_rob". Did you mean "ur5_robot"?'),
        (("--price", "ur5_robot=-1"), "expected a finite number of at least 0 USD, got -1.0"),
    ):
        assert words in refused(2, "compare-arms", "task.yaml", UR5, *options)
