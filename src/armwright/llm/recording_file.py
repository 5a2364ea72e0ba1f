"""Recordings: runs with a language model, packed into one small file each, to be replayed without a network.

A recording is xz-compressed text with one JSON document per line: a header (provenance, settings of the run), then the
calls in their order. `xzcat NAME.jsonl.xz` shows it. The recordings in recordings/ ship with armwright and are replayed
by name.
"""

import lzma
import os
from dataclasses import dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from pydantic import BaseModel, TypeAdapter, ValidationError

from armwright.exceptions import ReplayError
from armwright.llm.transcript import Call
from armwright.runs.config import RunConfig

ENDING = ".jsonl.xz"
MAX_RECORDING = 64 * 1024 * 1024  # [bytes] of text, far above the largest run


@dataclass(frozen=True)
class Recording:
    """A recorded run."""

    name: str  # of its file, without the ending
    provenance: str  # what answered, how and when
    config: RunConfig
    calls: tuple[Call, ...]  # with their whole prompts and answers

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


_CALL = TypeAdapter(Call)


@cache
def shipped_recordings() -> dict[str, Traversable]:
    """Return the files of the shipped recordings by name."""
    folder = resources.files("armwright.llm") / "recordings"
    files = sorted((file for file in folder.iterdir() if file.name.endswith(ENDING)), key=lambda file: file.name)
    return {file.name.removesuffix(ENDING): file for file in files}


def find_recording(name_or_path: str) -> Recording | None:
    """Return a recording by its file, or a shipped one by its name; None for anything else."""
    if name_or_path.endswith(ENDING):
        return read_recording(Path(name_or_path))
    shipped = shipped_recordings().get(name_or_path)
    return None if shipped is None or os.path.exists(name_or_path) else read_recording(shipped)


def read_recording(file: Path | Traversable) -> Recording:
    """Return a recording.

    Raises:
        ReplayError: The file cannot be read, is damaged or lacks lines.
    """
    try:
        with file.open("rb") as packed, lzma.open(packed) as content:
            text = content.read(MAX_RECORDING)
    except (OSError, EOFError, lzma.LZMAError) as fault:
        raise ReplayError(f"cannot read the recording {file}: {fault}") from fault
    lines = text.split(b"\n")[:-1]
    damaged = f"the recording {file} is damaged; restore the file"
    try:
        header = _Header.model_validate_json(lines[0] if lines else b"")
        calls = tuple(_CALL.validate_json(line) for line in lines[1:])
    except ValidationError as fault:
        raise ReplayError(damaged) from fault
    if len(calls) != header.calls:
        raise ReplayError(f"the recording {file} has {len(calls)} of its {header.calls} calls; restore the file")
    return Recording(file.name.removesuffix(ENDING), header.provenance, header.config, calls)
