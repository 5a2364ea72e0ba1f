"""Manual proposals whose answers come later: the run is interrupted at a question without an answer."""

import threading
from pathlib import Path

from armwright import ManualProposer, PromptOptions


class _Patience(threading.Event):
    """Has a KeyboardInterrupt at the third look for an answer; two looks find one that is there."""

    looks = 0

    def wait(self, timeout: float | None = None) -> bool:
        self.looks += 1
        if self.looks == 3:
            raise KeyboardInterrupt
        return False


def impatient(folder: Path, **how: str) -> ManualProposer:
    """Return a manual proposer who takes the answers that are there, and then interrupts the run."""
    proposer = ManualProposer(folder, PromptOptions.model_validate(how))
    proposer.manual._cancelled = _Patience()
    return proposer
