"""The files that the editor opens and writes."""

import codecs
import stat
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import armwright as aw
from armwright.editor.edited_files import MAX_BYTES, EditedFiles, Texts, default_space_file
from armwright.exceptions import FailureError, TaskError


@pytest.mark.parametrize(
    ("task", "space"),
    [("my.yaml", "my-space.yaml"), ("a/my-task.yml", "a/my-space.yml"), ("task.yaml", "task-space.yaml")],
)
def test_a_space_file_is_named_after_its_task(task: str, space: str) -> None:
    assert default_space_file(Path(task)) == Path(space)


def test_new_files_begin_with_templates_and_are_written_by_save(tmp_path: Path) -> None:
    files = EditedFiles(tmp_path / "new.yaml")
    assert not files.exist
    files.save(files.texts())
    assert files.exist
    task, space = aw.load_task(tmp_path / "new.yaml"), aw.load_space(tmp_path / "new-space.yaml")
    assert task.name == "new"
    assert space.actuators
    assert aw.Problem(task, space).objectives


def test_a_file_that_changed_or_appeared_on_disk_is_kept(tmp_path: Path) -> None:
    files = EditedFiles(tmp_path / "new.yaml")
    files.save(files.texts())
    (tmp_path / "new.yaml").write_text("name: theirs\n", encoding="utf-8")
    mine = Texts(task="name: mine\n", space=files.texts().space)
    with pytest.raises(aw.UsageError, match=r"new\.yaml has changed"):
        files.save(mine)
    assert (tmp_path / "new.yaml").read_text(encoding="utf-8") == "name: theirs\n"
    files.save(mine, overwrite=True)
    assert (tmp_path / "new.yaml").read_text(encoding="utf-8") == "name: mine\n"
    files.save(Texts(task="name: later\n", space=mine.space))
    later = EditedFiles(tmp_path / "later.yaml")
    (tmp_path / "later-space.yaml").write_text("name: theirs\n", encoding="utf-8")
    with pytest.raises(aw.UsageError, match=r"later-space\.yaml"):
        later.save(later.texts())
    assert not (tmp_path / "later.yaml").exists()


def test_links_and_modes_stay(tmp_path: Path) -> None:
    (tmp_path / "real.yaml").write_text("name: one\n", encoding="utf-8")
    (tmp_path / "real.yaml").chmod(0o600)
    (tmp_path / "link.yaml").symlink_to(tmp_path / "real.yaml")
    files = EditedFiles(tmp_path / "link.yaml")
    files.save(Texts(task="name: two\n", space=files.texts().space))
    assert (tmp_path / "link.yaml").is_symlink()
    assert (tmp_path / "real.yaml").read_text(encoding="utf-8") == "name: two\n"
    assert stat.S_IMODE((tmp_path / "real.yaml").stat().st_mode) == 0o600


lines = st.text(st.characters(codec="utf-8", exclude_characters="\r\n", exclude_categories=["Cs"]), max_size=20)


@given(st.lists(lines, min_size=1), st.sampled_from(("\n", "\r\n")), st.booleans(), st.data())
def test_line_ends_and_the_mark_stay(written: list[str], end: str, has_mark: bool, data: st.DataObject) -> None:
    """The page shows LF, as text fields do, and no mark; a change of a line changes the bytes of this line."""
    mark = codecs.BOM_UTF8 if has_mark else b""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "task.yaml"
        before = mark + f"# first{end}{end.join(written)}".encode()
        file.write_bytes(before)
        files = EditedFiles(file)
        texts = files.texts()
        assert texts.task == "\n".join(["# first", *written])
        assert files.notes == Texts(task="", space="")
        files.save(texts)
        assert file.read_bytes() == before
        changed = data.draw(st.integers(0, len(written) - 1))
        written[changed] = data.draw(lines)
        files.save(Texts(task="\n".join(["# first", *written]), space=texts.space))
        assert file.read_bytes() == mark + f"# first{end}{end.join(written)}".encode()
        assert EditedFiles(file).texts().task == "\n".join(["# first", *written])


def test_what_saving_does_not_keep_is_announced(tmp_path: Path) -> None:
    file = tmp_path / "task.yaml"
    mixed = b"name: one\r\n# a\r# b\n"
    file.write_bytes(mixed)
    (tmp_path / "other.yaml").hardlink_to(file)
    files = EditedFiles(file)
    assert files.notes.task == (
        "Saving a change of task.yaml writes the line end CRLF in all lines. "
        "The other names of task.yaml (hard links) keep the text from before a change."
    )
    assert files.notes.space == ""
    files.save(files.texts())
    assert file.read_bytes() == mixed
    files.save(Texts(task="name: two\n# a\n# b\n", space=files.texts().space))
    assert file.read_bytes() == b"name: two\r\n# a\r\n# b\r\n"
    assert (tmp_path / "other.yaml").read_bytes() == mixed
    assert files.notes == Texts(task="", space="")


@pytest.mark.parametrize("content", [b"\xff\xfe", b"#" * (MAX_BYTES + 1)])
def test_what_is_no_text_or_too_long_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "task.yaml").write_bytes(content)
    with pytest.raises(TaskError, match=r"task\.yaml"):
        EditedFiles(tmp_path / "task.yaml")


def test_a_folder_in_the_place_of_a_file_is_an_error(tmp_path: Path) -> None:
    files = EditedFiles(tmp_path / "task.yaml")
    (tmp_path / "task.yaml").mkdir()
    with pytest.raises((FailureError, TaskError)):
        files.save(files.texts(), overwrite=True)
