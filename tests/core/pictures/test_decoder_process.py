"""Decoders in processes of their own: whatever becomes of these, a sentence comes out."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from edf_stitch.core.pictures import decoder_main, decoder_process
from edf_stitch.core.pictures.decoder_process import decoded
from edf_stitch.core.system.errors import UnreadableImage

Script = Callable[[str], None]


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Script:
    """Makes lines of Python the decoder."""

    def write(lines: str) -> None:
        (tmp_path / "decoder.py").write_text(f"import json, os, sys, time\nout = sys.stdout.buffer\n{lines}\n")
        monkeypatch.setattr(decoder_process, "SCRIPT", tmp_path / "decoder.py")

    return write


def refusal(data: bytes = b"data") -> str:
    with pytest.raises(UnreadableImage) as error:
        decoded("raw", data, {})
    return str(error.value)


def test_what_it_writes_comes_back(script: Script) -> None:
    script(
        "asked = json.loads(sys.stdin.buffer.readline())\ndata = sys.stdin.buffer.read()\n"
        "facts = {'bytes': len(data), 'said': asked['word'], 'kind': sys.argv[1]}\n"
        "out.write(json.dumps(facts).encode() + b'\\n' + data)"
    )
    data = bytes(range(256)) * 20_000  # more than any pipe holds
    facts, samples = decoded("heic", data, {"word": "hello"})
    assert (facts["said"], facts["kind"]) == ("hello", "heic") and samples.tobytes() == data


@pytest.mark.parametrize("lines", [
    "sys.stderr.write('words of a library'); os.abort()",
    "sys.stdin.buffer.read(); os.abort()", "sys.exit(3)", "out.write(b'no JSON\\n')", "",
    "out.write(b'{\"bytes\": 100}\\n' + bytes(50))",
    "out.write(b'{\"bytes\": 10}\\n' + bytes(10)); out.flush(); os.abort()",
])  # fmt: skip
def test_a_crash_is_a_sentence(script: Script, lines: str, capfd: pytest.CaptureFixture[str]) -> None:
    script(lines)
    for data in (b"data", bytes(10**6)):
        words = refusal(data)
        assert "the decoder of camera RAW files broke down over it (status" in words and "16-bit TIFF" in words
    assert not "".join(capfd.readouterr()), "nothing of its own reaches the user"


def test_a_decoder_that_hangs_is_ended(script: Script, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(decoder_process, "DECODING", replace(decoder_process.DECODING, most_seconds=1.0))
    script("sys.stdin.buffer.read(); time.sleep(600)")
    began = time.monotonic()
    assert "broke down over it" in refusal() and time.monotonic() < began + 300


def test_a_missing_library_is_named_with_what_to_do(script: Script) -> None:
    script("sys.stdin.buffer.read(); out.write(b'{\"missing\": \"No module named rawpy\"}\\n')")
    words = refusal()
    assert "camera RAW pictures need the package rawpy" in words and "pip install rawpy" in words and "TIFF" in words


def test_the_script_itself_says_what_is_missing_or_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "the camera RAW file cannot be decoded" in refusal() and "copy it again" in refusal()
    folders = [one for one in sys.path if "site-packages" not in one]
    monkeypatch.setattr(sys, "path", folders)
    assert "need the package rawpy, which cannot be loaded here (No module named" in refusal()


def test_libraries_are_found_where_blender_leaves_them_on_windows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "site" / "pi_heif-1.4.0.data" / "platlib"
    kept.mkdir(parents=True)
    found: list[str] = []
    monkeypatch.setattr(os, "add_dll_directory", found.append, raising=False)
    monkeypatch.setattr(sys, "path", [str(tmp_path), str(tmp_path / "site"), str(tmp_path / "missing")])
    decoder_main.find_libraries()
    assert found == [str(kept)]


def test_without_a_python_to_start_there_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("", "/nowhere/python"):
        monkeypatch.setattr(sys, "executable", name)
        assert "the decoder of camera RAW files cannot be started" in refusal()
