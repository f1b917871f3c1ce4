"""Decoders that may crash or hang on damaged files, each file in a process of its own.

The libraries for HEIC and camera RAW are native code that is fed with whatever a card, a phone or the net brought
along. A crash there ends that process, and the stitch says which file it was. Nor do their own messages reach the user,
or their libraries Blender, which has others of the same names.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from ..system.errors import UnreadableImage
from .options import DECODING

SCRIPT = Path(__file__).with_name("decoder_main.py")
# What a kind is called in messages, the package that reads it, and what helps where that is missing or fails.
_KINDS = {
    "heic": ("HEIC", "pi-heif", "export it as JPEG or TIFF"),
    "raw": ("camera RAW", "rawpy", "develop it in a RAW converter and export a 16-bit TIFF"),
}


def decoded(kind: str, data: bytes, asked: dict[str, Any]) -> tuple[dict[str, Any], NDArray[np.uint8]]:
    """Decode a file.

    Parameters
    ----------
    kind : str
        heic or raw.
    data : bytes
        The file.
    asked : dict
        What `decoder_main` is asked for.

    Returns
    -------
    facts : dict
        What it says about the picture.
    samples : (N,) uint8 array
        As they lie in memory; none where none were asked for.

    Raises
    ------
    UnreadableImage
        The file cannot be decoded, the library for it is missing, or its decoder crashed or did not end.
    """
    name, package, advice = _KINDS[kind]
    try:
        process = _started(kind)
    except (OSError, ValueError) as error:
        raise UnreadableImage(f"the decoder of {name} files cannot be started ({error}); {advice}") from error
    late = threading.Timer(DECODING.most_seconds, process.kill)
    late.start()
    try:
        with process:
            assert process.stdin is not None and process.stdout is not None
            with suppress(OSError):  # it has ended already; the status says how
                process.stdin.write(json.dumps(asked).encode() + b"\n")
                process.stdin.write(data)
            with suppress(OSError):  # what it has not read goes with it
                process.stdin.close()
            facts = _facts(process.stdout.readline())
            samples = _rest_of(process.stdout, facts.get("bytes", 0))
    except BaseException:
        process.kill()
        raise
    finally:
        late.cancel()
    if "missing" in facts:
        raise UnreadableImage(
            f"{name} pictures need the package {package}, which cannot be loaded here ({facts['missing']}); install it "
            f"with “pip install {package}” (in Blender: reinstall the extension), or {advice}"
        )
    if "trouble" in facts:
        raise UnreadableImage(
            f"the {name} file cannot be decoded: it is damaged or of an unusual kind ({facts['trouble']}); copy it "
            f"again, or {advice}"
        )
    if process.returncode != 0 or "bytes" not in facts or len(samples) != facts["bytes"]:
        raise UnreadableImage(
            f"the decoder of {name} files broke down over it (status {process.returncode}): the file is damaged, too "
            f"large for the memory, or of a kind it does not master; copy it again, or {advice}"
        )
    return facts, samples


def _started(kind: str) -> subprocess.Popen[bytes]:
    # Blender ignores the user's Python variables, and its extensions' folders reach this process by sys.path only: what
    # can be imported here can be there, and nothing else.
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    environment |= {
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
    }  # fmt: skip
    return subprocess.Popen(
        [sys.executable, "-s", "-S", "-P", str(SCRIPT), kind], env=environment, stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),  # Windows would open a console
    )  # fmt: skip


def _facts(line: bytes) -> dict[str, Any]:
    try:
        facts = json.loads(line)
    except ValueError:
        return {}
    return facts if isinstance(facts, dict) else {}


def _rest_of(stream: IO[bytes], count: int) -> NDArray[np.uint8]:
    """So many bytes, read to where they are needed; fewer where the stream ends before."""
    samples = np.empty(count, np.uint8)
    at, view = 0, memoryview(samples.data)
    while at < count:
        read = stream.readinto(view[at:])  # type: ignore[attr-defined]
        if not read:
            break
        at += read
    return samples[:at]
