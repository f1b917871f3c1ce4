"""What came of one pair or set, and how it is kept so that a later run goes on from there."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..output.json_file import json_bytes
from ..system.output_files import OutputFiles

PARTS, PICTURES = "parts", "pictures"


@dataclass
class Outcome:
    """The results of a pair or set: its entry in compare.json; pictures by path below `pictures`; CPU seconds by step;
    the exit code, not 0 if nothing could be stitched."""

    entry: dict[str, Any]
    pictures: dict[str, bytes] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    exit_code: int = 0

    def failed_at(self, name: str, message: str, exit_code: int) -> None:
        """Notes that a field or program made nothing, and why."""
        self.entry["fields"][name] = {"status": "failed", "message": message, "figures": {}, "pictures": {}}
        self.exit_code = self.exit_code or exit_code

    def settled(self) -> Outcome:
        """The same once all were tried: it failed if all of them did."""
        fields = self.entry["fields"].values()
        done = any(one["status"] == "done" for one in fields)
        self.entry["status"] = "done" if done else "failed"
        self.entry["message"] = "" if done else next((one["message"] for one in fields), "nothing was to be made")
        self.exit_code = 0 if done else self.exit_code
        return self

    def add_pictures(self, folder: Path, files: OutputFiles) -> None:
        """Stages its pictures below a comparison's folder."""
        for path, data in self.pictures.items():
            place = folder / PICTURES / path
            files.add_to_folder(place.parent, place.name, data)


def slug(name: str) -> str:
    """What a program is called in the names of its pictures."""
    return name.replace(" ", "_")


def mark_of(paths: Iterable[Path], *decided: object) -> str:
    """What tells whether a kept part is still right: of the files, as they are now, and of all that was decided."""
    digest = hashlib.sha256()
    for path in paths:
        about = path.stat() if path.exists() else None
        digest.update(repr((str(path.resolve()), about and (about.st_size, about.st_mtime_ns))).encode())
    digest.update(repr(decided).encode())
    return digest.hexdigest()


def kept_part(folder: Path, name: str, mark: str) -> Outcome | None:
    """What an earlier run left of a pair or set, if it was made of the same; its pictures are in place already."""
    try:
        content = json.loads((folder / PARTS / f"{name}.json").read_text("utf-8"))
        if content["mark"] != mark:
            return None
        return Outcome(content["entry"], {}, content["seconds"], content["exit_code"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep_part(folder: Path, name: str, mark: str, outcome: Outcome) -> None:
    """Puts a part and its pictures in place at once. Raises UnwritableOutput."""
    content = {"mark": mark, "entry": outcome.entry, "seconds": outcome.seconds, "exit_code": outcome.exit_code}
    with OutputFiles(overwrite=True) as files:
        outcome.add_pictures(folder, files)
        files.add_to_folder(folder / PARTS, f"{name}.json", json_bytes(content))
