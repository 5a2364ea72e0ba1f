"""Manual answers in place of a model, as files: from a model's web page, or a designer's own ideas."""

import os
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from armwright.exceptions import FailureError, SettingsError, UsageError
from armwright.files import naming_write_errors, read_text, replace_file
from armwright.llm.backend import FREE_TEXT, AskOptions, CallError, LlmBackend, Question, Reply
from armwright.llm.model_options import PromptOptions
from armwright.proposers.prompted import PromptedProposer

LOOK_EVERY = 0.5  # [s]
ENDINGS = ("md", "json")  # of an answer's file
MAX_FILE = 10_000_000  # [bytes]


class ManualBackend(LlmBackend):
    """Write DIR/NNN-prompt.md and wait for DIR/NNN-answer.md (or .json), where NNN is the trial's number."""

    def __init__(self, folder: Path) -> None:
        super().__init__("people", "manual")
        self.folder = folder
        self._cancelled = threading.Event()
        self._seen: dict[Path, tuple[int, int]] = {}  # sizes and times of files at the last look

    def begin(self) -> None:
        """Start a session."""
        self._cancelled.clear()

    def cancel(self) -> None:
        """Stop waiting."""
        self._cancelled.set()

    def files(self, number: int) -> tuple[Path, list[Path]]:
        """Return the paths of the question for trial `number`, and of its possible answers."""
        answers = [self.folder / f"{number:03d}-answer.{ending}" for ending in ENDINGS]
        return self.folder / f"{number:03d}-prompt.md", answers

    def ask(self, question: Question, options: AskOptions = FREE_TEXT) -> Reply:
        """Return the answer; one that is refused is moved aside with the reason."""
        started = time.perf_counter()
        number = question.trial
        prompt_file, answers = self.files(number)
        self._ask(prompt_file, answers, question.prompt)
        while True:
            answer = next(filter(self._is_ready, answers), None)
            if answer is not None:
                text = read_text(answer, MAX_FILE, FailureError)
                try:
                    accepted = text if options.output is None else options.output.read(text)
                    return Reply(accepted, requests=1, seconds=round(time.perf_counter() - started, 3))
                except UsageError as refusal:
                    self._refuse(number, answer, str(refusal))
                    continue  # another file may hold a valid answer
            if self._cancelled.wait(LOOK_EVERY):
                raise CallError("cancelled", "waiting for the answer was cancelled", Reply())

    def _ask(self, file: Path, answers: Sequence[Path], prompt: str) -> None:
        if os.path.isfile(file):
            if read_text(file, MAX_FILE, FailureError) == prompt:
                return
            raise FailureError(
                f"{file} is a question of another run or version; use an empty folder, or move {file.name} and its "
                "answer away"
            )
        early = next((answer for answer in answers if answer.exists()), None)
        if early is not None:
            raise FailureError(f"{early} exists before its question was asked; use an empty folder, or move it away")
        self._write(file, prompt)

    def _is_ready(self, answer: Path) -> bool:
        """Return whether the answer is not empty and did not change since the last look."""
        if not os.path.isfile(answer):
            return False
        found = answer.stat()
        now = found.st_size, found.st_mtime_ns
        before, self._seen[answer] = self._seen.get(answer), now
        return now[0] > 0 and before == now

    def _refuse(self, number: int, answer: Path, reason: str) -> None:
        before = len(list(self.folder.glob(f"{number:03d}-refused-*")))
        kept = self.folder / f"{number:03d}-refused-{before + 1}{answer.suffix}"
        with naming_write_errors(kept, error=FailureError):
            os.replace(answer, kept)
        self._write(
            self.folder / f"{number:03d}-refused.md",
            f"{kept.name} was refused:\n\n{reason}\n\nGive another {answer.name}.\n",
        )

    def _write(self, file: Path, text: str) -> None:
        with naming_write_errors(file, error=FailureError):
            self.folder.mkdir(parents=True, exist_ok=True)
            replace_file(file, text.encode())


class ManualProposer(PromptedProposer):
    """Writes each prompt to FOLDER/NNN-prompt.md and takes the answer from FOLDER/NNN-answer.md (or .json).

    Args:
        folder: Folder of questions and answers.
        options: Prompt and memory; answers are always text.
    """

    overlaps = False  # a person answers one question at a time, and may take days

    def __init__(self, folder: str | Path, options: PromptOptions | None = None) -> None:
        if Path(folder).exists() and not Path(folder).is_dir():
            raise SettingsError(f"{folder} is a file; manual needs a folder for its questions")
        self.manual = ManualBackend(Path(folder))
        answers = (options or PromptOptions()).model_copy(update={"answer": "text"})
        super().__init__(self.manual, "manual", answers)

    def check(self) -> str:
        """Check nothing: nobody is asked before the first question."""
        return ""

    def announce(self, number: int) -> str:
        """Name the files of the question and of its answer, until it is answered."""
        question, answers = self.manual.files(number)
        is_answered = any(file.is_file() and file.stat().st_size > 0 for file in answers)  # and not refused
        return "" if is_answered else f"{question} waits for your answer in {answers[0]}"
