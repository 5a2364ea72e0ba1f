"""report.html plays the motion of designs through the cycle of their task."""

from pathlib import Path

import numpy as np
import pytest

import armwright as aw
from armwright.kinematics.arms.forward import joint_positions
from armwright.page.page import write_report
from armwright.runs.folder import read_run
from armwright.runs.history import FrontMember, History
from armwright.tasks.task import Task
from tests.support.browser import Tab

TASK = Task.model_validate(
    {
        "name": "cell",
        "targets": [[0.3, -0.2, 0.2], [0.3, 0.2, 0.2], [0.2, 0.0, 0.4]],
        "cycle": {
            "time": 0.4,
            "dwell": 0.2,
            "steps": [{"to": 1, "do": "pick"}, {"to": 2, "by": "line", "do": "place"}, {"to": 3}],
        },
        "reference_point": [5.0, 5.0],
    }
)
CYCLE_TIME = 3 * 0.4 + 2 * 0.2


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page-cycle") / "run"
    space = aw.paper_space(joints=5).model_copy(update={"origin_x": (0.0, 0.0), "origin_y": (0.0, 0.0)})
    aw.optimize(aw.Problem(TASK, space), proposer="rules", n_init=20, n_total=40, seed=1, out=folder)
    write_report(folder)
    return folder


@pytest.fixture
def history(run: Path) -> History:
    found = read_run(run)[1]
    assert found.front
    return found


def posture(history: History, number: int, motion: int, share: float) -> np.ndarray:
    """The joint values (J,) of a design at a share of a motion."""
    _, paths = history.evaluation([number]).paths.of_arm(0)
    return paths[motion].at(np.array([share]))[0, 0]


def check_posture(tab: Tab, history: History, member: FrontMember) -> None:
    """Assert that the arm is drawn in its posture at the current target."""
    q = history.evaluation([member.number]).q[0, tab.ask("armwright.state.target")]
    assert tab.centres("joint") == pytest.approx(joint_positions(member.arm, q), abs=1e-4)


def test_motion_in_time_follows_the_joint_path(run: Path, tab: Tab, history: History) -> None:
    tab.open(run / "report.html")
    held = tab.ask("Object.keys(armwright.content.head.cycles).map(Number)")
    assert sorted(held) == sorted(member.number for member in history.front)
    number = history.front[0].number
    # Half of a motion's time is half of the motion. The cycle: a line, a rest, two joint motions, a rest.
    for time, motion, share, target in (
        (0.0, 0, 0.0, 1), (0.2, 0, 0.5, 1), (0.5, 0, 1.0, 1), (0.8, 1, 0.5, 2), (1.2, 2, 0.5, 0), (1.5, 2, 1.0, 0),
        (CYCLE_TIME + 0.2, 0, 0.5, 1),
    ):  # fmt: skip
        at = tab.ask(f"armwright.during(armwright.content.head, {number}, {time})")
        assert at["q"] == pytest.approx(posture(history, number, motion, share), abs=6e-3)
        assert (at["target"], at["step"], at["moves"]) == (target, target + 1, share < 1.0)
    off_front = next(n for n in range(len(history)) if n not in {member.number for member in history.front})
    assert tab.ask(f"armwright.during(armwright.content.head, {off_front}, 0)") is None


def test_play_drives_the_arm_through_its_cycle(run: Path, tab: Tab, history: History) -> None:
    member = history.front[0]
    tab.open(run / "report.html", f"#design={member.number}&target=1")
    tab.ask("""(() => {
        window.seen = [];
        const middle = (part) => [0, 1, 2].map((k) => { const v = part.map((p) => p[k]);
            return (Math.min(...v) + Math.max(...v)) / 2; });
        requestAnimationFrame(function look() {
            seen.push([armwright.state.target, middle(armwright.drawn("joint").at(-1))]);
            if (seen.length < 1000) requestAnimationFrame(look);
        });
    })()""")
    tab.page.locator("#play").click()
    for target in (2, 3, 1):
        tab.page.get_by_text(f"To target {target} of 3").wait_for()
    tab.page.locator("#play").click()
    assert tab.text("#target-note").startswith("Target ")  # it shows the posture there
    assert tab.faults == []
    seen = tab.ask("seen")
    tips = np.array([tip for _, tip in seen])
    # On the line from the first target to the second, the tip neither rises nor leaves the plane x = 0.3.
    on_line = np.array([target == 1 for target, _ in seen])
    assert on_line.any()
    assert np.abs(tips[on_line][:, [0, 2]] - [0.3, 0.2]).max() < 5e-3
    check_posture(tab, history, member)


def test_selecting_another_design_while_playing_plays_its_motion(run: Path, tab: Tab, history: History) -> None:
    off_front = next(n for n in range(len(history)) if n not in {member.number for member in history.front})
    tab.open(run / "report.html", f"#design={off_front}&target=3")
    tab.page.locator("#play").click()  # from target to target: its motion is not in the page
    tab.page.get_by_text("Target 1 of 3").wait_for()
    tab.ask(f"armwright.set({{ design: {history.front[0].number} }})")
    for target in (2, 3, 1, 2):
        tab.page.get_by_text(f"Target {target} of 3").wait_for()
    assert tab.faults == []


def test_reduced_motion_steps_from_target_to_target(run: Path, tab: Tab, history: History) -> None:
    tab.page.emulate_media(reduced_motion="reduce")
    member = history.front[0]
    tab.open(run / "report.html", f"#design={member.number}&target=1")
    tab.page.locator("#play").click()
    tab.page.get_by_text("Target 2 of 3").wait_for()
    tab.page.locator("#play").click()
    check_posture(tab, history, member)
