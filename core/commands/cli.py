"""The `edf` command: one parser behind `edf`, `python -m edf_stitch` and `blender -b --command edf`.

Nothing heavy is imported before the arguments are understood.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NoReturn

from ..system.errors import Cancelled, StitchError, UnwritableOutput
from ..system.memory import check_address_space
from ..system.streams import messages_may_be_lost, silence
from ..system.text_files import printable
from .arguments import numbered, options_from
from .file_arguments import exr_form, without_plan
from .info import run_info
from .messages import print_result, print_summary, progress_shown, say, shortened, verdict_line
from .options import MESSAGES, STOPPING
from .parser import edf_parser

if TYPE_CHECKING:
    from ..batch.pieces import BatchRequest

_STOPPING = (signal.SIGINT, signal.SIGTERM)


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
    asked_to_stop = finished = False

    def interrupt(_number: int, _frame: object) -> NoReturn:
        nonlocal asked_to_stop
        asked_to_stop = True
        raise KeyboardInterrupt

    def once_more() -> None:
        if not finished:
            signal.raise_signal(signal.SIGINT)

    def ignored(what: sys.UnraisableHookArgs) -> None:
        # where Python ignores what is raised, as while an object goes, the work would go on
        if asked_to_stop and issubclass(what.exc_type, KeyboardInterrupt):
            threading.Timer(STOPPING.again_seconds, once_more).start()
        else:
            hook(what)

    # A render farm ends a job with SIGTERM: that must leave as little behind as Ctrl-C. A shell starts background jobs
    # with SIGINT ignored: here it stops them all the same.
    main_thread = threading.current_thread() is threading.main_thread()
    before = {number: signal.signal(number, interrupt) for number in _STOPPING} if main_thread else {}
    hook, sys.unraisablehook = sys.unraisablehook, ignored
    try:
        args = edf_parser().parse_args(argv)
        args.given = list(sys.argv[1:] if argv is None else argv)
        check_address_space()
        return _COMMANDS[args.command](args)
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except (KeyboardInterrupt, Exception) as error:
        # a library that is interrupted while it loads raises ImportError instead
        return _report_error(KeyboardInterrupt() if asked_to_stop else error)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        finished, sys.unraisablehook = True, hook


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
    print(f"edf: {printable(sentence)}", file=sys.stderr)
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
        print(f"edf: {len(pictures)} pictures: {printable(shortened(names))}", file=sys.stderr)
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
    verdict = result.report["verdict"]
    if not args.quiet or verdict["is"] != "good":
        print(f"edf: verdict: {printable(verdict_line(verdict))}", file=sys.stderr)
    if not args.quiet:
        height, width = result.panorama.alpha.shape
        print(f"edf: {printable(str(args.output))}: {width}×{height}", file=sys.stderr)
    for warning in warnings:
        print(f"edf: warning: {printable(warning)}", file=sys.stderr)
    if args.verbose:
        print_summary(result.report, result.seconds)
    if args.json:
        print_result(outputs, result.report, warnings)
    return 1 if args.strict_verdict and verdict["is"] == "not usable" else 0


def _batch(args: argparse.Namespace) -> int:
    from ..system.output_files import undisturbed

    with undisturbed():  # see _stitch
        from ..batch.list import read_list
        from ..batch.outcomes import Outcome
        from ..batch.pieces import BatchRequest
        from ..batch.run import run_batch
        from ..system.json_values import plain
        from ..system.memory import use_again

    use_again()
    suffix = args.format if args.format.startswith(".") else f".{args.format}"
    request = BatchRequest(
        args.output, suffix, args.warp, args.layers, args.resume, args.overwrite, args.shard, args.depth, args.mesh,
        exr_form(args), args.unit, args.keep_going, args.retry_failed,
    )  # fmt: skip
    if args.plan is not None:
        return _plan(args, request)

    def tell(outcome: Outcome, number: int, count: int) -> None:
        place = f" in {request.summary}" if request.summary else ""
        more = len(outcome.warnings) - MESSAGES.max_warnings
        for warning in (*outcome.warnings[:MESSAGES.max_warnings], *[f"{more} more{place}"] * (more > 0)):
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
        left = summary.total - len(summary.outcomes)
        stopped = f", {left} not begun: --keep-going goes on past a failure" if left else ""
        print(f"edf: {request.summary or args.output}: {counts}{stopped}", file=sys.stderr)
    if args.keep_going:
        for line in summary.failures():
            print(f"edf: {printable(line)}", file=sys.stderr)
    if args.json:
        print(json.dumps(plain(summary.as_dict()), indent=1))
    return summary.exit_code


def _plan(args: argparse.Namespace, request: BatchRequest) -> int:
    """Writes which units there are, instead of making them."""
    from ..batch.list import read_list
    from ..batch.plan_file import in_words, plan_document
    from ..output.json_file import json_bytes
    from ..system.errors import BadRequest
    from ..system.output_files import OutputFiles

    if str(args.list) == "-":
        raise BadRequest("a list on stdin has no plan: every unit would have to read it; put it into a file")
    if request.unit is not None or request.shard != (1, 1):
        raise BadRequest("a plan is of the whole list: leave out --unit and --shard")
    command = ["edf", *without_plan(args.given)]
    if not (request.goes_on or request.overwrite):
        command.append("--resume")  # for a unit that is killed and called again
    items, options = read_list(args.list), options_from(args, measure=True)
    document = plan_document(items, options, request, command)
    data = json_bytes(document)
    if str(args.plan) == "-":
        sys.stdout.write(data.decode())
    else:
        read = [args.list, *options.files_read, *(path for item in items for path in item.files())]
        with OutputFiles(request.overwrite or request.goes_on, read) as files:
            files.check(args.plan)
            files.add(args.plan, data)
    if not args.quiet:
        print(f"edf: {in_words(document)}", file=sys.stderr)
    return 0


def _compare(args: argparse.Namespace) -> int:
    from importlib import import_module

    from ...synthetic_scenes.compared import truth_beside
    from ..choices import FIELDS
    from ..compare.figures import MEASURES
    from ..compare.pairs import find_pairs
    from ..compare.run import ComparisonRequest, run_comparison
    from ..compare.tables import comparison_markdown

    pairs = tuple(find_pairs(args.paths))
    request = ComparisonRequest(
        args.output, pairs, args.fields or FIELDS, args.overwrite, args.measure or MEASURES, tuple(args.outside),
        args.resume, args.shard,
    )  # fmt: skip
    version = str(import_module(__package__.rpartition(".core")[0]).__version__)
    options = options_from(args, measure=False)
    with progress_shown(args.quiet or not sys.stderr.isatty()) as show:
        summary, code = run_comparison(
            request, options, version, truth_beside, lambda what, share: show(f"{what:<32}", share),
            lambda line: None if args.quiet and "failed" not in line else say(f"edf: {line}"),
        )  # fmt: skip
    if summary["missing"]:
        said = ", ".join(summary["missing"])
        say(f"edf: still to be compared: {said}; --resume without --shard puts all together")
        return code
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
    if args.no_render:
        from ...synthetic_scenes.shipped_demo import run_shipped_demo as run
    else:
        from ...synthetic_scenes.demo import run_demo as run

    with progress_shown(args.quiet or not sys.stderr.isatty()) as show:
        lines = run(args.output, args.overwrite, show)
    print("\n".join(lines))
    return 0


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "stitch": _stitch, "info": run_info, "batch": _batch, "compare": _compare, "validate": _validate, "demo": _demo,
}  # fmt: skip
