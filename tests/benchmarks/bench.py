"""`make bench`: what a stitch costs beside SIFT + one homography on the same features, in one run.

    bench.py [--sizes 0.3,1,3] [--runs 3] [--pairs DIR]

Prints wall and CPU seconds (medians) of whole processes, from start to written file, and their ratios: seconds differ
between machines, ratios hardly. Pairs: the folders of two pictures under --pairs ($EDF_DATA/pairs, else
../shared/data/pairs beside the checkout), resized; without any, a generated pair. OpenCV's Stitcher stands there for
information: it registers at 0.6 MP.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """Runs every program on every pair at every size and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="0.3,1,3", help="megapixels")
    parser.add_argument("--runs", type=int, default=3)
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--pairs", type=Path, default=data / "pairs")
    args = parser.parse_args()
    print(f"{'MP':>4} {'program':<22}{'wall s':>8}{'CPU s':>8}{'× homography CPU':>18}")
    for size in (float(s) for s in args.sizes.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            measure_size(size, args.runs, prepare(args.pairs, size, Path(folder)), Path(folder))


def measure_size(size: float, runs: int, pairs: list[tuple[Path, Path]], folder: Path) -> None:
    """One block of the table: the median over runs, summed over the pairs."""
    walls: dict[str, float] = {}
    cpus: dict[str, float] = {}
    stages: dict[str, float] = {}
    ratios: list[float] = []
    stitched = 0
    for reference, target in pairs:
        of_pair = {}
        for name, command in programs(reference, target, folder).items():
            taken = [run(command) for _ in range(runs)]
            if any(t is None for t in taken):
                continue
            wall, cpu = (statistics.median(t[k] for t in taken) for k in (0, 1))
            walls[name], cpus[name] = walls.get(name, 0) + wall, cpus.get(name, 0) + cpu
            of_pair[name] = cpu
            stitched += name == STITCHER
        ratios.append(of_pair[EDF] / of_pair[HOMOGRAPHY])
        run([*programs(reference, target, folder)[EDF], "--report", str(folder / "out.json")])  # not timed: by stage
        for stage, seconds in json.loads((folder / "out.timing.json").read_text())["seconds"].items():
            stages[stage] = stages.get(stage, 0) + seconds
    for name in walls:
        note = f"  ({stitched} of {len(pairs)} pairs)" if name == STITCHER else ""
        ratio = "" if note else f"{cpus[name] / cpus[HOMOGRAPHY]:.2f}"
        print(f"{size:>4g} {name:<22}{walls[name]:>8.2f}{cpus[name]:>8.2f}{ratio:>18}{note}")
    spread = f"median {statistics.median(ratios):.2f}, {min(ratios):.2f}–{max(ratios):.2f}"
    by_stage = ", ".join(f"{stage} {seconds:.2f}" for stage, seconds in stages.items())
    print(f"     ratio pair by pair: {spread}; edf's wall by stage: {by_stage}", flush=True)


EDF, HOMOGRAPHY, STITCHER = "edf stitch (strict)", "SIFT + homography", "OpenCV Stitcher"


def programs(reference: Path, target: Path, folder: Path) -> dict[str, list[str]]:
    """The command lines, each writing a PNG."""
    pair = [str(reference), str(target)]
    files = ["--overwrite", "--quiet"]
    edf = ["-m", "edf_stitch", "stitch", *pair, "-o", str(folder / "out.png"), "--field", "strict", "--no-dense"]
    here = [sys.executable, str(Path(__file__).with_name("homography_stitch.py"))]
    return {
        EDF: [sys.executable, *edf, *files],
        HOMOGRAPHY: [*here, *pair, str(folder / "homography.png")],
        STITCHER: [*here, "--opencv-stitcher", *pair, str(folder / "stitcher.png")],
    }


def run(command: list[str]) -> tuple[float, float] | None:
    """Wall and CPU seconds of a process and its children; None where it fails."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, cwd=ROOT)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        if "--opencv-stitcher" not in command:
            sys.exit(f"{' '.join(command)}\n{done.stderr.decode()}")
        return None
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def prepare(folder: Path, size: float, out: Path) -> list[tuple[Path, Path]]:
    """Pairs of about `size` megapixels as PNG files."""
    import cv2
    from edf_stitch.synthetic_scenes.two_planes import make_pair

    found = [sorted(p for p in pair.iterdir() if p.is_file())[:2] for pair in sorted(folder.glob("*/"))]
    pictures = [[cv2.imread(str(p)) for p in pair] for pair in found]
    if not pictures:
        pair = make_pair(1200, 900)
        pictures = [[pair.reference[..., ::-1], pair.target[..., ::-1]]]
    written = []
    for number, pair in enumerate(pictures):
        paths = []
        for name, picture in zip(("a", "b"), pair, strict=True):
            scale = (size * 1e6 / (picture.shape[0] * picture.shape[1])) ** 0.5
            how = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
            paths.append(out / f"{number}{name}.png")
            cv2.imwrite(str(paths[-1]), cv2.resize(picture, None, fx=scale, fy=scale, interpolation=how))
        written.append((paths[0], paths[1]))
    return written


if __name__ == "__main__":
    main()
