"""Replay of the proposals of a recorded run: a run folder, its transcript, or a shipped recording."""

import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, ProposalError, ReplayError, SettingsError, did_you_mean
from armwright.llm.backend import Question
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import PROMPTS, Prompt, load_prompt
from armwright.llm.recording_file import find_recording, shipped_recordings
from armwright.llm.replay_backend import ReplayBackend
from armwright.llm.transcript import LAST_STEPS, TRANSCRIPTS, Call, Transcript, hints_of, last_call
from armwright.proof.summary_file import ProposerSummary
from armwright.proposers.prompted import PromptedProposer
from armwright.proposers.proposer import Proposal
from armwright.runs.config import RunConfig
from armwright.runs.control import Hint
from armwright.runs.folder import CONFIG, read_config, read_run
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.runs.trials_file import TRIALS
from armwright.yaml_documents import check_document


class ReplayProposer(PromptedProposer):
    """Replays the transcript of a run, or a recording, without network or cost.

    With the settings of the recorded run, on the same machine with the same versions, the run is equal to the bit.

    Args:
        source: run folder, transcripts file, recording, or name of a shipped recording.
        strict: treat a prompt that differs from the recorded one as an error; otherwise it is reported. Recordings are
            shown with the prompts that they hold, whatever today's templates say.
        options: prompt and memory of a transcript without its config.yaml. Options that contradict the record are
            refused.
    """

    def __init__(self, source: str | Path, strict: bool = False, options: PromptOptions | None = None) -> None:
        self.source = str(source)
        self.recording = find_recording(self.source)
        recorded: RunConfig | None
        if self.recording is not None:
            file, calls, recorded = Path(self.source), self.recording.calls, self.recording.config
            self._trials: Sequence[FinishedTrial] = ()
        else:
            file, calls, recorded, self._trials = _read_transcript(Path(source))
        if not any(call.proposal for call in calls):
            raise ReplayError(f"{file} holds no proposal")
        name = next(call.proposal for call in calls if call.proposal).rpartition("-")[0]
        prompt, then = _as_recorded(file, recorded, calls, options or PromptOptions())
        self.replayed = ReplayBackend(calls, file, strict)
        super().__init__(self.replayed, then, name, prompt=prompt)

    def settings(self) -> Mapping[str, Any]:
        """Return the source of the replay, and how it was asked."""
        return {"replay": self.source, **super().settings()}

    def check(self) -> str:
        """Replay the recorded check, so that the summary is the same; it cannot fail."""
        was_checked = any(call.step == "check" and call.fault is None for call in self.replayed.calls)
        return super().check() if was_checked else ""

    def recorded_trials(self) -> Sequence[FinishedTrial]:
        """Return the trials of the recorded run; empty for a transcript without its run."""
        return self._trials

    def summary(self) -> ProposerSummary:
        """Return the summary of the replayed calls."""
        summary = super().summary()
        notes = {"replay": self.source, "differing_prompts": len(self.replayed.differing)}
        return replace(summary, notes={**summary.notes, **notes})

    def propose(self, history: History, seed: int, number: int) -> Sequence[Proposal]:
        """Return the recorded designs, or raise the recorded error."""
        identity = self.identity(number)
        try:
            proposals = super().propose(history, seed, number)
        except DesignError as error:
            raise ReplayError(f"{self.replayed.source}: the answer for {identity} was changed: {error}") from error
        except ProposalError as error:
            if error.kind != "missing":
                raise
            recorded = ProposalError(*self._why_missing(number))
            recorded.known = error.known
            raise recorded from error
        if identity not in self.replayed.differing:
            return proposals
        note = f"the prompt for {identity} differs from the recorded one"
        return [replace(proposals[0], note=note), *proposals[1:]]

    def question(self, history: History, seed: int, number: int) -> Question:
        """Return the next question for trial `number`; that of a recording as it was put then."""
        question = super().question(history, seed, number)
        call = last_call(self.replayed.calls, question.proposal, question.step) if self.recording else None
        return question if call is None else replace(question, prompt=call.prompt)

    def prompt_for(self, history: History, seed: int, number: int, hints: Sequence[Hint] = ()) -> str:
        """Return the prompt for trial `number`; empty for a recording, whose questions hold theirs."""
        return "" if self.recording else super().prompt_for(history, seed, number, hints)

    def next_hints(self, number: int) -> tuple[Hint, ...]:
        """Return the hints of the recorded question; there are no new ones."""
        return hints_of(self.replayed.calls, self.identity(number))

    def _why_missing(self, number: int) -> tuple[str, str]:
        recorded = next((t for t in self._trials if t.fault and t.request is not None and t.request[0] == number), None)
        if recorded is not None:  # never asked or not answered: no budget, or a model that was given up
            assert recorded.fault is not None
            return recorded.fault, f"recorded: {recorded.fault}"
        return "missing", f"{self.replayed.source} holds no proposal for trial {number}; check n_init and n_step"


