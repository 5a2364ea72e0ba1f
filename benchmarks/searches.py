"""Our search on a problem and on sub-spaces of it, without run folder and clock, as benchmarks compare it."""

import itertools
from collections.abc import Iterator

from armwright.arrays import Array
from armwright.pareto import default_reference_point
from armwright.problem.problem import Problem
from armwright.search.front.front_search import FrontSearch
from armwright.search.front.screening import Screen, pays
from armwright.search.front.variation import offspring
from armwright.spaces.design_parameters import named_parameters
from armwright.spaces.design_space import DesignSpace
from armwright.spaces.parameters import CategoricalParameter
from armwright.study.front.direct_search import SHORT, SHORT_FIRST_BATCH


def new_search(problem: Problem, reference_point: tuple[float, ...], seed: int, screen: Screen | None) -> FrontSearch:
    """A search that has not begun; `screen` chooses its designs, if there is one."""

    def evaluate(matrix: Array) -> Array:
        outcomes = problem.evaluate(matrix)
        if screen is not None:
            screen.learn(matrix, outcomes)
        return outcomes.penalised

    vary = offspring if screen is None else screen.offspring
    return FrontSearch(problem.space.parameters, evaluate, reference_point, seed, vary=vary)


def searched(problem: Problem, reference_point: tuple[float, ...], seed: int, evaluations: int) -> FrontSearch:
    """Return a search after so many evaluations, screened and started as by `armwright design`."""
    screen = Screen(problem, lambda: reference_point) if pays(problem) else None
    search = new_search(problem, reference_point, seed, screen)
    if screen is not None and evaluations < SHORT:
        search.step(SHORT_FIRST_BATCH)
    while search.evaluations < evaluations:
        search.step()
    return search


def reference_point_of(problem: Problem) -> tuple[float, ...]:
    """The task's, else the one of ten random designs."""
    return problem.reference_point or default_reference_point(problem.evaluate(problem.space.sample(10, seed=0)).values)


def by_number(space: DesignSpace) -> Iterator[tuple[str, DesignSpace]]:
    """The arms of each number of joints, if there are several."""
    if space.min_joints < space.max_joints:
        for number in range(space.min_joints, space.max_joints + 1):
            yield str(number), restricted(space, {"n_joints": str(number)})


def by_sequence(space: DesignSpace) -> Iterator[tuple[str, DesignSpace]]:
    """The arms of each joint sequence."""
    parameters = named_parameters(space)
    for number in range(space.min_joints, space.max_joints + 1):
        joints = [parameters[f"joint_{j}"] for j in range(1, number + 1)]
        for types in itertools.product(*(p.choices for p in joints if isinstance(p, CategoricalParameter))):
            fixed = {parameter.name: letter for parameter, letter in zip(joints, types, strict=True)}
            yield (
                "".join(types),
                restricted(space, fixed | ({"n_joints": str(number)} if "n_joints" in parameters else {})),
            )


def restricted(space: DesignSpace, fixed: dict[str, str]) -> DesignSpace:
    return space.model_copy(update={"restrict": tuple((dict(space.restrict) | fixed).items())})
