"""A table of docs/validation.md: `edf stitch` on every pair of a folder, judged by an outside program.

    score_pairs.py [--pairs DIR] [--score SCORE.py] [--field FIELD] [-o OUTDIR]

Every folder of two pictures under --pairs ($EDF_DATA/pairs, else ../shared/data/pairs beside the checkout) is stitched
on the reference's plane; --score (default ../shared/tools/score.py) gets the pictures and the warp, and nothing else of
ours.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# The score is of the reference's own pixels: on its own plane, whole.
ON_REFERENCE = ("--projection", "reference", "--crop", "full")
COLUMNS = ("ov_psnr_rgb", "ov_ssim_g11", "proj_mean", "proj_floor", "proj_reached", "overlap_ratio", "folds")


def main() -> None:
    """Prints a table in Markdown, a row a pair."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    data = Path(os.environ.get("EDF_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--pairs", type=Path, default=data / "pairs")
    parser.add_argument("--score", type=Path, default=ROOT.parent / "shared" / "tools" / "score.py")
    parser.add_argument("--field", default="slack")
    parser.add_argument("-o", "--output", type=Path, default=Path("scored"))
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    print("| pair (size) | PSNR dB / SSIM | off lines | projectivity px (floor) | reached | overlap | folds | CPU s |")
    print("|---|---|---|---|---|---|---|---|")
    for folder in sorted(args.pairs.glob("*/")):
        pictures = [str(p) for p in sorted(folder.iterdir())[:2]]
        out = args.output / folder.name
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        edf = [sys.executable, "-m", "edf_stitch", "stitch", *pictures, "-o", f"{out}.png", *ON_REFERENCE]
        files = ["--field", args.field, "--warp", f"{out}.npz", "--report", f"{out}.json"]
        subprocess.run([*edf, *files, "--overwrite", "--quiet"], check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        scored = subprocess.run([sys.executable, args.score, *pictures, f"{out}.npz"], check=True, capture_output=True)
        value = json.loads(scored.stdout)
        psnr, ssim, line, floor, reached, overlap, folds = (value[name] for name in COLUMNS)
        report = json.loads(Path(f"{out}.json").read_text())
        size = "{width}×{height}".format(**report["pictures"][0])
        off = report["measured"]["off_line_mean_px"]
        print(
            f"| {folder.name} ({size}) | {psnr:.2f} / {ssim:.3f} | {off:.2f} | {line:.2f} ({floor:.2f}) "
            f"| {reached:.3f} | {overlap:.2f} | {folds:.2%} | {cpu:.1f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
