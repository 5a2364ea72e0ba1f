"""Recordings: runs with a language model, packed into one small file each, to be replayed without a network.

A recording is xz-compressed text with one JSON document per line: a header (provenance, settings of the run), then the
calls in their order. `xzcat NAME.jsonl.xz` shows it. The recordings in recordings/ ship with armwright and are replayed
by name.
"""

import json
import lzma
import os
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from armwright.exceptions import ReplayError
from armwright.llm.transcript import Call
from armwright.runs.config import RunConfig
from armwright.spaces.design_space import DesignSpace
from armwright.tasks.task import Task

ENDING = ".jsonl.xz"
MAX_RECORDING = 64 * 1024 * 1024  # [bytes] of text, far above the largest run


@dataclass(frozen=True)
class Recording:
    """A recorded run.

    Attributes:
        name: Name of its file, without the ending.
        provenance: What answered, how and when.
        config: Settings of the run.
        calls: Calls with their whole prompts and answers.
    """

    name: str
    provenance: str
    config: RunConfig
    calls: tuple[Call, ...]

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


def pack_recording(recording: Recording) -> bytes:
    """Return the content of a recording's file, without values of task and space that are the defaults."""
    header = _Header(provenance=recording.provenance, calls=len(recording.calls), config=recording.config)
    content = header.model_dump(mode="json")
    for name, model in (("task", Task), ("space", DesignSpace)):
        content["config"][name] = _without_defaults(content["config"][name], model)
    lines = [json.dumps(content), *(json.dumps(asdict(call)) for call in recording.calls)]
    return lzma.compress("".join(line + "\n" for line in lines).encode(), preset=9 | lzma.PRESET_EXTREME)


def _without_defaults(values: dict[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    defaults = {
        field.alias or name: field.get_default(call_default_factory=True) for name, field in model.model_fields.items()
    }
    plain = TypeAdapter(dict[str, Any]).dump_python(defaults, mode="json", warnings=False, fallback=lambda _: None)
    return {name: value for name, value in values.items() if value != plain[name]}


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
