"""A stitch of a set that is ended or killed at any moment of its work leaves all that was asked for, or nothing."""

from __future__ import annotations

import os
import random
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture

from ..sets import FOCAL, make_set

pytestmark = [
    pytest.mark.slow,
    pytest.mark.soak,
    pytest.mark.skipif(not hasattr(os, "fork"), reason="kills forked processes"),
    pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning"),
]
KILLS = int(os.environ.get("EDF_SOAK_KILLS", 80))


class Runs:
    """Stitches of three pictures in forked processes, with a cache, into a folder that is emptied before."""

    def __init__(self, folder: Path) -> None:
        self.out, self.cache, self._said = folder / "out", folder / "cache", folder / "said"
        for picture in make_set(3, size=(240, 180)).pictures:
            (folder / picture.name).write_bytes(encode_picture(picture.pixels, None, 8, ".png")[0])
        names = {"-o": "out.png", "--report": "r.json", "--layers": "layers", "--warp": "w.npz",
                 "--cameras-out": "colmap", "--mesh": "m.glb"}  # fmt: skip
        self._words = [word for option, name in names.items() for word in (option, str(self.out / name))]
        pictures = [str(folder / f"{number}.png") for number in (1, 2, 3)]
        self._words = ["stitch", "--no-dense", "--focal-px", str(FOCAL), *pictures, *self._words]

    def run(self, moment: float, number: int) -> tuple[int, float, str]:
        """Exit code (the signal's, negative, where it ended the process), CPU s and what was said of a run that gets a
        signal after `moment` s of CPU, or none at 0."""
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir()
        child = os.fork()
        if not child:
            os.dup2(os.open(self._said, os.O_CREAT | os.O_TRUNC | os.O_WRONLY), 2)
            signal.signal(signal.SIGPROF, lambda *_: os.kill(os.getpid(), number))
            if number == signal.SIGKILL:
                signal.signal(signal.SIGPROF, signal.SIG_DFL)  # which ends it as suddenly, in the middle of any call
            signal.setitimer(signal.ITIMER_PROF, moment)
            code = 9
            try:
                code = main(self._words)
                signal.setitimer(signal.ITIMER_PROF, 0)
            finally:
                os._exit(code)
        _, status, used = os.wait4(child, 0)
        return os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, self._said.read_text("utf-8")

    def left(self) -> dict[str, bytes]:
        """What lies in the folder; not the times that it took."""
        files = [path for path in self.out.rglob("*") if path.is_file()]
        return {str(path.relative_to(self.out)): path.read_bytes() for path in files if ".timing" not in path.name}


@pytest.fixture
def runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Runs]:
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    yield Runs(tmp_path)


def test_a_set_ended_at_any_moment_is_whole_or_not_there(runs: Runs) -> None:
    code, seconds, _ = runs.run(0, signal.SIGINT)
    whole, ended = runs.left(), 0
    assert code == 0 and len(whole) > 10
    for seed in range(KILLS):
        chance = random.Random(seed)
        if chance.random() < 0.5:
            shutil.rmtree(runs.cache, ignore_errors=True)
        number = chance.choice((signal.SIGINT, signal.SIGTERM, signal.SIGKILL))
        code, _, said = runs.run(chance.uniform(0.01, seconds), number)
        left = runs.left()
        assert "Traceback" not in said and "internal error" not in said, (seed, said)
        ended += code != 0
        if code == 0:
            assert left == whole, seed
        elif number == signal.SIGKILL:
            there = {name: data for name, data in left.items() if ".edf-" not in name}
            assert code < 0 and all(data == whole[name] for name, data in there.items()), (seed, code, sorted(left))
        else:
            assert (code, left) == (130, {}) and said.endswith("edf: interrupted, nothing was written\n"), (seed, said)
            assert not list(runs.cache.glob(".*")), seed
    assert ended > KILLS / 3
    assert runs.run(0, signal.SIGINT)[0] == 0 and runs.left() == whole, "with what the cache holds by now"
