"""The parser of the `edf` command: its commands, their arguments and what `--help` says of them.

Nothing heavy is imported here.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, NoReturn

from ..system.text_files import printable
from .arguments import add_options
from .config_file import add_config, with_config
from .file_arguments import add_batch_files, add_files, outside, shard
from .info import INFO, add_info
from .meant import what_was_meant

# What most people need of the commands with many options: `--help` shows these, `--help-all` all of them.
_COMMON = {
    "stitch": (
        "--output", "--projection", "--crop", "--viewpoint", "--focal35", "--exposure", "--preview", "--report",
        "--depth", "--overwrite",
    ),
    "batch": (
        "--output", "--resume", "--keep-going", "--shard", "--format", "--projection", "--crop", "--focal35", "--depth",
        "--overwrite",
    ),
    "compare": ("--output", "--fields", "--measure", "--outside", "--resume", "--overwrite"),
}  # fmt: skip
_EXIT_CODES = """Exit codes of all commands: 0 done, 1 measured but not within its limits, 2 the call is wrong, 3 the
pictures can't be stitched, 4 a file can't be read or written, 130 interrupted. `edf COMMAND --help` says more of
each."""


class Parser(argparse.ArgumentParser):
    """A parser that says what was meant, takes arguments from a file, and has a short help beside the whole one.

    common: the options that the short one shows; with none there is only the whole one.
    """

    common: tuple[str, ...] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self._given = list(sys.argv[1:] if args is None else args)
        known = self._option_string_actions
        return super().parse_known_args(
            with_config(self._given, known) if "--config" in known else self._given, namespace
        )

    def format_help(self) -> str:
        """What `--help` prints."""
        if not self.common:
            return super().format_help()
        words = [action for action in self._actions if not action.option_strings]
        options = [self._option_string_actions[name] for name in self.common]
        formatter = self._get_formatter()
        several = " ..." if words[0].nargs == "+" else ""
        formatter.add_usage(f"%(prog)s {words[0].metavar}{several} -o {options[0].metavar} [options]", [], [])
        formatter.add_text(self.description)
        formatter.add_arguments(words)
        formatter.start_section("what most people need")
        formatter.add_arguments(options)
        formatter.end_section()
        rest = len([action for action in self._actions if action.option_strings]) - len(options)
        formatter.add_text(f"{rest} more options, in groups: {self.prog} --help-all")
        return formatter.format_help()

    def format_full_help(self) -> str:
        """What `--help-all` prints."""
        return super().format_help()

    @property
    def commands(self) -> dict[str, argparse.ArgumentParser]:
        """Its commands by their names."""
        found = (action.choices for action in self._actions if isinstance(action, argparse._SubParsersAction))
        return next(found, {})

    def error(self, message: str) -> NoReturn:
        meant = what_was_meant(message, self._given, _options_of(self))
        if meant:
            message = meant
        elif not message.startswith("argument -"):  # what is wrong with one option's value, its own line says
            self.print_usage(sys.stderr)
        print(f"{self.prog}: {printable(message)}", file=sys.stderr)
        raise SystemExit(2)


def _options_of(parser: argparse.ArgumentParser) -> list[str]:
    """The options of a parser and of its commands, as they are written."""
    commands = parser.commands.values() if isinstance(parser, Parser) else ()
    return [name for one in (parser, *commands) for action in one._actions for name in action.option_strings]


def edf_parser() -> Parser:
    """The parser of `edf`, with all its commands."""
    parser = Parser(
        prog="edf",
        description="Stitches photographs taken from different places into one picture seen from one place.",
        epilog=_EXIT_CODES,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND", required=True)
    _add_stitch(commands.add_parser("stitch", help="stitch pictures into one panorama", description=_STITCH))
    add_info(commands.add_parser("info", help="say what was understood of each picture", description=INFO))
    _add_batch(commands.add_parser("batch", help="stitch a list of panoramas and clips", description=_BATCH))
    compare = "every field on every pair, every program on every set, in one table"
    _add_compare(commands.add_parser("compare", help=compare, description=_COMPARE))
    _add_validate(
        commands.add_parser("validate", help="render scenes with known cameras and measure", description=_VALIDATE)
    )
    _add_demo(commands.add_parser("demo", help="make pictures, stitch them, say what was measured", description=_DEMO))
    for name, common in _COMMON.items():
        command = parser.commands[name]
        assert isinstance(command, Parser)
        command.common = common
        command.add_argument("--help-all", action=_HelpAll, nargs=0, help="show all options, in groups, and exit")
        add_config(command)
    return parser


class _HelpAll(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        assert isinstance(parser, Parser)
        print(parser.format_full_help(), end="")
        raise SystemExit(0)


class _Version(argparse.Action):
    def __call__(self, *_: object) -> NoReturn:
        from importlib import import_module

        print(import_module(__package__.rpartition(".core")[0]).__version__)
        raise SystemExit(0)


_STITCH = """Stitch 2 to 60 pictures into one, seen from one place. Of two, the first is REF and the other TARGET, which
slides along its epipolar lines to meet it; more may come in any order, and those that connect with no others are left
out and named. Messages go to stderr; of what came out the first line says whether the panorama is good, where to look
at it, or why it is not usable. Exit codes: 0 done, 1 not usable (with --strict-verdict), 2 the call is wrong, 3 the
pictures can't be stitched, 4 a file can't be read or written, 130 interrupted."""
_BATCH = """Stitch every line of LIST.csv: pictures, a folder of them, or a clip of cameras that stand still
(a_%04d.png or a_####.png), whose frames share one alignment. A line holds reference,target and, if wanted, a name; a
header may name picture3 and so on, first, last, step, focal_px and focal35 as well. The first that cannot be made stops
it, unless --keep-going is given; DIR/batch.json says what became of each. Exit codes: 0 all done, 1 some failed (with
--keep-going), 2 the call is wrong, 3 one can't be stitched, 4 a file can't be read or written, 130 interrupted."""
_COMPARE = """Stitch every pair with every field, features and geometry found once; every set of more pictures with
ours, as if all were taken from one place, with Hugin and with OpenCV's Stitcher; and put the figures side by side:
OUTDIR gets compare.html, .md, .csv and .json, pictures, and the seconds in timing.md and .json. A PATH is a folder of
two pictures or more, a folder of such folders (also OUTDIR/pictures of `edf validate`: then the truth is asked too), or
a picture followed by its target. Exit codes: 0 done, 2 the call is wrong, 3 a pair can't be stitched with any field, 4
a file can't be read or written, 130 interrupted."""
_VALIDATE = """Render scenes with known cameras in Blender, stitch them, and hold all of it against the truth: OUTDIR
gets report.html, report.json and report.csv. Pictures are kept in OUTDIR/pictures and made only once. Exit codes: 0 all
thresholds held, 1 some did not, 2 the call is wrong, 3 nothing can render, 4 a file can't be read or written, 130
interrupted (--resume goes on)."""
_DEMO = "Render a pair and five pictures of a room through known cameras, stitch both, and compare with the truth."


def _add_stitch(parser: argparse.ArgumentParser) -> None:
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
    _add_json(parser)


def _add_batch(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "list", metavar="LIST.csv", type=Path,
        help="the list, or - for one on stdin; relative paths start at its folder",
    )  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="folder for all outputs")
    add_options(parser)
    add_batch_files(parser)
    _add_loudness(parser)
    _add_json(parser)


