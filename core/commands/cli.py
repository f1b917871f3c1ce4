"""The `edf` command: one parser behind `edf`, `python -m edf_stitch` and `blender -b --command edf`.

Nothing heavy is imported before the arguments are understood.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

from ..system.errors import Cancelled, StitchError, UnwritableOutput
from ..system.streams import messages_may_be_lost, silence
from .arguments import add_options, numbered, options_from
from .file_arguments import add_batch_files, add_files, exr_form, shard
from .info import INFO, add_info
from .meant import what_was_meant
from .messages import print_summary, progress_shown, say, shortened, verdict_line
from .options import MESSAGES

_STOPPING = (signal.SIGINT, signal.SIGTERM)


class _Parser(argparse.ArgumentParser):
    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self._given = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        meant = what_was_meant(message, self._given, _options_of(self))
        if meant:
            message = meant
        elif not message.startswith("argument -"):  # what is wrong with one option's value, its own line says
            self.print_usage(sys.stderr)
        print(f"{self.prog}: {message}", file=sys.stderr)
        raise SystemExit(2)


def _options_of(parser: argparse.ArgumentParser) -> list[str]:
    """The options of a parser and of its commands, as they are written."""
    found: list[str] = []
    for action in parser._actions:
        found += action.option_strings
        if isinstance(action, argparse._SubParsersAction):
            found += [name for command in action.choices.values() for name in _options_of(command)]
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments after the program's name; those of the process by default.

    Returns
    -------
    int
        0 done, 1 a threshold of the validation missed or a panorama not usable (--strict-verdict), 2 a wrong call,
        3 pictures that cannot be stitched, 4 a file that cannot be read or written, 130 interrupted.
    """
    with messages_may_be_lost():
        code = _run(argv)
        try:
            if sys.stdout is not None:
                sys.stdout.flush()
        except OSError as error:
            silence(sys.stdout)
            code = code or _stream_lost(error)
        return code


def _run(argv: Sequence[str] | None) -> int:
    # before NumPy loads: results of BLAS depend on its thread count, and the same call must give the same bytes
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    asked_to_stop = False

    def interrupt(_number: int, _frame: object) -> NoReturn:
        nonlocal asked_to_stop
        asked_to_stop = True
        raise KeyboardInterrupt

    # A render farm ends a job with SIGTERM: that must leave as little behind as Ctrl-C. A shell starts background jobs
    # with SIGINT ignored: here it stops them all the same.
    main_thread = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, interrupt) for number in _STOPPING} if main_thread else {}
    try:
        args = _parser().parse_args(argv)
        return int(args.run(args))
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except (KeyboardInterrupt, Exception) as error:
        # a library that is interrupted while it loads raises ImportError instead
        return _report_error(KeyboardInterrupt() if asked_to_stop else error)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)


def _report_error(error: BaseException) -> int:
    """Says in a sentence why there is no result; returns the exit code."""
    if isinstance(error, KeyboardInterrupt):
        sentence, code = "interrupted, nothing was written", Cancelled.exit_code
    elif isinstance(error, StitchError):
        sentence, code = str(error), error.exit_code
    elif isinstance(error, MemoryError):
        sentence, code = "not enough memory for pictures of this size; use smaller ones", StitchError.exit_code
    elif isinstance(error, OSError):
        return _stream_lost(error)
    else:  # a bug, or a library's error: a sentence is more use than a traceback
        sentence = f"internal error, please report it: {type(error).__name__}: {error}"
        code = StitchError.exit_code
    print(f"edf: {sentence}", file=sys.stderr)
    return code


def _stream_lost(error: OSError) -> int:
    """Reports an OSError that is not about a named file, which would be an UnwritableOutput: mostly of stdout or of a
    temporary folder. Returns the exit code."""
    print(f"edf: cannot be read or written: {error.filename or 'the output'}: {error.strerror}", file=sys.stderr)
    return UnwritableOutput.exit_code


def _too_late_to_interrupt() -> None:
    """Ignores signals while finished files are put in place: the message would say that nothing was written."""
    if threading.current_thread() is threading.main_thread():
        for number in _STOPPING:
            signal.signal(number, signal.SIG_IGN)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="edf",
        description="Stitches photographs taken from different places into one picture seen from one place.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    _add_stitch(commands.add_parser("stitch", help="stitch pictures into one panorama", description=_STITCH))
    add_info(commands.add_parser("info", help="say what was understood of each picture", description=INFO))
    _add_batch(commands.add_parser("batch", help="stitch a list of panoramas and clips", description=_BATCH))
    _add_compare(
        commands.add_parser("compare", help="every field on every pair, in one table", description=_COMPARE)
    )
    _add_validate(
        commands.add_parser("validate", help="render scenes with known cameras and measure", description=_VALIDATE)
    )
    _add_demo(commands.add_parser("demo", help="make pictures, stitch them, say what was measured", description=_DEMO))
    return parser


class _Version(argparse.Action):
    def __call__(self, *_: object) -> NoReturn:
        from importlib import import_module

        print(import_module(__package__.rpartition(".core")[0]).__version__)
        raise SystemExit(0)


