"""Draft a task and a design space from a description, by a language model, for the user to check and edit.

Nothing is run. Only files that their own models accept are written; every call is kept in drafts.jsonl.
"""

import errno
import json
import os
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import BaseModel

from armwright.exceptions import FailureError, ModelError, ProposalError, SettingsError, SpaceError, TaskError
from armwright.files import naming_write_errors, replace_file
from armwright.llm.backend import MAX_REQUESTS, CallError, OutputFormat, Question
from armwright.llm.configuration import ConfiguredModel, configuration_path, configured_model
from armwright.llm.draft_prompt import draft_prompt, draft_schema
from armwright.llm.model_options import ModelOptions
from armwright.llm.prompt import estimated_tokens
from armwright.llm.servers import describe_server
from armwright.llm.session import LlmSession
from armwright.llm.transcript import Call, Transcript
from armwright.problem.checks.instant import check_instantly, stop_if_proven
from armwright.problem.problem import Problem
from armwright.proof.summary_file import ProposerSummary
from armwright.spaces.design_space import DesignSpace, paper_space
from armwright.tasks.catalogue import builtin_names
from armwright.tasks.task import Task
from armwright.text import map_text, one_line, visible
from armwright.yaml_documents import check_document, document_keys, dump_document, parse_document

DRAFTS = "drafts.jsonl"  # transcript of the calls, next to the files
ANSWER_TOKENS = 2000  # estimated length of an answer
N_TRIED = 64  # designs evaluated to check that objectives, actuators and targets fit together
MAX_NOTE_LENGTH, MAX_COMMAND_LENGTH = 1000, 4000  # characters in a file's comment
MAX_LINE_LENGTH, MAX_LINES = 400, 40  # of assumptions and of questions
MAX_FAULT_LENGTH = 600  # characters
WIDTH = 110  # of comments
WITHOUT_A_MODEL = "armwright init my-task.yaml writes a task to edit without a model"

Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class Draft:
    """A drafted task and design space."""

    task: Task
    space: DesignSpace | None  # None if the default fits
    assumptions: tuple[str, ...]  # what the model assumed, one sentence each
    questions: tuple[str, ...]  # what the model would like to know, one sentence each
    task_yaml: str  # content of the task's file, without the comment at its top
    space_yaml: str  # the same of the space; empty if there is none
    by: str  # who answered
    usage: ProposerSummary  # calls, tokens and cost
    files: tuple[Path, ...] = ()  # where it was written; empty if it was not

    @property
    def problem(self) -> Problem:
        """The problem that `armwright optimize` would search."""
        return Problem(self.task, self.space or paper_space())

    @property
    def command(self) -> str:
        """The command that searches it, for a shell."""
        task, *spaces = map(str, self.files or _places(Path(), self.task.name, self.space is not None))
        return shlex.join(["armwright", "optimize", task, *(part for space in spaces for part in ("--space", space))])

    def record(self) -> dict[str, Any]:
        """Return the draft as JSON."""
        usage = asdict(self.usage)
        return {
            "files": [str(path) for path in self.files],
            "by": self.by,
            **{name: usage[name] for name in ("origin", "calls", "input_tokens", "output_tokens", "cost_usd")},
            "assumptions": list(self.assumptions),
            "questions": list(self.questions),
            "task": self.task.model_dump(mode="json"),
            "space": self.space and self.space.model_dump(mode="json"),
        }


