"""The reference point that a direct search chooses, and the hypervolumes that it bounds."""

import moocore
import numpy as np
import pytest

import armwright as aw
from armwright.problem.outcomes import Outcomes
from armwright.problem.problem import Problem
from armwright.study.front.reference_survey import ReferenceSurvey

TASK = aw.Task.model_validate(
    {
        "name": "near",
        "targets": [[0.3, 0.1, 0.2]],
        "objectives": ["mass", "torque"],
        "constraints": ["worst_error <= 1"],
    }
)


@pytest.mark.parametrize("size", [1, 37])
def test_history_is_that_of_all_feasible_designs(size: int) -> None:
    """Compare with moocore at the end of each chunk of designs."""
    rng = np.random.default_rng(size)
    values, violations = rng.uniform(size=(600, 2)), rng.uniform(-1.0, 1.0, (600, 1))
    survey, point = ReferenceSurvey(Problem(TASK), seed=0), (0.9, 0.8)
    for start in range(0, len(values), size):
        chunk = slice(start, start + size)
        survey.add(Outcomes(values[chunk], violations[chunk]))
        numbers, volumes = np.array([(0, 0.0), *survey.history(point)]).T
        assert (np.diff(numbers) > 0).all()
        feasible = values[: start + size][violations[: start + size, 0] <= 0.0]
        expected = moocore.hypervolume(feasible, ref=point) if len(feasible) else 0.0
        assert volumes[-1] == pytest.approx(expected)


def test_no_hypervolume_is_reported_before_its_reference_point_is_chosen() -> None:
    reported = list[float | None]()
    run = aw.find_front(Problem(TASK), evaluations=4000, watch=lambda progress: reported.append(progress.hypervolume))
    n_unknown = reported.index(next(volume for volume in reported if volume is not None))
    assert n_unknown > 0
    assert None not in reported[n_unknown:]
    evaluations, volumes = np.array(run.summary["search"]["hypervolume_history"]).T
    assert evaluations[0] < 100
    assert (np.diff(volumes) >= -1e-12).all()
    assert volumes[-1] == pytest.approx(run.summary["hypervolume"]["final"])
    short = aw.find_front(Problem(TASK), evaluations=500)  # too few for a final point
    evaluations, volumes = np.array(short.summary["search"]["hypervolume_history"]).T
    assert len(volumes) > 3
    assert volumes[-1] == pytest.approx(short.summary["hypervolume"]["final"])


def test_designs_that_violate_constraints_are_not_counted_as_a_front() -> None:
    impossible = TASK.model_copy(update={"constraints": ("worst_error <= 1", "anisotropy <= 1e-9")})
    sizes = list[int]()
    aw.find_front(Problem(impossible), evaluations=1000, watch=lambda progress: sizes.append(progress.front_size))
    assert set(sizes) == {0}
