"""report.html in a real browser, offline."""

import csv
import io
import json
import re
import shutil
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import yourdfpy

import armwright as aw
from armwright.exceptions import RunFolderError
from armwright.kinematics.arms.forward import joint_positions
from armwright.page.page import write_report
from armwright.pareto import front_indices
from armwright.problem.conditions import read_condition
from armwright.proof.selection import pick_from
from armwright.runs.folder import read_run
from armwright.runs.history import History
from tests.fuzz.run_targets import a_run
from tests.support.browser import Tab
from tests.support.command_line import wait_until


@pytest.fixture
def run(studied: Path) -> Path:
    return studied


@pytest.fixture
def history(run: Path) -> History:
    return read_run(run)[1]


def place_of(tab: Tab, number: int) -> tuple[float, float]:
    """Where a design is drawn in the Pareto plot [px]."""
    return tab.ask(
        f"""(() => {{
            const plot = document.getElementById("pareto"), {{ xaxis, yaxis }} = plot._fullLayout;
            const [x, y] = armwright.content.values({number}), box = plot.getBoundingClientRect();
            return [box.left + xaxis._offset + xaxis.d2p(x), box.top + yaxis._offset + yaxis.d2p(y)];
        }})()"""
    )


def isolated(tab: Tab, history: History) -> int:
    """A design of the front within the box that no other is drawn near to."""
    inside = [n for n in front_indices(history.values) if np.all(history.values[n] < 4.9)]
    places = np.array([place_of(tab, n) for n in range(len(history))])
    apart = [np.sort(np.linalg.norm(places - places[n], axis=1))[1] for n in inside]
    return inside[int(np.argmax(apart))]


def test_page_opens_offline_without_requests(run: Path, tab: Tab) -> None:
    tab.open(run / "report.html")
    assert tab.requests == [(run / "report.html").resolve().as_uri()]
    assert tab.faults == []
    assert (run / "report.html").stat().st_size < 2.5e6
    facts = tab.text("#facts")
    summary = json.loads((run / "summary.json").read_text(encoding="utf-8"))
    assert f"{summary['hypervolume']['final']:.4g}" in facts
    assert f"{100 * summary['front_gap']['share']:.1f} % of the best known" in facts
    assert not tab.page.locator("#repeat").is_visible()  # it was made by Python
    tab.page.set_viewport_size({"width": 390, "height": 800})
    tab.page.emulate_media(color_scheme="dark")
    wait_until(lambda: tab.ask("document.documentElement.scrollWidth") <= 390)  # after plots have shrunk
    background = tab.ask("getComputedStyle(document.body).backgroundColor")
    assert sum(map(int, re.findall(r"\d+", background)[:3])) < 200
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', (run / "report.html").read_text("utf-8"))
    assert {"default-src 'none'", " connect-src 'none'"} <= set(policy.split(";"))
    scripts = next(part for part in policy.split(";") if "script-src" in part).split()[1:]
    assert all(re.fullmatch(r"'sha256-[A-Za-z0-9+/]{43}='", one) for one in scripts)
    tab.ask("(() => { const s = document.createElement('script'); s.textContent = 'window.hacked = 1'; "
            "document.body.append(s); })()")  # fmt: skip
    assert tab.ask("window.hacked") is None


def test_axes_fit_the_designs(tmp_path: Path, tab: Tab) -> None:
    task = aw.load_task("target-1").model_copy(update={"name": "far", "reference_point": (900.0, 9000.0)})
    history = aw.optimize(aw.Problem(task=task), proposer="none", n_init=4, n_total=6, out=tmp_path / "run").history
    tab.open(write_report(tmp_path / "run"))
    high = np.array(tab.ask("[pareto.layout.xaxis.range[1], pareto.layout.yaxis.range[1]]"))
    assert all((member.values < high).all() for member in history.front)
    assert high == pytest.approx(1.1 * history.values.max(axis=0), rel=1e-3)


