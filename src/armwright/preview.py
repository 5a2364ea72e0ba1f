"""What would be sent to a model, without sending it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armwright.exceptions import SettingsError
from armwright.history import History
from armwright.llm.answer import answer_schema
from armwright.llm.prompt import estimated_tokens, load_prompt
from armwright.problem import Problem
from armwright.proposers.asking import ANSWERS, Asking
from armwright.run_folder import read_run
from armwright.seeding import derived_seed
from armwright.study import optimize
from armwright.turns import PROPOSING, Schedule


@dataclass(frozen=True)
class Preview:
    """A prompt for trial `number`, its length in tokens (estimated), and the JSON schema of the answer."""

    number: int
    prompt: str
    tokens: int
    schema: dict[str, Any]


def preview(
    problem: Problem,
    asking: Asking,
    *,
    after: Path | None = None,
    number: int | None = None,
    n_init: int = 10,
    seed: int = 0,
) -> Preview:
    """The prompt for the next proposal of the run `after`, or for the first one of a new run.

    number: the prompt for this trial of the run instead, as it was then.
    """
    history, number, run_seed = _standing(problem, after, number, n_init, seed)
    form = ANSWERS[asking.answer]
    prompt = load_prompt(asking.prompt).render(
        history,
        derived_seed(run_seed, PROPOSING, number),
        memory=asking.memory,
        proposals=asking.proposals,
        form=form,
    )
    schema = answer_schema(
        problem, reasoning=form == "schema", expected=asking.memory == "own", proposals=asking.proposals
    )
    return Preview(number, prompt, estimated_tokens(prompt), schema)


def _standing(
    problem: Problem, after: Path | None, number: int | None, n_init: int, seed: int
) -> tuple[History, int, int]:
    """The finished trials that the prompt is made from, the trial that it is for, and the run's seed."""
    if after is None:
        if number is not None:
            raise SettingsError(f"--number {number} goes with --after RUN")
        run = optimize(problem, proposer="none", n_init=n_init, n_total=1, seed=seed)
        return run.history.before(n_init), n_init, seed
    config, history = read_run(after)
    if (config.task.targets, config.space) != (problem.task.targets, problem.space):
        raise SettingsError(f"{after} is a run of another task or space: {config.task.name}, space {config.space.name}")
    schedule = Schedule(config.method.n_init, config.method.n_step, config.method.n_total)
    if number is None:
        number = next(
            n
            for n in range(len(history), len(history) + schedule.n_step + schedule.n_init + 1)
            if schedule.begins_block(n)
        )
        return history, number, config.seed
    if not schedule.begins_block(number) or number > len(history):
        raise SettingsError(
            f"--number {number}: proposals of this run are for trials {schedule.n_init}, "
            f"{schedule.n_init + schedule.n_step}, …, up to {len(history)}"
        )
    return history.before(number), number, config.seed
