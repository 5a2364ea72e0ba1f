"""A task and a design space drafted by a language model from somebody's words, for people to check and edit.

Nothing runs by itself. What is written passed the models that load it; what did not is kept with the question in
drafts.jsonl, and nowhere else.
"""

import os
import shlex
import textwrap
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from armwright.exceptions import (
    ArmwrightError,
    FailureError,
    ModelError,
    ProposalError,
    SettingsError,
    SpaceError,
    TaskError,
    UsageError,
)
from armwright.files import replace_file
from armwright.llm.backend import CallError, Question
from armwright.llm.budget import CallBudget
from armwright.llm.configuration import ConfiguredModel, configuration_path, configured_model
from armwright.llm.draft_prompt import draft_prompt, read_documents
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import estimated_tokens
from armwright.llm.session import LlmSession
from armwright.llm.transcript import Transcript
from armwright.problem.problem import Problem
from armwright.runs.summary import ProposerSummary
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import builtin_names
from armwright.tasks.task import Task
from armwright.text import one_line
from armwright.yaml_documents import parse_document

DRAFTS = "drafts.jsonl"  # in the folder of the files: what was asked and answered
MOST_ANSWERS = 3  # a refused one goes back with the reason, at most twice
ANSWER_TOKENS = 2000  # that a model is taken to write, for an estimate
N_TRIED = 64  # designs that are evaluated, to see that objectives, actuators and targets go together
LONGEST_REFUSAL = 600  # characters
LONGEST_NOTE = 1000  # characters of the user's words in a file's comment
LONGEST_COMMAND = 4000  # characters in a file's comment
WIDTH = 110  # of comments
LAST_OF_HEAD = "Run it with:  "  # how the last line of the comment at the top begins

Model = TypeVar("Model", bound=BaseModel)


class _NameTakenError(TaskError):
    """A file of this name lies there."""


@dataclass(frozen=True)
class Draft:
    """What came of the words.

    space: None where the default fits.
    assumed: what the model says that it assumed, line by line.
    task_yaml, space_yaml: the files' text, comments included; of no space empty.
    by: who answered, in words.  account: calls, tokens and cost.
    files: where it was written; empty where it was not.
    """

    task: Task
    space: DesignSpace | None
    assumed: tuple[str, ...]
    task_yaml: str
    space_yaml: str
    by: str
    account: ProposerSummary
    files: tuple[Path, ...] = ()

    @property
    def problem(self) -> Problem:
        """What `armwright optimize` would search."""
        return Problem(self.task, paper_space() if self.space is None else self.space)

    @property
    def command(self) -> str:
        """What runs it, for a shell."""
        return _command(*(self.files or _places(None, self.task.name, self.space)))

    @property
    def space_body(self) -> str:
        """The space file's text without the comment at its top."""
        return self.space_yaml.partition(LAST_OF_HEAD)[2].partition("\n\n")[2]

    def record(self) -> dict[str, Any]:
        """All of it as JSON."""
        return {
            "files": [str(path) for path in self.files],
            "by": self.by,
            "origin": self.account.origin,
            "assumed": list(self.assumed),
            "calls": self.account.calls,
            "input_tokens": self.account.input_tokens,
            "output_tokens": self.account.output_tokens,
            "cost_usd": self.account.cost_usd,
            "task": self.task.model_dump(mode="json"),
            "space": None if self.space is None else self.space.model_dump(mode="json"),
        }


