"""The study: schedule, reference point, hypervolume, resume."""

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import moocore
import numpy as np
import optuna
import pytest
from optuna.samplers import BaseSampler, NSGAIISampler, QMCSampler, RandomSampler

from armwright import Design, History, Problem, Proposal, Proposer, Task, find_front, load_task, optimize
from armwright.exceptions import ProposalError, RunConflictError, SettingsError, TaskError
from armwright.search.samplers import SamplerFactory
from armwright.study.progress import Progress, StudyResult
from tests.support.controlled_runs import after, interrupt
from tests.support.extras import NEEDS_GP

PROBLEM = Problem(load_task("target-1"))
OPEN = Problem(Task(name="open", targets=((0.3, 0.0, 0.3), (0.3, 0.2, 0.5))))  # states no reference point


class Listed(Proposer):
    """Proposes uniform designs, or fails where `faulty` says so."""

    name = "listed"

    def __init__(self, faulty: tuple[int, ...] = ()) -> None:
        self.faulty = faulty

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        if len(history) in self.faulty:
            raise ProposalError("timeout", "it did not answer")
        return Proposal(history.problem.space.sample(1, seed)[0], f"listed-{len(history)}")


def short(
    out: Path | None = None, problem: Problem = PROBLEM, proposer: Proposer | str = "none", n_total: int = 8
) -> StudyResult:
    return optimize(problem, proposer=proposer, n_init=5, n_step=4, n_total=n_total, seed=0, out=out, verify=False)


def designs(run: StudyResult) -> list[object]:
    return [(trial.source, trial.design, trial.values, trial.proposal) for trial in run.trials]


def test_first_trial_of_each_block_is_the_proposers() -> None:
    """n_init random trials, then blocks of n_step whose first trial is the proposer's."""
    run = short(proposer=Listed())
    assert [trial.source for trial in run.trials] == ["random"] * 5 + ["listed", "bbo", "bbo", "bbo"] * 2
    assert [trial.number for trial in run.trials] == list(range(13))


def test_hypervolume_curve_matches_moocore() -> None:
    run = short(n_total=30)
    values = np.array([trial.values for trial in run.trials])
    assert values == pytest.approx(PROBLEM.evaluate([trial.design for trial in run.trials]).values, abs=0)
    expected = [
        moocore.hypervolume(np.minimum(values[: 5 + i], 5.0), ref=[5.0, 5.0]) for i in range(1, 31)
    ]  # a point moved onto the reference point's lines dominates no area
    assert run.hypervolume == pytest.approx(np.array(expected))
    assert run.summary["hypervolume"]["final"] == pytest.approx(expected[-1])
    assert run.summary["hypervolume"]["mean"] == pytest.approx(np.mean(expected))
    assert np.all(np.diff(run.hypervolume) >= 0.0)


def test_front_members_are_the_non_dominated_trials_with_their_arms() -> None:
    run = short(n_total=30)
    values = np.array([trial.values for trial in run.trials])
    assert [m.number for m in run.front] == sorted(
        np.flatnonzero(moocore.is_nondominated(values)), key=lambda n: values[n, 0]
    )
    assert run.front[0].values == run.trials[run.front[0].number].values
    assert run.front[0].arm == PROBLEM.arm(run.front[0].design)


def test_open_reference_point_is_frozen(tmp_path: Path) -> None:
    run = short(tmp_path / "run", OPEN)
    first = np.array([trial.values for trial in run.trials[:5]])
    expected = 1.1 * first[moocore.is_nondominated(first)].max(axis=0)
    assert run.config.reference_point == pytest.approx(expected)
    more = short(tmp_path / "run", OPEN, n_total=16)
    assert more.config.reference_point == run.config.reference_point
    assert more.hypervolume[:8] == pytest.approx(run.hypervolume)


def test_failing_proposer_is_counted_and_flagged() -> None:
    run = short(proposer=Listed(faulty=(5, 9)))
    assert [trial.fault for trial in run.trials] == [None] * 5 + ["timeout", None, None, None] * 2
    assert {trial.source for trial in run.trials[5:]} == {"bbo"}
    proposer = run.summary["proposer"]
    assert (proposer["failures"], proposer["fallback_share"], proposer["flagged"]) == ({"timeout": 2}, 1.0, True)


