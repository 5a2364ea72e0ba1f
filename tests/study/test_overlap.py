"""Model calls in flight while black-box trials run."""

import random
import threading
from collections import Counter
from typing import Any

import pytest

from armwright import History, Problem, Proposal, Proposer, load_task, optimize
from armwright.exceptions import ProposalError
from armwright.study.progress import Progress, StudyResult
from tests.support.command_line import PATIENCE
from tests.support.controlled_runs import after, interrupt

PROBLEM = Problem(load_task("target-1"))
N_INIT = 4


class Held(Proposer):
    """Its answers are held back until they are released, one question at a time."""

    name = "held"

    def __init__(self, faulty: tuple[int, ...] = ()) -> None:
        self.faulty = faulty
        self.known: dict[int, int] = {}
        self.most_under_way = 0
        self._gates: dict[int, threading.Event] = {}
        self._lock = threading.Lock()

    @property
    def waiting(self) -> list[int]:
        """The trials whose questions wait."""
        return [number for number, gate in self._gates.items() if not gate.is_set()]

    def release(self, number: int) -> None:
        """Lets an answer go, and waits until the study has it."""
        self._gates[number].set()
        for thread in threading.enumerate():
            if thread.name == f"armwright-request-{number}" and thread is not threading.current_thread():
                thread.join()

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        with self._lock:
            gate = self._gates.setdefault(number, threading.Event())
            self.known[number] = len(history)
            self.most_under_way = max(self.most_under_way, len(self.waiting))
        gate.wait()
        if number in self.faulty:
            raise ProposalError("timeout", "it did not answer")
        return Proposal(history.problem.space.sample(1, seed)[0], f"held-{number}")


class Releasing(threading.Thread):
    """Releases whatever waits, in an order of its own, as long as a study runs."""

    def __init__(self, proposer: Held, seed: int) -> None:
        super().__init__(daemon=True)
        self.proposer = proposer
        self.random = random.Random(seed)
        self.over = threading.Event()

    def run(self) -> None:
        while not self.over.wait(0.001):
            if waiting := self.proposer.waiting:
                self.proposer.release(self.random.choice(waiting))


def search(proposer: Proposer, n_step: int = 5, n_total: int = 20, in_flight: int = 1, **settings: Any) -> StudyResult:
    schedule = {"n_init": N_INIT, "n_step": n_step, "n_total": n_total, "in_flight": in_flight}
    return optimize(PROBLEM, proposer=proposer, sampler="random", verify=False, **{**schedule, **settings})


def released(proposer: Held, seed: int, *schedule: int) -> StudyResult:
    """A search whose answers are released in an order drawn from the seed."""
    releasing = Releasing(proposer, seed)
    releasing.start()
    run = search(proposer, *schedule)
    releasing.over.set()
    return run


def test_answer_becomes_the_next_trial_after_its_arrival() -> None:
    proposer = Held()

    def watch(progress: Progress) -> None:
        after(6, lambda: proposer.release(4))(progress)  # asked when trial 4 was due
        after(10, lambda: proposer.release(9))(progress)

    run = search(proposer, n_total=10, watch=watch)
    assert [trial.number for trial in run.trials if trial.source == "held"] == [7, 11]
    first, second = run.trials[7], run.trials[11]
    assert (first.proposal, first.asked, first.feedback) == ("held-4", 4, 4)
    assert (second.proposal, second.asked, second.feedback) == ("held-9", 9, 9)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("n_step", "n_total", "in_flight"), [(5, 23, 1), (5, 40, 3), (1, 12, 4), (30, 20, 2)])
@pytest.mark.fast_cases(3)
def test_ratio_does_not_depend_on_the_order_of_answers(seed: int, n_step: int, n_total: int, in_flight: int) -> None:
    proposer = Held()
    run = released(proposer, seed, n_step, n_total, in_flight)
    sources = [trial.source for trial in run.trials[N_INIT:]]
    planned = -(-n_total // n_step)
    assert Counter(sources) == Counter({"held": planned, "bbo": n_total - planned}) - Counter(bbo=0)
    assert proposer.most_under_way <= in_flight
    entered = 0
    for i, source in enumerate(sources):
        entered += source == "held"
        assert i + 1 - entered <= (n_step - 1) * (entered + in_flight)
    ids = [trial.proposal for trial in run.trials if trial.proposal]
    assert len(set(ids)) == planned
    for trial in run.trials:
        if trial.proposal:
            asked = trial.number if trial.asked is None else trial.asked
            assert proposer.known[asked] == (trial.number if trial.feedback is None else trial.feedback) <= trial.number


def test_failed_call_becomes_a_black_box_trial() -> None:
    run = released(Held(faulty=(9,)), 0)
    assert [trial.asked or trial.number for trial in run.trials if trial.fault] == [9]
    assert Counter(trial.source for trial in run.trials[N_INIT:]) == {"bbo": 17, "held": 3}
    assert run.summary["proposer"]["failures"] == {"timeout": 1}


def test_permanent_fault_of_concurrent_calls_is_reported_once() -> None:
    """This holds for any number of calls in flight."""

    class Keyless(Proposer):
        name = "keyless"
        together = threading.Barrier(3)

        def propose(self, history: History, seed: int, number: int) -> Proposal:
            self.together.wait(PATIENCE)
            raise ProposalError("key", "the key is wrong", final=True)

    notes: list[str] = []
    run = search(Keyless(), in_flight=3, watch=lambda progress: notes.append(progress.note))
    assert run.summary["proposer"]["failures"] == {"key": 4}
    told = "the key is wrong; no more requests are made in this session"
    assert [note for note in notes if note] == [told]


def test_interrupt_waits_for_answers_being_recorded() -> None:
    """The study waits briefly for the threads that record answers."""

    class Keeping(Proposer):
        name = "keeping"

        def __init__(self) -> None:
            self.asked, self.cancelled, self.kept = threading.Event(), threading.Event(), threading.Event()

        def propose(self, history: History, seed: int, number: int) -> Proposal:
            self.asked.set()
            self.cancelled.wait(PATIENCE)
            self.kept.wait(0.1)  # to keep it takes a moment
            self.kept.set()
            raise ProposalError("cancelled", "the study is over")

        def cancel(self) -> None:
            self.cancelled.set()

    proposer = Keeping()

    with pytest.raises(KeyboardInterrupt):
        search(proposer, watch=after(N_INIT, lambda: (proposer.asked.wait(PATIENCE), interrupt())))
    assert proposer.kept.is_set()


def test_proposer_exception_ends_the_study() -> None:
    class Broken(Proposer):
        name = "broken"

        def propose(self, history: History, seed: int, number: int) -> Proposal:
            raise ZeroDivisionError("a bug of its own")

    with pytest.raises(ZeroDivisionError, match="a bug of its own"):
        search(Broken())