def _add_compare(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("paths", metavar="PATH", type=Path, nargs="+", help="folders of pairs, or REF TARGET")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUTDIR", help="folder for everything")
    parser.add_argument(
        "--fields", type=lambda text: tuple(text.split(",")), default=None, metavar="A,B,C",
        help="the fields to compare on pairs, in this order (default: all)",
    )  # fmt: skip
    parser.add_argument(
        "--measure", type=lambda text: tuple(text.split(",")), default=None, metavar="A,B,C",
        help="what is measured: keep, overlap, projectivity, lines (default: all)",
    )  # fmt: skip
    parser.add_argument(
        "--outside", type=outside, action="append", default=[], metavar="NAME=FOLDER",
        help="another program's results, made elsewhere: FOLDER/PAIR/ holds its layers, masks or maps; may be repeated",
    )  # fmt: skip
    add_options(parser, with_field=False)
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="I/N", help="the I-th of N runs sharing OUTDIR")
    parser.add_argument("--resume", action="store_true", help="compare only what is missing or was compared otherwise")
    parser.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_loudness(parser)


def _add_validate(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="OUTDIR", help="folder for everything")
    parser.add_argument(
        "--suite", default="quick", metavar="SUITE",
        help="quick (default: 4 scenes and a set, 640×480), full (all scenes of two pictures, 1280×960) or sets (of "
        "many, 640×480)",
    )  # fmt: skip
    parser.add_argument(
        "--scene", nargs="+", action="extend", default=[], metavar="NAME",
        help="these only, of one switch or several; NAME:baseline=2,turn=1.5,overlap=0.4,noise=3 makes a scene harder, "
        "NAME:n=12,spread=0.3,noise=3 a set",
    )  # fmt: skip
    parser.add_argument("--shard", type=shard, default=(1, 1), metavar="I/N", help="the I-th of N runs sharing OUTDIR")
    parser.add_argument("--resume", action="store_true", help="measure only what is missing or was measured otherwise")
    parser.add_argument("--overwrite", action="store_true", help="measure everything again")
    _add_loudness(parser)


def _add_demo(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("edf_demo"),
        metavar="OUTDIR",
        help="folder for the files (default: edf_demo)",
    )
    parser.add_argument(
        "--no-render", action="store_true", help="stitch pictures that come with the program: nothing need render them"
    )
    parser.add_argument("--overwrite", action="store_true", help="replace files that exist")
    _add_loudness(parser)


def _add_json(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="what came out as a document on stdout (docs/formats.md)")


def _add_loudness(parser: argparse.ArgumentParser) -> None:
    loudness = parser.add_mutually_exclusive_group()
    loudness.add_argument("--quiet", action="store_true", help="only errors and warnings")
    loudness.add_argument("--verbose", action="store_true", help="what was decided, measured and how long it took")
