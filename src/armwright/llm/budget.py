"""The budget of calls: reserved before each question, accounted for after it."""

import math
import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager

from armwright.exceptions import ProposalError
from armwright.llm.backend import MOST_REQUESTS
from armwright.llm.transcript import Call


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
        self._forget()

    def begin(self, calls: Iterable[Call]) -> None:
        """Start a session, given the calls of earlier ones."""
        with self._change:
            self._forget()
        for call in calls:
            self.spend(call)

    def spend(self, call: Call) -> None:
        """Count a call."""
        with self._change:
            self._requests += max(1, call.requests)
            if call.requests:  # otherwise nothing was answered, and nothing is to be paid
                self._cost = None if self._cost is None or call.cost_usd is None else self._cost + call.cost_usd
            if call.requests and call.proposal:
                self._priced += call.requests
                self._priced_cost += call.cost_usd or 0.0

    @property
    def price_is_missing(self) -> bool:
        """True if the cost is limited but unknown for some answer."""
        return self.max_cost is not None and self._cost is None

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

    def _forget(self) -> None:
        self._requests = 0
        self._cost: float | None = 0.0  # of all requests; None if a price is unknown
        self._priced = 0  # answered requests for proposals
        self._priced_cost = 0.0  # of these

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
        elif self.max_calls is not None and self._requests >= self.max_calls:
            reason = f"max_calls {self.max_calls} is used up"
        elif self._left(0) < 1:
            reason = f"max_cost {self.max_cost:g} USD is used up"
        else:
            return
        raise ProposalError("budget", reason, final=True)

    def _left(self, reserved: int) -> int:
        """Return the requests left for the next prompt while this many are reserved for others."""
        left = MOST_REQUESTS
        if self.max_calls is not None:
            left = min(left, self.max_calls - self._requests - reserved)
        if self.max_cost is not None:
            cost = self._cost or 0.0
            if cost >= self.max_cost:
                left = 0
            elif not self._priced:
                left = min(left, MOST_REQUESTS - reserved)
            elif self._priced_cost:
                each = self._priced_cost / self._priced
                affordable = math.floor((self.max_cost - cost) / each + 1e-9)  # 5 of 5 despite rounding
                left = min(left, affordable - reserved)
        return left
