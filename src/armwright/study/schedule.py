"""Schedules: which trials are the proposer's, and with what design."""

from collections import deque
from collections.abc import Sequence

from armwright.runs.trial import FinishedTrial
from armwright.study.proposal_requests import ProposalRequests, ProposalSlot


class Schedule:
    """Assigns each trial to the black box or to the proposer. This base class assigns all trials to the black box."""

    n_in_flight: int = 0  # number of requests that run while trials go on

    def next(self, number: int) -> ProposalSlot | None:
        """Return the slot of trial `number`, or None if it is the black box's."""
        return None

    def close(self) -> None:
        """End all requests."""


class AlternatingSchedule(Schedule):
    """The first trial of each block is the proposer's; the study waits for its design."""

    def __init__(self, requests: ProposalRequests) -> None:
        self._requests = requests
        self._ready = deque(requests.unused())

    def next(self, number: int) -> ProposalSlot | None:
        """Return the slot if the trial is the first of a block; request a proposal if none is left."""
        if not self._requests.method.is_first_trial(number):
            return None
        return self._ready.popleft() if self._ready else self._requests.request(self._requests.history(), number)


class ReplaySchedule(Schedule):
    """Repeats a recorded run: each proposal enters at its trial, requested with the recorded feedback.

    After the end of the record, the proposals that would be due are missing.
    """

    def __init__(self, requests: ProposalRequests, record: Sequence[FinishedTrial]) -> None:
        self._requests = requests
        self._record = record
        past = requests.past_slots()
        self._asked = {slot.asked for slot in past}
        self._end_is_reported = any(slot.fault == "missing" for slot in past)
        self._ready = {slot.asked: slot for slot in requests.unused()}

    def next(self, number: int) -> ProposalSlot | None:
        """Return what was recorded for this trial."""
        if number >= len(self._record):
            if len(self._requests.past_slots()) >= self._requests.method.n_started(number):
                return None
            note = "" if self._end_is_reported else f"the record ends with trial {len(self._record) - 1}"
            self._end_is_reported = True
            return ProposalSlot(number, number, fault="missing", note=note)
        request = self._record[number].request
        if request is None:
            return None
        asked, feedback = request
        if asked not in self._ready and asked not in self._asked:
            self._ready[asked] = self._requests.request(self._requests.history().before(feedback), asked)
        self._asked.add(asked)
        missing = ProposalSlot(asked, feedback, fault="missing", note=f"no design is left of call {asked}")
        return self._ready.pop(asked, missing)
