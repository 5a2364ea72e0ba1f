"""Proposer bias: round lengths, bases on symmetry planes, repeated joint types."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armwright.problem.problem import Problem
from armwright.proof.proposer_bias import are_round, proposer_bias
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.spaces.parameters import Design
from armwright.tasks.catalogue import load_task, random_task

TARGET_2 = Problem(load_task("target-2"))  # symmetric about y = 0, x = 0.5 and its own z = 0.5
WITHOUT_SYMMETRY = Problem(random_task(0))


def design(
    origin: tuple[float, float, float] = (0.11, 0.12, 0.13),
    joints: str = "YPPR",
    links: tuple[float, ...] = (0.1, 0.15, 0.2, 0.25),
) -> Design:
    return TARGET_2.space.clipped(origin, joints, links)


def history(designs: list[tuple[str, Design]], problem: Problem = TARGET_2, n_init: int = 0) -> History:
    return History(problem, [FinishedTrial(i, s, d, (1.0 + i, 2.0)) for i, (s, d) in enumerate(designs)], n_init)


@given(st.lists(st.integers(1, 60), min_size=1, max_size=8))
def test_multiples_of_a_step_count_as_round(steps: list[int]) -> None:
    assert are_round([n * 0.05 for n in steps], 0.05)
    assert are_round([sum([0.05] * n) for n in steps], 0.01)
    assert are_round([n / 20 + 9e-10 for n in steps], 0.05)
    assert not are_round([*(n / 20 for n in steps), 0.1 + 2e-9], 0.05)
    assert not are_round([*(n / 20 for n in steps), 0.11], 0.05)
    assert are_round([*(n / 20 for n in steps), 0.11], 0.01)


def test_proposer_bias_is_compared_with_the_black_box() -> None:
    past = history(
        [
            ("random", design(links=(0.1, 0.1, 0.1, 0.1))),
            ("rules", design(origin=(0.3, 0.0, 0.2))),  # on y = 0
            ("bbo", design(origin=(0.3, 0.01, 0.2), links=(0.11, 0.12, 0.13, 0.14))),
            ("rules", design(origin=(0.5, 0.3, 0.2), links=(0.11, 0.2, 0.2, 0.2))),  # on x = 0.5
            ("rules", design(origin=(0.2, 2e-6, 0.2), links=(0.111, 0.2, 0.2, 0.2))),
            ("rules", design(origin=(0.2, 9e-7, 0.2), links=(0.111, 0.2, 0.2, 0.2))),
            ("bbo", design(origin=(0.3, 0.0, 0.2))),
        ]
    )
    found = proposer_bias(past, "rules")
    assert found.proposer is not None
    assert found.black_box is not None
    assert (found.proposer.lengths_5_cm, found.black_box.lengths_5_cm) == (0.25, 0.5)
    assert (found.proposer.lengths_1_cm, found.black_box.lengths_1_cm) == (0.5, 1.0)
    assert (found.proposer.base_on_symmetry_plane, found.black_box.base_on_symmetry_plane) == (0.75, 0.5)
    assert found.black_box.equal_neighbours == pytest.approx(1 / 3), "of YPPR"


def test_asymmetric_targets_have_no_bases_on_symmetry_planes() -> None:
    found = proposer_bias(history([("rules", design())], WITHOUT_SYMMETRY), "rules")
    assert found.proposer is not None
    assert found.proposer.base_on_symmetry_plane is None
    assert found.black_box is None


@pytest.mark.parametrize(
    ("joints", "share"), [(("YYYY", "PPPP"), 1.0), (("YPRP", "RPYP"), 0.0), (("YYPR", "YYYR"), 0.5)]
)
def test_equal_neighbours_are_counted_over_all_designs(joints: tuple[str, ...], share: float) -> None:
    found = proposer_bias(history([("rules", design(joints=each)) for each in joints]), "rules")
    assert found.proposer is not None
    assert found.proposer.equal_neighbours == share


def test_uniform_designs_have_no_bias() -> None:
    drawn = TARGET_2.space.sample(300, 0)
    found = proposer_bias(history([("bbo", d) for d in drawn]), "rules")
    assert found.proposer is None
    assert found.black_box is not None
    assert (found.black_box.lengths_1_cm, found.black_box.base_on_symmetry_plane) == (0.0, 0.0)
    assert found.black_box.equal_neighbours == pytest.approx(1 / 3, abs=0.05)
