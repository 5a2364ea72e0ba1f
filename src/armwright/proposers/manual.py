"""Manual answers as a proposer: from a model's web page, or a designer's own ideas."""

from pathlib import Path

from armwright.exceptions import SettingsError
from armwright.llm.manual import ManualBackend
from armwright.llm.model_options import PromptOptions
from armwright.proposers.prompted import PromptedProposer


class ManualProposer(PromptedProposer):
    """Writes each prompt to FOLDER/NNN-prompt.md and takes the answer from FOLDER/NNN-answer.md (or .json).

    Args:
        folder: Folder of questions and answers.
        options: Prompt and memory; answers are always text.
        wait: Wait for an answer; if false, raise AnswerPendingError. The same call continues once it is there.
    """

    overlaps = False  # a person answers one question at a time, and may take days

    def __init__(self, folder: str | Path, options: PromptOptions | None = None, *, wait: bool = True) -> None:
        if Path(folder).exists() and not Path(folder).is_dir():
            raise SettingsError(f"{folder} is a file; manual needs a folder for its questions")
        self.manual = ManualBackend(Path(folder), wait)
        answers = (options or PromptOptions()).model_copy(update={"answer": "text"})
        super().__init__(self.manual, answers, "manual")

    def check(self) -> str:
        """Check nothing: nobody is asked before the first question."""
        return ""

    def announce(self, number: int) -> str:
        """Name the files of the question and of its answer, until it is answered."""
        question, answer = self.manual.files(number)
        if self.manual.is_answered(number):
            return ""
        return f"{question} waits for your answer in {answer}"
