"""A cache of results on disk, by the content that they are computed from.

A key is a digest of everything that decides a result: pixels, matches, cameras, options, this program's own source and
the libraries' versions. So entries are never stale, and a damaged one counts as absent. Entries are arrays and plain
values of our own dataclasses, never pickles: reading one runs no code.
"""

from __future__ import annotations

import json
import os
import secrets
import sys
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from typing import IO, Any, TypeVar

import cv2
import numpy as np
import poselib
import scipy
from numpy.typing import NDArray

from .options import SYSTEM

Result = TypeVar("Result")
# The package of the whole engine, whichever name it is installed under.
_PACKAGE = __name__.rpartition(".system")[0]
_PLAN = "plan.json"


def default_folder(environ: Mapping[str, str] = os.environ) -> Path | None:
    """Where the system keeps what can be made again: EDF_CACHE if set, else its own place; None where it has none."""
    if environ.get("EDF_CACHE"):
        return Path(environ["EDF_CACHE"])
    home = environ.get("USERPROFILE" if sys.platform == "win32" else "HOME")
    own, below_home = {
        "win32": ("LOCALAPPDATA", "AppData/Local"), "darwin": ("", "Library/Caches"),
    }.get(sys.platform, ("XDG_CACHE_HOME", ".cache"))  # fmt: skip
    place = environ.get(own) or (str(Path(home, below_home)) if home else "")
    return Path(place, "edf_stitch") if place and Path(place).is_absolute() else None


class Cache:
    """Results in a folder, or nowhere (None): then everything is worked out anew, with the same outcome.

    Nothing here fails a stitch: a folder that cannot be written or read is as good as none. Safe with several processes
    at once, since entries appear whole and never change.
    """

    def __init__(self, folder: Path | None, limit: int = SYSTEM.cache_bytes) -> None:
        self._folder, self._limit = folder, limit

    def remember(self, what: str, decided_by: tuple[Any, ...], make: Callable[[], Result]) -> Result:
        """Return the stored result of an earlier call, or call `make` and store what it returns.

        Parameters
        ----------
        what : str
            Names the computation.
        decided_by : tuple
            Everything the result depends on: dataclasses of this package, arrays, plain values, tuples of them.
            Anything else is not stored, nor is a result of another type.
        make : callable
            Computes the result; what it raises is passed on.

        Returns
        -------
        The result, equal bit for bit whether it was stored or not, and whatever is worked out of it.
        """
        path = None
        if self._folder is not None:
            with suppress(_Unknown):
                path = self._folder / f"{_digest(what, decided_by)}.npz"
        found: Result | None = None if path is None else _read(path)
        if found is not None:
            return found
        made = make()
        arrays: list[NDArray[Any]] = []
        try:
            plan = _plan(made, arrays)
        except _Unknown:
            return made
        if path is not None:
            self._keep(path, plan, arrays)
        if all(array.flags.forc for array in arrays):
            return made
        result: Result = _value(plan, [_as_kept(array) for array in arrays])
        return result

    def _keep(self, path: Path, plan: Any, arrays: list[NDArray[Any]]) -> None:
        size = sum(array.nbytes + 300 for array in arrays) + 1000
        if size > self._limit // SYSTEM.cache_entry_part:
            return
        temporary = path.with_name(f".{secrets.token_hex(8)}.tmp")
        try:
            path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self._make_room(size)
            with open(temporary, "xb") as file:
                _write(file, path.stem, plan, arrays)
            os.replace(temporary, path)
        except OSError:  # full, read-only, or cleared by somebody in this moment
            pass
        finally:  # KeyboardInterrupt too
            with suppress(OSError):
                temporary.unlink(missing_ok=True)

    def _make_room(self, wanted: int) -> None:
        """Takes away what was used longest ago, and what killed processes left, until so many bytes have room."""
        assert self._folder is not None
        entries = []
        with os.scandir(self._folder) as listed:
            for entry in listed:
                with suppress(OSError):
                    facts = entry.stat(follow_symlinks=False)
                    if entry.name.endswith((".npz", ".tmp")):
                        entries.append((facts.st_mtime, facts.st_size, entry.path))
        spare = self._limit - wanted - sum(size for _, size, _ in entries)
        for _, size, path in sorted(entries):
            if spare >= 0:
                return
            with suppress(OSError):
                os.unlink(path)
            spare += size


class _Unknown(TypeError):
    """A value of a type that cannot be kept."""


