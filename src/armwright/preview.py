"""What would be sent to a model, without sending it."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, SettingsError
from armwright.history import History
from armwright.llm.answer import answer_schema, read_text
from armwright.llm.prompt import Prompt, estimated_tokens, load_prompt
from armwright.llm.transcript import Transcript
from armwright.problem import Problem
from armwright.proposers.asking import ANSWERS, LAST_STEPS, TRANSCRIPTS, Asking
from armwright.proposers.replay import recorded_asking
from armwright.run_folder import RunConfig, read_run
from armwright.seeding import derived_seed
from armwright.space import DesignSpace
from armwright.study import optimize
from armwright.task import Task
from armwright.turns import PROPOSING, Schedule


@dataclass(frozen=True)
class Preview:
    """A prompt for trial `number`, its length in tokens (estimated), and the JSON schema of the answer.

    note: what else will be in the prompt when it is really sent; empty where nothing will.
    """

    number: int
    prompt: str
    tokens: int
    schema: dict[str, Any]
    note: str = ""


def preview(problem: Problem, asking: Asking, *, n_init: int = 10, seed: int = 0) -> Preview:
    """The first prompt of a new run."""
    run = optimize(problem, proposer="none", n_init=n_init, n_total=1, seed=seed)
    return _rendered(run.history.before(n_init), n_init, seed, load_prompt(asking.prompt), asking, "llm")


def preview_after(
    run: Path,
    wishes: Mapping[str, Any],
    *,
    task: Task | None = None,
    space: DesignSpace | None = None,
    number: int | None = None,
) -> Preview:
    """The prompt for the next proposal of a run, asked for as the run asks.

    wishes: fields of Asking that shall be others.
    task, space: where given, the run must be one of these.
    number: the prompt for this trial instead, as it was then.
    """
    config, history = read_run(run)
    if task is not None and task.targets != config.task.targets:
        raise SettingsError(f"{run} is a run of another task: {config.task.name}")
    if space is not None and space != config.space:
        raise SettingsError(f"{run} is a run of another space: {config.space.name}")
    own, asking = recorded_asking(config)
    asking = replace(asking, **wishes)
    prompt = load_prompt(asking.prompt) if own is None or "prompt" in wishes else own
    name = (config.method.proposer or {}).get("name", "llm") if "prompt" in (config.method.proposer or {}) else "llm"
    asked = _asked(run)
    if number is not None:
        return _rendered(_then(run, config, history, asked, number), number, config.seed, prompt, asking, name)
    number, note = _next(config, history, asked, _unused(run, history, asking.proposals))
    return replace(_rendered(history, number, config.seed, prompt, asking, name), note=note)


def _rendered(history: History, number: int, seed: int, prompt: Prompt, asking: Asking, name: str) -> Preview:
    form = ANSWERS[asking.answer]
    text = prompt.render(
        history,
        derived_seed(seed, PROPOSING, number),
        memory=asking.memory,
        name=name,
        proposals=asking.proposals,
        form=form,
    )
    schema = answer_schema(
        history.problem, reasoning=form == "schema", expected=asking.memory == "own", proposals=asking.proposals
    )
    return Preview(number, text, estimated_tokens(text), schema)


def _asked(run: Path) -> dict[int, int]:
    """The trials that proposals were asked for, and how many finished trials were known then."""
    calls = Transcript(run / TRANSCRIPTS, read_only=True).calls
    return {int(call.proposal.rpartition("-")[2]): call.known for call in calls if call.proposal}


def _unused(run: Path, history: History, proposals: int) -> int:
    """Designs of earlier calls that are still to be evaluated."""
    used = {trial.proposal for trial in history}
    found: set[str] = set()
    for call in Transcript(run / TRANSCRIPTS, read_only=True).calls:
        if call.step in LAST_STEPS and call.fault is None:
            with suppress(DesignError):
                n = len(read_text(call.answer, history.problem, proposals))
                found |= {call.proposal} if n == 1 else {f"{call.proposal}.{i}" for i in range(1, n + 1)}
    return len(found - used)


def _then(run: Path, config: RunConfig, history: History, asked: Mapping[int, int], number: int) -> History:
    """What was known when a past proposal was asked for."""
    schedule = _schedule(config)
    if asked:
        if number in asked:
            return history.before(asked[number])
        numbers = ", ".join(map(str, sorted(asked)))
    else:  # a run without a model: as a model would have been asked
        if schedule.begins_block(number) and number <= len(history):
            return history.before(number)
        there = [n for n in range(len(history) + 1) if schedule.begins_block(n)]
        numbers = ", ".join(map(str, there[:6])) + (f", … {there[-1]}" if len(there) > 6 else "")
    raise SettingsError(f"--number {number}: the proposals of {run} were asked for trials {numbers}")


def _next(config: RunConfig, history: History, asked: Mapping[int, int], unused: int) -> tuple[int, str]:
    """The trial that will be asked for next, and what comes before it."""
    schedule = _schedule(config)
    number = next(n for n in count(max(len(history), schedule.n_init)) if schedule.begins_block(n))
    if config.method.in_flight is not None:  # asked ahead of its trial
        number = next(n for n in count(number, schedule.n_step) if n not in asked)
    number += unused * schedule.n_step
    before = number - len(history)
    if not before:
        return number, ""
    trials = "1 trial comes" if before == 1 else f"{before} trials come"
    designs = f", {unused} of them of the calls so far" if unused else ""
    return number, f"{trials} before it{designs}, and will be in it"


def _schedule(config: RunConfig) -> Schedule:
    return Schedule(config.method.n_init, config.method.n_step, config.method.n_total)
