"""The targets of the fuzzer by name."""

from tests.fuzz.answer_targets import answer_seeds, run_answer
from tests.fuzz.problem_targets import BODY_TASK, RICH_SPACE, RICH_TASK, run_experiment, run_space, run_task
from tests.fuzz.run_targets import of_run, run_replay, run_trials, seed_of_run
from tests.fuzz.target import Target, of_examples, shipped
from tests.fuzz.text_targets import POINTS, WORDS, run_points, run_urdf, run_words, urdf_seeds

TARGETS: dict[str, Target] = {
    "words": Target(200_000, "text", lambda: WORDS, run_words),
    "points": Target(200_000, "text", lambda: POINTS, run_points),
    "answer": Target(120_000, "json", answer_seeds, run_answer),
    "urdf": Target(120_000, "text", urdf_seeds, run_urdf),
    "trials": Target(30_000, "jsonl", seed_of_run("trials.jsonl"), run_trials),
    "space": Target(20_000, "yaml", lambda: [RICH_SPACE, *shipped("spaces"), *of_examples("space")], run_space),
    "task": Target(20_000, "yaml", lambda: [RICH_TASK, BODY_TASK, *shipped("tasks"), *of_examples("task")], run_task),
    "experiment": Target(10_000, "yaml", lambda: [*shipped("experiments"), *of_examples("rules")], run_experiment),
    "replay": Target(10_000, "jsonl", seed_of_run("transcripts.jsonl"), run_replay),
    **{
        f"run {name}": Target(inputs, name.rpartition(".")[2], seed_of_run(name), of_run(name))
        for inputs, names in (
            (1_000, ("config.yaml", "trials.jsonl", "transcripts.jsonl", "summary.json")),
            (500, ("existing_arms.json",)),
        )
        for name in names
    },
}