class Drafter(LlmSession):
    """Ask a language model for drafts, with a budget for each; `out` and `force` are as in `draft`."""

    def __init__(self, configured: ConfiguredModel, out: Path | None = None, force: bool = False) -> None:
        from armwright.llm.client import ModelClient

        options = configured.options
        super().__init__(ModelClient(options), "draft", options)
        self.configured = configured
        self.out = out
        self.force = force
        self._identity = ""
        if out is not None:
            with naming_write_errors(out, error=FailureError):  # before a call is paid for, not after it
                out.mkdir(parents=True, exist_ok=True)
                if not os.access(out, os.W_OK):
                    raise PermissionError(errno.EACCES, "no permission")
            self._transcript = Transcript(out / DRAFTS)

    def forecast(self, description: str) -> str:
        """Return the model and the estimated tokens and cost, in one line."""
        from armwright.llm.prices import describe_cost

        given, configured = _input_tokens(description), self.configured
        cost = describe_cost(configured.options, 1, given, ANSWER_TOKENS)
        return (
            f"asking {self._by()}{describe_server(configured.options)}, named by {configured.named_by}: "
            f"about {given:,} tokens in, {ANSWER_TOKENS:,} out, up to {MAX_REQUESTS} times; {cost}"
        )

    def _calls(self) -> Sequence[Call]:
        """Return the calls of this draft: each draft has a budget of its own."""
        return [call for call in self._transcript.calls if call.proposal == self._identity]

    def draft(self, description: str) -> Draft:
        """Return the draft of a description, written if there is a folder; ModelError if no valid one came."""
        n_drafts = len({call.proposal for call in self._transcript.calls})
        self._identity = f"draft-{n_drafts + 1:04d}"
        question = Question(self._identity, "draft", draft_prompt(description))
        self._check_price(description)
        self.backend.begin()
        drafts: list[Draft] = []

        def read(content: Mapping[str, Any] | str) -> str:
            assert not isinstance(content, str)  # models answer in JSON
            drafts.append(self._read(map_text(content, visible)))
            return json.dumps(content, ensure_ascii=False)

        try:
            self._ask(question, OutputFormat(draft_schema(), read))
        except ProposalError as fault:
            raise self._failure(fault) from fault
        draft = replace(drafts[-1], usage=self.summary())
        return draft if self.out is None else self._written(draft, description, self.out)

    def _read(self, content: Mapping[str, Any]) -> Draft:
        """Return the draft that an answer holds; UsageError refuses it."""
        task, task_yaml = _document(content.get("task"), Task, TaskError, "task")
        space, space_yaml = _document(content.get("space") or {}, DesignSpace, SpaceError, "space")
        if space.model_copy(update={"name": DesignSpace().name}) == DesignSpace():
            space, space_yaml = None, ""
        self._check_names(task, space)
        if not task.provenance.strip():
            raise TaskError("task: provenance is missing; state what the targets were made from and what was assumed")
        problem = Problem(task, space or paper_space())
        stop_if_proven(check_instantly(problem))
        problem.evaluate(problem.space.sample(N_TRIED, 0))
        assumptions, questions = (_lines(content.get(key)) for key in ("assumptions", "questions"))
        return Draft(task, space, assumptions, questions, task_yaml, space_yaml, self._by(), self.summary())

    def _check_names(self, task: Task, space: DesignSpace | None) -> None:
        if task.name in builtin_names():
            raise TaskError(f'the name "{task.name}" is that of a built-in task; choose another')
        if space is not None and space.name == paper_space().name:
            raise SpaceError(f'the space needs its own name; "{space.name}" is the default\'s')
        if self.out is None or self.force:
            return
        for place in _places(self.out, task.name, True):
            if os.path.lexists(place):
                raise TaskError(
                    f'the name "{task.name}" is taken: {place.name} exists (--force replaces it); choose another'
                )

    def _written(self, draft: Draft, description: str, out: Path) -> Draft:
        """Return the draft with its files, which are written; without `force`, none that appeared is replaced."""
        draft = replace(draft, files=_places(out, draft.task.name, draft.space is not None))
        head = _head(draft, description)
        for place, text in reversed(list(zip(draft.files, (draft.task_yaml, draft.space_yaml), strict=False))):
            with naming_write_errors(place, f". {self._kept()}", FailureError):
                if not self.force:
                    place.touch(exist_ok=False)
                replace_file(place, (head + text).encode())
        return draft

    def _by(self) -> str:
        """Return who answers; a stand-in is never called a model."""
        model = str(self.configured.options.model)
        return model if self.backend.origin == "model" else f"a {self.backend.origin} stand-in for a model ({model})"

    def _check_price(self, description: str) -> None:
        """Raise SettingsError if the first question alone may exceed max_cost."""
        from armwright.llm.prices import estimated_cost

        options = self.configured.options
        if options.max_cost is None:
            return
        cost = estimated_cost(options, 1, _input_tokens(description), ANSWER_TOKENS)
        if cost is None:
            raise SettingsError(f"the price of {options.model} is unknown; use max_calls instead of max_cost")
        if cost > options.max_cost:
            raise SettingsError(f"a draft takes about {cost:.3f} USD, more than max_cost = {options.max_cost:g}")

    def _failure(self, fault: ProposalError) -> ModelError:
        answered = isinstance(fault, CallError) and fault.reply.answer.strip()
        advice = "Describe it in other words" if answered else "Check the model, its key and base_url"
        reason = one_line(str(fault), MAX_FAULT_LENGTH).rstrip(".")
        return ModelError(
            f"no draft: {reason}. {self._kept() if answered else ''}{advice}; {WITHOUT_A_MODEL}",
            final=fault.kind if fault.final else None,
        )

    def _kept(self) -> str:
        return "" if self.out is None else f"The answer is in {self.out / DRAFTS}. "


