"""A virtual machine in qemu that carries out commands; every wait is bounded, nothing is left behind."""

import shutil
import socket
import subprocess
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import msgspec

from hil_mocks.vm.guest.agent import Command, Outcome
from hil_mocks.vm.image import HERE, Image
from lcf_edge.errors import LcfError

BOOTS_S = 600.0
PROBE_S = 10.0
ENDS_S = 30.0
REPLY_S = 20.0  # beyond a command's own time
EMULATED_PATIENCE = 4.0  # times the usual: a busy computer leaves an emulated processor a fraction of its time
ZENOH_PORT = 7447  # in the guest
MEMORY_MIB, PROCESSORS = 1024, 2
KERNEL = "root=/dev/vda ro quiet panic=-1 net.ifnames=0 systemd.show_status=0"  # its command line
EMULATED = "tcg,thread=multi"
FOR_EMULATED = "systemd.default_timeout_start_sec=600"  # as what it starts may get no processor for long


@dataclass(frozen=True, slots=True)
class Board:
    """What qemu makes of a processor: its program, its options with a USB controller, and the console's name there."""

    qemu: str
    options: tuple[str, ...]
    console: str


BOARDS = {
    "x86_64": Board("qemu-system-x86_64", ("-cpu", "max", "-usb"), "ttyS0"),
    "aarch64": Board(
        "qemu-system-aarch64",
        ("-machine", "virt,gic-version=3", "-cpu", "cortex-a72", "-device", "qemu-xhci"),  # a Raspberry Pi 4's cores
        "ttyAMA0",
    ),
}


class MachineError(LcfError):
    """The machine does not do as asked."""


