"""What a language model's calls add to the time of a run, when they overlap with the black box's trials.

The server is a stand-in on 127.0.0.1 that answers after LATENCY seconds; nothing here says how good a model is.
"""

import json
import random
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from armwright.llm.model_options import ModelOptions

sys.path.insert(0, str(Path(__file__).parents[1]))

from armwright.problem.problem import Outcomes, Problem
from armwright.proposers.llm import LlmProposer
from armwright.spaces.parameters import Design
from armwright.study.progress import StudyResult
from armwright.study.study import optimize
from armwright.tasks.catalogue import load_task
from tests.support.chat_server import Answer, ChatServer, Request

LATENCY = 2.0  # [s] of a call
EVALUATION = 0.5  # [s] of a trial of the slow evaluator
GOAL = 1.1


class SlowProblem(Problem):
    """Evaluates like a simulation that takes its time."""

    def evaluate(self, designs: Sequence[Design]) -> Outcomes:
        time.sleep(EVALUATION * len(designs))
        return super().evaluate(designs)


def slow_designer(problem: Problem) -> ChatServer:
    """A server that thinks LATENCY seconds, and proposes at random."""
    rng = random.Random(0)

    def answer(request: Request) -> Answer:
        time.sleep(LATENCY)
        design = problem.space.sample(1, rng.randrange(2**31))[0]
        return json.dumps({**design.params, "reason": "by chance"}) if "response_format" in request else "so be it"

    server = ChatServer()
    server.answer = answer
    return server


def timed(problem: Problem, proposer: LlmProposer | str, n_total: int, **settings: int) -> tuple[float, StudyResult]:
    started = time.perf_counter()
    run = optimize(problem, proposer=proposer, n_total=n_total, **settings)
    return time.perf_counter() - started, run


def row(words: str, seconds: float, bound: float, run: StudyResult) -> None:
    overlap = run.summary["proposer"]["overlap"]
    print(
        f"| {words} | {seconds:.1f} s | {bound:.1f} s | {seconds / bound:.2f} | {overlap['ratio']:.3f} of "
        f"{overlap['ratio_planned']:.3f} | {overlap['feedback_age']['mean']:.1f} |",
        flush=True,
    )


def main() -> None:
    task = load_task("target-1")
    fast, slow = Problem(task), SlowProblem(task)
    optimize(fast, proposer="none", n_total=12)  # imports and kernels are not what is measured
    with slow_designer(fast) as server:
        print(f"goal {GOAL}; calls of {LATENCY:g} s")
        print("| | time | to compare with | ratio | proposals | age of feedback |")
        print("|---|---|---|---|---|---|")
        bare, _ = timed(slow, "none", 100)
        for n_step, in_flight, answer in ((10, 1, "two-step"), (5, 2, "two-step"), (5, 1, "one-step")):
            proposer = LlmProposer(
                ModelOptions(model="stand-in", base_url=server.url, answer=answer, origin="scripted")
            )
            seconds, run = timed(slow, proposer, 100, n_step=n_step, in_flight=in_flight)
            row(f"{EVALUATION:g} s a trial, n_step {n_step}, {answer}, {in_flight} in flight", seconds, bare, run)
        bare, _ = timed(fast, "none", 200)
        for in_flight in (1, 2, 4, 8):
            proposer = LlmProposer(ModelOptions(model="stand-in", base_url=server.url, origin="scripted"))
            seconds, run = timed(fast, proposer, 200, n_step=10, in_flight=in_flight)
            calls = run.summary["proposer"]["calls"]
            row(f"built-in evaluator, {in_flight} in flight", seconds, max(bare, calls * LATENCY / in_flight), run)


if __name__ == "__main__":
    main()
