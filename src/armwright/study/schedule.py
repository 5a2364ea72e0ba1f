"""Whose turn a trial is: the black box's, or the proposer's, and with what design.

Alternating   the first trial of each block of n_step is the proposer's, and the study waits for it
Overlapping   questions are asked while black-box trials go on; an answer enters when it comes, the ratio is kept
Recorded      a recorded run is played again: its proposals enter when they did
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import count, groupby
from typing import Protocol

from armwright.exceptions import DesignError, ProposalError
from armwright.proposers.proposer import Proposal, Proposer, Record
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.seeding import PROPOSING, derived_seed

LOOK_EVERY = 0.2  # [s] between two looks for Ctrl-C, where a wait cannot be interrupted
LAST_WORDS = 0.5  # [s] that questions have, when a study ends, to keep what has come


@dataclass(frozen=True)
class Turn:
    """The proposer's turn at a trial: its proposal, or the kind of fault that left it without one.

    asked: the trial that it was asked for.  feedback: how many finished trials the proposer knew.
    note: what the user should be told.
    """

    asked: int
    feedback: int
    proposal: Proposal | None = None
    fault: str | None = None
    note: str = ""


@dataclass(frozen=True)
class Schedule:
    """Blocks of n_step trials after n_init random ones; one of each block is the proposer's."""

    n_init: int
    n_step: int
    n_total: int

    @property
    def n_proposals(self) -> int:
        """In the whole run."""
        return -(-self.n_total // self.n_step)

    def number(self, block: int) -> int:
        """The first trial of a block."""
        return self.n_init + block * self.n_step

    def begun(self, number: int) -> int:
        """How many blocks have begun when trial `number` is due, its own included."""
        return max(0, (number - self.n_init) // self.n_step + 1)

    def begins_block(self, number: int) -> bool:
        """Whether the trial is the first of a block."""
        return number >= self.n_init and (number - self.n_init) % self.n_step == 0


class Turns(Protocol):
    """Says before each trial whose turn it is.

    under_way: questions that wait for their answers while trials go on.
    """

    under_way: int = 0

    def next(self, number: int) -> Turn | None:
        """The proposer's turn at trial `number`; None where it is the black box's."""
        ...

    def close(self) -> None:
        """Nothing more is wanted."""


class Asker:
    """Asks the proposer, until a fault that asking again does not mend.

    tell: called with the trial's number before a question.
    """

    def __init__(self, proposer: Proposer, seed: int, tell: Callable[[int], None] | None = None) -> None:
        self.per_call = proposer.per_call
        self._proposer = proposer
        self._seed = seed
        self._tell = tell
        self._given_up: str | None = None  # the kind of that fault
        self._lock = threading.Lock()

    def unused(self, history: History) -> list[Turn]:
        """The turns of proposals of earlier sessions that no trial has used yet."""
        return [Turn(p.asked, p.known or 0, p, note=p.note) for p in self._proposer.unused(history)]

    def ask(self, history: History, number: int) -> list[Turn]:
        """The turns that come of asking for trial `number` after `history`: one a design, or one with a fault."""
        known = len(history)
        if self._given_up is not None:
            return [Turn(number, known, fault=self._given_up)]
        if self._tell is not None:
            self._tell(number)
        try:
            made = self._proposer.propose(history, self.seed(number), number)
        except ProposalError as fault:
            return [
                Turn(number, known if fault.known is None else fault.known, fault=fault.kind, note=self._note(fault))
            ]
        proposals = [made] if isinstance(made, Proposal) else list(made)
        if not proposals:
            return [Turn(number, known, fault="answer", note="the proposer gave no design")]
        return [_checked(history, number, proposal) for proposal in proposals]

    def seed(self, number: int) -> int:
        """Of the question for trial `number`."""
        return derived_seed(self._seed, PROPOSING, number)

    def give_up(self, kind: str) -> bool:
        """Asks no more in this session; whether that is news."""
        with self._lock:
            news, self._given_up = self._given_up is None, self._given_up or kind
        return news

    def cancel(self) -> None:
        """Ends what is under way."""
        self._proposer.cancel()

    def _note(self, fault: ProposalError) -> str:
        """What the user should be told; a fault that ends the asking is said once, however many questions meet it."""
        if not fault.final:
            return str(fault)
        return f"{fault}; no more questions are asked in this session" if self.give_up(fault.kind) else ""


def _checked(history: History, number: int, proposal: Proposal) -> Turn:
    known = len(history) if proposal.known is None else proposal.known
    try:
        history.problem.space.design(proposal.design.params)
    except DesignError as refusal:
        return Turn(number, known, fault="answer", note=str(refusal))
    return Turn(number, known, proposal, note=proposal.note)


def past_turns(history: History) -> list[Turn]:
    """The proposer's turns that the finished trials were."""
    return [turn for turn in map(_past_turn, history) if turn is not None]


def _past_turn(trial: FinishedTrial) -> Turn | None:
    if trial.proposal is None and trial.fault is None:
        return None
    asked = trial.number if trial.asked is None else trial.asked
    return Turn(asked, trial.number if trial.feedback is None else trial.feedback, fault=trial.fault)


class Nobody(Turns):
    """There is no proposer: every trial is the black box's."""

    def next(self, number: int) -> Turn | None:
        """Never the proposer's."""
        return None


class Alternating(Turns):
    """The first trial of each block is the proposer's; the study waits for its design."""

    def __init__(self, asker: Asker, schedule: Schedule, history: Callable[[], History]) -> None:
        self._asker = asker
        self._schedule = schedule
        self._history = history
        self._ready = deque(asker.unused(history()))

    def next(self, number: int) -> Turn | None:
        """Asks where the trial begins a block and nothing lies ready."""
        if not self._schedule.begins_block(number):
            return None
        if not self._ready:
            self._ready.extend(self._asker.ask(self._history(), number))
        return self._ready.popleft()

    def upcoming(self, number: int) -> tuple[int, int]:
        """The trial that is asked for next when `number` trials are finished, and how many will be finished then."""
        begins = next(n for n in count(number) if self._schedule.begins_block(n))
        asked = begins + len(self._ready) * self._schedule.n_step
        return asked, asked


class Recorded(Turns):
    """Plays recorded turns: each enters at its trial, asked with the feedback of then.

    Beyond the record's end, the proposals that would be due are missing.
    """

    def __init__(self, asker: Asker, record: Record, schedule: Schedule, history: Callable[[], History]) -> None:
        self._asker = asker
        self._record = record
        self._schedule = schedule
        self._history = history
        past = past_turns(history())
        self._asked = {turn.asked for turn in past}
        self._missed = any(turn.fault == "missing" for turn in past)
        self._ready: dict[tuple[int, str | None], Turn] = {}  # by trial and proposal; None for a fault
        self._take(asker.unused(history()))

    def next(self, number: int) -> Turn | None:
        """What was recorded for this trial."""
        turn = self._record.turns.get(number)
        if turn is None:
            return self._beyond(number)
        if (turn.asked, turn.proposal) not in self._ready and turn.asked not in self._asked:
            self._take(self._asker.ask(self._history().before(turn.feedback), turn.asked))
        self._asked.add(turn.asked)
        missing = Turn(turn.asked, turn.feedback, fault="missing", note=f"no design is left of call {turn.asked}")
        return self._ready.pop((turn.asked, turn.proposal), self._ready.pop((turn.asked, None), missing))

    def _take(self, turns: Iterable[Turn]) -> None:
        for turn in turns:
            self._ready[turn.asked, None if turn.proposal is None else turn.proposal.id] = turn

    def _beyond(self, number: int) -> Turn | None:
        if number < self._record.n_trials or len(past_turns(self._history())) >= self._schedule.begun(number):
            return None
        note = "" if self._missed else f"the record ends with trial {self._record.n_trials - 1}"
        self._missed = True
        return Turn(number, number, fault="missing", note=note)


class Overlapping(Turns):
    """Questions go on in threads of their own while black-box trials run.

    in_flight: questions at a time.

    A question is asked when its block would begin, `in_flight` - 1 blocks ahead. The black box may run ahead of the
    answers by what the blocks of the questions under way hold; then it waits, so the ratio is kept. An answer enters
    as the next trial after it came; of an answer with several designs all but the first wait for their blocks.
    """

    def __init__(self, asker: Asker, schedule: Schedule, history: Callable[[], History], in_flight: int) -> None:
        self._asker = asker
        self._schedule = schedule
        self._history = history
        self._in_flight = in_flight
        past = past_turns(history())
        self._entered = len(past)
        self._asked = {turn.asked for turn in past}
        self._arrived: deque[list[Turn]] = deque()  # answers, each with its designs
        self._surplus: deque[Turn] = deque()  # designs of answers whose first has entered
        self._failure: BaseException | None = None  # raised again in the study's thread
        self._threads: list[threading.Thread] = []
        self.under_way = 0
        self._change = threading.Condition()
        for asked, turns in groupby(asker.unused(history()), lambda turn: turn.asked):
            if asked in self._asked:
                self._surplus.extend(turns)
            else:
                self._arrived.append(list(turns))
                self._asked.add(asked)

    def next(self, number: int) -> Turn | None:
        """The turn of the answer that came first; None as long as the black box may go on without one."""
        counted = number - self._schedule.n_init  # trials that are finished
        if counted < 0:
            return None
        with self._change:
            while True:
                if self._failure is not None:
                    raise self._failure
                self._ask(counted)
                turn = self._take(counted)
                if turn is not None:
                    self._entered += 1
                    return turn
                if self._black_box_may_run(counted - self._entered):
                    return None
                self._change.wait(LOOK_EVERY)

    def close(self) -> None:
        """Ends the questions under way; what has come is kept."""
        if self.under_way:
            self._asker.cancel()
        deadline = time.monotonic() + LAST_WORDS
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def upcoming(self, number: int) -> tuple[int, int]:
        """The trial that is asked for next when `number` trials are finished, and how many will be finished then."""
        return self._next_asked(), max(number, self._schedule.n_init + max(0, self._asks_at()))

    def _take(self, counted: int) -> Turn | None:
        """The next turn, if one is due."""
        if self._entered >= self._schedule.n_proposals:
            return None
        if self._surplus and counted >= self._entered * self._schedule.n_step:
            return self._surplus.popleft()
        if self._arrived:
            first, *others = self._arrived.popleft()
            self._surplus.extend(others)
            return first
        return None

    def _black_box_may_run(self, drawn: int) -> bool:
        """drawn: counted trials of the black box so far."""
        s = self._schedule
        ahead = (s.n_step - 1) * (self._entered + self._in_flight * self._asker.per_call)
        return drawn < min(ahead, s.n_total - s.n_proposals)

    def _ask(self, counted: int) -> None:
        """Asks what is due; counted: counted trials that are finished."""
        while self.under_way < self._in_flight and self._supplied() < self._schedule.n_proposals:
            if counted < self._asks_at():
                return
            number = self._next_asked()
            self._asked.add(number)
            self.under_way += 1
            question = threading.Thread(
                target=self._wait_for, args=(self._history(), number), name=f"armwright-question-{number}", daemon=True
            )
            self._threads = [thread for thread in self._threads if thread.is_alive()] + [question]
            question.start()

    def _supplied(self) -> int:
        """Designs that have come, or are asked for."""
        came = self._entered + sum(map(len, self._arrived)) + len(self._surplus)
        return came + self.under_way * self._asker.per_call

    def _asks_at(self) -> int:
        """After how many counted trials the next question is asked."""
        return (self._supplied() - (self._in_flight - 1) * self._asker.per_call) * self._schedule.n_step

    def _next_asked(self) -> int:
        """The trial that is asked for next: the first of a block for which nothing was asked."""
        numbers = (self._schedule.number(block) for block in count(0, self._asker.per_call))
        return next(number for number in numbers if number not in self._asked)

    def _wait_for(self, history: History, number: int) -> None:
        answer: list[Turn] = []
        failure: BaseException | None = None
        try:
            answer = self._asker.ask(history, number)
        except BaseException as fault:  # noqa: BLE001 raised again in the study's thread
            failure = fault
        with self._change:
            self.under_way -= 1
            self._failure = self._failure or failure
            if answer:
                self._arrived.append(answer)
            self._change.notify_all()


def asking_turns(
    asker: Asker, schedule: Schedule, history: Callable[[], History], in_flight: int | None
) -> Alternating | Overlapping:
    """The turns of a proposer that is asked; with `in_flight`, while black-box trials run."""
    if in_flight is None:
        return Alternating(asker, schedule, history)
    return Overlapping(asker, schedule, history, in_flight)