class Machine:
    """Boots ``image``; changes to its disk are forgotten. Leaves its console and journal in ``folder``.

    ``share``: a folder that the guest sees as /mnt. ``endpoint``: where the host reaches the guest's Zenoh. ``imu``:
    the other end of the guest's USB serial port. ``emulated``: whether its processor is. ``patience``: by how much all
    time limits are stretched. Raises ``MachineError``.
    """

    def __init__(self, image: Image, folder: Path) -> None:
        self.folder = folder
        self.share = folder / "share"
        shutil.rmtree(self.share, ignore_errors=True)
        self.share.mkdir(parents=True)
        self.port = _free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._accelerator = _accelerator(image)
        self.emulated = self._accelerator == EMULATED
        self.patience = EMULATED_PATIENCE if self.emulated else 1.0
        self._number, self._read = 0, b""
        self._agent_path, self._imu_path = folder / "agent.sock", folder / "imu.sock"
        with ExitStack() as resources:
            log = resources.enter_context((folder / "qemu.txt").open("wb"))
            self._process = subprocess.Popen(self._command(image), stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            resources.callback(self._process.wait)
            resources.callback(self._process.kill)
            deadline_s = time.monotonic() + BOOTS_S
            self._agent = resources.enter_context(self._connect(self._agent_path, deadline_s))
            self.imu = resources.enter_context(self._connect(self._imu_path, deadline_s))
            self.run("modprobe 9pnet_virtio && mount -t 9p -o trans=virtio,version=9p2000.L share /mnt", BOOTS_S)
            self._resources = resources.pop_all()

    def _command(self, image: Image) -> list[str]:
        board = BOARDS[image.processor]
        return [
            *(board.qemu, "-accel", self._accelerator, *board.options),
            *("-m", str(MEMORY_MIB), "-smp", str(PROCESSORS)),
            *("-display", "none", "-monitor", "none", "-no-reboot", "-serial", f"file:{self.folder / 'console.txt'}"),
            *("-kernel", str(image.kernel), "-initrd", str(image.initrd)),
            *("-append", f"console={board.console} {KERNEL} {FOR_EMULATED if self.emulated else ''}"),
            *("-drive", f"file={image.disk},format=raw,if=virtio,snapshot=on"),
            *("-netdev", f"user,id=net,restrict=on,hostfwd=tcp:127.0.0.1:{self.port}-:{ZENOH_PORT}"),
            *("-device", "virtio-net-pci,netdev=net,romfile="),  # nothing boots from it
            *("-virtfs", f"local,path={self.share},mount_tag=share,security_model=none"),
            *(
                "-device",
                "virtio-serial-pci",
                "-chardev",
                f"socket,id=agent,path={self._agent_path},server=on,wait=off",
            ),
            *("-device", "virtserialport,chardev=agent,name=hil"),
            *("-chardev", f"socket,id=imu,path={self._imu_path},server=on,wait=off"),
            *("-device", "usb-serial,chardev=imu,always-plugged=on"),
        ]

    def run(self, shell: str, timeout_s: float = 60.0) -> str:
        """Run a command as root; what it wrote. Raises ``MachineError`` with that when it fails or takes too long."""
        outcome = self.tried(shell, timeout_s)
        if outcome.status:
            raise MachineError(f"exit status {outcome.status} in the machine: {shell}\n{outcome.output}")
        return outcome.output.rstrip("\n")

    def tried(self, shell: str, timeout_s: float = 60.0) -> Outcome:
        """Run a command as root. Raises ``MachineError`` when the machine does not answer."""
        self._number += 1
        timeout_s *= self.patience
        deadline_s = time.monotonic() + timeout_s + REPLY_S * self.patience
        try:
            self._agent.sendall(msgspec.json.encode(Command(self._number, shell, timeout_s)) + b"\n")
            while True:
                outcome = msgspec.json.decode(self._line(deadline_s), type=Outcome)
                if outcome.number == self._number:  # an earlier one came too late
                    return outcome
        except (OSError, msgspec.DecodeError) as error:
            raise MachineError(f"{shell}: the machine does not answer; {self._said()}") from error

    def _line(self, deadline_s: float) -> bytes:
        """The next line of the agent. Raises ``OSError``."""
        while b"\n" not in self._read:
            self._agent.settimeout(max(deadline_s - time.monotonic(), 0.01))
            came = self._agent.recv(65536)
            if not came:
                raise ConnectionResetError
            self._read += came
        line, _, self._read = self._read.partition(b"\n")
        return line

    def wait_until(self, shell: str, timeout_s: float = 60.0) -> None:
        """Wait until a command succeeds. Raises ``MachineError``."""
        self.run(f"until {{ {shell}; }} >/dev/null 2>&1; do sleep 0.2; done", timeout_s)

    def uptime_s(self) -> float:
        """Since it booted."""
        return float(self.run("cut -d' ' -f1 /proc/uptime"))

    def journal(self, since_s: float = 0.0) -> str:
        """All that was logged since that uptime."""
        lines = self.tried("journalctl -b --no-pager -q -o short-monotonic").output.splitlines()
        return "\n".join(line for line in lines if _logged_s(line) >= since_s)

    def close(self) -> None:
        """Keep the journal, power off."""
        try:
            (self.folder / "journal.txt").write_text(self.journal() + "\n", encoding="utf-8")
            self.tried("systemctl --no-block poweroff")
            self._process.wait(ENDS_S)
        except (MachineError, subprocess.TimeoutExpired):
            pass  # it is ended all the same
        finally:
            self._resources.close()

    def __enter__(self) -> "Machine":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _connect(self, path: Path, deadline_s: float) -> socket.socket:
        """To a socket that qemu makes soon."""
        while self._process.poll() is None and time.monotonic() < deadline_s:
            connection = socket.socket(socket.AF_UNIX)
            try:
                connection.connect(str(path))
            except OSError:
                connection.close()
                time.sleep(0.05)
            else:
                return connection
        raise MachineError(f"the machine does not start; {self._said()}")

    def _said(self) -> str:
        """The last words of qemu and of the console."""
        said = (
            (self.folder / name).read_bytes()[-500:].decode(errors="replace") for name in ("qemu.txt", "console.txt")
        )
        return " | ".join(" ".join(text.split()) for text in said)


def _accelerator(image: Image) -> str:
    """KVM where the kernel runs to its end with it (here: no disk, so it stops and the machine goes), else emulation.

    A nested KVM may set up a processor and then never run it.
    """
    if image.processor != HERE:
        return EMULATED
    bare = ("-display", "none", "-nodefaults", "-monitor", "none", "-no-reboot", "-m", "256")
    boots = ("-kernel", str(image.kernel), "-append", "panic=-1")
    probe = (BOARDS[HERE].qemu, "-accel", "kvm", "-cpu", "max", *bare, *boots)
    try:
        works = (
            subprocess.run(
                probe, check=False, stdin=subprocess.DEVNULL, capture_output=True, timeout=PROBE_S
            ).returncode
            == 0
        )
    except subprocess.TimeoutExpired:
        works = False
    return "kvm" if works else EMULATED


def _logged_s(line: str) -> float:
    """``[   12.345678] rover …``; lines that go on belong to the one before."""
    try:
        return float(line[1 : line.index("]")])
    except ValueError:
        return float("inf")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
