"""A proposer that asks: what the language model, a recording of one, and people in its place have in common."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, ModelError, ProposalError
from armwright.llm.answer import Answer, answer_schema, read_answers, read_text, written_answers
from armwright.llm.backend import CHECK, LlmBackend, Question, Reply
from armwright.llm.budget import CallBudget
from armwright.llm.model_options import ANSWERS, PromptOptions
from armwright.llm.prompt import Form, Prompt, load_prompt, parameters_prompt
from armwright.llm.session import LlmSession
from armwright.llm.transcript import TRANSCRIPTS, Transcript, hints_of
from armwright.problem.problem import Problem
from armwright.proposers.hints import Hints
from armwright.proposers.proposer import Proposal, Proposer
from armwright.runs.control import Hint
from armwright.runs.history import History

LAST_STEPS = ("parameters", "answer")  # the steps whose answers are designs


class PromptedProposer(LlmSession, Proposer):
    """Ask a backend for each proposal, and record what was asked and answered.

    Args:
        backend: Who answers.
        options: How designs are asked for.
        name: The `source` of its trials.
        prompt: A prompt that is loaded already, in place of the one that `options` names.
        budget: Limits of the whole run.
    """

    def __init__(
        self,
        backend: LlmBackend,
        options: PromptOptions,
        name: str,
        *,
        prompt: Prompt | None = None,
        budget: CallBudget | None = None,
    ) -> None:
        super().__init__(backend, name, budget)
        self.options = options
        self.per_call = options.proposals
        self.prompt = prompt or load_prompt(options.prompt)
        self._form: Form = ANSWERS[options.answer]
        self._hints = Hints(None)

    def settings(self) -> Mapping[str, Any]:
        """Prompt, memory and form of the answer; of a prompt of one's own the whole template."""
        own = {} if self.prompt.name in ("plus", "minus") else {"template": self.prompt.template}
        return {
            "prompt": self.prompt.name,
            **own,
            "memory": self.options.memory,
            "answer": self.options.answer,
            "proposals": self.options.proposals,
        }

    def open(self, folder: Path | None) -> None:
        """Reads what was said before in this run."""
        self._begin(None if folder is None else folder / TRANSCRIPTS)
        self._hints = Hints(folder)

    def look(self, folder: Path) -> None:
        """Reads what was said before in a run, and changes nothing there."""
        self._transcript = Transcript(folder / TRANSCRIPTS, read_only=True)
        self._hints = Hints(folder)

    def asked(self) -> Mapping[int, int]:
        """The trials that were asked for so far, and how many finished trials were known then."""
        calls = [call for call in self._transcript.calls if call.proposal]
        return {int(call.proposal.rpartition("-")[2]): call.known for call in calls}

    def check(self) -> None:
        """Makes sure that answers are to be had; a budget that is used up is said at the first question."""
        try:
            self._call(CHECK, self.backend.check, self._over)
        except ProposalError as fault:
            if fault.kind == "budget":
                return
            raise ModelError(
                f"{fault}. Check the model, its key and base_url; --proposer rules needs none",
                final=fault.kind if fault.final else None,
            ) from fault
        if self._budget.price_is_missing:
            raise ModelError(
                f"the price of {self.backend.model} is not known, so max_cost cannot hold; use max_calls",
                final="budget",
            )

    def unused(self, history: History) -> Sequence[Proposal]:
        """Designs that were answered in a run that was killed, and that no trial has used: they were paid for."""
        used = {trial.proposal for trial in history}
        found: dict[str, Proposal] = {}
        for call in self._transcript.calls:
            if call.step in LAST_STEPS and call.fault is None:
                with suppress(DesignError):  # a transcript that was changed by hand: asked again
                    answers = read_text(call.answer, history.problem, self.options.proposals)
                    found.update({p.id: p for p in self._proposals(call.proposal, answers, call.known)})
        return [proposal for proposal in found.values() if proposal.id not in used]

    def propose(self, history: History, seed: int, number: int) -> Sequence[Proposal]:
        """The next designs. An answer that was paid for in a run that was killed is used, not asked again."""
        question = self.question(history, seed, number)
        try:
            return self._answered(question, history.problem)
        finally:
            self._hints.give_back(question.hints)

    def _answered(self, question: Question, problem: Problem) -> Sequence[Proposal]:
        over = self._over
        try:
            if question.step == "reasoning":
                said = self._call(question, self.backend.ask, over)
                question = self._extracting(problem, question.proposal, said, question.known)
            text = self._call(question, lambda asked: self.ask_designs(asked, problem), over)
        except ProposalError as fault:
            fault.known = question.known
            raise
        answers = read_text(text, problem, self.options.proposals)
        return self._proposals(question.proposal, answers, question.known)

    def question(self, history: History, seed: int, number: int) -> Question:
        """What is asked first for trial `number`; where free thoughts have come already, for their parameters."""
        identity = self.identity(number)
        in_steps = self._form == "then-schema"
        thoughts = self._transcript.answered(identity, "reasoning") if in_steps else None
        if thoughts is not None:
            return self._extracting(history.problem, identity, thoughts.answer, thoughts.known)
        hints = self.next_hints(number)
        prompt = self.prompt_for(history, seed, hints)
        return Question(identity, "reasoning" if in_steps else "answer", prompt, len(history), hints=hints)

    def identity(self, number: int) -> str:
        """Of the question for trial `number`, and of the proposal that comes of it."""
        return f"{self.name}-{number:04d}"

    def next_hints(self, number: int) -> tuple[Hint, ...]:
        """Those that go with a question for trial `number` if it is asked now.

        People who answer by files get none: their question has to stay the same until it is answered.
        """
        return () if self._form == "text" else self._hints.take(self._transcript)

    def past_hints(self, number: int) -> tuple[Hint, ...]:
        """Those that the question for trial `number` went with."""
        return hints_of(self._transcript.calls, self.identity(number))

    def _extracting(self, problem: Problem, identity: str, said: str, known: int) -> Question:
        prompt = parameters_prompt(problem, said, proposals=self.options.proposals, expected=self._expects)
        return Question(identity, "parameters", prompt, known)

    def prompt_for(self, history: History, seed: int, hints: Sequence[Hint] = ()) -> str:
        """What is asked after `history`."""
        return self.prompt.render(
            history,
            seed,
            memory=self.options.memory,
            name=self.name,
            proposals=self.options.proposals,
            form=self._form,
            hints=[hint.text for hint in hints],
        )

    def schema(self, problem: Problem) -> dict[str, Any]:
        """JSON schema of the answer that holds the designs."""
        return answer_schema(
            problem,
            reasoning=self._form == "schema",
            expected=self._expects,
            proposals=self.options.proposals,
        )

    def ask_designs(self, question: Question, problem: Problem) -> Reply:
        """The answer that holds the designs, as JSON that `read_text` reads."""

        def read(content: Mapping[str, Any]) -> str:
            answers = read_answers(content, problem, self.options.proposals)
            return written_answers(answers, problem, str(content.get("reasoning", "")))

        return self.backend.ask_for(question, self.schema(problem), read)

    @property
    def _expects(self) -> bool:
        return self.options.memory == "own"

    def _proposals(self, identity: str, answers: Sequence[Answer], known: int) -> list[Proposal]:
        ids = [identity] if len(answers) == 1 else [f"{identity}.{i}" for i in range(1, len(answers) + 1)]
        asked = int(identity.rpartition("-")[2])
        return [
            Proposal(answer.design, id_, answer.reason, answer.expected, asked, known)
            for id_, answer in zip(ids, answers, strict=True)
        ]
