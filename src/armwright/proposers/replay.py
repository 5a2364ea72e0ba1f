"""Replay of the proposals of a recorded run: a run folder, or a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from armwright.exceptions import DesignError, ProposalError, ReplayError, SettingsError
from armwright.llm.backend import LlmBackend
from armwright.llm.model_options import PromptOptions
from armwright.llm.prompt import parameters_prompt
from armwright.llm.recording_file import read_recording
from armwright.llm.transcript import LAST_STEPS, Call, last_call
from armwright.proof.summary_file import ProposerSummary
from armwright.proposers.prompted import PromptedProposer, proposal_of
from armwright.proposers.proposer import Proposal
from armwright.runs.config import RunConfig
from armwright.runs.folder import CONFIG
from armwright.runs.history import History
from armwright.runs.trial import FinishedTrial
from armwright.yaml_documents import check_document


class ReplayProposer(PromptedProposer):
    """Replays the transcript of a run, or a recording, without network or cost.

    With the settings of the recorded run, on the same machine with the same versions, the run is equal to the bit.
    Prompts of a run folder that differ from the recorded ones are reported. Recordings are shown with the prompts that
    they hold, whatever today's templates say.

    Args:
        source: run folder, recording, or name of a shipped recording.
    """

    def __init__(self, source: str | Path) -> None:
        self.source = str(source)
        self.recording = read_recording(self.source)
        first = next((call for call in self.recording.calls if call.proposal), None)
        if first is None:
            raise ReplayError(f"{self.recording.file} holds no proposal")
        backend = LlmBackend(first.model, first.origin)
        super().__init__(backend, first.proposal.rpartition("-")[0], recorded_options(self.recording.config))
        self._differing: set[str] = set()  # ids of the proposals whose prompts differ

    def settings(self) -> Mapping[str, Any]:
        """Return the source of the replay, and how it was asked."""
        return {"replay": self.source, **super().settings()}

    def check(self) -> str:
        """Repeat the recorded check, so that the summary is the same."""
        checks = [call for call in self.recording.calls if call.step == "check" and call.fault is None]
        if checks:
            self._transcript.add(checks[0])
        return ""

    def recorded_trials(self) -> Sequence[FinishedTrial]:
        """Return the trials of the recorded run; empty for a recording."""
        return self.recording.trials

    def summary(self) -> ProposerSummary:
        """Return the summary of the replayed calls."""
        summary = super().summary()
        notes = {"replay": self.source, "differing_prompts": len(self._differing)}
        return replace(summary, notes={**summary.notes, **notes})

    def propose(self, history: History, seed: int, number: int) -> Proposal:
        """Return the recorded design, or raise the recorded error."""
        identity = self.identity(number)
        calls = [call for call in self.recording.calls if call.proposal == identity]
        asked = [] if self.recording.provenance else self._prompts(history, seed, number, calls)
        note = ""
        if any(call.prompt != prompt for call, prompt in zip(calls, asked, strict=False)):
            self._differing.add(identity)
            note = f"the prompt for {identity} differs from the recorded one"
        played = sum(call.proposal == identity for call in self._transcript.calls)  # by a replay that was killed
        for call in calls[played:]:
            self._transcript.add(call)
        last = calls[-1] if calls else None
        if last is not None and last.fault is not None:
            raise ProposalError(last.fault, last.error or last.fault)
        if last is None or last.step not in LAST_STEPS:
            raise ProposalError(*self._why_missing(number))
        try:
            return proposal_of(last, last.answer, history.problem, note)
        except DesignError as error:
            raise ReplayError(f"{self.recording.file}: the answer for {identity} was changed: {error}") from error

    def _prompts(self, history: History, seed: int, number: int, calls: Sequence[Call]) -> list[str]:
        """Return today's prompts of recorded calls for trial `number`."""
        first = self.prompt_for(history, seed, number)
        thoughts = last_call(calls, self.identity(number), "reasoning")
        second = "" if thoughts is None else parameters_prompt(history.problem, thoughts.answer)
        return [second if call.step == "parameters" else first for call in calls]

    def _why_missing(self, number: int) -> tuple[str, str]:
        trials = self.recording.trials
        fault = next((t.fault for t in trials if t.fault and t.request is not None and t.request[0] == number), None)
        if fault is not None:  # never asked or not answered: no budget, or a model that was given up
            return fault, f"recorded: {fault}"
        return "missing", f"{self.recording.file} holds no proposal for trial {number}; check n_init and n_step"


def recorded_options(config: RunConfig) -> PromptOptions:
    """Return the prompt options of a run; the defaults if it had no model."""
    settings = config.study.proposer or {}
    stated = {name: settings[name] for name in PromptOptions.model_fields if "prompt" in settings and name in settings}
    return check_document(stated, PromptOptions, SettingsError, f"{CONFIG}: proposer")
