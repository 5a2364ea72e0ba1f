"""What the objectives and constraints of a problem require of its task and space, found without evaluating a design."""

from armwright.problem.problem import Problem

N_SAMPLES = 64  # designs whose motors are looked at


def check_requirements(problem: Problem) -> None:
    """Raise SettingsError if a quantity needs actuators, sections, a cycle or a workspace that the problem lacks."""
    arms = problem.arms(problem.space.matrix(problem.space.sample(N_SAMPLES, seed=0)))
    for quantity in problem.quantities:
        quantity.check(problem.scenes[0], arms)
