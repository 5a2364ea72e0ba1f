"""Content of the figures, and figures of unusual runs."""

from pathlib import Path

import numpy as np
import pytest

from armwright.exceptions import RunFolderError
from armwright.pictures.arm_figures import draw_arm, draw_arms
from armwright.pictures.figures import chosen_members, draw_hypervolume, draw_samples, write_figures
from armwright.pictures.style import line
from armwright.problem.problem import Problem
from armwright.proof.design_record import compute_records
from armwright.spaces.design_space import paper_space
from armwright.study.progress import Progress, StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from armwright.tasks.task import Task


def short(out: Path, problem: Problem, n_total: int = 12) -> StudyResult:
    return optimize(problem, proposer="rules", n_init=4, n_step=4, n_total=n_total, out=out)


@pytest.mark.slow
@pytest.mark.parametrize(
    "task",
    [
        Task(name="far", targets=((2.1, 0.0, 0.0),), reference_point=(0.01, 0.01)),
        Task(name="same", targets=((0.3, 0.1, 0.2),) * 40),
    ],
)
def test_unusual_tasks_are_drawn(tmp_path: Path, task: Task) -> None:
    history = short(tmp_path, Problem(task), n_total=1).history
    assert write_figures(tmp_path)
    assert draw_samples(history).axes
    for title, member in chosen_members(history):
        assert draw_arm(history, title, member, compute_records(history, [member.number])).axes


@pytest.mark.slow
def test_arms_along_a_cycle_are_drawn_within_the_axes(tmp_path: Path) -> None:
    task = Task.model_validate(
        {
            "name": "from-above",
            "targets": [{"position": [0.3, y, 0.1], "axis": [0, 0, -1]} for y in (-0.05, 0.05)],
            "cycle": {"time": 1.0, "approach": 0.9, "steps": [{"to": 1, "do": "pick"}, {"to": 2, "do": "place"}]},
        }
    )
    history = short(tmp_path, Problem(task), n_total=30).history
    chosen = chosen_members(history)
    records = compute_records(history, [member.number for _, member in chosen])
    for axes in draw_arms(history, chosen, records).axes:
        low, high = np.transpose([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])  # type: ignore[attr-defined]
        for drawn in axes.lines:
            points = np.transpose(drawn.get_data_3d())  # type: ignore[attr-defined]
            assert (low <= points).all()
            assert (points <= high).all()


@pytest.mark.slow
def test_legend_of_arms_lists_what_is_drawn() -> None:
    missed = set[bool]()
    for by in ("line", "joint"):
        steps = [{"to": 1}, {"to": 2, "by": by}]
        targets = ((0.3, 0.0, 0.2), (0.2, 0.2, 0.2))
        task = Task.model_validate({"name": "two", "targets": targets, "cycle": {"time": 1.0, "steps": steps}})
        problem = Problem(task, paper_space(joints=5))
        history = optimize(problem, proposer="none", n_init=20, n_total=20, verify=False).history
        for number in (history.values[:, 0].argmin(), history.values[:, 0].argmax()):
            figure = draw_arm(history, "arm", history.member(int(number)), compute_records(history, [int(number)]))
            labels = [text.get_text() for text in figure.legends[0].get_texts()]
            assert ("line of the cycle" in labels) == (by == "line")
            missed.add("missed by" in labels)
            assert ("missed by" in labels) == history.evaluation([int(number)]).unreached.any()
    assert missed == {False, True}


def test_chosen_members_are_the_ends_of_the_front_and_of_its_part_in_the_box(tmp_path: Path) -> None:
    tight = load_task("target-1").model_copy(update={"reference_point": (5.0, 2.5)})
    history = short(tmp_path, Problem(tight), n_total=40).history
    chosen = dict(chosen_members(history))
    inside = [m for m in history.front if m.values[0] < 5.0 and m.values[1] < 2.5]
    assert chosen["Solution 1: least position error"] == inside[0]
    assert chosen["Solution 2: least torque"] == inside[-1]
    assert inside[0] != history.front[0]
    assert chosen["Least position error of all, beyond the reference point"] == history.front[0]


def test_hypervolume_curve_spans_random_trials_to_final_value(tmp_path: Path) -> None:
    run = short(tmp_path, Problem(load_task("target-1")))
    line = draw_hypervolume(run.history).axes[0].lines[0]
    assert len(line.get_xdata()) == 13
    assert line.get_ydata()[-1] == run.hypervolume[-1]


def test_figures_without_all_random_trials_are_refused(tmp_path: Path) -> None:
    def stop(progress: Progress) -> None:
        if progress.number == 1:
            raise KeyboardInterrupt

    problem = Problem(Task(name="open", targets=((0.3, 0.1, 0.2),)))
    with pytest.raises(KeyboardInterrupt):
        optimize(problem, proposer="none", n_init=4, n_total=4, out=tmp_path, watch=stop)
    with pytest.raises(RunFolderError, match="has only 2 so far"):
        write_figures(tmp_path)


def test_lines_of_many_methods_differ() -> None:
    lines = [line(number) for number in range(40)]
    assert len({(each.colour, each.pattern) for each in lines}) == len(lines)