class Repeating(Proposer):
    """Proposes one design again and again, and keeps how many finished trials it was shown each time."""

    name = "repeating"

    def __init__(self) -> None:
        self.shown: list[tuple[int, int]] = []

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        self.shown.append((number, len(history)))
        return Proposal(history.problem.space.sample(1, 0)[0], f"repeating-{number}")


def test_duplicate_is_recorded_before_the_next_trial(tmp_path: Path) -> None:
    """Otherwise a kill between the two trials would change the next draw."""
    proposer = Repeating()
    run = optimize(PROBLEM, proposer=proposer, n_init=2, n_step=1, n_total=5, out=tmp_path / "run")
    assert proposer.shown == [(number, number) for number in range(2, 7)]
    assert [trial.duplicate_of for trial in run.trials[3:]] == [2] * 4
    assert all(trial.feedback is None for trial in run.trials)


class Odd(Proposer):
    """Gives a design that no design space takes."""

    name = "odd"

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        design = history.problem.space.sample(1, seed)[0]
        return Proposal(Design({**design.params, "link_1": 9.0}), f"odd-{number}")


@pytest.mark.parametrize("in_flight", [None, 2])
def test_answer_without_usable_design_becomes_black_box_trial(in_flight: int | None) -> None:
    notes: list[str] = []
    asked: dict[str, Any] = {"proposer": Odd(), "in_flight": in_flight, "n_init": 5, "n_step": 4, "n_total": 8}
    run = optimize(PROBLEM, **asked, watch=lambda progress: notes.append(progress.note))
    assert run.summary["proposer"]["failures"] == {"answer": 2}
    assert [note for note in notes if note] == ["link_1 = 9 m is outside 0.03 <= link_1 <= 0.3 m"] * 2


def nsga2(seed: int) -> BaseSampler:
    return NSGAIISampler(population_size=5, seed=seed)


def qmc(seed: int) -> BaseSampler:
    return QMCSampler(seed=7, scramble=True, warn_independent_sampling=False)


@pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")
@pytest.mark.parametrize(
    ("sampler", "proposer", "stop"),
    [  # 7 is coprime to the lengths of the lists, so each value occurs
        *product(["tpe", "tpe-multivariate", "nsga2", nsga2, qmc], ["none", "rules", Listed()], [3, 5, 6, 12])
    ][::7],
)
@pytest.mark.fast_cases(3)
def test_resumed_run_equals_uninterrupted_one(
    tmp_path: Path, sampler: str | SamplerFactory, proposer: Proposer | str, stop: int
) -> None:
    check_resume(tmp_path / "run", stop, proposer=proposer, sampler=sampler, n_total=20)


@pytest.mark.parametrize("proposer", [pytest.param(name, marks=NEEDS_GP) for name in ("none", "rules")])
def test_resumed_run_with_gp_equals_uninterrupted_one(tmp_path: Path, proposer: str) -> None:
    """GP draws use the model from the 11th trial on and take 0.3 s each, so the run is short."""
    check_resume(tmp_path / "run", 12, proposer=proposer, sampler="gp", n_total=12)


def check_resume(out: Path, stop: int, **settings: Any) -> None:
    settings = {"n_init": 5, "n_step": 4, "verify": False, **settings}
    whole = optimize(PROBLEM, **settings)
    with pytest.raises(KeyboardInterrupt):
        optimize(PROBLEM, **settings, out=out, watch=after(stop, interrupt))
    resumed = optimize(PROBLEM, **settings, out=out)
    assert resumed.resumed == stop + 1
    assert designs(resumed) == designs(whole)


def test_larger_n_total_extends_a_finished_run(tmp_path: Path) -> None:
    short(tmp_path / "run", n_total=8)
    content = (tmp_path / "run" / "trials.jsonl").read_bytes()
    again = short(tmp_path / "run", n_total=8)
    assert (again.resumed, len(again.trials)) == (13, 13)
    assert (tmp_path / "run" / "trials.jsonl").read_bytes() == content
    longer = short(tmp_path / "run", n_total=12)
    assert longer.resumed == 13
    assert designs(longer) == designs(short(n_total=12))
    assert json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))["n_trials"] == 17


