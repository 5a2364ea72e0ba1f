"""The two files that the editor writes: a task and its design space.

The page has their texts with LF line ends and no byte order mark, like any text field of a browser. `save` writes the
line ends, the mark, the mode and the symbolic links that it found; `notes` says before what it cannot keep.
"""

import codecs
import os
import re
import stat
from importlib import resources
from pathlib import Path
from string import Template

from pydantic import BaseModel, Field

from armwright.exceptions import FailureError, TaskError, UsageError
from armwright.files import decode_text, naming_write_errors, read_bytes, replace_file
from armwright.tasks.task_template import safe_name, task_template

MAX_BYTES = 256 * 1024  # a task of 3,000 targets; forms for more would be slow
SUFFIXES = (".yaml", ".yml")


class Texts(BaseModel, frozen=True):
    """The text of a task file and of a space file, or about them."""

    task: str = Field(max_length=MAX_BYTES)
    space: str = Field(max_length=MAX_BYTES)


class EditedFiles:
    """A task file and a space file (by default `default_space_file`).

    Those that do not exist yet begin with a template and are written by `save`.

    Raises:
        TaskError: A name does not end in .yaml, or a file cannot be read.
    """

    def __init__(self, task: Path, space: Path | None = None) -> None:
        self.task = task
        self.space = space or default_space_file(task)
        for file in (self.task, self.space):
            if file.suffix not in SUFFIXES:
                raise TaskError(f"{file}: expected a name that ends in .yaml, such as {file.stem}.yaml")
            if not file.parent.is_dir():
                raise TaskError(f"{file}: there is no folder {file.parent}")
        self._seen: dict[Path, bytes | None] = {file: _read(file) for file in (self.task, self.space)}

    @property
    def exist(self) -> bool:
        """Whether both files were there when they were last read or written."""
        return None not in self._seen.values()

    def texts(self) -> Texts:
        """Return the files as they were last read or written, or the templates."""
        task, space = self._seen[self.task], self._seen[self.space]
        return Texts(
            task=task_template(self.task) if task is None else decode_text(task, self.task, TaskError),
            space=space_template(self.space) if space is None else decode_text(space, self.space, TaskError),
        )

    @property
    def notes(self) -> Texts:
        """What saving a change of each file will change besides; empty for nothing."""
        task, space = (_note(file, content) for file, content in self._seen.items())
        return Texts(task=task, space=space)

    def save(self, texts: Texts, overwrite: bool = False) -> None:
        """Write both files; `overwrite` replaces even files that have changed since they were last read.

        Raises:
            UsageError: A file has changed, and `overwrite` is False.
            FailureError: A file cannot be written.
        """
        given = {self.task: texts.task, self.space: texts.space}
        if not overwrite:
            for file in given:
                if _read(file) != self._seen[file]:
                    raise UsageError(f"{file} has changed on disk since it was opened")
        for file, text in given.items():
            former = self._seen[file]
            if overwrite or former is None or text != decode_text(former, file, TaskError):
                content = _encode(text, former or b"")
                _write(file, content)
                self._seen[file] = content


def default_space_file(task: Path) -> Path:
    """Return the space file that belongs to a task file: `NAME-space.yaml` for `NAME.yaml` and `NAME-task.yaml`."""
    return task.with_name(f"{task.stem.removesuffix('-task')}-space{task.suffix}")


def space_template(file: Path) -> str:
    """Return a commented space file to edit; the file's stem becomes its name."""
    text = (resources.files("armwright.editor") / "space-template.yaml").read_text(encoding="utf-8")
    return Template(text).substitute(name=safe_name(file.stem))


def _read(file: Path) -> bytes | None:
    """Return the content of a file of text; None if it does not exist."""
    if not os.path.lexists(file):
        return None
    content = read_bytes(file, MAX_BYTES, TaskError)
    decode_text(content, file, TaskError)
    return content


def _encode(text: str, former: bytes) -> bytes:
    """Return a text as bytes, with the byte order mark and the line ends of the former content."""
    mark = codecs.BOM_UTF8 if former.startswith(codecs.BOM_UTF8) else b""
    return mark + text.encode().replace(b"\n", _line_end(former))


def _line_end(content: bytes) -> bytes:
    return b"\r\n" if b"\r\n" in content else b"\n"


def _note(file: Path, content: bytes | None) -> str:
    """Return what saving a change of a file does not keep."""
    if content is None:
        return ""
    notes: list[str] = []
    if set(re.findall(rb"\r\n|\r|\n", content)) - {_line_end(content)}:
        end = "CRLF" if b"\r\n" in content else "LF"
        notes.append(f"Saving a change of {file.name} writes the line end {end} in all lines.")
    if file.stat().st_nlink > 1:
        notes.append(f"The other names of {file.name} (hard links) keep the text from before a change.")
    return " ".join(notes)


def _write(file: Path, content: bytes) -> None:
    target = file.resolve()  # a link stays one
    with naming_write_errors(file, error=FailureError):
        mode = stat.S_IMODE(target.stat().st_mode) if target.exists() else None
        replace_file(target, content, 0o666 if mode is None else mode)
        if mode is not None:
            target.chmod(mode)  # of which the umask took something
