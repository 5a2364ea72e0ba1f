"""The budget of calls: reserved before each question, accounted for after it."""

import math
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager

from armwright.exceptions import ProposalError
from armwright.llm.backend import MAX_REQUESTS
from armwright.llm.transcript import Call, n_requests, total_cost

POLL_SECONDS = 0.1  # between two looks whether the session of a waiting question is over


class CallBudget:
    """Limits of requests and cost [USD] over all sessions of a run; several threads may ask at a time.

    Each question reserves the requests that it may need, so that concurrent questions cannot spend them, too. Cost is
    reserved at the average of earlier requests, without the tiny one of the check. Until the first answer, one
    question is asked at a time.
    """

    def __init__(self, max_calls: int | None, max_cost: float | None) -> None:
        self.max_calls = max_calls
        self.max_cost = max_cost
        self._change = threading.Condition()
        self._reserved = 0  # requests of the questions in flight

    @contextmanager
    def reserved(self, calls: Callable[[], Sequence[Call]], over: threading.Event) -> Generator[int | None]:
        """Reserve what a prompt may cost and return its number of requests; None if there is no limit.

        Waits while the rest is reserved for others, until they have returned or the session is `over`. `calls` returns
        the calls so far, earlier sessions included.

        Raises:
            ProposalError: The budget is used up, or the session is over.
        """
        requests = None
        with self._change:
            while not over.is_set() and (requests := self._left(calls())) is not None and requests < 1:
                self._change.wait(POLL_SECONDS)
            if over.is_set():
                raise ProposalError("cancelled", "the study is over")
            self._reserved += requests or 0
        try:
            yield requests
        finally:
            with self._change:
                self._reserved -= requests or 0
                self._change.notify_all()

    def _left(self, calls: Sequence[Call]) -> int | None:
        """Return the requests left for the next question, None without a limit; ProposalError if a limit is used up."""
        limits: list[int] = []
        if self.max_cost is not None:
            limits.append(self._affordable(self.max_cost, calls))
        if self.max_calls is not None:
            left = self.max_calls - n_requests(calls)
            if left < 1:
                raise ProposalError("budget", f"max_calls {self.max_calls} is used up", final=True)
            limits.append(left - self._reserved)
        return min(MAX_REQUESTS, *limits) if limits else None

    def _affordable(self, max_cost: float, calls: Sequence[Call]) -> int:
        spent, priced = total_cost(calls), [call for call in calls if call.requests and call.proposal]
        if spent is None:
            reason = f"the cost of its calls is unknown, so max_cost {max_cost:g} cannot hold; use max_calls"
            raise ProposalError("budget", reason, final=True)
        each = (total_cost(priced) or 0.0) / max(1, n_requests(priced))
        left = math.floor((max_cost - spent) / each + 1e-9) if each else MAX_REQUESTS  # 5 of 5 despite rounding
        if spent >= max_cost or left < 1:
            raise ProposalError("budget", f"max_cost {max_cost:g} USD is used up", final=True)
        return left - self._reserved if each or not priced else MAX_REQUESTS
