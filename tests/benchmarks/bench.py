"""`make bench`: what a stitch costs beside what others take for the same pixels, in one run.

    bench.py [--sizes 0.3,1,3] [--runs 3] [--pairs DIR] [--most 2] [--programs edf,sparse,...]

Whole processes, from start to written file: wall and CPU seconds (medians over runs, summed over pairs), the ratio to
SIFT + one homography on the same features (in CPU; the median pair, least and most), and peak memory (the largest).
Seconds differ between machines, ratios hardly. Then the default's wall by stage (FILE.timing.json).

Pairs: the folders of two pictures under --pairs ($EDF_DATA/pairs, else ../shared/data/pairs beside the checkout),
resized; without any, a generated pair. --most: at most so many of them, spread evenly. Hugin is run where it is
installed; OpenCV's Stitcher stands there for information: it registers at 0.6 MP, and does not succeed on every pair.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = [sys.executable, str(Path(__file__).with_name("homography_stitch.py"))]
EDF = [sys.executable, "-m", "edf_stitch", "stitch"]
FILES = ["--overwrite", "--quiet"]
PLAIN = ["--no-dense", "--seam", "none", "--no-exposure"]
YARDSTICK = "SIFT + homography"
# name on the command line: name in the table
PROGRAMS = {
    "homography": YARDSTICK, "edf": "edf stitch", "sparse": "edf stitch, sparse", "preview": "edf stitch, preview",
    "again": "edf stitch, again", "rew": "edf stitch, rew", "opencv": "OpenCV Stitcher", "hugin": "Hugin",
    "floor": "floor",
}  # fmt: skip
HUGIN = """set -e; cd "$1"; rm -f hugin*
pto_gen -o hugin.pto "$2" "$3"; cpfind --multirow -o hugin.pto hugin.pto; cpclean -o hugin.pto hugin.pto
autooptimiser -a -m -l -s -o hugin.pto hugin.pto; pano_modify --canvas=AUTO --crop=AUTO -o hugin.pto hugin.pto
hugin_executor --stitching --prefix=hugin hugin.pto; test -e hugin.tif"""


@dataclass
class Row:
    """One program at one size: of every pair (wall, CPU s, peak MB), and its CPU as a multiple of the yardstick's."""

    taken: list[tuple[float, float, float]] = field(default_factory=list)
    ratios: list[float] = field(default_factory=list)


