"""Recordings of runs with a language model: packing, reading, damage."""

import lzma
from pathlib import Path

import pytest

from armwright.exceptions import ReplayError
from armwright.llm.recording_file import ENDING, read_recording, shipped_recordings


def lines_of(name: str) -> list[bytes]:
    return lzma.decompress(shipped_recordings()[name].read_bytes()).splitlines(keepends=True)


def packed(folder: Path, lines: list[bytes]) -> str:
    file = folder / f"mine{ENDING}"
    file.write_bytes(lzma.compress(b"".join(lines)))
    return str(file)


def test_shipped_recordings_are_complete_and_small() -> None:
    shipped = shipped_recordings()
    assert {name.partition("-plus")[0] for name in shipped} >= {"target-1", "target-2", "target-3"}
    assert sum(len(file.read_bytes()) for file in shipped.values()) < 1_000_000
    for name in shipped:
        recording = read_recording(name)
        study = recording.config.study
        due = range(study.n_init, study.n_trials, study.n_step)
        assert [call.proposal for call in recording.calls] == [f"llm-{number:04d}" for number in due], name
        assert all(call.prompt and call.answer and call.origin == "model" for call in recording.calls)
        assert "Its name and settings are not stated" in recording.provenance
        assert name.endswith(f"seed{recording.config.seed}")


def test_damaged_lines_are_one_error(tmp_path: Path) -> None:
    lines = lines_of("target-1-plus-seed0")
    for damaged in ([], [b"{}\n", *lines[1:]], [*lines[:5], lines[5][:40] + b"\n", *lines[6:]]):
        with pytest.raises(ReplayError, match="is damaged; restore the file"):
            read_recording(packed(tmp_path, damaged))
    file = Path(packed(tmp_path, lines))
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(ReplayError, match="cannot read the recording"):
        read_recording(str(file))


def test_files_that_are_no_recording_are_one_error(tmp_path: Path) -> None:
    with pytest.raises(ReplayError, match="cannot read the recording"):
        read_recording(str(tmp_path / f"none{ENDING}"))
    text = tmp_path / f"text{ENDING}"
    text.write_text("no xz", encoding="utf-8")
    with pytest.raises(ReplayError, match="cannot read the recording"):
        read_recording(str(text))


def test_a_folder_of_the_same_name_precedes_a_shipped_recording(in_folder: Path) -> None:
    assert read_recording("target-1-plus-seed0").calls
    (in_folder / "target-1-plus-seed0").mkdir()
    with pytest.raises(ReplayError, match=r"there is no .*transcripts\.jsonl to replay"):
        read_recording("target-1-plus-seed0")
