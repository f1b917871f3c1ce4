"""Text that users write, and what is no text."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from edf_stitch.core.system.errors import BadRequest, UnreadableImage
from edf_stitch.core.system.text_files import name_in_table, printable, read_text


@pytest.mark.parametrize("written", ["a,b\nä\n".encode(), b"\xef\xbb\xbf" + "a,b\nä\n".encode()])
def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "list.csv").write_bytes(written)
    assert read_text(tmp_path / "list.csv", "the list", "") == "a,b\nä\n"


@pytest.mark.parametrize("written", [b"\xff\xfea\x00", b"a\x00b", b"caf\xe9"])
def test_what_is_no_text_is_refused_with_what_is_needed(tmp_path: Path, written: bytes) -> None:
    (tmp_path / "list.csv").write_bytes(written)
    with pytest.raises(BadRequest, match=r"list\.csv: not a text in UTF-8; the list is a CSV file: two columns"):
        read_text(tmp_path / "list.csv", "the list", "two columns")


def test_what_cannot_be_read_is_another_matter(tmp_path: Path) -> None:
    with pytest.raises(UnreadableImage, match="the list cannot be read") as refused:
        read_text(tmp_path / "none.csv", "the list", "")
    assert refused.value.exit_code == 4


def test_others_names_neither_steer_a_terminal_nor_end_a_line() -> None:
    said = printable("a\x1b[2J\r\nb\x07\x9b1m\u202egnp.exe\u2028\udcff c\u00e9\u3000\U0001f4f7.jpg")
    assert said == "a\\x1b[2J\\r\\nb\\x07\\x9b1m\\u202egnp.exe\\u2028\\udcff c\u00e9\u3000\U0001f4f7.jpg"


@pytest.mark.parametrize("name", ["=1+1.png", "+1.png", "-1.png", "@a.png"])
def test_no_name_is_a_formula_in_a_table(name: str) -> None:
    assert name_in_table(name) == f"./{name}" and Path(name_in_table(name)) == Path(name)
    assert name_in_table("a=1.png") == "a=1.png" and name_in_table("a\n=1.png") == "a\\n=1.png"


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="a device of Unix")
def test_a_device_which_may_have_no_end_is_not_read() -> None:
    with pytest.raises(UnreadableImage, match="the list cannot be read: /dev/zero is a device, not a file"):
        read_text(Path("/dev/zero"), "the list", "a,b")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of Unix")
def test_a_pipe_is_read_where_its_writer_is_there(tmp_path: Path) -> None:
    """What a shell's <(...) hands over; a pipe with a name waited for its writer for ever."""
    out, into = os.pipe()
    os.write(into, b"a,b\n")
    os.close(into)
    if Path(f"/dev/fd/{out}").is_fifo():
        assert read_text(Path(f"/dev/fd/{out}"), "the list", "") == "a,b\n"
    os.close(out)
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(UnreadableImage, match=r"pipe\.csv is a named pipe, not a file; name a file"):
        read_text(tmp_path / "pipe.csv", "the list", "a,b")
