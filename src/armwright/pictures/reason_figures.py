"""The reasons a proposer gave for a design, drawn as text."""

import textwrap
from typing import Any

from matplotlib.figure import Figure

from armwright.experiments.run_record import RunSummary
from armwright.llm.transcript import TRANSCRIPTS, Transcript
from armwright.runs.history import History

STEPS = ("reasoning", "answer", "parameters")  # transcript steps that contain a model's reasons, the best first
MAX_REASONS_LENGTH = 5_200  # characters; longer text loses its middle
LINE_LENGTH = 104  # characters


def draw_reasons(run: RunSummary, history: History, solutions: tuple[int, int] | None) -> Figure | None:
    """Draw the reasons given for Solution 1, or for the proposal on the front that is nearest to it.

    None without such a proposal or without reasons. `solutions` are the numbers of Solutions 1 and 2.
    """
    if solutions is None or not run.proposer:
        return None
    proposed = [member.number for member in history.front if history.trials[member.number].proposal is not None]
    within = [n for n in proposed if history.values[n, 0] >= history.values[solutions[0], 0]]
    if not within:
        return None
    number = within[0]
    trial = history.trials[number]
    calls = Transcript(run.folder / TRANSCRIPTS, read_only=True).calls
    answered = [call for call in calls if call.proposal == trial.proposal and call.fault is None]
    call = next((call for step in STEPS for call in answered if call.step == step), None)
    text = call.answer if call is not None else trial.reason
    if not text.strip():
        return None
    source = "the built-in rules" if call is None else f"{call.model} ({call.origin})"
    which = "Solution 1" if number == solutions[0] else "the proposal on the front that is nearest to Solution 1"
    title = f"{run.task}, {run.method}, seed {run.seed}: why #{number}, {which}, was proposed by {source}"
    return _draw_text(title, _shortened(text))


def _shortened(text: str) -> str:
    if len(text) <= MAX_REASONS_LENGTH:
        return text
    half = MAX_REASONS_LENGTH // 2
    return f"{text[:half].rstrip()}\n\n[… {len(text) - 2 * half:,} characters …]\n\n{text[-half:].lstrip()}"


def _draw_text(title: str, text: str) -> Figure:
    """Draw plain text as a figure; markup is not interpreted."""
    plain = "".join(c for c in text if c.isprintable() or c == "\n")
    lines = [part for whole in plain.splitlines() for part in textwrap.wrap(whole, LINE_LENGTH) or [""]]
    height = 0.7 + 0.148 * len(lines)
    figure = Figure(figsize=(8.0, height))
    form: dict[str, Any] = {"va": "top", "parse_math": False}
    figure.text(0.02, 1 - 0.15 / height, textwrap.fill(title, 90), fontsize=9, weight="bold", **form)
    figure.text(0.02, 1 - 0.5 / height, "\n".join(lines), fontsize=7.5, family="monospace", linespacing=1.2, **form)
    return figure
