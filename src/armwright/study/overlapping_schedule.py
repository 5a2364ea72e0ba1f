"""Proposals requested in threads, while black-box trials go on."""

import threading
import time
from collections import deque
from itertools import count

from armwright.runs.history import History
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot
from armwright.study.schedule import Schedule

POLL_SECONDS = 0.2  # between two checks for Ctrl-C, because a wait cannot be interrupted everywhere
GRACE_SECONDS = 0.5  # for requests to save their answers when a study ends


class OverlappingSchedule(Schedule):
    """Requests run in threads while black-box trials go on; the ratio of proposals to trials is kept.

    A request is made when its block starts, `max_in_flight` - 1 blocks ahead. The black box may run ahead of the
    answers by the trials in the blocks of the requests in flight, then it waits. An answer enters as the next trial
    after its arrival.
    """

    def __init__(self, requests: ProposalRequests, max_in_flight: int) -> None:
        self._requests = requests
        self._max_in_flight = max_in_flight
        past = requests.past_slots()
        self._entered = len(past)
        self._arrived = deque(requests.unused())
        self._asked = {slot.asked for slot in (*past, *self._arrived)}
        self._failure: BaseException | None = None  # of a request; raised in the thread of the study
        self._threads: list[threading.Thread] = []
        self.n_in_flight = 0
        self._change = threading.Condition()

    def next(self, number: int) -> ProposalSlot | None:
        """Return the slot of the earliest answer, or None while the black box may go on without one."""
        method = self._requests.method
        counted = number - method.n_init  # finished trials
        if counted < 0:
            return None
        with self._change:
            while True:
                if self._failure is not None:
                    raise self._failure
                self._start_requests(counted)
                if self._arrived and self._entered < method.n_proposals:
                    self._entered += 1
                    return self._arrived.popleft()
                ahead = (method.n_step - 1) * (self._entered + self._max_in_flight)
                if counted - self._entered < min(ahead, method.n_total - method.n_proposals):
                    return None
                self._change.wait(POLL_SECONDS)

    def close(self) -> None:
        """Cancel the requests in flight; answers that have arrived are kept."""
        if self.n_in_flight:
            self._requests.cancel()
        deadline = time.monotonic() + GRACE_SECONDS
        for thread in self._threads:
            thread.join(max(0.0, deadline - time.monotonic()))

    def _start_requests(self, counted: int) -> None:
        """Start the requests that are due after so many counted trials."""
        method = self._requests.method
        while self.n_in_flight < self._max_in_flight:
            supplied = self._entered + len(self._arrived) + self.n_in_flight
            due = (supplied - self._max_in_flight + 1) * method.n_step
            if counted < due or supplied >= method.n_proposals:
                return
            blocks = count(method.n_init, method.n_step)
            number = next(first for first in blocks if first not in self._asked)
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

    def _request(self, history: History, number: int) -> None:
        slot, failure = None, None
        try:
            slot = self._requests.request(history, number)
        except BaseException as fault:  # noqa: BLE001 (raised in the thread of the study)
            failure = fault
        with self._change:
            self.n_in_flight -= 1
            self._failure = self._failure or failure
            if slot is not None:
                self._arrived.append(slot)
            self._change.notify_all()
