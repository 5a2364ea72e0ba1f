"""Proposals requested in threads, while black-box trials go on."""

import threading
import time
from collections import deque
from itertools import count, groupby

from armwright.runs.history import History
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot
from armwright.study.schedule import AlternatingSchedule, Schedule

POLL_SECONDS = 0.2  # between two checks for Ctrl-C, because a wait cannot be interrupted everywhere
GRACE_SECONDS = 0.5  # for requests to save their answers when a study ends


class OverlappingSchedule(Schedule):
    """Requests run in threads while black-box trials go on; the ratio of proposals to trials is kept.

    A request is made when its block starts, `max_in_flight` - 1 blocks ahead. The black box may run ahead of the
    answers by the trials in the blocks of the requests in flight, then it waits. An answer enters as the next trial
    after its arrival. If it has several designs, all but the first wait for their blocks.

    Args:
        requests: requests to the proposer.
        max_in_flight: requests at a time.
    """

    def __init__(self, requests: ProposalRequests, max_in_flight: int) -> None:
        self._requests = requests
        self._method = requests.method
        self._max_in_flight = max_in_flight
        past = requests.past_slots()
        self._entered = len(past)
        self._asked = {slot.asked for slot in past}
        self._arrived: deque[list[ProposalSlot]] = deque()  # answers with all their designs
        self._surplus: deque[ProposalSlot] = deque()  # designs of answers whose first design has entered
        self._failure: BaseException | None = None  # of a request; raised in the thread of the study
        self._threads: list[threading.Thread] = []
        self.n_in_flight = 0
        self._change = threading.Condition()
        for asked, slots in groupby(requests.unused(), lambda slot: slot.asked):
            if asked in self._asked:
                self._surplus.extend(slots)
            else:
                self._arrived.append(list(slots))
                self._asked.add(asked)

    def next(self, number: int) -> ProposalSlot | None:
        """Return the slot of the earliest answer, or None while the black box may go on without one."""
        counted = number - self._method.n_init  # finished trials
        if counted < 0:
            return None
        with self._change:
            while True:
                if self._failure is not None:
                    raise self._failure
                self._start_requests(counted)
                slot = self._take(counted)
                if slot is not None:
                    self._entered += 1
                    return slot
                if self._black_box_may_run(counted - self._entered):
                    return None
                self._change.wait(POLL_SECONDS)

    def close(self) -> None:
        """Cancel the requests in flight; answers that have arrived are kept."""
        if self.n_in_flight:
            self._requests.cancel()
        deadline = time.monotonic() + GRACE_SECONDS
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def upcoming(self, number: int) -> int:
        """Return the trial of the next request: the first of a block without one."""
        numbers = count(self._method.n_init, self._method.n_step * self._requests.per_call)
        return next(number for number in numbers if number not in self._asked)

    def _take(self, counted: int) -> ProposalSlot | None:
        """Return the next slot, if one is due."""
        if self._entered >= self._method.n_proposals:
            return None
        if self._surplus and counted >= self._entered * self._method.n_step:
            return self._surplus.popleft()
        if self._arrived:
            first, *others = self._arrived.popleft()
            self._surplus.extend(others)
            return first
        return None

    def _black_box_may_run(self, n_drawn: int) -> bool:
        """Return whether the black box may draw another trial after `n_drawn` counted ones."""
        method = self._method
        ahead = (method.n_step - 1) * (self._entered + self._max_in_flight * self._requests.per_call)
        return n_drawn < min(ahead, method.n_total - method.n_proposals)

    def _start_requests(self, counted: int) -> None:
        """Start the requests that are due after so many counted trials."""
        while self.n_in_flight < self._max_in_flight and self._n_supplied() < self._method.n_proposals:
            if counted < self._next_request_after():
                return
            number = self.upcoming(counted + self._method.n_init)
            self._asked.add(number)
            self.n_in_flight += 1
            thread = threading.Thread(
                target=self._request,
                args=(self._requests.history(), number),
                name=f"armwright-request-{number}",
                daemon=True,
            )
            self._threads = [other for other in self._threads if other.is_alive()] + [thread]
            thread.start()

    def _n_supplied(self) -> int:
        """Return the number of designs that have arrived or are requested."""
        arrived = self._entered + sum(map(len, self._arrived)) + len(self._surplus)
        return arrived + self.n_in_flight * self._requests.per_call

    def _next_request_after(self) -> int:
        """Return the number of counted trials after which the next request is made."""
        return (self._n_supplied() - (self._max_in_flight - 1) * self._requests.per_call) * self._method.n_step

    def _request(self, history: History, number: int) -> None:
        answer: list[ProposalSlot] = []
        failure: BaseException | None = None
        try:
            answer = self._requests.request(history, number)
        except BaseException as fault:  # noqa: BLE001 (raised in the thread of the study)
            failure = fault
        with self._change:
            self.n_in_flight -= 1
            self._failure = self._failure or failure
            if answer:
                self._arrived.append(answer)
            self._change.notify_all()


def request_schedule(requests: ProposalRequests) -> AlternatingSchedule | OverlappingSchedule:
    """Return the schedule of a proposer; its requests overlap with black-box trials if `in_flight` is set."""
    in_flight = requests.method.in_flight
    return AlternatingSchedule(requests) if in_flight is None else OverlappingSchedule(requests, in_flight)
