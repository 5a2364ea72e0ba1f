"""The content of the page: a run, and what is kept beside it, packed as bytes for the page's script.

report.html embeds these bytes.
"""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import to_json

from armwright.exceptions import RunFolderError
from armwright.existing.compare_arms import read_existing_arms
from armwright.files import MAX_DERIVED, read_text, replace_surrogates
from armwright.llm.transcript import TRANSCRIPTS, Transcript
from armwright.pictures.style import EXISTING, INFEASIBLE, JOINT, JOINT_LABEL, MISSED, OBSTACLE, TARGET, look
from armwright.proof.design_record import DESIGNS, design_name, read_records
from armwright.proof.results import COMMAND, read_summary
from armwright.proof.shown_run import Arrays, show_run, shown_facts
from armwright.runs.config import FrontMethod, Method
from armwright.runs.folder import read_run
from armwright.sheet.record import NOT_MODELLED

FILES = {"urdf": "arm.urdf", "mjcf": "arm.xml"}  # of designs of the front, by format
MAX_COMMAND = 64 * 1024  # [bytes]
COLOURS = {"missed": MISSED, "target": TARGET, "joint": JOINT, "obstacle": OBSTACLE, "infeasible": INFEASIBLE}


class RunContent:
    """A run folder as the page shows it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.config, self.history = read_run(folder)
        self.study: Method | None = None if isinstance(self.config.method, FrontMethod) else self.config.method
        summary = read_summary(folder)
        # A summary of another kind of run does not belong to this one.
        self.summary = summary if summary is not None and ("search" in summary) == (self.study is None) else None
        self.calls = Transcript(folder / TRANSCRIPTS, read_only=True).calls
        recommended = [self.history.member(one["design"]).number for one in (self.summary or {}).get("recommended", ())]
        numbers = dict.fromkeys([*(member.number for member in self.history.front), *recommended])
        self.records = read_records(folder, self.history, list(numbers))

    def packed(self) -> bytes:
        """Pack the run; with the files of its front if it has ended."""
        shown = show_run(self.config, self.history, self.summary, self.records)
        head = {
            **shown.head,
            "files": {number: _files(self.folder, number) for number in self.records}
            if self.summary is not None
            else {},
            "folder": replace_surrogates(self.folder.resolve().name),
            "command": _command(self.folder),
            "calls": [asdict(call) for call in self.calls],
            "existing_arms": [
                {"name": arm.name, "values": arm.values, "facts": shown_facts(arm.facts), "violated": arm.violated}
                for arm in read_existing_arms(self.folder, len(self.config.objectives))
            ],
            "existing": EXISTING._asdict(),
            "not_modelled": NOT_MODELLED,
            "looks": {source: look(source)._asdict() for source in shown.head["sources"]},
            "colours": COLOURS,
            "joint_labels": JOINT_LABEL,
        }
        return pack(head, shown.arrays)


def _command(folder: Path) -> str:
    try:
        return read_text(folder / COMMAND, MAX_COMMAND, ValueError).strip()
    except ValueError:  # a run by Python
        return ""


def _files(folder: Path, number: int) -> dict[str, str]:
    """Return the files of a design of the front, by format."""
    place = folder / DESIGNS / design_name(number)
    return {
        kind: read_text(place / name, MAX_DERIVED, RunFolderError)
        for kind, name in FILES.items()
        if (place / name).is_file()
    }


def pack(head: Mapping[str, Any], arrays: Arrays) -> bytes:
    """Pack a JSON head and arrays: the head's length (uint32, little-endian), the head, then the arrays.

    The head's "arrays" holds the type, the offset after the head [bytes] and the shape of each array. Offsets are
    multiples of 8, so that a script can use the arrays in place.
    """
    places: dict[str, Any] = {}
    parts: list[bytes] = []
    at = 0
    for name, array in arrays.items():
        data = np.ascontiguousarray(array.astype(array.dtype.newbyteorder("<"))).tobytes()
        places[name] = [array.dtype.name, at, list(array.shape)]
        parts.append(data + b"\0" * (-len(data) % 8))
        at += len(parts[-1])
    text = to_json({**head, "arrays": places}, inf_nan_mode="null")
    text += b" " * (-(len(text) + 4) % 8)
    return len(text).to_bytes(4, "little") + text + b"".join(parts)
