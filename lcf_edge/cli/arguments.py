"""Commands and their options, with the help that ``--help`` shows."""

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from lcf_edge import __version__
from lcf_edge.errors import UsageError
from lcf_edge.recording.pace import FASTEST, SLOWEST


class _Parser(argparse.ArgumentParser):
    """Turns wrong usage into a ``UsageError``: one line that refers to the help of the command."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Let the command itself refuse unknown arguments, before the whole program does."""
        known, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return known, unknown

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the whole program; its result has ``command``, for calibrate also ``what``."""
    program = _Parser(
        prog="lcf-edge",
        allow_abbrev=False,
        description="The Line-Circle filter: camera and IMU in, objects and circles out over Zenoh.",
    )
    program.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = program.add_subparsers(dest="command", metavar="COMMAND", required=True)

    settings = _Parser(add_help=False)
    settings.add_argument(
        "-c",
        "--config",
        type=Path,
        metavar="FILE",
        help="configuration: TOML, or a recording that holds one (/etc/lcf-edge/config.toml, if there)",
    )
    settings.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="set one key, as in vehicle.half_width_m=0.6; may be repeated",
    )

    pace = _pace()
    demo = commands.add_parser("demo", allow_abbrev=False, help="see the filter work on a rendered drive")
    demo.add_argument("--out", type=Path, default=Path("demo-out"), metavar="DIR", help="where to write (%(default)s)")
    demo.add_argument("--seconds", type=_number(1.0, 120.0), default=10.0, metavar="N", help="length of the drive (10)")

    bench = commands.add_parser("bench", allow_abbrev=False, help="how fast the filter is on this computer")
    bench.add_argument(
        "--seconds", type=_number(1.0, 3600.0), default=20.0, metavar="N", help="how long to measure (%(default)g)"
    )

    replay = commands.add_parser(
        "replay", allow_abbrev=False, parents=[settings, pace], help="run the filter over a recording"
    )
    replay.add_argument("recording", type=Path, metavar="RECORDING", help="ASL folder, MCAP file, video or images")
    replay.add_argument("-o", dest="results", metavar="FILE", help="one JSON line a frame; - is standard output")
    replay.add_argument(
        "--video", type=Path, metavar="FILE.webm", help="video of what the filter saw, two panels; or .mp4"
    )
    replay.add_argument("--plot", type=Path, metavar="FILE.png", help="plot of the rows in use of each table")
    replay.add_argument(
        "--mcap", type=Path, metavar="FILE.mcap", help="a recording with what was found in it, for Foxglove and ROS 2"
    )
    replay.add_argument("--publish", action="store_true", help="publish each scene over Zenoh")
    replay.add_argument("--realtime", action="store_true", help="at the recording's own pace: --speed 1")

    _add_evaluate(commands, settings)

    commands.add_parser(
        "run", allow_abbrev=False, parents=[settings], help="the daemon: camera and IMU in, scenes out over Zenoh"
    )

    record = commands.add_parser(
        "record",
        allow_abbrev=False,
        parents=[settings],
        help="the daemon, recording camera, IMU, speed and scenes into a file",
    )
    record.add_argument(
        "file", type=Path, metavar="FILE.mcap", help="a new file; without a suffix: a folder, as a rosbag2 bag"
    )
    record.add_argument("--seconds", type=_positive, metavar="N", help="length of the recording (until Ctrl-C)")

    source = _Parser(add_help=False)
    source.add_argument(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="where the daemon, or a Zenoh router, listens (%(default)s)",
    )
    source.add_argument("--prefix", default="lcf", metavar="PREFIX", help="of the daemon's keys (%(default)s)")
    source.add_argument(
        "--zenoh-config", default="", metavar="FILE", help="a configuration of Zenoh (JSON5), for TLS and passwords"
    )

    watch = commands.add_parser(
        "watch",
        allow_abbrev=False,
        parents=[source, settings, pace],
        help="what a running daemon sees, or a recording shows, as a table in the terminal",
        description="Shows objects, circles, figures and devices of a daemon, five times a second; q or Ctrl-C ends. "
        "For a recording: space plays and pauses, s steps, arrows skip 5 s back or forward, p and n go to the previous "
        "and the next alarm.",
    )
    _add_recording(watch)
    watch.add_argument("--json", action="store_true", help="one JSON line a scene instead, for pipes")

    foxglove = commands.add_parser(
        "foxglove",
        allow_abbrev=False,
        parents=[source],
        help="what a running daemon sees, for the Foxglove app",
        description="Serves what a daemon publishes to Foxglove on this machine until Ctrl-C.",
    )
    foxglove.add_argument(
        "--port", type=_whole(0, 65535), default=8765, metavar="N", help="on 127.0.0.1 (%(default)s; 0: any)"
    )

    gate = commands.add_parser(
        "gate", allow_abbrev=False, help="guards the daemon's port: keeps out strangers and floods"
    )
    gate.add_argument(
        "--tls", type=Path, metavar="DIR", help="certificates (docs/network.md); without: only for this machine"
    )
    gate.add_argument("--listen", metavar="HOST", help="where parties connect (0.0.0.0; without --tls 127.0.0.1)")
    gate.add_argument("--port", type=_whole(0, 65535), default=7447, metavar="N", help="(%(default)s)")
    gate.add_argument(
        "--to", metavar="PLACE", help="the daemon's port on 127.0.0.1 (7448); without --tls its Unix socket"
    )

    view = commands.add_parser(
        "view",
        allow_abbrev=False,
        parents=[source, settings, pace],
        help="what a running daemon sees, or a recording shows, as a page for a browser",
        description="Serves a page with image, objects, circles, figures and devices of a daemon until Ctrl-C; for a "
        "recording with a slider.",
    )
    _add_recording(view)
    view.add_argument(
        "--port", type=_whole(0, 65535), default=8088, metavar="N", help="of the page (%(default)s; 0: any)"
    )
    view.add_argument(
        "--listen",
        default="127.0.0.1",
        metavar="HOST",
        help="address of the page (%(default)s); one that other machines reach requires a token",
    )

    doctor = commands.add_parser(
        "doctor",
        allow_abbrev=False,
        parents=[settings],
        help="check devices, permissions, clock, network, memory: what is wrong and how to fix it",
        description="Checks everything that the daemon needs, says what is wrong and how to fix it. Opens camera and "
        "IMU as the daemon would, or asks the daemon if it has them. Changes nothing else. Exit status 1: "
        "something failed, 2: the configuration cannot be used.",
    )
    doctor.add_argument("--json", action="store_true", help="one JSON object a finding")

    _add_calibrate(commands, settings)

    commands.add_parser(
        "config", allow_abbrev=False, parents=[settings], help="check and print the effective configuration"
    )
    return program


def _add_evaluate(commands: "argparse._SubParsersAction[_Parser]", settings: _Parser) -> None:
    evaluate = commands.add_parser(
        "evaluate",
        allow_abbrev=False,
        parents=[settings],
        help="replay many recordings and report what was found, false, late and slow",
        description="Replays recordings, compares what the filter reports with the truth where it is known, and writes "
        "a report: a page with images, and JSON. A recording that cannot be read is reported and left out.",
    )
    evaluate.add_argument(
        "recordings", type=Path, nargs="+", metavar="RECORDING", help="a recording, or a folder with recordings in it"
    )
    evaluate.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="what is in the frames, or a folder with NAME.jsonl (truth.jsonl beside each recording)",
    )
    evaluate.add_argument(
        "--against", type=Path, metavar="RESULTS", help="an earlier report to compare with: its folder or report.json"
    )
    evaluate.add_argument(
        "--out", type=Path, default=Path("evaluation"), metavar="FOLDER", help="where to write (%(default)s)"
    )
    work = evaluate.add_mutually_exclusive_group()
    work.add_argument(
        "--jobs", type=_whole(1, 1024), metavar="N", help="how many at once, on this computer (one per processor)"
    )
    work.add_argument("--scheduler", metavar="ENDPOINT", help="run on a Dask cluster instead, as in tcp://host:8786")


def _pace() -> _Parser:
    pace = _Parser(add_help=False)
    pace.add_argument(
        "--start", type=_number(0.0, 1e6), default=0.0, metavar="S", help="start so many seconds after the first frame"
    )
    pace.add_argument(
        "--duration", type=_positive, default=math.inf, metavar="S", help="stop so many seconds after the start"
    )
    pace.add_argument("--speed", type=_number(SLOWEST, FASTEST), metavar="N", help="N times the recording's own pace")
    pace.add_argument("--loop", action="store_true", help="start over at the end, until Ctrl-C")
    pace.add_argument("--step", action="store_true", help="pause at each frame")
    return pace


def _add_recording(command: argparse.ArgumentParser) -> None:
    text = "in place of a daemon: ASL folder, MCAP file, video or images"
    command.add_argument("recording", type=Path, nargs="?", metavar="RECORDING", help=text)


def _add_calibrate(commands: "argparse._SubParsersAction[_Parser]", settings: _Parser) -> None:
    task = _Parser(add_help=False)
    task.add_argument(
        "--from", dest="recording", type=Path, metavar="RECORDING", help="a recording in place of the devices"
    )
    task.add_argument("--report", type=Path, metavar="FILE.png", help="a figure to judge the result by")
    task.add_argument("--write", action="store_true", help="write the result to the configuration file")

    def add(name: str, text: str) -> _Parser:
        return kinds.add_parser(name, allow_abbrev=False, parents=[settings, task], help=text, description=text)

    calibrate = commands.add_parser(
        "calibrate", allow_abbrev=False, help="measure lens, IMU axes, mounting, clocks, own parts in view"
    )
    kinds = calibrate.add_subparsers(dest="what", metavar="WHAT", required=True)
    camera = add("camera", "the lens: intrinsics and distortion, from views of a board")
    camera.add_argument(
        "--board",
        default="checkerboard:9x6:25mm",
        metavar="BOARD",
        help="checkerboard:9x6:25mm by its inner corners (the default), or charuco:8x6:28mm by its squares",
    )
    camera.add_argument("--print-board", type=Path, metavar="FILE", help="only write the board: png, pdf or svg")
    camera.add_argument(
        "--model",
        choices=("radial-tangential", "equidistant"),
        default="radial-tangential",
        help="distortion model; equidistant for fisheyes (%(default)s)",
    )
    camera.add_argument(
        "--views", type=_whole(8, 100), default=20, metavar="N", help="how many views to take (%(default)s)"
    )
    imu = add("imu", "the IMU: noise, and its axes from motions it prompts for")
    way = imu.add_mutually_exclusive_group()
    way.add_argument("--by-camera", action="store_true", help="axes by comparing gyro and camera instead")
    way.add_argument("--at-rest", action="store_true", help="only noise, bias and gravity")
    imu.add_argument(
        "--snap",
        type=_number(0.0, 45.0),
        metavar="DEG",
        help="snap axes to exact ones within this angle (15 by motions, 0 by camera)",
    )
    foe = add("foe", "how the camera is mounted, yaw and pitch, from a straight drive")
    clocks = add("time", "the offset between the clocks of camera and IMU, from turning back and forth")
    mask = add("mask", "own parts in view: what never moves while driving, or outlines")
    mask.add_argument(
        "--polygon",
        action="append",
        type=_polygon,
        metavar="X,Y,X,Y,...",
        help="an outline, px of the image, in place of what never moves; may be repeated",
    )
    mask.add_argument("--draw", action="store_true", help="outlines drawn on a page for a browser, on 127.0.0.1")
    mask.add_argument(
        "--port", type=_whole(0, 65535), default=8088, metavar="N", help="of that page (%(default)s; 0: any)"
    )
    for kind, default_s in ((imu, "10 at rest, 20 by camera"), (foe, "20"), (clocks, "20"), (mask, "30")):
        text = f"how long to measure ({default_s}; of a recording: all)"
        kind.add_argument("--seconds", type=_positive, metavar="N", help=text)


def _number(low: float, high: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not low <= number <= high:  # also refuses NaN
            raise argparse.ArgumentTypeError(f"{text}: write a number between {low:g} and {high:g}")
        return number

    return read


def _polygon(text: str) -> list[list[float]]:
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) < 6 or len(numbers) % 2 or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"{text}: write three points and more as X,Y,X,Y,X,Y")
    return [list(point) for point in zip(numbers[::2], numbers[1::2], strict=True)]


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: write a number above 0")
    return number


def _whole(low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"{text}: write a number between {low} and {high}")
        return int(text)

    return read
