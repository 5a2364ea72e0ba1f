"""Custom parameters that nothing reads: they do not change the arm, and no built-in objective depends on them."""

from collections.abc import Iterator

from armwright.exceptions import SettingsError
from armwright.problem.checks.finding import SUSPECTED, Finding
from armwright.problem.problem import Problem


def check_custom_parameters(problem: Problem) -> Iterator[Finding]:
    """Find custom parameters of a problem without an evaluator."""
    names = _unread(problem)
    if names:
        yield Finding(
            f"parameters {', '.join(names)}: only an evaluator reads them; try armwright optimize --evaluator",
            SUSPECTED,
        )


def refuse_unread_parameters(problem: Problem) -> None:
    """Raise SettingsError if a search would vary custom parameters that no objective depends on."""
    names = _unread(problem)
    if names:
        raise SettingsError(
            f"space {problem.space.name}: no built-in objective depends on the parameters {', '.join(names)}; try "
            "armwright optimize with --evaluator FILE.py:FUNCTION, or a space without them"
        )


def _unread(problem: Problem) -> list[str]:
    return [] if problem.evaluator is not None else [name for name, _ in problem.space.custom]
