"""Replay of the proposals of a recorded run: a run folder, or a recording."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, ProposalError, ReplayError, SettingsError, did_you_mean
from armwright.llm.backend import Question
from armwright.llm.model_options import PromptOptions
from armwright.llm.recording_file import find_recording, shipped_recordings
from armwright.llm.replay_backend import ReplayBackend
from armwright.llm.transcript import TRANSCRIPTS, Transcript, hints_of, last_call
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
        source: run folder, recording, or name of a shipped recording.
        strict: treat a prompt that differs from the recorded one as an error; otherwise it is reported. Recordings are
            shown with the prompts that they hold, whatever today's templates say.
    """

    def __init__(self, source: str | Path, strict: bool = False) -> None:
        self.source = str(source)
        self.recording = find_recording(self.source)
        self._trials: Sequence[FinishedTrial] = ()
        if self.recording is not None:
            file, calls, config = Path(self.source), self.recording.calls, self.recording.config
        else:
            folder = Path(source)
            file = folder / TRANSCRIPTS
            if not os.path.isfile(file):
                missing = file if folder.is_dir() else folder
                raise ReplayError(
                    f"there is no {missing} to replay.{did_you_mean(folder.name, shipped_recordings())} Give a run "
                    f"folder, or a recording: {', '.join(shipped_recordings())}"
                )
            calls, config = Transcript(file, read_only=True).calls, read_config(folder)
            self._trials = read_run(folder)[1].trials if (folder / TRIALS).is_file() else ()
        if not any(call.proposal for call in calls):
            raise ReplayError(f"{file} holds no proposal")
        name = next(call.proposal for call in calls if call.proposal).rpartition("-")[0]
        self.replayed = ReplayBackend(calls, file, strict)
        super().__init__(self.replayed, recorded_options(config), name)

    def settings(self) -> Mapping[str, Any]:
        """Return the source of the replay, and how it was asked."""
        return {"replay": self.source, **super().settings()}

    def check(self) -> str:
        """Replay the recorded check, so that the summary is the same; it cannot fail."""
        was_checked = any(call.step == "check" and call.fault is None for call in self.replayed.calls)
        return super().check() if was_checked else ""

    def recorded_trials(self) -> Sequence[FinishedTrial]:
        """Return the trials of the recorded run; empty for a recording."""
        return self._trials

    def summary(self) -> ProposerSummary:
        """Return the summary of the replayed calls."""
        summary = super().summary()
        notes = {"replay": self.source, "differing_prompts": len(self.replayed.differing)}
        return replace(summary, notes={**summary.notes, **notes})

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        """Return the recorded design, or raise the recorded error."""
        identity = self.identity(number)
        try:
            proposal = super().propose(history, seed, number)
        except DesignError as error:
            raise ReplayError(f"{self.replayed.source}: the answer for {identity} was changed: {error}") from error
        except ProposalError as error:
            if error.kind != "missing":
                raise
            recorded = ProposalError(*self._why_missing(number))
            recorded.known = error.known
            raise recorded from error
        if identity not in self.replayed.differing:
            return proposal
        return replace(proposal, note=f"the prompt for {identity} differs from the recorded one")

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


def recorded_options(config: RunConfig) -> PromptOptions:
    """Return the prompt options of a run; the defaults if it had no model."""
    settings = config.study.proposer or {}
    stated = {name: settings[name] for name in PromptOptions.model_fields if "prompt" in settings and name in settings}
    return check_document(stated, PromptOptions, SettingsError, f"{CONFIG}: proposer")
