"""What the objectives and constraints of a problem require of its task and space, found without evaluating a design."""

from armwright.exceptions import SettingsError
from armwright.problem.problem import Problem

N_SAMPLES = 64  # designs whose motors are looked at


def check_requirements(problem: Problem) -> None:
    """Raise SettingsError if a quantity needs actuators, sections, a cycle or a workspace that the problem lacks."""
    arms = problem.arms(problem.space.matrix(problem.space.sample(N_SAMPLES, seed=0)))
    for quantity in problem.quantities:
        quantity.check(problem.scenes[0], arms)


def refuse_unread_parameters(problem: Problem) -> None:
    """Raise SettingsError if a search would vary custom parameters that no objective depends on."""
    names = [name for name, _ in problem.space.custom]
    if names and problem.evaluator is None:
        raise SettingsError(
            f"space {problem.space.name}: no built-in objective depends on the parameters {', '.join(names)}; try "
            "armwright optimize with --evaluator FILE.py:FUNCTION, or a space without them"
        )
