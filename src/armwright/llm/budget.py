"""The budget of calls: reserved before each question, accounted for after it."""

import math
import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager

from armwright.exceptions import ProposalError
from armwright.llm.backend import MAX_REQUESTS
from armwright.llm.transcript import Call, n_requests, total_cost


class CallBudget:
    """Limits of requests and cost [USD] over all sessions of a run; several threads may ask at a time.

    Each question reserves the requests that it may need, so that concurrent questions cannot spend them, too. Cost is
    reserved at the average of earlier requests, without the tiny one of the check. Until the first answer, one
    question is asked at a time.
    """

    def __init__(self, max_calls: int | None = None, max_cost: float | None = None) -> None:
        self.max_calls = max_calls
        self.max_cost = max_cost
        self._change = threading.Condition()
        self._reserved = 0  # requests of the questions in flight
        self._calls: list[Call] = []

    def begin(self, calls: Iterable[Call]) -> None:
        """Start a session, given the calls of earlier ones."""
        self._calls = list(calls)

    def spend(self, call: Call) -> None:
        """Count a call."""
        self._calls.append(call)

    @property
    def price_is_missing(self) -> bool:
        """True if the cost is limited but unknown for some answer."""
        return self.max_cost is not None and total_cost(self._calls) is None

    @contextmanager
    def reserved(self, is_over: Callable[[], bool]) -> Generator[int | None]:
        """Reserve what a prompt may cost and return its number of requests; None if there is no limit.

        Waits while the rest is reserved for others, until they have returned or the session is over.

        Raises:
            ProposalError: The budget is used up, or the session is over.
        """
        requests = self._reserve(is_over)
        try:
            yield requests
        finally:
            with self._change:
                self._reserved -= requests or 0
                self._change.notify_all()

    def wake(self) -> None:
        """Wake up waiting questions after the session is over."""
        with self._change:
            self._change.notify_all()

    def _reserve(self, is_over: Callable[[], bool]) -> int | None:
        with self._change:
            while not is_over():
                if self.max_calls is None and self.max_cost is None:
                    return None
                self._check()
                requests = self._left(self._reserved)
                if requests >= 1:
                    self._reserved += requests
                    return requests
                self._change.wait()
        raise ProposalError("cancelled", "the study is over")

    def _check(self) -> None:
        """Raise ProposalError if nothing would be left even if the questions in flight needed nothing."""
        if self.price_is_missing:
            reason = f"the cost of its calls is unknown, so max_cost {self.max_cost:g} cannot hold; use max_calls"
        elif self.max_calls is not None and n_requests(self._calls) >= self.max_calls:
            reason = f"max_calls {self.max_calls} is used up"
        elif self._left(0) < 1:
            reason = f"max_cost {self.max_cost:g} USD is used up"
        else:
            return
        raise ProposalError("budget", reason, final=True)

    def _left(self, reserved: int) -> int:
        """Return the requests left for the next prompt while this many are reserved for others."""
        left = MAX_REQUESTS
        if self.max_calls is not None:
            left = min(left, self.max_calls - n_requests(self._calls) - reserved)
        if self.max_cost is not None:
            rest = self.max_cost - (total_cost(self._calls) or 0.0)
            priced = [call for call in self._calls if call.requests and call.proposal]
            each = (total_cost(priced) or 0.0) / max(1, n_requests(priced))
            if rest <= 0.0:
                left = 0
            elif not priced:
                left = min(left, MAX_REQUESTS - reserved)
            elif each:
                left = min(left, math.floor(rest / each + 1e-9) - reserved)  # 5 of 5 despite rounding
        return left