def recorded_options(config: RunConfig | None) -> tuple[Prompt | None, PromptOptions]:
    """Return the prompt options of a run, and its prompt if that was a custom template."""
    settings = config.study.proposer if config is not None else None
    if not settings or "prompt" not in settings:
        return None, PromptOptions()
    own = Prompt(settings["prompt"], settings["template"]) if "template" in settings else None
    stated = {name: settings[name] for name in PromptOptions.model_fields if name in settings}
    name = stated["prompt"] if stated["prompt"] in PROMPTS else PROMPTS[0]
    return own, check_document({**stated, "prompt": name}, PromptOptions, SettingsError, f"{CONFIG}: proposer")


def _as_recorded(
    file: Path, config: RunConfig | None, calls: Sequence[Call], given: PromptOptions
) -> tuple[Prompt, PromptOptions]:
    """Return how a record was asked for; SettingsError if the given options contradict it."""
    if config is not None and "prompt" in (config.study.proposer or {}):
        own, recorded = recorded_options(config)
        prompt = own or load_prompt(recorded.prompt)
    else:  # a transcript alone does not name its prompt and memory
        prompt = load_prompt(given.prompt)
        recorded = options_of(calls).model_copy(update={"memory": given.memory, "others": given.others})
    for name, value in given.given.items():
        if name == "prompt":
            found, same = prompt.name, load_prompt(given.prompt).template == prompt.template
        elif name in PromptOptions.model_fields:
            found = getattr(recorded, name)
            same = found == value
        else:
            continue
        if not same:
            raise SettingsError(f"{file} was recorded with {name} = {found}; leave out {name} = {value}")
    return prompt, recorded


def options_of(calls: Sequence[Call]) -> PromptOptions:
    """Return the form of the answer and the number of designs per call, as far as calls show them."""
    proposed = [call for call in calls if call.proposal]
    if all(call.step != "answer" for call in proposed):
        form = "two-step"
    else:
        form = "text" if any(call.origin == "manual" for call in proposed) else "one-step"
    answers = [call.answer for call in proposed if call.step in LAST_STEPS and call.fault is None]
    return PromptOptions(answer=form, proposals=max(map(_designs, answers), default=1))


def _designs(answer: str) -> int:
    """Count the designs of a recorded answer."""
    with suppress(ValueError, TypeError, KeyError):  # one design, or a transcript edited by hand
        return max(1, len(json.loads(answer)["designs"]))
    return 1


def _read_transcript(source: Path) -> tuple[Path, Sequence[Call], RunConfig | None, Sequence[FinishedTrial]]:
    """Return the transcript of a run with its calls, and the run's settings and trials as far as they are there."""
    folder = source if source.is_dir() else source.parent
    file = folder / TRANSCRIPTS if source.is_dir() else source
    if not os.path.isfile(file):
        raise ReplayError(
            f"there is no {file} to replay.{did_you_mean(source.name, shipped_recordings())} Give a run folder, its "
            f"{TRANSCRIPTS}, or a recording: {', '.join(shipped_recordings())}"
        )
    calls = Transcript(file, read_only=True).calls
    config = read_config(folder) if (folder / CONFIG).is_file() else None
    trials = read_run(folder)[1].trials if config is not None and (folder / TRIALS).is_file() else ()
    return file, calls, config, trials
