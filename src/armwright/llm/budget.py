"""What questions may cost: set aside before each, accounted for after it."""

import math
import threading
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager

from armwright.exceptions import ProposalError
from armwright.llm.backend import MOST_REQUESTS
from armwright.llm.transcript import Call


class CallBudget:
    """Requests and money [USD] of all sessions of a run; several threads may ask at a time.

    What a question may take is set aside while it is under way, so that those beside it cannot spend it, too. Money is
    set aside by what a request has cost on average, the tiny one of the check left out; as long as none has come back,
    one question is asked at a time.
    """

    def __init__(self, max_calls: int | None = None, max_cost: float | None = None) -> None:
        self.max_calls = max_calls
        self.max_cost = max_cost
        self._change = threading.Condition()
        self._set_aside = 0  # requests of the questions under way
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
            if call.requests:  # else nothing was answered, and nothing is to be paid
                self._cost = None if self._cost is None or call.cost_usd is None else self._cost + call.cost_usd
            if call.requests and call.proposal:
                self._priced += call.requests
                self._priced_cost += call.cost_usd or 0.0

    @property
    def price_is_missing(self) -> bool:
        """Whether a cost is bounded, but not known of all that came back."""
        return self.max_cost is not None and self._cost is None

    @contextmanager
    def reserved(self, is_over: Callable[[], bool]) -> Generator[int | None]:
        """Reserve what a prompt may cost and return its number of requests; None if there is no limit.

        Waits where what is left is set aside for others, until they have come back, or the session is over.
        ProposalError where nothing is left.
        """
        requests = self._reserve(is_over)
        try:
            yield requests
        finally:
            with self._change:
                self._set_aside -= requests or 0
                self._change.notify_all()

    def wake(self) -> None:
        """Lets those that wait see that the session is over."""
        with self._change:
            self._change.notify_all()

    def _forget(self) -> None:
        self._requests = 0
        self._cost: float | None = 0.0  # of all requests; None where a price is not known
        self._priced = 0  # answered requests for proposals
        self._priced_cost = 0.0  # of these

    def _reserve(self, is_over: Callable[[], bool]) -> int | None:
        with self._change:
            while not is_over():
                if self.max_calls is None and self.max_cost is None:
                    return None
                self._check()
                requests = self._left(self._set_aside)
                if requests >= 1:
                    self._set_aside += requests
                    return requests
                self._change.wait()
        raise ProposalError("cancelled", "the study is over")

    def _check(self) -> None:
        """ProposalError where nothing would be left even if those under way took nothing."""
        if self.price_is_missing:
            words = f"what its calls cost is not known, so max_cost {self.max_cost:g} cannot hold; use max_calls"
            raise ProposalError("budget", words, final=True)
        if self.max_calls is not None and self._requests >= self.max_calls:
            raise ProposalError("budget", f"max_calls {self.max_calls} is used up", final=True)
        if self._left(0) < 1:
            raise ProposalError("budget", f"max_cost {self.max_cost:g} USD is used up", final=True)

    def _left(self, set_aside: int) -> int:
        """Return the requests left for the next prompt while this many are reserved for others."""
        left = MOST_REQUESTS
        if self.max_calls is not None:
            left = min(left, self.max_calls - self._requests - set_aside)
        if self.max_cost is not None:
            cost = self._cost or 0.0
            if cost >= self.max_cost:
                left = 0
            elif not self._priced:
                left = min(left, MOST_REQUESTS - set_aside)
            elif self._priced_cost:
                each = self._priced_cost / self._priced
                affordable = math.floor((self.max_cost - cost) / each + 1e-9)  # 5 of 5 in spite of rounding
                left = min(left, affordable - set_aside)
        return left
