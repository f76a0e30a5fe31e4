"""Run a camera from the command line: the arguments that all kinds of cameras share."""

import argparse
import shlex
import sys
from collections.abc import Callable, Sequence
from typing import Any

from drivers.by_hand import describe_frame, positive, watch
from drivers.device import Device
from drivers.errors import DriverError
from drivers.samples import Frame


def list_command(prog: str) -> str:
    """Return the command that lists cameras of another kind, with the running Python; another may lack the program."""
    return f"{shlex.quote(sys.executable)} -m {prog} --list"


def run(
    argv: Sequence[str] | None,
    prog: str,
    *,
    device: str,
    listed: str,
    list_cameras: Callable[[], int],
    camera: Callable[..., Device[Frame]],
    formats: Sequence[str] | None = None,
    gain: Callable[[str], Any] = float,
) -> int:
    """Open the camera that the arguments name and report on it, or list the cameras present.

    ``device``, ``listed``: help for the device and for ``--list``. ``camera``: opens one. ``formats``: the choices,
    None: any. Return the exit status.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {prog}", description="Run a camera by hand.")
    parser.add_argument("device", nargs="?", default="/dev/video0", help=device)
    parser.add_argument("--list", action="store_true", help=listed)
    parser.add_argument("--width", type=int, default=640, help="px")
    parser.add_argument("--height", type=int, default=480, help="px")
    parser.add_argument("--fps", type=positive, default=30.0, help="frames a second")
    parser.add_argument("--format", choices=formats, default="auto")
    parser.add_argument("--exposure-s", type=positive)
    parser.add_argument("--gain", type=gain)
    parser.add_argument("--power-line-hz", type=int, choices=(0, 50, 60))
    parser.add_argument("--seconds", type=positive, default=10.0)
    arguments = parser.parse_args(argv)
    if arguments.list:
        try:
            return list_cameras()
        except DriverError as error:
            sys.stderr.write(f"{error}\n")
            return 1

    def open_device() -> Device[Frame]:
        return camera(
            arguments.device,
            width=arguments.width,
            height=arguments.height,
            fps=arguments.fps,
            pixel_format=arguments.format,
            exposure_s=arguments.exposure_s,
            gain=arguments.gain,
            power_line_hz=arguments.power_line_hz,
        )

    return watch(open_device, arguments.seconds, describe_frame)
