"""The command line: reads arguments, runs a command, prints; every error is one line on standard error.

Exit status: 0 done, 1 failed at run time, 2 wrong usage or configuration, 130 interrupted, 141 the reader
of the output went away. What a command needs is imported when it runs, so that ``--help`` is quick.
"""

import argparse
import io
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from lcf_edge import __version__
from lcf_edge.errors import LcfError, UsageError

if TYPE_CHECKING:
    from lcf_edge.config import Config

_LONGEST_DEMO_S = 120.0


class _Parser(argparse.ArgumentParser):
    """Wrong usage is a ``UsageError``, one line like every other."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; answers with the exit status."""
    for closed in ("stdout", "stderr"):
        if getattr(sys, closed) is None:  # by the shell, as in >&-
            setattr(sys, closed, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # where there are no Greek letters
    try:
        try:
            arguments = _parser().parse_args(argv)
            arguments.run(arguments)
        finally:
            _tell()  # also what argparse printed
    except LcfError as error:
        _say(f"lcf-edge: {error}")
        return error.exit_status
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        _abandon_stdout()
        return 141
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="lcf-edge",
        allow_abbrev=False,
        description="The Line-Circle filter: camera and IMU in, circles and psi regions out over Zenoh.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)

    settings = _Parser(add_help=False)
    settings.add_argument("-c", "--config", type=Path, metavar="FILE", help="configuration, TOML")
    settings.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="set one key, as in vehicle.half_width_m=0.6",
    )

    demo = commands.add_parser("demo", allow_abbrev=False, help="see the filter work on a drive that it renders itself")
    demo.add_argument("--out", type=Path, default=Path("demo-out"), metavar="DIR", help="where to write (%(default)s)")
    demo.add_argument("--seconds", type=_demo_seconds, default=10.0, metavar="N", help="length of the drive (10)")
    demo.set_defaults(run=_demo)

    replay = commands.add_parser(
        "replay", allow_abbrev=False, parents=[settings], help="run the filter over a recording"
    )
    replay.add_argument("recording", type=Path, metavar="RECORDING", help="ASL folder, MCAP file, video or pictures")
    replay.add_argument("-o", dest="results", metavar="FILE", help="one JSON line a frame; - is standard output")
    replay.add_argument("--video", type=Path, metavar="FILE.mp4", help="what the filter saw, two panels")
    replay.add_argument("--plot", type=Path, metavar="FILE.png", help="rows in use of each table")
    replay.add_argument("--publish", action="store_true", help="publish each scene over Zenoh")
    replay.add_argument("--realtime", action="store_true", help="as slow as the recording was made")
    replay.set_defaults(run=_replay)

    run = commands.add_parser(
        "run", allow_abbrev=False, parents=[settings], help="the daemon: camera and IMU in, scenes out over Zenoh"
    )
    run.set_defaults(run=_run)

    config = commands.add_parser(
        "config", allow_abbrev=False, parents=[settings], help="check and print the effective configuration"
    )
    config.set_defaults(run=_config)
    return parser


def _demo_seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 1.0 <= seconds <= _LONGEST_DEMO_S:  # NaN neither
        raise argparse.ArgumentTypeError(f"{text}: write a number between 1 and {_LONGEST_DEMO_S:.0f}")
    return seconds


def _load(arguments: argparse.Namespace) -> "Config":
    from lcf_edge.config import load  # noqa: PLC0415

    return load(arguments.config, arguments.set)


def _config(arguments: argparse.Namespace) -> None:
    config = _load(arguments)
    from lcf_edge.commands.config import report  # noqa: PLC0415

    _tell(report(config))


def _run(arguments: argparse.Namespace) -> None:
    from lcf_edge.commands.run import run  # noqa: PLC0415

    run(arguments.config, arguments.set)


def _replay(arguments: argparse.Namespace) -> None:
    config = _load(arguments)
    from lcf_edge.commands.replay import Outputs, replay  # noqa: PLC0415

    outputs = Outputs(arguments.results, arguments.video, arguments.plot, arguments.publish, arguments.realtime)
    summary = replay(arguments.recording, config, outputs, lambda text: _say(f"lcf-edge: warning: {text}"))
    if arguments.results == "-":
        print(*summary, sep="\n", file=sys.stderr)
    else:
        _tell(*summary)


def _demo(arguments: argparse.Namespace) -> None:
    from lcf_edge.commands.demo import demo  # noqa: PLC0415

    demo(arguments.out, arguments.seconds, _tell)


def _say(text: str) -> None:
    """One line on standard error."""
    print(" ".join(text.split()), file=sys.stderr)


def _tell(*lines: str) -> None:
    """Lines on standard output, flushed: what cannot be written is noticed here, not at the very end."""
    try:
        sys.stdout.writelines(f"{line}\n" for line in lines)
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _abandon_stdout()
        raise LcfError(f"standard output: cannot be written ({error.strerror}); free the disk") from error


def _abandon_stdout() -> None:
    """Let the interpreter's last flush go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