class Drafter(LlmSession):
    """Asks a language model for drafts.

    out: the folder of the files; None writes nothing, and keeps nothing of what was said.
    force: whether files of the same name are replaced; else a name that is taken is refused to the model.
    """

    def __init__(self, configured: ConfiguredModel, out: Path | None = None, force: bool = False) -> None:
        from armwright.llm.client import ModelClient

        options = configured.options
        super().__init__(ModelClient(options), "draft", CallBudget(options.max_calls, options.max_cost))
        self.configured = configured
        self.out = out
        self.force = force
        self._identity = ""
        if out is not None:
            _make_folder(out)
            # Of earlier drafts in this folder only their number counts: each has a budget of its own.
            self._transcript = Transcript(out / DRAFTS)

    def forecast(self, words: str) -> str:
        """Who is asked, and about what that will take, in one line for the user."""
        from armwright.llm.client import describe_cost

        options, given = self.configured.options, estimated_tokens(draft_prompt(words))
        server = f" at {options.base_url}" if options.base_url else ""
        cost = describe_cost(options, given, ANSWER_TOKENS)
        return (
            f"asking {self._by()}{server}, named by {self.configured.named_by}: about {given:,} tokens in, "
            f"{ANSWER_TOKENS:,} out, up to {MOST_ANSWERS} times; {cost}"
        )

    def summary(self) -> ProposerSummary:
        """Calls, tokens and cost of the last draft."""
        return self._summary([call for call in self._transcript.calls if call.proposal == self._identity])

    def draft(self, words: str) -> Draft:
        """The draft of these words, written where there is a folder; ModelError where none came that is valid."""
        prompt = draft_prompt(words)
        self._check_price(prompt)
        self._identity = f"draft-{len({call.proposal for call in self._transcript.calls}) + 1:04d}"
        self.backend.begin()
        refusal = way = ""
        for _ in range(MOST_ANSWERS):
            try:
                said = self._call(Question(self._identity, "draft", prompt), self.backend.ask, self._over)
            except ProposalError as fault:
                raise self._failure(fault, refusal) from fault
            try:
                draft = self._read(said, words)
            except UsageError as fault:
                refusal = one_line(str(fault), LONGEST_REFUSAL)
                way = "--force replaces files; --out names another folder" if isinstance(fault, _NameTakenError) else ""
                prompt = draft_prompt(words, said, refusal)
                continue
            return draft if self.out is None else replace(draft, files=self._write(draft, self.out))
        raise ModelError(
            f"{self._by()} gave no valid draft in {MOST_ANSWERS} answers; the last was refused: {refusal}. "
            f"{self._kept()}{way or 'Say it in other words, or write a task yourself: armwright init my-task.yaml'}"
        )

    def _read(self, said: str, words: str) -> Draft:
        """What an answer comes to; UsageError refuses it."""
        found = read_documents(said)
        task = _checked(found.task, Task, TaskError)
        space = _checked(found.space, DesignSpace, SpaceError) if found.space else None
        if space is not None and _is_default(space):
            space = None
        self._check_names(task, space)
        problem = Problem(task, paper_space() if space is None else space)
        problem.evaluate(problem.space.sample(N_TRIED, 0))
        if not task.provenance.strip():
            raise TaskError("provenance is missing from the task: say what the points were made from, and what assumed")
        places = _places(self.out, task.name, space)
        task_yaml = self._head(words, found.assumed, places) + found.task
        space_yaml = "" if space is None else self._head(words, (), places) + found.space
        # What is written is what was checked: comments around it change nothing.
        if _checked(task_yaml, Task, TaskError) != task:
            raise TaskError("the task is no plain block of YAML")
        if space is not None and _checked(space_yaml, DesignSpace, SpaceError) != space:
            raise SpaceError("the space is no plain block of YAML")
        return Draft(task, space, found.assumed, task_yaml, space_yaml, self._by(), self.summary())

    def _check_names(self, task: Task, space: DesignSpace | None) -> None:
        if task.name in builtin_names():
            raise TaskError(f'the name "{task.name}" is that of a built-in task; choose another')
        if space is not None and space.name == paper_space().name:
            raise SpaceError(f'the space needs a name of its own; "{space.name}" is the default\'s')
        if self.out is None or self.force:
            return
        for place in _places(self.out, task.name, DesignSpace()):
            if os.path.lexists(place):
                raise _NameTakenError(f'the name "{task.name}" is taken ({place.name} exists already); choose another')

    def _head(self, words: str, assumed: Sequence[str], places: tuple[Path, ...]) -> str:
        """The comment at the top of a file."""
        lines = [
            "A draft that nobody has checked: check the numbers before you run it.",
            f"From the words: {one_line(words, LONGEST_NOTE)}",
            f"Drafted by {one_line(self._by(), 200)} on {date.today().isoformat()}, armwright {version('armwright')}.",
            *(["Assumed:"] if assumed else []),
            *(f"- {line}" for line in assumed),
        ]
        wrapped = [piece for line in lines for piece in textwrap.wrap(line, WIDTH, subsequent_indent="  ")]
        wrapped.append(LAST_OF_HEAD + one_line(_command(*places), LONGEST_COMMAND))
        return "".join(f"# {line}\n" for line in wrapped) + "\n"

    def _write(self, draft: Draft, out: Path) -> tuple[Path, ...]:
        """The files written; without `force`, none that came to be there meanwhile is replaced."""
        places = _places(out, draft.task.name, draft.space)
        for place, text in reversed(list(zip(places, (draft.task_yaml, draft.space_yaml), strict=False))):
            try:
                if self.force:
                    replace_file(place, text.encode())
                else:
                    with open(place, "xb") as file:
                        file.write(text.encode())
            except OSError as fault:
                raise FailureError(
                    f"cannot write {place}: {fault.strerror or fault}. {self._kept()}".strip()
                ) from fault
        return places

    def _by(self) -> str:
        """Who answers; a stand-in is never called a model."""
        model = str(self.configured.options.model)
        return model if self.backend.origin == "model" else f"a {self.backend.origin} stand-in for a model ({model})"

    def _check_price(self, prompt: str) -> None:
        """SettingsError where the first question alone may go beyond max_cost."""
        from armwright.llm.client import estimated_cost

        most = self._budget.max_cost
        if most is None:
            return
        options = self.configured.options
        cost = estimated_cost(options, estimated_tokens(prompt), ANSWER_TOKENS)
        if cost is None:
            raise SettingsError(
                f"the price of {options.model} is not known, so max_cost = {most:g} cannot hold; use max_calls"
            )
        if cost > most:
            raise SettingsError(f"a draft takes about {cost:.3f} USD, more than max_cost = {most:g}")

    def _failure(self, fault: ProposalError, refusal: str) -> ModelError:
        before = f"the answer was refused ({refusal}), and " if refusal else ""
        said = refusal or (isinstance(fault, CallError) and fault.reply.text.strip())
        kept = self._kept() if said else ""
        hint = "" if fault.kind == "budget" else "Check the model, its key and base_url; "
        return ModelError(
            f"no draft: {before}{one_line(str(fault), LONGEST_REFUSAL).rstrip('.')}. {kept}{hint}"
            "armwright init my-task.yaml writes a task to edit without a model",
            final=fault.kind if fault.final else None,
        )

    def _kept(self) -> str:
        return "" if self.out is None else f"What it said is in {self.out / DRAFTS}. "


