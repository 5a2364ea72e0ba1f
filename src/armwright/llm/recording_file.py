"""Recorded runs with a language model, to be replayed without a network: run folders, or one small file each.

Such a file is xz-compressed text with one JSON document per line: a header (provenance, settings of the run), then the
calls in their order. `xzcat NAME.jsonl.xz` shows it. The files in recordings/ ship with armwright and are replayed by
name.
"""

import lzma
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from pydantic import BaseModel, ValidationError

from armwright.exceptions import ReplayError, did_you_mean
from armwright.llm.transcript import CALL, TRANSCRIPTS, Call, Transcript
from armwright.runs.config import RunConfig
from armwright.runs.folder import read_config, read_run
from armwright.runs.trial import FinishedTrial
from armwright.runs.trials_file import TRIALS

ENDING = ".jsonl.xz"
MAX_RECORDING = 64 * 1024 * 1024  # [bytes] of text, far above the largest run


@dataclass(frozen=True)
class Recording:
    """A recorded run."""

    file: str  # of the calls
    config: RunConfig
    calls: Sequence[Call]  # with their whole prompts and answers
    provenance: str = ""  # what answered, how and when; empty for a run folder
    trials: Sequence[FinishedTrial] = ()  # of a run folder

    @property
    def options(self) -> str:
        """The options of `armwright optimize` that give the same trials again."""
        study = self.config.study
        stated = {"seed": self.config.seed, "n-init": study.n_init, "n-step": study.n_step, "n-total": study.n_total}
        return " ".join(f"--{name} {value}" for name, value in stated.items())


class _Header(BaseModel, frozen=True, extra="forbid"):
    provenance: str
    calls: int  # number of lines that follow
    config: RunConfig


@cache
def shipped_recordings() -> dict[str, Traversable]:
    """Return the files of the shipped recordings by name."""
    folder = resources.files("armwright.llm") / "recordings"
    files = sorted((file for file in folder.iterdir() if file.name.endswith(ENDING)), key=lambda file: file.name)
    return {file.name.removesuffix(ENDING): file for file in files}


def read_recording(source: str) -> Recording:
    """Return a recorded run by its folder, its file, or the name of a shipped recording, which a folder precedes.

    Raises:
        ReplayError: There is none, or its file cannot be read, is damaged or lacks lines.
    """
    shipped = shipped_recordings()
    if source.endswith(ENDING):
        return _unpacked(Path(source))
    if source in shipped and not os.path.exists(source):
        return _unpacked(shipped[source])
    folder, file = Path(source), Path(source, TRANSCRIPTS)
    if not os.path.isfile(file):
        missing = file if folder.is_dir() else folder
        raise ReplayError(
            f"there is no {missing} to replay.{did_you_mean(folder.name, shipped)} Give a run folder, or a recording: "
            f"{', '.join(shipped)}"
        )
    calls = Transcript(file, read_only=True).calls
    trials = read_run(folder)[1].trials if (folder / TRIALS).is_file() else ()
    return Recording(str(file), read_config(folder), calls, trials=trials)


def _unpacked(file: Path | Traversable) -> Recording:
    try:
        with file.open("rb") as packed, lzma.open(packed) as content:
            text = content.read(MAX_RECORDING)
    except (OSError, EOFError, lzma.LZMAError) as fault:
        raise ReplayError(f"cannot read the recording {file}: {fault}") from fault
    lines = text.split(b"\n")[:-1]
    try:
        header = _Header.model_validate_json(lines[0] if lines else b"")
        calls = [CALL.validate_json(line) for line in lines[1 : 1 + header.calls]]
    except ValidationError as fault:
        raise ReplayError(f"the recording {file} is damaged; restore the file") from fault
    return Recording(str(file), header.config, calls, header.provenance)
