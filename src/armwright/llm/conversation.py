"""The conversation of a run with `memory: chat`, rebuilt from its transcript, so that nothing is stored twice."""

from collections.abc import Iterable, Sequence

from armwright.llm.backend import Turn
from armwright.llm.transcript import FIRST_STEPS, LAST_STEPS, Call
from armwright.text import without_thoughts

RESULTS = "# Results so far"  # heading in a prompt; all that changes from question to question stands below it


def conversation(calls: Iterable[Call], trial: int | None = None) -> tuple[Turn, ...]:
    """Return the turns before the question for a trial; None: before the next question.

    A turn is the prompt of a proposal with all of its answers. Of a proposal in two steps these are the reasoning and
    the values that came of it: the second prompt only repeats the reasoning, but its answer holds what was evaluated,
    after corrections if the reasoning ended with an invalid design. A proposal without a design is no turn.

    Each time the prompt of a proposal was refused as too long, the older half of the turns is dropped. Half at a time
    keeps the beginning of the conversation the same over several questions, so that it can be cached. The first turn
    stays, because its question describes the problem.
    """
    asked: dict[str, Call] = {}
    turns: dict[str, Turn] = {}
    for call in calls:
        if not call.proposal or (trial is not None and call.trial > trial):
            continue
        if call.fault == "context" and call.step in FIRST_STEPS:
            for proposal in list(turns)[1 : len(turns) // 2 + 1]:
                del turns[proposal]
        if call.fault is not None or call.trial == trial:
            continue
        if call.step in FIRST_STEPS:
            asked[call.proposal] = call
        if call.step in LAST_STEPS and call.proposal in asked:
            first = asked[call.proposal]
            reasoning = without_thoughts(first.answer).strip()
            answer = call.answer if first is call else f"{reasoning}\n\n{call.answer}".lstrip()
            turns[call.proposal] = Turn(first.prompt, answer)
    return tuple(turns.values())


def new_part(prompt: str, turns: Sequence[Turn]) -> str:
    """Return the part of a prompt that the turns do not contain.

    It begins with RESULTS, unless the latest full prompt describes the problem in another way; it may list other
    targets, to which the results then refer.
    """
    problem, heading, results = prompt.rpartition(f"\n{RESULTS}\n")
    latest = next((turn.question for turn in reversed(turns) if not turn.question.startswith(RESULTS)), "")
    return f"{RESULTS}\n{results}" if heading and latest.startswith(problem + heading) else prompt