_STITCH = """Stitch 2 to 60 pictures into one, seen from one place. Of two, the first is REF and the other TARGET, which
slides along its epipolar lines to meet it; more may come in any order, and those that connect with no others are left
out and named. Messages go to stderr; the last line says whether the panorama is good, where to look at it, or why it is
not usable. Exit codes: 0 done, 1 not usable (with --strict-verdict), 2 the call is wrong, 3 the pictures can't be
stitched, 4 a file can't be read or written, 130 interrupted."""
_BATCH = """Stitch every line of LIST.csv: pictures, a folder of them, or a clip of cameras that stand still
(a_%04d.png or a_####.png), whose frames share one alignment. A line holds reference,target and, if wanted, a name; a
header may name picture3 and so on, first, last, step, focal_px and focal35 as well. A bad one is reported and the rest
goes on; DIR/batch.json says what became of each. Exit codes: 0 all done, 2 the call is wrong, 3 one can't be stitched,
4 a file can't be read or written, 130 interrupted."""
_COMPARE = """Stitch every pair with every field, features and geometry found once, and put the figures side by side:
OUTDIR gets compare.html, .md, .csv and .json, pictures, and the seconds in timing.md and .json. A PATH is a folder of
two pictures, a folder of such folders (also OUTDIR/pictures of `edf validate`: then the truth is asked too), or a
picture followed by its target. Exit codes: 0 done, 2 the call is wrong, 3 a pair can't be stitched with any field, 4 a
file can't be read or written, 130 interrupted."""
_VALIDATE = """Render scenes with known cameras in Blender, stitch them, and hold all of it against the truth: OUTDIR
gets report.html, report.json and report.csv. Pictures are kept in OUTDIR/pictures and made only once. Exit codes: 0 all
thresholds held, 1 some did not, 2 the call is wrong, 3 nothing can render, 4 a file can't be read or written, 130
interrupted (--resume goes on)."""
_DEMO = "Render a pair and five pictures of a room through known cameras, stitch both, and compare with the truth."


def _add_stitch(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_stitch)
    parser.add_argument(
        "pictures", metavar="PICTURE", type=Path, nargs="+",
        help="files, folders, or patterns like IMG_*.jpg, which stand for all pictures in them but hidden ones, sorted "
        "as people count; of two pictures the first is the reference",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="OUT",
        help=".png, .jpg, .tif (8 or 16 bit), .exr or .hdr (float)",
    )
    add_options(parser)
    add_files(parser)
    _add_loudness(parser)
    parser.add_argument(
        "--strict-verdict", action="store_true", help="exit with 1 where the panorama is found not to be usable"
    )


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_batch)
    parser.add_argument("list", metavar="LIST.csv", type=Path, help="the list; relative paths start at its folder")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder for all outputs")
    add_options(parser)
    add_batch_files(parser)
    _add_loudness(parser)


def _add_compare(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_compare)
    parser.add_argument("paths", metavar="PATH", type=Path, nargs="+", help="folders of pairs, or REF TARGET")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUTDIR", help="folder for everything")
    parser.add_argument(
        "--fields", type=lambda text: tuple(text.split(",")), default=None, metavar="A,B,C",
        help="the fields to compare, in this order (default: all)",
    )  # fmt: skip
    add_options(parser, with_field=False)
    parser.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_loudness(parser)


def _add_validate(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=_validate)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUTDIR", help="folder for everything")
    parser.add_argument(
        "--suite", default="quick", metavar="SUITE",
        help="quick (default: 4 scenes and a set, 640×480), full (all scenes of two pictures, 1280×960) or sets (of "
        "many, 640×480)",
    )  # fmt: skip
    parser.add_argument(
        "--scene", nargs="+", default=[], metavar="NAME",
        help="these only; NAME:baseline=2,turn=1.5,overlap=0.4,noise=3 makes a scene harder, "
        "NAME:n=12,spread=0.3,noise=3 a set",
    )  # fmt: skip
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="I/N", help="the I-th of N runs sharing OUTDIR")
    parser.add_argument("--resume", action="store_true", help="measure only what is missing or was measured otherwise")
    parser.add_argument("--overwrite", action="store_true", help="measure everything again")
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