def _read(path: Path) -> Any:
    """What an entry holds; None where there is none, or none that is sound."""
    try:
        with open(path, "rb") as file:
            value = _unpacked(file, path.stem)
        os.utime(path)  # used just now
        return value
    except FileNotFoundError:
        return None
    except Exception:  # rotten in whatever way: zip, JSON and arrays each have errors of their own
        with suppress(OSError):
            path.unlink()
        return None


def _write(file: IO[bytes], name: str, plan: Any, arrays: list[NDArray[Any]]) -> None:
    """An .npz with the plan of a value in JSON, which names the entry too."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(_PLAN, json.dumps({"name": name, "value": plan}))
        for number, array in enumerate(arrays):
            with archive.open(f"{number}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)  # type: ignore[no-untyped-call]  # keeps the order of its axes too


def _unpacked(file: IO[bytes], name: str) -> Any:
    with zipfile.ZipFile(file) as archive:  # checks every member's checksum while reading
        plan = json.loads(archive.read(_PLAN))
        if plan["name"] != name:
            raise ValueError("an entry under another's name")
        arrays = []
        for number in range(len(archive.namelist()) - 1):
            with archive.open(f"{number}.npy") as member:
                arrays.append(np.lib.format.read_array(member, allow_pickle=False))  # type: ignore[no-untyped-call]
    return _value(plan["value"], arrays)


def _plan(value: Any, arrays: list[NDArray[Any]]) -> Any:
    """The value as JSON: arrays by their number, NumPy's scalars as arrays of no dimension (their type counts)."""
    if value is None or isinstance(value, (bool, int, str)) or type(value) is float:
        return value
    if isinstance(value, (np.ndarray, np.generic)):
        if value.dtype.hasobject:
            raise _Unknown(value.dtype.name)
        arrays.append(np.asarray(value))
        return {"array": len(arrays) - 1, "scalar": isinstance(value, np.generic)}
    if isinstance(value, tuple):
        return {"tuple": [_plan(part, arrays) for part in value]}
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, bytes):
        arrays.append(np.frombuffer(value, np.uint8))
        return {"bytes": len(arrays) - 1}
    module = type(value).__module__
    if not is_dataclass(value) or not module.startswith(f"{_PACKAGE}."):
        raise _Unknown(type(value).__name__)
    parts = {field.name: _plan(getattr(value, field.name), arrays) for field in fields(value) if field.init}
    return {"class": [module.removeprefix(_PACKAGE), type(value).__qualname__], "fields": parts}


def _value(plan: Any, arrays: list[NDArray[Any]]) -> Any:
    if not isinstance(plan, dict):
        return plan
    if "array" in plan:
        array = arrays[plan["array"]]
        return array[()] if plan["scalar"] else array
    if "tuple" in plan:
        return tuple(_value(part, arrays) for part in plan["tuple"])
    if "path" in plan:
        return Path(plan["path"])
    if "bytes" in plan:
        return arrays[plan["bytes"]].tobytes()
    module, name = plan["class"]
    kind: Any = getattr(import_module(module, _PACKAGE), name)
    ours = is_dataclass(kind) and kind.__module__.startswith(f"{_PACKAGE}.")
    if not ours:
        raise ValueError("no dataclass of this package")
    return kind(**{name: _value(part, arrays) for name, part in plan["fields"].items()})


def _as_kept(array: NDArray[Any]) -> NDArray[Any]:
    """An array as it lies in memory once it has been kept: sums and products of one that lies otherwise, like every
    second column of another, are rounded otherwise."""
    return array if array.flags.forc else np.ascontiguousarray(array)


def _digest(what: str, decided_by: tuple[Any, ...]) -> str:
    arrays: list[NDArray[Any]] = []
    plan = _plan(decided_by, arrays)
    digest = blake2b(json.dumps([what, _code(), plan]).encode(), digest_size=20)
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data if array.size else b"")
    return digest.hexdigest()


@lru_cache
def _code() -> str:
    """A digest of this program's own source and of the libraries' versions: other code, other results."""
    digest = blake2b(f"{sys.version}{sys.byteorder}".encode(), digest_size=20)
    here = Path(__file__).parents[1]  # all of core, whatever its folders
    for path in sorted(here.rglob("*.py")):
        digest.update(str(path.relative_to(here)).encode() + path.read_bytes())
    for library in (np, scipy, cv2, poselib):
        digest.update(f"{library.__name__}{getattr(library, '__version__', '')}".encode())
    return digest.hexdigest()