def test_changed_settings_are_refused_with_differences(tmp_path: Path) -> None:
    short(tmp_path / "run", n_total=8)
    with pytest.raises(RunConflictError) as refusal:
        optimize(PROBLEM, proposer=Listed(), n_init=5, n_step=2, n_total=6, seed=3, out=tmp_path / "run")
    assert "n_step: 4 stored, 2 requested" in str(refusal.value)
    assert "proposer.name: None stored, listed requested" in str(refusal.value)
    assert "n_total: 8 stored, 6 requested (it can only grow)" in str(refusal.value)


def test_folder_without_trials_accepts_any_settings(tmp_path: Path) -> None:
    watch = after(0, interrupt)
    with pytest.raises(KeyboardInterrupt):
        optimize(PROBLEM, proposer=Listed(), n_init=1, n_step=1, n_total=1, out=tmp_path / "run", watch=watch)
    (tmp_path / "run" / "trials.jsonl").write_text("", encoding="utf-8")
    assert len(short(tmp_path / "run").trials) == 13


def test_changed_versions_are_recorded(tmp_path: Path) -> None:
    short(tmp_path / "run")
    config = tmp_path / "run" / "config.yaml"
    config.write_text(config.read_text(encoding="utf-8").replace("  optuna: ", "  optuna: 0."), encoding="utf-8")
    run = short(tmp_path / "run", n_total=12)
    assert run.config.versions["optuna"] == optuna.__version__
    assert run.config.earlier_versions[0]["optuna"] == f"0.{optuna.__version__}"


def test_changed_sampler_factory_is_refused(tmp_path: Path) -> None:
    def go_on(sampler: SamplerFactory, n_total: int) -> StudyResult:
        return optimize(PROBLEM, proposer="none", sampler=sampler, n_init=2, n_total=n_total, out=tmp_path / "run")

    go_on(lambda seed: RandomSampler(seed=seed), 2)
    with pytest.raises(
        RunConflictError, match=r"sampler: line \d+ \(.*\) of tests.study.test_study,.* stored, line \d+"
    ):
        go_on(lambda seed: QMCSampler(seed=seed), 3)
    with pytest.raises(RunConflictError, match="qmc requested"):
        go_on(qmc, 3)


def test_sampler_instance_and_proposer_class_are_refused() -> None:
    with pytest.raises(SettingsError, match=r"or a factory seed -> sampler, got .*RandomSampler"):
        optimize(PROBLEM, proposer="none", sampler=RandomSampler())  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match=r"Listed is a class; give an instance of it: Listed\(\)"):
        optimize(PROBLEM, proposer=Listed)  # type: ignore[arg-type]


def test_progress_reports_hypervolume_and_front_size() -> None:
    seen: list[Progress] = []
    run = optimize(OPEN, proposer=Listed(), n_init=3, n_step=2, n_total=4, watch=seen.append)
    finished = [progress for progress in seen if progress.doing == "finished"]
    assert [progress.iteration for progress in finished] == [0, 0, 0, 1, 2, 3, 4]
    assert [progress.hypervolume for progress in finished[:2]] == [None, None]
    assert [progress.hypervolume for progress in finished[3:]] == pytest.approx(run.hypervolume.tolist())
    assert finished[-1].front_size == len(run.front)
    assert [progress.source for progress in seen if progress.doing == "proposing"] == ["listed"] * 2


@pytest.mark.parametrize(
    "settings",
    [{"seed": 2**31}, {"n_step": 0}, {"n_init": 0}, {"n_total": 0}, {"seed": -1}, {"n_total": 1.5}, {"n_step": True}],
)
def test_settings_out_of_range_are_refused(settings: dict[str, int]) -> None:
    with pytest.raises(SettingsError, match=f"{next(iter(settings))}: "):
        optimize(PROBLEM, proposer="none", **settings)


@pytest.mark.parametrize("search", [optimize, find_front])
def test_searches_stop_at_what_is_proven(search: Callable[..., object], tmp_path: Path) -> None:
    problem = Problem(Task(name="far", targets=((9.0, 0.0, 0.0),)))
    with pytest.raises(TaskError, match=r"target 1 \(9, 0, 0\) m is 8 m from the nearest allowed base"):
        search(problem, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()
