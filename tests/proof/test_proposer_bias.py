"""Proposer bias: bases on symmetry planes."""

from armwright.problem.problem import Problem
from armwright.proof.proposer_bias import proposer_bias
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
    assert (found.proposer, found.black_box) == (0.75, 0.5)


def test_asymmetric_targets_have_no_bases_on_symmetry_planes() -> None:
    found = proposer_bias(history([("rules", design())], WITHOUT_SYMMETRY), "rules")
    assert (found.proposer, found.black_box) == (None, None)


def test_uniform_designs_have_no_bias() -> None:
    drawn = TARGET_2.space.sample(300, 0)
    found = proposer_bias(history([("bbo", d) for d in drawn]), "rules")
    assert (found.proposer, found.black_box) == (None, 0.0)
