"""Repeated designs are recorded without another evaluation."""

from armwright import DesignSpace, Problem, load_task, optimize


def test_repeated_design_is_evaluated_once_and_counted() -> None:
    space = DesignSpace.model_validate(
        {"joints": 3, "joint_types": ["P", "Y"], "link": [0.2, 0.3], "grid": {"link": 0.05}}
        | {f"origin_{axis}": [0.0, 0.0] for axis in "xyz"}
    )  # 216 designs
    run = optimize(Problem(load_task("target-1"), space), proposer=None, sampler="random", n_total=90, verify=False)
    first: dict[frozenset[tuple[str, float | str]], int] = {}
    repeated = 0
    for trial in run.trials:
        earlier = first.setdefault(frozenset(trial.design.params.items()), trial.number)
        is_repeated = earlier != trial.number
        repeated += is_repeated
        assert trial.duplicate_of == (earlier if is_repeated else None)
        assert (trial.seconds["evaluation"] == 0.0) == is_repeated
        assert trial.values == run.trials[earlier].values
    assert repeated > 10
    assert run.summary["duplicates"] == repeated
