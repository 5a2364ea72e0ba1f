"""Whose turn a trial is: the black box's, or the proposer's, and with what design.

Alternating   the first trial of each block of n_step is the proposer's, and the study waits for it
Overlapping   questions are asked while black-box trials go on; an answer enters when it comes, the ratio is kept
Recorded      a recorded run is played again: its proposals enter when they did
"""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from armwright.exceptions import ProposalError
from armwright.history import History
from armwright.proposers.proposer import Proposal, Proposer, RecordedTurn
from armwright.seeding import derived_seed

PROPOSING = 2  # the place of the proposals' seeds under the run's seed
LOOK_EVERY = 0.2  # [s] between two looks for Ctrl-C, where a wait cannot be interrupted


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
        ...


class Asker:
    """Asks the proposer, until a fault that asking again does not mend."""

    def __init__(self, proposer: Proposer, seed: int) -> None:
        self._proposer = proposer
        self._seed = seed
        self._given_up: str | None = None  # the kind of that fault

    def ask(self, history: History, number: int) -> list[Turn]:
        """The turns that come of asking for trial `number` after `history`: one a design, or one with a fault."""
        known = len(history)
        if self._given_up is not None:
            return [Turn(number, known, fault=self._given_up)]
        try:
            made = self._proposer.propose(history, derived_seed(self._seed, PROPOSING, number), number)
        except ProposalError as fault:
            note = str(fault)
            if fault.final and self._given_up is None:
                self._given_up = fault.kind
                note += "; no more questions are asked in this session"
            return [Turn(number, known if fault.known is None else fault.known, fault=fault.kind, note=note)]
        proposals = [made] if isinstance(made, Proposal) else list(made)
        return [Turn(number, known if p.known is None else p.known, p, note=p.note) for p in proposals]

    def cancel(self) -> None:
        """Ends what is under way."""
        self._proposer.cancel()


class Nobody(Turns):
    """There is no proposer: every trial is the black box's."""

    def next(self, number: int) -> Turn | None:
        """Never the proposer's."""
        return None

    def close(self) -> None:
        """Nothing is under way."""


class Alternating(Turns):
    """The first trial of each block is the proposer's; the study waits for its design."""

    def __init__(
        self, asker: Asker, schedule: Schedule, history: Callable[[], History], unused: Iterable[Turn]
    ) -> None:
        self._asker = asker
        self._schedule = schedule
        self._history = history
        self._ready = deque(unused)

    def next(self, number: int) -> Turn | None:
        """Asks where the trial begins a block and nothing lies ready."""
        if not self._schedule.begins_block(number):
            return None
        if not self._ready:
            self._ready.extend(self._asker.ask(self._history(), number))
        return self._ready.popleft()

    def close(self) -> None:
        """Nothing is under way."""


class Recorded(Turns):
    """Plays recorded turns: each enters at its trial, asked with the feedback of then."""

    def __init__(self, asker: Asker, turns: Mapping[int, RecordedTurn], history: Callable[[], History]) -> None:
        self._asker = asker
        self._turns = turns
        self._history = history
        self._ready: dict[int, deque[Turn]] = {}  # of calls that gave several designs

    def next(self, number: int) -> Turn | None:
        """What was recorded for this trial."""
        turn = self._turns.get(number)
        if turn is None:
            return None
        ready = self._ready.get(turn.asked)
        if not ready:
            history = self._history()
            used = {trial.proposal for trial in history} - {None}
            came = self._asker.ask(history.before(turn.feedback), turn.asked)
            ready = deque(t for t in came if t.proposal is None or t.proposal.id not in used)
            if not ready:
                return Turn(turn.asked, turn.feedback, fault="missing", note=f"no design is left of call {turn.asked}")
            self._ready[turn.asked] = ready
        return ready.popleft()

    def close(self) -> None:
        """Nothing is under way."""


class Overlapping(Turns):
    """Questions go on in threads of their own while black-box trials run.

    in_flight: questions at a time.  per_call: designs that a question asks for.
    past: the turns of the trials that are finished, when a run is resumed.

    A question is asked when its block would begin, `in_flight` - 1 blocks ahead. The black box may run ahead of the
    answers by what the blocks of the questions under way hold; then it waits, so the ratio is kept.
    """

    def __init__(
        self,
        asker: Asker,
        schedule: Schedule,
        history: Callable[[], History],
        unused: Sequence[Turn],
        past: Sequence[Turn],
        in_flight: int,
        per_call: int,
    ) -> None:
        self._asker = asker
        self._schedule = schedule
        self._history = history
        self._in_flight = in_flight
        self._per_call = per_call
        self._arrived: deque[Turn | BaseException] = deque(unused)
        self._entered = len(past)
        self._asked = {turn.asked for turn in (*past, *unused)}
        self.under_way = 0
        self._change = threading.Condition()

    def next(self, number: int) -> Turn | None:
        """The turn of the answer that came first; None as long as the black box may go on without one."""
        counted = number - self._schedule.n_init  # trials that are finished
        if counted < 0:
            return None
        with self._change:
            while True:
                self._ask(counted)
                if self._arrived and self._entered < self._schedule.n_proposals:
                    turn = self._arrived.popleft()
                    if isinstance(turn, BaseException):
                        raise turn
                    self._entered += 1
                    return turn
                if self._black_box_may_run(counted - self._entered):
                    return None
                self._change.wait(LOOK_EVERY)

    def close(self) -> None:
        """Ends the questions under way; their threads end by themselves."""
        if self.under_way:
            self._asker.cancel()

    def _black_box_may_run(self, drawn: int) -> bool:
        """drawn: counted trials of the black box so far."""
        s = self._schedule
        ahead = (s.n_step - 1) * (self._entered + self._in_flight * self._per_call)
        return drawn < min(ahead, s.n_total - s.n_proposals)

    def _ask(self, counted: int) -> None:
        """Asks what is due; counted: counted trials that are finished."""
        while self.under_way < self._in_flight:
            supplied = self._entered + len(self._arrived) + self.under_way * self._per_call
            ahead = (self._in_flight - 1) * self._per_call
            if supplied >= self._schedule.n_proposals or counted < (supplied - ahead) * self._schedule.n_step:
                return
            block = 0
            while self._schedule.number(block) in self._asked:
                block += self._per_call
            number = self._schedule.number(block)
            self._asked.add(number)
            self.under_way += 1
            question = threading.Thread(
                target=self._wait_for, args=(self._history(), number), name=f"armwright-question-{number}", daemon=True
            )
            question.start()

    def _wait_for(self, history: History, number: int) -> None:
        answer: list[Turn] | list[BaseException]
        try:
            answer = self._asker.ask(history, number)
        except BaseException as fault:  # noqa: BLE001 raised again in the study's thread
            answer = [fault]
        with self._change:
            self.under_way -= 1
            self._arrived.extend(answer)
            self._change.notify_all()
