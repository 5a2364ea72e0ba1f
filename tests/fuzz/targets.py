"""The targets of the fuzzer by name."""

from tests.fuzz.answer_targets import answer_seeds, draft_seeds, run_answer, run_draft
from tests.fuzz.argument_targets import argument_seeds, run_arguments
from tests.fuzz.problem_targets import (
    BODY_TASK,
    RICH_SPACE,
    RICH_TASK,
    actuator_seeds,
    run_experiment,
    run_space,
    run_start,
    run_task,
    start_seeds,
)
from tests.fuzz.request_targets import request_seeds, run_request
from tests.fuzz.run_targets import a_run, of_run, replay_seeds, run_replay, run_trials
from tests.fuzz.target import Target, of_examples, shipped
from tests.fuzz.text_targets import point_seeds, run_points, run_urdf, run_words, urdf_seeds, word_seeds


def task_seeds() -> list[bytes]:
    return [RICH_TASK, BODY_TASK, *shipped("tasks"), *of_examples("task")]


TARGETS: dict[str, Target] = {
    "task": Target("yaml", task_seeds, run_task, heavy=True),
    "space": Target("yaml", lambda: [RICH_SPACE, *shipped("spaces"), *of_examples("space")], run_space, heavy=True),
    "actuators": Target("yaml", actuator_seeds, run_space, heavy=True),
    "experiment": Target("yaml", lambda: [*shipped("experiments"), *of_examples("rules")], run_experiment, heavy=True),
    "start": Target("json", start_seeds, run_start),
    "answer": Target("json", answer_seeds, run_answer),
    "draft": Target("text", draft_seeds, run_draft, heavy=True),
    "replay": Target("jsonl", replay_seeds, run_replay),
    "trials": Target("jsonl", lambda: [(a_run() / "trials.jsonl").read_bytes()], run_trials),
    **{
        f"run {name}": of_run(name)
        for name in ("config.yaml", "trials.jsonl", "transcripts.jsonl", "summary.json", "existing_arms.json",
                     "control.json", "status.json")
    },
    "urdf": Target("text", urdf_seeds, run_urdf),
    "points": Target("text", point_seeds, run_points),
    "words": Target("text", word_seeds, run_words),
    "request": Target("json", request_seeds, run_request),
    "arguments": Target("json", argument_seeds, run_arguments, heavy=True),
}  # fmt: skip