def draft(
    words: str,
    options: ModelOptions | str | None = None,
    *,
    out: str | Path | None = None,
    force: bool = False,
) -> Draft:
    """Draft a task and, if the default does not fit, a design space from words, by a language model.

    Args:
        words: What the arm has to do, in any language.
        options: Which model, how it is called, what it may spend; or a model's name; None for the configured model.
        out: Folder for NAME.yaml, NAME-space.yaml and drafts.jsonl (the calls); None to write nothing.
        force: Replace files of these names.
    """
    return Drafter(drafting_model(options), None if out is None else Path(out), force).draft(words)


def drafting_model(options: ModelOptions | str | None = None) -> ConfiguredModel:
    """Return the configured model; SettingsError if there is none."""
    configured = configured_model(ModelOptions.of(options))
    if configured is None:
        raise SettingsError(
            "a draft needs a language model, and none is configured: give --model openai-chat:gpt-4o (with its key in "
            f"the environment), set ARMWRIGHT_MODEL, or name one in {configuration_path()}; without any, "
            "armwright init my-task.yaml writes a task to edit"
        )
    return configured


def _checked(text: str, model: type[Model], error: type[ArmwrightError]) -> Model:
    """The document as its model takes it, without anything hidden in its texts."""
    value = parse_document(text, model, error, "the task" if model is Task else "the space")
    for words in _texts(value.model_dump()):
        if any(unicodedata.category(letter) in ("Cc", "Cf", "Cs") and letter not in "\n\t" for letter in words):
            raise error(f"control characters are not allowed: {ascii(words)[:80]}")
    return value


def _texts(content: Any) -> Iterator[str]:
    if isinstance(content, str):
        yield content
    elif isinstance(content, dict):
        for key, value in cast("dict[Any, Any]", content).items():
            yield from _texts(key)
            yield from _texts(value)
    elif isinstance(content, (list, tuple)):
        for item in cast("list[Any]", content):
            yield from _texts(item)


def _is_default(space: DesignSpace) -> bool:
    return space.model_copy(update={"name": DesignSpace().name}) == DesignSpace()


def _places(out: Path | None, name: str, space: DesignSpace | None) -> tuple[Path, ...]:
    """Of the task's file and, where there is one, the space's."""
    folder = Path() if out is None else out
    return (folder / f"{name}.yaml", *([] if space is None else [folder / f"{name}-space.yaml"]))


def _command(task: Path, space: Path | None = None) -> str:
    words = ["armwright", "optimize", str(task), *([] if space is None else ["--space", str(space)])]
    return shlex.join(words)


def _make_folder(out: Path) -> None:
    """FailureError before anything is asked, rather than after it was paid for."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise FailureError(f"cannot write {out}: {fault.strerror or fault}") from fault
    if not os.access(out, os.W_OK):
        raise FailureError(f"cannot write {out}: no permission")