def draft(
    description: str,
    options: ModelOptions | str | None = None,
    *,
    out: str | Path | None = None,
    force: bool = False,
) -> Draft:
    """Draft a task and, if the default does not fit, a design space from a description, by a language model.

    Args:
        description: What the arm has to do, in any language.
        options: Which model, how it is called, what it may spend; or a model's name; None for the configured model.
        out: Folder for NAME.yaml, NAME-space.yaml and drafts.jsonl (the calls); None to write nothing.
        force: Replace files of these names.
    """
    return Drafter(drafting_model(options), None if out is None else Path(out), force).draft(description)


def drafting_model(options: ModelOptions | str | None = None) -> ConfiguredModel:
    """Return the configured model; SettingsError if there is none."""
    configured = configured_model(ModelOptions.of(options))
    if configured is None:
        raise SettingsError(
            "a draft needs a language model, and none is configured: give --model openai-chat:gpt-4o (with its key in "
            f"the environment), set ARMWRIGHT_MODEL, or name one in {configuration_path()}; {WITHOUT_A_MODEL}"
        )
    return configured


def _document(content: Any, schema: type[Model], error: type[Exception], where: str) -> tuple[Model, str]:
    """Return the value of an answer's part, and the YAML that states it without the keys that have their default.

    The YAML is read back like a file: what is written is what was checked.
    """
    if not isinstance(content, dict):
        raise error(f"{where}: expected an object with the keys {', '.join(document_keys(schema))}")
    given = {key: item for key, item in cast("dict[str, Any]", content).items() if item is not None}
    value = check_document(given, schema, error, where)
    names = document_keys(schema)
    defaults = {name: field.get_default(call_default_factory=True) for name, field in schema.model_fields.items()}
    text = dump_document({k: item for k, item in given.items() if getattr(value, names[k]) != defaults[names[k]]})
    if parse_document(text, schema, error, where) != value:
        raise error(f"{where}: expected plain text and numbers")
    return value, text


def _lines(content: Any) -> tuple[str, ...]:
    """Return the sentences of a list in an answer."""
    lines = cast("list[Any]", content) if isinstance(content, list) else [content or ""]
    return tuple(one_line(str(line), MAX_LINE_LENGTH) for line in lines[:MAX_LINES] if str(line).strip())


def _head(draft: Draft, description: str) -> str:
    """Return the comment at the top of a file."""
    lines = [
        "A draft that nobody has checked: check the numbers before you run it.",
        f"From the description: {one_line(description, MAX_NOTE_LENGTH)}",
        f"Drafted by {one_line(draft.by, 200)} on {date.today().isoformat()}, armwright {version('armwright')}.",
        *(f"Assumed: {line}" for line in draft.assumptions),
        *(f"Open question: {line}" for line in draft.questions),
    ]
    wrapped = [piece for line in lines for piece in textwrap.wrap(line, WIDTH, subsequent_indent="  ")]
    wrapped.append(f"Run it with:  {one_line(draft.command, MAX_COMMAND_LENGTH)}")
    return "".join(f"# {line}\n" for line in wrapped) + "\n"


def _input_tokens(description: str) -> int:
    return estimated_tokens(draft_prompt(description) + json.dumps(draft_schema()))


def _places(folder: Path, name: str, with_space: bool) -> tuple[Path, ...]:
    """Return the path of the task's file and, if there is one, of the space's."""
    return (folder / f"{name}.yaml", *([folder / f"{name}-space.yaml"] * with_space))