def test_clicking_a_point_shows_its_arm(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    number = isolated(tab, history)
    tab.page.mouse.click(*place_of(tab, number))
    assert tab.ask("armwright.state.design") == number
    assert tab.text("#arm-title").startswith(f"#{number} ")
    arm, evaluation = history.member(number).arm, history.evaluation([number])
    for target in (0, 4):
        tab.ask(f"armwright.set({{ target: {target} }}); armwright.drawArm()")
        drawn = tab.centres("joint")
        assert drawn == pytest.approx(joint_positions(arm, evaluation.q[0, target]), abs=1e-5)
    assert f"#design={number}&target=5" in tab.page.url
    front = {member.number for member in history.front}
    tab.ask(f"armwright.set({{ design: {next(n for n in range(50) if n not in front)} }})")
    assert tab.page.get_by_role("button", name="URDF").is_disabled()
    assert tab.page.get_by_role("button", name="CSV").is_enabled()


def check_postures(tab: Tab, history: History, number: int) -> list[dict[str, Any]]:
    """Compare what the page says of a design at its targets with the kernels."""
    told, evaluation = tab.ask(f"armwright.postures({number})"), history.evaluation([number])
    assert [one["error"] for one in told] == pytest.approx(evaluation.position_error[0], abs=1e-5)
    if number in {member.number for member in history.front}:
        torques = np.array([one["torques"] for one in told])
        assert torques == pytest.approx(evaluation.joint_torques[0], abs=1e-4 * np.abs(torques).max())
        assert [bool(one["reason"]) for one in told] == evaluation.unreached[0].tolist()
    return list(told)


def test_page_kinematics_match_the_kernels(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    for number in (0, 17, 40, history.front[0].number):
        check_postures(tab, history, number)


def test_page_kinematics_count_tool_and_payload(tmp_path: Path, tab: Tab) -> None:
    tool = {"tip": [0.02, -0.03, 0.1], "rpy": [0.4, -0.3, 2.0], "mass": 0.7, "center": [0.03, 0.0, 0.1]}
    content = {"name": "handling", "targets": [[0.3, 0.1, 0.2], {"position": [0.1, 0.3, 0.3], "axis": [0, 0, -1]}]}
    content |= {"tool": tool, "payload": {"mass": 0.5, "center": [0.05, 0.0, 0.03], "size": [0.06, 0.04, 0.06]}}
    problem = aw.Problem(aw.Task.model_validate(content), aw.DesignSpace(mount=("floor", "ceiling", "wall+y")))
    aw.optimize(problem, proposer="none", n_init=4, n_total=4, out=tmp_path / "run")
    tab.open(write_report(tmp_path / "run"))
    _, history = aw.read_run(tmp_path / "run")
    assert tab.faults == []
    for number in range(len(history)):
        angle = check_postures(tab, history, number)[1]["angle"]
        assert angle == pytest.approx(history.evaluation([number]).angle_error[0, 1], abs=1e-4)


def test_address_stepper_and_comparison_agree(run: Path, tab: Tab) -> None:
    tab.open(run / "report.html", "#design=12&target=9")
    assert tab.ask("[armwright.state.design, armwright.state.target]") == [12, 8]
    tab.page.locator("#next").click()
    assert tab.text("#target-note").startswith("Target 1 of 9")
    for key in ("ArrowRight", "ArrowRight", "ArrowLeft"):
        tab.page.keyboard.press(key)
    assert tab.text("#target-note").startswith("Target 2 of 9")
    assert tab.page.locator("#postures tr.chosen td").first.inner_text() == "2"
    tab.page.get_by_role("button", name="Compare").click()
    tab.page.evaluate("location.hash = '#design=20&target=3'")
    tab.page.get_by_text("Target 3 of 9").wait_for()
    assert tab.text("#compare") == "Beside #12 ✕"
    assert tab.page.locator("#ring-compared").get_attribute("style").count("translate") == 1
    tab.page.locator("#compare").click()
    assert tab.ask("armwright.state.compared") is None
    tab.page.goto("about:blank")
    tab.open(run / "report.html", "#design=99999&target=<script>")
    assert tab.ask("armwright.content.head.front.includes(armwright.state.design)")
    assert tab.faults == []


def test_slider_shows_earlier_iterations(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    tab.page.locator("#iteration").fill("14")
    assert tab.text("#iteration-value") == "14"
    shown = tab.ask("document.getElementById('pareto').data.flatMap((trace) => trace.customdata ?? [])")
    assert sorted(shown) == list(range(10 + 14))
    line = tab.ask(
        "(({x, y}) => [x, y])(document.getElementById('pareto').data.find((t) => t.name === 'Pareto front'))"
    )
    values = history.values[:24]
    front = [n for n in front_indices(values) if np.all(values[n] < 5.0)]
    assert sorted({*line[0]} - {5.0}) == pytest.approx(sorted(values[front, 0]))
    tab.page.locator("#marks button").last.click()
    assert tab.text("#iteration-value") == "40"


def test_downloaded_files_load(run: Path, tab: Tab, history: History) -> None:
    number = history.front[0].number
    tab.open(run / "report.html", f"#design={number}")
    files = {}
    for name in ("URDF", "MJCF", "CSV"):
        with tab.page.expect_download() as download:
            tab.page.get_by_role("button", name=name).click()
        files[name] = (download.value.suggested_filename, Path(download.value.path()).read_text(encoding="utf-8"))
    assert files["URDF"][0] == f"target-2-{number}.urdf"
    assert files["URDF"][1] == (run / "designs" / f"{number:04d}" / "arm.urdf").read_text(encoding="utf-8")
    robot = yourdfpy.URDF.load(io.StringIO(files["URDF"][1]))
    assert len(robot.actuated_joints) == 4
    assert mujoco.MjModel.from_xml_string(files["MJCF"][1]).njnt == 4
    rows = list(csv.DictReader(files["CSV"][1].splitlines()))
    evaluation = history.evaluation([number])
    assert [float(row["q_2"]) for row in rows] == pytest.approx(evaluation.q[0, :, 1].tolist(), abs=1e-6)
    assert [float(row["position_error"]) for row in rows] == pytest.approx(evaluation.position_error[0], abs=1e-5)


def test_infeasible_designs_are_hollow_and_list_violations(tmp_path: Path, tab: Tab) -> None:
    task = aw.load_task("target-2").model_copy(update={"constraints": ("worst_error <= 0.4", "length >= 0.5")})
    history = aw.optimize(aw.Problem(task=task), proposer="none", n_total=30, seed=1, out=tmp_path / "run").history
    tab.open(write_report(tmp_path / "run"))
    infeasible = np.flatnonzero(~history.feasible).tolist()
    assert infeasible
    assert history.front
    drawn = (
        "pareto.data.filter((t) => t.marker?.symbol === 'circle-open').map((t) => [t.name, Array.from(t.customdata)])"
    )
    assert tab.ask(drawn) == [["infeasible", infeasible]]
    assert f"infeasible {len(infeasible)}" in tab.text("#facts")
    numbers = [int(text) for text in tab.page.locator("#table tbody tr td:first-child").all_inner_texts()]
    assert numbers == [member.number for member in history.front]
    worst = max(infeasible, key=lambda number: history.violations[number, 0])
    tab.ask(f"armwright.set({{ design: {worst} }})")
    error = history.evaluation([worst]).position_error.max()
    assert f"Infeasible; worst_error <= 0.4: {error:.4g} m (violated); length >= 0.5: " in tab.text("#design-summary")
    tab.ask(f"armwright.set({{ design: {numbers[0]} }})")
    assert "Feasible; worst_error <= 0.4: " in tab.text("#design-summary")
    assert asked(tab, "worst_error<=0.35") == picked(tmp_path / "run", "worst_error<=0.35")
    assert tab.faults == []


def test_table_sorts_and_selects_by_keyboard(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    numbers = [int(text) for text in tab.page.locator("#table tbody tr td:first-child").all_inner_texts()]
    assert numbers == [member.number for member in history.front]  # by rising position error
    tab.page.locator("#table th button", has_text="Torque").click()
    torques = [float(text) for text in tab.page.locator("#table tbody tr td:nth-child(4)").all_inner_texts()]
    assert torques == sorted(torques)
    tab.page.locator("#table th button", has_text="Torque").click()
    first, second = tab.page.locator("#table tbody tr").all()[:2]
    first.focus()
    tab.page.keyboard.press("ArrowDown")
    assert tab.ask("armwright.state.design") == int(second.get_attribute("data-design"))
    assert second.get_attribute("aria-current") == "true"
    robust = set(json.loads((run / "summary.json").read_text(encoding="utf-8"))["verification"]["robust_numbers"])
    for row in tab.page.locator("#table tbody tr").all():
        verdict = "robust" if int(row.get_attribute("data-design")) in robust else "sensitive"
        assert verdict in row.inner_text()


def asked(tab: Tab, where: str = "", by: str = "the knee", holds: bool = False) -> list[int]:
    """The designs of the table, in its order, after a query was typed in."""
    page = tab.page
    page.locator("#pick-where").fill(where)
    page.locator("#pick-by").select_option(label=by)
    page.locator("#pick-holds").set_checked(holds)
    page.get_by_role("button", name="Pick", exact=True).click()
    return [int(text) for text in page.locator("#table tbody tr td:first-child").all_inner_texts()]


def picked(run: Path, *conditions: str, **wishes: Any) -> list[int]:
    """The same of `armwright pick`."""
    _, members, _ = pick_from(run, [read_condition(condition) for condition in conditions], **wishes)
    return [member.number for member in members]


def test_page_pick_matches_the_pick_command(run: Path, tab: Tab) -> None:
    tab.open(run / "report.html")
    assert tab.ask("armwright.state.design") == picked(run)[0]  # it begins with the knee
    assert asked(tab) == picked(run)
    assert asked(tab, by="least torque") == picked(run, by="torque")
    where = ("position_error<=2", " length < .6")
    assert asked(tab, ",".join(where), by="least mass") == picked(run, *where, by="mass")
    assert asked(tab, holds=True) == picked(run, holds=True)
    assert asked(tab, "origin_z >= 1e-2") == picked(run, "origin_z>=0.01")
    last = asked(tab, "torque < 4.5", by="least mass")
    assert last == picked(run, "torque<4.5", by="mass")
    assert tab.ask("armwright.state.design") == last[0]
    assert tab.text("#pick-message").endswith('armwright pick RUN --where "torque<4.5" --by mass')
    tab.page.get_by_role("button", name="Show all").click()
    assert tab.page.locator("#table tbody tr").count() == len(picked(run))


def test_page_pick_explains_empty_results(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    before = tab.page.locator("#table tbody tr").count()
    asked(tab, "torque<100, position_error<=1e-6")
    least = float(re.findall(r"the nearest has ([\d.]+)\.", tab.text("#pick-message"))[0])
    assert least == pytest.approx(min(member.values[0] for member in history.front), rel=1e-3)
    for where, message in (("mas<2", 'Unknown quantity "mas"'), ("torque", "such as mass<=2.5")):
        asked(tab, where)
        assert message in tab.text("#pick-message")
    assert tab.page.locator("#table tbody tr").count() == before
    assert tab.faults == []


def test_page_works_without_webgl(run: Path, tab: Tab, history: History) -> None:
    tab.context.add_init_script(
        "HTMLCanvasElement.prototype.getContext = new Proxy(HTMLCanvasElement.prototype.getContext, "
        "{ apply: (f, canvas, said) => (String(said[0]).includes('webgl') ? null : Reflect.apply(f, canvas, said)) })"
    )
    tab.open(run / "report.html")
    assert "shows no 3D graphics" in tab.text("#arm")
    number = isolated(tab, history)
    tab.page.mouse.click(*place_of(tab, number))
    assert tab.text("#design-title").startswith(f"#{number} ")
    tab.page.locator("#next").click()
    assert tab.text("#target-note").startswith("Target 2 of 9")


def test_transcript_states_what_was_predicted_of_a_screened_proposal(tmp_path: Path, tab: Tab) -> None:
    folder = Path(shutil.copytree(a_run(), tmp_path / "run"))
    trials = [json.loads(line) for line in (folder / "trials.jsonl").read_text(encoding="utf-8").splitlines()]
    screened = next(trial for trial in trials if trial["proposal"])  # as if the screen had left it out
    number, id_ = screened["number"], screened["proposal"]
    screened |= {"screened": {"source": "llm", "proposal": id_, "gain": 0.02, "predicted": [0.5, 12.0]}}
    screened |= {"source": "bbo", "proposal": None}
    del screened["reason"]
    (folder / "trials.jsonl").write_text("".join(json.dumps(trial) + "\n" for trial in trials), encoding="utf-8")
    tab.open(write_report(folder), f"#design={number}")
    assert f"{id_} was not evaluated: predicted position error 0.5 m, torque 12 N m" in tab.text("#transcript")
    assert tab.page.locator("#transcript .call").count() >= 1
    assert tab.faults == []


def test_any_two_of_three_objectives_are_shown(tmp_path: Path, tab: Tab) -> None:
    task = aw.load_task("target-1").model_copy(
        update={
            "name": "three",
            "objectives": ("position_error", "torque", "length"),
            "reference_point": (5.0, 5.0, 1.0),
        }
    )
    run = aw.optimize(aw.Problem(task=task), proposer="none", n_init=6, n_total=20, out=tmp_path / "run")
    tab.open(write_report(tmp_path / "run"))
    assert tab.page.locator("#table tbody tr").count() == len(run.front)
    tab.page.locator("#y-axis").select_option(label="Length")
    drawn = tab.ask(
        "pareto.data.flatMap((trace) => (trace.customdata ?? []).map((n, k) => [n, trace.x[k], trace.y[k]]))"
    )
    for number, x, y in drawn:
        assert (x, y) == pytest.approx(run.history.values[int(number), [0, 2]])
    assert len(drawn) == 26
    assert tab.ask("pareto.layout.yaxis.title.text") == "Length [m]"
    assert tab.faults == []


@pytest.mark.slow
def test_report_without_trials_is_refused(run: Path, tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text((run / "config.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(RunFolderError, match="nothing to report"):
        write_report(tmp_path)
    with pytest.raises(RunFolderError, match="not a run folder"):
        write_report(tmp_path / "nowhere")


def test_unfinished_run_is_shown(run: Path, tmp_path: Path, tab: Tab) -> None:
    lines = (run / "trials.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "config.yaml").write_text((run / "config.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "trials.jsonl").write_bytes(b"".join(lines[:20]) + lines[20][:30])
    tab.open(write_report(tmp_path))
    assert "unfinished" in tab.text("#facts")
    assert tab.ask("armwright.content.n") == 20
