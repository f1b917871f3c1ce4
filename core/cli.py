"""The `edf` command: one parser behind `edf`, `python -m edf_stitch` and `blender -b --command edf`.

Nothing heavy is imported before the arguments are understood.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from .errors import BadRequest, Cancelled, StitchError

# What DESIGN names and what is not there yet is refused by name, so that nobody takes silence for success.
FIELD_CHOICES, FIELDS_TO_COME = ("strict",), ("slack", "paper", "rew", "apap", "homography")
BLEND_CHOICES, BLENDS_TO_COME = ("feather", "linear"), ("multiband",)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        print(f"{self.prog}: {message}", file=sys.stderr)
        raise SystemExit(2)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code (DESIGN 5: 0, 1, 2, 3, 4, 130)."""
    # before NumPy loads: BLAS gives other bytes with other thread counts, and the same call owes the same bytes
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    # a farm ends a job with SIGTERM: leave as cleanly as after Ctrl-C
    main_thread = threading.current_thread() is threading.main_thread()
    previous = signal.signal(signal.SIGTERM, _interrupt) if main_thread else None
    # a shell starts background jobs with SIGINT ignored; whoever sends one to a stitch wants it to stop
    previous_int = signal.signal(signal.SIGINT, signal.default_int_handler) if main_thread else None
    try:
        args = _parser().parse_args(argv)
        return args.run(args)
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except KeyboardInterrupt:
        print("edf: interrupted, nothing was written", file=sys.stderr)
        return Cancelled.exit_code
    except StitchError as error:
        print(f"edf: {error}", file=sys.stderr)
        return error.exit_code
    except MemoryError:
        print("edf: not enough memory for pictures of this size; use smaller ones", file=sys.stderr)
        return 3
    except Exception as error:  # a bug or a library's refusal: the user gets a sentence all the same
        print(f"edf: internal error, please report it: {type(error).__name__}: {error}", file=sys.stderr)
        return StitchError.exit_code
    finally:
        if main_thread:
            signal.signal(signal.SIGTERM, previous if previous is not None else signal.SIG_DFL)
            signal.signal(signal.SIGINT, previous_int if previous_int is not None else signal.SIG_DFL)


def _interrupt(_number: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="edf",
        description="Stitches two photographs taken from different places into one picture seen from the first place.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_stitch(commands.add_parser("stitch", help="stitch a pair into one panorama", description=_STITCH))
    _add_demo(commands.add_parser("demo", help="make a pair, stitch it, say what was measured", description=_DEMO))
    return parser


class _Version(argparse.Action):
    def __call__(self, *_: object) -> NoReturn:
        from importlib import import_module

        print(import_module(__package__.rpartition(".")[0]).__version__)
        raise SystemExit(0)


_STITCH = """Stitch TARGET into the plane of REF. REF keeps every pixel it has; TARGET slides along its epipolar lines
to meet it. Messages go to stderr. Exit codes: 0 done, 2 the call is wrong, 3 the pictures can't be stitched, 4 a file
can't be read or written, 130 interrupted."""

_DEMO = "Make two pictures of a small scene through known cameras, stitch them, and compare with the truth."


def _add_stitch(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_stitch)
    parser.add_argument(
        "reference", metavar="REF", type=Path, help="the picture whose plane and place the panorama keeps"
    )
    parser.add_argument(
        "target", metavar="TARGET", type=Path, nargs="+", help="the picture to warp into it (one, for now)"
    )
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT", help=".png, .jpg, .tif (8 or 16 bit) or .exr (float)"
    )

    camera = parser.add_argument_group(
        "cameras", "One value serves both pictures; two are for REF,TARGET. Without any: EXIF, or an estimate."
    )
    camera.add_argument("--focal-px", type=_numbers, default=(), metavar="F[,F2]", help="focal length in pixels")
    camera.add_argument(
        "--focal-mm", type=_numbers, default=(), metavar="F[,F2]", help="focal length in mm (with --sensor-mm)"
    )
    camera.add_argument(
        "--sensor-mm",
        type=_numbers,
        default=(),
        metavar="W[,W2]",
        help="width of the sensor in mm, along the longer side",
    )
    camera.add_argument("--focal35", type=_numbers, default=(), metavar="F[,F2]", help="35 mm equivalent focal length")
    camera.add_argument(
        "--principal",
        type=_numbers,
        default=(),
        metavar="X,Y[,X2,Y2]",
        help="principal point in pixels (default: the middle)",
    )
    camera.add_argument(
        "--cameras", type=Path, metavar="FILE.json", help="per picture K, optionally distortion, R and t"
    )

    how = parser.add_argument_group("how")
    how.add_argument(
        "--field",
        default="strict",
        type=_choice(FIELD_CHOICES, FIELDS_TO_COME),
        metavar="FIELD",
        help="displacement field: strict",
    )
    how.add_argument(
        "--fade",
        default="plane",
        type=_choice(("plane",), ("infinity",)),
        help="what it fades to outside the overlap: plane",
    )
    how.add_argument(
        "--dense",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="dense refinement in the overlap (yet to come)",
    )
    how.add_argument(
        "--projection",
        default="perspective",
        type=_choice(("perspective",), ("cylindrical", "equirectangular")),
        help="perspective",
    )
    how.add_argument(
        "--blend",
        default="feather",
        type=_choice(BLEND_CHOICES, BLENDS_TO_COME),
        help="feather (default) or linear (plain average)",
    )
    how.add_argument("--seam", default="none", type=_choice(("none",), ("graphcut",)), help="none")
    how.add_argument(
        "--exposure", action=argparse.BooleanOptionalAction, default=False, help="exposure compensation (yet to come)"
    )
    how.add_argument("--seed", type=int, default=0, metavar="N", help="seed of every random choice (default 0)")

    files = parser.add_argument_group("files")
    files.add_argument("--report", type=Path, metavar="FILE.json", help="everything that was measured and decided")
    files.add_argument(
        "--layers", type=Path, metavar="DIR", help="both pictures on the canvas before blending, with alpha"
    )
    files.add_argument("--warp", type=Path, metavar="FILE.npz", help="the map, the inverse depth and the geometry")
    files.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_loudness(parser)