def main() -> None:
    """Runs every program on every pair at every size and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="0.3,1,3", help="megapixels")
    parser.add_argument("--runs", type=int, default=3)
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--pairs", type=Path, default=data / "pairs")
    parser.add_argument("--most", type=int, default=99, help="pairs")
    parser.add_argument("--programs", default=",".join(PROGRAMS), help="the first is always run")
    args = parser.parse_args()
    wanted = [name for name in PROGRAMS if name in {"homography", *args.programs.split(",")}]
    print(f"{'MP':>4} {'program':<22}{'wall s':>8}{'CPU s':>8}{'× homography (CPU)':>22}{'peak MB':>9}")
    for size in (float(s) for s in args.sizes.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            pairs = prepare(args.pairs, size, args.most, Path(folder))
            measure_size(size, args.runs, pairs, wanted, Path(folder))


def measure_size(size: float, runs: int, pairs: list[tuple[Path, Path]], wanted: list[str], folder: Path) -> None:
    """One block of the table."""
    rows = {name: Row() for name in wanted}
    stages: dict[str, float] = {}
    for reference, target in pairs:
        yardstick = 0.0
        for name in wanted:
            command = program(name, reference, target, folder)
            taken = [run(command, folder, name in ("opencv", "hugin")) for _ in range(runs)] if command else [None]
            done = [one for one in taken if one is not None]
            if len(done) < len(taken):
                continue
            wall, cpu, peak = (statistics.median(one[k] for one in done) for k in range(3))
            yardstick = cpu if name == "homography" else yardstick
            rows[name].taken.append((wall, cpu, peak))
            rows[name].ratios.append(cpu / yardstick)
        if "edf" in wanted:
            line = [*EDF, str(reference), str(target), "-o", str(folder / "out.png"), *FILES, "--no-cache"]
            run([*line, "--report", str(folder / "out.json")], folder)  # not timed: by stage
            for stage, seconds in json.loads((folder / "out.timing.json").read_text())["seconds"].items():
                stages[stage] = stages.get(stage, 0) + seconds
    for name, row in rows.items():
        if not row.taken:
            print(f"{size:>4g} {PROGRAMS[name]:<22}{'-':>8}")
            continue
        walls, cpus, peaks = zip(*row.taken, strict=True)
        spread = f"{statistics.median(row.ratios):.2f} ({min(row.ratios):.2f}–{max(row.ratios):.2f})"
        note = f"  {len(row.taken)} of {len(pairs)} pairs" if len(row.taken) < len(pairs) else ""
        print(f"{size:>4g} {PROGRAMS[name]:<22}{sum(walls):>8.2f}{sum(cpus):>8.2f}{spread:>22}{max(peaks):>9.0f}{note}")
    if stages:
        by_stage = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in stages.items())
        print(f"     edf stitch, wall by stage: {by_stage}", flush=True)


def program(name: str, reference: Path, target: Path, folder: Path) -> list[str]:
    """The command line, which writes a picture; empty where the program is not there."""
    pair = [str(reference), str(target)]
    edf = [*EDF, *pair, "-o", str(folder / "out.png"), *FILES]
    if name == "again":  # the same pair with another blend, once its alignment is kept
        subprocess.run(edf, env=environment(folder), check=True)
        return [*edf, "--blend", "feather"]
    if name == "floor":
        return [*HERE, "--floor", *pair, str(folder / "out.png"), str(folder / "floor.png")]
    if name == "hugin":
        there = shutil.which("hugin_executor") and shutil.which("cpfind")
        return ["bash", "-c", HUGIN, "hugin", str(folder), *pair] if there else []
    return {
        "homography": [*HERE, *pair, str(folder / "homography.png")],
        "opencv": [*HERE, "--opencv-stitcher", *pair, str(folder / "stitcher.png")],
        "edf": [*edf, "--no-cache"],
        "sparse": [*edf, "--no-cache", *PLAIN, "--blend", "feather", "--field", "strict"],
        "preview": [*edf, "--no-cache", *PLAIN, "--blend", "linear", "--field", "strict"],
        "rew": [*edf, "--no-cache", *PLAIN, "--blend", "feather", "--field", "rew", "--projection", "reference"],
    }[name]


def environment(folder: Path) -> dict[str, str]:
    """What every program runs in: one BLAS thread, and a cache of its own."""
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1", "EDF_CACHE": str(folder / "cache")}


def run(command: list[str], folder: Path, may_fail: bool = False) -> tuple[float, float, float] | None:
    """Wall and CPU seconds and peak MB of a process with all it waits for; None where it fails and may."""
    with open(folder / "said", "w+b") as said:
        start = time.perf_counter()
        job = subprocess.Popen(command, env=environment(folder), stdout=said, stderr=subprocess.STDOUT, cwd=ROOT)
        _, status, used = os.wait4(job.pid, 0)
        wall = time.perf_counter() - start
        job.returncode = os.waitstatus_to_exitcode(status)
        if job.returncode:
            said.seek(0)
            return None if may_fail else sys.exit(f"{' '.join(command)}\n{said.read().decode()}")
    return wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def prepare(folder: Path, size: float, most: int, out: Path) -> list[tuple[Path, Path]]:
    """Pairs of about `size` megapixels as JPEG files of the best quality, as cameras write them."""
    import cv2
    import numpy as np
    from edf_stitch.synthetic_scenes.two_planes import make_pair

    found = [sorted(p for p in pair.iterdir() if p.is_file())[:2] for pair in sorted(folder.glob("*/"))]
    chosen = np.unique(np.linspace(0, len(found) - 1, min(most, len(found))).round().astype(int))
    pictures = [[cv2.imread(str(p)) for p in found[number]] for number in chosen]
    if not pictures:
        pair = make_pair(1200, 900)
        pictures = [[pair.reference[..., ::-1], pair.target[..., ::-1]]]
    written = []
    for number, pair in enumerate(pictures):
        paths = []
        for name, picture in zip(("a", "b"), pair, strict=True):
            scale = (size * 1e6 / (picture.shape[0] * picture.shape[1])) ** 0.5
            how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
            paths.append(out / f"{number}{name}.jpg")
            resized = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=how)
            cv2.imwrite(str(paths[-1]), resized, [cv2.IMWRITE_JPEG_QUALITY, 97])
        written.append((paths[0], paths[1]))
    return written


if __name__ == "__main__":
    main()
