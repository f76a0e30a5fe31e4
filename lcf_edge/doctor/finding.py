"""What a check is given, and what it returns."""

import shlex
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import TypeAlias

from drivers.camera.v4l2_ioctl import LINUX, Kernel
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.imu.i2c_bus import I2cBus
from drivers.samples import Frame, ImuSample
from lcf_edge.config import DEFAULT_PATH, Config
from lcf_edge.devices import open_camera, open_imu
from lcf_edge.doctor.daemon import Daemon, ask
from lcf_edge.doctor.program import program
from lcf_edge.errors import ConfigError


class Severity(Enum):
    """How bad it is."""

    OK = "ok"
    WARN = "warn"  # works, but not as well as it could
    FAIL = "fail"  # does not work


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the report. ``remedy``: where one exists, a command to paste."""

    level: Severity
    subject: str
    text: str
    remedy: str = ""


@dataclass(frozen=True)
class Context:
    """What the checks look at; all but the first five describe the machine, and are replaced in tests.

    ``settings``: of ``--set``. ``given``: the keys set by file or settings, as "camera.height_m". ``error``: why the
    configuration is unusable; then ``config`` holds the defaults.
    """

    config: Config
    path: Path = DEFAULT_PATH
    settings: tuple[str, ...] = ()
    given: frozenset[str] = frozenset()
    error: ConfigError | None = None
    dev: Path = Path("/dev")
    sys: Path = Path("/sys")
    proc: Path = Path("/proc")
    kernel: Kernel = LINUX
    open_camera: Callable[[Config, Clock], Device[Frame]] = open_camera
    open_imu: Callable[[Config, Clock], Device[ImuSample] | None] = open_imu
    open_bus: Callable[[int], I2cBus] = I2cBus
    clock: Clock = SYSTEM_CLOCK
    systemctl: Sequence[str] = ("systemctl",)
    installed: Path = DEFAULT_PATH.parent  # folder of the units' configurations
    program: str = field(default_factory=program)  # name of the program in remedies

    @cached_property
    def daemon(self) -> Daemon | None:
        """The daemon that runs on this computer, by its own report; None: none answers."""
        return ask(self.config)

    def again(self, *settings: str) -> str:
        """Return the command that checks again with more settings, as "imu.bus=3"."""
        words = [f"-c {shlex.quote(str(self.path))}"] if self.path != DEFAULT_PATH else []
        words += [f"--set {shlex.quote(setting)}" for setting in (*self.settings, *settings)]
        return " ".join((f"{self.program} doctor", *words)) + ("  # then in the configuration" if settings else "")

    def calibrate(self, what: str) -> str:
        """Return the command that calibrates something and writes it into the configuration.

        The command creates a configuration that does not exist yet, unless another remedy has done so.
        """
        file = shlex.quote(str(self.path))
        sudo = "sudo " if _belongs_to_root(self.path) else ""
        command = f"{sudo}{self.program} calibrate {what} -c {file} --write"
        make = f"test -e {file} || {sudo}install -D -m 644 /dev/null {file}"
        return command if self.path.is_file() else f"{make} && {command}"


Check: TypeAlias = Callable[[Context], Iterator[Finding]]


def ok(subject: str, text: str) -> Finding:
    """Return a finding of something that works."""
    return Finding(Severity.OK, subject, text)


def warn(subject: str, text: str, remedy: str = "") -> Finding:
    """Return a finding of something that works, but not as well as it could."""
    return Finding(Severity.WARN, subject, text, remedy)


def fail(subject: str, text: str, remedy: str = "") -> Finding:
    """Return a finding of something that does not work."""
    return Finding(Severity.FAIL, subject, text, remedy)


def edit(path: Path, comment: str = "") -> str:
    """Return the command that opens a file for editing."""
    file = shlex.quote(str(path))
    command = f"sudoedit {file}" if _belongs_to_root(path) else f"${{EDITOR:-nano}} {file}"
    return f"{command}  # {comment}" if comment else command


def _belongs_to_root(path: Path) -> bool:
    return path.is_relative_to("/etc")


def short(error: Exception) -> str:
    """Return an error's text without the remedy."""
    return str(error).partition("; ")[0]