def _stitch(args: argparse.Namespace) -> int:
    from ..system.output_files import OutputFiles, undisturbed

    with undisturbed():  # interrupted while it loads, NumPy prints a traceback
        from ..frames.reading import check_count
        from ..output.outputs import OutputRequest, check, write
        from ..pictures.listing import listed
        from ..pictures.naming import told_apart
        from ..pipeline import stitch
        from ..system.memory import use_again

    use_again()
    pictures = listed(args.pictures)
    if pictures != args.pictures and not args.quiet:
        names = told_apart([str(path) for path in pictures])
        print(f"edf: {len(pictures)} pictures: {shortened(names)}", file=sys.stderr)
    options = numbered(options_from(args, measure=bool(args.report or args.verbose)), pictures)
    check_count(len(pictures), options)
    outputs = OutputRequest(
        args.output, args.report, args.layers, args.warp, args.cameras_out, args.depth, args.mesh, exr_form(args)
    )  # fmt: skip
    with OutputFiles(args.overwrite, [*pictures, *options.files_read]) as files:
        names = [path.name for path in pictures]
        check(outputs, files, names, options.has_seam, options.fills_holes, options.may_slide)
        with progress_shown(args.quiet) as show:
            result = stitch(pictures, options, progress=show)
            show("write", MESSAGES.written_share)
            warnings = [*result.warnings, *write(result, outputs, files)]
        _too_late_to_interrupt()
    for warning in warnings:
        print(f"edf: warning: {warning}", file=sys.stderr)
    if not args.quiet:
        height, width = result.panorama.alpha.shape
        print(f"edf: {args.output}: {width}×{height}", file=sys.stderr)
    if args.verbose:
        print_summary(result.report, result.seconds)
    verdict = result.report["verdict"]
    if not args.quiet or verdict["is"] != "good":
        print(f"edf: verdict: {verdict_line(verdict)}", file=sys.stderr)
    return 1 if args.strict_verdict and verdict["is"] == "not usable" else 0


def _batch(args: argparse.Namespace) -> int:
    from ..system.output_files import undisturbed

    with undisturbed():  # see _stitch
        from ..batch.list import read_list
        from ..batch.run import Outcome, run_batch
        from ..batch.units import BatchRequest
        from ..system.memory import use_again

    use_again()
    suffix = args.format if args.format.startswith(".") else f".{args.format}"
    request = BatchRequest(
        args.output, suffix, args.warp, args.layers, args.resume, args.overwrite, args.shard, args.depth, args.mesh,
        exr_form(args),
    )  # fmt: skip

    def tell(outcome: Outcome, number: int, count: int) -> None:
        more = len(outcome.warnings) - MESSAGES.max_warnings
        for warning in (*outcome.warnings[:MESSAGES.max_warnings], *[f"{more} more in {request.summary}"] * (more > 0)):
            say(f"edf: warning: {outcome.name}: {warning}")
        if outcome.exit_code or not args.quiet:
            say(f"edf: [{number}/{count}] {outcome.name}: {outcome.in_words(args.verbose)}")

    try:
        options = options_from(args, measure=True)
        with progress_shown(args.quiet or not sys.stderr.isatty()) as show:
            summary = run_batch(
                read_list(args.list), options, request, lambda what, share: show(f"{what:<18}", share), finished=tell
            )
    except KeyboardInterrupt:
        print("edf: interrupted; what is finished is kept, and --resume goes on with the rest", file=sys.stderr)
        return Cancelled.exit_code
    if not args.quiet:
        counts = ", ".join(f"{summary.count(status)} {status}" for status in ("done", "skipped", "failed"))
        print(f"edf: {request.summary}: {counts}", file=sys.stderr)
    return summary.exit_code


def _compare(args: argparse.Namespace) -> int:
    from importlib import import_module

    from ...synthetic_scenes.compared import truth_beside
    from ..choices import FIELDS
    from ..compare.pairs import find_pairs
    from ..compare.run import ComparisonRequest, run_comparison
    from ..compare.tables import comparison_markdown

    pairs = tuple(find_pairs(args.paths))
    request = ComparisonRequest(args.output, pairs, args.fields or FIELDS, args.overwrite)
    version = str(import_module(__package__.rpartition(".core")[0]).__version__)
    options = options_from(args, measure=False)
    with progress_shown(args.quiet or not sys.stderr.isatty()) as show:
        summary, code = run_comparison(
            request, options, version, truth_beside, lambda what, share: show(f"{what:<32}", share),
            lambda line: None if args.quiet and "failed" not in line else say(f"edf: {line}"),
        )  # fmt: skip
    if args.verbose:
        print(comparison_markdown(summary), file=sys.stderr)
    print(args.output / "compare.html")
    return code


def _validate(args: argparse.Namespace) -> int:
    from ...synthetic_scenes.validation import ValidationRequest, run_validation
    from ...synthetic_scenes.validation_report import summary_lines

    request = ValidationRequest(
        args.output, args.suite, tuple(args.scene), args.shard, args.resume, args.overwrite
    )  # fmt: skip
    try:
        done = run_validation(request, lambda line: None if args.quiet else say(f"edf: {line}"))
    except KeyboardInterrupt:
        print("edf: interrupted; finished scenes are kept, and --resume goes on with the rest", file=sys.stderr)
        return Cancelled.exit_code
    if done.verdict is None:
        say(f"edf: still to be measured: {', '.join(done.missing)}; --resume without --shard puts all together")
    else:
        print("\n".join([*summary_lines(done.verdict, done.results), *map(str, done.files)]))
    return done.exit_code


def _demo(args: argparse.Namespace) -> int:
    from ...synthetic_scenes.demo import run_demo

    with progress_shown(args.quiet or not sys.stderr.isatty()) as show:
        lines = run_demo(args.output, args.overwrite, show)
    print("\n".join(lines))
    return 0