def _add_demo(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_demo)
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("edf_demo"),
        metavar="OUTDIR",
        help="folder for the files (default: edf_demo)",
    )
    parser.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_loudness(parser)


def _add_loudness(parser: argparse.ArgumentParser) -> None:
    loudness = parser.add_mutually_exclusive_group()
    loudness.add_argument("--quiet", action="store_true", help="only errors and warnings")
    loudness.add_argument("--verbose", action="store_true", help="what was decided, measured and how long it took")


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a list of numbers like 1200 or 1200,1180") from None


def _choice(known: tuple[str, ...], to_come: tuple[str, ...]) -> Callable[[str], str]:
    def parse(text: str) -> str:
        if text in to_come:
            raise argparse.ArgumentTypeError(f"{text!r} is yet to come; for now: {', '.join(known)}")
        if text not in known:
            raise argparse.ArgumentTypeError(f"{text!r} is not known; choose from: {', '.join(known)}")
        return text

    return parse


def _stitch(args: argparse.Namespace) -> int:
    if len(args.target) > 1:
        raise BadRequest(f"{1 + len(args.target)} pictures given: two at a time for now; stitch them pair by pair")
    if args.dense or args.exposure:
        raise BadRequest(f"--{'dense' if args.dense else 'exposure'} is yet to come")
    from .camera import CameraRequest
    from .output_files import OutputFiles
    from .outputs import OutputRequest, check, write
    from .pipeline import StitchOptions, stitch

    request = CameraRequest(args.focal_px, args.focal_mm, args.sensor_mm, args.focal35, args.principal, args.cameras)
    options = StitchOptions(args.field, request, args.blend, args.seed, measure=bool(args.report or args.verbose))
    outputs = OutputRequest(args.output, args.report, args.layers, args.warp)
    with OutputFiles(args.overwrite) as files:
        check(outputs, files)
        with _progress_shown(args.quiet) as show:
            result = stitch(args.reference, args.target[0], options, progress=show)
            show("write", 0.95)
            warnings = [*result.warnings, *write(result, outputs, files)]
    for warning in warnings:
        print(f"edf: warning: {warning}", file=sys.stderr)
    if not args.quiet:
        height, width = result.alpha.shape
        print(f"edf: {args.output}: {width}×{height}", file=sys.stderr)
    if args.verbose:
        _tell(result.report, result.seconds)
    return 0


def _tell(report: dict, seconds: dict[str, float]) -> None:
    view, field, measured = report["two_view"], report["field"], report["measured"]
    focal = ", ".join(f"{value:.1f}" for value in view["focal_px"])
    lines = [
        f"{view['model']}: {view['why']}",
        f"focal length {focal} px ({view['focal_source']}; ± {view['focal_deviation']:.1%})",
        f"field {field['kind']}: {field['centres']} points, {field['pruned']} left out, λ {field['smoothing']:.1e}",
        f"alignment {measured['alignment_median_px']:.2f} px (median), {measured['alignment_p95_px']:.2f} px (95 %)",
        f"overlap PSNR {measured['overlap_psnr_db']:.2f} dB, SSIM {measured['overlap_ssim']:.3f}",
        "seconds: " + ", ".join(f"{stage} {value:.2f}" for stage, value in seconds.items()),
    ]
    print("\n".join(f"edf: {line}" for line in lines), file=sys.stderr)


@contextmanager
def _progress_shown(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A bar on a terminal, one plain line for each stage elsewhere, nothing when quiet."""
    if quiet:
        yield lambda stage, total: None
    elif sys.stderr.isatty():
        from tqdm import tqdm

        with tqdm(
            total=100, bar_format="{desc:<9}{bar}{percentage:3.0f} % {elapsed}", leave=False, file=sys.stderr
        ) as bar:

            def move(stage: str, total: float) -> None:
                bar.set_description_str(stage, refresh=False)
                bar.update(round(100 * total) - bar.n)

            yield move
    else:
        last = ""

        def tell(stage: str, total: float) -> None:
            nonlocal last
            if stage != last:
                print(f"edf: {stage} ({total:.0%})", file=sys.stderr, flush=True)
                last = stage

        yield tell


def _demo(args: argparse.Namespace) -> int:
    from ..synthetic_scenes.demo import run_demo

    with _progress_shown(args.quiet or not sys.stderr.isatty()) as show:
        lines = run_demo(args.output, args.overwrite, show)
    print("\n".join(lines))
    return 0
